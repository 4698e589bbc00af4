//! The size of an error that is larger than stated: one error, or several, with their own knowledge
//! beforehand left out.
//!
//! Errors θ drawn from N(μ, P) are estimated as θ̂, and `d = θ̂ − μ` then has the covariance D. With the
//! score `s = P⁻¹ d` and its covariance `H = P⁻¹ D P⁻¹` an error `U a` in addition to what is drawn has
//! ```text
//! E[s] = H U a        â = (UᵀHU)⁻¹ Uᵀs        Δχ² = sᵀU (UᵀHU)⁻¹ Uᵀs
//! ```
//! (C. R. Rao, 1948). `(UᵀHU)⁻¹` counts what is drawn; `(UᵀHU)⁻¹ − (UᵀP⁻¹U)⁻¹` is the covariance of the whole
//! error along U as the rows tell it. All other errors keep what is known of them.

use nalgebra::{DMatrix, DVector};

/// Less of the variance beforehand is rounding.
const LEAST: f64 = 1e-6;

/// Scores of errors of a rig against what is known of them beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorScores {
    score: DVector<f64>,
    information: DMatrix<f64>,
    beforehand: DMatrix<f64>,
}

/// Errors along some directions as the rows tell them.
#[derive(Clone, Debug, PartialEq)]
pub struct Larger {
    /// The errors less their values beforehand, one a direction.
    pub value: DVector<f64>,
    /// Standard deviation of each by the rows.
    pub sd: DVector<f64>,
    /// Standard deviation of each if it is drawn as known beforehand.
    pub drawn_sd: DVector<f64>,
    /// χ² that goes away if they are freed.
    pub chi2: f64,
}

impl ErrorScores {
    /// Returns the scores of estimates that are `off` by this much from their values beforehand, a
    /// distribution of the covariance `prior`; `drawn` is the covariance of `off` if they are drawn from
    /// that. `None` if that is singular.
    pub(super) fn new(off: &DVector<f64>, prior: DMatrix<f64>, drawn: &DMatrix<f64>) -> Option<Self> {
        let beforehand = prior.cholesky()?.inverse();
        let information = &beforehand * drawn * &beforehand;
        let information = 0.5 * (&information + information.transpose());
        Some(Self { score: &beforehand * off, information, beforehand })
    }

    /// Returns the number of errors.
    pub fn count(&self) -> usize {
        self.score.len()
    }

    /// Returns the errors along the columns of `directions`; `None` where the rows do not tell them.
    pub fn larger(&self, directions: &DMatrix<f64>) -> Option<Larger> {
        let informed = directions.transpose() * &self.information * directions;
        let drawn = (directions.transpose() * &self.beforehand * directions).cholesky()?.inverse();
        let covariance = informed.cholesky()?.inverse();
        let (total, prior) = (covariance.diagonal(), drawn.diagonal());
        if covariance.iter().any(|v| !v.is_finite())
            || prior.iter().zip(&total).any(|(prior, all)| *prior < LEAST * all)
        {
            return None;
        }
        let score = directions.transpose() * &self.score;
        let value = &covariance * &score;
        Some(Larger {
            chi2: score.dot(&value),
            sd: (&total - prior).map(|variance| variance.max(0.0).sqrt()),
            drawn_sd: total.map(f64::sqrt),
            value,
        })
    }

    /// Returns the scores of all errors with those along some directions free: nothing is known of these
    /// beforehand.
    #[must_use]
    pub fn freed(&self, directions: &DMatrix<f64>) -> Self {
        let across = &self.information * directions;
        let Some(inverse) = (directions.transpose() * &across).cholesky().map(|c| c.inverse()) else {
            return self.clone();
        };
        Self {
            score: &self.score - &across * (&inverse * (directions.transpose() * &self.score)),
            information: &self.information - &across * inverse * across.transpose(),
            beforehand: self.beforehand.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of two errors and one parameter, solved with and without what is known of the first error: the
    /// scores tell the second solution from the first.
    #[test]
    fn scores_tell_the_solution_without_the_prior() {
        let a =
            DMatrix::from_row_slice(5, 3, &[1., 2., 0.5, 0., 1., 3., 2., -1., 1., 1., 1., 1., -1., 2., 0.3]);
        let (y, sigma) = (DVector::from_vec(vec![4., 1., 3., -2., 5.]), [0.5, 0.8]);
        let solve = |known: [f64; 2]| {
            let prior = DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, known[0], known[1]]));
            let covariance = (a.transpose() * &a + prior).try_inverse().unwrap();
            (&covariance * a.transpose() * &y, covariance)
        };
        let weights = sigma.map(|s: f64| s.powi(-2));
        let (value, covariance) = solve(weights);
        let off = value.rows(1, 2).clone_owned();
        let prior = DMatrix::from_diagonal(&DVector::from_vec(sigma.map(|s| s * s).to_vec()));
        let drawn = &prior - covariance.view((1, 1), (2, 2));
        let scores = ErrorScores::new(&off, prior, &drawn).unwrap();
        let (free, free_covariance) = solve([0.0, weights[1]]);
        let of_first = DMatrix::from_column_slice(2, 1, &[1.0, 0.0]);
        let found = scores.larger(&of_first).unwrap();
        assert!((found.value[0] - free[1]).abs() < 1e-12);
        assert!((found.sd[0] - free_covariance[(1, 1)].sqrt()).abs() < 1e-12);
        let cost = |at: &DVector<f64>, known: [f64; 2]| {
            (&y - &a * at).norm_squared() + known[0] * at[1].powi(2) + known[1] * at[2].powi(2)
        };
        assert!((found.chi2 - (cost(&value, weights) - cost(&free, [0.0, weights[1]]))).abs() < 1e-12);
        // Freed of the first, the second tells the solution without either.
        let both = solve([0.0, 0.0]).0;
        let second = scores.freed(&of_first).larger(&DMatrix::from_column_slice(2, 1, &[0.0, 1.0])).unwrap();
        assert!((second.value[0] - both[2]).abs() < 1e-10);
    }
}
