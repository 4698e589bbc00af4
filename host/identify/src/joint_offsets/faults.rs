//! The fault that explains poses that contradict each other.
//!
//! Each fault that can be thought of is undone, one at a time, and the offsets are found again. One that
//! makes what is left this much smaller that chance does not is named. Faults of which each reading is either
//! right or wrong (axes, signs, units, names) are compared by their squares; those with a size (a floor that
//! leans, a step, an IMU that is mounted askew) are estimated along, without what is known of them
//! beforehand, and named if they are far from zero and from what is stated.

use std::fmt;

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, UnitQuaternion, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::result::Answer;
use super::search::{beginning, fitted};
use super::shared::Shared;
use super::solve::{Found, merged, score};
use super::turns::turn_of;
use super::{Plane, Pose, Setup};
use rigident_fit::parallel::{map, threads};
use rigident_fit::{COVERAGE_95, Estimate, Noise};

/// Poses from which faults are searched for; of more, as many that are spread over all.
const POSES: usize = 120;
/// Poses by which all faults are examined.
const GLANCED: usize = 16;
/// Faults that are tried in full: those that appear best with offsets at zero.
const TRIED: usize = 6;
/// Steps of a base when a fault is examined.
const BASE_STEPS: usize = 4;
/// The size of offsets when a fault is tested, 1 σ, rad (3°) and m.
const OFFSETS: (f64, f64) = (0.052, 0.02);
/// A fault explains the poses if it takes off this much more of the squares than what is left explains.
const BETTER: f64 = 30.0;
/// Faults of which the squares differ by less are not distinguished.
const ALIKE: f64 = 10.0;
/// Squares are more than the noise explains by this many standard deviations: then faults without a size are
/// searched for.
const SUSPICIOUS: f64 = 4.0;
/// Probability that a size of zero is called a fault.
const CHANCE: f64 = 1e-3;
/// 1 σ of a size that is searched for, rad (10°).
const WIDE_RAD: f64 = 0.175;
/// An offset above this, rad, is none (30°).
const LARGEST_RAD: f64 = 0.52;
/// With more left than this, a ratio of variances, nothing is believed: noise twice what is stated.
const NOT_NOISE: f64 = 4.0;
/// Directions below this share of the best known one are rounding.
const ROUNDING: f64 = 1e-9;

