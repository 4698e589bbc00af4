//! The fit of a source's rows: weights, nuisance parameters, outliers, autocorrelation, forgetting.

use nalgebra::{DMatrix, DVector};
use rigident_shared::forgetting::Span;

use super::autocorrelation::{self, Coloured};
use super::condition;
use super::convergence;
use super::forgetting::Memory;
use super::gains::{Gains, WithGains};
use super::outliers::{self, Reference, Watch, Weights};
use super::residuals::{measured_rms, raw_sigma, residuals, rms};
use super::signal_noise::{RowNoise, Spectrum};
use super::weighing::Weighing;
use super::{
    BlockResidual, ChannelFit, Convergence, Counts, DeviceFactor, Estimate, Factor, Fit, FitError,
    FitOptions, Forgotten, Kind, Noise, NoiseCheck, Progress, RowBlocks, RowSet, RowSource, judge, parallel,
};

/// Rounds of weights from residuals where no σ is stated: from the unweighted fit, then once more.
const SIGMA_ROUNDS: usize = 2;
/// Rounds of weights from the covariance of all noise, which the estimate is part of.
const WEIGHING_ROUNDS: usize = 4;
/// Done when no parameter moves by more than so many standard deviations.
const WEIGHING_SETTLED_SD: f64 = 0.1;
/// Noise of the signals does not count if it is at most this share of every channel's variance,
const NEGLIGIBLE_SHARE: f64 = 0.01;
/// and moves no parameter by more than so many standard deviations.
const NEGLIGIBLE_SD: f64 = 0.02;

/// A moment of inertia whose information is less than so many times what noise of the rates alone would bring is not
/// informed: noise in a coefficient attenuates the estimate by the inverse of this ratio.
pub const LEAST_EXCITATION: f64 = 20.0;

/// A moment of inertia whose information is at most so many times that is mostly noise: half of it and more.
const MOSTLY_NOISE: f64 = 2.0;

/// Fits the parameters of a source to its rows.
///
/// Samples are filtered to row blocks ([`RowSource::condition`]) and absorbed, whitened by the covariance of all noise: that
/// of the channels, and that which noise of the signals in the coefficients leaves in the residuals. What the latter adds to
/// the normal equations is taken off. Noise that is not stated comes from the residuals and from differences of the signals.
/// Gain errors are nuisance parameters; outliers are given less weight; the covariance is inflated where residuals are
/// larger than stated or autocorrelated.
///
/// # Errors
/// [`FitError`] if there are no rows, or a setting is impossible.
pub fn fit(source: &dyn RowSource, options: &FitOptions, progress: &dyn Progress) -> Result<Fit, FitError> {
    let engine = Engine::new(source, *options, progress)?;
    progress.stage("estimate", 0.0);
    let given = engine.stated_sigma();
    let sigma = given.clone().unwrap_or_else(|| source.nominal_sigma());
    engine.check(&sigma)?;
    match options.forgetting {
        Some(span) => engine.forgetting(span, sigma, given.is_some()),
        None => engine.batch(sigma, given.is_some()),
    }
}

