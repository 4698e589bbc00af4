//! Bags recorded elsewhere: topics found by the type of their messages, sensors on clocks and rates of their
//! own.

use std::collections::BTreeMap;

use rigident_shared::alignment::{Aligner, AlignerConfig, ImuReading};
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::container::{Contents, Message};
use super::messages::{ImuValues, Stamped, read_imu, read_numbers};
use super::read::{by_topic, imu_numbers, refuse, series};
use super::schemas;
use crate::recording::time;
use crate::recording::{ImuColumns, Recording, RecordingError};

/// The rig file's names of the topics in `[recording] topics`.
const WRENCH: &str = "wrench";
const IMU: &str = "imu";

/// Reads wrench and IMU and brings the IMU to the times of the wrench.
pub(super) fn read(
    label: &str,
    contents: &Contents<'_>,
    recording: &mut Recording,
) -> Result<(), RecordingError> {
    let topics = by_topic(contents);
    let wrench_topic = choose(label, contents, &topics, recording, WRENCH, schemas::WRENCH_STAMPED.name)?
        .ok_or_else(|| no_wrench(label, contents))?;
    let imu_topic = choose(label, contents, &topics, recording, IMU, schemas::IMU.name)?;
    let wrench = stamped(label, wrench_topic, &topics, read_numbers::<6>, |v| v.to_vec())?;
    let Some(imu_topic) = imu_topic else {
        recording.time_ns = wrench.iter().map(|(time, _)| *time).collect();
        recording.wrench = Some(wrench.into_iter().map(|(_, w)| w).collect());
        return Ok(());
    };
    let imu = stamped(label, imu_topic, &topics, read_imu, imu_numbers)?;
    let measures =
        imu.iter().fold((true, true), |(a, g), (_, v)| (a && v.accel.is_some(), g && v.gyro.is_some()));
    let readings = if wrench.iter().map(|(time, _)| time).eq(imu.iter().map(|(time, _)| time)) {
        wrench.iter().zip(&imu).map(|((time, w), (_, v))| reading(*time, w, v)).collect()
    } else {
        align(label, wrench_topic, imu_topic, &wrench, &imu, recording)?
    };
    recording.time_ns = readings.iter().map(|r| r.time_ns).collect();
    recording.wrench = Some(readings.iter().map(|r| r.wrench.array()).collect());
    recording.imus = vec![ImuColumns {
        accel: measures.0.then(|| readings.iter().map(|r| r.specific_force.array()).collect()),
        gyro: measures.1.then(|| readings.iter().map(|r| r.angular_rate.array()).collect()),
    }];
    Ok(())
}

/// Returns the topic of a kind: the one that the rig file names, or the only one.
fn choose<'t>(
    label: &str,
    contents: &Contents<'_>,
    topics: &BTreeMap<&'t str, Vec<&Message<'_>>>,
    recording: &Recording,
    key: &str,
    schema: &str,
) -> Result<Option<&'t str>, RecordingError> {
    let error = |reason: String| RecordingError::Columns { name: label.to_owned(), reason };
    let found: Vec<&'t str> = topics
        .iter()
        .filter(|(_, messages)| {
            messages
                .first()
                .and_then(|m| contents.channels.get(&m.channel))
                .is_some_and(|channel| channel.encoding == "cdr" && same_type(&channel.schema, schema))
        })
        .map(|(topic, _)| *topic)
        .collect();
    match (recording.rig.recording.topics.get(key), found.as_slice()) {
        (Some(wanted), found) => {
            found.iter().find(|topic| *topic == wanted).copied().map(Some).ok_or_else(|| {
                error(format!(
                    "the rig file names topic {wanted} for {key}, and there is no such topic with {schema}: \
                 there {}",
                    if found.is_empty() {
                        "is none of that type".to_owned()
                    } else {
                        format!("is {}", found.join(", "))
                    }
                ))
            })
        }
        (None, []) => Ok(None),
        (None, [one]) => Ok(Some(*one)),
        (None, several) => Err(error(format!(
            "topics {} all hold {schema}: name one in the rig file, [recording] topics = \
             {{ {key} = \"{}\" }}",
            several.join(", "),
            several[0]
        ))),
    }
}

/// Compares names of types: `sensor_msgs/msg/Imu` is also written `sensor_msgs/Imu`.
fn same_type(found: &str, wanted: &str) -> bool {
    found == wanted || found == wanted.replace("/msg/", "/")
}

fn no_wrench(label: &str, contents: &Contents<'_>) -> RecordingError {
    RecordingError::Columns {
        name: label.to_owned(),
        reason: format!("no topic holds {} messages; {}", schemas::WRENCH_STAMPED.name, topics_of(contents)),
    }
}

/// Tells which topics there are, each with its type and encoding.
pub(super) fn topics_of(contents: &Contents<'_>) -> String {
    let mut there: Vec<String> = contents
        .channels
        .values()
        .map(|c| {
            format!("{} ({}, {})", c.topic, c.schema, if c.encoding.is_empty() { "?" } else { &c.encoding })
        })
        .collect();
    there.sort();
    if there.is_empty() {
        "there are no topics at all".to_owned()
    } else {
        format!("there are {}", there.join(", "))
    }
}

/// Returns true if there is a topic of wrenches.
pub(super) fn has_wrench(contents: &Contents<'_>) -> bool {
    contents.channels.values().any(|c| same_type(&c.schema, schemas::WRENCH_STAMPED.name))
}

