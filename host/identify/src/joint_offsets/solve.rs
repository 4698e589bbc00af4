//! Steps of Gauss and Newton.
//!
//! Each pose's rows, its base eliminated, are a factor of what all poses share; factors merge, and a step
//! follows. Poses that are off count less (Huber).

use nalgebra::DVector;

use super::pose::{Base, Observed};
use super::shared::Shared;
use super::{Pose, Setup};
use rigident_fit::Factor;
use rigident_fit::parallel::{map, threads};

/// Steps at most.
const STEPS: usize = 60;
/// The search ends with a step below this, rad or m: far below any interval.
const ENOUGH: f64 = 1e-10;
/// A step is halved at most this often.
const HALVINGS: usize = 8;
/// A step may raise the cost by this share: weights and covariances change with the offsets.
const RISE: f64 = 1e-3;
/// A direction of which the poses know less than this, 1 σ in rad or m, is not moved along: no joint is
/// assembled so badly (10°).
pub const HELD: f64 = 0.175;
/// A pose's squares count in full up to this many standard deviations above their mean; beyond, ever less
/// (Huber).
const HUBER: f64 = 3.0;
/// Rounds of leaving poses out, and of weighing before the conjugate gradient begins anew.
pub(super) const ROUNDS: usize = 12;
/// Poses from which on several threads share the work.
const MANY: usize = 64;

/// The state of the search.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// The common parameters of all poses.
    pub shared: Shared,
    /// The base of each pose.
    pub bases: Vec<Base>,
}

/// The end of the search.
#[derive(Clone, Debug)]
pub struct Found {
    /// Offsets and bases.
    pub state: State,
    /// The information of each pose there.
    pub observed: Vec<Observed>,
    /// The weight of each pose, 0 to 1; 0 if it is left out.
    pub weights: Vec<f64>,
    /// Median of the poses' squares over their degrees of freedom, at least 1: by how much the stated noise
    /// is too small.
    pub scale: f64,
    /// Steps that were made.
    pub steps: usize,
    /// Whether the last step was short enough.
    pub converged: bool,
    /// The change of what is shared in the last step, rad or m.
    pub last: Vec<f64>,
}

/// Does a job for each pose, on all cores if there are many.
pub(super) fn for_each<R: Send>(poses: &[Pose], job: impl Fn(usize, &Pose) -> R + Sync) -> Vec<R> {
    let threads = if poses.len() < MANY { 1 } else { threads() };
    let own: Vec<Option<R>> = map(threads, poses.len(), |k| poses.get(k).map(|pose| job(k, pose)));
    own.into_iter().flatten().collect()
}

/// Returns what each pose says about a state.
///
/// # Errors
/// Names a pose whose rows cannot be made.
pub fn observed(setup: &Setup, poses: &[Pose], state: &State) -> Result<Vec<Observed>, String> {
    let all = for_each(poses, |k, pose| {
        let base = state.bases.get(k).copied().unwrap_or_default();
        let rows = setup.rows(pose, &base, &state.shared);
        setup.whitener(&rows).map(|whitener| rows.observed(&whitener)).unwrap_or_default()
    });
    match all.iter().zip(poses).find(|(observed, _)| observed.factor.is_none()) {
        Some((_, pose)) => {
            Err(format!("{}: its rows cannot be weighed: are its numbers possible?", pose.name))
        }
        None => Ok(all),
    }
}

/// Weights of poses about one state.
pub(super) struct Weights {
    /// 0 to 1; they multiply squares.
    pub each: Vec<f64>,
    /// As [`Found::scale`].
    pub scale: f64,
}

/// Returns the square from which on a pose counts less.
fn limit(observed: &Observed, scale: f64) -> f64 {
    scale * (observed.degrees_of_freedom + HUBER * (2.0 * observed.degrees_of_freedom).sqrt())
}

/// Returns how much each pose counts.
pub(super) fn weights(observed: &[Observed], left_out: &[bool]) -> Weights {
    let ratio = |observed: &Observed| observed.squares / observed.degrees_of_freedom.max(1.0);
    let tells = |observed: &&Observed| observed.degrees_of_freedom > 0.0;
    let mut ratios: Vec<f64> = observed.iter().filter(tells).map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let scale = ratios.get(ratios.len() / 2).copied().unwrap_or(1.0).max(1.0);
    let weigh = |(observed, left_out): (&Observed, &bool)| {
        let limit = limit(observed, scale);
        if *left_out {
            0.0
        } else if observed.squares <= limit {
            1.0
        } else {
            (limit / observed.squares).sqrt()
        }
    };
    Weights { each: observed.iter().zip(left_out).map(weigh).collect(), scale }
}

