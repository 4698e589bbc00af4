//! The calibration of a rig: what a body of known properties shows of the errors of its sensors and of their
//! mounting.
//!
//! Lives here: the file and the `[calibration]` table of a rig file, and whether the one belongs to the
//! other. How a calibration is made is in `rigident::reference`; what it is to a fit, a prior, in
//! `rigident::problem::body::errors`.

use std::path::Path;
use std::time::{Duration, SystemTime};

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Calibrated, ImuTable, RigFile, RigFileError, WrenchSign, known_errors};
use rigident_fit::{Fingerprint, Gaussian};

/// Days that a calibration is valid for, unless it says otherwise.
pub const VALID_DAYS: u32 = 365;

/// The clock of the computer that made a calibration may be ahead by this much.
const CLOCKS: Duration = Duration::from_secs(86_400);
/// Geometry that differs by less, m or relative, is the same.
const SAME: f64 = 1e-9;

/// `[calibration]` of a rig file: a file, or all of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be file = \"…\", or what `calibrate_rig()` writes")]
pub enum CalibrationTable {
    /// A file beside the rig file.
    File(CalibrationFile),
    /// The calibration itself.
    Inline(Box<RigCalibration>),
}

/// Where a calibration is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFile {
    /// The file, beside the rig file.
    pub file: String,
}

/// A calibration of a rig: means, standard deviations and correlations of its errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RigCalibration {
    /// Name that answers call it by.
    pub name: String,
    /// Date, UTC, as RFC 3339 has it.
    pub date: String,
    /// Days that it is valid for.
    pub valid_days: u32,
    /// Name of the body of known properties.
    pub reference: String,
    /// Names of the recordings of it.
    pub recordings: Vec<String>,
    /// Fingerprints of their readings, hexadecimal.
    #[serde(default)]
    pub fingerprints: Vec<String>,
    /// Assumptions about the reference where nothing was stated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assumed: Vec<String>,
    /// Checksum of all else, hexadecimal: [`RigCalibration::sealed`].
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub checksum: String,
    /// The rig that it is of.
    pub rig: CalibratedRig,
    /// The errors.
    pub error: Vec<CalibratedError>,
    /// Correlations of each error with those before it.
    pub correlation: Vec<Vec<f64>>,
}

/// The references from which the errors are counted: a rig that differs in any of them is another one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibratedRig {
    /// Serial number of the load cell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_cell_serial: Option<String>,
    /// Serial number of the IMU.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imu_serial: Option<String>,
    /// Gravity, m/s²: where it was calibrated.
    pub gravity_mps2: f64,
    /// From gauges to the wrench on the body, N/V and N m/V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_cell_calibration: Option<[[f64; 6]; 6]>,
    /// Place of the IMU in S, m.
    pub imu_position_m: [f64; 3],
    /// S axes ← IMU axes.
    pub imu_rotation_wxyz: [f64; 4],
    /// Scale of the accelerometer.
    pub accel_scale: [f64; 3],
}

/// One error with what is known of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibratedError {
    /// Name of the error: `gain_fz`.
    pub name: String,
    /// SI unit of the error in ASCII.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Standard deviation of the estimate.
    pub std: f64,
}

/// Why a calibration is none for a rig.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// It cannot be read.
    #[error("calibration {path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// The message of the system.
        reason: String,
    },
    /// It is no calibration.
    #[error("calibration {path}: {reason}; it is made by `calibrate_rig()`")]
    Invalid {
        /// The file.
        path: String,
        /// The fault in the file.
        reason: String,
    },
    /// It is of another rig.
    #[error(
        "the calibration {name} is of another rig: its {key} is {calibrated}, that of this rig file {own}; \
         calibrate this rig, or leave the calibration out"
    )]
    OtherRig {
        /// The calibration.
        name: String,
        /// The key that differs.
        key: &'static str,
        /// In the calibration.
        calibrated: String,
        /// In the rig file.
        own: String,
    },
    /// The rig has something calibrated anew in every recording.
    #[error(
        "accel_scale = \"from_poses\" finds the accelerometer's scale anew in each recording: a calibration \
         of the rig needs numbers that stay"
    )]
    FromPoses,
}

