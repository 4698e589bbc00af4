//! A recording that was read, with the problem that it poses.

use std::path::{Path, PathBuf};

use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::Span;

use super::recorded::{self, assumed_columns, joints_of, left_out_columns, stream_set};
use super::tree::{change_as_recorded, tree_in, tree_of};
use super::{Caller, Changes, Error, Recorded, Tree, calibration, drift, motion_plots};
use rigident_device::session::sound;
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Checks, DeviceFactor, Fit, FitError, FitOptions, Progress, RowSource, Timing};
use rigident_identify::answer::result::Cause;
use rigident_identify::answer::{self, Answer, Context, Drift, Links, Source, StandardRequest, TimeBase};
use rigident_identify::diagnosis::{self, Case};
use rigident_identify::problem::clocks::{StreamSet, as_stamped};
use rigident_identify::problem::{Problem, ProblemError, ProblemOptions, Subject};
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;
use rigident_model::Model;
use rigident_present::TimePlot;
use rigident_rows::body::BodySource;
use rigident_rows::body::{input_checks, prepare};

/// The note given where a rig file's calibration is of no use.
const UNUSED_CALIBRATION: &str =
    "the calibration of the rig is not used: it is for one body, and this is a tree of links";

/// Points of a convergence plot.
pub const PLOT_POINTS: usize = 200;

/// A recording with the problem that it poses.
pub struct Loaded {
    /// The source of rows with its rig file.
    pub problem: Problem,
    /// Things to act on that were noticed while reading.
    pub warnings: Vec<String>,
    /// Things that were done, as information.
    pub notes: Vec<String>,
    /// Rows of the recording that no sample was made of.
    unused_rows: u64,
    /// The model of a tree as its file has it, links on fixed joints on their own, and the file.
    nominal: Option<(Model, Option<PathBuf>)>,
    /// Date of the recording, RFC 3339.
    recorded: Option<String>,
    /// The recording as it was read, of several files on one time base, for the search for a fault; `None` of
    /// a tree's files and of what a device read.
    case: Option<Case>,
}

/// The way standard parameters of links are sought.
#[derive(Clone, Copy, Debug)]
pub struct StandardOptions<'a> {
    /// Relative standard deviation (1 σ) that the nominal model is trusted with.
    pub trust: f64,
    /// Right links mirror left ones.
    pub symmetric: bool,
    /// The file that a model with them is written to.
    pub write_model: Option<&'a Path>,
    /// Joints that are locked, `JOINT` or `JOINT=VALUE`.
    pub locked: &'a [String],
}

impl StandardOptions<'_> {
    /// Nothing in particular is asked for.
    pub const DEFAULT: Self = Self { trust: 1.0, symmetric: false, write_model: None, locked: &[] };

    fn required(&self) -> bool {
        self.write_model.is_some() || self.symmetric
    }
}

impl Loaded {
    /// Reads a recording of one body, or of the tree that `tree` or the rig file's `[[link]]` tables say.
    ///
    /// # Errors
    /// The recording cannot be read, or does not fit the model.
    pub fn read(
        path: &Path,
        rig: Option<&Path>,
        calibrated: Option<&Path>,
        tree: &Tree,
        options: &ProblemOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        let path = &recorded::listed(path.to_owned());
        let Some((nominal, file)) = tree_of(path, rig, tree)? else {
            return Self::body(path, rig, calibrated, caller);
        };
        calibration::refuse_for_trees(calibrated)?;
        if let Some(set) = stream_set(path, rig)? {
            return Self::tree_in_streams(set, (nominal, file), &tree.changes, options, caller);
        }
        let recording = Recording::load(path, rig)?;
        Self::tree(recording, (nominal, file), &tree.changes, options, caller)
    }

    /// Reads a recording, or takes one that is in memory.
    ///
    /// # Errors
    /// Fails as [`Loaded::read`] and [`Loaded::of_recording`] do.
    pub fn of(
        recording: Recorded,
        rig: Option<&Path>,
        calibrated: Option<&Path>,
        tree: &Tree,
        options: &ProblemOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        match recording {
            Recorded::File(path) => Self::read(&path, rig, calibrated, tree, options, caller),
            Recorded::Memory(recording) => Self::of_recording(*recording, calibrated, tree, options, caller),
        }
    }

