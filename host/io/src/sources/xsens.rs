//! Xsens MTi's over a serial line: MTData2 messages.
//!
//! By the vendor's "MT Low Level Communication Protocol": `FA FF 36`, a length (`FF` and two bytes if it is
//! longer than 254), items, a check sum that makes the bytes behind the preamble add up to a multiple of 256.
//! An item has an identifier, whose lowest nibble is its format (floating-point of 32 or 64 bits, fixed-point
//! 12.20 or 16.32), a length and numbers, big-endian.

use std::time::Duration;

use super::sequence::{Order, Sequence};
use super::socket::{read_serial, serial};
use super::source::{Losses, OwnClock, Row, Source, SourceError};
use super::url::SourceUrl;
use crate::recording::columns::Group;

const BAUD: u32 = 115_200;
const PREAMBLE: u8 = 0xFA;
const BUS: u8 = 0xFF;
const DATA: u8 = 0x36;
const EXTENDED: u8 = 0xFF;
/// Items, without the nibble of their format.
const PACKET_COUNTER: u16 = 0x1020;
const SAMPLE_TIME_FINE: u16 = 0x1060;
const ACCELERATION: u16 = 0x4020;
const FREE_ACCELERATION: u16 = 0x4030;
const RATE_OF_TURN: u16 = 0x8020;
/// Ticks of the fine time, ns.
const TICK_NS: i64 = 100_000;
/// A message is no longer than this, by the protocol.
const MOST: usize = 2048;
/// After this many messages without a sample it is said what they lack.
const MESSAGES: u32 = 50;
/// And after this many bytes without a message.
const BYTES: u64 = 20_000;

/// Holds what one message says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Number of the message, 16 bits.
    pub counter: Option<u16>,
    /// Time of the sample, ticks of 100 µs, 32 bits.
    pub ticks: Option<u32>,
    /// Specific force, m/s².
    pub accel: Option<[f64; 3]>,
    /// Angular rate, rad/s.
    pub gyro: Option<[f64; 3]>,
    /// It has an acceleration from which gravity was taken off.
    pub free_accel: bool,
}

/// Reads one number of its bytes.
type Number = fn(&[u8]) -> Option<f64>;

/// Reads three numbers in the format of an item's identifier.
fn three(identifier: u16, bytes: &[u8]) -> Option<[f64; 3]> {
    let (size, read): (usize, Number) = match identifier & 3 {
        0 => (4, |b| Some(f64::from(f32::from_be_bytes(b.try_into().ok()?)))),
        1 => (4, |b| Some(f64::from(i32::from_be_bytes(b.try_into().ok()?)) / f64::from(1 << 20))),
        2 => (6, |b| {
            // The fraction comes first.
            let [f0, f1, f2, f3, i0, i1] = b.try_into().ok()?;
            let whole = i64::from(i16::from_be_bytes([i0, i1]));
            let fraction = i64::from(u32::from_be_bytes([f0, f1, f2, f3]));
            Some(((whole << 32) + fraction) as f64 / 4_294_967_296.0)
        }),
        _ => (8, |b| Some(f64::from_be_bytes(b.try_into().ok()?))),
    };
    if bytes.len() != 3 * size {
        return None;
    }
    let mut numbers = [0.0; 3];
    for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(size)) {
        *number = read(bytes).filter(|v| v.is_finite())?;
    }
    Some(numbers)
}

/// Reads the items of a message; `None` if they do not fill it.
pub fn items(mut bytes: &[u8]) -> Option<Measured> {
    let mut measured = Measured::default();
    while let Some(([a, b, length], rest)) = bytes.split_first_chunk::<3>() {
        let identifier = u16::from_be_bytes([*a, *b]);
        let data = rest.get(..usize::from(*length))?;
        bytes = rest.get(usize::from(*length)..)?;
        match identifier & 0xFFF0 {
            PACKET_COUNTER => measured.counter = Some(u16::from_be_bytes(data.try_into().ok()?)),
            SAMPLE_TIME_FINE => measured.ticks = Some(u32::from_be_bytes(data.try_into().ok()?)),
            ACCELERATION => measured.accel = Some(three(identifier, data)?),
            RATE_OF_TURN => measured.gyro = Some(three(identifier, data)?),
            FREE_ACCELERATION => measured.free_accel = true,
            _ => {}
        }
    }
    bytes.is_empty().then_some(measured)
}

