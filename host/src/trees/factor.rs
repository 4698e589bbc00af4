//! The information factor of as many parameters as a model has.
//!
//! The numbers are those of `rigident_shared::factor`, whose kernel reduces the rows; only the size is not known when
//! the program is compiled. What is determined is decided by the same rules, but for the rounding
//! that robot descriptions bring.

use nalgebra::DMatrix;
use rigident_shared::Scalar;
use rigident_shared::estimator::frames::TreeFactor;
use rigident_shared::factor::{BLOCK_ROWS, Column};

/// What shows less than this, in columns of unit length, is not told apart: robot descriptions round angles to some 1e-11
/// (π/2 as 1.57079632679), and by that alone columns that are one seem to be two.
const ROUNDED: f64 = 1e-10;

/// `[R z]`, the residual sum of squares and the row count of all rows seen. Rows come whitened.
#[derive(Clone, Debug, PartialEq)]
pub struct TallFactor {
    parameters: usize,
    /// By columns, z the last; the entries below the diagonal are zero.
    triangle: Vec<f64>,
    residual_sum_of_squares: f64,
    rows: u32,
}

/// What a factor says.
#[derive(Clone, Debug, PartialEq)]
pub struct TallSolution {
    /// Least-squares estimate; meaningless where not determined.
    pub estimate: Vec<f64>,
    /// `(RᵀR)⁻¹` over the directions that are determined.
    pub covariance: DMatrix<f64>,
    /// Whether the rows alone determine the parameter.
    pub determined: Vec<bool>,
    /// 2-norm condition number of the column-scaled R over what is determined.
    pub condition_number: f64,
    /// Directions that are not: parameters and their shares.
    pub lost: Vec<Vec<(usize, f64)>>,
}

impl TallFactor {
    /// The factor of no rows.
    pub fn new(parameters: usize) -> Self {
        Self {
            parameters,
            triangle: vec![0.0; parameters * (parameters + 1)],
            residual_sum_of_squares: 0.0,
            rows: 0,
        }
    }

