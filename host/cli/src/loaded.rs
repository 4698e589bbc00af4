use std::path::{Path, PathBuf};

use rigident_shared::calibration::Reading;
use rigident_shared::forgetting::Span;

use super::options::calibration;
use super::options::trees::{ModelChanges, TreeModel};
use super::recorded::{is_rig_file, left_out_columns, listed, stream_set};
use super::{Failure, Stages, locked_joints};
use rigident::answer::result::Cause;
use rigident::answer::{self, Answer, Context, Drift, Links, Source, StandardRequest, TimeBase};
use rigident::diagnosis::{self, Case};
use rigident::present::TimePlot;
use rigident::problem::body::BodySource;
use rigident::problem::body::{input_checks, prepare};
use rigident::problem::clocks::{StreamSet, as_stamped};
use rigident::problem::{Problem, ProblemError, ProblemOptions, Subject};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Checks, DeviceFactor, Fit, FitError, FitOptions, RowSource, Timing};
use rigident_io::recording::{Recording, extension, rig_path};
use rigident_io::rig::RigFile;
use rigident_model::Model;

/// Said where a rig file's calibration is of no use.
const UNUSED_CALIBRATION: &str =
    "the calibration of the rig is not used: it is for one body, and this is a tree of links";

/// Points of a convergence plot.
pub(super) const PLOT_POINTS: usize = 200;

/// A recording with the problem that it poses.
pub(super) struct Loaded {
    /// The source of rows with its rig file.
    pub(super) problem: Problem,
    /// Things to act on that were noticed while reading.
    pub(super) warnings: Vec<String>,
    /// Things that were done, as information.
    pub(super) notes: Vec<String>,
    /// Rows of the recording that no sample was made of.
    unused_rows: u64,
    /// The model of a tree as its file has it, links on fixed joints on their own, and the file.
    nominal: Option<(Model, Option<PathBuf>)>,
    /// Date of the recording, RFC 3339.
    recorded: Option<String>,
    /// The recording as it was read, for the search for a fault; `None` of several files and of what a device read.
    case: Option<Case>,
}

/// How standard parameters of links are sought.
#[derive(Clone, Copy, Debug)]
pub(super) struct StandardOptions<'a> {
    /// Relative standard deviation (1 σ) that the nominal model is trusted with.
    pub(super) trust: f64,
    /// Right links mirror left ones.
    pub(super) symmetric: bool,
    /// The file that a model with them is written to.
    pub(super) write_model: Option<&'a Path>,
    /// Joints that are locked, `JOINT` or `JOINT=VALUE`.
    pub(super) locked: &'a [String],
}

impl StandardOptions<'_> {
    /// Nothing in particular is asked for.
    pub(super) const DEFAULT: Self = Self { trust: 1.0, symmetric: false, write_model: None, locked: &[] };

    fn required(&self) -> bool {
        self.write_model.is_some() || self.symmetric
    }
}

impl Loaded {
    /// Reads a recording of one body, or of the tree that `tree` or the rig file's `[[link]]` tables say.
    ///
    /// # Errors
    /// Bad input: the recording cannot be read, or does not fit the model.
    pub(super) fn read(
        path: &Path,
        rig: Option<&Path>,
        calibrated: Option<&Path>,
        tree: &TreeModel,
        options: &ProblemOptions,
        stages: &Stages,
    ) -> Result<Self, Failure> {
        let path = &listed(path.to_owned());
        let Some((nominal, file)) = tree_of(path, rig, tree)? else {
            return Self::body(path, rig, calibrated);
        };
        calibration::refuse_for_trees(calibrated)?;
        if let Some(set) = stream_set(path, rig)? {
            return Self::tree_in_streams(set, (nominal, file), &tree.changes, options, stages);
        }
        let recording = Recording::load(path, rig)?;
        Self::tree(recording, (nominal, file), &tree.changes, options, stages)
    }

