//! A recording of a robot streamed to the firmware, which finds what changes of one of its links.

use std::path::{Path, PathBuf};

use rigident_shared::wire::{ChangeReport, ChangeSize, ErrorCode, SettingName};
use serde::Serialize;

use super::device_error::DeviceError;
use super::recorded::{named, refuse_several};
use super::tree::{change_as_recorded, tree_of};
use super::watch_error::WatchError;
use super::{Caller, Error, Tree};
use rigident_device::link::{BAUD, LinkError, SerialTransport, Transport};
use rigident_device::microcontroller::{self, Image, Microcontroller, MicrocontrollerError};
use rigident_device::session::SessionError;
use rigident_device::session::streamed::{Pace, Watched, line_need};
use rigident_device::session::tree::complaints;
use rigident_device::session::watched::{self, WatchedRobot};
use rigident_fit::Progress;
use rigident_io::recording::Recording;
use rigident_rows::tree::ProblemOptions;
use rigident_rows::tree::prepare::{PreparedTree, prepare};

/// Names and units of a link's parameters.
pub const PARAMETERS: [(&str, &str); 10] = [
    ("mass", "kg"),
    ("mcx", "kg m"),
    ("mcy", "kg m"),
    ("mcz", "kg m"),
    ("Ixx", "kg m²"),
    ("Iyy", "kg m²"),
    ("Izz", "kg m²"),
    ("Iyz", "kg m²"),
    ("Ixz", "kg m²"),
    ("Ixy", "kg m²"),
];
/// Beyond this multiple of the limit of noise a change must be three times as large, which is reported.
const BLIND: u32 = 10;
/// Coverage factor of a 95 % uncertainty.
const COVERAGE: f64 = 1.96;
/// Of the line's rate frames may take this much.
const LINE_SHARE: f64 = 0.95;

/// The link that is watched, and how.
#[derive(Clone, Debug)]
pub struct WatchOptions {
    /// The link that may change.
    pub link: String,
    /// The robot; without a model the `[[link]]` tables of the rig file.
    pub tree: Tree,
    /// Rig file. Default: `NAME.rig.toml` beside the recording.
    pub rig: Option<PathBuf>,
    /// The microcontroller that watches. Default: this process.
    pub mcu: Microcontroller,
    /// Rate of the line to a device on a port while it watches, baud; `None`: the usual one.
    pub baud: Option<u32>,
    /// False alarms per hour at most, of noise alone.
    pub false_alarms_per_hour: f64,
    /// Nothing is found in the first seconds, s.
    pub settle_s: f64,
}

impl WatchOptions {
    /// Returns those of a link, 0.1 false alarms per hour, 20 s to settle.
    pub fn of(link: &str) -> Self {
        let watched::WatchOptions { false_alarms_per_hour, settle_s } = watched::WatchOptions::default();
        Self {
            link: link.to_owned(),
            tree: Tree::default(),
            rig: None,
            mcu: Microcontroller::default(),
            baud: None,
            false_alarms_per_hour,
            settle_s,
        }
    }
}

/// The result of watching a link in a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WatchedLink {
    /// The end of it.
    pub status: WatchStatus,
    /// The link.
    pub link: String,
    /// Changes in the order in which they were found.
    pub changes: Vec<Change>,
    /// The limit by that of noise: errors of the model make it larger.
    pub excess: f64,
    /// Counts of the frames that were sent, taken and lost.
    pub frames: FrameCounts,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    /// True if nothing was left unseen: it settled, came to its end, and its limit is not far above that of
    /// noise.
    #[serde(skip)]
    pub is_whole: bool,
    /// Changes that the device counted.
    #[serde(skip)]
    pub counted: u16,
    /// The recording's time that was watched, s.
    #[serde(skip)]
    pub watched_s: f64,
    /// Frames of the recording.
    #[serde(skip)]
    pub all_frames: usize,
    /// Why it ended early, if it did.
    #[serde(skip)]
    pub broken: Option<String>,
}

/// The end of a watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum WatchStatus {
    /// It ended early.
    #[serde(rename = "broken")]
    Broken,
    /// It came to the end of the recording.
    #[serde(rename = "watched")]
    Watched,
    /// The recording ended before the watch had settled.
    #[serde(rename = "not settled")]
    NotSettled,
}

/// A change of a link. Times are the recording's, s.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The number of the change, from one.
    pub change: u16,
    /// When it was found.
    pub found_s: f64,
    /// When it happened.
    pub at_s: f64,
    /// Not before the one, and not after the other.
    pub between_s: [f64; 2],
    /// The squares that the change explains, divided by the limit for a change.
    pub times_the_limit: f32,
    /// The parameters that the motion determines of it; `None`: it was not measured to the end.
    pub size: Option<Vec<ParameterChange>>,
}

/// The change of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterChange {
    /// The name of the parameter.
    pub name: &'static str,
    /// The unit of the parameter.
    pub unit: &'static str,
    /// The value after the change minus the value before it.
    pub change: f32,
    /// 95 % expanded uncertainty.
    pub u95: f64,
}