    /// Takes a recording that is in memory, of one body or of a tree, as [`Loaded::read`] does one of a file.
    ///
    /// # Errors
    /// The recording does not fit the model.
    pub fn of_recording(
        recording: Recording,
        calibrated: Option<&Path>,
        tree: &Tree,
        options: &ProblemOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        let Some(nominal) = tree_in(Path::new(&recording.name), Some(recording.rig.clone()), tree)? else {
            return Self::of_body(recording, calibrated, caller);
        };
        calibration::refuse_for_trees(calibrated)?;
        Self::tree(recording, nominal, &tree.changes, options, caller)
    }

    /// Poses the problem of a recording of a tree.
    ///
    /// # Errors
    /// The recording does not fit the model.
    fn tree(
        mut recording: Recording,
        (mut nominal, file): (Model, Option<PathBuf>),
        changes: &Changes,
        options: &ProblemOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        recording.leave_out_bad_readings();
        let mut notes = change_as_recorded(&mut nominal, changes, &recording, caller)?;
        caller.stage("frames of the recording", 0.0);
        let problem = Problem::from_recording(&recording, Some(&nominal), options)?;
        notes.extend(problem.notes.iter().cloned());
        let (rows, recorded) = (recording.rows(), recording.recorded());
        let mut warnings = recording.warnings.clone();
        warnings.extend(assumed_columns(&recording, caller));
        warnings.extend(problem.warnings.iter().cloned());
        warnings.extend(problem.rig.calibrated().map(|_| UNUSED_CALIBRATION.to_owned()));
        warnings.extend(nominal.findings.iter().map(ToString::to_string));
        let unused_rows = (rows as u64).saturating_sub(problem.source().samples() as u64);
        let case = Self::case_of_tree(&recording, &problem, &nominal, options);
        Ok(Self { problem, warnings, notes, unused_rows, nominal: Some((nominal, file)), recorded, case })
    }

    /// Returns what faults of a tree are tried on; `None` of a robot on its feet: what a fault does there is
    /// not among those that are tried.
    fn case_of_tree(
        recording: &Recording,
        problem: &Problem,
        nominal: &Model,
        options: &ProblemOptions,
    ) -> Option<Case> {
        let has_feet = !problem.rig.foot.is_empty();
        let recording = || diagnosis::looked_at(recording);
        let case = || Case { recording: recording(), model: Some(nominal.clone()), options: options.clone() };
        (!has_feet).then(case)
    }

    /// Poses the problem of a tree in several files with clocks of their own.
    ///
    /// # Errors
    /// The files have nothing in common, or do not fit the model.
    fn tree_in_streams(
        mut set: StreamSet,
        (mut nominal, file): (Model, Option<PathBuf>),
        changes: &Changes,
        options: &ProblemOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        set.settle(false)?;
        let stamped = as_stamped(&set)?;
        let mut notes = change_as_recorded(&mut nominal, changes, &stamped, caller)?;
        caller.stage("clocks of the files", 0.0);
        let problem = Problem::from_streams(set, Some(&nominal), options)?;
        notes.extend(problem.notes.iter().cloned());
        let mut warnings = problem.warnings.clone();
        warnings.extend(nominal.findings.iter().map(ToString::to_string));
        let aligned = problem.aligned();
        let case = aligned.and_then(|aligned| Self::case_of_tree(aligned, &problem, &nominal, options));
        let nominal = Some((nominal, file));
        Ok(Self { problem, warnings, notes, unused_rows: 0, nominal, recorded: None, case })
    }

