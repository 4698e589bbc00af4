//! The streams of a rig file at a glance: how their clocks fit, and a curve of each to see it by.

use std::path::Path;

use rigident_identify::problem::clocks::{Stream, StreamSet, as_stamped};
use rigident_io::recording::columns::Group;
use rigident_io::recording::overview::Overview;
use serde::Serialize;

use super::Error;

/// Buckets of a curve: more than a page has pixels for.
const BUCKETS: usize = 600;

/// The streams of a rig file, and what they are together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StreamsSeen {
    /// The rig file's name.
    pub file: Option<String>,
    /// The file whose clock is the time of all.
    pub clock_of: Option<String>,
    /// Each of them.
    pub streams: Vec<StreamSeen>,
    /// Warnings of the readers and of the clocks' alignment.
    pub warnings: Vec<String>,
    /// The recording that they are together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<Overview>,
    /// Why they are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// A stream: what it carries, when, by which clock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StreamSeen {
    /// The file as listed.
    pub file: String,
    /// The quantities in the stream, in words.
    pub carries: Vec<String>,
    /// The rate of the stream, 1/s.
    pub rate_hz: f64,
    /// The number of rows.
    pub rows: usize,
    /// The first instant after the first wrench, s.
    pub from_s: f64,
    /// The last one, s.
    pub to_s: f64,
    /// The clock that was found; `None` as stamped.
    pub clock: Option<StreamClock>,
    /// A curve of the stream's motion; `None` without a quantity to draw.
    pub curve: Option<StreamCurve>,
}

/// A clock against that of the stream that has the time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StreamClock {
    /// Common time at its zero, s.
    pub offset_s: f64,
    /// Common time in one second of its own, s.
    pub rate: f64,
}

/// A curve of a stream's motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StreamCurve {
    /// The quantity.
    pub name: &'static str,
    /// The unit of the quantity.
    pub unit: &'static str,
    /// Time (s), least and greatest value of each stretch.
    pub points: Vec<[f64; 3]>,
}

/// Looks at the streams of a rig file: their clocks as [`identify`](super::identify) sets them, and what they
/// are together.
///
/// # Errors
/// [`Error`]: the rig file, or a file that it lists, cannot be read.
pub fn see_streams(rig: &Path) -> Result<StreamsSeen, Error> {
    let mut set = StreamSet::load(rig, None)?;
    let stamped: Vec<[f64; 2]> = set.streams.iter().map(ends_s).collect();
    let is_body = set.rig.link.is_empty() && set.rig.joint.is_empty();
    let settled = set.settle(is_body);
    let together = settled.and_then(|()| as_stamped(&set));
    let streams = set.streams.iter().zip(&stamped).map(|(stream, stamped)| seen(stream, *stamped)).collect();
    let (recording, error) = match together {
        Ok(recording) => (Some(recording.overview()), None),
        Err(error) => (None, Some(error.to_string())),
    };
    Ok(StreamsSeen {
        file: rig.file_name().map(|name| name.to_string_lossy().into_owned()),
        clock_of: set.streams.get(set.reference).map(|stream| stream.file.clone()),
        streams,
        warnings: set.warnings,
        recording,
        error,
    })
}

/// Returns the first and the last instant of a stream, s after the first wrench.
fn ends_s(stream: &Stream) -> [f64; 2] {
    let at = |ns: Option<&i64>| ns.map_or(0.0, |ns| *ns as f64 * 1e-9);
    [at(stream.time_ns.first()), at(stream.time_ns.last())]
}

fn seen(stream: &Stream, stamped: [f64; 2]) -> StreamSeen {
    let [from_s, to_s] = ends_s(stream);
    let length = stamped[1] - stamped[0];
    let rate = if length > 0.0 { (to_s - from_s) / length } else { 1.0 };
    let moved = [from_s, to_s] != stamped;
    StreamSeen {
        file: stream.file.clone(),
        carries: stream.carries(),
        rate_hz: stream.rate_hz,
        rows: stream.time_ns.len(),
        from_s,
        to_s,
        clock: moved.then(|| StreamClock { offset_s: from_s - rate * stamped[0], rate }),
        curve: curve(stream),
    }
}

/// Returns a curve of the motion as a stream saw it: lowest and highest values by stretches of time. The
/// length of a vector is alike whatever the axes, so that curves of force and specific force have the same
/// shape.
fn curve(stream: &Stream) -> Option<StreamCurve> {
    let (name, unit, values) = shown(stream)?;
    let [from, to] = ends_s(stream);
    let width = ((to - from) / BUCKETS as f64).max(1e-9);
    let mut buckets: Vec<[f64; 3]> = Vec::new();
    let mut last = usize::MAX;
    for (ns, value) in stream.time_ns.iter().zip(values) {
        let seconds = *ns as f64 * 1e-9;
        let number = ((seconds - from) / width) as usize;
        match buckets.last_mut() {
            Some([_, low, high]) if number == last => {
                *low = low.min(value);
                *high = high.max(value);
            }
            _ => buckets.push([seconds, value, value]),
        }
        last = number;
    }
    Some(StreamCurve { name, unit, points: buckets })
}

/// Returns the quantity that shows a stream's motion best, its unit and its values.
fn shown(stream: &Stream) -> Option<(&'static str, &'static str, Vec<f64>)> {
    let length = |columns: &[Vec<f64>]| -> Vec<f64> {
        let rows = columns.iter().map(Vec::len).min().unwrap_or(0);
        (0..rows).map(|row| columns.iter().map(|column| column[row].powi(2)).sum::<f64>().sqrt()).collect()
    };
    let find = |is: fn(Group) -> bool| stream.groups.iter().find(|(group, _)| is(*group));
    let three = |columns: &Vec<Vec<f64>>| length(columns.get(..3).unwrap_or(columns));
    if let Some((_, columns)) = find(|group| group == Group::Wrench) {
        return Some(("length of the force", "N", three(columns)));
    }
    if let Some((_, columns)) = find(|group| matches!(group, Group::Accel(_))) {
        return Some(("length of the acceleration", "m/s²", three(columns)));
    }
    if let Some((_, columns)) = find(|group| matches!(group, Group::Gyro(_))) {
        return Some(("length of the angular rate", "rad/s", three(columns)));
    }
    if let Some(attitude) = &stream.attitude {
        let first = attitude.first()?;
        return Some((
            "turn since the first row",
            "rad",
            attitude.iter().map(|q| q.angle_to(first)).collect(),
        ));
    }
    if let Some((_, columns)) = find(|group| group == Group::Gauges) {
        return Some(("length of the gauges", "V", length(columns)));
    }
    let (_, columns) = stream.groups.first()?;
    Some(("length of its first quantity", "", length(columns)))
}
