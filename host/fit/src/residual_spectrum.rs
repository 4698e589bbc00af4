//! Covariance of residuals by bands of frequency: noise of differentiated rates rises with the frequency, so
//! that what is below it shows at the lowest ones only.
//!
//! Stretches of row blocks are transformed by sines that end at their ends, which are orthogonal and let
//! little of high frequencies through to low ones. What noise of unit variance leaves in each follows from
//! its autocovariance.

use std::f64::consts::PI;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::residuals::informative_blocks;
use super::{BlockResidual, Filter, RowBlocks};

/// Row blocks of a stretch at most,
const LONGEST: usize = 256;
/// halved until this many stretches
const FEWEST: usize = 4;
/// hold this share of all.
const LEAST_USED: f64 = 0.8;
/// If the filter leaves less than this share of white noise, nothing is examined.
const LEAST_GAIN: f64 = 0.01;
/// There is motion where the mean square of what was measured is this many times that of the residuals.
const LEAST_RATIO: f64 = 3.0;

/// A band of frequencies.
#[derive(Clone, Debug)]
pub(super) struct Band {
    /// Mean product of residuals, C × C.
    pub(super) covariance: DMatrix<f64>,
    /// Number of independent products.
    pub(super) count: f64,
    /// Variance that white noise of unit variance per sample has here,
    pub(super) white: f64,
    /// and that its derivative has, 1/s².
    pub(super) rising: f64,
}

/// Returns the covariance of residuals by bands, an octave each.
pub(super) fn bands(residuals: &[BlockResidual], filter: &Filter) -> Vec<Band> {
    bands_of(residuals, filter, |_, _| 1.0)
}

