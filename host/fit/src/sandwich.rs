//! The covariance that noise leaves which is slow: the whole of it, not only its diagonal.
//!
//! The scores `Aᵀ n` of the rows have the covariance `J = Σ_c Σ_m γ_c(m) Σ_i a_i a_(i+m)ᵀ` for noise that is
//! stationary in each channel c and independent between them; with the autocovariance of filtered white noise
//! that is `AᵀA` (see docs/estimation.md). What is found beyond white noise makes the rows `R φ = z` noisier,
//! `cov z = 1 + R⁻ᵀ (J − J_white) R⁻¹`, so that the estimate has `R⁻¹ (cov z) R⁻ᵀ`, all its sums and
//! differences too. No direction gets quieter than white noise.

use nalgebra::{DMatrix, SymmetricEigen};

use super::autocorrelation::Coloured;
use super::outliers::Weights;
use super::{Estimate, Factor, Filter, RowBlocks, Whitener, Whitening, parallel};

/// Lags that products are made for; where noise lasts for more rows, this many are summed first.
const MOST_LAGS: usize = 250;
/// Numbers that are examined, shared out evenly over the recording: 60 000 row blocks of a body with its
/// offset.
const MOST_NUMBERS: usize = 60_000 * 6 * 16;
/// Most pieces that a long recording in one part is examined in.
const MOST_PIECES: usize = 64;
/// Sums of rows that are taken side by side.
const TILE: usize = 32;
/// The least singular value, by the largest, of a direction of unit columns that rows determine.
const LEAST_DIRECTION: f64 = 1e-10;
/// Iterations for each column after which singular values are given up; two or three do.
const MOST_SWEEPS: usize = 100;

/// Covariances of the scores of all columns, of the rows that were examined.
pub(super) struct Sandwich {
    white: DMatrix<f64>,
    found: DMatrix<f64>,
    /// All rows by those that were examined.
    share: f64,
    /// The variance of the slowest part of the noise by that of white noise.
    most: f64,
}

/// The noise of the rows of each whitened channel, and how they are weighed.
pub(super) struct SlowNoise<'a> {
    pub whitening: &'a Whitening,
    /// Of outliers.
    pub weights: &'a Weights,
    /// Variance of each channel before the filter that the covariance assumes.
    pub variance: &'a [f64],
    /// The findings in the residuals.
    pub coloured: &'a [Coloured],
}

impl Sandwich {
    /// Returns the covariances of the scores of rows of `n` columns.
    pub(super) fn new(blocks: &dyn RowBlocks, n: usize, slow: &SlowNoise) -> Self {
        let filter = blocks.filter();
        let noise = Noise::new(filter, slow);
        let lead = slow.whitening.lead();
        let pieces = pieces(blocks, &noise, n);
        let parts: Vec<Scores> = parallel::map(parallel::threads(), pieces.len(), |k| {
            let mut part = Scores::new(&noise, n);
            let channels = slow.whitening.channels();
            let (mut rows, mut measured) = (DMatrix::zeros(n, channels), vec![0.0; channels]);
            let mut whitener = Whitener::new(slow.whitening, n);
            let piece = pieces.get(k).cloned().unwrap_or_default();
            for block in piece.start.saturating_sub(lead)..piece.end {
                blocks.write(block, rows.as_mut_slice(), &mut measured);
                let own = Some(slow.weights.of_block(block)).filter(|own| !own.is_empty());
                whitener.apply(blocks.time_s(block), rows.as_mut_slice(), &mut measured, own);
                if block >= piece.start {
                    part.take(blocks.time_s(block), rows.as_slice());
                }
            }
            part
        });
        let channels: Vec<[DMatrix<f64>; 2]> =
            parallel::map(parallel::threads(), noise.variance.len(), |c| noise.of_channel(&parts, n, c));
        let sum = |which: usize| channels.iter().fold(DMatrix::zeros(n, n), |sum, own| sum + &own[which]);
        let looked_at: usize = pieces.iter().map(std::iter::ExactSizeIterator::len).sum();
        let factors = slow.coloured.iter().map(|own| own.found.factor);
        Self {
            white: sum(0),
            found: sum(1),
            share: blocks.len() as f64 / looked_at.max(1) as f64,
            most: factors.fold(1.0, f64::max).powi(2),
        }
    }