    /// Takes a recording that is in memory, of one body or of a tree, as [`Loaded::read`] does one of a file.
    ///
    /// # Errors
    /// Bad input: the recording does not fit the model.
    pub(super) fn of_recording(
        recording: Recording,
        calibrated: Option<&Path>,
        tree: &TreeModel,
        options: &ProblemOptions,
        stages: &Stages,
    ) -> Result<Self, Failure> {
        let Some(nominal) = tree_in(Path::new(&recording.name), Some(recording.rig.clone()), tree)? else {
            return Self::of_body(recording, calibrated);
        };
        calibration::refuse_for_trees(calibrated)?;
        Self::tree(recording, nominal, &tree.changes, options, stages)
    }

    /// Poses the problem of a recording of a tree.
    ///
    /// # Errors
    /// Bad input: the recording does not fit the model.
    fn tree(
        mut recording: Recording,
        (mut nominal, file): (Model, Option<PathBuf>),
        changes: &ModelChanges,
        options: &ProblemOptions,
        stages: &Stages,
    ) -> Result<Self, Failure> {
        recording.leave_out_spikes();
        let mut notes = change_as_recorded(&mut nominal, changes, &recording)?;
        stages.at("frames of the recording", 0.0);
        let problem = Problem::from_recording(&recording, Some(&nominal), options).map_err(Failure::input)?;
        notes.extend(problem.notes.iter().cloned());
        let (rows, recorded) = (recording.rows(), recording.recorded());
        let mut warnings = recording.warnings.clone();
        warnings.extend(super::recorded::assumed_columns(&recording));
        warnings.extend(problem.warnings.iter().cloned());
        warnings.extend(problem.rig.calibrated().map(|_| UNUSED_CALIBRATION.to_owned()));
        warnings.extend(nominal.findings.iter().map(ToString::to_string));
        let unused_rows = (rows as u64).saturating_sub(problem.source().samples() as u64);
        // What a fault does to a robot on its feet is not among those that are tried.
        let has_feet = !problem.rig.foot.is_empty();
        let recording = diagnosis::looked_at(&recording);
        let case = Case { recording, model: Some(nominal.clone()), options: options.clone() };
        let case = Some(case).filter(|_| !has_feet);
        Ok(Self { problem, warnings, notes, unused_rows, nominal: Some((nominal, file)), recorded, case })
    }

    /// Poses the problem of a tree in several files with clocks of their own.
    ///
    /// # Errors
    /// Bad input: files that have nothing in common, or do not fit the model.
    fn tree_in_streams(
        set: StreamSet,
        (mut nominal, file): (Model, Option<PathBuf>),
        changes: &ModelChanges,
        options: &ProblemOptions,
        stages: &Stages,
    ) -> Result<Self, Failure> {
        let stamped = as_stamped(&set).map_err(Failure::input)?;
        let mut notes = change_as_recorded(&mut nominal, changes, &stamped)?;
        stages.at("clocks of the files", 0.0);
        let problem = Problem::from_streams(set, Some(&nominal), options).map_err(Failure::input)?;
        notes.extend(problem.notes.iter().cloned());
        let mut warnings = problem.warnings.clone();
        warnings.extend(nominal.findings.iter().map(ToString::to_string));
        let nominal = Some((nominal, file));
        Ok(Self { problem, warnings, notes, unused_rows: 0, nominal, recorded: None, case: None })
    }

    /// Reads a recording of one body: one file, or several with clocks of their own.
    ///
    /// # Errors
    /// Bad input: what cannot be read, or is no recording of a body.
    fn body(path: &Path, rig: Option<&Path>, file: Option<&Path>) -> Result<Self, Failure> {
        if let Some(mut set) = stream_set(path, rig)? {
            calibration::take(&mut set.rig, file)?;
            let problem = Problem::from_streams(set, None, &ProblemOptions::default());
            let problem = problem.map_err(Failure::input)?;
            let (mut notes, warnings) = (problem.notes.clone(), problem.warnings.clone());
            notes.extend(assumed(&problem.rig));
            return Ok(Self {
                problem,
                warnings,
                notes,
                unused_rows: 0,
                nominal: None,
                recorded: None,
                case: None,
            });
        }
        Self::of_body(Recording::load(path, rig)?, file)
    }

