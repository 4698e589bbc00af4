use crate::Scalar;

/// One-sided Jacobi: `A V = W` with orthogonal columns W; their squared lengths are the squared singular values
/// (Hestenes 1958; accurate to relative precision on column-scaled matrices, Demmel and Veselić 1992).
pub(crate) struct Jacobi<T: Scalar, const N: usize> {
    /// Columns of W.
    pub(crate) w: [[T; N]; N],
    /// Columns of V.
    pub(crate) v: [[T; N]; N],
    /// Squared lengths of the columns of W.
    pub(crate) squares: [T; N],
}

pub(crate) fn dot<T: Scalar, const N: usize>(a: &[T; N], b: &[T; N]) -> T {
    let mut sum = T::ZERO;
    for (x, y) in a.iter().zip(b) {
        sum += *x * *y;
    }
    sum
}

impl<T: Scalar, const N: usize> Jacobi<T, N> {
    /// Of the matrix A with these columns. A column of zeros stays one, with a unit vector of its own in V.
    pub(crate) fn of(columns: [[T; N]; N]) -> Self {
        let mut jacobi = Self { w: columns, v: [[T::ZERO; N]; N], squares: [T::ZERO; N] };
        for j in 0..N {
            jacobi.v[j][j] = T::ONE;
        }
        // Quadratic convergence: six to eight sweeps are usual at N = 16; the bound is for bad luck.
        for _ in 0..30 {
            if !jacobi.sweep() {
                break;
            }
        }
        for j in 0..N {
            jacobi.squares[j] = dot(&jacobi.w[j], &jacobi.w[j]);
        }
        jacobi
    }

    /// Rotates every pair of columns once. Whether any rotation was needed.
    fn sweep(&mut self) -> bool {
        let two = T::from_u32(2);
        let mut rotated = false;
        for p in 0..N {
            for q in p + 1..N {
                let (a, b) = (dot(&self.w[p], &self.w[p]), dot(&self.w[q], &self.w[q]));
                let c = dot(&self.w[p], &self.w[q]);
                // The product of the roots, as that of the squares might overflow.
                if c.abs() <= T::EPSILON * (a.sqrt() * b.sqrt()) || c * c <= T::TINY_SQUARE {
                    continue;
                }
                rotated = true;
                let zeta = (b - a) / (two * c);
                let sign = if zeta < T::ZERO { -T::ONE } else { T::ONE };
                // Beyond this ζ² would overflow or drown the 1; the root is then |ζ|.
                let large = T::ONE / (T::EPSILON * T::EPSILON);
                let root = if zeta.abs() < large { (T::ONE + zeta * zeta).sqrt() } else { zeta.abs() };
                let tangent = sign / (zeta.abs() + root);
                let cosine = T::ONE / (T::ONE + tangent * tangent).sqrt();
                let sine = cosine * tangent;
                rotate(&mut self.w, p, q, cosine, sine);
                rotate(&mut self.v, p, q, cosine, sine);
            }
        }
        rotated
    }
}

fn rotate<T: Scalar, const N: usize>(columns: &mut [[T; N]; N], p: usize, q: usize, cosine: T, sine: T) {
    for i in 0..N {
        let (x, y) = (columns[p][i], columns[q][i]);
        columns[p][i] = cosine * x - sine * y;
        columns[q][i] = sine * x + cosine * y;
    }
}
