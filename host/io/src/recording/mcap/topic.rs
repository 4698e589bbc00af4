//! One topic of a bag as columns: what bags bring that is no wrench with its IMU, and streams with clocks of
//! their own.

use std::collections::{BTreeMap, BTreeSet};

use super::bag::{sorted_by_time, topics_of};
use super::cdr::CdrError;
use super::container::{Contents, Message};
use super::messages::{
    Stamped, Transform, read_accel, read_imu, read_joint_state, read_numbers, read_pose, read_quaternion,
    read_transforms,
};
use super::read::{by_topic, refuse};
use crate::recording::columns::{Cells, Group, TIME};
use crate::recording::{RecordingError, time};

/// Numbers by the names of their columns, at a time in ns.
type Row = (u64, Vec<(String, f64)>);

/// Returns the columns of a topic, a row a message: `t_s`, and those that the type of the message has.
///
/// # Errors
/// [`RecordingError`]: there is no such topic, its type is none that is read, or a message is none or differs from the first.
pub(super) fn columns(
    label: &str,
    contents: &Contents<'_>,
    topic: &str,
) -> Result<Vec<Cells>, RecordingError> {
    let error = |reason: String| RecordingError::Columns { name: label.to_owned(), reason };
    let topics = by_topic(contents);
    let frame = topic.split_once('#').map(|(_, frame)| frame);
    let name = topic.split_once('#').map_or(topic, |(name, _)| name);
    let messages = topics
        .get(name)
        .ok_or_else(|| error(format!("there is no topic {name}; {}", topics_of(contents))))?;
    let channel = messages.first().and_then(|m| contents.channels.get(&m.channel));
    let (schema, encoding) = channel.map_or(("", ""), |c| (c.schema.as_str(), c.encoding.as_str()));
    if encoding != "cdr" {
        return Err(error(format!("topic {name} is encoded as {encoding:?}, not as ROS 2 does (cdr)")));
    }
    let rows = rows(label, name, schema, frame, messages)?;
    let rows = merged(&rows).unwrap_or(rows);
    let rows = sorted_by_time(label, name, rows)?;
    by_column(label, name, &rows)
}

