//! The common part of `demo`, `run` and `replay`: watching an experiment, recording it, judging it.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use hexapod::experiment::SHORTEST_S;
use rigident_shared::forgetting::Span;
use rigident_shared::screening::CHANNEL_NAMES;
use rigident_shared::wire::{
    ClockSource, Consistency, EstimateReport, Identity, LinkReadingMessage, ReadingMessage, Reason,
    ResetReason, StopRule,
};

use super::arguments::Output;
use super::came::Came;
use super::next_move::NextMove;
use super::options::stop_criterion::{self, StopCriterion};
use super::run_report::{Outlet, finish};
use super::tracking_error::{MotionLog, TrackingError};
use super::{ExitStatus, Failure, Folder, Progress, Stages};
use rigident::application::loaded::PLOT_POINTS;
use rigident::application::tare::take_off;
use rigident::application::{Loaded, Report};
use rigident::device::link::TakenFactor;
use rigident::device::platform::MotionSample;
use rigident::device::session::tree::complaints;
use rigident::device::session::{Observer, Take, widen};
use rigident::fit::figures::counted;
use rigident::present::{Decided, Stage};
use rigident_fit::prior::KnownValues;
use rigident_fit::tare::Tare;
use rigident_fit::{Convergence, DeviceFactor, Measured};
use rigident_io::behind::Behind;
use rigident_io::recording::comment_in_words;
use rigident_io::recording::mcap::messages::ImuValues;
use rigident_io::recording::mcap::write::{Head, McapWriter, Row};
use rigident_io::rig::RigFile;

/// Parameters of one body with the offset.
const ONE_BODY: usize = 16;
/// Noise alone seldom takes an answer so far from what a body can have, standard deviations.
const DOUBTFUL_SD: f32 = 3.0;

/// Checks whether poses and motion fit into the given time, s.
pub(super) fn check_duration(duration_s: f64) -> Result<(), Failure> {
    if (SHORTEST_S..=3600.0).contains(&duration_s) {
        return Ok(());
    }
    Err(Failure::input(format!(
        "--duration-s {duration_s}: the five poses and the motion take {SHORTEST_S} s at least, and 3600 s are enough"
    )))
}

/// Shows progress and writes every reading into the recording.
pub(super) struct Watcher {
    progress: Progress,
    started: Instant,
    writer: Option<McapWriter<Behind>>,
    path: PathBuf,
    latest: Option<EstimateReport>,
    expected: usize,
    /// Further knowledge, in words.
    pub(super) state: Option<String>,
    /// The log of the platform's motion.
    pub(super) motion: Option<MotionLog>,
    /// Of a body that is moved by hand.
    pub(super) next_move: Option<NextMove>,
}

impl Watcher {
    /// Without a recording.
    pub(super) fn new(expected: usize) -> Self {
        Self {
            progress: Progress::new(),
            started: Instant::now(),
            writer: None,
            path: PathBuf::new(),
            latest: None,
            expected,
            state: None,
            motion: None,
            next_move: None,
        }
    }

    /// With a recording at `path`, the rig file inside.
    pub(super) fn recording(
        path: PathBuf,
        rig: &RigFile,
        comments: &[(String, String)],
        expected: usize,
    ) -> Result<Self, Failure> {
        let text = rig.to_toml();
        let comments: Vec<_> = comments.iter().map(|(what, said)| comment_in_words(what, said)).collect();
        let head = Head { rig: rig.clone(), rig_text: Some(&text), comments: &comments, ..Head::default() };
        let writer = McapWriter::create(&path, &head).map_err(Failure::input)?;
        Ok(Self { writer: Some(writer), path, ..Self::new(expected) })
    }

    fn append(&mut self, row: &Row<'_>) -> Result<(), String> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        writer
            .append(row)
            .map_err(|e| format!("{}: {e}; what was written until then is readable", self.path.display()))
    }

