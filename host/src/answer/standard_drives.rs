//! Parameters of drives beside standard parameters of links: with these the vector is complete, and predicts.
//!
//! Of friction and rotors that are not identified, or occur together with links only, those values are given that fit best beside
//! the links' standard parameters. They are marked, and they have no uncertainty.

use nalgebra::{DMatrix, DVector};

use super::context::Links;
use super::result::{ParameterState, StandardDrive, StandardTerm};
use super::standard_parameters::with_rotors;
use crate::fit::{Fit, Owner};

/// Singular values below this share of the largest are not determined.
const ROUNDING: f64 = 1e-12;

/// Returns the parameters of all drives, beside links whose base parameters are `base`.
pub(super) fn standard_drives(
    fit: &Fit,
    links: &Links,
    base: &[f64],
    states: &[ParameterState],
) -> Vec<StandardDrive> {
    let count = links.base.parameters.len();
    let beside = values_beside(fit, links, base).unwrap_or_default();
    let rotors = links.base.rotors();
    let own = |drive: &str, word: &str| -> Option<StandardTerm> {
        let name = format!("{drive}.{}", word.split(':').next().unwrap_or(word));
        let is_own = |p: &crate::fit::Parameter| p.name == name && p.owner == Owner::Drive(drive.to_owned());
        let j = fit.parameters.iter().position(is_own)?;
        Some(StandardTerm {
            term: word.to_owned(),
            value: *beside.get(j.checked_sub(count)?)?,
            unit: fit.parameters[j].unit.clone(),
            identified: states.get(j).is_some_and(ParameterState::is_identified),
            together_with: Vec::new(),
        })
    };
    let rotor = |drive: &str| -> Option<StandardTerm> {
        let name = format!("{drive}.rotor");
        let k = rotors.iter().position(|own| *own == name)?;
        let with = links.base.parameters.iter().filter(|p| p.rotors.iter().any(|(own, _)| *own == name));
        let first = fit.parameters.iter().find(|p| p.made_of.iter().any(|(own, _)| *own == name))?;
        Some(StandardTerm {
            term: "rotor".to_owned(),
            value: *beside.get(fit.parameters.len() - count + k)?,
            unit: first.unit.clone(),
            identified: false,
            together_with: with.map(|p| p.name.clone()).collect(),
        })
    };
    let drives = links.drives.iter().map(|drive| StandardDrive {
        name: drive.name.clone(),
        turns_with: drive.turns_with.clone(),
        terms: drive
            .terms
            .iter()
            .filter_map(|word| own(&drive.name, word))
            .chain(rotor(&drive.name))
            .collect(),
    });
    drives.filter(|drive| !drive.terms.is_empty()).collect()
}

/// Returns the values of all columns after the base parameters, then of the rotors that are parts of these, that fit best beside
/// links with these base parameters. No column is taken to bring more than all that was measured.
fn values_beside(fit: &Fit, links: &Links, base: &[f64]) -> Option<Vec<f64>> {
    let factor = with_rotors(fit.solved.as_ref().unwrap_or(&fit.factor), links.base);
    let (r, z) = (factor.r(), DVector::from_column_slice(factor.z()));
    let (n, count) = (factor.parameters(), base.len());
    let rest = n.checked_sub(count).filter(|rest| *rest > 0)?;
    let own = r.columns(count, rest);
    let left = &z - r.columns(0, count) * DVector::from_column_slice(base);
    // Columns of unit length, each known beforehand to be no more than everything.
    let length: Vec<f64> = own.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let all = z.norm().max(f64::MIN_POSITIVE);
    let mut rows = DMatrix::zeros(n + rest, rest);
    for k in 0..rest {
        rows.view_mut((0, k), (n, 1)).copy_from(&(own.column(k) / length[k]));
        rows[(n + k, k)] = 1.0 / all;
    }
    let mut values = DVector::zeros(n + rest);
    values.rows_mut(0, n).copy_from(&left);
    let found = rows.svd(true, true).solve(&values, ROUNDING).ok()?;
    Some(found.iter().zip(&length).map(|(value, length)| value / length).collect())
}