/// Returns the messages' numbers, in the order of the file.
fn rows(
    label: &str,
    topic: &str,
    schema: &str,
    frame: Option<&str>,
    messages: &[&Message<'_>],
) -> Result<Vec<Row>, RecordingError> {
    let plain = schema.replace("/msg/", "/");
    let decode: &dyn Fn(&Message<'_>) -> Result<Vec<Row>, CdrError> = match plain.as_str() {
        "sensor_msgs/JointState" => &|message| one(message, read_joint_state(message.data)?, joints),
        "geometry_msgs/WrenchStamped" => {
            &|message| one(message, read_numbers::<6>(message.data)?, |v| named(Group::Wrench, &v))
        }
        "sensor_msgs/Imu" => &|message| {
            one(message, read_imu(message.data)?, |v| {
                let accel = v.accel.map(|v| named(Group::Accel(0), &v)).unwrap_or_default();
                let gyro = v.gyro.map(|v| named(Group::Gyro(0), &v)).unwrap_or_default();
                [accel, gyro].concat()
            })
        },
        "geometry_msgs/PoseStamped" => {
            &|message| one(message, read_pose(message.data)?, |v| named(Group::Platform, &v))
        }
        "geometry_msgs/AccelStamped" => &|message| one(message, read_accel(message.data)?, accelerations),
        "geometry_msgs/QuaternionStamped" => {
            &|message| one(message, read_quaternion(message.data)?, |v| named(Group::Attitude(1), &v))
        }
        "tf2_msgs/TFMessage" => &|message| {
            let transforms = read_transforms(message.data)?;
            Ok(transforms.into_iter().filter_map(|t| pose_of(message, &t, frame)).collect())
        },
        other => {
            let reason = format!(
                "topic {topic} holds {other}, which is not read: there may be JointState, WrenchStamped, \
                 Imu, PoseStamped, AccelStamped, QuaternionStamped and TFMessage"
            );
            return Err(RecordingError::Columns { name: label.to_owned(), reason });
        }
    };
    let mut rows = Vec::new();
    for (n, message) in messages.iter().enumerate() {
        rows.extend(decode(message).map_err(|e| refuse(label, topic, n, e.to_string()))?);
    }
    if rows.is_empty() {
        let reason = match frame {
            Some(frame) => format!("topic {topic} has no transform to the frame {frame}"),
            None if plain == "tf2_msgs/TFMessage" => {
                format!("topic {topic} holds transforms of many frames: name one, as {topic}#FRAME")
            }
            None => format!("topic {topic} has no messages"),
        };
        return Err(RecordingError::Columns { name: label.to_owned(), reason });
    }
    Ok(rows)
}

fn one<V>(
    message: &Message<'_>,
    stamped: Stamped<V>,
    columns: impl Fn(V) -> Vec<(String, f64)>,
) -> Result<Vec<Row>, CdrError> {
    Ok(vec![(stamped.stamp_ns.unwrap_or(message.log_time), columns(stamped.value))])
}

fn named(group: Group, values: &[f64]) -> Vec<(String, f64)> {
    group.names().into_iter().zip(values.iter().copied()).collect()
}

/// Angles, rates and torques of joints. Sliding joints have m, m/s and N: which they are only the model
/// knows, so that the rig file says it (`[[joint]] position`).
fn joints(state: super::messages::JointState) -> Vec<(String, f64)> {
    let units = [("rad", state.position), ("radps", state.velocity), ("nm", state.effort)];
    let of_unit = |(unit, values): (&str, Vec<f64>)| {
        let names = state.names.iter().map(move |joint| format!("{joint}_{unit}"));
        names.zip(values).collect::<Vec<_>>()
    };
    units.into_iter().flat_map(of_unit).collect()
}

/// Returns linear and angular accelerations as foreign columns: the notation has none for them, so the rig
/// file names their meaning.
fn accelerations(values: [f64; 6]) -> Vec<(String, f64)> {
    let names = ["linear_x", "linear_y", "linear_z", "angular_x", "angular_y", "angular_z"];
    names.iter().map(|name| (*name).to_owned()).zip(values).collect()
}

fn pose_of(message: &Message<'_>, transform: &Transform<'_>, frame: Option<&str>) -> Option<Row> {
    (Some(transform.child) == frame)
        .then(|| (transform.stamp_ns.unwrap_or(message.log_time), named(Group::Platform, &transform.pose)))
}

/// Brings the messages of several publishers on one topic, as an arm and its gripper have them, to the times
/// of the one with the most; rows that not all of them surround are left out. `None` if all have the same
/// columns, or two have one in common.
fn merged(rows: &[Row]) -> Option<Vec<Row>> {
    let mut publishers: BTreeMap<Vec<&str>, Vec<&Row>> = BTreeMap::new();
    for row in rows.iter().filter(|(_, columns)| !columns.is_empty()) {
        let names = row.1.iter().map(|(name, _)| name.as_str()).collect();
        publishers.entry(names).or_default().push(row);
    }
    let mut names = BTreeSet::new();
    if publishers.len() < 2 || !publishers.keys().flatten().all(|name| names.insert(*name)) {
        return None;
    }
    let mut all: Vec<Vec<&Row>> = publishers.into_values().collect();
    for own in &mut all {
        own.sort_by_key(|(time, _)| *time);
        if own.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return None;
        }
    }
    all.sort_by_key(|own| std::cmp::Reverse(own.len()));
    let (first, others) = all.split_first()?;
    let together = |row: &&Row| {
        let mut columns = row.1.clone();
        for other in others {
            columns.extend(at(other, row.0)?);
        }
        Some((row.0, columns))
    };
    Some(first.iter().filter_map(together).collect())
}

