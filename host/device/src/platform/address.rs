//! The address of a platform and its protocol.

use std::fmt::Display;
use std::io::{self, Read, Write};
use std::net::UdpSocket;
use std::sync::Arc;
use std::time::Duration;

use hexapod::Geometry;

use super::clock::{Clock, World};
use super::gcs::GcsPlatform;
use super::pace::{Follows, Timing};
use super::stream::{Lines, StreamPlatform};
use super::ur::{self, UrPlatform};
use super::{NetworkPlatform, PATIENCE, Platform, PlatformError, tcp};

/// Set points per second where the address does not say.
const RATE_HZ: f64 = 100.0;
/// Rates that make sense, 1/s.
const RATES_HZ: std::ops::RangeInclusive<f64> = 10.0..=500.0;
/// The time before their own at which they are sent where the address does not say, s.
const LEAD_S: f64 = 0.2;
/// Leads that make sense, s.
const LEADS_S: std::ops::RangeInclusive<f64> = 0.02..=2.0;
/// Baud where the address does not say.
const BAUD: u32 = 115_200;

/// A line to a controller, either way.
pub trait Wire: Read + Write + Send {}
impl<T: Read + Write + Send> Wire for T {}

/// Datagrams, one a write.
struct Datagrams(UdpSocket);

impl Read for Datagrams {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.recv(buffer)
    }
}

impl Write for Datagrams {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.send(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// An address taken apart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Address {
    /// The address as it was given.
    pub text: String,
    scheme: String,
    place: String,
    /// The time at which set points are sent.
    pub timing: Timing,
    baud: u32,
    /// The port to which an arm's controller takes programs.
    script_port: u16,
}

impl Address {
    pub(super) fn parse(text: &str) -> Result<Self, PlatformError> {
        let wrong = |reason: String| PlatformError::Address { address: text.to_owned(), reason };
        let (scheme, rest) =
            text.split_once("://").ok_or_else(|| wrong("there is no :// in it".to_owned()))?;
        let (place, settings) = rest.split_once('?').unwrap_or((rest, ""));
        // A PI controller takes a point every interval of its own.
        let follows = if scheme == "gcs" { Follows::Time } else { Follows::Unknown };
        let mut address = Self {
            text: text.to_owned(),
            scheme: scheme.to_owned(),
            place: place.to_owned(),
            timing: Timing { rate_hz: RATE_HZ, lead_s: LEAD_S, follows },
            baud: BAUD,
            script_port: ur::SCRIPT_PORT,
        };
        if place.is_empty() {
            return Err(wrong("nothing follows ://".to_owned()));
        }
        for setting in settings.split('&').filter(|s| !s.is_empty()) {
            let bad = |e: &dyn Display| wrong(format!("{setting}: {e}"));
            match setting.split_once('=') {
                Some(("script", value)) if address.scheme == "ur" => {
                    address.script_port = value.parse().map_err(|e| bad(&e))?;
                }
                _ if address.scheme == "ur" => {
                    return Err(bad(&"there is script, the port that takes programs"));
                }
                Some(("rate_hz", value)) => address.timing.rate_hz = value.parse().map_err(|e| bad(&e))?,
                Some(("lead_s", value)) => address.timing.lead_s = value.parse().map_err(|e| bad(&e))?,
                Some(("baud", value)) => address.baud = value.parse().map_err(|e| bad(&e))?,
                Some(("follows", "time")) => address.timing.follows = Follows::Time,
                Some(("follows", "arrival")) if address.scheme.contains('+') => {
                    address.timing.follows = Follows::Arrival;
                }
                Some(("follows", _)) => {
                    return Err(bad(
                        &"lines of set points (pose+…, legs+…) are followed by time or by arrival",
                    ));
                }
                _ => return Err(bad(&"there are rate_hz, lead_s, follows and baud")),
            }
        }
        if !RATES_HZ.contains(&address.timing.rate_hz) {
            return Err(wrong(format!("rate_hz goes from {} to {}", RATES_HZ.start(), RATES_HZ.end())));
        }
        if !LEADS_S.contains(&address.timing.lead_s) {
            return Err(wrong(format!("lead_s goes from {} to {}", LEADS_S.start(), LEADS_S.end())));
        }
        Ok(address)
    }

