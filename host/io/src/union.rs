//! Factors of many files as one, in which each run counts once, however often it comes.
//!
//! `A ∪ A = A`: whoever shares the work out may do a part of it again.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use crate::factor_table::{Part, parts};
use rigident_fit::Fingerprint;
use rigident_fit::factor_file::FactorSource;
use rigident_fit::parallel::{map, threads};
use rigident_fit::pool::{PoolError, PooledFactor};

/// Factors that one thread merges before it takes others.
const CHUNK: usize = 64;

/// Factors as one.
#[derive(Clone, Debug, PartialEq)]
pub struct Union {
    /// The rows of all runs, each once.
    pub factor: PooledFactor,
    /// Factors that were left out, because all their runs are in others.
    pub repeated: usize,
    /// Factors in all, with those.
    pub given: usize,
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
    /// Of its readings; of several runs their sum.
    fingerprint: u64,
    /// The number of runs.
    count: u64,
    /// Of the readings of some of them, where there are several.
    sample: Vec<u64>,
    /// Of what was made of them.
    made: u64,
}

impl Runs {
    /// Returns the runs of a factor.
    #[must_use]
    pub fn of(factor: &PooledFactor) -> Self {
        let run = |source: &FactorSource| Run {
            recording: source.in_words(),
            fingerprint: source.fingerprint,
            count: source.runs(),
            sample: source.folded.as_ref().map_or_else(Vec::new, |folded| folded.sample.clone()),
            made: made(factor.model_fingerprint, source),
        };
        Self { name: factor.name.clone(), runs: factor.sources.iter().map(run).collect() }
    }
}

/// Returns a fingerprint of what was made of a run's readings; its name and date do not count. Of several
/// runs means and sums depend on their order, and do not count either.
fn made(model: u64, source: &FactorSource) -> u64 {
    let mut hash = Fingerprint::default();
    [model, source.samples, source.rejected, source.rows, u64::from(source.sigma_given), source.runs()]
        .into_iter()
        .for_each(|word| hash.add(word));
    if source.folded.is_some() {
        return hash.finish();
    }
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
/// [`PoolError::Repeated`] if a run is in two factors, and the one is not a part of the other: its rows
/// cannot be taken out again.
pub fn counted_once(all: &[Runs]) -> Result<Vec<bool>, PoolError> {
    let mut order: Vec<(usize, &Runs)> = all.iter().enumerate().collect();
    // Those of many runs first, so that one of some of their runs is left out.
    order.sort_by_key(|(_, own)| Reverse(own.runs.iter().map(|run| run.count).sum::<u64>()));
    let mut seen: HashMap<u64, (&str, u64)> = HashMap::new();
    let mut counts = vec![false; all.len()];
    for (k, own) in order {
        let known = |run: &Run| {
            let all = std::iter::once(&run.fingerprint).chain(&run.sample);
            all.filter_map(|fingerprint| seen.get(fingerprint).copied()).next()
        };
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
        // Made alike or not: what else is in both cannot be seen.
        let samples = own.runs.iter().flat_map(|run| &run.sample);
        seen.extend(samples.map(|fingerprint| (*fingerprint, (own.name.as_str(), 0))));
        if let Some(counts) = counts.get_mut(k) {
            *counts = true;
        }
    }
    Ok(counts)
}

/// Returns all factors as one; those whose runs are all in others are left out.
///
/// # Errors
/// Fails as [`counted_once`] and [`PooledFactor::merged`] do.
pub fn union(factors: Vec<PooledFactor>, shared_offsets: bool) -> Result<Union, PoolError> {
    let counts = counted_once(&factors.iter().map(Runs::of).collect::<Vec<_>>())?;
    let (given, repeated) = (counts.len(), counts.iter().filter(|counts| !**counts).count());
    let once = factors.into_iter().zip(counts).filter_map(|(factor, counts)| counts.then_some(factor));
    Ok(Union { factor: PooledFactor::merged(once.collect(), shared_offsets)?, repeated, given })
}

/// Returns the factors of files as one, on all cores; few are in memory at a time. `done` receives how much
/// is read, of how much.
///
/// # Errors
/// Fails as [`union`] and [`Part::read`] do; a file that changes meanwhile is named.
pub fn union_of_files<P: AsRef<Path> + Sync>(
    files: &[P],
    shared_offsets: bool,
    done: &(dyn Fn(usize, usize) + Sync),
) -> Result<Union, PoolError> {
    let parts: Vec<Vec<Part>> = files.iter().map(|file| parts(file.as_ref())).collect::<Result<_, _>>()?;
    union_of_parts(&parts.concat(), shared_offsets, done)
}

/// Returns the factors of parts of files as one, as [`union_of_files`] does.
///
/// # Errors
/// Fails as [`union_of_files`] does.
pub fn union_of_parts(
    parts: &[Part],
    shared_offsets: bool,
    done: &(dyn Fn(usize, usize) + Sync),
) -> Result<Union, PoolError> {
    // Each is read twice: for its runs, and for its numbers.
    let read = std::sync::atomic::AtomicUsize::new(0);
    let open = |part: &Part| {
        let factors = part.read();
        done(1 + read.fetch_add(1, std::sync::atomic::Ordering::Relaxed), 2 * parts.len());
        factors
    };
    let runs = map(threads(), parts.len(), |k| {
        parts.get(k).map(|part| Ok(open(part)?.iter().map(Runs::of).collect()))
    });
    let runs: Vec<Vec<Runs>> = runs.into_iter().flatten().collect::<Result<_, _>>()?;
    let counts = counted_once(&runs.concat())?;
    let (given, repeated) = (counts.len(), counts.iter().filter(|counts| !**counts).count());
    let mut counts = counts.into_iter();
    let counts: Vec<Vec<bool>> =
        runs.iter().map(|of_part| counts.by_ref().take(of_part.len()).collect()).collect();
    let jobs = jobs(&counts);
    let merged = map(threads(), jobs.len(), |k| {
        let job = jobs.get(k).cloned().unwrap_or_default();
        let mut factors = Vec::new();
        for ((part, before), counts) in
            job.filter_map(|n| Some(((parts.get(n)?, runs.get(n)?), counts.get(n)?)))
        {
            if !counts.contains(&true) {
                continue;
            }
            let own = open(part)?;
            if !own.iter().map(Runs::of).eq(before.iter().cloned()) {
                let reason = "changed while it was read; once nobody writes it, merge again".to_owned();
                let name = before.first().map_or_else(String::new, |runs| runs.name.clone());
                return Err(PoolError::Access { name, reason });
            }
            factors
                .extend(own.into_iter().zip(counts).filter_map(|(factor, counts)| counts.then_some(factor)));
        }
        PooledFactor::merged(factors, shared_offsets)
    });
    let factor = PooledFactor::merged(merged.into_iter().collect::<Result<_, _>>()?, shared_offsets)?;
    Ok(Union { factor, repeated, given })
}

/// Returns runs of parts that one thread merges before it takes others, each with some factors that count.
fn jobs(counts: &[Vec<bool>]) -> Vec<Range<usize>> {
    let (mut jobs, mut first, mut factors) = (Vec::new(), 0, 0);
    for (n, of_part) in counts.iter().enumerate() {
        factors += of_part.iter().filter(|counts| **counts).count();
        if factors >= CHUNK {
            jobs.push(first..n + 1);
            (first, factors) = (n + 1, 0);
        }
    }
    if factors > 0 {
        jobs.push(first..counts.len());
    }
    jobs
}

#[cfg(test)]
#[path = "union_tests.rs"]
mod tests;