/// Returns the numbers of a publisher at a time: a message's own, or by the cubic through the two before and
/// the two after.
fn at(rows: &[&Row], time_ns: u64) -> Option<Vec<(String, f64)>> {
    let after = rows.partition_point(|(time, _)| *time < time_ns);
    if let Some((_, columns)) = rows.get(after).filter(|(time, _)| *time == time_ns) {
        return Some(columns.clone());
    }
    let near = rows.get(after.checked_sub(2)?..after + 2)?;
    let seconds = |time: u64| (i128::from(time) - i128::from(time_ns)) as f64 * 1e-9;
    let times: Vec<f64> = near.iter().map(|(time, _)| seconds(*time)).collect();
    let weight = |k: usize| {
        let others = times.iter().enumerate().filter(|(other, _)| *other != k);
        others.map(|(_, other)| other / (other - times[k])).product::<f64>()
    };
    let value = |column: usize| near.iter().enumerate().map(|(k, row)| weight(k) * row.1[column].1).sum();
    let names = near.first()?.1.iter().enumerate();
    Some(names.map(|(column, (name, _))| (name.clone(), value(column))).collect())
}

fn by_column(label: &str, topic: &str, rows: &[Row]) -> Result<Vec<Cells>, RecordingError> {
    let first = rows.first().map(|(_, row)| row.as_slice()).unwrap_or_default();
    let mut columns: Vec<Cells> = first.iter().map(|(name, _)| (name.clone(), Vec::new())).collect();
    let place: BTreeMap<&str, usize> =
        first.iter().enumerate().map(|(k, (name, _))| (name.as_str(), k)).collect();
    for (n, (_, row)) in rows.iter().enumerate() {
        for (name, value) in row {
            let column = place.get(name.as_str()).and_then(|k| columns.get_mut(*k));
            let (_, cells) = column.ok_or_else(|| {
                refuse(label, topic, n, format!("it has {name}, which the first one has not"))
            })?;
            cells.push(format!("{value:?}"));
        }
        if let Some((name, _)) = columns.iter().find(|(_, cells)| cells.len() != n + 1) {
            return Err(refuse(label, topic, n, format!("it has not one {name}, which the first one has")));
        }
    }
    let times = rows.iter().map(|(time_ns, _)| time::text(*time_ns)).collect();
    columns.insert(0, (TIME.to_owned(), times));
    Ok(columns)
}

/// Returns the one topic of joint states, if there is one.
pub(super) fn joint_states<'c>(contents: &'c Contents<'_>) -> Option<&'c str> {
    let is_joints = |schema: &str| schema.replace("/msg/", "/") == "sensor_msgs/JointState";
    let mut found = contents.channels.values().filter(|c| is_joints(&c.schema)).map(|c| c.topic.as_str());
    let first = found.next()?;
    found.all(|topic| topic == first).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn publishers_with_joints_of_their_own_are_brought_together() {
        let arm = |k: u64| -> Row { (10_000_000 * k, vec![("a_rad".to_owned(), 0.1 * k as f64)]) };
        let cubic = |t: f64| 1.0 - 2.0 * t + 3.0 * t * t - 4.0 * t * t * t;
        let hand = |k: u64| -> Row {
            let time = 3_000_000 + 25_000_000 * k;
            (time, vec![("h_rad".to_owned(), cubic(time as f64 * 1e-9))])
        };
        let mut rows: Vec<Row> = (0..50).map(arm).chain((0..20).map(hand)).collect();
        let found = merged(&rows).unwrap();
        // From the second of the gripper's messages to the last but one.
        let times: Vec<u64> = found.iter().map(|(time, _)| time / 10_000_000).collect();
        assert_eq!(times, (3..=45).collect::<Vec<_>>());
        for (time, columns) in &found {
            assert_eq!(columns[0].0, "a_rad");
            assert!((columns[1].1 - cubic(*time as f64 * 1e-9)).abs() < 1e-12);
        }
        // At the same times each has its own numbers.
        let same = |k: u64| -> Row { (10_000_000 * k, vec![("h_rad".to_owned(), 7.0)]) };
        let both: Vec<Row> = (0..50).map(arm).chain((0..50).map(same)).collect();
        assert_eq!(merged(&both).unwrap().len(), 50);
        // A joint in two of them is whose?
        rows[0].1.push(("h_rad".to_owned(), 0.0));
        assert_eq!(merged(&rows), None);
        assert_eq!(merged(&(0..9).map(arm).collect::<Vec<_>>()), None);
    }
}
