use std::process::ExitCode;

use serde_json::Value;

use crate::Failure;
use crate::commands::device_arguments::Ports;
use crate::commands::info::of_identity;
use crate::screen::outcome::say;
use rigident::device::ports::{self, Answered, Attached, answers, state};

/// Runs `rigident ports`.
pub(crate) fn run(arguments: &Ports) -> Result<ExitCode, Failure> {
    let ports = ports::listed().map_err(|e| {
        Failure::link(format!("the serial ports cannot be listed: {e}; `rigident doctor` looks further"))
    })?;
    let found = answers(ports, arguments.no_hello);
    if arguments.json {
        say(Value::from(found.iter().map(as_json).collect::<Vec<_>>()));
    } else if found.is_empty() {
        say("no serial ports; a simulated one: `rigident-sim serve`. `rigident doctor` says what may be \
             missing");
    } else {
        found.iter().for_each(|port| say(in_words(port)));
    }
    Ok(ExitCode::SUCCESS)
}

fn as_json((port, answer): &Answered) -> Value {
    let mut object = serde_json::to_value(port).unwrap_or_default();
    object["answer"] = state(answer.as_ref()).into();
    match answer {
        Some(Ok(identity)) => object["device"] = of_identity(identity),
        Some(Err(why)) => object["trouble"] = why.to_string().into(),
        None => {}
    }
    object
}

fn in_words((port, answer): &Answered) -> String {
    let kind = match port.kind {
        Attached::Usb => "usb",
        Attached::Pci => "pci",
        Attached::Bluetooth => "bluetooth",
        Attached::Unknown => "unknown",
        Attached::Simulated => "simulated",
    };
    let mut words = format!("{}  {kind}", port.port);
    if let Some(usb) = &port.usb {
        words.push_str(&format!(" {}:{}", usb.vid, usb.pid));
        for said in [&usb.manufacturer, &usb.product].into_iter().flatten() {
            words.push_str(&format!(" {said}"));
        }
        if let Some(serial) = &usb.serial_number {
            words.push_str(&format!(", serial number {serial}"));
        }
    }
    match answer {
        Some(Ok(identity)) => words.push_str(&format!("\n  Rigident device: {}", ports::board(identity))),
        Some(Err(why)) => words.push_str(&format!("\n  {why}")),
        None => {}
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident::device::link::{LinkError, PortError};
    use rigident::device::ports::{Port, Unusable};

    #[test]
    fn every_port_keeps_its_own_answer_and_trouble_is_reported_by_kind() {
        let port = |name: &str, kind| Port { port: name.to_owned(), kind, usb: None };
        let ports = vec![
            port("/dev/ttyS0", Attached::Unknown),
            port("/dev/no-such-1", Attached::Usb),
            port("/dev/ttyS1", Attached::Pci),
            port("/dev/no-such-2", Attached::Simulated),
        ];
        let found = answers(ports.clone(), false);
        let of: Vec<&str> = found.iter().map(|(_, answer)| state(answer.as_ref())).collect();
        assert_eq!(of, ["not_asked", "cannot_open", "not_asked", "cannot_open"]);
        assert!(as_json(&found[3])["trouble"].as_str().unwrap().contains("/dev/no-such-2"));
        assert!(answers(ports, true).iter().all(|(_, answer)| answer.is_none()));
        let why = Unusable::Port(PortError::Permission("/dev/ttyACM0".to_owned()));
        let (said, kind) = (why.to_string(), state(Some(&Err(why))));
        assert!(kind == "no_permission" && said.contains("group") && said.contains("udev"), "{said}");
        assert_eq!(state(Some(&Err(LinkError::OtherSchema { device: 1 }.into()))), "other_firmware");
    }
}
