//! Motions of a person, each with its rows and factor, and what they say together.

use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{DMatrix, DVector};

use super::calibration::{Drawn, draws, factor_as};
use super::error::StudyError;
use super::ground::{GroundErrors, KINDS, LEVELS, PlateScale};
use super::motion::{FEWEST_FRAMES, Motion, Part, Parts, parts, source};
use crate::person::Person;
use crate::person::anthropometry::{Spread, distribution, standard, with_whole_mass};
use crate::person::noise::{RowSums, sigma};
use rigident_fit::lack_of_fit::LackOfFit;
use rigident_fit::pool::PooledFactor;
use rigident_fit::prior::apply_distribution;
use rigident_fit::{
    COVERAGE_95, Channel, Factor, Fit, FitError, FitOptions, Gaussian, Measured, Progress, RowSource, Silent,
    fit, parallel,
};
use rigident_identify::answer::standard_beside::{Errors, beside};
use rigident_identify::answer::standard_parameters::{BaseEstimate, Full};
use rigident_io::motion_capture::trial::Trial;
use rigident_model::base::{BaseParameters, Situation};
use rigident_model::{Model, ModelError};

/// The request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudyOptions {
    /// The uncertainty of the table for one person.
    pub spread: Spread,
    /// Right segments mirror left ones.
    pub symmetric: bool,
    /// The way trials become motions.
    pub parts: Parts,
    /// The person's mass by scales, kg, with 1 σ; `None`: not known.
    pub mass_kg: Option<[f64; 2]>,
    /// The uncertainty of the plates' scales.
    pub plates: PlateScale,
}

impl Default for StudyOptions {
    fn default() -> Self {
        Self {
            spread: Spread::default(),
            symmetric: false,
            parts: Parts::Equal(4),
            mass_kg: None,
            plates: PlateScale::default(),
        }
    }
}

/// Returns 1 σ of the channels of every part, from the residuals of the table and of all parts.
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

/// Returns a fit whose σ are what residuals have beside the table: there is no stated noise to compare them
/// with. What is left moves as segments that are not rigid do, and tells of no change by itself: see
/// [`Study::other_masses`].
fn nothing_stated(mut fit: Fit) -> Fit {
    fit.noise.variance_ratio = 1.0;
    fit.lack_of_fit = LackOfFit::default();
    fit
}

/// Joint centres and marker places, by their name in the budget.
const JOINTS: &str = "joint centres";

/// A motion whose mass differs from that of all by more than this share, …
const OTHER_MASS: f64 = 0.01;
/// … and by this many times the U95 of the difference, is another body's.
const OTHER_MASS_U95: f64 = 2.0;

/// A whole mass.
struct Mass {
    kg: f64,
    /// Without errors of plates, kg².
    variance: f64,
    /// The addition of each error of a plate to it, 1 σ, kg.
    plates: Vec<f64>,
}

impl Mass {
    fn measured(&self) -> Measured {
        let variance = self.variance + self.plates.iter().map(|z| z * z).sum::<f64>();
        Measured { value: self.kg, u95: COVERAGE_95 * variance.sqrt() }
    }

    /// Returns the difference to another mass, which the same errors of plates affect.
    fn less(&self, other: &Self) -> Measured {
        let plates = self.plates.iter().zip(&other.plates).map(|(a, b)| a - b).collect();
        Self { kg: self.kg - other.kg, variance: self.variance + other.variance, plates }.measured()
    }
}

/// The segments of a person.
pub struct Segments {
    /// Their parameters.
    pub full: Full,
    /// The covariance of these, ten of every link of the person's model.
    pub covariance: DMatrix<f64>,
    /// The share of the variance of each link's mass, whichever table people are like, that the rows take: 0
    /// if they tell nothing of it, 1 if they tell all.
    pub informed: Vec<f64>,
}

/// All motions of a person.
pub struct Study {
    /// The motions.
    pub motions: Vec<Motion>,
    /// The table's values of the base parameters, and scales of the mass.
    pub table: Gaussian,
    /// The values of them by the table alone.
    open: Gaussian,
    /// Settings.
    pub options: StudyOptions,
    /// Trials without a usable frame, or too few, with the reason.
    pub left: Vec<String>,
    /// The effect of joint centres and marker places on the parameters, one column a draw; none before
    /// [`Study::draw`].
    pub draws: DMatrix<f64>,
    ground: GroundErrors,
    /// σ is this many times what rows and table leave, so that bodies explain them.
    pub(super) noise_by_bodies: f64,
    base: BaseParameters,
    /// The model that the rows are of, without fixed joints.
    pub model: Model,
    /// The measured quantities of it.
    pub situation: Situation,
    /// The measured quantities by channels.
    pub channels: Vec<Channel>,
}

