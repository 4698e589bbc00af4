//! A value for every column of a tree's rows: what predicts.
//!
//! Base parameters are those of the standard parameters nearest to the nominal model, where there is one, and
//! friction and rotors those that fit best beside them. Without a nominal model all are those that fit best
//! while no column brings more than all that was measured, which leaves what the rows determine as it is.
//! What is not identified is marked, and nothing here has an uncertainty.

use nalgebra::{DMatrix, DVector};

use super::context::Links;
use super::result::{Complete, CompleteDrive, CompleteParameter, CompleteTerm, ParameterState};
use super::standard_parameters::with_rotors;
use rigident_fit::{Factor, Fit, Owner, Parameter};

/// Singular values below this share of the largest are not determined.
const ROUNDING: f64 = 1e-12;

/// The note about the values.
const NOTE: &str = "values of all columns to predict with, which belong together; those that are not \
                    identified are such that all fit best, beside the nominal model where there is one, and \
                    by themselves they mean nothing";

/// Returns the values of all columns; `base` are the base parameters of the standard parameters of links,
/// without rotors.
pub(super) fn complete(
    fit: &Fit,
    links: &Links,
    base: Option<&[f64]>,
    states: &[ParameterState],
) -> Option<Complete> {
    let factor = fit.solved.as_ref().unwrap_or(&fit.factor);
    let (count, rotors) = (links.base.parameters.len(), links.base.rotors());
    let (values, of_rotors) = match base {
        Some(base) => {
            let beside = beside(&with_rotors(factor, links.base), base)?;
            let of_rotors = beside.get(fit.parameters.len() - count..)?.to_vec();
            let together = links.base.rotor_map() * DVector::from_column_slice(&of_rotors);
            let links = base.iter().zip(&together).map(|(own, rotors)| own + rotors);
            (links.chain(beside.iter().copied()).take(fit.parameters.len()).collect(), Some(of_rotors))
        }
        None => (beside(factor, &[])?, None),
    };
    let identified = |j: usize| states.get(j).is_some_and(ParameterState::is_identified);
    let is_drive = |p: &Parameter| matches!(p.owner, Owner::Drive(_));
    let all = || fit.parameters.iter().zip(&values).enumerate();
    let of_link = |(j, (p, value)): (usize, (&Parameter, &f64))| CompleteParameter {
        name: p.name.clone(),
        value: *value,
        unit: p.unit.clone(),
        identified: identified(j),
    };
    let own = |drive: &str, word: &str| {
        let name = format!("{drive}.{}", CompleteTerm::name_in(word));
        let (j, (p, value)) = all().find(|(_, (p, _))| p.name == name && is_drive(p))?;
        Some(CompleteTerm {
            term: word.to_owned(),
            value: Some(*value),
            unit: p.unit.clone(),
            identified: identified(j),
            together_with: Vec::new(),
        })
    };
    let rotor = |drive: &str| {
        let name = format!("{drive}.rotor");
        let k = rotors.iter().position(|own| *own == name)?;
        let with = links.base.parameters.iter().filter(|p| p.rotors.iter().any(|(own, _)| *own == name));
        Some(CompleteTerm {
            term: "rotor".to_owned(),
            value: of_rotors.as_ref().and_then(|all| all.get(k)).copied(),
            unit: "kg m2".to_owned(),
            identified: false,
            together_with: with.map(|p| p.name.clone()).collect(),
        })
    };
    let drives = links.drives.iter().map(|drive| CompleteDrive {
        name: drive.name.clone(),
        turns_with: drive.turns_with.clone(),
        terms: drive
            .terms
            .iter()
            .filter_map(|word| own(&drive.name, word))
            .chain(rotor(&drive.name))
            .collect(),
    });
    Some(Complete {
        note: NOTE.to_owned(),
        links: all().filter(|(_, (p, _))| !is_drive(p)).map(of_link).collect(),
        drives: drives.filter(|drive| !drive.terms.is_empty()).collect(),
    })
}

/// Returns the values of all columns after the first that fit best beside these values of the first. No
/// column is taken to bring more than all that was measured.
fn beside(factor: &Factor, first: &[f64]) -> Option<Vec<f64>> {
    let (r, z) = (factor.r(), DVector::from_column_slice(factor.z()));
    let (n, count) = (factor.parameters(), first.len());
    let rest = n.checked_sub(count)?;
    if rest == 0 {
        return Some(Vec::new());
    }
    let own = r.columns(count, rest);
    let left = &z - r.columns(0, count) * DVector::from_column_slice(first);
    // Columns of unit length, each known beforehand to be no more than everything.
    let length: Vec<f64> = own.column_iter().map(|c| c.norm()).collect();
    // What is rounding of a column is none: nothing depends on its parameter, which is left at zero.
    let least = f64::EPSILON * length.iter().fold(f64::MIN_POSITIVE, |most, v| most.max(*v));
    let length: Vec<f64> = length.into_iter().map(|v| if v > least { v } else { f64::INFINITY }).collect();
    let all = z.norm().max(f64::MIN_POSITIVE);
    let mut rows = DMatrix::zeros(n + rest, rest);
    for (k, length) in length.iter().enumerate() {
        rows.view_mut((0, k), (n, 1)).copy_from(&(own.column(k) / *length));
        rows[(n + k, k)] = 1.0 / all;
    }
    let mut values = DVector::zeros(n + rest);
    values.rows_mut(0, n).copy_from(&left);
    let found = rows.svd(true, true).solve(&values, ROUNDING).ok()?;
    Some(found.iter().zip(&length).map(|(value, length)| value / length).collect())
}
