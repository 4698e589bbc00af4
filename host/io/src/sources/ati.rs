//! ATI's force sensors on Ethernet by Raw Data Transfer: Net F/T boxes, Ethernet Axia, Schunk's of the same
//! make.
//!
//! By the vendor's manual 9620-05-NET FT: a request of 8 bytes to UDP port 49152 (header 0x1234, command 2 to
//! stream, count 0 without end; command 0 stops) is answered by records of 36 bytes: `rdt_sequence`,
//! `ft_sequence`, status, six counts. Counts per force and per torque are given by
//! `http://HOST/netftapi2.xml` (`cfgcpf`, `cfgcpt`, units `scfgfu`, `scfgtu`, rate `comrdtrate`), or by
//! READCALINFO on TCP port 49151. All numbers are big-endian.

use std::io::Write;
use std::net::UdpSocket;
use std::time::{Duration, Instant};

use super::sequence::{Order, Sequence};
use super::socket::{is_patience, read_within, resolve, tcp};
use super::source::{Losses, OwnClock, Row, Source, SourceError};
use super::url::SourceUrl;
use crate::recording::columns::Group;

/// The port that records are asked for at.
const RDT_PORT: u16 = 49_152;
/// The port that tells the calibration.
const TCP_PORT: u16 = 49_151;
const HEADER: u16 = 0x1234;
/// Commands: stop, and stream as fast as is set.
const STOP: u16 = 0;
const STREAM: u16 = 2;
/// Bytes of a record.
pub const RECORD: usize = 36;
/// The status bit that is set with every serious error.
const IS_FAULTY: u32 = 1 << 31;
/// A page of the sensor is no longer than this.
const MOST_PAGE: usize = 1 << 20;
/// Asked again after this long without a record: a request may be lost as any datagram.
const ASK_AGAIN: Duration = Duration::from_millis(500);

/// Holds a record as it is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Number of the record.
    pub rdt_sequence: u32,
    /// Number of the sample inside the sensor.
    pub ft_sequence: u32,
    /// The sensor's status.
    pub status: u32,
    /// Fx, Fy, Fz, Tx, Ty, Tz in counts.
    pub counts: [i32; 6],
}

/// Returns the bytes of a request.
pub fn request(command: u16) -> [u8; 8] {
    let [a, b] = HEADER.to_be_bytes();
    let [c, d] = command.to_be_bytes();
    [a, b, c, d, 0, 0, 0, 0]
}

/// Reads a record; `None` of anything that is none.
pub fn record(bytes: &[u8]) -> Option<Record> {
    let bytes: &[u8; RECORD] = bytes.try_into().ok()?;
    let word = |k: usize| {
        let mut four = [0; 4];
        four.copy_from_slice(&bytes[4 * k..4 * k + 4]);
        u32::from_be_bytes(four)
    };
    Some(Record {
        rdt_sequence: word(0),
        ft_sequence: word(1),
        status: word(2),
        counts: std::array::from_fn(|k| word(3 + k).cast_signed()),
    })
}

/// Tells what makes SI units of counts, and how many records come a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// N for a count of a force.
    pub newton: f64,
    /// N m for a count of a torque.
    pub newton_metre: f64,
    /// Records a second, if given.
    pub rate_hz: Option<f64>,
}

/// Forces' units by their names on the page and by their numbers in READCALINFO, N.
const FORCES: [(&str, u8, f64); 6] = [
    ("lbf", 1, 4.448_221_615_260_5),
    ("n", 2, 1.0),
    ("klbf", 3, 4_448.221_615_260_5),
    ("kn", 4, 1000.0),
    ("kg", 5, 9.806_65),
    ("g", 6, 9.806_65e-3),
];
/// Torques' units likewise, N m.
const TORQUES: [(&str, u8, f64); 6] = [
    ("lbf-in", 1, 0.112_984_829_027_616_7),
    ("lbf-ft", 2, 1.355_817_948_331_400_4),
    ("nm", 3, 1.0),
    ("nmm", 4, 1e-3),
    ("kg-cm", 5, 0.098_066_5),
    ("knm", 6, 1000.0),
];

/// Returns the size of a unit as the page writes it: `N-m`, `Nm`, `in-lbf`, `kgf-cm` are in use.
fn unit(table: &[(&str, u8, f64)], written: &str) -> Option<f64> {
    let plain = written.trim().to_lowercase().replace("kgf", "kg").replace(['.', '·', ' '], "-");
    let turned = plain.split_once('-').map(|(a, b)| format!("{b}-{a}"));
    let joined = plain.replace('-', "");
    let is = |name: &str| name == plain || Some(name) == turned.as_deref() || name == joined;
    table.iter().find(|(name, ..)| is(name)).map(|(.., si)| *si)
}

