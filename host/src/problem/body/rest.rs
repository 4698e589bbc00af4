//! Rest: what stands still shows gravity to its accelerometer, whatever its attitude, and so the errors of the sensor.
//!
//! With bias b, scales s and angles μ between its axes an accelerometer at rest reads, to first order,
//! ```text
//! |a| = g (1 + γ) + n·b + |a| (Σ_i s_i n_i² + Σ_ij μ_ij n_i n_j)        n = a/|a|
//! ```
//! γ being the error of the gravity that is stated. Each rest is one such row, whatever the body.

use nalgebra::Vector3;
use rigident_shared::calibration::{ImuMounting, Reading};

use super::errors::{AccelTerm, GRAVITY, accelerometer};
use super::poses::still_poses;
use crate::fit::ErrorRow;

/// A rest is as long, s: shorter, and the turning point of a slow heave looks like one.
const LEAST_S: f64 = 2.0;
/// Means over a tenth of a second stay as near, m/s² and rad/s, beside six standard deviations of their noise.
const STILL: (f64, f64) = (1e-3, 2e-3);
const MEAN_S: f64 = 0.1;
const NOISE_SD: f64 = 6.0;
/// A gyro that reads more turns, rad/s.
const TURNS_RADPS: f64 = 0.05;
/// Bias that wanders, and motion too slow to be seen, m/s²: half a thousandth of gravity.
const UNSEEN_MPS2: f64 = 5e-3;
/// Scatter of a still pose that nobody has stated, m/s².
const POSE_MPS2: f64 = 0.01;
/// Rests that are kept, the first ones.
const MOST: usize = 500;

/// Returns the rows of still poses, each reading one; `sigma` is that of the accelerometer per reading, `gravity` as stated, m/s².
pub fn of_poses(
    readings: &[Reading<f64>],
    mounting: &ImuMounting<f64>,
    sigma: Option<f64>,
    gravity: f64,
) -> Vec<ErrorRow> {
    let sd = sigma.unwrap_or(POSE_MPS2).hypot(UNSEEN_MPS2);
    let forces = readings.iter().map(|reading| reading.specific_force.array());
    forces.filter_map(|force| row(force, mounting, sd, gravity)).take(MOST).collect()
}

/// Returns the rows of the rests of a body that moves; `sigma` are those of accelerometer and gyro per reading.
pub fn of_motion(
    readings: &[Reading<f64>],
    mounting: &ImuMounting<f64>,
    rate_hz: f64,
    [accel, gyro]: [f64; 2],
    gravity: f64,
) -> Vec<ErrorRow> {
    let averaged = (MEAN_S * rate_hz).max(1.0).sqrt();
    let near = |still: f64, sigma: f64| still + NOISE_SD * sigma / averaged;
    let rests = still_poses(readings, rate_hz, near(STILL.1, gyro), near(STILL.0, accel));
    let bias = Vector3::from(mounting.gyro_bias.array());
    let rows = rests.iter().filter_map(|rest| {
        let count = (rest.range.1 - rest.range.0) as f64;
        let turns = (Vector3::from(rest.angular_rate) - bias).norm() > TURNS_RADPS;
        if turns || count < LEAST_S * rate_hz {
            return None;
        }
        // What hides below the noise of a mean is as large as that.
        row(rest.specific_force, mounting, (accel / averaged).hypot(UNSEEN_MPS2), gravity)
    });
    rows.take(MOST).collect()
}

fn row(force: [f64; 3], mounting: &ImuMounting<f64>, sd: f64, gravity: f64) -> Option<ErrorRow> {
    let bias = mounting.accel_bias.array();
    let force = Vector3::from_fn(|k, _| mounting.accel_scale[k] * force[k] - bias[k]);
    let size = force.norm();
    let n = force.try_normalize(f64::MIN_POSITIVE).filter(|n| n.norm().is_finite())?;
    let mut terms = vec![(GRAVITY.to_owned(), gravity)];
    terms.extend(accelerometer().map(|(name, term)| {
        let along = match term {
            AccelTerm::Bias(i) => n[i],
            AccelTerm::Product(i, j) => size * n[i] * n[j],
        };
        (name, along)
    }));
    Some(ErrorRow { terms, value: size - gravity, sd })
}

#[cfg(test)]
#[path = "rest_tests.rs"]
mod tests;
