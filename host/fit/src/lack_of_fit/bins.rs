//! Means of whitened rows over bins of time: what is slow in a recording, in a size that every pair of bins
//! can be examined.
//!
//! Any mean of rows leaves the equation exact. Bins are at least as long as the filter, so that white noise
//! is all but independent from bin to bin; a sum of w rows over `√w` then has the variance that the rows'
//! covariance states, 1.

use nalgebra::{DMatrix, DVector};

use super::{MEASURED, Rows};
use crate::Whitener;
use crate::left_of_rows::left_of_rows;

/// Bins at most.
const MOST: usize = 2000;
/// Bins with an outlier are left out if they are at most this share of all: knocks are. A changed body stays.
const KNOCKS: f64 = 0.1;
/// A step longer than this many periods is a gap.
const GAP: f64 = 1.5;

/// Bins of a recording.
#[derive(Clone)]
pub(super) struct Bins {
    pub(super) channels: usize,
    pub(super) columns: usize,
    /// By channels: bins × columns.
    pub(super) rows: Vec<DMatrix<f64>>,
    /// By channels: residuals of the estimate.
    pub(super) residuals: Vec<DVector<f64>>,
    /// First row block of each bin.
    pub(super) first: Vec<usize>,
    /// Row blocks of a bin.
    pub(super) several: usize,
    /// Root mean square of the residuals over that of the measurements.
    pub(super) unexplained: f64,
    /// The estimate, zero of columns that it does not have; last the measured side's −1.
    pub(super) about: DVector<f64>,
    /// By channels: what noise of the signals has in a bin.
    pub(super) noise: Vec<BinNoise>,
}

/// Noise Δ of the signals in the rows of a channel in one bin.
#[derive(Clone)]
pub(super) struct BinNoise {
    /// `κ = E[ΔᵀΔ]`, of one more column, the measured side's.
    pub(super) gram: DMatrix<f64>,
    /// Variance of a row's product with its residual beyond that of independent ones, over `κφ (κφ)ᵀ`: one of
    /// the noise that is there, the rest of the series that κ is a mean of.
    pub(super) uncertain: f64,
    /// By how much κ may be wrong, as a share of itself.
    pub(super) doubt: f64,
}

impl BinNoise {
    /// Returns no noise in the given number of columns.
    fn none(columns: usize) -> Self {
        Self { gram: DMatrix::zeros(columns, columns + 1), uncertain: 0.0, doubt: 0.0 }
    }
}

/// Returns the noise in bins of the given number of blocks, by channels; there are `count` bins. `visit` is
/// called with the number of a series and the rows of each of its blocks.
fn noise_of(
    rows: &Rows,
    wide: usize,
    several: usize,
    count: usize,
    mut visit: impl FnMut(usize, &[f64]),
) -> Vec<BinNoise> {
    let channels = rows.whitening.channels();
    let mut all = vec![BinNoise::none(wide); channels];
    let Some(noise) = rows.noise else { return all };
    let n = rows.values.len();
    let mut fewest = f64::INFINITY;
    for series in 0..noise.series() {
        let mut grams = vec![DMatrix::<f64>::zeros(wide + 1, wide + 1); channels];
        let mut sums = vec![DVector::<f64>::zeros(wide + 1); channels];
        let (mut in_bin, mut bins) = (0, 0.0);
        noise.each(series, &mut |_, own| {
            visit(series, own);
            for (sum, row) in sums.iter_mut().zip(own.chunks_exact(n + 1)) {
                sum.iter_mut().zip(row).take(n).for_each(|(s, v)| *s += v);
                sum[wide] += row[n];
            }
            in_bin += 1;
            if in_bin == several {
                for (gram, sum) in grams.iter_mut().zip(&mut sums) {
                    gram.syger(1.0 / several as f64, sum, sum, 1.0);
                    sum.fill(0.0);
                }
                (in_bin, bins) = (0, bins + 1.0);
            }
        });
        for (own, gram) in all.iter_mut().zip(&mut grams).filter(|_| bins > 0.0) {
            gram.fill_upper_triangle_with_lower_triangle();
            own.gram += gram.rows(0, wide) * (noise.weight(series) / bins);
        }
        fewest = fewest.min(bins);
    }
    for own in &mut all {
        own.doubt = noise.doubt();
        own.uncertain = 1.0 + count as f64 / fewest.max(1.0);
    }
    all
}