impl RigCalibration {
    /// Builds a calibration from the distribution of errors, their units in the same order.
    pub fn of(known: &Gaussian, units: &[String], rig: CalibratedRig) -> Self {
        let sd = known.covariance().diagonal().map(f64::sqrt);
        let error = known.names().iter().zip(units).enumerate().map(|(k, (name, unit))| CalibratedError {
            name: name.clone(),
            unit: unit.clone(),
            value: known.mean()[k],
            std: sd[k],
        });
        let row =
            |i: usize| (0..i).map(|j| known.covariance()[(i, j)] / (sd[i] * sd[j])).collect::<Vec<f64>>();
        Self {
            name: String::new(),
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            valid_days: VALID_DAYS,
            reference: String::new(),
            recordings: Vec::new(),
            fingerprints: Vec::new(),
            assumed: Vec::new(),
            checksum: String::new(),
            rig,
            error: error.collect(),
            correlation: (0..sd.len()).map(row).collect(),
        }
    }

    /// Returns the distribution of the errors; `None` if the numbers make none.
    pub fn distribution(&self) -> Option<Gaussian> {
        let n = self.error.len();
        let is_triangle =
            self.correlation.len() == n && self.correlation.iter().enumerate().all(|(i, row)| row.len() == i);
        if !is_triangle || self.error.iter().any(|error| error.std <= 0.0) {
            return None;
        }
        let correlation = |i: usize, j: usize| {
            let row = self.correlation.get(i.max(j));
            if i == j { Some(1.0) } else { row.and_then(|row| row.get(i.min(j))).copied() }
        };
        let std = |k: usize| self.error.get(k).map_or(f64::NAN, |error| error.std);
        let covariance =
            DMatrix::from_fn(n, n, |i, j| correlation(i, j).unwrap_or(f64::NAN) * std(i) * std(j));
        Gaussian::new(
            self.error.iter().map(|error| error.name.clone()).collect(),
            DVector::from_iterator(n, self.error.iter().map(|error| error.value)),
            covariance,
        )
    }

    /// Reads the text of a calibration file called `path`.
    ///
    /// # Errors
    /// [`CalibrationError::Invalid`] says what is wrong.
    pub fn parse(text: &str, path: &str) -> Result<Self, CalibrationError> {
        let invalid = |reason: String| CalibrationError::Invalid { path: path.to_owned(), reason };
        let read: Self = toml::from_str(text).map_err(|e| invalid(e.message().trim().replace('\n', ", ")))?;
        read.check().map_err(invalid)?;
        Ok(read)
    }

    /// Reads a calibration file.
    ///
    /// # Errors
    /// [`CalibrationError`] says why there is none.
    pub fn load(path: &Path) -> Result<Self, CalibrationError> {
        let name = path.display().to_string();
        let text = rigident_files::read_text(path)
            .map_err(|e| CalibrationError::Unreadable { path: name.clone(), reason: e.to_string() })?;
        Self::parse(&text, &name)
    }

    /// Returns the calibration with the checksum of what it says.
    #[must_use]
    pub fn sealed(self) -> Self {
        Self { checksum: self.content(), ..self }
    }

    /// Returns the checksum of all but the checksum; comments and the order of keys do not count.
    fn content(&self) -> String {
        let mut hash = Fingerprint::default();
        hash.add_text(&Self { checksum: String::new(), ..self.clone() }.to_toml());
        format!("{:016x}", hash.finish())
    }

