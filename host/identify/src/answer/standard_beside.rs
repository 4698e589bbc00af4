//! Full parameters of links by rows and by what is known of them beforehand, a normal distribution of all of
//! them.
//!
//! With rows R of the base parameters K φ, z their right-hand side, φ⁰ and Σ what is known:
//! `H = Σ⁻¹ + KᵀRᵀR K`, `φ = φ⁰ + H⁻¹ KᵀRᵀ (z − R K φ⁰)`, and of bodies that can be the nearest to it in the
//! metric of H. Errors that all rows share, e of variance 1, move what rows and Σ say by D e: the rows are
//! wrong by Y e with `RᵀY = (RᵀR + P) D`, P what Σ says of the base parameters. Those of rows with the
//! covariance `1 + Y Yᵀ = L Lᵀ` are `L⁻¹ R, L⁻¹ z`.
//!
//! A few draws of errors that have many more directions weigh rows as if no others were possible: rows then
//! tell each draw's amount, and what they say beside these few directions is taken for right. Therefore each
//! draw moves values whose weights come from the others alone, as an error that nobody has drawn does, and
//! the covariance is the sum of what these do.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::standard_parameters::{BaseEstimate, Full, Problem, full, symmetric_pairs, variables};
use rigident_model::{Model, ModelError, symmetry};

/// The weight of the barrier that keeps bodies possible: it moves nothing that is inside by more than this in
/// standard deviations.
const BARRIER: f64 = 0.03;

/// Directions that rows tell less of than this share of the best one know no error.
const LEAST_DIRECTION: f64 = 1e-5;

/// The part of the variance of drawn errors that counts as each row's own in the weights: more directions are
/// wrong than were drawn (O. Ledoit, M. Wolf, J. Multivariate Analysis 88 (2), 2004, of few samples).
const ALONE: f64 = 0.5;

/// Errors that all rows share.
pub struct Errors {
    /// The effect of those that rows are weighted by on the base parameters by rows and what is known
    /// beforehand, one column each, of 1 σ.
    pub moved: DMatrix<f64>,
    /// The same of draws of errors of many directions, one column each, of which the sum of squares counts.
    pub drawn: DMatrix<f64>,
    /// The same of errors that values are not to follow, as of zeros: they are in the covariance alone.
    pub beside: DMatrix<f64>,
    /// The prior knowledge of the base parameters, as rows of variance 1.
    pub known: DMatrix<f64>,
}

impl Errors {
    /// Y of some errors.
    fn rows(&self, r: &DMatrix<f64>, moved: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let right = r.transpose() * (r * moved) + self.known.transpose() * (&self.known * moved);
        // Columns of unit length, so that no unit decides what is small.
        let scale = DVector::from_iterator(
            r.ncols(),
            r.column_iter().map(|column| if column.norm() > 0.0 { 1.0 / column.norm() } else { 0.0 }),
        );
        let scale = DMatrix::from_diagonal(&scale);
        let svd = (r * &scale).svd(true, true);
        let (u, v_t) = (svd.u?, svd.v_t?);
        let least = LEAST_DIRECTION * svd.singular_values.max();
        let inverse = svd.singular_values.map(|s| if s > least { 1.0 / s } else { 0.0 });
        Some(u * DMatrix::from_diagonal(&inverse) * v_t * &scale * right)
    }
}

/// Rows weighted by the errors that they share, beside what is known beforehand.
struct Weighted {
    /// L.
    root: DMatrix<f64>,
    /// `L⁻¹ R K`.
    rows: DMatrix<f64>,
    /// `Σ⁻¹ + Kᵀ Rᵀ (L Lᵀ)⁻¹ R K`.
    information: Cholesky<f64, Dyn>,
}

impl Weighted {
    /// Returns rows that are wrong by some errors Y, one column each, and by others of which some were drawn;
    /// `None` if nothing is known of a direction.
    fn by(
        [moved, drawn]: [&DMatrix<f64>; 2],
        rows: &DMatrix<f64>,
        beforehand: &DMatrix<f64>,
    ) -> Option<Self> {
        let mut all = DMatrix::identity(rows.nrows(), rows.nrows()) + moved * moved.transpose();
        let square = drawn * drawn.transpose();
        all += DMatrix::from_diagonal(&square.diagonal()) * ALONE + square * (1.0 - ALONE);
        let root = all.cholesky()?.l();
        let rows = root.solve_lower_triangular(rows)?;
        let information = (beforehand + rows.transpose() * &rows).cholesky()?;
        Some(Self { root, rows, information })
    }

    fn whitened(&self, all: &DMatrix<f64>) -> DMatrix<f64> {
        self.root.solve_lower_triangular(all).unwrap_or_else(|| all.clone())
    }

    /// Returns how errors of rows, one column each, move the parameters.
    fn shifts(&self, errors: &DMatrix<f64>) -> DMatrix<f64> {
        self.information.solve(&(self.rows.transpose() * self.whitened(errors)))
    }
}

/// Returns the columns of two matrices with as many rows beside one another.
pub fn joined(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(a.nrows(), a.ncols() + b.ncols());
    all.columns_mut(0, a.ncols()).copy_from(a);
    all.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    all
}

