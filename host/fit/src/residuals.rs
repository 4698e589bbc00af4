//! Residuals of row blocks, and the noise that they show.

use super::left_of_rows::CHUNK;
use super::outliers::Weights;
use super::{BlockResidual, Channel, RowBlocks, parallel};

/// Returns the residuals of all row blocks against the values of all their columns, weighted as given.
pub(super) fn residuals(
    blocks: &dyn RowBlocks,
    channels: usize,
    values: &[f64],
    weights: &Weights,
) -> Vec<BlockResidual> {
    let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
        let part = blocks.parts().get(k).cloned().unwrap_or_default();
        let mut all = Vec::with_capacity(part.len());
        let mut left = vec![0.0; CHUNK * channels];
        for first in part.clone().step_by(CHUNK) {
            let some = first..part.end.min(first + CHUNK);
            let left = &mut left[..some.len() * channels];
            blocks.left(some.clone(), values, left);
            all.extend(some.zip(left.chunks_exact(channels.max(1))).map(|(block, own)| {
                let mut weights = weights.of_block(block).to_vec();
                if (0..channels).any(|c| !blocks.measures(block, c)) {
                    weights.resize(channels, 1.0);
                    let own = weights.iter_mut().enumerate().filter(|(c, _)| !blocks.measures(block, *c));
                    own.for_each(|(_, weight)| *weight = 0.0);
                }
                BlockResidual { time_s: blocks.time_s(block), values: own.to_vec(), weights }
            }));
        }
        all
    });
    let mut all = Vec::with_capacity(blocks.len());
    parts.into_iter().for_each(|part| all.extend(part));
    all
}

/// Returns the number of blocks that tell of a channel.
pub(super) fn informative_blocks(residuals: &[BlockResidual], channel: usize) -> usize {
    residuals.iter().filter(|r| r.measures(channel)).count()
}

/// Returns the root mean square of each channel's residuals, outliers weighted as they count.
pub(super) fn rms(residuals: &[BlockResidual], channels: usize) -> Vec<f64> {
    let of_channel = |c: usize| {
        let squares: f64 = residuals.iter().map(|r| r.weighted(c).powi(2)).sum();
        (squares / informative_blocks(residuals, c).max(1) as f64).sqrt()
    };
    (0..channels).map(of_channel).collect()
}

/// Returns the root mean square of each channel's filtered measurements.
pub(super) fn measured_rms(blocks: &dyn RowBlocks, channels: usize, parameters: usize) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0, 0_u32); channels];
    let (mut rows, mut measured) = (vec![0.0; channels * parameters], vec![0.0; channels]);
    for block in 0..blocks.len() {
        blocks.write(block, &mut rows, &mut measured);
        for (c, ((sum, square, count), value)) in sums.iter_mut().zip(&measured).enumerate() {
            *sum += value;
            *square += value * value;
            *count += u32::from(blocks.measures(block, c));
        }
    }
    let of = |(sum, square, count): (f64, f64, u32)| {
        let n = f64::from(count.max(1));
        let (mean, square) = (sum / n, square / n);
        (square.sqrt(), (square - mean * mean).max(0.0).sqrt())
    };
    sums.into_iter().map(of).collect()
}

/// Returns σ of each channel per sample: the residuals' variance over `Σh²`, for the degrees of freedom that
/// are left of the blocks beside those `fitted` to each channel.
pub(super) fn raw_sigma(
    blocks: &dyn RowBlocks,
    channels: &[Channel],
    measured_rms: &[f64],
    fitted: &[f64],
    residuals: &[BlockResidual],
) -> Vec<f64> {
    let filter = blocks.filter();
    // Filtered blocks are worth this many independent samples each.
    let left = |c: usize| {
        let blocks = informative_blocks(residuals, c) as f64;
        let fitted = fitted.get(c).copied().unwrap_or(0.0);
        let dof = (blocks * filter.row_noise_gain().min(1.0) - fitted).max(1.0);
        dof / (dof + fitted)
    };
    let raw = rms(residuals, channels.len()).into_iter().enumerate();
    let raw: Vec<f64> = raw.map(|(c, r)| r / (filter.noise_gain * left(c)).sqrt()).collect();
    let largest = |unit: &str| {
        let own = raw.iter().zip(channels).filter(|(_, c)| c.unit == unit);
        own.map(|(r, _)| *r).fold(f64::MIN_POSITIVE, f64::max)
    };
    // A channel that fits exactly must not outweigh all others, and none is known better than its digits.
    let floor = |c: &Channel, measured: f64| 1e-6 * largest(&c.unit).max(1e-12).max(1e-6 * measured);
    let channels = channels.iter().zip(measured_rms);
    raw.iter().zip(channels).map(|(r, (c, measured))| r.max(floor(c, *measured))).collect()
}