    /// Returns the factor on the standard deviation of each of the first `kept` parameters, 1 or more; 1
    /// where nothing is determined. `estimate` is that of white noise, of all columns.
    pub(super) fn inflation(&self, estimate: &Estimate, kept: usize) -> Vec<f64> {
        // Rows lie in what is determined, so that of a parameter that is, the whole row counts.
        let variance = |j: usize, scores: &DMatrix<f64>| {
            let influence = estimate.covariance.row(j);
            (influence * scores * influence.transpose())[0]
        };
        let of = |j: usize| {
            let ratio = (variance(j, &self.found) / variance(j, &self.white)).sqrt();
            // Zero over zero where nothing is determined.
            if estimate.is_determined(j) && ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
        };
        (0..kept.min(estimate.len())).map(of).collect()
    }

    /// Returns the rows of a factor of all columns as noisy as the sandwich says, whose variance is `scale`
    /// times that of the rows that were examined.
    pub(super) fn noisier(&self, rows: &Factor, scale: f64) -> Factor {
        let n = rows.parameters();
        let r = rows.r();
        let norms: Vec<f64> = r.column_iter().map(|column| column.norm()).collect();
        let back = DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(
            n,
            norms.iter().map(|norm| if *norm > 0.0 { 1.0 / norm } else { 0.0 }),
        ));
        // Bounded: the numbers of a recording may be any.
        let svd = (&r * &back).try_svd(true, true, f64::EPSILON, MOST_SWEEPS * n.max(8));
        let Some((svd, (u, v_t))) =
            svd.as_ref().and_then(|svd| Some((svd, svd.u.as_ref().zip(svd.v_t.as_ref())?)))
        else {
            return rows.discount(self.most);
        };
        let least = LEAST_DIRECTION * svd.singular_values.max();
        let inverse = svd.singular_values.map(|s| if s > least { 1.0 / s } else { 0.0 });
        // R⁺, of unit columns.
        let inverse = back * v_t.transpose() * DMatrix::from_diagonal(&inverse) * u.transpose();
        let beyond = (&self.found - &self.white) * (self.share / (scale * scale));
        let beyond = inverse.tr_mul(&beyond) * &inverse;
        let beyond = (&beyond + beyond.transpose()) * 0.5;
        let Some(own) = SymmetricEigen::try_new(beyond, f64::EPSILON, MOST_SWEEPS * n.max(8)) else {
            return rows.discount(self.most);
        };
        let less = own.eigenvalues.map(|e| (1.0 + e.clamp(0.0, self.most - 1.0)).sqrt().recip());
        let turn = DMatrix::from_diagonal(&less) * own.eigenvectors.transpose();
        let mut out = Factor::new(n);
        let values = &turn * nalgebra::DVector::from_column_slice(rows.z());
        out.absorb_matrix(&(turn * r), values.as_slice());
        // As many equations as columns leave nothing.
        out.with_residual(rows.residual_sum_of_squares(), rows.rows())
    }
}

/// Noise of the rows of each channel.
struct Noise<'a> {
    /// Autocovariance of filtered white noise of unit variance at lags of 0, 1, … rows.
    white: Vec<f64>,
    variance: &'a [f64],
    coloured: &'a [Coloured],
    row_period_s: f64,
}

impl<'a> Noise<'a> {
    fn new(filter: &Filter, slow: &SlowNoise<'a>) -> Self {
        Self {
            white: filter.white_autocovariance(),
            variance: slow.variance,
            coloured: slow.coloured,
            row_period_s: filter.row_period_s(),
        }
    }

    /// Returns the longest reach of any channel's autocovariance, rows.
    fn longest(&self) -> usize {
        self.coloured.iter().map(|c| c.autocovariance.len()).fold(self.white.len(), usize::max)
    }

    /// Returns the rows that are summed before products are made.
    fn several(&self) -> usize {
        self.longest().div_ceil(MOST_LAGS).max(1)
    }

    /// Returns the row blocks that are used, in each of the given number of parts.
    fn most_blocks(&self, columns: usize, parts: usize) -> usize {
        let block = (self.variance.len() * columns).max(1);
        (MOST_NUMBERS / block / parts.max(1)).max(4 * self.longest())
    }

