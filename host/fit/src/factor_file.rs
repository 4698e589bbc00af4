//! The factor file, `*.factor`: all that the rows of some runs say, without the runs.
//!
//! Eight bytes of magic; a postcard object (version, counts, header); the numbers of the factor, f64
//! little-endian; the CRC-32 of all after the magic, little-endian. The parameters with names, units, kinds,
//! owners and what they are made of are part of it, so a factor of another model is distinguished.

mod checks;
mod rigs;

use std::collections::BTreeMap;

use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::pool::{Folded, PooledFactor, SAMPLE};
use rigident_shared::printable;

use super::{Checks, Factor, Parameter, READINGS_KEPT};
use checks::{check, check_freedom, check_names};
use rigs::{Rigs, StoredRig};

const MAGIC: &[u8; 8] = b"RIGIDFAC";
/// Version 6 holds the errors of each rig apart from its rows, and the variance of each run. Version 5 holds
/// the labels of each run after what version 4 holds, and that its checks after what version 3 holds: any
/// parameters and channels. 1 and 2 held one body's ten or sixteen parameters.
/// 7 says how many runs one entry represents, where there are such. 8 holds some readings of each run, and
/// each number that errors have in common once.
pub const VERSION: u16 = 8;
/// Has no readings, and all numbers of every error.
const WITHOUT_READINGS: u16 = 7;
/// Tells every run apart.
const WITHOUT_FOLDED: u16 = 6;
/// Holds what is known of errors in its rows.
const ERRORS_INSIDE: u16 = 5;
/// Has checks, and no labels.
const WITHOUT_LABELS: u16 = 4;
/// The oldest version that is read: without checks.
const WITHOUT_CHECKS: u16 = 3;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// The most parameters of a factor.
pub const MOST_PARAMETERS: usize = 2048;
/// The most runs in a factor.
pub const MOST_SOURCES: usize = 1 << 20;
/// The most errors that the runs of a rig share.
pub const MOST_ERRORS: usize = 1024;
/// The most texts that errors are distinguished by.
const MOST_TEXTS: usize = 1 << 16;
/// The most numbers of errors.
const MOST_NUMBERS: usize = 1 << 20;
/// The most rigs in a factor.
pub const MOST_RIGS: usize = 1 << 14;
/// The most channels of a run.
pub const MOST_CHANNELS: usize = 4096;
/// The most standard parameters that a parameter is made of.
const MOST_TERMS: usize = 10 * MOST_PARAMETERS;
/// The most bytes of a file.
pub const MOST_BYTES: u64 = 1 << 28;
/// Columns shorter or longer than this come from no whitened rows, and their squares might leave the range of
/// f64.
const LARGEST: f64 = 1e60;

/// Why bytes are not a usable factor file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FactorFileError {
    /// The file does not start as a factor file does.
    #[error("not a factor file: it does not start with RIGIDFAC")]
    NotAFactor,
    /// The file is a result object.
    #[error(
        "a result (result.json), not a factor: it holds an answer and not the rows behind it; give the \
         NAME.factor that was written beside it, or make one of the recording with `factor()`"
    )]
    Result,
    /// The check sum does not fit, or the file is cut off.
    #[error(
        "the factor file is damaged or cut off (its check sum does not fit): write it anew from the \
         recording with `factor()`"
    )]
    Damaged,
    /// The file is of an older program.
    #[error(
        "the factor file has version {0}, this program reads versions {WITHOUT_CHECKS} to {VERSION}: write \
         it anew from the recording with `factor()`"
    )]
    Old(u16),
    /// The file is of a newer program.
    #[error(
        "the factor file has version {0}, this program reads versions {WITHOUT_CHECKS} to {VERSION}: use the \
         program that wrote it, or write it anew from the recording with `factor()`"
    )]
    New(u16),
    /// More than this program takes.
    #[error("the factor file holds {got} {what}, more than the {most} that are taken")]
    TooLarge {
        /// Parameters, runs or bytes.
        what: &'static str,
        /// The number stated.
        got: u64,
        /// The most that are taken.
        most: u64,
    },
    /// Numbers of the header that no recording can give.
    #[error(
        "the factor file's header holds {0}, which no recording gives: write it anew from the recording with \
         `factor()`"
    )]
    Header(&'static str),
    /// No rows are in it.
    #[error(
        "the factor file is empty: no row was absorbed into it; write it anew from a recording with rows"
    )]
    Empty,
    /// The numbers are not a factor.
    #[error("the factor file holds {got} numbers, not finite or not a triangle of {parameters} parameters")]
    Numbers {
        /// Numbers found.
        got: usize,
        /// Parameters named.
        parameters: usize,
    },
}

