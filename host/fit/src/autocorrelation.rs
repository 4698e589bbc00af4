//! Residuals that stay correlated for longer than the filter explains, and the covariance that they leave.
//!
//! `cov = σ² (AᵀA)⁻¹` is right for noise that is white before the filter, because the sum over all lags of
//! the filtered noise's autocovariance, which is what a slowly varying row averages, is then `σ² (Σh)² = σ²`
//! again. For any noise that sum is `row_every Σ_m γ(m)` with γ the residuals' autocovariance, so that
//! `√(row_every Σ γ) / σ` is the factor by which intervals are too narrow at most. Noise that varies much
//! faster than the filter raises the residuals as it raises σ and needs no test; slower noise shows at lags
//! where the filter's own correlation has ended.
//!
//! The covariance is that of the sandwich, which [`super::sandwich`] makes of what is found here. Channels
//! are those after the whitening: in the measured ones noise of the signals is common to all, and hides what
//! a channel has of its own.

use super::residuals::informative_blocks;
use super::{Autocorrelation, BlockResidual, Filter, Whitener, Whitening};

/// A deviation this many standard deviations long is not chance: 6 channels, two tests, one false alarm in
/// 1e4.
const SIGNIFICANT: f64 = 4.5;
/// Rows over the longest lag of the tests. With so few, 0.8 s at 200 Hz, white noise is still taken for
/// autocorrelated in less than one channel of 1e4, and noise that lasts 0.05 s is named in most.
const LEAST: usize = 5;
/// Longest lag that is checked, rows.
const LONGEST: usize = 2000;
/// Factors on an interval below this are not worth a word.
const NOTICEABLE: f64 = 1.1;

/// The share of slow noise at most that parameters are taken to have explained.
const MOST_TAKEN: f64 = 0.75;

/// Autocorrelated noise of a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Coloured {
    /// The channel.
    pub channel: usize,
    /// Test and consequence.
    pub found: Autocorrelation,
    /// Autocovariance of its residuals at lags of 0, 1, … rows, as far as it is distinguished from chance.
    pub autocovariance: Vec<f64>,
}

/// Lags whose sums go side by side.
const SIDE_BY_SIDE: usize = 8;

/// Weighted residuals of one channel by stretches without gaps, and their autocovariance as far as it was
/// asked for.
struct Series {
    stretches: Vec<Vec<f64>>,
    /// Blocks that tell of the channel.
    count: f64,
    known: Vec<f64>,
}

impl Series {
    fn new(stretches: &[&[BlockResidual]], channel: usize) -> Self {
        let weighted = |s: &&[BlockResidual]| s.iter().map(|r| r.weighted(channel)).collect();
        Self {
            stretches: stretches.iter().map(weighted).collect(),
            count: stretches.iter().map(|s| informative_blocks(s, channel)).sum::<usize>().max(1) as f64,
            known: Vec::new(),
        }
    }

    /// Returns the autocovariance at a lag, pairs counted only within stretches.
    fn autocovariance(&mut self, lag: usize) -> f64 {
        while self.known.len() <= lag {
            let sums = self.sums(self.known.len());
            self.known.extend(sums.map(|sum| sum / self.count));
        }
        self.known[lag]
    }

    /// Returns the sums of the products at lags from `first` on, each in the order of time.
    fn sums(&self, first: usize) -> [f64; SIDE_BY_SIDE] {
        // As a sum begins.
        let mut sums = [-0.0; SIDE_BY_SIDE];
        for own in &self.stretches {
            let later = own.get(first..).unwrap_or_default();
            let all = own.iter().zip(later.windows(SIDE_BY_SIDE));
            let done = all.len();
            for (a, later) in all {
                sums.iter_mut().zip(later).for_each(|(sum, b)| *sum += a * b);
            }
            for (k, sum) in sums.iter_mut().enumerate() {
                let rest = own.iter().skip(done).zip(own.iter().skip(first + k + done));
                rest.for_each(|(a, b)| *sum += a * b);
            }
        }
        sums
    }
}