    /// Poses the problem of a recording of one body.
    ///
    /// # Errors
    /// Bad input: it is no recording of a body.
    pub(super) fn of_body(mut recording: Recording, file: Option<&Path>) -> Result<Self, Failure> {
        recording.leave_out_spikes();
        calibration::take(&mut recording.rig, file)?;
        let joints = super::recorded::joints_of(&recording);
        let looked_at = diagnosis::looked_at(&recording);
        let problem = Problem::of_body(recording).map_err(|error| {
            let assumed = super::recorded::assumed_columns(&looked_at);
            let failure = Failure::input(match joints.first() {
                None => error.to_string(),
                Some(joint) => format!(
                    "{error}. Its columns {joint}_… are of a robot's joints: to identify its links give its description by \
                     --model FILE"
                ),
            });
            match assumed {
                Some(assumed) => failure.after(&assumed),
                None => failure,
            }
        })?;
        let recording = looked_at;
        let mut warnings = recording.warnings.clone();
        warnings.extend(super::recorded::assumed_columns(&recording));
        warnings.extend(problem.warnings.iter().cloned());
        warnings.extend(left_out_columns(&recording, &joints));
        let recorded = recording.recorded();
        warnings.extend(recording.rig.calibrated().and_then(|c| c.expired(recorded.as_deref())));
        let calibrated = recording.rig.calibrated();
        warnings.extend(calibrated.and_then(|c| c.repeated(problem.source().fingerprint())));
        warnings.extend(problem.rig.imu.first().and_then(|imu| input_checks::far_away(imu.position_m)));
        let mut notes = problem.notes.clone();
        notes.extend(assumed(&recording.rig));
        let case = Some(Case { recording, model: None, options: ProblemOptions::default() });
        Ok(Self { problem, warnings, notes, unused_rows: 0, nominal: None, recorded, case })
    }

    /// Returns the source of rows.
    pub(super) fn source(&self) -> &dyn RowSource {
        self.problem.source()
    }

    /// Returns the nominal model of a tree, and its file.
    pub(super) fn nominal(&self) -> Option<(&Model, Option<&Path>)> {
        self.nominal.as_ref().map(|(model, file)| (model, file.as_deref()))
    }

    /// Fits the recording; the uncertainty of skews between several clocks is counted.
    ///
    /// # Errors
    /// Bad input: no usable rows, or a span that cannot be kept.
    pub(super) fn fit(
        &self,
        span: Option<Span<f64>>,
        points: usize,
        stages: &Stages,
    ) -> Result<Fit, Failure> {
        if span.is_some() && self.problem.time_base().is_some() {
            return Err(Failure::input(
                "--forget and --window: not of several files with clocks of their own, as the uncertainty of their skews is \
                 that of a whole run; give one recording",
            ));
        }
        let options = FitOptions { forgetting: span, convergence_points: points };
        let progress = |stage: &str, share: f64| stages.at(stage, share);
        let found = self.problem.fit(&options, &progress).map_err(|error| {
            // Readings in another unit may all be beyond a sensor's range.
            let no_rows = matches!(error, ProblemError::Fit(FitError::NoRows { .. }));
            let case = self.case.as_ref().filter(|_| no_rows);
            let cause = case.and_then(|case| diagnosis::diagnose(case, None, &progress));
            Failure::input(match cause {
                Some(Cause { what, mend, .. }) => format!("{error}. Most likely {what}: {mend}"),
                None => error.to_string(),
            })
        })?;
        Ok(self.with_unused(found))
    }

