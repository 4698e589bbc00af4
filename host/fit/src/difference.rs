//! What some runs see beyond others.
//!
//! Runs with something more are rows over `φ = M κ + N τ`, runs without it are rows over κ: a bare fixture, an arm that
//! carries nothing, a person with empty hands. The trailing triangle of both together is what is known of τ when κ is known as
//! well as its runs tell, and no better.

use nalgebra::DMatrix;

use super::Factor;

/// What is known of τ, and how far the runs contradict each other.
#[derive(Clone, Debug)]
pub struct Beyond {
    /// The factor of τ, whitened as the runs are.
    pub factor: Factor,
    /// The sum of squares by which κ of the two differs beyond what τ explains: χ² if both are whitened by their true σ.
    pub chi2: f64,
}

/// Returns what is known of τ from the rows `total` over `of_known κ + of_sought τ` and the rows `known` over κ.
///
/// What neither tells of τ is zero in the answer, not the rounding of the elimination: rounding alone has a direction of its own,
/// and a column of it would look like one that depends on another.
pub fn beyond(total: &Factor, known: &Factor, of_known: &DMatrix<f64>, of_sought: &DMatrix<f64>) -> Beyond {
    let (k, m) = (of_known.ncols(), of_sought.ncols());
    let map = DMatrix::from_fn(total.parameters(), k + m, |i, j| match j.checked_sub(k) {
        None => of_known[(i, j)],
        Some(j) => of_sought[(i, j)],
    });
    let mut joint = total.substitute(&map);
    joint.merge(&known.append(m));
    let apart = total.residual_sum_of_squares() + known.residual_sum_of_squares();
    let chi2 = (joint.residual_sum_of_squares() - apart).max(0.0);
    let sought = joint.eliminate_others(&(k..k + m).collect::<Vec<_>>());
    let rounding = 4.0 * (k + m) as f64 * f64::EPSILON;
    let least: Vec<f64> =
        (total.r() * of_sought).column_iter().map(|column| rounding * column.norm()).collect();
    Beyond { factor: sought.without_columns_below(&least), chi2 }
}
