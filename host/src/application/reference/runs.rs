//! Recordings of a reference body, and the errors of the rig by them.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::calibrate_error::CalibrateError;
use super::super::recorded::named;
use super::super::tare::{ReadWith, tare};
use super::super::{Caller, Error, Fixture, Tree, calibrate};
use rigident_fit::tare::Tare;
use rigident_fit::{COVERAGE_95, Nuisance, Progress, RowSource};
use rigident_identify::problem::{Problem, ProblemOptions, Subject};
use rigident_identify::reference::body::Mounted;
use rigident_identify::reference::{self, ReferenceBody, Run};
use rigident_io::recording::Recording;
use rigident_io::rig::RigCalibration;
use rigident_io::rig::calibration::CalibratedRig;
use rigident_rows::body::BodySource;

/// Name of the mounting that is `[place]` as it is.
const PLACE: &str = "place";

/// Options of reading recordings of a reference body.
#[derive(Clone, Debug, Default)]
pub struct ReferenceOptions {
    /// The file of the reference body.
    pub reference: PathBuf,
    /// Names of its mountings, or `place`: one for each recording, or one for all; none: its place.
    pub mounting: Vec<String>,
    /// Rig file of all recordings. Default: `NAME.rig.toml` beside each.
    pub rig: Option<PathBuf>,
    /// Runs with the bare fixture.
    pub tare: Vec<Fixture>,
    /// The rig file's own calibration is left out: the errors of the rig are looked for.
    pub is_uncalibrated: bool,
    /// A calibration in place of the rig file's.
    pub calibration: Option<PathBuf>,
}

/// Recordings of a reference body.
///
/// ```
/// use rigident::application::{Caller, ReferenceOptions, ReferenceRuns};
///
/// let folder = tempfile::tempdir().unwrap();
/// let reference = folder.path().join("bracket.toml");
/// let body = "name = \"bracket\"\nmass_kg = 3.2\nmass_std_kg = 1e-3\n[measured]\n\
///             com_m = [0.0, 0.01, 0.053]\ncom_std_m = [1e-4, 1e-4, 1e-4]\n\
///             inertia_com_kgm2 = [0.021, 0.017, 0.012, 0.0004, -0.0003, 0.0002]\n\
///             inertia_com_std_kgm2 = [1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4]\n";
/// std::fs::write(&reference, body).unwrap();
/// let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/bracket.csv");
/// let options = ReferenceOptions { reference, ..ReferenceOptions::default() };
/// let runs = ReferenceRuns::read(&[recording.into()], &options, &Caller::default())?;
/// assert!(runs.verify(&Caller::default())?.passed);
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub struct ReferenceRuns {
    /// The body.
    pub body: ReferenceBody,
    /// The recordings.
    pub runs: Vec<ReferenceRun>,
}

/// A recording with the body as it was mounted.
pub struct ReferenceRun {
    /// The path of the recording.
    pub name: String,
    /// The estimation problem of the recording.
    pub problem: Problem,
    /// The body as it was mounted.
    pub mounted: Mounted,
    /// Name of the mounting; empty: its place.
    pub mounting: String,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
}

/// The errors of a rig that recordings of a reference show.
#[derive(Clone, Debug, Serialize)]
pub struct RigErrors {
    /// Name of the reference body.
    pub reference: String,
    /// The recordings.
    pub recordings: Vec<String>,
    /// The errors.
    pub errors: Vec<RigError>,
    /// The assumptions made.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// The errors as a calibration that rig files take, without its name and seal.
    #[serde(skip)]
    calibration: RigCalibration,
}

/// An error of a rig, before and after.
#[derive(Clone, Debug, Serialize)]
pub struct RigError {
    /// The name of the error.
    pub name: String,
    /// The part of the rig.
    pub group: String,
    /// The unit of the error.
    pub unit: String,
    /// 1 σ by data sheets.
    pub sigma_before: f64,
    /// The estimated value.
    pub value: f64,
    /// The standard deviation of the value.
    pub sigma: f64,
    /// The 95 % expanded uncertainty of the value.
    pub u95: f64,
}

impl ReferenceRuns {
    /// Reads the reference body and all recordings of it.
    ///
    /// # Errors
    /// A file cannot be read, a recording is of several links, or mountings, fixture and calibration do not
    /// go together with them.
    pub fn read(
        recordings: &[PathBuf],
        options: &ReferenceOptions,
        caller: &Caller<'_>,
    ) -> Result<Self, Error> {
        caller.stoppable(|| read(recordings, options, caller))
    }

    /// Finds the errors of the rig's sensors and of their mounting, in one joint solution over all
    /// recordings.
    ///
    /// # Errors
    /// The recordings are of two rigs, one is given twice, or they contradict the reference or the rig; the
    /// caller stops the job.
    pub fn calibrate(&self, caller: &Caller<'_>) -> Result<RigErrors, Error> {
        caller.stoppable(|| self.calibrated(caller))
    }

