//! The common part of `demo`, `run` and `replay`: watching an experiment, recording it, judging it.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::wire::{EstimateReport, LinkReadingMessage, ReadingMessage};

use crate::device::report::{Outlet, show};
use crate::device::tracking_error::MotionLog;
use crate::{ExitStatus, Failure, Folder, Progress, Stages};
use rigident::application::{Concluded, Error, Experiment, NextMove};
use rigident::device::platform::MotionSample;
use rigident::device::session::{Observer, Take, widen};
use rigident::device::words;
use rigident_io::behind::Behind;
use rigident_io::recording::comment_in_words;
use rigident_io::recording::mcap::messages::ImuValues;
use rigident_io::recording::mcap::write::{Head, McapWriter, Row};
use rigident_io::rig::RigFile;

/// Shows progress and writes every reading into the recording.
pub(crate) struct Watcher {
    progress: Progress,
    started: Instant,
    writer: Option<McapWriter<Behind>>,
    path: PathBuf,
    latest: Option<EstimateReport>,
    expected: usize,
    /// Further knowledge, in words.
    state: Option<String>,
    /// The log of the platform's motion.
    pub(crate) motion: Option<MotionLog>,
    /// Of a body that is moved by hand.
    pub(crate) next_move: Option<NextMove>,
}

impl Watcher {
    /// Watches without a recording.
    pub(crate) fn new(expected: usize) -> Self {
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

    /// Watches with a recording at `path`, the rig file inside.
    pub(crate) fn recording(
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
    pub(crate) fn end(&mut self, take: &mut Take) {
        if let Err(failure) = self.finish() {
            take.broken.get_or_insert_with(|| failure.to_string());
        }
    }

    /// Ends the recording.
    pub(crate) fn finish(&mut self) -> Result<(), Failure> {
        self.progress.finish();
        self.writer.take().map_or(Ok(()), |w| w.close().map_err(Failure::input))
    }
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

/// Returns a row of the readings of the sensors on the load cell's body and of the IMUs.
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

    fn known(&mut self, words: Option<String>) {
        self.state = words;
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
            let state =
                latest.as_ref().map_or_else(String::new, |report| format!(", {}", words::estimate(report)));
            let known = known.as_deref().unwrap_or_default();
            format!("{readings}{share} readings, {rate:.0}/s{left}{state}{known}")
        });
    }
}

/// Concludes an experiment: tells its news, judges it, prints the answer, writes the files and returns the
/// exit status.
///
/// # Errors
/// The readings make no rows, what is known contradicts them, a file cannot be written, or the experiment
/// broke off.
pub(crate) fn conclude(
    experiment: Experiment<'_>,
    take: Take,
    outlet: Outlet<'_>,
    folder: &Folder,
) -> Result<ExitCode, Failure> {
    experiment.news(&take).iter().for_each(|news| tell!("{news}"));
    let stages = Stages::new("estimate");
    let concluded = experiment.conclude(take, &stages.caller()).map_err(|error| unanswered(error, folder))?;
    drop(stages);
    let Concluded { identified, is_short } = concluded;
    let code = show(identified, outlet, |_| Ok(Vec::new()), || Ok(Some(folder.clone())))?;
    Ok(if is_short { ExitStatus::NotIdentified.into() } else { code })
}

/// Says why there is no answer, and where what was recorded is.
fn unanswered(error: Error, folder: &Folder) -> Failure {
    let place = folder.path().display();
    match error {
        Error::Unanswered { broken: Some(broken), error } => {
            let error = Failure::from(*error);
            Failure::link(format!("{broken}\nWhat was recorded is in {place}: {error}"))
        }
        Error::Unanswered { broken: None, error } => {
            let error = Failure::from(*error);
            Failure::input(format!("{error}\nFiles written before this was found out are in {place}"))
        }
        other => other.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_reported_where_it_is_known() {
        assert_eq!(time_left(10_000, 60_000, 166.0), ", 5 min left");
        assert_eq!(time_left(50_000, 60_000, 1000.0), ", 10 s left");
        assert_eq!(time_left(70_000, 60_000, 1000.0), ", 0 s left");
        assert_eq!((time_left(0, 60_000, 0.0), time_left(5, 0, 1.0)), (String::new(), String::new()));
    }
}
