//! Choices of equal size compared by what is identified from them, and by the motions that they left out.

use nalgebra::DVector;

use super::conditions::{Group, conditions};
use super::{Candidate, SelectionError, check};
use crate::Factor;

/// Relative standard deviations that parameters are counted by.
pub const GOOD: f64 = 0.05;
/// The same for parameters that are known roughly.
pub const FAIR: f64 = 0.15;
/// Parameters below this, kg, kg m or kg m², are counted apart: relative to next to nothing nothing is known
/// well.
pub const SMALL: f64 = 0.05;
/// Singular values below this share of the largest tell nothing.
const ROUNDING: f64 = 1e-10;

/// The result of a choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The way it was made.
    pub name: String,
    /// The motions.
    pub motions: Vec<usize>,
    /// Parameters with a relative standard deviation below 5 %.
    pub good: usize,
    /// From 5 to 15 %.
    pub fair: usize,
    /// Above 15 %, or not determined.
    pub poor: usize,
    /// Parameters that are small.
    pub small: usize,
    /// Condition number of the whole, columns as they are, then of unit length.
    pub condition: [f64; 2],
    /// log10 of the determinant of the information.
    pub log10_determinant: f64,
    /// Root mean square of what the parameters leave of the whitened rows of the motions that were not
    /// chosen; `None` if all were.
    pub left_out: Option<f64>,
}

/// Returns the result of a choice. `known` are rows of what is known beforehand, which are in every solution.
///
/// # Errors
/// [`SelectionError`] if there is nothing to choose from.
pub fn compare(
    name: &str,
    candidates: &[Candidate],
    motions: &[usize],
    known: Option<&Factor>,
) -> Result<Choice, SelectionError> {
    let columns = check(candidates)?;
    let chosen = || motions.iter().filter_map(|k| candidates.get(*k));
    let mut all = Factor::new(columns);
    chosen().for_each(|c| all.merge(&c.factor));
    if chosen().next().is_none() {
        return Err(SelectionError::Zero);
    }
    let mut with_known = all.clone();
    if let Some(known) = known {
        with_known.merge(known);
    }
    let solution = with_known.solve(ROUNDING);
    let phi = DVector::from_column_slice(&solution.estimate);
    let rank = columns - solution.null_directions.len().min(columns);
    let spare = (all.rows() as f64 - rank as f64).max(1.0);
    let noise = (square_left(&all, &phi) / spare).max(f64::MIN_POSITIVE);
    let mut choice = Choice {
        name: name.to_owned(),
        motions: motions.to_vec(),
        good: 0,
        fair: 0,
        poor: 0,
        small: 0,
        condition: [f64::INFINITY; 2],
        log10_determinant: all.log_determinant() / std::f64::consts::LN_10,
        left_out: left_out(candidates, motions, &phi),
    };
    for (j, value) in phi.iter().enumerate() {
        let deviation = (solution.covariance[(j, j)] * noise).max(0.0).sqrt() / value.abs();
        let count = match deviation {
            _ if value.abs() < SMALL => &mut choice.small,
            d if d < GOOD && solution.determined[j] => &mut choice.good,
            d if d < FAIR && solution.determined[j] => &mut choice.fair,
            _ => &mut choice.poor,
        };
        *count += 1;
    }
    let whole = Group { name: String::new(), columns: (0..columns).collect() };
    if let Some(found) = conditions(&all, &[whole]).first() {
        choice.condition = [found.raw, found.scaled];
        if found.scaled.is_infinite() {
            // What rounding makes of it is no number.
            choice.log10_determinant = f64::NEG_INFINITY;
        }
    }
    Ok(choice)
}

/// `|R φ − z|² + ρ²`: the square of what parameters leave of a factor's rows.
pub fn square_left(factor: &Factor, phi: &DVector<f64>) -> f64 {
    let left = factor.r() * phi - DVector::from_column_slice(factor.z());
    left.norm_squared() + factor.residual_sum_of_squares()
}

fn left_out(candidates: &[Candidate], motions: &[usize], phi: &DVector<f64>) -> Option<f64> {
    let others = candidates.iter().enumerate().filter(|(k, _)| !motions.contains(k));
    let (square, rows) = others.fold((0.0, 0), |(square, rows), (_, c)| {
        (square + square_left(&c.factor, phi), rows + c.factor.rows())
    });
    (rows > 0).then(|| (square / rows as f64).sqrt())
}