    /// Says what is wrong with the content, and where.
    pub(super) fn check(&self) -> Result<(), String> {
        let Ok(made) = humantime::parse_rfc3339(&self.date) else {
            return Err(format!("date = {:?} is no date; write one as 2026-05-01T12:00:00Z", self.date));
        };
        if made > SystemTime::now() + CLOCKS {
            return Err(format!(
                "date = {:?} is in the future: set the clock of this computer, or calibrate the rig again",
                self.date
            ));
        }
        for (k, error) in self.error.iter().enumerate() {
            let Some(unit) = known_errors::unit(&error.name) else {
                return Err(format!(
                    "error[{k}].name = {:?} is no error of a rig; they are called as the errors of an \
                     answer, gain_fz or lever_arm_x: calibrate the rig again",
                    error.name
                ));
            };
            if unit != error.unit {
                return Err(format!(
                    "error[{k}].unit = {:?}: the unit of {} is {unit:?}; calibrate the rig again",
                    error.unit, error.name
                ));
            }
        }
        if self.distribution().is_none() {
            return Err("the errors' values, standard deviations and correlations are those of no \
                        distribution: a number is not finite, a std not positive, a name appears twice, or \
                        the correlations contradict each other"
                .to_owned());
        }
        if self.checksum != self.content() {
            return Err(format!(
                "checksum = {:?} is not that of its content: it was edited by hand, or is damaged; take the \
                 file as it was written, or calibrate the rig again",
                self.checksum
            ));
        }
        Ok(())
    }

    /// Returns the text of the file.
    pub fn to_toml(&self) -> String {
        // Tables, numbers and strings have no way to fail.
        toml::to_string(self).unwrap_or_default()
    }

    /// Returns the fingerprint of readings as it is in the file.
    pub fn fingerprint(readings: u64) -> String {
        format!("{readings:016x}")
    }

    /// Returns a warning if the calibration was made of these readings.
    pub fn repeated(&self, readings: u64) -> Option<String> {
        self.fingerprints.contains(&Self::fingerprint(readings)).then(|| {
            format!(
                "the calibration {} was made of this recording: its readings count twice, and agree with \
                 themselves; take another one",
                self.name
            )
        })
    }

    /// Returns a warning if the calibration was not valid when something was recorded, RFC 3339; now if that
    /// is not known.
    pub fn expired(&self, recorded: Option<&str>) -> Option<String> {
        let recorded = recorded.and_then(|date| humantime::parse_rfc3339(date).ok());
        let at = recorded.unwrap_or_else(SystemTime::now);
        let made = humantime::parse_rfc3339(&self.date).ok()?;
        let valid = Duration::from_secs(86_400 * u64::from(self.valid_days));
        let age = at.duration_since(made).ok().filter(|age| *age > valid)?;
        Some(format!(
            "the calibration {} was {} days old when this was recorded, and is valid for {}: calibrate the \
             rig again; the intervals take its errors for unchanged",
            self.name,
            age.as_secs() / 86_400,
            self.valid_days
        ))
    }
}

impl CalibratedRig {
    /// Returns what a calibration of a rig counts from.
    ///
    /// # Errors
    /// [`CalibrationError::FromPoses`] if that is found anew in each recording.
    pub fn of(rig: &RigFile) -> Result<Self, CalibrationError> {
        let default = ImuTable::default();
        let imu = rig.imu.first().unwrap_or(&default);
        let Calibrated::Numbers(accel_scale) = imu.accel_scale else {
            return Err(CalibrationError::FromPoses);
        };
        // A recording's wrench is turned to that on the body when it is read.
        let sign = if rig.recording.wrench_sign == WrenchSign::OnSensor { -1.0 } else { 1.0 };
        let calibration = rig.load_cell.calibration.map(|rows| rows.map(|row| row.map(|v| sign * v)));
        Ok(Self {
            load_cell_serial: rig.load_cell.serial.clone(),
            imu_serial: imu.serial.clone(),
            gravity_mps2: rig.recording.gravity_mps2,
            load_cell_calibration: calibration,
            imu_position_m: imu.position_m,
            imu_rotation_wxyz: imu.rotation_wxyz,
            accel_scale,
        })
    }

