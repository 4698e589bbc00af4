//! A trajectory for a robot: sought, examined once more, made smaller if it must be, and predicted.

use std::sync::atomic::AtomicBool;

use rigident_shared::tree::{Joint, LinkState};

use super::boxes::BodyBox;
use super::collisions::{Apart, Collisions, Nearest};
use super::family::{Family, Series};
use super::information::{Measured, Tree};
use super::limits::JointLimits;
use super::predict::{PredictError, Prediction, predict};
use super::problem::Problem;
use super::resampled::{Resampled, resampled};
use crate::descent::Descent;
use rigident_model::Model;
use rigident_rows::tree::TreeSourceError;

/// Longest trajectory, s, and highest harmonic, Hz, that is planned for: the filter of `identify` takes most
/// off what is faster.
const MOST: [f64; 2] = [3600.0, 5.0];
/// Coefficients beyond which no search ends.
const MOST_COEFFICIENTS: usize = 20_000;
/// Least and most readings per shortest period and in all.
const READINGS: [f64; 2] = [10.0, 1e6];
/// Steps in which a size is found.
const HALVINGS: usize = 12;

/// The planning task.
#[derive(Clone, Debug)]
pub struct Task {
    /// The model without fixed joints; every joint that is left moves.
    pub model: Model,
    /// Limits of the joints, in the order of the model.
    pub limits: Vec<JointLimits>,
    /// The positions where the joints start and end, rad or m.
    pub start: Vec<f64>,
    /// The start was asked for: boxes that touch there are a collision, not too large.
    pub is_start_given: bool,
    /// Length, s: one over the fundamental.
    pub duration_s: f64,
    /// Highest harmonic, Hz.
    pub bandwidth_hz: f64,
    /// The measured quantities and their noise.
    pub measured: Measured,
    /// Boxes round the bodies.
    pub boxes: Vec<BodyBox>,
    /// Pairs of links that are not examined.
    pub skipped: Vec<[String; 2]>,
    /// The parts that stay apart.
    pub apart: Apart,
    /// Seed of the first random beginning.
    pub seed: u64,
    /// Random beginnings.
    pub restarts: usize,
}

/// A trajectory, what it uses and what it tells.
#[derive(Clone, Debug)]
pub struct Excitation {
    /// The trajectory.
    pub series: Series,
    /// Harmonics.
    pub harmonics: usize,
    /// The part of the limits that it uses.
    pub used: Resampled,
    /// The information of a random trajectory of the same kind, as large as limits allow.
    pub before: Prediction,
    /// The information of this one.
    pub after: Prediction,
    /// Pairs of links that touch in a pose that is free, and are not examined.
    pub left_out: Vec<[String; 2]>,
    /// Pairs of boxes that are examined.
    pub pairs: usize,
}

/// The progress of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stage {
    /// The number of searches of the total that have ended; the largest `log det`.
    Search(usize, usize, f64),
    /// Limits on a finer grid.
    Limits,
    /// The factor of its readings.
    Prediction,
}

