//! Rest: what is at rest shows gravity to its accelerometer, whatever its attitude, and so the errors of the
//! sensor.
//!
//! With bias b, scales s and angles μ between its axes an accelerometer at rest reads, to first order,
//! ```text
//! |a| = g (1 + γ) + n·b + |a| (Σ_i s_i n_i² + Σ_ij μ_ij n_i n_j)        n = a/|a|
//! ```
//! γ being the error of the gravity that is stated. Each rest is one such row, whatever the body.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rigident_shared::calibration::{ImuMounting, Reading};

use super::errors::{AccelTerm, GRAVITY, accelerometer};
use super::poses::still_poses;
use rigident_fit::ErrorRow;

/// A rest is as long, s: shorter, and the turning point of a slow heave resembles one.
const LEAST_S: f64 = 2.0;
/// Means over a tenth of a second stay as near, m/s² and rad/s, beside six standard deviations of their
/// noise.
const STILL: (f64, f64) = (1e-3, 2e-3);
const MEAN_S: f64 = 0.1;
const NOISE_SD: f64 = 6.0;
/// A gyro that reads more turns, rad/s.
const TURNS_RADPS: f64 = 0.05;
/// Bias that wanders, and motion too slow to be seen, m/s²: half a thousandth of gravity.
const UNSEEN_MPS2: f64 = 5e-3;
/// Scatter of a still pose that nobody has stated, m/s².
const POSE_MPS2: f64 = 0.01;
/// Rests that are stored, the first ones.
const MOST: usize = 500;

/// Returns the rows of still poses, each reading one; `sigma` is that of the accelerometer per reading,
/// `gravity` as stated, m/s².
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

/// Returns the rows of the rests of a body that moves; `sigma` are those of accelerometer and gyro per
/// reading.
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

/// Stretches of which the mean specific force is taken, s.
const STRETCH_S: f64 = 5.0;
/// The speed of the IMU at their ends, 1 σ, m/s.
const SPEED_MPS: f64 = 1.0;

/// The part of gravity by which the mean may differ besides, m/s²: gyros that are off.
const TURNED_MPS2: f64 = 0.05;
/// The row says something where it differs by this many standard deviations: that is no chance.
const CONTRADICTION_SD: f64 = 4.42;

/// Returns the row of a body that turns and stays where it is, if that contradicts gravity: over a stretch of
/// [`STRETCH_S`] the mean specific force, turned back by the gyro, is gravity but for the change of speed,
/// however it moves between. Else it would tell little beside what is known of an accelerometer.
///
/// With R the attitude against that at the beginning, `|⟨R a⟩| = g (1 + γ) + û·⟨R b⟩ + …`, û along ⟨R a⟩; the
/// errors enter as at rest.
pub fn of_turning(
    readings: &[Reading<f64>],
    mounting: &ImuMounting<f64>,
    rate_hz: f64,
    gravity: f64,
) -> Option<ErrorRow> {
    let length = ((STRETCH_S * rate_hz) as usize).max(2);
    let longest_ns = (1.05 * STRETCH_S * 1e9) as u64;
    let whole = |stretch: &&[Reading<f64>]| matches!((stretch.first(), stretch.last()), (Some(a), Some(b)) if b.time_ns.saturating_sub(a.time_ns) < longest_ns);
    let stretches = readings.chunks_exact(length).filter(whole).take(MOST);
    let rows: Vec<ErrorRow> =
        stretches.filter_map(|stretch| turning(stretch, mounting, rate_hz, gravity)).collect();
    let count = rows.len() as f64;
    let (first, others) = rows.split_first()?;
    let mut mean = first.clone();
    for row in others {
        mean.value += row.value;
        mean.terms.iter_mut().zip(&row.terms).for_each(|(to, from)| to.1 += from.1);
    }
    mean.value /= count;
    mean.terms.iter_mut().for_each(|term| term.1 /= count);
    mean.sd = (mean.sd / count.sqrt()).hypot(TURNED_MPS2);
    (mean.value.abs() > CONTRADICTION_SD * mean.sd).then_some(mean)
}

fn turning(
    stretch: &[Reading<f64>],
    mounting: &ImuMounting<f64>,
    rate_hz: f64,
    gravity: f64,
) -> Option<ErrorRow> {
    let (accel_bias, gyro_bias) = (mounting.accel_bias.array(), Vector3::from(mounting.gyro_bias.array()));
    let mut attitude = UnitQuaternion::identity();
    // ⟨R⟩, and ⟨R a_j⟩ for each j.
    let (mut turned, mut products) = (Matrix3::zeros(), [Matrix3::zeros(); 3]);
    for reading in stretch {
        let force = reading.specific_force.array();
        let rotation = attitude.to_rotation_matrix().into_inner();
        turned += rotation;
        for (j, product) in products.iter_mut().enumerate() {
            *product += rotation * (mounting.accel_scale[j] * force[j] - accel_bias[j]);
        }
        let rate = Vector3::from(reading.angular_rate.array()) - gyro_bias;
        attitude *= UnitQuaternion::from_scaled_axis(rate / rate_hz);
    }
    let count = stretch.len() as f64;
    let mean = (0..3).map(|j| products[j].column(j) / count).sum::<Vector3<f64>>();
    let along = mean.try_normalize(f64::MIN_POSITIVE).filter(|n| n.norm().is_finite())?;
    let mut terms = vec![(GRAVITY.to_owned(), gravity)];
    terms.extend(accelerometer().map(|(name, term)| {
        let value = match term {
            AccelTerm::Bias(i) => along.dot(&turned.column(i)) / count,
            AccelTerm::Product(i, j) => along.dot(&products[j].column(i)) / count,
        };
        (name, value)
    }));
    let sd = std::f64::consts::SQRT_2 * SPEED_MPS / STRETCH_S;
    Some(ErrorRow { terms, value: mean.norm() - gravity, sd })
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
