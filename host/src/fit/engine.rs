//! The fit of a source's rows: weights, nuisance parameters, outliers, autocorrelation, forgetting.

use nalgebra::DMatrix;
use rigident_shared::forgetting::Span;

use super::autocorrelation::{self, Coloured};
use super::condition;
use super::convergence;
use super::forgetting::Memory;
use super::gains::ChannelFactors;
use super::outliers::{self, Reference, Watch, Weights};
use super::compensation::compensate;
use super::residuals::{measured_rms, raw_sigma, residuals, rms};
use super::signal_noise::RowNoise;
use super::variance_components::explain;
use super::{
    BlockResidual, ChannelFit, Convergence, Counts, DeviceFactor, Estimate, Factor, Fit, FitError,
    FitOptions, Forgotten, Kind, Noise, NoiseCheck, Progress, RowBlocks, RowSet, RowSource, SignalNoise,
    Whitening, judge, parallel,
};

/// Rounds of weights from residuals where no σ is stated: from the unweighted fit, then once more.
const SIGMA_ROUNDS: usize = 2;
/// Rounds of the full covariance in the estimate.
const GLS_ROUNDS: usize = 3;
/// A parameter counts in the covariance of the noise if it differs from zero by so many standard deviations.
const SIGNIFICANT_SD: f64 = 2.0;

/// A moment of inertia whose information is less than so many times what noise of the rates alone would bring is not
/// informed: noise in a coefficient attenuates the estimate by the inverse of this ratio.
pub const LEAST_EXCITATION: f64 = 20.0;

/// A moment of inertia whose information is at most so many times that is mostly noise: half of it and more.
const MOSTLY_NOISE: f64 = 2.0;

/// Fits the parameters of a source to its rows.
///
/// Samples are filtered to row blocks ([`RowSource::condition`]) and absorbed, whitened by σ of their channels; where not all
/// σ are stated all come from the residuals. Gain errors are nuisance parameters; outliers are given less weight; the
/// covariance is inflated where residuals are larger than stated or autocorrelated, or the signals' noise moves the
/// estimate.
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
    if !device.is_filtered && engine.channel_factors.is_none() {
        engine.row_noise_gain = 1.0;
    }
    let whitening = Whitening::diagonal(&engine.weights_of(&sigma, 1.0));
    let pass = Pass {
        total: sigma.clone(),
        signals: Vec::new(),
        sigma,
        whitening,
        factor: device.factor.clone(),
        weights: engine.no_weights(),
    };
    let mut conclusion = engine.conclude(&pass, device.sigma_given, options.forgetting.is_none());
    if let Some(span) = options.forgetting {
        engine.restrict(&mut conclusion, span, &pass.sigma);
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
    channel_factors: Option<ChannelFactors<'a>>,
    row_noise_gain: f64,
    limit: f64,
    /// Noise of the signals in the rows.
    noise: Option<RowNoise>,
}

/// Rows absorbed.
struct Pass {
    /// σ of the channels.
    sigma: Vec<f64>,
    /// The same with what noise of the signals leaves in the residuals.
    total: Vec<f64>,
    /// 1 σ of the signals' noise, by groups.
    signals: Vec<f64>,
    whitening: Whitening,
    /// Gain errors not eliminated.
    factor: Factor,
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
        // Where older rows are forgotten gain errors are not told apart.
        let channel_factors = match options.forgetting {
            None => ChannelFactors::of(&*blocks, parameters, channels),
            Some(_) => None,
        };
        // Gain errors exceed the noise.
        let uncertain = channels.iter().any(|c| c.gain_sigma > 0.0);
        let noise = match (&channel_factors, options.forgetting) {
            (None, None) => RowNoise::of(source, &*blocks)?,
            _ => None,
        };
        Ok(Self {
            noise,
            source,
            options,
            parameters,
            measured_rms: measured_rms(&*blocks, channels.len(), parameters),
            channel_factors,
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

    /// Returns what multiplies the rows of each channel where the noise's variance is `scale` times as large.
    fn weights_of(&self, sigma: &[f64], scale: f64) -> Vec<f64> {
        let root = (f64::from(self.blocks.filter().every) / scale).sqrt();
        sigma.iter().map(|s| root / s).collect()
    }

    fn absorb(&self, sigma: Vec<f64>, reference: Option<&Reference>) -> Pass {
        let weights = match reference {
            Some(reference) => Weights::of(&*self.blocks, reference, &sigma),
            None => self.no_weights(),
        };
        let whitening = Whitening::diagonal(&self.weights_of(&sigma, 1.0));
        let factor = self.factor_of(&whitening, &weights);
        Pass { total: sigma.clone(), signals: Vec::new(), sigma, whitening, factor, weights }
    }

    fn factor_of(&self, whitening: &Whitening, weights: &Weights) -> Factor {
        let blocks = &*self.blocks;
        let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
            let part = blocks.parts().get(k).cloned().unwrap_or_default();
            blocks.absorb(part, self.parameters, whitening, weights.as_slice())
        });
        let mut factor = Factor::new(self.parameters);
        let several = parts.len() > 1;
        for part in parts {
            if several { factor.merge(&part) } else { factor = part }
        }
        factor
    }

