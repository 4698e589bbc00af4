//! The information of still poses on the sensors themselves.

use nalgebra::{SMatrix, SVector};
use rigident_shared::calibration::Reading;

/// Gain and bias of an accelerometer, `a_true = scale ∘ a − bias`, IMU axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AccelerometerCalibration {
    /// Factor on each axis.
    pub scale: [f64; 3],
    /// Bias of the scaled reading, m/s².
    pub bias_mps2: [f64; 3],
    /// Root mean square of `|a| − |g|` after calibration, m/s².
    pub residual_mps2: f64,
}

/// Why the poses do not calibrate the accelerometer.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// Fewer poses than unknowns allow.
    #[error(
        "{0} still poses; gain and bias of an accelerometer need at least nine, spread over all attitudes"
    )]
    TooFew(usize),
    /// The poses leave a combination of gain and bias open.
    #[error(
        "the still poses do not spread enough to tell gain from bias of the accelerometer: add poses with \
         each axis up and down, or give accel_scale and accel_bias_mps2 as numbers"
    )]
    NotSpread,
    /// The fit is not that of an accelerometer.
    #[error("the still poses do not fit |a| = {0} m/s²: check the unit of the accelerometer columns")]
    NotGravity(f64),
}

/// Determines gain and bias from poses of any attitude, against |g|: least squares of
/// `|scale ∘ a − bias|² − g²` by Gauss and Newton. Attitudes need not be known.
///
/// # Errors
/// [`PoseError`] if the poses do not determine the six numbers.
pub fn calibrate_accelerometer(
    poses: &[[f64; 3]],
    gravity_mps2: f64,
) -> Result<AccelerometerCalibration, PoseError> {
    if poses.len() < 9 {
        return Err(PoseError::TooFew(poses.len()));
    }
    let mut x = SVector::<f64, 6>::from([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    for _ in 0..50 {
        let mut normal = SMatrix::<f64, 6, 6>::zeros();
        let mut gradient = SVector::<f64, 6>::zeros();
        for a in poses {
            // In units of g, so that gain and bias columns are alike.
            let v: [f64; 3] = std::array::from_fn(|i| x[i] * a[i] / gravity_mps2 - x[i + 3]);
            let e = v.iter().map(|v| v * v).sum::<f64>() - 1.0;
            let row = SVector::<f64, 6>::from_fn(|i, _| {
                if i < 3 { 2.0 * v[i] * a[i] / gravity_mps2 } else { -2.0 * v[i - 3] }
            });
            normal += row * row.transpose();
            gradient += row * e;
        }
        let eigen = normal.symmetric_eigenvalues();
        if eigen.min() < 1e-4 * eigen.max() {
            return Err(PoseError::NotSpread);
        }
        let Some(cholesky) = normal.cholesky() else { return Err(PoseError::NotSpread) };
        let step = cholesky.solve(&gradient);
        x -= step;
        if !x.iter().all(|v| v.is_finite()) {
            return Err(PoseError::NotGravity(gravity_mps2));
        }
        if step.norm() < 1e-13 {
            break;
        }
    }
    let calibration = AccelerometerCalibration {
        scale: [x[0], x[1], x[2]],
        bias_mps2: [x[3], x[4], x[5]].map(|b| b * gravity_mps2),
        residual_mps2: (poses
            .iter()
            .map(|a| {
                let square: f64 = (0..3).map(|i| (x[i] * a[i] - x[i + 3] * gravity_mps2).powi(2)).sum();
                (square.sqrt() - gravity_mps2).powi(2)
            })
            .sum::<f64>()
            / poses.len() as f64)
            .sqrt(),
    };
    if calibration.scale.iter().any(|s| !(0.5..2.0).contains(s)) || calibration.residual_mps2 > 0.5 {
        return Err(PoseError::NotGravity(gravity_mps2));
    }
    Ok(calibration)
}

/// A stretch without motion: mean specific force and angular rate, IMU axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillPose {
    /// First and one-past-last reading.
    pub range: (usize, usize),
    /// Mean specific force, m/s².
    pub specific_force: [f64; 3],
    /// Mean angular rate, rad/s: the gyro's bias.
    pub angular_rate: [f64; 3],
}

/// Stretches of at least half a second in which the angular rate stays within `tolerance_radps` of its mean
/// and the specific force within `tolerance_mps2`, judged by means over a tenth of a second.
pub fn still_poses(
    readings: &[Reading<f64>],
    rate_hz: f64,
    tolerance_radps: f64,
    tolerance_mps2: f64,
) -> Vec<StillPose> {
    let step = (0.1 * rate_hz).round().max(1.0) as usize;
    let means: Vec<Mean> = readings
        .chunks_exact(step)
        .map(|chunk| {
            average(chunk.iter().map(|r| Mean {
                specific_force: r.specific_force.array(),
                angular_rate: r.angular_rate.array(),
            }))
        })
        .collect();
    let near = |a: &Mean, b: &Mean| {
        let within = |x: &[f64; 3], y: &[f64; 3], tolerance: f64| {
            x.iter().zip(y).all(|(x, y)| (x - y).abs() < tolerance)
        };
        within(&a.specific_force, &b.specific_force, tolerance_mps2)
            && within(&a.angular_rate, &b.angular_rate, tolerance_radps)
    };
    let mut poses = Vec::new();
    let mut first = 0;
    while let Some(start) = means.get(first) {
        let still = means.iter().skip(first).take_while(|m| near(start, m)).count();
        let end = first + still.max(1);
        if still >= 5 {
            let mean = average(means.iter().skip(first).take(still).copied());
            poses.push(StillPose {
                range: (first * step, end * step),
                specific_force: mean.specific_force,
                angular_rate: mean.angular_rate,
            });
        }
        first = end;
    }
    poses
}

#[derive(Clone, Copy, Default)]
struct Mean {
    specific_force: [f64; 3],
    angular_rate: [f64; 3],
}

fn average(values: impl Iterator<Item = Mean>) -> Mean {
    let mut sum = Mean::default();
    let mut count = 0.0;
    for value in values {
        count += 1.0;
        for i in 0..3 {
            sum.specific_force[i] += value.specific_force[i];
            sum.angular_rate[i] += value.angular_rate[i];
        }
    }
    Mean {
        specific_force: sum.specific_force.map(|v| v / count),
        angular_rate: sum.angular_rate.map(|v| v / count),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attitude(k: usize) -> [f64; 3] {
        let (azimuth, height) = (k as f64 * 2.399_963, 1.0 - 2.0 * (k as f64 + 0.5) / 24.0);
        let radius = (1.0 - height * height).sqrt();
        [radius * azimuth.cos(), radius * azimuth.sin(), height].map(|v| v * 9.80665)
    }

    #[test]
    fn gain_and_bias_are_recovered_from_their_effect() {
        let (scale, bias) = ([1.002, 0.998, 1.01], [-0.04, 0.09, 0.75]);
        let poses: Vec<_> =
            (0..24).map(attitude).map(|a| std::array::from_fn(|i| (a[i] + bias[i]) / scale[i])).collect();
        let found = calibrate_accelerometer(&poses, 9.80665).unwrap();
        for i in 0..3 {
            assert!((found.scale[i] - scale[i]).abs() < 1e-10);
            assert!((found.bias_mps2[i] - bias[i]).abs() < 1e-9);
        }
    }

    #[test]
    fn stretches_without_motion_are_found_with_their_means() {
        use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
        let readings: Vec<_> = (0..4000)
            .map(|n| {
                let still = n < 1000 || (2000..3200).contains(&n);
                let rate = if still { 0.02 } else { (f64::from(n) * 0.01).sin() };
                let tilt = if n < 1000 { 0.0 } else { 2.0 };
                Reading {
                    time_ns: n as u64 * 1_000_000,
                    wrench: Wrench::default(),
                    specific_force: SpecificForce::new(tilt, 0.0, 9.7),
                    angular_rate: AngularRate::new(rate, 0.0, 0.0),
                }
            })
            .collect();
        let poses = still_poses(&readings, 1000.0, 0.01, 0.1);
        assert_eq!(poses.iter().map(|p| p.range).collect::<Vec<_>>(), [(0, 1000), (2000, 3200)]);
        assert!((poses[1].angular_rate[0] - 0.02).abs() < 1e-12);
        assert!((poses[1].specific_force[0] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn poses_that_say_nothing_are_refused() {
        let upright = vec![[0.0, 0.0, 9.8]; 24];
        assert_eq!(calibrate_accelerometer(&upright, 9.80665), Err(PoseError::NotSpread));
        assert_eq!(calibrate_accelerometer(&upright[..5], 9.80665), Err(PoseError::TooFew(5)));
        let in_g: Vec<_> = (0..24).map(|k| attitude(k).map(|v| v / 9.80665)).collect();
        assert!(calibrate_accelerometer(&in_g, 9.80665).is_err());
    }
}