/// Returns the covariance of parameters by rows that share errors `moved`, and others of which `drawn` are
/// draws; `all` is weighted by both.
fn counted(
    all: &Weighted,
    [moved, drawn]: [&DMatrix<f64>; 2],
    rows: &DMatrix<f64>,
    beforehand: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    // Noise, what is known, and errors all of whose directions are here.
    let own = joined(&DMatrix::identity(rows.nrows(), rows.nrows()), moved);
    let by_rows = all.shifts(&own);
    let by_known = all.information.solve(beforehand);
    let inverse = all.information.inverse();
    let mut sum = &by_rows * by_rows.transpose() + by_known * inverse;
    for k in 0..drawn.ncols() {
        let share = drawn.ncols() as f64 / (drawn.ncols() - 1).max(1) as f64;
        let others = drawn.clone().remove_column(k) * share.sqrt();
        let without = Weighted::by([moved, &others], rows, beforehand)?;
        let shift = without.shifts(&drawn.columns(k, 1).into_owned());
        sum += &shift * shift.transpose();
    }
    Some(sum)
}

/// Returns the full parameters of a model's links, ten each, and their covariance, by an estimate of base
/// parameters and what is known beforehand: the model's nominal bodies with `covariance`; `errors` are those
/// of the rows that their noise does not count. With `symmetric` the right links mirror the left ones.
///
/// # Errors
/// [`ModelError`] if a link has no body, or what is known is singular.
pub fn beside(
    model: &Model,
    found: &BaseEstimate,
    (covariance, errors): (&DMatrix<f64>, &Errors),
    symmetric: bool,
) -> Result<(Full, DMatrix<f64>), ModelError> {
    let refuse =
        |problem: &str| ModelError::Structure { what: model.name.clone(), problem: problem.to_owned() };
    let variables = variables(model, 0)?;
    let nominal =
        DVector::from_iterator(10 * variables.nominal.len(), variables.nominal.iter().flatten().copied());
    if nominal.len() != covariance.nrows() {
        return Err(refuse("a link has no body"));
    }
    let map = found.base.map() * &variables.bodies;
    let singular = || refuse("what is known of its links beforehand is singular");
    let none = || DMatrix::zeros(found.r.nrows(), 0);
    let [moved, drawn] =
        [&errors.moved, &errors.drawn].map(|own| errors.rows(&found.r, own).unwrap_or_else(none));
    let beforehand = covariance.clone().cholesky().ok_or_else(singular)?.inverse();
    let plain = &found.r * &map;
    let weighted = Weighted::by([&moved, &drawn], &plain, &beforehand).ok_or_else(singular)?;
    let right = DMatrix::from_column_slice(found.z.len(), 1, found.z.as_slice());
    let left = weighted.whitened(&right) - &weighted.rows * &nominal;
    let mean = &nominal + weighted.information.solve(&(weighted.rows.transpose() * left)).column(0);
    let upper = weighted.information.l().transpose();
    let pairs = if symmetric { symmetric_pairs(model, &variables)? } else { Vec::new() };
    let substitution = symmetry::substitution(variables.nominal.len(), &pairs);
    let mut problem = Problem {
        rows: &upper * &substitution,
        rhs: &upper * mean,
        substitution,
        nominal: &variables.nominal,
        weight: BARRIER,
    };
    let solved = problem.solve();
    let mut covariance = counted(&weighted, [&moved, &drawn], &plain, &beforehand).ok_or_else(singular)?;
    if let Some(y) = errors.rows(&found.r, &errors.beside) {
        let shifts = weighted.shifts(&y);
        covariance += &shifts * shifts.transpose();
    }
    Ok((full(&variables, found, &map, solved), covariance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Few draws of errors of many directions must not be taken for all of them: the covariance that is
    /// stated is that of an error which nobody has drawn.
    #[test]
    fn the_covariance_counts_directions_that_were_not_drawn() {
        const N: usize = 30;
        const DRAWS: usize = 12;
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut unit = || -> f64 { StandardNormal.sample(&mut random) };
        // Rows of unit variance whose errors are three times as large, in all directions.
        let rows = DMatrix::from_fn(N, N, |_, _| unit());
        let beforehand = DMatrix::identity(N, N) * 0.05;
        let all = DMatrix::from_fn(N, 4 * N, |_, _| 3.0 * unit() / (4.0 * N as f64).sqrt());
        let none = DMatrix::zeros(N, 0);
        let (mut stated, mut actual) = (0.0, 0.0);
        for _ in 0..20 {
            let drawn = DMatrix::from_fn(4 * N, DRAWS, |_, _| unit() / (DRAWS as f64).sqrt());
            let drawn = &all * drawn;
            let weighted = Weighted::by([&none, &drawn], &rows, &beforehand).unwrap();
            stated += counted(&weighted, [&none, &drawn], &rows, &beforehand).unwrap().trace();
            // Of the estimator that these weights make, with every direction of the errors.
            actual += counted(&weighted, [&all, &none], &rows, &beforehand).unwrap().trace();
        }
        assert!((0.85..1.15).contains(&(stated / actual)), "{stated} {actual}");
    }
}
