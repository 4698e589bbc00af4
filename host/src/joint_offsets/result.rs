//! What the offsets are worth, and how many poses are enough.

use nalgebra::DMatrix;

use super::pose::Told;
use super::search::{Method, find};
use super::solve::{Found, merged};
use super::{Pose, Setup};
use crate::fit::{Estimate, Factor, Measured, Noise};

/// Directions below this share of the best known one are rounding.
const ROUNDING: f64 = 1e-9;
/// An offset whose U95 is above this, rad (m of a joint that slides), is not identified: by eye a joint is set better (2°).
pub const COARSEST: f64 = 0.035;
/// Shares of the weakest combination that are told.
const SHARE: f64 = 0.2;
/// Fewest poses: with one, each height is as well the base's.
pub const FEWEST: usize = 2;

/// The offset of one joint: true less measured position.
#[derive(Clone, Debug, PartialEq)]
pub struct Offset {
    /// The joint.
    pub joint: String,
    /// Whether it slides: then numbers are in m, otherwise in rad.
    pub slides: bool,
    /// The offset with its U95, if the poses identify it.
    pub measured: Option<Measured>,
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
    /// The sole with the corner that is farthest off the floor, and by how much, m.
    pub height_off: (String, f64),
}

/// What the first so many poses determine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverPoses {
    /// How many poses, in the file's order, those left out not counted.
    pub poses: usize,
    /// How many offsets they identify.
    pub identified: usize,
    /// Largest U95 of those that all poses identify, rad or m; `None` while one of them is not determined.
    pub worst_u95: Option<f64>,
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
    /// What is left over what the stated noise explains, a ratio of variances; intervals are widened if it is above 1.
    pub variance_ratio: f64,
    /// Degrees of freedom of what is left.
    pub degrees_of_freedom: f64,
    /// The combination of offsets that the poses know worst: 1 σ (infinite if not at all), joints with their shares.
    pub weakest: Option<(f64, Vec<(String, f64)>)>,
    /// What the first poses determine.
    pub over_poses: Vec<OverPoses>,
    /// Root mean square of the attitudes' residuals, rad.
    pub attitude_rms: f64,
    /// Root mean square of the heights' residuals, m.
    pub height_rms: f64,
    /// Steps of the search.
    pub steps: usize,
    /// Whether the search settled.
    pub converged: bool,
}

/// Finds the offsets of poses and what they are worth. An offset whose U95 is above `coarsest`, rad or m, is not identified.
///
/// # Errors
/// Says what is wrong with the poses.
pub fn identify(setup: &Setup, poses: &[Pose], method: Method, coarsest: f64) -> Result<Answer, String> {
    if poses.len() < FEWEST {
        return Err(format!("there are too few poses: {} where at least {FEWEST} are needed", poses.len()));
    }
    if let Some(few) = poses.iter().find(|pose| setup.rows_of(pose) <= super::pose::BASE_COLUMNS) {
        return Err(format!("{}: too few corners stand on the floor to say anything", few.name));
    }
    let found = find(setup, poses, method)?;
    Ok(answer(setup, poses, &found, coarsest))
}

fn answer(setup: &Setup, poses: &[Pose], found: &Found, coarsest: f64) -> Answer {
    let factor = merged(setup, &found.told, &found.weights, &found.state.shared);
    let kept = || found.told.iter().zip(&found.weights).filter(|(_, weight)| **weight > 0.0);
    let squares: f64 = kept().map(|(told, _)| told.squares).sum();
    let counted: f64 = kept().map(|(told, _)| told.degrees_of_freedom).sum();
    let estimate = Estimate::new(&factor, ROUNDING, 1.0, Noise::Given);
    let degrees_of_freedom = (counted - estimate.rank() as f64).max(1.0);
    let variance_ratio = squares / degrees_of_freedom;
    let estimate = Estimate::new(&factor, ROUNDING, variance_ratio.max(1.0), Noise::Given);
    let values = &found.state.shared.offsets;
    let offsets: Vec<Offset> = setup
        .asked
        .iter()
        .zip(values)
        .enumerate()
        .filter_map(|(k, (place, value))| {
            let link = *setup.joints.get(*place)?;
            let measured = estimate.measured(k).map(|own| Measured { value: *value, ..own });
            Some(Offset {
                joint: setup.tree.joint_name(link).to_owned(),
                slides: setup.tree.slides(link),
                measured: measured.filter(|own| own.u95 <= coarsest),
            })
        })
        .collect();
    let known: Vec<usize> =
        (0..offsets.len()).filter(|k| offsets.get(*k).is_some_and(|o| o.measured.is_some())).collect();
    let covariance = DMatrix::from_fn(known.len(), known.len(), |i, j| {
        estimate.covariance(known[i], known[j]).unwrap_or(0.0)
    });
    let over_poses = over_poses(setup, found, &known, variance_ratio.max(1.0), coarsest);
    let (attitude_rms, height_rms) = left(setup, poses, found);
    Answer {
        bad: bad(setup, poses, found),
        weakest: weakest(setup, &factor, variance_ratio.max(1.0)),
        offsets,
        covariance,
        variance_ratio,
        degrees_of_freedom,
        over_poses,
        attitude_rms,
        height_rms,
        steps: found.steps,
        converged: found.converged,
    }
}

