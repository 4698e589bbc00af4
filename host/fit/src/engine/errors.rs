//! Nuisance parameters as a pass found them, and against what was known of them beforehand.

use nalgebra::{DMatrix, DVector};

use super::conclusion::BeyondWhite;
use super::{Conclusion, Engine, Pass};
use crate::linearised::Prior;
use crate::{Agreement, ErrorScores, Estimate, Gaussian, Noise, NuisanceFit};

impl Engine<'_> {
    /// Returns the estimate of all columns beside noise as it was found, as the answer's own numbers have it:
    /// slow noise moves errors as it moves parameters.
    pub(super) fn joint_beside(
        &self,
        pass: &Pass,
        conclusion: &Conclusion,
        beyond: Option<&BeyondWhite>,
    ) -> Estimate {
        match beyond.filter(|beyond| pass.linearised.is_some() && beyond.is_any()) {
            Some(beyond) => {
                let rows = beyond.noisier(&conclusion.rows, conclusion.check.variance_scale);
                self.estimate(&self.columns.with_prior(&rows), 1.0, Noise::Given)
            }
            None => conclusion.joint.clone(),
        }
    }

    /// Returns the nuisance parameters as a joint estimate of a pass has them.
    pub(super) fn nuisance_fits(&self, pass: &Pass, joint: &Estimate) -> Vec<NuisanceFit> {
        let n = self.parameters;
        let Estimate { values, covariance, .. } = joint;
        if pass.linearised.is_none() {
            return Vec::new();
        }
        let found = self.columns.nuisances.iter().enumerate();
        // Of independent errors `(N⁻¹)_jk / σ_k`.
        let brought = covariance.rows(0, n) * self.columns.prior.whitening.rows(n, found.len()).transpose();
        found
            .map(|(k, nuisance)| NuisanceFit {
                nuisance: nuisance.clone(),
                expected: self.columns.prior.mean[n + k] + self.columns.corrected[k],
                value: values[n + k] + self.columns.corrected[k],
                sd: covariance[(n + k, n + k)].max(0.0).sqrt().min(nuisance.sigma),
                drawn: nuisance.sigma.powi(2) - covariance[(n + k, n + k)],
                contributions: brought.column(k).iter().copied().collect(),
            })
            .collect()
    }

    /// Returns parameters and errors together, as far as they are determined, if something is known of them
    /// together.
    pub(super) fn joint(&self, pass: &Pass, joint: &Estimate) -> Option<Gaussian> {
        pass.linearised.as_ref()?;
        self.source.beforehand()?;
        let Estimate { values, covariance, determined, .. } = joint;
        let kept: Vec<usize> = (0..values.len()).filter(|j| determined.get(*j) == Some(&true)).collect();
        let own = self.source.parameters().iter().map(|p| &p.name);
        let names: Vec<&String> = own.chain(self.columns.nuisances.iter().map(|k| &k.name)).collect();
        let mut values = DVector::from_column_slice(values);
        let errors = values.iter_mut().skip(self.parameters).zip(&self.columns.corrected);
        errors.for_each(|(value, corrected)| *value += corrected);
        Gaussian::new(
            kept.iter().filter_map(|j| names.get(*j).map(|name| (*name).clone())).collect(),
            values.select_rows(&kept),
            covariance.select_rows(&kept).select_columns(&kept),
        )
    }

    /// Compares the errors found with what was known of them beforehand.
    pub(super) fn agreement(
        &self,
        pass: &Pass,
        joint: &Estimate,
    ) -> (Option<Agreement>, Option<ErrorScores>) {
        let (n, count) = (self.parameters, self.columns.nuisances.len());
        if pass.linearised.is_none() {
            return (None, None);
        }
        let sigma = |k: usize| self.columns.nuisances[k].sigma;
        let Prior { mean, covariance, .. } = &self.columns.prior;
        let known = DVector::from_fn(count, |k, _| (joint.values[n + k] - mean[n + k]) / sigma(k));
        let learned = DMatrix::from_fn(count, count, |i, j| {
            (covariance[(i, j)] - joint.covariance[(n + i, n + j)]) / (sigma(i) * sigma(j))
        });
        // In standard deviations beforehand: errors of several units.
        let prior = DMatrix::from_fn(count, count, |i, j| covariance[(i, j)] / (sigma(i) * sigma(j)));
        let scores = ErrorScores::new(&known, prior, &learned);
        // The law of friction is the model's, not the rig's.
        let of_rig: Vec<usize> =
            (0..count).filter(|k| !self.columns.nuisances[*k].is_of_friction()).collect();
        let learned = learned.select_rows(&of_rig).select_columns(&of_rig);
        (Agreement::new(&known.select_rows(&of_rig), learned), scores)
    }
}
