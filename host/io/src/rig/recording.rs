//! Properties of a recording or of one of its files: `[recording]`, `[[stream]]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ColumnSource, FROZEN_AFTER, is_false, is_zero, unscaled};

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
    /// Direction of gravity in the axes of the base, for a base that is held still and has no IMU; of any
    /// length.
    #[serde(skip_serializing_if = "is_down")]
    pub gravity_direction: [f64; 3],
    /// Standard deviation of gravity, m/s².
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
    /// Labels that distinguish the recordings of a collection: `body`, `rig`, a date. Factors keep them, and
    /// `rigident merge --by` groups by them.
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
