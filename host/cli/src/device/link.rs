use std::io::{self, IsTerminal};

use rigident_shared::wire::{Identity, Settings};

use crate::Failure;
use crate::screen::question::answered;
use crate::screen::tell::tell;
pub(crate) use rigident::application::device::of_sensors;
use rigident::application::device::{self, configure};
use rigident::device::ports::{self, NotFound, Port};
use rigident::device::session::{DeviceTiming, INTERRUPTED, Session};
use rigident_io::rig::RigFile;

/// Opens a device's port and says hello; without a name the only device's, left out `others` that belong to
/// something else.
///
/// # Errors
/// The link: no device, or none that can be used. Bad usage: several, and nobody to ask which.
pub(crate) fn open(port: Option<&str>, others: &[String]) -> Result<(String, Session), Failure> {
    let open = |port: &str| ports::open(port).map_err(|why| Failure::link(format!("{port}: {why}")));
    if let Some(port) = port {
        return Ok((port.to_owned(), open(port)?));
    }
    match ports::find(others) {
        Ok((port, session)) => {
            tell!("the device on {} ({})", port.port, ports::board(session.identity()));
            Ok((port.port, session))
        }
        Err(NotFound::Several(found)) => {
            let port = chosen(&found)?;
            let session = open(&port)?;
            Ok((port, session))
        }
        Err(none @ NotFound::NoPort) => Err(Failure::input(none)),
        Err(other) => Err(Failure::link(other)),
    }
}

/// Asks which of several devices is meant.
fn chosen(found: &[(Port, Identity)]) -> Result<String, Failure> {
    let names: Vec<&str> = found.iter().map(|(port, _)| port.port.as_str()).collect();
    let refused = || {
        Failure::input(format!(
            "several devices are here: name the port of one by --port, one of {}",
            names.join(", ")
        ))
    };
    let input = io::stdin();
    if !input.is_terminal() || !io::stderr().is_terminal() {
        return Err(refused());
    }
    tell!("several devices are here:");
    for (k, (port, identity)) in found.iter().enumerate() {
        tell!("  {}  {}  {}", k + 1, port.port, ports::board(identity));
    }
    tell(format_args!("Which one [1-{}]? ", found.len()), "");
    let read = move || {
        let mut answer = String::new();
        input.read_line(&mut answer).map(|_| answer)
    };
    let answer = answered(read, &INTERRUPTED)?.unwrap_or_default();
    let number = answer.trim().parse::<usize>().ok().and_then(|k| k.checked_sub(1));
    number.and_then(|k| names.get(k)).map(|port| (*port).to_owned()).ok_or_else(refused)
}

/// Returns the device's settings for the content of a rig file, and σ where it has none.
///
/// # Errors
/// Bad input: what the rig file lacks, or more links than the device takes from sensors.
pub(crate) fn device_settings(
    rig: &RigFile,
    timing: &DeviceTiming,
    noise: Option<[f64; 6]>,
) -> Result<Settings, Failure> {
    Ok(device::device_settings(rig, timing, noise)?)
}

/// Sends settings and reads them back.
///
/// # Errors
/// Bad input where the device refuses one of them; the link.
pub(crate) fn configured(session: &mut Session, settings: &Settings) -> Result<(), Failure> {
    Ok(configure(session, settings)?)
}
