//! Universal Robots' controllers by RTDE, protocol version 2, on TCP port 30004.
//!
//! By the vendor's guide ("Real-Time Data Exchange"): every package is `u16` length, `u8` type and a payload,
//! big-endian. The client asks for version 2 (`V`), gives the names of what it wants with a rate (`O`; the
//! answer has a recipe's number and the types), and starts (`S`); packages of data (`U`) follow. Wrench:
//! `ft_raw_wrench`, which is not zeroed and not compensated. The IMU is `actual_tool_accelerometer` with the
//! turns of `actual_TCP_pose`: the rate of turn is the attitude's slope.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::socket::{PATIENCE, is_patience, tcp};
use super::source::{Losses, OwnClock, Role, Row, Source, SourceError};
use super::url::SourceUrl;
use crate::recording::columns::Group;

const PORT: u16 = 30_004;
/// Types of packages.
const VERSION: u8 = b'V';
const OUTPUTS: u8 = b'O';
const START: u8 = b'S';
const DATA: u8 = b'U';
const MESSAGE: u8 = b'M';
/// Rate asked for where the address does not say: that of an e-Series.
const RATE_HZ: f64 = 500.0;
/// Longer than any package, by its own field.
const MOST: usize = 1 << 16;
const LOOK_AT: &str = "is the robot switched on, in this network, with the RTDE service enabled under \
                       Settings, Security, Services?";

/// A variable that may be asked for: its name, the type it must have, numbers of it.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Variable {
    name: String,
    kind: &'static str,
    numbers: usize,
    group: Option<Group>,
}

/// Returns what names are asked for.
///
/// # Errors
/// A name that is of no use here.
fn variables(url: &SourceUrl, roles: &[Role]) -> Result<Vec<Variable>, SourceError> {
    let vector = |name: &str, group| Variable {
        name: name.to_owned(),
        kind: "VECTOR6D",
        numbers: 6,
        group: Some(group),
    };
    let mut wanted = vec![Variable { name: "timestamp".to_owned(), kind: "DOUBLE", numbers: 1, group: None }];
    let wrench = url.setting("wrench").unwrap_or("ft_raw_wrench");
    if wrench == "actual_TCP_force" {
        return Err(url.wrong(
            "actual_TCP_force is zeroed by the controller, and the payload that it believes in is taken off, \
             so that what is to be identified is missing from it: leave wrench= out, ft_raw_wrench is the \
             sensor's own",
        ));
    }
    if roles.contains(&Role::Wrench) {
        wanted.push(vector(wrench, Group::Wrench));
    }
    if roles.contains(&Role::Imu) {
        wanted.push(Variable {
            name: url.setting("accel").unwrap_or("actual_tool_accelerometer").to_owned(),
            kind: "VECTOR3D",
            numbers: 3,
            group: Some(Group::Accel(0)),
        });
    }
    if roles.iter().any(|role| matches!(role, Role::Imu | Role::Pose)) {
        wanted.push(vector(url.setting("pose").unwrap_or("actual_TCP_pose"), Group::Platform));
    }
    Ok(wanted)
}

/// Returns the bytes of a package.
pub fn package(kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len() + 3).unwrap_or(u16::MAX);
    let mut bytes = length.to_be_bytes().to_vec();
    bytes.push(kind);
    bytes.extend_from_slice(payload);
    bytes
}

/// Cuts a stream of bytes into packages.
#[derive(Debug, Default)]
pub struct Packages {
    bytes: Vec<u8>,
    at: usize,
}

impl Packages {
    /// Takes what arrived.
    pub fn feed(&mut self, bytes: &[u8]) {
        self.bytes.drain(..self.at);
        self.at = 0;
        self.bytes.extend_from_slice(bytes);
    }

    /// Returns the next whole package, its type and payload.
    ///
    /// # Errors
    /// A length that no package has: the stream is something else.
    #[allow(
        clippy::should_implement_trait,
        reason = "the payload borrows from here, and a stream can be none"
    )]
    pub fn next(&mut self) -> Result<Option<(u8, &[u8])>, String> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some((head, _)) = rest.split_first_chunk::<3>() else { return Ok(None) };
        let length = usize::from(u16::from_be_bytes([head[0], head[1]]));
        if length < 3 {
            return Err(format!("a package of {length} bytes: this is no RTDE"));
        }
        match rest.get(3..length) {
            None => Ok(None),
            Some(payload) => {
                self.at += length;
                Ok(Some((head[2], payload)))
            }
        }
    }
}