/// Reads `netftapi2.xml`.
///
/// # Errors
/// In words, what it lacks.
pub fn read_page(text: &str) -> Result<Calibration, String> {
    // The sensor writes its page by hand: nothing but the elements is relied on.
    let start = text.find('<').ok_or("the page is empty")?;
    let document = roxmltree::Document::parse(text.get(start..).unwrap_or_default())
        .map_err(|e| format!("the page is no XML: {e}"))?;
    let element = |name: &str| {
        let of_name = |n: &roxmltree::Node| n.tag_name().name().eq_ignore_ascii_case(name);
        document.descendants().find(of_name).and_then(|n| n.text()).map(str::trim)
    };
    let number = |name: &str| {
        let value = element(name).and_then(|t| t.parse::<f64>().ok());
        value.filter(|v| v.is_finite() && *v > 0.0)
    };
    let counts = |name: &str| number(name).ok_or(format!("the page has no {name} greater than zero"));
    let known = |table, name: &str| {
        let written = element(name).ok_or(format!("the page has no {name}"))?;
        unit(table, written).ok_or(format!("{name} is {written:?}, a unit that is not known here"))
    };
    Ok(Calibration {
        newton: known(&FORCES, "scfgfu")? / counts("cfgcpf")?,
        newton_metre: known(&TORQUES, "scfgtu")? / counts("cfgcpt")?,
        rate_hz: number("comrdtrate"),
    })
}

/// Reads the answer to READCALINFO: header, units of force and torque, counts per each, six scale factors.
///
/// # Errors
/// In words, what is wrong with it.
pub fn read_calibration(bytes: &[u8]) -> Result<Calibration, String> {
    let bytes: &[u8; 24] = bytes.try_into().map_err(|_| format!("{} bytes in place of 24", bytes.len()))?;
    if bytes[..2] != HEADER.to_be_bytes() {
        return Err("the answer does not begin with 0x1234".to_owned());
    }
    let counts =
        |k: usize| f64::from(u32::from_be_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]));
    let of = |table: &[(&str, u8, f64)], number: u8| {
        table
            .iter()
            .find(|(_, n, _)| *n == number)
            .map(|(.., si)| *si)
            .ok_or(format!("unit {number} is not known"))
    };
    let (force, torque) = (counts(4), counts(8));
    if force == 0.0 || torque == 0.0 {
        return Err("it has zero counts per unit".to_owned());
    }
    Ok(Calibration {
        newton: of(&FORCES, bytes[2])? / force,
        newton_metre: of(&TORQUES, bytes[3])? / torque,
        rate_hz: None,
    })
}

/// Makes samples of records.
#[derive(Debug)]
pub struct Decoder {
    calibration: Calibration,
    sequence: Sequence,
    losses: Losses,
}

impl Decoder {
    /// Starts to count.
    pub fn new(calibration: Calibration) -> Self {
        Self { calibration, sequence: Sequence::new(32), losses: Losses::default() }
    }

    /// Takes a datagram; `None` if there is no sample in it.
    pub fn datagram(&mut self, bytes: &[u8]) -> Option<Row> {
        let Some(record) = record(bytes) else {
            self.losses.damaged += 1;
            return None;
        };
        let (count, order) = self.sequence.note(record.rdt_sequence.into());
        match order {
            Order::Next | Order::Anew => {}
            Order::After(lost) => self.losses.lost += lost,
            Order::Late => {
                self.losses.late += 1;
                return None;
            }
        }
        if record.status & IS_FAULTY != 0 {
            self.losses.faulty += 1;
            self.losses.status = Some(record.status);
            return None;
        }
        let unit = |k: usize| if k < 3 { self.calibration.newton } else { self.calibration.newton_metre };
        let values = record.counts.iter().enumerate().map(|(k, count)| f64::from(*count) * unit(k)).collect();
        let time_s = count as f64 / self.calibration.rate_hz.unwrap_or(NOMINAL_HZ);
        Some(Row { time_ns: Some((1e9 * time_s).round() as i64), values })
    }
}

/// Any rate does where none is given: the arrivals determine it.
const NOMINAL_HZ: f64 = 1000.0;

/// Reads a sensor that streams.
pub struct Ati {
    url: SourceUrl,
    socket: UdpSocket,
    decoder: Decoder,
    heard: Instant,
}

impl Ati {
    /// Asks for the calibration, unless the address gives it, and for records.
    ///
    /// # Errors
    /// The host is not known, or does not tell its calibration.
    pub fn open(url: &SourceUrl) -> Result<Self, SourceError> {
        let (host, port) = url.host_and_port(RDT_PORT)?;
        let mut calibration = match (url.number("cpf")?, url.number("cpt")?) {
            (Some(force), Some(torque)) => {
                Calibration { newton: 1.0 / force, newton_metre: 1.0 / torque, rate_hz: None }
            }
            (None, None) => asked(url, &host)?,
            _ => return Err(url.wrong("cpf and cpt, counts per N and per N m, are given together")),
        };
        calibration.rate_hz = url.number("rate_hz")?.or(calibration.rate_hz);
        let address = *resolve(url, &host, port)?.first().ok_or_else(|| url.unreachable("no address"))?;
        let any = if address.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(any)
            .and_then(|socket| socket.connect(address).map(|()| socket))
            .and_then(|socket| socket.send(&request(STREAM)).map(|_| socket));
        let socket = socket.map_err(|e| url.unreachable(e.to_string()))?;
        Ok(Self { url: url.clone(), socket, decoder: Decoder::new(calibration), heard: Instant::now() })
    }
}