/// A measured channel of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SourceChannel {
    /// Its name: `fx`, or a joint's.
    pub name: String,
    /// Its SI unit.
    pub unit: String,
    /// Standard deviation per sample by which its rows were whitened.
    pub sigma: f64,
    /// Standard deviation of its relative gain error, already eliminated from the factor; zero: none.
    pub gain_sigma: f64,
    /// Root mean square of its filtered measurements, against which the uncertainty of an offset is judged.
    pub measured_rms: f64,
}

/// One run in a factor: enough to judge the residuals of a merged one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FactorSource {
    /// Name of the recording.
    pub recording: String,
    /// The time of recording, s since 1970-01-01 UTC; `None`: not known.
    pub recorded_unix_s: Option<i64>,
    /// That of [`super::RowSource::identity`]: a recording counts once.
    pub fingerprint: u64,
    /// Samples in it.
    pub samples: u64,
    /// Samples that were not used.
    pub rejected: u64,
    /// Scalar rows absorbed.
    pub rows: u64,
    /// Variance of the whitened, filtered noise per row (1 without filter).
    pub noise_gain: f64,
    /// True if every σ was given; else it is from the residuals.
    pub sigma_given: bool,
    /// Information that noise of the rates alone brings to a moment of inertia: 1/(kg m²)².
    pub spurious_information: f64,
    /// Variance of its rows relative to that of the σ that are stated: they are whitened by it.
    #[serde(skip, default = "one")]
    pub variance_scale: f64,
    /// Degrees of freedom that parameters and errors took of its rows; `None`: not known, by an older
    /// program.
    #[serde(skip)]
    pub fitted: Option<f64>,
    /// Its channels.
    #[serde(deserialize_with = "at_most::<_, _, MOST_CHANNELS>")]
    pub channels: Vec<SourceChannel>,
    /// The findings of the checks of the recording; `None`: it was not checked, or by an older program.
    #[serde(skip)]
    pub checks: Option<Checks>,
    /// The labels that distinguish it from other runs of a collection: `body`, `rig` and others, each with
    /// its value.
    #[serde(skip)]
    pub labels: BTreeMap<String, String>,
    /// The smallest hashes of single readings ([`super::RowSource::identity`]); empty: not known, by an older
    /// program, or of several runs.
    #[serde(skip)]
    pub readings: Vec<u64>,
    /// What is left of several runs that are no longer distinguished; `None` of one.
    #[serde(skip)]
    pub folded: Option<Folded>,
}

/// A parameter as it is in a file: the terms are bounded.
#[derive(Serialize, Deserialize)]
struct StoredParameter {
    name: String,
    owner: super::Owner,
    kind: super::Kind,
    unit: String,
    frame: String,
    #[serde(deserialize_with = "at_most::<_, _, MOST_TERMS>")]
    made_of: Vec<(String, f64)>,
}

/// All but the numbers of the factor.
#[derive(Serialize, Deserialize)]
struct Header {
    #[serde(deserialize_with = "at_most::<_, _, MOST_PARAMETERS>")]
    parameters: Vec<StoredParameter>,
    model_fingerprint: u64,
    rounding: f64,
    rows: u64,
    #[serde(deserialize_with = "at_most::<_, _, MOST_SOURCES>")]
    sources: Vec<FactorSource>,
    eliminated: u64,
    disagreement: f64,
    comparisons: u64,
}

/// A name that could steer a terminal, or the program of a robot that it is written into.
const UNFIT_NAME: &str = "a name with control characters, or of more than 1024 bytes";

/// The variance of a run's rows, and the degrees of freedom taken of them.
type Scale = (f64, Option<f64>);

fn one() -> f64 {
    1.0
}

/// What came with version 8: numbers of errors, each once; some readings of each run; runs that have readings
/// in common.
#[derive(Default, Serialize, Deserialize)]
struct Added {
    #[serde(deserialize_with = "at_most::<_, _, MOST_NUMBERS>")]
    numbers: Vec<f64>,
    #[serde(deserialize_with = "at_most::<_, _, MOST_SOURCES>")]
    readings: Vec<Readings>,
    #[serde(deserialize_with = "at_most::<_, _, MOST_TEXTS>")]
    overlapping: Vec<String>,
}

