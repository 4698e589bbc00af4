//! The serial ports of this machine, and which of them is a device's.
//!
//! Lives here: the list of ports and the search for the one device. May not live here: printing, and asking a
//! person.

use std::io::ErrorKind;
use std::path::Path;
use std::thread;

use rigident_shared::wire::Identity;
use serialport::{SerialPortInfo, SerialPortType};

use super::link::{Client, LinkError, PortError, SerialTransport};
use super::session::Session;

/// The path where `rigident-sim serve` puts the port of its rig, in the folder that it runs in.
pub const SIMULATED: &str = "rigident-rig";
/// A port that may be another device's is asked this often.
const ATTEMPTS: u32 = 2;

/// Holds what a USB port says of the device behind it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Usb {
    /// The vendor's number, four hexadecimal digits.
    pub vid: String,
    /// The product's number, four hexadecimal digits.
    pub pid: String,
    /// The product's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub product: Option<String>,
    /// The manufacturer's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub manufacturer: Option<String>,
    /// The device's serial number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub serial_number: Option<String>,
}

/// Tells how a port is attached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Attached {
    /// A port on USB.
    Usb,
    /// A port on the machine's own board.
    Pci,
    /// A port by Bluetooth.
    Bluetooth,
    /// The system does not say.
    Unknown,
    /// `rigident-sim serve` made it.
    Simulated,
}

/// Describes a serial port.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Port {
    /// The name that it is opened by.
    pub port: String,
    /// The way it is attached.
    pub kind: Attached,
    /// The identity of a USB port.
    #[serde(flatten)]
    pub usb: Option<Usb>,
}

impl Port {
    /// Returns true if a device of ours may be on it: other ports are asked nothing.
    pub fn may_be_a_device(&self) -> bool {
        matches!(self.kind, Attached::Usb | Attached::Simulated)
    }

    /// Opens it and says hello, giving up soon: what is on it may be another maker's.
    ///
    /// # Errors
    /// [`Unusable`] says why it is no device that this program can use.
    pub fn greet(&self) -> Result<Identity, Unusable> {
        let transport = SerialTransport::open(&self.port)?;
        Ok(Client::new(Box::new(transport)).greet(ATTEMPTS)?)
    }
}

impl From<&SerialPortInfo> for Port {
    fn from(info: &SerialPortInfo) -> Self {
        let (kind, usb) = match &info.port_type {
            SerialPortType::UsbPort(usb) => {
                let said = Usb {
                    vid: format!("{:04x}", usb.vid),
                    pid: format!("{:04x}", usb.pid),
                    product: usb.product.clone(),
                    manufacturer: usb.manufacturer.clone(),
                    serial_number: usb.serial_number.clone(),
                };
                (Attached::Usb, Some(said))
            }
            SerialPortType::PciPort => (Attached::Pci, None),
            SerialPortType::BluetoothPort => (Attached::Bluetooth, None),
            SerialPortType::Unknown => (Attached::Unknown, None),
        };
        Self { port: info.port_name.clone(), kind, usb }
    }
}

/// Says why what is on a port cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum Unusable {
    /// The port cannot be opened.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The device that answers is none of ours, or firmware built from other definitions, or nothing does.
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// Lists the ports of this machine, and that of a simulated rig if `rigident-sim serve` runs in this folder.
///
/// # Errors
/// The system does not list them.
pub fn listed() -> Result<Vec<Port>, serialport::Error> {
    let mut ports: Vec<Port> = serialport::available_ports()?.iter().map(Port::from).collect();
    ports.sort_by(|a, b| a.port.cmp(&b.port));
    if Path::new(SIMULATED).exists() {
        ports.push(Port { port: format!("./{SIMULATED}"), kind: Attached::Simulated, usb: None });
    }
    Ok(ports)
}