    /// Weighs the rows by the covariance of all noise, and takes off what noise in the coefficients adds.
    fn refine(&self, pass: Pass, sigma_given: bool) -> Pass {
        let Some(noise) = &self.noise else { return pass };
        let (channels, n) = (pass.sigma.len(), self.parameters);
        let filter = self.blocks.filter();
        let mut pass = pass;
        for _ in 0..GLS_ROUNDS {
            let estimate = self.estimate(&pass.factor, 1.0, Noise::Given);
            let phi = self.significant(&estimate, pass.signals.is_empty(), &pass.sigma);
            let spectra = noise.spectra(&phi, channels, filter);
            let rise = filter.derivative_noise_gain / filter.noise_gain;
            let spread: Vec<_> = spectra.iter().map(|s| &s.white + &s.rising * rise).collect();
            let groups: Vec<_> = noise.groups().cloned().collect();
            let mut signals: Vec<f64> = groups.iter().map(|g| g.stated.unwrap_or(g.found)).collect();
            let mut sigma = pass.sigma.clone();
            if !sigma_given {
                let left = self.residual_covariance(&pass, &estimate);
                let count = self.blocks.len() as f64 * filter.row_noise_gain().min(1.0);
                (sigma, signals) = shares_of_noise(&left, &spread, &groups, &sigma, count);
            }
            let mut white = DMatrix::from_fn(channels, channels, |i, j| {
                if i == j { sigma[i] * sigma[i] } else { 0.0 }
            });
            let mut rising = DMatrix::zeros(channels, channels);
            for (spectrum, sigma) in spectra.iter().zip(&signals) {
                white += &spectrum.white * (sigma * sigma);
                rising += &spectrum.rising * (sigma * sigma);
            }
            let covariance = &white + &rising * rise;
            let every = f64::from(filter.every);
            let Some(whitening) = Whitening::of_spectrum(&white, &rising, every, filter.row_period_s()) else {
                return pass;
            };
            let raw = self.factor_of(&whitening, &pass.weights);
            let gram = noise.gram(&whitening, n, &signals);
            pass = Pass {
                factor: compensate(&raw, &gram, self.source.rounding()),
                total: (0..channels).map(|c| covariance[(c, c)].sqrt()).collect(),
                sigma,
                signals,
                whitening,
                weights: pass.weights,
            };
        }
        pass
    }

    /// Returns the values that the rows say something of, the others zero; in the `first` round noise of the rates is in the
    /// estimate still.
    fn significant(&self, estimate: &Estimate, first: bool, sigma: &[f64]) -> Vec<f64> {
        let informed = if first {
            self.without_spurious(estimate, self.spurious_information(sigma)).values
        } else {
            estimate.values.clone()
        };
        let values = informed.into_iter().enumerate();
        values
            .map(|(j, value)| {
                let known = estimate.is_determined(j)
                    && (first || value.abs() > SIGNIFICANT_SD * estimate.covariance[(j, j)].max(0.0).sqrt());
                if known { value } else { 0.0 }
            })
            .collect()
    }