/// Makes samples of bytes.
#[derive(Debug)]
pub struct Decoder {
    bytes: Vec<u8>,
    counter: Sequence,
    ticks: Sequence,
    has_time: bool,
    losses: Losses,
    /// Messages without a sample in them, and the last one.
    without: u32,
    lacking: Measured,
    samples: u64,
    read: u64,
    messages: u64,
}

impl Default for Decoder {
    fn default() -> Self {
        Self {
            bytes: Vec::new(),
            counter: Sequence::new(16),
            ticks: Sequence::new(32),
            has_time: false,
            losses: Losses::default(),
            without: 0,
            lacking: Measured::default(),
            samples: 0,
            read: 0,
            messages: 0,
        }
    }
}

impl Decoder {
    /// Takes bytes as they come, and appends the samples in them.
    pub fn feed(&mut self, bytes: &[u8], rows: &mut Vec<Row>) {
        self.read += bytes.len() as u64;
        self.bytes.extend_from_slice(bytes);
        let mut at = 0;
        loop {
            let rest = self.bytes.get(at..).unwrap_or_default();
            let Some(skipped) = rest.iter().position(|b| *b == PREAMBLE) else {
                at = self.bytes.len();
                break;
            };
            at += skipped;
            match message(rest.get(skipped..).unwrap_or_default()) {
                Piece::Wait => break,
                Piece::None => at += 1,
                Piece::Damaged => {
                    self.losses.damaged += 1;
                    at += 1;
                }
                Piece::Whole { kind, data, length } => {
                    let measured = (kind == DATA).then(|| items(data));
                    at += length;
                    match measured {
                        // Acknowledgements and the like.
                        None => {}
                        Some(None) => self.losses.damaged += 1,
                        Some(Some(measured)) => rows.extend(self.sample(&measured)),
                    }
                }
            }
        }
        self.bytes.drain(..at);
    }

    fn sample(&mut self, measured: &Measured) -> Option<Row> {
        self.messages += 1;
        // The count is of messages, whatever is in them.
        if let Some(counter) = measured.counter {
            match self.counter.note(counter.into()).1 {
                Order::After(lost) => self.losses.lost += lost,
                Order::Late => {
                    self.losses.late += 1;
                    return None;
                }
                Order::Next | Order::Anew => {}
            }
        }
        let (Some(accel), Some(gyro)) = (measured.accel, measured.gyro) else {
            (self.without, self.lacking) = (self.without.saturating_add(1), *measured);
            return None;
        };
        self.samples += 1;
        let time_ns = measured.ticks.map(|ticks| self.ticks.note(ticks.into()).0 as i64 * TICK_NS);
        self.has_time |= time_ns.is_some();
        Some(Row { time_ns, values: accel.into_iter().chain(gyro).collect() })
    }

    /// Says what messages lack, if none has had a sample for long.
    pub fn lacks(&self) -> Option<String> {
        if self.samples > 0 {
            return None;
        }
        if self.messages == 0 && self.read > BYTES {
            return Some(
                "bytes come, and no MTData2 among them: is the baud rate right (?baud=)?".to_owned(),
            );
        }
        if self.without < MESSAGES {
            return None;
        }
        let mut lacking = Vec::new();
        if self.lacking.accel.is_none() {
            lacking.push("Acceleration (0x4020)");
        }
        if self.lacking.gyro.is_none() {
            lacking.push("Rate of Turn (0x8020)");
        }
        let free = if self.lacking.free_accel {
            "; Free Acceleration has no gravity in it and is of no use"
        } else {
            ""
        };
        Some(format!(
            "its messages have no {}{free}: enable it with Packet Counter and Sample Time Fine in the output \
             configuration, by MT Manager",
            lacking.join(" and no ")
        ))
    }
}