    fn unreachable(&self, reason: impl Display) -> PlatformError {
        PlatformError::Unreachable { address: self.text.clone(), reason: reason.to_string() }
    }

    fn tcp(&self) -> Result<Box<dyn Wire>, PlatformError> {
        let stream = tcp(&*self.place, PATIENCE).map_err(|e| self.unreachable(e))?;
        stream
            .set_read_timeout(Some(Duration::from_millis(20)))
            .and_then(|()| stream.set_write_timeout(Some(PATIENCE)))
            .and_then(|()| stream.set_nodelay(true))
            .map_err(|e| self.unreachable(e))?;
        Ok(Box::new(stream))
    }

    /// Returns the host and the port of an address that may leave out its port.
    fn host_and_port(&self, port: u16) -> Result<(String, u16), PlatformError> {
        // An address of IPv6 has colons of its own, and brackets.
        match self.place.rsplit_once(':').filter(|(host, _)| !host.contains(':') || host.ends_with(']')) {
            None => Ok((self.place.clone(), port)),
            Some((host, port)) => match port.parse() {
                Ok(port) => Ok((host.trim_matches(['[', ']']).to_owned(), port)),
                Err(e) => {
                    let reason = format!("port {port}: {e}");
                    Err(PlatformError::Address { address: self.text.clone(), reason })
                }
            },
        }
    }

    fn udp(&self) -> Result<Box<dyn Wire>, PlatformError> {
        let socket = UdpSocket::bind("0.0.0.0:0").map_err(|e| self.unreachable(e))?;
        socket.connect(self.place.as_str()).map_err(|e| self.unreachable(e))?;
        Ok(Box::new(Datagrams(socket)))
    }

