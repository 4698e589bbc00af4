//! The reduction of many rows of many columns into a triangle, by products of matrices.
//!
//! The reflections of [`rigident_shared::factor`], `u = k (y·c − ρ)`, `ρ ← ρ + u`, `c ← c − u y`, of a panel
//! of columns Y act on the later columns C with their entries P all at once: with `G = YᵀY`
//! ```text
//! k_i⁻¹ u_i + Σ_{j<i} G_ij u_j = (YᵀC − P)_i        P ← P + U        C ← C − Y U
//! ```
//! (C. Bischof, C. Van Loan, The WY representation for products of Householder matrices, 1987).

use nalgebra::{DMatrix, DMatrixViewMut};

/// Columns of a panel.
const PANEL: usize = 32;

/// Reduces rows, the last column being the right-hand side, into `[R z]`, n × (n + 1); returns the sum of
/// squares of what is left in the right-hand side. The rows are used up.
pub(super) fn reduce(triangle: &mut [f64], n: usize, rows: &mut DMatrix<f64>) -> f64 {
    let mut triangle = DMatrixViewMut::from_slice(triangle, n, n + 1);
    for first in (0..n).step_by(PANEL) {
        let width = PANEL.min(n - first);
        let mut k = vec![0.0; width];
        for j in 0..width {
            let c = first + j;
            for i in 0..j {
                let (y, mut column) = rows.columns_range_pair_mut(first + i, c);
                let entry = &mut triangle[(first + i, c)];
                let u = k[i] * (y.dot(&column) - *entry);
                *entry += u;
                column.axpy(-u, &y, 1.0);
            }
            let (mut column, r) = (rows.column_mut(c), &mut triangle[(c, c)]);
            let square = column.norm_squared();
            // Also keeps a square that underflows from becoming 0/0.
            if square <= f64::MIN_POSITIVE {
                column.fill(0.0);
                continue;
            }
            let norm = r.hypot(square.sqrt());
            let sum = *r + norm;
            *r = norm;
            k[j] = square / (norm * sum);
            column *= sum / square;
        }
        let later = n + 1 - first - width;
        let y = rows.columns(first, width).into_owned();
        let transposed = y.transpose();
        let square = &transposed * &y;
        let mut u = &transposed * rows.columns(first + width, later);
        u -= triangle.view((first, first + width), (width, later));
        for mut column in u.column_iter_mut() {
            for i in 0..width {
                let value = k[i] * column[i];
                column[i] = value;
                let later = width - i - 1;
                column.rows_mut(i + 1, later).axpy(-value, &square.column(i).rows(i + 1, later), 1.0);
            }
        }
        let mut entries = triangle.view_mut((first, first + width), (width, later));
        entries += &u;
        rows.columns_mut(first + width, later).gemm(-1.0, &y, &u, 1.0);
    }
    rows.column(n).norm_squared()
}