/// Counts of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FrameCounts {
    /// Frames that were sent.
    pub sent: u32,
    /// Frames that the device heard of.
    pub given: u32,
    /// Frames that the device took in.
    pub taken: u32,
    /// Frames that are missing in the series.
    pub missing: u32,
    /// Frames that were lost on the way.
    pub lost: u32,
    /// Frames that came twice.
    pub repeated: u32,
    /// Frames that came after a later one.
    pub late: u32,
    /// Frames that came while the device did not watch.
    pub unasked: u32,
    /// The number of times that the device had no room.
    pub overruns: u32,
}

/// Has the firmware watch a link in a recording. `noted` hears what was done with the recording, `found` a
/// change when it is found, and again when it has been measured.
///
/// # Errors
/// Something cannot be read, or does not fit; [`Error::Watch`] and [`Error::Device`] if the firmware cannot
/// watch it; the caller stops the job. What fails later is in [`WatchedLink::broken`].
///
/// ```
/// use rigident::application::{Caller, Error, WatchError, WatchOptions, watch};
///
/// let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/bracket.csv"); let options =
/// WatchOptions::of("hand"); let refused = watch(bracket.as_ref(), &options, &mut |_| {}, &mut |_| {},
/// &Caller::default()).unwrap_err(); assert!(matches!(refused, Error::Watch(why) if matches!(*why,
/// WatchError::NoModel)));
/// ```
pub fn watch(
    recording: &Path,
    options: &WatchOptions,
    noted: &mut dyn FnMut(&str),
    found: &mut dyn FnMut(&Change),
    caller: &Caller<'_>,
) -> Result<WatchedLink, Error> {
    caller.stoppable(|| {
        let (prepared, robot) = prepared(&named(recording.to_owned()), options, noted, caller)?;
        let input = &prepared.input;
        caller.stage("frames to the firmware", 0.0);
        let clock = Clock {
            start_s: input.frames.first().map_or(0.0, |frame| frame.time_ns as f64 * 1e-9),
            rate_hz: input.rate_hz,
        };
        let (line, pace) = line(options, &robot, input.rate_hz)?;
        let mut session = microcontroller::session(line).map_err(DeviceError::from)?;
        let mut reported = |change: &ChangeReport| found(&clock.change(change, change));
        let watched = session.watch_robot(&robot, pace, &mut reported).map_err(refused)?;
        let names: Vec<String> = input.model.links.iter().map(|link| link.name.clone()).collect();
        Ok(concluded(&watched, &options.link, &names, &clock, robot.frames.len()))
    })
}

/// Reads the recording, and makes the robot ready for the device.
fn prepared(
    path: &Path,
    options: &WatchOptions,
    noted: &mut dyn FnMut(&str),
    caller: &Caller<'_>,
) -> Result<(PreparedTree, WatchedRobot), Error> {
    let (rate, settle_s) = (options.false_alarms_per_hour, options.settle_s);
    if !rate.is_finite() || rate <= 0.0 || rate > 60.0 {
        return Err(WatchError::FalseAlarms(rate).into());
    }
    if !(1.0..=3600.0).contains(&settle_s) {
        return Err(WatchError::Settle(settle_s).into());
    }
    let rig = options.rig.as_deref();
    refuse_several(path, rig, "watch")?;
    caller.stage(&format!("reading {}", path.display()), 0.0);
    let (mut model, _) = tree_of(path, rig, &options.tree)?.ok_or(WatchError::NoModel)?;
    let mut recording = Recording::load(path, rig)?;
    recording.leave_out_bad_readings();
    let notes = change_as_recorded(&mut model, &options.tree.changes, &recording, caller)?;
    let prepared = prepare(&recording, &model, &ProblemOptions::default())?;
    let limits = watched::WatchOptions { false_alarms_per_hour: rate, settle_s };
    let robot = WatchedRobot::new(&prepared.input, &options.link, &limits).map_err(WatchError::from)?;
    notes.iter().chain(&prepared.notes).chain(&prepared.warnings).for_each(|note| noted(note));
    Ok((prepared, robot))
}

/// Opens the firmware that watches: a simulated one takes frames as fast as it can, one on a port when they
/// are due.
fn line(
    options: &WatchOptions,
    robot: &WatchedRobot,
    rate_hz: f64,
) -> Result<(Box<dyn Transport>, Pace), Error> {
    let Microcontroller::Port(name) = &options.mcu else {
        let line = options.mcu.open(Image::Watch).map_err(DeviceError::from)?;
        return match options.baud {
            Some(baud) => Err(WatchError::NoLine { baud, mcu: options.mcu.name() }.into()),
            None => Ok((line, Pace::AsTaken)),
        };
    };
    let port = SerialTransport::open(name).map_err(MicrocontrollerError::from).map_err(DeviceError::from)?;
    let need = line_need(&robot.frames, rate_hz);
    let baud = options.baud.unwrap_or(BAUD);
    if port.has_rate() && need > LINE_SHARE * f64::from(baud) {
        let (links, feet) = (robot.links.len(), robot.feet());
        return Err(WatchError::SlowLine { port: name.clone(), rate_hz, links, feet, need, baud }.into());
    }
    Ok((Box::new(port), Pace::RealTime { rate_hz, baud: options.baud }))
}

