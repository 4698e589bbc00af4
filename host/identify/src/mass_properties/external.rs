//! A wrench on the base that is constant and that nobody measures: a hose, a cable, a rope, zeros of the
//! feet's sensors.
//!
//! Horizontal pull of 20 N bends every estimate of masses that takes the ground for all that acts. Six more
//! columns on the base's rows, constant in the base's axes, take it up, and with it what the weight tells in
//! all attitudes alike.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use rigident_fit::Factor;
use rigident_model::base::ROUNDED;
use rigident_rows::tree::{TreeSource, TreeSourceError};

/// Components of a wrench.
const COMPONENTS: usize = 6;
/// Squares that a wrench explains are no chance below this probability.
const SURPRISING: f64 = 1e-6;
/// Rows behind the filter, and errors of what is measured, are not independent: they count as this share of
/// their number.
const INDEPENDENT: f64 = 0.2;

/// Returns the source with a constant wrench on the base as six columns after the base parameters; `None`
/// where the base's wrench has an offset already, or is not among the rows.
///
/// # Errors
/// [`TreeSourceError`] as [`TreeSource::new`].
pub fn with_unknown_wrench(source: &TreeSource) -> Result<Option<TreeSource>, TreeSourceError> {
    let mut input = source.input().clone();
    if input.contact.is_none() || input.known_offset.is_none() {
        return Ok(None);
    }
    input.known_offset = None;
    source.of_same_model(input).map(Some)
}

/// A wrench that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct External {
    /// Force on the base, N, axes of the base.
    pub force_n: [f64; 3],
    /// Moment about its origin, N m.
    pub moment_nm: [f64; 3],
    /// Probability of this much by chance.
    pub probability: f64,
}

impl External {
    /// Returns the wrench that rows show: `with` has its six columns after the first `base` ones, `without`
    /// has not. `None` if chance explains what it explains.
    pub fn found(without: &Factor, with: &Factor, base: usize) -> Option<Self> {
        let left = with.residual_sum_of_squares();
        let explained = without.residual_sum_of_squares() - left;
        let free = INDEPENDENT * (with.rows() as f64) - with.parameters() as f64;
        if !(explained > 0.0 && left > 0.0 && free > 1.0) {
            return None;
        }
        let each = left / (with.rows() as f64 - with.parameters() as f64);
        let ratio = INDEPENDENT * explained / COMPONENTS as f64 / each;
        let probability = FisherSnedecor::new(COMPONENTS as f64, free).ok()?.sf(ratio);
        if probability > SURPRISING {
            return None;
        }
        let solution = with.solve(ROUNDED);
        // The ground does as much less.
        let own = |k: usize| -solution.estimate.get(base + k).copied().unwrap_or(0.0);
        Some(Self {
            force_n: std::array::from_fn(own),
            moment_nm: std::array::from_fn(|k| own(3 + k)),
            probability,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of two parameters and, in the second factor, of six constants in turn, with and without a
    /// constant pull.
    #[test]
    fn a_constant_pull_is_found_and_none_is_not() {
        let noise = |k: usize| 0.3 * ((k * 7919 + 13) as f64 * 12.9898).sin();
        for pull in [0.0, 0.4] {
            let (mut without, mut with) = (Factor::new(2), Factor::new(8));
            for k in 0..6000 {
                let (a, b) = ((0.37 * k as f64).sin(), (0.11 * k as f64).cos());
                let force = if k % 6 == 1 { pull } else { 0.0 };
                let value = 2.0 * a - b - force + noise(k);
                without.absorb([(&[a, b][..], value)]);
                let mut row = [a, b, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                row[2 + k % 6] = 1.0;
                with.absorb([(&row[..], value)]);
            }
            let found = External::found(&without, &with, 2);
            assert_eq!(found.is_some(), pull > 0.0, "{found:?}");
            if let Some(found) = found {
                assert!((found.force_n[1] - pull).abs() < 0.05 && found.force_n[0].abs() < 0.05, "{found:?}");
            }
        }
    }
}
