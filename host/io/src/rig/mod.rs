//! The rig file: what a recording was taken with.
//!
//! Lives here: its tables, one type each, keys as in the file. Reading, checking and complaining about them
//! is in `read`. May not live here: what the numbers are used for.

pub mod calibration;
pub mod certificate;
pub mod classes;
mod known_errors;
pub mod labels;
mod read;
pub mod spelling;
mod suspension;
mod suspension_check;
#[cfg(test)]
mod tests;
pub mod units;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use calibration::{CalibrationTable, RigCalibration};
pub use certificate::CertificateTable;
pub use classes::{ImuClass, LoadCellClass, TreeClass};
pub use read::{RigFileError, files_outside, is_number_of_chip};
pub use suspension::{Coordinate, SpringTable, SuspendedPlatformTable, SuspensionTable};
pub use units::{Quantity, Unit};

/// The channels of a wrench and their units, for people.
pub const WRENCH_CHANNELS: [(&str, &str); 6] =
    [("Fx", "N"), ("Fy", "N"), ("Fz", "N"), ("Mx", "N m"), ("My", "N m"), ("Mz", "N m")];

/// Equal readings in a row that make a channel frozen, unless the rig file says otherwise.
pub const FROZEN_AFTER: u16 = 50;

/// The whole file. Everything may be absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RigFile {
    /// How the recording differs from the notation.
    pub recording: RecordingTable,
    /// The IMUs, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub imu: Vec<ImuTable>,
    /// The load cell.
    pub load_cell: LoadCellTable,
    /// The rig's errors, identified by a body of known properties.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationTable>,
    /// The customer's frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyTable>,
    /// What a certificate says beside the numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<CertificateTable>,
    /// The hexapod.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub platform: Option<PlatformTable>,
    /// What is really the case; printed beside the answer, never used by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<TruthTable>,
    /// Several links, the first of them the base.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<LinkTable>,
    /// Joints with columns of their own, where these differ from the joints' names.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<JointTable>,
    /// Feet of a robot that stands, each with what it measures of the ground's wrench.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub foot: Vec<FootTable>,
    /// Joints and base of a tree of links.
    #[serde(skip_serializing_if = "TreeTable::is_empty")]
    pub tree: TreeTable,
    /// Several files, each with a clock of its own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stream: Vec<StreamTable>,
    /// The springs that carry platform and body, where no load cell does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suspension: Option<SuspensionTable>,
}

/// `[recording]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordingTable {
    /// Checked against the times, 1/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Whose sign the wrench has.
    pub wrench_sign: WrenchSign,
    /// Gravity, m/s².
    pub gravity_mps2: f64,
    /// Its direction in the axes of the base, of a base that is held still and has no IMU; of any length.
    #[serde(skip_serializing_if = "is_down")]
    pub gravity_direction: [f64; 3],
    /// Its standard deviation, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity_std_mps2: Option<f64>,
    /// Columns w, x, y, z with the attitude of S in a frame whose z is up; gravity columns follow from them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_wxyz: Option<[String; 4]>,
    /// Rows were taken at a constant rate, and stamps that jitter are the recorder's: they are made even.
    #[serde(skip_serializing_if = "is_false")]
    pub even_stamps: bool,
    /// Rows are still poses without time.
    #[serde(rename = "static")]
    pub is_static: bool,
    /// Equal readings in a row that make a channel frozen; 0: never, as of a simulation without noise.
    pub frozen_after: u16,
    /// Mark before the decimals in a file of text, where its numbers do not show it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal: Option<DecimalMark>,
    /// Foreign names of the columns.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, ColumnSource>,
    /// Topics of a bag recorded elsewhere that holds several of a kind: `wrench`, `imu`.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub topics: BTreeMap<String, String>,
    /// What tells recordings of a collection apart: `body`, `rig`, a date; factors keep them, and
    /// `rigident merge --by` goes by them.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub labels: BTreeMap<String, String>,
}

/// Gravity's direction in a base that is upright.
pub const DOWN: [f64; 3] = [0.0, 0.0, -1.0];

fn is_down(direction: &[f64; 3]) -> bool {
    *direction == DOWN
}

