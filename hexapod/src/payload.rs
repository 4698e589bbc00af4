//! The load of the plate, and what perfect sensors make of its motion.

use nalgebra::{Matrix3, Vector3};

use super::body::{BodyParameters, FrameMotion, STANDARD_GRAVITY_MPS2};
use super::kinematics::PlateState;
use super::mounting::Mounting;

/// White noise per reading of the thesis' load cell, 1 σ, N and N m (Table 1, 95 % figures).
pub const THESIS_WRENCH_NOISE_N_NM: [f64; 6] =
    [9.9 / 1.96, 9.9 / 1.96, 19.8 / 1.96, 0.75 / 1.96, 0.9 / 1.96, 0.9 / 1.96];
/// Range of the thesis' load cell, N and N m.
pub const THESIS_WRENCH_RANGE_N_NM: [f64; 6] = [660.0, 660.0, 1980.0, 60.0, 60.0, 60.0];
/// Range of the thesis' accelerometer, m/s². It is not printed there, 16 g are assumed.
pub const THESIS_ACCEL_RANGE_MPS2: f64 = 16.0 * STANDARD_GRAVITY_MPS2;
/// Range of the thesis' gyro, rad/s (Table 2).
pub const THESIS_GYRO_RANGE_RADPS: f64 = 1.309;

/// A rotation quaternion is zero or not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the rotation_wxyz of {0} is not a rotation")]
pub struct BadRotation(pub &'static str);

/// A body on a load cell on the plate, and an IMU fixed to the body. Frames: P plate, S load cell, U IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload {
    /// The body, in S.
    pub body: BodyParameters,
    /// S on the plate.
    pub load_cell: Mounting,
    /// U in S: the lever arm and `R_SU`.
    pub imu: Mounting,
    /// Gravity, downward positive, m/s².
    pub gravity_mps2: f64,
}

impl Payload {
    /// Returns the thesis' test body lying across the platform.
    pub fn thesis_horizontal() -> Self {
        Self {
            body: BodyParameters::thesis_horizontal(),
            load_cell: Mounting::IDENTITY,
            imu: Mounting { position_m: [0.06, -0.04, 0.02], rotation_wxyz: [0.92, 0.20, -0.10, 0.32] },
            gravity_mps2: STANDARD_GRAVITY_MPS2,
        }
    }

    /// Returns perfect sensors on this payload.
    ///
    /// # Errors
    /// A rotation quaternion that is zero or not finite.
    pub fn sensors(&self) -> Result<IdealSensors, BadRotation> {
        Ok(IdealSensors {
            body: self.body,
            gravity: Vector3::new(0.0, 0.0, -self.gravity_mps2),
            sensor_position: Vector3::from(self.load_cell.position_m),
            sensor_rotation: self.load_cell.rotation().ok_or(BadRotation("the load cell"))?,
            imu_position: Vector3::from(self.imu.position_m),
            imu_rotation: self.imu.rotation().ok_or(BadRotation("the IMU"))?,
        })
    }
}

/// A load cell and an IMU without noise, bias, delay and range.
#[derive(Clone, Debug)]
pub struct IdealSensors {
    body: BodyParameters,
    gravity: Vector3<f64>,
    sensor_position: Vector3<f64>,
    sensor_rotation: Matrix3<f64>,
    imu_position: Vector3<f64>,
    imu_rotation: Matrix3<f64>,
}

impl IdealSensors {
    /// Returns the body, in S.
    pub fn body(&self) -> &BodyParameters {
        &self.body
    }

    /// Returns gravity in A, m/s².
    pub fn gravity(&self) -> &Vector3<f64> {
        &self.gravity
    }

    /// Returns `R_SU`, which takes the IMU's axes to the load cell's.
    pub fn imu_rotation(&self) -> &Matrix3<f64> {
        &self.imu_rotation
    }

    /// Returns the motion of S as the plate moves.
    pub fn sensor_motion(&self, plate: &PlateState) -> FrameMotion {
        FrameMotion::of_plate(plate).fixed_frame(&self.sensor_position, &self.sensor_rotation)
    }

    /// Returns the wrench on the body at S's origin, in S, N and N m.
    pub fn wrench(&self, plate: &PlateState) -> [f64; 6] {
        self.body.wrench(&self.sensor_motion(plate), &self.gravity)
    }

    /// Returns specific force, m/s², and angular rate, rad/s, at U's origin, in U.
    pub fn imu(&self, plate: &PlateState) -> ([f64; 3], [f64; 3]) {
        let motion = self.sensor_motion(plate).fixed_frame(&self.imu_position, &self.imu_rotation);
        (motion.specific_force(&self.gravity).into(), motion.body_rate().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pose, Trajectory};

    #[test]
    fn perfect_sensors_at_rest_read_the_weight_and_gravity() {
        let payload = Payload { imu: Mounting::IDENTITY, ..Payload::thesis_horizontal() };
        let plate = Trajectory::resting(&Pose::default()).state(0.0);
        let sensors = payload.sensors().unwrap();
        assert_eq!(sensors.imu(&plate), ([0.0, 0.0, STANDARD_GRAVITY_MPS2], [0.0; 3]));
        assert_eq!(sensors.wrench(&plate), [0.0, 0.0, 20.0 * STANDARD_GRAVITY_MPS2, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn a_rotation_that_is_none_is_named() {
        let mut payload = Payload::thesis_horizontal();
        payload.imu.rotation_wxyz = [0.0; 4];
        assert_eq!(payload.sensors().unwrap_err(), BadRotation("the IMU"));
    }
}
