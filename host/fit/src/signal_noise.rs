//! Noise of the signals that coefficients are made of: it is in the rows, and does not average out there.
//!
//! With rows `A + Δ` in place of A, the residual of the truth is `w − Δ φ`: its covariance has, beside that
//! of the measured side, `Σ_s(φ) = E[Δφ (Δφ)ᵀ]`, which weights are made of. And the normal equations have the
//! expectation `K = E[Δᵀ W Δ]` too much, which draws the estimate to zero; it is taken off (T. Söderström,
//! Errors-in-Variables Methods in System Identification, 2018, bias-eliminating least squares). Both are
//! found by noise of the same size and either sign that is added once more: half the difference of the two
//! filtered recordings is Δ to third order, whatever the source.
//!
//! If the measured side is made of the same signals, as the forces of springs are of poses, it has the noise
//! δ: the residual is `w + δ − Δ φ`, and the normal equations have `Δᵀ W δ` too. So it is a last column of
//! the noise, of the parameter −1.

mod differences;
mod whitened;

use std::ops::AddAssign as _;
use std::sync::{Mutex, PoisonError};

use nalgebra::{DMatrix, DVector};

use super::features;
use super::lack_of_fit::MEASURED;
use super::left_of_rows;
use super::linearised::{Columns, Linearised, NoiseColumns, Sensitivities};
use super::residual_spectrum::{Band, measured, restore};
use super::weighing::{Residuals, Spectrum, Weighing};
use super::{Filter, FitError, RowBlocks, RowSource, SignalNoise, Whitener};
use differences::{Difference, Differences, Noisy};
pub(super) use whitened::WhitenedNoise;

/// Longer recordings are examined in their middle.
const LONGEST: usize = 20_000;
/// Shorter ones are examined so often that there are about as many row blocks.
const LEAST_BLOCKS: usize = 2_000;
/// Most repetitions.
const MOST_REPETITIONS: usize = 8;
/// Products that a Gram matrix of the rows, or one with nuisance parameters for each repetition, may take.
const MOST_PRODUCTS: usize = 100_000_000;
/// Columns of noise are made anew where what is predicted moves by more than this: their squares have a
/// sampling error of some per cent; wherever it moves, if the measured side has the same noise: errors of
/// springs and a body that is larger are then nearly one, and what tells them apart is no larger than that.
const NEAR: f64 = 0.01;
/// Lags of the rows that coloured noise is examined.
const CORRELATED_LAGS: usize = 200;

/// Noise in the rows of a source, by groups of signals.
pub(super) struct RowNoise<'a> {
    groups: Vec<Group<'a>>,
    /// Row blocks of the whole recording.
    blocks: f64,
    measured: Vec<Band>,
    /// `2 Σ ρ²` of noise that is not white before the filter: its squares are this much less independent.
    /// Zero of white noise.
    correlated: f64,
    /// Gram matrix of the rows.
    gram: DMatrix<f64>,
    parameters: usize,
    channels: usize,
    /// Columns of nuisance parameters that noise is in, of the last time.
    kept: Mutex<Option<Kept>>,
}

/// Columns of nuisance parameters in the rows with noise of either sign, by groups and repetitions.
struct Kept {
    /// The point that they are linearised about.
    phi: Vec<f64>,
    sensitivities: Vec<Vec<Option<[Sensitivities; 2]>>>,
}

struct Group<'a> {
    noise: SignalNoise,
    /// Columns that it reaches; the measured side comes after the parameters.
    reached: Vec<usize>,
    repetitions: Vec<Difference<'a>>,
}

