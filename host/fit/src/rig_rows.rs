//! Rows over parameters and over the errors of a rig, which outlive a recording.
//!
//! `R [φ; θ] = z`: errors of one recording alone are eliminated with what is known of them. Those that other
//! recordings of the rig share are columns θ, and what is known of them beforehand, `θ = μ ± Σ`, stays beside
//! the rows. So it counts once, however many recordings are merged: an error in common does not average out.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{Basis, Factor, Gaussian};

/// The least singular value, by the largest, of a direction of unit columns that rows determine.
const LEAST_DIRECTION: f64 = 1e-12;
/// Iterations for each parameter after which singular values are given up; two or three do.
const MOST_SWEEPS: usize = 100;
/// Standard deviations beforehand that differ by less, relative, are the same.
const SAME_SIGMA: f64 = 1e-6;

/// An error that all recordings with one instrument share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigError {
    /// The instrument whose error it is, by a serial number or by what is stated of it; empty: there is but
    /// one.
    pub instrument: String,
    /// Its name: `gain_fz`.
    pub name: String,
    /// The errors that it is one of: `load-cell gain`.
    pub group: String,
    /// Its SI unit in ASCII.
    pub unit: String,
    /// The knowledge that its standard deviation rests on.
    pub basis: Basis,
    /// Its value beforehand.
    pub expected: f64,
    /// Its standard deviation beforehand.
    pub sigma: f64,
}

impl RigError {
    /// Returns true if the instrument has no name: what is stated of it replaces one, after a `#`.
    pub fn is_unnamed(&self) -> bool {
        self.instrument.contains('#')
    }

    /// Returns true if two are one error.
    pub fn is(&self, other: &Self) -> bool {
        self.name == other.name && self.instrument == other.instrument
    }
}

/// Rows over parameters, then errors.
#[derive(Clone, Debug, PartialEq)]
pub struct RigRows {
    parameters: usize,
    factor: Factor,
    errors: Vec<RigError>,
    covariance: DMatrix<f64>,
}

impl RigRows {
    /// Returns the rows of a factor that has a column for each of `parameters` parameters and then for each
    /// error, whose covariance beforehand is given.
    ///
    /// Returns `None` if the sizes differ or the covariance is none.
    pub fn new(
        parameters: usize,
        factor: Factor,
        errors: Vec<RigError>,
        covariance: DMatrix<f64>,
    ) -> Option<Self> {
        let k = errors.len();
        let fits = factor.parameters() == parameters + k && covariance.shape() == (k, k);
        let rows = Self { parameters, factor, errors, covariance };
        (fits && (k == 0 || rows.is_known())).then_some(rows)
    }