    /// Returns the covariance of the residuals per sample, C × C.
    fn residual_covariance(&self, pass: &Pass, estimate: &Estimate) -> DMatrix<f64> {
        let channels = pass.sigma.len();
        let residuals = self.residuals(&estimate.values, &vec![0.0; channels], &pass.weights);
        let per_channel = estimate.rank() as f64 / channels.max(1) as f64;
        let filter = self.blocks.filter();
        let dof = (residuals.len() as f64 * filter.row_noise_gain().min(1.0) - per_channel).max(1.0);
        let left = dof / (dof + per_channel);
        let mut sum = DMatrix::zeros(channels, channels);
        for residual in &residuals {
            for i in 0..channels {
                for j in 0..channels {
                    sum[(i, j)] += residual.weighted(i) * residual.weighted(j);
                }
            }
        }
        sum / (residuals.len().max(1) as f64 * filter.noise_gain * left)
    }

    /// Returns the factor with the gain errors eliminated, the noise's variance taken `scale` times as large beside their
    /// prior, and the gain errors.
    fn with_gains(&self, pass: &Pass, scale: f64) -> (Factor, Vec<f64>) {
        match &self.channel_factors {
            None => (pass.factor.clone(), vec![0.0; pass.sigma.len()]),
            Some(factors) => {
                let whitening = self.weights_of(&pass.sigma, scale);
                let (factor, gains) = factors.fit(&whitening, self.source.rounding());
                (factor, gains)
            }
        }
    }

    fn estimate(&self, factor: &Factor, scale: f64, noise: Noise) -> Estimate {
        Estimate::new(factor, self.source.rounding(), scale, noise)
    }

    fn residuals(&self, parameters: &[f64], gains: &[f64], weights: &Weights) -> Vec<BlockResidual> {
        residuals(&*self.blocks, self.source.channels(), parameters, gains, weights)
    }

    /// Returns σ of the channels from what a pass leaves.
    fn sigma_from_residuals(&self, pass: &Pass) -> Vec<f64> {
        let (factor, gains) = self.with_gains(pass, 1.0);
        let estimate = self.estimate(&factor, 1.0, Noise::Given);
        let residuals = self.residuals(&estimate.values, &gains, &pass.weights);
        raw_sigma(&*self.blocks, self.source.channels(), &self.measured_rms, &estimate, &residuals)
    }

    fn batch(&self, sigma: Vec<f64>, sigma_given: bool) -> Result<Fit, FitError> {
        let mut pass = self.absorb(sigma, None);
        if !sigma_given {
            for _ in 0..SIGMA_ROUNDS {
                pass = self.absorb(self.sigma_from_residuals(&pass), None);
            }
        }
        pass = self.refine(pass, sigma_given);
        let mut conclusion = self.conclude(&pass, sigma_given, true);
        for _ in 0..outliers::MOST_ROUNDS {
            if conclusion.outliers.iter().all(|count| *count == 0) {
                break;
            }
            let reference = self.reference(&conclusion);
            pass = self.absorb(pass.sigma, Some(&reference));
            if !sigma_given {
                pass = self.absorb(self.sigma_from_residuals(&pass), Some(&reference));
            }
            pass = self.refine(pass, sigma_given);
            conclusion = self.conclude(&pass, sigma_given, true);
        }
        let convergence = self.convergence(&pass, &conclusion);
        self.finish(pass, conclusion, convergence, None)
    }

    fn reference(&self, conclusion: &Conclusion) -> Reference {
        Reference::of(&conclusion.estimate, conclusion.check.variance_ratio, self.limit)
    }