/// Judges a factor that a device made by the samples that it was made of: residuals, outliers, gain errors,
/// autocorrelation and noise of the signals are found as in [`fit`].
///
/// Gain errors multiply the parameters, so a device's factor does not hold them: where a gain has a σ, the factor is made
/// anew from the samples.
///
/// # Errors
/// [`FitError`] if there are no rows, or the factor is of other parameters.
pub fn fit_device(
    source: &dyn RowSource,
    device: &DeviceFactor,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<Fit, FitError> {
    let mut engine = Engine::new(source, *options, progress)?;
    let parameters = engine.parameters;
    if device.factor.parameters() != parameters {
        return Err(FitError::Device { device: device.factor.parameters(), model: parameters });
    }
    let sigma = engine.stated_sigma().unwrap_or_else(|| source.nominal_sigma());
    engine.check(&sigma)?;
    // Where gains are uncertain the rows are made here, filtered.
    if !device.is_filtered && engine.gains.is_empty() {
        engine.row_noise_gain = 1.0;
    }
    let gains = Gains::new(source.channels(), parameters, false);
    let (weighing, weights) = (engine.diagonal(sigma), engine.no_weights());
    let mut pass = Pass { weighing, factor: device.factor.clone(), gains, weights };
    let made_anew = options.forgetting.is_none() && !engine.gains.is_empty();
    if made_anew {
        pass = engine.absorb(pass.weighing, engine.no_weights(), None);
    }
    let mut conclusion = engine.conclude(&pass, device.sigma_given);
    if let Some(span) = options.forgetting {
        engine.restrict(&mut conclusion, span, &pass.weighing);
    }
    if let Some(outliers) = &device.outliers {
        conclusion.outliers.clone_from(outliers);
    }
    let convergence = match options.forgetting {
        None => engine.convergence(&pass, &conclusion),
        Some(_) => Vec::new(),
    };
    engine.finish(pass, conclusion, convergence, options.forgetting)
}

/// A source with its row blocks.
struct Engine<'a> {
    source: &'a dyn RowSource,
    blocks: Box<dyn RowBlocks>,
    options: FitOptions,
    parameters: usize,
    /// Root mean square of the filtered measurements.
    measured_rms: Vec<f64>,
    gains: Gains<'a>,
    /// Noise of the signals in the rows.
    noise: Option<RowNoise>,
    row_noise_gain: f64,
    limit: f64,
}

/// Rows absorbed.
struct Pass<'a> {
    weighing: Weighing,
    /// Gain errors not eliminated; what noise of the signals adds is taken off.
    factor: Factor,
    /// What the gains' columns are linearised about.
    gains: Gains<'a>,
    weights: Weights,
}

/// What a pass says.
struct Conclusion {
    /// Gain errors eliminated.
    factor: Factor,
    /// The same beside the noise as it is, where it is larger than stated.
    solved: Option<Factor>,
    estimate: Estimate,
    /// The same, variance not scaled by the residuals.
    unscaled: Estimate,
    noise: Noise,
    check: NoiseCheck,
    gains: Vec<f64>,
    residuals: Vec<BlockResidual>,
    weights: Weights,
    outliers: Vec<u32>,
    residual_rms: Vec<f64>,
    coloured: Vec<Coloured>,
    /// Share of all row blocks that the factor holds.
    share: f64,
}

impl<'a> Engine<'a> {
    fn new(
        source: &'a dyn RowSource,
        options: FitOptions,
        progress: &dyn Progress,
    ) -> Result<Self, FitError> {
        let blocks = source.condition(progress)?;
        if blocks.is_empty() {
            return Err(condition::no_rows(&*blocks));
        }
        let (channels, parameters) = (source.channels(), source.parameters().len());
        let noise = RowNoise::of(source, &*blocks)?;
        // Gain errors exceed the noise.
        let uncertain = channels.iter().any(|c| c.gain_sigma > 0.0);
        Ok(Self {
            source,
            options,
            parameters,
            measured_rms: measured_rms(&*blocks, channels.len(), parameters),
            // Where older rows are forgotten gain errors are not told apart.
            gains: Gains::new(channels, parameters, options.forgetting.is_none()),
            noise,
            row_noise_gain: blocks.filter().row_noise_gain(),
            limit: if uncertain { 0.0 } else { outliers::LIMIT_SD },
            blocks,
        })
    }

    /// Returns the stated σ of all channels; `None` if one has none.
    fn stated_sigma(&self) -> Option<Vec<f64>> {
        self.source.channels().iter().map(|c| c.sigma).collect()
    }

    fn check(&self, sigma: &[f64]) -> Result<(), FitError> {
        let mut channels = self.source.channels().iter().zip(sigma);
        match channels.find(|(_, s)| !(s.is_finite() && **s > 0.0)) {
            Some((channel, sigma)) => Err(FitError::Sigma { channel: channel.name.clone(), sigma: *sigma }),
            None => Ok(()),
        }
    }

    fn no_weights(&self) -> Weights {
        Weights::none(self.source.channels().len())
    }

