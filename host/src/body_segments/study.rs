//! Motions of a person, each with its rows and factor, and what they say together.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::DMatrix;

use super::calibration::{DrawError, draws};
use crate::answer::checks;
use crate::answer::standard_parameters::{BaseEstimate, Full, nearest};
use crate::fit::pool::{PoolError, PooledFactor};
use crate::fit::prior::apply_distribution;
use crate::fit::{
    Channel, Checks, Factor, Fit, FitError, FitOptions, Gaussian, Measured, Progress, RowSource, Silent, fit,
    parallel,
};
use crate::model::base::{BaseParameters, Situation};
use crate::model::{Model, ModelError};
use crate::motion_capture::trial::Trial;
use crate::motion_selection::SelectionError;
use crate::problem::person::anthropometry::{Spread, distribution};
use crate::problem::person::noise::{RowSums, sigma};
use crate::problem::person::{Person, PersonError};
use crate::problem::tree::{TreeSource, TreeSourceError};

/// Fewest frames that a motion has.
const FEWEST_FRAMES: usize = 15;
/// Most frames of a motion: longer trials are more motions.
const MOST_FRAMES: usize = 10_000;

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
    /// Its frames among those of the trial that rows are made of.
    pub frames: Range<usize>,
    /// 1 σ of every channel, per unfiltered sample.
    pub sigma: Vec<f64>,
    /// Samples that a row stands for.
    pub every: u16,
    /// Its factor, with what its checks found. That residuals of people who are not rigid are as slow as their motion is counted in the
    /// intervals, and no warning.
    pub pooled: PooledFactor,
}

impl Motion {
    /// Returns its rows.
    ///
    /// # Errors
    /// [`StudyError::Source`] if the person has other frames.
    pub fn source(&self, person: &Person) -> Result<TreeSource, StudyError> {
        Ok(source(person, self.trial, &self.frames)?.with_channel_sigma(self.sigma.clone()))
    }

    fn of(part: &Part, sigma: &[f64], fit: &Fit) -> Self {
        let found = Checks { warnings: Vec::new(), ..checks(fit, &[], true) };
        Self {
            name: part.name.clone(),
            trial: part.trial,
            frames: part.frames.clone(),
            sigma: sigma.to_vec(),
            every: fit.filter.every,
            pooled: PooledFactor::of(fit, &part.name).checked(&found),
        }
    }
}

/// Frames that become a motion.
struct Part {
    name: String,
    trial: usize,
    frames: Range<usize>,
}

/// Parts of some of a person's trials, and why trials have none; a single trial is cut into `asked` parts, a long one into more.
fn parts(person: &Person, which: &[usize], asked: usize) -> (Vec<Part>, Vec<String>) {
    let (mut parts, mut left) = (Vec::new(), Vec::new());
    for (trial, tracked) in which.iter().filter_map(|k| Some((*k, person.trials.get(*k)?))) {
        let frames = tracked.frames.len();
        if frames < FEWEST_FRAMES {
            left.push(tracked.why_unused());
            continue;
        }
        let asked = if which.len() == 1 { asked } else { 1 };
        let count = asked.max(frames.div_ceil(MOST_FRAMES)).min(frames / FEWEST_FRAMES).max(1);
        let length = frames.div_ceil(count);
        for (part, first) in (0..frames).step_by(length).enumerate() {
            let own = if count == 1 { String::new() } else { format!(", part {}", part + 1) };
            let name = tracked.name.clone() + &own;
            parts.push(Part { name, trial, frames: first..frames.min(first + length) });
        }
    }
    (parts, left)
}

/// 1 σ of the channels of every part, by what the table and all parts leave.
fn noise(
    person: &Person,
    parts: &[Part],
    table: &Gaussian,
    progress: &(dyn Fn() + Sync),
) -> Result<Vec<Vec<f64>>, StudyError> {
    let sums = parallel::map(parallel::threads(), parts.len(), |k| -> Result<RowSums, StudyError> {
        progress();
        let report = &person.trials[parts[k].trial].report;
        let source = source(person, parts[k].trial, &parts[k].frames)?;
        Ok(RowSums::of(&source, report.rate_hz, report.cut_off_hz)?)
    });
    let sums: Vec<RowSums> = sums.into_iter().collect::<Result<_, _>>()?;
    sigma(&sums, table).ok_or_else(|| {
        StudyError::NoFrames("the rows that are left are too short for their filter".to_owned())
    })
}