    /// Judges the answer of a fit by the faults that a recording may have; returns the one that explains it, to be explained.
    pub(super) fn judge(&self, fit: &Fit, answer: &mut Answer) -> Option<Cause> {
        let stages = Stages::new("looking for the cause");
        let progress = |stage: &str, share: f64| stages.at(stage, share);
        diagnosis::judge(self.case.as_ref()?, fit, answer, &progress)
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
    /// Bad input: no usable rows, or a factor of other parameters.
    pub(super) fn fit_device(
        self,
        device: &DeviceFactor,
        span: Option<Span<f64>>,
        stages: &Stages,
    ) -> Result<(Self, Fit), Failure> {
        let options = FitOptions { forgetting: span, convergence_points: PLOT_POINTS };
        let progress = |stage: &str, share: f64| stages.at(stage, share);
        let (problem, found) =
            self.problem.fit_device(device, &options, &progress).map_err(Failure::input)?;
        let loaded = Self { problem, ..self };
        let found = loaded.with_unused(found);
        Ok((loaded, found))
    }

    /// Wraps the readings of one body that a device took or was given.
    pub(super) fn of_readings(
        name: &str,
        rig: &RigFile,
        readings: Vec<Reading<f64>>,
        rate_hz: Option<f64>,
        gravity_columns: bool,
    ) -> Self {
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
            case: None,
        }
    }

    /// Wraps what a device read of a tree; accelerometers of links beyond the base have served their attitudes and are not
    /// among the rows.
    ///
    /// # Errors
    /// Bad input: the recording does not fit the model.
    pub(super) fn of_links(recording: &Recording, model: &Model) -> Result<Self, Failure> {
        let mut read = recording.clone();
        read.imus.iter_mut().skip(1).for_each(|imu| imu.accel = None);
        let problem = Problem::from_recording(&read, Some(model), &ProblemOptions::default());
        let problem = problem.map_err(Failure::input)?;
        let notes = problem.notes.clone();
        let warnings = model.findings.iter().map(ToString::to_string).collect();
        let unused_rows = (recording.rows() as u64).saturating_sub(problem.source().samples() as u64);
        Ok(Self {
            problem,
            warnings,
            notes,
            unused_rows,
            nominal: Some((model.clone(), None)),
            recorded: recording.recorded(),
            case: None,
        })
    }

    /// Returns the names of a tree's links, fixed joints welded; empty of one body.
    pub(super) fn link_names(&self) -> Vec<String> {
        let model = self.nominal.as_ref().map(|(model, _)| model.welded());
        model.map_or_else(Vec::new, |model| model.links.into_iter().map(|l| l.name).collect())
    }

    /// Returns the mean wrench of the same pose at the end less that at the beginning; `None` where a pose has no readings.
    pub(super) fn drift(&self, spans: [(f64, f64); 2], found: &Fit) -> Option<Drift> {
        let Subject::Body { source, .. } = &self.problem.subject else { return None };
        super::drift::of_body(&source.input().readings, spans, found)
    }

