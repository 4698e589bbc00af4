//! The weight of a channel's residuals over bins: the inverse of the covariance of its noise, a line and a
//! curve taken out.

use nalgebra::DMatrix;

use super::noise::PowerLaw;

/// Inverse of the covariance of a channel's noise: `inverse − U Uᵀ`.
pub(super) struct Metric {
    pub(super) inverse: Inverse,
    pub(super) u: DMatrix<f64>,
}

pub(super) enum Inverse {
    White(f64),
    Full(DMatrix<f64>),
}

impl Metric {
    /// Returns the metric of noise in `count` bins, a line and a curve taken out.
    pub(super) fn new(noise: &PowerLaw, count: usize) -> Self {
        let inverse = if noise.is_white() {
            Inverse::White(1.0 / noise.white)
        } else {
            Inverse::Full(noise.inverse(count))
        };
        let lines = drift(count);
        let weighted = inverse.apply(&lines);
        let gram = lines.tr_mul(&weighted);
        let back = nalgebra::Cholesky::new(gram)
            .and_then(|c| c.l().try_inverse())
            .map_or_else(|| DMatrix::zeros(lines.ncols(), lines.ncols()), |l| l.transpose());
        Self { u: weighted * back, inverse }
    }

    /// Returns the metric of white noise, nothing taken out.
    pub(super) fn without_drift(noise: &PowerLaw, count: usize) -> Self {
        Self { inverse: Inverse::White(1.0 / noise.white), u: DMatrix::zeros(count, 2) }
    }

    pub(super) fn apply(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        self.inverse.apply(columns) - &self.u * self.u.tr_mul(columns)
    }

    /// Returns the weight of a bin in its own score.
    pub(super) fn of_bin(&self, bin: usize) -> f64 {
        let own = match &self.inverse {
            Inverse::White(weight) => *weight,
            Inverse::Full(matrix) => matrix[(bin, bin)],
        };
        own - self.u.row(bin).norm_squared()
    }
}

impl Inverse {
    fn apply(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Self::White(weight) => columns * *weight,
            Self::Full(matrix) => {
                let own = own(columns);
                let made = matrix * columns.select_columns(&own);
                let mut all = DMatrix::zeros(columns.nrows(), columns.ncols());
                own.iter().zip(made.column_iter()).for_each(|(j, made)| all.set_column(*j, &made));
                all
            }
        }
    }
}

/// Returns the columns that have something: most are none of a channel's.
fn own(columns: &DMatrix<f64>) -> Vec<usize> {
    (0..columns.ncols()).filter(|j| columns.column(*j).iter().any(|v| *v != 0.0)).collect()
}

/// Returns `AᵀB` of columns over bins.
pub(super) fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let (of_a, of_b) = (own(a), own(b));
    // A product of rows by columns is made in tiles, one of columns by columns is not.
    let made = a.select_columns(&of_a).transpose() * b.select_columns(&of_b);
    let mut all = DMatrix::zeros(a.ncols(), b.ncols());
    for (to, made) in of_b.iter().zip(made.column_iter()) {
        of_a.iter().zip(made.iter()).for_each(|(i, v)| all[(*i, *to)] = *v);
    }
    all
}

/// Returns a line and a curve over `count` bins.
pub(super) fn drift(count: usize) -> DMatrix<f64> {
    let middle = 0.5 * (count as f64 - 1.0);
    DMatrix::from_fn(count, 2, |b, k| {
        let s = (b as f64 - middle) / middle.max(1.0);
        if k == 0 { s } else { s * s - 1.0 / 3.0 }
    })
}
