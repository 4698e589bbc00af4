use std::process::ExitCode;

use rigident_shared::wire::{Command, ErrorCode, Reply, SettingName, Settings, Source};
use serde_json::{Value, json};
use serialport::{SerialPortInfo, SerialPortType};

use super::Failure;
use super::arguments::{Configure, Info, Ports};
use super::experiment::{boot_notes, device_notes};
use super::outcome::say;
use crate::device::link::{Client, LinkError, SerialTransport};
use crate::device::session::two_links::{attitude_source, two_link_settings};
use crate::device::session::{DeviceTiming, Session, settings};
use crate::rig::RigFile;

/// A device's name for the answer, and the way to it.
pub(super) type NamedTransport = (&'static str, Box<dyn crate::device::link::Transport>);

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

/// Opens a port, the only one of a USB device if none is named, and says hello.
pub(super) fn open(port: Option<&str>) -> Result<Session, Failure> {
    let port = match port {
        Some(port) => port.to_owned(),
        None => only_port(&listed()?)?,
    };
    let transport = SerialTransport::open(&port).map_err(Failure::link)?;
    Session::open(Client::new(Box::new(transport))).map_err(|e| Failure::link(e).context(port))
}

fn listed() -> Result<Vec<SerialPortInfo>, Failure> {
    serialport::available_ports()
        .map_err(|e| Failure::link(format!("the serial ports cannot be listed: {e}")))
}

/// Returns the one port that a device can be meant to be on.
///
/// # Errors
/// Bad usage: there is none of a USB device, or there are several.
fn only_port(ports: &[SerialPortInfo]) -> Result<String, Failure> {
    let usb: Vec<&str> = ports
        .iter()
        .filter(|port| matches!(port.port_type, SerialPortType::UsbPort(_)))
        .map(|port| port.port_name.as_str())
        .collect();
    match usb.as_slice() {
        [one] => Ok((*one).to_owned()),
        [] => Err(Failure::input(
            "no USB serial port is here: name the device's port by --port (`rigident ports` lists all)",
        )),
        several => Err(Failure::input(format!(
            "there are several USB serial ports: name the device's by --port, one of {}",
            several.join(", ")
        ))),
    }
}

/// Sends settings and reads them back.
///
/// # Errors
/// Bad input where the device refuses one of them; the link.
pub(super) fn configured(session: &mut Session, settings: &Settings) -> Result<(), Failure> {
    session.configure(settings).map_err(|error| match error {
        LinkError::Refused { code: ErrorCode::BadSetting(SettingName::Rate | SettingName::Filter), .. } => {
            Failure::input(format!(
                "rate_hz = {} is no rate that the device takes readings at: it takes up to {MOST_RATE_HZ} a second, and as \
                 many as its filter of {} s has room for",
                settings.rate_hz, settings.filter_width_s
            ))
        }
        LinkError::Refused { code: ErrorCode::BadSetting(name), .. } => Failure::input(format!(
            "the device does not take what the rig file says of {name:?}; nothing was changed"
        )),
        other => Failure::link(other),
    })
}

/// The fastest that firmware takes readings, 1/s.
const MOST_RATE_HZ: u32 = 4000;

/// Returns what kind of port it is, in words, and what a USB device says of itself.
fn kind(port: &SerialPortInfo) -> (&'static str, Vec<(&'static str, String)>) {
    let usb = match &port.port_type {
        SerialPortType::UsbPort(usb) => usb,
        SerialPortType::PciPort => return ("pci", Vec::new()),
        SerialPortType::BluetoothPort => return ("bluetooth", Vec::new()),
        SerialPortType::Unknown => return ("unknown", Vec::new()),
    };
    let mut said = vec![("vid", format!("{:04x}", usb.vid)), ("pid", format!("{:04x}", usb.pid))];
    let words = [
        ("product", &usb.product),
        ("manufacturer", &usb.manufacturer),
        ("serial_number", &usb.serial_number),
    ];
    said.extend(words.into_iter().filter_map(|(what, word)| Some((what, word.clone()?))));
    ("usb", said)
}

