//! One run through the program, and what many runs say.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rigident::answer::{Answer, Context, Status};
use rigident::fit::{Fit, FitOptions, Silent, parallel};
use rigident::problem::{Problem, ProblemOptions};
use rigident::rig::RigFile;

use super::mechanics::{Body, Motion, Quantities};
use super::recording::Rig;

/// Quantities of the body.
pub const COUNT: usize = 13;
/// The quantities m, mc and the tensor about the centre of mass, whose coverage is examined.
pub const MASS: std::ops::Range<usize> = 0..1;
pub const MOMENT: std::ops::Range<usize> = 1..4;
pub const CENTRE: std::ops::Range<usize> = 4..7;
pub const TENSOR: std::ops::Range<usize> = 7..13;
/// A nuisance parameter this many standard deviations off is named.
const NAMED: f64 = 4.0;

/// The result of one run.
#[derive(Clone, Debug)]
pub struct Run {
    /// Error of each quantity.
    pub error: Quantities,
    /// Expanded uncertainty of each quantity.
    pub u95: Quantities,
    /// The group of the nuisance parameter that is the most standard deviations from nothing, if it is named.
    pub named: Option<String>,
    /// Name and value of all nuisance parameters.
    pub values: Vec<(String, f64)>,
    /// χ² of the residuals per degree of freedom.
    pub residual: f64,
    pub status: Status,
    /// The warnings of the program.
    pub warnings: Vec<String>,
}

/// Returns the quantities of the ten parameters.
fn quantities(phi: &[f64]) -> Quantities {
    let (m, moment) = (phi[0], Vector3::new(phi[1], phi[2], phi[3]));
    let c = moment / m;
    let i = Matrix3::new(phi[4], phi[9], phi[8], phi[9], phi[5], phi[7], phi[8], phi[7], phi[6])
        - (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * m;
    Body { mass: m, com: c, inertia: i }.quantities()
}

/// Identifies what a rig recorded; `None` if there is no estimate of all ten parameters.
pub fn run(rig: &Rig, motion: &Motion, file: &RigFile, seed: u64) -> Option<Run> {
    let recording = rig.record(motion, file, seed);
    let problem = Problem::from_recording(&recording, None, &ProblemOptions::default()).ok()?;
    let fit = problem.fit(&FitOptions::default(), &Silent).ok()?;
    let context = Context { rate_sigma: problem.source().rate_sigma(), ..Context::default() };
    let answer = Answer::new(&fit, context).ok()?;
    let (value, u95) = found(&fit)?;
    let truth = rig.body.quantities();
    let most = fit.nuisances.iter().max_by(|a, b| a.pull().abs().total_cmp(&b.pull().abs()));
    Some(Run {
        error: std::array::from_fn(|k| value[k] - truth[k]),
        u95,
        named: most.filter(|k| k.pull().abs() > NAMED).map(|k| k.nuisance.group.clone()),
        values: fit.nuisances.iter().map(|k| (k.nuisance.name.clone(), k.value)).collect(),
        residual: fit.noise.variance_ratio,
        status: answer.status,
        warnings: answer.warnings,
    })
}

/// Returns the quantities of a fit and their expanded uncertainties to first order.
fn found(fit: &Fit) -> Option<(Quantities, Quantities)> {
    let estimate = &fit.estimate;
    let phi: Vec<f64> = (0..10).map(|j| estimate.measured(j).map(|m| m.value)).collect::<Option<_>>()?;
    let covariance = DMatrix::from_fn(10, 10, |i, j| estimate.covariance(i, j).unwrap_or(f64::INFINITY));
    let value = quantities(&phi);
    let slopes: Vec<Quantities> = (0..10)
        .map(|j| {
            let step = 1e-4 * covariance[(j, j)].sqrt();
            let at = |by: f64| {
                let mut moved = phi.clone();
                moved[j] += by;
                quantities(&moved)
            };
            let (less, more) = (at(-step), at(step));
            std::array::from_fn(|k| (more[k] - less[k]) / (2.0 * step))
        })
        .collect();
    let slopes = DMatrix::from_fn(COUNT, 10, |k, j| slopes[j][k]);
    let all = &slopes * covariance * slopes.transpose();
    Some((value, std::array::from_fn(|k| estimate.coverage_factor() * all[(k, k)].sqrt())))
}

/// Makes runs, with progress on standard error.
pub fn runs(name: &str, count: u64, job: impl Fn(u64) -> Option<Run> + Sync) -> Runs {
    let begun = std::time::Instant::now();
    let done = parallel::map(parallel::threads(), count as usize, |k| job(k as u64));
    let runs = Runs { asked: count, runs: done.into_iter().flatten().collect() };
    let coverage =
        [MASS, MOMENT, TENSOR].map(|group| format!("{:.0}/{:.0}", runs.mean(&group), runs.worst(&group)));
    eprintln!(
        "  {name}: {count} runs, {:.1} s, coverage {}",
        begun.elapsed().as_secs_f64(),
        coverage.join(" ")
    );
    runs
}

/// Many runs of one case.
#[derive(Clone, Debug)]
pub struct Runs {
    asked: u64,
    pub runs: Vec<Run>,
}

impl Runs {
    /// Returns the share of the runs, %, for which something holds; those without an estimate count as none.
    pub fn share(&self, holds: impl Fn(&Run) -> bool) -> f64 {
        100.0 * self.runs.iter().filter(|run| holds(run)).count() as f64 / self.asked.max(1) as f64
    }

    fn coverage(&self, k: usize) -> f64 {
        self.share(|run| run.error[k].abs() <= run.u95[k]) * self.asked as f64 / self.runs.len().max(1) as f64
    }

    /// Returns the mean coverage of a group, %.
    pub fn mean(&self, group: &std::ops::Range<usize>) -> f64 {
        group.clone().map(|k| self.coverage(k)).sum::<f64>() / group.len().max(1) as f64
    }

    /// Returns the least coverage in a group, %.
    pub fn worst(&self, group: &std::ops::Range<usize>) -> f64 {
        group.clone().map(|k| self.coverage(k)).fold(f64::INFINITY, f64::min)
    }

    /// Returns the largest coverage in a group, %.
    pub fn best(&self, group: &std::ops::Range<usize>) -> f64 {
        group.clone().map(|k| self.coverage(k)).fold(0.0, f64::max)
    }

    /// Returns the median of a number of every run.
    pub fn median(&self, of: impl Fn(&Run) -> f64) -> f64 {
        median(self.runs.iter().map(of).collect())
    }
}

/// Returns the median; NaN of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns the largest error in units of its uncertainty, of m, mc and the tensor.
pub fn largest(run: &Run) -> f64 {
    let all = MASS.chain(MOMENT).chain(TENSOR);
    all.map(|k| run.error[k].abs() / run.u95[k]).fold(0.0, f64::max)
}
