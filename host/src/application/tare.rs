//! The bare fixture, which is taken off with its uncertainty.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::factor::{FactorOptions, reduced};
use super::recorded::{is_recording, is_rig_file};
use super::{Caller, Error, Recorded, Tree};

use rigident_fit::pool::PooledFactor;
use rigident_fit::tare::{Tare, TareError};
use rigident_fit::{CheckedRun, Fit, Kind};
use rigident_io::recording::rig_path;
use rigident_rows::tree::ProblemOptions;

/// A run with the bare fixture.
#[derive(Clone, Debug)]
pub enum Fixture {
    /// A recording or a factor, by its file's name.
    File(PathBuf),
    /// A factor in memory.
    Factor(Box<PooledFactor>),
}

/// The files that recordings of a fixture are read with: the rig file and the calibration of those that have
/// none of their own, and the tree.
#[derive(Clone, Copy, Debug)]
pub struct ReadWith<'a> {
    /// The rig file.
    pub rig: Option<&'a Path>,
    /// The calibration of the rig.
    pub calibration: Option<&'a Path>,
    /// The tree.
    pub tree: &'a Tree,
}

/// Returns the fixture, if there are runs of it; what is to be known of it goes to the notes and warnings.
///
/// # Errors
/// A run cannot be read, or runs do not fit together.
pub fn tare(
    runs: &[Fixture],
    with: ReadWith<'_>,
    (notes, warnings): (&mut Vec<String>, &mut Vec<String>),
    caller: &Caller<'_>,
) -> Result<Option<Tare>, Error> {
    let Some(tare) = bare(runs, with, &ProblemOptions::default(), notes, caller)? else {
        return Ok(None);
    };
    notes.push(taken_off(&tare));
    warnings.extend(tare.warning());
    Ok(Some(tare))
}

/// Returns the merged runs of a fixture, if there are any; the errors of a single recording are stored.
///
/// # Errors
/// A run cannot be read, or runs do not fit together.
pub fn bare(
    runs: &[Fixture],
    with: ReadWith<'_>,
    options: &ProblemOptions,
    notes: &mut Vec<String>,
    caller: &Caller<'_>,
) -> Result<Option<Tare>, Error> {
    let (mut factors, mut fits) = (Vec::new(), Vec::new());
    for run in runs {
        let path = match run {
            Fixture::Factor(factor) => {
                factors.push((**factor).clone());
                continue;
            }
            Fixture::File(path) if !is_recording(path) => {
                factors.push(PooledFactor::read(path)?);
                continue;
            }
            Fixture::File(path) => path,
        };
        // Its own rig file if it has one: the fixture's run may have been taken with another IMU.
        let own = is_rig_file(path) || rig_path(path).exists();
        let how = FactorOptions {
            rig: with.rig.filter(|_| !own).map(Path::to_owned),
            calibration: with.calibration.map(Path::to_owned),
            tree: with.tree.clone(),
            labels: BTreeMap::new(),
        };
        let (reduced, fit) = reduced(Recorded::File(path.clone()), &how, options, caller)?;
        fits.push(fit);
        notes.extend(reduced.notes.into_iter().map(|said| format!("tare {}: {said}", path.display())));
        factors.push(reduced.factor);
    }
    if factors.is_empty() {
        return Ok(None);
    }
    let pooled = PooledFactor::merged(factors, false)?;
    let tare = match fits.as_slice() {
        [run] if pooled.runs() == 1 => Tare::of_run(run, pooled),
        _ => Tare::new(pooled),
    };
    Ok(Some(tare?))
}

/// Takes a fixture off a fit; what that assumes of the rigs of both goes to the notes.
///
/// # Errors
/// Fails as [`Tare::take_off`] does.
pub fn take_off(tare: &Tare, found: &mut Fit, notes: &mut Vec<String>) -> Result<(), TareError> {
    notes.extend(rigident_present::merged::rigs_of_tare(&found.rows(), &tare.fit().rows()));
    tare.take_off(found)
}

/// Returns the note that a fixture is taken off.
pub fn taken_off(tare: &Tare) -> String {
    if tare.fit().runs.iter().any(CheckedRun::is_contradicted) {
        return format!("tare: {} cannot be true, and nothing is left of the difference", tare.recordings());
    }
    let mass = match tare.fit().parameters.iter().position(|p| p.kind == Kind::Mass) {
        Some(j) => tare.fit().estimate.measured(j),
        None => None,
    };
    let mass =
        mass.map_or("unknown mass".to_owned(), |m| rigident_fit::figures::with_u95(m.value, m.u95, "kg"));
    format!("tare: a fixture of {mass} was subtracted with its uncertainty ({})", tare.recordings())
}
