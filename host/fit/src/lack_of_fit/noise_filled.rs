//! Directions of a step that noise could fill.
//!
//! At rest an accelerometer shows gravity and noise, so that noise alone tells a mass from an offset there.
//! This is wrong by as much as the size of the noise in the rows is, which is not known to better than a
//! factor where the noise is not white: filters, steps and repeated samples make it larger in the band of the
//! rows than differences of samples show. So the noise is taken as the larger of what those differences say
//! and of the scatter κ of the rows in a rest, of which no more counts than the residuals have room for,
//! `φᵀ κ φ` of a bin: the rest may not be still. A direction in which noise could be more than a tenth of
//! what is known on either side of a step, offsets given, is no evidence of a change.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::bins::Bins;
use super::directions::{LEAST, filled, seen};
use super::metric::{Metric, product};
use super::noise::PowerLaw;

/// The time in which rows are quietest, s, and the least number of its bins.
const QUIET_S: f64 = 1.0;
const LEAST_QUIET: usize = 8;
/// It is a rest if the wrench varies by less than this share of its variance.
const RESTS: f64 = 0.03;
/// Noise that the scatter of a short time may have missed.
const MISSED: f64 = 1.15;
/// Sweeps of a singular value decomposition, for each column, at most.
const MOST_SWEEPS: usize = 100;

/// The time in which the rows scatter least.
pub(super) struct Quiet {
    bins: Range<usize>,
    /// Square that the scatter leaves in the residuals of each channel if it is noise.
    would_leave: Vec<f64>,
    is_rest: bool,
}

impl Quiet {
    /// Returns the time in which all columns scatter least for their size; a bin is `bin_s` long.
    pub(super) fn new(bins: &Bins, bin_s: f64) -> Self {
        let count = bins.len();
        let long = (QUIET_S / bin_s.max(f64::MIN_POSITIVE)).ceil().min(count as f64) as usize;
        let long = long.max(LEAST_QUIET).min(count);
        let mean = |rows: &DMatrix<f64>| rows.map(|v| v * v).row_sum().transpose() / count.max(1) as f64;
        let whole: Vec<DVector<f64>> = bins.rows.iter().map(mean).collect();
        let scatters = |first: usize| {
            let own = bins.rows.iter().map(|rows| variances(&rows.rows(first, long).into_owned()));
            let shares = own.zip(&whole).map(|(own, whole)| {
                own.iter()
                    .zip(whole)
                    .filter(|(_, whole)| **whole > 0.0)
                    .map(|(own, whole)| own / whole)
                    .sum::<f64>()
            });
            shares.sum::<f64>()
        };
        let starts = (0..=count - long).step_by((long / 4).max(1));
        let first = starts.map(|first| (first, scatters(first))).min_by(|a, b| a.1.total_cmp(&b.1));
        let first = first.map_or(0, |(first, _)| first);
        let mut quiet = Self { bins: first..first + long, would_leave: Vec::new(), is_rest: false };
        let about = bins.about.rows(0, bins.columns).into_owned();
        let left = |scatter: DMatrix<f64>| about.dot(&(scatter * &about));
        quiet.would_leave = bins.rows.iter().map(|rows| left(quiet.scatter(rows))).collect();
        let moves: f64 = bins.rows.iter().map(|rows| left(scatter(rows))).sum();
        quiet.is_rest = quiet.would_leave.iter().sum::<f64>() < RESTS * moves;
        quiet
    }

    /// Returns the squares of columns in a bin that could be noise, if all that they do in that time is.
    pub(super) fn scatter(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        scatter(&columns.rows(self.bins.start, self.bins.len()).into_owned()) * MISSED
    }

    /// Returns the share of that which residuals of some noise have room for; nothing without a rest.
    pub(super) fn room(&self, channel: usize, noise: &[PowerLaw]) -> f64 {
        if !self.is_rest {
            return 0.0;
        }
        let would = self.would_leave.get(channel).copied().unwrap_or(0.0);
        let left = noise.get(channel).map_or(0.0, |noise| noise.white + noise.flicker);
        if would > left { left / would } else { 1.0 }
    }
}

/// Holds the noise that could be in the columns that may step.
pub(super) struct NoiseFilled<'a> {
    bins: &'a Bins,
    quiet: Quiet,
    offsets: usize,
    /// The columns by channels.
    own: Vec<DMatrix<f64>>,
    /// Squares of noise in a bin, by channels, as differences of samples say and as the quietest time shows.
    could: [Vec<DMatrix<f64>>; 2],
}