    /// Returns the information that noise of the rates alone brings to a moment of inertia in all row blocks, 1/(kg m²)².
    fn spurious_information(&self, sigma: &[f64]) -> f64 {
        let filter = self.blocks.filter();
        self.blocks.len() as f64
            * f64::from(filter.every)
            * filter.derivative_noise_gain
            * self.source.rate_sigma().powi(2)
            / self.moment_sigma(sigma).powi(2)
    }

    /// Returns the estimate without the values of moments of inertia that are mostly noise of the rates: they are drawn to
    /// nothing already. A moment that is less attenuated than that moves the others, informed or not.
    fn without_spurious(&self, estimate: &Estimate, spurious_information: f64) -> Estimate {
        let mut informed = estimate.clone();
        for (j, parameter) in self.source.parameters().iter().enumerate() {
            let information = 1.0 / estimate.covariance[(j, j)];
            if parameter.kind == Kind::Inertia && information <= MOSTLY_NOISE * spurious_information {
                informed.values[j] = 0.0;
            }
        }
        informed
    }

    /// Returns the weighing by σ of the channels alone.
    fn diagonal(&self, sigma: Vec<f64>) -> Weighing {
        Weighing::diagonal(sigma, f64::from(self.blocks.filter().every))
    }

    /// Absorbs all rows; where gains are uncertain as often as their columns move, from `about` on.
    fn absorb(&self, weighing: Weighing, weights: Weights, about: Option<&Gains<'a>>) -> Pass<'a> {
        let start = about.unwrap_or(&self.gains);
        let absorb = |gains: &Gains<'a>| self.factor_of(&weighing, &weights, gains);
        let (factor, gains) = start.settle(self.source.rounding(), absorb);
        Pass { weighing, factor, gains, weights }
    }

    fn factor_of(&self, weighing: &Weighing, weights: &Weights, gains: &Gains) -> Factor {
        let with_gains = WithGains { blocks: &*self.blocks, gains };
        let blocks: &dyn RowBlocks = if gains.is_empty() { &*self.blocks } else { &with_gains };
        let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
            let part = blocks.parts().get(k).cloned().unwrap_or_default();
            blocks.absorb(part, gains.columns(), &weighing.whitening, weights.as_slice())
        });
        let mut factor = Factor::new(gains.columns());
        let several = parts.len() > 1;
        for part in parts {
            if several { factor.merge(&part) } else { factor = part }
        }
        match &self.noise {
            Some(noise) if weighing.is_compensated() => {
                weighing.compensate(&factor, &noise.gram(weighing, gains), self.source.rounding())
            }
            _ => factor,
        }
    }

    /// Weighs the rows by the covariance of all noise, and takes off what noise in the coefficients adds, until the estimate
    /// stays where it is.
    fn refine(&self, pass: Pass<'a>, sigma_given: bool) -> Pass<'a> {
        let Some(noise) = self.noise.as_ref().filter(|_| self.source.signal_noise_is_known()) else {
            return pass;
        };
        let (filter, rounding) = (self.blocks.filter(), self.source.rounding());
        let mut pass = pass;
        let mut before: Option<Estimate> = None;
        for _ in 0..WEIGHING_ROUNDS {
            let (factor, errors) = pass.gains.eliminate(&pass.factor, 1.0, rounding);
            let estimate = self.estimate(&factor, 1.0, Noise::Given);
            if before.as_ref().is_some_and(|before| estimate.largest_step(before) < WEIGHING_SETTLED_SD) {
                break;
            }
            let first = !pass.weighing.is_compensated();
            let informed = if first {
                self.without_spurious(&estimate, self.spurious_information(&pass.weighing.sigma))
            } else {
                estimate.clone()
            };
            let phi = Weighing::significant(&informed, first);
            let spectra = noise.spectra(&phi, &pass.weighing, filter);
            if first && self.is_negligible(noise, &spectra, &pass, &estimate, &phi) {
                break;
            }
            let residuals = (!sigma_given).then(|| {
                let residuals = self.residuals(&estimate.values, &errors, &pass.weights);
                Weighing::covariance_of(&residuals, &estimate, filter)
            });
            let Some(weighing) = pass.weighing.with_signals(noise, &spectra, residuals.as_ref(), filter)
            else {
                return pass;
            };
            pass = self.absorb(weighing, pass.weights, Some(&pass.gains));
            before = Some(estimate);
        }
        pass
    }

    /// Returns true if noise of the signals is a small part of that in the residuals, and moves no parameter by much of its
    /// standard deviation: the channels' own weights are then as good, and cost less.
    fn is_negligible(
        &self,
        noise: &RowNoise,
        spectra: &[Spectrum],
        pass: &Pass,
        estimate: &Estimate,
        phi: &[f64],
    ) -> bool {
        if noise.share(spectra, &pass.weighing, self.blocks.filter()) > NEGLIGIBLE_SHARE {
            return false;
        }
        let gram = noise.gram(&pass.weighing, &self.gains.none());
        let moved = &estimate.covariance * (gram * DVector::from_column_slice(phi));
        (0..estimate.len())
            .filter(|j| estimate.is_determined(*j))
            .all(|j| moved[j].abs() <= NEGLIGIBLE_SD * estimate.covariance[(j, j)].max(0.0).sqrt())
    }

    fn estimate(&self, factor: &Factor, scale: f64, noise: Noise) -> Estimate {
        Estimate::new(factor, self.source.rounding(), scale, noise)
    }

    fn residuals(&self, parameters: &[f64], gains: &[f64], weights: &Weights) -> Vec<BlockResidual> {
        residuals(&*self.blocks, self.source.channels(), parameters, gains, weights)
    }

    /// Returns σ of the channels from what a pass leaves.
    fn sigma_from_residuals(&self, pass: &Pass) -> Vec<f64> {
        let (factor, gains) = pass.gains.eliminate(&pass.factor, 1.0, self.source.rounding());
        let estimate = self.estimate(&factor, 1.0, Noise::Given);
        let residuals = self.residuals(&estimate.values, &gains, &pass.weights);
        raw_sigma(&*self.blocks, self.source.channels(), &self.measured_rms, &estimate, &residuals)
    }

    fn batch(&self, sigma: Vec<f64>, sigma_given: bool) -> Result<Fit, FitError> {
        let mut pass = self.absorb(self.diagonal(sigma), self.no_weights(), None);
        if !sigma_given {
            for _ in 0..SIGMA_ROUNDS {
                pass = self.absorb(
                    self.diagonal(self.sigma_from_residuals(&pass)),
                    pass.weights,
                    Some(&pass.gains),
                );
            }
        }
        pass = self.refine(pass, sigma_given);
        let mut conclusion = self.conclude(&pass, sigma_given);
        for _ in 0..outliers::MOST_ROUNDS {
            if conclusion.outliers.iter().all(|count| *count == 0) {
                break;
            }
            let reference = self.reference(&conclusion);
            let weights = Weights::of(&*self.blocks, &reference, &pass.weighing.total);
            pass = self.absorb(pass.weighing, weights, Some(&pass.gains));
            if !sigma_given {
                let sigma = self.sigma_from_residuals(&pass);
                pass = self.absorb(self.diagonal(sigma), pass.weights, Some(&pass.gains));
            }
            pass = self.refine(pass, sigma_given);
            conclusion = self.conclude(&pass, sigma_given);
        }
        let convergence = self.convergence(&pass, &conclusion);
        self.finish(pass, conclusion, convergence, None)
    }

    fn reference(&self, conclusion: &Conclusion) -> Reference {
        Reference::of(&conclusion.estimate, conclusion.check.variance_ratio, self.limit)
    }

    /// Draws the conclusions from a factor.
    fn conclude(&self, pass: &Pass, sigma_given: bool) -> Conclusion {
        let eliminated = |scale: f64| pass.gains.eliminate(&pass.factor, scale, self.source.rounding());
        let (factor, mut gains) = eliminated(1.0);
        let mut unscaled = self.estimate(&factor, 1.0, Noise::Given);
        let set = RowSet {
            rows: factor.rows(),
            channels: self.source.channels().len(),
            noise_gain: self.row_noise_gain,
            sigma_given,
        };
        let judged = judge(&[set], factor.residual_sum_of_squares(), unscaled.rank() as f64);
        let (noise, scale) = (judged.noise, judged.variance_scale);
        let check = NoiseCheck {
            sigma_given,
            noise_gain: self.row_noise_gain,
            variance_ratio: judged.variance_ratio,
            variance_scale: scale,
            disagreement: None,
        };
        // The prior of the gains is not the noise's to scale.
        let mut solved = None;
        if scale > 1.0 && !pass.gains.is_empty() {
            let (true_noise, true_gains) = eliminated(scale);
            let estimate = self.estimate(&true_noise, 1.0, Noise::Given);
            unscaled = Estimate { covariance: &estimate.covariance / scale, ..estimate };
            (solved, gains) = (Some(true_noise), true_gains);
        }
        let estimate = Estimate { covariance: &unscaled.covariance * scale, noise, ..unscaled.clone() };
        let reference = Reference::of(&estimate, check.variance_ratio, self.limit);
        let weights = Weights::of(&*self.blocks, &reference, &pass.weighing.total);
        let residuals = self.residuals(&estimate.values, &gains, &weights);
        let mut conclusion = Conclusion {
            factor,
            solved,
            estimate,
            unscaled,
            noise,
            check,
            gains,
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

    fn coloured(
        &self,
        residuals: &[BlockResidual],
        weighing: &Weighing,
        check: &NoiseCheck,
    ) -> Vec<Coloured> {
        let variance: Vec<f64> = weighing.total.iter().map(|s| s * s * check.variance_scale).collect();
        autocorrelation::detect(residuals, self.blocks.filter(), &variance)
    }

    fn convergence(&self, pass: &Pass, conclusion: &Conclusion) -> Vec<Convergence> {
        let points = self.options.convergence_points;
        if points == 0 || self.blocks.filter().response.is_empty() {
            return Vec::new();
        }
        let scale = conclusion.check.variance_scale;
        let gram = self.noise.as_ref().filter(|_| pass.weighing.is_compensated());
        let way = convergence::Way {
            blocks: &*self.blocks,
            rounding: self.source.rounding(),
            weighing: &pass.weighing,
            gram: gram.map(|noise| noise.gram(&pass.weighing, &pass.gains)),
            weights: pass.weights.as_slice(),
            gains: &pass.gains,
            scale,
            noise: conclusion.noise,
        };
        way.points(points)
    }

    /// Counts what makes intervals wider than white noise alone, and puts everything together.
    fn finish(
        &self,
        pass: Pass,
        conclusion: Conclusion,
        mut convergence: Vec<Convergence>,
        forgetting: Option<Span<f64>>,
    ) -> Result<Fit, FitError> {
        let Conclusion { mut factor, mut solved, mut estimate, unscaled, check, .. } = conclusion;
        let weighing = &pass.weighing;
        let variance: Vec<f64> = weighing.total.iter().map(|s| s * s * check.variance_scale).collect();
        let mut inflation = Vec::new();
        if !conclusion.coloured.is_empty() && forgetting.is_none() {
            let coloured = &conclusion.coloured;
            inflation = autocorrelation::inflation(
                &*self.blocks,
                &estimate,
                &weighing.whitening,
                &conclusion.weights,
                &variance,
                coloured,
            );
        }
        // What is compensated moves no estimate and informs of nothing.
        let (mut spurious_information, mut bias) = (0.0, Vec::new());
        if let Some(noise) = self.noise.as_ref().filter(|_| !weighing.is_compensated()) {
            spurious_information = conclusion.share * self.spurious_information(&weighing.sigma);
            let informed = self.without_spurious(&unscaled, spurious_information);
            let known = |j: usize| if informed.is_determined(j) { informed.values[j] } else { 0.0 };
            let informed = DVector::from_fn(self.parameters, |j, _| known(j));
            let pull: DMatrix<f64> = noise.gram(weighing, &self.gains.none()) * conclusion.share;
            bias = (&unscaled.covariance * (pull * informed)).iter().map(|b| -b).collect();
        }
        let by: Vec<f64> = (0..self.parameters)
            .map(|j| {
                let white = estimate.covariance[(j, j)].max(0.0).sqrt();
                let coloured = inflation.get(j).copied().unwrap_or(1.0) * white;
                let bias = bias.get(j).copied().unwrap_or(0.0);
                if white > 0.0 { coloured.hypot(bias) / white } else { 1.0 }
            })
            .collect();
        if by.iter().any(|by| *by > 1.0) {
            factor = factor.inflate(&estimate.values, &by);
            solved = solved.map(|rows| rows.inflate(&estimate.values, &by));
            estimate = estimate.inflate(&by);
        }
        let widened = if by.iter().any(|by| *by > 1.0) { by.clone() } else { Vec::new() };
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
        let channel_fits = channels.iter().enumerate().map(|(c, channel)| ChannelFit {
            channel: channel.clone(),
            sigma: weighing.sigma[c],
            residual_rms: conclusion.residual_rms.get(c).copied().unwrap_or(0.0),
            measured_rms: self.measured_rms.get(c).copied().unwrap_or(0.0),
            gain: conclusion.gains.get(c).copied().unwrap_or(0.0),
            outliers: conclusion.outliers.get(c).copied().unwrap_or(0),
            rejected: self.rejected(c),
            residual_sigma: (variance[c] * filter.noise_gain).sqrt(),
            autocorrelation: conclusion.coloured.iter().find(|k| k.channel == c).map(|k| k.found),
        });
        let channel_fits = channel_fits.collect();
        Ok(Fit {
            parameters: self.source.parameters().to_vec(),
            channels: channel_fits,
            solved,
            rounding: self.source.rounding(),
            model_fingerprint: self.source.model_fingerprint(),
            fingerprints: vec![self.source.fingerprint()],
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
            noise: check,
            residuals: conclusion.residuals,
            filter,
            factor,
            estimate,
            convergence,
        })
    }

    /// Returns the samples rejected because of a channel.
    fn rejected(&self, channel: usize) -> u32 {
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

    /// Returns the least σ of the channels that measure a moment; of all if none does.
    fn moment_sigma(&self, sigma: &[f64]) -> f64 {
        let least = |moments: bool| {
            let of = self.source.channels().iter().zip(sigma);
            of.filter(|(c, _)| !moments || c.unit == "N m").map(|(_, s)| *s).fold(f64::INFINITY, f64::min)
        };
        let moments = least(true);
        if moments.is_finite() { moments } else { least(false) }
    }
}

/// Forgetting: one pass in the order of time, as the device does it.
impl Engine<'_> {
    fn forgetting(&self, span: Span<f64>, sigma: Vec<f64>, sigma_given: bool) -> Result<Fit, FitError> {
        let (mut pass, mut convergence) = self.remember(span, sigma)?;
        if !sigma_given {
            for _ in 0..SIGMA_ROUNDS {
                let sigma = self.sigma_of_the_remembered(span, &pass);
                (pass, convergence) = self.remember(span, sigma)?;
            }
        }
        let mut conclusion = self.conclude(&pass, sigma_given);
        conclusion.outliers.clone_from(&pass.weights.outliers);
        self.restrict(&mut conclusion, span, &pass.weighing);
        // Intervals as wide as the result's, which is known only now.
        let wider = conclusion.check.variance_scale.sqrt() * conclusion.noise.coverage_factor()
            / Noise::Given.coverage_factor();
        for measured in convergence.iter_mut().flat_map(|point| point.parameters.iter_mut().flatten()) {
            measured.u95 *= wider;
        }
        self.finish(pass, conclusion, convergence, Some(span))
    }

    /// Restricts what residuals say to the rows that are remembered.
    fn restrict(&self, conclusion: &mut Conclusion, span: Span<f64>, weighing: &Weighing) {
        let channels = self.source.channels().len();
        let blocks = conclusion.factor.rows() as f64 / channels.max(1) as f64;
        conclusion.share = blocks / self.blocks.len().max(1) as f64;
        let recent = recent(&conclusion.residuals, span);
        conclusion.residual_rms = rms(recent, channels);
        conclusion.coloured = self.coloured(recent, weighing, &conclusion.check);
    }

    fn sigma_of_the_remembered(&self, span: Span<f64>, pass: &Pass) -> Vec<f64> {
        let estimate = self.estimate(&pass.factor, 1.0, Noise::Given);
        let weights =
            Weights::of(&*self.blocks, &Reference::of(&estimate, 1.0, self.limit), &pass.weighing.total);
        let residuals = self.residuals(&estimate.values, &vec![0.0; pass.weighing.sigma.len()], &weights);
        let channels = self.source.channels();
        raw_sigma(&*self.blocks, channels, &self.measured_rms, &estimate, recent(&residuals, span))
    }

    /// Returns the root mean square, per whitened row, of what noise of the signals brings to the coefficients.
    fn coefficient_noise(&self, weighing: &Weighing) -> Vec<f64> {
        let rows = (self.blocks.len() * weighing.sigma.len()).max(1) as f64;
        match &self.noise {
            Some(noise) => {
                let gram = noise.gram(weighing, &self.gains);
                gram.diagonal().iter().map(|square| (square / rows).sqrt()).collect()
            }
            None => vec![0.0; self.parameters],
        }
    }

    fn remember(&self, span: Span<f64>, sigma: Vec<f64>) -> Result<(Pass<'_>, Vec<Convergence>), FitError> {
        let (blocks, channels, n) = (&*self.blocks, sigma.len(), self.parameters);
        let filter = blocks.filter();
        let weighing = self.diagonal(sigma);
        let noise = match self.source.coefficient_noise(filter, &weighing.sigma) {
            Some(noise) => noise,
            None => self.coefficient_noise(&weighing),
        };
        let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
        let mut memory = Memory::new(span, filter, noise, channels)
            .ok_or(FitError::Forgetting { span_s, width_s: filter.width_s })?;
        let whitening = &weighing.whitening;
        let every = convergence::every(blocks, self.options.convergence_points, n);
        let mut watch = Watch::new(&weighing.sigma, filter.noise_gain);
        let mut weights = Weights::none(channels);
        let mut reference: Option<Reference> = None;
        // First block that is not in the memory.
        let mut waiting = 0;
        let (mut rows, mut measured, mut own) =
            (vec![0.0; channels * n], vec![0.0; channels], vec![1.0; channels]);
        let mut points = Vec::new();
        for block in 0..blocks.len() {
            blocks.write(block, &mut rows, &mut measured);
            if let Some(reference) = &reference
                && watch.weigh(reference, &rows, &measured, &mut own)
            {
                weights.set(block, blocks.len(), &own);
            }
            if block + 1 - waiting >= memory.segment_blocks as usize {
                memory.take(&blocks.absorb(waiting..block + 1, n, whitening, weights.as_slice()));
                waiting = block + 1;
                let whole = memory.factor();
                let deviations = whole.standard_deviations();
                if let Some(parameters) = whole.well_determined(&deviations) {
                    memory.recentre(&parameters);
                    let before = reference.iter().flat_map(|r| &r.standard_deviation);
                    // One that a segment makes twice as good was no measure of the noise.
                    if before.zip(&deviations).any(|(before, now)| now + now < *before) {
                        watch.forget_statistics();
                    }
                    let limit = self.limit;
                    reference = Some(Reference {
                        parameters,
                        standard_deviation: deviations,
                        noise_scale: 1.0,
                        limit,
                    });
                }
            }
            if every > 0 && (block + 1) % every == 0 {
                let mut whole = memory.factor();
                whole.merge(&blocks.absorb(waiting..block + 1, n, whitening, weights.as_slice()));
                let estimate = self.estimate(&whole, 1.0, Noise::Given);
                points.push(Convergence {
                    time_s: blocks.time_s(block),
                    parameters: (0..n).map(|j| estimate.measured(j)).collect(),
                });
            }
        }
        let mut factor = memory.factor();
        factor.merge(&blocks.absorb(waiting..blocks.len(), n, whitening, weights.as_slice()));
        Ok((Pass { weighing, factor, gains: self.gains.clone(), weights }, points))
    }
}

/// Returns the residuals of the last seconds, as many as the span.
fn recent(residuals: &[BlockResidual], span: Span<f64>) -> &[BlockResidual] {
    let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
    let end_s = residuals.last().map_or(0.0, |r| r.time_s);
    let first = residuals.partition_point(|r| r.time_s < end_s - span_s);
    residuals.get(first..).unwrap_or(residuals)
}
