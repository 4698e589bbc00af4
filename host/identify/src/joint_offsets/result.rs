//! The quality of the offsets, and the number of poses that are enough.

use nalgebra::DMatrix;
use serde::Serialize;

use super::pose::{Observed, RowOf};
use super::search::{Method, find};
use super::solve::{Found, State, merged};
use super::turns::turn_of;
use super::{Pose, Setup};
use rigident_fit::{Estimate, Factor, Measured, Noise};

/// Directions below this share of the best known one are rounding.
const ROUNDING: f64 = 1e-9;
/// An offset whose U95 is above this is not identified: by eye a joint is set better (2°, 10 mm).
pub const COARSEST: Coarsest = Coarsest { rad: 0.035, m: 0.01 };
/// A joint that moves by less over all poses is at rest, rad (0.6°) and m.
const STILL: Coarsest = Coarsest { rad: 0.01, m: 1e-3 };
/// The last step moves no identified offset by more than this share of its U95. Along what poses do not tell
/// the search may go on for long.
const SETTLED: f64 = 0.05;
/// Shares of the weakest combination that are reported.
const SHARE: f64 = 0.2;
/// Fewest poses: with one, each height is as well the base's.
pub const FEWEST: usize = 2;

/// A limit of joints that turn, and of those that slide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coarsest {
    /// Of joints that turn, rad.
    pub rad: f64,
    /// Of joints that slide, m.
    pub m: f64,
}

impl Coarsest {
    /// Returns the limit of a joint.
    pub fn of(&self, slides: bool) -> f64 {
        if slides { self.m } else { self.rad }
    }
}

/// Why the poses do not identify an offset.
#[derive(Clone, Debug, PartialEq)]
pub struct Open {
    /// The U95 that it would have, rad or m; `None` if the poses say nothing of it.
    pub u95: Option<f64>,
    /// Joints whose offsets act as its own does, the most alike first.
    pub beside: Vec<String>,
}

/// The offset of one joint: true less measured position.
#[derive(Clone, Debug, PartialEq)]
pub struct Offset {
    /// The joint.
    pub joint: String,
    /// Whether it slides: then numbers are in m, otherwise in rad.
    pub slides: bool,
    /// The offset with its U95, if the poses identify it.
    pub measured: Option<Measured>,
    /// Why they do not.
    pub open: Option<Open>,
    /// The distance that the joint moves over the poses that count, rad or m.
    pub moves_by: f64,
}

impl Offset {
    /// Tells whether the joint is at rest in all poses.
    pub fn stands_still(&self) -> bool {
        self.moves_by < STILL.of(self.slides)
    }
}

/// The parameters estimated along with the offsets.
#[derive(Clone, Debug, PartialEq)]
pub struct Along {
    /// The meaning.
    pub name: String,
    /// Whether it is a length, m; otherwise rad.
    pub length: bool,
    /// The value.
    pub measured: Measured,
}

/// A pose that the others contradict.
#[derive(Clone, Debug, PartialEq)]
pub struct BadPose {
    /// Its name.
    pub name: String,
    /// Sum of its whitened squares over their number less the base's.
    pub ratio: f64,
    /// The link whose measured attitude is farthest off, and by how much, rad.
    pub attitude_off: (String, f64),
    /// The contact that is farthest off its plane or place, and by how much, m.
    pub height_off: (String, f64),
}

/// The result of the given number of first poses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OverPoses {
    /// The number of poses, in the file's order, those left out not counted.
    pub poses: usize,
    /// The number of offsets that they identify.
    pub identified: usize,
    /// Largest U95 of joints that turn, of those that all poses identify, rad; `None` while one of them is
    /// not determined or there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_u95: Option<f64>,
    /// Likewise of joints that slide, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_u95_m: Option<f64>,
}

/// The answer.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The offsets, in the order in which they were asked for.
    pub offsets: Vec<Offset>,
    /// Covariance of those that are identified, in their order, rad² (m and rad m where a joint slides).
    pub covariance: DMatrix<f64>,
    /// Poses that were left out.
    pub bad: Vec<BadPose>,
    /// The residuals over what the stated noise explains, a ratio of variances; intervals are widened if it
    /// is above 1.
    pub variance_ratio: f64,
    /// Degrees of freedom of what is left.
    pub degrees_of_freedom: f64,
    /// The combination of offsets that the poses know worst: 1 σ (infinite if not at all), joints with their
    /// shares.
    pub weakest: Option<(f64, Vec<(String, f64)>)>,
    /// The results of the first poses.
    pub over_poses: Vec<OverPoses>,
    /// Root mean square of the attitudes' residuals, rad.
    pub attitude_rms: f64,
    /// Root mean square of the contacts' residuals, m.
    pub height_rms: f64,
    /// The parameters estimated along: the floor's slope, planes, held links, mountings.
    pub along: Vec<Along>,
    /// The end of the search: offsets, identified or not, and the bases of all poses.
    pub state: State,
    /// Whether each pose was left out.
    pub left_out: Vec<bool>,
    /// Steps of the search.
    pub steps: usize,
    /// Whether the search settled: its last step moved no identified offset by more than a twentieth of its
    /// U95.
    pub converged: bool,
}

