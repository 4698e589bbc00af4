//! Singular values to relative precision, whatever the columns' scales.

use nalgebra::DMatrix;

/// Most sweeps: quadratic convergence needs six to eight at sixteen columns.
const SWEEPS: usize = 30;

/// One-sided Jacobi: `A V = W` with orthogonal columns W; their squared lengths are the squared singular
/// values (Hestenes 1958; accurate to relative precision on column-scaled matrices, Demmel and Veselić 1992).
pub(super) struct Jacobi {
    /// W.
    pub(super) w: DMatrix<f64>,
    /// V.
    pub(super) v: DMatrix<f64>,
    /// Squared singular values, in no order.
    pub(super) squares: Vec<f64>,
}

impl Jacobi {
    /// Decomposes A. A column of zeros stays one, with a unit vector of its own in V.
    pub(super) fn of(a: DMatrix<f64>) -> Self {
        let n = a.ncols();
        let mut jacobi = Self { w: a, v: DMatrix::identity(n, n), squares: Vec::new() };
        for _ in 0..SWEEPS {
            if !jacobi.sweep() {
                break;
            }
        }
        jacobi.squares = jacobi.w.column_iter().map(|c| c.norm_squared()).collect();
        jacobi
    }

    /// Rotates every pair of columns once; returns true if any rotation was needed.
    fn sweep(&mut self) -> bool {
        let mut rotated = false;
        for p in 0..self.w.ncols() {
            for q in p + 1..self.w.ncols() {
                let (left, right) = (self.w.column(p), self.w.column(q));
                let (a, b, c) = (left.norm_squared(), right.norm_squared(), left.dot(&right));
                // The product of the roots, as that of the squares might overflow.
                if c.abs() <= f64::EPSILON * (a.sqrt() * b.sqrt()) || c * c <= f64::MIN_POSITIVE {
                    continue;
                }
                rotated = true;
                let zeta = (b - a) / (2.0 * c);
                // Without squaring what may be large.
                let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                for columns in [&mut self.w, &mut self.v] {
                    rotate(columns, p, q, cosine, cosine * tangent);
                }
            }
        }
        rotated
    }
}

fn rotate(columns: &mut DMatrix<f64>, p: usize, q: usize, cosine: f64, sine: f64) {
    for i in 0..columns.nrows() {
        let (x, y) = (columns[(i, p)], columns[(i, q)]);
        columns[(i, p)] = cosine * x - sine * y;
        columns[(i, q)] = sine * x + cosine * y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns scaled over sixteen decades: the least singular value is that of the well-scaled block.
    #[test]
    fn small_singular_values_survive_large_columns() {
        let small = DMatrix::from_row_slice(2, 2, &[3.0, 1.0, 1.0, 2.0]);
        let mut a = DMatrix::zeros(3, 3);
        a.view_mut((0, 0), (2, 2)).copy_from(&small);
        a[(2, 2)] = 1e16;
        let mut found = Jacobi::of(a).squares;
        found.sort_by(f64::total_cmp);
        let mut wanted: Vec<f64> = small.singular_values().iter().map(|s| s * s).collect();
        wanted.sort_by(f64::total_cmp);
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((found / wanted - 1.0).abs() < 1e-14, "{found} {wanted}");
        }
    }
}
