//! Sources under way: every sample into its file, and onto the common time base.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Duration;

use crate::application::live_error::LiveError;
use rigident_fit::figures::counted;
use rigident_identify::problem::clocks::Growing;
use rigident_io::recording::columns::{Group, TIME};
use rigident_io::recording::time;
use rigident_io::rig::{RigFile, StreamTable};
use rigident_io::sources::clock::{ArrivalLine, ClockLine};
use rigident_io::sources::feed::Feeds;
use rigident_io::sources::url::SourceUrl;
use rigident_io::sources::{OwnClock, Role, Row, SourceError};

/// A source from which nothing arrived for this long is silent, ns.
pub(super) const SILENT_NS: i64 = 2_000_000_000;
/// Lines of clocks are examined anew this often, ns: in between they stay, so that no sample jumps.
const ANEW_NS: i64 = 2_000_000_000;
/// The time for which arrived data are taken in at once, ns.
const MOST_NS: i64 = 200_000_000;
/// Clocks that count seconds are no further off than so, a share.
const OFF: f64 = 0.01;
/// Stamps of one clock do not differ by more than so, s.
const APART_S: f64 = 5.0;
/// No clock goes on by this much more than this computer's between two samples, ns.
const JUMP_NS: i64 = 5_000_000_000;
/// This many consecutive samples whose times do not go on: the clock has begun anew.
const BACKWARDS: u32 = 100;

/// One source as it was asked for.
pub(super) struct Asked {
    pub(super) url: SourceUrl,
    pub(super) roles: Vec<Role>,
}

/// The destination of its samples.
struct Stream {
    asked: Asked,
    file: String,
    groups: Vec<Group>,
    /// The index of the stream's clock among the clocks.
    clock: usize,
    own: OwnClock,
    when_silent: String,
    writer: Option<BufWriter<File>>,
    /// Samples before the time base was chosen.
    pending: Vec<(i64, Vec<f64>)>,
    last_ns: Option<i64>,
    backwards: u32,
    heard_ns: i64,
    samples: u64,
}

/// A clock that one or more sources share.
struct Clock {
    /// The first time of the clock, ns.
    zero_ns: Option<i64>,
    arrivals: ArrivalLine,
    /// The state used until the next check.
    line: ClockLine,
    looked_ns: i64,
    counts: bool,
    is_arrival: bool,
}

/// All of them.
pub(super) struct Streams {
    feeds: Feeds,
    streams: Vec<Stream>,
    clocks: Vec<Clock>,
    growing: Growing,
    begun: bool,
    flushed_ns: i64,
}

/// The data received.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Came {
    /// Samples, or nothing.
    Samples,
    /// A source has come to its end, as a file does.
    End,
}

impl Streams {
    /// Starts to take samples in; nothing is written yet.
    pub(super) fn new(asked: Vec<Asked>, feeds: Feeds, rig: &RigFile) -> Self {
        let mut names: BTreeMap<String, usize> = BTreeMap::new();
        let (mut clocks, mut streams) = (Vec::new(), Vec::new());
        for (described, asked) in feeds.described.iter().zip(asked) {
            let name = match &described.clock {
                OwnClock::Seconds(name) => name.clone(),
                OwnClock::Counts | OwnClock::Arrival => asked.url.to_string(),
            };
            let clock = *names.entry(name).or_insert(clocks.len());
            if clock == clocks.len() {
                clocks.push(Clock {
                    zero_ns: None,
                    arrivals: ArrivalLine::default(),
                    line: ClockLine { offset_s: 0.0, rate: 1.0 },
                    looked_ns: 0,
                    counts: described.clock == OwnClock::Counts,
                    is_arrival: described.clock == OwnClock::Arrival,
                });
            }
            let roles: Vec<String> = asked.roles.iter().map(ToString::to_string).collect();
            streams.push(Stream {
                file: format!("{}.csv", roles.join("-")),
                groups: described.groups.clone(),
                clock,
                own: described.clock.clone(),
                when_silent: described.when_silent.clone(),
                asked,
                writer: None,
                pending: Vec::new(),
                last_ns: None,
                backwards: 0,
                heard_ns: feeds.now_ns(),
                samples: 0,
            });
        }
        let named = streams.iter().map(|s| (s.asked.url.to_string(), s.groups.clone())).collect();
        let growing = Growing::new(rig, named);
        Self { feeds, streams, clocks, growing, begun: false, flushed_ns: 0 }
    }