/// Hashes of readings.
#[derive(Serialize, Deserialize)]
struct Readings(#[serde(deserialize_with = "at_most::<_, _, READINGS_KEPT>")] Vec<u64>);

/// Holds what each run has, in their order.
#[derive(Deserialize)]
#[serde(bound(deserialize = "T: Deserialize<'de>"))]
struct OfRuns<T>(#[serde(deserialize_with = "at_most::<_, _, MOST_SOURCES>")] Vec<T>);

/// Takes what each of the given number of runs has off the bytes.
fn of_runs<'a, T: Deserialize<'a>>(
    bytes: &'a [u8],
    runs: usize,
) -> Result<(Vec<T>, &'a [u8]), FactorFileError> {
    match postcard::take_from_bytes::<OfRuns<T>>(bytes) {
        Ok((OfRuns(list), rest)) if list.len() == runs => Ok((list, rest)),
        _ => Err(FactorFileError::Damaged),
    }
}

impl From<&Parameter> for StoredParameter {
    fn from(parameter: &Parameter) -> Self {
        let Parameter { name, owner, kind, unit, frame, made_of } = parameter.clone();
        Self { name, owner, kind, unit, frame, made_of }
    }
}

impl From<StoredParameter> for Parameter {
    fn from(stored: StoredParameter) -> Self {
        let StoredParameter { name, owner, kind, unit, frame, made_of } = stored;
        Self { name, owner, kind, unit, frame, made_of }
    }
}

/// Reads a list of at most the given number of elements; room is made as they are read.
pub(super) fn at_most<'de, D: Deserializer<'de>, T: Deserialize<'de>, const MOST: usize>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    struct List<T, const MOST: usize>(std::marker::PhantomData<T>);
    impl<'de, T: Deserialize<'de>, const MOST: usize> Visitor<'de> for List<T, MOST> {
        type Value = Vec<T>;
        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            write!(f, "at most {MOST} elements")
        }
        fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Self::Value, A::Error> {
            let mut list = Vec::new();
            while let Some(element) = elements.next_element()? {
                if list.len() == MOST {
                    return Err(serde::de::Error::invalid_length(MOST + 1, &self));
                }
                list.push(element);
            }
            Ok(list)
        }
    }
    deserializer.deserialize_seq(List::<T, MOST>(std::marker::PhantomData))
}

/// Returns the bytes of a factor file.
pub(super) fn to_bytes(pooled: &PooledFactor) -> Vec<u8> {
    let header = Header {
        parameters: pooled.parameters.iter().map(StoredParameter::from).collect(),
        model_fingerprint: pooled.model_fingerprint,
        rounding: pooled.rounding,
        rows: pooled.rows(),
        sources: pooled.sources.clone(),
        eliminated: pooled.eliminated,
        disagreement: pooled.disagreement,
        comparisons: pooled.comparisons,
    };
    // Serialising plain vectors and numbers into a growing buffer has no way to fail.
    let checks: Vec<Option<&Checks>> = pooled.sources.iter().map(|source| source.checks.as_ref()).collect();
    let labels: Vec<&BTreeMap<String, String>> = pooled.sources.iter().map(|source| &source.labels).collect();
    let scales: Vec<Scale> = pooled.sources.iter().map(|own| (own.variance_scale, own.fitted)).collect();
    let (rigs, numbers) = Rigs::of(&pooled.rigs, &pooled.differing);
    let count = rigs.numbers(header.parameters.len()) as u64;
    let folded: Vec<Option<&Folded>> = pooled.sources.iter().map(|own| own.folded.as_ref()).collect();
    let added = Added {
        numbers,
        readings: pooled.sources.iter().map(|own| Readings(own.readings.clone())).collect(),
        overlapping: pooled.overlapping.clone(),
    };
    let counts = (VERSION, header.parameters.len() as u64, header.sources.len() as u64, count);
    let of_runs = (checks, labels, scales);
    let object = (counts, header, of_runs, pooled.errors_inside, rigs, folded, added);
    let mut body = postcard::to_allocvec(&object).unwrap_or_default();
    for rig in &pooled.rigs {
        let mut numbers = rig.factor().entries();
        if !rig.is_independent() {
            let covariance = rig.covariance();
            let lower = (0..covariance.nrows()).flat_map(|i| (0..=i).map(move |j| (i, j)));
            numbers.extend(lower.map(|at| covariance[at]));
        }
        body.extend(numbers.iter().flat_map(|entry| entry.to_le_bytes()));
    }
    [MAGIC.as_slice(), &body, &CRC.checksum(&body).to_le_bytes()].concat()
}

