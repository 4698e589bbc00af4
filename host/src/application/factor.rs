//! From a recording to its factor: all that it says of its body.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::{Caller, Error, Loaded, Recorded, Tree};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Fit, Progress};
use rigident_rows::tree::ProblemOptions;

/// The way a recording is reduced.
#[derive(Clone, Debug, Default)]
pub struct FactorOptions {
    /// The rig file of a recording that is a file. Default: the one beside it.
    pub rig: Option<PathBuf>,
    /// The calibration of the rig. Default: that of the rig file.
    pub calibration: Option<PathBuf>,
    /// The tree that the recording is of.
    pub tree: Tree,
    /// Labels beside those of the rig file, and before them.
    pub labels: BTreeMap<String, String>,
}

/// A recording reduced to its factor.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The factor, which keeps what the checks of the recording found.
    pub factor: PooledFactor,
    /// The steps done, as information.
    pub notes: Vec<String>,
}

impl Reduced {
    /// Returns what the checks of the recording found.
    pub fn warnings(&self) -> impl Iterator<Item = &String> {
        let checks = self.factor.sources.iter().filter_map(|source| source.checks.as_ref());
        checks.flat_map(|checks| &checks.warnings)
    }

    /// Returns true if the recording cannot be true: whoever solves the factor finds that, too.
    pub fn is_contradicted(&self) -> bool {
        let mut checks = self.factor.sources.iter().filter_map(|source| source.checks.as_ref());
        checks.any(|checks| checks.contradicted)
    }
}

/// Reduces a recording to its factor.
///
/// # Errors
/// The recording cannot be read or used, or the caller stops the job.
pub fn factor(recording: Recorded, options: &FactorOptions, caller: &Caller<'_>) -> Result<Reduced, Error> {
    caller.stoppable(|| Ok(reduced(recording, options, &ProblemOptions::default(), caller)?.0))
}

/// Reduces a recording to its factor, and returns the fit too.
pub(super) fn reduced(
    recording: Recorded,
    options: &FactorOptions,
    problem: &ProblemOptions,
    caller: &Caller<'_>,
) -> Result<(Reduced, Fit), Error> {
    let name = recording.name();
    caller.stage(&format!("reading {name}"), 0.0);
    let calibration = options.calibration.as_deref();
    let mut loaded =
        Loaded::of(recording, options.rig.as_deref(), calibration, &options.tree, problem, caller)?;
    let labels = options.labels.iter().map(|(key, value)| (key.clone(), value.clone()));
    loaded.problem.rig.recording.labels.extend(labels);
    let found = loaded.fit(None, 0, caller).map_err(|error| error.of(&name))?;
    let factor = PooledFactor { name, ..loaded.factor(&found) };
    Ok((Reduced { factor, notes: loaded.notes }, found))
}