/// Finds the offsets of poses and what they are worth. An offset whose U95 is above `coarsest` is not
/// identified.
///
/// # Errors
/// Says what is wrong with the poses.
pub fn identify(setup: &Setup, poses: &[Pose], method: Method, coarsest: Coarsest) -> Result<Answer, String> {
    if poses.len() < FEWEST {
        return Err(format!("there are too few poses: {} where at least {FEWEST} are needed", poses.len()));
    }
    if let Some(few) = poses.iter().find(|pose| setup.rows_of(pose) <= setup.base_columns()) {
        return Err(format!("{}: too few corners stand on the floor to say anything", few.name));
    }
    if moves(setup, poses.iter()).iter().all(|by| *by == 0.0) {
        return Err("no joint moves: all poses are the same one".to_owned());
    }
    let found = find(setup, poses, method)?;
    Ok(answer(setup, poses, &found, coarsest))
}

/// Returns how far each joint that counts moves over poses, rad or m.
fn moves<'a>(setup: &Setup, poses: impl Iterator<Item = &'a Pose> + Clone) -> Vec<f64> {
    let of = |k: usize| {
        let values = poses.clone().filter_map(|pose| pose.positions.get(k).copied());
        let ends =
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        (ends[1] - ends[0]).max(0.0)
    };
    (0..setup.joints.len()).map(of).collect()
}

fn answer(setup: &Setup, poses: &[Pose], found: &Found, coarsest: Coarsest) -> Answer {
    let factor = merged(setup, &found.observed, &found.weights, &found.state.shared);
    let kept = || found.observed.iter().zip(&found.weights).filter(|(_, weight)| **weight > 0.0);
    let squares: f64 = kept().map(|(observed, _)| observed.squares).sum();
    let counted: f64 = kept().map(|(observed, _)| observed.degrees_of_freedom).sum();
    let estimate = Estimate::new(&factor, ROUNDING, 1.0, Noise::Given);
    // What a prior tells of a column takes nothing from the rows.
    let of_priors = setup.priors(&found.state.shared).into_iter();
    let by_priors = of_priors
        .filter_map(|prior| Some(estimate.covariance(prior.column, prior.column)? / prior.sigma.powi(2)));
    let by_rows = (estimate.rank() as f64 - by_priors.sum::<f64>()).max(0.0);
    let degrees_of_freedom = (counted - by_rows).max(1.0);
    let variance_ratio = squares / degrees_of_freedom;
    let scale = variance_ratio.max(1.0);
    let estimate = Estimate::new(&factor, ROUNDING, scale, Noise::Given);
    let offsets = offsets(setup, poses, found, (&factor, &estimate), coarsest);
    let moved = offsets.iter().zip(&found.last).filter_map(|(own, by)| Some(by.abs() / own.measured?.u95));
    let settled = found.converged || moved.fold(0.0, f64::max) < SETTLED;
    let known: Vec<usize> =
        (0..offsets.len()).filter(|k| offsets.get(*k).is_some_and(|o| o.measured.is_some())).collect();
    let covariance = DMatrix::from_fn(known.len(), known.len(), |i, j| {
        estimate.covariance(known[i], known[j]).unwrap_or(0.0)
    });
    let over_poses = over_poses(setup, found, &known, scale, coarsest);
    let (attitude_rms, height_rms) = left(setup, poses, found);
    Answer {
        bad: bad(setup, poses, found),
        weakest: weakest(setup, &factor, scale),
        along: along(setup, found, &estimate),
        offsets,
        covariance,
        variance_ratio,
        degrees_of_freedom,
        over_poses,
        attitude_rms,
        height_rms,
        steps: found.steps,
        converged: settled,
        state: found.state.clone(),
        left_out: found.weights.iter().map(|weight| *weight == 0.0).collect(),
    }
}

