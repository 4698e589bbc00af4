//! Residuals of row blocks, and the noise that they show.

use super::outliers::{Weights, dot};
use super::{BlockResidual, Channel, Estimate, RowBlocks, parallel};

/// Returns the residuals of all row blocks against the values of all their columns, weighted as told.
pub(super) fn residuals(
    blocks: &dyn RowBlocks,
    channels: usize,
    values: &[f64],
    weights: &Weights,
) -> Vec<BlockResidual> {
    let n = values.len();
    let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
        let part = blocks.parts().get(k).cloned().unwrap_or_default();
        let (mut rows, mut measured) = (vec![0.0; channels * n], vec![0.0; channels]);
        part.map(|block| {
            blocks.write(block, &mut rows, &mut measured);
            let lines = rows.chunks_exact(n.max(1)).zip(&measured);
            BlockResidual {
                time_s: blocks.time_s(block),
                values: lines.map(|(row, measured)| measured - dot(row, values)).collect(),
                weights: weights.of_block(block).to_vec(),
            }
        })
        .collect::<Vec<_>>()
    });
    parts.into_iter().flatten().collect()
}

/// Returns the root mean square of each channel's residuals, outliers weighted as they count.
pub(super) fn rms(residuals: &[BlockResidual], channels: usize) -> Vec<f64> {
    let n = residuals.len().max(1) as f64;
    (0..channels).map(|c| (residuals.iter().map(|r| r.weighted(c).powi(2)).sum::<f64>() / n).sqrt()).collect()
}

/// Returns the root mean square of each channel's filtered measurements.
pub(super) fn measured_rms(blocks: &dyn RowBlocks, channels: usize, parameters: usize) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0); channels];
    let (mut rows, mut measured) = (vec![0.0; channels * parameters], vec![0.0; channels]);
    for block in 0..blocks.len() {
        blocks.write(block, &mut rows, &mut measured);
        for ((sum, square), value) in sums.iter_mut().zip(&measured) {
            *sum += value;
            *square += value * value;
        }
    }
    let n = blocks.len().max(1) as f64;
    let of = |(sum, square): (f64, f64)| {
        let (mean, square) = (sum / n, square / n);
        (square.sqrt(), (square - mean * mean).max(0.0).sqrt())
    };
    sums.into_iter().map(of).collect()
}

/// Returns σ of each channel per sample: the residuals' variance over `Σh²`, for the degrees of freedom that `estimate`
/// leaves of so many blocks.
pub(super) fn raw_sigma(
    blocks: &dyn RowBlocks,
    channels: &[Channel],
    measured_rms: &[f64],
    estimate: &Estimate,
    residuals: &[BlockResidual],
) -> Vec<f64> {
    let per_channel = estimate.rank() as f64 / channels.len().max(1) as f64;
    let filter = blocks.filter();
    // Filtered blocks are worth this many independent samples each.
    let dof = (residuals.len() as f64 * filter.row_noise_gain().min(1.0) - per_channel).max(1.0);
    let left = dof / (dof + per_channel);
    let raw: Vec<f64> =
        rms(residuals, channels.len()).iter().map(|r| r / (filter.noise_gain * left).sqrt()).collect();
    let largest = |unit: &str| {
        let own = raw.iter().zip(channels).filter(|(_, c)| c.unit == unit);
        own.map(|(r, _)| *r).fold(f64::MIN_POSITIVE, f64::max)
    };
    // A channel that fits exactly must not outweigh all others, and none is known better than its digits.
    let floor = |c: &Channel, measured: f64| 1e-6 * largest(&c.unit).max(1e-12).max(1e-6 * measured);
    let channels = channels.iter().zip(measured_rms);
    raw.iter().zip(channels).map(|(r, (c, measured))| r.max(floor(c, *measured))).collect()
}
