//! Efforts that are motor currents, or otherwise in a unit of its own for each joint.

use super::{Case, Fault, posed};
use crate::drive_gains::columns::{EffortColumn, columns, scale};
use crate::drive_gains::scales::Errors;
use crate::drive_gains::{WIDE, start};
use rigident_fit::{FitOptions, Silent};
use rigident_model::Model;

/// Gains that lie within this factor of one another are one unit.
const ONE_UNIT: f64 = 1.15;
/// Efforts that are this many times what the model says, or this share, are none of its size.
const OTHER_SIZE: f64 = 2.0;
/// How well the model's masses tell a gain, relative, 1 σ.
const BY_MASSES: f64 = 0.5;
/// A gain is at least this share of what was guessed.
const LEAST: f64 = 0.1;

/// Returns the fault of efforts that are no torques.
pub(super) fn fault(case: &Case, model: &Model) -> Option<Fault> {
    let count = columns(&case.recording, model).len();
    let what = "the efforts are no torques: they are motor currents, or in a unit of its own for each joint";
    let remedy = "find the gains of the drives by a load that is known, and give them as scales of [[joint]] \
                  effort in the rig file";
    (count > 1).then(|| Fault::new("gains of the drives", what, remedy, undo))
}

/// Scales each effort by a gain of its own; false where one unit would do.
fn undo(case: &mut Case) -> bool {
    let Some(model) = case.model.clone() else { return false };
    let efforts = columns(&case.recording, &model);
    let Some(first) = guess(case, &model).filter(|gains| gains.len() == efforts.len()) else { return false };
    // Torques are those of the model, nearly.
    if first.iter().all(|gain| (1.0 / OTHER_SIZE..=OTHER_SIZE).contains(&gain.abs())) {
        return false;
    }
    let wide = vec![WIDE; efforts.len()];
    scale(&mut case.recording.rig, &efforts, &first, &wide);
    let Some(found) = found(case, &efforts) else { return false };
    let gains: Vec<f64> =
        first.iter().zip(&found.values).map(|(gain, error)| gain / (1.0 + error).max(LEAST)).collect();
    let sizes = || gains.iter().map(|gain| gain.abs());
    let (least, most) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
    if most <= ONE_UNIT * least {
        return false;
    }
    scale(&mut case.recording.rig, &efforts, &gains, &vec![BY_MASSES; efforts.len()]);
    true
}

/// Returns what the model's torques say of each gain.
fn guess(case: &Case, model: &Model) -> Option<Vec<f64>> {
    let problem = posed(case)?;
    start::gains(problem.tree()?, model).ok()?
}

/// Returns the errors of the gains that a case is scaled by.
fn found(case: &Case, efforts: &[EffortColumn]) -> Option<Errors> {
    let options = FitOptions { convergence_points: 0, ..FitOptions::default() };
    let fit = posed(case)?.fit(&options, &Silent).ok()?;
    let rows = fit.rows();
    let joints: Vec<String> = efforts.iter().map(|effort| effort.joint.clone()).collect();
    Errors::of(&rows.known(), rows.parameters(), rows.errors(), &joints)
}
