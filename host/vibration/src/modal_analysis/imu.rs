//! Motion of a platform from an IMU on it.
//!
//! At rest, platform axes are those of the reference; x is the displacement of the reference point and θ the
//! small rotation, both in them. The accelerometer at the lever arm p reads the specific force `Rᵀ(r̈ − g)`
//! of `r = x + R p`, to first order `−g + ẍ + θ̈ × p + θ × g`: the last is gravity that the tilt brings in.
//! The gyro reads `θ̇`. At a pole s, so with complex amplitudes:
//!
//! ```text
//! Z_w = s Θ                          Θ = Z_w / s
//! Z_f = s² X + s² Θ × p + Θ × g      X = Z_f / s² + [p ×] Z_w / s + [g ×] Z_w / s³
//! ```

use nalgebra::{Complex, DMatrix, Matrix3, Matrix6, Vector3};

use super::amplitudes::Amplitudes;
use super::input::ModalError;

type Complex6 = Matrix6<Complex<f64>>;

/// The place of an IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imu {
    /// The vector from the reference point to the accelerometer, in platform axes, m.
    pub lever: Vector3<f64>,
    /// Columns are the IMU's axes in platform axes.
    pub axes: Matrix3<f64>,
    /// Gravity in platform axes at rest, m/s²: (0, 0, −9.80665) on a platform that is level.
    pub gravity: Vector3<f64>,
}

/// Converts amplitudes of an IMU's six channels, specific force (m/s²) and angular rate (rad/s), into those
/// of the platform's six coordinates: displacement of the reference point (m) and rotation (rad), in platform
/// axes, with their covariance.
///
/// # Errors
/// [`ModalError::Input`] if there are not six channels, or the IMU's axes are not at right angles.
pub fn platform_amplitudes(imu: &Imu, amplitudes: &Amplitudes) -> Result<Amplitudes, ModalError> {
    let (channels, count) = amplitudes.complex.shape();
    if channels != 6 {
        let text =
            format!("{channels} channels of an IMU: give three of specific force and three of angular rate");
        return Err(ModalError::Input(text));
    }
    let off = (imu.axes.transpose() * imu.axes - Matrix3::identity()).norm();
    if off.is_nan() || off > 1e-6 {
        return Err(ModalError::Input(format!(
            "the IMU's axes are off right angles and unit length by {off:.1e}"
        )));
    }
    let stride = amplitudes.stride();
    let mut complex = DMatrix::zeros(6, count);
    let mut to = DMatrix::<f64>::zeros(count * stride, count * stride);
    for r in 0..count {
        let (omega, zeta) = (amplitudes.angular[r], amplitudes.damping[r]);
        let root = (1.0 - zeta * zeta).max(0.0).sqrt();
        let s = Complex::new(-zeta * omega, omega * root);
        let by_omega = s / omega;
        let by_zeta = Complex::new(-omega, -omega * zeta / root.max(f64::MIN_POSITIVE));
        let z = amplitudes.complex.column(r);
        let (map, slope) = maps(imu, s);
        complex.set_column(r, &(map * z));
        let k = r * stride;
        to[(k, k)] = 1.0;
        to[(k + 1, k + 1)] = 1.0;
        let moved = slope * z;
        for i in 0..6 {
            for (column, by) in [(k, by_omega), (k + 1, by_zeta)] {
                let change = moved[i] * by;
                to[(k + 2 + i, column)] = change.re;
                to[(k + 8 + i, column)] = change.im;
            }
            for j in 0..6 {
                let entry = map[(i, j)];
                to[(k + 2 + i, k + 2 + j)] = entry.re;
                to[(k + 2 + i, k + 8 + j)] = -entry.im;
                to[(k + 8 + i, k + 2 + j)] = entry.im;
                to[(k + 8 + i, k + 8 + j)] = entry.re;
            }
        }
    }
    let covariance = &to * &amplitudes.covariance * to.transpose();
    Ok(Amplitudes {
        angular: amplitudes.angular.clone(),
        damping: amplitudes.damping.clone(),
        complex,
        covariance,
    })
}

/// Returns the map from `[Z_f; Z_w]` to `[X; Θ]` at a pole, and its derivative by the pole.
fn maps(imu: &Imu, s: Complex<f64>) -> (Complex6, Complex6) {
    let arm = imu.lever.cross_matrix() * imu.axes;
    let tilt = imu.gravity.cross_matrix() * imu.axes;
    let one = Complex::new(1.0, 0.0) / s;
    let (two, three, four) = (one * one, one * one * one, one * one * one * one);
    let (mut map, mut slope) = (Complex6::zeros(), Complex6::zeros());
    for i in 0..3 {
        for j in 0..3 {
            map[(i, j)] = two * imu.axes[(i, j)];
            map[(i, j + 3)] = one * arm[(i, j)] + three * tilt[(i, j)];
            map[(i + 3, j + 3)] = one * imu.axes[(i, j)];
            slope[(i, j)] = three * (-2.0 * imu.axes[(i, j)]);
            slope[(i, j + 3)] = -two * arm[(i, j)] - four * (3.0 * tilt[(i, j)]);
            slope[(i + 3, j + 3)] = -two * imu.axes[(i, j)];
        }
    }
    (map, slope)
}
