//! Excitation advice for an [`Estimate`] that keeps its rows; it goes with `crate::identification`.

use nalgebra::DMatrix;

use super::identifiability::{RegressorNoise, identified};
use super::{Estimate, excitation_advice};
use crate::identification::Factor;

/// What to do so that the parameters that are not identified become so; empty if all are.
pub fn advice(estimate: &Estimate, noise: RegressorNoise) -> Vec<String> {
    if identified(estimate, noise).iter().all(|identified| *identified) {
        return Vec::new();
    }
    let data = estimate.of_data_alone();
    let r = data.rows.as_ref().map(|(factor, _)| triangle(factor));
    excitation_advice::advice(r.as_ref(), estimate, data.coverage_factor, noise.tensor_information)
}

fn triangle(factor: &Factor) -> DMatrix<f64> {
    match factor {
        Factor::Ten(f) => {
            let r = f.r();
            DMatrix::from_fn(10, 10, |i, j| r[i][j])
        }
        Factor::Sixteen(f) => {
            let r = f.r();
            DMatrix::from_fn(16, 16, |i, j| r[i][j])
        }
    }
}
