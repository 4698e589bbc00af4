//! The conclusion of a pass: its estimate, its noise against what was stated, and what the residuals say
//! against the model.

use super::{Conclusion, Engine, Pass, Solved};
use crate::autocorrelation::{self, Coloured};
use crate::convergence;
use crate::lack_of_fit::{self, LackOfFit, NoiseRows, Role};
use crate::repetition;
use crate::residuals::rms;
use crate::sandwich::{Sandwich, SlowNoise};
use crate::signal_noise::WhitenedNoise;
use crate::weighing::Weighing;
use crate::{
    BlockResidual, Channel, Convergence, Effect, Estimate, Factor, Noise, NoiseCheck, RowSet, contradict,
    judge,
};

/// Rounds in which what a model of drives lacks is counted.
const MODEL_ERROR_ROUNDS: usize = 4;

/// The findings in residuals beyond white noise.
pub(super) struct BeyondWhite {
    /// Noise that is slow; `None` where none is found.
    slow: Option<Sandwich>,
    /// Factor on all standard deviations, as what a model of drives lacks repeats with the motion.
    repeated: f64,
    /// Both, as factors on the standard deviation of each parameter; empty: none.
    pub inflation: Vec<f64>,
}

impl BeyondWhite {
    /// Returns true if rows are noisier than white noise.
    pub(super) fn is_any(&self) -> bool {
        self.slow.is_some() || self.repeated > 1.0
    }

    /// Returns rows over all columns as noisy as that; their variance is `scale` times that which is stated.
    pub(super) fn noisier(&self, rows: &Factor, scale: f64) -> Factor {
        let slow = self.slow.as_ref().map(|slow| slow.noisier(rows, scale));
        let rows = slow.as_ref().unwrap_or(rows);
        if self.repeated > 1.0 { rows.discount(self.repeated.powi(2)) } else { rows.clone() }
    }
}

impl Engine<'_> {
    /// Draws the conclusions from a factor; where a model of drives lacks something, beside that.
    ///
    /// What a model of friction lacks follows the motion and is no white noise: taken as such it has errors
    /// of the rig explain it, and these then contradict what is known of them, or a law of friction that is
    /// not that of its columns. So in that case all rows count as noisier, by the largest factor that the
    /// autocorrelation of the residuals and the repetitions of a motion have on any interval, until the
    /// errors are as stated or nothing is left.
    pub(super) fn conclude(&self, pass: &Pass, sigma_given: bool) -> Conclusion {
        let mut conclusion = self.concluded(pass, sigma_given, 1.0);
        let has_drives = self.source.channels().iter().any(Channel::is_drive);
        if pass.linearised.is_none() || !has_drives || self.options.forgetting.is_some() {
            return conclusion;
        }
        for _ in 0..MODEL_ERROR_ROUNDS {
            let nuisances = self.nuisance_fits(pass, &conclusion.joint);
            let is_other = nuisances.iter().any(|k| k.nuisance.is_of_friction() && k.is_contradicted());
            if !is_other && !contradict(&nuisances, self.agreement(pass, &conclusion.joint).0) {
                break;
            }
            let by = self.beyond_white(pass, &conclusion).inflation.into_iter().fold(1.0, f64::max);
            if by <= 1.0 {
                break;
            }
            conclusion = self.concluded(pass, sigma_given, conclusion.check.model_error * by * by);
        }
        conclusion
    }

    /// Returns what residuals show beyond white noise.
    pub(super) fn beyond_white(&self, pass: &Pass, conclusion: &Conclusion) -> BeyondWhite {
        let slow = self.autocorrelated(pass, conclusion);
        let repeated = if conclusion.check.model_error > 1.0 { 1.0 } else { self.repeated(conclusion) };
        let mut inflation =
            slow.as_ref().map_or_else(Vec::new, |slow| slow.inflation(&conclusion.joint, self.parameters));
        if repeated > 1.0 {
            inflation.resize(self.parameters, 1.0);
            inflation.iter_mut().for_each(|own| *own *= repeated);
        }
        BeyondWhite { slow, repeated, inflation }
    }

    /// Returns by how much intervals are too narrow because what the model of the drives lacks repeats with
    /// the motion.
    fn repeated(&self, conclusion: &Conclusion) -> f64 {
        let channels = self.source.channels();
        let drives: Vec<usize> = (0..channels.len()).filter(|c| channels[*c].is_drive()).collect();
        let blocks = &self.blocks;
        if drives.is_empty() || blocks.len() != conclusion.residuals.len() {
            return 1.0;
        }
        let picked = || (0..blocks.len()).step_by(repetition::stride(blocks.len()));
        let mut rows = vec![0.0; channels.len() * self.parameters];
        let mut values = vec![0.0; channels.len()];
        let mut measured = vec![Vec::new(); drives.len()];
        for block in picked() {
            blocks.write(block, &mut rows, &mut values);
            measured.iter_mut().zip(&drives).for_each(|(own, c)| own.push(values[*c]));
        }
        let left = |c: &usize| picked().map(|k| conclusion.residuals[k].values[*c]).collect();
        repetition::factor(&measured, &drives.iter().map(left).collect::<Vec<Vec<f64>>>())
    }

    fn autocorrelated(&self, pass: &Pass, conclusion: &Conclusion) -> Option<Sandwich> {
        let (weighing, check) = (&pass.weighing, &conclusion.check);
        let whitened = autocorrelation::whitened(&conclusion.residuals, &weighing.whitening);
        let unit = vec![f64::from(self.blocks.filter().every) * check.variance_scale; weighing.sigma.len()];
        let coloured = autocorrelation::detect(&whitened, self.blocks.filter(), &unit, check.fitted);
        let slow = SlowNoise {
            whitening: &weighing.whitening,
            weights: &conclusion.weights,
            variance: &unit,
            coloured: &coloured,
        };
        (!coloured.is_empty()).then(|| Sandwich::new(self.rows_of(pass), conclusion.joint.len(), &slow))
    }

    /// Draws the conclusions from a factor beside noise that is `model_error` times as large in variance.
    fn concluded(&self, pass: &Pass, sigma_given: bool, model_error: f64) -> Conclusion {
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
        let (noise, scale) = (judged.noise, judged.variance_scale * model_error);
        let check = NoiseCheck {
            sigma_given,
            noise_gain: self.row_noise_gain,
            variance_ratio: judged.variance_ratio,
            variance_scale: scale,
            model_error,
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
