//! Lines of CSV over a serial port, UDP or standard input.
//!
//! Columns are named by `?columns=`, or by the first line; foreign names, units and scales are those of the
//! rig file's `[recording] columns`, as in a file. A column `seq` or `sequence` counts lines, so that lost
//! ones are known; without `t_s` the time of arrival is taken.

use std::io::Read;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use super::sequence::{Order, Sequence};
use super::socket::{PATIENCE, is_patience, read_serial, resolve, serial};
use super::source::{Losses, OwnClock, Row, Source, SourceError};
use super::url::{Scheme, SourceUrl};
use crate::recording::Recording;
use crate::recording::columns::{Group, Known, TIME};
use crate::recording::conventions;
use crate::recording::csv::separator;
use crate::recording::text::decimal::Form;
use crate::recording::time;
use crate::rig::{DecimalMark, RecordingTable, RigFile};

const BAUD: u32 = 115_200;
/// Longer lines are none.
const MOST: usize = 4096;
/// Names of a column that counts lines.
const COUNTS: [&str; 2] = ["seq", "sequence"];
/// This many consecutive lines that are no samples end the stream.
const USELESS: u32 = 100;
/// A time that is further ahead of the last, ns, is believed if the next line goes on from it.
const FAR_NS: i64 = 5_000_000_000;
/// A sender that was silent for this long may have begun anew from another port.
const SILENT: Duration = Duration::from_secs(3);

/// A number in a line.
#[derive(Clone, Copy, Debug)]
struct Cell {
    at: usize,
    scale: f64,
    offset: f64,
}

/// The meaning of the cells of a line.
#[derive(Clone, Debug)]
struct Layout {
    separator: char,
    count: usize,
    groups: Vec<Group>,
    cells: Vec<Cell>,
    time: Option<Cell>,
    number: Option<usize>,
    form: Form,
}

impl Layout {
    /// Reads a header; the first line of numbers shows that they are numbers.
    fn new(header: &str, first: &str, rig: &RigFile) -> Result<Self, String> {
        let (mut columns, decimal) = (rig.recording.columns.clone(), rig.recording.decimal);
        let separator = char::from(separator(header));
        let names: Vec<&str> = header.split(separator).map(|n| n.trim().trim_matches('"')).collect();
        let is_known = |name: &&str| matches!(Known::parse(name), Some(Known::Member(..)));
        if columns.is_empty() && !names.iter().any(is_known) {
            // By the names and units that other programs give, as of a file.
            let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
            let meanings = conventions::meanings(&names, &[], &[]);
            columns = conventions::columns(&names, &meanings, |_| false).unwrap_or_default();
        }
        let source = |known: &str| {
            let (name, scale, offset) = match columns.get(known) {
                Some(source) => (source.parts().0, source.parts().1, source.offset()),
                None => (known, 1.0, 0.0),
            };
            Some(Cell { at: names.iter().position(|n| *n == name)?, scale, offset })
        };
        let time = source(TIME);
        // A file of one row is read as any: names, units and what is missing are found there.
        let own = RigFile {
            recording: RecordingTable { columns: columns.clone(), decimal, ..RecordingTable::default() },
            ..RigFile::default()
        };
        let text = match time {
            Some(_) => format!("{header}\n{first}\n"),
            None => format!("{TIME}{separator}{header}\n0{separator}{first}\n"),
        };
        let recording =
            Recording::from_csv_bytes("the stream", text.as_bytes(), &own).map_err(|e| e.to_string())?;
        let of_one_body = |group: &Group| {
            matches!(
                group,
                Group::Wrench | Group::Gauges | Group::Accel(0) | Group::Gyro(0) | Group::Platform
            )
        };
        let groups: Vec<Group> =
            recording.groups().into_iter().map(|(group, _)| group).filter(of_one_body).collect();
        if groups.is_empty() {
            return Err(format!(
                "its columns {} are of no wrench, no IMU and no pose: name them by ?columns=t_s,fx_n,…, or \
                 in [recording.columns] of the rig file",
                names.join(", ")
            ));
        }
        let cells = groups.iter().flat_map(|group| group.names()).map(|name| source(&name).ok_or(name));
        let cells =
            cells.collect::<Result<Vec<_>, _>>().map_err(|name| format!("column {name} is missing"))?;
        let number = names.iter().position(|name| COUNTS.contains(&name.to_lowercase().as_str()));
        // The first line shows how all of them are written.
        let first: Vec<&str> = first.split(separator).map(str::trim).collect();
        let known = cells.iter().chain(&time).filter_map(|cell| first.get(cell.at).copied());
        let form = Form::of(known, decimal.map(|mark| mark == DecimalMark::Comma)).unwrap_or(Form::PLAIN);
        Ok(Self { separator, count: names.len(), groups, cells, time, number, form })
    }

