//! Factors of several recordings as one, and what their residuals say of it.
//!
//! Lives here: merging in any order with the offsets of each recording eliminated before, the header that a
//! factor file carries, and the judgement that scales the covariance when raw data are no longer at hand. May
//! not live here: the bytes of the file ([`super::factor_file`]), subtraction of a fixture
//! ([`super::tare`]). Before this: [`super::identify`]; after it: [`crate::answer`].

use std::collections::HashMap;
use std::rc::Rc;

use nalgebra::DMatrix;
use rigident_shared::estimator::Counters;
use rigident_shared::factor::InformationFactor;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::factor_file::{FactorFile, FactorFileError, FactorSource, fingerprint};
use super::{Factor, Identification, Input};
use crate::answer::Noise;
use crate::answer::identifiability::RegressorNoise;

/// Names of recordings that one line holds.
const MOST_NAMES: usize = 6;
/// A disagreement less likely than this among runs of one body is told and widens the intervals.
const SURPRISING: f64 = 1e-4;

/// Why factors are not merged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoolError {
    /// The file.
    #[error("{name}: {error}")]
    File {
        /// Its name.
        name: String,
        /// Why.
        error: FactorFileError,
    },
    /// The same readings twice.
    #[error(
        "the recording {recording} is in it twice ({first} and {second}): counting the same noise twice would halve \
         the variance without knowing more; leave one of them out"
    )]
    Repeated {
        /// The recording.
        recording: String,
        /// Name of the first factor that holds it.
        first: String,
        /// Name of the second.
        second: String,
    },
    /// A shared offset that one of them does not have.
    #[error(
        "{name} has {got} parameters, the others have {wanted}: with --shared-offset all need the six offsets; \
         without it each factor's offsets are eliminated and the ten parameters of the body merge"
    )]
    Parameters {
        /// The factor that differs.
        name: String,
        /// Its parameters.
        got: usize,
        /// Those of the first.
        wanted: usize,
    },
    /// Numbers too large.
    #[error("{name}: merged with the others its numbers overflow: it is no factor of a real recording")]
    Overflow {
        /// The factor.
        name: String,
    },
    /// Nothing was given.
    #[error("there is nothing to merge: give at least one factor")]
    Nothing,
}

/// A factor with the recordings that are in it.
#[derive(Clone, Debug, PartialEq)]
pub struct PooledFactor {
    /// Name of the file or of the recording, for messages.
    pub name: String,
    /// All rows, whitened.
    pub factor: Factor,
    /// Where they came from.
    pub sources: Vec<FactorSource>,
    /// Parameters that the rows determined and that were eliminated.
    pub eliminated: u32,
    /// χ² of the disagreement of what was merged.
    pub disagreement: f64,
    /// Its degrees of freedom.
    pub comparisons: u32,
}

/// What residuals say of the noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// How the noise is known.
    pub noise: Noise,
    /// Residual variance relative to what σ lets expect; 1 where every σ comes from the residuals.
    pub variance_ratio: f64,
    /// What the covariance is multiplied by.
    pub variance_scale: f64,
    /// χ² per degree of freedom of the merged runs' disagreement, where their noise does not explain it.
    pub disagreement: Option<f64>,
}

/// Rows of one recording, as far as their residuals are concerned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowSet {
    /// Scalar rows, six a block.
    pub rows: u32,
    /// Variance of the whitened, filtered noise per row.
    pub noise_gain: f64,
    /// σ was given; else it is from the residuals.
    pub sigma_given: bool,
}

impl RowSet {
    /// Effective independent readings per channel. Filtered ones are worth `noise_gain` each.
    fn independent(&self) -> f64 {
        f64::from(self.rows) / 6.0 * self.noise_gain.min(1.0)
    }
}

impl From<&FactorSource> for RowSet {
    fn from(source: &FactorSource) -> Self {
        Self { rows: source.rows, noise_gain: source.noise_gain, sigma_given: source.sigma_given }
    }
}

