//! The application's jobs: identify, factor, merge and solve, by their functions.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use rigident::application::{
    self, Caller, Changes, Error, FactorOptions, Fixture, IdentifyOptions, Recorded, SolveOptions, Tree,
    payload, write_loads,
};
use rigident::fit::Silent;
use rigident::fit::pool::PooledFactor;
use rigident::fit::prior::KnownValues;
use rigident::model::human::{Person, Sex};
use rigident::rows::tree::drive::Friction;
use rigident_shared::forgetting::Span;
use rigident_shared::printable;

use crate::answers::{Answered, Residuals, answered};
use crate::calls::watched;
use crate::errors::Refused;
use crate::recordings::Recording;
use crate::worded;

/// A recording: a path, or one in memory.
#[derive(FromPyObject)]
pub enum Given<'py> {
    /// Of arrays.
    Memory(PyRef<'py, Recording>),
    /// A file, a rig file that lists several, or their folder.
    File(PathBuf),
}

/// A run with the bare fixture.
#[derive(FromPyObject)]
pub enum Run {
    /// The bytes of a factor, and its name.
    Factor(PyBackedBytes, String),
    /// A recording or a factor.
    File(PathBuf),
}

/// Which tree a recording is of, as the fields of the command line say it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct TreeWords {
    model: Option<String>,
    lock: Vec<String>,
    spherical: Vec<String>,
    tool: Vec<String>,
    height_m: Option<f64>,
    mass_kg: Option<f64>,
    sex: Option<String>,
}

impl TreeWords {
    fn typed(self) -> Result<Tree, Refused> {
        let three = |words: &String| -> Result<[String; 3], Refused> {
            let joints: Vec<String> = words.split(',').map(|joint| joint.trim().to_owned()).collect();
            joints
                .try_into()
                .map_err(|_| Refused::usage(format!("spherical {words}: names three joints, J1,J2,J3")))
        };
        let default = Person::default();
        let sex = match self.sex.as_deref() {
            None => default.sex,
            Some("female") => Sex::Female,
            Some("male") => Sex::Male,
            Some(other) => return Err(Refused::usage(format!("sex {other:?}: must be 'female' or 'male'"))),
        };
        let person = Person {
            height_m: self.height_m.unwrap_or(default.height_m),
            mass_kg: self.mass_kg.unwrap_or(default.mass_kg),
            sex,
            lengths_m: Vec::new(),
        };
        let spherical = self.spherical.iter().map(three).collect::<Result<_, _>>()?;
        for name in self.model.iter().chain(&self.tool) {
            plain(name)?;
        }
        Ok(Tree {
            model: self.model,
            changes: Changes { lock: self.lock, spherical, tool: self.tool, person },
        })
    }
}

/// The way a recording is read.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ReadWords {
    rig: Option<PathBuf>,
    calibration: Option<PathBuf>,
    tree: TreeWords,
}

/// The request for an answer.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct AskWords {
    estimate: Vec<String>,
    known: Vec<(String, f64, f64)>,
    symmetry: Vec<String>,
    tare: Vec<Run>,
}

impl AskWords {
    /// Returns what must be identified, what is known, and the fixture.
    fn typed(self) -> Result<(Vec<String>, KnownValues, Vec<Fixture>), Refused> {
        let asked = self.estimate.iter().flat_map(|words| words.split(',')).map(str::to_owned).collect();
        let known: Vec<String> =
            self.known.iter().map(|(name, value, sigma)| format!("{name}={value:?}±{sigma:?}")).collect();
        let known = KnownValues::parse(&known, &self.symmetry).map_err(Error::from)?;
        let mut runs = Vec::new();
        for run in self.tare {
            runs.push(match run {
                Run::File(path) => {
                    plain(&path.to_string_lossy())?;
                    Fixture::File(path)
                }
                Run::Factor(bytes, name) => {
                    Fixture::Factor(Box::new(PooledFactor::from_bytes(&bytes, &name).map_err(Error::from)?))
                }
            });
        }
        Ok((asked, known, runs))
    }
}

/// The parameters identified from a recording, and the method.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct IdentifyWords {
    read: ReadWords,
    ask: AskWords,
    forget_s: Option<f64>,
    window_s: Option<f64>,
    friction: Vec<String>,
    drive: Vec<String>,
    nominal_sigma: Option<f64>,
    symmetric_sides: bool,
    payload: Option<String>,
    write_model: Option<PathBuf>,
    write_load: Vec<PathBuf>,
    residuals: bool,
}

impl IdentifyWords {
    fn typed(self) -> Result<(IdentifyOptions, Vec<PathBuf>), Refused> {
        let span = match (self.forget_s, self.window_s) {
            (Some(_), Some(_)) => {
                return Err(Refused::usage("forget_s and window_s: give one of them".to_owned()));
            }
            (forget, window) => forget.map(Span::TimeConstant).or(window.map(Span::Window)),
        };
        for path in self.write_model.iter().chain(&self.write_load) {
            plain(&path.to_string_lossy())?;
        }
        if self.payload.is_none() && !self.write_load.is_empty() {
            return Err(Refused::usage("write_load: needs a payload".to_owned()));
        }
        let ReadWords { rig, calibration, tree } = self.read;
        let (asked, known, tare) = self.ask.typed()?;
        let default = IdentifyOptions::default();
        let options = IdentifyOptions {
            rig,
            calibration,
            span,
            tare,
            known,
            asked,
            tree: tree.typed()?,
            friction: Friction::parse(&self.friction).map_err(Error::Friction)?,
            drives: self.drive,
            nominal_sigma: self.nominal_sigma.unwrap_or(default.nominal_sigma),
            symmetric_sides: self.symmetric_sides,
            write_model: self.write_model,
            payload: self.payload,
        };
        payload::check_files(&self.write_load)?;
        Ok((options, self.write_load))
    }
}

