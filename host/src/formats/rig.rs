//! The rig file: what a recording was taken with.

use std::path::Path;

use serde::{Deserialize, Serialize};

/// Why a rig file cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RigFileError {
    /// It cannot be read.
    #[error("rig file {path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// Not TOML, an unknown key, a value of the wrong kind.
    #[error("rig file: {0}")]
    Syntax(String),
    /// A value that makes no sense.
    #[error("rig file: {key} = {value}: {advice}")]
    Value {
        /// The key.
        key: String,
        /// What stands there.
        value: String,
        /// What should.
        advice: &'static str,
    },
}

/// The whole file. Everything may be absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RigFile {
    /// How the recording differs from the notation.
    pub recording: RecordingTable,
    /// The IMUs, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub imu: Vec<ImuTable>,
    /// The load cell.
    pub load_cell: LoadCellTable,
    /// The customer's frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyTable>,
    /// The hexapod.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub platform: Option<PlatformTable>,
    /// What is really the case; printed beside the answer, never used by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<TruthTable>,
    /// Several links.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<toml::Table>,
    /// Several files.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stream: Vec<toml::Table>,
}

/// `[recording]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecordingTable {
    /// Checked against the times, 1/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Whose sign the wrench has.
    pub wrench_sign: WrenchSign,
    /// Gravity, m/s².
    pub gravity_mps2: f64,
    /// Rows are still poses without time.
    #[serde(rename = "static")]
    pub is_static: bool,
    /// Foreign names of the columns.
    #[serde(skip_serializing_if = "std::collections::BTreeMap::is_empty")]
    pub columns: std::collections::BTreeMap<String, ColumnSource>,
}

impl Default for RecordingTable {
    fn default() -> Self {
        Self {
            rate_hz: None,
            wrench_sign: WrenchSign::OnBody,
            gravity_mps2: 9.80665,
            is_static: false,
            columns: Default::default(),
        }
    }
}

/// Whose sign a wrench has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WrenchSign {
    /// On the body, by the sensor.
    OnBody,
    /// On the sensor, by the body: the reaction.
    OnSensor,
}

/// Where a column's numbers are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ColumnSource {
    /// Under another name.
    Name(String),
    /// Under another name and in another unit.
    Scaled(ScaledColumn),
}

/// A column in another unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaledColumn {
    /// Its name in the file.
    pub name: String,
    /// Multiplies its numbers to give SI.
    pub scale: f64,
}

impl ColumnSource {
    /// Name in the file and factor to SI.
    pub fn parts(&self) -> (&str, f64) {
        match self {
            Self::Name(name) => (name, 1.0),
            Self::Scaled(column) => (&column.name, column.scale),
        }
    }
}

/// Numbers, or calibrated on the recording's still poses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Calibrated {
    /// Given.
    Numbers([f64; 3]),
    /// `"from_poses"`
    FromPoses(FromPoses),
}

/// The word `from_poses`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FromPoses {
    /// Calibrated against |g| (accelerometer) or rest (gyro).
    #[serde(rename = "from_poses")]
    FromPoses,
}

/// `[[imu]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImuTable {
    /// The link it sits on.
    pub link: usize,
    /// Its origin in the link's frame, m.
    pub position_m: [f64; 3],
    /// `R_LU`.
    pub rotation_wxyz: [f64; 4],
    /// Factor on each accelerometer axis.
    pub accel_scale: Calibrated,
    /// Bias of the scaled accelerometer, m/s².
    pub accel_bias_mps2: Calibrated,
    /// Bias of the gyro, rad/s.
    pub gyro_bias_radps: Calibrated,
    /// Group delay, s.
    pub group_delay_s: f64,
    /// Bandwidth, Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_hz: Option<f64>,
    /// Rate it is run at, 1/s; the recording's otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Range of the accelerometer, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_mps2: Option<f64>,
    /// Range of the gyro, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_radps: Option<f64>,
    /// 1 σ per sample, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_noise_mps2: Option<f64>,
    /// 1 σ per sample, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_noise_radps: Option<f64>,
    /// Serial number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// Date of its calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated_on: Option<String>,
}

impl Default for ImuTable {
    fn default() -> Self {
        Self {
            link: 0,
            position_m: [0.0; 3],
            rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
            accel_scale: Calibrated::Numbers([1.0; 3]),
            accel_bias_mps2: Calibrated::Numbers([0.0; 3]),
            gyro_bias_radps: Calibrated::Numbers([0.0; 3]),
            group_delay_s: 0.0,
            bandwidth_hz: None,
            rate_hz: None,
            range_mps2: None,
            range_radps: None,
            accel_noise_mps2: None,
            gyro_noise_radps: None,
            serial: None,
            calibrated_on: None,
        }
    }
}