    /// Reads a line; `None` if it is none of these columns.
    fn read(&self, line: &str) -> Option<(Row, Option<u64>)> {
        let cells: Vec<&str> = line.split(self.separator).map(str::trim).collect();
        if cells.len() != self.count {
            return None;
        }
        let number = |cell: &Cell| {
            let plain = self.form.plain(cells.get(cell.at)?).ok()?;
            let value = plain.parse::<f64>().ok()? * cell.scale + cell.offset;
            value.is_finite().then_some(value)
        };
        let values = self.cells.iter().map(number).collect::<Option<Vec<f64>>>()?;
        let time_ns = match &self.time {
            Some(cell) => {
                let plain = self.form.plain(cells.get(cell.at)?).ok()?;
                let ns = time::parse(&plain, cell.scale)?.nanoseconds();
                // Two centuries either way fit.
                Some(i64::try_from(ns).ok().filter(|ns| ns.unsigned_abs() < 1 << 62)?)
            }
            None => None,
        };
        let count = match self.number {
            Some(at) => Some(cells.get(at)?.parse().ok()?),
            None => None,
        };
        Some((Row { time_ns, values }, count))
    }
}

/// Makes samples of bytes.
#[derive(Debug)]
pub struct Decoder {
    rig: RigFile,
    header: Option<String>,
    layout: Option<Layout>,
    line: Vec<u8>,
    /// The rest of a line that was begun before anybody listened.
    skips: bool,
    sequence: Sequence,
    last_ns: Option<i64>,
    /// A time far ahead, of a line that was left out.
    far_ns: Option<i64>,
    losses: Losses,
    useless: u32,
    /// Anybody may have sent a line that is no sample: it does not end the stream.
    forgives: bool,
}

impl Decoder {
    /// Starts with columns, or waits for a header; `midst` if the stream was under way before.
    pub fn new(columns: Option<&str>, rig: &RigFile, midst: bool) -> Self {
        Self {
            rig: rig.clone(),
            header: columns.map(str::to_owned),
            layout: None,
            line: Vec::new(),
            skips: midst,
            sequence: Sequence::new(32),
            last_ns: None,
            far_ns: None,
            losses: Losses::default(),
            useless: 0,
            forgives: false,
        }
    }

    /// Takes bytes as they come, and appends the samples in them.
    ///
    /// # Errors
    /// In words, why the lines are of no use.
    pub fn feed(&mut self, bytes: &[u8], rows: &mut Vec<Row>) -> Result<(), String> {
        for byte in bytes {
            if *byte != b'\n' {
                if self.line.len() <= MOST {
                    self.line.push(*byte);
                }
                continue;
            }
            let line = std::mem::take(&mut self.line);
            if std::mem::take(&mut self.skips) {
                continue;
            }
            let text = if line.len() > MOST { None } else { std::str::from_utf8(&line).ok() };
            match text.map(str::trim) {
                Some("") => {}
                Some(text) if text.starts_with('#') => {}
                Some(text) => {
                    if let Some(row) = self.line(text)? {
                        rows.push(row);
                    }
                }
                None => self.useless("it is no text")?,
            }
        }
        Ok(())
    }

    fn useless(&mut self, line: &str) -> Result<(), String> {
        self.losses.damaged += 1;
        self.useless += 1;
        if self.useless < USELESS || (self.forgives && self.layout.is_some()) {
            return Ok(());
        }
        let shown: String = line.chars().take(80).collect();
        let expected = self.header.as_deref().unwrap_or("a header");
        Err(format!(
            "{USELESS} lines in a row are no samples, the last {shown:?}: its columns are to be {expected}, \
             in numbers with a decimal point; is it the right port and baud rate?"
        ))
    }