    /// Ends the recording. One that cannot be ended is a broken experiment, unless it was broken before.
    pub(super) fn end(&mut self, take: &mut Take) {
        if let Err(failure) = self.finish() {
            take.broken.get_or_insert_with(|| failure.to_string());
        }
    }

    /// Ends the recording.
    pub(super) fn finish(&mut self) -> Result<(), Failure> {
        self.progress.finish();
        self.writer.take().map_or(Ok(()), |w| w.close().map_err(Failure::input))
    }
}

/// Returns what the device's own estimate comes to, in words.
pub(super) fn in_words(report: &EstimateReport) -> String {
    // Against the largest of its kind: a true zero has no relative uncertainty of its own.
    let worst = [0..1, 1..4, 4..10]
        .into_iter()
        .filter_map(|kind| {
            let values = report.estimate.get(kind.clone())?;
            let scale = values.iter().fold(0.0_f32, |s, v| s.max(v.abs()));
            let sds = report.standard_deviation.get(kind)?;
            Some(100.0 * sds.iter().fold(0.0_f32, |s, v| s.max(*v)) / scale)
        })
        .filter(|v| v.is_finite())
        .fold(0.0_f32, f32::max);
    let apart = match report.consistency {
        // Of several links it is never judged.
        Consistency::NotDetermined if report.estimate.len() <= ONE_BODY => {
            ", no body determined yet".to_owned()
        }
        _ if report.distance_sd > DOUBTFUL_SD => format!(", {:.1} sd from any body", report.distance_sd),
        _ => String::new(),
    };
    format!("condition {:.1}, worst relative sd {worst:.1} %{apart}", report.condition_number)
}

/// Returns how long the rest takes at this rate, 1/s, in words; nothing where that is not known.
fn time_left(readings: usize, expected: usize, rate: f64) -> String {
    let left_s = expected.saturating_sub(readings) as f64 / rate;
    if expected == 0 || readings == 0 || !left_s.is_finite() {
        String::new()
    } else if left_s < 90.0 {
        format!(", {left_s:.0} s left")
    } else {
        format!(", {:.0} min left", left_s / 60.0)
    }
}

fn imu_values(specific_force: [f32; 3], angular_rate: [f32; 3]) -> ImuValues {
    ImuValues { accel: Some(specific_force.map(f64::from)), gyro: Some(angular_rate.map(f64::from)) }
}

/// A row of what the sensors on the load cell's body read, and the IMUs.
fn row<'a>(reading: &ReadingMessage, imus: &'a [ImuValues], attitudes: &'a [(usize, [f64; 4])]) -> Row<'a> {
    let wrench = Some(reading.wrench.map(f64::from));
    Row { time_ns: reading.time_ns, wrench, imus, attitudes, ..Row::default() }
}

impl Observer for Watcher {
    fn reading(&mut self, reading: &ReadingMessage) -> Result<(), String> {
        let imu = imu_values(reading.specific_force, reading.angular_rate);
        if let Some(next) = &mut self.next_move {
            next.take(widen(reading));
        }
        self.append(&row(reading, &[imu], &[]))
    }

    fn link_reading(&mut self, reading: &LinkReadingMessage) -> Result<(), String> {
        let base = &reading.base;
        let imus = [
            imu_values(base.specific_force, base.angular_rate),
            imu_values(reading.specific_force, reading.angular_rate),
        ];
        let attitude = reading.attitude_wxyz.map(f64::from);
        self.append(&row(base, &imus, &[(1, attitude)]))
    }

    fn estimate(&mut self, report: &EstimateReport) {
        self.latest = Some(report.clone());
    }

    fn motion(&mut self, sample: &MotionSample) -> Result<(), String> {
        self.motion.as_mut().map_or(Ok(()), |log| log.append(sample))
    }

