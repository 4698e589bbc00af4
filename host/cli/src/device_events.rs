//! The last events of a device in words.

use rigident::device::session::Session;
use rigident_shared::wire::{Command, EventCode, EventMessage, Reply, reason_of, reset_of};
use serde_json::{Value, json};

use super::device_words::{of_reason, of_reset};
use super::doctor_finding::Check;

const WHAT: &str = "events";
/// The newest events that `doctor` shows; `info` shows all.
const SHOWN: usize = 8;

/// Asks the device for its last events; none if it keeps none.
pub(super) fn ask(session: &mut Session) -> Result<Vec<EventMessage>, String> {
    match session.client().ask("read the events", &Command::ReadEvents) {
        Ok(Reply::Events(report)) => Ok(report.events.to_vec()),
        Ok(_) => Err("it answers with something else".to_owned()),
        Err(why) => Err(why.to_string()),
    }
}

/// Returns the events of a device, those before its last reset included.
pub(super) fn check(port: &str, session: &mut Session) -> Check {
    match ask(session) {
        Ok(events) => Check::ok(WHAT, found(port, &events)),
        Err(why) => Check::to_do(WHAT, format!("{port}: {why}"), "run it again"),
    }
}

fn found(port: &str, events: &[EventMessage]) -> String {
    if events.is_empty() {
        return format!("{port}: it keeps none");
    }
    let newest = events.iter().skip(events.len().saturating_sub(SHOWN)).map(in_words).collect::<Vec<_>>();
    format!("{port}: of {} the last: {}", events.len(), newest.join("; "))
}

/// Returns the events as `info` shows them.
pub(super) fn of_events(events: &[EventMessage]) -> Value {
    let of = |event: &EventMessage| {
        json!({
            "time_s": f64::from(event.time_ms) / 1000.0,
            "event": name(event),
            "count": event.count,
        })
    };
    events.iter().map(of).collect::<Vec<_>>().into()
}

/// Time since the program's start, what happened, and how often.
fn in_words(event: &EventMessage) -> String {
    let often = match event.count {
        1 => String::new(),
        255 => ", 255 times or more".to_owned(),
        count => format!(", {count} times"),
    };
    format!("{:.3} s {}{often}", f64::from(event.time_ms) / 1000.0, name(event))
}

fn name(event: &EventMessage) -> String {
    let detail = event.detail;
    let state = |word: &str| match reason_of(detail).map(of_reason) {
        Some((reason, Some(fault))) => format!("{word} ({reason}: {fault})"),
        Some((reason, None)) => format!("{word} ({reason})"),
        None => format!("{word} (reason {detail})"),
    };
    match EventCode::of(event.code) {
        Some(EventCode::Started) => {
            let why = reset_of(detail).map_or_else(|| format!("reset {detail}"), |r| of_reset(r).to_owned());
            format!("started ({why})")
        }
        Some(EventCode::Idle) => state("idle"),
        Some(EventCode::Configured) => state("configured"),
        Some(EventCode::Running) => state("running"),
        Some(EventCode::Holding) => state("holding"),
        Some(EventCode::Fault) => state("fault"),
        Some(EventCode::Refused) => format!("command refused (error {detail})"),
        Some(EventCode::Lost) => match ["load cell", "IMU", "second IMU"].get(usize::from(detail)) {
            Some(sensor) => format!("samples lost ({sensor})"),
            None => format!("samples lost (sensor {detail})"),
        },
        Some(EventCode::Overrun) => "bytes of the host lost".to_owned(),
        Some(EventCode::Transfers) => "transfers with sensors failed".to_owned(),
        Some(EventCode::Restart) => "restart asked for".to_owned(),
        None => format!("event {} ({detail})", event.code),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_told_in_words_and_unknown_ones_by_their_numbers() {
        let event = |time_ms, code, detail, count| EventMessage { time_ms, code, detail, count };
        let all = [
            event(0, 1, 4, 1),
            event(12, 4, 1, 1),
            event(4_250, 8, 1, 3),
            event(5_000, 6, 38, 1),
            event(5_100, 7, 3, 255),
            event(6_000, 99, 7, 1),
        ];
        assert_eq!(
            found("p", &all),
            "p: of 6 the last: 0.000 s started (watchdog); 0.012 s running (command); \
             4.250 s samples lost (IMU), 3 times; 5.000 s fault (imu: silent); \
             5.100 s command refused (error 3), 255 times or more; 6.000 s event 99 (7)"
        );
        assert_eq!(of_events(&all)[2], json!({ "time_s": 4.25, "event": "samples lost (IMU)", "count": 3 }));
        assert_eq!(found("p", &[]), "p: it keeps none");
        // The last eight of more.
        let many: Vec<_> = (0..20).map(|k| event(k, 9, 0, 1)).collect();
        assert!(found("p", &many).starts_with("p: of 20 the last: 0.012 s bytes of the host lost"));
    }
}
