//! `rigident import --look` of a rig file that lists streams: how their clocks fit, and a curve of each to
//! see it by.

use std::path::Path;

use serde_json::{Value, json};

use crate::Failure;
use rigident::problem::clocks::{Stream, StreamError, StreamSet, as_stamped};
use rigident_io::recording::columns::Group;

/// Buckets of a curve: more than a page has pixels for.
const BUCKETS: usize = 600;

/// Looks at the streams of a rig file: their clocks as the program sets them, and what they are together.
///
/// # Errors
/// Bad input: the rig file, or a file that it lists, cannot be read.
pub(super) fn look(rig: &Path) -> Result<Value, Failure> {
    let mut set = StreamSet::load(rig, None).map_err(failure)?;
    let stamped: Vec<[f64; 2]> = set.streams.iter().map(ends_s).collect();
    let is_body = set.rig.link.is_empty() && set.rig.joint.is_empty();
    let settled = set.settle(is_body);
    let together = settled.and_then(|()| as_stamped(&set));
    let streams = set.streams.iter().zip(&stamped).map(|(stream, stamped)| described(stream, *stamped));
    let mut found = json!({
        "file": rig.file_name().map(|name| name.to_string_lossy()),
        "clock_of": set.streams.get(set.reference).map(|stream| &stream.file),
        "streams": streams.collect::<Vec<_>>(),
        "warnings": set.warnings,
    });
    match together {
        Ok(recording) => found["recording"] = json!(recording.overview()),
        Err(error) => found["error"] = json!(error.to_string()),
    }
    Ok(found)
}

fn failure(error: StreamError) -> Failure {
    match error {
        StreamError::File(error) => error.into(),
        StreamError::Rig(error) => error.into(),
        other => Failure::input(other),
    }
}

/// Returns the first and the last instant of a stream, s after the first wrench.
fn ends_s(stream: &Stream) -> [f64; 2] {
    let at = |ns: Option<&i64>| ns.map_or(0.0, |ns| *ns as f64 * 1e-9);
    [at(stream.time_ns.first()), at(stream.time_ns.last())]
}

/// Describes a stream: what it carries, when, by which clock, and its curve.
fn described(stream: &Stream, stamped: [f64; 2]) -> Value {
    let [from, to] = ends_s(stream);
    let length = stamped[1] - stamped[0];
    let rate = if length > 0.0 { (to - from) / length } else { 1.0 };
    let moved = [from, to] != stamped;
    let clock = moved.then(|| json!({ "offset_s": from - rate * stamped[0], "rate": rate }));
    json!({
        "file": stream.file,
        "carries": stream.carries(),
        "rate_hz": stream.rate_hz,
        "rows": stream.time_ns.len(),
        "from_s": from,
        "to_s": to,
        "clock": clock,
        "curve": curve(stream),
    })
}

/// Returns a curve of the motion as a stream saw it: lowest and highest values by stretches of time. The
/// length of a vector is alike whatever the axes, so that curves of force and specific force have the same
/// shape.
fn curve(stream: &Stream) -> Option<Value> {
    let (name, unit, values) = seen(stream)?;
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
    Some(json!({ "name": name, "unit": unit, "points": buckets }))
}

/// Returns the quantity that shows a stream's motion best, its unit and its values.
fn seen(stream: &Stream) -> Option<(&'static str, &'static str, Vec<f64>)> {
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