    fn calibrated(&self, caller: &Caller<'_>) -> Result<RigErrors, Error> {
        let mut of: Option<CalibratedRig> = None;
        for read in &self.runs {
            let own = CalibratedRig::of(&read.problem.rig)?;
            if of.as_ref().is_some_and(|of| *of != own) {
                let first = self.runs.first().map_or_else(String::new, |first| first.name.clone());
                return Err(CalibrateError::OtherRig { name: read.name.clone(), first }.into());
            }
            of = Some(own);
        }
        let of = of.ok_or(CalibrateError::NoRecording)?;
        let runs = self.runs.iter().map(ReferenceRun::run).collect::<Result<Vec<_>, _>>()?;
        let mut fingerprints: Vec<String> = Vec::new();
        for run in &runs {
            let own = RigCalibration::fingerprint(run.source.identity().fingerprint);
            if fingerprints.contains(&own) {
                return Err(CalibrateError::Twice(run.name.clone()).into());
            }
            fingerprints.push(own);
        }
        let found = reference::calibrate(&runs, caller).map_err(CalibrateError::from)?;
        let units: Vec<String> = found.before.iter().map(|k| k.unit.clone()).collect();
        let recordings: Vec<String> = self.runs.iter().map(|read| read.name.clone()).collect();
        let notes: Vec<String> = self.body.place.assumed().into_iter().collect();
        let error = |nuisance: &Nuisance| {
            let (value, sigma) = found.known.value(&nuisance.name).zip(found.known.sd(&nuisance.name))?;
            Some(RigError {
                name: nuisance.name.clone(),
                group: nuisance.group.clone(),
                unit: nuisance.unit.clone(),
                sigma_before: nuisance.sigma,
                value,
                sigma,
                u95: COVERAGE_95 * sigma,
            })
        };
        Ok(RigErrors {
            reference: self.body.name.clone(),
            errors: found.before.iter().filter_map(error).collect(),
            calibration: RigCalibration {
                reference: self.body.name.clone(),
                recordings: recordings.clone(),
                fingerprints,
                assumed: notes.clone(),
                ..RigCalibration::of(&found.known, &units, of)
            },
            recordings,
            notes,
        })
    }
}

impl RigErrors {
    /// Returns the calibration for rig files, valid for this many days, with its seal.
    pub fn calibration(&self, name: &str, valid_days: u32) -> RigCalibration {
        RigCalibration { name: name.to_owned(), valid_days, ..self.calibration.clone() }.sealed()
    }
}

impl ReferenceRun {
    /// Returns the run for a calibration.
    ///
    /// # Errors
    /// [`CalibrateError::NotOneBody`] if the recording is of several links.
    pub fn run(&self) -> Result<Run<'_>, Error> {
        let source: &BodySource = match &self.problem.subject {
            Subject::Body { source, .. } => source,
            Subject::Tree { .. } | Subject::Suspended { .. } => {
                return Err(CalibrateError::NotOneBody(self.name.clone()).into());
            }
        };
        Ok(Run { name: self.name.clone(), source, mounted: self.mounted.clone() })
    }
}

fn read(
    recordings: &[PathBuf],
    options: &ReferenceOptions,
    caller: &Caller<'_>,
) -> Result<ReferenceRuns, Error> {
    let body = ReferenceBody::load(&options.reference).map_err(CalibrateError::from)?;
    let asked = options.mounting.len();
    if asked > 1 && asked != recordings.len() {
        return Err(CalibrateError::Mountings { asked, recordings: recordings.len() }.into());
    }
    let own = options.calibration.as_deref().filter(|_| !options.is_uncalibrated);
    let (mut notes, mut warnings) = (Vec::new(), Vec::new());
    let with = ReadWith { rig: options.rig.as_deref(), calibration: own, tree: &Tree::default() };
    let fixture = tare(&options.tare, with, (&mut notes, &mut warnings), caller)?;
    let mut runs = Vec::new();
    for (k, path) in recordings.iter().enumerate() {
        let named = options.mounting.get(k).or(options.mounting.first()).map_or("", String::as_str);
        let mounting = if named == PLACE { "" } else { named };
        let mut run = one(path, (&body, mounting), (options, own, &warnings), caller)?;
        if let Some(fixture) = &fixture {
            run.mounted = with_fixture(run.mounted, fixture)?;
        }
        runs.push(run);
    }
    Ok(ReferenceRuns { body, runs })
}

fn one(
    path: &Path,
    (body, mounting): (&ReferenceBody, &str),
    (options, calibration, of_tare): (&ReferenceOptions, Option<&Path>, &[String]),
    caller: &Caller<'_>,
) -> Result<ReferenceRun, Error> {
    let path = named(path.to_owned());
    caller.stage(&format!("reading {}", path.display()), 0.0);
    let mut recording = Recording::load(&path, options.rig.as_deref())?;
    recording.leave_out_bad_readings();
    if options.is_uncalibrated {
        recording.rig.calibration = None;
    }
    calibrate(&mut recording.rig, calibration)?;
    let expired = recording.rig.calibrated().and_then(|c| c.expired(recording.recorded().as_deref()));
    let problem = Problem::from_recording(&recording, None, &ProblemOptions::default())?;
    let found = body.mounting(mounting).map_err(CalibrateError::from)?;
    let mut warnings = recording.warnings;
    warnings.extend(of_tare.iter().cloned());
    warnings.extend(expired);
    let readings = problem.source().identity().fingerprint;
    warnings.extend(problem.rig.calibrated().and_then(|c| c.repeated(readings)));
    Ok(ReferenceRun {
        name: path.display().to_string(),
        problem,
        mounted: body.mounted(found),
        mounting: mounting.to_owned(),
        warnings,
    })
}

/// Adds the fixture to the body that is mounted.
fn with_fixture(mounted: Mounted, tare: &Tare) -> Result<Mounted, Error> {
    let estimate = &tare.fit().estimate;
    let values: Vec<f64> = (0..10).map_while(|j| estimate.measured(j).map(|m| m.value)).collect();
    let Ok(values) = <[f64; 10]>::try_from(values) else {
        return Err(CalibrateError::Fixture.into());
    };
    let covariance = nalgebra::DMatrix::from_fn(10, 10, |i, j| estimate.covariance(i, j).unwrap_or(0.0));
    Ok(mounted.with_fixture(&values, &covariance))
}