impl Default for RecordingTable {
    fn default() -> Self {
        Self {
            rate_hz: None,
            wrench_sign: WrenchSign::OnBody,
            gravity_mps2: 9.80665,
            gravity_direction: DOWN,
            gravity_std_mps2: None,
            attitude_wxyz: None,
            even_stamps: false,
            is_static: false,
            frozen_after: FROZEN_AFTER,
            decimal: None,
            columns: BTreeMap::new(),
            topics: BTreeMap::new(),
            labels: BTreeMap::new(),
        }
    }
}

/// Whose sign a wrench has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WrenchSign {
    /// On the body, by the sensor.
    #[default]
    OnBody,
    /// On the sensor, by the body: the reaction.
    OnSensor,
}

/// Mark before the decimals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DecimalMark {
    /// 1.5
    Point,
    /// 1,5
    Comma,
}

/// Where a column's numbers are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "must be a column's name, or { name = \"…\", scale = …, offset = … }")]
pub enum ColumnSource {
    /// Under another name.
    Name(String),
    /// Under another name and in another unit.
    Scaled(ScaledColumn),
}

/// A column in another unit, or counted from another zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScaledColumn {
    /// Its name in the file.
    pub name: String,
    /// Multiplies its numbers to give SI.
    #[serde(default = "unscaled")]
    pub scale: f64,
    /// Their unit by name, in place of `scale`: `kgf`, `deg/s`, `N mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Is added after that, SI.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub offset: f64,
    /// Other columns that are added, each with its factor to SI: of a joint whose drive turns with another's.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub plus: BTreeMap<String, f64>,
}

fn is_false(value: &bool) -> bool {
    !*value
}

fn unscaled() -> f64 {
    1.0
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl ColumnSource {
    /// Name in the file and factor to SI.
    pub fn parts(&self) -> (&str, f64) {
        match self {
            Self::Name(name) => (name, 1.0),
            Self::Scaled(column) => (&column.name, column.scale * self.unit().map_or(1.0, |unit| unit.scale)),
        }
    }

    /// Returns its unit, if it is given by name; `None` too if the name is none of a unit, which a rig file's
    /// check refuses.
    pub fn unit(&self) -> Option<Unit> {
        match self {
            Self::Name(_) => None,
            Self::Scaled(column) => Unit::parse(column.unit.as_deref()?),
        }
    }

    /// Returns what is added after that, SI.
    pub fn offset(&self) -> f64 {
        match self {
            Self::Name(_) => 0.0,
            Self::Scaled(column) => column.offset,
        }
    }

    /// Returns the other columns that are added, each with its factor to SI.
    pub fn plus(&self) -> impl Iterator<Item = (&str, f64)> {
        let columns = match self {
            Self::Name(_) => None,
            Self::Scaled(column) => Some(&column.plus),
        };
        columns.into_iter().flatten().map(|(name, factor)| (name.as_str(), *factor))
    }
}

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

/// What is known of the wrench's offset.
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
    /// What the converter's seventh input has of the gauges' excitation while it is the one of the
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
    /// How far from zero the offset of a channel may be, N and N m.
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

/// `[body]`: the customer's frame, in S.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlatformTable {
    /// Joints of the six legs on the base, in A, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_joints_m: Option<[[f64; 3]; 6]>,
    /// Joints of the six legs on the plate, in P, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_joints_m: Option<[[f64; 3]; 6]>,
    /// Shortest and longest leg, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_length_m: Option<[f64; 2]>,
    /// Largest rate of a leg, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_rate_mps: Option<f64>,
    /// Largest acceleration of a leg, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_acceleration_mps2: Option<f64>,
    /// Largest jerk of a leg, m/s³.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_jerk_mps3: Option<f64>,
    /// Largest force of a leg, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_force_n: Option<f64>,
    /// Largest force of a leg that pushes, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_push_n: Option<f64>,
    /// Largest force of a leg that pulls, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_pull_n: Option<f64>,
    /// Largest force of a leg that pushes, times its length squared, N m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_buckling_nm2: Option<f64>,
    /// Largest angle of a base joint from its axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_joint_angle_rad: Option<f64>,
    /// Axes of the base joints in A.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_joint_axes: Option<[[f64; 3]; 6]>,
    /// Largest angle of a plate joint from its axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_joint_angle_rad: Option<f64>,
    /// Axes of the plate joints in P.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_joint_axes: Option<[[f64; 3]; 6]>,
    /// Radius of a leg, m: collisions are looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_radius_m: Option<f64>,
    /// What of a leg belongs to its joint at either end, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_length_m: Option<f64>,
    /// Radius of the bars between any two of the plate's joints, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_radius_m: Option<f64>,
    /// Radius of the bars between any two of the base's joints, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_radius_m: Option<f64>,
    /// Least distance of their surfaces, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearance_m: Option<f64>,
    /// Largest condition number of the legs' Jacobian, lengths over four times the plate joints' r.m.s.
    /// radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cond_max: Option<f64>,
    /// Of a machine whose joints are not published: how far the plate goes along x, y, z to either side of
    /// its reference pose, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel_m: Option<[f64; 3]>,
    /// How far it rolls, pitches and yaws to either side, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel_rad: Option<[f64; 3]>,
    /// All of that can be used at once, not only with the other axes at zero.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub travel_together: bool,
    /// Largest speed of the plate's origin, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_speed_mps: Option<f64>,
    /// Largest angular rate of the plate, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_rate_radps: Option<f64>,
    /// The heaviest body that is ever put on the load cell, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_max_kg: Option<f64>,
    /// No part of it is farther from the load cell's origin, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_within_m: Option<f64>,
    /// What the legs carry and the load cell does not feel: plate, load cell, adapter.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub part: Vec<PartTable>,
    /// The load cell's frame S on the plate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_cell: Option<PlaceTable>,
}

