//! Uncertain shifts of the estimate: errors of something that the rows were made with.

use nalgebra::{DMatrix, DVector};

use super::rig_rows::shifted;
use super::{Estimate, Factor, Fit};

/// Directions of which rows say less than this share of the most are none of theirs.
const LEAST_DIRECTION: f64 = 1e-9;

impl Fit {
    /// Counts errors that move the estimate by `column · η`, each η independent and of unit variance.
    ///
    /// Rows say `R (φ − S η) = z` then; η is appended, known to be 0 ± 1, and eliminated. The estimate stays,
    /// its covariance grows by `S Sᵀ`, and a factor that is merged with others takes it along. Each column
    /// has an entry for every parameter, in its unit.
    pub fn count_shifts(&mut self, columns: &[Vec<f64>]) {
        let before = self.estimate.covariance.clone();
        let mut rows = self.rows();
        for column in columns {
            let determined = |i: usize| f64::from(u8::from(self.estimate.is_determined(i)));
            let shift: Vec<f64> = column.iter().enumerate().map(|(i, v)| v * determined(i)).collect();
            rows = rows.shifted(&shift);
        }
        self.rig_rows = self.rig_rows.take().map(|_| rows.clone());
        let (own, noise) = (rows.own(), self.estimate.noise);
        self.estimate = Estimate::new(&own, self.rounding, 1.0, noise).beside(std::slice::from_ref(&rows));
        let rows = own;
        self.added.push(("clocks".to_owned(), &self.estimate.covariance - before));
        self.factor = rows.discount(1.0 / self.noise.variance_scale);
        self.solved = self.solved.take().map(|_| rows);
    }

    /// Counts errors of a source that move the estimate by `moved · η`, η as above, where `known` has as rows
    /// what was known of the parameters beforehand. All values stay.
    pub fn count_shifts_beside(&mut self, name: &str, moved: &DMatrix<f64>, known: &Factor) {
        if moved.ncols() == 0 {
            return;
        }
        let square = moved * moved.transpose();
        self.estimate.widen(&square);
        if let Some(prior) = &mut self.prior {
            prior.data_alone.widen(&square);
        }
        self.added.push((name.to_owned(), square));
        let rows = self.scaled_factor();
        let alone = alone(&rows.r(), moved, &known.r());
        let counted = alone.column_iter().fold(rows, |rows, column| shifted(&rows, column.as_slice()));
        self.solved = Some(counted);
    }
}

/// Returns C: what errors move the estimate of rows alone by, R, that move it by D beside rows K that are
/// right: `RᵀR C = (RᵀR + KᵀK) D`.
fn alone(r: &DMatrix<f64>, moved: &DMatrix<f64>, known: &DMatrix<f64>) -> DMatrix<f64> {
    let norms = r.column_iter().map(|column| column.norm());
    let scale: Vec<f64> = norms.map(|norm| if norm > 0.0 { 1.0 / norm } else { 0.0 }).collect();
    let scale = DMatrix::from_diagonal(&DVector::from_vec(scale));
    let svd = (r * &scale).svd(false, true);
    let Some(v) = svd.v_t else { return moved.clone() };
    let most = svd.singular_values.max();
    let mut beside = &v * &scale * known.transpose() * (known * moved);
    for (mut row, s) in beside.row_iter_mut().zip(&svd.singular_values) {
        row *= if *s > LEAST_DIRECTION * most { 1.0 / (s * s) } else { 0.0 };
    }
    moved + &scale * v.transpose() * beside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_rows_move_these_more_than_prior_knowledge_does() {
        // Rows of two parameters of which the second is next to unknown, and 1 ± 0.5 known of it beforehand.
        let r = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 0.0, 0.2]);
        let known = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 2.0]);
        let wrong = DMatrix::from_column_slice(2, 1, &[0.3, -0.7]);
        // The same error by the normal equations of both and of the rows alone.
        let right = r.transpose() * &wrong;
        let both = (r.transpose() * &r + known.transpose() * &known).lu().solve(&right).unwrap();
        let own = r.clone().lu().solve(&wrong).unwrap();
        let found = alone(&r, &both, &known);
        assert!((found - own).norm() < 1e-12);
    }
}