/// Greets ports, all at the same time. Returns, in their order, why each cannot be used or who it is.
pub fn greet_all(ports: &[Port]) -> Vec<Result<Identity, Unusable>> {
    thread::scope(|scope| {
        let asked: Vec<_> = ports.iter().map(|port| scope.spawn(|| port.greet())).collect();
        let gone = || Err(Unusable::Link(LinkError::Gone(ErrorKind::Other.into())));
        asked.into_iter().map(|answer| answer.join().unwrap_or_else(|_| gone())).collect()
    })
}

/// Says why a device is not found without the name of its port.
#[derive(Debug, thiserror::Error)]
pub enum NotFound {
    /// The system does not list the ports.
    #[error("the serial ports cannot be listed: {0}; name the device's by `port`")]
    NotListed(#[from] serialport::Error),
    /// There is no port that a device may be on.
    #[error(
        "no device is here: there is no USB serial port. Is the cable one that carries data, and the device \
         powered? A converter may need its driver (CP210x, CH34x, FTDI); in a container or virtual machine \
         the port must be passed through; on Linux `doctor()` looks at permissions and the udev rule. \
         `ports()` lists all ports; one that is not on USB is named by `port`. A simulated device: \
         `rigident-sim serve`"
    )]
    NoPort,
    /// Ports are there, and none of them answers as a device.
    #[error("none of the ports here is a device's that this program can use:\n{}\nName the device's port by \
             `port`, once it answers", lines(.0))]
    NoneAnswers(Vec<(Port, Unusable)>),
    /// Several devices answer.
    #[error("several devices are here; name the port of one by `port`:\n{}", several(.0))]
    Several(Vec<(Port, Identity)>),
    /// The only port cannot be used.
    #[error("{port}: {why}")]
    Only {
        /// The port's name.
        port: String,
        /// The reason why it cannot be used.
        why: Unusable,
    },
}

fn lines(refused: &[(Port, Unusable)]) -> String {
    let lines: Vec<String> = refused.iter().map(|(port, why)| format!("  {}: {why}", port.port)).collect();
    lines.join("\n")
}

