//! Runs of a merged factor that are no longer distinguished: its size does not grow with their number.
//!
//! What judging the residuals needs of a run adds up. Of the fingerprints the smallest are stored, which are
//! a sample of all: the smallest of two sets together are those of the smallest of each. So a factor that is
//! merged with one that holds a good part of its recordings is noticed, a single recording seldom.

use std::collections::{BTreeMap, HashMap};

use serde::{Deserialize, Serialize};

use super::error::{NAMES_LISTED, names_of_many};
use crate::factor_file::{FactorSource, SourceChannel, at_most};
use crate::noise_check::RowSet;
use crate::{Checks, Identity, Noise};

/// Runs that a factor names one by one at most.
pub const MOST_NAMED: usize = 64;
/// Fingerprints that are stored of folded runs.
pub(crate) const SAMPLE: usize = 32;
/// Pairs of runs with readings in common that are kept.
pub(super) const OVERLAPS: usize = 16;
/// Warnings that are kept of them.
const WARNINGS: usize = 3;

/// Holds what is left of several runs beside the sums that are in their [`FactorSource`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Folded {
    /// The number of runs, two or more.
    pub runs: u64,
    /// Names of the first few.
    #[serde(deserialize_with = "at_most::<_, _, NAMES_LISTED>")]
    pub names: Vec<String>,
    /// The smallest fingerprints of their readings, in order.
    #[serde(deserialize_with = "at_most::<_, _, SAMPLE>")]
    pub sample: Vec<u64>,
    /// The least degrees of freedom of a noise that residuals have shown; `None` where none was larger than
    /// stated.
    pub freedom: Option<f64>,
}

impl FactorSource {
    /// Returns the number of runs that it holds: one, unless they were folded.
    pub fn runs(&self) -> u64 {
        self.folded.as_ref().map_or(1, |folded| folded.runs)
    }

    /// Returns the fingerprints that are known of its runs.
    pub fn fingerprints(&self) -> &[u64] {
        self.folded.as_ref().map_or(std::slice::from_ref(&self.fingerprint), |folded| &folded.sample)
    }

    /// Returns what is known of the readings of its runs.
    pub(super) fn identities(&self) -> Vec<Identity> {
        if self.folded.is_none() {
            return vec![self.identity()];
        }
        let of = |fingerprint: &u64| Identity { fingerprint: *fingerprint, sample: Vec::new() };
        self.fingerprints().iter().map(of).collect()
    }

    fn identity(&self) -> Identity {
        Identity { fingerprint: self.fingerprint, sample: self.readings.clone() }
    }

    /// Returns the names that are known of its recordings.
    pub fn names(&self) -> &[String] {
        self.folded.as_ref().map_or(std::slice::from_ref(&self.recording), |folded| &folded.names)
    }

    /// Returns the names of its recordings; of many the first few and their number.
    pub fn in_words(&self) -> String {
        let names = self.names();
        names_of_many(names, self.runs().saturating_sub(names.len() as u64), ", ")
    }

    /// Returns its rows as far as their residuals are concerned.
    pub(super) fn row_set(&self) -> RowSet {
        RowSet {
            rows: self.rows,
            channels: self.channels.len(),
            noise_gain: self.noise_gain,
            sigma_given: self.sigma_given,
        }
    }

    /// Returns the least degrees of freedom of a noise that residuals have shown to be larger than stated.
    pub(super) fn freedom(&self) -> Option<f64> {
        if let Some(folded) = &self.folded {
            return folded.freedom;
        }
        match self.row_set().noise_of_scale(self.fitted.unwrap_or(0.0)) {
            Noise::Estimated { degrees_of_freedom } if self.variance_scale > 1.0 => Some(degrees_of_freedom),
            _ => None,
        }
    }

    /// Returns true if the two may be folded: of the same channels, and nothing stated of one alone.
    fn is_like(&self, other: &Self) -> bool {
        let contradicted = |own: &Self| own.checks.as_ref().map(|checks| checks.contradicted);
        let name = |c: &SourceChannel| (c.name.clone(), c.unit.clone());
        self.sigma_given == other.sigma_given
            && (self.variance_scale > 1.0) == (other.variance_scale > 1.0)
            && contradicted(self) == contradicted(other)
            && self.channels.iter().map(name).eq(other.channels.iter().map(name))
    }

