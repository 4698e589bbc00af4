use std::process::ExitCode;
use std::time::Duration;

use rigident_shared::screening::CHANNEL_NAMES;
use rigident_shared::wire::{
    ClockSource, Command, CounterReport, EventMessage, Identity, PROTOCOL_VERSION, Reply, SCHEMA_HASH,
};
use serde_json::{Value, json};

use crate::Failure;
use crate::commands::device_arguments::Info;
use crate::device::link::open;
use crate::screen::outcome::say;
use rigident::device::calibrated_board::number;
use rigident::device::events;
use rigident::device::link::LinkError;
use rigident::device::ports::board_name;
use rigident::device::session::Session;
use rigident::device::words;

/// A board has started after this long: its clocks, and a check of what its flash stores.
const STARTS: Duration = Duration::from_millis(500);

/// Runs `rigident info`.
pub(crate) fn run(arguments: &Info) -> Result<ExitCode, Failure> {
    let (mut port, mut session) = open(arguments.device.port.as_deref(), &[])?;
    if arguments.restart {
        restart(&mut session).map_err(|error| Failure::link(error).context(&port))?;
        drop(session);
        std::thread::sleep(STARTS);
        (port, session) = open(Some(&port), &[])?;
    }
    let identity = session.identity().clone();
    let counters = match session.client().ask("read the counters", &Command::ReadCounters) {
        Ok(Reply::Counters(counters)) => counters,
        Ok(_) => return Err(Failure::link("the device answered with something else")),
        Err(error) => return Err(Failure::link(error).context(port)),
    };
    let mut object = json!({ "port": port });
    if let (Some(object), Value::Object(of_device)) = (object.as_object_mut(), of_identity(&identity)) {
        object.extend(of_device);
    }
    object["counters"] = of_counters(&counters);
    let events = events::ask(&mut session).map_err(|why| Failure::link(why).context(&port))?;
    object["events"] = of_events(&events);
    if arguments.json {
        say(object);
    } else {
        let mut lines = Vec::new();
        in_words(&object, "", &mut lines);
        say(lines.join("\n"));
    }
    Ok(ExitCode::SUCCESS)
}

/// Has the device start anew.
fn restart(session: &mut Session) -> Result<(), LinkError> {
    session.client().ask("restart", &Command::Restart).map(drop)
}

/// Returns what a device says of itself.
pub(crate) fn of_identity(identity: &Identity) -> Value {
    let [major, minor, patch] = identity.firmware_version;
    let (reason, fault) = words::reason(identity.reason);
    json!({
        "board": board_name(identity),
        "unique_id": of_unique_id(identity.unique_id),
        "firmware": format!("{major}.{minor}.{patch}"),
        "firmware_hash": format!("{:08x}", identity.firmware_hash),
        "protocol": identity.protocol_version,
        "schema": format!("{:016x}", identity.schema_hash),
        "same_messages": identity.protocol_version == PROTOCOL_VERSION && identity.schema_hash == SCHEMA_HASH,
        "state": words::state(identity.state),
        "reason": reason,
        "fault": fault,
        "reset": words::reset(identity.reset),
        "started_by": words::started_by(identity.reset),
        "ended_at": words::bad_end(identity.ended),
        "clock": of_clock(identity.clock),
        "time_from": words::time_from(identity.clock),
    })
}

/// Returns the chip's own number in hexadecimal digits, null if it has none.
fn of_unique_id(id: [u8; 12]) -> Value {
    number(id).into()
}

/// Returns a word for what a device's time comes from.
fn of_clock(clock: ClockSource) -> &'static str {
    match clock {
        ClockSource::Simulated => "simulated",
        ClockSource::Crystal => "crystal",
        ClockSource::Internal => "internal",
        ClockSource::Slow => "slow",
        ClockSource::Emulated => "emulated",
    }
}