/// Makes samples of packages of data.
#[derive(Debug)]
pub struct Decoder {
    recipe: u8,
    variables: Vec<Variable>,
    period_s: f64,
    last_s: Option<f64>,
    losses: Losses,
}

/// Returns a rotation vector as a quaternion `w, x, y, z`.
fn quaternion([x, y, z]: [f64; 3]) -> [f64; 4] {
    let q = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::new(x, y, z));
    [q.w, q.i, q.j, q.k]
}

impl Decoder {
    /// Reads the answer to a set-up: number of the recipe, types of the variables.
    ///
    /// # Errors
    /// In words, what the controller does not have.
    fn new(answer: &[u8], variables: Vec<Variable>, rate_hz: f64) -> Result<Self, String> {
        let (recipe, types) = answer.split_first().ok_or("the answer to the set-up is empty")?;
        let types = std::str::from_utf8(types).map_err(|_| "the answer to the set-up is no text")?;
        let types: Vec<&str> = types.split(',').collect();
        if types.len() != variables.len() {
            return Err(format!(
                "{} variables were asked for, and {} are given",
                variables.len(),
                types.len()
            ));
        }
        for (variable, found) in variables.iter().zip(&types) {
            let name = &variable.name;
            match *found {
                "NOT_FOUND" if name == "ft_raw_wrench" => {
                    return Err(format!(
                        "the controller has no {name}: it comes with PolyScope 5.9 on an e-Series, which has \
                         a sensor in its flange; older robots need a sensor of their own, as ati+udp://"
                    ));
                }
                "NOT_FOUND" => return Err(format!("the controller has no {name}")),
                "IN_USE" => return Err(format!("{name} is in use by another program")),
                kind if kind != variable.kind => {
                    return Err(format!("{name} is a {kind}, and a {} is needed", variable.kind));
                }
                _ => {}
            }
        }
        Ok(Self {
            recipe: *recipe,
            variables,
            period_s: 1.0 / rate_hz,
            last_s: None,
            losses: Losses::default(),
        })
    }

    /// Takes a package of data; `None` if there is no sample in it.
    pub fn data(&mut self, payload: &[u8]) -> Option<Row> {
        let row = self.numbers(payload);
        let Some((time_s, values)) = row else {
            self.losses.damaged += 1;
            return None;
        };
        if let Some(last) = self.last_s {
            let steps = ((time_s - last) / self.period_s).round();
            if time_s <= last {
                self.losses.late += 1;
                return None;
            }
            // A pause of the controller is not a million packages.
            self.losses.lost += if steps > 1.0 { steps.min(1e9) as u64 - 1 } else { 0 };
        }
        self.last_s = Some(time_s);
        Some(Row { time_ns: Some((1e9 * time_s).round() as i64), values })
    }

    fn numbers(&self, payload: &[u8]) -> Option<(f64, Vec<f64>)> {
        let (recipe, mut rest) = payload.split_first()?;
        if *recipe != self.recipe {
            return None;
        }
        let mut values = Vec::new();
        let mut time_s = None;
        for variable in &self.variables {
            let mut read = [0.0; 6];
            for number in read.iter_mut().take(variable.numbers) {
                let (eight, after) = rest.split_first_chunk::<8>()?;
                *number = f64::from_be_bytes(*eight);
                rest = after;
                if !number.is_finite() {
                    return None;
                }
            }
            match variable.group {
                None => time_s = Some(read[0]),
                Some(Group::Platform) => {
                    let [x, y, z, rx, ry, rz] = read;
                    values.extend([x, y, z]);
                    values.extend(quaternion([rx, ry, rz]));
                }
                Some(_) => values.extend(read.iter().take(variable.numbers)),
            }
        }
        // Times beyond a century are none.
        let time_s = time_s.filter(|t| t.abs() < 4e9)?;
        // A rotation vector may be finite, and so long that it turns nowhere.
        (rest.is_empty() && values.iter().all(|v| v.is_finite())).then_some((time_s, values))
    }
}

/// Returns the decoder of a recipe of everything, for tests by bytes.
#[doc(hidden)]
pub fn decoder_of_everything(answer: &[u8]) -> Option<Decoder> {
    let url: SourceUrl = "rtde://robot".parse().ok()?;
    let variables = variables(&url, &[Role::Wrench, Role::Imu, Role::Pose]).ok()?;
    Decoder::new(answer, variables, RATE_HZ).ok()
}