/// What is known of the wrench's offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum OffsetTable {
    /// Six numbers, on-body sign.
    Known([f64; 6]),
    /// A word.
    Word(OffsetWord),
}

/// Words for the offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OffsetWord {
    /// Estimated with the body.
    Estimate,
    /// There is none.
    Zero,
}

/// `[load_cell]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LoadCellTable {
    /// 1 σ per sample, N and N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_n_nm: Option<[f64; 6]>,
    /// The offset.
    pub offset_n_nm: OffsetTable,
    /// 1 σ, relative, constant over an experiment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_uncertainty: Option<[f64; 6]>,
    /// `wrench = calibration · gauges`, N/V and N m/V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<[[f64; 6]; 6]>,
    /// Group delay, s.
    pub group_delay_s: f64,
    /// Bandwidth, Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_hz: Option<f64>,
    /// Range, N and N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_n_nm: Option<[f64; 6]>,
    /// Serial number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// Date of its calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrated_on: Option<String>,
}

impl Default for LoadCellTable {
    fn default() -> Self {
        Self {
            noise_n_nm: None,
            offset_n_nm: OffsetTable::Word(OffsetWord::Estimate),
            gain_uncertainty: None,
            calibration: None,
            group_delay_s: 0.0,
            bandwidth_hz: None,
            range_n_nm: None,
            serial: None,
            calibrated_on: None,
        }
    }
}

/// `[body]`: the customer's frame, in S.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BodyTable {
    /// Its name.
    pub name: String,
    /// Origin in S, m.
    pub position_m: [f64; 3],
    /// Body axes to S.
    pub rotation_wxyz: [f64; 4],
}

impl Default for BodyTable {
    fn default() -> Self {
        Self { name: String::new(), position_m: [0.0; 3], rotation_wxyz: [1.0, 0.0, 0.0, 0.0] }
    }
}

/// `[platform]`: a hexapod.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs, reason = "the keys of the format, which documents them")]
pub struct PlatformTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_joints_m: Option<[[f64; 3]; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_joints_m: Option<[[f64; 3]; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_length_m: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_rate_mps: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_force_n: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cond_max: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_cell: Option<PlaceTable>,
}

/// A frame on the plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaceTable {
    /// Origin, m.
    pub position_m: [f64; 3],
    /// Orientation.
    pub rotation_wxyz: [f64; 4],
}

/// `[truth]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TruthTable {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in S, m.
    pub com_m: [f64; 3],
    /// About the centre of mass, axes of S, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Apparent offset of the wrench, on-body sign, N and N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub apparent_offset_n_nm: Option<[f64; 6]>,
}

fn bad(key: impl Into<String>, value: impl std::fmt::Debug, advice: &'static str) -> RigFileError {
    RigFileError::Value { key: key.into(), value: format!("{value:?}"), advice }
}

impl RigFile {
    /// Reads and checks the text of a rig file.
    ///
    /// # Errors
    /// [`RigFileError`] names key or line.
    pub fn parse(text: &str) -> Result<Self, RigFileError> {
        let rig: Self =
            toml::from_str(text).map_err(|e| RigFileError::Syntax(e.to_string().trim().to_owned()))?;
        rig.check()?;
        Ok(rig)
    }

    /// Reads and checks a rig file.
    ///
    /// # Errors
    /// It cannot be read, or [`RigFile::parse`] refuses it.
    pub fn load(path: &Path) -> Result<Self, RigFileError> {
        let text = std::fs::read_to_string(path).map_err(|e| RigFileError::Unreadable {
            path: path.display().to_string(),
            reason: e.to_string(),
        })?;
        Self::parse(&text)
    }

    /// The text of the file.
    pub fn to_toml(&self) -> String {
        // Tables, numbers and strings have no way to fail.
        toml::to_string(self).unwrap_or_default()
    }

