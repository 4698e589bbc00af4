//! The guards of a motion, as the rig file has it.

use super::DrivingError;
use rigident_device::session::{Axes, LoadGuard, MotionGuard, Session};
use rigident_io::rig::{Calibrated, RigFile};
use rigident_plan::{machine, ranges};

/// Has load cell and IMU watched from now on, each where the rig file says enough of it.
///
/// # Errors
/// A mounting whose rotation is none.
pub fn guard(session: &mut Session, rig: &RigFile, axes: Axes) -> Result<(), DrivingError> {
    session.load_guard = rig.load_cell.range_n_nm.map(LoadGuard::new);
    let (at, rotation) = machine::load_cell(rig)?;
    let zero = match rig.imu.first().map(|imu| imu.gyro_bias_radps) {
        Some(Calibrated::Numbers(zero)) => zero,
        _ => [0.0; 3],
    };
    session.motion_guard = ranges::ideal(rig, &at).map(|sensors| {
        let to_plate = rotation * sensors.imu_rotation();
        MotionGuard::new(sensors, to_plate, zero, axes)
    });
    Ok(())
}