/// The rows of some frames of a trial, their noise not known.
fn source(person: &Person, trial: usize, frames: &Range<usize>) -> Result<TreeSource, StudyError> {
    let input = person.input(trial, frames.clone());
    let input = input.ok_or_else(|| StudyError::NoFrames(format!("trial {} is not there", trial + 1)))?;
    Ok(TreeSource::new(input)?)
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
    base: BaseParameters,
    /// The model that the rows are of, without fixed joints.
    pub model: Model,
    /// What is measured of it.
    pub situation: Situation,
    /// The same by channels.
    pub channels: Vec<Channel>,
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
        progress: &(dyn Progress + Sync),
    ) -> Result<Self, StudyError> {
        let (parts, mut left) = parts(person, which, options.parts);
        let Some(Part { trial, frames, .. }) = parts.first() else {
            return Err(StudyError::NoFrames(left.join("; ")));
        };
        let first = source(person, *trial, &(frames.start..frames.start + FEWEST_FRAMES))?;
        let open = table(person, first.base(), &options.spread)?;
        let done = AtomicUsize::new(0);
        let one = || {
            let done = done.fetch_add(1, Ordering::Relaxed);
            progress.stage("motions", done as f64 / (2 * parts.len()) as f64);
        };
        let sigma = noise(person, &parts, &open, &one)?;
        let found = parallel::map(parallel::threads(), parts.len(), |k| -> Result<_, StudyError> {
            one();
            let own = source(person, parts[k].trial, &parts[k].frames)?.with_channel_sigma(sigma[k].clone());
            match fit(&own, fit_options, &Silent) {
                Ok(fit) => Ok(Ok(Motion::of(&parts[k], &sigma[k], &nothing_stated(fit)))),
                Err(error @ FitError::NoRows { .. }) => Ok(Err(format!("{}: {error}", parts[k].name))),
                Err(error) => Err(error.into()),
            }
        });
        let mut motions = Vec::new();
        for found in found {
            match found? {
                Ok(motion) => motions.push(motion),
                Err(why) => left.push(why),
            }
        }
        if motions.is_empty() {
            return Err(StudyError::NoFrames(left.join("; ")));
        }
        Ok(Self {
            motions,
            table: options.mass_kg.map_or_else(|| open.clone(), |mass| with_mass(&open, mass)),
            draws: DMatrix::zeros(open.names().len(), 0),
            open,
            options: *options,
            left,
            base: first.base().clone(),
            model: first.input().model.clone(),
            situation: first.input().situation,
            channels: first.channels().to_vec(),
        })
    }

    /// Finds how joint centres and marker places move the parameters; `trials` are those that the person was made of.
    ///
    /// # Errors
    /// [`StudyError::Draws`] if a person with other joints has no rows.
    pub fn draw(
        &mut self,
        person: &Person,
        trials: &[Trial],
        progress: &(dyn Progress + Sync),
    ) -> Result<(), StudyError> {
        self.draws = draws(person, trials, &self.motions, &known(&self.table), &|share| {
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
        Self::merged(chosen.map(|motion| motion.pooled.clone()).collect(), &self.table)
    }

    /// Returns the same of other factors of these motions: each with its motion's number.
    ///
    /// # Errors
    /// [`StudyError::Pool`] if there are none.
    pub fn together_by(&self, factors: Vec<(usize, Factor)>) -> Result<Fit, StudyError> {
        let own = |(k, factor): (usize, Factor)| {
            Some(PooledFactor { factor, ..self.motions.get(k)?.pooled.clone() })
        };
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
        let all = self.motions.iter().map(|motion| motion.pooled.clone());
        let fit = Self::merged(all.collect(), &self.open)?;
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
        &self.base
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
        self.table.names().len()
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
