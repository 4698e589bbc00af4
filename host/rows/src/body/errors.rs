//! Errors of load cell, IMU and mounting of one body: what the rig file or a class of data sheets says of
//! them.

use rigident_shared::calibration::Reading;

use super::sensitivities::{ERRORS, ImuError, PAIRS};
use super::{CHANNELS, WRENCH};
use rigident_fit::{Basis, Effect, Gaussian, Nuisance, Scope};
use rigident_io::rig::classes::{ImuLimits, rectangular};
use rigident_io::rig::{ImuClass, ImuTable, LoadCellClass, LoadCellTable, RigCalibration};

const AXES: [&str; 3] = ["x", "y", "z"];
/// The name of the error of the gravity that is stated.
pub(super) const GRAVITY: &str = "gravity";
/// Gravity where nobody has stated it, m/s²: the standard one, and how far that of sea level is from it
/// between equator and pole.
const STANDARD: (f64, f64) = (9.80665, 0.03);
/// Gravity that was computed or taken from a table for a place is as near, m/s².
const LOCAL_MPS2: f64 = 1e-3;

/// The way an error of the accelerometer shows at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AccelTerm {
    /// Along an axis.
    Bias(usize),
    /// In proportion to what is along two axes.
    Product(usize, usize),
}

/// Returns the errors of the accelerometer by name.
pub(super) fn accelerometer() -> impl Iterator<Item = (String, AccelTerm)> {
    let of = |group: &str, axis: usize| format!("accelerometer_{group}_{}", AXES[axis]);
    let biases = (0..3).map(move |i| (of("bias", i), AccelTerm::Bias(i)));
    let scales = (0..3).map(move |i| (of("scale", i), AccelTerm::Product(i, i)));
    let angles = PAIRS.into_iter().enumerate();
    let angles = angles.map(move |(k, (i, j))| (of("misalignment", k), AccelTerm::Product(i, j)));
    biases.chain(scales).chain(angles)
}

/// Returns the error of the gravity that is stated, relative; `columns`: it is in the rows in place of an
/// accelerometer.
pub fn of_gravity(stated_mps2: f64, std_mps2: Option<f64>, columns: bool) -> Option<Nuisance> {
    let is_standard = stated_mps2 == STANDARD.0;
    let (limit, class) = match is_standard {
        true => (STANDARD.1, "gravity standard"),
        false => (LOCAL_MPS2, "gravity local"),
    };
    let nuisance = Nuisance {
        name: GRAVITY.to_owned(),
        group: GRAVITY.to_owned(),
        unit: "1".to_owned(),
        sigma: std_mps2.unwrap_or(rectangular(limit)) / stated_mps2,
        basis: match std_mps2 {
            Some(_) => Basis::Stated("recording.gravity_std_mps2".to_owned()),
            None => Basis::Class(class.to_owned()),
        },
        scope: Scope::Rig,
        effect: if columns { Effect::Signal(ImuError::Gravity.first()) } else { Effect::None },
    };
    (nuisance.sigma.is_finite() && nuisance.sigma > 0.0).then_some(nuisance)
}

/// Returns the nuisance parameters of a body in motion, or of still poses: what does not move has no lever
/// arm, no delay and no rate.
pub fn nuisances(
    imu: &ImuTable,
    cell: &LoadCellTable,
    readings: &[Reading<f64>],
    is_static: bool,
) -> Vec<Nuisance> {
    let mut all: Vec<Nuisance> =
        of_imu(imu, is_static).into_iter().map(|(_, _, nuisance)| nuisance).collect();
    let wrenches = readings.iter().map(|reading| reading.wrench.array());
    all.extend(if is_static { of_cell_at_poses(cell, wrenches) } else { of_cell(cell, wrenches) });
    all
}

/// Returns the nuisance parameters of the load cell, the first channels being its six; full scale is the
/// largest load seen where the rig file gives no range.
pub fn of_cell(cell: &LoadCellTable, wrenches: impl Iterator<Item = [f64; WRENCH]>) -> Vec<Nuisance> {
    of_cell_with(cell, || largest(wrenches))
}

/// Returns those of still poses: where the rig file gives no range, full scale is the load of the middle
/// pose, which no drift and no odd pose make larger.
pub fn of_cell_at_poses(
    cell: &LoadCellTable,
    wrenches: impl Iterator<Item = [f64; WRENCH]>,
) -> Vec<Nuisance> {
    of_cell_with(cell, || median(wrenches))
}