impl Bins {
    /// Returns the bins of whitened rows; residuals are those of the estimate.
    pub(super) fn new(rows: &Rows) -> Self {
        Self::with(rows, 0..rows.blocks.len(), rows.values.len(), |_, _, _| (), |_, _| ())
    }

    /// Returns the bins of some whitened rows of `wide` columns, which `extend` writes behind those of the
    /// estimate: it takes the block, its rows of `wide` columns, and its residuals. `of_noise` takes the
    /// number of a series of noise and the whitened rows of each of its blocks.
    pub(super) fn with(
        rows: &Rows,
        range: std::ops::Range<usize>,
        wide: usize,
        mut extend: impl FnMut(usize, &mut [f64], &[f64]),
        of_noise: impl FnMut(usize, &[f64]),
    ) -> Self {
        let (channels, n) = (rows.whitening.channels(), rows.values.len());
        let filter = rows.blocks.filter();
        let period_s = filter.row_period_s();
        let least = if period_s > 0.0 { (filter.width_s / period_s).round() as usize } else { 1 };
        let several = least.max(range.len().div_ceil(MOST)).max(1);
        let mut all = Gathered { channels, n: wide, several, ..Gathered::default() };
        all.sum = vec![0.0; channels * (wide + 1)];
        let mut whitener = Whitener::new(rows.whitening, n);
        let mut made = Made::new(rows, channels);
        let mut extended = vec![0.0; channels * wide];
        let (mut whole, mut left) = (0.0, 0.0);
        let mut before: Option<f64> = None;
        for block in range.clone() {
            let (own, measured, remains) = made.block(rows, block, range.end);
            for (value, remains) in measured.iter_mut().zip(remains) {
                whole += *value * *value;
                *value = *remains;
                left += *value * *value;
            }
            let time_s = rows.blocks.time_s(block);
            whitener.apply(time_s, own, measured, None);
            if before.is_some_and(|before| time_s - before > GAP * period_s) {
                all.start_anew();
            }
            before = Some(time_s);
            for (to, from) in extended.chunks_exact_mut(wide.max(1)).zip(own.chunks_exact(n.max(1))) {
                to[..n].copy_from_slice(from);
            }
            extend(block, &mut extended, measured);
            let is_knocked = rows.weights.of_block(block).iter().any(|w| *w < 1.0);
            all.take(block, &extended, measured, is_knocked);
        }
        let own = all.finish();
        let value = |j: usize| rows.values.get(j).copied().unwrap_or(0.0);
        let about = DVector::from_fn(wide + 1, |j, _| if j < wide { value(j) } else { MEASURED });
        let noise = noise_of(rows, wide, several, own.len(), of_noise);
        Self { unexplained: if whole > 0.0 { (left / whole).sqrt() } else { 0.0 }, about, noise, ..own }
    }

    /// Returns the same with some of the columns; the residuals stay.
    pub(super) fn only(self, columns: &[usize]) -> Self {
        let rows = self.rows.iter().map(|rows| rows.select_columns(columns)).collect();
        let with_measured: Vec<usize> = columns.iter().copied().chain([self.columns]).collect();
        let noise = self.noise.iter().map(|noise| BinNoise {
            gram: noise.gram.select_rows(columns).select_columns(&with_measured),
            ..*noise
        });
        let noise = noise.collect();
        Self { columns: columns.len(), rows, about: self.about.select_rows(&with_measured), noise, ..self }
    }

    /// Returns the same with the columns `steps` once more, from a bin on; noise of the signals is left out.
    pub(super) fn with_step(&self, steps: &[usize], from: usize) -> Self {
        let rows = self.rows.iter().map(|rows| {
            let mut rows = rows.clone().resize_horizontally(self.columns + steps.len(), 0.0);
            for (k, step) in steps.iter().enumerate() {
                let later = rows.column(*step).rows_range(from..).into_owned();
                rows.column_mut(self.columns + k).rows_range_mut(from..).copy_from(&later);
            }
            rows
        });
        let rows = rows.collect();
        let columns = self.columns + steps.len();
        let noise = (0..self.channels).map(|_| BinNoise::none(columns)).collect();
        let about = DVector::from_fn(columns + 1, |j, _| if j < columns { 0.0 } else { MEASURED });
        Self { columns, rows, noise, about, ..self.clone() }
    }

