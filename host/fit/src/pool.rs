//! Factors of several runs as one, and what their residuals say of it.

mod error;
mod folding;
mod merging;

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::factor_file::{self, FactorFileError, FactorSource, MOST_BYTES, SourceChannel};
use super::lack_of_fit::LackOfFit;
use super::{
    Channel, ChannelFit, CheckedRun, Checks, Counts, Estimate, Factor, Filter, Fit, Judgement, Kind, Noise,
    NoiseCheck, Owner, Parameter, RigRows, RowSet, judge,
};

pub use error::{ModelDifference, PoolError, names_in_words};
pub(super) use folding::SAMPLE;
pub use folding::{Folded, MOST_NAMED};
pub(super) use merging::difference;

/// A disagreement less likely than this among runs of one body is reported and scales the covariance.
const SURPRISING: f64 = 1e-4;

/// A factor with its parameters and the runs that are in it.
///
/// ```no_run
/// use std::path::Path;
///
/// use rigident_fit::pool::PooledFactor;
///
/// let files = ["monday.factor", "tuesday.factor"].map(|file| PooledFactor::read(Path::new(file)));
/// let both = PooledFactor::merged(files.into_iter().collect::<Result<_, _>>()?, false)?;
/// println!("{} rows of {}", both.rows(), both.recordings());
/// both.write(Path::new("both.factor"))?;
/// # Ok::<(), rigident_fit::pool::PoolError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PooledFactor {
    /// Name of the file or of the recording, for messages.
    pub name: String,
    /// The unknowns, in the order of the columns.
    pub parameters: Vec<Parameter>,
    /// The model's ([`super::RowSource::model_fingerprint`]).
    pub model_fingerprint: u64,
    /// The share in columns of unit length that is no more than rounding ([`super::RowSource::rounding`]).
    pub rounding: f64,
    /// All rows, whitened by the noise that they have, those of each rig with the errors that its runs share.
    pub rigs: Vec<RigRows>,
    /// True if what was known of errors is in the rows, once a run: an older program wrote them.
    pub errors_inside: bool,
    /// The runs that they are from.
    pub sources: Vec<FactorSource>,
    /// Parameters that the rows determined and that were eliminated.
    pub eliminated: u64,
    /// χ² of the disagreement of what was merged, whitened.
    pub disagreement: f64,
    /// Its degrees of freedom.
    pub comparisons: u64,
    /// Errors of which runs of one rig stated different standard deviations: the largest was taken.
    pub differing: Vec<String>,
    /// Names of runs that have a part of their readings in common, two by two.
    pub overlapping: Vec<String>,
}

impl PooledFactor {
    /// Returns the factor of one run; its date is not known.
    pub fn of(fit: &Fit, recording: &str) -> Self {
        let identity = fit.identities.first().cloned().unwrap_or_default();
        let source = FactorSource {
            recording: recording.to_owned(),
            recorded_unix_s: None,
            fingerprint: identity.fingerprint,
            readings: identity.sample,
            samples: fit.counts.samples,
            rejected: fit.counts.rejected,
            rows: fit.factor.rows(),
            variance_scale: fit.noise.variance_scale,
            fitted: Some(fit.noise.fitted),
            noise_gain: fit.noise.noise_gain,
            sigma_given: fit.noise.sigma_given,
            spurious_information: fit.spurious_information,
            channels: fit
                .channels
                .iter()
                .enumerate()
                .map(|(k, c)| SourceChannel {
                    name: c.channel.name.clone(),
                    unit: c.channel.unit.clone(),
                    sigma: c.sigma,
                    gain_sigma: fit.gain(k).map_or(0.0, |gain| gain.nuisance.sigma),
                    measured_rms: c.measured_rms,
                })
                .collect(),
            checks: None,
            labels: BTreeMap::new(),
            folded: None,
        };
        Self {
            name: recording.to_owned(),
            parameters: fit.parameters.clone(),
            model_fingerprint: fit.model_fingerprint,
            rounding: fit.rounding,
            rigs: vec![fit.rows()],
            errors_inside: false,
            sources: vec![source],
            eliminated: 0,
            disagreement: 0.0,
            comparisons: 0,
            differing: Vec::new(),
            overlapping: Vec::new(),
        }
    }