/// `[[platform.part]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartTable {
    /// Its name.
    #[serde(default)]
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in P, m.
    pub com_m: [f64; 3],
    /// About the centre of mass, axes of P, kg m².
    #[serde(default)]
    pub inertia_com_kgm2: [f64; 6],
}

/// A frame on the plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaceTable {
    /// Origin, m.
    pub position_m: [f64; 3],
    /// Orientation.
    pub rotation_wxyz: [f64; 4],
}

/// `[truth]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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

/// `[[link]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkTable {
    /// Its name.
    pub name: String,
    /// Name of the link it hangs on; absent for the base.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// How it hangs there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<Joint>,
    /// Axis of a revolute, continuous or prismatic joint, in the link's frame; first axis of a universal one,
    /// x if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// Second axis of a universal joint, y if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_axis: Option<[f64; 3]>,
    /// Joint in the parent's frame, m; its origin if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Parent axes ← link axes at zero angle.
    #[serde(default = "no_rotation")]
    pub rotation_wxyz: [f64; 4],
    /// For a device that finds the joint's attitude from both links' IMUs: `R_SL` at the start of a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_wxyz: Option<[f64; 4]>,
    /// What is assumed of it beforehand: mass, kg; given with the two below or not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_mass_kg: Option<f64>,
    /// Centre of mass in the link's frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_com_m: Option<[f64; 3]>,
    /// Tensor about the centre of mass, axes of the link, Ixx, Iyy, Izz, Iyz, Izx, Ixy, kg m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_inertia_com_kgm2: Option<[f64; 6]>,
}

/// `[[joint]]`: the columns of a joint. Without it, and for keys that are left out, they are named for the
/// joint: `NAME_rad`, `NAME_radps`, `NAME_nm`, or `NAME_m`, `NAME_mps`, `NAME_n` of one that slides.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointTable {
    /// The joint's name in the model; in `[[link]]` tables that of its link.
    pub name: String,
    /// Its angle, rad, or length, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<ColumnSource>,
    /// Its rate, rad/s or m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<ColumnSource>,
    /// Torque, N m, or force, N, of its drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort: Option<ColumnSource>,
    /// 1 σ of the position per sample, rad or m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_noise: Option<f64>,
    /// 1 σ of the rate per sample, rad/s or m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_noise: Option<f64>,
    /// 1 σ of the effort per sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort_noise: Option<f64>,
    /// 1 σ of the position where the joint is at zero, rad or m; that of `[tree]` otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_std: Option<f64>,
    /// 1 σ of the effort's scale, relative; that of `[tree]` otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort_gain_std: Option<f64>,
    /// Cut-off of the low-pass of first order that the effort went through, Hz; positions did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort_lowpass_hz: Option<f64>,
}

