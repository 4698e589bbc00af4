//! How far damping that is not in proportion moves frequencies and shapes from those without damping.
//!
//! With the undamped modes x_r of ω_r and the damping c_rs between two of them, a vibration at the pole λ_r has
//! `η_s = −c_rs λ_r / (λ_r² + c_ss λ_r + ω_s²)` of x_s in it. To first order that is out of phase,
//! `i q`, `q = −c_rs ω_r / D`, `D = ω_s² − ω_r²`; so the amplitudes out of phase tell the damping. To second
//! order the frequency and the shape are off by
//! ```text
//! |λ_r|² − ω_r² = Σ_s q_rs² D        Re η_s = q_rs (2 (ζ_s ω_s − ζ_r ω_r) ω_r / D − ζ_r)
//! ```
//! Both count as standard deviations. What is out of phase along no other mode counts with `D = ω_r²`.

use nalgebra::{DMatrix, DVector};

use crate::modal_analysis::Mode;

/// Directions of shapes of unit columns with less than this share are not told apart.
const LEAST_DIRECTION: f64 = 1e-6;

/// Returns the covariance that damping adds to (ω, φ) of each of the modes of one body, in their order.
pub(super) fn covariance(modes: &[Mode]) -> DMatrix<f64> {
    let stride = modes.first().map_or(0, |mode| 1 + mode.shape.len());
    let mut all = DMatrix::zeros(modes.len() * stride, modes.len() * stride);
    let coordinates = stride.saturating_sub(1);
    let fit = |mode: &Mode| mode.amplitudes.len() == coordinates && mode.shape.len() == coordinates;
    if coordinates == 0 || !modes.iter().all(fit) {
        return all;
    }
    // Metres and radians side by side: each coordinate by its largest.
    let largest = |c: usize| modes.iter().map(|mode| mode.shape[c].abs()).fold(f64::MIN_POSITIVE, f64::max);
    let unit = DVector::from_fn(coordinates, |c, _| 1.0 / largest(c));
    let shapes: Vec<DVector<f64>> = modes.iter().map(|mode| mode.shape.component_mul(&unit)).collect();
    for (r, mode) in modes.iter().enumerate() {
        let Some(beside) = out_of_phase(mode, &shapes[r], &unit) else { continue };
        let others: Vec<usize> = (0..modes.len()).filter(|s| *s != r).collect();
        let columns: Vec<DVector<f64>> = others.iter().map(|s| shapes[*s].clone()).collect();
        let (shares, left) = shares(&columns, &beside);
        let from = r * stride;
        let mut square = left / shapes[r].norm_squared() * mode.angular.powi(2);
        for (s, q) in others.iter().zip(&shares) {
            let other = &modes[*s];
            let apart = other.angular.powi(2) - mode.angular.powi(2);
            square += q * q * apart.abs();
            let damped = 2.0 * (other.damping * other.angular - mode.damping * mode.angular);
            let real = q * (damped * mode.angular / apart - mode.damping);
            // Modes of one frequency are no expansion of each other.
            let real = if real.is_finite() && real.abs() < 1.0 { real } else { 1.0 };
            let moved = &other.shape * real;
            let mut own = all.view_mut((from + 1, from + 1), (coordinates, coordinates));
            own += &moved * moved.transpose();
        }
        all[(from, from)] = (0.5 * square / mode.angular).powi(2);
    }
    all
}

/// Returns the part of the amplitudes that is out of phase with the shape, as the shape is scaled, in units of
/// each coordinate; `None` where there are no amplitudes.
fn out_of_phase(mode: &Mode, shape: &DVector<f64>, unit: &DVector<f64>) -> Option<DVector<f64>> {
    let amplitudes = mode.amplitudes.zip_map(unit, |z, unit| z * unit);
    let along = amplitudes.iter().zip(shape.iter()).map(|(z, x)| z * *x).sum::<nalgebra::Complex<f64>>();
    let along = along / shape.norm_squared();
    (along.norm() > 0.0).then(|| amplitudes.map(|z| (z / along).im))
}

/// Returns how much of each column is in a vector, and the square of what is in none.
fn shares(columns: &[DVector<f64>], vector: &DVector<f64>) -> (Vec<f64>, f64) {
    if columns.is_empty() {
        return (Vec::new(), vector.norm_squared());
    }
    let columns = DMatrix::from_columns(columns);
    let svd = columns.clone().svd(true, true);
    let least = LEAST_DIRECTION * svd.singular_values.max();
    let found = svd.solve(vector, least).unwrap_or_else(|_| DVector::zeros(columns.ncols()));
    let left = (vector - &columns * &found).norm_squared();
    (found.iter().copied().collect(), left)
}

#[cfg(test)]
#[path = "damping_tests.rs"]
mod tests;
