//! Conversion of sensor words to physical quantities in known frames.
//!
//! Lives here: gauge matrix, IMU scale, bias and mounting. May not live here: time. Before this: the drivers
//! of the firmware; after it: [`crate::alignment`].

use nalgebra::Matrix3;

use crate::Scalar;
use crate::regressor::{self, SIGNALS};
use crate::spatial::{AngularRate, Imu, Position, Rotation, Sensor, SpecificForce, Wrench};

/// Holds what the two sensors said at one instant of the load cell's clock: one row of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading<T: Scalar> {
    /// Time of the load cell's sample, its group delay already taken off, ns.
    pub time_ns: u64,
    /// Wrench on the body, in S. Its offset is still in it.
    pub wrench: Wrench<Sensor, T>,
    /// Specific force at the IMU's origin, in the IMU's axes, uncorrected.
    pub specific_force: SpecificForce<Imu, T>,
    /// Angular rate in the IMU's axes, uncorrected.
    pub angular_rate: AngularRate<Imu, T>,
}

/// Six gauge voltages × 6×6 matrix → wrench on the body in S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaugeCalibration<T: Scalar> {
    /// Row-major, N/V and N m/V, rows `[Fx, Fy, Fz, Mx, My, Mz]`.
    pub matrix: [[T; 6]; 6],
}

impl<T: Scalar> GaugeCalibration<T> {
    /// Returns the wrench `w = C g`, gauges in volts.
    #[inline]
    pub fn wrench(&self, gauges_v: &[T; 6]) -> Wrench<Sensor, T> {
        Wrench::from_array(self.matrix.map(|row| {
            let mut sum = T::ZERO;
            for (c, g) in row.iter().zip(gauges_v) {
                sum += *c * *g;
            }
            sum
        }))
    }
}

/// Holds how an IMU sits on its link and what its words mean: `v_true = scale ∘ v − bias`, then rotated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuMounting<T: Scalar> {
    /// `R_LU`: IMU axes to the link's axes (link 0: S).
    pub rotation: Rotation<Sensor, Imu, T>,
    /// Origin of U in the link's frame, m.
    pub position: Position<Sensor, T>,
    /// Factor on each accelerometer axis.
    pub accel_scale: [T; 3],
    /// Bias of the scaled accelerometer, IMU axes.
    pub accel_bias: SpecificForce<Imu, T>,
    /// Bias of the gyro, IMU axes.
    pub gyro_bias: AngularRate<Imu, T>,
}

impl<T: Scalar> Default for ImuMounting<T> {
    fn default() -> Self {
        Self::PERFECT
    }
}

impl<T: Scalar> ImuMounting<T> {
    /// A mounting at the link's origin and along its axes, without errors.
    pub const PERFECT: Self = Self {
        rotation: Rotation::identity(),
        position: Position::zero(),
        accel_scale: [T::ONE; 3],
        accel_bias: SpecificForce::zero(),
        gyro_bias: AngularRate::zero(),
    };

    /// The mounting before it is set up. All bits are zero.
    pub(crate) const UNUSED: Self = Self {
        rotation: Rotation::unset(),
        position: Position::zero(),
        accel_scale: [T::ZERO; 3],
        accel_bias: SpecificForce::zero(),
        gyro_bias: AngularRate::zero(),
    };

    /// Returns the signals of a reading, still in the IMU's axes and with the accelerometer as it reads:
    /// all that is linear can wait until they are conditioned ([`Self::mounted`]), the products of the rates
    /// cannot.
    #[inline]
    pub fn signals(&self, reading: &Reading<T>) -> [T; SIGNALS] {
        let rate = (reading.angular_rate - self.gyro_bias).array();
        regressor::signals(reading.specific_force.array(), rate, reading.wrench.array())
    }

    /// Returns the conditioned signals in the axes of S, the accelerometer's scale and bias taken out. The
    /// filter has unit gain at zero frequency, so a bias is itself behind it.
    #[inline]
    pub fn mounted(&self, signals: &[T; SIGNALS]) -> [T; SIGNALS] {
        let [ax, ay, az, xx, yy, zz, yz, zx, xy, fx, fy, fz, mx, my, mz, wx, wy, wz] = *signals;
        let [sx, sy, sz] = self.accel_scale;
        let scaled = SpecificForce::<Imu, T>::new(sx * ax, sy * ay, sz * az);
        let [ax, ay, az] = (self.rotation * (scaled - self.accel_bias)).array();
        let [wx, wy, wz] = (self.rotation * AngularRate::<Imu, T>::new(wx, wy, wz)).array();
        // R ωωᵀ Rᵀ
        let r = self.rotation.matrix();
        let rows = r * Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
        let product = |i: usize, j: usize| {
            rows[(i, 0)] * r[(j, 0)] + rows[(i, 1)] * r[(j, 1)] + rows[(i, 2)] * r[(j, 2)]
        };
        let [xx, yy, zz] = [product(0, 0), product(1, 1), product(2, 2)];
        let [yz, zx, xy] = [product(1, 2), product(2, 0), product(0, 1)];
        [ax, ay, az, xx, yy, zz, yz, zx, xy, fx, fy, fz, mx, my, mz, wx, wy, wz]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mounted_signals_are_the_signals_of_the_mounted_readings() {
        let mounting = ImuMounting::<f64> {
            rotation: Rotation::from_quaternion([0.8, -0.3, 0.4, 0.2]).unwrap(),
            accel_scale: [1.01, 0.98, 1.02],
            accel_bias: SpecificForce::new(0.1, -0.2, 0.3),
            gyro_bias: AngularRate::new(0.01, 0.02, -0.03),
            ..ImuMounting::default()
        };
        let reading = Reading {
            time_ns: 0,
            wrench: Wrench::from_array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
            specific_force: SpecificForce::new(1.0, -2.0, 9.0),
            angular_rate: AngularRate::new(0.7, -0.5, 1.1),
        };
        let [ax, ay, az] = reading.specific_force.array();
        let scaled = SpecificForce::<Imu, f64>::new(1.01 * ax, 0.98 * ay, 1.02 * az);
        let a = mounting.rotation * (scaled - mounting.accel_bias);
        let w = mounting.rotation * (reading.angular_rate - mounting.gyro_bias);
        let expected = regressor::signals(a.array(), w.array(), reading.wrench.array());
        for (got, expected) in mounting.mounted(&mounting.signals(&reading)).iter().zip(expected) {
            assert!((got - expected).abs() < 1e-14);
        }
    }
}