fn refused(error: SessionError) -> Error {
    match error {
        SessionError::Link(LinkError::Refused { code: ErrorCode::NotBuiltIn, .. }) => {
            WatchError::NotBuiltIn.into()
        }
        SessionError::Link(LinkError::Refused { code: ErrorCode::BadSetting(name), .. }) => match name {
            SettingName::LineRate => WatchError::LineRate.into(),
            SettingName::Link(link) => WatchError::Link(link).into(),
            other => WatchError::Setting(other).into(),
        },
        other => DeviceError::from(other).into(),
    }
}

/// The times of frames by their numbers.
struct Clock {
    start_s: f64,
    rate_hz: f64,
}

impl Clock {
    fn at(&self, number: u32) -> f64 {
        self.start_s + f64::from(number) / self.rate_hz
    }

    /// Returns a change as it was found, and as it was reported last.
    fn change(&self, found: &ChangeReport, last: &ChangeReport) -> Change {
        Change {
            change: found.change,
            found_s: self.at(found.found),
            at_s: self.at(last.at),
            between_s: last.between.map(|number| self.at(number)),
            times_the_limit: found.ratio,
            size: last.size.as_ref().map(size),
        }
    }
}

/// Returns what the motion determines of a change.
fn size(size: &ChangeSize) -> Vec<ParameterChange> {
    let all = PARAMETERS.iter().zip(size.change.iter().zip(&size.standard_deviation));
    all.filter(|(_, (_, sd))| sd.is_finite())
        .map(|(&(name, unit), (change, sd))| ParameterChange {
            name,
            unit,
            change: *change,
            u95: COVERAGE * f64::from(*sd),
        })
        .collect()
}

/// Returns what a watch found, and what is to be said of it.
fn concluded(
    watched: &Watched,
    link: &str,
    names: &[String],
    clock: &Clock,
    all_frames: usize,
) -> WatchedLink {
    let (report, frames) = (&watched.counters.watch, &watched.counters.frames);
    // What was lost on the way is missing in the series, too.
    let mut of_series = *frames;
    of_series.missing = of_series.missing.saturating_sub(report.stream.lost);
    let mut warnings = complaints(&of_series, names);
    warnings.extend(of_the_link(watched));
    let blind = blind(watched);
    let is_whole = report.settled && !watched.interrupted && blind.is_none();
    warnings.extend(blind);
    let last = |change: &ChangeReport| {
        watched.changes.iter().rfind(|other| other.change == change.change).copied().unwrap_or(*change)
    };
    let found = watched.changes.iter().filter(|change| change.size.is_none());
    WatchedLink {
        status: match &watched.broken {
            Some(_) => WatchStatus::Broken,
            None if report.settled => WatchStatus::Watched,
            None => WatchStatus::NotSettled,
        },
        link: link.to_owned(),
        changes: found.map(|change| clock.change(change, &last(change))).collect(),
        excess: f64::from(report.excess_percent) / 100.0,
        frames: FrameCounts {
            sent: watched.sent,
            given: frames.frames,
            taken: frames.absorbed,
            missing: frames.missing,
            lost: watched.lost(),
            repeated: report.stream.repeated,
            late: report.stream.late,
            unasked: report.stream.unasked,
            overruns: watched.counters.overruns,
        },
        warnings,
        is_whole,
        counted: report.changes,
        watched_s: f64::from(frames.absorbed) / clock.rate_hz,
        all_frames,
        broken: watched.broken.as_ref().map(ToString::to_string),
    }
}

/// Returns what became of frames on the way.
fn of_the_link(watched: &Watched) -> Vec<String> {
    let (stream, counters) = (&watched.counters.watch.stream, &watched.counters);
    let counts = [
        (
            watched.lost(),
            "were lost on the way to the device: check the cable, and that nothing else keeps this computer \
             busy",
        ),
        (stream.repeated, "came twice, and were taken once"),
        (stream.late, "came after a later one, and were left out"),
        (stream.unasked, "came while the device did not watch"),
    ];
    let mut said: Vec<String> =
        counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} frames {what}")).collect();
    if counters.overruns > 0 {
        said.push(format!("{} times the device had no room for what came over its line", counters.overruns));
    }
    said
}

/// Returns the warning of a limit that few changes exceed.
fn blind(watched: &Watched) -> Option<String> {
    let times = watched.counters.watch.excess_percent / 100;
    (times > BLIND).then(|| {
        format!(
            "the limit is {times} times that of noise, so only a change that is larger by the root of it is \
             found: the model does not fit the recording, or the link \
             changed while the watch settled; identify the model anew, or begin where nothing changes"
        )
    })
}
