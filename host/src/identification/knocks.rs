//! Knocks in a recording: rows far from the answer are given less weight, and the answer is made anew.
//!
//! Lives here: the limit, and the reference that the pipeline compares with. May not live here: the comparison itself
//! ([`rigident_shared::estimator::Reference`]), which is the firmware's too.

use rigident_shared::estimator::Reference;

use super::Input;
use crate::answer::Estimate;

/// A row is given less weight beyond so many standard deviations. Of noise alone two rows in 1e9 are: in an experiment of
/// 60 s (36 000 rows) one in 14 000 loses a row.
pub const LIMIT_SD: f64 = 6.0;
/// The answer is made anew at most so often: the first was spoilt by the knocks that it shows.
pub(super) const MOST_ROUNDS: usize = 3;

/// The limit for these readings: none where the load cell's gains are uncertain, whose errors exceed the noise.
pub fn limit(input: &Input) -> f64 {
    if input.gain_sigma.iter().any(|s| *s > 0.0) { 0.0 } else { LIMIT_SD }
}

/// What the pipeline compares rows with. A parameter that the rows do not determine has no uncertainty that matters to
/// them: its value explains them as well as any other. Residuals larger than σ explains make the noise so much larger, smaller
/// ones do not make it smaller.
pub(super) fn reference(input: &Input, estimate: &Estimate, variance_ratio: f64) -> Reference<f64, 16> {
    let sd = |j: usize| match estimate.determined.get(j) {
        Some(true) => estimate.covariance.get((j, j)).map_or(0.0, |v| v.max(0.0).sqrt()),
        _ => 0.0,
    };
    Reference {
        parameters: std::array::from_fn(|j| estimate.values.get(j).copied().unwrap_or(0.0)),
        standard_deviation: std::array::from_fn(sd),
        noise_scale: variance_ratio.max(1.0),
        knock_limit: limit(input),
    }
}
