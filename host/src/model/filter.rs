//! Rows without accelerations, filtered: both parts and the measurements by one kernel.
//!
//! `k ∗ w = k ∗ smoothed + k̇ ∗ differentiated` holds exactly; nothing is differentiated from samples. The kernel is the
//! pipeline's own (`rigident_shared::conditioning`).

use std::collections::VecDeque;

use rigident_shared::conditioning::{Kernel, KernelError};

use super::rows::MomentumRows;

/// Room for the longest kernel: a second at 1 kHz.
const TAPS: usize = 1024;

/// The filter with what it remembers.
#[derive(Clone, Debug)]
pub struct MomentumFilter {
    /// Weights of the smoothed and of the differentiated part, oldest sample first.
    weights: Vec<(f64, f64)>,
    samples: VecDeque<(MomentumRows, Vec<f64>)>,
    every: usize,
    until: usize,
}

/// A filtered instant: rows and what was measured for each.
#[derive(Clone, Debug, PartialEq)]
pub struct FilteredRows {
    /// Six base rows and the joints', as [`MomentumRows`].
    pub rows: Vec<f64>,
    /// The measurements, by the same kernel.
    pub measured: Vec<f64>,
}

impl MomentumFilter {
    /// A filter of `width_s` seconds on samples at `rate_hz`, an output every `every` samples.
    ///
    /// # Errors
    /// [`KernelError`] if it cannot be, does not fit, or is too short to differentiate: less than three samples.
    pub fn new(rate_hz: f64, width_s: f64, every: usize) -> Result<Self, KernelError> {
        let kernel = Kernel::<f64, TAPS>::new(rate_hz, width_s, 1)?;
        let weights: Vec<_> =
            kernel.smooth().iter().copied().zip(kernel.derivative().iter().copied()).collect();
        if weights.len() < 3 || every == 0 {
            return Err(KernelError::Invalid);
        }
        let until = weights.len();
        Ok(Self { samples: VecDeque::with_capacity(until), weights, every, until })
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        self.samples.clear();
        self.until = self.weights.len();
    }

    /// Weights of the smoothed part, oldest sample first.
    pub fn response(&self) -> Vec<f64> {
        self.weights.iter().map(|(h, _)| *h).collect()
    }

    /// `Σ h²`: the variance of white noise after the filter, relative to before.
    pub fn noise_gain(&self) -> f64 {
        self.weights.iter().map(|(h, _)| h * h).sum()
    }

    /// `Σ ḣ²`, 1/s².
    pub fn derivative_noise_gain(&self) -> f64 {
        self.weights.iter().map(|(_, d)| d * d).sum()
    }

    /// Samples under the filter.
    pub fn span(&self) -> usize {
        self.weights.len()
    }

