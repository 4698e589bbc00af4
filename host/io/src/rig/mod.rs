//! The rig file: what a recording was taken with.
//!
//! Lives here: its tables, one type each, keys as in the file. Reading, checking and complaining about them
//! is in `read`. May not live here: what the numbers are used for.

pub mod arm;
pub mod calibration;
pub mod certificate;
pub mod classes;
mod columns;
mod known_errors;
pub mod labels;
mod links;
mod platform;
mod read;
mod recording;
mod sensors;
pub mod spelling;
mod suspension;
mod suspension_check;
#[cfg(test)]
mod tests;
pub mod units;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use arm::{ArmTable, OfJoints};
pub use calibration::{CalibrationTable, RigCalibration};
pub use certificate::CertificateTable;
pub use classes::{ImuClass, LoadCellClass, TreeClass};
pub use columns::{ColumnSource, ScaledColumn};
pub use links::{FootTable, Joint, JointTable, LinkTable, TreeTable};
pub use platform::{BodyTable, PartTable, PlaceTable, PlatformTable, TruthTable};
pub use read::{RigFileError, files_outside, is_number_of_chip};
pub use recording::{DOWN, DecimalMark, RecordingTable, RotationMatrixTable, StreamTable, WrenchSign};
pub use sensors::{Calibrated, FromPoses, ImuTable, LoadCellTable, OffsetTable, OffsetWord};
pub use suspension::{Coordinate, RestTable, SpringTable, SuspendedPlatformTable, SuspensionTable};
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
    /// Differences of the recording from the notation.
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
    /// Statements of a certificate beside the numbers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<CertificateTable>,
    /// The hexapod.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub platform: Option<PlatformTable>,
    /// The true values; printed beside the answer, never used by it.
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

impl RigFile {
    /// Returns the IMU on link `j`.
    pub fn imu_on(&self, j: usize) -> Option<&ImuTable> {
        self.imu.iter().find(|imu| imu.link == j)
    }

    /// Returns the text of the file.
    pub fn to_toml(&self) -> String {
        // Tables, numbers and strings have no way to fail.
        toml::to_string(self).unwrap_or_default()
    }
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