/// Returns the variance, times the number of rows, of the mean autocorrelation over `lags` lags beyond the
/// filter, for white noise of autocorrelation ρ: the mean over pairs of lags of `Σ_m ρ(m) ρ(m + k − l)`
/// (Bartlett 1946).
fn chance(white: &[f64], lags: usize) -> f64 {
    let rho = |lag: isize| white.get(lag.unsigned_abs()).map_or(0.0, |w| w / white[0]);
    let reach = white.len() as isize;
    let overlap = |d: isize| (-reach..=reach).map(|m| rho(m) * rho(m + d)).sum::<f64>();
    let lags = lags as isize;
    (0..lags).flat_map(|k| (0..lags).map(move |l| overlap(k - l))).sum::<f64>() / (lags * lags) as f64
}

/// Returns the channels whose residuals show more than the filter explains, the worst first.
///
/// `variance` is the one that the covariance assumes, per channel and sample before the filter; `fitted` are
/// the degrees of freedom that parameters took of all channels. Empty too where there is no filter, or too
/// few rows to tell.
pub fn detect(residuals: &[BlockResidual], filter: &Filter, variance: &[f64], fitted: f64) -> Vec<Coloured> {
    let white = &filter.white_autocovariance();
    let reach = white.len();
    let (from, to) = (reach.div_ceil(2).max(1), (3 * reach).div_ceil(2));
    if reach < 2 || residuals.len() < LEAST * to {
        return Vec::new();
    }
    let period_s = filter.row_period_s();
    let stretches: Vec<&[BlockResidual]> =
        residuals.chunk_by(|a, b| b.time_s - a.time_s < 1.5 * period_s).collect();
    let count = residuals.len() as f64;
    let chance = (chance(white, to - from + 1) / count).sqrt();
    // Sum over lags with triangular weights: its relative variance is 4 M / 3 n (Newey and West 1987), that
    // of a χ² of ν degrees of freedom 2/ν; the cube root of χ²/ν is nearly normal (Wilson and Hilferty 1931).
    let ninths = 2.0 / 9.0 * (0.5 * 4.0 * (2 * reach) as f64 / (3.0 * count));
    let largest_by_chance = (1.0 - ninths + SIGNIFICANT * ninths.sqrt()).powi(3);
    let weighted = |gamma: &[f64]| {
        let tail = gamma.iter().enumerate().skip(1).take(2 * reach);
        gamma[0] + 2.0 * tail.map(|(m, g)| g * (1.0 - m as f64 / (2 * reach) as f64)).sum::<f64>()
    };
    let longest = (residuals.len() / 4).min(LONGEST);
    let fitted = fitted / variance.len().max(1) as f64;
    let found = variance.iter().enumerate().filter_map(|(channel, scale)| {
        let mut series = Series::new(&stretches, channel);
        let gamma: Vec<f64> = (0..=2 * reach).map(|lag| series.autocovariance(lag)).collect();
        if *scale <= 0.0 || gamma[0] <= 0.0 {
            return None;
        }
        let beyond = &gamma[from..=to];
        let mean = beyond.iter().sum::<f64>() / (beyond.len() as f64 * gamma[0]);
        let expected = white[from.min(reach)..].iter().sum::<f64>() / (beyond.len() as f64 * white[0]);
        let ratio = weighted(&gamma) / (scale * weighted(white));
        if mean - expected < SIGNIFICANT * chance && ratio < largest_by_chance {
            return None;
        }
        // The sum ends where two neighbours no longer are positive together (Geyer 1992).
        let (mut tail, mut autocovariance) = (0.0, vec![gamma[0]]);
        for lag in (1..longest).step_by(2) {
            let pair = [lag, lag + 1].map(|lag| series.autocovariance(lag));
            let sum = pair[0] + pair[1];
            if lag >= reach && sum <= 0.0 {
                break;
            }
            tail += sum;
            autocovariance.extend(pair);
        }
        let sum = gamma[0] + 2.0 * tail;
        // What is fitted is as slow as the noise: at every lag it has taken a share `p/n` of the sum
        // (Bartlett 1946).
        let taken = (fitted * (2 * autocovariance.len() - 1) as f64 / series.count).min(MOST_TAKEN);
        let sum = sum / (1.0 - taken);
        let back = fitted * sum / series.count;
        autocovariance.iter_mut().for_each(|gamma| *gamma += back);
        let factor = (f64::from(filter.every) * sum / scale).max(0.0).sqrt();
        Some(Coloured { channel, found: Autocorrelation { mean, chance, factor }, autocovariance })
    });
    let mut found: Vec<Coloured> = found.filter(|c| c.found.factor > NOTICEABLE).collect();
    found.sort_by(|a, b| b.found.factor.total_cmp(&a.found.factor));
    found
}

