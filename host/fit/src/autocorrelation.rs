//! Residuals that stay correlated for longer than the filter explains, and the covariance that they leave.
//!
//! `cov = σ² (AᵀA)⁻¹` is right for noise that is white before the filter, because the sum over all lags of the filtered
//! noise's autocovariance, which is what a slowly varying row averages, is then `σ² (Σh)² = σ²` again. For any noise that
//! sum is `row_every Σ_m γ(m)` with γ the residuals' autocovariance, so that `√(row_every Σ γ) / σ` is the factor by which
//! intervals are too narrow at most. Noise that varies much faster than the filter raises the residuals as it raises σ and
//! needs no test; slower noise shows at lags where the filter's own correlation has ended.
//!
//! The covariance is that of the sandwich: `φ̂ − φ = Σ_i p_i n_i` with the influence `p = (AᵀA)⁻¹ a/σ²` of a row, so that
//! the variance of `φ̂_j` is `Σ_c Σ_m γ_c(m) Σ_i p_ij p_(i+m)j` for noise that is stationary in each channel c and
//! independent between them. The ratio to the same sum with the autocovariance of filtered white noise inflates the
//! factor's covariance. Estimates stay. Channels are those after the whitening: in the measured ones noise of the signals is
//! common to all, and hides what a channel has of its own.

use nalgebra::DMatrix;

use super::outliers::Weights;
use super::residuals::told;
use super::{Autocorrelation, BlockResidual, Estimate, Filter, RowBlocks, Whitener, Whitening, parallel};

/// A deviation this many standard deviations long is not chance: 6 channels, two tests, one false alarm in 1e4.
const SIGNIFICANT: f64 = 4.5;
/// Rows over the longest lag of the tests. With so few, 0.8 s at 200 Hz, white noise is still taken for autocorrelated in
/// less than one channel of 1e4, and noise that lasts 0.05 s is named in most.
const LEAST: usize = 5;
/// Longest lag that is looked at, rows.
const LONGEST: usize = 2000;
/// Lags that products are made for; where noise lasts for more rows, so many are summed first.
const MOST_LAGS: usize = 250;
/// Numbers that are looked at, shared out evenly over the recording: 60 000 row blocks of a body with its offset.
const MOST_NUMBERS: usize = 60_000 * 6 * 16;
/// Most pieces that a long recording in one part is looked at in.
const MOST_PIECES: usize = 64;
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
    /// Autocovariance of its residuals at lags of 0, 1, … rows, as far as it is told from chance.
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
            count: stretches.iter().map(|s| told(s, channel)).sum::<usize>().max(1) as f64,
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

/// Returns the variance, times the number of rows, of the mean autocorrelation over `lags` lags beyond the filter, for
/// white noise of autocorrelation ρ: the mean over pairs of lags of `Σ_m ρ(m) ρ(m + k − l)` (Bartlett 1946).
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
    // Sum over lags with triangular weights: its relative variance is 4 M / 3 n (Newey and West 1987), that of a χ² of
    // ν degrees of freedom 2/ν; the cube root of χ²/ν is nearly normal (Wilson and Hilferty 1931).
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
        let (mut tail, mut told) = (0.0, vec![gamma[0]]);
        for lag in (1..longest).step_by(2) {
            let pair = [lag, lag + 1].map(|lag| series.autocovariance(lag));
            let sum = pair[0] + pair[1];
            if lag >= reach && sum <= 0.0 {
                break;
            }
            tail += sum;
            told.extend(pair);
        }
        let sum = gamma[0] + 2.0 * tail;
        // What is fitted is as slow as the noise: at every lag it has taken a share `p/n` of the sum
        // (Bartlett 1946).
        let taken = (fitted * (2 * told.len() - 1) as f64 / series.count).min(MOST_TAKEN);
        let sum = sum / (1.0 - taken);
        let back = fitted * sum / series.count;
        told.iter_mut().for_each(|gamma| *gamma += back);
        let factor = (f64::from(filter.every) * sum / scale).max(0.0).sqrt();
        Some(Coloured { channel, found: Autocorrelation { mean, chance, factor }, autocovariance: told })
    });
    let mut found: Vec<Coloured> = found.filter(|c| c.found.factor > NOTICEABLE).collect();
    found.sort_by(|a, b| b.found.factor.total_cmp(&a.found.factor));
    found
}

/// Noise of the rows of each channel.
struct Noise<'a> {
    /// Autocovariance of filtered white noise of unit variance at lags of 0, 1, … rows.
    white: Vec<f64>,
    /// Variance of each channel before the filter that the factor assumes.
    variance: &'a [f64],
    coloured: &'a [Coloured],
    row_period_s: f64,
}

