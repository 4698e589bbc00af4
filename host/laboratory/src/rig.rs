//! The simulator's rig in the pipeline's types.

use rigident_shared::Scalar;
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Rotation, SpecificForce, Wrench};
use rigident_sim::rig::{ReadingRow, RigConfig};

use rigident_io::rig::FROZEN_AFTER;

/// Returns a row as the pipeline takes it.
pub fn reading<T: Scalar>(row: &ReadingRow) -> Reading<T> {
    let f = T::from_f64_const;
    Reading {
        time_ns: row.time_ns,
        wrench: Wrench::from_array(row.wrench.map(f)),
        specific_force: SpecificForce::from_array(row.specific_force.map(f)),
        angular_rate: AngularRate::from_array(row.angular_rate.map(f)),
    }
}

/// Returns how the simulated IMU is mounted.
pub fn mounting<T: Scalar>(config: &RigConfig) -> ImuMounting<T> {
    let f = T::from_f64_const;
    ImuMounting {
        // The simulator refuses a rig whose rotation is none.
        rotation: Rotation::from_quaternion(config.imu.rotation_wxyz.map(f))
            .unwrap_or_else(Rotation::identity),
        position: Position::from_array(config.imu.position_m.map(f)),
        ..ImuMounting::default()
    }
}

/// Returns the ranges of the simulated sensors.
pub fn limits<T: Scalar>(config: &RigConfig) -> Limits<T> {
    let f = T::from_f64_const;
    let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
    let noisy = imu.accel_noise_mps2.iter().chain(&imu.gyro_noise_radps).all(|sigma| *sigma > 0.0);
    Limits {
        wrench: cell.range_n_nm.map(f),
        specific_force: f(imu.accel_range_mps2),
        angular_rate: f(imu.gyro_range_radps),
        // A sensor without noise repeats itself at rest and is not broken.
        frozen_after: if noisy { FROZEN_AFTER } else { 0 },
    }
}