/// Returns the Gram matrix of the rows of each channel, as of all blocks.
fn channel_grams(blocks: &dyn RowBlocks, channels: usize, n: usize) -> Vec<DMatrix<f64>> {
    let (mut rows, mut measured) = (vec![0.0; channels * n], vec![0.0; channels]);
    let mut grams = vec![DMatrix::<f64>::zeros(n, n); channels];
    let most = (MOST_PRODUCTS / (channels * n * n).max(1)).max(LEAST_BLOCKS / 4);
    let every = blocks.len().div_ceil(most).max(1);
    let (mut count, mut own) = (0, Vec::with_capacity(n));
    for block in (0..blocks.len()).step_by(every) {
        blocks.write(block, &mut rows, &mut measured);
        count += 1;
        for (gram, row) in grams.iter_mut().zip(rows.chunks_exact(n.max(1))) {
            // A channel has few of the columns.
            own.clear();
            own.extend(row.iter().copied().enumerate().filter(|(_, a)| *a != 0.0));
            for (k, (j, a)) in own.iter().enumerate() {
                let column = &mut gram.as_mut_slice()[j * n..(j + 1) * n];
                own[k..].iter().for_each(|(i, b)| column[*i] += a * b);
            }
        }
    }
    let share = blocks.len() as f64 / f64::from(count.max(1));
    for gram in &mut grams {
        gram.fill_upper_triangle_with_lower_triangle();
        *gram *= share;
    }
    grams
}

impl<'a> Group<'a> {
    fn new(noise: SignalNoise, mut repetitions: Vec<Difference<'a>>, n: usize) -> Self {
        let is_reached = |j: &usize| {
            let mut of_rows = repetitions.iter().flat_map(|r| r.rows.iter().skip(*j).step_by(n + 1));
            of_rows.any(|a| *a != 0.0)
        };
        let reached: Vec<usize> = (0..=n).filter(is_reached).collect();
        for repetition in &mut repetitions {
            repetition.keep(&reached, n + 1);
        }
        Self { noise, reached, repetitions }
    }

    /// Returns the values of the columns reached.
    fn values(&self, phi: &[f64]) -> Vec<f64> {
        self.reached.iter().map(|j| phi.get(*j).copied().unwrap_or(MEASURED)).collect()
    }

    /// Returns `2 Σ ρ²` over the lags of the rows, of the channel's column where it is most.
    fn correlated(&self, channels: usize) -> f64 {
        let (width, lines) = (self.reached.len().max(1), channels.max(1) * self.reached.len().max(1));
        let of = |place: usize| {
            let mut sums = [0.0; CORRELATED_LAGS];
            for repetition in &self.repetitions {
                let own: Vec<f64> = repetition.rows.iter().skip(place).step_by(lines).copied().collect();
                for (lag, sum) in sums.iter_mut().enumerate() {
                    *sum += own.iter().zip(own.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
                }
            }
            let [zero, rest @ ..] = sums;
            if zero > 0.0 { rest.iter().map(|sum| 2.0 * (sum / zero).powi(2)).sum() } else { 0.0 }
        };
        (0..channels * width).map(of).fold(0.0, f64::max)
    }

    /// Returns the rows of a block of a repetition.
    fn block(&self, repetition: usize, block: usize, channels: usize) -> &[f64] {
        let length = channels * self.reached.len();
        let rows =
            self.repetitions.get(repetition).and_then(|r| r.rows.get(block * length..(block + 1) * length));
        rows.unwrap_or_default()
    }
}

impl<'a> RowNoise<'a> {
    /// Returns the noise in the rows; `None` if the source knows of none. `with_nuisances` tells if their
    /// columns have noise too.
    ///
    /// # Errors
    /// [`FitError`] if the middle of a recording cannot be filtered.
    pub(super) fn of(
        source: &'a dyn RowSource,
        blocks: &dyn RowBlocks,
        with_nuisances: bool,
    ) -> Result<Option<Self>, FitError> {
        let features = with_nuisances.then(|| blocks.features());
        let differences = Differences::of(source, features);
        let (channels, n, samples) = (source.channels().len(), source.parameters().len(), source.samples());
        let from = samples.saturating_sub(LONGEST) / 2;
        let middle = from..samples.min(from + LONGEST);
        let grams = channel_grams(blocks, channels, n);
        let rows = (blocks.len() * channels).max(1) as f64;
        let square = |j: usize| grams.iter().map(|gram| gram[(j, j)]).sum::<f64>();
        let scale: Vec<f64> = (0..n).map(|j| (square(j) / rows).sqrt()).collect();
        let felt = differences.felt(&middle, &scale)?;
        let of_middle = blocks.len() as f64 * middle.len() as f64 / samples.max(1) as f64;
        let repetitions = (LEAST_BLOCKS as f64 / of_middle.max(1.0)).ceil() as usize;
        let repetitions = repetitions.clamp(1, MOST_REPETITIONS);
        let groups = differences.groups(&felt, &middle, repetitions)?;
        let Some(groups) = groups.filter(|groups| !groups.is_empty()) else { return Ok(None) };
        let measured = measured(blocks, channels, n);
        let blocks = blocks.len() as f64;
        let gram = grams.iter().fold(DMatrix::zeros(n, n), |sum, gram| sum + gram);
        let coloured = groups.iter().filter(|_| !source.signal_noise_is_white());
        let correlated = coloured.map(|group| group.correlated(channels)).fold(0.0, f64::max);
        Ok(Some(Self {
            groups,
            blocks,
            measured,
            correlated,
            gram,
            parameters: n,
            channels,
            kept: Mutex::new(None),
        }))
    }