impl Noise<'_> {
    /// Returns the longest reach of any channel's autocovariance, rows.
    fn longest(&self) -> usize {
        self.coloured.iter().map(|c| c.autocovariance.len()).fold(self.white.len(), usize::max)
    }

    /// Returns the rows that are summed before products are made.
    fn several(&self) -> usize {
        self.longest().div_ceil(MOST_LAGS).max(1)
    }

    /// Returns the row blocks that are looked at, in each of so many parts.
    fn most_blocks(&self, parameters: usize, parts: usize) -> usize {
        let block = (self.variance.len() * parameters).max(1);
        (MOST_NUMBERS / block / parts.max(1)).max(4 * self.longest())
    }
}

/// Influence of rows on parameters, summed over several rows: stretches without gaps of `[sum][channel][parameter]`.
struct Influences {
    done: Vec<Vec<f64>>,
    sum: Vec<f64>,
    summed: usize,
    several: usize,
    gap_s: f64,
    last_s: f64,
}

impl Influences {
    fn new(noise: &Noise, parameters: usize) -> Self {
        Self {
            done: Vec::new(),
            sum: vec![0.0; noise.variance.len() * parameters],
            summed: 0,
            several: noise.several(),
            gap_s: 1.5 * noise.row_period_s,
            last_s: f64::NEG_INFINITY,
        }
    }

    /// Takes a row block: `add` adds its influence, `[channel][parameter]`.
    fn take(&mut self, time_s: f64, add: impl FnOnce(&mut [f64])) {
        if time_s - self.last_s > self.gap_s {
            self.start_anew();
            self.done.push(Vec::new());
        }
        self.last_s = time_s;
        add(&mut self.sum);
        self.summed += 1;
        if self.summed == self.several {
            if let Some(stretch) = self.done.last_mut() {
                stretch.extend_from_slice(&self.sum);
            }
            self.start_anew();
        }
    }

    fn start_anew(&mut self) {
        self.sum.fill(0.0);
        self.summed = 0;
    }
}

/// Returns residuals as the whitening leaves them, each channel with a variance of the samples that a row stands for.
pub fn whitened(residuals: &[BlockResidual], whitening: &Whitening) -> Vec<BlockResidual> {
    let mut whitener = Whitener::new(whitening, 1);
    let mut rows = vec![0.0; whitening.channels()];
    let of = |residual: &BlockResidual| {
        let mut values = residual.values.clone();
        let weights = Some(residual.weights.as_slice()).filter(|own| !own.is_empty());
        rows.fill(0.0);
        whitener.apply(residual.time_s, &mut rows, &mut values, weights);
        // Where channels are mixed every one has something of the others.
        let told = residual.weights.iter().map(|weight| f64::from(u8::from(*weight != 0.0)));
        let weights = if whitening.weights().is_some() { told.collect() } else { Vec::new() };
        BlockResidual { time_s: residual.time_s, values, weights }
    };
    residuals.iter().map(of).collect()
}

/// Returns the factor on the standard deviation of each of the first `kept` parameters, 1 or more; 1 where nothing is
/// determined.
///
/// `estimate` is that of white noise, from rows whitened with the `weights` of outliers; `variance` is that of
/// each whitened channel before the filter that its covariance assumes, `coloured` is what [`whitened`] residuals show.
pub fn inflation(
    blocks: &dyn RowBlocks,
    estimate: &Estimate,
    kept: usize,
    whitening: &Whitening,
    weights: &Weights,
    variance: &[f64],
    coloured: &[Coloured],
) -> Vec<f64> {
    let (n, kept, channels) = (estimate.len(), kept.min(estimate.len()), whitening.channels());
    let lead = whitening.lead();
    let filter = blocks.filter();
    let white = filter.white_autocovariance();
    let noise = Noise { white, variance, coloured, row_period_s: filter.row_period_s() };
    // Rows lie in what is determined, so that of a parameter that is, the whole row counts.
    let mut gain: DMatrix<f64> = estimate.covariance.rows(0, kept).into_owned();
    for (j, determined) in estimate.determined.iter().enumerate().take(kept) {
        if !determined {
            gain.row_mut(j).fill(0.0);
        }
    }
    let pieces = pieces(blocks, &noise, n);
    let parts: Vec<Influences> = parallel::map(parallel::threads(), pieces.len(), |k| {
        let mut part = Influences::new(&noise, kept);
        let (mut rows, mut measured) = (DMatrix::zeros(n, channels), vec![0.0; channels]);
        let mut whitener = Whitener::new(whitening, n);
        let piece = pieces.get(k).cloned().unwrap_or_default();
        for block in piece.start.saturating_sub(lead)..piece.end {
            blocks.write(block, rows.as_mut_slice(), &mut measured);
            let own = Some(weights.of_block(block)).filter(|own| !own.is_empty());
            whitener.apply(blocks.time_s(block), rows.as_mut_slice(), &mut measured, own);
            if block < piece.start {
                continue;
            }
            let influence = &gain * &rows;
            part.take(blocks.time_s(block), |sum| {
                for (sum, p) in sum.iter_mut().zip(influence.iter()) {
                    *sum += p;
                }
            });
        }
        part
    });
    ratios(&parts, kept, &noise)
}