/// Decodes a topic; times are the headers' stamps, or log times where a stamp is not set. Sorted by time.
fn stamped<'c, V: Copy>(
    label: &str,
    topic: &str,
    topics: &BTreeMap<&str, Vec<&Message<'c>>>,
    decode: impl Fn(&'c [u8]) -> Result<Stamped<V>, super::cdr::CdrError>,
    numbers: impl Fn(&V) -> Vec<f64>,
) -> Result<Vec<(u64, V)>, RecordingError> {
    let messages = topics.get(topic).map(Vec::as_slice).unwrap_or_default();
    let found = series(label, topic, messages, decode, |s| numbers(&s.value))?;
    let values = found.into_iter().map(|(log_time, s)| (s.stamp_ns.unwrap_or(log_time), s.value)).collect();
    sorted_by_time(label, topic, values)
}

/// Returns values by time: messages may have been stored in another order than they were measured.
pub(super) fn sorted_by_time<V>(
    label: &str,
    topic: &str,
    values: Vec<(u64, V)>,
) -> Result<Vec<(u64, V)>, RecordingError> {
    let mut values: Vec<(usize, u64, V)> =
        values.into_iter().enumerate().map(|(n, (time, value))| (n, time, value)).collect();
    values.sort_by_key(|(_, time, _)| *time);
    if let Some(pair) = values.windows(2).find(|pair| pair[0].1 == pair[1].1) {
        return Err(refuse(
            label,
            topic,
            pair[1].0,
            format!(
                "its time {} s is also that of message {}: time must increase",
                time::text(pair[1].1),
                pair[0].0 + 1
            ),
        ));
    }
    Ok(values.into_iter().map(|(_, time, value)| (time, value)).collect())
}

fn reading(time_ns: u64, wrench: &[f64; 6], imu: &ImuValues) -> Reading<f64> {
    Reading {
        time_ns,
        wrench: Wrench::from_array(*wrench),
        specific_force: SpecificForce::from_array(imu.accel.unwrap_or_default()),
        angular_rate: AngularRate::from_array(imu.gyro.unwrap_or_default()),
    }
}

/// Aligns messages by the pipeline's own aligner, fed in the order of time; stated group delays are taken
/// off.
fn align(
    label: &str,
    wrench_topic: &str,
    imu_topic: &str,
    wrench: &[(u64, [f64; 6])],
    imu: &[(u64, ImuValues)],
    recording: &mut Recording,
) -> Result<Vec<Reading<f64>>, RecordingError> {
    let delay_ns = |seconds: f64| (seconds * 1e9).round() as u32;
    let imu_delay_s = recording.rig.imu_on(0).map_or(0.0, |i| i.group_delay_s);
    let wrench_delay_s = recording.rig.load_cell.group_delay_s;
    // The aligner counts from zero: times of the clock lose nothing, being integers.
    let origin =
        wrench.iter().chain([]).map(|(t, _)| *t).chain(imu.iter().map(|(t, _)| *t)).min().unwrap_or(0);
    let shift = u64::from(delay_ns(imu_delay_s).max(delay_ns(wrench_delay_s)));
    let local = |t: u64| t - origin + shift;
    let mut steps: Vec<u64> = imu.windows(2).map(|w| w[1].0 - w[0].0).collect();
    let middle = steps.len() / 2;
    let period = if steps.is_empty() { 0 } else { *steps.select_nth_unstable(middle).1 };
    let mut aligner = Aligner::new(AlignerConfig {
        wrench_delay_ns: delay_ns(wrench_delay_s),
        imu_delay_ns: delay_ns(imu_delay_s),
        imu_period_ns: u32::try_from(period).unwrap_or(u32::MAX),
    });
    let mut readings = Vec::with_capacity(wrench.len());
    let mut waiting = wrench.iter().peekable();
    for (time, values) in imu {
        // One at a time: the aligner's queue is that of a microcontroller.
        while let Some((t, w)) = waiting.next_if(|(t, _)| t <= time) {
            aligner.push_wrench(local(*t), Wrench::from_array(*w));
        }
        let Reading { specific_force, angular_rate, .. } = reading(0, &[0.0; 6], values);
        aligner.push_imu(&ImuReading { time_ns: local(*time), specific_force, angular_rate });
        while let Some(mut reading) = aligner.pop() {
            reading.time_ns = (reading.time_ns + origin).saturating_sub(shift);
            readings.push(reading);
        }
    }
    let lost = wrench.len() - readings.len();
    if readings.is_empty() {
        return Err(RecordingError::Columns {
            name: label.to_owned(),
            reason: format!(
                "{wrench_topic} and {imu_topic} have no time in common ({} to {} s, {} to {} s): were their \
                 clocks set alike?",
                time::text(wrench.first().map_or(0, |v| v.0)),
                time::text(wrench.last().map_or(0, |v| v.0)),
                time::text(imu.first().map_or(0, |v| v.0)),
                time::text(imu.last().map_or(0, |v| v.0)),
            ),
        });
    }
    recording.warnings.push(format!(
        "{imu_topic} has a clock of its own: interpolated (cubic) onto the times of {wrench_topic}, group \
         delays of {wrench_delay_s} s and {imu_delay_s} s taken off{}",
        if lost > 0 {
            format!("; {lost} of {} wrenches have no IMU messages around them and are left out", wrench.len())
        } else {
            String::new()
        }
    ));
    recording.comments.push(("delays_removed".to_owned(), "true".to_owned()));
    Ok(readings)
}