/// `[[foot]]`: a place where the ground pushes on a link, and the sensor of that wrench: columns `NAME_fx_n`
/// … `NAME_mz_nm`, on the foot, in the sensor's axes, about its origin.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FootTable {
    /// Its name, with which its columns begin.
    pub name: String,
    /// The link that it is part of.
    pub link: String,
    /// Origin of the sensor in the link's frame, m.
    #[serde(default)]
    pub position_m: [f64; 3],
    /// Link axes ← sensor axes.
    #[serde(default = "no_rotation")]
    pub rotation_wxyz: [f64; 4],
    /// Foreign names of its columns, by component: `fz = "lf_force"`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, ColumnSource>,
    /// Components that are recorded and not to be believed: `["fx", "fy"]`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unavailable: Vec<String>,
    /// The ground touches it in a point: no moments about the sensor's origin.
    #[serde(default, skip_serializing_if = "is_false")]
    pub point: bool,
    /// It stands where the force measured is above this, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub touching_n: Option<f64>,
    /// 1 σ of fx … mz per sample, N and N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_n_nm: Option<[f64; 6]>,
    /// 1 σ of the zero of each force, N, and of each moment, N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_std_n_nm: Option<[f64; 2]>,
    /// 1 σ of the scale of each component, relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
}

/// `[tree]`: what is known of joints and base.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TreeTable {
    /// Class, from which every uncertainty below follows that is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub class: Option<TreeClass>,
    /// 1 σ of the zero of each joint that turns, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_zero_std_rad: Option<f64>,
    /// 1 σ of the zero of each joint that slides, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_zero_std_m: Option<f64>,
    /// 1 σ of the tilt of a base that is held still and has no IMU, about either horizontal axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_tilt_std_rad: Option<f64>,
    /// 1 σ of the delay of the joints' positions against wrench and efforts, s, where the base has no IMU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skew_std_s: Option<f64>,
    /// 1 σ of the scale of each effort, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort_gain_std: Option<f64>,
    /// 1 σ of the offset of each effort and of its drift over a recording, relative to the largest effort of
    /// the joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort_drift_std: Option<f64>,
}

impl TreeTable {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Joint {
    /// Does not move.
    Fixed,
    /// Turns about one axis.
    Revolute,
    /// Turns about one axis without end.
    Continuous,
    /// Slides along one axis.
    Prismatic,
    /// Turns about two axes.
    Universal,
    /// Turns about any axis.
    Spherical,
    /// Moves in any way.
    Free,
}

/// `[[stream]]`: one of several files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StreamTable {
    /// The file, beside the rig file.
    pub file: String,
    /// The topic of a bag (MCAP or .db3) whose messages are the rows; of transforms with the frame,
    /// `/tf#tool0`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Foreign names of its columns.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, ColumnSource>,
    /// Attitude as a matrix, row by row.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_matrix: Option<RotationMatrixTable>,
    /// Time of the clock that the streams have in common at the zero of this stream's, s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub clock_offset_s: f64,
    /// Seconds of that clock for a second of this stream's.
    #[serde(default = "unscaled", skip_serializing_if = "is_one")]
    pub clock_rate: f64,
}

fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// Where the elements of a rotation matrix are.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotationMatrixTable {
    /// Which frame's attitude in which, `S in A`.
    pub frame: String,
    /// Names of the nine columns, row by row.
    pub columns: [String; 9],
}

impl RotationMatrixTable {
    /// Returns whether it is `R_AS`; else it is `R_SA`.
    pub fn is_s_in_a(&self) -> bool {
        self.frame == "S in A"
    }
}

impl RigFile {
    /// The IMU on link `j`.
    pub fn imu_on(&self, j: usize) -> Option<&ImuTable> {
        self.imu.iter().find(|imu| imu.link == j)
    }

    /// The text of the file.
    pub fn to_toml(&self) -> String {
        // Tables, numbers and strings have no way to fail.
        toml::to_string(self).unwrap_or_default()
    }
}
