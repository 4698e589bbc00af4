//! The part that some runs see beyond others.
//!
//! Runs with something more are rows over `φ = M κ + N τ`, runs without it are rows over κ: a bare fixture,
//! an arm that carries nothing, a person with empty hands. What is left of both together where κ is
//! eliminated is what is known of τ when κ is known as well as its runs tell, and no better.

use nalgebra::DMatrix;

use super::RigRows;

/// The knowledge of τ, and how far the runs contradict each other.
#[derive(Clone, Debug)]
pub struct Beyond {
    /// The rows over τ and the errors of both, whitened as the runs are.
    pub rows: RigRows,
    /// The sum of squares by which κ of the two differs beyond what τ and the errors explain: χ² if both are
    /// whitened by their true σ.
    pub chi2: f64,
}

impl RigRows {
    /// Returns what is known of τ from these rows over `of_known κ + of_sought τ` and the rows `known` over
    /// κ, errors of the same instrument being the same in both.
    ///
    /// What neither tells of τ is zero in the answer, not the rounding of the elimination.
    pub fn beyond(&self, known: &Self, of_known: &DMatrix<f64>, of_sought: &DMatrix<f64>) -> Beyond {
        let (k, m) = (of_known.ncols(), of_sought.ncols());
        let both = DMatrix::from_fn(self.parameters(), k + m, |i, j| match j.checked_sub(k) {
            None => of_known[(i, j)],
            Some(j) => of_sought[(i, j)],
        });
        let mut joint = self.substitute(&both);
        let mut errors = self.of_errors();
        joint.merge(&known.substitute(&DMatrix::identity(k, k + m)));
        errors.merge(&known.of_errors());
        let apart = errors.known().residual_sum_of_squares();
        let chi2 = (joint.known().residual_sum_of_squares() - apart).max(0.0);
        let rounding = 4.0 * (k + m) as f64 * f64::EPSILON;
        let own = self.factor().r().columns(0, self.parameters()) * of_sought;
        let mut least: Vec<f64> = own.column_iter().map(|column| rounding * column.norm()).collect();
        least.resize(m + joint.errors().len(), 0.0);
        let sought = joint.select(&(k..k + m).collect::<Vec<_>>());
        Beyond { rows: sought.without_columns_below(&least), chi2 }
    }
}
