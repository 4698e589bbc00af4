//! The rig file that an owner of the served rig would have written.

use std::fmt::{Debug, Write as _};

use super::ur;
use crate::rig::{Rig, RigConfig};
use hexapod::{BodyParameters, Geometry, Mounting};

/// Writes the TOML of a rig, as the host reads it: data sheets and mountings, and the true values as
/// `[truth]`.
#[must_use]
pub fn rig_file(rig: &Rig) -> String {
    let (config, truth) = (rig.config(), rig.truth());
    let (cell, unit) = (&config.sensors.load_cell, &config.sensors.imu);
    let largest = |noise: [f64; 3]| noise.into_iter().fold(0.0, f64::max);
    let mut file = Toml(String::from("# A simulated rig.\n"));
    file.table("[recording]");
    file.key("rate_hz", config.adc_hz);
    file.key("gravity_mps2", config.gravity_mps2);

    let second = config.second.as_ref();
    for (link, mounting) in [config.imu].into_iter().chain(second.map(|link| link.imu)).enumerate() {
        file.table("[[imu]]");
        file.key("link", link);
        // The simulation errs by noise and converters alone.
        file.key("class", "exact");
        file.key("position_m", mounting.position_m);
        file.key("rotation_wxyz", unit_quaternion(&mounting));
        file.key("rate_hz", config.imu_hz);
        file.key("group_delay_s", config.imu_group_delay_s());
        file.key("range_mps2", unit.accel_range_mps2);
        file.key("range_radps", unit.gyro_range_radps);
        // Without noise the converters' steps are still there: the host then takes it from the residuals.
        file.positive("accel_noise_mps2", largest(unit.accel_noise_mps2));
        file.positive("gyro_noise_radps", largest(unit.gyro_noise_radps));
    }
    if let Some(second) = second {
        let initial =
            if second.with_program { [1.0, 0.0, 0.0, 0.0] } else { second.swing.attitude_wxyz(0.0) };
        file.table("[[link]]");
        file.key("name", "body");
        file.table("[[link]]");
        file.key("name", "arm");
        file.key("parent", "body");
        file.key("joint", "spherical");
        file.key("position_m", second.joint_m);
        file.key("initial_wxyz", initial);
    }

    file.table("[load_cell]");
    if cell.noise_n_nm.iter().all(|sigma| *sigma > 0.0) {
        file.key("noise_n_nm", cell.noise_n_nm);
    }
    file.key("class", "exact");
    if cell.gain_error.spread.iter().any(|sigma| *sigma > 0.0) {
        file.key("gain_uncertainty", cell.gain_error.spread);
    }
    file.key("offset_n_nm", "estimate");
    file.key("calibration", config.gauge_calibration);
    file.key("group_delay_s", config.load_cell_group_delay_s());
    file.key("range_n_nm", cell.range_n_nm);

    file.table("[platform]");
    if config.geometry.has_joints() {
        hexapod(&mut file, &config.geometry);
    } else {
        arm(&mut file);
    }
    let [mass_kg, within_m] = bound(config);
    file.key("load_max_kg", mass_kg);
    file.key("load_within_m", within_m);
    if !config.geometry.has_joints() {
        arm_table(&mut file);
    }
    file.table("[platform.load_cell]");
    file.key("position_m", config.load_cell.position_m);
    file.key("rotation_wxyz", unit_quaternion(&config.load_cell));

    if second.is_none() {
        file.table("[truth]");
        file.key("mass_kg", truth.body.mass_kg);
        file.key("com_m", truth.body.com_m);
        file.key("inertia_com_kgm2", truth.body.inertia_com_kgm2);
        file.key("apparent_offset_n_nm", truth.apparent_offset_n_nm);
    }
    file.0
}

