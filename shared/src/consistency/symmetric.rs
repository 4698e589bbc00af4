use crate::Scalar;

/// Symmetric 4×4 matrix, both triangles filled; also a general one where said.
pub(super) type Sym4<T> = [[T; 4]; 4];

/// Returns the lower triangle L of `A = L Lᵀ`. `None` if A is not positive definite or not finite.
pub(super) fn cholesky<T: Scalar>(a: &Sym4<T>) -> Option<Sym4<T>> {
    let mut l = [[T::ZERO; 4]; 4];
    for i in 0..4 {
        for j in 0..=i {
            let mut rest = a[i][j];
            for k in 0..j {
                rest -= l[i][k] * l[j][k];
            }
            l[i][j] = if i == j {
                if !rest.is_finite() || rest <= T::ZERO {
                    return None;
                }
                rest.sqrt()
            } else {
                rest / l[j][j]
            };
        }
    }
    Some(l)
}

/// Returns the inverse of a lower triangle with a positive diagonal.
pub(super) fn invert_lower<T: Scalar>(l: &Sym4<T>) -> Sym4<T> {
    let mut inverse = [[T::ZERO; 4]; 4];
    for j in 0..4 {
        inverse[j][j] = T::ONE / l[j][j];
        for i in j + 1..4 {
            let mut sum = T::ZERO;
            for k in j..i {
                sum += l[i][k] * inverse[k][j];
            }
            inverse[i][j] = -(sum / l[i][i]);
        }
    }
    inverse
}

/// Eigenvalues and unit eigenvectors (one per row) of a symmetric matrix, by Jacobi's rotations.
pub(super) fn eigen<T: Scalar, const M: usize>(a: &[[T; M]; M]) -> ([T; M], [[T; M]; M]) {
    let mut a = *a;
    let mut axes = [[T::ZERO; M]; M];
    for (i, axis) in axes.iter_mut().enumerate() {
        axis[i] = T::ONE;
    }
    // Quadratic convergence: four or five sweeps are usual; the bound is for bad luck.
    for _ in 0..12 {
        let mut rotated = false;
        for p in 0..M {
            for q in p + 1..M {
                let apq = a[p][q];
                let size = (a[p][p] * a[q][q]).abs().sqrt();
                if apq.abs() <= T::EPSILON * size || apq * apq <= T::TINY_SQUARE {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (apq + apq);
                // Beyond this the rotation is below rounding, and θ² might overflow.
                if theta.abs() * T::EPSILON > T::ONE {
                    continue;
                }
                rotated = true;
                let sign = if theta < T::ZERO { -T::ONE } else { T::ONE };
                let t = sign / (theta.abs() + (theta * theta + T::ONE).sqrt());
                let c = T::ONE / (t * t + T::ONE).sqrt();
                let s = t * c;
                for k in 0..M {
                    let (x, y) = (a[k][p], a[k][q]);
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for k in 0..M {
                    let (x, y) = (a[p][k], a[q][k]);
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                    let (x, y) = (axes[p][k], axes[q][k]);
                    axes[p][k] = c * x - s * y;
                    axes[q][k] = s * x + c * y;
                }
            }
        }
        if !rotated {
            break;
        }
    }
    (core::array::from_fn(|i| a[i][i]), axes)
}