    /// Takes the rows of an instant and what was measured there; gives what is due.
    pub fn push(&mut self, rows: MomentumRows, measured: Vec<f64>) -> Option<FilteredRows> {
        if self.samples.len() == self.weights.len() {
            self.samples.pop_front();
        }
        self.samples.push_back((rows, measured));
        self.until -= 1;
        if self.until > 0 {
            return None;
        }
        self.until = self.every;
        let (first, first_measured) = self.samples.front()?;
        let mut out =
            FilteredRows { rows: vec![0.0; first.smoothed.len()], measured: vec![0.0; first_measured.len()] };
        for ((h, d), (rows, measured)) in self.weights.iter().zip(&self.samples) {
            let parts = rows.smoothed.iter().zip(&rows.differentiated);
            for (sum, (smoothed, differentiated)) in out.rows.iter_mut().zip(parts) {
                *sum += h * smoothed + d * differentiated;
            }
            for (sum, value) in out.measured.iter_mut().zip(measured) {
                *sum += h * value;
            }
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::rows::Moving;
    use nalgebra::{Matrix3, UnitQuaternion, Vector3};
    use rigident_shared::tree::{BaseMotion, Joint, Link};

    /// Angle, rate and acceleration of a swing about a mean.
    fn swing(t: f64, hz: f64, phase: f64) -> [f64; 3] {
        let w = std::f64::consts::TAU * hz;
        let a = w * t + phase;
        [0.8 * a.sin() + phase, 0.8 * w * a.cos(), -0.8 * w * w * a.sin()]
    }

    #[test]
    fn filtered_rows_without_accelerations_are_the_filtered_rows_with_them() {
        let link = |parent, joint, p: [f64; 3]| Link {
            parent,
            joint,
            rotation: Matrix3::identity(),
            position: Vector3::from(p),
        };
        let skew = Vector3::new(1.0, -2.0, 0.5).normalize();
        let links = vec![
            link(0, Joint::Free, [0.0; 3]),
            link(0, Joint::Revolute(skew), [0.1, 0.2, 0.3]),
            link(1, Joint::Spherical, [0.0, 0.1, 0.4]),
            link(1, Joint::Prismatic(skew), [-0.2, 0.0, 0.1]),
            link(0, Joint::Universal(Vector3::x(), Vector3::y()), [0.2, -0.3, 0.0]),
        ];
        let rate_hz = 1000.0;
        let mut moving = Moving::new(links).unwrap();
        let mut filter = MomentumFilter::new(rate_hz, 0.1, 25).unwrap();
        let kernel: Vec<f64> = filter.weights.iter().map(|w| w.0).collect();
        let mut with: Vec<Vec<f64>> = Vec::new();
        let mut compared = 0;
        for n in 0..400 {
            let t = f64::from(n) / rate_hz;
            let s: Vec<[f64; 3]> =
                (0..6).map(|k| swing(t, 0.6 + 0.08 * f64::from(k), f64::from(k))).collect();
            let ball = UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_normalize(skew), s[1][0]);
            let b = ball.quaternion();
            let q = [s[0][0], b.w, b.i, b.j, b.k, s[2][0], s[3][0], s[4][0]];
            let rates = |k: usize| {
                let w = skew * s[1][k];
                [s[0][k], w.x, w.y, w.z, s[2][k], s[3][k], s[4][k]]
            };
            let base = BaseMotion {
                specific_force: Vector3::new(s[2][0], 3.0 * s[3][0], 9.8),
                rate: Vector3::x() * s[5][1] + Vector3::y() * s[4][1],
                angular_acceleration: Vector3::x() * s[5][2] + Vector3::y() * s[4][2],
            };
            moving.set(&q, &rates(1), &rates(2), &base).unwrap();
            with.push(moving.all_rows().unwrap().to_vec());
            // Accelerations left out: not a number.
            let blind = BaseMotion { angular_acceleration: Vector3::repeat(f64::NAN), ..base };
            moving.set(&q, &rates(1), &[f64::NAN; 7], &blind).unwrap();
            let rows = moving.momentum_rows().unwrap();
            let Some(out) = filter.push(rows, vec![swing(t, 1.0, 0.0)[0]]) else { continue };
            let first = with.len() - filter.span();
            let scale = with[first].iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            for (k, got) in out.rows.iter().enumerate() {
                let wanted: f64 = kernel.iter().enumerate().map(|(i, h)| h * with[first + i][k]).sum();
                // The kernel's aliasing: 2e-9 at 200 Hz and less at 1 kHz, of momenta with harmonics below 5 Hz.
                assert!((got - wanted).abs() < 2e-9 * scale, "{got} {wanted} {scale}");
            }
            compared += 1;
        }
        assert!(compared > 10);
    }

    #[test]
    fn filters_that_cannot_differentiate_are_refused() {
        assert!(MomentumFilter::new(1000.0, 0.001, 1).is_err());
        assert!(MomentumFilter::new(1000.0, 0.1, 0).is_err());
        assert!(MomentumFilter::new(1000.0, 10.0, 1).is_err());
    }
}