    /// Returns rows without errors in common.
    pub fn plain(factor: Factor) -> Self {
        let parameters = factor.parameters();
        Self { parameters, factor, errors: Vec::new(), covariance: DMatrix::zeros(0, 0) }
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// Returns the rows: parameters, then errors, without what is known of these beforehand.
    pub fn factor(&self) -> &Factor {
        &self.factor
    }

    /// Returns the errors, in the order of their columns.
    pub fn errors(&self) -> &[RigError] {
        &self.errors
    }

    /// Returns the covariance of the errors beforehand, in their units.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Returns true if the errors are known independently of each other.
    pub fn is_independent(&self) -> bool {
        let k = self.errors.len();
        (0..k).all(|i| (0..i).all(|j| self.covariance[(i, j)] == 0.0))
    }

    /// Returns the same with every error that of the instrument which `name` says.
    #[must_use]
    pub fn of_instruments(mut self, name: impl Fn(&RigError) -> String) -> Self {
        for error in &mut self.errors {
            error.instrument = name(error);
        }
        self
    }

    /// Returns true if every error is there once, and what is known of them beforehand is a normal
    /// distribution.
    fn is_known(&self) -> bool {
        let mut names: Vec<_> = self.errors.iter().map(|e| (&e.instrument, &e.name)).collect();
        names.sort_unstable();
        let own = |(k, e): (usize, &RigError)| {
            let variance = self.covariance[(k, k)];
            e.expected.is_finite() && variance.is_finite() && variance > 0.0 && e.sigma > 0.0
        };
        names.windows(2).all(|pair| pair[0] != pair[1])
            && self.errors.iter().enumerate().all(own)
            && (self.is_independent() || self.beforehand().is_some())
    }

    /// Returns the distribution of the errors beforehand; `None` if there is none.
    fn beforehand(&self) -> Option<Gaussian> {
        let names = self.errors.iter().map(|e| format!("{} {}", e.instrument, e.name)).collect();
        let mean = DVector::from_iterator(self.errors.len(), self.errors.iter().map(|e| e.expected));
        Gaussian::new(names, mean, self.covariance.clone())
    }

    /// Returns the rows with what is known of the errors beforehand.
    pub fn known(&self) -> Factor {
        let (n, k) = (self.parameters, self.errors.len());
        let mut known = self.factor.clone();
        if k == 0 {
            return known;
        }
        let rows: Vec<(Vec<f64>, f64)> = if self.is_independent() {
            let row = |(i, error): (usize, &RigError)| {
                let mut row = vec![0.0; n + k];
                row[n + i] = 1.0 / error.sigma;
                (row, error.expected / error.sigma)
            };
            self.errors.iter().enumerate().map(row).collect()
        } else {
            let Some(beforehand) = self.beforehand() else { return known };
            beforehand.rows(n + k, &(n..n + k).collect::<Vec<_>>())
        };
        known.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
        // What is known beforehand are no measurements.
        let left = known.residual_sum_of_squares();
        known.with_residual(left, self.factor.rows())
    }

    /// Returns the rows over the parameters alone, whatever the errors are, with what is known of these.
    pub fn own(&self) -> Factor {
        if self.errors.is_empty() { self.factor.clone() } else { self.known().leading(self.parameters) }
    }

    /// Returns L, parameters × errors, whose `L Lᵀ` is the covariance that what is known of the errors
    /// beforehand leaves in the scores of [`RigRows::own`]: with `Σ = B Bᵀ` of the errors beforehand and
    /// `RᵀR = [H_φφ H_φθ; H_θφ H_θθ]`, `L = H_φθ B (1 + Bᵀ H_θθ B)⁻¹`. The estimate's own part is then
    /// `C L Lᵀ C`, C being its covariance.
    pub(crate) fn beforehand_in_scores(&self) -> DMatrix<f64> {
        let (n, k) = (self.parameters, self.errors.len());
        let root = if self.is_independent() {
            Some(DMatrix::from_diagonal(&self.covariance.diagonal().map(f64::sqrt)))
        } else {
            self.covariance.clone().cholesky().map(|own| own.l())
        };
        let r = self.factor.r();
        let of_errors = root.map(|root| r.columns(n, k) * root);
        let solved = of_errors.and_then(|of_errors| {
            let information = DMatrix::identity(k, k) + of_errors.tr_mul(&of_errors);
            let cross = r.columns(0, n).tr_mul(&of_errors);
            Some(information.cholesky()?.solve(&cross.transpose()).transpose())
        });
        solved.unwrap_or_else(|| DMatrix::zeros(n, k))
    }

    /// Returns the rows over the parameters for given errors.
    pub fn of_given_errors(&self) -> Factor {
        let n = self.parameters;
        let r = self.factor.r();
        let mut own = Factor::new(n);
        own.absorb_matrix(&r.view((0, 0), (n, n)).into_owned(), &self.factor.z()[..n]);
        own
    }

    /// Returns the rows over the errors alone, whatever the parameters are.
    #[must_use]
    pub fn of_errors(&self) -> Self {
        self.select(&[])
    }

    /// Returns the rows over some of the parameters, in this order, whatever the others are.
    #[must_use]
    pub fn select(&self, parameters: &[usize]) -> Self {
        let n = self.parameters;
        let kept: Vec<usize> = parameters.iter().copied().chain(n..n + self.errors.len()).collect();
        Self {
            parameters: parameters.len(),
            factor: self.factor.eliminate_others(&kept),
            errors: self.errors.clone(),
            covariance: self.covariance.clone(),
        }
    }

    /// Returns the rows over ψ, where `φ = map ψ`.
    #[must_use]
    pub fn substitute(&self, map: &DMatrix<f64>) -> Self {
        let k = self.errors.len();
        let (n, m) = map.shape();
        let all = DMatrix::from_fn(n + k, m + k, |i, j| match (i.checked_sub(n), j.checked_sub(m)) {
            (None, None) => map[(i, j)],
            (Some(i), Some(j)) => f64::from(u8::from(i == j)),
            _ => 0.0,
        });
        Self { parameters: m, factor: self.factor.substitute(&all), ..self.clone() }
    }

    /// Returns the same rows with a variance `by` times as large; what is known of the errors stays.
    #[must_use]
    pub fn discount(&self, by: f64) -> Self {
        Self { factor: self.factor.discount(by), ..self.clone() }
    }

    /// Returns the same with the columns that are no longer than their `least` set to zero; see
    /// [`Factor::without_columns_below`].
    #[must_use]
    pub fn without_columns_below(self, least: &[f64]) -> Self {
        Self { factor: self.factor.without_columns_below(least), ..self }
    }

    /// Returns true if an error is in both.
    pub fn shares_errors_with(&self, other: &Self) -> bool {
        self.errors.is_empty() && other.errors.is_empty()
            || other.errors.iter().any(|error| self.errors.iter().any(|own| own.is(error)))
    }

    /// Merges rows over the same parameters: an error that both have is one, and where they differ tells of
    /// it.
    pub fn merge(&mut self, other: &Self) {
        let (rows, _) = self.aligned(other);
        self.factor.merge(&rows);
    }

    /// Merges rows over the same parameters that each run was linearised for about its own estimate. Returns
    /// the names of the errors of which different standard deviations were stated; the larger is taken, also
    /// of those of one class, which goes by the load.
    ///
    /// With `R_φφ (φ + T θ) = z` the sum has the mean of T, weighed as the parameters are, and what each run
    /// says of θ by itself. That T differs from run to run tells nothing of θ: it has the noise of the run's
    /// estimate in it, which is that of its z, and of thousands of runs this alone would seem to tell a gain.
    pub fn merge_run(&mut self, other: &Self) -> Vec<String> {
        let (rows, differing) = self.aligned(other);
        let n = self.parameters;
        // What each says of the errors by itself.
        let mut sum = self.factor.rows_from(n);
        sum.merge(&rows.rows_from(n));
        let mut tops = Vec::new();
        for factor in [&self.factor, &rows] {
            let count = factor.parameters();
            let mut all = factor.r().rows(0, n).into_owned().insert_column(count, 0.0);
            all.column_mut(count).copy_from_slice(&factor.z()[..n]);
            let (top, others) = of_parameters(&all, n);
            absorb(&mut sum, &others);
            tops.push(top);
        }
        absorb(&mut sum, &of_parameters(&stacked(&tops), n).0);
        let squares = self.factor.residual_sum_of_squares() + rows.residual_sum_of_squares();
        // Lower rows alone may leave something, too.
        let left = squares + sum.residual_sum_of_squares();
        self.factor = sum.with_residual(left, self.factor.rows().saturating_add(rows.rows()));
        differing
    }

    /// Returns the same rows with another sum of squares that no parameters explain.
    #[must_use]
    pub fn with_residual(mut self, squares: f64) -> Self {
        let rows = self.factor.rows();
        self.factor = self.factor.with_residual(squares, rows);
        self
    }

    /// Takes the errors of another among its own, and returns its rows over the columns of both, with the
    /// names of errors of which different standard deviations were stated.
    fn aligned(&mut self, other: &Self) -> (Factor, Vec<String>) {
        if self.errors == other.errors {
            return (other.factor.clone(), Vec::new());
        }
        let (at, differing) = self.take_errors(other);
        let (n, all) = (self.parameters, self.parameters + self.errors.len());
        let place = |i: usize| if i < n { Some(i) } else { at.get(i - n).map(|k| n + k) };
        let map =
            DMatrix::from_fn(other.factor.parameters(), all, |i, j| f64::from(u8::from(place(i) == Some(j))));
        (other.factor.substitute(&map), differing)
    }

    /// Takes the errors of another among its own, and returns their places and the names of those that
    /// differ.
    fn take_errors(&mut self, other: &Self) -> (Vec<usize>, Vec<String>) {
        let before = self.errors.len();
        let mut differing = Vec::new();
        let mut at = Vec::new();
        for error in &other.errors {
            match self.errors.iter().position(|own| own.is(error)) {
                Some(k) => at.push(k),
                None => {
                    at.push(self.errors.len());
                    self.errors.push(error.clone());
                }
            }
        }
        let count = self.errors.len();
        if count > before {
            self.factor = self.factor.append(count - before);
            self.covariance = self.covariance.clone().resize(count, count, 0.0);
        }
        for (i, k) in at.iter().enumerate() {
            let theirs = other.covariance[(i, i)];
            if *k >= before {
                for (j, l) in at.iter().enumerate().filter(|(_, l)| **l >= before) {
                    self.covariance[(*k, *l)] = other.covariance[(i, j)];
                }
                continue;
            }
            let own = self.covariance[(*k, *k)];
            let (ours, error) = (&self.errors[*k], &other.errors[i]);
            let of_class = matches!(error.basis, Basis::Class(_)) && error.basis == ours.basis;
            let differs = (theirs / own - 1.0).abs() > SAME_SIGMA && !of_class;
            if differs || (error.expected - ours.expected).abs() > SAME_SIGMA * ours.sigma {
                differing.push(self.errors[*k].name.clone());
            }
            if theirs > own {
                self.covariance[(*k, *k)] = theirs;
                let expected = other.errors[i].expected;
                self.errors[*k] = RigError { expected, sigma: theirs.sqrt(), ..self.errors[*k].clone() };
            }
        }
        (at, differing)
    }

    /// Returns the rows with an error of this recording alone, known to be 0 ± 1, that moves the estimate by
    /// `column`.
    #[must_use]
    pub fn shifted(&self, column: &[f64]) -> Self {
        Self { factor: shifted(&self.factor, column), ..self.clone() }
    }
}

/// Returns the rows of matrices of as many columns, one matrix after the other.
fn stacked(all: &[DMatrix<f64>]) -> DMatrix<f64> {
    let columns = all.first().map_or(0, DMatrix::ncols);
    let rows: Vec<f64> =
        all.iter().flat_map(|own| own.transpose().iter().copied().collect::<Vec<_>>()).collect();
    DMatrix::from_row_slice(all.iter().map(DMatrix::nrows).sum(), columns, &rows)
}

/// Absorbs rows whose last column is the value.
fn absorb(factor: &mut Factor, rows: &DMatrix<f64>) {
    let n = rows.ncols() - 1;
    let values: Vec<f64> = rows.column(n).iter().copied().collect();
    factor.absorb_matrix(&rows.columns(0, n).into_owned(), &values);
}

/// Turns rows so that the first tell of the first `n` columns, as many as these have directions, and the
/// others of none; of more rows than columns those are left out that tell of none.
fn of_parameters(rows: &DMatrix<f64>, n: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let own = rows.columns(0, n);
    let scaled = DMatrix::from_fn(rows.nrows(), n, |i, j| {
        let norm = own.column(j).norm();
        if norm > 0.0 { own[(i, j)] / norm } else { 0.0 }
    });
    let none = || (rows.clone(), DMatrix::zeros(0, rows.ncols()));
    if scaled.is_empty() {
        return none();
    }
    // Bounded: the numbers of a file may be any.
    let Some(svd) = scaled.try_svd(true, false, f64::EPSILON, MOST_SWEEPS * n) else { return none() };
    let Some(u) = svd.u else { return none() };
    let most = svd.singular_values.max();
    let tells = |k: &usize| svd.singular_values[*k] > LEAST_DIRECTION * most;
    let (first, others): (Vec<usize>, Vec<usize>) = (0..u.ncols()).partition(tells);
    let turned = |chosen: &[usize]| u.select_columns(chosen).tr_mul(rows);
    let mut others = turned(&others);
    others.columns_mut(0, n).fill(0.0);
    (turned(&first), others)
}

/// See [`RigRows::shifted`]; the column may be shorter than the columns are many.
pub(super) fn shifted(factor: &Factor, column: &[f64]) -> Factor {
    if column.iter().all(|v| *v == 0.0) {
        return factor.clone();
    }
    let n = factor.parameters();
    let map = DMatrix::from_fn(n, n + 1, |i, j| match j {
        0 => column.get(i).map_or(0.0, |v| -v),
        _ => f64::from(u8::from(j == i + 1)),
    });
    let mut joint = factor.substitute(&map);
    let mut beforehand = vec![0.0; n + 1];
    beforehand[0] = 1.0;
    joint.absorb([(beforehand.as_slice(), 0.0)]);
    let marginal = joint.eliminate_others(&(1..=n).collect::<Vec<_>>());
    // What is known beforehand is none of the data's.
    let left = marginal.residual_sum_of_squares();
    marginal.with_residual(left, factor.rows())
}

#[cfg(test)]
#[path = "rig_rows_tests.rs"]
mod tests;
