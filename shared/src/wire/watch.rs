//! The messages of a robot that is watched for changes of a link while it works.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most links of a robot that is watched.
pub const MAX_WATCHED_LINKS: usize = 32;
/// Most sensors of forces of a robot that is watched.
pub const MAX_WATCH_FEET: usize = 4;

/// A robot whose inertial parameters are known but for those of one link, which may change. Its links are
/// given one by one, with [`super::Command::WatchLink`], before it starts. Frames bring joints, the base's
/// IMU and the wrenches of sensors. The base link has the axes of the IMU, and its origin is the IMU's
/// place. The other settings that count: rate, filter, rows, and the load cell's noise, which is that of the
/// wrench on the whole robot about the IMU's place, and range, which is each sensor's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct WatchSettings {
    /// Links, the base included.
    pub links: u8,
    /// The link that is watched.
    pub watched: u8,
    /// Sensors of forces: under the feet, or under the base.
    pub feet: [FootSettings; MAX_WATCH_FEET],
    /// The number of them; what is behind them does not count.
    pub foot_count: u8,
    /// The least that a change must explain to be reported: χ² of ten degrees of freedom.
    pub limit: f32,
    /// Bins of two rows before any is reported.
    pub settle_bins: u16,
    /// Rows before a change are forgotten with this time constant, s; zero: never.
    pub forget_s: f32,
}

/// Places a sensor of the wrench on a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct FootSettings {
    /// The link.
    pub link: u8,
    /// Axes of the link ← axes of the sensor, Hamilton quaternion.
    pub rotation_wxyz: [f32; 4],
    /// Origin of the sensor in the link's frame, m.
    pub position_m: [f32; 3],
}

/// Describes a link of a robot that is watched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct WatchLinkSettings {
    /// Index of its parent, smaller than its own.
    pub parent: u8,
    /// The way its joint moves.
    pub joint: WatchJoint,
    /// The joint's axis in the link's frame, a unit vector.
    pub axis: [f32; 3],
    /// Axes of the parent ← axes of the link at zero, Hamilton quaternion.
    pub rotation_wxyz: [f32; 4],
    /// The joint in the parent's frame at zero, m.
    pub position_m: [f32; 3],
    /// m (kg), m c (kg m), Ixx, Iyy, Izz, Iyz, Ixz, Ixy (kg m²) about the link's origin, in its axes.
    pub parameters: [f32; 10],
}

/// Returns whether the payload of a command tells of a robot to watch. Firmware without the feature `watch`
/// does not know these commands, and asks this to say so.
pub fn asks_to_watch(payload: &[u8]) -> bool {
    // Configure, its rate, its source, and the model; WatchLink; LineRate.
    matches!(payload, [1, _, _, _, _, _, 4, ..] | [15 | 16, ..])
}

/// Tells how a joint of one freedom moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum WatchJoint {
    /// The link does not move against its parent.
    #[default]
    Fixed,
    /// The joint turns.
    Revolute,
    /// The joint slides.
    Prismatic,
}

/// Reports a change of the watched link. It is sent when it is found, and again when it has been measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ChangeReport {
    /// The change's number, from one.
    pub change: u16,
    /// Number of the frame after which it was found.
    pub found: u32,
    /// Number of the frame about which it happened.
    pub at: u32,
    /// Numbers of frames: not before the one, and not after the other.
    pub between: [u32; 2],
    /// The part that it explains against the limit.
    pub ratio: f32,
    /// The size of the change, once it has been measured.
    pub size: Option<ChangeSize>,
}

/// Holds the size of a change, in the order of a link's parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct ChangeSize {
    /// The part that is there now and was not before.
    pub change: [f32; 10],
    /// Standard deviations; infinite: rows do not tell.
    pub standard_deviation: [f32; 10],
}

/// Writes a report of nothing: a zero for each of its eight numbers, none of which takes more than a byte
/// then.
#[cfg(not(feature = "watch"))]
pub(super) fn nothing_watched<S: serde::Serializer>(
    _: &WatchReport,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    [0_u8; 8].serialize(serializer)
}

/// Tells what became of the watch so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct WatchReport {
    /// Changes found.
    pub changes: u16,
    /// A change would be reported: it has seen enough.
    pub settled: bool,
    /// The effect of errors of the known parameters on the limit, %: 100 where they are nothing beside noise.
    pub excess_percent: u32,
    /// Sensor that was last at its range.
    pub last_saturated: u8,
    /// Tells what became of frames on the link.
    pub stream: StreamReport,
}

/// Counts frames on the link by their sequence numbers, since the start of the run. One that is damaged is
/// lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct StreamReport {
    /// Frames that had not come when a later one did.
    pub lost: u32,
    /// Frames that arrived once more; the copy was left out.
    pub repeated: u32,
    /// Frames that arrived after a later one, and were left out; each has been counted as lost, too.
    pub late: u32,
    /// Frames that arrived while no robot was watched.
    pub unasked: u32,
}
