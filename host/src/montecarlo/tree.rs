//! Experiments with a tree of links: its joints and its base swing, an IMU on every link, the wrench on the base.

use std::sync::atomic::AtomicBool;

use nalgebra::{Cholesky, DMatrix, DVector};
use rigident_shared::tree::Joint;

use super::repeat::repeat;
use super::{CampaignError, Judgement, MOST_READINGS, One};
use crate::fit::{FitOptions, Silent};
use crate::model::Model;
use crate::model::base::{BaseParameters, Rows, Situation, base_parameters};
use crate::problem::{Problem, ProblemError, ProblemOptions};
use crate::recording::Recording;
use crate::rig::ImuTable;
use crate::simulated::trees::{TreeInstant, person_recording, truth, with_noise_and_offset};

/// Noise of the load cell, 1 σ per reading, N and N m.
const WRENCH_NOISE: [f64; 6] = [0.5, 0.5, 0.5, 0.03, 0.03, 0.03];
/// Noise of the gyros, 1 σ per reading, rad/s.
const GYRO_NOISE: f64 = 1e-4;
/// Spread of the load cell's offsets, which each experiment draws, N and N m.
const OFFSETS: [f64; 6] = [2.0, 2.0, 2.0, 0.2, 0.2, 0.2];

/// A tree's experiment that is repeated.
#[derive(Clone, Debug)]
pub struct TreeCampaign {
    model: Model,
    recording: Recording,
    /// Base parameters of the nominal bodies.
    truth: Vec<f64>,
    /// The Cramér–Rao bound, 1 σ: base parameters, then offsets.
    crb_std: Vec<f64>,
}

/// A parameter over all experiments.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeJudgement {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Bias, spread, bound and coverage.
    pub judgement: Judgement,
}

/// The figures of a tree's experiments.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeVerdict {
    /// Experiments done.
    pub runs: u64,
    /// Parameters that every experiment identified.
    pub parameters: Vec<TreeJudgement>,
    /// Names of those that were not identified in every one.
    pub not_identified: Vec<String>,
}

/// What one experiment found: names and units, and each parameter's error with its σ if it was identified.
struct Outcome {
    names: Vec<(String, String)>,
    found: Vec<Option<One>>,
}

impl TreeCampaign {
    /// Simulates the motion of a tree and computes the bound.
    ///
    /// # Errors
    /// [`CampaignError`] if a joint cannot be simulated, a link has no body, there are too many readings, or the motion
    /// leaves a parameter undetermined.
    pub fn new(model: &Model, rate_hz: f64, duration_s: f64) -> Result<Self, CampaignError> {
        if rate_hz * duration_s > MOST_READINGS {
            return Err(CampaignError::TooMany { rate_hz, duration_s });
        }
        let model = model.welded();
        for (i, link) in model.links.iter().enumerate() {
            if i > 0 && !matches!(link.link.joint, Joint::Revolute(_) | Joint::Spherical) {
                return Err(CampaignError::Joint(link.joint_name.clone()));
            }
            if link.nominal.is_none() {
                return Err(CampaignError::NoBody(link.name.clone()));
            }
        }
        let mut recording = person_recording(&model, rate_hz, duration_s);
        recording.name.clone_from(&model.name);
        recording.rig.load_cell.noise_n_nm = Some(WRENCH_NOISE);
        let imu = |link| ImuTable { link, gyro_noise_radps: Some(GYRO_NOISE), ..ImuTable::default() };
        recording.rig.imu = (0..model.links.len()).map(imu).collect();
        let situation = Situation { floating: true, rows: Rows::Base, mimic: false };
        let base = base_parameters(&model, &situation).map_err(|_| CampaignError::Undetermined)?;
        let crb_std = bound(&model, &base, &recording).ok_or(CampaignError::Undetermined)?;
        Ok(Self { truth: truth(&model, &base), model, recording, crb_std })
    }

    /// Runs `runs` experiments on every core. Their seeds follow from `seed` alone, and so do the figures, whatever the
    /// number of cores. `done` is told how many are done; `stop` ends early with what there is.
    ///
    /// # Errors
    /// [`CampaignError`] if an experiment cannot be identified, or there are fewer than two of them.
    pub fn run(
        &self,
        runs: u64,
        seed: u64,
        stop: &AtomicBool,
        mut done: impl FnMut(u64),
    ) -> Result<TreeVerdict, CampaignError> {
        let outcomes = repeat(runs, seed, stop, &mut done, |seed| self.experiment(seed))
            .map_err(|(seed, error)| CampaignError::Tree { seed, error: Box::new(error) })?;
        let runs = outcomes.len() as u64;
        let Some(first) = outcomes.first().filter(|_| runs > 1) else {
            return Err(CampaignError::TooFew(runs));
        };
        let (mut parameters, mut not_identified) = (Vec::new(), Vec::new());
        for (j, (name, unit)) in first.names.iter().enumerate() {
            let found: Option<Vec<One>> =
                outcomes.iter().map(|o| o.found.get(j).copied().flatten()).collect();
            let Some(found) = found else {
                not_identified.push(name.clone());
                continue;
            };
            let truth = self.truth.get(j).copied().unwrap_or(0.0);
            let crb_std = self.crb_std.get(j).copied().unwrap_or(0.0);
            let judgement = Judgement::of(truth, crb_std, found.into_iter());
            parameters.push(TreeJudgement { name: name.clone(), unit: unit.clone(), judgement });
        }
        Ok(TreeVerdict { runs, parameters, not_identified })
    }