impl Study {
    /// Returns the study of some of a person's trials, by their numbers, with the joint centres as they were
    /// found.
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
        Self::holding(person, which, options, fit_options, progress, None)
    }

    /// Returns the study of trials in which a link holds something that nothing is known of.
    ///
    /// # Errors
    /// [`StudyError`] if nothing can be used.
    pub fn holding(
        person: &Person,
        which: &[usize],
        options: &StudyOptions,
        fit_options: &FitOptions,
        progress: &(dyn Progress + Sync),
        link: Option<usize>,
    ) -> Result<Self, StudyError> {
        let (parts, mut left) = parts(person, which, options.parts)?;
        let Some(Part { trial, frames, .. }) = parts.first() else {
            return Err(StudyError::NoFrames(left.join("; ")));
        };
        let first = source(person, *trial, &(frames.start..frames.start + FEWEST_FRAMES))?;
        let mut options = *options;
        options.spread =
            options.spread.about(person.subject.person.sex, person.height_sigma, options.symmetric);
        let open = table(person, first.base(), &options.spread)?;
        let open = link.map_or_else(|| open.clone(), |link| with_something(&open, first.base(), link));
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
            ground: GroundErrors::default(),
            noise_by_bodies: 1.0,
            open,
            options,
            left,
            base: first.base().clone(),
            model: first.input().model.clone(),
            situation: first.input().situation,
            channels: first.channels().to_vec(),
        })
    }

    /// Finds how joint centres, marker places and errors of plates that are not known move the parameters,
    /// and widens the noise to what bodies explain; `trials` are those that the person was made of.
    ///
    /// # Errors
    /// [`StudyError`] if a person with other joints, or a motion, has no rows.
    pub fn draw(
        &mut self,
        person: &Person,
        trials: &[Trial],
        progress: &(dyn Progress + Sync),
    ) -> Result<(), StudyError> {
        let redraw = |study: &mut Self| -> Result<(), StudyError> {
            let beforehand = known(&study.table);
            let solved = |drawn: &Drawn| {
                let mut all = beforehand.clone();
                let rows = factor_as(drawn, person, trials, &study.motions)?;
                rows.iter().for_each(|rows| all.merge(rows));
                Ok(DVector::from_vec(all.solve(f64::EPSILON).estimate))
            };
            let shown = |share| progress.stage("joint centres' uncertainty", share);
            study.draws = draws(person, &shown, &solved)?;
            study.ground =
                GroundErrors::of(person, &study.motions, study.parameters(), study.options.plates)?;
            Ok(())
        };
        redraw(self)?;
        self.widen_to_bodies(redraw)
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
        let own =
            |(k, factor): (usize, Factor)| Some(self.motions.get(k)?.pooled.clone().with_factor(factor));
        Self::merged(factors.into_iter().filter_map(own).collect(), &self.table)
    }

    fn merged(factors: Vec<PooledFactor>, table: &Gaussian) -> Result<Fit, StudyError> {
        let mut fit = nothing_stated(PooledFactor::merged(factors, false)?.fit());
        apply_distribution(&mut fit, table);
        Ok(fit)
    }

    /// Returns the whole mass by plates and table, kg, whatever scales say; `None` if that is not determined.
    ///
    /// # Errors
    /// [`StudyError::Pool`] if there are no motions.
    pub fn mass_by_plates(&self) -> Result<Option<Measured>, StudyError> {
        let all: Vec<usize> = (0..self.motions.len()).collect();
        Ok(self.mass_of(&all)?.map(|mass| mass.measured()))
    }

    /// Returns the whole mass by some motions and the table; `None` if it is not determined.
    fn mass_of(&self, motions: &[usize]) -> Result<Option<Mass>, StudyError> {
        let factors = motions.iter().filter_map(|k| self.motions.get(*k)).map(|motion| motion.pooled.clone());
        let fit = Self::merged(factors.collect(), &self.open)?;
        let plates = self.ground.moved(&self.motions, motions, &known(&self.open));
        let Some(own) = fit.estimate.measured(0) else { return Ok(None) };
        let joints = self.draws.row(0).norm_squared();
        let variance = (own.u95 / COVERAGE_95).powi(2) + joints;
        Ok(Some(Mass { kg: own.value, variance, plates: plates.row(0).iter().copied().collect() }))
    }

    /// Returns motions whose whole mass, kg, is not that of all motions, by their numbers: something was
    /// carried, put down or leaned on.
    ///
    /// # Errors
    /// [`StudyError::Pool`] if there are no motions.
    pub fn other_masses(&self) -> Result<Vec<(usize, Measured)>, StudyError> {
        let every: Vec<usize> = (0..self.motions.len()).collect();
        let Some(all) = self.mass_of(&every)? else { return Ok(Vec::new()) };
        let is_other = |own: &Mass| {
            let off = (own.kg - all.kg).abs();
            // The same plates are in both.
            off > OTHER_MASS * all.kg && off > OTHER_MASS_U95 * own.less(&all).u95
        };
        let of = |k: usize| -> Result<_, StudyError> {
            Ok(self.mass_of(&[k])?.filter(is_other).map(|own| (k, own.measured())))
        };
        let found = parallel::map(parallel::threads(), self.motions.len(), of);
        found.into_iter().filter_map(Result::transpose).collect()
    }

    /// Returns pairs of trials, by their numbers, whose whole masses, kg, have intervals apart: not both can
    /// be right.
    ///
    /// # Errors
    /// [`StudyError::Pool`] if there are no motions.
    pub fn contradicting_trials(&self) -> Result<Vec<[(usize, Measured); 2]>, StudyError> {
        let mut trials: Vec<usize> = self.motions.iter().map(|motion| motion.trial).collect();
        trials.dedup();
        let mut masses = Vec::new();
        for trial in trials {
            let own = self.motions.iter().enumerate().filter(|(_, motion)| motion.trial == trial);
            let own: Vec<usize> = own.map(|(k, _)| k).collect();
            masses.extend(self.mass_of(&own)?.map(|mass| (trial, mass)));
        }
        let pairs =
            masses.iter().enumerate().flat_map(|(k, a)| masses.iter().skip(k + 1).map(move |b| [a, b]));
        let apart = pairs.filter(|[a, b]| apart(&a.1, &b.1));
        Ok(apart.map(|pair| pair.map(|(trial, mass)| (*trial, mass.measured()))).collect())
    }

    /// Returns how joint centres and marker places, then each kind of errors of plates, move what some
    /// motions and the table say, one column each, with their names in the budget.
    pub fn moved(&self, motions: &[usize]) -> Vec<(&'static str, DMatrix<f64>)> {
        let plates = self.ground.moved(&self.motions, motions, &known(&self.table));
        let kinds = KINDS.into_iter().enumerate().map(|(k, name)| (name, self.ground.of_kind(k, &plates)));
        std::iter::once((JOINTS, self.draws.clone())).chain(kinds).collect()
    }

    /// Returns the fit of some motions with what joint centres, marker places and errors of plates leave open
    /// in its covariance. Its values are those that predict best with joints as they were found and plates as
    /// the file has them.
    #[must_use]
    pub fn with_calibration(&self, mut fit: Fit, motions: &[usize]) -> Fit {
        let known = known(&self.table);
        for (name, moved) in self.moved(motions) {
            fit.count_shifts_beside(name, &moved, &known);
        }
        fit
    }

    /// Returns what errors of plates, 1 σ each, add to the normal equations of all motions, one column each,
    /// in the same order for all motions of a person.
    ///
    /// # Errors
    /// [`StudyError`] if a motion has no rows.
    pub(super) fn plates_scores(&self, person: &Person) -> Result<DMatrix<f64>, StudyError> {
        let errors = GroundErrors::of(person, &self.motions, self.parameters(), self.options.plates)?;
        Ok(errors.scores(&self.motions))
    }

    /// Returns what the table says of the base parameters, whatever scales say.
    pub(super) fn open(&self) -> &Gaussian {
        &self.open
    }

    /// Returns the base parameters.
    pub fn base(&self) -> &BaseParameters {
        &self.base
    }

    /// Returns the physically consistent segments of a person by the fit of some motions and by what is known
    /// of people. That joint centres and plates may be off is counted.
    ///
    /// # Errors
    /// [`StudyError::Model`] if the table has none.
    pub fn segments(&self, person: &Person, fit: &Fit, motions: &[usize]) -> Result<Segments, StudyError> {
        let (full, covariance) = self.beside(person, fit, motions, &self.options.spread)?;
        // Motions that tell which table fits tell of no segment by themselves.
        let one_table = Spread { tables: 0.0, ..self.options.spread };
        let (_, within) = self.beside(person, fit, motions, &one_table)?;
        let before = with_whole_mass(&self.known_of_segments(person, &one_table)?, 0.0);
        let share = |k: usize| (1.0 - within[(10 * k, 10 * k)] / before[(10 * k, 10 * k)]).clamp(0.0, 1.0);
        let informed = (0..person.subject.model.links.len()).map(share).collect();
        Ok(Segments { full, covariance, informed })
    }

    /// Returns the base parameters of these segments.
    ///
    /// # Errors
    /// [`StudyError::Model`] if the table has none.
    pub(super) fn base_of_segments(
        &self,
        person: &Person,
        fit: &Fit,
        motions: &[usize],
    ) -> Result<Vec<f64>, StudyError> {
        Ok(self.beside(person, fit, motions, &self.options.spread)?.0.base)
    }

    /// Returns the segments beside what is known with a spread, and their covariance.
    fn beside(
        &self,
        person: &Person,
        fit: &Fit,
        motions: &[usize],
        spread: &Spread,
    ) -> Result<(Full, DMatrix<f64>), StudyError> {
        let found = BaseEstimate::of(fit, self.base()).evenly_widened(fit);
        // A zero and a scale are the same in whatever these plates measure: no segment follows them, nor, of
        // a person whom no bodies explain, any error of joints and plates.
        let weighs = |name: &str| self.tells_segments() && !LEVELS.contains(&name);
        let (weighted, others): (Vec<_>, Vec<_>) =
            self.moved(motions).into_iter().partition(|(name, _)| weighs(name));
        let (drawn, exact): (Vec<_>, Vec<_>) = weighted.into_iter().partition(|(name, _)| *name == JOINTS);
        let columns = |all: &[(&str, DMatrix<f64>)]| {
            let columns: Vec<_> = all.iter().flat_map(|(_, moved)| moved.column_iter()).collect();
            if columns.is_empty() {
                DMatrix::zeros(self.parameters(), 0)
            } else {
                DMatrix::from_columns(&columns)
            }
        };
        let errors = Errors {
            moved: columns(&exact),
            drawn: columns(&drawn),
            beside: columns(&others),
            known: known(&self.table).r(),
        };
        let known = self.known_of_segments(person, spread)?;
        Ok(beside(&person.subject.model, &found, (&known, &errors), self.options.symmetric)?)
    }

    /// Returns the covariance of what is known of a person's segments beforehand, ten parameters of every
    /// link: of people like her, of her mass by scales.
    ///
    /// # Errors
    /// [`StudyError::Model`] if the table has none.
    pub(super) fn known_of_segments(
        &self,
        person: &Person,
        spread: &Spread,
    ) -> Result<DMatrix<f64>, StudyError> {
        let model = &person.subject.model;
        let known = standard(model, spread, &person.given).ok_or_else(|| no_table(person))?;
        Ok(match self.options.mass_kg {
            Some([_, sigma_kg]) => with_whole_mass(&known, sigma_kg),
            None => known,
        })
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        self.table.names().len()
    }
}

