//! Outliers: rows far from the answer are given less weight.
//!
//! The rule is the firmware's (`rigident_shared::estimator::Reference`) for any number of channels. A row's
//! residual e against the reference is compared with `k (s + v)`: v is the standard deviation of the filtered
//! noise, or the root mean square of the residuals so far if that is larger; `s = Σ_j |a_j| sd_j` bounds what
//! the reference's own uncertainty brings. Beyond that the row is multiplied by `k (s + v) / |e|` (a
//! redescending M-estimator in one step). A deviation that lasts longer than [`LONGEST`] blocks is no outlier
//! but news: it counts fully until residuals are within the limit again.

use super::left_of_rows::{CHUNK, dot};
use super::{Estimate, RowBlocks, parallel};

pub use rigident_shared::estimator::LONGEST_KNOCK as LONGEST;

/// A row is given less weight beyond this many standard deviations. Of noise alone two rows in 1e9 are.
pub const LIMIT_SD: f64 = 6.0;
/// The answer is made anew at most this often: the first was spoilt by the outliers that it shows.
pub const MOST_ROUNDS: usize = 3;

/// The reference of the residuals, and how far they may be off.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// φ.
    pub parameters: Vec<f64>,
    /// Standard deviation of each parameter; zero where the rows do not determine it, as its value then
    /// explains them as well as any other.
    pub standard_deviation: Vec<f64>,
    /// Variance of the noise relative to σ, as far as it is known to be larger; else 1.
    pub noise_scale: f64,
    /// A row is weighted if its residual exceeds this many standard deviations; zero: never.
    pub limit: f64,
}

impl Reference {
    /// Returns the reference of an estimate. Residuals larger than σ explains make the noise this much
    /// larger, smaller ones do not make it smaller.
    pub fn of(estimate: &Estimate, variance_ratio: f64, limit: f64) -> Self {
        let n = estimate.len();
        let deviation = |j: usize| {
            if estimate.is_determined(j) { estimate.covariance[(j, j)].max(0.0).sqrt() } else { 0.0 }
        };
        Self {
            parameters: estimate.values.clone(),
            standard_deviation: (0..n).map(deviation).collect(),
            noise_scale: variance_ratio.max(1.0),
            limit,
        }
    }

    /// Returns a bound of the share of its own uncertainty in a row.
    fn spread(&self, row: &[f64]) -> f64 {
        row.iter().zip(&self.standard_deviation).map(|(a, sd)| a.abs() * sd).sum()
    }
}

/// Watches every channel, block after block.
#[derive(Clone, Debug)]
pub struct Watch {
    /// Variance of the filtered noise.
    variance: Vec<f64>,
    /// Blocks beyond the limit, in a row.
    lasting: Vec<u16>,
    /// Σ e² of weighted residuals.
    squares: Vec<f64>,
    count: u32,
}

impl Watch {
    /// Returns a watch that has seen nothing; `sigma` per sample before a filter of `noise_gain`.
    pub fn new(sigma: &[f64], noise_gain: f64) -> Self {
        Self {
            variance: sigma.iter().map(|s| s * s * noise_gain).collect(),
            lasting: vec![0; sigma.len()],
            squares: vec![0.0; sigma.len()],
            count: 0,
        }
    }

    /// Forgets the residuals so far.
    pub fn forget_statistics(&mut self) {
        self.squares.fill(0.0);
        self.count = 0;
    }

    /// Writes the weight of each row of a block, 1 for all but outliers; returns true if one is less.
    pub fn weigh(
        &mut self,
        reference: &Reference,
        rows: &[f64],
        measured: &[f64],
        weights: &mut [f64],
    ) -> bool {
        let n = reference.parameters.len().max(1);
        let lines = || rows.chunks_exact(n);
        let left = lines().zip(measured).map(|(row, value)| value - dot(row, &reference.parameters));
        let left: Vec<f64> = left.collect();
        let spread = |c: usize| lines().nth(c).map_or(0.0, |row| reference.spread(row));
        self.weigh_left(reference, &left, spread, weights)
    }