/// Reads the bytes of a factor file called `name`.
pub(super) fn from_bytes(bytes: &[u8], name: &str) -> Result<PooledFactor, FactorFileError> {
    let (version, rest) = body_of(bytes)?;
    let rest = after_counts(version, rest)?;
    let (mut header, rest) =
        postcard::take_from_bytes::<Header>(rest).map_err(|_| FactorFileError::Damaged)?;
    check(&header)?;
    let rest = checks_and_labels_of(version, rest, &mut header.sources)?;
    let mut overlapping = Vec::new();
    let (errors_inside, rigs, numbers) = match version {
        ..=ERRORS_INSIDE => (true, one_rig(header.rows), rest),
        _ => {
            let rest = scales_of(rest, &mut header.sources)?;
            rigs_of(version, rest, &mut header.sources, &mut overlapping)?
        }
    };
    check_freedom(&header)?;
    let Header {
        parameters,
        model_fingerprint,
        rounding,
        rows: _,
        sources,
        eliminated,
        disagreement,
        comparisons,
    } = header;
    check_names(&parameters, &sources, &rigs, &overlapping)?;
    let count = parameters.len();
    let refuse = || FactorFileError::Numbers { got: numbers.len() / 8, parameters: count };
    if rigs.rigs.is_empty() || numbers.len() != 8 * rigs.numbers(count) {
        return Err(refuse());
    }
    let differing = rigs.differing.clone();
    let found = rigs.rows_of(count, numbers).ok_or_else(refuse)?;
    Ok(PooledFactor {
        name: name.to_owned(),
        parameters: parameters.into_iter().map(Parameter::from).collect(),
        model_fingerprint,
        rounding,
        rigs: found,
        errors_inside,
        sources,
        eliminated,
        disagreement,
        comparisons,
        differing,
        overlapping,
    })
}

/// Returns the version, and the bytes between it and the check sum.
fn body_of(bytes: &[u8]) -> Result<(u16, &[u8]), FactorFileError> {
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        return Err(if is_result(bytes) { FactorFileError::Result } else { FactorFileError::NotAFactor });
    };
    too_large("bytes", bytes.len() as u64, MOST_BYTES)?;
    let (body, sum) = rest.split_last_chunk::<4>().ok_or(FactorFileError::Damaged)?;
    if CRC.checksum(body) != u32::from_le_bytes(*sum) {
        return Err(FactorFileError::Damaged);
    }
    let (version, rest) = postcard::take_from_bytes::<u16>(body).map_err(|_| FactorFileError::Damaged)?;
    match version {
        WITHOUT_CHECKS..=VERSION => Ok((version, rest)),
        0..WITHOUT_CHECKS => Err(FactorFileError::Old(version)),
        _ => Err(FactorFileError::New(version)),
    }
}

/// Takes the counts off the bytes, and refuses too large ones.
fn after_counts(version: u16, bytes: &[u8]) -> Result<&[u8], FactorFileError> {
    let damaged = |_| FactorFileError::Damaged;
    let ((parameters, sources), rest) = postcard::take_from_bytes::<(u64, u64)>(bytes).map_err(damaged)?;
    too_large("parameters", parameters, MOST_PARAMETERS as u64)?;
    too_large("runs", sources, MOST_SOURCES as u64)?;
    // How many numbers follow is for programs that read these alone: the rigs say it, too.
    match version {
        ..=ERRORS_INSIDE => Ok(rest),
        _ => Ok(postcard::take_from_bytes::<u64>(rest).map_err(damaged)?.1),
    }
}

/// Takes checks and labels of runs off the bytes, where a version has them.
fn checks_and_labels_of<'a>(
    version: u16,
    mut bytes: &'a [u8],
    sources: &mut [FactorSource],
) -> Result<&'a [u8], FactorFileError> {
    if version > WITHOUT_CHECKS {
        let (checks, rest) = of_runs(bytes, sources.len())?;
        sources.iter_mut().zip(checks).for_each(|(source, checks)| source.checks = checks);
        bytes = rest;
    }
    if version > WITHOUT_LABELS {
        let (labels, rest) = of_runs(bytes, sources.len())?;
        sources.iter_mut().zip(labels).for_each(|(source, labels)| source.labels = labels);
        bytes = rest;
    }
    Ok(bytes)
}

/// Returns the one rig without errors of its own that a file of an older version has.
fn one_rig(rows: u64) -> Rigs<f64> {
    let stored = StoredRig { errors: Vec::new(), is_correlated: false, rows };
    Rigs { texts: Vec::new(), bases: Vec::new(), rigs: vec![stored], differing: Vec::new() }
}

