//! Recordings of a reference body, as `calibrate rig` and `verify` read them.

use std::path::Path;

use super::calibration_arguments::ReferenceRuns;
use super::{Failure, Stages, factor, recorded};
use rigident::application::recorded::named;
use rigident::application::{Tree, calibrate};
use rigident::problem::{Problem, ProblemOptions, Subject};
use rigident::reference::body::Mounted;
use rigident::reference::{ReferenceBody, Run};
use rigident::rows::body::BodySource;
use rigident_fit::tare::Tare;
use rigident_io::recording::Recording;

/// Name of the mounting that is `[place]` as it is.
const PLACE: &str = "place";

/// A recording with the body as it was mounted.
pub(super) struct Read {
    /// The path as it was given.
    pub(super) name: String,
    pub(super) problem: Problem,
    pub(super) mounted: Mounted,
    /// Name of the mounting; empty: its place.
    pub(super) mounting: String,
    /// The warnings that a user should act on.
    pub(super) warnings: Vec<String>,
}

impl Read {
    /// Returns the rows of the body.
    ///
    /// # Errors
    /// Bad input: the recording is of several links.
    pub(super) fn source(&self) -> Result<&BodySource, Failure> {
        match &self.problem.subject {
            Subject::Body { source, .. } => Ok(source),
            Subject::Tree { .. } | Subject::Suspended { .. } => {
                Err(Failure::input(format!("{}: a reference is one body on a load cell", self.name)))
            }
        }
    }

    /// Returns the run for a calibration.
    ///
    /// # Errors
    /// See [`Read::source`].
    pub(super) fn run(&self) -> Result<Run<'_>, Failure> {
        Ok(Run { name: self.name.clone(), source: self.source()?, mounted: self.mounted.clone() })
    }
}

/// The rig's errors that recordings are read with.
#[derive(Clone, Copy)]
pub(super) enum RigErrors<'a> {
    /// Those of the rig file without its calibration.
    Uncalibrated,
    /// Those of the rig file, its calibration, or another one.
    Calibrated(Option<&'a Path>),
}

/// Reads the reference body and all recordings of it.
///
/// # Errors
/// Bad input: what cannot be read, is of several links or files, or does not go together.
pub(super) fn read(
    arguments: &ReferenceRuns,
    errors: RigErrors<'_>,
    command: &str,
) -> Result<(ReferenceBody, Vec<Read>), Failure> {
    let body = ReferenceBody::load(&arguments.reference).map_err(Failure::input)?;
    let (asked, count) = (arguments.mounting.len(), arguments.recordings.len());
    if asked > 1 && asked != count {
        return Err(Failure::input(format!(
            "--mounting names {asked} mountings of {count} recordings: give one for each, in their order, or one for all"
        )));
    }
    let (mut notes, mut warnings) = (Vec::new(), Vec::new());
    let rig = arguments.rig.as_deref();
    let own = match errors {
        RigErrors::Uncalibrated => None,
        RigErrors::Calibrated(file) => file,
    };
    let tare = factor::tare(&arguments.tare, rig, own, &Tree::default(), (&mut notes, &mut warnings))?;
    let mut all = Vec::new();
    for (k, path) in arguments.recordings.iter().enumerate() {
        let path = named(path.clone());
        let stages = Stages::new(&format!("reading {}", path.display()));
        recorded::refuse_streams(&path, rig, command)?;
        let mut recording = Recording::load(&path, rig).map_err(Failure::input)?;
        recording.leave_out_spikes();
        if let RigErrors::Uncalibrated = errors {
            recording.rig.calibration = None;
        }
        calibrate(&mut recording.rig, own)?;
        let expired = recording.rig.calibrated().and_then(|c| c.expired(recording.recorded().as_deref()));
        let problem = Problem::from_recording(&recording, None, &ProblemOptions::default());
        let problem = problem.map_err(Failure::input)?;
        drop(stages);
        let named = arguments.mounting.get(k).or(arguments.mounting.first()).map_or("", String::as_str);
        let mounting = if named == PLACE { "" } else { named };
        let found = body.mounting(mounting).map_err(Failure::input)?;
        let mut mounted = body.mounted(found);
        if let Some(tare) = &tare {
            mounted = with_fixture(mounted, tare)?;
        }
        let mut said = recording.warnings.clone();
        said.extend(warnings.iter().cloned());
        said.extend(expired);
        let readings = problem.source().identity().fingerprint;
        said.extend(problem.rig.calibrated().and_then(|c| c.repeated(readings)));
        all.push(Read {
            name: path.display().to_string(),
            problem,
            mounted,
            mounting: mounting.to_owned(),
            warnings: said,
        });
    }
    Ok((body, all))
}

/// Adds the fixture to the body that is mounted.
fn with_fixture(mounted: Mounted, tare: &Tare) -> Result<Mounted, Failure> {
    let estimate = &tare.fit().estimate;
    let values: Vec<f64> = (0..10).map_while(|j| estimate.measured(j).map(|m| m.value)).collect();
    let Ok(values) = <[f64; 10]>::try_from(values) else {
        return Err(Failure::input(
            "--tare: the runs of the bare fixture do not determine all its ten parameters; record it in full motion",
        ));
    };
    let covariance = nalgebra::DMatrix::from_fn(10, 10, |i, j| estimate.covariance(i, j).unwrap_or(0.0));
    Ok(mounted.with_fixture(&values, &covariance))
}
