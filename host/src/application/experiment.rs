//! An experiment with a device that is over: its factor judged by its readings, and the answer.

use rigident_shared::forgetting::Span;
use rigident_shared::screening::CHANNEL_NAMES;
use rigident_shared::wire::{EstimateReport, Identity, Reason, StopRule};

use super::loaded::PLOT_POINTS;
use super::tare::take_off;
use super::{Caller, Error, Identified, Loaded, Report};
use rigident_device::link::TakenFactor;
use rigident_device::session::Take;
use rigident_device::session::tree::complaints;
use rigident_device::stop_criterion::not_reached;
use rigident_device::words::{device_notes, doubtful_clock};
use rigident_fit::figures::counted;
use rigident_fit::prior::KnownValues;
use rigident_fit::tare::Tare;
use rigident_fit::{Convergence, DeviceFactor, Fit, Measured, Progress};
use rigident_identify::answer::Tracking;
use rigident_identify::answer::result::ExperimentSummary;
use rigident_present::{Decided, Stage, TimePlot};

/// The course of an experiment that decides for itself.
#[derive(Clone, Debug)]
pub struct Course {
    /// The quantities that were asked for, and the progress towards each.
    pub summary: ExperimentSummary,
    /// Why what was asked for is not reached, and what is; `None` if it is.
    pub why: Option<String>,
}

/// An experiment that is over, without what was taken: the readings are the loaded ones.
pub struct Experiment<'a> {
    /// The input that the device was given, or reported.
    pub loaded: Loaded,
    /// The microcontroller, as an answer names it.
    pub mcu: &'static str,
    /// The device.
    pub identity: Identity,
    /// The prior knowledge.
    pub known: &'a KnownValues,
    /// The fixture, which is taken off.
    pub tare: Option<Tare>,
    /// The parameters that must be identified; empty: all.
    pub asked: Vec<String>,
    /// The rule that the device was given, if it decides when to end.
    pub until: Option<StopRule>,
    /// The way older rows are forgotten, if they are.
    pub span: Option<Span<f64>>,
    /// True values of the parameters in the device's order.
    pub parameter_truth: Option<Vec<f64>>,
    /// Stages of the programme.
    pub stages: Vec<Stage>,
    /// Spans of the first pose and of the same pose at the end, s from the first reading.
    pub same_pose: Option<[(f64, f64); 2]>,
    /// The tracking of the platform.
    pub tracking: Option<Tracking>,
    /// Plots of the platform's motion.
    pub motion: Vec<TimePlot>,
    /// Segments that were decided on, and their results.
    pub decisions: Vec<Decided>,
    /// The point to which the decisions proceeded.
    pub course: Option<Course>,
    /// Things that were done, as information.
    pub notes: Vec<String>,
    /// Things to act on.
    pub warnings: Vec<String>,
}

/// The conclusion of an experiment.
#[derive(Debug)]
pub struct Concluded {
    /// The answer, with all that it rests on.
    pub identified: Identified,
    /// True if it was stopped, or did not reach what it was to reach: the answer is not all that was asked
    /// for.
    pub is_short: bool,
}