/// Takes the noise of runs off the bytes.
fn scales_of<'a>(bytes: &'a [u8], sources: &mut [FactorSource]) -> Result<&'a [u8], FactorFileError> {
    let (scales, rest) = of_runs::<Scale>(bytes, sources.len())?;
    let usual = |(scale, fitted): &Scale| {
        (LARGEST.recip()..LARGEST).contains(scale) && (0.0..LARGEST).contains(&fitted.unwrap_or(0.0))
    };
    if !scales.iter().all(usual) {
        return Err(FactorFileError::Header("a run with impossible noise"));
    }
    let scaled = sources.iter_mut().zip(scales);
    scaled.for_each(|(source, own)| (source.variance_scale, source.fitted) = own);
    Ok(rest)
}

/// Takes the rigs, and the parts that follow them, off the bytes: whether errors are in the rows, the rigs,
/// and the bytes of their numbers.
fn rigs_of<'a>(
    version: u16,
    bytes: &'a [u8],
    sources: &mut [FactorSource],
    overlapping: &mut Vec<String>,
) -> Result<(bool, Rigs<f64>, &'a [u8]), FactorFileError> {
    let damaged = |_| FactorFileError::Damaged;
    if version <= WITHOUT_READINGS {
        let ((inside, rigs), rest) = postcard::take_from_bytes(bytes).map_err(damaged)?;
        let rest = if version > WITHOUT_FOLDED { folded_of(rest, sources)? } else { rest };
        return Ok((inside, rigs, rest));
    }
    let ((inside, rigs), rest) = postcard::take_from_bytes::<(bool, Rigs)>(bytes).map_err(damaged)?;
    let rest = folded_of(rest, sources)?;
    let (added, rest) = postcard::take_from_bytes::<Added>(rest).map_err(damaged)?;
    if added.readings.len() != sources.len() {
        return Err(FactorFileError::Damaged);
    }
    let usual = |own: &Readings| own.0.windows(2).all(|pair| pair[0] < pair[1]);
    if !added.readings.iter().all(usual) {
        return Err(FactorFileError::Header("readings that are not in order"));
    }
    sources.iter_mut().zip(added.readings).for_each(|(source, own)| source.readings = own.0);
    *overlapping = added.overlapping;
    let rigs = rigs.with_numbers(&added.numbers).ok_or(FactorFileError::Damaged)?;
    Ok((inside, rigs, rest))
}

/// Takes what is left of runs that are no longer distinguished off the bytes.
fn folded_of<'a>(bytes: &'a [u8], sources: &mut [FactorSource]) -> Result<&'a [u8], FactorFileError> {
    let (folded, rest) = of_runs::<Option<Folded>>(bytes, sources.len())?;
    let usual = |own: &Folded| {
        let ordered = own.sample.is_sorted() && !own.sample.is_empty() && own.sample.len() <= SAMPLE;
        let named = !own.names.is_empty() && own.names.iter().all(|name| printable::is_name(name));
        named
            && ordered
            && own.runs > 1
            && own.runs < 1 << 48
            && own.freedom.is_none_or(|v| (1.0..LARGEST).contains(&v))
    };
    if !folded.iter().flatten().all(usual) {
        return Err(FactorFileError::Header("runs that are no longer distinguished, and impossible"));
    }
    sources.iter_mut().zip(folded).for_each(|(source, own)| source.folded = own);
    Ok(rest)
}

fn too_large(what: &'static str, got: u64, most: u64) -> Result<(), FactorFileError> {
    if got > most { Err(FactorFileError::TooLarge { what, got, most }) } else { Ok(()) }
}

/// Returns true for the JSON object that `rigident identify` and others leave.
fn is_result(bytes: &[u8]) -> bool {
    let start = String::from_utf8_lossy(bytes.get(..4096).unwrap_or(bytes));
    start.trim_start_matches('\u{feff}').trim_start().starts_with('{') && start.contains("rigident/result")
}

/// Returns true if the squares of all numbers are within the range of f64.
fn in_range(factor: &Factor) -> bool {
    let usual = |v: f64| v == 0.0 || (LARGEST.recip()..LARGEST).contains(&v.abs());
    let r = factor.r();
    r.column_iter().all(|column| usual(column.amax()))
        && factor.z().iter().all(|z| z.abs() < LARGEST)
        && factor.residual_sum_of_squares() < LARGEST * LARGEST
}

#[cfg(test)]
#[path = "factor_file_tests.rs"]
mod tests;