/// Returns the same of stretches that are multiplied by a window first, by sample and length.
fn bands_of(residuals: &[BlockResidual], filter: &Filter, window: impl Fn(usize, usize) -> f64) -> Vec<Band> {
    let channels = residuals.first().map_or(0, |r| r.values.len());
    let stretches = stretches(residuals, filter.row_period_s());
    let length = stretch_length(&stretches, residuals.len());
    let parts: Vec<&[BlockResidual]> =
        stretches.iter().flat_map(|own| residuals[own.clone()].chunks_exact(length)).collect();
    let blocks = residuals.len().max(1) as f64;
    let shares: Vec<f64> =
        (0..channels).map(|c| informative_blocks(residuals, c).max(1) as f64 / blocks).collect();
    let (mut white, mut rising) = (filter.white_autocovariance(), filter.derivative_autocovariance());
    if white.is_empty() {
        (white, rising) = (vec![1.0], vec![0.0]);
    }
    // By samples and channels, part after part.
    let weighted: Vec<f64> =
        parts.iter().copied().flatten().flat_map(|r| (0..channels).map(|c| r.weighted(c))).collect();
    let sines: Vec<Vec<f64>> = (1..=length).map(|k| sine(k, length)).collect();
    let gain = |sine: &[f64], autocovariance: &[f64]| -> f64 {
        let lags = autocovariance.iter().enumerate().take(length);
        let of_lag = |lag: usize| sine.iter().zip(sine.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
        lags.map(|(lag, gamma)| if lag == 0 { *gamma } else { 2.0 * gamma * of_lag(lag) }).sum()
    };
    let gains: Vec<f64> = sines.iter().map(|sine| gain(sine, &white)).collect();
    let most = gains.iter().copied().fold(0.0, f64::max);
    let seen = gains.iter().take_while(|gain| **gain > LEAST_GAIN * most).count();
    let mut bands = Vec::new();
    let mut first = 1;
    while first <= seen {
        let last = (2 * first - 1).min(seen);
        let own = &sines[first - 1..last];
        let windowed: Vec<Vec<f64>> = own
            .iter()
            .map(|sine| sine.iter().enumerate().map(|(t, s)| s * window(t, length)).collect())
            .collect();
        let mut sum = DMatrix::zeros(channels, channels);
        let mut values = DVector::zeros(channels);
        for part in weighted.chunks_exact((length * channels).max(1)) {
            for sine in &windowed {
                transform(part, sine, values.as_mut_slice());
                sum.ger(1.0, &values, &values, 1.0);
            }
        }
        for (i, j) in (0..channels).flat_map(|i| (0..channels).map(move |j| (i, j))) {
            sum[(i, j)] /= (shares[i] * shares[j]).sqrt();
        }
        let count = (parts.len() * own.len()).max(1) as f64;
        let mean = |autocovariance: &[f64]| {
            own.iter().map(|sine| gain(sine, autocovariance)).sum::<f64>() / own.len() as f64
        };
        let (white, rising) = (mean(&white), mean(&rising).max(0.0));
        bands.push(Band { covariance: sum / count, count, white, rising });
        first *= 2;
    }
    bands
}

/// Writes the sums of a part's samples times those of a sine, by channels.
fn transform(part: &[f64], sine: &[f64], out: &mut [f64]) {
    /// The same for a constant number of channels: their sums stay in registers.
    fn of<const C: usize>(part: &[f64], sine: &[f64], out: &mut [f64; C]) {
        *out = [-0.0; C];
        for (row, s) in part.as_chunks::<C>().0.iter().zip(sine) {
            out.iter_mut().zip(row).for_each(|(sum, v)| *sum += s * v);
        }
    }
    if let Ok(out) = <&mut [f64; 6]>::try_from(&mut *out) {
        return of(part, sine, out);
    }
    // As a sum begins.
    out.fill(-0.0);
    for (row, s) in part.chunks_exact(out.len().max(1)).zip(sine) {
        out.iter_mut().zip(row).for_each(|(sum, v)| *sum += s * v);
    }
}

/// Returns the bands of what was measured.
pub(super) fn measured(blocks: &dyn RowBlocks, channels: usize, parameters: usize) -> Vec<Band> {
    let mut rows = vec![0.0; channels * parameters];
    let of_block = |block: usize| {
        let mut values = vec![0.0; channels];
        blocks.write(block, &mut rows, &mut values);
        BlockResidual { time_s: blocks.time_s(block), values, weights: Vec::new() }
    };
    let all: Vec<BlockResidual> = (0..blocks.len()).map(of_block).collect();
    // Hann's, of unit mean square: what is slow and large stays out of the bands above.
    let hann = |t: usize, length: usize| {
        let turn = 2.0 * PI * (t + 1) as f64 / (length + 1) as f64;
        if length > 1 { (2.0_f64 / 3.0).sqrt() * (1.0 - turn.cos()) } else { 1.0 }
    };
    bands_of(&all, blocks.filter(), hann)
}

/// Gives residuals back what the parameters take of the noise, a sum of squares by channels: where there is
/// motion, which is where what was measured exceeds what is left.
pub(super) fn restore(residuals: &mut [Band], measured: &[Band], taken: &[f64]) {
    for (c, taken) in taken.iter().enumerate() {
        let moves =
            |own: &Band, measured: &Band| measured.covariance[(c, c)] > LEAST_RATIO * own.covariance[(c, c)];
        let moving = residuals.iter().zip(measured).rposition(|(own, measured)| moves(own, measured));
        let own = residuals.get_mut(..=moving.unwrap_or(0)).unwrap_or_default();
        let count: f64 = own.iter().map(|band| band.count).sum();
        own.iter_mut().for_each(|band| band.covariance[(c, c)] += taken / count.max(1.0));
    }
}

/// Returns a sine of k half periods, of unit square.
fn sine(k: usize, length: usize) -> Vec<f64> {
    let ends = (length + 1) as f64;
    (1..=length).map(|t| (2.0 / ends).sqrt() * (PI * k as f64 * t as f64 / ends).sin()).collect()
}

/// Returns the stretches of residuals without gaps in time.
fn stretches(residuals: &[BlockResidual], period_s: f64) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut start = 0;
    for end in 1..=residuals.len() {
        let follows = residuals.get(end).zip(residuals.get(end - 1)).is_some_and(|(now, before)| {
            period_s == 0.0 || (now.time_s - before.time_s - period_s).abs() < 0.5 * period_s
        });
        if !follows {
            found.push(start..end);
            start = end;
        }
    }
    found
}

