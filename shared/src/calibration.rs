//! From sensor words to physical quantities in known frames.
//!
//! Lives here: gauge matrix, IMU scale, bias and mounting. May not live here: time. Before this: the drivers
//! of the firmware; after it: [`crate::alignment`].

use crate::Scalar;
use crate::spatial::{AngularRate, Imu, Position, Rotation, Sensor, SpecificForce, Wrench};

/// What the two sensors said at one instant of the load cell's clock: one row of a recording.
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

/// A reading in the axes of S: what the regressor is made of. The lever arm is not yet taken into account.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<T: Scalar> {
    /// Wrench on the body, in S.
    pub wrench: Wrench<Sensor, T>,
    /// Specific force **at the IMU's origin**, in S's axes.
    pub specific_force_at_imu: SpecificForce<Sensor, T>,
    /// Angular rate, in S's axes.
    pub angular_rate: AngularRate<Sensor, T>,
}

/// Six gauge voltages × 6×6 matrix → wrench on the body in S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaugeCalibration<T: Scalar> {
    /// Row-major, N/V and N m/V, rows `[Fx, Fy, Fz, Mx, My, Mz]`.
    pub matrix: [[T; 6]; 6],
}

impl<T: Scalar> GaugeCalibration<T> {
    /// `w = C g`, gauges in volts.
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

/// How an IMU sits on its link and what its words mean: `v_true = scale ∘ v − bias`, then rotated.
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
        Self {
            rotation: Rotation::identity(),
            position: Position::zero(),
            accel_scale: [T::ONE; 3],
            accel_bias: SpecificForce::zero(),
            gyro_bias: AngularRate::zero(),
        }
    }
}

impl<T: Scalar> ImuMounting<T> {
    /// A reading brought into the axes of S.
    #[inline]
    pub fn sample(&self, reading: &Reading<T>) -> Sample<T> {
        let [ax, ay, az] = reading.specific_force.array();
        let [sx, sy, sz] = self.accel_scale;
        let scaled = SpecificForce::<Imu, T>::new(sx * ax, sy * ay, sz * az);
        Sample {
            wrench: reading.wrench,
            specific_force_at_imu: self.rotation * (scaled - self.accel_bias),
            angular_rate: self.rotation * (reading.angular_rate - self.gyro_bias),
        }
    }
}
