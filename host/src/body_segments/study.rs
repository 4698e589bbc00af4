//! Motions of a person, each with its rows and factor, and what they say together.

use nalgebra::DMatrix;

use super::calibration::{DrawError, Looked, draws};
use crate::answer::checks;
use crate::answer::standard_parameters::{BaseEstimate, Full, nearest};
use crate::fit::pool::{PoolError, PooledFactor};
use crate::fit::prior::apply_distribution;
use crate::fit::{Checks, Factor, Fit, FitError, FitOptions, Gaussian, Measured, Progress, RowSource, fit};
use crate::model::ModelError;
use crate::model::base::BaseParameters;
use crate::motion_capture::trial::Trial;
use crate::motion_selection::SelectionError;
use crate::problem::person::anthropometry::{Spread, distribution};
use crate::problem::person::noise::{RowSums, sigma};
use crate::problem::person::{Person, PersonError};
use crate::problem::tree::{Input, TreeSource, TreeSourceError};

/// Fewest frames that a motion has.
const FEWEST_FRAMES: usize = 15;

/// The reason that a person's segments are not found.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The trials make no person.
    #[error(transparent)]
    Person(#[from] PersonError),
    /// The frames make no rows.
    #[error(transparent)]
    Source(#[from] TreeSourceError),
    /// The rows cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A person with other joints has no rows.
    #[error(transparent)]
    Draws(#[from] DrawError),
    /// Motions do not fit together.
    #[error(transparent)]
    Pool(#[from] PoolError),
    /// There is nothing to choose from.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// The table has no bodies of this model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// No frame of any trial can be used.
    #[error("no frame can be used: {0}")]
    NoFrames(String),
}

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudyOptions {
    /// How well the table is known of one person.
    pub spread: Spread,
    /// Relative standard deviation (1 σ) of the segments nearest to the table.
    pub trust: f64,
    /// Right segments mirror left ones.
    pub symmetric: bool,
    /// Parts of a single trial, each a motion.
    pub parts: usize,
    /// The person's mass by scales, kg, with 1 σ; `None`: not known.
    pub mass_kg: Option<[f64; 2]>,
}

impl Default for StudyOptions {
    fn default() -> Self {
        Self { spread: Spread::default(), trust: 0.3, symmetric: false, parts: 4, mass_kg: None }
    }
}

/// A motion: a trial, or a part of one.
pub struct Motion {
    /// Its name.
    pub name: String,
    /// The trial, by its number.
    pub trial: usize,
    /// Its rows.
    pub source: TreeSource,
    /// Its fit.
    pub fit: Fit,
}

impl Motion {
    /// Returns 1 σ of every channel, per unfiltered sample.
    pub fn sigma(&self) -> Vec<f64> {
        self.source.channels().iter().map(|c| c.sigma.unwrap_or(1.0)).collect()
    }

    fn looked(&self) -> Looked {
        let frames = &self.source.input().frames;
        let first_ns = frames.first().map_or(0, |frame| frame.time_ns);
        Looked { trial: self.trial, first_ns, frames: frames.len(), sigma: self.sigma() }
    }

    /// Returns its factor, with what its checks found. That residuals of people who are not rigid are as slow as their motion is
    /// counted in the intervals, and no warning.
    pub fn factor(&self) -> PooledFactor {
        let found = Checks { warnings: Vec::new(), ..checks(&self.fit, &[], true) };
        PooledFactor::of(&self.fit, &self.name).checked(&found)
    }
}

/// Returns a fit whose σ are what residuals have beside the table: there is no stated noise to compare them with.
fn nothing_stated(mut fit: Fit) -> Fit {
    fit.noise.variance_ratio = 1.0;
    fit
}

/// All motions of a person.
pub struct Study {
    /// The motions.
    pub motions: Vec<Motion>,
    /// What the table says of the base parameters, and scales of the mass.
    pub table: Gaussian,
    /// What the table alone says of them.
    open: Gaussian,
    /// Settings.
    pub options: StudyOptions,
    /// Trials without a usable frame, or too few, with the reason.
    pub left: Vec<String>,
    /// How joint centres and marker places move the parameters, one column a draw; none before [`Study::draw`].
    pub draws: DMatrix<f64>,
}

impl Study {
    /// Returns the study of some of a person's trials, by their numbers, with the joint centres as they were found.
    ///
    /// # Errors
    /// [`StudyError`] if nothing can be used.
    pub fn new(
        person: &Person,
        which: &[usize],
        options: &StudyOptions,
        fit_options: &FitOptions,
        progress: &dyn Progress,
    ) -> Result<Self, StudyError> {
        let (mut sources, mut left): (Vec<(String, usize, TreeSource)>, Vec<String>) =
            (Vec::new(), Vec::new());
        let parts = if which.len() == 1 { options.parts.max(1) } else { 1 };
        for (k, tracked) in which.iter().filter_map(|k| Some((*k, person.trials.get(*k)?))) {
            let Some(input) = person.input(k).filter(|input| input.frames.len() >= FEWEST_FRAMES) else {
                left.push(tracked.why_unused());
                continue;
            };
            let parts = parts.min(input.frames.len() / FEWEST_FRAMES).max(1);
            for (part, input) in in_parts(input, parts).into_iter().enumerate() {
                let name = if parts == 1 {
                    tracked.name.clone()
                } else {
                    format!("{}, part {}", tracked.name, part + 1)
                };
                sources.push((name, k, TreeSource::new(input)?));
            }
        }
        let Some((_, _, first)) = sources.first() else {
            return Err(StudyError::NoFrames(left.join("; ")));
        };
        let open = table(person, first.base(), &options.spread)?;
        let mut sums = Vec::new();
        for (_, trial, source) in &sources {
            let report = &person.trials[*trial].report;
            sums.push(RowSums::of(source, report.rate_hz, report.cut_off_hz)?);
        }
        let sigmas = sigma(&sums, &open).ok_or_else(|| {
            StudyError::NoFrames("the rows that are left are too short for their filter".to_owned())
        })?;
        let mut motions = Vec::new();
        for (k, ((name, trial, source), sigma)) in sources.into_iter().zip(sigmas).enumerate() {
            progress.stage("motions", k as f64 / sums.len() as f64);
            let source = source.with_channel_sigma(sigma);
            match fit(&source, fit_options, progress) {
                Ok(fit) => motions.push(Motion { name, trial, source, fit: nothing_stated(fit) }),
                Err(error @ FitError::NoRows { .. }) => left.push(format!("{name}: {error}")),
                Err(error) => return Err(error.into()),
            }
        }
        if motions.is_empty() {
            return Err(StudyError::NoFrames(left.join("; ")));
        }
        let table = options.mass_kg.map_or_else(|| open.clone(), |mass| with_mass(&open, mass));
        let draws = DMatrix::zeros(open.names().len(), 0);
        Ok(Self { motions, table, open, options: *options, left, draws })
    }

    /// Finds how joint centres and marker places move the parameters; `trials` are those that the person was made of.
    ///
    /// # Errors
    /// [`StudyError::Draws`] if a person with other joints has no rows.
    pub fn draw(
        &mut self,
        person: &Person,
        trials: &[Trial],
        progress: &dyn Progress,
    ) -> Result<(), StudyError> {
        let looked: Vec<Looked> = self.motions.iter().map(Motion::looked).collect();
        self.draws = draws(person, trials, &looked, &known(&self.table), &|share| {
            progress.stage("joint centres' uncertainty", share);
        })?;
        Ok(())
    }

    /// Returns what some motions say together, with the table in the estimate.
    ///
    /// # Errors
    /// [`StudyError::Pool`] if there are none.
    pub fn together(&self, motions: &[usize]) -> Result<Fit, StudyError> {
        let chosen = motions.iter().filter_map(|k| self.motions.get(*k));
        Self::merged(chosen.map(Motion::factor).collect(), &self.table)
    }

    /// Returns the same of other factors of these motions: each with its motion's number.
    ///
    /// # Errors
    /// [`StudyError::Pool`] if there are none.
    pub fn together_by(&self, factors: Vec<(usize, Factor)>) -> Result<Fit, StudyError> {
        let own =
            |(k, factor): (usize, Factor)| Some(PooledFactor { factor, ..self.motions.get(k)?.factor() });
        Self::merged(factors.into_iter().filter_map(own).collect(), &self.table)
    }

    fn merged(factors: Vec<PooledFactor>, table: &Gaussian) -> Result<Fit, StudyError> {
        let mut fit = nothing_stated(PooledFactor::merged(factors, false)?.fit());
        apply_distribution(&mut fit, table);
        Ok(fit)
    }

    /// Returns the whole mass by plates and table, kg, whatever scales say; `None` if that is not told.
    ///
    /// # Errors
    /// [`StudyError::Pool`] if there are no motions.
    pub fn mass_by_plates(&self) -> Result<Option<Measured>, StudyError> {
        let fit = Self::merged(self.motions.iter().map(Motion::factor).collect(), &self.open)?;
        Ok(self.with_calibration(fit).estimate.measured(0))
    }

    /// Returns a fit with what joint centres and marker places leave open in its covariance. Its values are those that predict best with
    /// the joints as they were found.
    #[must_use]
    pub fn with_calibration(&self, mut fit: Fit) -> Fit {
        let square = &self.draws * self.draws.transpose();
        fit.estimate.covariance += &square;
        if let Some(prior) = &mut fit.prior {
            prior.data_alone.covariance += &square;
        }
        fit.added.push(("joint centres".to_owned(), square));
        fit
    }

    /// Returns the base parameters.
    pub fn base(&self) -> &BaseParameters {
        self.motions[0].source.base()
    }

    /// Returns the physically consistent segments nearest to the table of a person that a fit leaves.
    ///
    /// # Errors
    /// [`StudyError::Model`] if the table has none.
    pub fn segments(&self, person: &Person, fit: &Fit) -> Result<Full, StudyError> {
        let found = BaseEstimate::of(fit, self.base()).evenly_widened(fit);
        Ok(nearest(&person.subject.model, &found, self.options.trust, self.options.symmetric)?)
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        self.motions.first().map_or(0, |m| m.source.parameters().len())
    }
}

/// Returns the table as rows.
pub fn known(table: &Gaussian) -> Factor {
    let whitening = table.whitening();
    let right = &whitening * table.mean();
    let rows: Vec<Vec<f64>> = whitening.row_iter().map(|row| row.iter().copied().collect()).collect();
    let mut factor = Factor::new(table.names().len());
    factor.absorb(rows.iter().map(Vec::as_slice).zip(right.iter().copied()));
    factor
}

/// Parts of a trial, as equal as can be; its frames are moved into them.
fn in_parts(mut whole: Input, parts: usize) -> Vec<Input> {
    let length = whole.frames.len().div_ceil(parts);
    let mut rest = std::mem::take(&mut whole.frames);
    let mut all = Vec::new();
    while !rest.is_empty() {
        let next = rest.split_off(length.min(rest.len()));
        all.push(whole.with_frames(rest));
        rest = next;
    }
    all
}

/// The table of a person whose mass is known, kg with 1 σ: that is its first parameter.
fn with_mass(table: &Gaussian, [kg, sigma]: [f64; 2]) -> Gaussian {
    let column = table.covariance().column(0).into_owned();
    let variance = column[0] + sigma * sigma;
    let mean = table.mean() + &column * ((kg - table.mean()[0]) / variance);
    let covariance = table.covariance() - &column * column.transpose() / variance;
    Gaussian::new(table.names().to_vec(), mean, covariance).unwrap_or_else(|| table.clone())
}

fn table(person: &Person, base: &BaseParameters, spread: &Spread) -> Result<Gaussian, StudyError> {
    distribution(&person.subject.model, base, spread).ok_or_else(|| {
        StudyError::Model(ModelError::Structure {
            what: person.subject.model.name.clone(),
            problem: "a segment has no body in the table".to_owned(),
        })
    })
}