    /// Opens a file for each in a folder.
    pub(super) fn record(&mut self, folder: &Path) -> Result<(), LiveError> {
        for stream in &mut self.streams {
            let path = folder.join(&stream.file);
            let failed = |e: std::io::Error| LiveError::Clock(format!("{}: {e}", path.display()));
            let mut writer = BufWriter::new(File::create_new(&path).map_err(failed)?);
            let names = stream.groups.iter().flat_map(|group| group.names());
            let header: Vec<String> = std::iter::once(TIME.to_owned()).chain(names).collect();
            let source = stream.asked.url.to_string();
            writeln!(writer, "# source = {source:?}\n{}", header.join(",")).map_err(failed)?;
            stream.writer = Some(writer);
        }
        Ok(())
    }

    /// Waits up to the given time, and takes in what arrived.
    ///
    /// # Errors
    /// In words: a source broke off, fell silent, or began its time anew; a file cannot be written.
    pub(super) fn take(&mut self, timeout: Duration) -> Result<Came, String> {
        let mut came = Came::Samples;
        let mut next = self.feeds.next(timeout);
        // Whoever sends faster than this takes it in keeps nobody from ending the run.
        let until_ns = self.feeds.now_ns().saturating_add(MOST_NS);
        while let Some(arrival) = next {
            match arrival.rows {
                Ok(rows) => {
                    for (k, row) in rows.into_iter().enumerate() {
                        // Of samples that come at once the times of arrival still differ.
                        self.sample(arrival.source, arrival.at_ns + k as i64, row)?;
                    }
                }
                Err(SourceError::Ended(_)) => came = Came::End,
                Err(error) => return Err(error.to_string()),
            }
            next = if self.feeds.now_ns() < until_ns { self.feeds.next(Duration::ZERO) } else { None };
        }
        self.write_through()?;
        if came == Came::End {
            return Ok(came);
        }
        let now = self.feeds.now_ns();
        match self.streams.iter().position(|s| now - s.heard_ns > SILENT_NS) {
            None => Ok(came),
            Some(silent) => Err(self.why_silent(silent)),
        }
    }

    /// Says why nothing new arrived from a source.
    fn why_silent(&self, source: usize) -> String {
        let (url, when_silent) = self
            .streams
            .get(source)
            .map(|s| (s.asked.url.to_string(), s.when_silent.as_str()))
            .unwrap_or_default();
        let seconds = SILENT_NS / 1_000_000_000;
        match self.feeds.losses(source).late {
            0 => format!("{url} has sent nothing for {seconds} s: {when_silent}"),
            late => format!(
                "{url} has sent nothing new for {seconds} s, and {late} samples late or twice: does its \
                 time or its number stand still, or has it \
                 gone back?"
            ),
        }
    }

    fn write_through(&mut self) -> Result<(), String> {
        let now = self.feeds.now_ns();
        if now - self.flushed_ns < 1_000_000_000 {
            return Ok(());
        }
        self.flushed_ns = now;
        for stream in &mut self.streams {
            if let Some(writer) = &mut stream.writer {
                writer.flush().map_err(|e| format!("{} cannot be written on: {e}", stream.file))?;
            }
        }
        Ok(())
    }

