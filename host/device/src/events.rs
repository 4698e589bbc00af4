//! The last events of a device.

use rigident_shared::wire::{Command, EventCode, EventMessage, Reply, reason_of, reset_of};

use crate::session::Session;
use crate::words::{reason, reset};

/// Asks a device for its last events; there are none if it keeps none.
///
/// # Errors
/// In words: the link fails, or it answers with something else.
pub fn ask(session: &mut Session) -> Result<Vec<EventMessage>, String> {
    match session.client().ask("read the events", &Command::ReadEvents) {
        Ok(Reply::Events(report)) => Ok(report.events.to_vec()),
        Ok(_) => Err("it answers with something else".to_owned()),
        Err(why) => Err(why.to_string()),
    }
}

/// Returns the time since the program's start, what happened, and how often.
pub fn in_words(event: &EventMessage) -> String {
    let often = match event.count {
        1 => String::new(),
        255 => ", 255 times or more".to_owned(),
        count => format!(", {count} times"),
    };
    format!("{:.3} s {}{often}", f64::from(event.time_ms) / 1000.0, name(event))
}

/// Returns what happened.
pub fn name(event: &EventMessage) -> String {
    let detail = event.detail;
    let state = |word: &str| match reason_of(detail).map(reason) {
        Some((reason, Some(fault))) => format!("{word} ({reason}: {fault})"),
        Some((reason, None)) => format!("{word} ({reason})"),
        None => format!("{word} (reason {detail})"),
    };
    match EventCode::of(event.code) {
        Some(EventCode::Started) => {
            let why = reset_of(detail).map_or_else(|| format!("reset {detail}"), |r| reset(r).to_owned());
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