/// Judges the residual sum of squares of all rows, to which `fitted` parameters were fitted.
///
/// A whitened, filtered row of set i has the variance `gain_i`, so
/// `E[RSS] = Σ rows_i gain_i · (rows − fitted) / rows`. Residuals larger than the stated noise can make them
/// widen the intervals.
pub fn judge(sets: &[RowSet], residual_sum_of_squares: f64, fitted: f64) -> Judgement {
    let rows: f64 = sets.iter().map(|s| f64::from(s.rows)).sum();
    let expected: f64 = sets.iter().map(|s| f64::from(s.rows) * s.noise_gain).sum();
    let left = |readings: f64| (readings - fitted / 6.0).max(1.0);
    let dof = left(sets.iter().map(RowSet::independent).sum());
    let estimated: f64 = sets.iter().filter(|s| !s.sigma_given).map(RowSet::independent).sum();
    let noise = if sets.iter().all(|s| s.sigma_given) {
        Noise::Given
    } else {
        Noise::Estimated { degrees_of_freedom: left(estimated) }
    };
    let variance_ratio = if sets.iter().any(|s| s.sigma_given) {
        residual_sum_of_squares / ((rows - fitted).max(1.0) * expected / rows.max(1.0))
    } else {
        1.0
    };
    let surprising = 1.0 + 4.0 * (2.0 / (6.0 * dof)).sqrt();
    let variance_scale = if variance_ratio > surprising { variance_ratio } else { 1.0 };
    Judgement { noise, variance_ratio, variance_scale, disagreement: None }
}

/// The ten body parameters with the offsets eliminated: these are ordered first, the trailing triangle is what
/// all rows say of the rest.
pub fn without_offset(factor: &InformationFactor<f64, 16>) -> InformationFactor<f64, 10> {
    let mut order = [[0.0; 16]; 16];
    for (parameter, row) in order.iter_mut().enumerate() {
        row[(parameter + 6) % 16] = 1.0;
    }
    factor.substitute(&order).trailing::<10>()
}

/// Rank of the triangle, columns scaled to unit length.
fn rank<const N: usize>(factor: &InformationFactor<f64, N>) -> u32 {
    let mut r = DMatrix::from_fn(N, N, |i, j| factor.r()[i][j]);
    for mut column in r.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    // Bounded: a file may hold numbers whose squares overflow.
    let Some(svd) = r.try_svd(false, false, f64::EPSILON, 1000) else { return 0 };
    let floor = N as f64 * f64::EPSILON * svd.singular_values.max();
    svd.singular_values.iter().filter(|v| **v > floor).count() as u32
}

impl Factor {
    /// Parameters: 10 or 16.
    pub fn parameters(&self) -> usize {
        match self {
            Self::Ten(_) => 10,
            Self::Sixteen(_) => 16,
        }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Ten(f) => f.is_finite(),
            Self::Sixteen(f) => f.is_finite(),
        }
    }

    /// How many parameters the rows alone determine.
    pub fn determined(&self) -> usize {
        let count = |determined: &[bool]| determined.iter().filter(|d| **d).count();
        match self {
            Self::Ten(f) => count(&f.solve().determined),
            Self::Sixteen(f) => count(&f.solve().determined),
        }
    }
}

impl PooledFactor {
    /// The factor of one recording, whose readings are in `input`.
    pub fn of(identification: &Identification, input: &Input, recording: &str) -> Self {
        let readings = identification.counters.readings;
        let source = FactorSource {
            recording: recording.to_owned(),
            fingerprint: fingerprint(&input.readings),
            readings,
            rejected: identification.counters.rejected,
            rows: identification.factor.rows(),
            noise_gain: identification.noise_gain,
            channel_sigma: identification.channel_sigma,
            sigma_given: identification.sigma_given,
            gain_sigma: input.gain_sigma,
            tensor_information: identification.regressor_noise.tensor_information,
        };
        Self {
            name: recording.to_owned(),
            factor: identification.factor.clone(),
            sources: vec![source],
            eliminated: 0,
            disagreement: 0.0,
            comparisons: 0,
        }
    }