    /// From a device's numbers: the triangle by rows, the right-hand side, the residual sum of squares. `None` if they are no
    /// factor.
    pub fn from_entries(parameters: usize, entries: &[f64], rows: u32) -> Option<Self> {
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

    /// From a factor that was taken row by row.
    pub fn from_rows(taken: &TreeFactor<f64>) -> Self {
        let n = taken.parameters();
        let mut factor = Self::new(n);
        for i in 0..n {
            for (k, value) in taken.row(i).enumerate() {
                factor.triangle[(i + k) * n + i] = value;
            }
        }
        (factor.residual_sum_of_squares, factor.rows) = (taken.residual_sum_of_squares(), taken.rows());
        factor
    }

    /// Returns the same factor in the one form.
    pub fn to_factor(&self) -> crate::fit::Factor {
        crate::fit::Factor::from_columns(
            self.parameters,
            self.triangle.clone(),
            self.residual_sum_of_squares,
            u64::from(self.rows),
        )
    }

    /// How many parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// Scalar rows absorbed.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Sum of squares that no parameters explain.
    pub fn residual_sum_of_squares(&self) -> f64 {
        self.residual_sum_of_squares
    }

    /// The triangle.
    pub fn r(&self) -> DMatrix<f64> {
        DMatrix::from_column_slice(
            self.parameters,
            self.parameters,
            &self.triangle[..self.parameters * self.parameters],
        )
    }

    /// The projected right-hand side.
    pub fn z(&self) -> &[f64] {
        &self.triangle[self.parameters * self.parameters..]
    }

    /// Absorbs rows: coefficients of all parameters, then what they make.
    pub fn absorb<'a>(&mut self, rows: impl IntoIterator<Item = (&'a [f64], f64)>) {
        let mut columns = vec![Column::<f64>::ZERO; self.parameters + 1];
        let mut filled = 0;
        let flush = |columns: &mut Vec<Column<f64>>, triangle: &mut [f64]| {
            let sum = f64::reduce(triangle, self.parameters, columns);
            columns.fill(Column::ZERO);
            sum
        };
        for (row, value) in rows {
            for (column, entry) in columns.iter_mut().zip(row.iter().chain([&value])) {
                column.rows[filled] = *entry;
            }
            filled += 1;
            self.rows = self.rows.saturating_add(1);
            if filled == BLOCK_ROWS {
                self.residual_sum_of_squares += flush(&mut columns, &mut self.triangle);
                filled = 0;
            }
        }
        if filled > 0 {
            self.residual_sum_of_squares += flush(&mut columns, &mut self.triangle);
        }
    }

    /// What all rows say of the first `kept` parameters, whatever the others are.
    #[must_use]
    pub fn leading(&self, kept: usize) -> Self {
        let n = self.parameters;
        let gone = n - kept.min(n);
        // The others first; then the trailing triangle is the marginal.
        let (r, z) = (self.r(), self.z());
        let order = |k: usize| if k < gone { kept + k } else { k - gone };
        let stacked = DMatrix::from_fn(n, n + 1, |i, k| if k < n { r[(i, order(k))] } else { z[i] });
        let reduced = stacked.qr().r();
        let mut out = Self::new(n - gone);
        let rest = n - gone;
        for k in 0..=rest {
            for i in 0..rest {
                let column = if k < rest { gone + k } else { n };
                out.triangle[k * rest + i] =
                    if k == rest || i <= k { reduced[(gone + i, column)] } else { 0.0 };
            }
        }
        (out.rows, out.residual_sum_of_squares) = (self.rows, self.residual_sum_of_squares);
        out
    }

    /// The same rows, solution `estimate`, with standard deviations `by` times as large and correlations as they are.
    #[must_use]
    pub fn stretched(&self, estimate: &[f64], by: &[f64]) -> Self {
        let n = self.parameters;
        let mut out = self.clone();
        let (triangle, z) = out.triangle.split_at_mut(n * n);
        // R (φ − φ̂) keeps its residual z − R φ̂.
        for (column, (value, by)) in triangle.chunks_exact_mut(n.max(1)).zip(estimate.iter().zip(by)) {
            for (z, r) in z.iter_mut().zip(column) {
                let before = *r;
                *r /= by;
                *z += (*r - before) * value;
            }
        }
        out
    }

    /// The same with another count of scalar rows.
    #[must_use]
    pub(super) fn counted(self, rows: u32) -> Self {
        Self { rows, ..self }
    }

    /// The same rows whitened by another σ, `by` times as small; the residual sum stays.
    #[must_use]
    pub(super) fn weighted(mut self, by: f64) -> Self {
        self.triangle.iter_mut().for_each(|v| *v *= by);
        self
    }

    /// The least-squares solution and what of it is determined.
    pub fn solve(&self) -> TallSolution {
        let n = self.parameters;
        let r = self.r();
        let scale: Vec<f64> = r.column_iter().map(|c| c.norm()).collect();
        // Columns of zeros are no part of any combination.
        let seen: Vec<usize> = (0..n).filter(|j| scale[*j] > 0.0).collect();
        let r = DMatrix::from_fn(n, seen.len(), |i, k| r[(i, seen[k])] / scale[seen[k]]);
        let mut solution = TallSolution {
            estimate: vec![0.0; n],
            covariance: DMatrix::zeros(n, n),
            determined: scale.iter().map(|s| *s > 0.0).collect(),
            condition_number: 1.0,
            lost: Vec::new(),
        };
        if seen.is_empty() {
            return solution;
        }
        let svd = r.svd(true, true);
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else { return solution };
        let most = svd.singular_values.max();
        let floor = ROUNDED * most;
        // A share of a lost direction larger than rounding can explain.
        let share = 3.0 * ROUNDED.sqrt();
        let mut least = most;
        for (k, s) in svd.singular_values.iter().enumerate() {
            let direction = v_t.row(k);
            if *s <= floor {
                let parts: Vec<(usize, f64)> = direction
                    .iter()
                    .zip(&seen)
                    .filter(|(v, _)| v.abs() > share)
                    .map(|(v, j)| (*j, *v))
                    .collect();
                for (j, _) in &parts {
                    solution.determined[*j] = false;
                }
                solution.lost.push(parts);
                continue;
            }
            least = least.min(*s);
            let projection: f64 = u.column(k).iter().zip(self.z()).map(|(a, b)| a * b).sum::<f64>() / s;
            let natural: Vec<(usize, f64)> =
                direction.iter().zip(&seen).map(|(v, j)| (*j, v / scale[*j])).collect();
            for (i, a) in &natural {
                solution.estimate[*i] += a * projection;
                for (j, b) in &natural {
                    solution.covariance[(*i, *j)] += a * b / (s * s);
                }
            }
        }
        if least > 0.0 {
            solution.condition_number = most / least;
        }
        solution
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;

    fn number(k: usize) -> f64 {
        ((k * k * 31 + k * 17 + 5) as f64).sin()
    }

    fn problem(rows: usize, n: usize) -> (DMatrix<f64>, DVector<f64>) {
        (
            DMatrix::from_fn(rows, n, |i, j| number(i * n + j)),
            DVector::from_fn(rows, |i, _| number(7 * i + 3)),
        )
    }

    fn factor_of(a: &DMatrix<f64>, y: &DVector<f64>) -> TallFactor {
        let rows: Vec<Vec<f64>> = a.row_iter().map(|r| r.iter().copied().collect()).collect();
        let mut factor = TallFactor::new(a.ncols());
        // In two pieces that do not fill whole blocks.
        let cut = rows.len() / 3;
        factor.absorb(rows[..cut].iter().zip(y.iter()).map(|(r, v)| (r.as_slice(), *v)));
        factor.absorb(rows[cut..].iter().zip(y.iter().skip(cut)).map(|(r, v)| (r.as_slice(), *v)));
        factor
    }

    #[test]
    fn the_factor_is_that_of_the_normal_equations() {
        let (a, y) = problem(100, 17);
        let factor = factor_of(&a, &y);
        let (r, z) = (factor.r(), DVector::from_column_slice(factor.z()));
        assert!((r.tr_mul(&r) - a.tr_mul(&a)).abs().max() < 1e-12);
        assert!((r.tr_mul(&z) - a.tr_mul(&y)).abs().max() < 1e-12);
        let solution = factor.solve();
        let gram = (a.tr_mul(&a)).cholesky().unwrap();
        let wanted = gram.solve(&a.tr_mul(&y));
        assert!((DVector::from_vec(solution.estimate.clone()) - &wanted).abs().max() < 1e-12);
        assert!((&solution.covariance - gram.inverse()).abs().max() < 1e-12);
        let rss = (&a * wanted - y).norm_squared();
        assert!((factor.residual_sum_of_squares() - rss).abs() < 1e-11 * rss);
        assert_eq!((factor.rows(), solution.lost.len()), (100, 0));
    }

    #[test]
    fn a_device_s_numbers_are_the_factor_they_were_made_of() {
        let (a, y) = problem(40, 5);
        let factor = factor_of(&a, &y);
        let r = factor.r();
        let mut entries: Vec<f64> =
            (0..5).flat_map(|i| (i..5).map(move |j| (i, j))).map(|at| r[at]).collect();
        entries.extend(factor.z());
        entries.push(factor.residual_sum_of_squares());
        assert_eq!(TallFactor::from_entries(5, &entries, 40), Some(factor.clone()));
        assert_eq!(TallFactor::from_entries(4, &entries, 40), None);
        entries[3] = f64::NAN;
        assert_eq!(TallFactor::from_entries(5, &entries, 40), None);
        // Row by row, as a tree's are taken.
        let mut taken = Box::new(TreeFactor::<f64>::EMPTY);
        taken.clear(5);
        for i in 0..5 {
            let row: Vec<f64> = (i..5).map(|j| r[(i, j)]).chain([factor.z()[i]]).collect();
            taken.merge_row(i, &row);
        }
        taken.merge_residual(factor.residual_sum_of_squares(), factor.rows());
        let again = TallFactor::from_rows(&taken);
        assert!((again.r().map(f64::abs) - r.map(f64::abs)).abs().max() < 1e-12);
        let (one, other) = (again.solve(), factor.solve());
        for (a, b) in one.estimate.iter().zip(&other.estimate) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_eq!((again.rows(), again.residual_sum_of_squares()), (40, factor.residual_sum_of_squares()));
    }

    #[test]
    fn the_leading_parameters_alone_have_the_marginal_covariance() {
        let (a, y) = problem(60, 9);
        let (all, part) = (factor_of(&a, &y).solve(), factor_of(&a, &y).leading(5).solve());
        for i in 0..5 {
            assert!((all.estimate[i] - part.estimate[i]).abs() < 1e-12);
            for j in 0..5 {
                assert!((all.covariance[(i, j)] - part.covariance[(i, j)]).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_stretched_factor_has_the_same_solution_with_wider_intervals() {
        let (a, y) = problem(60, 5);
        let factor = factor_of(&a, &y);
        let (before, by) = (factor.solve(), [1.0, 2.0, 1.5, 1.0, 7.0]);
        let after = factor.stretched(&before.estimate, &by).solve();
        for i in 0..5 {
            assert!((after.estimate[i] - before.estimate[i]).abs() < 1e-12);
            for j in 0..5 {
                let wanted = before.covariance[(i, j)] * by[i] * by[j];
                assert!((after.covariance[(i, j)] - wanted).abs() < 1e-12 * wanted.abs().max(1e-3));
            }
        }
    }

    #[test]
    fn columns_that_differ_by_a_rounded_angle_are_one() {
        let (mut a, y) = problem(60, 4);
        let nearly = a.column(1)
            + a.column(2)
                * (std::f64::consts::FRAC_PI_2 - (1e11 * std::f64::consts::FRAC_PI_2).trunc() * 1e-11);
        a.set_column(3, &nearly);
        let solution = factor_of(&a, &y).solve();
        assert_eq!(solution.determined, [true, false, true, false]);
        assert!(solution.condition_number < 10.0);
    }

    #[test]
    fn parameters_that_only_occur_together_are_not_determined_and_the_rest_is() {
        let (mut a, y) = problem(60, 6);
        let sum = a.column(1) * 2.0 - a.column(4);
        a.set_column(5, &sum);
        let zero = a.column(2) * 0.0;
        a.set_column(2, &zero);
        let solution = factor_of(&a, &y).solve();
        assert_eq!(solution.determined, [true, false, false, true, false, false]);
        let mut together: Vec<usize> = solution.lost.concat().iter().map(|l| l.0).collect();
        together.sort_unstable();
        assert_eq!(together, [1, 4, 5]);
    }
}