impl<'a> NoiseFilled<'a> {
    /// Returns the noise in `columns`, the first of which are `offsets`; a bin is `bin_s` long.
    pub(super) fn new(bins: &'a Bins, columns: &[usize], offsets: usize, bin_s: f64) -> Self {
        let own: Vec<DMatrix<f64>> = bins.rows.iter().map(|rows| rows.select_columns(columns)).collect();
        let stated =
            bins.noise.iter().map(|noise| noise.gram.select_rows(columns).select_columns(columns) * MISSED);
        let quiet = Quiet::new(bins, bin_s);
        let shown = own.iter().map(|rows| quiet.scatter(rows)).collect();
        Self { bins, offsets, could: [stated.collect(), shown], own, quiet }
    }

    /// Returns the directions that noise could fill before or after a bin; `noise` is that of the residuals
    /// beside a step there.
    pub(super) fn at(&self, bin: usize, metrics: &[Metric], noise: &[PowerLaw]) -> Vec<DVector<f64>> {
        let room: Vec<f64> = (0..self.own.len()).map(|c| self.quiet.room(c, noise)).collect();
        let sides = [0..bin, bin..self.bins.len()];
        sides.into_iter().flat_map(|side| self.of(side, metrics, &room)).collect()
    }

    fn of(&self, side: Range<usize>, metrics: &[Metric], room: &[f64]) -> Vec<DVector<f64>> {
        let q = self.own.first().map_or(0, DMatrix::ncols);
        let n = q - self.offsets;
        let mut known = DMatrix::<f64>::zeros(q, q);
        let mut could = [DMatrix::<f64>::zeros(q, q), DMatrix::zeros(q, q)];
        for (c, (own, metric)) in self.own.iter().zip(metrics).enumerate() {
            let mut sum = 0.0;
            for bin in side.clone() {
                let weight = metric.of_bin(bin).max(0.0);
                let row = own.row(bin).transpose();
                known.ger(weight, &row, &row, 1.0);
                sum += weight;
            }
            let room = [1.0, room.get(c).copied().unwrap_or(1.0)];
            for ((to, of), room) in could.iter_mut().zip(&self.could).zip(room) {
                *to += of.get(c).map_or_else(|| DMatrix::zeros(q, q), |gram| gram * (room * sum));
            }
        }
        // Offsets given: what a column has in common with them tells of no body.
        let shared = given(&known, self.offsets);
        let to = |matrix: &DMatrix<f64>| matrix.view((self.offsets, self.offsets), (n, n)).into_owned();
        let beside = to(&known) - known.view((self.offsets, 0), (n, self.offsets)) * &shared;
        let unit = seen(&beside);
        let found = could.iter().zip(unit.iter().cycle()).flat_map(|(could, unit)| filled(unit, &to(could)));
        let whole = |v: DVector<f64>| {
            let offsets = -(&shared * &v);
            DVector::from_iterator(q, offsets.iter().chain(v.iter()).copied())
        };
        found.map(whole).collect()
    }
}

/// Returns what offsets take of the other columns: `(XᵀX)⁺ XᵀY`.
fn given(known: &DMatrix<f64>, offsets: usize) -> DMatrix<f64> {
    let n = known.nrows() - offsets;
    let own = known.view((0, 0), (offsets, offsets)).into_owned();
    let across = known.view((0, offsets), (offsets, n)).into_owned();
    let none = || DMatrix::zeros(offsets, n);
    if own.is_empty() {
        return none();
    }
    let svd = own.try_svd(true, true, f64::EPSILON, MOST_SWEEPS * offsets);
    svd.and_then(|svd| svd.solve(&across, LEAST).ok()).unwrap_or_else(none)
}

/// Returns the covariance of rows about a line in time.
fn scatter(rows: &DMatrix<f64>) -> DMatrix<f64> {
    let left = off_line(rows);
    product(&left, &left) / (rows.nrows() as f64 - 2.0).max(1.0)
}

/// Returns the variances of rows about a line in time.
fn variances(rows: &DMatrix<f64>) -> DVector<f64> {
    let squares = off_line(rows).column_iter().map(|own| own.norm_squared()).collect();
    DVector::from_vec(squares) / (rows.nrows() as f64 - 2.0).max(1.0)
}

/// Returns rows less a line in time.
fn off_line(rows: &DMatrix<f64>) -> DMatrix<f64> {
    let count = rows.nrows();
    let middle = 0.5 * (count as f64 - 1.0);
    let line = DMatrix::from_fn(count, 2, |b, k| if k == 0 { 1.0 } else { b as f64 - middle });
    let norms = [count as f64, line.column(1).norm_squared()];
    let mut left = rows.clone();
    for (k, norm) in norms.into_iter().enumerate().filter(|(_, norm)| *norm > 0.0) {
        let line = line.column(k);
        let along = line.tr_mul(rows) / norm;
        left -= line * along;
    }
    left
}
