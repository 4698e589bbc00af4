//! From a recording and its rig file to what is identified.

use rigident_shared::calibration::{GaugeCalibration, ImuMounting, Reading};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Rotation, SpecificForce, Wrench};

use super::input_checks::{self, Implausible};
use super::poses::{PoseError, calibrate_accelerometer, still_poses};
use super::{Input, errors, imu_noise, rest};
use rigident_fit::{ErrorRow, Nuisance};
use rigident_io::recording::Recording;
use rigident_io::recording::columns::TIME;
use rigident_io::rig::{Calibrated, ImuTable, OffsetTable, OffsetWord, RigFile};

/// Names the knowledge that still poses by gravity columns rest on.
const STILL_POSES: &str = "still poses by the gravity columns; an IMU, if any, was not used";

/// The deviation of the mean rate of a still pose from rest, rad/s, and of the specific force from its mean,
/// m/s².
const STILL: (f64, f64) = (0.02, 0.15);

/// Why a recording cannot be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PrepareError {
    /// A group of columns is needed and not there.
    #[error("{name}: {missing} missing: {advice}")]
    Missing {
        /// The recording.
        name: String,
        /// The columns.
        missing: &'static str,
        /// The advice.
        advice: &'static str,
    },
    /// Calibration on still poses failed.
    #[error("{name}: {error}")]
    Poses {
        /// The recording.
        name: String,
        /// Why.
        error: PoseError,
    },
    /// It cannot be what the rig file says.
    #[error("{name}: {error}")]
    Implausible {
        /// The recording.
        name: String,
        /// Why.
        error: Implausible,
    },
    /// Needs what later versions will do.
    #[error("{name}: {what}")]
    Unsupported {
        /// The recording.
        name: String,
        /// The request.
        what: &'static str,
    },
}

/// A recording ready to be identified.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The rig file with every calibration done: numbers only, and the mounting that the readings need.
    pub rig: RigFile,
    /// The readings and all settings.
    pub input: Input,
    /// The specific force is that of gravity columns, in the axes of S; an IMU was not used.
    pub gravity_columns: bool,
    /// The steps done, in words.
    pub notes: Vec<String>,
}

/// Returns what a rig file says of the IMU on link 0, all calibrations done.
pub fn mounting(imu: &ImuTable) -> ImuMounting<f64> {
    let numbers = |c: Calibrated, otherwise| match c {
        Calibrated::Numbers(v) => v,
        Calibrated::FromPoses(_) => otherwise,
    };
    ImuMounting {
        // Checked when the rig file was read.
        rotation: Rotation::from_quaternion(imu.rotation_wxyz).unwrap_or_else(Rotation::identity),
        position: Position::from_array(imu.position_m),
        accel_scale: numbers(imu.accel_scale, [1.0; 3]),
        accel_bias: SpecificForce::from_array(numbers(imu.accel_bias_mps2, [0.0; 3])),
        gyro_bias: AngularRate::from_array(numbers(imu.gyro_bias_radps, [0.0; 3])),
    }
}

/// Returns what is known of the gravity that a rig file states.
fn gravity(rig: &RigFile, columns: bool) -> Option<Nuisance> {
    errors::of_gravity(rig.recording.gravity_mps2, rig.recording.gravity_std_mps2, columns)
}

/// Returns what rests say of the accelerometer; without a rate every reading is one.
fn rests(rig: &RigFile, imu: &ImuTable, readings: &[Reading<f64>], rate_hz: Option<f64>) -> Vec<ErrorRow> {
    let (mounting, gravity) = (mounting(imu), rig.recording.gravity_mps2);
    match rate_hz {
        Some(rate_hz) => {
            let noise = imu_noise::white_imu_noise(Some(imu), readings);
            let mut rows = rest::of_motion(readings, &mounting, rate_hz, [noise.accel, noise.gyro], gravity);
            rows.extend(rest::of_turning(readings, &mounting, rate_hz, gravity));
            rows
        }
        None => rest::of_poses(readings, &mounting, imu.accel_noise_mps2, gravity),
    }
}