    /// Returns the first difference from another: the key and both values.
    fn difference(&self, own: &Self) -> Option<(&'static str, String, String)> {
        let differ = |a: &[f64], b: &[f64]| {
            a.len() != b.len() || a.iter().zip(b).any(|(a, b)| (a - b).abs() > SAME * a.abs().max(1.0))
        };
        let found = |key, a: &dyn std::fmt::Debug, b: &dyn std::fmt::Debug| {
            Some((key, format!("{a:?}"), format!("{b:?}")))
        };
        // A serial number that one of the two does not give says nothing.
        let serial = |a: &Option<String>, b: &Option<String>| a.is_some() && b.is_some() && a != b;
        let text = |serial: &Option<String>| serial.clone().unwrap_or_default();
        if serial(&self.load_cell_serial, &own.load_cell_serial) {
            let (calibrated, own) = (text(&self.load_cell_serial), text(&own.load_cell_serial));
            return found("load_cell.serial", &calibrated, &own);
        }
        if serial(&self.imu_serial, &own.imu_serial) {
            return found("imu.serial", &text(&self.imu_serial), &text(&own.imu_serial));
        }
        if differ(&[self.gravity_mps2], &[own.gravity_mps2]) {
            return found("recording.gravity_mps2", &self.gravity_mps2, &own.gravity_mps2);
        }
        let matrix =
            |rig: &Self| rig.load_cell_calibration.iter().flatten().flatten().copied().collect::<Vec<f64>>();
        if differ(&matrix(self), &matrix(own)) {
            return found("load_cell.calibration", &matrix(self), &matrix(own));
        }
        if differ(&self.imu_position_m, &own.imu_position_m) {
            return found("imu.position_m", &self.imu_position_m, &own.imu_position_m);
        }
        if differ(&self.imu_rotation_wxyz, &own.imu_rotation_wxyz) {
            return found("imu.rotation_wxyz", &self.imu_rotation_wxyz, &own.imu_rotation_wxyz);
        }
        if differ(&self.accel_scale, &own.accel_scale) {
            return found("imu.accel_scale", &self.accel_scale, &own.accel_scale);
        }
        None
    }
}

impl RigFile {
    /// Takes a calibration for this rig, in place of one that it has.
    ///
    /// # Errors
    /// [`CalibrationError::OtherRig`] says what differs.
    pub fn calibrate(&mut self, calibration: RigCalibration) -> Result<(), CalibrationError> {
        let own = CalibratedRig::of(self)?;
        if let Some((key, calibrated, own)) = calibration.rig.difference(&own) {
            return Err(CalibrationError::OtherRig { name: calibration.name, key, calibrated, own });
        }
        self.calibration = Some(CalibrationTable::Inline(Box::new(calibration)));
        Ok(())
    }

    /// Returns the calibration, where it was read.
    pub fn calibrated(&self) -> Option<&RigCalibration> {
        match &self.calibration {
            Some(CalibrationTable::Inline(calibration)) => Some(calibration),
            Some(CalibrationTable::File(_)) | None => None,
        }
    }

    /// Reads the calibration that the file names, beside `path`, and checks that it is of this rig.
    pub(super) fn read_calibration(&mut self, path: &Path) -> Result<(), RigFileError> {
        let refuse = |value: String, error: &CalibrationError| RigFileError::Value {
            file: None,
            line: None,
            key: "calibration".to_owned(),
            value,
            advice: error.to_string(),
        };
        if let Some(CalibrationTable::File(CalibrationFile { file })) = self.calibration.clone() {
            let beside = path.parent().unwrap_or(Path::new("")).join(&file);
            let read = RigCalibration::load(&beside).and_then(|read| self.calibrate(read));
            read.map_err(|error| refuse(file, &error))?;
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "calibration_tests.rs"]
mod tests;