    /// From the bytes of a factor file called `name`.
    ///
    /// # Errors
    /// [`PoolError::File`] says what is wrong with it.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self, PoolError> {
        let refuse = |error| PoolError::File { name: name.to_owned(), error };
        let file = FactorFile::from_bytes(bytes).map_err(refuse)?;
        file.check().map_err(refuse)?;
        let factor = if file.parameters.len() == 10 {
            Factor::Ten(Box::new(file.factor::<10>().map_err(refuse)?))
        } else {
            Factor::Sixteen(Box::new(file.factor::<16>().map_err(refuse)?))
        };
        let FactorFile { sources, eliminated, disagreement, comparisons, .. } = file;
        Ok(Self { name: name.to_owned(), factor, sources, eliminated, disagreement, comparisons })
    }

    /// The factor file.
    pub fn to_file(&self) -> FactorFile {
        let mut file = match &self.factor {
            Factor::Ten(f) => FactorFile::new(f, self.sources.clone()),
            Factor::Sixteen(f) => FactorFile::new(f, self.sources.clone()),
        };
        file.eliminated = self.eliminated;
        file.disagreement = self.disagreement;
        file.comparisons = self.comparisons;
        file
    }

    /// The same with the wrench offset, if it is in it, eliminated.
    #[must_use]
    pub fn without_offset(mut self) -> Self {
        if let Factor::Sixteen(factor) = &self.factor {
            // Every block has a row of each offset.
            self.eliminated += 6;
            self.factor = Factor::Ten(Box::new(without_offset(factor)));
        }
        self
    }

    /// All of them as one. Unless the offset is shared each factor's own is eliminated first; the order does not
    /// matter but for rounding.
    ///
    /// # Errors
    /// [`PoolError`]: the same recording twice, or factors that do not fit.
    pub fn merged(factors: Vec<Self>, shared_offset: bool) -> Result<Self, PoolError> {
        let several = factors.len() > 1;
        let mut factors = factors.into_iter();
        let prepare = |f: Self| if shared_offset || !several { f } else { f.without_offset() };
        let mut whole = prepare(factors.next().ok_or(PoolError::Nothing)?);
        // Where each recording came from, for the message, by its fingerprint: of thousands none is looked for in turn.
        let mut origins: HashMap<u64, Rc<str>> = HashMap::new();
        let name = Rc::from(whole.name.as_str());
        origins.extend(whole.sources.iter().map(|s| (s.fingerprint, Rc::clone(&name))));
        for other in factors.map(prepare) {
            if let Some((source, first)) =
                other.sources.iter().find_map(|s| Some((s, origins.get(&s.fingerprint)?)))
            {
                return Err(PoolError::Repeated {
                    recording: source.recording.clone(),
                    first: first.to_string(),
                    second: other.name,
                });
            }
            let disagreement = match (&mut whole.factor, &other.factor) {
                (Factor::Ten(a), Factor::Ten(b)) => merge(a, b),
                (Factor::Sixteen(a), Factor::Sixteen(b)) => merge(a, b),
                (a, b) => {
                    return Err(PoolError::Parameters {
                        name: other.name.clone(),
                        got: b.parameters(),
                        wanted: a.parameters(),
                    });
                }
            };
            if !whole.factor.is_finite() {
                return Err(PoolError::Overflow { name: other.name });
            }
            whole.disagreement += other.disagreement + disagreement.0;
            whole.comparisons += other.comparisons + disagreement.1;
            whole.eliminated += other.eliminated;
            let name = Rc::from(other.name.as_str());
            origins.extend(other.sources.iter().map(|s| (s.fingerprint, Rc::clone(&name))));
            whole.sources.extend(other.sources);
        }
        Ok(whole)
    }

    /// What the residuals say, `determined` of the parameters being determined by the rows.
    pub fn judgement(&self, determined: usize) -> Judgement {
        let fitted = determined as f64 + f64::from(self.eliminated);
        // What only shows between the runs is judged between the runs.
        let within = (self.factor.residual_sum_of_squares() - self.disagreement).max(0.0);
        let sets: Vec<RowSet> = self.sources.iter().map(RowSet::from).collect();
        let mut judgement = judge(&sets, within, fitted + f64::from(self.comparisons));
        let dof = f64::from(self.comparisons);
        let chi2 = self.disagreement / judgement.variance_scale;
        if ChiSquared::new(dof).is_ok_and(|distribution| distribution.sf(chi2) < SURPRISING) {
            judgement.disagreement = Some(chi2 / dof);
            judgement.variance_scale *= chi2 / dof;
        }
        judgement
    }

    /// What the factor says, without the data: no residuals over time, no counters of single channels.
    pub fn identification(&self) -> Identification {
        let judgement = self.judgement(self.factor.determined());
        let sum = |count: &dyn Fn(&FactorSource) -> u32| {
            self.sources.iter().map(count).fold(0, u32::saturating_add)
        };
        let rows: f64 = self.sources.iter().map(|s| f64::from(s.rows)).sum();
        let expected: f64 = self.sources.iter().map(|s| f64::from(s.rows) * s.noise_gain).sum();
        Identification {
            factor: self.factor.clone(),
            estimate: self.factor.estimate(judgement.variance_scale, judgement.noise),
            channel_sigma: self.sources.first().map_or([1.0; 6], |s| s.channel_sigma),
            sigma_given: self.sources.iter().any(|s| s.sigma_given),
            noise_gain: expected / rows.max(1.0),
            variance_ratio: judgement.variance_ratio,
            widening: Vec::new(),
            residual_rms: [0.0; 6],
            residuals: Vec::new(),
            gains: [0.0; 6],
            regressor_noise: RegressorNoise {
                tensor_information: self.sources.iter().map(|s| s.tensor_information).sum(),
            },
            // There are no residuals to look at, only their sum.
            colour: Vec::new(),
            counters: Counters {
                readings: sum(&|s| s.readings),
                rejected: sum(&|s| s.rejected),
                blocks: sum(&|s| s.rows / 6),
                ..Counters::default()
            },
        }
    }

    /// What merging did not do, in words. Gain errors are eliminated run by run; those of one load cell are the
    /// same in all of them, and do not average out as noise does.
    pub fn warning(&self) -> Option<String> {
        let uncertain = self.sources.iter().filter(|s| s.gain_sigma.iter().any(|g| *g > 0.0)).count();
        (uncertain > 1).then(|| {
            format!(
                "the gain errors of the load cell were taken to differ from run to run: if all {uncertain} runs were \
                 taken with one load cell, the part of the intervals that comes from its gains is too small by up to \
                 a factor of {:.1}",
                (uncertain as f64).sqrt()
            )
        })
    }

    /// Why the wrench offset is no parameter of it; `None` if it is one.
    pub fn without_offset_in_words(&self) -> Option<String> {
        (self.factor.parameters() == 10).then(|| {
            if self.sources.len() > 1 {
                "the factor has no wrench offsets: each run has its own, and merging eliminated them; solve the factors of \
                 the single runs for theirs, or merge with --shared-offset if they have one between them"
                    .to_owned()
            } else {
                "the factor has no wrench offset: it was known by the rig file (offset_n_nm) and not estimated".to_owned()
            }
        })
    }

    /// Returns the names of the recordings, joined; of many the first ones and how many more there are.
    pub fn recordings(&self) -> String {
        let names: Vec<_> = self.sources.iter().take(MOST_NAMES).map(|s| s.recording.as_str()).collect();
        let more = self.sources.len().saturating_sub(MOST_NAMES);
        names.join(" + ") + &if more > 0 { format!(" + {more} more") } else { String::new() }
    }
}