/// Reads a controller that streams.
pub struct Rtde {
    url: SourceUrl,
    stream: TcpStream,
    packages: Packages,
    decoder: Decoder,
    groups: Vec<Group>,
}

impl Rtde {
    /// Agrees with the controller on what is sent, and starts.
    ///
    /// # Errors
    /// Nobody is there, the controller refuses, or a variable that is of no use was asked for.
    pub fn open(url: &SourceUrl, roles: &[Role]) -> Result<Self, SourceError> {
        let variables = variables(url, roles)?;
        let rate_hz = url.number("rate_hz")?.unwrap_or(RATE_HZ);
        let (host, port) = url.host_and_port(PORT)?;
        let mut stream = tcp(url, &host, port, LOOK_AT)?;
        let mut packages = Packages::default();
        let agreed = ask(url, &mut stream, &mut packages, VERSION, &2_u16.to_be_bytes())?;
        if agreed.first() != Some(&1) {
            return Err(url.protocol(
                "the controller does not know version 2 of RTDE: update PolyScope to 3.10, 5.4 or later",
            ));
        }
        let names: Vec<&str> = variables.iter().map(|v| v.name.as_str()).collect();
        let mut setup = rate_hz.to_be_bytes().to_vec();
        setup.extend(names.join(",").bytes());
        let answer = ask(url, &mut stream, &mut packages, OUTPUTS, &setup)?;
        let groups = variables.iter().filter_map(|v| v.group).collect();
        let decoder = Decoder::new(&answer, variables, rate_hz).map_err(|why| url.protocol(why))?;
        if ask(url, &mut stream, &mut packages, START, &[])?.first() != Some(&1) {
            return Err(url.protocol(format!(
                "the controller does not start: is it able to send {rate_hz} packages a second?"
            )));
        }
        Ok(Self { url: url.clone(), stream, packages, decoder, groups })
    }
}

/// Sends a package and waits for the answer of its type.
fn ask(
    url: &SourceUrl,
    stream: &mut TcpStream,
    packages: &mut Packages,
    kind: u8,
    payload: &[u8],
) -> Result<Vec<u8>, SourceError> {
    let lost = |e: std::io::Error| url.unreachable(e.to_string());
    stream.write_all(&package(kind, payload)).map_err(lost)?;
    let (begun, mut buffer) = (Instant::now(), [0; 4096]);
    while begun.elapsed() < PATIENCE {
        while let Some((found, payload)) = packages.next().map_err(|why| url.protocol(why))? {
            if found == kind {
                return Ok(payload.to_vec());
            }
        }
        match stream.read(&mut buffer) {
            Ok(0) => return Err(url.unreachable(format!("it hung up; {LOOK_AT}"))),
            Ok(n) => packages.feed(buffer.get(..n).unwrap_or_default()),
            Err(error) if is_patience(&error) => {}
            Err(error) => return Err(lost(error)),
        }
    }
    Err(url.protocol(format!(
        "no answer to package {:?}: is this an RTDE port? It is {PORT} on a robot",
        char::from(kind)
    )))
}

impl Source for Rtde {
    fn groups(&self) -> &[Group] {
        &self.groups
    }

    fn clock(&self) -> OwnClock {
        OwnClock::Seconds(format!("the controller at {}", self.url.place))
    }

    fn read(&mut self, timeout: Duration, rows: &mut Vec<Row>) -> Result<(), SourceError> {
        let mut buffer = vec![0; MOST];
        let timed = self.stream.set_read_timeout(Some(timeout.max(Duration::from_millis(1))));
        timed.map_err(|e| self.url.unreachable(e.to_string()))?;
        match self.stream.read(&mut buffer) {
            Ok(0) => {
                return Err(self
                    .url
                    .unreachable("the controller hung up: was it switched off, or another client started?"));
            }
            Ok(n) => self.packages.feed(buffer.get(..n).unwrap_or_default()),
            Err(error) if is_patience(&error) => return Ok(()),
            Err(error) => return Err(self.url.unreachable(error.to_string())),
        }
        while let Some((kind, payload)) = self.packages.next().map_err(|why| self.url.protocol(why))? {
            match kind {
                DATA => rows.extend(self.decoder.data(payload)),
                // Texts to whoever listens.
                MESSAGE => {}
                _ => self.decoder.losses.damaged += 1,
            }
        }
        Ok(())
    }

    fn losses(&self) -> Losses {
        self.decoder.losses
    }

    fn when_silent(&self) -> String {
        LOOK_AT.to_owned()
    }
}

#[cfg(test)]
#[path = "rtde_tests.rs"]
mod tests;