/// Returns whether two masses contradict each other: they differ by far more than the uncertainty of their
/// difference.
fn apart(a: &Mass, b: &Mass) -> bool {
    let off = (a.kg - b.kg).abs();
    // The same plates are in both.
    off > OTHER_MASS_U95 * a.less(b).u95 && off > OTHER_MASS * a.kg.max(b.kg)
}

/// Returns the table as rows.
pub fn known(table: &Gaussian) -> Factor {
    let n = table.names().len();
    let rows = table.rows(n, &(0..n).collect::<Vec<_>>());
    let mut factor = Factor::new(n);
    factor.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
    factor
}

/// Returns the table of a person whose mass, its first parameter, is known, kg with 1 σ.
fn with_mass(table: &Gaussian, [kg, sigma]: [f64; 2]) -> Gaussian {
    let column = table.covariance().column(0).into_owned();
    let variance = column[0] + sigma * sigma;
    let mean = table.mean() + &column * ((kg - table.mean()[0]) / variance);
    let covariance = table.covariance() - &column * column.transpose() / variance;
    Gaussian::new(table.names().to_vec(), mean, covariance).unwrap_or_else(|| table.clone())
}

/// 1 σ of the parameters of something that is held beforehand, kg, kg m, kg m²: as good as nothing is known
/// of it.
const HELD: [f64; 3] = [10.0, 3.0, 1.0];

/// Returns 1 σ of one of the ten parameters of something that is held, beforehand.
pub(super) fn held_sigma(parameter: usize) -> f64 {
    HELD[parameter.div_ceil(3).min(2)]
}

/// Returns the table of a person of whom a link holds something.
fn with_something(table: &Gaussian, base: &BaseParameters, link: usize) -> Gaussian {
    let own = DMatrix::from_fn(10, 10, |i, j| if i == j { held_sigma(i) } else { 0.0 });
    let weighed = base.map().columns(10 * link, 10) * own;
    let covariance = table.covariance() + &weighed * weighed.transpose();
    Gaussian::new(table.names().to_vec(), table.mean().clone(), covariance).unwrap_or_else(|| table.clone())
}

fn table(person: &Person, base: &BaseParameters, spread: &Spread) -> Result<Gaussian, StudyError> {
    distribution(&person.subject.model, base, spread, &person.given).ok_or_else(|| no_table(person))
}

fn no_table(person: &Person) -> StudyError {
    StudyError::Model(ModelError::Structure {
        what: person.subject.model.name.clone(),
        problem: "a segment has no body in the table".to_owned(),
    })
}