/// Returns everything in a rig file that an identification needs, for given readings.
pub fn input(rig: &RigFile, readings: Vec<Reading<f64>>, is_static: bool, rate_hz: f64) -> Input {
    let default = ImuTable::default();
    let imu = rig.imu.first().unwrap_or(&default);
    let mut nuisances = errors::nuisances(imu, &rig.load_cell, &readings, is_static);
    let rests = rests(rig, imu, &readings, (!is_static).then_some(rate_hz));
    let knows = |name: &str| nuisances.iter().any(|k| k.name.starts_with(name));
    if !rests.is_empty() && knows("accelerometer") {
        nuisances.extend(gravity(rig, false));
    }
    let beforehand = errors::calibrated(rig.calibrated(), &mut nuisances);
    Input { nuisances, rests, beforehand, ..settings(rig, readings, is_static, rate_hz) }
}

/// Returns readings with what their rows need of a rig file: nothing of its errors.
fn settings(rig: &RigFile, readings: Vec<Reading<f64>>, is_static: bool, rate_hz: f64) -> Input {
    let default = ImuTable::default();
    let imu = rig.imu.first().unwrap_or(&default);
    let none = Limits::none();
    Input {
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        readings,
        is_static,
        rate_hz,
        mounting: mounting(imu),
        channel_sigma: rig.load_cell.noise_n_nm,
        gyro_sigma: imu.gyro_noise_radps,
        known_offset: match rig.load_cell.offset_n_nm {
            OffsetTable::Known(offset) => Some(offset),
            OffsetTable::Word(OffsetWord::Zero) => Some([0.0; 6]),
            OffsetTable::Word(OffsetWord::Estimate) => None,
        },
        limits: Limits {
            wrench: rig.load_cell.range_n_nm.unwrap_or(none.wrench),
            specific_force: imu.range_mps2.unwrap_or(none.specific_force),
            angular_rate: imu.range_radps.unwrap_or(none.angular_rate),
            frozen_after: rig.recording.frozen_after,
        },
    }
}

/// Brings a recording into readings: wrench or gauges, gravity or IMU, calibrations from poses.
///
/// # Errors
/// [`PrepareError`] says which columns or keys are missing.
pub fn prepare(recording: &Recording) -> Result<Prepared, PrepareError> {
    prepare_owned(recording.clone())
}

/// Does as [`prepare`] does with a recording that is not needed any more: its numbers are not copied.
///
/// # Errors
/// Fails as [`prepare`] does.
pub fn prepare_owned(mut recording: Recording) -> Result<Prepared, PrepareError> {
    let mut rig = recording.rig.clone();
    let mut notes = Vec::new();
    if rig.link.len() > 1 || !rig.stream.is_empty() {
        return Err(PrepareError::Unsupported {
            name: recording.name,
            what: "its rig file is for several links or several files. `identify()` and `replay()` take \
                   several links, factor files and what is made of them do not; of several files \
                   `identify()` takes the rig file itself as the recording, or the folder of the files and \
                   `rig`",
        });
    }
    let (readings, rate_hz) = readings(&mut recording, &mut rig, &mut notes)?;
    let name = recording.name;
    let mut input = input(&rig, readings, recording.is_static, rate_hz);
    let gravity_columns = recording.is_static && recording.gravity.is_some();
    if gravity_columns {
        input.nuisances = errors::of_cell_at_poses(
            &rig.load_cell,
            input.readings.iter().map(|reading| reading.wrench.array()),
        );
        input.nuisances.extend(gravity(&rig, true));
        input.rests.clear();
        input.beforehand = errors::calibrated(rig.calibrated(), &mut input.nuisances);
    }
    input_checks::check(&input, rig.recording.gravity_mps2, gravity_columns)
        .map_err(|error| PrepareError::Implausible { name, error })?;
    Ok(Prepared { rig, input, gravity_columns, notes })
}

/// Brings a moving recording into the readings of its rows, without what is known of errors and noise: for a
/// quick look at what the rows explain.
///
/// # Errors
/// Fails as [`prepare`] does.
pub fn rows_alone(mut recording: Recording) -> Result<Input, PrepareError> {
    let mut rig = recording.rig.clone();
    let (readings, rate_hz) = readings(&mut recording, &mut rig, &mut Vec::new())?;
    let input = settings(&rig, readings, recording.is_static, rate_hz);
    input_checks::check(&input, rig.recording.gravity_mps2, false)
        .map_err(|error| PrepareError::Implausible { name: recording.name, error })?;
    Ok(input)
}

