//! Intervals where the noise is not white: the sandwich with the autocovariance that the residuals show.
//!
//! `φ̂ − φ = Σ_i p_i n_i` with the influence `p = (AᵀA)⁻¹ a/σ²` of a row, so that the variance of `φ̂_j` is
//! `Σ_c Σ_m γ_c(m) Σ_i p_ij p_(i+m)j` for noise that is stationary in each channel c and independent between them. The
//! ratio to the same sum with the autocovariance of filtered white noise widens what the factor says of `φ̂_j`: a mass
//! and an offset rest on the slowest part of the noise, a tensor on what is as fast as the motion. Estimates stay.

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::Estimator;

use super::TAPS;
use super::whiteness::Colour;
use crate::answer::Estimate;
use crate::problem::body::shares::Shares;

/// Lags that products are made for; where noise is remembered for more rows, so many are summed first.
const MOST_LAGS: usize = 250;
/// Numbers that are looked at, shared out evenly over the recording: 60 000 row blocks of a body with its offset.
const MOST_NUMBERS: usize = 60_000 * 6 * 16;

/// Noise of the rows of each channel.
pub(crate) struct Noise<'a> {
    /// Autocovariance of filtered white noise of unit variance at lags of 0, 1, … rows.
    pub white: &'a [f64],
    /// Variance of each channel before the filter that the factor assumes, its unit squared.
    pub variance: &'a [f64],
    /// The channels that show more.
    pub colour: &'a [Colour],
    /// Between row blocks, s.
    pub row_period_s: f64,
}

impl Noise<'_> {
    /// The longest memory of any channel, rows.
    fn longest(&self) -> usize {
        self.colour.iter().map(|c| c.autocovariance.len()).fold(self.white.len(), usize::max)
    }

    /// Rows that are summed before products are made.
    fn several(&self) -> usize {
        self.longest().div_ceil(MOST_LAGS).max(1)
    }

    /// Row blocks that are looked at, in each of so many parts.
    pub(crate) fn most_blocks(&self, parameters: usize, parts: usize) -> usize {
        let block = (self.variance.len() * parameters).max(1);
        (MOST_NUMBERS / block / parts.max(1)).max(4 * self.longest())
    }
}

/// Influence of rows on parameters, summed over several rows: stretches without gaps of `[sum][channel][parameter]`.
#[derive(Clone)]
pub(crate) struct Influences {
    done: Vec<Vec<f64>>,
    sum: Vec<f64>,
    summed: usize,
    several: usize,
    gap_s: f64,
    left: usize,
    last_s: f64,
}

impl Influences {
    /// Of so many parameters, room for so many blocks.
    pub(crate) fn new(noise: &Noise, parameters: usize, most: usize) -> Self {
        Self {
            done: Vec::new(),
            sum: vec![0.0; noise.variance.len() * parameters],
            summed: 0,
            several: noise.several(),
            gap_s: 1.5 * noise.row_period_s,
            left: most,
            last_s: f64::NEG_INFINITY,
        }
    }

    /// Takes a row block: `add` adds its influence, `[channel][parameter]`.
    pub(crate) fn take(&mut self, time_s: f64, add: impl FnOnce(&mut [f64])) {
        if self.left == 0 {
            return;
        }
        self.left -= 1;
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

/// Factor on the standard deviation of each parameter, 1 or more; 1 where nothing is determined.
pub(crate) fn widening(parts: &[Influences], parameters: usize, noise: &Noise) -> Vec<f64> {
    let several = noise.several();
    let lags = noise.longest().div_ceil(several) + 1;
    let stretches: Vec<&[f64]> = parts.iter().flat_map(|part| part.done.iter().map(Vec::as_slice)).collect();
    let (mut white, mut found) = (vec![0.0; parameters], vec![0.0; parameters]);
    for (c, variance) in noise.variance.iter().enumerate() {
        let flat: Vec<f64> = noise.white.iter().map(|w| w * variance).collect();
        let told = noise.colour.iter().find(|colour| colour.channel == c);
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

/// The same of the readings of one body; `sigma` are those that the rows are whitened by.
pub(super) fn widening_of_body<const N: usize>(
    shares: &Shares,
    sigma: [f64; 6],
    estimate: &Estimate,
    noise: &Noise,
) -> Vec<f64> {
    let gain: [[f64; N]; N] =
        std::array::from_fn(|j| std::array::from_fn(|k| estimate.covariance(j, k).unwrap_or(0.0)));
    let start = || Influences::new(noise, N, noise.most_blocks(N, shares.parts()));
    let take = |s: &mut Influences, reading: &Reading<f64>, pipeline: &Estimator<f64, N, TAPS>| {
        let Some(block) = pipeline.last_block() else { return };
        s.take(reading.time_ns as f64 * 1e-9, |sum| {
            for (c, (influence, factor)) in sum.chunks_exact_mut(N).zip(pipeline.last_factors()).enumerate() {
                let weight = factor / (sigma[c] * sigma[c]);
                for (p, gain) in influence.iter_mut().zip(&gain) {
                    let body: f64 = block.columns.iter().zip(gain).map(|(column, g)| column[c] * g).sum();
                    *p += weight * (body + gain.get(10 + c).copied().unwrap_or(0.0));
                }
            }
        });
    };
    // The σ have been accepted before: there is no other way to fail.
    let Ok(done) = shares.absorb(sigma, start, take) else { return vec![1.0; N] };
    widening(&done.parts, N, noise)
}

/// Mean autocovariance between a row of one sum of `several` rows and a row of the sum `m` later, m = 0, 1, ….
fn of_sums(gamma: &[f64], several: usize, lags: usize) -> Vec<f64> {
    let q = several as isize;
    let at = |lag: isize| gamma.get(lag.unsigned_abs()).copied().unwrap_or(0.0);
    (0..lags as isize)
        .map(|m| (1 - q..q).map(|d| (q - d.abs()) as f64 * at(m * q + d)).sum::<f64>() / (q * q) as f64)
        .collect()
}

/// `Σ_i p_ij p_(i+m)j` of one of several channels, pairs within stretches.
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