/// The explanation of poses that contradict each other.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The axes of an IMU are turned by right angles.
    Axes {
        /// Its link.
        link: String,
        /// Link axes ← axes of the IMU.
        rotation: UnitQuaternion<f64>,
        /// Whether its attitudes are the other way round: they take world axes to the link's.
        inverse: bool,
    },
    /// A joint counts the other way.
    Sign(String),
    /// The angles of all joints are in degrees.
    Degrees,
    /// The column of a joint is to be multiplied: by π/180 if it is in degrees, by a half or by two if a gear
    /// is not counted.
    Scaled(String, f64),
    /// The columns of two joints are exchanged.
    Joints([String; 2]),
    /// The corners of two soles are exchanged.
    Corners([String; 2]),
    /// The names of two soles are exchanged in the column `contact`.
    Names([String; 2]),
    /// The floor leans: about x and y, rad, and the U95 of the larger.
    Floor([f64; 2], f64),
    /// A sole is higher than the others: by how much, m, and its U95.
    Step(String, f64, f64),
    /// An IMU is mounted askew: link, turn, rad, and its largest U95.
    Mounting(String, [f64; 3], f64),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let degrees = |v: &f64| format!("{:.1}°", v.to_degrees());
        match self {
            Self::Axes { link, rotation, inverse } => {
                let q = rotation;
                let turned = q.angle() > 1e-6;
                if *inverse {
                    write!(
                        f,
                        "the attitudes of {link} are the other way round: give their conjugates, link axes \
                         to world axes"
                    )?;
                } else {
                    write!(f, "the axes of the IMU on {link} are not the link's")?;
                }
                if turned {
                    let [w, x, y, z] = [q.w, q.i, q.j, q.k].map(|v| if v.abs() < 1e-9 { 0.0 } else { v });
                    write!(
                        f,
                        "; write rotation_wxyz = [{w:.6}, {x:.6}, {y:.6}, {z:.6}] into [[imu]] of {link}"
                    )?;
                }
                Ok(())
            }
            Self::Sign(joint) => {
                write!(
                    f,
                    "{joint} counts the other way than the model's joint: change the sign of its column"
                )
            }
            Self::Degrees => write!(f, "the columns of joints are in degrees"),
            Self::Scaled(joint, by) if *by < 0.1 => write!(f, "the column of {joint} is in degrees"),
            Self::Scaled(joint, by) => {
                write!(
                    f,
                    "the column of {joint} is to be multiplied by {by}: is it on the other side of a gear?"
                )
            }
            Self::Joints([a, b]) => write!(f, "the columns of {a} and {b} are exchanged"),
            Self::Corners([a, b]) => write!(f, "the corners of the soles {a} and {b} are exchanged"),
            Self::Names([a, b]) => write!(f, "{a} and {b} are exchanged in the column contact"),
            Self::Floor([x, y], u95) => write!(
                f,
                "the floor leans by {} about x and {} about y of the attitudes' axes (± {}): level it, or \
                 say by `floor_noise_deg` how far it may lean",
                degrees(x),
                degrees(y),
                degrees(u95)
            ),
            Self::Step(sole, by, u95) => write!(
                f,
                "the sole {sole} stands {:.1} mm {} than the rest (± {:.1} mm): is it on a step? Give it a \
                 [[plane]] of its own, or correct its corners",
                1e3 * by.abs(),
                if *by > 0.0 { "higher" } else { "lower" },
                1e3 * u95
            ),
            Self::Mounting(link, [x, y, z], u95) => write!(
                f,
                "the IMU on {link} is turned on its link by {}, {}, {} about x, y, z (up to ± {}): correct \
                 its rotation_wxyz in [[imu]], or say by `mounting_noise_deg` how far it may be off",
                degrees(x),
                degrees(y),
                degrees(z),
                degrees(u95)
            ),
        }
    }
}

/// Why the answer of poses is not to be believed.
#[derive(Clone, Debug, PartialEq)]
pub enum Contradiction {
    /// They contradict the model unless there is one of these faults, the likeliest first.
    Faults(Vec<Fault>),
    /// The offset of a joint is too large to be one, rad.
    TooLarge(String, f64),
    /// The residuals are not the stated noise, and no single fault explains it.
    NotNoise {
        /// The residuals over what the noise explains, a ratio of variances.
        ratio: f64,
        /// Root mean square of the attitudes' residuals, rad.
        attitude_rms: f64,
        /// Root mean square of the contacts' residuals, m.
        height_rms: f64,
    },
}

/// Returns why the answer of poses is not to be believed; `None` if it is.
///
/// # Errors
/// As [`super::search::find`].
pub fn contradiction(
    setup: &Setup,
    poses: &[Pose],
    answer: &Answer,
) -> Result<Option<Contradiction>, String> {
    let found = faults(setup, poses, answer)?;
    Ok(if !found.is_empty() {
        Some(Contradiction::Faults(found))
    } else if let Some((joint, offset)) = too_large(setup, answer) {
        Some(Contradiction::TooLarge(joint, offset))
    } else {
        let Answer { variance_ratio: ratio, attitude_rms, height_rms, .. } = *answer;
        (ratio > NOT_NOISE).then_some(Contradiction::NotNoise { ratio, attitude_rms, height_rms })
    })
}

