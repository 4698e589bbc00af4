//! Whitening by a covariance that is banded: noise of a sample reaches the residuals of its neighbours.

use nalgebra::{Cholesky, DMatrix};

/// The addition of noise of unit variance of three samples to the residuals of the middle one, C × S each.
pub(super) struct Coefficients {
    pub(super) before: DMatrix<f64>,
    pub(super) now: DMatrix<f64>,
    pub(super) after: DMatrix<f64>,
}

/// A sample that went through.
struct Past {
    coefficients: Coefficients,
    /// Diagonal block of the covariance's lower triangular factor, and that left of it.
    own: DMatrix<f64>,
    beside: Option<DMatrix<f64>>,
    rows: DMatrix<f64>,
}

/// Whitens the rows of one sample after the other, by the factor of the covariance that grows with them.
pub(super) struct Banded {
    /// Covariance of what each sample has of its own.
    constant: DMatrix<f64>,
    last: Option<Past>,
    earlier: Option<Past>,
}

impl Banded {
    /// Returns the whitening of samples with noise of their own of this covariance, C × C.
    pub(super) fn new(constant: DMatrix<f64>) -> Self {
        Self { constant, last: None, earlier: None }
    }

    /// Returns the rows of the next sample, whitened; `None` if the covariance is not positive definite.
    pub(super) fn next(&mut self, coefficients: Coefficients, rows: DMatrix<f64>) -> Option<DMatrix<f64>> {
        let Coefficients { before, now, after } = &coefficients;
        let squares = before * before.transpose() + now * now.transpose() + after * after.transpose();
        let (mut diagonal, mut rest, mut beside) = (&self.constant + squares, rows, None);
        if let Some(last) = &self.last {
            let shared = &last.coefficients;
            let mut covariance = before * shared.now.transpose() + now * shared.after.transpose();
            if let Some(earlier) = &self.earlier {
                let two_back = right_solve(&(before * earlier.coefficients.after.transpose()), &earlier.own)?;
                if let Some(its_beside) = &last.beside {
                    covariance -= &two_back * its_beside.transpose();
                }
                diagonal -= &two_back * two_back.transpose();
                rest -= &two_back * &earlier.rows;
            }
            let one_back = right_solve(&covariance, &last.own)?;
            diagonal -= &one_back * one_back.transpose();
            rest -= &one_back * &last.rows;
            beside = Some(one_back);
        }
        let own = Cholesky::new(diagonal)?.l();
        let rows = own.solve_lower_triangular(&rest)?;
        let white = rows.clone();
        self.earlier = self.last.take();
        self.last = Some(Past { coefficients, own, beside, rows });
        Some(white)
    }
}

/// Returns `matrix L⁻ᵀ` of a lower triangle.
fn right_solve(matrix: &DMatrix<f64>, lower: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    Some(lower.solve_lower_triangular(&matrix.transpose())?.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The information of rows whitened one by one is that of the dense inverse of the whole covariance.
    #[test]
    fn rows_carry_the_information_that_the_whole_covariance_leaves_them() {
        let (channels, samples, signals, columns) = (2, 7, 3, 2);
        let mut state = 1_u32;
        let mut any = |rows, columns| {
            DMatrix::from_fn(rows, columns, |_, _| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state >> 8) / f64::from(1 << 23) - 1.0
            })
        };
        let constant = DMatrix::from_diagonal_element(channels, channels, 0.3);
        let mut banded = Banded::new(constant.clone());
        // Noise of the samples, one more at either end, to residuals.
        let mut way = DMatrix::zeros(channels * samples, signals * (samples + 2));
        let mut all = DMatrix::zeros(channels * samples, columns);
        let mut information = DMatrix::zeros(columns, columns);
        for k in 0..samples {
            let [before, now, after] =
                [any(channels, signals), any(channels, signals), any(channels, signals)];
            for (lag, own) in [&before, &now, &after].into_iter().enumerate() {
                way.view_mut((channels * k, signals * (k + lag)), (channels, signals)).copy_from(own);
            }
            let rows = any(channels, columns);
            all.view_mut((channels * k, 0), (channels, columns)).copy_from(&rows);
            let white = banded.next(Coefficients { before, now, after }, rows).unwrap();
            information += white.tr_mul(&white);
        }
        let mut covariance = &way * way.transpose();
        for k in 0..channels * samples {
            covariance[(k, k)] += 0.3;
        }
        let dense = all.tr_mul(&(covariance.try_inverse().unwrap() * &all));
        assert!((&information - &dense).norm() < 1e-12 * dense.norm(), "{information} {dense}");
    }
}
