//! The result: all that makes intervals wider than white noise alone, and what was counted.

use nalgebra::DVector;
use rigident_shared::forgetting::Span;

use super::{Conclusion, Engine, Pass};
use crate::lack_of_fit::LackOfFit;
use crate::rig_rows::shifted;
use crate::{ChannelFit, Convergence, Counts, Estimate, Fit, FitError, Forgotten, SignalFit, convergence};

/// Returns by how much the standard deviations of one estimate are larger than those of another, 1 or more.
fn wider(before: &Estimate, after: &Estimate) -> Vec<f64> {
    let of = |j: usize| {
        let ratio = (after.covariance[(j, j)] / before.covariance[(j, j)]).sqrt();
        let both = before.is_determined(j) && after.is_determined(j);
        if both && ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
    };
    (0..before.len()).map(of).collect()
}

impl Engine<'_> {
    /// Counts what makes intervals wider than white noise alone, and puts everything together.
    pub(super) fn finish(
        &self,
        pass: Pass,
        conclusion: Conclusion,
        mut convergence: Vec<Convergence>,
        forgetting: Option<Span<f64>>,
    ) -> Result<Fit, FitError> {
        let lack_of_fit =
            if forgetting.is_none() { self.lack_of_fit(&pass, &conclusion) } else { LackOfFit::default() };
        let (nuisances, known) = match forgetting {
            None => (self.nuisance_fits(&pass, &conclusion), DVector::zeros(self.parameters)),
            Some(span) => self.considered(&pass, &conclusion, span)?,
        };
        let beyond = forgetting.is_none().then(|| self.beyond_white(&pass, &conclusion));
        let inflation = beyond.as_ref().map_or_else(Vec::new, |beyond| beyond.inflation.clone());
        let Conclusion { mut factor, mut solved, mut estimate, unscaled, check, rows: mut joint, .. } =
            conclusion;
        if known.iter().any(|v| *v != 0.0) {
            factor = factor.about(known.as_slice());
            estimate.values.iter_mut().zip(&known).for_each(|(value, by)| *value -= by);
            for point in &mut convergence {
                let all = point.parameters.iter_mut().zip(&known);
                all.for_each(|(measured, by)| measured.iter_mut().for_each(|m| m.value -= by));
            }
        }
        let weighing = &pass.weighing;
        let variance: Vec<f64> = weighing.total.iter().map(|s| s * s * check.variance_scale).collect();
        // What is compensated moves no estimate and informs of nothing.
        let (mut spurious_information, mut bias) = (0.0, Vec::new());
        if let Some(noise) = self.noise.as_ref().filter(|_| !weighing.is_compensated()) {
            spurious_information = conclusion.share * self.spurious_information(&weighing.sigma);
            let informed = self.without_spurious(&unscaled, spurious_information);
            let known = |j: usize| if informed.is_determined(j) { informed.values[j] } else { 0.0 };
            let informed: Vec<f64> = (0..self.parameters).map(known).collect();
            let pull = noise.pull(weighing, &informed) * conclusion.share;
            bias = (&unscaled.covariance * pull).iter().map(|b| -b).collect();
        }
        let mut by: Vec<f64> = (0..self.parameters)
            .map(|j| {
                let all = estimate.covariance[(j, j)].max(0.0).sqrt();
                let brought = nuisances.iter().map(|k| k.contributions.get(j).map_or(0.0, |sd| sd * sd));
                let systematic = brought.sum::<f64>().sqrt();
                // Nuisance parameters that were eliminated are in the covariance already.
                let counted = if pass.linearised.is_some() { systematic.min(all) } else { 0.0 };
                let noise = (all * all - counted * counted).sqrt();
                let coloured = inflation.get(j).copied().unwrap_or(1.0) * noise;
                let noise = coloured.hypot(bias.get(j).copied().unwrap_or(0.0));
                let systematic = if pass.linearised.is_some() { counted } else { systematic };
                let shift = lack_of_fit.shift(j);
                if all > 0.0 { noise.hypot(systematic).hypot(shift) / all } else { 1.0 }
            })
            .collect();
        let mut widened = Vec::new();
        if by.iter().any(|by| *by > 1.0) {
            let before = estimate.clone();
            if forgetting.is_none() {
                if let Some(beyond) = beyond.filter(|_| !inflation.is_empty()) {
                    joint = beyond.noisier(&joint, check.variance_scale);
                }
                let change: Vec<f64> = (0..self.parameters).map(|j| lack_of_fit.shift(j)).collect();
                joint = shifted(&shifted(&joint, &bias), &change);
                let own = self.without_errors(&joint, pass.linearised.is_some());
                estimate = self.estimate(&own, 1.0, estimate.noise);
                solved = Some(own);
                by = wider(&before, &estimate);
            } else {
                solved = solved.map(|rows| rows.inflate(&estimate.values, &by));
                estimate = estimate.inflate(&by);
            }
            factor = factor.inflate(&before.values, &by);
            widened.clone_from(&by);
        }
        let rig_rows = match (forgetting, &pass.linearised) {
            (None, Some(_)) => self.columns.rig_rows(&joint),
            _ => None,
        };
        for point in &mut convergence {
            for (measured, by) in point.parameters.iter_mut().zip(&by) {
                if let Some(measured) = measured {
                    measured.u95 *= by;
                }
            }
        }
        convergence::end_at(&mut convergence, &conclusion.residuals, &estimate);
        let counts = self.blocks.counts();
        let filter = self.blocks.filter().clone();
        let channels = self.source.channels();
        let floor = self.source.channel_noise();
        let channel_fits = channels.iter().enumerate().map(|(c, channel)| ChannelFit {
            channel: channel.clone(),
            sigma: weighing.sigma[c],
            residual_rms: conclusion.residual_rms.get(c).copied().unwrap_or(0.0),
            measured_rms: self.measured_rms.get(c).copied().unwrap_or(0.0),
            measured_sd: self.measured_sd.get(c).copied().unwrap_or(0.0),
            noise_floor: floor.get(c).copied().unwrap_or(0.0),
            outliers: conclusion.outliers.get(c).copied().unwrap_or(0),
            rejected: self.rejected(c),
            residual_sigma: (variance[c] * filter.noise_gain).sqrt(),
            autocorrelation: conclusion.coloured.iter().find(|k| k.channel == c).map(|k| k.found),
        });
        let channel_fits = channel_fits.collect();
        let (agreement, error_scores) = self.agreement(&pass, &conclusion.joint);
        let signals = self.noise.as_ref().filter(|_| weighing.is_compensated());
        let signals = signals.into_iter().flat_map(|noise| noise.groups().zip(&weighing.signals));
        let signals =
            signals.map(|(noise, sigma)| SignalFit { noise: noise.clone(), sigma: *sigma }).collect();
        Ok(Fit {
            parameters: self.source.parameters().to_vec(),
            channels: channel_fits,
            signals,
            stated_noise: self.source.stated_noise(),
            agreement,
            error_scores,
            joint: self.joint(&pass, &conclusion.joint, check.variance_scale, &inflation),
            nuisances,
            added: Vec::new(),
            device: None,
            solved,
            rig_rows,
            rounding: self.source.rounding(),
            model_fingerprint: self.source.model_fingerprint(),
            identities: vec![self.source.identity()],
            prior: None,
            inflation,
            widened,
            signal_bias: bias,
            spurious_information,
            counts: Counts {
                samples: counts.samples,
                rejected: counts.rejected,
                rejected_by_signal: counts
                    .by_signal
                    .iter()
                    .map(|(signal, count)| (self.source.signal_name(*signal), *count))
                    .collect(),
                gaps: counts.gaps,
                blocks: self.blocks.len() as u64,
            },
            forgotten: forgetting.map(|span| {
                let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
                Forgotten {
                    is_window: matches!(span, Span::Window(_)),
                    span_s,
                    effective_s: factor.rows() as f64 / channels.len().max(1) as f64 * filter.row_period_s(),
                }
            }),
            lack_of_fit,
            runs: Vec::new(),
            noise: check,
            residuals: conclusion.residuals,
            filter,
            factor,
            estimate,
            convergence,
        })
    }

    /// Returns the samples rejected because of a channel.
    pub(super) fn rejected(&self, channel: usize) -> u32 {
        let signal = u8::try_from(channel).unwrap_or(u8::MAX);
        let by_channel = |signal: u8| {
            self.source
                .channels()
                .get(channel)
                .is_some_and(|c| self.source.signal_name(signal).starts_with(&c.name))
        };
        let count = self.blocks.counts().by_signal.get(&signal).filter(|_| by_channel(signal));
        count.map_or(0, |count| u32::try_from(*count).unwrap_or(u32::MAX))
    }
}