    /// Returns the covariance of the noise by bands: that of residuals with what all columns of the rows took
    /// of it.
    pub(super) fn restored(&self, residuals: &Residuals, rows: &dyn RowBlocks) -> Vec<Band> {
        let grams = channel_grams(rows, self.channels, residuals.covariance.nrows());
        let taken: Vec<f64> = grams.iter().map(|gram| gram.dot(&residuals.covariance)).collect();
        let mut bands = residuals.bands.clone();
        restore(&mut bands, &self.measured, &taken);
        bands
    }

    /// Returns the number of row blocks that tell as much of a mean square, as that of the noise that was
    /// there and of its repetitions differ.
    pub(super) fn independent_blocks(&self) -> f64 {
        let repeated = |g: &Group| g.repetitions.iter().map(Difference::len).sum::<usize>() as f64;
        let repeated = self.groups.iter().map(repeated).fold(f64::INFINITY, f64::min);
        1.0 / (1.0 / self.blocks + 1.0 / repeated.max(1.0))
    }

    /// Returns `2 Σ ρ²` of noise that is not white before the filter.
    pub(super) fn correlated(&self) -> f64 {
        self.correlated
    }

    /// Returns the groups of signals.
    pub(super) fn groups(&self) -> impl Iterator<Item = &SignalNoise> {
        self.groups.iter().map(|g| &g.noise)
    }

    /// Returns the variance that noise of the signals leaves in the filtered residuals of `phi`, by channels.
    pub(super) fn left(&self, phi: &[f64], weighing: &Weighing) -> Vec<f64> {
        let mut left = vec![0.0; self.channels];
        for (group, sigma) in self.groups.iter().zip(&weighing.signals) {
            let reached = group.values(phi);
            let count: usize = group.repetitions.iter().map(Difference::len).sum();
            let weight = sigma * sigma / count.max(1) as f64;
            let rows = group.repetitions.iter().flat_map(|r| r.rows.chunks_exact(reached.len().max(1)));
            for (row, c) in rows.zip((0..self.channels).cycle()) {
                left[c] += weight * left_of_rows::dot(row, &reached).powi(2);
            }
        }
        left
    }

