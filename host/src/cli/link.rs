use std::process::ExitCode;

use rigident_shared::wire::{Command, Reply, Settings, Source};
use serde_json::json;

use super::Failure;
use super::arguments::{Configure, Info, Ports};
use super::experiment::device_notes;
use super::outcome::say;
use crate::device::link::{Client, SerialTransport};
use crate::device::session::two_links::{attitude_source, two_link_settings};
use crate::device::session::{DeviceTiming, Session, settings};
use crate::rig::RigFile;

/// The device says Holding after so long without us.
pub(super) const HOST_TIMEOUT_MS: u32 = 2_000;

/// The device's settings for what a rig file describes, one body or two links, and σ where it has none.
///
/// # Errors
/// Bad input: what the rig file lacks, or more links than the device takes from sensors.
pub(super) fn device_settings(
    rig: &RigFile,
    timing: &DeviceTiming,
    noise: Option<[f64; 6]>,
) -> Result<Settings, Failure> {
    if rig.link.len() > 1 {
        return two_link_settings(rig, timing, noise, attitude_source(rig)).map_err(Failure::input);
    }
    settings(rig, timing, noise, None).map_err(Failure::input)
}

/// Opens a port and says hello.
pub(super) fn open(port: &str) -> Result<Session, Failure> {
    let transport = SerialTransport::open(port).map_err(Failure::link)?;
    Session::open(Client::new(Box::new(transport))).map_err(|e| Failure::link(e).context(port))
}

/// `rigident ports`
pub(super) fn ports(arguments: &Ports) -> Result<ExitCode, Failure> {
    let ports = serialport::available_ports()
        .map_err(|e| Failure::link(format!("the serial ports cannot be listed: {e}")))?;
    if arguments.json {
        let list: Vec<_> = ports
            .iter()
            .map(|p| json!({ "port": p.port_name, "kind": format!("{:?}", p.port_type) }))
            .collect();
        say(format_args!("{}", serde_json::Value::from(list)));
    } else if ports.is_empty() {
        say(format_args!("no serial ports; a simulated one: `rigident-sim serve`"));
    } else {
        for port in ports {
            say(format_args!("{}  {:?}", port.port_name, port.port_type));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// `rigident info`
pub(super) fn info(arguments: &Info) -> Result<ExitCode, Failure> {
    let mut session = open(&arguments.port)?;
    let identity = session.identity().clone();
    let counters = match session.client().ask("read the counters", &Command::ReadCounters) {
        Ok(Reply::Counters(counters)) => counters,
        Ok(_) => return Err(Failure::link("the device answered with something else")),
        Err(error) => return Err(Failure::link(error)),
    };
    if arguments.json {
        let mut object = serde_json::to_value(&identity).unwrap_or_default();
        for (key, value) in device_notes(&identity) {
            object[key.to_lowercase().replace([' ', ','], "_")] = value.into();
        }
        object["counters"] = serde_json::to_value(counters).unwrap_or_default();
        say(format_args!("{object}"));
    } else {
        for (what, value) in device_notes(&identity) {
            say(format_args!("{what}: {value}"));
        }
        say(format_args!("State: {:?} ({:?})", identity.state, identity.reason));
        say(format_args!("{counters:#?}"));
    }
    Ok(ExitCode::SUCCESS)
}

/// `rigident configure`
pub(super) fn configure(arguments: &Configure) -> Result<ExitCode, Failure> {
    let rig = RigFile::load(&arguments.rig).map_err(Failure::input)?;
    let timing = DeviceTiming {
        rate_hz: rig.recording.rate_hz.unwrap_or(1000.0),
        is_static: false,
        source: Source::Sensors,
        host_timeout_ms: HOST_TIMEOUT_MS,
    };
    let settings = device_settings(&rig, &timing, None)?;
    let mut session = open(&arguments.port)?;
    session.configure(&settings).map_err(Failure::link)?;
    say(format_args!("configured and read back: {settings:#?}"));
    Ok(ExitCode::SUCCESS)
}