/// Returns the events as `info` shows them.
fn of_events(events: &[EventMessage]) -> Value {
    let of = |event: &EventMessage| {
        json!({
            "time_s": f64::from(event.time_ms) / 1000.0,
            "event": events::name(event),
            "count": event.count,
        })
    };
    events.iter().map(of).collect::<Vec<_>>().into()
}

/// Returns the counters by name; those of channels by the channel's, as far as they are not zero.
fn of_counters(counters: &CounterReport) -> Value {
    let mut object = serde_json::to_value(counters).unwrap_or_default();
    let by_channel = |names: &[&str], counts: &[u16]| {
        let counted = names.iter().zip(counts).filter(|(_, count)| **count > 0);
        Value::Object(counted.map(|(name, count)| ((*name).to_owned(), (*count).into())).collect())
    };
    object["rejected_by_channel"] = by_channel(&CHANNEL_NAMES, &counters.rejected_by_channel);
    object["knocks"] = by_channel(&CHANNEL_NAMES, &counters.knocks);
    object["last_rejection"] = match counters.last_rejection {
        0 => Value::Null,
        1 => "not_finite".into(),
        2 => "saturated".into(),
        3 => "frozen".into(),
        other => other.into(),
    };
    let channel = CHANNEL_NAMES.get(usize::from(counters.last_rejected_channel));
    object["last_rejected_channel"] =
        if counters.last_rejection == 0 { Value::Null } else { channel.copied().into() };
    let clipped = (0..8_u8).filter(|gauge| counters.clipped_gauges >> gauge & 1 == 1);
    object["clipped_gauges"] = clipped.collect::<Vec<_>>().into();
    object
}

/// Puts a value of JSON into words: `name: value` lines of an object, one level after the other.
pub(crate) fn in_words(value: &Value, name: &str, lines: &mut Vec<String>) {
    let inner = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match value {
        Value::Object(map) if map.is_empty() => lines.push(format!("{name}: none")),
        Value::Object(map) => map.iter().for_each(|(key, value)| in_words(value, &inner(key), lines)),
        Value::Array(list) if list.is_empty() => lines.push(format!("{name}: none")),
        Value::Null => lines.push(format!("{name}: none")),
        Value::String(word) => lines.push(format!("{name}: {word}")),
        Value::Array(list) if list.iter().any(Value::is_object) => {
            list.iter().enumerate().for_each(|(k, value)| in_words(value, &inner(&k.to_string()), lines));
        }
        other => lines.push(format!("{name}: {other}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_shared::wire::{Reason, SensorFault};

    #[test]
    fn counters_are_named_by_channel_and_reasons_are_words() {
        let mut counters =
            CounterReport { last_rejection: 2, last_rejected_channel: 1, ..CounterReport::default() };
        (counters.rejected_by_channel[1], counters.knocks[5], counters.clipped_gauges) = (7, 2, 0b101);
        let object = of_counters(&counters);
        assert_eq!(object["rejected_by_channel"], json!({ CHANNEL_NAMES[1]: 7 }));
        assert_eq!(object["knocks"], json!({ CHANNEL_NAMES[5]: 2 }));
        assert_eq!(
            (&object["last_rejection"], &object["clipped_gauges"]),
            (&json!("saturated"), &json!([0, 2]))
        );
        assert_eq!(words::reason(Reason::Imu(SensorFault::Silent)), ("imu", Some("silent")));
    }

    #[test]
    fn events_have_their_time_and_how_often_they_happened() {
        let event = EventMessage { time_ms: 4_250, code: 8, detail: 1, count: 3 };
        let shown = json!([{ "time_s": 4.25, "event": "samples lost (IMU)", "count": 3 }]);
        assert_eq!(of_events(&[event]), shown);
    }

    #[test]
    fn nested_values_become_lines() {
        let mut lines = Vec::new();
        let value = json!({"imu": {"rate_hz": 1000.0, "range": null}, "empty": {}, "noise": [1, 2]});
        in_words(&value, "", &mut lines);
        assert_eq!(lines, ["empty: none", "imu.range: none", "imu.rate_hz: 1000.0", "noise: [1,2]"]);
    }
}