/// Returns what may be wrong with poses that were answered for: nothing, or the faults that explain them
/// best, the likeliest first.
///
/// # Errors
/// As [`super::search::find`].
fn faults(setup: &Setup, poses: &[Pose], answer: &Answer) -> Result<Vec<Fault>, String> {
    let every = poses.len().div_ceil(POSES).max(1);
    let some: Vec<Pose> = poses.iter().step_by(every).cloned().collect();
    let plain = fitted(setup, &some)?;
    let before = score(setup, &plain);
    let freedom: f64 = plain.observed.iter().map(|observed| observed.degrees_of_freedom).sum();
    let mut named: Vec<(f64, Fault)> = Vec::new();
    let too_large = answer.state.shared.offsets.iter().any(|offset| offset.abs() > LARGEST_RAD);
    let too_much = before > freedom + SUSPICIOUS * (2.0 * freedom).sqrt();
    if too_large || too_much || !answer.bad.is_empty() {
        for fault in likeliest(setup, &some) {
            let (other, undone) = fault.undone(setup, &some);
            let after = score(&other, &fitted(&other, &undone)?);
            let scale = (after / freedom.max(1.0)).max(1.0);
            if before - after > BETTER * scale {
                named.push((after / scale, fault));
            }
        }
    }
    for (other, fault) in sizes(setup) {
        let found = fitted(&other, &some)?;
        let after = score(&other, &found);
        let scale = (after / freedom.max(1.0)).max(1.0);
        if let Some(fault) = sized(setup, (&other, &found, scale), fault) {
            named.push((after / scale, fault));
        }
    }
    named.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = named.first().map_or(0.0, |(after, _)| *after);
    Ok(named.into_iter().take_while(|(after, _)| after - best < ALIKE).map(|(_, fault)| fault).collect())
}

/// Returns the joint whose offset is too large to be one, with that, rad.
fn too_large(setup: &Setup, answer: &Answer) -> Option<(String, f64)> {
    let all = setup.asked_names().into_iter().zip(&answer.state.shared.offsets).zip(&answer.offsets);
    all.filter(|((_, offset), own)| !own.slides && offset.abs() > LARGEST_RAD)
        .max_by(|a, b| a.0.1.abs().total_cmp(&b.0.1.abs()))
        .map(|((name, offset), _)| (name.to_owned(), *offset))
}

/// Returns the 24 turns that take axes to axes.
pub fn right_angles() -> Vec<Rotation3<f64>> {
    let mut out = Vec::with_capacity(24);
    let axes: Vec<Vector3<f64>> =
        (0..3).flat_map(|k| [Vector3::ith(k, 1.0), Vector3::ith(k, -1.0)]).collect();
    for x in &axes {
        for y in axes.iter().filter(|y| x.dot(y) == 0.0) {
            out.push(Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[*x, *y, x.cross(y)])));
        }
    }
    out
}

/// Returns all faults without a size.
fn all(setup: &Setup) -> Vec<Fault> {
    let mut out = vec![Fault::Degrees];
    for link in &setup.measured_links {
        for inverse in [false, true] {
            for turn in right_angles() {
                let rotation = UnitQuaternion::from_rotation_matrix(&turn);
                if inverse || rotation.angle() > 1e-6 {
                    out.push(Fault::Axes { link: setup.tree.link_name(*link).to_owned(), rotation, inverse });
                }
            }
        }
    }
    let names: Vec<String> =
        setup.joints.iter().map(|link| setup.tree.joint_name(*link).to_owned()).collect();
    for (k, (name, link)) in names.iter().zip(&setup.joints).enumerate() {
        out.push(Fault::Sign(name.clone()));
        let degrees = (!setup.tree.slides(*link)).then_some(1_f64.to_radians());
        let scales = degrees.into_iter().chain([0.5, 2.0]);
        out.extend(scales.map(|by| Fault::Scaled(name.clone(), by)));
        out.extend(names.iter().skip(k + 1).map(|other| Fault::Joints([name.clone(), other.clone()])));
    }
    let soles = &setup.contacts.soles;
    for (k, one) in soles.iter().enumerate() {
        for other in soles.iter().skip(k + 1) {
            out.push(Fault::Corners([one.name.clone(), other.name.clone()]));
            out.push(Fault::Names([one.name.clone(), other.name.clone()]));
        }
    }
    out
}