fn of_cell_with(cell: &LoadCellTable, load: impl FnOnce() -> [f64; WRENCH]) -> Vec<Nuisance> {
    let class = cell.class.unwrap_or(LoadCellClass::DEFAULT);
    let sigma = rectangular(class.limit());
    let full_scale = cell.range_n_nm.unwrap_or_else(load);
    let basis = |stated: bool, key: &str| match stated {
        true => Basis::Stated(format!("load_cell.{key}")),
        false => Basis::Class(format!("load cell {}", class.name())),
    };
    let unit = |c: usize| if c < 3 { "N" } else { "N m" };
    let mut all = Vec::new();
    for (c, name) in CHANNELS.iter().enumerate() {
        all.push(Nuisance {
            name: format!("gain_{name}"),
            group: "load-cell gain".to_owned(),
            unit: "1".to_owned(),
            sigma: cell.gain_uncertainty.map_or(sigma, |g| g[c]),
            basis: basis(cell.gain_uncertainty.is_some(), "gain_uncertainty"),
            scope: Scope::Rig,
            effect: Effect::Gain { channel: c },
        });
    }
    for (to, name) in CHANNELS.iter().enumerate() {
        for (from, other) in CHANNELS.iter().enumerate().filter(|(from, _)| *from != to) {
            let ratio = full_scale[to] / full_scale[from];
            all.push(Nuisance {
                name: format!("crosstalk_{name}_{other}"),
                group: "cross-talk".to_owned(),
                unit: match (to < 3, from < 3) {
                    (true, false) => "1/m",
                    (false, true) => "m",
                    _ => "1",
                }
                .to_owned(),
                sigma: cell.crosstalk_std.unwrap_or(sigma) * ratio,
                basis: basis(cell.crosstalk_std.is_some(), "crosstalk_std"),
                scope: Scope::Rig,
                effect: Effect::CrossTalk { from, to },
            });
        }
    }
    for (degree, word) in [(1, "line"), (2, "curve")] {
        for (c, name) in CHANNELS.iter().enumerate() {
            all.push(Nuisance {
                name: format!("drift_{word}_{name}"),
                group: "load-cell drift".to_owned(),
                unit: unit(c).to_owned(),
                sigma: cell.drift_std_n_nm.map_or(sigma * full_scale[c], |d| d[c]),
                basis: basis(cell.drift_std_n_nm.is_some(), "drift_std_n_nm"),
                scope: Scope::Recording,
                effect: Effect::Drift { channel: c, degree },
            });
        }
    }
    all.retain(|k| k.sigma.is_finite() && k.sigma > 0.0);
    all
}

/// Returns what a calibration knows of those errors that all runs of the rig share, and names it as what they
/// rest on.
pub fn calibrated(calibration: Option<&RigCalibration>, nuisances: &mut [Nuisance]) -> Option<Gaussian> {
    let calibration = calibration?;
    let known = calibration.distribution()?;
    for nuisance in nuisances.iter_mut().filter(|k| k.scope == Scope::Rig) {
        if known.place(&nuisance.name).is_some() {
            nuisance.basis = Basis::Calibration(format!("{} of {}", calibration.name, calibration.date));
        }
    }
    let own = |name: &str| nuisances.iter().any(|k| k.scope == Scope::Rig && k.name == name);
    Some(known.only(own))
}

/// The moment of a weight goes with the sine of the angle between it and the arm, whose median over all
/// attitudes is √3/2.
const LARGEST_OVER_MEDIAN: [f64; 2] = [1.0, 2.0 / 1.732_050_8];

/// Returns the median force and the moment that goes with the median one, for each channel.
fn median(wrenches: impl Iterator<Item = [f64; WRENCH]>) -> [f64; WRENCH] {
    let mut sizes = [Vec::new(), Vec::new()];
    for wrench in wrenches {
        for (own, three) in sizes.iter_mut().zip(wrench.chunks(3)) {
            own.push(three.iter().map(|v| v * v).sum::<f64>().sqrt());
        }
    }
    let middle = sizes.map(|mut own| {
        own.retain(|size| size.is_finite());
        own.sort_by(f64::total_cmp);
        own.get(own.len() / 2).copied().unwrap_or(0.0)
    });
    std::array::from_fn(|c| LARGEST_OVER_MEDIAN[c / 3] * middle[c / 3])
}

