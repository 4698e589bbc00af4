//! Simulated runs of a body, of a fixture, and of both bolted together; as readings and as files.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use hexapod::BodyParameters;
use hexapod::experiment::thesis_program;
use nalgebra::{Matrix3, Vector3};
use rigident::laboratory::{mounting, reading};
use rigident::rig::FROZEN_AFTER;
use rigident::rows::body::Input;
use rigident_shared::screening::Limits;
use rigident_sim::rig::{Readings, RigConfig};
use serde_json::Value;

pub use crate::program::{rigident, said, status};

/// Thesis, Table 1: 95 % figures over 1.96.
pub const SIGMA: [f64; 6] = [9.9 / 1.96, 9.9 / 1.96, 19.8 / 1.96, 0.75 / 1.96, 0.9 / 1.96, 0.9 / 1.96];
/// Rate of the simulated recordings, 1/s.
pub const RATE_HZ: f64 = 200.0;

/// The thesis' body alone.
pub fn body() -> BodyParameters {
    BodyParameters::thesis_horizontal()
}

/// A lopsided plate with a bracket.
pub fn fixture() -> BodyParameters {
    BodyParameters {
        mass_kg: 6.0,
        com_m: [0.03, -0.02, 0.015],
        inertia_com_kgm2: [0.05, 0.04, 0.08, 0.004, -0.006, 0.009],
    }
}

/// Two bodies bolted together: masses, first moments and tensors about S's origin add.
pub fn together(a: &BodyParameters, b: &BodyParameters) -> BodyParameters {
    let mass_kg = a.mass_kg + b.mass_kg;
    let com = (Vector3::from(a.com_m) * a.mass_kg + Vector3::from(b.com_m) * b.mass_kg) / mass_kg;
    let origin = |p: &BodyParameters| {
        let c = Vector3::from(p.com_m);
        p.inertia_com() + p.mass_kg * (Matrix3::identity() * c.norm_squared() - c * c.transpose())
    };
    let i =
        origin(a) + origin(b) - mass_kg * (Matrix3::identity() * com.norm_squared() - com * com.transpose());
    BodyParameters {
        mass_kg,
        com_m: com.into(),
        inertia_com_kgm2: [i.m11, i.m22, i.m33, i.m23, i.m31, i.m12],
    }
}

/// Returns what `body` makes the sensors read in the thesis' experiment.
pub fn experiment(body: BodyParameters, seconds: f64) -> (RigConfig, Readings) {
    let config = RigConfig::thesis_horizontal().with_body(body);
    let program = thesis_program(&config.geometry, seconds);
    let readings = Readings::new(&config, &program, RATE_HZ).unwrap();
    (config, readings)
}

/// The readings of one seed, ready to be identified.
pub fn input(config: &RigConfig, readings: &Readings, seed: u64) -> Input {
    Input {
        readings: readings.measured(seed).map(|row| reading(&row)).collect(),
        is_static: false,
        rate_hz: RATE_HZ,
        mounting: mounting(config),
        channel_sigma: Some(SIGMA),
        gyro_sigma: Some(4.3e-4),
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits { frozen_after: FROZEN_AFTER, ..Limits::none() },
    }
}

/// Writes `NAME.csv`, and `NAME.rig.toml` with what is in `load_cell`.
pub fn write(folder: &Path, name: &str, body: BodyParameters, seed: u64, load_cell: &str) {
    let (config, readings) = experiment(body, 20.0);
    let mut text = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,\
                    imu_gy_radps,imu_gz_radps\n"
        .to_owned();
    for row in readings.measured(seed) {
        let _ = write!(text, "{}", row.time_ns as f64 * 1e-9);
        for v in row.wrench.iter().chain(&row.specific_force).chain(&row.angular_rate) {
            let _ = write!(text, ",{v}");
        }
        text.push('\n');
    }
    fs::write(folder.join(format!("{name}.csv")), text).unwrap();
    let imu = &config.imu;
    let norm = imu.rotation_wxyz.iter().map(|v| v * v).sum::<f64>().sqrt();
    let rig = format!(
        "[[imu]]\nposition_m = {:?}\nrotation_wxyz = {:?}\ngyro_noise_radps = 4.3e-4\nclass \
         = \"exact\"\n\n[load_cell]\nclass = \"exact\"\n\
         {load_cell}\n",
        imu.position_m,
        imu.rotation_wxyz.map(|v| v / norm),
    );
    fs::write(folder.join(format!("{name}.rig.toml")), rig).unwrap();
}

/// `noise_n_nm` of a rig file.
pub fn noise() -> String {
    format!("noise_n_nm = {SIGMA:?}")
}

/// The command must succeed; its object.
pub fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = rigident(folder, arguments);
    let answer = String::from_utf8_lossy(&output.stdout);
    assert_eq!(status(&output), 0, "{arguments:?}: {} {answer}", said(&output));
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)))
}

/// Value and U95 of every parameter that has one.
pub fn values(result: &Value) -> Vec<(f64, f64)> {
    let parameters = result["parameters"].as_array().unwrap();
    parameters.iter().filter_map(|p| Some((p["value"].as_f64()?, p["u95"].as_f64()?))).collect()
}
