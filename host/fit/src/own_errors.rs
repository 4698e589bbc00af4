//! The part of errors that all runs of a rig share in the inertial parameters of one run.

use nalgebra::{DMatrix, DVector};

use super::{Fit, NuisanceFit, Scope};

/// Holds how far errors move the inertial parameters of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct OwnErrors {
    /// The name of each error that all runs of the rig share, with what one standard deviation of it brings.
    pub errors: Vec<(String, DVector<f64>)>,
}

impl OwnErrors {
    /// Returns those of a fit.
    pub fn of(fit: &Fit) -> Self {
        let kept = inertial(fit);
        let part = |found: &NuisanceFit| {
            DVector::from_fn(kept.len(), |i, _| found.contributions.get(kept[i]).copied().unwrap_or(0.0))
        };
        let shared = fit.nuisances.iter().filter(|found| found.nuisance.scope == Scope::Rig);
        Self { errors: shared.map(|found| (found.nuisance.name.clone(), part(found))).collect() }
    }

    /// Returns what the errors bring to `n` parameters, those of `names` in their order; zero of one that the
    /// run does not have.
    pub(super) fn brought(&self, names: &[String], n: usize) -> DMatrix<f64> {
        let own = |name: &String| self.errors.iter().find(|(own, _)| own == name);
        let columns: Vec<DVector<f64>> =
            names.iter().map(|name| own(name).map_or_else(|| DVector::zeros(n), |e| e.1.clone())).collect();
        if columns.is_empty() { DMatrix::zeros(n, 0) } else { DMatrix::from_columns(&columns) }
    }
}

/// Returns the places of the inertial parameters of a fit.
pub(super) fn inertial(fit: &Fit) -> Vec<usize> {
    (0..fit.parameters.len())
        .filter(|j| fit.parameters.get(*j).is_some_and(|p| p.kind.is_inertial()))
        .collect()
}