    fn line(&mut self, line: &str) -> Result<Option<Row>, String> {
        if self.header.as_deref() == Some(line) {
            // Repeated by a sender that does not know when it is listened to.
            return Ok(None);
        }
        let layout = match (&self.layout, &self.header) {
            (Some(layout), _) => layout,
            (None, Some(header)) => {
                let cells = |text: &str| text.split(char::from(separator(header))).count();
                // A sensor that has just come up may send no numbers yet; the next line shows what the
                // columns are.
                let none_yet = line
                    .split(char::from(separator(header)))
                    .any(|cell| cell.trim().parse::<f64>().is_ok_and(|value| !value.is_finite()));
                if none_yet || cells(line) != cells(header) {
                    self.useless(line)?;
                    return Ok(None);
                }
                self.layout.insert(Layout::new(header, line, &self.rig)?)
            }
            (None, None) => {
                // Numbers before a header are of a stream that was under way.
                if !line.split([',', ';', '\t', '|']).all(|cell| cell.trim().parse::<f64>().is_ok()) {
                    self.header = Some(line.to_owned());
                }
                return Ok(None);
            }
        };
        let Some((row, count)) = layout.read(line) else {
            self.useless(line)?;
            return Ok(None);
        };
        self.useless = 0;
        if self.is_far(row.time_ns) {
            self.losses.damaged += 1;
            return Ok(None);
        }
        let order = count.map_or(Order::Next, |count| self.sequence.note(count).1);
        let is_late = row.time_ns.is_some_and(|ns| self.last_ns.is_some_and(|last| ns <= last));
        match order {
            Order::After(lost) => self.losses.lost += lost,
            Order::Late => {
                self.losses.late += 1;
                return Ok(None);
            }
            Order::Next | Order::Anew => {}
        }
        if is_late {
            self.losses.late += 1;
            return Ok(None);
        }
        self.last_ns = row.time_ns.or(self.last_ns);
        Ok(Some(row))
    }

    /// Returns true for a time far ahead of the last that no line before has gone on to: one wrong time would
    /// make all after it late.
    fn is_far(&mut self, time_ns: Option<i64>) -> bool {
        let (Some(time), Some(last)) = (time_ns, self.last_ns) else { return false };
        if time.saturating_sub(last) <= FAR_NS {
            self.far_ns = None;
            return false;
        }
        let goes_on = |far: i64| (1..=FAR_NS).contains(&time.saturating_sub(far));
        let far = self.far_ns.replace(time);
        !far.is_some_and(goes_on)
    }

    /// Returns the columns, once they are known.
    pub fn groups(&self) -> &[Group] {
        self.layout.as_ref().map_or(&[], |layout| &layout.groups)
    }
}

/// The origin of lines.
enum Line {
    Serial(Box<dyn serialport::SerialPort>),
    Udp(UdpSocket, Sender),
    /// A thread reads, as nobody can wait for standard input for a limited time.
    Input(Receiver<Vec<u8>>),
}

/// The sender whose datagrams are taken: those of the first who sent something of use.
#[derive(Debug, Default)]
struct Sender {
    /// Addresses of the host that was asked for; none: anybody's.
    only: Vec<IpAddr>,
    first: Option<SocketAddr>,
    heard: Option<Instant>,
}

impl Sender {
    /// Returns true for the sender whose datagrams are taken. One that was silent may go on from another
    /// port.
    fn is_taken(&self, from: SocketAddr) -> bool {
        let is_asked = self.only.is_empty() || self.only.contains(&from.ip());
        let is_silent = self.heard.is_none_or(|heard| heard.elapsed() > SILENT);
        is_asked && self.first.is_none_or(|first| first == from || (is_silent && first.ip() == from.ip()))
    }

    fn take(&mut self, from: SocketAddr) {
        (self.first, self.heard) = (Some(from), Some(Instant::now()));
    }
}

/// Reads a stream of lines.
pub struct Lines {
    url: SourceUrl,
    line: Line,
    decoder: Decoder,
    first: Vec<Row>,
}

impl Lines {
    /// Opens it, and waits for the first sample, which says what the columns are.
    ///
    /// # Errors
    /// It cannot be opened, nothing comes, or the columns are of no use.
    pub fn open(url: &SourceUrl, rig: &RigFile) -> Result<Self, SourceError> {
        let (line, midst) = match url.scheme {
            Scheme::UdpLines => {
                let only = match url.setting("from") {
                    Some(host) => resolve(url, host, 0)?.iter().map(SocketAddr::ip).collect(),
                    None => Vec::new(),
                };
                (Line::Udp(bound(url)?, Sender { only, ..Sender::default() }), false)
            }
            Scheme::StandardInput => (Line::Input(standard_input()), false),
            _ => (Line::Serial(serial(url, BAUD)?), true),
        };
        let columns = url.setting("columns");
        let mut source =
            Self { url: url.clone(), line, decoder: Decoder::new(columns, rig, midst), first: Vec::new() };
        source.decoder.forgives = url.scheme == Scheme::UdpLines;
        let (begun, mut rows) = (Instant::now(), Vec::new());
        while rows.is_empty() {
            source.read(Duration::from_millis(100), &mut rows)?;
            if begun.elapsed() > PATIENCE && rows.is_empty() {
                let header = match (&source.decoder.header, source.decoder.useless) {
                    (None, _) => "no header came and ?columns= is not given",
                    (Some(_), 0) => "nothing came",
                    (Some(_), _) => "nothing that is a sample came",
                };
                return Err(url.unreachable(format!("{header} within 3 s; {}", source.when_silent())));
            }
        }
        source.first = rows;
        Ok(source)
    }
}