    /// Draws the conclusions from a factor; `with_gains` if it is of all rows.
    fn conclude(&self, pass: &Pass, sigma_given: bool, with_gains: bool) -> Conclusion {
        let eliminated = |scale: f64| {
            if with_gains {
                self.with_gains(pass, scale)
            } else {
                (pass.factor.clone(), vec![0.0; pass.sigma.len()])
            }
        };
        let (factor, mut gains) = eliminated(1.0);
        let mut unscaled = self.estimate(&factor, 1.0, Noise::Given);
        let set = RowSet {
            rows: factor.rows(),
            channels: pass.sigma.len(),
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
        if scale > 1.0 && self.channel_factors.is_some() && with_gains {
            let (true_noise, true_gains) = eliminated(scale);
            let estimate = self.estimate(&true_noise, 1.0, Noise::Given);
            unscaled = Estimate { covariance: &estimate.covariance / scale, ..estimate };
            (solved, gains) = (Some(true_noise), true_gains);
        }
        let estimate = Estimate { covariance: &unscaled.covariance * scale, noise, ..unscaled.clone() };
        let reference = Reference::of(&estimate, check.variance_ratio, self.limit);
        let weights = Weights::of(&*self.blocks, &reference, &pass.total);
        let residuals = self.residuals(&estimate.values, &gains, &weights);
        let mut conclusion = Conclusion {
            factor,
            solved,
            estimate,
            unscaled,
            noise,
            check,
            gains,
            residual_rms: rms(&residuals, pass.sigma.len()),
            residuals,
            outliers: weights.outliers.clone(),
            weights,
            coloured: Vec::new(),
            share: 1.0,
        };
        conclusion.coloured = self.coloured(&conclusion.residuals, &pass.total, &conclusion.check);
        conclusion
    }

    fn coloured(&self, residuals: &[BlockResidual], sigma: &[f64], check: &NoiseCheck) -> Vec<Coloured> {
        let variance: Vec<f64> = sigma.iter().map(|s| s * s * check.variance_scale).collect();
        autocorrelation::detect(residuals, self.blocks.filter(), &variance)
    }

    fn convergence(&self, pass: &Pass, conclusion: &Conclusion) -> Vec<Convergence> {
        let points = self.options.convergence_points;
        if points == 0 || self.blocks.filter().response.is_empty() {
            return Vec::new();
        }
        let scale = conclusion.check.variance_scale;
        let way = convergence::Way {
            blocks: &*self.blocks,
            parameters: self.parameters,
            rounding: self.source.rounding(),
            whitening: &pass.whitening,
            channel_weights: self.weights_of(&pass.sigma, scale),
            weights: pass.weights.as_slice(),
            channels: self.channel_factors.as_ref().map(|_| self.source.channels()),
            scale: if self.channel_factors.is_some() { 1.0 } else { scale },
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
        let Conclusion { mut factor, mut solved, mut estimate, check, .. } = conclusion;
        let sigma = pass.sigma;
        let variance: Vec<f64> = pass.total.iter().map(|s| s * s * check.variance_scale).collect();
        let mut inflation = Vec::new();
        if !conclusion.coloured.is_empty() && forgetting.is_none() {
            let coloured = &conclusion.coloured;
            inflation = autocorrelation::inflation(
                &*self.blocks,
                &estimate,
                &pass.whitening,
                &conclusion.weights,
                &variance,
                coloured,
            );
        }
        let spurious_information = conclusion.share * self.spurious_information(&sigma);
        let bias: Vec<f64> = Vec::new();
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
            sigma: sigma[c],
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
        let mut conclusion = self.conclude(&pass, sigma_given, false);
        conclusion.outliers.clone_from(&pass.weights.outliers);
        self.restrict(&mut conclusion, span, &pass.sigma);
        // Intervals as wide as the result's, which is known only now.
        let wider = conclusion.check.variance_scale.sqrt() * conclusion.noise.coverage_factor()
            / Noise::Given.coverage_factor();
        for measured in convergence.iter_mut().flat_map(|point| point.parameters.iter_mut().flatten()) {
            measured.u95 *= wider;
        }
        self.finish(pass, conclusion, convergence, Some(span))
    }

    /// Restricts what residuals say to the rows that are remembered.
    fn restrict(&self, conclusion: &mut Conclusion, span: Span<f64>, sigma: &[f64]) {
        let channels = self.source.channels().len();
        let blocks = conclusion.factor.rows() as f64 / channels.max(1) as f64;
        conclusion.share = blocks / self.blocks.len().max(1) as f64;
        let recent = recent(&conclusion.residuals, span);
        conclusion.residual_rms = rms(recent, channels);
        conclusion.coloured = self.coloured(recent, sigma, &conclusion.check);
    }

    fn sigma_of_the_remembered(&self, span: Span<f64>, pass: &Pass) -> Vec<f64> {
        let estimate = self.estimate(&pass.factor, 1.0, Noise::Given);
        let weights = Weights::of(&*self.blocks, &Reference::of(&estimate, 1.0, self.limit), &pass.sigma);
        let residuals = self.residuals(&estimate.values, &vec![0.0; pass.sigma.len()], &weights);
        let channels = self.source.channels();
        raw_sigma(&*self.blocks, channels, &self.measured_rms, &estimate, recent(&residuals, span))
    }

    fn remember(&self, span: Span<f64>, sigma: Vec<f64>) -> Result<(Pass, Vec<Convergence>), FitError> {
        let (blocks, channels, n) = (&*self.blocks, sigma.len(), self.parameters);
        let filter = blocks.filter();
        let noise = match self.source.coefficient_noise(filter, &sigma) {
            Some(noise) => noise,
            None => vec![0.0; n],
        };
        let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
        let mut memory = Memory::new(span, filter, noise, channels)
            .ok_or(FitError::Forgetting { span_s, width_s: filter.width_s })?;
        let whitening = Whitening::diagonal(&self.weights_of(&sigma, 1.0));
        let every = convergence::every(blocks, self.options.convergence_points, n);
        let mut watch = Watch::new(&sigma, filter.noise_gain);
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
                memory.take(&blocks.absorb(waiting..block + 1, n, &whitening, weights.as_slice()));
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
                whole.merge(&blocks.absorb(waiting..block + 1, n, &whitening, weights.as_slice()));
                let estimate = self.estimate(&whole, 1.0, Noise::Given);
                points.push(Convergence {
                    time_s: blocks.time_s(block),
                    parameters: (0..n).map(|j| estimate.measured(j)).collect(),
                });
            }
        }
        let mut factor = memory.factor();
        factor.merge(&blocks.absorb(waiting..blocks.len(), n, &whitening, weights.as_slice()));
        let pass = Pass { total: sigma.clone(), signals: Vec::new(), sigma, whitening, factor, weights };
        Ok((pass, points))
    }
}