    fn progress(&mut self, readings: usize) {
        if let Some(news) = self.next_move.as_mut().and_then(NextMove::news) {
            self.progress.finish();
            tell!("next: {news}");
        }
        let (started, expected, latest, known) = (self.started, self.expected, &self.latest, &self.state);
        self.progress.show(|| {
            let rate = readings as f64 / started.elapsed().as_secs_f64();
            let share = if expected > 0 { format!(" of {expected}") } else { String::new() };
            let left = time_left(readings, expected, rate);
            let state = latest.as_ref().map_or_else(String::new, |report| format!(", {}", in_words(report)));
            let known = known.as_deref().unwrap_or_default();
            format!("{readings}{share} readings, {rate:.0}/s{left}{state}{known}")
        });
    }
}

/// Returns what the device said of itself.
pub(super) fn device_notes(identity: &Identity) -> Vec<(String, String)> {
    let [major, minor, patch] = identity.firmware_version;
    let board: String = identity.board.iter().take_while(|b| **b != 0).map(|b| char::from(*b)).collect();
    vec![
        ("Board".to_owned(), board),
        ("Firmware".to_owned(), format!("{major}.{minor}.{patch}")),
        ("Firmware, hash of its sources".to_owned(), format!("{:08x}", identity.firmware_hash)),
    ]
}

/// Returns what the device said of its start.
pub(super) fn boot_notes(identity: &Identity) -> [(&'static str, &'static str); 2] {
    [("Started by", started_by(identity.reset)), ("Time from", time_from(identity.clock))]
}

/// Returns what is to be said of a device whose times are not those of a crystal.
pub(super) fn doubtful_clock(clock: ClockSource) -> Option<String> {
    matches!(clock, ClockSource::Internal | ClockSource::Slow)
        .then(|| format!("the device takes its time from {}", time_from(clock)))
}

fn started_by(reset: ResetReason) -> &'static str {
    match reset {
        ResetReason::PowerOn => "power coming on",
        ResetReason::BrownOut => "a supply that sagged: look at its cable and what else hangs on it",
        ResetReason::Pin => "the reset pin",
        ResetReason::Software => "its own program",
        ResetReason::Watchdog => "its watchdog, because the program had stopped",
        ResetReason::Panic => "a panic of its program",
        ResetReason::Fault => "a fault of its processor",
        ResetReason::ClockLost => "the loss of its crystal",
        ResetReason::Unknown => "something that it does not tell",
    }
}

fn time_from(clock: ClockSource) -> &'static str {
    match clock {
        ClockSource::Simulated => "the simulator",
        ClockSource::Crystal => "a crystal",
        ClockSource::Internal => {
            "the chip's own oscillator, because the crystal does not start: off by up to 1 % at 25 °C, 4 % elsewhere"
        }
        ClockSource::Slow => "the chip's own oscillator, unmultiplied: the board is too slow for its sensors",
        ClockSource::Emulated => "the emulator",
    }
}

/// Returns true if the device said that its stop criterion is reached.
fn was_reached(take: &Take) -> bool {
    take.states.iter().any(|(_, reason)| *reason == Reason::StopRule)
}

/// Returns what is to be said of a take, whatever it was of.
fn noticed(take: &Take, seconds: f64) -> Vec<String> {
    let mut warnings = Vec::new();
    let counters = &take.counters;
    let lost = "lost between device and host; the answer is made of the others";
    let (sample, samples) = ("sample", "samples");
    for (count, one, many, what) in [
        (take.missing, "reading", "readings", lost),
        (
            counters.load_cell_crc_errors,
            sample,
            samples,
            "of the load cell left out: the check sum was wrong",
        ),
        (counters.imu_errors, sample, samples, "of the IMU could not be read"),
        (counters.second_imu_errors, sample, samples, "of the second link's IMU could not be read"),
        (
            counters.lost.iter().fold(0, |sum, lost| lost.saturating_add(sum)),
            sample,
            samples,
            "of the sensors came when the board had no room",
        ),
        (counters.gaps, "gap", "gaps", "in time; the filter started anew after it"),
        (
            counters.telemetry_dropped,
            "message",
            "messages",
            "of the device dropped for want of room on the link",
        ),
    ] {
        if count > 0 {
            warnings.push(format!("{} {what}", counted(count as usize, one, many)));
        }
    }
    if was_reached(take) {
        tell!("the uncertainties asked for were reached; {seconds:.1} s were taken in");
    }
    if take.cut_short {
        warnings.push("ended before the programme's end, after the time of --at-most-s".to_owned());
    }
    if take.interrupted {
        warnings.push("stopped by Ctrl-C before the end".to_owned());
    }
    warnings
}