/// Writes joints, legs and limits.
fn hexapod(file: &mut Toml, geometry: &Geometry) {
    file.key("base_joints_m", geometry.base_joints_m);
    file.key("plate_joints_m", geometry.plate_joints_m);
    file.key("leg_length_m", geometry.leg_length_m);
    file.key("leg_rate_mps", geometry.leg_rate_mps);
    let limits = &geometry.limits;
    for (key, limit) in [
        ("leg_acceleration_mps2", limits.leg_acceleration_mps2),
        ("leg_jerk_mps3", limits.leg_jerk_mps3),
        ("leg_force_n", limits.leg_force_n),
        ("leg_push_n", limits.leg_push_n),
        ("leg_pull_n", limits.leg_pull_n),
        ("leg_buckling_nm2", limits.leg_buckling_nm2),
    ] {
        if let Some(limit) = limit {
            file.key(key, limit);
        }
    }
    for (joint, cones) in [("base", &limits.base_joints), ("plate", &limits.plate_joints)] {
        if let Some(cones) = cones {
            file.key(&format!("{joint}_joint_angle_rad"), cones.half_angle_rad);
            file.key(&format!("{joint}_joint_axes"), cones.axes);
        }
    }
    if let Some(bulk) = &limits.bulk {
        let keys = [
            ("leg_radius_m", Some(bulk.leg_radius_m)),
            ("joint_length_m", Some(bulk.joint_length_m)),
            ("plate_radius_m", bulk.plate_radius_m),
            ("base_radius_m", bulk.base_radius_m),
            ("clearance_m", Some(bulk.clearance_m).filter(|m| *m > 0.0)),
        ];
        for (key, value) in keys {
            if let Some(value) = value {
                file.key(key, value);
            }
        }
    }
    file.key("cond_max", limits.cond_max);
}

/// Writes the part of the arm's reach that may be used.
fn arm(file: &mut Toml) {
    let travel = ur::travel();
    file.key("travel_m", travel.shift_m);
    file.key("travel_rad", travel.turn_rad);
    if let Some(speed) = travel.speed_mps {
        file.key("plate_speed_mps", speed);
    }
}

/// Writes the arm's joints, and its model beside the file.
fn arm_table(file: &mut Toml) {
    file.table("[platform.arm]");
    file.key("model", ur::MODEL);
    file.key("flange", "tool0");
    file.key("home_rad", ur::HOME);
    file.key("rate_radps", ur::RATE_RADPS);
    file.key("acceleration_radps2", ur::ACCELERATION_RADPS2);
    file.key("payload_kg", ur::PAYLOAD_KG);
}

/// Returns what an owner would say of the heaviest body (kg) and its size (m): half as much again as it is.
fn bound(config: &RigConfig) -> [f64; 2] {
    // Of a block the corner is at √3 times the radius of gyration.
    let extent = |body: &BodyParameters| {
        let [xx, yy, zz, ..] = body.inertia_com_kgm2;
        let com = body.com_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        com + (1.5 * (xx + yy + zz) / body.mass_kg).sqrt()
    };
    let second = config.second.as_ref().map_or([0.0; 2], |link| {
        let joint = link.joint_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        [link.body.mass_kg, joint + extent(&link.body)]
    });
    let [mass, within] = [config.body.mass_kg + second[0], extent(&config.body).max(second[1])];
    [mass, within].map(|v| (150.0 * v).ceil() / 100.0)
}

fn unit_quaternion(mounting: &Mounting) -> [f64; 4] {
    let norm = mounting.rotation_wxyz.iter().map(|q| q * q).sum::<f64>().sqrt();
    mounting.rotation_wxyz.map(|q| q / norm)
}

/// Text in TOML. Numbers, strings and arrays of them look the same in Rust's debug format.
struct Toml(String);

impl Toml {
    fn table(&mut self, name: &str) {
        self.line(format_args!("\n{name}"));
    }

    fn key(&mut self, key: &str, value: impl Debug) {
        self.line(format_args!("{key} = {value:?}"));
    }

    fn positive(&mut self, key: &str, value: f64) {
        if value > 0.0 {
            self.key(key, value);
        }
    }

    fn line(&mut self, text: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = writeln!(self.0, "{text}");
    }
}