    /// Reads a recording of one body: one file, or several with clocks of their own.
    ///
    /// # Errors
    /// It cannot be read, or is no recording of a body.
    fn body(
        path: &Path,
        rig: Option<&Path>,
        file: Option<&Path>,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        if let Some(mut set) = stream_set(path, rig)? {
            calibration::calibrate(&mut set.rig, file)?;
            let problem = Problem::from_streams(set, None, &ProblemOptions::default())?;
            let (mut notes, warnings) = (problem.notes.clone(), problem.warnings.clone());
            notes.extend(assumed(&problem.rig));
            let case = problem.aligned().map(|aligned| Case {
                recording: diagnosis::looked_at(aligned),
                model: None,
                options: ProblemOptions::default(),
            });
            return Ok(Self {
                problem,
                warnings,
                notes,
                unused_rows: 0,
                nominal: None,
                recorded: None,
                case,
            });
        }
        Self::of_body(Recording::load(path, rig)?, file, caller)
    }

    /// Poses the problem of a recording of one body.
    ///
    /// # Errors
    /// It is no recording of a body.
    pub fn of_body(
        mut recording: Recording,
        file: Option<&Path>,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        recording.leave_out_bad_readings();
        calibration::calibrate(&mut recording.rig, file)?;
        let joints = joints_of(&recording);
        let looked_at = diagnosis::looked_at(&recording);
        let problem = Problem::of_body(recording).map_err(|error| {
            let error = match joints.first() {
                None => Error::from(error),
                Some(joint) => Error::OfRobot { error: Box::new(error), joint: joint.clone() },
            };
            match assumed_columns(&looked_at, caller) {
                Some(assumed) => Error::Assuming { error: Box::new(error), assumed },
                None => error,
            }
        })?;
        let recording = looked_at;
        let mut warnings = recording.warnings.clone();
        warnings.extend(assumed_columns(&recording, caller));
        warnings.extend(problem.warnings.iter().cloned());
        warnings.extend(left_out_columns(&recording, &joints).map(|notice| caller.words(&notice)));
        let recorded = recording.recorded();
        warnings.extend(recording.rig.calibrated().and_then(|c| c.expired(recorded.as_deref())));
        let calibrated = recording.rig.calibrated();
        warnings.extend(calibrated.and_then(|c| c.repeated(problem.source().identity().fingerprint)));
        warnings.extend(problem.rig.imu.first().and_then(|imu| input_checks::far_away(imu.position_m)));
        let mut notes = problem.notes.clone();
        notes.extend(assumed(&recording.rig));
        let case = Some(Case { recording, model: None, options: ProblemOptions::default() });
        Ok(Self { problem, warnings, notes, unused_rows: 0, nominal: None, recorded, case })
    }

    /// Returns the source of rows.
    pub fn source(&self) -> &dyn RowSource {
        self.problem.source()
    }

    /// Returns the nominal model of a tree, and its file.
    pub fn nominal(&self) -> Option<(&Model, Option<&Path>)> {
        self.nominal.as_ref().map(|(model, file)| (model, file.as_deref()))
    }

    /// Fits the recording; the uncertainty of skews between several clocks is counted.
    ///
    /// # Errors
    /// There are no usable rows, or a span that cannot be retained.
    pub fn fit(&self, span: Option<Span<f64>>, points: usize, caller: &Caller<'_>) -> Result<Fit, Error> {
        if span.is_some() && self.problem.time_base().is_some() {
            return Err(Error::SpanOfStreams);
        }
        let options = FitOptions { forgetting: span, convergence_points: points, ..FitOptions::default() };
        let found = self.problem.fit(&options, caller).map_err(|error| {
            // Readings in another unit may all be beyond a sensor's range.
            let no_rows = matches!(error, ProblemError::Fit(FitError::NoRows { .. }));
            let case = self.case.as_ref().filter(|_| no_rows);
            match case.and_then(|case| diagnosis::diagnose(case, None, caller)) {
                Some(Cause { what, remedy, .. }) => Error::Explained { error: Box::new(error), what, remedy },
                None => error.into(),
            }
        })?;
        Ok(self.with_unused(found))
    }

    /// Judges the answer of a fit by the faults that a recording may have; returns the one that explains it,
    /// to be explained.
    pub fn judge(&self, fit: &Fit, answer: &mut Answer, caller: &Caller<'_>) -> Option<Cause> {
        let case = self.case.as_ref()?;
        caller.stage("looking for the cause", 0.0);
        let links = self.links(&StandardOptions::DEFAULT);
        diagnosis::judge(case, (fit, links.as_ref()), answer, caller)
    }