/// Returns the faults without a size that appear best with the offsets at zero.
fn likeliest(setup: &Setup, poses: &[Pose]) -> Vec<Fault> {
    let some: Vec<Pose> = poses.iter().step_by(poses.len().div_ceil(GLANCED).max(1)).cloned().collect();
    let all = all(setup);
    let left = map(threads(), all.len(), |k| all.get(k).map_or(f64::INFINITY, |f| glance(f, setup, &some)));
    let mut all: Vec<(f64, Fault)> = left.into_iter().zip(all).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().take(TRIED).map(|(_, fault)| fault).collect()
}

/// Returns what is left with a fault undone, offsets being zero to some degrees.
fn glance(fault: &Fault, setup: &Setup, poses: &[Pose]) -> f64 {
    let (mut setup, poses) = fault.undone(setup, poses);
    (setup.noise.encoder_rad, setup.noise.slide_m) = OFFSETS;
    let mut state = beginning(&setup, &poses);
    let shared: Shared = state.shared.clone();
    let mut sum = 0.0;
    for (pose, base) in poses.iter().zip(&mut state.bases) {
        let mut left = f64::INFINITY;
        for _ in 0..BASE_STEPS {
            let rows = setup.rows(pose, base, &shared);
            let Some(whitener) = setup.whitener(&rows) else { return f64::INFINITY };
            let observed = rows.observed(&whitener);
            left = observed.squares;
            *base = base.moved(&observed.base_step(&[]));
        }
        // One bad pose is none of a fault's.
        sum += left.sqrt();
    }
    if sum.is_finite() { sum } else { f64::INFINITY }
}

impl Fault {
    /// Returns setup and poses with the fault undone.
    fn undone(&self, setup: &Setup, poses: &[Pose]) -> (Setup, Vec<Pose>) {
        let (mut setup, mut poses) = (setup.clone(), poses.to_vec());
        let joint = |setup: &Setup, name: &str| {
            setup.joints.iter().position(|link| setup.tree.joint_name(*link) == name)
        };
        let sole = |setup: &Setup, name: &str| setup.contacts.soles.iter().position(|sole| sole.name == name);
        match self {
            Self::Axes { link, rotation, inverse } => {
                let of = setup.measured_links.iter().position(|own| setup.tree.link_name(*own) == link);
                for read in poses.iter_mut().filter_map(|pose| pose.attitudes.get_mut(of?)) {
                    let way = if *inverse { read.inverse() } else { *read };
                    *read = way * rotation.inverse();
                }
            }
            Self::Sign(name) => {
                let of = joint(&setup, name);
                poses.iter_mut().filter_map(|pose| pose.positions.get_mut(of?)).for_each(|q| *q = -*q);
            }
            Self::Scaled(name, by) => {
                let of = joint(&setup, name);
                poses.iter_mut().filter_map(|pose| pose.positions.get_mut(of?)).for_each(|q| *q *= by);
            }
            Self::Degrees => {
                for pose in &mut poses {
                    for (q, link) in pose.positions.iter_mut().zip(&setup.joints) {
                        if !setup.tree.slides(*link) {
                            *q = q.to_radians();
                        }
                    }
                }
            }
            Self::Joints([a, b]) => {
                if let (Some(a), Some(b)) = (joint(&setup, a), joint(&setup, b)) {
                    poses.iter_mut().for_each(|pose| pose.positions.swap(a, b));
                }
            }
            Self::Corners([a, b]) => {
                if let (Some(a), Some(b)) = (sole(&setup, a), sole(&setup, b)) {
                    let corners = setup.contacts.soles[a].corners_m.clone();
                    setup.contacts.soles[a].corners_m = setup.contacts.soles[b].corners_m.clone();
                    setup.contacts.soles[b].corners_m = corners;
                }
            }
            Self::Names([a, b]) => {
                if let (Some(a), Some(b)) = (sole(&setup, a), sole(&setup, b)) {
                    poses.iter_mut().for_each(|pose| pose.stands.swap(a, b));
                }
            }
            Self::Floor(..) | Self::Step(..) | Self::Mounting(..) => {}
        }
        (setup, poses)
    }
}

