//! Uncertain shifts of the estimate: errors of something that the rows were made with.

use super::{Estimate, Fit};

impl Fit {
    /// Counts errors that move the estimate by `column · η`, each η independent and of unit variance.
    ///
    /// Rows say `R (φ − S η) = z` then; η is appended, known to be 0 ± 1, and eliminated. The estimate stays, its covariance
    /// grows by `S Sᵀ`, and a factor that is merged with others takes it along. Each column has an entry for every
    /// parameter, in its unit.
    pub fn count_shifts(&mut self, columns: &[Vec<f64>]) {
        let before = self.estimate.covariance.clone();
        let mut rows = self.rows();
        for column in columns {
            let determined = |i: usize| f64::from(u8::from(self.estimate.is_determined(i)));
            let shift: Vec<f64> = column.iter().enumerate().map(|(i, v)| v * determined(i)).collect();
            rows = rows.shifted(&shift);
        }
        self.rig_rows = self.rig_rows.take().map(|_| rows.clone());
        let rows = rows.own();
        self.estimate = Estimate::new(&rows, self.rounding, 1.0, self.estimate.noise);
        self.added.push(("clocks".to_owned(), &self.estimate.covariance - before));
        self.factor = rows.discount(1.0 / self.noise.variance_scale);
        self.solved = self.solved.take().map(|_| rows);
    }
}