fn bound(url: &SourceUrl) -> Result<UdpSocket, SourceError> {
    let (host, port) = url.host_and_port(0)?;
    if port == 0 {
        return Err(url.wrong("the port that lines are sent to is missing: udp://0.0.0.0:PORT"));
    }
    let address = *resolve(url, &host, port)?.first().ok_or_else(|| url.unreachable("no address"))?;
    UdpSocket::bind(address).map_err(|e| {
        url.unreachable(format!(
            "{e}; it is the address on which this computer listens, 0.0.0.0 for any, and no other program, \
             nor another source of this one, may have the port"
        ))
    })
}

fn standard_input() -> Receiver<Vec<u8>> {
    let (sender, receiver) = sync_channel(64);
    std::thread::spawn(move || {
        let mut buffer = [0; 8192];
        let mut input = std::io::stdin().lock();
        loop {
            match input.read(&mut buffer) {
                Ok(0) => return,
                Ok(n) if sender.send(buffer.get(..n).unwrap_or_default().to_vec()).is_ok() => {}
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                _ => return,
            }
        }
    });
    receiver
}

impl Source for Lines {
    fn groups(&self) -> &[Group] {
        self.decoder.groups()
    }

    fn clock(&self) -> OwnClock {
        match self.decoder.layout.as_ref().and_then(|layout| layout.time) {
            Some(_) => OwnClock::Seconds(self.url.to_string()),
            None => OwnClock::Arrival,
        }
    }

    fn read(&mut self, timeout: Duration, rows: &mut Vec<Row>) -> Result<(), SourceError> {
        rows.append(&mut self.first);
        let mut buffer = [0; 8192];
        let fed = match &mut self.line {
            Line::Serial(port) => {
                let n = read_serial(&self.url, &mut **port, &mut buffer, timeout)?;
                self.decoder.feed(buffer.get(..n).unwrap_or_default(), rows)
            }
            Line::Udp(socket, sender) => {
                let lost = |e: std::io::Error| self.url.unreachable(e.to_string());
                socket.set_read_timeout(Some(timeout.max(Duration::from_millis(1)))).map_err(lost)?;
                match socket.recv_from(&mut buffer) {
                    Ok((_, from)) if !sender.is_taken(from) => {
                        self.decoder.losses.others += 1;
                        Ok(())
                    }
                    // The end of a datagram is the end of a line.
                    Ok((n, from)) => {
                        let (before, named) = (rows.len(), self.decoder.header.is_some());
                        let fed = self.decoder.feed(buffer.get(..n).unwrap_or_default(), rows);
                        let fed = fed.and_then(|()| self.decoder.feed(b"\n", rows));
                        if rows.len() > before || (!named && self.decoder.header.is_some()) {
                            sender.take(from);
                        }
                        fed
                    }
                    Err(error) if is_patience(&error) => Ok(()),
                    Err(error) => return Err(lost(error)),
                }
            }
            Line::Input(receiver) => match receiver.recv_timeout(timeout) {
                Ok(bytes) => self.decoder.feed(&bytes, rows),
                Err(RecvTimeoutError::Timeout) => Ok(()),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(SourceError::Ended("standard input".to_owned()));
                }
            },
        };
        // Columns are what was asked for; lines are what somebody sends.
        fed.map_err(|why| match (&self.decoder.layout, self.decoder.useless < USELESS) {
            (None, true) => self.url.wrong(why),
            _ => self.url.protocol(why),
        })
    }

    fn losses(&self) -> Losses {
        self.decoder.losses
    }

    fn when_silent(&self) -> String {
        match self.line {
            Line::Serial(_) => "is its cable in, and the baud rate right (?baud=)?",
            Line::Udp(..) => {
                "does its sender run, and send to this computer and port; does a firewall hold back UDP?"
            }
            Line::Input(_) => "does the program before the pipe run, and write every line at once?",
        }
        .to_owned()
    }
}

#[cfg(test)]
#[path = "lines_tests.rs"]
mod tests;
