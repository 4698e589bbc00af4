//! Positions and rates of records of positions: local polynomials.
//!
//! Over a short stretch around each sample a polynomial is fitted; its value and its slope at the sample are
//! position and rate. No difference of samples is taken, and accelerations are not formed at all: the rows
//! need none.

use nalgebra::DMatrix;

/// Degree of the polynomials.
const DEGREE: usize = 6;
/// Half of the stretch, s.
const HALF_S: f64 = 0.01;

/// Weights of the samples for value and slope at the middle one.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    value: Vec<f64>,
    slope: Vec<f64>,
}

impl Polynomial {
    /// Returns the polynomial for samples at `rate_hz`.
    pub fn new(rate_hz: f64) -> Self {
        let half = ((HALF_S * rate_hz).round() as usize).max(DEGREE.div_ceil(2));
        let n = 2 * half + 1;
        // In units of the half width: a Vandermonde matrix that is well conditioned.
        let x = |i: usize| (i as f64 - half as f64) / half as f64;
        let vandermonde = DMatrix::from_fn(n, DEGREE + 1, |i, k| x(i).powi(k as i32));
        let weights = vandermonde
            .svd(true, true)
            .pseudo_inverse(f64::EPSILON)
            .unwrap_or_else(|_| DMatrix::zeros(DEGREE + 1, n));
        Self {
            value: weights.row(0).iter().copied().collect(),
            slope: weights.row(1).iter().map(|w| w * rate_hz / half as f64).collect(),
        }
    }

    /// Returns the number of samples on either side.
    pub fn half(&self) -> usize {
        self.value.len() / 2
    }

    /// Returns the factor from the noise of a position to that of a rate, 1/s.
    pub fn slope_noise(&self) -> f64 {
        self.slope.iter().map(|w| w * w).sum::<f64>().sqrt()
    }

    /// Returns value and slope at the middle of as many samples as there are weights.
    pub fn at(&self, samples: &[f64]) -> (f64, f64) {
        // About the middle one, so that a large constant costs no digits.
        let middle = samples.get(self.half()).copied().unwrap_or(0.0);
        let sum = |weights: &[f64]| weights.iter().zip(samples).map(|(w, s)| w * (s - middle)).sum::<f64>();
        (middle + sum(&self.value), sum(&self.slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn swings_of_robots_keep_value_and_slope() {
        for rate_hz in [200.0, 1000.0, 5000.0] {
            let fit = Polynomial::new(rate_hz);
            let w = std::f64::consts::TAU * 2.0;
            let samples: Vec<f64> = (0..=2 * fit.half())
                .map(|i| 3.0 + (w * (i as f64 - fit.half() as f64) / rate_hz + 0.4).sin())
                .collect();
            let (value, slope) = fit.at(&samples);
            // The first term that degree 6 leaves out is of the order (w h)^6/7! of the slope, h the half
            // width.
            let h = fit.half() as f64 / rate_hz;
            let left = (w * h).powi(6) / 5040.0;
            assert!((value - 3.0 - 0.4_f64.sin()).abs() < left.max(1e-12), "{rate_hz}");
            assert!(
                (slope - w * 0.4_f64.cos()).abs() < w * left.max(1e-12),
                "{rate_hz}: {}",
                slope - w * 0.4_f64.cos()
            );
        }
    }

    #[test]
    fn noise_of_the_slope_is_that_of_least_squares() {
        // Straight lines only: var = σ²/Σt²; a higher degree costs more, never less.
        let fit = Polynomial::new(1000.0);
        let sum: f64 = (0..=2 * fit.half()).map(|i| ((i as f64 - fit.half() as f64) / 1000.0).powi(2)).sum();
        assert!(fit.slope_noise() > sum.sqrt().recip());
        assert!(fit.slope_noise() < 6.0 * sum.sqrt().recip());
    }
}
