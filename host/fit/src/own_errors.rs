//! A run of a tree with the errors that it shares with other runs of its rig taken apart from its noise.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::{Factor, Fit, NuisanceFit, Scope};

/// Least share of a variance that is left to noise where errors are taken apart from it.
const LEAST_NOISE: f64 = 1e-9;

/// A run of a tree that its own errors are known of.
#[derive(Clone, Debug)]
pub(super) struct OwnErrors {
    /// The rows over the inertial parameters, whitened by their true σ.
    pub factor: Factor,
    /// The errors that all runs of the rig share, with what they bring to the inertial parameters.
    pub errors: Vec<(String, f64, DVector<f64>)>,
}

impl OwnErrors {
    /// Returns the inertial part of a fit of a tree.
    pub fn of(fit: &Fit) -> Self {
        let kept = inertial(fit);
        let part = |found: &NuisanceFit| {
            DVector::from_fn(kept.len(), |i, _| found.contributions.get(kept[i]).copied().unwrap_or(0.0))
        };
        let shared = fit.nuisances.iter().filter(|found| found.nuisance.scope == Scope::Rig);
        Self {
            factor: fit.scaled_factor().eliminate_others(&kept),
            errors: shared
                .map(|found| (found.nuisance.name.clone(), found.nuisance.sigma, part(found)))
                .collect(),
        }
    }

    /// Returns what the errors bring, those of `names` in their order; zero of one that the run does not have.
    pub(super) fn brought(&self, names: &[String]) -> DMatrix<f64> {
        let n = self.factor.parameters();
        let own = |name: &String| self.errors.iter().find(|(own, ..)| own == name);
        let columns: Vec<DVector<f64>> =
            names.iter().map(|name| own(name).map_or_else(|| DVector::zeros(n), |e| e.2.clone())).collect();
        if columns.is_empty() { DMatrix::zeros(n, 0) } else { DMatrix::from_columns(&columns) }
    }

    /// Returns the rows over `[φ, e]`, what is known of e beforehand left out.
    ///
    /// `(Σ − C Cᵀ)⁻¹ = N + N C (1 − Cᵀ N C)⁻¹ Cᵀ N` with `N = Σ⁻¹ = RᵀR`: rows beside those of R.
    pub(super) fn with_errors(&self, names: &[String]) -> Factor {
        let (n, count) = (self.factor.parameters(), names.len());
        let c = self.brought(names);
        let r = self.factor.r();
        let rc = &r * &c;
        let mut factor = self.factor.clone();
        if count > 0 {
            let eigen = SymmetricEigen::new(DMatrix::identity(count, count) - rc.tr_mul(&rc));
            let root = eigen.eigenvalues.map(|v| 1.0 / v.max(LEAST_NOISE).sqrt());
            let rows = DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose() * rc.tr_mul(&r);
            // z = R φ̂ of any φ̂ that solves the rows.
            let z = DVector::from_column_slice(self.factor.z());
            let values = DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose() * rc.tr_mul(&z);
            factor.absorb_matrix(&rows, values.as_slice());
        }
        let map = DMatrix::from_fn(n, n + count, |i, j| match j.checked_sub(n) {
            None => f64::from(u8::from(i == j)),
            Some(k) => c[(i, k)],
        });
        factor.substitute(&map)
    }
}

/// Returns the places of the inertial parameters of a fit.
pub(super) fn inertial(fit: &Fit) -> Vec<usize> {
    (0..fit.parameters.len())
        .filter(|j| fit.parameters.get(*j).is_some_and(|p| p.kind.is_inertial()))
        .collect()
}