    fn experiment(&self, seed: u64) -> Result<Outcome, ProblemError> {
        let (recording, offset) =
            with_noise_and_offset(&self.recording, WRENCH_NOISE, GYRO_NOISE, OFFSETS, seed);
        let problem = Problem::from_recording(&recording, Some(&self.model), &ProblemOptions::default())?;
        let found = problem.fit(&FitOptions::default(), &Silent)?;
        let truth = self.truth.iter().copied().chain(offset);
        let one = |(j, truth): (usize, f64)| {
            let measured = found.estimate.measured(j)?;
            let coverage_factor = found.estimate.coverage_factor();
            let sd = measured.u95 / coverage_factor;
            Some(One { error: measured.value - truth, sd, coverage_factor })
        };
        Ok(Outcome {
            names: found.parameters.iter().map(|p| (p.name.clone(), p.unit.clone())).collect(),
            found: truth.enumerate().map(one).collect(),
        })
    }
}

/// Returns the Cramér–Rao bound of base parameters and offsets, 1 σ; `None` if the motion leaves something undetermined.
///
/// `J⁻¹` with `J = Σ aᵀa/σ²`: every sample of the load cell with its white noise, the motion known exactly. A wrench is
/// linear in the standard parameters, `w = Y φ`, the columns of Y being wrenches of unit bodies by Newton and Euler. With
/// `β = M φ` and `M_L` the columns of M of those that stand for β, `w = Y_L M_L⁻¹ β`.
fn bound(model: &Model, base: &BaseParameters, recording: &Recording) -> Option<Vec<f64>> {
    let map = base.map();
    let skip = 10 * model.links.len() - base.standard.len();
    let leads: Vec<usize> = base.parameters.iter().filter_map(|p| Some(p.terms.first()?.0)).collect();
    let count = leads.len();
    let mix = map.select_columns(&leads).try_inverse()?;
    // Mechanics by centre of mass and tensor about it know no massless body: what a parameter adds to a kilogram.
    let bodies = |lead: &usize| {
        let (own, mass) = (skip + lead, (skip + lead) / 10 * 10);
        (unit_body(model, own), (own != mass).then(|| unit_body(model, mass)))
    };
    let units: Vec<(Model, Option<Model>)> = leads.iter().map(bodies).collect();
    let mut information = DMatrix::<f64>::zeros(count + 6, count + 6);
    for time_ns in &recording.time_ns {
        let now = TreeInstant::new(model, *time_ns as f64 * 1e-9);
        let column = |(own, mass): &(Model, Option<Model>)| {
            let own = now.wrench(own)?;
            let mass = mass.as_ref().map_or(Some([0.0; 6]), |mass| now.wrench(mass))?;
            Some(std::array::from_fn(|c| own[c] - mass[c]))
        };
        let columns: Vec<[f64; 6]> = units.iter().map(column).collect::<Option<_>>()?;
        let own = DMatrix::from_fn(6, count, |c, j| columns[j][c]) * &mix;
        for (c, sigma) in WRENCH_NOISE.iter().enumerate() {
            let mut row = DVector::zeros(count + 6);
            row.rows_mut(0, count).copy_from(&own.row(c).transpose());
            row[count + c] = 1.0;
            information.ger(sigma.powi(-2), &row, &row, 1.0);
        }
    }
    // Units differ by orders of magnitude: a unit diagonal leaves the inverse its digits.
    let scale = information.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = DMatrix::from_fn(count + 6, count + 6, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = Cholesky::new(scaled)?.inverse();
    Some((0..count + 6).map(|j| inverse[(j, j)].sqrt() * scale[j]).collect())
}

/// Returns the same tree with a body of one link alone: of a kilogram, and with one standard parameter more if `parameter`
/// is not the link's mass.
fn unit_body(model: &Model, parameter: usize) -> Model {
    let mut unit = model.clone();
    for (i, link) in unit.links.iter_mut().enumerate() {
        let is_one = |k: usize| k == 0 || 10 * i + k == parameter;
        let own = || std::array::from_fn(|k| if is_one(k) { 1.0 } else { 0.0 });
        link.nominal = (i == parameter / 10).then(own);
    }
    unit
}