    /// Counts rows that no sample was made of as rejected.
    fn with_unused(&self, mut found: Fit) -> Fit {
        found.counts.samples += self.unused_rows;
        found.counts.rejected += self.unused_rows;
        found
    }

    /// Judges a factor that a device made of this recording; the parameters are then in the device's order.
    ///
    /// # Errors
    /// There are no usable rows, or a factor of other parameters.
    pub fn fit_device(
        self,
        device: &DeviceFactor,
        span: Option<Span<f64>>,
        caller: &Caller<'_>,
    ) -> Result<(Self, Fit), Error> {
        let options =
            FitOptions { forgetting: span, convergence_points: PLOT_POINTS, ..FitOptions::default() };
        let (problem, found) = self.problem.fit_device(device, &options, caller)?;
        let loaded = Self { problem, ..self };
        let found = loaded.with_unused(found);
        Ok((loaded, found))
    }

    /// Wraps the readings of one body that a device took or was given.
    pub fn of_readings(
        name: &str,
        rig: &RigFile,
        readings: Vec<Reading<f64>>,
        rate_hz: Option<f64>,
        gravity_columns: bool,
    ) -> Self {
        let recording = looked_at(name, rig, &readings, rate_hz, gravity_columns);
        let case = Case { recording, model: None, options: ProblemOptions::default() };
        let input = prepare::input(rig, readings, rate_hz.is_none(), rate_hz.unwrap_or(1.0));
        let source = Box::new(BodySource::new(input, rig.imu.first()));
        let subject = Subject::Body { source, gravity_columns };
        let problem = Problem::new(name, rig.clone(), subject);
        Self {
            problem,
            warnings: rig
                .calibrated()
                .and_then(|calibration| calibration.expired(None))
                .into_iter()
                .collect(),
            notes: assumed(rig),
            unused_rows: 0,
            nominal: None,
            recorded: None,
            case: Some(case),
        }
    }

    /// Wraps what a device read of a tree; accelerometers of links beyond the base have served their
    /// attitudes and are not among the rows.
    ///
    /// # Errors
    /// The recording does not fit the model.
    pub fn of_links(recording: &Recording, model: &Model) -> Result<Self, Error> {
        let mut read = recording.clone();
        read.imus.iter_mut().skip(1).for_each(|imu| imu.accel = None);
        let problem = Problem::from_recording(&read, Some(model), &ProblemOptions::default())?;
        let notes = problem.notes.clone();
        let warnings = model.findings.iter().map(ToString::to_string).collect();
        let unused_rows = (recording.rows() as u64).saturating_sub(problem.source().samples() as u64);
        let case = Self::case_of_tree(&read, &problem, model, &ProblemOptions::default());
        Ok(Self {
            problem,
            warnings,
            notes,
            unused_rows,
            nominal: Some((model.clone(), None)),
            recorded: recording.recorded(),
            case,
        })
    }

    /// Returns the names of a tree's links, fixed joints welded; empty of one body.
    pub fn link_names(&self) -> Vec<String> {
        let model = self.nominal.as_ref().map(|(model, _)| model.welded());
        model.map_or_else(Vec::new, |model| model.links.into_iter().map(|l| l.name).collect())
    }

    /// Returns the mean wrench of the same pose at the end less that at the beginning; `None` where a pose
    /// has no readings.
    pub fn drift(&self, spans: [(f64, f64); 2], found: &Fit) -> Option<Drift> {
        let Subject::Body { source, .. } = &self.problem.subject else { return None };
        drift::of_body(&source.input().readings, spans, found)
    }

    /// Returns the factor of a fit, named after the recording, with what the checks of that found.
    pub fn factor(&self, found: &Fit) -> PooledFactor {
        let context = Context {
            links: self.links(&StandardOptions::DEFAULT),
            findings: self.problem.findings.clone(),
            ..Context::default()
        };
        match Answer::new(found, context) {
            Ok(answer) => self.factor_of(found, &answer, 0),
            Err(_) => self
                .checked(found, &answer::checks(found, &self.warnings, self.problem.links(None).is_some())),
        }
    }

