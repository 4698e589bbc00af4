//! Intervals where the noise is not white: the sandwich with the autocovariance that the residuals show.
//!
//! `φ̂ − φ = Σ_i p_i n_i` with the influence `p = (AᵀA)⁻¹ a/σ²` of a row, so that the variance of `φ̂_j` is
//! `Σ_c Σ_m γ_c(m) Σ_i p_ij p_(i+m)j` for noise that is stationary in each channel c and independent between them. The
//! ratio to the same sum with the autocovariance of filtered white noise widens what the factor says of `φ̂_j`: a mass
//! and an offset rest on the slowest part of the noise, a tensor on what is as fast as the motion. Estimates stay.

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::Estimator;

use super::TAPS;
use super::absorb::Shares;
use super::whiteness::Colour;
use crate::answer::Estimate;

/// Lags that products are made for; where noise is remembered for more rows, so many are summed first.
const MOST_LAGS: usize = 250;
/// Row blocks looked at, shared out evenly over the recording.
const MOST_BLOCKS: usize = 60_000;

/// Noise of the rows of each channel.
pub(super) struct Noise<'a> {
    /// Autocovariance of filtered white noise of unit variance at lags of 0, 1, … rows.
    pub white: &'a [f64],
    /// Variance of each channel before the filter that the factor assumes, N² and N² m².
    pub variance: [f64; 6],
    /// The channels that show more.
    pub colour: &'a [Colour],
    /// Between row blocks, s.
    pub row_period_s: f64,
}

/// Influence of the rows of a stretch without gaps, `[block][channel][parameter]`, summed over several rows.
#[derive(Clone)]
struct Stretches<const N: usize> {
    done: Vec<Vec<[[f64; N]; 6]>>,
    sum: [[f64; N]; 6],
    summed: usize,
    blocks: usize,
    last_s: f64,
}

/// Factor on the standard deviation of each parameter, 1 or more; 1 where nothing is determined.
///
/// `sigma` are those that the rows are whitened by.
pub(super) fn widening<const N: usize>(
    shares: &Shares,
    sigma: [f64; 6],
    estimate: &Estimate,
    noise: &Noise,
) -> [f64; N] {
    let longest = noise.colour.iter().map(|c| c.autocovariance.len()).fold(noise.white.len(), usize::max);
    let several = longest.div_ceil(MOST_LAGS).max(1);
    let lags = longest.div_ceil(several) + 1;
    let most = (MOST_BLOCKS / shares.parts().max(1)).max(4 * longest);
    let gain: [[f64; N]; N] =
        std::array::from_fn(|j| std::array::from_fn(|k| estimate.covariance(j, k).unwrap_or(0.0)));

    let start = || Stretches::<N> {
        done: Vec::new(),
        sum: [[0.0; N]; 6],
        summed: 0,
        blocks: 0,
        last_s: f64::NEG_INFINITY,
    };
    let take = |s: &mut Stretches<N>, reading: &Reading<f64>, pipeline: &Estimator<f64, N, TAPS>| {
        let Some(block) = pipeline.last_block().filter(|_| s.blocks < most) else { return };
        s.blocks += 1;
        let time_s = reading.time_ns as f64 * 1e-9;
        if time_s - s.last_s > 1.5 * noise.row_period_s {
            (s.sum, s.summed) = ([[0.0; N]; 6], 0);
            s.done.push(Vec::new());
        }
        s.last_s = time_s;
        for (c, (influence, factor)) in s.sum.iter_mut().zip(pipeline.last_factors()).enumerate() {
            let weight = factor / (sigma[c] * sigma[c]);
            for (p, gain) in influence.iter_mut().zip(&gain) {
                let body: f64 = block.columns.iter().zip(gain).map(|(column, g)| column[c] * g).sum();
                *p += weight * (body + gain.get(10 + c).copied().unwrap_or(0.0));
            }
        }
        s.summed += 1;
        if s.summed == several {
            if let Some(stretch) = s.done.last_mut() {
                stretch.push(s.sum);
            }
            (s.sum, s.summed) = ([[0.0; N]; 6], 0);
        }
    };
    // The σ have been accepted before: there is no other way to fail.
    let Ok(done) = shares.absorb(sigma, start, take) else { return [1.0; N] };
    let stretches: Vec<Vec<[[f64; N]; 6]>> = done.parts.into_iter().flat_map(|part| part.done).collect();

    let (mut white, mut found) = ([0.0; N], [0.0; N]);
    for c in 0..6 {
        let flat: Vec<f64> = noise.white.iter().map(|w| w * noise.variance[c]).collect();
        let told = noise.colour.iter().find(|colour| colour.channel == c);
        let (flat_sums, told_sums) =
            (of_sums(&flat, several, lags), told.map(|t| of_sums(&t.autocovariance, several, lags)));
        for m in 0..lags {
            let both = if m == 0 { 1.0 } else { 2.0 };
            let (g, t) = (both * flat_sums[m], both * told_sums.as_ref().unwrap_or(&flat_sums)[m]);
            if g == 0.0 && t == 0.0 {
                continue;
            }
            let products = products(&stretches, c, m);
            for ((white, found), product) in white.iter_mut().zip(&mut found).zip(products) {
                *white += g * product;
                *found += t * product;
            }
        }
    }
    std::array::from_fn(|j| {
        let ratio = (found[j] / white[j]).sqrt();
        // Zero over zero where nothing is determined.
        if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
    })
}

/// Mean autocovariance between a row of one sum of `several` rows and a row of the sum `m` later, m = 0, 1, ….
fn of_sums(gamma: &[f64], several: usize, lags: usize) -> Vec<f64> {
    let q = several as isize;
    let at = |lag: isize| gamma.get(lag.unsigned_abs()).copied().unwrap_or(0.0);
    (0..lags as isize)
        .map(|m| (1 - q..q).map(|d| (q - d.abs()) as f64 * at(m * q + d)).sum::<f64>() / (q * q) as f64)
        .collect()
}

/// `Σ_i p_ij p_(i+m)j` of one channel, pairs within stretches.
fn products<const N: usize>(stretches: &[Vec<[[f64; N]; 6]>], channel: usize, m: usize) -> [f64; N] {
    let mut sums = [0.0; N];
    for stretch in stretches {
        for (a, b) in stretch.iter().zip(stretch.iter().skip(m)) {
            let (Some(a), Some(b)) = (a.get(channel), b.get(channel)) else { continue };
            for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
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