    fn serial(&self) -> Result<Box<dyn Wire>, PlatformError> {
        let port = serialport::new(&self.place, self.baud).timeout(Duration::from_millis(20)).open();
        port.map(|port| Box::new(port) as Box<dyn Wire>).map_err(|e| self.unreachable(e))
    }
}

/// Returns the names of the serial port that an address is of, as it is given and as the system lists it;
/// none if it is of another kind.
pub fn port_of(address: &str) -> Vec<String> {
    let place = Address::parse(address).map(|address| address.place).unwrap_or_default();
    let is_port = place.starts_with('/') || place.starts_with("COM");
    let listed = std::fs::canonicalize(&place).ok().map(|path| path.display().to_string());
    [Some(place), listed].into_iter().flatten().filter(|_| is_port).collect()
}

/// Returns whether what is at an address holds programs against its own limits, so that the host need not
/// know them.
pub fn checks_itself(address: &str) -> bool {
    address.starts_with("tcp://")
}

/// Connects to the platform at an address; nothing moves. `geometry` says where the plate is at home, and the
/// legs' lengths.
///
/// # Errors
/// The address is not one, or nobody is there; a driver that needs the joints of a machine of which they are
/// not known.
pub fn connect(address: &str, geometry: &Geometry) -> Result<Box<dyn Platform>, PlatformError> {
    let parsed = Address::parse(address)?;
    if !geometry.has_joints() && (parsed.scheme == "tcp" || parsed.scheme.starts_with("legs+")) {
        return Err(PlatformError::Refused(format!(
            "{}:// depends on where the joints are, and the rig file gives travel_m in their place: gcs:// \
             and pose+…:// count from the reference pose",
            parsed.scheme
        )));
    }
    if geometry.arm.is_some() && parsed.scheme != "ur" {
        return Err(PlatformError::Refused(format!(
            "{}:// drives hexapods, and the rig file describes an arm ([platform.arm]): ur://HOST drives it",
            parsed.scheme
        )));
    }
    let streamed = |lines, wire| {
        let clock = Clock::of_this_machine();
        Box::new(StreamPlatform::new(&parsed, lines, wire, geometry.clone(), clock)) as Box<dyn Platform>
    };
    let gcs = |wire| GcsPlatform::connect(&parsed, wire, geometry, Clock::of_this_machine());
    match parsed.scheme.as_str() {
        "tcp" => Ok(Box::new(NetworkPlatform::connect(address, geometry)?)),
        "ur" => {
            let (host, port) = parsed.host_and_port(ur::RTDE_PORT)?;
            let ports = [port, parsed.script_port];
            Ok(Box::new(UrPlatform::connect(address, &host, ports, geometry, Clock::of_this_machine())?))
        }
        "gcs" if parsed.place.starts_with('/') => Ok(Box::new(gcs(parsed.serial()?)?)),
        "gcs" => Ok(Box::new(gcs(parsed.tcp()?)?)),
        "pose+tcp" => Ok(streamed(Lines::Poses, parsed.tcp()?)),
        "pose+udp" => Ok(streamed(Lines::Poses, parsed.udp()?)),
        "pose+serial" => Ok(streamed(Lines::Poses, parsed.serial()?)),
        "legs+tcp" => Ok(streamed(Lines::Legs, parsed.tcp()?)),
        "legs+udp" => Ok(streamed(Lines::Legs, parsed.udp()?)),
        "legs+serial" => Ok(streamed(Lines::Legs, parsed.serial()?)),
        other => Err(PlatformError::Address {
            address: address.to_owned(),
            reason: format!("nothing is known of {other}://"),
        }),
    }
}

/// Connects to a platform of a simulated world, over a wire of that world; nothing moves. Its scheme is
/// `gcs`, `pose+tcp` or `legs+tcp`.
///
/// # Errors
/// See [`connect`].
pub fn connect_simulated(
    address: &str,
    geometry: &Geometry,
    wire: Box<dyn Wire>,
    world: Arc<dyn World>,
) -> Result<Box<dyn Platform>, PlatformError> {
    let parsed = Address::parse(address)?;
    let clock = Clock::Simulated(world);
    let lines = if parsed.scheme.starts_with("legs+") { Lines::Legs } else { Lines::Poses };
    if parsed.scheme == "gcs" {
        return Ok(Box::new(GcsPlatform::connect(&parsed, wire, geometry, clock)?));
    }
    Ok(Box::new(StreamPlatform::new(&parsed, lines, wire, geometry.clone(), clock)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_that_need_joints_are_refused_for_a_machine_without() {
        let travel = hexapod::Travel {
            shift_m: [0.1; 3],
            turn_rad: [0.3; 3],
            together: false,
            speed_mps: None,
            rate_radps: None,
        };
        let geometry = Geometry::of_travel(travel);
        for address in ["tcp://127.0.0.1:1", "legs+udp://127.0.0.1:1", "legs+tcp://127.0.0.1:1"] {
            let error = connect(address, &geometry).err().unwrap().to_string();
            assert!(error.contains("joints") && error.contains("reference pose"), "{error}");
        }
        connect("pose+udp://127.0.0.1:1", &geometry).unwrap();
    }

    #[test]
    fn an_address_says_how_where_and_how_fast() {
        let address = Address::parse("gcs:///dev/ttyUSB0?rate_hz=50&lead_s=0.5&baud=57600").unwrap();
        assert_eq!((address.scheme.as_str(), address.place.as_str()), ("gcs", "/dev/ttyUSB0"));
        let timing = Timing { rate_hz: 50.0, lead_s: 0.5, follows: Follows::Time };
        assert_eq!((address.timing, address.baud), (timing, 57_600));
        assert_eq!(
            Address::parse("legs+udp://h:1?follows=arrival").unwrap().timing.follows,
            Follows::Arrival
        );
        for wrong in [
            "here",
            "gcs://",
            "gcs://h:1?rate_hz=0",
            "gcs://h:1?rate_hz=nan",
            "gcs://h:1?lead_s=9",
            "gcs://h:1?speed=2",
            "gcs://h:1?follows=arrival",
            "pose+tcp://h:1?follows=me",
        ] {
            let error = Address::parse(wrong).unwrap_err();
            assert!(matches!(error, PlatformError::Address { .. }), "{wrong}: {error}");
        }
    }

    #[test]
    fn unknown_and_unreachable_platforms_are_reported() {
        let geometry = Geometry::thesis();
        let error = |address: &str| connect(address, &geometry).err().unwrap();
        assert!(matches!(error("ftp://127.0.0.1:1"), PlatformError::Address { .. }));
        for address in ["gcs:///dev/no-such-line", "gcs://127.0.0.1:1"] {
            assert!(matches!(error(address), PlatformError::Unreachable { .. }), "{address}");
        }
    }
}