/// Asks the page first, then the port.
fn asked(url: &SourceUrl, host: &str) -> Result<Calibration, SourceError> {
    let http = url.integer("http_port", 65_535)?.unwrap_or(80) as u16;
    let by_tcp = url.integer("tcp_port", 65_535)?.unwrap_or(TCP_PORT.into()) as u16;
    let page = page(url, host, http).map_err(|e| e.to_string()).and_then(|text| read_page(&text));
    let page = match page {
        Ok(found) => return Ok(found),
        Err(why) => why,
    };
    calinfo(url, host, by_tcp).map_err(|e| e.to_string()).and_then(|bytes| read_calibration(&bytes)).map_err(
        |why| {
            url.protocol(format!(
            "the sensor does not tell its counts per unit, neither by its page ({page}) nor by port {by_tcp} \
             ({why}): read them on its configuration page and give them, per N and per N m, as \
             ?cpf=1000000&cpt=1000000"
        ))
        },
    )
}

fn page(url: &SourceUrl, host: &str, port: u16) -> Result<String, SourceError> {
    let mut stream = tcp(url, host, port, "is it switched on, in this network?")?;
    let lost = |e: std::io::Error| url.unreachable(e.to_string());
    let request = format!("GET /netftapi2.xml HTTP/1.0\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).map_err(lost)?;
    let bytes = read_within(&mut stream, MOST_PAGE).map_err(lost)?;
    let text = String::from_utf8_lossy(&bytes);
    let (head, body) = text.split_once("\r\n\r\n").ok_or_else(|| url.protocol("it is no web page"))?;
    let status = head.lines().next().unwrap_or_default();
    if status.split_whitespace().nth(1) != Some("200") {
        return Err(url.protocol(format!("netftapi2.xml: {status}")));
    }
    Ok(body.to_owned())
}

fn calinfo(url: &SourceUrl, host: &str, port: u16) -> Result<Vec<u8>, SourceError> {
    let mut stream = tcp(url, host, port, "is it switched on, in this network?")?;
    let lost = |e: std::io::Error| url.unreachable(e.to_string());
    let mut request = [0; 20];
    request[0] = 1;
    stream.write_all(&request).map_err(lost)?;
    let bytes = read_within(&mut stream, 24).map_err(lost)?;
    if bytes.len() < 24 {
        return Err(url.protocol("its answer is too short"));
    }
    Ok(bytes)
}

impl Source for Ati {
    fn groups(&self) -> &[Group] {
        &[Group::Wrench]
    }

    fn clock(&self) -> OwnClock {
        match self.decoder.calibration.rate_hz {
            Some(_) => OwnClock::Seconds(self.url.to_string()),
            None => OwnClock::Counts,
        }
    }

    fn read(&mut self, timeout: Duration, rows: &mut Vec<Row>) -> Result<(), SourceError> {
        let lost = |e: std::io::Error| self.url.unreachable(e.to_string());
        self.socket.set_read_timeout(Some(timeout.max(Duration::from_millis(1)))).map_err(lost)?;
        let mut buffer = [0; 2048];
        match self.socket.recv(&mut buffer) {
            Ok(n) => {
                self.heard = Instant::now();
                rows.extend(self.decoder.datagram(buffer.get(..n).unwrap_or_default()));
                Ok(())
            }
            Err(error) if is_patience(&error) || error.kind() == std::io::ErrorKind::ConnectionRefused => {
                if self.heard.elapsed() > ASK_AGAIN {
                    self.heard = Instant::now();
                    // Nobody may be there yet; the silence is reported by whoever waits.
                    let _ = self.socket.send(&request(STREAM));
                }
                Ok(())
            }
            Err(error) => Err(lost(error)),
        }
    }

    fn losses(&self) -> Losses {
        self.decoder.losses
    }

    fn when_silent(&self) -> String {
        "is the sensor switched on and in this network, is RDT enabled on its communications page, does \
         another program stream from it, or a firewall hold back UDP?"
            .to_owned()
    }
}

impl Drop for Ati {
    fn drop(&mut self) {
        // Whoever does not hear it goes on sending for nobody.
        let _ = self.socket.send(&request(STOP));
    }
}

#[cfg(test)]
#[path = "ati_tests.rs"]
mod tests;
