//! Recordings as MCAP files with ROS 2 messages.
//!
//! Lives here: the container ([`container`] reads it, [`mod@write`] writes it), the messages and their
//! encoding ([`messages`], [`cdr`], [`schemas`]), recordings of our own ([`read`]) and bags recorded
//! elsewhere ([`bag`]), the folders that they come in ([`folder`]), bags of ROS 1 (`ros1`). May not live
//! here: what columns and units mean ([`super::csv`], [`super`]).
//!
//! | topic | message | content |
//! |---|---|---|
//! | `/wrench` | `geometry_msgs/msg/WrenchStamped` | wrench on the body, frame `S` |
//! | `/imu0`, `/imu1`, … | `sensor_msgs/msg/Imu` | specific force and angular rate, frame `U0` …; a half that was not measured has −1 as its first covariance, as ROS has it |
//! | `/gravity` | `geometry_msgs/msg/Vector3Stamped` | gravity vector in `S` |
//! | `/gauges` | `std_msgs/msg/Float64MultiArray` | six voltages |
//! | `/platform/pose`, `/platform/commanded_pose` | `geometry_msgs/msg/PoseStamped` | pose of the plate in `A` |
//! | `/link1/attitude`, … | `geometry_msgs/msg/QuaternionStamped` | attitude of the link relative to `S` |
//! | `/rigident/row` | `std_msgs/msg/String` | JSON: other columns, and the time where nanoseconds do not hold it |
//!
//! The rig file is the attachment `rig.toml`; comments and the order of columns are in metadata records
//! named `rigident`. All messages of a row have the same log time, to the nanosecond.

pub mod bag;
mod bzip2;
pub mod cdr;
pub mod container;
pub mod folder;
pub mod messages;
pub mod read;
mod ros1;
pub mod schemas;
mod sqlite;
mod topic;
pub mod write;

/// Name of the metadata records that mark a recording of our own.
pub const METADATA: &str = "rigident";
/// Name of the attachment that holds the rig file.
pub const RIG_ATTACHMENT: &str = "rig.toml";

/// Topic of the wrench.
pub const WRENCH_TOPIC: &str = "/wrench";
/// Topic of the gravity vector.
pub const GRAVITY_TOPIC: &str = "/gravity";
/// Topic of the gauges' voltages.
pub const GAUGES_TOPIC: &str = "/gauges";
/// Topic of the measured pose of the plate.
pub const PLATFORM_TOPIC: &str = "/platform/pose";
/// Topic of the commanded pose of the plate.
pub const COMMANDED_TOPIC: &str = "/platform/commanded_pose";
/// Topic of what no ROS message holds.
pub const ROW_TOPIC: &str = "/rigident/row";

/// Returns the topic of the IMU on link `j`.
pub fn imu_topic(j: usize) -> String {
    format!("/imu{j}")
}

/// Returns the topic of the attitude of link `j`.
pub fn attitude_topic(j: usize) -> String {
    format!("/link{j}/attitude")
}

/// Returns the number between `prefix` and `suffix` of a topic.
pub fn topic_number(topic: &str, prefix: &str, suffix: &str) -> Option<usize> {
    let digits = topic.strip_prefix(prefix)?.strip_suffix(suffix)?;
    digits.parse().ok().filter(|j: &usize| j.to_string() == digits)
}
