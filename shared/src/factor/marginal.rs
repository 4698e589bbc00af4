use super::{InformationFactor, Triangle};
use crate::Scalar;

impl<T: Scalar, const N: usize> InformationFactor<T, N> {
    /// Returns the factor of the last `K` parameters with the others eliminated: what all rows say about
    /// those `K` when nothing else is known about the rest. Nuisance parameters are therefore absorbed first
    /// in order.
    ///
    /// The trailing rows of a triangle hold no earlier column, so they are the marginal information
    /// themselves.
    pub fn trailing<const K: usize>(&self) -> InformationFactor<T, K> {
        const { assert!(K <= N, "no more parameters than there are") }
        let first = N - K;
        let Triangle { r, z } = &self.triangle;
        InformationFactor {
            triangle: Triangle {
                r: core::array::from_fn(|j| core::array::from_fn(|i| r[first + j][first + i])),
                z: core::array::from_fn(|i| z[first + i]),
            },
            residual_sum_of_squares: self.residual_sum_of_squares,
            rows: self.rows,
        }
    }

    /// Returns the factor of ψ where `φ = B ψ`: every row `A φ = y` reads `(A B) ψ = y`. `map[i][j]` is B_ij.
    ///
    /// Serves a change of order, a tie between parameters, and a body that is the sum of two.
    pub fn substitute<const M: usize>(&self, map: &[[T; M]; N]) -> InformationFactor<T, M> {
        let mut factor = InformationFactor::new();
        for i in 0..N {
            let mut columns = [[T::ZERO; 1]; M];
            for (j, [entry]) in columns.iter_mut().enumerate() {
                for (column, b) in self.triangle.r.iter().zip(map).skip(i) {
                    *entry += column[i] * b[j];
                }
            }
            factor.absorb(&columns, &[self.triangle.z[i]]);
        }
        factor.residual_sum_of_squares += self.residual_sum_of_squares;
        factor.rows = self.rows;
        factor
    }
}
