//! Series for the plots of a page, beside the answer. Times in seconds on one axis for all plots.

use super::data::{Along, Convergence, Decided, Residual, Stage, TimePlot};
use rigident_fit::{Convergence as Point, Fit};
use rigident_identify::answer::Answer;

/// Everything over time that a page shows, and what else is no result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// The unit of all times below: seconds, or poses numbered from one.
    pub along: Along,
    /// Stages of the experiment in order of time.
    pub stages: Vec<Stage>,
    /// Estimates on their way, in any order.
    pub convergence: Vec<Convergence>,
    /// Time at which something changed.
    pub change_s: Option<f64>,
    /// Filtered residuals, one a channel.
    pub residuals: Vec<Residual>,
    /// Angular rate, specific force, pose and the like.
    pub motion: Vec<TimePlot>,
    /// Segments that were decided on while the experiment lasted, in order.
    pub decisions: Vec<Decided>,
    /// Rejected samples by the signal that was the reason.
    pub rejected: Vec<(String, u64)>,
    /// Label and value: firmware's hash, serial numbers, calibration dates.
    pub provenance: Vec<(String, String)>,
}

impl Series {
    /// Returns convergence and residuals of a fit whose answer is `answer`; times count from `origin_s`.
    ///
    /// A parameter that is not identified in the end has no convergence either.
    pub fn new(fit: &Fit, answer: &Answer, is_static: bool, origin_s: f64) -> Self {
        let time = |k: usize, time_s: f64| if is_static { k as f64 + 1.0 } else { time_s - origin_s };
        let identified = |j: &usize| answer.parameters.get(*j).is_some_and(|p| p.state.measured().is_some());
        let history = |j: usize| {
            let at = |point: &Point| point.parameters.get(j).copied().flatten();
            Convergence {
                name: answer.parameters[j].name.clone(),
                time_s: fit.convergence.iter().enumerate().map(|(k, p)| time(k, p.time_s)).collect(),
                estimate: fit.convergence.iter().map(|p| at(p).map_or(f64::NAN, |m| m.value)).collect(),
                u95: fit.convergence.iter().map(|p| at(p).map_or(f64::INFINITY, |m| m.u95)).collect(),
            }
        };
        let residual = |c: usize| Residual {
            channel: fit.channels[c].channel.name.clone(),
            unit: fit.channels[c].channel.unit.clone(),
            time_s: fit.residuals.iter().enumerate().map(|(k, r)| time(k, r.time_s)).collect(),
            values: fit.residuals.iter().map(|r| r.values.get(c).copied().unwrap_or(f64::NAN)).collect(),
            sigma: fit.channels[c].residual_sigma,
        };
        let has_history = !fit.convergence.is_empty();
        let has_residuals = !fit.residuals.is_empty();
        let rejected = fit.channels.iter().filter(|c| c.rejected > 0);
        Self {
            along: if is_static { Along::Poses } else { Along::Time },
            convergence: (0..answer.parameters.len())
                .filter(|_| has_history)
                .filter(identified)
                .map(history)
                .collect(),
            residuals: (0..fit.channels.len()).filter(|_| has_residuals).map(residual).collect(),
            change_s: fit.lack_of_fit.change.as_ref().map(|change| change.time_s - origin_s),
            rejected: rejected.map(|c| (c.channel.name.clone(), u64::from(c.rejected))).collect(),
            ..Self::default()
        }
    }
}