/// Returns what is to be said of a host that stood still, if it did.
fn stalled(take: &Take) -> Option<String> {
    (take.resumed > 0).then(|| {
        format!(
            "{} the device stopped because it did not hear this program, and was started again: this program stood still in the middle \
             of the experiment, and the readings of that time are missing. Run on a host that is less busy",
            counted(take.resumed, "time", "times")
        )
    })
}

/// An experiment that is over.
pub(super) struct Experiment<'a> {
    pub(super) started: Instant,
    pub(super) output: &'a Output,
    pub(super) stop: &'a StopCriterion,
    /// The input that the device was given, or reported.
    pub(super) loaded: Loaded,
    pub(super) mcu: &'a str,
    pub(super) identity: &'a Identity,
    /// The prior knowledge.
    pub(super) known: &'a KnownValues,
    pub(super) tare: Option<Tare>,
    /// The rule that the device was given, if it decides when to end.
    pub(super) until: Option<StopRule>,
    /// The way older rows are forgotten, if they are.
    pub(super) span: Option<Span<f64>>,
    /// True values of the parameters in the device's order.
    pub(super) parameter_truth: Option<&'a [f64]>,
    pub(super) stages: Vec<Stage>,
    /// Spans of the first pose and of the same pose at the end, s from the first reading.
    pub(super) same_pose: Option<[(f64, f64); 2]>,
    /// The tracking of the platform.
    pub(super) tracking_error: Option<TrackingError>,
    /// Segments that were decided on, and their results.
    pub(super) decisions: Vec<Decided>,
    /// The point to which the decisions proceeded, and why not farther.
    pub(super) came: Option<Came>,
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

