//! Full parameters of links by rows and by what is known of them beforehand, a normal distribution of all of
//! them.
//!
//! With rows R of the base parameters K φ, z their right-hand side, φ⁰ and Σ what is known:
//! `H = Σ⁻¹ + KᵀRᵀR K`, `φ = φ⁰ + H⁻¹ KᵀRᵀ (z − R K φ⁰)`, and of bodies that can be the nearest to it in the
//! metric of H. Errors that all rows share, e of variance 1, move what rows and Σ say by D e: the rows are
//! wrong by Y e with `RᵀY = (RᵀR + P) D`, P what Σ says of the base parameters. Those of rows with the
//! covariance `1 + Y Yᵀ = L Lᵀ` are `L⁻¹ R, L⁻¹ z`.

use nalgebra::{DMatrix, DVector};

use super::standard_parameters::{BaseEstimate, Full, Problem, full, symmetric_pairs, variables};
use rigident_model::{Model, ModelError, symmetry};

/// The weight of the barrier that keeps bodies possible: it moves nothing that is inside by more than this in
/// standard deviations.
const BARRIER: f64 = 0.03;

/// Directions that rows tell less of than this share of the best one know no error.
const LEAST_DIRECTION: f64 = 1e-5;

/// Errors that all rows share.
pub struct Errors {
    /// The effect of those that rows are weighted by on the base parameters by rows and what is known
    /// beforehand, one column each, of 1 σ.
    pub moved: DMatrix<f64>,
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

    /// L: the root of the covariance of rows with the errors that they are weighted by.
    fn root(&self, r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let y = self.rows(r, &self.moved)?;
        let all = DMatrix::identity(r.nrows(), r.nrows()) + &y * y.transpose();
        Some(all.cholesky()?.l())
    }
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
    let own = errors.root(&found.r);
    let whitened = |all: &DMatrix<f64>| {
        own.as_ref().and_then(|own| own.solve_lower_triangular(all)).unwrap_or_else(|| all.clone())
    };
    let rows = whitened(&(&found.r * &map));
    let right =
        whitened(&DMatrix::from_column_slice(found.z.len(), 1, found.z.as_slice())).column(0).into_owned();
    let singular = || refuse("what is known of its links beforehand is singular");
    let information =
        covariance.clone().cholesky().ok_or_else(singular)?.inverse() + rows.transpose() * &rows;
    let root = information.cholesky().ok_or_else(singular)?;
    let mean = &nominal + root.solve(&(rows.transpose() * (right - &rows * &nominal)));
    let upper = root.l().transpose();
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
    let mut covariance = root.inverse();
    if let Some(y) = errors.rows(&found.r, &errors.beside) {
        let shifts = &covariance * rows.transpose() * whitened(&y);
        covariance += &shifts * shifts.transpose();
    }
    Ok((full(&variables, found, &map, solved), covariance))
}
