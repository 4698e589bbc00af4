//! Experiments with a tree of links: its joints and its base swing, an IMU on every link, the wrench on the
//! base; or an arm on a base held still, with the torques of its joints.

use std::sync::atomic::AtomicBool;

use rigident_shared::tree::Joint;

use super::repeat::repeat;
use super::tree_bound::bound;
use super::tree_experiment::TreeExperiment;
use super::{CampaignError, Judgement, MOST_READINGS, One};
use rigident_fit::{FitOptions, Silent};
use rigident_identify::problem::{Problem, ProblemError, ProblemOptions};
use rigident_io::recording::Recording;
use rigident_laboratory::trees::{truth, with_noise_and_offset};
use rigident_model::Model;
use rigident_model::base::{Rows, Situation, base_parameters};

/// Spread of the load cell's offsets, which each experiment draws, N and N m.
const OFFSETS: [f64; 6] = [2.0, 2.0, 2.0, 0.2, 0.2, 0.2];

/// A tree's experiment that is repeated.
#[derive(Clone, Debug)]
pub struct TreeCampaign {
    model: Model,
    experiment: TreeExperiment,
    recording: Recording,
    /// Base parameters of the nominal bodies.
    truth: Vec<f64>,
    /// The Cramér–Rao bound, 1 σ: base parameters, then offsets.
    crb_std: Vec<f64>,
}

/// A parameter over all experiments.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeJudgement {
    /// The name of the parameter.
    pub name: String,
    /// The unit of the parameter.
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

/// The result of one experiment: names and units, and each parameter's error with its σ if it was identified.
struct Outcome {
    names: Vec<(String, String)>,
    found: Vec<Option<One>>,
}

impl TreeCampaign {
    /// Simulates the motion of a tree and computes the bound.
    ///
    /// # Errors
    /// [`CampaignError`] if a joint cannot be simulated, a link has no body, there are too many readings, or
    /// the motion leaves a parameter undetermined.
    pub fn new(model: &Model, experiment: TreeExperiment) -> Result<Self, CampaignError> {
        let TreeExperiment { rate_hz, duration_s, has_torques, .. } = experiment;
        if rate_hz * duration_s > MOST_READINGS {
            return Err(CampaignError::TooMany { rate_hz, duration_s });
        }
        let model = model.welded();
        for (i, link) in model.links.iter().enumerate() {
            let is_known = match link.link.joint {
                Joint::Revolute(_) => true,
                Joint::Spherical => !has_torques,
                _ => false,
            };
            if i > 0 && !is_known {
                return Err(CampaignError::Joint(link.joint_name.clone()));
            }
            if link.nominal.is_none() {
                return Err(CampaignError::NoBody(link.name.clone()));
            }
        }
        let recording = experiment.recording(&model);
        let rows = if has_torques { Rows::Joint } else { Rows::Base };
        let situation = Situation { floating: !has_torques, rows, mimic: false };
        let base = base_parameters(&model, &situation).map_err(|_| CampaignError::Undetermined)?;
        let crb_std = bound(&model, &base, &experiment).ok_or(CampaignError::Undetermined)?;
        Ok(Self { truth: truth(&model, &base), model, experiment, recording, crb_std })
    }

    /// Runs `runs` experiments on every core. Their seeds follow from `seed` alone, and so do the figures,
    /// whatever the number of cores. `done` receives how many are done; `stop` ends early with what there is.
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
            with_noise_and_offset(&self.recording, &self.experiment.noise, OFFSETS, seed);
        let problem = Problem::from_recording(&recording, Some(&self.model), &ProblemOptions::default())?;
        let found = problem.fit(&FitOptions::default(), &Silent)?;
        let truth = self.truth.iter().copied().chain(offset);
        let one = |(j, truth): (usize, f64)| {
            let measured = found.estimate.measured(j)?;
            let sd = found.estimate.covariance(j, j)?.sqrt();
            Some(One { error: measured.value - truth, sd, coverage_factor: measured.u95 / sd })
        };
        Ok(Outcome {
            names: found.parameters.iter().map(|p| (p.name.clone(), p.unit.clone())).collect(),
            found: truth.enumerate().map(one).collect(),
        })
    }
}