impl Experiment<'_> {
    /// Judges the device's factor by its readings and concludes the command.
    ///
    /// # Errors
    /// The readings make no rows, what is known contradicts them, a file cannot be written, or the experiment broke off.
    pub(super) fn conclude(self, mut take: Take, folder: &Folder) -> Result<ExitCode, Failure> {
        let mut warnings = self.warnings;
        let mut notes = self.notes;
        if let Some(stalled) = stalled(&take) {
            take.broken.get_or_insert(stalled);
        }
        let seconds = self.loaded.origin(self.mcu).duration_s.unwrap_or(0.0);
        warnings.extend(noticed(&take, seconds));
        warnings.extend(doubtful_clock(self.identity.clock));
        if take.levels > 0 {
            let times = counted(take.levels as usize, "time", "times");
            tell!("a level of the factor was taken from the device {times} and merged here");
        }
        let names = self.loaded.link_names();
        warnings.extend(complaints(&take.counters.frames, &names));
        let kept = |error: &dyn std::fmt::Display| {
            let place = folder.path().display();
            match &take.broken {
                Some(broken) => Failure::link(format!("{broken}\nWhat was recorded is in {place}: {error}")),
                None => {
                    Failure::input(format!("{error}\nFiles written before this was found out are in {place}"))
                }
            }
        };
        let stages = Stages::new("estimate");
        let (loaded, mut found, mcu) = match take.factor.clone() {
            Some(TakenFactor { factor, gram }) => {
                let device = DeviceFactor { factor, gram };
                let (loaded, found) = self
                    .loaded
                    .fit_device(&device, self.span, &stages.caller())
                    .map_err(|e| kept(&Failure::from(e)))?;
                (loaded, found, self.mcu)
            }
            None => {
                // The device is out of reach; what it streamed is here, and the pipeline is the same.
                let found = self
                    .loaded
                    .fit(self.span, PLOT_POINTS, &stages.caller())
                    .map_err(|e| kept(&Failure::from(e)))?;
                let why = match &take.broken {
                    Some(_) => "could not be fetched: this one was made here, from the readings received",
                    None => "holds readings that are left out: this one was made here, from the others",
                };
                warnings.push(format!("the device's factor {why}"));
                (self.loaded, found, "host")
            }
        };
        drop(stages);
        let device = CHANNEL_NAMES.iter().zip(take.counters.rejected_by_channel);
        for (name, count) in device.filter(|(_, count)| *count > 0) {
            let told = &mut found.counts.rejected_by_signal;
            // The device may have screened what the rows made here do not rest on.
            if told.iter().all(|(signal, _)| signal != name) {
                told.push(((*name).to_owned(), u64::from(count)));
            }
        }
        if let Some(stop) = self.until.filter(|_| !was_reached(&take)) {
            warnings.push(stop_criterion::not_reached(&stop, &found));
        }
        if mcu != "host" && !take.estimates.is_empty() {
            found.convergence = convergence(&take.estimates, found.estimate.coverage_factor());
        }
        let named: u64 = found.counts.rejected_by_signal.iter().map(|(_, count)| count).sum();
        found.counts.rejected = found.counts.rejected.max(named);
        let keeps_factor = self.tare.is_none() && self.known.is_empty();
        let factor = (!keeps_factor).then(|| loaded.factor(&found));
        if let Some(tare) = &self.tare {
            take_off(tare, &mut found, &mut notes).map_err(|e| kept(&e))?;
        }
        self.known.apply(&mut found).map_err(|e| kept(&e))?;
        let mut report = Report::of_recording(&loaded, mcu);
        report.asked = self.stop.asked(&self.output.estimate);
        (report.factor, report.keeps_factor) = (factor, keeps_factor);
        report.parameter_truth = self.parameter_truth;
        report.drift = self.same_pose.and_then(|spans| loaded.drift(spans, &found));
        report.tracking = self.tracking_error.as_ref().map(TrackingError::tracking);
        report.motion = self.tracking_error.as_ref().map_or_else(Vec::new, TrackingError::plots);
        report.provenance = device_notes(self.identity).into_iter().chain(report.provenance).collect();
        (report.stages, report.decisions) = (self.stages, self.decisions);
        report.notes.extend(notes);
        let whole = take.error_free();
        let unmet = self.came.as_ref().is_some_and(|came| whole && !came.summary.reached);
        if let Some(Came { mut summary, why }) = self.came {
            summary.rig_s = seconds;
            report.warnings.extend(why.filter(|_| unmet));
            report.experiment = Some(summary);
        }
        report.warnings.extend(warnings);
        report.error = take.broken;
        let outlet = Outlet { started: self.started, output: self.output };
        let code = finish(report, found, outlet, || Ok(Some(folder.clone())))?;
        let unmet = unmet && code == ExitCode::SUCCESS;
        Ok(if take.interrupted || unmet { ExitStatus::NotIdentified.into() } else { code })
    }
}

/// Returns the estimates that a device sent while it ran.
fn convergence(estimates: &[EstimateReport], coverage_factor: f64) -> Vec<Convergence> {
    let point = |report: &EstimateReport| Convergence {
        time_s: report.time_ns as f64 * 1e-9,
        parameters: report
            .estimate
            .iter()
            .zip(&report.standard_deviation)
            .enumerate()
            .map(|(j, (value, sd))| {
                (report.determined >> j & 1 == 1)
                    .then(|| Measured { value: f64::from(*value), u95: coverage_factor * f64::from(*sd) })
            })
            .collect(),
    };
    estimates.iter().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_told_where_it_is_known() {
        assert_eq!(time_left(10_000, 60_000, 166.0), ", 5 min left");
        assert_eq!(time_left(50_000, 60_000, 1000.0), ", 10 s left");
        assert_eq!(time_left(70_000, 60_000, 1000.0), ", 0 s left");
        assert_eq!((time_left(0, 60_000, 0.0), time_left(5, 0, 1.0)), (String::new(), String::new()));
    }
}