/// Merges; the residual sum of squares that this adds, whitened to unit variance, and how many parameters both
/// knew. `cov = (RᵀR)⁻¹` already counts what the filter takes, so the sum is a χ² as it is.
fn merge<const N: usize>(a: &mut InformationFactor<f64, N>, b: &InformationFactor<f64, N>) -> (f64, u32) {
    let (apart, ranks) = (a.residual_sum_of_squares() + b.residual_sum_of_squares(), rank(a) + rank(b));
    a.merge(b);
    ((a.residual_sum_of_squares() - apart).max(0.0), ranks.saturating_sub(rank(a)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One run of a body, some rows of noise.
    fn run(number: u64) -> PooledFactor {
        let mut factor = InformationFactor::<f64, 10>::new();
        for k in 0..12 {
            let columns = std::array::from_fn(|j| [((k * 10 + j) % 7) as f64 - 3.1]);
            factor.absorb(&columns, &[((k + number as usize) % 5) as f64 * 0.1]);
        }
        let source = FactorSource {
            recording: format!("run {number}"),
            fingerprint: number,
            readings: 2,
            rejected: 0,
            rows: 12,
            noise_gain: 1.0,
            channel_sigma: [1.0; 6],
            sigma_given: true,
            gain_sigma: [0.0; 6],
            tensor_information: 0.0,
        };
        PooledFactor {
            name: format!("run{number}.factor"),
            factor: Factor::Ten(Box::new(factor)),
            sources: vec![source],
            eliminated: 0,
            disagreement: 0.0,
            comparisons: 0,
        }
    }

    #[test]
    fn ten_thousand_runs_are_merged_in_a_line_of_words() {
        let runs = 10_000;
        let merged = PooledFactor::merged((0..runs).map(run).collect(), false).unwrap();
        assert_eq!((merged.sources.len() as u64, merged.factor.rows()), (runs, 120_000));
        assert_eq!(merged.recordings(), "run 0 + run 1 + run 2 + run 3 + run 4 + run 5 + 9994 more");
        let again = (0..runs).chain([4711]).map(run).collect();
        let repeated = PooledFactor::merged(again, false).unwrap_err();
        assert!(
            matches!(&repeated, PoolError::Repeated { first, second, .. } if first == second && first == "run4711.factor")
        );
    }
}