/// Returns the faults with a size, each with the setup in which it is estimated along.
fn sizes(setup: &Setup) -> Vec<(Setup, Fault)> {
    let mut out = Vec::new();
    let mut leaning = setup.clone();
    if let Some(floor) = leaning.contacts.planes.first_mut() {
        floor.tilt_rad = WIDE_RAD;
        out.push((leaning, Fault::Floor([0.0; 2], 0.0)));
    }
    let on_floor: Vec<usize> =
        (0..setup.contacts.soles.len()).filter(|k| setup.contacts.soles[*k].plane == 0).collect();
    for k in on_floor.iter().copied().filter(|_| on_floor.len() > 1) {
        let mut stepped = setup.clone();
        let name = setup.contacts.soles[k].name.clone();
        stepped.contacts.soles[k].plane = stepped.contacts.planes.len();
        stepped.contacts.planes.push(Plane {
            name: name.clone(),
            normal: Vector3::z(),
            tilt_rad: 0.0,
            at_origin: false,
        });
        out.push((stepped, Fault::Step(name, 0.0, 0.0)));
        // Of two soles one is as much higher as the other is lower.
        if on_floor.len() == 2 {
            break;
        }
    }
    let mut askew = setup.clone();
    askew.noise.mounting_rad = WIDE_RAD;
    for link in &setup.measured_links {
        out.push((askew.clone(), Fault::Mounting(setup.tree.link_name(*link).to_owned(), [0.0; 3], 0.0)));
    }
    out
}

/// Returns a fault with its size if that is far from zero and from what is stated of it.
fn sized(setup: &Setup, (other, found, scale): (&Setup, &Found, f64), fault: Fault) -> Option<Fault> {
    let factor = merged(other, &found.observed, &found.weights, &found.state.shared);
    let estimate = Estimate::new(&factor, ROUNDING, scale, Noise::Given);
    let shared = &found.state.shared;
    let (columns, values, stated): (Vec<usize>, Vec<f64>, f64) = match &fault {
        Fault::Floor(..) => {
            let first = other.plane_columns(0).tilt?;
            (vec![first, first + 1], shared.planes.first()?.tilt_rad.to_vec(), setup.noise.floor_rad)
        }
        Fault::Step(..) => {
            let last = other.contacts.planes.len().checked_sub(1)?;
            (vec![other.plane_columns(last).distance?], vec![shared.planes.get(last)?.distance_m], 0.0)
        }
        Fault::Mounting(link, ..) => {
            let n = other.measured_links.iter().position(|own| other.tree.link_name(*own) == link)?;
            let first = other.mounting_column(n)?;
            let turn = turn_of(shared.mountings.get(n)?);
            (vec![first, first + 1, first + 2], turn.iter().copied().collect(), setup.noise.mounting_rad)
        }
        _ => return None,
    };
    let count = columns.len();
    let mut covariance = DMatrix::zeros(count, count);
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            covariance[(i, j)] = estimate.covariance(*a, *b)?;
        }
        covariance[(i, i)] += stated * stated;
    }
    let u95 = COVERAGE_95 * (0..count).map(|k| covariance[(k, k)].sqrt()).fold(0.0, f64::max);
    let vector = DVector::from_column_slice(&values);
    let squares = vector.dot(&covariance.cholesky()?.solve(&vector));
    if squares < ChiSquared::new(count as f64).ok()?.inverse_cdf(1.0 - CHANCE) {
        return None;
    }
    Some(match (fault, values.as_slice()) {
        (Fault::Floor(..), [x, y]) => Fault::Floor([*x, *y], u95),
        (Fault::Step(name, ..), [by]) => Fault::Step(name, *by, u95),
        (Fault::Mounting(link, ..), [x, y, z]) => Fault::Mounting(link, [*x, *y, *z], u95),
        _ => return None,
    })
}
