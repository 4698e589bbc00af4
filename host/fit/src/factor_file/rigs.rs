//! The rigs of a factor file: errors, their numbers, and the rows.

use std::collections::HashMap;
use std::hash::Hash;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{LARGEST, MOST_ERRORS, MOST_RIGS, MOST_TEXTS, at_most, in_range};
use crate::{Basis, Factor, RigError, RigRows};

/// An error of a rig; its texts and numbers are among those of all.
#[derive(Serialize, Deserialize)]
pub(super) struct StoredError<N> {
    pub(super) name: String,
    instrument: u32,
    group: u32,
    unit: u32,
    basis: u32,
    expected: N,
    sigma: N,
}

/// The errors of a rig, and their correlations; an error's numbers are places in the list of all, or
/// themselves up to version 7.
#[derive(Serialize, Deserialize)]
#[serde(bound(deserialize = "N: Deserialize<'de>"))]
pub(super) struct StoredRig<N = u32> {
    #[serde(deserialize_with = "at_most::<_, _, MOST_ERRORS>")]
    pub(super) errors: Vec<StoredError<N>>,
    /// True if the lower triangle of the covariance beforehand follows the numbers of the rows.
    pub(super) is_correlated: bool,
    pub(super) rows: u64,
}

/// The rigs, in the order of their numbers, and the keys that distinguish their errors, each once.
#[derive(Serialize, Deserialize)]
#[serde(bound(deserialize = "N: Deserialize<'de>"))]
pub(super) struct Rigs<N = u32> {
    #[serde(deserialize_with = "at_most::<_, _, MOST_TEXTS>")]
    pub(super) texts: Vec<String>,
    #[serde(deserialize_with = "at_most::<_, _, MOST_TEXTS>")]
    pub(super) bases: Vec<Basis>,
    #[serde(deserialize_with = "at_most::<_, _, MOST_RIGS>")]
    pub(super) rigs: Vec<StoredRig<N>>,
    /// Errors of which its runs stated different standard deviations.
    #[serde(deserialize_with = "at_most::<_, _, MOST_TEXTS>")]
    pub(super) differing: Vec<String>,
}

/// A list of things, each once.
struct Places<T, K> {
    list: Vec<T>,
    at: HashMap<K, u32>,
}

impl<T: Clone, K: Eq + Hash> Places<T, K> {
    fn new() -> Self {
        Self { list: Vec::new(), at: HashMap::new() }
    }

    /// Returns the place of a thing with this key, put there if it is not.
    fn place(&mut self, thing: &T, key: K) -> u32 {
        let next = u32::try_from(self.list.len()).unwrap_or(u32::MAX);
        *self.at.entry(key).or_insert_with(|| {
            self.list.push(thing.clone());
            next
        })
    }
}

impl Rigs {
    /// Returns the rigs as they are stored, and the numbers of their errors.
    pub(super) fn of(rigs: &[RigRows], differing: &[String]) -> (Self, Vec<f64>) {
        let (mut texts, mut bases, mut numbers) = (Places::new(), Places::new(), Places::new());
        let mut all = Vec::new();
        for rig in rigs {
            let errors = rig.errors().iter().map(|error| {
                let mut text = |text: &String| texts.place(text, text.clone());
                StoredError {
                    name: error.name.clone(),
                    instrument: text(&error.instrument),
                    group: text(&error.group),
                    unit: text(&error.unit),
                    basis: bases.place(&error.basis, format!("{:?}", error.basis)),
                    expected: numbers.place(&error.expected, error.expected.to_bits()),
                    sigma: numbers.place(&error.sigma, error.sigma.to_bits()),
                }
            });
            let errors = errors.collect();
            all.push(StoredRig { errors, is_correlated: !rig.is_independent(), rows: rig.factor().rows() });
        }
        let differing = differing.to_vec();
        (Self { texts: texts.list, bases: bases.list, rigs: all, differing }, numbers.list)
    }