    fn sample(&mut self, source: usize, at_ns: i64, row: Row) -> Result<(), String> {
        let Some(stream) = self.streams.get_mut(source) else { return Ok(()) };
        let Some(clock) = self.clocks.get_mut(stream.clock) else { return Ok(()) };
        let passed_ns = at_ns.saturating_sub(std::mem::replace(&mut stream.heard_ns, at_ns));
        let own_ns = match row.time_ns.filter(|_| !clock.is_arrival) {
            Some(time_ns) => {
                let zero = *clock.zero_ns.get_or_insert(time_ns);
                time_ns.saturating_sub(zero)
            }
            None => at_ns,
        };
        let step_ns = stream.last_ns.map_or(0, |last| own_ns.saturating_sub(last));
        if step_ns.saturating_sub(passed_ns) > JUMP_NS {
            return Err(format!(
                "{}: its time jumps on by {:.1} s where {:.1} s pass: was its clock set in mid-run? Run \
                 again",
                stream.asked.url,
                step_ns as f64 * 1e-9,
                passed_ns as f64 * 1e-9
            ));
        }
        if stream.last_ns.is_some_and(|last| own_ns <= last) {
            stream.backwards += 1;
            if stream.backwards >= BACKWARDS {
                return Err(format!(
                    "{}: its time went back and did not come on again: was it switched off and on? Run again",
                    stream.asked.url
                ));
            }
            return Ok(());
        }
        stream.backwards = 0;
        stream.last_ns = Some(own_ns);
        stream.samples += 1;
        if !clock.is_arrival {
            clock.arrivals.note(own_ns as f64 * 1e-9, at_ns as f64 * 1e-9);
        }
        Self::write(stream, own_ns, &row.values)?;
        if !self.begun {
            stream.pending.push((own_ns, row.values));
            return Ok(());
        }
        if at_ns - clock.looked_ns > ANEW_NS {
            clock.looked_ns = at_ns;
            clock.line = clock.arrivals.line().filter(|_| !clock.is_arrival).unwrap_or(clock.line);
        }
        self.growing.push(source, clock.line.here_ns(own_ns), row.values);
        Ok(())
    }

    fn write(stream: &mut Stream, own_ns: i64, values: &[f64]) -> Result<(), String> {
        let Some(writer) = &mut stream.writer else { return Ok(()) };
        let sign = if own_ns < 0 { "-" } else { "" };
        let mut line = format!("{sign}{}", time::text(own_ns.unsigned_abs()));
        for value in values {
            // As many digits as it takes to read the same number back.
            line.push_str(&format!(",{value:?}"));
        }
        line.push('\n');
        writer.write_all(line.as_bytes()).map_err(|e| format!("{} cannot be written on: {e}", stream.file))
    }

    /// Puts the clocks beside each other by what has come until now, and everything onto the time base.
    ///
    /// # Errors
    /// In words: a clock that goes wrong, or clocks that are not one.
    pub(super) fn begin(&mut self) -> Result<(), String> {
        self.check_shared()?;
        for stream in &self.streams {
            let Some(clock) = self.clocks.get_mut(stream.clock).filter(|c| !c.is_arrival) else { continue };
            let Some(line) = clock.arrivals.line() else { continue };
            (clock.line, clock.looked_ns) = (line, self.feeds.now_ns());
            if !clock.counts && (line.rate - 1.0).abs() > OFF {
                return Err(wrong_rate(stream, line.rate));
            }
        }
        self.begun = true;
        for source in 0..self.streams.len() {
            let Some(stream) = self.streams.get_mut(source) else { continue };
            let line =
                self.clocks.get(stream.clock).map_or(ClockLine { offset_s: 0.0, rate: 1.0 }, |c| c.line);
            for (own_ns, values) in std::mem::take(&mut stream.pending) {
                self.growing.push(source, line.here_ns(own_ns), values);
            }
        }
        Ok(())
    }

    /// Sources that share a clock must be stamped by one.
    fn check_shared(&self) -> Result<(), String> {
        for (k, stream) in self.streams.iter().enumerate() {
            let before = self.streams.get(..k).unwrap_or_default();
            let Some(other) = before.iter().find(|other| other.clock == stream.clock) else { continue };
            let last_s = |s: &Stream| s.pending.last().map_or(0.0, |(own, _)| *own as f64 * 1e-9);
            let apart_s = last_s(stream) - last_s(other);
            if apart_s.abs() > APART_S {
                return Err(format!(
                    "{} and {} are stamped by one clock, and their stamps are {apart_s:.1} s apart: the \
                     stamps of one of them are not of \
                     it (a device's own, a bag's, a computer's whose clock is not set). Take the bridge's \
                     time for that one by \
                     ?stamp=bridge, or give it a clock of its own by ?clock=own",
                    other.asked.url, stream.asked.url
                ));
            }
        }
        Ok(())
    }

