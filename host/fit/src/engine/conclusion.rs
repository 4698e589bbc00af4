//! What a pass says: its estimate, its noise against what was stated, and what the residuals say against the model.

use super::{Conclusion, Engine, Pass, Solved};
use crate::autocorrelation::{self, Coloured};
use crate::convergence;
use crate::lack_of_fit::{self, LackOfFit, NoiseRows, Role};
use crate::residuals::rms;
use crate::signal_noise::WhitenedNoise;
use crate::weighing::Weighing;
use crate::{BlockResidual, Convergence, Effect, Estimate, Noise, NoiseCheck, RowSet, judge};

impl Engine<'_> {
    /// Draws the conclusions from a factor.
    pub(super) fn conclude(&self, pass: &Pass, sigma_given: bool) -> Conclusion {
        let Solved { factor, mut rows, mut joint, mut about, .. } = self.solve(pass, 1.0);
        let mut unscaled = self.estimate(&factor, 1.0, Noise::Given);
        let set = RowSet {
            rows: factor.rows(),
            channels: self.source.channels().len(),
            noise_gain: self.row_noise_gain,
            sigma_given,
        };
        let fitted = self.fitted(pass, &joint);
        let judged = judge(&[set], factor.residual_sum_of_squares(), fitted);
        let (noise, scale) = (judged.noise, judged.variance_scale);
        let check = NoiseCheck {
            sigma_given,
            noise_gain: self.row_noise_gain,
            variance_ratio: judged.variance_ratio,
            variance_scale: scale,
            disagreement: None,
            fitted,
        };
        // What is known beforehand is not the noise's to scale.
        let mut solved = None;
        if scale > 1.0 && pass.linearised.is_some() {
            let beside = self.solve(pass, scale);
            let estimate = self.estimate(&beside.factor, 1.0, Noise::Given);
            unscaled = Estimate { covariance: &estimate.covariance / scale, ..estimate };
            (solved, joint, about) = (Some(beside.factor), beside.joint, beside.about);
            rows = beside.rows;
        } else {
            rows = rows.discount(scale);
            joint.covariance *= scale;
            about.covariance *= scale;
        }
        let estimate = Estimate { covariance: &unscaled.covariance * scale, noise, ..unscaled.clone() };
        let weights = self.weights_of(pass, &about, &check);
        let residuals = self.residuals(self.rows_of(pass), &about.values, &weights);
        let mut conclusion = Conclusion {
            factor,
            solved,
            rows,
            estimate,
            unscaled,
            noise,
            check,
            joint,
            about,
            residual_rms: rms(&residuals, self.source.channels().len()),
            residuals,
            outliers: weights.outliers.clone(),
            weights,
            coloured: Vec::new(),
            share: 1.0,
        };
        conclusion.coloured = self.coloured(&conclusion.residuals, &pass.weighing, &conclusion.check);
        conclusion
    }

    pub(super) fn coloured(
        &self,
        residuals: &[BlockResidual],
        weighing: &Weighing,
        check: &NoiseCheck,
    ) -> Vec<Coloured> {
        let variance: Vec<f64> = weighing.total.iter().map(|s| s * s * check.variance_scale).collect();
        autocorrelation::detect(residuals, self.blocks.filter(), &variance, check.fitted)
    }

    pub(super) fn convergence(&self, pass: &Pass, conclusion: &Conclusion) -> Vec<Convergence> {
        let points = self.options.convergence_points;
        if points == 0 || self.blocks.filter().response.is_empty() {
            return Vec::new();
        }
        let scale = conclusion.check.variance_scale;
        let way = convergence::Way {
            blocks: self.rows_of(pass),
            rounding: self.source.rounding(),
            weighing: &pass.weighing,
            noise_gram: pass.gram.as_ref().map(|gram| self.noise_gram(gram, 1.0, pass.weighing.doubt)),
            weights: pass.weights.as_slice(),
            columns: pass.linearised.as_ref().map(|_| &self.columns),
            parameters: self.parameters,
            scale,
            noise: conclusion.noise,
        };
        way.points(points)
    }

    /// Returns what the residuals say against the model.
    pub(super) fn lack_of_fit(&self, pass: &Pass, conclusion: &Conclusion) -> LackOfFit {
        if pass.weighing.is_compensated() && !self.source.signal_noise_is_white() {
            return LackOfFit::default();
        }
        let values = &conclusion.about.values;
        let mut roles: Vec<Role> = self.source.parameters().iter().map(Role::of).collect();
        if pass.linearised.is_some() {
            roles.extend(self.columns.nuisances.iter().map(|nuisance| match nuisance.effect {
                Effect::Drift { .. } => Role::Drift,
                _ => Role::Fixed,
            }));
        }
        roles.resize(values.len(), Role::Fixed);
        let noise = self.noise.as_ref().filter(|_| pass.weighing.is_compensated());
        let noise = noise.map(|noise| WhitenedNoise {
            noise,
            weighing: &pass.weighing,
            columns: &self.columns,
            linearised: pass.linearised.as_ref(),
        });
        lack_of_fit::look(&lack_of_fit::Rows {
            blocks: self.rows_of(pass),
            noise: noise.as_ref().map(|noise| noise as &dyn NoiseRows),
            values,
            roles: &roles,
            whitening: &pass.weighing.whitening,
            weights: &conclusion.weights,
            has_drives: self.source.channels().iter().any(|channel| channel.is_drive()),
            is_suspect: !conclusion.coloured.is_empty()
                || conclusion.check.variance_ratio > lack_of_fit::SUSPECT,
        })
    }
}