    /// Returns, by groups, the spectrum that noise of unit σ leaves in the residuals of `phi`.
    ///
    /// The autocovariance is that of white noise and of its derivative, each after the filter; their shares
    /// fit it by least squares.
    pub(super) fn spectra(&self, phi: &[f64], weighing: &Weighing, filter: &Filter) -> Vec<Spectrum> {
        let channels = weighing.sigma.len();
        let (mut white, mut rising) = (filter.white_autocovariance(), filter.derivative_autocovariance());
        if white.is_empty() {
            (white, rising) = (vec![1.0], vec![0.0]);
        }
        let sum = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let (ww, wr, rr) = (sum(&white, &white), sum(&white, &rising), sum(&rising, &rising));
        let of_group = |group: &Group| {
            let mut sums = vec![DMatrix::<f64>::zeros(channels, channels); white.len()];
            let reached = group.values(phi);
            for repetition in &group.repetitions {
                let rows = repetition.rows.chunks_exact(reached.len().max(1));
                let all: Vec<f64> = rows.map(|row| left_of_rows::dot(row, &reached)).collect();
                let errors: Vec<DVector<f64>> =
                    all.chunks_exact(channels).map(DVector::from_column_slice).collect();
                for (lag, sum) in sums.iter_mut().enumerate() {
                    let weight = 1.0 / (errors.len().max(1) * group.repetitions.len()) as f64;
                    for (a, b) in errors.iter().zip(errors.iter().skip(lag)) {
                        sum.ger(weight, a, b, 1.0);
                    }
                }
            }
            let against = |of: &[f64]| {
                let zero = DMatrix::zeros(channels, channels);
                let all = sums.iter().zip(of).fold(zero, |all, (sum, weight)| all + sum * *weight);
                (&all + all.transpose()) * 0.5
            };
            let (to_white, to_rising) = (against(&white), against(&rising));
            let determinant = ww * rr - wr * wr;
            if rr == 0.0 || determinant <= 0.0 {
                let white = positive(&(to_white / ww));
                return Spectrum { rising: white.clone() * 0.0, white };
            }
            Spectrum {
                white: positive(&((&to_white * rr - &to_rising * wr) / determinant)),
                rising: positive(&((to_rising * ww - to_white * wr) / determinant)),
            }
        };
        self.groups.iter().map(of_group).collect()
    }

    /// Returns the largest share that noise of the signals has of a channel's variance after the filter.
    pub(super) fn share(&self, spectra: &[Spectrum], weighing: &Weighing, filter: &Filter) -> f64 {
        let rise = filter.derivative_noise_gain / filter.noise_gain;
        let of_channel = |c: usize| {
            let groups = spectra.iter().zip(&self.groups);
            let own =
                groups.map(|(s, g)| g.noise.size().powi(2) * (s.white[(c, c)] + rise * s.rising[(c, c)]));
            own.sum::<f64>() / weighing.sigma[c].powi(2)
        };
        (0..weighing.sigma.len()).map(of_channel).fold(0.0, f64::max)
    }

    /// Returns the expectation of `Δᵀ W Δ` over the whole recording, for the parameters and, last, the
    /// measured side. Signals of which the weighing knows no σ have their own.
    pub(super) fn gram(&self, weighing: &Weighing) -> DMatrix<f64> {
        let reached = |g: usize| self.groups[g].reached.clone();
        self.sum(weighing, self.parameters, reached, |(g, r), block, rows| {
            rows.extend_from_slice(self.groups[g].block(r, block, self.channels));
        })
    }

    /// Returns the expectation of `Δᵀ W (Δ φ − δ)` over the whole recording: what pulls the estimate.
    pub(super) fn pull(&self, weighing: &Weighing, phi: &[f64]) -> DVector<f64> {
        let n = self.parameters;
        let all = DVector::from_iterator(n + 1, phi.iter().copied().take(n).chain([MEASURED]));
        (self.gram(weighing) * all).rows(0, n).into_owned()
    }

