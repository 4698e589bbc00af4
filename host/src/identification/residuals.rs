//! What an answer leaves unexplained, and the noise that tells.

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::Estimator;

use super::gains::residual_with_gains;
use super::whiteness::Leftover;
use super::{Absorbed, Input, TAPS};
use crate::answer::{Estimate, Noise};
use crate::problem::body::shares::Shares;

/// Residual of one row block, N and N m, at its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockResidual {
    /// Time of the reading that completed the block, s.
    pub time_s: f64,
    /// Filtered wrench less the prediction.
    pub residual: [f64; 6],
    /// Factor on each row beside its weight: less than 1 where a knock has spoilt it.
    pub factors: [f64; 6],
}

impl BlockResidual {
    /// The residual as the answer counts it.
    pub(super) fn weighted(&self) -> [f64; 6] {
        std::array::from_fn(|c| self.residual[c] * self.factors[c])
    }
}

impl Leftover for BlockResidual {
    fn time_s(&self) -> f64 {
        self.time_s
    }

    fn of(&self, channel: usize) -> f64 {
        let both = self.residual.get(channel).zip(self.factors.get(channel));
        both.map_or(0.0, |(residual, factor)| residual * factor)
    }
}

/// Filtered readings are worth this many independent ones each, and dof are counted per channel.
fn degrees_of_freedom(blocks: u32, noise_gain: f64, determined: usize) -> f64 {
    (f64::from(blocks) * noise_gain.min(1.0) - determined as f64 / 6.0).max(1.0)
}

/// Residuals of the row blocks for given parameters, by running the pipeline once more, and how many rows of each
/// channel a knock has spoilt.
pub(super) fn residuals<const N: usize>(
    shares: &Shares,
    sigma: [f64; 6],
    estimate: &Estimate,
    gains: &[f64; 6],
) -> (Vec<BlockResidual>, [u16; 6]) {
    let phi: [f64; N] = std::array::from_fn(|j| estimate.values.get(j).copied().unwrap_or(0.0));
    let take = |list: &mut Vec<BlockResidual>, reading: &Reading<f64>, pipeline: &Estimator<f64, N, TAPS>| {
        list.extend(pipeline.last_block().map(|block| BlockResidual {
            time_s: reading.time_ns as f64 * 1e-9,
            residual: residual_with_gains(&block, &phi, gains),
            factors: *pipeline.last_factors(),
        }));
    };
    // The σ have been accepted before: there is no other way to fail.
    shares
        .absorb(sigma, Vec::new, take)
        .map_or_else(|_| (Vec::new(), [0; 6]), |done| (done.parts.concat(), done.counters.knocks))
}

pub(super) fn rms(residuals: &[BlockResidual]) -> [f64; 6] {
    let n = residuals.len().max(1) as f64;
    std::array::from_fn(|c| (residuals.iter().map(|r| r.weighted()[c].powi(2)).sum::<f64>() / n).sqrt())
}

/// Raw σ of each channel: residual variance over `Σh²`, for the degrees of freedom that are left.
pub(super) fn sigma_from_residuals<const N: usize>(
    input: &Input,
    shares: &Shares,
    absorbed: &Absorbed<N>,
) -> [f64; 6] {
    let settings = &*absorbed.settings;
    let (factor, gains) = absorbed.factor_and_gains(&input.gain_sigma);
    let estimate = Estimate::new(&factor, 1.0, Noise::Given);
    let (residuals, _) = residuals::<N>(shares, settings.config().channel_sigma, &estimate, &gains);
    raw_sigma(settings, &estimate, &residuals, absorbed.counters.blocks)
}

/// Raw σ of each channel from the residuals of so many blocks, to which the estimate was fitted.
pub(super) fn raw_sigma<const N: usize>(
    settings: &Estimator<f64, N, TAPS>,
    estimate: &Estimate,
    residuals: &[BlockResidual],
    blocks: u32,
) -> [f64; 6] {
    let determined = estimate.determined.iter().filter(|d| **d).count();
    let dof = degrees_of_freedom(blocks, settings.noise_gain(), determined);
    let left = dof / (dof + determined as f64 / 6.0);
    let kernel = settings.kernel().noise_gain();
    let raw = rms(residuals).map(|r| r / (kernel * left).sqrt());
    // A channel that fits exactly must not outweigh all others.
    let floor = |group: &[f64]| 1e-6 * group.iter().copied().fold(f64::MIN_POSITIVE, f64::max).max(1e-12);
    let (force, moment) = (floor(&raw[..3]), floor(&raw[3..]));
    std::array::from_fn(|c| raw[c].max(if c < 3 { force } else { moment }))
}