    /// Returns the rows over the parameters alone, whatever the errors of the rigs are.
    pub fn factor(&self) -> Factor {
        merging::own(&self.rigs)
    }

    /// Returns the same runs with other rows, which no errors of a rig are known apart of.
    #[must_use]
    pub fn with_factor(self, factor: Factor) -> Self {
        Self { rigs: vec![RigRows::plain(factor)], ..self }
    }

    /// Returns the number of scalar rows absorbed.
    pub fn rows(&self) -> u64 {
        self.rigs.iter().map(|rig| rig.factor().rows()).fold(0, u64::saturating_add)
    }

    /// Returns the number of runs that are in it.
    pub fn runs(&self) -> u64 {
        self.sources.iter().map(FactorSource::runs).fold(0, u64::saturating_add)
    }

    /// Returns the same with the date of its runs, s since 1970-01-01 UTC.
    #[must_use]
    pub fn recorded_at(mut self, unix_s: i64) -> Self {
        self.sources.iter_mut().for_each(|source| source.recorded_unix_s = Some(unix_s));
        self
    }

    /// Returns the same with what the checks of its runs found.
    #[must_use]
    pub fn checked(mut self, checks: &Checks) -> Self {
        self.sources.iter_mut().for_each(|source| source.checks = Some(checks.clone()));
        self
    }

    /// Returns the same with labels of its runs beside those that they have; a label that is given anew takes
    /// the place of the old one.
    #[must_use]
    pub fn labelled(mut self, labels: &BTreeMap<String, String>) -> Self {
        for source in &mut self.sources {
            source.labels.extend(labels.iter().map(|(key, value)| (key.clone(), value.clone())));
        }
        self
    }

