//! The mass of the whole robot, as rows tell it by themselves.

use nalgebra::{DMatrix, DVector};

use rigident_fit::{Factor, Noise};
use rigident_model::base::{BaseParameters, ROUNDED};

/// Parameters of a link.
const TEN: usize = 10;
/// The masses are a combination of base parameters if that leaves no more of them.
const SAME: f64 = 1e-9;

/// A mass with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WholeMass {
    /// kg.
    pub kg: f64,
    /// U95, kg: by what rows leave, or by the scatter of the parts where that is more.
    pub u95_kg: f64,
}

impl WholeMass {
    /// Returns the sum of all masses that rows of these parts see; `None` where rows do not tell it, as of a
    /// base that is held still.
    pub fn of(parts: &[Factor], base: &BaseParameters) -> Option<Self> {
        let weights = weights(base)?;
        let count = weights.len();
        let all = Factor::merged(parts);
        let (kg, sd) = sum(&all, &weights)?;
        let free = (all.rows() as f64 - all.parameters() as f64).max(1.0);
        let by_rows = sd * (all.residual_sum_of_squares() / free).sqrt();
        let own: Vec<f64> = parts.iter().filter_map(|part| Some(sum(part, &weights)?.0)).collect();
        let n = own.len() as f64;
        let mean = own.iter().sum::<f64>() / n.max(1.0);
        let square = own.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / ((n - 1.0) * n).max(1.0);
        let by_rows = Noise::Estimated { degrees_of_freedom: free }.coverage_factor() * by_rows;
        let scatter = Noise::Estimated { degrees_of_freedom: n - 1.0 }.coverage_factor() * square.sqrt();
        let scatter = if own.len() > 2 { scatter } else { 0.0 };
        (count > 0).then_some(Self { kg, u95_kg: by_rows.max(scatter) })
    }
}

/// Returns the combination of base parameters that all masses together are.
fn weights(base: &BaseParameters) -> Option<DVector<f64>> {
    let map = base.map();
    let masses = DVector::from_fn(map.ncols(), |column, _| f64::from(u8::from(column % TEN == 0)));
    let normal: DMatrix<f64> = &map * map.transpose();
    let weights = normal.cholesky()?.solve(&(&map * &masses));
    ((map.tr_mul(&weights) - masses).amax() < SAME).then_some(weights)
}

/// Returns a combination of the first parameters and its standard deviation by rows of σ one.
fn sum(factor: &Factor, weights: &DVector<f64>) -> Option<(f64, f64)> {
    let count = weights.len();
    let solution = factor.leading(count).solve(ROUNDED);
    let largest = weights.amax();
    let is_determined = |j: usize| solution.determined.get(j) == Some(&true);
    if (0..count).any(|j| weights[j].abs() > SAME * largest && !is_determined(j)) {
        return None;
    }
    let estimate = DVector::from_column_slice(&solution.estimate);
    let variance = (weights.transpose() * &solution.covariance * weights)[(0, 0)];
    Some((weights.dot(&estimate), variance.max(0.0).sqrt()))
}
