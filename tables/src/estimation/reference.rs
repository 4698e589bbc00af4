//! Least squares in f64 by another implementation: nalgebra's Householder QR, block of rows by block of rows,
//! the triangle so far on top of each.

use nalgebra::{DMatrix, DVector};

use super::problem::Block;

/// The solution of all rows.
pub struct Reference {
    pub estimate: DVector<f64>,
    /// 1 σ of each parameter for whitened rows.
    pub sd: DVector<f64>,
    /// Condition number of the column-scaled rows.
    pub condition: f64,
}

/// The triangle of all rows so far, the right-hand side as last column.
pub struct BlockQr<const N: usize> {
    triangle: DMatrix<f64>,
    waiting: Vec<f64>,
}

impl<const N: usize> BlockQr<N> {
    /// Rows gathered before they are reduced.
    const ROWS: usize = if N > 64 { 768 } else { 384 };

    pub fn new() -> Self {
        Self { triangle: DMatrix::zeros(N + 1, N + 1), waiting: Vec::new() }
    }

    pub fn absorb(&mut self, (columns, rhs): &Block<N>) {
        for i in 0..6 {
            self.waiting.extend(columns.iter().map(|c| f64::from(c[i])));
            self.waiting.push(f64::from(rhs[i]));
        }
        if self.waiting.len() >= Self::ROWS * (N + 1) {
            self.reduce();
        }
    }

    fn reduce(&mut self) {
        let rows = DMatrix::from_row_slice(self.waiting.len() / (N + 1), N + 1, &self.waiting);
        self.waiting.clear();
        let mut stacked = DMatrix::zeros(N + 1 + rows.nrows(), N + 1);
        stacked.rows_mut(0, N + 1).copy_from(&self.triangle);
        stacked.rows_mut(N + 1, rows.nrows()).copy_from(&rows);
        self.triangle = stacked.qr().r();
    }

    pub fn solve(&mut self) -> Reference {
        if !self.waiting.is_empty() {
            self.reduce();
        }
        let r = self.triangle.view((0, 0), (N, N)).into_owned();
        let z = self.triangle.view((0, N), (N, 1)).column(0).into_owned();
        let inverse =
            r.solve_upper_triangular(&DMatrix::identity(N, N)).expect("the rows determine everything");
        let scaled = DMatrix::from_fn(N, N, |i, j| r[(i, j)] / r.column(j).norm());
        let s = scaled.singular_values();
        Reference {
            estimate: &inverse * z,
            sd: DVector::from_fn(N, |j, _| inverse.row(j).norm()),
            condition: s.max() / s.min(),
        }
    }
}

impl Reference {
    /// Makes the reference of all rows of a problem.
    pub fn of<const N: usize>(blocks: &[Block<N>]) -> Self {
        let mut qr = BlockQr::new();
        blocks.iter().for_each(|block| qr.absorb(block));
        qr.solve()
    }

    /// Returns the largest deviation in units of the standard deviation.
    pub fn deviation_sd(&self, x: impl IntoIterator<Item = f64>) -> f64 {
        largest(x.into_iter().zip(&self.estimate).zip(&self.sd).map(|((x, e), sd)| (x - e).abs() / sd))
    }
}

/// Returns the largest, and not a number if one of them is none.
pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m: f64, v| if v > m || v.is_nan() { v } else { m })
}