    /// Returns the same with nuisance parameters after the parameters, whose columns are those of
    /// `linearised`.
    ///
    /// # Errors
    /// [`FitError`] if a source with errors cannot be filtered.
    pub(super) fn joint_gram(
        &self,
        weighing: &Weighing,
        columns: &Columns,
        linearised: &Linearised,
    ) -> Result<DMatrix<f64>, FitError> {
        if linearised.features() > 0 {
            return Ok(self.gram_of_features(weighing, columns.all(), linearised));
        }
        let phi = linearised.phi();
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let near = kept.take().filter(|kept| self.is_near(&kept.phi, phi));
        let near = match near {
            Some(near) => near,
            None => self.columns_of_noise(columns, phi)?,
        };
        let own = kept.insert(near);
        let all = columns.all();
        Ok(self.sum(
            weighing,
            all,
            |_| (0..=all).collect(),
            |place, block, rows| {
                let mut own_rows = vec![0.0; self.channels * all];
                let mut values = vec![0.0; self.channels];
                self.write_joint(place, block, own, (columns, phi), &mut own_rows);
                self.write_own(place, block, &mut [], &mut values);
                rows.extend(join(&own_rows, &values));
            },
        ))
    }

    /// Writes the rows of a block of a repetition of a group for the parameters, C × n at the beginning of
    /// `rows`, and what is measured.
    fn write_own(&self, (g, r): (usize, usize), block: usize, rows: &mut [f64], values: &mut [f64]) {
        let Some(group) = self.groups.get(g) else { return };
        let n = self.parameters;
        let lines = group.block(r, block, self.channels).chunks_exact(group.reached.len().max(1));
        for (c, line) in lines.enumerate() {
            for (j, a) in group.reached.iter().zip(line) {
                let to = if *j < n { rows.get_mut(c * n + j) } else { values.get_mut(c) };
                to.into_iter().for_each(|to| *to = *a);
            }
        }
    }

    /// Writes the same for all columns.
    fn write_joint(
        &self,
        (g, r): (usize, usize),
        block: usize,
        kept: &Kept,
        (columns, phi): (&Columns, &[f64]),
        rows: &mut [f64],
    ) {
        self.write_own((g, r), block, rows, &mut []);
        let Some(group) = self.groups.get(g) else { return };
        let both = group.repetitions.get(r).and_then(|repetition| repetition.both.as_ref());
        let sensitivities = kept.sensitivities.get(g).and_then(|own| own.get(r)?.as_ref());
        if let Some(([more, less], [by_more, by_less])) = both.zip(sensitivities) {
            let pair = [(&*more.1, by_more), (&*less.1, by_less)];
            NoiseColumns::new(columns, phi, pair, group.noise.size()).spread(block, rows);
        }
    }

    /// Returns the columns of nuisance parameters about φ̂ that noise is in.
    fn columns_of_noise(&self, columns: &Columns, phi: &[f64]) -> Result<Kept, FitError> {
        let of = |repetition: &Difference<'_>| {
            let both = repetition.both.as_ref();
            let of = |(source, blocks): &Noisy<'_>| Sensitivities::of(&**source, &**blocks, columns, phi);
            both.map(|[more, less]| Ok([of(more)?, of(less)?])).transpose()
        };
        let of_group = |group: &Group<'_>| group.repetitions.iter().map(of).collect::<Result<Vec<_>, _>>();
        let sensitivities = self.groups.iter().map(of_group).collect::<Result<Vec<_>, FitError>>()?;
        Ok(Kept { phi: phi.to_vec(), sensitivities })
    }

    /// Returns true if two estimates predict the same to so little that columns about one serve for the noise
    /// about the other.
    fn is_near(&self, from: &[f64], to: &[f64]) -> bool {
        let square = |of: &DVector<f64>| of.dot(&(&self.gram * of));
        let (from, to) = (DVector::from_column_slice(from), DVector::from_column_slice(to));
        let near = if self.groups.iter().any(|g| g.reached.contains(&self.parameters)) { 0.0 } else { NEAR };
        square(&(&to - from)) <= near * near * square(&to)
    }

