//! Residuals of row blocks, and the noise that they show.

use super::left_of_rows::CHUNK;
use super::noise_check::OWN_FREEDOM;
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
/// are left of the blocks beside those `fitted` to each channel. What a channel lacks of [`OWN_FREEDOM`] it
/// borrows from the channels of its unit, and these from all, in proportion to `nominal`: of a channel
/// without freedom the residuals are none of its noise.
pub(super) fn raw_sigma(
    blocks: &dyn RowBlocks,
    (channels, nominal): (&[Channel], &[f64]),
    measured_rms: &[f64],
    fitted: &[f64],
    residuals: &[BlockResidual],
) -> Vec<f64> {
    let filter = blocks.filter();
    let of = |(c, rms): (usize, f64)| {
        // Filtered blocks are worth this many independent samples each.
        let samples = informative_blocks(residuals, c) as f64 * filter.row_noise_gain().min(1.0);
        let fitted = fitted.get(c).copied().unwrap_or(0.0);
        let freedom = (samples - fitted).max(0.0);
        Shown { squares: rms * rms / filter.noise_gain * (freedom + fitted), freedom }
    };
    let shown: Vec<Shown> = rms(residuals, channels.len()).into_iter().enumerate().map(of).collect();
    let raw = borrowed(&shown, channels, nominal);
    let largest = |unit: &str| {
        let own = raw.iter().zip(channels).filter(|(_, c)| c.unit == unit);
        own.map(|(r, _)| *r).fold(f64::MIN_POSITIVE, f64::max)
    };
    // A channel that fits exactly must not outweigh all others, and none is known better than its digits.
    let floor = |c: &Channel, measured: f64| 1e-6 * largest(&c.unit).max(1e-12).max(1e-6 * measured);
    let channels = channels.iter().zip(measured_rms);
    raw.iter().zip(channels).map(|(r, (c, measured))| r.max(floor(c, *measured))).collect()
}

/// The noise that residuals show: their squares, and the degrees of freedom these have.
#[derive(Clone, Copy)]
struct Shown {
    squares: f64,
    freedom: f64,
}

impl Shown {
    const NONE: Self = Self { squares: 0.0, freedom: 0.0 };

    /// Returns the same with that of another channel whose σ is `1/scale` times this one's.
    fn with(self, other: Self, scale: f64) -> Self {
        Self { squares: self.squares + scale * scale * other.squares, freedom: self.freedom + other.freedom }
    }

    /// Returns the variance, for what is lacking of [`OWN_FREEDOM`] the one that is lent.
    fn variance(self, lent: f64) -> f64 {
        let lacking = (OWN_FREEDOM - self.freedom).max(0.0);
        (self.squares + lacking * lent) / (self.freedom + lacking)
    }
}

/// Returns σ of each channel, of those with little freedom partly that of the others.
fn borrowed(shown: &[Shown], channels: &[Channel], nominal: &[f64]) -> Vec<f64> {
    let size = |c: usize| nominal.get(c).copied().unwrap_or(1.0);
    let pooled = |c: usize, counts: &dyn Fn(usize) -> bool| {
        let others = shown.iter().enumerate().filter(|(other, _)| counts(*other));
        others.fold(Shown::NONE, |all, (other, own)| all.with(*own, size(c) / size(other)))
    };
    let of = |(c, own): (usize, &Shown)| {
        if own.freedom >= OWN_FREEDOM {
            return (own.squares / own.freedom).sqrt();
        }
        let all = pooled(c, &|_| true);
        let alike = |other: usize| channels.get(other).map(|o| &o.unit) == channels.get(c).map(|c| &c.unit);
        own.variance(pooled(c, &alike).variance(all.squares / all.freedom.max(1.0))).sqrt()
    };
    shown.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of six channels one has no freedom and hardly a residual, one a little; forces have ten times the
    /// noise of moments, as is nominal. A channel with enough freedom has its own noise, to the last bit.
    #[test]
    fn channels_without_freedom_borrow_their_noise() {
        let channel = |name: &str| Channel {
            name: name.to_owned(),
            unit: if name.starts_with('f') { "N" } else { "N m" }.to_owned(),
            sigma: None,
            offset: None,
            group: u8::from(name.starts_with('m')),
        };
        let channels = ["fx", "fy", "fz", "mx", "my", "mz"].map(channel);
        let nominal = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1];
        let of = |squares: f64, freedom: f64| Shown { squares, freedom };
        let forces = [of(4.0, 4.0), of(9.0, 6.0), of(2.0, 2.0)];
        let moments = [of(0.03, 3.0), of(0.02, 2.0), of(1e-18, 0.0)];
        let found = borrowed(&[forces, moments].concat(), &channels, &nominal);
        assert_eq!(found[..2], [1.0, 1.5_f64.sqrt()]);
        // Two of its own, two of the 15 in twelve.
        assert!((found[2] - ((2.0 + 2.0 * 1.25) / 4.0_f64).sqrt()).abs() < 1e-12);
        assert!((found[5] - 0.1).abs() < 1e-6, "{found:?}");
        // No moment has any: theirs is in proportion to the forces'.
        let none = borrowed(&[forces, [of(1e-20, 0.0); 3]].concat(), &channels, &nominal);
        assert!((none[5] - 0.1 * 1.25_f64.sqrt()).abs() < 1e-6, "{none:?}");
    }
}
