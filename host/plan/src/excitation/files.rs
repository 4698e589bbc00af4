//! Trajectories as files: CSV with the columns that `identify` reads, and
//! `trajectory_msgs/msg/JointTrajectory` of ROS 2 as YAML.

use std::fmt::Write as _;

use super::family::Series;
use rigident_files::csv::field;
use rigident_model::Model;
use rigident_rows::tree::columns::units;

/// A joint of a file: its name, its kind by the units of its columns, and its place in the series, or where
/// it is held.
#[derive(Clone, Debug, PartialEq)]
pub struct FileJoint {
    /// The joint's name.
    pub name: String,
    /// The units at the end of its columns of position and rate.
    pub units: [&'static str; 2],
    /// The joint's place in the series.
    pub moves: Option<usize>,
    /// The position where it is held, rad or m; not used of one that moves.
    pub held: f64,
    /// True if it is in the message for the controller, which refuses joints that are none of its own.
    pub is_commanded: bool,
}

/// Returns the joints of a model in its order: those that move in the series by their names, the others held
/// at zero or where `held` says. Only those that move and the `commanded` ones are in the message for a
/// controller.
pub fn joints(
    model: &Model,
    moving: &[String],
    held: &[(String, f64)],
    commanded: &[String],
) -> Vec<FileJoint> {
    let links = model.links.iter().skip(1);
    let own = links.filter_map(|link| {
        let [position, rate, _] = units(&link.link.joint)?;
        let name = link.joint_name.clone();
        let at = held.iter().find(|(own, _)| *own == name).map_or(0.0, |(_, at)| *at);
        Some(FileJoint {
            units: [position, rate],
            moves: moving.iter().position(|own| *own == name),
            held: at,
            is_commanded: [moving, commanded].iter().any(|names| names.contains(&name)),
            name,
        })
    });
    own.collect()
}

/// Returns `t_s, JOINT_rad, JOINT_radps, …` at a rate, 1/s, of a sliding joint `JOINT_m, JOINT_mps`.
pub fn csv(series: &Series, joints: &[FileJoint], rate_hz: f64) -> String {
    let mut text = "t_s".to_owned();
    for joint in joints {
        let ([position, rate], name) = (joint.units, &joint.name);
        let column = |unit: &str| field(&format!("{name}_{unit}"));
        let _ = write!(text, ",{},{}", column(position), column(rate));
    }
    text.push('\n');
    for t in times(series, rate_hz) {
        let motion = series.at(t);
        let _ = write!(text, "{t:.9}");
        for joint in joints {
            let (q, v) = joint.moves.map_or((joint.held, 0.0), |k| (motion.positions[k], motion.rates[k]));
            let _ = write!(text, ",{:.9},{:.9}", positive_zero(q), positive_zero(v));
        }
        text.push('\n');
    }
    text
}

/// Returns a message for `ros2 topic pub` in YAML of the joints that are commanded, with points at a rate,
/// 1/s, and the last one at the end. Its stamp of zero means at once.
pub fn joint_trajectory(series: &Series, joints: &[FileJoint], rate_hz: f64) -> String {
    let mut text = "header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: \"\"\njoint_names:\n".to_owned();
    let joints = || joints.iter().filter(|joint| joint.is_commanded);
    for joint in joints() {
        // A string of JSON is one of YAML.
        let _ = writeln!(text, "- {}", serde_json::Value::from(joint.name.as_str()));
    }
    text.push_str("points:\n");
    for t in times(series, rate_hz) {
        let motion = series.at(t);
        let list = |of: &dyn Fn(usize) -> f64, held: &dyn Fn(&FileJoint) -> f64| {
            let own = joints().map(|joint| joint.moves.map_or_else(|| held(joint), of));
            own.map(|v| format!("{:.6}", positive_zero(v))).collect::<Vec<_>>().join(", ")
        };
        let nanoseconds = (t * 1e9).round() as u64;
        let _ = write!(
            text,
            "- positions: [{}]\n  velocities: [{}]\n  accelerations: [{}]\n  effort: []\n  time_from_start: \
             {{sec: {}, nanosec: {}}}\n",
            list(&|k| motion.positions[k], &|joint| joint.held),
            list(&|k| motion.rates[k], &|_| 0.0),
            list(&|k| motion.accelerations[k], &|_| 0.0),
            nanoseconds / 1_000_000_000,
            nanoseconds % 1_000_000_000,
        );
    }
    text
}

/// Returns the times of samples at a rate, and the end.
fn times(series: &Series, rate_hz: f64) -> Vec<f64> {
    let whole = (series.duration_s * rate_hz * (1.0 - 1e-12)).ceil() as usize;
    (0..whole).map(|k| k as f64 / rate_hz).chain([series.duration_s]).collect()
}

/// Returns zero for what is written as minus zero.
fn positive_zero(value: f64) -> f64 {
    if value.abs() < 5e-10 { 0.0 } else { value }
}
