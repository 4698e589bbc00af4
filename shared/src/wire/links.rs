//! The messages of models of several links: what the device is given of them, their readings, frames and
//! factor.
//!
//! Frames and signs as in [`super::messages`], which says when these travel.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::messages::{ImuSettings, ReadingMessage};
use super::watch::WatchSettings;

/// Most links of a tree from frames.
pub const MAX_LINKS: usize = 16;
/// Most base parameters of a tree from frames.
pub const MAX_TREE_PARAMETERS: usize = 128;
/// Most parameters of a model whose device reckons with noise of the signals: a body's and the wrench offset.
pub const MAX_NOISY_PARAMETERS: usize = 16;
/// Readings of two links per batch, either way.
pub const LINK_BATCH: usize = 8;

/// Tells what is identified.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
pub enum ModelSettings {
    /// One body, ten parameters, or sixteen with the offset.
    #[default]
    Body,
    /// Two links that a spherical joint holds together: 19 parameters, or 25 with the offset.
    TwoLinks(TwoLinkSettings),
    /// A tree of links from frames that are streamed to the device: up to 128 parameters, the offset known.
    /// The first link is the base. If its joint is [`LinkJoint::Free`], cameras track it: its frames bring
    /// positions and rates alone, and the rows' filter is the device's ([`super::Settings::filter_width_s`],
    /// [`super::Settings::row_every`]).
    Tree(Vec<LinkSettings, MAX_LINKS>),
    /// A tree of at most [`crate::estimator::frames::SUSPENDED_LINKS`] links from frames, on a platform that
    /// springs carry and that is tracked: the springs are the load cell. Parameters are the base's, then what
    /// springs carry at rest, of every free coordinate.
    Suspended(Vec<LinkSettings, MAX_LINKS>, SuspensionSettings),
    /// A robot that is watched for changes of a link, from frames.
    #[cfg_attr(not(feature = "watch"), serde(skip))]
    Watch(WatchSettings),
}

/// The springs under a platform, about its point O and in its axes at rest, z up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SuspensionSettings {
    /// Stiffness from the first row's diagonal on, then the second's: forces (N) and moments (N m) against
    /// shifts (m) and turns (rad).
    pub stiffness: [f32; 21],
    /// Origin of the base link against O, axes of the platform, m.
    pub base_position_m: [f32; 3],
    /// Axes of the platform ← base link, Hamilton quaternion.
    pub base_rotation_wxyz: [f32; 4],
    /// Height of the anchors above O, m.
    pub anchor_height_m: f32,
    /// Bit k: coordinate k of x, y, z, roll, pitch and yaw is locked.
    pub locked: u8,
}

impl SuspensionSettings {
    /// Returns where the elements of the stiffness are in a matrix.
    pub fn places() -> impl Iterator<Item = (usize, usize)> {
        (0..6).flat_map(|i| (i..6).map(move |j| (i, j)))
    }
}

/// The second link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct TwoLinkSettings {
    /// The second link's IMU in the link's frame, whose origin is the joint.
    pub imu: ImuSettings,
    /// The joint in S, m.
    pub joint_position_m: [f32; 3],
    /// Tells where the joint's attitude comes from.
    pub attitude: AttitudeSource,
}

/// Tells where a joint's attitude comes from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum AttitudeSource {
    /// The attitude comes with every reading that is injected.
    Streamed,
    /// The attitude is found from both IMUs.
    FromImus {
        /// `R_SL` at the start of the run, Hamilton quaternion.
        initial_wxyz: [f32; 4],
        /// Time constant of the correction by the accelerometers, s; zero: none.
        time_constant_s: f32,
    },
}

/// A link of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct LinkSettings {
    /// Index of its parent, smaller than its own.
    pub parent: u8,
    /// The joint above it.
    pub joint: LinkJoint,
    /// The joint in the parent's frame, m.
    pub position_m: [f32; 3],
}

/// Tells how a link of a tree turns against its parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum LinkJoint {
    /// The link does not move against its parent.
    Fixed,
    /// About an axis of its own: 0 x, 1 y, 2 z.
    Revolute(u8),
    /// The link turns in any way, or about two axes.
    Spherical,
    /// Moves freely: the first link alone, of which frames tell position and rates.
    Free,
}

/// One reading of two links on the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct LinkReadingMessage {
    /// Load cell and the base's IMU.
    pub base: ReadingMessage,
    /// Specific force, second IMU's axes, uncorrected, m/s².
    pub specific_force: [f32; 3],
    /// Angular rate, second IMU's axes, uncorrected, rad/s.
    pub angular_rate: [f32; 3],
    /// The second link's attitude `R_SL`, w, x, y, z: from the device the one it has used.
    pub attitude_wxyz: [f32; 4],
}

/// Readings of a recording of two links, in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct LinkBatch {
    /// Index of the first one, counted from the start of the run.
    pub first_index: u32,
    /// The readings.
    pub readings: Vec<LinkReadingMessage, LINK_BATCH>,
}

/// Holds what became of frames. Of those that were left out nothing was absorbed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct FrameReport {
    /// Frames that arrived whole.
    pub frames: u32,
    /// Frames that were absorbed.
    pub absorbed: u32,
    /// Frames that did not come: numbers of their series that are missing.
    pub missing: u32,
    /// Frames that were damaged on the way, or could not be fetched.
    pub damaged: u32,
    /// Frames of a tree with another number of links.
    pub wrong_links: u32,
    /// Frames with a number that is NaN or infinite.
    pub not_finite: u32,
    /// Frames with an attitude that is no rotation.
    pub no_attitude: u32,
    /// Frames with a wrench at its range.
    pub saturated: u32,
    /// The number whose motion repeats itself while the wrench changes.
    pub without_motion: u32,
    /// Frames that came after the level was full.
    pub full: u32,
    /// The link that the last rejected frame was rejected for, or the links that it had.
    pub last_link: u8,
}

/// A row of a factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct FactorRow {
    /// The row.
    pub row: u8,
    /// Parameters.
    pub parameters: u8,
    /// The row from the diagonal on, then the right-hand side.
    pub entries: Vec<f32, { MAX_TREE_PARAMETERS + 1 }>,
    /// The row, from the diagonal on, of the part of `RᵀR` that noise of the signals has added, in the same
    /// units; empty if there is none. It is taken off where the factor is solved.
    pub gram: Vec<f32, MAX_NOISY_PARAMETERS>,
    /// Sum of squares that no parameters explain, with row 0. Of a tree: of all rows since it was last taken.
    pub residual_sum_of_squares: f32,
    /// Number of the rows of that sum, with row 0.
    pub rows: u32,
}