/// Returns the length that stretches are cut to.
fn stretch_length(stretches: &[Range<usize>], blocks: usize) -> usize {
    let mut length = LONGEST;
    while length > 1 {
        let parts: usize = stretches.iter().map(|own| own.len() / length).sum();
        if parts >= FEWEST && (parts * length) as f64 >= LEAST_USED * blocks as f64 {
            break;
        }
        length /= 2;
    }
    length
}

#[cfg(test)]
mod tests {
    use rigident_shared::conditioning::Kernel;

    use super::*;
    use crate::row_every;
    use crate::variance_components::{Sample, explain};

    /// A normal number of unit variance from twelve uniform ones.
    fn normal(state: &mut u64) -> f64 {
        let mut next = || {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        (0..12).map(|_| next()).sum()
    }

    /// Noise of a differentiated rate that is a hundred times the channel's own in variance, and as much at
    /// 0.4 Hz: of a minute the bands tell them apart, where the variance is one number for two.
    #[test]
    fn noise_of_a_channel_is_found_below_that_of_rates_which_rises() {
        let (rate_hz, own, rising) = (200.0, 0.3, 0.12);
        let kernel = Kernel::<f64, 64>::new(rate_hz, 0.1, 1).unwrap();
        let filter = Filter {
            rate_hz,
            width_s: 0.1,
            every: row_every(rate_hz),
            noise_gain: kernel.noise_gain(),
            derivative_noise_gain: kernel.derivative_noise_gain(),
            response: kernel.smooth().to_vec(),
            derivative: kernel.derivative().to_vec(),
        };
        let mut state = 7;
        let samples: Vec<[f64; 2]> =
            (0..12_000).map(|_| [own * normal(&mut state), rising * normal(&mut state)]).collect();
        let weights: Vec<(f64, f64)> =
            kernel.smooth().iter().copied().zip(kernel.derivative().iter().copied()).collect();
        let residual = |(k, window): (usize, &[[f64; 2]])| BlockResidual {
            time_s: k as f64 * filter.row_period_s(),
            values: vec![window.iter().zip(&weights).map(|([a, b], (h, d))| a * h + b * d).sum()],
            weights: Vec::new(),
        };
        let windows = samples.windows(weights.len()).step_by(usize::from(filter.every)).enumerate();
        let residuals: Vec<BlockResidual> = windows.map(residual).collect();
        let share = own * own * filter.noise_gain
            / (rising * rising * filter.derivative_noise_gain + own * own * filter.noise_gain);
        assert!(share < 0.02, "{share}");
        let bands = bands(&residuals, &filter);
        let one = |v: f64| DMatrix::from_element(1, 1, v);
        let samples: Vec<Sample> = bands
            .iter()
            .map(|b| Sample {
                covariance: &b.covariance,
                count: b.count,
                components: vec![one(b.white), one(b.rising)],
            })
            .collect();
        let found = explain(&samples, &[1.0, 1.0], &[true, true]).unwrap();
        for (k, truth) in [own, rising].into_iter().enumerate() {
            let (variance, deviation) = (found.variance[k], found.deviation[k]);
            assert!((variance - truth * truth).abs() < 4.0 * deviation, "{truth}: {variance} ± {deviation}");
        }
        // Stretches of 2.6 s have two products below 0.4 Hz, and more that see something: some fifty in a
        // minute.
        assert!(found.deviation[0] < 0.4 * own * own, "{}", found.deviation[0]);
        assert!(found.deviation[1] < 0.1 * rising * rising, "{}", found.deviation[1]);
    }

    #[test]
    fn gaps_part_stretches_and_the_length_leaves_most_of_them() {
        let at = |time_s: f64| BlockResidual { time_s, values: vec![1.0], weights: Vec::new() };
        let times = (0..500).map(|k| 0.01 * f64::from(k) + if k < 200 { 0.0 } else { 3.0 });
        let residuals: Vec<BlockResidual> = times.map(at).collect();
        let found = stretches(&residuals, 0.01);
        assert_eq!(found, [0..200, 200..500]);
        assert_eq!(stretch_length(&found, 500), 64);
        assert_eq!(stretch_length(&[0..1, 1..2], 2), 1);
    }
}