    /// Takes another's runs in.
    fn fold(&mut self, other: &Self) {
        let runs = self.runs().saturating_add(other.runs());
        let freedom = self.freedom().into_iter().chain(other.freedom()).reduce(f64::min);
        let mut sample = [self.fingerprints(), other.fingerprints()].concat();
        sample.sort_unstable();
        sample.dedup();
        sample.truncate(SAMPLE);
        let mut names = [self.names(), other.names()].concat();
        names.truncate(NAMES_LISTED);
        let share = other.rows as f64 / (self.rows.saturating_add(other.rows)).max(1) as f64;
        let mean = |own: f64, other: f64| own + share * (other - own);
        self.noise_gain = mean(self.noise_gain, other.noise_gain);
        for (own, other) in self.channels.iter_mut().zip(&other.channels) {
            *own = SourceChannel {
                gain_sigma: own.gain_sigma.max(other.gain_sigma),
                measured_rms: mean(own.measured_rms.powi(2), other.measured_rms.powi(2)).sqrt(),
                ..own.clone()
            };
        }
        self.recorded_unix_s = self.recorded_unix_s.max(other.recorded_unix_s);
        // The sum of all, in whatever order they come.
        self.fingerprint = self.fingerprint.wrapping_add(other.fingerprint);
        self.samples = self.samples.saturating_add(other.samples);
        self.rejected = self.rejected.saturating_add(other.rejected);
        self.rows = self.rows.saturating_add(other.rows);
        self.spurious_information += other.spurious_information;
        self.variance_scale = self.variance_scale.max(other.variance_scale);
        self.fitted = self.fitted.zip(other.fitted).map(|(own, other)| own + other);
        self.checks = both(self.checks.take(), other.checks.as_ref());
        self.labels.retain(|key, value| other.labels.get(key) == Some(value));
        self.readings.clear();
        self.folded = Some(Folded { runs, names, sample, freedom });
    }
}

/// Returns the checks of runs that were found alike, with the first few of their warnings.
fn both(own: Option<Checks>, other: Option<&Checks>) -> Option<Checks> {
    let (mut own, other) = own.zip(other)?;
    for warning in &other.warnings {
        if own.warnings.len() < WARNINGS && !own.warnings.contains(warning) {
            own.warnings.push(warning.clone());
        }
    }
    Some(own)
}

/// Returns the runs of a factor; more than [`MOST_NAMED`] are folded, and any with those that were.
pub(super) fn folded(sources: Vec<FactorSource>) -> Vec<FactorSource> {
    if sources.len() <= MOST_NAMED && sources.iter().all(|source| source.folded.is_none()) {
        return sources;
    }
    let mut all: Vec<FactorSource> = Vec::new();
    for source in sources {
        match all.iter_mut().find(|own| own.is_like(&source)) {
            Some(own) => own.fold(&source),
            None => all.push(source),
        }
    }
    all
}

/// Returns runs that have a part of their readings in common, two by two, the first few: `a and b`.
pub(super) fn overlapping(sources: &[FactorSource]) -> Vec<String> {
    // The first run that has a reading: of thousands that all have it none is compared with all.
    let mut first: HashMap<u64, &FactorSource> = HashMap::new();
    let mut said = Vec::new();
    for own in sources {
        let mut others: Vec<&FactorSource> =
            own.readings.iter().filter_map(|reading| first.get(reading).copied()).collect();
        others.sort_by_key(|other| other.fingerprint);
        others.dedup_by_key(|other| other.fingerprint);
        let others = others.into_iter().filter(|other| own.identity().overlaps(&other.identity()));
        said.extend(others.map(|other| format!("{} and {}", other.recording, own.recording)));
        own.readings.iter().for_each(|reading| {
            first.entry(*reading).or_insert(own);
        });
        if said.len() >= OVERLAPS {
            break;
        }
    }
    said
}

/// Returns a fingerprint that is known of two of these, with the places of both.
pub(super) fn repeated<'a>(
    sources: impl IntoIterator<Item = &'a FactorSource>,
    seen: &mut BTreeMap<u64, usize>,
    at: usize,
) -> Option<(&'a FactorSource, usize)> {
    for source in sources {
        for fingerprint in source.fingerprints() {
            if let Some(first) = seen.insert(*fingerprint, at) {
                return Some((source, first));
            }
        }
    }
    None
}

#[cfg(test)]
#[path = "folding_tests.rs"]
mod tests;
