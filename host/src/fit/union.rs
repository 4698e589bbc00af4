//! Factors of many files as one, in which each run counts once, however often it comes.
//!
//! `A ∪ A = A`: whoever shares the work out may do a part of it again.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::path::Path;

use super::Fingerprint;
use super::factor_file::FactorSource;
use super::parallel::{map, threads};
use super::pool::{PoolError, PooledFactor};

/// Files that one thread merges before it takes others.
const CHUNK: usize = 64;

/// Factors as one.
#[derive(Clone, Debug, PartialEq)]
pub struct Union {
    /// The rows of all runs, each once.
    pub factor: PooledFactor,
    /// Factors that were left out, because all their runs are in others.
    pub repeated: usize,
}

/// The runs of a factor, without its numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Runs {
    name: String,
    runs: Vec<Run>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Run {
    recording: String,
    /// Of its readings.
    fingerprint: u64,
    /// Of what was made of them.
    made: u64,
}

impl Runs {
    /// Returns the runs of a factor.
    #[must_use]
    pub fn of(factor: &PooledFactor) -> Self {
        let run = |source: &FactorSource| Run {
            recording: source.recording.clone(),
            fingerprint: source.fingerprint,
            made: made(factor.model_fingerprint, source),
        };
        Self { name: factor.name.clone(), runs: factor.sources.iter().map(run).collect() }
    }
}

/// Returns a fingerprint of what was made of a run's readings; its name and date do not count.
fn made(model: u64, source: &FactorSource) -> u64 {
    let mut hash = Fingerprint::default();
    [model, source.samples, source.rejected, source.rows, u64::from(source.sigma_given)]
        .into_iter()
        .for_each(|word| hash.add(word));
    [source.noise_gain, source.spurious_information].into_iter().for_each(|v| hash.add(v.to_bits()));
    for channel in &source.channels {
        hash.add_text(&channel.name);
        hash.add_text(&channel.unit);
        [channel.sigma, channel.gain_sigma, channel.measured_rms]
            .into_iter()
            .for_each(|v| hash.add(v.to_bits()));
    }
    hash.finish()
}

/// Returns which factors count: those whose runs are all in others, made alike, do not.
///
/// # Errors
/// [`PoolError::Repeated`] if a run is in two factors, and the one is not a part of the other: its rows cannot be taken out again.
pub fn counted_once(all: &[Runs]) -> Result<Vec<bool>, PoolError> {
    let mut order: Vec<(usize, &Runs)> = all.iter().enumerate().collect();
    // Those of many runs first, so that one of some of their runs is left out.
    order.sort_by_key(|(_, own)| Reverse(own.runs.len()));
    let mut seen: HashMap<u64, (&str, u64)> = HashMap::new();
    let mut counts = vec![false; all.len()];
    for (k, own) in order {
        let known = |run: &Run| seen.get(&run.fingerprint).copied();
        let alike = |run: &Run| known(run).is_some_and(|(_, made)| made == run.made);
        if !own.runs.is_empty() && own.runs.iter().all(alike) {
            continue;
        }
        if let Some((run, (first, _))) = own.runs.iter().find_map(|run| Some((run, known(run)?))) {
            return Err(PoolError::Repeated {
                recording: run.recording.clone(),
                first: first.to_owned(),
                second: own.name.clone(),
            });
        }
        seen.extend(own.runs.iter().map(|run| (run.fingerprint, (own.name.as_str(), run.made))));
        if let Some(counts) = counts.get_mut(k) {
            *counts = true;
        }
    }
    Ok(counts)
}

/// Returns all factors as one; those whose runs are all in others are left out.
///
/// # Errors
/// As [`counted_once`] and [`PooledFactor::merged`].
pub fn union(factors: Vec<PooledFactor>, shared_offsets: bool) -> Result<Union, PoolError> {
    let counts = counted_once(&factors.iter().map(Runs::of).collect::<Vec<_>>())?;
    let repeated = counts.iter().filter(|counts| !**counts).count();
    let once = factors.into_iter().zip(counts).filter_map(|(factor, counts)| counts.then_some(factor));
    Ok(Union { factor: PooledFactor::merged(once.collect(), shared_offsets)?, repeated })
}

/// Returns the factors of files as one, on all cores; few are in memory at a time. `done` is told how many files are read, of how many.
///
/// # Errors
/// As [`union`] and [`PooledFactor::read`]; a file that changes meanwhile is named.
pub fn union_of_files<P: AsRef<Path> + Sync>(
    files: &[P],
    shared_offsets: bool,
    done: &(dyn Fn(usize, usize) + Sync),
) -> Result<Union, PoolError> {
    // Each is read twice: for its runs, and for its numbers.
    let read = std::sync::atomic::AtomicUsize::new(0);
    let open = |file: &P| {
        let factor = PooledFactor::read(file.as_ref());
        done(1 + read.fetch_add(1, std::sync::atomic::Ordering::Relaxed), 2 * files.len());
        factor
    };
    let runs = map(threads(), files.len(), |k| files.get(k).map(|file| Ok(Runs::of(&open(file)?))));
    let runs: Vec<Runs> = runs.into_iter().flatten().collect::<Result<_, _>>()?;
    let counts = counted_once(&runs)?;
    let once: Vec<(&P, &Runs)> =
        files.iter().zip(&runs).zip(&counts).filter(|(_, counts)| **counts).map(|(both, _)| both).collect();
    let chunks: Vec<_> = once.chunks(CHUNK).collect();
    let merged = map(threads(), chunks.len(), |k| {
        let chunk = chunks.get(k).copied().unwrap_or_default();
        let factors = chunk.iter().map(|(file, before)| {
            let factor = open(file)?;
            if Runs::of(&factor) == **before {
                return Ok(factor);
            }
            let reason = "changed while it was read; once nobody writes it, merge again".to_owned();
            Err(PoolError::Access { name: factor.name, reason })
        });
        PooledFactor::merged(factors.collect::<Result<_, _>>()?, shared_offsets)
    });
    let factor = PooledFactor::merged(merged.into_iter().collect::<Result<_, _>>()?, shared_offsets)?;
    Ok(Union { factor, repeated: files.len() - once.len() })
}

#[cfg(test)]
#[path = "union_tests.rs"]
mod tests;