impl<'a> Experiment<'a> {
    /// Returns an experiment of which nothing but its input and its device is known.
    pub fn new(loaded: Loaded, mcu: &'static str, identity: &Identity, known: &'a KnownValues) -> Self {
        Self {
            loaded,
            mcu,
            identity: identity.clone(),
            known,
            tare: None,
            asked: Vec::new(),
            until: None,
            span: None,
            parameter_truth: None,
            stages: Vec::new(),
            same_pose: None,
            tracking: None,
            motion: Vec::new(),
            decisions: Vec::new(),
            course: None,
            notes: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Returns what is to be known of a run that ended well, before its answer.
    pub fn news(&self, take: &Take) -> Vec<String> {
        let mut news = Vec::new();
        if was_reached(take) {
            let seconds = self.seconds();
            news.push(format!("the uncertainties asked for were reached; {seconds:.1} s were taken in"));
        }
        if take.levels > 0 {
            let times = counted(take.levels as usize, "time", "times");
            news.push(format!("a level of the factor was taken from the device {times} and merged here"));
        }
        news
    }

    /// Returns the time that the readings take, s.
    fn seconds(&self) -> f64 {
        self.loaded.origin(self.mcu).duration_s.unwrap_or(0.0)
    }

    /// Judges the device's factor by its readings and concludes the answer. Without a factor one is made
    /// here, of the readings.
    ///
    /// # Errors
    /// [`Error::Unanswered`]: the readings make no rows, or what is known contradicts them.
    /// [`Error::Answer`]: what was asked for is no parameter.
    pub fn conclude(self, mut take: Take, caller: &Caller<'_>) -> Result<Concluded, Error> {
        let seconds = self.seconds();
        let Self { mut warnings, mut notes, .. } = self;
        if let Some(stalled) = stalled(&take) {
            take.broken.get_or_insert(stalled);
        }
        warnings.extend(noticed(&take));
        warnings.extend(doubtful_clock(self.identity.clock));
        warnings.extend(complaints(&take.counters.frames, &self.loaded.link_names()));
        let unanswered =
            |error: Error| Error::Unanswered { broken: take.broken.clone(), error: Box::new(error) };
        caller.stage("estimate", 0.0);
        let (loaded, mut found, mcu) = match take.factor.clone() {
            Some(TakenFactor { factor, gram }) => {
                let device = DeviceFactor { factor, gram };
                let fitted = self.loaded.fit_device(&device, self.span, caller);
                let (loaded, found) = fitted.map_err(unanswered)?;
                (loaded, found, self.mcu)
            }
            None => {
                // The device is out of reach; what it streamed is here, and the pipeline is the same.
                let found = self.loaded.fit(self.span, PLOT_POINTS, caller).map_err(unanswered)?;
                let why = match &take.broken {
                    Some(_) => "could not be fetched: this one was made here, from the readings received",
                    None => "holds readings that are left out: this one was made here, from the others",
                };
                warnings.push(format!("the device's factor {why}"));
                (self.loaded, found, "host")
            }
        };
        count_rejected(&take, &mut found);
        if let Some(stop) = self.until.filter(|_| !was_reached(&take)) {
            warnings.push(not_reached(&stop, &found));
        }
        if mcu != "host" && !take.estimates.is_empty() {
            found.convergence = convergence(&take.estimates, found.estimate.coverage_factor());
        }
        let named: u64 = found.counts.rejected_by_signal.iter().map(|(_, count)| count).sum();
        found.counts.rejected = found.counts.rejected.max(named);
        let keeps_factor = self.tare.is_none() && self.known.is_empty();
        let factor = (!keeps_factor).then(|| loaded.factor(&found));
        if let Some(tare) = &self.tare {
            take_off(tare, &mut found, &mut notes).map_err(|e| unanswered(e.into()))?;
        }
        self.known.apply(&mut found).map_err(|e| unanswered(e.into()))?;
        let mut report = Report::of_recording(&loaded, mcu);
        (report.asked, report.factor, report.keeps_factor) = (self.asked, factor, keeps_factor);
        report.parameter_truth = self.parameter_truth.as_deref();
        report.drift = self.same_pose.and_then(|spans| loaded.drift(spans, &found));
        (report.tracking, report.motion) = (self.tracking, self.motion);
        report.provenance = device_notes(&self.identity).into_iter().chain(report.provenance).collect();
        (report.stages, report.decisions) = (self.stages, self.decisions);
        report.notes.extend(notes);
        let unmet = self.course.as_ref().is_some_and(|course| take.error_free() && !course.summary.reached);
        if let Some(Course { mut summary, why }) = self.course {
            summary.rig_s = seconds;
            report.warnings.extend(why.filter(|_| unmet));
            report.experiment = Some(summary);
        }
        report.warnings.extend(warnings);
        report.error = take.broken;
        caller.stage("answer", 0.0);
        let identified = report.conclude(found, caller)?;
        Ok(Concluded { identified, is_short: take.interrupted || unmet })
    }
}

/// Returns true if the device said that its stop criterion is reached.
fn was_reached(take: &Take) -> bool {
    take.states.iter().any(|(_, reason)| *reason == Reason::StopRule)
}

/// Returns the warnings of a take, whatever it was of.
fn noticed(take: &Take) -> Vec<String> {
    let counters = &take.counters;
    let lost = "lost between device and host; the answer is made of the others";
    let (sample, samples) = ("sample", "samples");
    let no_room = counters.lost.iter().fold(0, |sum: u32, lost| lost.saturating_add(sum));
    let counts = [
        (take.missing, "reading", "readings", lost),
        (
            counters.load_cell_crc_errors,
            sample,
            samples,
            "of the load cell left out: the check sum was wrong",
        ),
        (counters.imu_errors, sample, samples, "of the IMU could not be read"),
        (counters.second_imu_errors, sample, samples, "of the second link's IMU could not be read"),
        (no_room, sample, samples, "of the sensors came when the board had no room"),
        (counters.gaps, "gap", "gaps", "in time; the filter started anew after it"),
        (
            counters.telemetry_dropped,
            "message",
            "messages",
            "of the device dropped for want of room on the link",
        ),
    ];
    let counts = counts.into_iter().filter(|(count, ..)| *count > 0);
    let mut warnings: Vec<String> = counts
        .map(|(count, one, many, what)| format!("{} {what}", counted(count as usize, one, many)))
        .collect();
    if take.cut_short {
        warnings.push("ended before the programme's end, after the time of `at_most_s`".to_owned());
    }
    if take.interrupted {
        warnings.push("stopped by Ctrl-C before the end".to_owned());
    }
    warnings
}

/// Returns why a take of which the host missed a part is broken, if it is.
fn stalled(take: &Take) -> Option<String> {
    (take.resumed > 0).then(|| {
        format!(
            "{} the device stopped because it did not hear this program, and was started again: this \
             program stood still in the middle \
             of the experiment, and the readings of that time are missing. Run on a host that is less busy",
            counted(take.resumed, "time", "times")
        )
    })
}

/// Counts what the device rejected.
fn count_rejected(take: &Take, found: &mut Fit) {
    let device = CHANNEL_NAMES.iter().zip(take.counters.rejected_by_channel);
    for (name, count) in device.filter(|(_, count)| *count > 0) {
        let counted = &mut found.counts.rejected_by_signal;
        // The device may have screened what the rows made here do not rest on.
        if counted.iter().all(|(signal, _)| signal != name) {
            counted.push(((*name).to_owned(), u64::from(count)));
        }
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