/// Identifies the body, or the tree of links, of a recording.
///
/// # Errors
/// Raises `RigidentError` if there is no answer.
#[pyfunction]
pub fn identify(py: Python<'_>, recording: Given<'_>, options: IdentifyWords) -> PyResult<Answered> {
    let recording = recorded(recording).map_err(|why| why.raised(py, &[]))?;
    let done = watched(py, move |stop| -> Result<_, Refused> {
        let asks_residuals = options.residuals;
        let (options, loads) = options.typed()?;
        let found = application::identify(recording, &options, &caller(&stop))?;
        let mut messages = Vec::new();
        if let Some(model) = &found.model {
            model.write()?;
        } else if let Some(path) = options.write_model.filter(|_| found.answer.is_contradicted()) {
            messages
                .push(format!("write_model {}: not written: the recording cannot be true", path.display()));
        }
        let written = write_loads(&found.answer, &loads, &caller(&stop))?;
        let is_written = written.iter().all(|load| load.refused.is_none());
        for load in written {
            messages.extend(
                load.refused.map(|why| format!("write_load {}: not written: {why}", load.path.display())),
            );
        }
        if found.answer.payload.is_none() {
            let why = "the recording with the payload cannot be true";
            messages.extend(
                loads.iter().map(|path| format!("write_load {}: not written: {why}", path.display())),
            );
        }
        let residuals = asks_residuals.then(|| Residuals::of(&found.fit));
        Ok(Answered { residuals, ..answered(&found, is_written, messages)? })
    })?;
    done.map_err(|why| why.raised(py, &[]))
}

/// Reduces a recording to its factor; returns its bytes, and what was noticed.
///
/// # Errors
/// Raises `RigidentError` if the recording cannot be used.
#[pyfunction]
pub fn factor(py: Python<'_>, recording: Given<'_>, options: ReadWords) -> PyResult<(Vec<u8>, Vec<String>)> {
    let recording = recorded(recording).map_err(|why| why.raised(py, &[]))?;
    let done = watched(py, move |stop| -> Result<_, Refused> {
        let ReadWords { rig, calibration, tree } = options;
        let options = FactorOptions { rig, calibration, tree: tree.typed()?, ..FactorOptions::default() };
        let name = recording.name();
        let made = application::factor(recording, &options, &caller(&stop))?;
        let mut messages: Vec<String> =
            made.warnings().chain(&made.notes).map(|said| format!("{name}: {said}")).collect();
        if made.is_contradicted() {
            messages.push(format!("{name}: not to be used; the factor says so to whoever solves it"));
        }
        Ok((made.factor.to_bytes(), messages))
    })?;
    done.map_err(|why| why.raised(py, &[]))
}

/// Merges factors, each its bytes and its name; returns the bytes, and what was noticed.
///
/// # Errors
/// Raises `RigidentError` if they are not of one body.
#[pyfunction]
pub fn merge(
    py: Python<'_>,
    factors: Vec<(PyBackedBytes, String)>,
    shared_offset: bool,
    force: bool,
) -> PyResult<(Vec<u8>, Vec<String>)> {
    let done = watched(py, move |_| -> Result<_, Refused> {
        let read = |(bytes, name): &(PyBackedBytes, String)| PooledFactor::from_bytes(bytes, name);
        let factors = factors.iter().map(read).collect::<Result<Vec<_>, _>>().map_err(Error::from)?;
        let merged = application::merge(factors, shared_offset, force)?;
        let mut messages = Vec::new();
        if merged.repeated > 0 {
            let (repeated, given) = (merged.repeated, merged.given);
            messages
                .push(format!("{repeated} of {given} factors are left out: their recordings are in others"));
        }
        messages.extend(merged.warnings);
        Ok((merged.factor.to_bytes(), messages))
    })?;
    done.map_err(|why| why.raised(py, &[]))
}

/// Solves a factor, its bytes and its name.
///
/// # Errors
/// Raises `RigidentError` if there is no answer.
#[pyfunction]
pub fn solve(
    py: Python<'_>,
    factor: (PyBackedBytes, String),
    rig: Option<PathBuf>,
    ask: AskWords,
    without_platform: bool,
) -> PyResult<Answered> {
    let done = watched(py, move |stop| {
        let (asked, known, tare) = ask.typed()?;
        if without_platform && !tare.is_empty() {
            return Err(Refused::usage("without_platform and tare: give one of them".to_owned()));
        }
        let options = SolveOptions { rig, without_platform, tare, known, asked };
        let (bytes, name) = factor;
        let pooled = PooledFactor::from_bytes(&bytes, &name).map_err(Error::from)?;
        answered(&application::solve(&pooled, &options, &caller(&stop))?, true, Vec::new())
    })?;
    done.map_err(|why| why.raised(py, &[]))
}

pub(crate) fn caller(stop: &Arc<AtomicBool>) -> Caller<'_> {
    Caller::new(&Silent).stopped_by(stop).worded_by(worded::notice)
}

fn recorded(given: Given<'_>) -> Result<Recorded, Refused> {
    match given {
        Given::Memory(recording) => Ok(recording.inner.clone().into()),
        Given::File(path) => {
            plain(&path.to_string_lossy())?;
            Ok(path.into())
        }
    }
}

/// Refuses names that would steer a terminal or a notebook: they go into messages and written files.
pub(crate) fn plain(name: &str) -> Result<(), Refused> {
    if name.chars().any(printable::steers) {
        return Err(Refused::usage(format!(
            "'{}' has control characters: names of files go into messages and written files; rename it",
            printable::name(name)
        )));
    }
    Ok(())
}
