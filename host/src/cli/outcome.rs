//! What every command prints on standard output.

use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::rig::RigFile;

/// Whether anything has been printed on standard output.
static SAID: AtomicBool = AtomicBool::new(false);

/// What `--json` prints of a command that ends without an answer; an object that is out already stays the only one.
pub(super) fn say_failed(error: &str) {
    if !SAID.load(Ordering::Relaxed) {
        say(failed(error));
    }
}

/// Returns the object of a command that ends without an answer.
pub(super) fn failed(error: &str) -> serde_json::Value {
    serde_json::json!({ "status": "failed", "error": error.trim_end() })
}

/// Prints a line on standard output. A reader that has gone away is no failure: the files have it all.
pub(super) fn say(text: impl std::fmt::Display) {
    SAID.store(true, Ordering::Relaxed);
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Serial numbers and calibration dates of the rig file.
pub fn provenance(rig: &RigFile) -> Vec<(String, String)> {
    let mut notes = Vec::new();
    let mut add = |what: &str, value: &Option<String>| {
        if let Some(value) = value {
            notes.push((what.to_owned(), value.clone()));
        }
    };
    add("Load cell, serial number", &rig.load_cell.serial);
    add("Load cell, calibrated on", &rig.load_cell.calibrated_on);
    if let Some(imu) = rig.imu.first() {
        add("IMU, serial number", &imu.serial);
        add("IMU, calibrated on", &imu.calibrated_on);
    }
    notes
}