    /// Returns the same where the answer of the fit is at hand, of which the first `skipped` warnings are not
    /// of the fit.
    pub fn factor_of(&self, found: &Fit, answer: &Answer, skipped: usize) -> PooledFactor {
        self.checked(found, &answer.checks(found, &self.warnings, skipped))
    }

    fn checked(&self, found: &Fit, checks: &Checks) -> PooledFactor {
        let labels = &self.problem.rig.recording.labels;
        let factor = PooledFactor::of(found, &self.problem.name).checked(checks).labelled(labels);
        let recorded = self.recorded.as_deref().and_then(|date| humantime::parse_rfc3339(date).ok());
        let unix = recorded.and_then(|at| at.duration_since(std::time::UNIX_EPOCH).ok());
        match unix.and_then(|unix| i64::try_from(unix.as_secs()).ok()) {
            Some(unix_s) => factor.recorded_at(unix_s),
            None => factor,
        }
    }

    /// Returns where the numbers come from.
    pub fn origin(&self, mcu: &str) -> Source {
        let source = self.source();
        let samples = source.samples();
        let rate_hz = match source.timing() {
            Timing::Static => None,
            Timing::Uniform { rate_hz } => Some(rate_hz),
        };
        let span_ns = source.time_ns(samples.saturating_sub(1)).saturating_sub(source.time_ns(0));
        Source {
            recording: self.problem.name.clone(),
            recorded: self.recorded.clone(),
            rows: samples as u64 + self.unused_rows,
            rate_hz,
            duration_s: rate_hz.map(|_| span_ns as f64 * 1e-9),
            mcu: mcu.to_owned(),
        }
    }

    /// Returns how several files became one recording.
    pub fn time_base(&self) -> Option<TimeBase> {
        self.problem.time_base().cloned()
    }

    /// Returns the tree for an answer; `None` of one body.
    pub fn links<'a>(&'a self, options: &StandardOptions) -> Option<Links<'a>> {
        self.problem.links(self.nominal.as_ref().map(|(nominal, _)| StandardRequest {
            nominal,
            trust: options.trust,
            symmetric: options.symmetric,
            required: options.required(),
        }))
    }

    /// Returns the motion over time for the plots; times count from the first sample.
    pub fn motion(&self) -> Vec<TimePlot> {
        match &self.problem.subject {
            Subject::Body { source, gravity_columns } => {
                motion_plots::of_body(source.input(), *gravity_columns)
            }
            Subject::Tree { .. } | Subject::Suspended { .. } => Vec::new(),
        }
    }
}

/// Returns the readings of one body that faults are tried on, as a recording.
fn looked_at(
    name: &str,
    rig: &RigFile,
    readings: &[Reading<f64>],
    rate_hz: Option<f64>,
    gravity_columns: bool,
) -> Recording {
    let all = 0..readings.len();
    let part = rate_hz.map_or(all, |_| diagnosis::rows_looked_at(readings.len(), rate_hz));
    let readings = readings.get(part).unwrap_or_default();
    let mut own = sound::recording(name, rig, rate_hz.unwrap_or(1.0), readings);
    if rate_hz.is_none() {
        // Of still poses the accelerometer alone says something.
        (own.is_static, own.rate_hz) = (true, None);
        own.imus.iter_mut().for_each(|imu| imu.gyro = None);
    }
    if gravity_columns {
        let up = own.imus.pop().and_then(|imu| imu.accel);
        own.gravity = up.map(|up| up.into_iter().map(|force| force.map(|v| -v)).collect());
    }
    own
}

/// Returns what the calibration of a rig assumed of its reference.
fn assumed(rig: &RigFile) -> Vec<String> {
    let of = |note: &String| format!("calibration of the rig: {note}");
    rig.calibrated().map_or_else(Vec::new, |calibration| calibration.assumed.iter().map(of).collect())
}