    /// Returns the streams on the common time base.
    pub(super) fn growing(&mut self) -> &mut Growing {
        &mut self.growing
    }

    /// Returns the rig file that lists the files, with the clocks as all arrivals have them.
    pub(super) fn listing(&self, rig: &RigFile) -> RigFile {
        let table = |stream: &Stream| {
            let clock = self.clocks.get(stream.clock);
            let line = clock.filter(|c| !c.is_arrival).and_then(|c| c.arrivals.line());
            let line = line.unwrap_or(ClockLine { offset_s: 0.0, rate: 1.0 });
            StreamTable {
                file: stream.file.clone(),
                topic: None,
                columns: BTreeMap::new(),
                rotation_matrix: None,
                clock_offset_s: line.offset_s,
                clock_rate: line.rate,
            }
        };
        let mut listing = rig.clone();
        listing.recording.columns.clear();
        listing.recording.topics.clear();
        // The sign is the sources' own, and stays to be applied.
        listing.stream = self.streams.iter().map(table).collect();
        listing
    }

    /// Ends the files.
    pub(super) fn close(&mut self) -> Result<(), String> {
        for stream in &mut self.streams {
            let Some(writer) = stream.writer.take() else { continue };
            let ended =
                writer.into_inner().map_err(std::io::IntoInnerError::into_error).and_then(|f| f.sync_all());
            ended.map_err(|e| format!("{} cannot be written on: {e}", stream.file))?;
        }
        Ok(())
    }

    /// Returns where the numbers come from.
    pub(super) fn provenance(&self) -> Vec<(String, String)> {
        let one = |stream: &Stream| {
            let roles: Vec<String> = stream.asked.roles.iter().map(Role::to_string).collect();
            (format!("Source of {}", roles.join(", ")), stream.asked.url.to_string())
        };
        self.streams.iter().map(one).collect()
    }

    /// Returns the warnings of what was lost, and whose time is of arrivals.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for (number, stream) in self.streams.iter().enumerate() {
            let losses = self.feeds.losses(number);
            let url = &stream.asked.url;
            let all = stream.samples + losses.lost + losses.damaged + losses.others + losses.faulty;
            for (count, what) in [
                (
                    losses.lost,
                    "never came, by their sequence numbers or times; the answer is made of the others",
                ),
                (losses.late, "came twice or late, and are left out"),
                (losses.damaged, "came damaged or of an impossible time, and are left out"),
                (
                    losses.others,
                    "came from other senders than the first, and are left out: ?from=HOST says whose are \
                     taken",
                ),
                (losses.faulty, "are left out: the sensor itself reports an error"),
            ] {
                if count > 0 {
                    let status = losses.status.filter(|_| what.contains("itself"));
                    let status =
                        status.map_or_else(String::new, |status| format!(" (status {status:#010x})"));
                    warnings.push(format!(
                        "{url}: {} of {all} {what}{status}",
                        counted(usize::try_from(count).unwrap_or(usize::MAX), "sample", "samples")
                    ));
                }
            }
            if stream.own == OwnClock::Arrival {
                warnings.push(format!(
                    "{url} does not say when its samples were taken: their times are those of arrival; a \
                     column t_s or seq, or its own \
                     time switched on, makes the answer better"
                ));
            }
        }
        warnings
    }
}

fn wrong_rate(stream: &Stream, rate: f64) -> String {
    let seconds = 1.0 / rate;
    let unit = [(1e3, "milliseconds", "1e-3"), (1e6, "microseconds", "1e-6"), (1e9, "nanoseconds", "1e-9")];
    let unit = unit.iter().find(|(scale, ..)| (seconds / scale - 1.0).abs() < 0.1);
    let url = &stream.asked.url;
    match unit {
        Some((_, name, scale)) => format!(
            "{url}: its time counts {name}: say so in the rig file, [recording.columns] t_s = {{ name = \
             \"…\", scale = {scale} }}"
        ),
        None => format!(
            "{url}: its clock makes {seconds:.4} s of a second here, which no clock does: is its rate \
             (?rate_hz=), or the unit of its time, \
             another one? A recorded file is for `identify()`"
        ),
    }
}