    /// Writes the same for the residuals of a block against the reference; `spread` gives the share of its
    /// own uncertainty in a channel, and is asked for few of them.
    pub fn weigh_left(
        &mut self,
        reference: &Reference,
        left: &[f64],
        mut spread: impl FnMut(usize) -> f64,
        weights: &mut [f64],
    ) -> bool {
        weights.fill(1.0);
        let k = reference.limit;
        if k <= 0.0 {
            return false;
        }
        let count = f64::from(self.count.max(1));
        let mut some = false;
        for (c, (left, weight)) in left.iter().zip(weights).enumerate() {
            let (Some(stated), Some(squares), Some(lasting)) =
                (self.variance.get(c), self.squares.get_mut(c), self.lasting.get_mut(c))
            else {
                return some;
            };
            let size = left.abs();
            let variance = (stated * reference.noise_scale).max(*squares / count);
            // Most rows need neither root nor bound.
            let beyond = size * size > k * k * variance && {
                let limit = k * (spread(c) + variance.sqrt());
                if size > limit && *lasting < LONGEST {
                    *weight = limit / size;
                    some = true;
                }
                size > limit
            };
            *lasting = if beyond { lasting.saturating_add(1) } else { 0 };
            *squares += (*weight * size).powi(2);
        }
        self.count = self.count.saturating_add(1);
        some
    }
}

/// Weights of all rows, one a channel and block; `None` if all count fully.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    all: Option<Vec<f64>>,
    /// Rows of each channel that count less.
    pub outliers: Vec<u32>,
}

impl Weights {
    /// Returns the weights of rows that all count fully.
    pub fn none(channels: usize) -> Self {
        Self { all: None, outliers: vec![0; channels] }
    }

    /// Sets the weights of one block of the given number.
    pub fn set(&mut self, block: usize, blocks: usize, weights: &[f64]) {
        let channels = self.outliers.len();
        let all = self.all.get_or_insert_with(|| vec![1.0; blocks * channels]);
        for (c, (to, from)) in all.iter_mut().skip(block * channels).zip(weights).enumerate() {
            *to = *from;
            if let Some(count) = self.outliers.get_mut(c).filter(|_| *from < 1.0) {
                *count += 1;
            }
        }
    }

    /// Returns the weights of all rows.
    pub fn as_slice(&self) -> Option<&[f64]> {
        self.all.as_deref()
    }

    /// Returns the weights of a block; empty if all rows count fully.
    pub fn of_block(&self, block: usize) -> &[f64] {
        let channels = self.outliers.len();
        self.as_slice().and_then(|all| all.get(block * channels..(block + 1) * channels)).unwrap_or_default()
    }

    /// Compares all row blocks with a reference; `sigma` per sample. Each part is watched by itself.
    pub fn of(blocks: &dyn RowBlocks, reference: &Reference, sigma: &[f64]) -> Self {
        let channels = sigma.len();
        let n = reference.parameters.len();
        if reference.limit <= 0.0 {
            return Self::none(channels);
        }
        let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
            let part = blocks.parts().get(k).cloned().unwrap_or_default();
            let mut watch = Watch::new(sigma, blocks.filter().noise_gain);
            let (mut rows, mut measured) = (vec![0.0; channels * n], vec![0.0; channels]);
            let mut weights = vec![1.0; channels];
            let mut left = vec![0.0; CHUNK * channels];
            // Blocks with outliers are few.
            let mut found: Vec<(usize, Vec<f64>)> = Vec::new();
            for first in part.clone().step_by(CHUNK) {
                let some = first..part.end.min(first + CHUNK);
                let left = &mut left[..some.len() * channels];
                blocks.left(some.clone(), &reference.parameters, left);
                for (block, left) in some.zip(left.chunks_exact(channels.max(1))) {
                    let spread = |c: usize| {
                        blocks.write(block, &mut rows, &mut measured);
                        rows.chunks_exact(n.max(1)).nth(c).map_or(0.0, |row| reference.spread(row))
                    };
                    if watch.weigh_left(reference, left, spread, &mut weights) {
                        found.push((block, weights.clone()));
                    }
                }
            }
            found
        });
        let mut weights = Self::none(channels);
        for (block, own) in parts.into_iter().flatten() {
            weights.set(block, blocks.len(), &own);
        }
        weights
    }
}