/// Puts a value of JSON into words: `name: value` lines of an object, one level after the other.
fn in_words(value: &Value, name: &str, lines: &mut Vec<String>) {
    let inner = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| in_words(value, &inner(key), lines)),
        Value::Null => lines.push(format!("{name}: none")),
        Value::String(word) => lines.push(format!("{name}: {word}")),
        Value::Array(list) if list.iter().any(Value::is_object) => {
            list.iter().enumerate().for_each(|(k, value)| in_words(value, &inner(&k.to_string()), lines));
        }
        other => lines.push(format!("{name}: {other}")),
    }
}

/// `rigident ports`
pub(super) fn ports(arguments: &Ports) -> Result<ExitCode, Failure> {
    let ports = listed()?;
    if arguments.json {
        let list: Vec<_> = ports
            .iter()
            .map(|port| {
                let (kind, said) = kind(port);
                let mut object = json!({ "port": port.port_name, "kind": kind });
                said.into_iter().for_each(|(what, word)| object[what] = word.into());
                object
            })
            .collect();
        say(format_args!("{}", serde_json::Value::from(list)));
    } else if ports.is_empty() {
        say(format_args!("no serial ports; a simulated one: `rigident-sim serve`"));
    } else {
        for port in ports {
            let (kind, said) = kind(&port);
            let said: Vec<String> = said.into_iter().map(|(what, word)| format!("{what} {word}")).collect();
            say(format_args!(
                "{}  {kind}{}{}",
                port.port_name,
                if said.is_empty() { "" } else { ": " },
                said.join(", ")
            ));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// `rigident info`
pub(super) fn info(arguments: &Info) -> Result<ExitCode, Failure> {
    let mut session = open(arguments.port.as_deref())?;
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
        for (what, value) in boot_notes(&identity) {
            say(format_args!("{what}: {value}"));
        }
        let mut lines = Vec::new();
        in_words(
            &json!({ "state": identity.state, "reason": identity.reason, "kept": identity.kept }),
            "",
            &mut lines,
        );
        in_words(&serde_json::to_value(counters).unwrap_or_default(), "", &mut lines);
        say(lines.join("\n"));
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
    let mut session = open(arguments.port.as_deref())?;
    configured(&mut session, &settings)?;
    let settings = serde_json::to_value(&settings).unwrap_or_default();
    if arguments.json {
        say(&settings);
    } else {
        let mut lines = vec!["configured and read back:".to_owned()];
        in_words(&settings, "", &mut lines);
        say(lines.join("\n"));
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    fn port(name: &str, is_usb: bool) -> SerialPortInfo {
        let usb = UsbPortInfo {
            vid: 0x1209,
            pid: 0x7,
            serial_number: Some("17".to_owned()),
            manufacturer: None,
            product: Some("Rigident".to_owned()),
        };
        let port_type = if is_usb { SerialPortType::UsbPort(usb) } else { SerialPortType::Unknown };
        SerialPortInfo { port_name: name.to_owned(), port_type }
    }

    #[test]
    fn the_port_need_not_be_named_where_there_is_one_only() {
        let ports = [port("/dev/ttyS0", false), port("/dev/ttyACM0", true), port("/dev/ttyACM1", true)];
        assert_eq!(only_port(&ports[..2]).unwrap(), "/dev/ttyACM0");
        let several = only_port(&ports).unwrap_err().to_string();
        assert!(several.contains("/dev/ttyACM0, /dev/ttyACM1"), "{several}");
        assert!(only_port(&ports[..1]).is_err());
    }

    #[test]
    fn ports_and_settings_are_told_in_words() {
        let (usb, said) = kind(&port("/dev/ttyACM0", true));
        assert_eq!(usb, "usb");
        let said: Vec<(&str, &str)> = said.iter().map(|(what, word)| (*what, word.as_str())).collect();
        assert_eq!(
            said,
            [("vid", "1209"), ("pid", "0007"), ("product", "Rigident"), ("serial_number", "17")]
        );
        let mut lines = Vec::new();
        in_words(
            &json!({"imu": {"rate_hz": 1000.0, "range": null}, "reason": {"Imu": "Silent"}, "noise": [1, 2]}),
            "",
            &mut lines,
        );
        assert_eq!(lines, ["imu.range: none", "imu.rate_hz: 1000.0", "noise: [1,2]", "reason.Imu: Silent"]);
    }
}
