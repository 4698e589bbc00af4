//! The platform, the body and the sensors that a motion is planned for.

use hexapod::{
    Bodies, BodyParameters, BodySet, Geometry, Load, Payload, THESIS_ACCEL_RANGE_MPS2,
    THESIS_GYRO_RANGE_RADPS, THESIS_WRENCH_NOISE_N_NM, THESIS_WRENCH_RANGE_N_NM,
};
use nalgebra::{Matrix3, Vector3};
use rigident_shared::calibration::ImuMounting;
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{Position, Rotation};

use super::machine::on_plate;

/// The knowledge of planning: geometry, payload, and the data sheets of the sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Equipment {
    /// The platform and its limits.
    pub geometry: Geometry,
    /// Body, mountings and gravity.
    pub payload: Payload,
    /// The bodies that are possible, in S, where it is not known: limits are met for all of them.
    pub bodies: Option<BodySet>,
    /// White noise of the load cell per reading, 1 σ, N and N m.
    pub noise_n_nm: [f64; 6],
    /// Range of the load cell, N and N m.
    pub wrench_range_n_nm: [f64; 6],
    /// Range of the accelerometer, m/s².
    pub accel_range_mps2: f64,
    /// Range of the gyro, rad/s.
    pub gyro_range_radps: f64,
}

impl Equipment {
    /// Returns the thesis' rig with its test body lying across the platform.
    pub fn thesis_horizontal() -> Self {
        Self {
            geometry: Geometry::thesis(),
            payload: Payload::thesis_horizontal(),
            bodies: None,
            noise_n_nm: THESIS_WRENCH_NOISE_N_NM,
            wrench_range_n_nm: THESIS_WRENCH_RANGE_N_NM,
            accel_range_mps2: THESIS_ACCEL_RANGE_MPS2,
            gyro_range_radps: THESIS_GYRO_RANGE_RADPS,
        }
    }

    /// Returns the thesis' rig with its test body standing upright.
    pub fn thesis_vertical() -> Self {
        Self::thesis_horizontal().with_body(BodyParameters::thesis_vertical())
    }

    /// Returns the same equipment with another body.
    pub fn with_body(self, body: BodyParameters) -> Self {
        Self { payload: Payload { body, ..self.payload }, ..self }
    }

    /// Returns the body that the legs carry, in P.
    pub fn carried(&self) -> BodyParameters {
        let cell = &self.payload.load_cell;
        let rotation = cell.rotation().unwrap_or_else(Matrix3::identity);
        on_plate(&self.payload.body, &Vector3::from(cell.position_m), &rotation)
    }

    /// Returns what the legs carry.
    pub fn load(&self) -> Load {
        let cell = &self.payload.load_cell;
        let rotation = cell.rotation().unwrap_or_else(Matrix3::identity);
        let bodies = match &self.bodies {
            None => Bodies::Known(vec![self.carried()]),
            Some(set) => {
                let body = set.in_frame(&Vector3::from(cell.position_m), &rotation);
                Bodies::Within { known: Vec::new(), body }
            }
        };
        Load { bodies, gravity_mps2: [0.0, 0.0, -self.payload.gravity_mps2] }
    }

    /// Returns what the body may be, in S.
    pub fn may_be(&self) -> BodySet {
        self.bodies.clone().unwrap_or_else(|| BodySet::known(&self.payload.body))
    }

    /// Returns where the IMU sits, as the estimator takes it.
    pub fn mounting(&self) -> ImuMounting<f64> {
        let imu = &self.payload.imu;
        ImuMounting {
            rotation: Rotation::from_quaternion(imu.rotation_wxyz).unwrap_or_else(Rotation::identity),
            position: Position::from_array(imu.position_m),
            ..ImuMounting::default()
        }
    }

    /// Returns the sensors' ranges. Nothing counts as frozen: a perfect sensor at rest repeats itself.
    pub fn limits(&self) -> Limits<f64> {
        Limits {
            wrench: self.wrench_range_n_nm,
            specific_force: self.accel_range_mps2,
            angular_rate: self.gyro_range_radps,
            frozen_after: 0,
        }
    }
}

#[cfg(feature = "simulator")]
impl From<&rigident_sim::rig::RigConfig> for Equipment {
    fn from(config: &rigident_sim::rig::RigConfig) -> Self {
        let sensors = &config.sensors;
        Self {
            geometry: config.geometry.clone(),
            payload: config.payload(),
            bodies: None,
            noise_n_nm: sensors.load_cell.noise_n_nm,
            wrench_range_n_nm: sensors.load_cell.range_n_nm,
            accel_range_mps2: sensors.imu.accel_range_mps2,
            gyro_range_radps: sensors.imu.gyro_range_radps,
        }
    }
}

#[cfg(all(test, feature = "simulator"))]
mod tests {
    use rigident_sim::rig::RigConfig;

    use super::*;

    #[test]
    fn the_simulated_rig_is_the_one_that_is_planned_for() {
        assert_eq!(Equipment::from(&RigConfig::thesis_horizontal()), Equipment::thesis_horizontal());
        assert_eq!(Equipment::from(&RigConfig::thesis_vertical()), Equipment::thesis_vertical());
    }
}