    fn check(&self) -> Result<(), RigFileError> {
        const FINITE: &str = "every number must be finite";
        const POSITIVE: &str = "must be finite and greater than zero";
        const DELAY: &str = "must be between 0 and 1 s";
        let positive = |key: String, values: &[f64]| {
            if values.iter().all(|v| v.is_finite() && *v > 0.0) {
                Ok(())
            } else {
                Err(bad(key, values, POSITIVE))
            }
        };
        let finite = |key: String, values: &[f64]| {
            if values.iter().all(|v| v.is_finite()) { Ok(()) } else { Err(bad(key, values, FINITE)) }
        };
        let rotation = |key: String, q: &[f64; 4]| {
            let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            if (0.9..1.1).contains(&norm) {
                Ok(())
            } else {
                Err(bad(key, q, "must be a unit quaternion w, x, y, z"))
            }
        };
        let delay = |key: String, value: f64| {
            if (0.0..=1.0).contains(&value) { Ok(()) } else { Err(bad(key, value, DELAY)) }
        };
        if let Some(rate) = self.recording.rate_hz {
            positive("recording.rate_hz".into(), &[rate])?;
        }
        positive("recording.gravity_mps2".into(), &[self.recording.gravity_mps2])?;
        for (name, source) in &self.recording.columns {
            let (_, scale) = source.parts();
            if !scale.is_finite() || scale == 0.0 {
                return Err(bad(
                    format!("recording.columns.{name}.scale"),
                    scale,
                    "must be finite and not zero",
                ));
            }
        }
        for (i, imu) in self.imu.iter().enumerate() {
            let key = |name: &str| format!("imu[{i}].{name}");
            finite(key("position_m"), &imu.position_m)?;
            rotation(key("rotation_wxyz"), &imu.rotation_wxyz)?;
            if let Calibrated::Numbers(scale) = &imu.accel_scale {
                positive(key("accel_scale"), scale)?;
            }
            for (name, value) in
                [("accel_bias_mps2", imu.accel_bias_mps2), ("gyro_bias_radps", imu.gyro_bias_radps)]
            {
                if let Calibrated::Numbers(bias) = value {
                    finite(key(name), &bias)?;
                }
            }
            delay(key("group_delay_s"), imu.group_delay_s)?;
            for (name, value) in [
                ("bandwidth_hz", imu.bandwidth_hz),
                ("rate_hz", imu.rate_hz),
                ("range_mps2", imu.range_mps2),
                ("range_radps", imu.range_radps),
                ("accel_noise_mps2", imu.accel_noise_mps2),
                ("gyro_noise_radps", imu.gyro_noise_radps),
            ] {
                positive(key(name), value.as_slice())?;
            }
        }
        let cell = &self.load_cell;
        for (name, values) in [
            ("noise_n_nm", cell.noise_n_nm),
            ("range_n_nm", cell.range_n_nm),
            ("gain_uncertainty", cell.gain_uncertainty),
        ] {
            positive(format!("load_cell.{name}"), values.as_ref().map_or(&[], |v| v.as_slice()))?;
        }
        if let OffsetTable::Known(offset) = &cell.offset_n_nm {
            finite("load_cell.offset_n_nm".into(), offset)?;
        }
        for row in cell.calibration.iter().flatten() {
            finite("load_cell.calibration".into(), row)?;
        }
        delay("load_cell.group_delay_s".into(), cell.group_delay_s)?;
        if let Some(body) = &self.body {
            finite("body.position_m".into(), &body.position_m)?;
            rotation("body.rotation_wxyz".into(), &body.rotation_wxyz)?;
        }
        if let Some(truth) = &self.truth {
            positive("truth.mass_kg".into(), &[truth.mass_kg])?;
            finite("truth.com_m".into(), &truth.com_m)?;
            finite("truth.inertia_com_kgm2".into(), &truth.inertia_com_kgm2)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_format_is_read() {
        let rig = RigFile::parse(
            r#"
[recording]
rate_hz = 200.0
wrench_sign = "on_sensor"
columns = { fx_n = "Fx", t_s = { name = "time_ms", scale = 1e-3 } }
[[imu]]
position_m = [0.01, -0.02, 0.05]
rotation_wxyz = [1, 0, 0, 0]
accel_bias_mps2 = "from_poses"
[load_cell]
noise_n_nm = [5.05, 5.05, 10.1, 0.383, 0.459, 0.459]
offset_n_nm = "zero"
[truth]
mass_kg = 3.2
com_m = [0.0, 0.01, 0.053]
inertia_com_kgm2 = [1, 1, 1, 0, 0, 0]
"#,
        )
        .unwrap();
        assert_eq!(rig.recording.wrench_sign, WrenchSign::OnSensor);
        assert_eq!(rig.recording.columns["t_s"].parts(), ("time_ms", 1e-3));
        assert_eq!(rig.imu[0].accel_bias_mps2, Calibrated::FromPoses(FromPoses::FromPoses));
        assert_eq!(rig.load_cell.offset_n_nm, OffsetTable::Word(OffsetWord::Zero));
        assert_eq!(RigFile::parse(&rig.to_toml()).unwrap(), rig);
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        for (text, words) in [
            ("[load_cell]\nnoise_n_nm = [1,1,1,1,1,0]", "load_cell.noise_n_nm"),
            ("[load_cell]\nnoise_n_nm = [1,1,1,1,1,nan]", "load_cell.noise_n_nm"),
            ("[[imu]]\nrotation_wxyz = [0,0,0,0]", "imu[0].rotation_wxyz"),
            ("[recording]\nrate_hz = -1", "recording.rate_hz"),
            ("[load_cell]\nnoise_nnm = [1,1,1,1,1,1]", "noise_nnm"),
            ("[recording]\nrate_hz = ", "line 2"),
            ("[recording]\ncolumns = { fx_n = { name = \"F\", scale = 0 } }", "scale"),
        ] {
            let error = RigFile::parse(text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
