//! Factors of one body as one.

use std::path::Path;

use super::{Caller, Error};

use rigident_fit::Progress;
use rigident_fit::pool::{PooledFactor, disagreement_in_words};
use rigident_io::union::{Union, union, union_of_files};

/// Runs that disagree by more than this many times their noise are of different bodies or rigs. What drifts
/// from run to run of one body, offsets apart, stays below.
const FOREIGN: f64 = 10.0;

/// Factors as one.
#[derive(Clone, Debug)]
pub struct Merged {
    /// The rows of all runs, each once.
    pub factor: PooledFactor,
    /// Factors that were left out, because all their runs are in others.
    pub repeated: usize,
    /// Factors in all, with those.
    pub given: usize,
    /// The agreement of the runs with each other, and what merging assumes.
    pub warnings: Vec<String>,
}

/// Merges factors of one body: in any order, and one whose recordings are all in others counts once.
///
/// `shared_offset` says that all have one wrench offset between them, `force` that those are merged, too,
/// that disagree more than ten times as much as their noise explains.
///
/// # Errors
/// [`Error::Factors`] if they are of other models or have only some recordings in common,
/// [`Error::Disagree`].
pub fn merge(factors: Vec<PooledFactor>, shared_offset: bool, force: bool) -> Result<Merged, Error> {
    judged(union(factors, shared_offset)?, shared_offset, force)
}

/// Merges the factors in files as [`merge`] does, on all cores. Few of them are in memory at a time.
///
/// # Errors
/// Fails as [`merge`] does, if a file cannot be read, or if the caller stops the job.
pub fn merge_files<P: AsRef<Path> + Sync>(
    files: &[P],
    shared_offset: bool,
    force: bool,
    caller: &Caller<'_>,
) -> Result<Merged, Error> {
    caller.stoppable(|| {
        let done = |read: usize, of: usize| caller.stage("reading", read as f64 / of as f64);
        judged(union_of_files(files, shared_offset, &done)?, shared_offset, force)
    })
}

fn judged(all: Union, shared_offset: bool, force: bool) -> Result<Merged, Error> {
    let Union { factor, repeated, given } = all;
    let warnings = agreement(&factor, shared_offset, force)?;
    Ok(Merged { factor, repeated, given, warnings })
}

/// Returns what merged runs say of each other, and what merging them assumes.
///
/// # Errors
/// [`Error::Disagree`] if they disagree too much to be of one body, and are not to be merged all the same.
pub fn agreement(pooled: &PooledFactor, shared_offset: bool, force: bool) -> Result<Vec<String>, Error> {
    let mut said = Vec::new();
    if let Some(ratio) = pooled.unexplained_disagreement() {
        if ratio.sqrt() > FOREIGN && !force {
            let (recordings, ratio) = (pooled.recordings(), ratio.sqrt());
            return Err(Error::Disagree { recordings, ratio, shared_offset });
        }
        said.push(disagreement_in_words("the runs", ratio));
    }
    said.extend(rigident_present::merged::assumptions(pooled));
    Ok(said)
}