/// Returns residuals as the whitening leaves them, each channel with a variance of the samples that a row
/// represents.
pub fn whitened(residuals: &[BlockResidual], whitening: &Whitening) -> Vec<BlockResidual> {
    let mut whitener = Whitener::new(whitening, 1);
    let mut rows = vec![0.0; whitening.channels()];
    let of = |residual: &BlockResidual| {
        let mut values = residual.values.clone();
        let weights = Some(residual.weights.as_slice()).filter(|own| !own.is_empty());
        rows.fill(0.0);
        whitener.apply(residual.time_s, &mut rows, &mut values, weights);
        // Where channels are mixed every one has something of the others.
        let present = residual.weights.iter().map(|weight| f64::from(u8::from(*weight != 0.0)));
        let weights = if whitening.weights().is_some() { present.collect() } else { Vec::new() };
        BlockResidual { time_s: residual.time_s, values, weights }
    };
    residuals.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slow noise of which a mean, a line and a curve were taken: the sum over its lags is that of the noise
    /// on the mean, and too small by a third where that is not counted.
    #[test]
    fn a_fit_to_slow_noise_is_counted_back() {
        use nalgebra::DMatrix;
        use rand_chacha::ChaCha8Rng;
        use rand_chacha::rand_core::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};

        let (rows, kept) = (240_usize, 0.9_f64);
        let response = vec![0.25; 4];
        let filter = Filter { rate_hz: 10.0, response, noise_gain: 0.25, ..Filter::default() };
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut sums = [0.0; 2];
        for _ in 0..300 {
            let mut slow = 0.0;
            let mut noise = DMatrix::zeros(rows, 1);
            for row in noise.iter_mut() {
                let z: f64 = StandardNormal.sample(&mut random);
                slow = kept * slow + (1.0 - kept * kept).sqrt() * z;
                *row = slow;
            }
            let t = |i: usize| 2.0 * i as f64 / (rows - 1) as f64 - 1.0;
            let taken = DMatrix::from_fn(rows, 3, |i, k| [1.0, t(i), t(i) * t(i)][k]);
            let q = taken.qr().q();
            let left = &noise - &q * q.tr_mul(&noise);
            let residuals: Vec<BlockResidual> = left
                .iter()
                .enumerate()
                .map(|(i, v)| BlockResidual { time_s: i as f64 * 0.1, values: vec![*v], weights: Vec::new() })
                .collect();
            for (sum, fitted) in sums.iter_mut().zip([0.0, 3.0]) {
                let found = detect(&residuals, &filter, &[1.0], fitted);
                *sum += found.first().map_or(1.0, |own| own.found.factor.powi(2)) / 300.0;
            }
        }
        // `(1 + k)/(1 − k)`, of unit variance.
        let truth = (1.0 + kept) / (1.0 - kept);
        let [plain, counted] = sums.map(|sum| sum / truth);
        assert!(plain < 0.75 && (counted - 1.0).abs() < 0.1, "{plain} {counted}");
    }
}