    /// Returns the rigs with their numbers in the place of the places of these; `None` if one has none.
    pub(super) fn with_numbers(self, numbers: &[f64]) -> Option<Rigs<f64>> {
        let number = |at: u32| numbers.get(at as usize).copied();
        let of_error = |StoredError { name, instrument, group, unit, basis, expected, sigma }| {
            let (expected, sigma) = (number(expected)?, number(sigma)?);
            Some(StoredError { name, instrument, group, unit, basis, expected, sigma })
        };
        let of_rig = |StoredRig { errors, is_correlated, rows }: StoredRig| {
            let errors = errors.into_iter().map(of_error).collect::<Option<_>>()?;
            Some(StoredRig { errors, is_correlated, rows })
        };
        let Self { texts, bases, rigs, differing } = self;
        Some(Rigs { texts, bases, rigs: rigs.into_iter().map(of_rig).collect::<Option<_>>()?, differing })
    }
}

impl<N> Rigs<N> {
    /// Returns how many numbers follow, of this many parameters.
    pub(super) fn numbers(&self, parameters: usize) -> usize {
        self.rigs.iter().flat_map(|rig| rig.numbers(parameters)).sum()
    }
}

impl Rigs<f64> {
    /// Returns the rows of the numbers; `None` if they are none.
    pub(super) fn rows_of(self, parameters: usize, numbers: &[u8]) -> Option<Vec<RigRows>> {
        let Self { texts, bases, rigs, .. } = self;
        let text = |at: u32| texts.get(at as usize).cloned();
        let mut rest = numbers;
        let mut found = Vec::new();
        for rig in rigs {
            let [entries, others] = rig.numbers(parameters);
            let own;
            (own, rest) = rest.split_at_checked(8 * (entries + others))?;
            let own: Vec<f64> = own
                .chunks_exact(8)
                .map(|word| word.try_into().map_or(f64::NAN, f64::from_le_bytes))
                .collect();
            let error = |stored: StoredError<f64>| {
                Some(RigError {
                    instrument: text(stored.instrument)?,
                    name: stored.name,
                    group: text(stored.group)?,
                    unit: text(stored.unit)?,
                    basis: bases.get(stored.basis as usize)?.clone(),
                    expected: stored.expected,
                    sigma: stored.sigma,
                })
            };
            let (is_correlated, rows) = (rig.is_correlated, rig.rows);
            let errors: Vec<RigError> = rig.errors.into_iter().map(error).collect::<Option<_>>()?;
            let (entries, lower) = own.split_at_checked(entries)?;
            let factor = Factor::from_entries(parameters + errors.len(), entries, rows).filter(in_range)?;
            let covariance = beforehand(&errors, lower, is_correlated)?;
            found.push(RigRows::new(parameters, factor, errors, covariance)?);
        }
        Some(found)
    }
}

/// Returns the covariance of errors by its lower triangle, or by their standard deviations; `None` if these
/// are out of range.
fn beforehand(errors: &[RigError], lower: &[f64], is_correlated: bool) -> Option<DMatrix<f64>> {
    let usual = |e: &RigError| (LARGEST.recip()..LARGEST).contains(&e.sigma) && e.expected.abs() < LARGEST;
    let entry = |i: usize, j: usize| match is_correlated {
        _ if i == j => errors.get(i).map_or(f64::NAN, |e| e.sigma.powi(2)),
        true => lower.get(i.max(j) * (i.max(j) + 1) / 2 + i.min(j)).copied().unwrap_or(f64::NAN),
        false => 0.0,
    };
    let covariance = DMatrix::from_fn(errors.len(), errors.len(), entry);
    // No covariance is larger than the product of its standard deviations.
    let within = |i: usize, j: usize| covariance[(i, j)].abs() <= errors[i].sigma * errors[j].sigma;
    let bounded = (0..errors.len()).all(|i| (0..i).all(|j| within(i, j)));
    (errors.iter().all(usual) && bounded).then_some(covariance)
}

impl<N> StoredRig<N> {
    /// Returns how many numbers its rows and its errors have, of this many parameters.
    fn numbers(&self, parameters: usize) -> [usize; 2] {
        let (n, k) = (parameters + self.errors.len(), self.errors.len());
        [n * (n + 3) / 2 + 1, if self.is_correlated { k * (k + 1) / 2 } else { 0 }]
    }
}