/// Takes the readings out of a recording, and calibrates its rig on still poses; returns them with their
/// rate, Hz.
fn readings(
    recording: &mut Recording,
    rig: &mut RigFile,
    notes: &mut Vec<String>,
) -> Result<(Vec<Reading<f64>>, f64), PrepareError> {
    let readings = columns(recording, rig, notes)?.into_readings();
    if rig.imu.is_empty() {
        rig.imu.push(ImuTable::default());
    }
    let rate_hz = recording.rate_hz.unwrap_or(1.0);
    calibrate(recording.is_static, rig, &readings, rate_hz, notes)
        .map_err(|error| PrepareError::Poses { name: recording.name.clone(), error })?;
    Ok((readings, rate_hz))
}

/// Checks that a recording has the columns of one body; notes oddities of still poses.
fn check_columns(recording: &Recording, rig: &RigFile, notes: &mut Vec<String>) -> Result<(), PrepareError> {
    let name = || recording.name.clone();
    let missing = |missing, advice| Err(PrepareError::Missing { name: name(), missing, advice });
    if recording.wrench.is_none() && recording.gauges.is_none() {
        return missing(
            "the wrench fx_n … mz_nm is",
            "add the columns, or name foreign ones in [recording] columns of the rig file",
        );
    }
    if recording.wrench.is_none() && rig.load_cell.calibration.is_none() {
        return missing(
            "[load_cell] calibration is",
            "raw gauges need the 6x6 matrix to N and N m in the rig file",
        );
    }
    let imu = recording.imus.first();
    let gyro = imu.and_then(|imu| imu.gyro.as_ref());
    if recording.is_static {
        let times = recording.extra.iter().find(|(column, _)| column == TIME);
        let times: Vec<f64> =
            times.iter().flat_map(|(_, cells)| cells).flat_map(|c| c.trim().parse()).collect();
        notes.extend(input_checks::hurried_poses(&times));
        match gyro.map(|gyro| input_checks::check_still(gyro)) {
            // Where gravity is given, the IMU is not trusted.
            Some(Err(error)) if recording.gravity.is_some() => notes.push(error.to_string()),
            Some(Err(error)) => return Err(PrepareError::Implausible { name: name(), error }),
            Some(Ok(())) | None => {}
        }
        if recording.gravity.is_some() {
            return Ok(());
        }
    }
    if imu.is_none_or(|imu| imu.accel.is_none()) {
        return missing(
            "the specific force imu_ax_mps2 … is",
            "add an accelerometer, or gravity columns gx_mps2 … for still poses with static = true",
        );
    }
    if !recording.is_static && gyro.is_none() {
        return missing(
            "the angular rate imu_gx_radps … is",
            "a moving body needs a gyro; still poses need static = true in [recording]",
        );
    }
    Ok(())
}

/// Takes the columns of one body out of a recording.
fn columns(
    recording: &mut Recording,
    rig: &mut RigFile,
    notes: &mut Vec<String>,
) -> Result<Columns, PrepareError> {
    check_columns(recording, rig, notes)?;
    let is_static = recording.is_static;
    let by_gravity = is_static && recording.gravity.is_some();
    if by_gravity {
        // A still sensor feels −g, here already in the axes of S.
        rig.imu = vec![ImuTable::default()];
        notes.push(STILL_POSES.to_owned());
    }
    let name = || recording.name.clone();
    input_checks::check_channels(recording)
        .map_err(|error| PrepareError::Implausible { name: name(), error })?;
    let matrix = rig.load_cell.calibration;
    let of_gauges = |gauges: Vec<[f64; 6]>| -> Vec<[f64; 6]> {
        let calibration = GaugeCalibration { matrix: matrix.unwrap_or_default() };
        gauges.into_iter().map(|g| calibration.wrench(&g).array()).collect()
    };
    let wrench = recording.wrench.take().or_else(|| recording.gauges.take().map(of_gauges));
    let imu = recording.imus.first_mut().map(std::mem::take).unwrap_or_default();
    let gravity = recording.gravity.as_ref().filter(|_| by_gravity);
    let by_gravity = gravity.map(|rows| rows.iter().map(|g| g.map(|v| -v)).collect());
    Ok(Columns {
        time_ns: std::mem::take(&mut recording.time_ns),
        wrench: wrench.unwrap_or_default(),
        specific_force: by_gravity.or(imu.accel).unwrap_or_default(),
        angular_rate: imu.gyro.filter(|_| !is_static).unwrap_or_default(),
    })
}

