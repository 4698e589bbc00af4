//! The result: an answer's numbers with all that its intervals count, and what was counted.

use nalgebra::DVector;
use rigident_shared::forgetting::Span;

use super::widening::{Solution, Widened};
use super::{Conclusion, Engine, Pass};
use crate::lack_of_fit::LackOfFit;
use crate::{ChannelFit, Convergence, Counts, Fit, FitError, Forgotten, SignalFit, contradict, convergence};

impl Engine<'_> {
    /// Counts what makes intervals wider than white noise alone, and puts everything together.
    pub(super) fn finish(
        &self,
        pass: Pass,
        conclusion: Conclusion,
        mut convergence: Vec<Convergence>,
        forgetting: Option<Span<f64>>,
    ) -> Result<Fit, FitError> {
        let beyond = forgetting.is_none().then(|| self.beyond_white(&pass, &conclusion));
        let beside = self.joint_beside(&pass, &conclusion, beyond.as_ref());
        let (nuisances, known) = match forgetting {
            None => (self.nuisance_fits(&pass, &beside), DVector::zeros(self.parameters)),
            Some(span) => self.considered(&pass, &conclusion, span)?,
        };
        let (agreement, error_scores) = self.agreement(&pass, &beside);
        let is_refused = self.options.verdict_alone && contradict(&nuisances, agreement);
        let lack_of_fit = if forgetting.is_some() || is_refused {
            LackOfFit::default()
        } else {
            self.lack_of_fit(&pass, &conclusion)
        };
        let found = self.found(&pass, &conclusion, beyond, &lack_of_fit);
        let inflation = found.inflation();
        let joint = self.joint(&pass, &beside);
        let channels = self.channel_fits(&pass, &conclusion);
        let Conclusion { check, residuals, factor, solved, rows, estimate, .. } = conclusion;
        let mut white = Solution { factor, solved, rows, estimate };
        about(&mut white, &mut convergence, &known);
        let with_errors = pass.linearised.is_some();
        let Widened { factor, solved, rows, mut estimate, by } = match forgetting {
            None => self.widened(white, &found, check.variance_scale, with_errors),
            Some(_) => self.widened_by_errors(white, &found, &nuisances),
        };
        let of_rig = forgetting.is_none() && with_errors;
        let rig_rows = if of_rig { self.columns.rig_rows(&rows) } else { None };
        estimate = estimate.beside(rig_rows.as_slice());
        widen(&mut convergence, &by);
        convergence::end_at(&mut convergence, &residuals, &estimate);
        Ok(Fit {
            parameters: self.source.parameters().to_vec(),
            channels,
            signals: self.signal_fits(&pass),
            stated_noise: self.source.stated_noise(),
            agreement,
            error_scores,
            joint,
            nuisances,
            added: Vec::new(),
            device: None,
            solved,
            rig_rows,
            rounding: self.source.rounding(),
            model_fingerprint: self.source.model_fingerprint(),
            identities: vec![self.source.identity()],
            prior: None,
            inflation: inflation.to_vec(),
            widened: by,
            signal_bias: found.bias,
            spurious_information: found.spurious_information,
            counts: self.counts(),
            forgotten: forgetting.map(|span| self.forgotten(span, factor.rows())),
            lack_of_fit,
            runs: Vec::new(),
            noise: check,
            residuals,
            filter: self.blocks.filter().clone(),
            factor,
            estimate,
            convergence,
        })
    }

    /// Returns the channels as the fit found them.
    fn channel_fits(&self, pass: &Pass, conclusion: &Conclusion) -> Vec<ChannelFit> {
        let weighing = &pass.weighing;
        let (floor, gain) = (self.source.channel_noise(), self.blocks.filter().noise_gain);
        let variance = |c: usize| weighing.total[c] * weighing.total[c] * conclusion.check.variance_scale;
        let left = self.left_by_signals(pass, conclusion);
        let of = |(c, channel): (usize, &crate::Channel)| ChannelFit {
            channel: channel.clone(),
            sigma: weighing.sigma[c],
            residual_rms: conclusion.residual_rms.get(c).copied().unwrap_or(0.0),
            measured_rms: self.measured_rms.get(c).copied().unwrap_or(0.0),
            measured_sd: self.measured_sd.get(c).copied().unwrap_or(0.0),
            noise_floor: floor.get(c).copied().unwrap_or(0.0),
            outliers: conclusion.outliers.get(c).copied().unwrap_or(0),
            rejected: self.rejected(c),
            residual_sigma: (variance(c) * gain).max(left.get(c).copied().unwrap_or(0.0)).sqrt(),
            autocorrelation: conclusion.coloured.iter().find(|k| k.channel == c).map(|k| k.found),
        };
        self.source.channels().iter().enumerate().map(of).collect()
    }

    /// Returns the variance of filtered residuals by channels, where noise of the signals has a spectrum of
    /// its own: of the parameters that residuals are about, those that count nothing included.
    fn left_by_signals(&self, pass: &Pass, conclusion: &Conclusion) -> Vec<f64> {
        let noise = self.noise.as_ref().filter(|_| pass.weighing.is_compensated());
        let Some(noise) = noise.filter(|_| !self.source.signal_noise_is_white()) else { return Vec::new() };
        let gain = self.blocks.filter().noise_gain;
        let own = pass.weighing.sigma.iter().map(|sigma| gain * sigma * sigma);
        let signals = noise.left(&conclusion.about.values, &pass.weighing);
        own.zip(signals).map(|(own, signals)| conclusion.check.variance_scale * (own + signals)).collect()
    }

    /// Returns the noise of the signals that rows were weighed by; nothing where it counts nothing.
    fn signal_fits(&self, pass: &Pass) -> Vec<SignalFit> {
        let Some(noise) = self.noise.as_ref().filter(|_| pass.weighing.is_compensated()) else {
            return Vec::new();
        };
        let of =
            |(noise, sigma): (&crate::SignalNoise, &f64)| SignalFit { noise: noise.clone(), sigma: *sigma };
        noise.groups().zip(&pass.weighing.signals).map(of).collect()
    }

    /// Returns the samples and rows counted.
    fn counts(&self) -> Counts {
        let counts = self.blocks.counts();
        let named = |(signal, count): (&u8, &u64)| (self.source.signal_name(*signal), *count);
        Counts {
            samples: counts.samples,
            rejected: counts.rejected,
            rejected_by_signal: counts.by_signal.iter().map(named).collect(),
            gaps: counts.gaps,
            blocks: self.blocks.len() as u64,
        }
    }

    /// Returns the seconds of rows that an answer rests on which forgets.
    fn forgotten(&self, span: Span<f64>, rows: u64) -> Forgotten {
        let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
        let blocks = rows as f64 / self.source.channels().len().max(1) as f64;
        Forgotten {
            is_window: matches!(span, Span::Window(_)),
            span_s,
            effective_s: blocks * self.blocks.filter().row_period_s(),
        }
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

/// Takes off the estimate, and off those on the way, what known errors move it by.
fn about(white: &mut Solution, convergence: &mut [Convergence], known: &DVector<f64>) {
    if known.iter().all(|v| *v == 0.0) {
        return;
    }
    white.factor = white.factor.about(known.as_slice());
    white.estimate.values.iter_mut().zip(known).for_each(|(value, by)| *value -= by);
    for point in convergence {
        let all = point.parameters.iter_mut().zip(known);
        all.for_each(|(measured, by)| measured.iter_mut().for_each(|m| m.value -= by));
    }
}

/// Widens the intervals of estimates on the way as those of the last.
fn widen(convergence: &mut [Convergence], by: &[f64]) {
    for (measured, by) in convergence.iter_mut().flat_map(|point| point.parameters.iter_mut().zip(by)) {
        measured.iter_mut().for_each(|measured| measured.u95 *= by);
    }
}