/// Returns the largest force and the largest moment, for each channel.
fn largest(wrenches: impl Iterator<Item = [f64; WRENCH]>) -> [f64; WRENCH] {
    let mut most = [0.0_f64; 2];
    for wrench in wrenches {
        for (c, value) in wrench.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            most[c / 3] = most[c / 3].max(value.abs());
        }
    }
    std::array::from_fn(|c| most[c / 3])
}

/// A group of errors of the IMU: its name, the first of its axes, unit, σ stated, limit of the class, key,
/// and who shares it.
type ImuGroup = (&'static str, ImuError, &'static str, Option<f64>, f64, &'static str, Scope);

/// Returns the nuisance parameters of an IMU, each with its group and its number in that; of one that is at
/// rest those that this shows.
pub fn of_imu(imu: &ImuTable, is_static: bool) -> Vec<(ImuError, usize, Nuisance)> {
    let class = imu.class.unwrap_or(ImuClass::DEFAULT);
    let limits = class.limits();
    let mut all = Vec::new();
    for (group, error, unit, stated, limit, key, scope) in groups(imu, &limits) {
        if is_static && error.is_of_motion() {
            continue;
        }
        for axis in 0..error.count() {
            let mut name = group.to_lowercase().replace([' ', '-'], "_");
            if error.count() > 1 {
                name = format!("{name}_{}", AXES[axis]);
            }
            let nuisance = Nuisance {
                name,
                group: group.to_owned(),
                unit: unit.to_owned(),
                sigma: stated.unwrap_or(rectangular(limit)),
                basis: match stated {
                    Some(_) => Basis::Stated(format!("imu.{key}")),
                    None => Basis::Class(format!("IMU {}", class.name())),
                },
                scope,
                effect: Effect::Signal(error.first() + axis),
            };
            all.push((error, axis, nuisance));
        }
    }
    all.retain(|(_, _, k)| k.sigma.is_finite() && k.sigma > 0.0);
    all
}

/// Returns the groups of errors of an IMU: as the rig file states them, and as its class limits them.
fn groups(imu: &ImuTable, limits: &ImuLimits) -> [ImuGroup; ERRORS] {
    [
        (
            "lever arm",
            ImuError::LeverArm,
            "m",
            imu.position_std_m,
            limits.position_m,
            "position_std_m",
            Scope::Rig,
        ),
        (
            "IMU rotation",
            ImuError::Rotation,
            "rad",
            imu.rotation_std_rad,
            limits.rotation_rad,
            "rotation_std_rad",
            Scope::Rig,
        ),
        ("time skew", ImuError::Skew, "s", imu.skew_std_s, limits.skew_s, "skew_std_s", Scope::Recording),
        (
            "gyro bias",
            ImuError::GyroBias,
            "rad/s",
            imu.gyro_bias_std_radps,
            limits.gyro_bias_radps,
            "gyro_bias_std_radps",
            Scope::Recording,
        ),
        (
            "gyro scale",
            ImuError::GyroGain,
            "1",
            imu.gyro_gain_std,
            limits.gyro_gain,
            "gyro_gain_std",
            Scope::Rig,
        ),
        (
            "gyro rotation",
            ImuError::GyroRotation,
            "rad",
            imu.gyro_rotation_std_rad,
            limits.gyro_rotation_rad,
            "gyro_rotation_std_rad",
            Scope::Rig,
        ),
        (
            "accelerometer bias",
            ImuError::AccelBias,
            "m/s2",
            imu.accel_bias_std_mps2,
            limits.accel_bias_mps2,
            "accel_bias_std_mps2",
            Scope::Recording,
        ),
        (
            "accelerometer scale",
            ImuError::AccelGain,
            "1",
            imu.accel_gain_std,
            limits.accel_gain,
            "accel_gain_std",
            Scope::Rig,
        ),
        (
            "accelerometer misalignment",
            ImuError::AccelMisalignment,
            "rad",
            imu.accel_misalignment_std_rad,
            limits.accel_misalignment_rad,
            "accel_misalignment_std_rad",
            Scope::Rig,
        ),
    ]
}

#[cfg(test)]
#[path = "errors_tests.rs"]
mod tests;
