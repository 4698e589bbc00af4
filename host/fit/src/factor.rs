//! The information factor of any number of parameters.
//!
//! After any number of rows, `[R z; 0 ρ]` is the triangular factor of the stacked `[A y]`: recursive least
//! squares in square-root information form. Rows are reduced as the firmware does it
//! (`rigident_shared::factor`); only the size is not known when the program is compiled. Every question about
//! the parameters is a function of the factor.

use nalgebra::{DMatrix, DVector};
use rigident_shared::estimator::frames::TreeFactor;
use rigident_shared::factor::InformationFactor;

use super::blocked;
use super::reduction::Reduction;

/// Columns from which on rows are reduced by products of matrices.
const WIDE: usize = 64;
/// Rows that are then reduced at once.
const BLOCKED_ROWS: usize = 192;
/// Iterations for each parameter after which singular values are given up; two or three do.
const MOST_SWEEPS: usize = 100;

/// R, z, the residual sum of squares and the row count of all rows absorbed.
///
/// Rows come whitened (divided by their σ), so that `(RᵀR)⁻¹` is the covariance of the parameters.
///
/// ```
/// use rigident_fit::Factor;
///
/// // y = 2 + 3 x at x = 0, 1, 2.
/// let mut factor = Factor::new(2);
/// factor.absorb([([1.0, 0.0].as_slice(), 2.0), (&[1.0, 1.0], 5.0), (&[1.0, 2.0], 8.0)]);
/// let solution = factor.solve(1e-12);
/// assert!((solution.estimate[1] - 3.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    parameters: usize,
    /// `[R z]` by columns; the entries below the diagonal are zero.
    triangle: Vec<f64>,
    residual_sum_of_squares: f64,
    rows: u64,
}

/// The solution of a factor.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Least-squares estimate; meaningless where not determined.
    pub estimate: Vec<f64>,
    /// `(RᵀR)⁻¹` over the directions that are determined.
    pub covariance: DMatrix<f64>,
    /// True where the rows alone determine the parameter.
    pub determined: Vec<bool>,
    /// 2-norm condition number of the column-scaled R over what is determined.
    pub condition_number: f64,
    /// Directions that are not determined: parameters and their shares in column-scaled units.
    pub null_directions: Vec<Vec<(usize, f64)>>,
}

impl Factor {
    /// Returns the factor of no rows.
    pub fn new(parameters: usize) -> Self {
        Self {
            parameters,
            triangle: vec![0.0; parameters * (parameters + 1)],
            residual_sum_of_squares: 0.0,
            rows: 0,
        }
    }

    /// Builds a factor from its numbers: the upper triangle by rows, z, the residual sum of squares.
    ///
    /// Returns `None` if there are not `n (n + 3) / 2 + 1` finite numbers or the residual sum is negative.
    pub fn from_entries(parameters: usize, entries: &[f64], rows: u64) -> Option<Self> {
        let triangle = parameters * (parameters + 1) / 2;
        let good = entries.len() == triangle + parameters + 1 && entries.iter().all(|v| v.is_finite());
        let (residual, numbers) = entries.split_last().filter(|(residual, _)| good && **residual >= 0.0)?;
        let (r, z) = numbers.split_at_checked(triangle)?;
        let mut factor = Self::new(parameters);
        let mut r = r.iter();
        for i in 0..parameters {
            for j in i..parameters {
                factor.triangle[j * parameters + i] = *r.next()?;
            }
        }
        factor.triangle[parameters * parameters..].copy_from_slice(z);
        (factor.residual_sum_of_squares, factor.rows) = (*residual, rows);
        Some(factor)
    }