enum Piece<'a> {
    /// The end is still to come.
    Wait,
    /// No message begins here.
    None,
    /// One that its check sum belies.
    Damaged,
    /// One, with its length.
    Whole { kind: u8, data: &'a [u8], length: usize },
}

/// Searches for a message at a preamble.
fn message(bytes: &[u8]) -> Piece<'_> {
    let (head, long) = match bytes {
        [_, bus, ..] if *bus != BUS => return Piece::None,
        [_, _, _, EXTENDED, a, b, ..] => (6, usize::from(u16::from_be_bytes([*a, *b]))),
        [_, _, _, EXTENDED, ..] | [_] | [_, _] | [_, _, _] | [] => return Piece::Wait,
        [_, _, _, length, ..] => (4, usize::from(*length)),
    };
    if long > MOST {
        return Piece::None;
    }
    let Some(whole) = bytes.get(..head + long + 1) else { return Piece::Wait };
    let sum = whole.iter().skip(1).fold(0_u8, |sum, b| sum.wrapping_add(*b));
    match (sum, whole.get(2), whole.get(head..head + long)) {
        (0, Some(kind), Some(data)) => Piece::Whole { kind: *kind, data, length: whole.len() },
        _ => Piece::Damaged,
    }
}

/// Reads an IMU that streams.
pub struct Xsens {
    url: SourceUrl,
    port: Box<dyn serialport::SerialPort>,
    decoder: Decoder,
    first: Vec<Row>,
}

impl Xsens {
    /// Opens the line and waits for the first sample, which says whether the device tells the time.
    ///
    /// # Errors
    /// The port cannot be opened, or messages lack what is needed.
    pub fn open(url: &SourceUrl) -> Result<Self, SourceError> {
        let port = serial(url, BAUD)?;
        // What waits on the line is older than it appears: its times would not go with its arrivals. A line
        // that cannot be emptied is read as it is.
        let _ = port.clear(serialport::ClearBuffer::Input);
        let mut source = Self { url: url.clone(), port, decoder: Decoder::default(), first: Vec::new() };
        let begun = std::time::Instant::now();
        let mut rows = Vec::new();
        while rows.is_empty() {
            source.read(Duration::from_millis(100), &mut rows)?;
            if begun.elapsed() > super::socket::PATIENCE {
                return Err(url.unreachable(format!("nothing came within 3 s; {}", source.when_silent())));
            }
        }
        source.first = rows;
        Ok(source)
    }
}

impl Source for Xsens {
    fn groups(&self) -> &[Group] {
        &[Group::Accel(0), Group::Gyro(0)]
    }

    fn clock(&self) -> OwnClock {
        if self.decoder.has_time { OwnClock::Seconds(self.url.to_string()) } else { OwnClock::Arrival }
    }

    fn read(&mut self, timeout: Duration, rows: &mut Vec<Row>) -> Result<(), SourceError> {
        rows.append(&mut self.first);
        let mut buffer = [0; 4096];
        let n = read_serial(&self.url, &mut *self.port, &mut buffer, timeout)?;
        self.decoder.feed(buffer.get(..n).unwrap_or_default(), rows);
        match self.decoder.lacks() {
            Some(lacks) => Err(self.url.protocol(lacks)),
            None => Ok(()),
        }
    }

    fn losses(&self) -> Losses {
        self.decoder.losses
    }

    fn when_silent(&self) -> String {
        "is its cable in, the baud rate right (?baud=), and the device in measurement mode?".to_owned()
    }
}

#[cfg(test)]
#[path = "xsens_tests.rs"]
mod tests;