/// Rows that are given back to the system at a time.
const GIVEN_BACK: usize = 1 << 17;

/// The columns of one body.
struct Columns {
    time_ns: Vec<u64>,
    wrench: Vec<[f64; 6]>,
    specific_force: Vec<[f64; 3]>,
    angular_rate: Vec<[f64; 3]>,
}

impl Columns {
    /// Returns the readings, made from the end on: the memory of the columns is given back on the way,
    /// because of a long recording both do not fit at once.
    fn into_readings(mut self) -> Vec<Reading<f64>> {
        fn keep<T>(column: &mut Vec<T>, rows: usize) {
            column.truncate(rows);
            column.shrink_to_fit();
        }
        let mut end = self.specific_force.len().min(self.wrench.len());
        let mut readings = Vec::with_capacity(end);
        while end > 0 {
            let start = end.saturating_sub(GIVEN_BACK);
            readings.extend((start..end).rev().map(|row| {
                Reading {
                    time_ns: self.time_ns.get(row).copied().unwrap_or(row as u64 * 1_000_000_000),
                    wrench: Wrench::from_array(self.wrench[row]),
                    specific_force: SpecificForce::from_array(self.specific_force[row]),
                    angular_rate: self
                        .angular_rate
                        .get(row)
                        .map_or_else(AngularRate::zero, |rate| AngularRate::from_array(*rate)),
                }
            }));
            keep(&mut self.time_ns, start);
            keep(&mut self.wrench, start);
            keep(&mut self.specific_force, start);
            keep(&mut self.angular_rate, start);
            end = start;
        }
        readings.reverse();
        readings
    }
}

fn calibrate(
    is_static: bool,
    rig: &mut RigFile,
    readings: &[Reading<f64>],
    rate_hz: f64,
    notes: &mut Vec<String>,
) -> Result<(), PoseError> {
    let gravity = rig.recording.gravity_mps2;
    let Some(imu) = rig.imu.first_mut() else { return Ok(()) };
    let from_poses = |c: Calibrated| matches!(c, Calibrated::FromPoses(_));
    let accel = from_poses(imu.accel_scale) || from_poses(imu.accel_bias_mps2);
    let gyro = from_poses(imu.gyro_bias_radps);
    if !accel && !gyro {
        return Ok(());
    }
    let stills = if is_static { Vec::new() } else { still_poses(readings, rate_hz, STILL.0, STILL.1) };
    if accel {
        let poses: Vec<[f64; 3]> = if is_static {
            readings.iter().map(|r| r.specific_force.array()).collect()
        } else {
            stills.iter().map(|p| p.specific_force).collect()
        };
        let found = calibrate_accelerometer(&poses, gravity)?;
        imu.accel_scale = Calibrated::Numbers(found.scale);
        imu.accel_bias_mps2 = Calibrated::Numbers(found.bias_mps2);
        notes.push(format!(
            "accelerometer calibrated against |g| = {gravity} m/s² on {} still poses: scale {:.5?}, bias \
             {:.4?} m/s², residual {:.4} m/s²",
            poses.len(),
            found.scale,
            found.bias_mps2,
            found.residual_mps2
        ));
    }
    if gyro {
        let at_rest: Vec<_> =
            stills.iter().filter(|p| p.angular_rate.iter().all(|v| v.abs() < 5.0 * STILL.0)).collect();
        if at_rest.is_empty() && !is_static {
            return Err(PoseError::TooFew(0));
        }
        let count = at_rest.len().max(1) as f64;
        let bias = std::array::from_fn(|k| at_rest.iter().map(|p| p.angular_rate[k]).sum::<f64>() / count);
        imu.gyro_bias_radps = Calibrated::Numbers(bias);
        notes.push(format!("gyro bias {bias:.5?} rad/s from {} still poses", at_rest.len()));
    }
    Ok(())
}