    /// Reads the bytes of a factor file called `name`.
    ///
    /// # Errors
    /// [`PoolError::File`] says what is wrong with it.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self, PoolError> {
        factor_file::from_bytes(bytes, name).map_err(|error| PoolError::File { name: name.to_owned(), error })
    }

    /// Returns the bytes of the factor file.
    pub fn to_bytes(&self) -> Vec<u8> {
        factor_file::to_bytes(self)
    }

    /// Reads a factor file.
    ///
    /// # Errors
    /// [`PoolError::Access`] if it cannot be read, [`PoolError::File`] if it is no usable factor.
    pub fn read(path: &Path) -> Result<Self, PoolError> {
        let name = path.display().to_string();
        let refuse = |e: std::io::Error| PoolError::Access {
            name: name.clone(),
            reason: format!("cannot be read: {e}"),
        };
        let length = rigident_files::open(path).and_then(|file| file.metadata()).map_err(refuse)?.len();
        if length > MOST_BYTES {
            let error = FactorFileError::TooLarge { what: "bytes", got: length, most: MOST_BYTES };
            return Err(PoolError::File { name, error });
        }
        Self::from_bytes(&rigident_files::read(path, MOST_BYTES).map_err(refuse)?, &name)
    }

    /// Writes a factor file, which must not exist.
    ///
    /// # Errors
    /// [`PoolError::Access`] if it is there already or cannot be written; nothing is left of it then.
    pub fn write(&self, path: &Path) -> Result<(), PoolError> {
        let refuse = |e: std::io::Error| PoolError::Access {
            name: path.display().to_string(),
            reason: match e.kind() {
                std::io::ErrorKind::AlreadyExists => "is there already and is not overwritten".to_owned(),
                _ => format!("cannot be written: {e}"),
            },
        };
        let mut file = std::fs::File::create_new(path).map_err(refuse)?;
        file.write_all(&self.to_bytes()).map_err(|error| {
            let _ = std::fs::remove_file(path);
            refuse(error)
        })
    }

    /// Returns what is known of the parameters that `keep` selects, whatever the others are.
    #[must_use]
    pub fn only(mut self, keep: impl Fn(&Parameter) -> bool) -> Self {
        let kept: Vec<usize> =
            (0..self.parameters.len()).filter(|j| self.parameters.get(*j).is_some_and(&keep)).collect();
        if kept.len() < self.parameters.len() {
            let before = self.rank();
            self.rigs = self.rigs.iter().map(|rig| rig.select(&kept)).collect();
            self.eliminated = self.eliminated.saturating_add(before.saturating_sub(self.rank()));
            self.parameters.retain(keep);
        }
        self
    }

    /// Returns the same with the channels' constant offsets, if they are in it, eliminated.
    #[must_use]
    pub fn without_offsets(self) -> Self {
        self.only(|parameter| parameter.kind != Kind::Offset)
    }

    /// Judges the residuals, `factor` being the rows over the parameters alone.
    fn judged(&self, factor: &Factor) -> (Judgement, Option<f64>) {
        let determined = factor.solve(self.rounding).determined.iter().filter(|d| **d).count() as u64;
        let together = determined.saturating_add(self.eliminated).saturating_add(self.comparisons) as f64;
        let of_runs: Option<f64> = self.sources.iter().map(|source| source.fitted).sum();
        let fitted = of_runs.unwrap_or(together);
        // What only shows between the runs is judged between the runs.
        let within = (factor.residual_sum_of_squares() - self.disagreement).max(0.0);
        let sets: Vec<RowSet> = self.sources.iter().map(FactorSource::row_set).collect();
        let mut judgement = judge(&sets, within, fitted);
        for degrees_of_freedom in self.sources.iter().filter_map(FactorSource::freedom) {
            judgement.noise = judgement.noise.less_certain(Noise::Estimated { degrees_of_freedom });
        }
        let dof = self.comparisons as f64;
        let chi2 = self.disagreement / judgement.variance_scale;
        // Below its mean it is no surprise; beyond the range of f64 it comes of no recording.
        let surprising = chi2 > dof
            && chi2.is_finite()
            && ChiSquared::new(dof).is_ok_and(|distribution| distribution.sf(chi2) < SURPRISING);
        if surprising {
            judgement.variance_scale *= chi2 / dof;
        }
        (judgement, surprising.then_some(chi2 / dof))
    }

    /// Returns χ² per degree of freedom of the runs' disagreement, where their noise does not explain it.
    pub fn unexplained_disagreement(&self) -> Option<f64> {
        self.judged(&self.factor()).1
    }

    /// Returns the fit that the factor alone gives: no residuals over time, no counts of single channels.
    pub fn fit(&self) -> Fit {
        let own = self.factor();
        let (judgement, disagreement) = self.judged(&own);
        let fitted = self.sources.iter().filter_map(|source| source.fitted).sum();
        let Judgement { noise, variance_ratio, variance_scale } = judgement;
        // What is known beforehand is not the noise's to scale.
        let scaled = self.discounted(variance_scale);
        let solved = if variance_scale == 1.0 { own } else { scaled.factor() };
        let rig_rows = match scaled.rigs.as_slice() {
            [rig] => Some(rig.clone()),
            _ => None,
        };
        // Of a single run what its residuals show; of several each has its own.
        let of_run = match self.sources.as_slice() {
            [run] if run.folded.is_none() => run.variance_scale,
            _ => 1.0,
        };
        let sum = |count: &dyn Fn(&FactorSource) -> u64| {
            self.sources.iter().map(count).fold(0, u64::saturating_add)
        };
        let rows: f64 = self.sources.iter().map(|s| s.rows as f64).sum();
        let expected: f64 = self.sources.iter().map(|s| s.rows as f64 * s.noise_gain).sum();
        Fit {
            signals: Vec::new(),
            stated_noise: Vec::new(),
            nuisances: Vec::new(),
            agreement: None,
            error_scores: None,
            joint: None,
            added: Vec::new(),
            device: None,
            parameters: self.parameters.clone(),
            channels: self.channels(),
            factor: solved.discount(1.0 / (of_run * variance_scale)),
            estimate: Estimate::new(&solved, self.rounding, 1.0, noise).beside(&scaled.rigs),
            solved: Some(solved),
            rig_rows,
            rounding: self.rounding,
            model_fingerprint: self.model_fingerprint,
            identities: self.sources.iter().flat_map(FactorSource::identities).collect(),
            prior: None,
            noise: NoiseCheck {
                sigma_given: self.sources.iter().any(|s| s.sigma_given),
                noise_gain: expected / rows.max(1.0),
                variance_ratio: if of_run > 1.0 { of_run } else { variance_ratio },
                variance_scale: variance_scale * of_run,
                model_error: 1.0,
                disagreement,
                fitted,
            },
            inflation: Vec::new(),
            widened: Vec::new(),
            signal_bias: Vec::new(),
            spurious_information: self.sources.iter().map(|s| s.spurious_information).sum(),
            residuals: Vec::new(),
            filter: Filter::default(),
            counts: Counts {
                samples: sum(&|s| s.samples),
                rejected: sum(&|s| s.rejected),
                rejected_by_signal: Vec::new(),
                gaps: 0,
                blocks: sum(&|s| s.rows / (s.channels.len() as u64).max(1)),
            },
            lack_of_fit: LackOfFit::default(),
            runs: self
                .sources
                .iter()
                .map(|source| CheckedRun { recording: source.in_words(), checks: source.checks.clone() })
                .collect(),
            forgotten: None,
            convergence: Vec::new(),
        }
    }

    /// Returns the same with a variance of all rows `by` times as large.
    fn discounted(&self, by: f64) -> Self {
        Self { rigs: self.rigs.iter().map(|rig| rig.discount(by)).collect(), ..self.clone() }
    }

    /// Returns the same runs with σ of every channel `by` times as large.
    #[must_use]
    pub fn with_noise_times(&self, by: f64) -> Self {
        let mut louder = self.discounted(by * by);
        let channels = louder.sources.iter_mut().flat_map(|source| &mut source.channels);
        channels.for_each(|channel| channel.sigma *= by);
        louder
    }

    /// The channels of all runs by their names; σ is that of the first run that has the channel.
    fn channels(&self) -> Vec<ChannelFit> {
        let mut channels: Vec<ChannelFit> = Vec::new();
        let mut seen = std::collections::HashSet::new();
        for channel in self.sources.iter().flat_map(|s| &s.channels) {
            if !seen.insert(channel.name.as_str()) {
                continue;
            }
            let owner = Owner::Channel(channel.name.clone());
            let offset = self.parameters.iter().position(|p| p.kind == Kind::Offset && p.owner == owner);
            channels.push(ChannelFit {
                channel: Channel {
                    name: channel.name.clone(),
                    unit: channel.unit.clone(),
                    sigma: Some(channel.sigma),
                    offset,
                    group: 0,
                },
                sigma: channel.sigma,
                residual_rms: 0.0,
                measured_rms: channel.measured_rms,
                measured_sd: 0.0,
                noise_floor: 0.0,
                outliers: 0,
                rejected: 0,
                residual_sigma: channel.sigma,
                autocorrelation: None,
            });
        }
        channels
    }

    /// Returns why no offset is a parameter of it; `None` if one is.
    pub fn without_offset_in_words(&self) -> Option<String> {
        if self.parameters.iter().any(|p| p.kind == Kind::Offset) {
            return None;
        }
        let said = if self.runs() > 1 {
            "the factor has no wrench offsets: each run has its own, and merging eliminated them; solve the \
             factors of the single runs for theirs, or merge with `shared_offset` if they have one between \
             them"
        } else {
            "the factor has no wrench offset: it was known by the rig file (offset_n_nm) and not estimated"
        };
        Some(said.to_owned())
    }

    /// Returns the names of the recordings, joined; of many the first few and their number.
    pub fn recordings(&self) -> String {
        let names: Vec<_> = self.sources.iter().flat_map(FactorSource::names).collect();
        let hidden = self.runs().saturating_sub(names.len() as u64);
        error::names_of_many(&names, hidden, " + ")
    }
}

/// Returns a warning for runs that disagree; `ratio` is χ² per degree of freedom.
pub fn disagreement_in_words(what: &str, ratio: f64) -> String {
    format!(
        "{what} disagree {:.1} times as much as their noise explains, and the intervals were widened: was \
         the body mounted differently, or does a sensor drift?",
        ratio.sqrt()
    )
}

#[cfg(test)]
#[path = "pool_tests.rs"]
mod tests;
