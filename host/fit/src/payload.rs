//! The load of a link of a tree: its ten parameters from a run with it and runs without it.
//!
//! With K the weights of the ten parameters of the link in the base parameters φ, a run with the payload is
//! rows over `φ + K τ`, a run without it over φ. Both are merged and φ is eliminated (`difference`).
//!
//! Errors of the rig that are the same in all runs ([`super::Scope::Rig`]) do not average out but cancel: the
//! scale of a torque multiplies what the arm weighs in both. They are columns of both runs' rows
//! ([`super::RigRows`]), and one unknown each.

use nalgebra::{DMatrix, DVector};
use rigident_shared::inertia::PARAMETER_NAMES;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::difference::Beyond;
use super::own_errors::{OwnErrors, inertial};
use super::standard::weights;
use super::tare::{Tare, TareError};
use super::{Estimate, Factor, Fit, Kind, Owner, Parameter, RigRows};

/// Runs of an arm that differ by what is less likely than this differ by more than the payload.
const SURPRISING: f64 = 1e-4;

/// The place of a payload.
#[derive(Clone, Debug)]
pub struct Carrier {
    /// The link of the rows that carries it, links on fixed joints being one with what they hang on.
    pub link: String,
    /// The ten parameters about the payload's frame as ones about the link's: 10 × 10.
    pub to_link: DMatrix<f64>,
    /// Name of the payload's frame.
    pub frame: String,
}

impl Tare {
    /// Returns the fit of what a link carries in a run and not in the runs of this tare, which are of the
    /// same tree: one body of ten parameters about the carrier's frame. Friction and offsets are each run's
    /// own.
    ///
    /// # Errors
    /// [`TareError`]: the run is one of the tare's, is of another model, or its rows see nothing of that link.
    pub fn payload(&self, total: &Fit, carrier: &Carrier) -> Result<Fit, TareError> {
        self.refuse_repeated(total)?;
        let kept = inertial(total);
        let of_known = self.map_by_name(total)?.select_rows(&kept);
        let parts: Vec<[f64; 10]> =
            kept.iter().filter_map(|j| total.parameters.get(*j)).map(|p| weights(p, &carrier.link)).collect();
        let parts = DMatrix::from_fn(parts.len(), 10, |i, k| parts[i][k]);
        if parts.amax() == 0.0 {
            return Err(self.without_link(total, &carrier.link));
        }
        let of_sought = parts * &carrier.to_link;
        // In the order of the run's parameters.
        let bare = self.rows().substitute(&of_known.transpose());
        Ok(self.apart(total, &total.rows().select(&kept), &bare, &of_sought, &of_known, carrier))
    }

    /// Returns the body that `own` rows have and `bare` ones have not.
    fn apart(
        &self,
        total: &Fit,
        own: &RigRows,
        bare: &RigRows,
        of_sought: &DMatrix<f64>,
        of_known: &DMatrix<f64>,
        carrier: &Carrier,
    ) -> Fit {
        let n = own.parameters();
        let Beyond { rows, chi2 } = own.beyond(bare, &DMatrix::identity(n, n), of_sought);
        let rounding = total.rounding.max(self.fit().rounding);
        let sides = [own.own(), bare.own()];
        let disagreement = disagreement(&rows.own(), chi2, &sides, of_sought, rounding);
        let rows = rows.discount(disagreement.unwrap_or(1.0));
        let factor = rows.own();
        let noise = total.estimate.noise.less_certain(self.fit().estimate.noise);
        let estimate = Estimate::new(&factor, rounding, 1.0, noise).beside(std::slice::from_ref(&rows));
        let mut fit = of_body(total, factor, estimate, &carrier.frame);
        fit.rig_rows = Some(rows);
        fit.noise.disagreement = disagreement;
        fit.rounding = rounding;
        let without = self.own_errors();
        let without =
            OwnErrors { errors: without.errors.iter().map(|(n, e)| (n.clone(), of_known * e)).collect() };
        budget(&mut fit, &OwnErrors::of(total), &without, &sides, of_sought, total);
        fit.identities.extend(self.fit().identities.iter().cloned());
        fit.runs.extend(self.fit().runs.iter().cloned());
        fit.spurious_information += self.fit().spurious_information;
        fit
    }
}