fn several(found: &[(Port, Identity)]) -> String {
    let line = |(port, identity): &(Port, Identity)| format!("  {}: {}", port.port, board(identity));
    found.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Returns the name of a device's board, and of its firmware's version.
pub fn board(identity: &Identity) -> String {
    let [major, minor, patch] = identity.firmware_version;
    format!("{}, firmware {major}.{minor}.{patch}", board_name(identity))
}

/// Returns the name of a device's board.
pub fn board_name(identity: &Identity) -> String {
    identity.board.iter().take_while(|b| **b != 0).map(|b| char::from(*b)).collect()
}

/// Opens a port by its name and says hello.
///
/// # Errors
/// [`Unusable`] says why it is no device that this program can use.
pub fn open(port: &str) -> Result<Session, Unusable> {
    let transport = SerialTransport::open(port)?;
    Ok(Session::open(Client::new(Box::new(transport)))?)
}

/// Finds the only device among the ports, leaving out those that belong to something else, such as a
/// platform's controller.
///
/// One port is taken as it is. Of several each is asked, and the one that answers is it.
///
/// # Errors
/// [`NotFound`] lists what is here, and says what to do.
pub fn find(others: &[String]) -> Result<(Port, Session), NotFound> {
    only(listed()?.into_iter().filter(|port| !others.contains(&port.port)).collect())
}

/// Finds the only device among these ports, as [`find`] does among all.
fn only(ports: Vec<Port>) -> Result<(Port, Session), NotFound> {
    let mut ports: Vec<Port> = ports.into_iter().filter(Port::may_be_a_device).collect();
    if ports.len() > 1 {
        let (mut found, mut refused) = (Vec::new(), Vec::new());
        let answers = greet_all(&ports);
        for (port, answer) in ports.into_iter().zip(answers) {
            match answer {
                Ok(identity) => found.push((port, identity)),
                Err(why) => refused.push((port, why)),
            }
        }
        if found.len() > 1 {
            return Err(NotFound::Several(found));
        }
        if found.is_empty() {
            return Err(NotFound::NoneAnswers(refused));
        }
        ports = found.into_iter().map(|(port, _)| port).collect();
    }
    let port = ports.pop().ok_or(NotFound::NoPort)?;
    match open(&port.port) {
        Ok(session) => Ok((port, session)),
        Err(why) => Err(NotFound::Only { port: port.port, why }),
    }
}

/// A port with the answer that it gave; `None`: it was not asked.
pub type Answered = (Port, Option<Result<Identity, Unusable>>);

/// Asks those ports that may be a device's, if anybody is to be asked.
pub fn answers(ports: Vec<Port>, no_hello: bool) -> Vec<Answered> {
    let asked: Vec<Port> = ports.iter().filter(|port| port.may_be_a_device() && !no_hello).cloned().collect();
    let mut answers = asked.iter().zip(greet_all(&asked)).map(|(port, answer)| (port.port.clone(), answer));
    let mut next = answers.next();
    let mut found = Vec::new();
    for port in ports {
        let answer = match &next {
            Some((name, _)) if *name == port.port => {
                std::mem::replace(&mut next, answers.next()).map(|(_, a)| a)
            }
            _ => None,
        };
        found.push((port, answer));
    }
    found
}

/// Returns the state of a port in a word, for programs.
pub fn state(answer: Option<&Result<Identity, Unusable>>) -> &'static str {
    match answer {
        None => "not_asked",
        Some(Ok(_)) => "device",
        Some(Err(Unusable::Port(PortError::Permission(_)))) => "no_permission",
        Some(Err(Unusable::Port(PortError::Busy(_)))) => "in_use",
        Some(Err(Unusable::Port(_))) => "cannot_open",
        Some(Err(Unusable::Link(LinkError::Silent(_)))) => "no_answer",
        Some(Err(Unusable::Link(LinkError::Gone(_)))) => "gone",
        Some(Err(Unusable::Link(_))) => "other_firmware",
    }
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    fn usb(name: &str) -> SerialPortInfo {
        let usb = UsbPortInfo {
            vid: 0x1209,
            pid: 0x7,
            serial_number: Some("17".to_owned()),
            manufacturer: None,
            product: Some("Rigident".to_owned()),
        };
        SerialPortInfo { port_name: name.to_owned(), port_type: SerialPortType::UsbPort(usb) }
    }

    #[test]
    fn a_port_says_how_it_is_attached_and_a_usb_port_whose_it_is() {
        let port = Port::from(&usb("/dev/ttyACM0"));
        let said = serde_json::to_value(&port).unwrap();
        let expected = serde_json::json!({
            "port": "/dev/ttyACM0", "kind": "usb", "vid": "1209", "pid": "0007", "product": "Rigident", "serial_number": "17"
        });
        assert_eq!(said, expected);
        let own = SerialPortInfo { port_name: "/dev/ttyS0".to_owned(), port_type: SerialPortType::Unknown };
        assert!(port.may_be_a_device() && !Port::from(&own).may_be_a_device());
    }

    #[test]
    fn without_a_device_every_port_is_named_with_advice() {
        assert!(matches!(only(Vec::new()), Err(NotFound::NoPort)));
        let none = NotFound::NoPort.to_string();
        assert!(["cable", "driver", "udev", "doctor()"].iter().all(|word| none.contains(word)), "{none}");
        let ports = ["/dev/no-such-port-1", "/dev/no-such-port-2"].map(|name| Port::from(&usb(name)));
        let alone = only(ports[..1].to_vec()).err().map(|e| e.to_string()).unwrap();
        assert!(alone.contains("no port /dev/no-such-port-1"), "{alone}");
        let error = only(ports.to_vec()).err().unwrap();
        assert!(matches!(&error, NotFound::NoneAnswers(refused) if refused.len() == 2), "{error}");
        assert!(error.to_string().contains("/dev/no-such-port-2: no port"), "{error}");
    }
}