/// The reason why there is no trajectory.
#[derive(Debug, thiserror::Error)]
pub enum ExcitationError {
    /// Nothing moves.
    #[error("{0} has no joint that moves: nothing can be excited")]
    Still(String),
    /// A joint that no series is made for.
    #[error("joint {name} {why}: hold it with `lock` {name}, at an angle with `lock` {name}=VALUE")]
    Joint {
        /// The joint's name.
        name: String,
        /// The meaning.
        why: String,
    },
    /// A number that makes no sense.
    #[error("{0}")]
    Number(String),
    /// The duration holds too few periods.
    #[error(
        "in {duration_s} s there are {harmonics} whole periods of {bandwidth_hz} Hz, and a motion that \
         begins and ends at rest needs two harmonics: `duration_s` {} at least, or a higher `bandwidth_hz`", 2.0 / bandwidth_hz
    )]
    TooShort {
        /// s
        duration_s: f64,
        /// Hz
        bandwidth_hz: f64,
        /// The number.
        harmonics: usize,
    },
    /// The start is outside the positions that may be used.
    #[error(
        "joint {name} starts at {at:.4}, and {low:.4} to {high:.4} may be used (`range_share` {share} of its \
         range): give another `start` {name}=VALUE"
    )]
    Start {
        /// The joint.
        name: String,
        /// rad or m
        at: f64,
        /// rad or m
        low: f64,
        /// rad or m
        high: f64,
        /// The share of the range.
        share: f64,
    },
    /// Something touches at the start.
    #[error(
        "at the start {} and {} are {:.1} mm apart, {:.1} mm is the least (`clearance_m`): give another \
         `start`, smaller boxes or skip_pairs in `boxes`", between.between[0], between.between[1], 1e3 * between.distance_m, 1e3 * clearance_m
    )]
    Touches {
        /// The quantity.
        between: Nearest,
        /// m
        clearance_m: f64,
    },
    /// A joint cannot hold the robot at the start.
    #[error(
        "joint {name} needs {needed:.3} to hold the robot at its start, and {usable:.3} of its largest \
         effort {effort:.3} may be used (`effort_share`, less dry friction): give another `start`, a larger \
         `effort` {name}=…, or check the masses of the model"
    )]
    Weak {
        /// The joint.
        name: String,
        /// N m or N
        needed: f64,
        /// N m or N
        usable: f64,
        /// N m or N
        effort: f64,
    },
    /// No motion is inside.
    #[error("no motion about the start is inside all limits: give another `start`, or a lower `clearance_m`")]
    NoRoom,
    /// The model has no base parameters.
    #[error(transparent)]
    Model(#[from] TreeSourceError),
    /// The prediction.
    #[error(transparent)]
    Predict(#[from] PredictError),
}

/// Returns the model without fixed joints, if every joint that is left can be moved by a series.
///
/// # Errors
/// [`ExcitationError::Still`] or [`ExcitationError::Joint`].
pub fn movable(model: &Model) -> Result<Model, ExcitationError> {
    let bodies = model.welded();
    if bodies.links.len() < 2 {
        return Err(ExcitationError::Still(model.name.clone()));
    }
    for link in bodies.links.iter().skip(1) {
        let why = match (&link.link.joint, &link.mimic) {
            (Joint::Revolute(_) | Joint::Prismatic(_), None) => continue,
            (_, Some(mimic)) => format!("follows {} and has no motion of its own", mimic.leader),
            _ => "has several freedoms, or none that a series could move".to_owned(),
        };
        return Err(ExcitationError::Joint { name: link.joint_name.clone(), why });
    }
    Ok(bodies)
}

/// Returns the number of harmonics.
fn harmonics(task: &Task) -> Result<usize, ExcitationError> {
    let number = |text: String| Err(ExcitationError::Number(text));
    for (name, value, most) in
        [("`duration_s`", task.duration_s, MOST[0]), ("`bandwidth_hz`", task.bandwidth_hz, MOST[1])]
    {
        if !(value > 0.0 && value <= most) {
            return number(format!("{name} {value}: more than 0, and {most} at most"));
        }
    }
    let (duration_s, bandwidth_hz) = (task.duration_s, task.bandwidth_hz);
    let harmonics = (bandwidth_hz * duration_s * (1.0 + 1e-9)).floor() as usize;
    if harmonics < 2 {
        return Err(ExcitationError::TooShort { duration_s, bandwidth_hz, harmonics });
    }
    let rate_hz = task.measured.rate_hz;
    if !(rate_hz >= READINGS[0] * bandwidth_hz && rate_hz * duration_s <= READINGS[1]) {
        return number(format!(
            "`rate_hz` {rate_hz}: {} times the bandwidth at least, and {} readings at most",
            READINGS[0], READINGS[1]
        ));
    }
    let coefficients = 2 * task.limits.len() * (harmonics - 1);
    if coefficients > MOST_COEFFICIENTS {
        return number(format!(
            "{coefficients} coefficients, {MOST_COEFFICIENTS} at most: a shorter `duration_s`, a lower \
             `bandwidth_hz` or fewer `joints`"
        ));
    }
    if task.restarts == 0 || task.restarts > 1000 {
        return number(format!("`restarts` {}: 1 to 1000", task.restarts));
    }
    Ok(harmonics)
}

/// Plans. `note` receives the progress; `stop` ends the search with the best so far.
///
/// # Errors
/// [`ExcitationError`] says which limit cannot be met, or which number makes no sense.
pub fn plan(
    task: &Task,
    stop: &AtomicBool,
    mut note: impl FnMut(Stage),
) -> Result<Excitation, ExcitationError> {
    let harmonics = harmonics(task)?;
    let joints = task.model.links.len() - 1;
    if [task.limits.len(), task.start.len(), task.measured.effort_noise.len()].iter().any(|n| *n != joints) {
        return Err(ExcitationError::Number(format!(
            "limits, start and noise of {joints} joints are needed"
        )));
    }
    for (limits, at) in task.limits.iter().zip(&task.start) {
        let (middle, half) = limits.room();
        let is_inside = (at - middle).abs() < half;
        if !is_inside {
            let (name, at, share) = (limits.name.clone(), *at, limits.shares.range);
            return Err(ExcitationError::Start { name, at, low: middle - half, high: middle + half, share });
        }
    }
    let tree = Tree::new(&task.model, &task.measured)?;
    let collisions = collisions(task, &tree)?;
    let rates: Vec<f64> = task.limits.iter().map(|limits| rate(limits, task.bandwidth_hz)).collect();
    let problem = Problem {
        tree: &tree,
        family: Family::new(&task.start, task.duration_s, harmonics, &rates),
        limits: &task.limits,
        collisions: &collisions,
        rate_hz: task.measured.rate_hz,
    };
    let seen = |series: &Series| {
        resampled(&tree, &task.limits, &collisions, series, harmonics).filter(|seen| seen.is_kept)
    };
    let begin = problem.begin(task.seed).ok_or(ExcitationError::NoRoom)?;
    let found = problem.search(task.restarts, task.seed, stop, |ended, best| {
        note(Stage::Search(ended, task.restarts, best))
    });
    let best = found.into_iter().next().ok_or(ExcitationError::NoRoom)?;
    note(Stage::Limits);
    let (series, used) =
        largest(&problem.family.series(&best.coefficients), 1.0, &seen).ok_or(ExcitationError::NoRoom)?;
    let (random, _) = largest(&problem.family.series(&begin), 1e3, &seen).ok_or(ExcitationError::NoRoom)?;
    note(Stage::Prediction);
    let rate_hz = task.measured.rate_hz;
    Ok(Excitation {
        before: predict(&tree, &random, rate_hz)?,
        after: predict(&tree, &series, rate_hz)?,
        harmonics,
        series,
        used,
        left_out: collisions.left_out().to_vec(),
        pairs: collisions.pairs(),
    })
}

/// Returns the rate that a series within the limits may have, rad/s or m/s.
fn rate(limits: &JointLimits, bandwidth_hz: f64) -> f64 {
    let (_, half) = limits.room();
    (limits.shares.speed * limits.speed).min(0.5 * std::f64::consts::TAU * bandwidth_hz * half)
}

impl Task {
    /// Returns the pose at zero, or nearest to it within the ranges, rad or m.
    pub(super) fn zero(&self) -> Vec<f64> {
        self.limits.iter().map(|limits| 0.0_f64.clamp(limits.range[0], limits.range[1])).collect()
    }

    /// Returns what must stay apart; boxes that touch in one of the states `free` are left out.
    pub(super) fn collisions(&self, tree: &Tree, free: &[Vec<LinkState<f64>>]) -> Collisions {
        let boxes = (self.boxes.clone(), self.skipped.as_slice());
        Collisions::new(&self.model, tree.paths(), boxes, self.apart, free)
    }
}

/// Returns what must stay apart, if it does at the start, where the joints must hold the robot as well.
fn collisions(task: &Task, tree: &Tree) -> Result<Collisions, ExcitationError> {
    let mut moving = tree.moving();
    let mut at = |positions: &[f64]| tree.at_rest(&mut moving, positions);
    let (start, efforts) = at(&task.start);
    for (needed, limits) in efforts.iter().zip(&task.limits) {
        let usable = limits.usable_effort();
        let holds = needed.abs() < usable;
        if !holds {
            let (name, needed) = (limits.name.clone(), needed.abs());
            return Err(ExcitationError::Weak { name, needed, usable, effort: limits.effort });
        }
    }
    let mut free = vec![at(&task.zero()).0];
    if !task.is_start_given {
        free.push(start.clone());
    }
    let collisions = task.collisions(tree, &free);
    match collisions.nearest(&start).filter(|nearest| nearest.distance_m <= task.apart.clearance_m) {
        Some(between) => Err(ExcitationError::Touches { between, clearance_m: task.apart.clearance_m }),
        None => Ok(collisions),
    }
}

/// Returns the largest size, up to one, at which a trajectory keeps every limit, with what was seen of it.
fn largest(
    series: &Series,
    most: f64,
    seen: &dyn Fn(&Series) -> Option<Resampled>,
) -> Option<(Series, Resampled)> {
    let at = |size: f64| {
        let sized = series.sized(size);
        seen(&sized).map(|seen| (sized, seen))
    };
    let (mut best, mut inside, mut outside) = (None, 0.0, most);
    let mut size = 1.0;
    // Outwards first, where it may grow.
    while let Some(found) = at(size) {
        (best, inside) = (Some(found), size);
        if size >= most {
            return best;
        }
        size = (1.5 * size).min(most);
    }
    outside = size.min(outside);
    for _ in 0..HALVINGS {
        size = 0.5 * (inside + outside);
        match at(size) {
            Some(found) => (best, inside) = (Some(found), size),
            None => outside = size,
        }
    }
    best
}
