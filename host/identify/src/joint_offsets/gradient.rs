//! The paper's conjugate gradient, beside the steps of Gauss and Newton.
//!
//! The bases of the poses are at their best for every offset that is tried, so that the gradient of what is
//! shared is that of the whole (`∂F/∂δ = −Aᵀ r`). Weights and covariances of the poses stay for a round and
//! are then made anew, until nothing moves.

use nalgebra::{Cholesky, DVector, Dyn};

use super::pose::Observed;
use super::solve::{Found, ROUNDS, State, Weights, for_each, merged, observed, prior_rows, weights};
use super::{Pose, Setup};

/// Directions of one round at most.
const DIRECTIONS: usize = 2000;
/// A round ends with a gradient, per standard deviation of each column by itself, below this.
const FLAT: f64 = 1e-9;
/// Nothing moves any more: a round changed every offset by less, rad or m.
const STILL: f64 = 1e-10;
/// Steps of a pose's base to its best.
const BASE_STEPS: usize = 8;
/// A base is at its best with a step below this, rad and m.
const BASE_ENOUGH: f64 = 1e-13;
/// Secant steps along one direction.
const SECANTS: usize = 4;
/// A slope along the direction below this share of the first ends its search.
const LEVEL: f64 = 1e-3;

/// The data that stay for a round.
struct Round<'a> {
    setup: &'a Setup,
    poses: &'a [Pose],
    whiteners: Vec<Cholesky<f64, Dyn>>,
    weights: Weights,
    /// Standard deviation of each column by itself.
    scale: DVector<f64>,
}

/// A point with its gradient in scaled columns.
#[derive(Clone)]
struct Point {
    state: State,
    gradient: DVector<f64>,
}

impl Round<'_> {
    /// Puts the bases at their best and returns the gradient there.
    fn at(&self, state: State) -> Point {
        let own = for_each(self.poses, |k, pose| {
            let mut base = state.bases.get(k).copied().unwrap_or_default();
            let mut last = Observed::default();
            for _ in 0..BASE_STEPS {
                let Some(whitener) = self.whiteners.get(k) else { break };
                last = self.setup.rows(pose, &base, &state.shared).observed(whitener);
                let step = last.base_step(&[]);
                base = base.moved(&step);
                if step.iter().all(|v| v.abs() < BASE_ENOUGH) {
                    break;
                }
            }
            (base, last)
        });
        let mut gradient = DVector::zeros(self.scale.len());
        for (row, value) in prior_rows(self.setup, &state.shared) {
            gradient -= DVector::from_vec(row) * value;
        }
        for ((_, observed), weight) in own.iter().zip(&self.weights.each) {
            let Some(factor) = observed.factor.as_ref().filter(|_| *weight > 0.0) else { continue };
            gradient -= *weight * factor.r().tr_mul(&DVector::from_column_slice(factor.z()));
        }
        let bases = own.into_iter().map(|(base, _)| base).collect();
        Point { state: State { bases, shared: state.shared }, gradient: gradient.component_mul(&self.scale) }
    }

    fn moved(&self, from: &Point, direction: &DVector<f64>, by: f64) -> Point {
        let step = self.scale.component_mul(direction) * by;
        let shared = from.state.shared.moved(self.setup, step.as_slice());
        self.at(State { shared, bases: from.state.bases.clone() })
    }

    /// Searches along a direction for where the slope vanishes, by secants from a first length.
    fn along(&self, from: &Point, direction: &DVector<f64>, length: &mut f64) -> Point {
        let first = from.gradient.dot(direction);
        let (mut before, mut slope_before, mut by) = (0.0, first, *length);
        let mut point = self.moved(from, direction, by);
        for _ in 0..SECANTS {
            let slope = point.gradient.dot(direction);
            if slope.abs() <= LEVEL * first.abs() {
                break;
            }
            let bend = (slope - slope_before) / (by - before);
            if bend <= 0.0 || !bend.is_finite() {
                break;
            }
            let next = by - slope / bend;
            (before, slope_before) = (by, slope);
            if (next - by).abs() <= f64::EPSILON * next.abs() {
                break;
            }
            by = next;
            point = self.moved(from, direction, by);
        }
        *length = by;
        point
    }

    /// Descends from a state; returns the end and the number of directions.
    fn descended(&self, state: State) -> (State, usize) {
        let mut point = self.at(state);
        let mut direction = -&point.gradient;
        let mut length = 1.0 / self.scale.len().max(1) as f64;
        for used in 0..DIRECTIONS {
            if point.gradient.amax() < FLAT {
                return (point.state, used);
            }
            if direction.dot(&point.gradient) >= 0.0 || used % (2 * self.scale.len().max(1)) == 0 {
                direction = -&point.gradient;
            }
            let next = self.along(&point, &direction, &mut length);
            if length.abs() < f64::EPSILON {
                return (next.state, used);
            }
            // Polak and Ribière, never negative.
            let turned = next.gradient.dot(&(&next.gradient - &point.gradient));
            let by = (turned / point.gradient.norm_squared()).max(0.0);
            direction = by * direction - &next.gradient;
            point = next;
        }
        (point.state, DIRECTIONS)
    }
}

/// Finds the offsets by rounds of conjugate gradients.
pub(super) fn in_rounds(
    setup: &Setup,
    poses: &[Pose],
    mut state: State,
    left_out: &[bool],
) -> Result<Found, String> {
    let (mut steps, mut converged) = (0, false);
    let mut last = Vec::new();
    for _ in 0..ROUNDS {
        let all = observed(setup, poses, &state)?;
        let weights = weights(&all, left_out);
        let factor = merged(setup, &all, &weights.each, &state.shared);
        let lengths = factor.r().column_iter().map(|c| c.norm()).collect::<Vec<_>>();
        let scale = lengths.iter().map(|norm| if *norm > 0.0 { 1.0 / norm } else { 0.0 });
        let whiteners = for_each(poses, |k, pose| {
            let base = state.bases.get(k).copied().unwrap_or_default();
            setup.whitener(&setup.rows(pose, &base, &state.shared))
        });
        let whiteners = whiteners.into_iter().collect::<Option<Vec<_>>>();
        let whiteners = whiteners.ok_or_else(|| "the rows of a pose cannot be weighed".to_owned())?;
        let scale = DVector::from_iterator(lengths.len(), scale);
        let round = Round { setup, poses, whiteners, weights, scale };
        let before = state.shared.offsets.clone();
        let (there, used) = round.descended(state);
        (state, steps) = (there, steps + used);
        last = before.iter().zip(&state.shared.offsets).map(|(a, b)| b - a).collect();
        converged = last.iter().all(|by: &f64| by.abs() < STILL);
        if converged {
            break;
        }
    }
    let all = observed(setup, poses, &state)?;
    let Weights { each, scale } = weights(&all, left_out);
    Ok(Found { state, observed: all, weights: each, scale, steps, converged, last })
}