/// Returns the combination of offsets that is known worst.
fn weakest(setup: &Setup, factor: &Factor, scale: f64) -> Option<(f64, Vec<(String, f64)>)> {
    let offsets = factor.leading(setup.asked.len());
    let svd = offsets.r().svd(false, true);
    let (at, least) = svd.singular_values.argmin();
    let most = svd.singular_values.max();
    let direction = svd.v_t?.row(at).transpose();
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
fn over_poses(setup: &Setup, found: &Found, known: &[usize], scale: f64, coarsest: f64) -> Vec<OverPoses> {
    let kept: Vec<(&Told, f64)> =
        found.told.iter().zip(&found.weights).filter(|(_, w)| **w > 0.0).map(|(t, w)| (t, *w)).collect();
    let mut counts: Vec<usize> = (0..).map(|k| 3_usize << k).take_while(|n| *n < kept.len()).collect();
    counts.push(kept.len());
    let mut factor = merged(setup, &[], &[], &found.state.shared);
    let (mut out, mut taken) = (Vec::new(), 0);
    for poses in counts {
        for (told, weight) in kept.iter().skip(taken).take(poses - taken) {
            if let Some(own) = &told.factor {
                factor.merge(&own.discount(1.0 / weight));
            }
        }
        taken = poses;
        let estimate = Estimate::new(&factor, ROUNDING, scale, Noise::Given);
        let u95 = |k: usize| estimate.measured(k).map(|own| own.u95);
        let identified = (0..setup.asked.len()).filter(|k| u95(*k).is_some_and(|u| u <= coarsest)).count();
        let worst = known.iter().map(|k| u95(*k)).collect::<Option<Vec<f64>>>();
        let worst_u95 = worst.filter(|all| !all.is_empty()).map(|all| all.into_iter().fold(0.0, f64::max));
        out.push(OverPoses { poses, identified, worst_u95 });
    }
    out
}

/// Returns the root mean squares of the residuals of poses that count, rad and m.
fn left(setup: &Setup, poses: &[Pose], found: &Found) -> (f64, f64) {
    let attitudes = 3 * setup.measured_links.len();
    let (mut squares, mut counts) = ([0.0; 2], [0_usize; 2]);
    for (k, pose) in poses.iter().enumerate().filter(|(k, _)| found.weights.get(*k).is_some_and(|w| *w > 0.0))
    {
        let base = found.state.bases.get(k).copied().unwrap_or_default();
        for (row, value) in setup.rows(pose, &base, &found.state.shared).residual.iter().enumerate() {
            let which = usize::from(row >= attitudes);
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
    for (k, (pose, told)) in poses.iter().zip(&found.told).enumerate() {
        if found.weights.get(k).is_some_and(|weight| *weight > 0.0) {
            continue;
        }
        let base = found.state.bases.get(k).copied().unwrap_or_default();
        let residual = setup.rows(pose, &base, &found.state.shared).residual;
        let mut attitude_off = (String::new(), 0.0);
        for (n, link) in setup.measured_links.iter().enumerate() {
            let off = residual.fixed_rows::<3>(3 * n).norm();
            if off >= attitude_off.1 {
                attitude_off = (setup.tree.link_name(*link).to_owned(), off);
            }
        }
        let mut height_off = (String::new(), 0.0);
        let standing = setup.soles.iter().zip(&pose.stands).filter(|(_, stands)| **stands);
        let corners = standing.flat_map(|(sole, _)| sole.corners_m.iter().map(|_| sole.name.as_str()));
        for (name, off) in corners.zip(residual.iter().skip(3 * setup.measured_links.len())) {
            if off.abs() >= height_off.1 {
                height_off = (name.to_owned(), off.abs());
            }
        }
        let ratio = told.squares / told.degrees_of_freedom.max(1.0);
        out.push(BadPose { name: pose.name.clone(), ratio, attitude_off, height_off });
    }
    out
}