/// Returns the offsets, with the reason where the poses do not identify one.
fn offsets(
    setup: &Setup,
    poses: &[Pose],
    found: &Found,
    (factor, estimate): (&Factor, &Estimate),
    coarsest: Coarsest,
) -> Vec<Offset> {
    let counting =
        poses.iter().zip(&found.weights).filter(|(_, weight)| **weight > 0.0).map(|(pose, _)| pose);
    let moves = moves(setup, counting);
    let directions = directions(setup, factor);
    let of = |(k, (place, value)): (usize, (&usize, &f64))| {
        let link = *setup.joints.get(*place)?;
        let slides = setup.tree.slides(link);
        let measured = estimate.measured(k).map(|own| Measured { value: *value, ..own });
        let fine = measured.filter(|own| own.u95 <= coarsest.of(slides));
        let open = fine.is_none().then(|| {
            let largest = directions.iter().map(|(least, _)| least).fold(0.0_f64, |most, s| most.max(*s));
            let own = |(least, parts): &(f64, Vec<f64>)| {
                parts.get(k).map_or(0.0, |part| part / least.max(ROUNDING * largest.max(1e-300))).abs()
            };
            let most = directions.iter().max_by(|a, b| own(a).total_cmp(&own(b)));
            let mut beside: Vec<(f64, &str)> = most
                .into_iter()
                .flat_map(|(_, parts)| parts.iter().zip(setup.asked_names()).enumerate())
                .filter(|(other, (part, _))| *other != k && part.abs() >= SHARE)
                .map(|(_, (part, name))| (part.abs(), name))
                .collect();
            beside.sort_by(|a, b| b.0.total_cmp(&a.0));
            Open {
                u95: measured.map(|own| own.u95),
                beside: beside.into_iter().map(|(_, name)| name.to_owned()).collect(),
            }
        });
        let moves_by = moves.get(*place).copied().unwrap_or(0.0);
        Some(Offset { joint: setup.tree.joint_name(link).to_owned(), slides, measured: fine, open, moves_by })
    };
    setup.asked.iter().zip(&found.state.shared.offsets).enumerate().filter_map(of).collect()
}

/// Returns the directions of the offsets with what the poses know of each, 1/σ.
fn directions(setup: &Setup, factor: &Factor) -> Vec<(f64, Vec<f64>)> {
    let svd = factor.leading(setup.asked.len()).r().svd(false, true);
    let Some(v_t) = &svd.v_t else { return Vec::new() };
    let of = |(k, s): (usize, &f64)| (*s, v_t.row(k).iter().copied().collect());
    svd.singular_values.iter().enumerate().map(of).collect()
}

/// Returns what was estimated along.
fn along(setup: &Setup, found: &Found, estimate: &Estimate) -> Vec<Along> {
    let shared = &found.state.shared;
    let mut out = Vec::new();
    let mut add = |name: String, length: bool, column: usize, value: f64| {
        let own = estimate.measured(column).map(|own| Measured { value, ..own });
        out.extend(own.map(|measured| Along { name, length, measured }));
    };
    for (n, plane) in setup.contacts.planes.iter().enumerate() {
        let (Some(at), columns) = (shared.planes.get(n), setup.plane_columns(n)) else { continue };
        let axes = if n == 0 { ["x", "y"] } else { ["its first axis", "its second axis"] };
        for k in 0..2 {
            if let Some(tilt) = columns.tilt {
                add(format!("slope of {} about {}", plane.name, axes[k]), false, tilt + k, at.tilt_rad[k]);
            }
        }
        if let Some(column) = columns.distance {
            add(format!("distance of {}", plane.name), true, column, at.distance_m);
        }
    }
    for (n, (link, mounting)) in setup.measured_links.iter().zip(&shared.mountings).enumerate() {
        let Some(first) = setup.mounting_column(n) else { continue };
        let turn = turn_of(mounting);
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let name = format!("mounting of the IMU on {} about {axis}", setup.tree.link_name(*link));
            add(name, false, first + k, turn[k]);
        }
    }
    out
}

/// Returns the combination of offsets that is known worst.
fn weakest(setup: &Setup, factor: &Factor, scale: f64) -> Option<(f64, Vec<(String, f64)>)> {
    let directions = directions(setup, factor);
    let most = directions.iter().map(|(known, _)| *known).fold(0.0, f64::max);
    let (least, direction) = directions.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let sigma = if least > ROUNDING * most { scale.sqrt() / least } else { f64::INFINITY };
    let named = setup.asked_names();
    let shares = named.iter().zip(direction.iter()).filter(|(_, share)| share.abs() >= SHARE);
    let mut shares: Vec<(String, f64)> = shares.map(|(name, share)| ((*name).to_owned(), *share)).collect();
    // The sign of a direction has no meaning: the largest share is positive.
    shares.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let sign = shares.first().map_or(1.0, |(_, share)| share.signum());
    shares.iter_mut().for_each(|(_, share)| *share *= sign);
    Some((sigma, shares))
}

