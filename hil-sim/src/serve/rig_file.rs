//! The rig file that an owner of the served rig would have written.

use std::fmt::Write as _;

use crate::rig::RigConfig;
use crate::sensors::{ImuModel, LoadCellModel};

/// TOML of a rig, as the host reads it: data sheets and mountings, and the body's true parameters as `[truth]`.
#[must_use]
pub fn rig_file(config: &RigConfig) -> String {
    let RigConfig { body, load_cell, imu, sensors, geometry, .. } = config;
    let (cell, unit): (&LoadCellModel, &ImuModel) = (&sensors.load_cell, &sensors.imu);
    let mut text = String::from("# A simulated rig.\n");
    let mut line = |key: &str, value: String| {
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{}",
            if value.is_empty() { format!("\n{key}") } else { format!("{key} = {value}") }
        );
    };
    let table = String::new;
    line("[recording]", table());
    line("rate_hz", format!("{:?}", config.adc_hz));
    line("gravity_mps2", format!("{:?}", config.gravity_mps2));
    line("[[imu]]", table());
    line("link", "0".into());
    line("position_m", format!("{:?}", imu.position_m));
    line("rotation_wxyz", format!("{:?}", imu.rotation_wxyz));
    line("rate_hz", format!("{:?}", config.imu_hz));
    line("group_delay_s", format!("{:?}", config.imu_group_delay_s()));
    line("range_mps2", format!("{:?}", unit.accel_range_mps2));
    line("range_radps", format!("{:?}", unit.gyro_range_radps));
    line("accel_noise_mps2", format!("{:?}", unit.accel_noise_mps2.into_iter().fold(0.0, f64::max)));
    line("gyro_noise_radps", format!("{:?}", unit.gyro_noise_radps.into_iter().fold(0.0, f64::max)));
    line("[load_cell]", table());
    if cell.noise_n_nm.iter().all(|sigma| *sigma > 0.0) {
        line("noise_n_nm", format!("{:?}", cell.noise_n_nm));
    }
    line("offset_n_nm", "\"estimate\"".into());
    line("calibration", format!("{:?}", config.gauge_calibration));
    line("group_delay_s", format!("{:?}", config.load_cell_group_delay_s()));
    line("range_n_nm", format!("{:?}", cell.range_n_nm));
    line("[platform]", table());
    line("base_joints_m", format!("{:?}", geometry.base_joints_m));
    line("plate_joints_m", format!("{:?}", geometry.plate_joints_m));
    line("leg_length_m", format!("{:?}", geometry.leg_length_m));
    line("leg_rate_mps", format!("{:?}", geometry.leg_rate_mps));
    line(
        "load_cell",
        format!(
            "{{ position_m = {:?}, rotation_wxyz = {:?} }}",
            load_cell.position_m, load_cell.rotation_wxyz
        ),
    );
    line("[truth]", table());
    line("mass_kg", format!("{:?}", body.mass_kg));
    line("com_m", format!("{:?}", body.com_m));
    line("inertia_com_kgm2", format!("{:?}", body.inertia_com_kgm2));
    text
}