/// Returns χ² per degree of freedom of what the payload does not explain of the difference between the runs,
/// where their noise does not either.
fn disagreement(
    sought: &Factor,
    chi2: f64,
    [own, bare]: &[Factor; 2],
    of_sought: &DMatrix<f64>,
    rounding: f64,
) -> Option<f64> {
    let rank = |factor: &Factor| factor.solve(rounding).determined.iter().filter(|d| **d).count();
    let mut both = own.clone();
    both.merge(bare);
    let rank_sought = rank(sought).min(of_sought.ncols());
    let compared = (rank(own) + rank(bare)).saturating_sub(rank(&both) + rank_sought);
    let dof = compared as f64;
    let surprising = chi2 > dof && ChiSquared::new(dof).is_ok_and(|d| d.sf(chi2) < SURPRISING);
    surprising.then(|| chi2 / dof)
}

/// Returns the fit of one body with the run's channels, residuals and counts.
fn of_body(total: &Fit, factor: Factor, estimate: Estimate, frame: &str) -> Fit {
    let mut fit = total.clone();
    let place = |k: usize, name: &str| {
        let (kind, unit) = match k {
            0 => (Kind::Mass, "kg"),
            1..4 => (Kind::FirstMoment, "kg m"),
            _ => (Kind::Inertia, "kg m2"),
        };
        let parameter = Parameter::new(name, Owner::Link(String::new()), kind, unit);
        Parameter { frame: frame.to_owned(), ..parameter }
    };
    fit.parameters = PARAMETER_NAMES[..10].iter().enumerate().map(|(k, name)| place(k, name)).collect();
    fit.channels.iter_mut().for_each(|c| c.channel.offset = None);
    // Columns of the tree.
    fit.lack_of_fit.change.iter_mut().for_each(|change| change.steps.clear());
    fit.factor = factor.clone().with_residual(total.factor.residual_sum_of_squares(), total.factor.rows());
    (fit.solved, fit.estimate) = (Some(factor), estimate);
    (fit.joint, fit.device, fit.prior) = (None, None, None);
    (fit.inflation, fit.widened, fit.signal_bias) = (Vec::new(), Vec::new(), Vec::new());
    (fit.convergence, fit.added) = (Vec::new(), Vec::new());
    fit
}

/// Says what errors and the runs without the payload bring to its parameters: `τ̂ = G (φ̂ − φ̂₀)` with
/// `G = C_τ Kᵀ S⁻¹`, S the covariance of the difference.
fn budget(
    fit: &mut Fit,
    own: &OwnErrors,
    bare: &OwnErrors,
    sides: &[Factor; 2],
    of_sought: &DMatrix<f64>,
    total: &Fit,
) {
    let kept = inertial(total);
    let [with, without] = sides.each_ref().map(|side| side.solve(fit.rounding));
    let is_shared = |name: &String| bare.errors.iter().any(|(other, _)| other == name);
    let shared: Vec<String> = own.errors.iter().map(|e| e.0.clone()).filter(is_shared).collect();
    let brought = [own, bare].map(|side| side.brought(&shared, kept.len()));
    let cross = &brought[0] * brought[1].transpose();
    let s = &with.covariance + &without.covariance - &cross - cross.transpose();
    let determined = with.determined.iter().chain(&without.determined).all(|d| *d);
    let inverse = s.cholesky().filter(|_| determined).map(|s| s.inverse());
    let gain = inverse.map(|inverse| &fit.estimate.covariance * of_sought.transpose() * inverse);
    for found in &mut fit.nuisances {
        let own =
            DVector::from_fn(kept.len(), |i, _| found.contributions.get(kept[i]).copied().unwrap_or(0.0));
        let other = shared.iter().position(|name| *name == found.nuisance.name);
        let brought = other.map_or(own.clone(), |k| own - brought[1].column(k));
        found.contributions =
            gain.as_ref().map_or_else(Vec::new, |g| (g * brought).iter().copied().collect());
    }
    if let Some(gain) = gain {
        let rest = without.covariance - &brought[1] * brought[1].transpose();
        fit.added.push(("run without the payload".to_owned(), &gain * rest * gain.transpose()));
    }
}

/// Returns the warning about runs that differ by more than what the link carries; `ratio` is χ² per degree of
/// freedom.
pub fn disagreement_in_words(link: &str, ratio: f64) -> String {
    format!(
        "with and without the payload the arm differs by {:.1} times as much as a body on {link} and noise \
         explain; intervals were widened: is it on another link, did it slip, are efforts in one unit and \
         the arm equally warm?",
        ratio.sqrt()
    )
}

#[cfg(test)]
#[path = "payload_tests.rs"]
mod tests;
