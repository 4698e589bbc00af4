//! Uncertain shifts of the estimate: errors of something that the rows were made with.

use nalgebra::DMatrix;

use super::{Estimate, Fit};

impl Fit {
    /// Counts errors that move the estimate by `column · η`, each η independent and of unit variance.
    ///
    /// Rows say `R (φ − S η) = z` then; η is appended, known to be 0 ± 1, and eliminated. The estimate stays, its covariance
    /// grows by `S Sᵀ`, and a factor that is merged with others takes it along. Each column has an entry for every
    /// parameter, in its unit.
    pub fn count_shifts(&mut self, columns: &[Vec<f64>]) {
        let n = self.parameters.len();
        let before = self.estimate.covariance.clone();
        let mut rows = self.scaled_factor();
        let count = rows.rows();
        for column in columns {
            let shift = |i: usize| {
                let free = !self.estimate.is_determined(i);
                if free { 0.0 } else { column.get(i).copied().unwrap_or(0.0) }
            };
            let map = DMatrix::from_fn(n, n + 1, |i, j| match j {
                0 => -shift(i),
                _ => f64::from(u8::from(j == i + 1)),
            });
            let mut joint = rows.substitute(&map);
            let mut prior = vec![0.0; n + 1];
            prior[0] = 1.0;
            joint.absorb([(prior.as_slice(), 0.0)]);
            let marginal = joint.eliminate_others(&(1..=n).collect::<Vec<_>>());
            let residual = marginal.residual_sum_of_squares();
            // A row of what is known beforehand is none of the data's.
            rows = marginal.with_residual(residual, count);
        }
        self.estimate = Estimate::new(&rows, self.rounding, 1.0, self.estimate.noise);
        self.added.push(("clocks".to_owned(), &self.estimate.covariance - before));
        self.factor = rows.discount(1.0 / self.noise.variance_scale);
        self.solved = self.solved.take().map(|_| rows);
    }
}