    /// Returns the number of bins.
    pub(super) fn len(&self) -> usize {
        self.first.len()
    }
}

/// Blocks that are made at once.
const AT_ONCE: usize = 16;

/// Rows, measurements and residuals of some blocks.
struct Made {
    channels: usize,
    blocks: std::ops::Range<usize>,
    rows: Vec<f64>,
    measured: Vec<f64>,
    left: Vec<f64>,
}

impl Made {
    fn new(rows: &Rows, channels: usize) -> Self {
        let room = || vec![0.0; AT_ONCE * channels];
        Self {
            channels,
            blocks: 0..0,
            rows: vec![0.0; AT_ONCE * channels * rows.values.len()],
            measured: room(),
            left: room(),
        }
    }

    /// Returns rows, measurements and residuals of a block; they are asked for one after the other.
    fn block(&mut self, rows: &Rows, block: usize, end: usize) -> (&mut [f64], &mut [f64], &[f64]) {
        let (channels, length) = (self.channels, self.channels * rows.values.len());
        if !self.blocks.contains(&block) {
            self.blocks = block..end.min(block + AT_ONCE);
            let count = self.blocks.len();
            let (own, measured) = (&mut self.rows[..count * length], &mut self.measured[..count * channels]);
            rows.blocks.write_blocks(self.blocks.clone(), channels, own, measured);
            left_of_rows(own, measured, rows.values, &mut self.left[..count * channels]);
        }
        let k = block - self.blocks.start;
        let of_channels = k * channels..(k + 1) * channels;
        (
            &mut self.rows[k * length..(k + 1) * length],
            &mut self.measured[of_channels.clone()],
            &self.left[of_channels],
        )
    }
}

#[derive(Default)]
struct Gathered {
    channels: usize,
    n: usize,
    several: usize,
    /// Rows and residuals of the bin under way, summed.
    sum: Vec<f64>,
    count: usize,
    is_knocked: bool,
    bins: Vec<Vec<f64>>,
    first: Vec<usize>,
    knocked: Vec<bool>,
}

impl Gathered {
    fn start_anew(&mut self) {
        self.sum.fill(0.0);
        (self.count, self.is_knocked) = (0, false);
    }

    fn take(&mut self, block: usize, rows: &[f64], residuals: &[f64], is_knocked: bool) {
        let lines = rows.chunks_exact(self.n.max(1)).zip(residuals);
        for (sum, (row, residual)) in self.sum.chunks_exact_mut(self.n + 1).zip(lines) {
            let (sums, last) = sum.split_at_mut(self.n);
            sums.iter_mut().zip(row).for_each(|(s, v)| *s += v);
            last.iter_mut().for_each(|s| *s += residual);
        }
        self.count += 1;
        self.is_knocked |= is_knocked;
        if self.count == self.several {
            let root = (self.several as f64).sqrt();
            self.bins.push(self.sum.iter().map(|v| v / root).collect());
            self.first.push(block + 1 - self.several);
            self.knocked.push(self.is_knocked);
            self.start_anew();
        }
    }

    fn finish(self) -> Bins {
        let count = self.bins.len();
        // A knock reaches as far as the filter does.
        let is_near = |b: &usize| (b.saturating_sub(1)..count.min(b + 2)).any(|b| self.knocked[b]);
        let near = (0..count).filter(is_near).count();
        let are_knocks = near as f64 <= KNOCKS * count as f64;
        let kept: Vec<usize> = (0..count).filter(|b| !(are_knocks && is_near(b))).collect();
        let at = |b: usize, c: usize, j: usize| self.bins[kept[b]][c * (self.n + 1) + j];
        let rows = |c| DMatrix::from_fn(kept.len(), self.n, |b, j| at(b, c, j));
        let residuals = |c| DVector::from_fn(kept.len(), |b, _| at(b, c, self.n));
        Bins {
            channels: self.channels,
            columns: self.n,
            rows: (0..self.channels).map(rows).collect(),
            residuals: (0..self.channels).map(residuals).collect(),
            first: kept.iter().map(|b| self.first[*b]).collect(),
            several: self.several,
            unexplained: 0.0,
            about: DVector::zeros(self.n + 1),
            noise: Vec::new(),
        }
    }
}