    /// Returns the factor of a fit, named after the recording, with what the checks of that found.
    pub(super) fn factor(&self, found: &Fit) -> PooledFactor {
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
    pub(super) fn factor_of(&self, found: &Fit, answer: &Answer, skipped: usize) -> PooledFactor {
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
    pub(super) fn origin(&self, mcu: &str) -> Source {
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
    pub(super) fn time_base(&self) -> Option<TimeBase> {
        self.problem.time_base().cloned()
    }

    /// Returns the tree for an answer; `None` of one body.
    pub(super) fn links<'a>(&'a self, options: &StandardOptions) -> Option<Links<'a>> {
        self.problem.links(self.nominal.as_ref().map(|(nominal, _)| StandardRequest {
            nominal,
            trust: options.trust,
            symmetric: options.symmetric,
            required: options.required(),
        }))
    }

    /// Returns the motion over time for the plots; times count from the first sample.
    pub(super) fn motion(&self) -> Vec<TimePlot> {
        match &self.problem.subject {
            Subject::Body { source, gravity_columns } => {
                super::motion_plots::of_body(source.input(), *gravity_columns)
            }
            Subject::Tree { .. } | Subject::Suspended { .. } => Vec::new(),
        }
    }
}

/// Returns the tree that a recording is of, as its source has it, and the robot description that it was read from: by
/// --model, or the `[[link]]` tables of its rig file if there are several; `None` if it is of a single body.
///
/// # Errors
/// Bad input: the tree is none.
pub(super) fn tree_of(
    recording: &Path,
    rig: Option<&Path>,
    options: &TreeModel,
) -> Result<Option<(Model, Option<PathBuf>)>, Failure> {
    let of_file = if options.model.is_some() { None } else { rig_of(recording, rig) };
    tree_in(recording, of_file, options)
}

/// Returns the same where the rig file has been read.
///
/// # Errors
/// Bad input: the tree is none.
pub(super) fn tree_in(
    recording: &Path,
    rig: Option<RigFile>,
    options: &TreeModel,
) -> Result<Option<(Model, Option<PathBuf>)>, Failure> {
    if let Some(name) = &options.model {
        let (model, is_person) = super::model::read(name, &options.changes)?;
        return Ok(Some((model, (!is_person).then(|| Path::new(name).to_owned()))));
    }
    let Some(rig) = rig.filter(|rig| rig.link.len() > 1) else { return Ok(None) };
    super::model::refuse_a_person(&options.changes)?;
    let name = recording.display().to_string();
    let mut model =
        rigident::named_model::rig_links::from_tables(&rig.link, &name).map_err(Failure::input)?;
    let stem = recording.file_stem().map_or(name, |stem| stem.to_string_lossy().into_owned());
    model.name = stem.strip_suffix(".rig").unwrap_or(&stem).to_owned();
    Ok(Some((model, None)))
}

/// Returns true if the rig file of a recording says that springs carry the platform.
pub(super) fn is_on_springs(recording: &Path, rig: Option<&Path>) -> bool {
    rig_of(recording, rig).is_some_and(|rig| rig.suspension.is_some())
}

/// Changes a tree as the options say, joints being locked where the recording has them; returns what to know of it.
///
/// # Errors
/// Bad input: no such joint or link, or a joint to be locked moves.
pub(super) fn change_as_recorded(
    model: &mut Model,
    changes: &ModelChanges,
    recording: &Recording,
) -> Result<Vec<String>, Failure> {
    let mut changes = changes.clone();
    let mut told = locked_joints::lock(model, &std::mem::take(&mut changes.lock), recording)?;
    locked_joints::meet(model, &std::mem::take(&mut changes.spherical), recording)?;
    super::model::change(model, &changes)?;
    told.extend(changes.tool.iter().map(|words| note_on_tool(words)));
    Ok(told)
}

fn note_on_tool(words: &str) -> String {
    let link = words.split('@').next().unwrap_or(words);
    format!(
        "--tool {words} changes nothing of the answer: what {link} holds is one body with it, and {link}'s base parameters are \
         those of both. It has no nominal model, so that it is not among the full parameters and not written: they count it to \
         {link}. Identify without the tool, too, and take the difference"
    )
}

/// Returns the rig file that the recording has; one that cannot be read is another's to complain of.
fn rig_of(path: &Path, rig: Option<&Path>) -> Option<RigFile> {
    let rig = match rig {
        Some(rig) => rig.to_owned(),
        None if is_rig_file(path) => path.to_owned(),
        None => rig_path(path),
    };
    let beside = RigFile::load(&rig).ok();
    if beside.is_some() || path.is_dir() {
        return beside;
    }
    // A recording may carry its rig file.
    let is_mcap = extension(path) == "mcap";
    is_mcap.then(|| Recording::load(path, None).ok().map(|r| r.rig)).flatten()
}

/// Refuses options of trees where nothing says which tree.
///
/// # Errors
/// Bad input, with the option's name.
pub(super) fn refuse_tree_options(given: &[(&str, bool)]) -> Result<(), Failure> {
    match given.iter().find(|(_, given)| *given) {
        None => Ok(()),
        Some((option, _)) => Err(Failure::input(format!(
            "{option} is for trees of links: say which by --model, or by [[link]] tables in the rig file"
        ))),
    }
}

/// Returns what the calibration of a rig assumed of its reference.
fn assumed(rig: &RigFile) -> Vec<String> {
    let of = |note: &String| format!("calibration of the rig: {note}");
    rig.calibrated().map_or_else(Vec::new, |calibration| calibration.assumed.iter().map(of).collect())
}