/// Returns σ of the channels and of the signals by groups that explain the covariance of residuals.
///
/// What is stated counts as stated. The rest of the groups explain what is beside the diagonal, by least squares, as far as
/// differences of their signals allow; the channels have what is left on it.
fn shares_of_noise(
    left: &DMatrix<f64>,
    spread: &[DMatrix<f64>],
    groups: &[SignalNoise],
    sigma: &[f64],
    count: f64,
) -> (Vec<f64>, Vec<f64>) {
    let channels = left.nrows();
    let own = |c: usize| DMatrix::from_fn(channels, channels, |i, j| f64::from(u8::from(i == c && j == c)));
    let components: Vec<DMatrix<f64>> = (0..channels).map(own).chain(spread.iter().cloned()).collect();
    let mut signals: Vec<f64> = groups.iter().map(|g| g.stated.unwrap_or(g.found)).collect();
    let of = |signals: &[f64]| -> Vec<f64> { sigma.iter().chain(signals).map(|s| s * s).collect() };
    let mut free: Vec<bool> = (0..channels).map(|_| true).collect();
    free.extend(groups.iter().map(|g| g.stated.is_none()));
    // What differences show is no less than the noise; vibration is more.
    if let Some(found) = explain(left, &components, &of(&signals), &free, count) {
        for (k, (sigma, group)) in signals.iter_mut().zip(groups).enumerate() {
            if group.stated.is_none() {
                let k = channels + k;
                *sigma = (found.variance[k] + 3.0 * found.deviation[k]).sqrt().min(*sigma);
            }
        }
    }
    free[channels..].fill(false);
    match explain(left, &components, &of(&signals), &free, count) {
        Some(found) => (found.variance[..channels].iter().map(|v| v.sqrt()).collect(), signals),
        None => (sigma.to_vec(), signals),
    }
}

/// Returns the residuals of the last seconds, as many as the span.
fn recent(residuals: &[BlockResidual], span: Span<f64>) -> &[BlockResidual] {
    let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
    let end_s = residuals.last().map_or(0.0, |r| r.time_s);
    let first = residuals.partition_point(|r| r.time_s < end_s - span_s);
    residuals.get(first..).unwrap_or(residuals)
}