/// Returns what more and more of the poses determine, about the offsets that all of them gave.
fn over_poses(
    setup: &Setup,
    found: &Found,
    known: &[usize],
    scale: f64,
    coarsest: Coarsest,
) -> Vec<OverPoses> {
    let kept: Vec<(&Observed, f64)> =
        found.observed.iter().zip(&found.weights).filter(|(_, w)| **w > 0.0).map(|(t, w)| (t, *w)).collect();
    let mut counts: Vec<usize> = (0..).map(|k| 3_usize << k).take_while(|n| *n < kept.len()).collect();
    counts.push(kept.len());
    let mut factor = merged(setup, &[], &[], &found.state.shared);
    let (mut out, mut taken) = (Vec::new(), 0);
    for poses in counts {
        for (observed, weight) in kept.iter().skip(taken).take(poses - taken) {
            if let Some(own) = &observed.factor {
                factor.merge(&own.discount(1.0 / weight));
            }
        }
        taken = poses;
        let estimate = Estimate::new(&factor, ROUNDING, scale, Noise::Given);
        let u95 = |k: usize| estimate.measured(k).map(|own| own.u95);
        let slides = |k: usize| {
            setup
                .asked
                .get(k)
                .and_then(|at| setup.joints.get(*at))
                .is_some_and(|link| setup.tree.slides(*link))
        };
        let fine = |k: &usize| u95(*k).is_some_and(|u| u <= coarsest.of(slides(*k)));
        let identified = (0..setup.asked.len()).filter(fine).count();
        let worst = |of_sliding: bool| {
            let own = known.iter().filter(|k| slides(**k) == of_sliding).map(|k| u95(*k));
            let all = own.collect::<Option<Vec<f64>>>().filter(|all| !all.is_empty());
            all.map(|all| all.into_iter().fold(0.0, f64::max))
        };
        out.push(OverPoses { poses, identified, worst_u95: worst(false), worst_u95_m: worst(true) });
    }
    out
}

/// Returns the root mean squares of the residuals of poses that count, rad and m.
fn left(setup: &Setup, poses: &[Pose], found: &Found) -> (f64, f64) {
    let (mut squares, mut counts) = ([0.0; 2], [0_usize; 2]);
    for (k, pose) in poses.iter().enumerate().filter(|(k, _)| found.weights.get(*k).is_some_and(|w| *w > 0.0))
    {
        let base = found.state.bases.get(k).copied().unwrap_or_default();
        let rows = setup.rows(pose, &base, &found.state.shared);
        for (of, value) in rows.of.iter().zip(rows.residual.iter()) {
            let which = match of {
                RowOf::Attitude(_) | RowOf::Turn(_) => 0,
                RowOf::Contact(_) => 1,
                RowOf::Kept => continue,
            };
            squares[which] += value * value;
            counts[which] += 1;
        }
    }
    // Of attitudes the turn as a whole.
    let turns = counts[0].max(3) / 3;
    ((squares[0] / turns as f64).sqrt(), (squares[1] / counts[1].max(1) as f64).sqrt())
}

/// Returns the poses that were left out, with what is off in each.
fn bad(setup: &Setup, poses: &[Pose], found: &Found) -> Vec<BadPose> {
    let mut out = Vec::new();
    for (k, (pose, observed)) in poses.iter().zip(&found.observed).enumerate() {
        if found.weights.get(k).is_some_and(|weight| *weight > 0.0) {
            continue;
        }
        let base = found.state.bases.get(k).copied().unwrap_or_default();
        let rows = setup.rows(pose, &base, &found.state.shared);
        let mut turns = vec![0.0; setup.measured_links.len()];
        let mut height_off = (String::new(), 0.0);
        for (of, off) in rows.of.iter().zip(rows.residual.iter()) {
            match of {
                RowOf::Attitude(n) => turns.iter_mut().skip(*n).take(1).for_each(|sum| *sum += off * off),
                RowOf::Contact(n) if off.abs() >= height_off.1 => {
                    height_off = (setup.contacts.names().nth(*n).unwrap_or("").to_owned(), off.abs());
                }
                _ => {}
            }
        }
        let most = turns.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let attitude_off = most.map_or((String::new(), 0.0), |(n, squares)| {
            let link = setup.measured_links.get(n).map_or("", |link| setup.tree.link_name(*link));
            (link.to_owned(), f64::sqrt(*squares))
        });
        let ratio = observed.squares / observed.degrees_of_freedom.max(1.0);
        out.push(BadPose { name: pose.name.clone(), ratio, attitude_off, height_off });
    }
    out
}