    /// Returns the upper triangle by rows, then z, then the residual sum of squares.
    pub fn entries(&self) -> Vec<f64> {
        let n = self.parameters;
        let upper = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        let mut entries: Vec<f64> = upper.map(|(i, j)| self.triangle[j * n + i]).collect();
        entries.extend_from_slice(self.z());
        entries.push(self.residual_sum_of_squares);
        entries
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// Returns the number of scalar rows absorbed.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Returns the sum of squares that no parameters explain.
    pub fn residual_sum_of_squares(&self) -> f64 {
        self.residual_sum_of_squares
    }

    /// Returns what is no more than rounding in as many columns of unit length.
    pub fn rounding(&self) -> f64 {
        f64::EPSILON * self.parameters as f64
    }

    /// Returns true if every number is finite.
    pub fn is_finite(&self) -> bool {
        self.residual_sum_of_squares.is_finite() && self.triangle.iter().all(|v| v.is_finite())
    }

    /// Returns the triangle, n × n.
    pub fn r(&self) -> DMatrix<f64> {
        let n = self.parameters;
        DMatrix::from_column_slice(n, n, &self.triangle[..n * n])
    }

    /// Returns the projected right-hand side.
    pub fn z(&self) -> &[f64] {
        &self.triangle[self.parameters * self.parameters..]
    }

    /// Absorbs whitened rows: the coefficients of all parameters, then the value.
    pub fn absorb<'a>(&mut self, rows: impl IntoIterator<Item = (&'a [f64], f64)>) {
        let n = self.parameters;
        if n >= WIDE {
            return self.absorb_blocked(rows);
        }
        let mut rows = rows.into_iter().peekable();
        if rows.peek().is_none() {
            return;
        }
        let mut reduction = Reduction::new(&self.triangle, n, n + 1);
        reduction.start(self.residual_sum_of_squares);
        for (row, value) in rows {
            reduction.push(row, value);
            self.rows = self.rows.saturating_add(1);
        }
        self.residual_sum_of_squares = reduction.write(&mut self.triangle);
    }

    /// Absorbs the rows of a matrix, as many values.
    pub fn absorb_matrix(&mut self, rows: &DMatrix<f64>, values: &[f64]) {
        let rows: Vec<Vec<f64>> = rows.row_iter().map(|row| row.iter().copied().collect()).collect();
        self.absorb(rows.iter().zip(values).map(|(row, value)| (row.as_slice(), *value)));
    }

    /// Returns the triangle with its columns of unit length, but for those of zeros.
    pub fn r_of_unit_columns(&self) -> DMatrix<f64> {
        let mut r = self.r();
        for mut column in r.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        r
    }

    /// Absorbs rows of many columns.
    fn absorb_blocked<'a>(&mut self, rows: impl IntoIterator<Item = (&'a [f64], f64)>) {
        let n = self.parameters;
        let mut rows = rows.into_iter().peekable();
        while rows.peek().is_some() {
            let chunk: Vec<(&[f64], f64)> = rows.by_ref().take(BLOCKED_ROWS).collect();
            self.rows = self.rows.saturating_add(chunk.len() as u64);
            let mut columns = DMatrix::zeros(chunk.len(), n + 1);
            for (i, (row, value)) in chunk.iter().enumerate() {
                for (to, entry) in columns.row_mut(i).iter_mut().zip(row.iter().take(n).chain([value])) {
                    *to = *entry;
                }
            }
            self.residual_sum_of_squares += blocked::reduce(&mut self.triangle, n, &mut columns);
        }
    }

    /// Returns the factor of the rows of all parts, which are of the same parameters; of none if there is no
    /// part.
    #[must_use]
    pub fn merged<'a>(parts: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut parts = parts.into_iter().peekable();
        let mut all = Self::new(parts.peek().map_or(0, |first| first.parameters()));
        parts.for_each(|part| all.merge(part));
        all
    }

    /// Merges another factor of the same parameters: the result is the factor of both sets of rows.
    pub fn merge(&mut self, other: &Self) {
        let rows = self.rows;
        self.absorb_matrix(&other.r(), other.z());
        self.residual_sum_of_squares += other.residual_sum_of_squares;
        self.rows = rows.saturating_add(other.rows);
    }

    /// Returns the factor of the same rows over ψ, where `φ = map ψ`; `map` is n × m.
    #[must_use]
    pub fn substitute(&self, map: &DMatrix<f64>) -> Self {
        let mut out = Self::new(map.ncols());
        out.absorb_matrix(&(self.r() * map), self.z());
        out.residual_sum_of_squares += self.residual_sum_of_squares;
        out.rows = self.rows;
        out
    }

    /// Returns the factor with the columns that are no longer than their `least` set to zero.
    ///
    /// What is left of a column that cancelled is rounding, with a direction of its own: it would resemble
    /// one that depends on others.
    #[must_use]
    pub fn without_columns_below(mut self, least: &[f64]) -> Self {
        let n = self.parameters;
        for (column, least) in self.triangle.chunks_exact_mut(n.max(1)).zip(least) {
            let norm = column.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm <= *least {
                column.fill(0.0);
            }
        }
        self
    }

    /// Returns the factor over more parameters, `count` of them after the present ones, of which the rows say
    /// nothing.
    #[must_use]
    pub fn append(&self, count: usize) -> Self {
        let (n, all) = (self.parameters, self.parameters + count);
        let mut out = Self::new(all);
        let columns = (0..n).chain([all]).zip(self.triangle.chunks_exact(n.max(1)));
        for (to, column) in columns {
            out.triangle[to * all..to * all + n].copy_from_slice(column);
        }
        out.with_residual(self.residual_sum_of_squares, self.rows)
    }

    /// Returns what all rows say of the parameters `kept`, in that order, whatever the others are.
    ///
    /// The others are ordered first; the trailing triangle is then the marginal.
    #[must_use]
    pub fn eliminate_others(&self, kept: &[usize]) -> Self {
        let n = self.parameters;
        let mut order: Vec<usize> = (0..n).filter(|j| !kept.contains(j)).collect();
        let gone = order.len();
        order.extend(kept.iter().copied().filter(|j| *j < n));
        self.in_order(&order).trailing(gone)
    }

    /// Returns the factor with its columns in another order.
    fn in_order(&self, order: &[usize]) -> Self {
        let n = self.parameters;
        let moved = (0..n).rev().find(|k| order.get(*k) != Some(k)).map_or(0, |k| k + 1);
        // The rows below hold none of the columns that move: they are a triangle as they are.
        let mut out = self.rows_from(moved);
        let row = |i: usize| order.iter().map(|j| self.triangle[j * n + i]).collect();
        let top: Vec<Vec<f64>> = (0..moved).map(row).collect();
        out.absorb(top.iter().zip(self.z()).map(|(row, value)| (row.as_slice(), *value)));
        out.residual_sum_of_squares += self.residual_sum_of_squares;
        out.rows = self.rows;
        out
    }

    /// Returns the factor of the rows of the triangle from `first` on, which tell nothing of the columns
    /// before, and of no others.
    pub(super) fn rows_from(&self, first: usize) -> Self {
        let n = self.parameters;
        let mut out = Self::new(n);
        for (to, from) in out.triangle.chunks_exact_mut(n.max(1)).zip(self.triangle.chunks_exact(n.max(1))) {
            to[first..].copy_from_slice(&from[first..]);
        }
        out
    }

    /// Returns what all rows say of the first `kept` parameters, whatever the others are.
    #[must_use]
    pub fn leading(&self, kept: usize) -> Self {
        self.eliminate_others(&(0..kept.min(self.parameters)).collect::<Vec<_>>())
    }

    /// Returns the factor of the parameters from `first` on, whatever those before are.
    fn trailing(&self, first: usize) -> Self {
        let n = self.parameters;
        let rest = n - first.min(n);
        let mut out = Self::new(rest);
        for k in 0..=rest {
            let column = &self.triangle[(first + k) * n..(first + k + 1) * n];
            out.triangle[k * rest..(k + 1) * rest].copy_from_slice(&column[first..]);
        }
        (out.residual_sum_of_squares, out.rows) = (self.residual_sum_of_squares, self.rows);
        out
    }

    /// Returns the same rows with standard deviations `by` times as large, with the same estimate and
    /// correlations.
    ///
    /// `R (φ − φ̂)` keeps its residual `z − R φ̂`.
    #[must_use]
    pub fn inflate(&self, estimate: &[f64], by: &[f64]) -> Self {
        let n = self.parameters;
        let mut out = self.clone();
        let (triangle, z) = out.triangle.split_at_mut(n * n);
        for (column, (value, by)) in triangle.chunks_exact_mut(n.max(1)).zip(estimate.iter().zip(by)) {
            for (z, r) in z.iter_mut().zip(column) {
                let before = *r;
                *r /= by;
                *z += (*r - before) * value;
            }
        }
        out
    }

    /// Returns the same rows with a variance `by` times as large; the residual sum of squares is scaled
    /// along.
    #[must_use]
    pub fn discount(&self, by: f64) -> Self {
        let mut out = self.clone();
        let root = by.sqrt();
        out.triangle.iter_mut().for_each(|v| *v /= root);
        out.residual_sum_of_squares /= by;
        out
    }

    /// Returns the same rows about other parameters: `z − R φ_r`.
    #[must_use]
    pub fn about(&self, reference: &[f64]) -> Self {
        let n = self.parameters;
        let mut out = self.clone();
        let (triangle, z) = out.triangle.split_at_mut(n * n);
        for (column, reference) in triangle.chunks_exact(n.max(1)).zip(reference) {
            for (z, r) in z.iter_mut().zip(column) {
                *z -= r * reference;
            }
        }
        if out.is_finite() { out } else { self.clone() }
    }

    /// Returns the standard deviation of every parameter by back substitution; infinite where R has a zero on
    /// its diagonal.
    pub fn standard_deviations(&self) -> Vec<f64> {
        let n = self.parameters;
        let r = |i: usize, j: usize| self.triangle[j * n + i];
        (0..n)
            .map(|j| {
                // x R = e_j, from the diagonal on.
                let mut x = vec![0.0; n];
                let mut square = 0.0;
                for k in j..n {
                    let mut rest = if k == j { 1.0 } else { 0.0 };
                    for (i, x) in x.iter().enumerate().take(k).skip(j) {
                        rest -= x * r(i, k);
                    }
                    x[k] = rest / r(k, k);
                    square += x[k] * x[k];
                }
                if square.is_finite() { square.sqrt() } else { f64::INFINITY }
            })
            .collect()
    }

    /// Returns the estimate by back substitution; `None` unless every parameter's variance inflation factor
    /// `(RᵀR)_jj (RᵀR)⁻¹_jj` is below `1/ε`. `deviations` are [`Factor::standard_deviations`].
    pub fn well_determined(&self, deviations: &[f64]) -> Option<Vec<f64>> {
        let n = self.parameters;
        let mut phi = self.z().to_vec();
        for j in (0..n).rev() {
            let column = self.triangle.get(j * n..(j + 1) * n)?;
            let norm2: f64 = column.iter().map(|r| r * r).sum();
            let inflation = norm2 * deviations.get(j)?.powi(2);
            if !inflation.is_finite() || inflation >= 1.0 / f64::EPSILON {
                return None;
            }
            let value = *phi.get(j)? / column.get(j)?;
            *phi.get_mut(j)? = value;
            for (rest, r) in phi.iter_mut().zip(column).take(j) {
                *rest -= r * value;
            }
        }
        Some(phi)
    }

    /// Returns the same triangle with another residual sum of squares and row count.
    #[must_use]
    pub fn with_residual(mut self, residual_sum_of_squares: f64, rows: u64) -> Self {
        (self.residual_sum_of_squares, self.rows) = (residual_sum_of_squares, rows);
        self
    }

    /// Returns what the rows say of the first `kept` parameters for given others, and nothing of these: the
    /// part of the triangle below is left out.
    #[must_use]
    pub fn for_given_others(mut self, kept: usize) -> Self {
        let n = self.parameters;
        for column in self.triangle.chunks_exact_mut(n.max(1)) {
            column.iter_mut().skip(kept).for_each(|v| *v = 0.0);
        }
        self
    }

    /// Returns the factor with more rows in it that are not measured yet: what a plan predicts. z is that of
    /// the present estimate, so that the rows move nothing.
    #[must_use]
    pub fn predicted<'a>(&self, estimate: &[f64], rows: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let mut out = self.clone();
        let of = |row: &[f64]| row.iter().zip(estimate).map(|(a, phi)| a * phi).sum::<f64>();
        out.absorb(rows.into_iter().map(|row| (row, of(row))));
        out
    }

    /// Returns `ln det(RᵀR)`, minus infinity if the rows do not determine every parameter.
    pub fn log_determinant(&self) -> f64 {
        let n = self.parameters;
        (0..n).map(|j| 2.0 * self.triangle[j * n + j].abs().ln()).sum()
    }

    /// Solves by singular values of R with its columns scaled to unit length.
    ///
    /// Directions whose singular value is below `rounding` times the largest are not determined, nor is a
    /// parameter with a share in one of them.
    pub fn solve(&self, rounding: f64) -> Solution {
        let n = self.parameters;
        let r = self.r();
        let scale: Vec<f64> = r.column_iter().map(|c| c.norm()).collect();
        // Columns of zeros are no part of any combination.
        let seen: Vec<usize> = (0..n).filter(|j| scale[*j] > 0.0).collect();
        let scaled = DMatrix::from_fn(n, seen.len(), |i, k| r[(i, seen[k])] / scale[seen[k]]);
        let mut solution = Solution {
            estimate: vec![0.0; n],
            covariance: DMatrix::zeros(n, n),
            determined: scale.iter().map(|s| *s > 0.0).collect(),
            condition_number: 1.0,
            null_directions: Vec::new(),
        };
        if seen.is_empty() {
            return solution;
        }
        // Bounded: the numbers of a file may be any.
        let svd = scaled.try_svd(true, true, 5.0 * f64::EPSILON, MOST_SWEEPS * n.max(8));
        let Some((svd, (u, v_t))) =
            svd.as_ref().and_then(|svd| Some((svd, svd.u.as_ref().zip(svd.v_t.as_ref())?)))
        else {
            solution.determined.fill(false);
            return solution;
        };
        let most = svd.singular_values.max();
        // A share of a lost direction larger than rounding can explain.
        let share = 3.0 * rounding.max(f64::EPSILON).sqrt();
        let mut least = most;
        let (mut projections, mut directions) = (Vec::new(), Vec::new());
        for (k, s) in svd.singular_values.iter().enumerate() {
            let direction = v_t.row(k);
            if *s <= rounding * most {
                let shares = direction.iter().zip(&seen).filter(|(v, _)| v.abs() > share);
                let shares: Vec<(usize, f64)> = shares.map(|(v, j)| (*j, *v)).collect();
                for (j, _) in &shares {
                    solution.determined[*j] = false;
                }
                solution.null_directions.push(shares);
                continue;
            }
            least = least.min(*s);
            let natural: Vec<(usize, f64)> =
                direction.iter().zip(&seen).map(|(v, j)| (*j, v / scale[*j])).collect();
            for (i, a) in &natural {
                for (j, b) in &natural {
                    solution.covariance[(*i, *j)] += a * b / (s * s);
                }
            }
            projections.push(u.column(k).into_owned() / *s);
            directions.push(natural);
        }
        // The decomposition is good to some 1e-11; one step of refinement takes that off the estimate.
        for _ in 0..2 {
            let left =
                DVector::from_column_slice(self.z()) - &r * DVector::from_column_slice(&solution.estimate);
            for (u, natural) in projections.iter().zip(&directions) {
                let projection = u.dot(&left);
                for (i, a) in natural {
                    solution.estimate[*i] += a * projection;
                }
            }
        }
        if least > 0.0 {
            solution.condition_number = most / least;
        }
        solution
    }
}

impl From<&TreeFactor<f64>> for Factor {
    fn from(taken: &TreeFactor<f64>) -> Self {
        let n = taken.parameters();
        let mut factor = Self::new(n);
        for i in 0..n {
            for (k, value) in taken.row(i).enumerate() {
                factor.triangle[(i + k) * n + i] = value;
            }
        }
        (factor.residual_sum_of_squares, factor.rows) =
            (taken.residual_sum_of_squares(), u64::from(taken.rows()));
        factor
    }
}

impl<const N: usize> From<&InformationFactor<f64, N>> for Factor {
    fn from(fixed: &InformationFactor<f64, N>) -> Self {
        let mut factor = Self::new(N);
        for (j, column) in (0..N).map(|j| (j, fixed.r().map(|row| row[j]))) {
            factor.triangle[j * N..(j + 1) * N].copy_from_slice(&column);
        }
        factor.triangle[N * N..].copy_from_slice(fixed.z());
        (factor.residual_sum_of_squares, factor.rows) =
            (fixed.residual_sum_of_squares(), u64::from(fixed.rows()));
        factor
    }
}

#[cfg(test)]
#[path = "factor_tests.rs"]
mod tests;
