//! Checks of everything that a run with a device needs, and the advice where something is to be done.

mod host;
mod of_device;

use std::time::SystemTime;

use serde::Serialize;

use crate::ports::{self, Answered, Attached, Port, answers};

pub use host::UDEV_RULE;

/// The state of something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// Everything is as it should be.
    Ok,
    /// Something is to be done.
    ToDo,
    /// Something is not here, and not everybody needs it.
    NotHere,
}

/// The advice of a check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Advice {
    /// Advice to install [`UDEV_RULE`].
    InstallRule,
    /// Advice to install the emulator, which only the emulated board needs.
    InstallEmulator,
    /// Advice to build the image of the emulated board.
    BuildImage,
    /// Anything else, in words.
    Words(String),
}

impl From<String> for Advice {
    fn from(words: String) -> Self {
        Self::Words(words)
    }
}

impl From<&str> for Advice {
    fn from(words: &str) -> Self {
        Self::Words(words.to_owned())
    }
}

/// A check of something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Check {
    /// A word: `ports`, `permissions`, `udev`, `emulator`, `image`, `device`, `sensors`, `events`, `clocks`.
    pub what: &'static str,
    /// The state of it.
    pub standing: Standing,
    /// The finding.
    pub found: String,
    /// The advice, where something is to be done or could be.
    pub advice: Option<Advice>,
}

impl Check {
    fn ok(what: &'static str, found: impl Into<String>) -> Self {
        Self { what, standing: Standing::Ok, found: found.into(), advice: None }
    }

    fn to_do(what: &'static str, found: impl Into<String>, advice: impl Into<Advice>) -> Self {
        Self { what, standing: Standing::ToDo, found: found.into(), advice: Some(advice.into()) }
    }

    fn not_here(what: &'static str, found: impl Into<String>, advice: impl Into<Advice>) -> Self {
        Self { what, standing: Standing::NotHere, found: found.into(), advice: Some(advice.into()) }
    }
}

/// Checks ports, permissions, emulator, clocks and the device; one on a port that is named, or the only one.
/// `noted` hears what takes seconds.
///
/// ```no_run
/// use rigident_device::doctor::{Standing, all};
///
/// let checks = all(None, &mut |what| eprintln!("{what}"));
/// let to_do = checks.iter().filter(|check| check.standing == Standing::ToDo);
/// to_do.for_each(|check| println!("{}: {}", check.what, check.found));
/// ```
pub fn all(port: Option<&str>, noted: &mut dyn FnMut(&str)) -> Vec<Check> {
    let (mut checks, found) = asked(port);
    checks.push(host::ports_found(&found));
    checks.extend(host::permissions(&found));
    checks.extend(host::udev(&found));
    checks.push(host::emulator());
    checks.push(host::image());
    let (device, session) = of_device::device(&found);
    checks.push(device);
    checks.push(host::system_clock(SystemTime::now()));
    if let Some((port, mut session)) = session {
        checks.push(of_device::sensors(&port, &mut session));
        checks.push(of_device::last_events(&port, &mut session));
        noted(&format!("{port}: its clock is watched for {:.0} s", of_device::CLOCK_S));
        checks.push(of_device::device_clock(&port, &mut session));
    }
    checks
}

/// Asks the ports.
fn asked(port: Option<&str>) -> (Vec<Check>, Vec<Answered>) {
    let ports = match port {
        // A port that is named is taken for what it is.
        Some(port) => Ok(vec![Port { port: port.to_owned(), kind: Attached::Usb, usb: None }]),
        None => ports::listed(),
    };
    match ports {
        Ok(ports) => (Vec::new(), answers(ports, false)),
        Err(e) => {
            let advice = "is /sys there, and this no bare container?";
            (vec![Check::to_do("ports", format!("they cannot be listed: {e}"), advice)], Vec::new())
        }
    }
}
