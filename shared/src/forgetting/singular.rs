use crate::Scalar;

/// Singular values of `R D⁻¹` by one-sided Jacobi: `R D⁻¹ V = W` with orthogonal columns W (Hestenes 1958).
pub(super) struct Singular<T: Scalar, const N: usize> {
    /// Columns of W.
    pub(super) w: [[T; N]; N],
    /// Columns of V.
    pub(super) v: [[T; N]; N],
    /// Squared lengths of the columns of W.
    pub(super) squares: [T; N],
}

impl<T: Scalar, const N: usize> Singular<T, N> {
    pub(super) fn of(r: &[[T; N]; N], scale: &[T; N]) -> Self {
        let mut singular = Self {
            w: core::array::from_fn(|j| core::array::from_fn(|i| r[i][j] / scale[j])),
            v: core::array::from_fn(|j| core::array::from_fn(|i| if i == j { T::ONE } else { T::ZERO })),
            squares: [T::ZERO; N],
        };
        // Quadratic convergence: six to eight sweeps are usual at N = 16; the bound is for bad luck.
        for _ in 0..30 {
            if !singular.sweep() {
                break;
            }
        }
        singular.squares = singular.w.map(|column| super::dot(&column, &column));
        singular
    }

    /// Rotates every pair of columns once. Whether any rotation was needed.
    fn sweep(&mut self) -> bool {
        let mut rotated = false;
        for p in 0..N {
            for q in p + 1..N {
                let (a, b) = (super::dot(&self.w[p], &self.w[p]), super::dot(&self.w[q], &self.w[q]));
                let c = super::dot(&self.w[p], &self.w[q]);
                if c.abs() <= T::EPSILON * a.sqrt() * b.sqrt() || c * c <= T::TINY_SQUARE {
                    continue;
                }
                let zeta = (b - a) / (c + c);
                // Beyond this the rotation is below rounding, and ζ² might overflow.
                if zeta.abs() * T::EPSILON * T::EPSILON > T::ONE {
                    continue;
                }
                rotated = true;
                let sign = if zeta < T::ZERO { -T::ONE } else { T::ONE };
                let tangent = sign / (zeta.abs() + (T::ONE + zeta * zeta).sqrt());
                let cosine = T::ONE / (T::ONE + tangent * tangent).sqrt();
                let sine = cosine * tangent;
                for columns in [&mut self.w, &mut self.v] {
                    for i in 0..N {
                        let (x, y) = (columns[p][i], columns[q][i]);
                        columns[p][i] = cosine * x - sine * y;
                        columns[q][i] = sine * x + cosine * y;
                    }
                }
            }
        }
        rotated
    }
}