    /// Returns the same by the features of noise.
    fn gram_of_features(&self, weighing: &Weighing, all: usize, linearised: &Linearised) -> DMatrix<f64> {
        // Where there are features, what is measured is a signal of its own.
        let mut sum = DMatrix::<f64>::zeros(all + 1, all + 1);
        for (k, group) in self.groups.iter().enumerate() {
            let parts: Vec<(&[f64], &[f64])> =
                group.repetitions.iter().map(|r| (r.time_s.as_slice(), r.features.as_slice())).collect();
            let count: usize = group.repetitions.iter().map(Difference::len).sum();
            let weight = self.weight(weighing, k, count);
            let own = features::gram(linearised, all, &weighing.whitening, &parts) * weight;
            sum.view_mut((0, 0), (all, all)).add_assign(&own);
        }
        sum
    }

    /// Returns the factor from squares of `count` blocks of unit noise of a group to those of the whole
    /// recording.
    fn weight(&self, weighing: &Weighing, group: usize, count: usize) -> f64 {
        let own = self.groups.get(group).map_or(0.0, |g| g.noise.size());
        let sigma = weighing.signals.get(group).copied().unwrap_or(own);
        self.blocks * sigma * sigma / count.max(1) as f64
    }

    /// Returns the sum of the squares of whitened rows of noise in the columns that each group has, as of the
    /// whole recording, `all` and the measured side; `write` appends the rows of a block of a repetition of a
    /// group.
    fn sum(
        &self,
        weighing: &Weighing,
        all: usize,
        columns_of: impl Fn(usize) -> Vec<usize>,
        write: impl Fn((usize, usize), usize, &mut Vec<f64>),
    ) -> DMatrix<f64> {
        let channels = self.channels;
        let mut sum = DMatrix::<f64>::zeros(all + 1, all + 1);
        let (mut rows, mut values) = (Vec::new(), vec![0.0; channels]);
        for (k, group) in self.groups.iter().enumerate() {
            let columns = columns_of(k);
            let width = columns.len();
            let most = (MOST_PRODUCTS / (channels * width * width).max(1)).max(LEAST_BLOCKS / 4);
            let mut own = DMatrix::<f64>::zeros(width, width);
            let mut count = 0;
            for (r, repetition) in group.repetitions.iter().enumerate() {
                let mut whitener = Whitener::new(&weighing.whitening, width);
                for (block, time_s) in repetition.time_s.iter().enumerate().take(most) {
                    rows.clear();
                    write((k, r), block, &mut rows);
                    values.fill(0.0);
                    whitener.apply(*time_s, &mut rows, &mut values, None);
                    for row in rows.chunks_exact(width.max(1)) {
                        let columns = own.as_mut_slice().chunks_exact_mut(width.max(1));
                        for (j, (column, a)) in columns.zip(row).enumerate().filter(|(_, (_, a))| **a != 0.0)
                        {
                            column.iter_mut().zip(row).take(j + 1).for_each(|(s, b)| *s += a * b);
                        }
                    }
                    count += 1;
                }
            }
            let weight = self.weight(weighing, k, count);
            for (j, to) in columns.iter().enumerate() {
                for (i, from) in columns.iter().enumerate().take(j + 1) {
                    sum[(*from, *to)] += weight * own[(i, j)];
                }
            }
        }
        sum.fill_lower_triangle_with_upper_triangle();
        sum
    }
}

/// Rows, each with its value of the measured side behind.
fn join<'r>(rows: &'r [f64], values: &'r [f64]) -> impl Iterator<Item = f64> + 'r {
    let width = (rows.len() / values.len().max(1)).max(1);
    rows.chunks_exact(width).zip(values).flat_map(|(row, value)| row.iter().chain([value]).copied())
}

/// Returns the positive semidefinite part of a symmetric matrix.
fn positive(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = nalgebra::SymmetricEigen::new(matrix.clone());
    let values = eigen.eigenvalues.map(|v| v.max(0.0));
    &eigen.eigenvectors * DMatrix::from_diagonal(&values) * eigen.eigenvectors.transpose()
}