/// Returns the sum of what the poses' squares count.
fn cost(setup: &Setup, observed: &[Observed], left_out: &[bool], scale: f64, shared: &Shared) -> f64 {
    let of = |observed: &Observed| {
        let limit = limit(observed, scale);
        if observed.squares <= limit {
            observed.squares
        } else {
            2.0 * (limit * observed.squares).sqrt() - limit
        }
    };
    let poses: f64 =
        observed.iter().zip(left_out).filter(|(_, out)| !**out).map(|(observed, _)| of(observed)).sum();
    poses + setup.priors(shared).iter().map(|prior| (prior.off / prior.sigma).powi(2)).sum::<f64>()
}

/// Returns the sum of what the poses' squares count, the stated noise being true; what is known beforehand
/// counts too.
pub(super) fn score(setup: &Setup, found: &Found) -> f64 {
    cost(setup, &found.observed, &vec![false; found.observed.len()], 1.0, &found.state.shared)
}

/// Returns the rows of what is known beforehand of what is shared, whitened.
pub(super) fn prior_rows(setup: &Setup, shared: &Shared) -> Vec<(Vec<f64>, f64)> {
    let columns = setup.shared_columns();
    let row = |prior: super::shared::Prior| {
        let mut row = vec![0.0; columns];
        if let Some(to) = row.get_mut(prior.column) {
            *to = 1.0 / prior.sigma;
        }
        (row, -prior.off / prior.sigma)
    };
    setup.priors(shared).into_iter().map(row).collect()
}

/// Returns the factor of what all poses share.
pub fn merged(setup: &Setup, observed: &[Observed], weights: &[f64], shared: &Shared) -> Factor {
    let mut all = Factor::new(setup.shared_columns());
    let prior = prior_rows(setup, shared);
    all.absorb(prior.iter().map(|(row, value)| (row.as_slice(), *value)));
    for (observed, weight) in observed.iter().zip(weights) {
        let Some(own) = observed.factor.as_ref().filter(|_| *weight > 0.0) else { continue };
        if *weight < 1.0 {
            all.merge(&own.discount(1.0 / weight));
        } else {
            all.merge(own);
        }
    }
    all
}

/// Returns the least-squares step along the directions that are known better than [`HELD`].
fn step(factor: &Factor) -> Vec<f64> {
    let svd = factor.r().svd(true, true);
    let mut step = DVector::zeros(factor.parameters());
    let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else { return step.as_slice().to_vec() };
    let z = DVector::from_column_slice(factor.z());
    for (k, s) in svd.singular_values.iter().enumerate() {
        if *s * HELD > 1.0 {
            step += v_t.row(k).transpose() * (u.column(k).dot(&z) / s);
        }
    }
    step.as_slice().to_vec()
}

impl State {
    /// Returns the state after a step of what is shared, the bases following.
    fn moved(&self, setup: &Setup, observed: &[Observed], step: &[f64]) -> Self {
        let bases = self
            .bases
            .iter()
            .zip(observed)
            .map(|(base, observed)| base.moved(&observed.base_step(step)))
            .collect();
        Self { shared: self.shared.moved(setup, step), bases }
    }
}

/// Searches by steps of Gauss and Newton.
///
/// # Errors
/// As [`observed`].
pub(super) fn gauss_newton(
    setup: &Setup,
    poses: &[Pose],
    mut state: State,
    left_out: &[bool],
) -> Result<Found, String> {
    let mut all = observed(setup, poses, &state)?;
    let mut counts = weights(&all, left_out);
    let (mut steps, mut converged) = (0, false);
    let mut last = Vec::new();
    while steps < STEPS && !converged {
        let before = cost(setup, &all, left_out, counts.scale, &state.shared);
        let full = step(&merged(setup, &all, &counts.each, &state.shared));
        let mut share = 1.0;
        for halving in 0..=HALVINGS {
            let part: Vec<f64> = full.iter().map(|v| share * v).collect();
            let next = state.moved(setup, &all, &part);
            let there = observed(setup, poses, &next)?;
            let after = cost(setup, &there, left_out, counts.scale, &next.shared);
            if after <= before * (1.0 + RISE) + f64::EPSILON || halving == HALVINGS {
                (state, all) = (next, there);
                break;
            }
            share *= 0.5;
        }
        counts = weights(&all, left_out);
        steps += 1;
        converged = full.iter().all(|v| v.abs() < ENOUGH);
        last = full;
    }
    Ok(Found { state, observed: all, weights: counts.each, scale: counts.scale, steps, converged, last })
}
