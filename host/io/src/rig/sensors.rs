//! `[[imu]]` and `[load_cell]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ImuClass, LoadCellClass};

/// Numbers, or calibrated on the recording's still poses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be three numbers, or \"from_poses\"")]
pub enum Calibrated {
    /// Given.
    Numbers([f64; 3]),
    /// `"from_poses"`
    FromPoses(FromPoses),
}

/// The word `from_poses`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum FromPoses {
    /// Calibrated against |g| (accelerometer) or rest (gyro).
    #[serde(rename = "from_poses")]
    FromPoses,
}

/// `[[imu]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImuTable {
    /// The link it sits on.
    pub link: usize,
    /// Origin of the IMU in the link's frame, m.
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
    /// Class of its data sheet, from which every `_std` below follows that is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub class: Option<ImuClass>,
    /// 1 σ of each coordinate of `position_m`, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_std_m: Option<f64>,
    /// 1 σ of `rotation_wxyz` about each axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_std_rad: Option<f64>,
    /// 1 σ of the delay of its stamps against the load cell's, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skew_std_s: Option<f64>,
    /// 1 σ of each accelerometer axis' bias, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_bias_std_mps2: Option<f64>,
    /// 1 σ of each accelerometer axis' scale, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_gain_std: Option<f64>,
    /// 1 σ of the angles between the accelerometer's axes, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accel_misalignment_std_rad: Option<f64>,
    /// 1 σ of each gyro axis' bias, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_bias_std_radps: Option<f64>,
    /// 1 σ of each gyro axis' scale, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_gain_std: Option<f64>,
    /// 1 σ of the gyro's axes against the IMU's, which the accelerometer's x and y span, about each of them,
    /// rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_rotation_std_rad: Option<f64>,
    /// 1 σ per sample of the attitude of its link, about any axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_noise_rad: Option<f64>,
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
            class: None,
            position_std_m: None,
            rotation_std_rad: None,
            skew_std_s: None,
            accel_bias_std_mps2: None,
            accel_gain_std: None,
            accel_misalignment_std_rad: None,
            gyro_bias_std_radps: None,
            gyro_gain_std: None,
            gyro_rotation_std_rad: None,
            attitude_noise_rad: None,
            serial: None,
            calibrated_on: None,
        }
    }
}

/// The knowledge of the wrench's offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be six numbers, \"estimate\" or \"zero\"")]
pub enum OffsetTable {
    /// Six numbers, on-body sign.
    Known([f64; 6]),
    /// A word.
    Word(OffsetWord),
}

/// Words for the offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OffsetWord {
    /// Estimated with the body.
    Estimate,
    /// There is none.
    Zero,
}

/// `[load_cell]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LoadCellTable {
    /// 1 σ per sample, N and N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_n_nm: Option<[f64; 6]>,
    /// The offset.
    pub offset_n_nm: OffsetTable,
    /// Class of its data sheet, from which every uncertainty below follows that is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub class: Option<LoadCellClass>,
    /// 1 σ, relative, constant over an experiment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_uncertainty: Option<[f64; 6]>,
    /// 1 σ of what a channel reads of another at its full scale, relative to its own full scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crosstalk_std: Option<f64>,
    /// 1 σ of the offset's drift over a recording, N and N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift_std_n_nm: Option<[f64; 6]>,
    /// `wrench = calibration · gauges`, N/V and N m/V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<[[f64; 6]; 6]>,
    /// Voltage at the converter's seventh input, a part of the gauges' excitation, at the excitation of the
    /// calibration, V: the device then divides the gauges by the excitation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excitation_v: Option<f64>,
    /// Group delay, s.
    pub group_delay_s: f64,
    /// Bandwidth, Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_hz: Option<f64>,
    /// Range, N and N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_n_nm: Option<[f64; 6]>,
    /// Largest offset of a channel to either side of zero, N and N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_within_n_nm: Option<[f64; 6]>,
    /// Number of the board that its calibration was made with, as `rigident info` shows it: 24 hexadecimal
    /// digits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub board_id: Option<String>,
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
            class: None,
            gain_uncertainty: None,
            crosstalk_std: None,
            drift_std_n_nm: None,
            calibration: None,
            excitation_v: None,
            group_delay_s: 0.0,
            bandwidth_hz: None,
            range_n_nm: None,
            offset_within_n_nm: None,
            board_id: None,
            serial: None,
            calibrated_on: None,
        }
    }
}