    /// Returns the covariance of the scores of a channel with white noise and with what was found.
    fn of_channel(&self, parts: &[Scores], n: usize, channel: usize) -> [DMatrix<f64>; 2] {
        let several = self.several();
        let lags = self.longest().div_ceil(several) + 1;
        let stretches = || parts.iter().flat_map(|part| part.of_channel(channel));
        let flat: Vec<f64> = self.white.iter().map(|w| w * self.variance[channel]).collect();
        let white = products(stretches(), n, &of_sums(&flat, several, lags));
        let found = self
            .coloured
            .iter()
            .find(|own| own.channel == channel)
            .map(|own| products(stretches(), n, &of_sums(&own.autocovariance, several, lags)));
        let found = found.unwrap_or_else(|| white.clone());
        [white, found]
    }
}

/// Rows of all channels, summed over several: stretches without gaps of `[sum][channel][column]`.
struct Scores {
    done: Vec<Vec<f64>>,
    sum: Vec<f64>,
    columns: usize,
    summed: usize,
    several: usize,
    gap_s: f64,
    last_s: f64,
}

impl Scores {
    fn new(noise: &Noise, columns: usize) -> Self {
        Self {
            done: Vec::new(),
            sum: vec![0.0; noise.variance.len() * columns],
            columns,
            summed: 0,
            several: noise.several(),
            gap_s: 1.5 * noise.row_period_s,
            last_s: f64::NEG_INFINITY,
        }
    }

    /// Takes a row block, `[channel][column]`.
    fn take(&mut self, time_s: f64, rows: &[f64]) {
        if time_s - self.last_s > self.gap_s {
            self.start_anew();
            self.done.push(Vec::new());
        }
        self.last_s = time_s;
        self.sum.iter_mut().zip(rows).for_each(|(sum, row)| *sum += row);
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

    /// Returns the sums of a channel, one a column, of every stretch.
    fn of_channel(&self, channel: usize) -> impl Iterator<Item = DMatrix<f64>> {
        let (columns, block) = (self.columns, self.sum.len().max(1));
        self.done.iter().map(move |stretch| {
            let sums = stretch.len() / block;
            let at = |sum: usize| sum * block + channel * columns;
            let all: Vec<f64> =
                (0..sums).flat_map(|sum| stretch[at(sum)..at(sum) + columns].iter().copied()).collect();
            DMatrix::from_vec(columns, sums, all)
        })
    }
}

/// Returns the blocks that are examined: the beginning of every part, or of every piece of a single part.
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

/// Returns the mean autocovariance between a row of one sum of `several` rows and a row of the sum `m` later,
/// m = 0, 1, ….
fn of_sums(gamma: &[f64], several: usize, lags: usize) -> Vec<f64> {
    let q = several as isize;
    let at = |lag: isize| gamma.get(lag.unsigned_abs()).copied().unwrap_or(0.0);
    (0..lags as isize)
        .map(|m| (1 - q..q).map(|d| (q - d.abs()) as f64 * at(m * q + d)).sum::<f64>() / (q * q) as f64)
        .collect()
}

/// Returns `Σ_i Σ_m γ(m) x_i x_(i+m)ᵀ` over both signs of m, pairs within stretches.
fn products(stretches: impl Iterator<Item = DMatrix<f64>>, n: usize, gamma: &[f64]) -> DMatrix<f64> {
    let lags = gamma.iter().rposition(|g| *g != 0.0).map_or(0, |last| last + 1);
    let mut half = DMatrix::zeros(n, n);
    for own in stretches {
        let count = own.ncols();
        for first in (0..count).step_by(TILE) {
            let tile = first..(first + TILE).min(count);
            let mut later: DMatrix<f64> = DMatrix::zeros(n, tile.len());
            for (m, g) in gamma.iter().enumerate().take(lags) {
                // Of the pair of a row with itself there is one.
                let g = if m == 0 { 0.5 * g } else { *g };
                let there = tile.len().min(count.saturating_sub(first + m));
                let from = own.as_slice().get((first + m) * n..(first + m + there) * n).unwrap_or_default();
                later.as_mut_slice().iter_mut().zip(from).for_each(|(sum, x)| *sum += g * x);
            }
            half += own.columns(first, tile.len()) * later.transpose();
        }
    }
    &half + half.transpose()
}

#[cfg(test)]
#[path = "sandwich_tests.rs"]
mod tests;