/// Returns the blocks that are looked at: the beginning of every part, or of every piece of a single part.
fn pieces(blocks: &dyn RowBlocks, noise: &Noise, n: usize) -> Vec<std::ops::Range<usize>> {
    let cut = |part: &std::ops::Range<usize>, length: usize| part.start..part.end.min(part.start + length);
    if blocks.parts().len() > 1 {
        let length = noise.most_blocks(n, blocks.parts().len());
        return blocks.parts().iter().map(|part| cut(part, length)).collect();
    }
    let (count, most) = (blocks.len(), noise.most_blocks(n, 1));
    if count <= most {
        return std::iter::once(0..count).collect();
    }
    let pieces = MOST_PIECES.min(most / noise.most_blocks(n, MOST_PIECES)).max(1);
    let length = noise.most_blocks(n, pieces);
    (0..pieces).map(|k| cut(&(k * count / pieces..count), length)).collect()
}

fn ratios(parts: &[Influences], parameters: usize, noise: &Noise) -> Vec<f64> {
    let several = noise.several();
    let lags = noise.longest().div_ceil(several) + 1;
    let stretches: Vec<&[f64]> = parts.iter().flat_map(|part| part.done.iter().map(Vec::as_slice)).collect();
    let (mut white, mut found) = (vec![0.0; parameters], vec![0.0; parameters]);
    for (c, variance) in noise.variance.iter().enumerate() {
        let flat: Vec<f64> = noise.white.iter().map(|w| w * variance).collect();
        let told = noise.coloured.iter().find(|coloured| coloured.channel == c);
        let (flat_sums, told_sums) =
            (of_sums(&flat, several, lags), told.map(|t| of_sums(&t.autocovariance, several, lags)));
        for m in 0..lags {
            let both = if m == 0 { 1.0 } else { 2.0 };
            let (g, t) = (both * flat_sums[m], both * told_sums.as_ref().unwrap_or(&flat_sums)[m]);
            if g == 0.0 && t == 0.0 {
                continue;
            }
            let products = products(&stretches, noise.variance.len(), parameters, c, m);
            for ((white, found), product) in white.iter_mut().zip(&mut found).zip(products) {
                *white += g * product;
                *found += t * product;
            }
        }
    }
    found
        .iter()
        .zip(&white)
        .map(|(found, white)| {
            let ratio = (found / white).sqrt();
            // Zero over zero where nothing is determined.
            if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
        })
        .collect()
}

/// Returns the mean autocovariance between a row of one sum of `several` rows and a row of the sum `m` later, m = 0, 1, ….
fn of_sums(gamma: &[f64], several: usize, lags: usize) -> Vec<f64> {
    let q = several as isize;
    let at = |lag: isize| gamma.get(lag.unsigned_abs()).copied().unwrap_or(0.0);
    (0..lags as isize)
        .map(|m| (1 - q..q).map(|d| (q - d.abs()) as f64 * at(m * q + d)).sum::<f64>() / (q * q) as f64)
        .collect()
}

/// Returns `Σ_i p_ij p_(i+m)j` of one of several channels, pairs within stretches.
fn products(stretches: &[&[f64]], channels: usize, parameters: usize, channel: usize, m: usize) -> Vec<f64> {
    let mut sums = vec![0.0; parameters];
    let of_channel = |sum: &'_ [f64]| -> std::ops::Range<usize> {
        let from = (channel * parameters).min(sum.len());
        from..(from + parameters).min(sum.len())
    };
    for stretch in stretches {
        let all = stretch.chunks_exact((channels * parameters).max(1));
        for (a, b) in all.clone().zip(all.skip(m)) {
            let own = of_channel(a);
            for ((sum, a), b) in sums.iter_mut().zip(&a[own.clone()]).zip(&b[own]) {
                *sum += a * b;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slow noise of which a mean, a line and a curve were taken: the sum over its lags is that of the noise
    /// on the mean, and too small by a third where that is not counted.
    #[test]
    fn what_was_fitted_to_slow_noise_is_counted_back() {
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

    /// The sum of the covariances of all pairs of rows is that of all pairs of sums.
    #[test]
    fn autocovariances_of_sums_are_means_over_pairs_of_rows() {
        let gamma: Vec<f64> = (0..40).map(|m| 0.9_f64.powi(m)).collect();
        let (several, sums) = (4_usize, 25_usize);
        let at = |lag: usize| gamma.get(lag).copied().unwrap_or(0.0);
        let rows = several * sums;
        let of_rows: f64 = (0..rows).flat_map(|i| (0..rows).map(move |k| at(i.abs_diff(k)))).sum();
        let told = of_sums(&gamma, several, sums);
        let of_told: f64 =
            (0..sums).flat_map(|i| (0..sums).map(|k| told[i.abs_diff(k)]).collect::<Vec<_>>()).sum();
        assert!((of_told * (several * several) as f64 / of_rows - 1.0).abs() < 1e-12);
        assert_eq!(of_sums(&gamma, 1, 40), gamma);
    }
}
