//! The fit of a source's rows: weights, nuisance parameters, outliers, autocorrelation, forgetting.

use nalgebra::{DMatrix, DVector};
use rigident_shared::forgetting::Span;

use super::autocorrelation::{self, Coloured};
use super::compensation::compensate;
use super::condition;
use super::convergence;
use super::forgetting::Memory;
use super::lack_of_fit::{self, LackOfFit, Role};
use super::linearised::{Columns, Linearised, Prior};
use super::outliers::{self, Reference, Watch, Weights};
use super::residuals::{measured_rms, raw_sigma, residuals, rms};
use super::signal_noise::RowNoise;
use super::weighing::Weighing;
use super::{
    Agreement, BlockResidual, ChannelFit, Convergence, Counts, DeviceFactor, Effect, ErrorScores, Estimate,
    Factor, Fit, FitError, FitOptions, Forgotten, Gaussian, Kind, Noise, NoiseCheck, NuisanceFit, Progress,
    RowBlocks, RowSet, RowSource, SignalFit, SignalNoise, judge, parallel,
};

/// Rounds of weights from residuals where no σ is stated: from the unweighted fit, then once more.
const SIGMA_ROUNDS: usize = 2;
/// Rounds of weights and columns that the estimate is part of.
const ROUNDS: usize = 5;
/// Done when no parameter moves by more than so many standard deviations.
const SETTLED_SD: f64 = 0.1;
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
/// Errors that do not average out are nuisance parameters; outliers are given less weight; the covariance is inflated where residuals are
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

/// Fits the parameters of a source as [`fit`] does, beside what a device made of the same samples by itself.
///
/// # Errors
/// [`FitError`] if there are no rows, or the factor is of other parameters.
pub fn fit_device(
    source: &dyn RowSource,
    device: &DeviceFactor,
    options: &FitOptions,
    progress: &dyn Progress,
) -> Result<Fit, FitError> {
    let parameters = source.parameters().len();
    if device.factor.parameters() != parameters {
        return Err(FitError::Device { device: device.factor.parameters(), model: parameters });
    }
    let found = fit(source, options, progress)?;
    Ok(Fit { device: Some(Box::new(device_estimate(device, source.rounding()))), ..found })
}

/// Returns the estimate of a device, beside the noise that it was told of.
pub fn device_estimate(device: &DeviceFactor, rounding: f64) -> Estimate {
    let compensated = device.gram.as_ref().and_then(|gram| compensate(&device.factor, gram, rounding));
    let factor = compensated.as_ref().map_or(&device.factor, |compensated| &compensated.factor);
    Estimate::new(factor, rounding, 1.0, Noise::Given)
}

/// A source with its row blocks.
struct Engine<'a> {
    source: &'a dyn RowSource,
    blocks: Box<dyn RowBlocks>,
    options: FitOptions,
    parameters: usize,
    /// Root mean square of the filtered measurements.
    measured_rms: Vec<f64>,
    columns: Columns,
    /// Noise of the signals in the rows.
    noise: Option<RowNoise<'a>>,
    row_noise_gain: f64,
    limit: f64,
}

/// Rows absorbed.
struct Pass<'a> {
    weighing: Weighing,
    /// Of all columns, without what is known beforehand.
    factor: Factor,
    /// What noise of the signals adds to it; `None`: nothing that counts.
    gram: Option<DMatrix<f64>>,
    /// The rows with the columns of nuisance parameters; `None`: without them.
    linearised: Option<Linearised<'a>>,
    weights: Weights,
}

/// The solution of a pass.
struct Solved {
    /// Nuisance parameters eliminated.
    factor: Factor,
    /// Of all columns.
    joint: Estimate,
    /// What a change of the right-hand side does to it.
    inverse: DMatrix<f64>,
}

/// What a pass says.
struct Conclusion {
    /// Nuisance parameters eliminated.
    factor: Factor,
    /// The same beside the noise as it is, where it is larger than stated.
    solved: Option<Factor>,
    estimate: Estimate,
    /// The same, variance not scaled by the residuals.
    unscaled: Estimate,
    noise: Noise,
    check: NoiseCheck,
    /// Of all columns, beside the noise as it is.
    joint: Estimate,
    /// What a change of the right-hand side does to it.
    inverse: DMatrix<f64>,
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
        let columns = Columns::of(source);
        let noise = RowNoise::of(source, &*blocks, !columns.is_empty())?;
        // Where rows are forgotten the nuisance parameters are not estimated, and errors may exceed the noise.
        let unweighted = options.forgetting.is_some() && !columns.is_empty();
        Ok(Self {
            source,
            options,
            parameters,
            measured_rms: measured_rms(&*blocks, channels.len(), parameters),
            columns,
            noise,
            row_noise_gain: blocks.filter().row_noise_gain(),
            limit: if unweighted { 0.0 } else { outliers::LIMIT_SD },
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

    /// Absorbs all rows, with the columns of nuisance parameters if they are linearised.
    fn absorb<'e>(
        &'e self,
        weighing: Weighing,
        weights: Weights,
        linearised: Option<Linearised<'e>>,
    ) -> Result<Pass<'e>, FitError> {
        let all = linearised.as_ref().map_or(self.parameters, |_| self.columns.all());
        let blocks = linearised.as_ref().map_or(&*self.blocks, |l| l as &dyn RowBlocks);
        let parts = parallel::map(parallel::threads(), blocks.parts().len(), |k| {
            let part = blocks.parts().get(k).cloned().unwrap_or_default();
            blocks.absorb(part, all, &weighing.whitening, weights.as_slice())
        });
        let mut factor = Factor::new(all);
        let several = parts.len() > 1;
        for part in parts {
            if several { factor.merge(&part) } else { factor = part }
        }
        let noise = self.noise.as_ref().filter(|_| weighing.is_compensated());
        let gram = match (noise, &linearised) {
            (Some(noise), None) => Some(noise.gram(&weighing)),
            (Some(noise), Some(linearised)) => {
                Some(noise.joint_gram(&weighing, &self.columns, linearised)?)
            }
            (None, _) => None,
        };
        Ok(Pass { weighing, factor, gram, linearised, weights })
    }

    fn linearise(&self, phi: &[f64]) -> Result<Option<Linearised<'_>>, FitError> {
        let some = !self.columns.is_empty();
        some.then(|| Linearised::new(self.source, &*self.blocks, &self.columns, phi)).transpose()
    }

    /// Returns the row blocks of a pass.
    fn rows_of<'p>(&'p self, pass: &'p Pass) -> &'p dyn RowBlocks {
        pass.linearised.as_ref().map_or(&*self.blocks, |l| l as &dyn RowBlocks)
    }

    /// Solves a pass whose noise has `scale` times the variance, beside what is known beforehand.
    fn solve(&self, pass: &Pass, scale: f64) -> Solved {
        let rounding = self.source.rounding();
        let scaled = if scale == 1.0 { pass.factor.clone() } else { pass.factor.discount(scale) };
        let known = if pass.linearised.is_some() { self.columns.with_prior(&scaled) } else { scaled };
        let compensated = pass.gram.as_ref().and_then(|gram| compensate(&known, &(gram / scale), rounding));
        let (known, inverse) = match compensated {
            Some(compensated) => (compensated.factor, Some(compensated.inverse)),
            None => (known, None),
        };
        let joint = self.estimate(&known, 1.0, Noise::Given);
        let factor = if pass.linearised.is_some() { known.leading(self.parameters) } else { known };
        let inverse = inverse.unwrap_or_else(|| joint.covariance.clone());
        Solved { factor, joint, inverse }
    }

    /// Weighs the rows by the covariance of all noise, takes off what noise in the coefficients adds, and linearises the
    /// columns of nuisance parameters, until the estimate stays where it is.
    fn refine<'e>(&'e self, pass: Pass<'e>, sigma_given: bool) -> Result<Pass<'e>, FitError> {
        let noise = self.noise.as_ref().filter(|_| self.source.signal_noise_is_known());
        if noise.is_none() && self.columns.is_empty() {
            return Ok(pass);
        }
        let mut pass = pass;
        let mut before: Option<Estimate> = None;
        for _ in 0..ROUNDS {
            let Solved { factor, joint, .. } = self.solve(&pass, 1.0);
            let estimate = self.estimate(&factor, 1.0, Noise::Given);
            if before.as_ref().is_some_and(|before| estimate.largest_step(before) < SETTLED_SD) {
                break;
            }
            let is_negligible = noise.is_none_or(|noise| self.is_negligible(noise, &pass, &estimate));
            if is_negligible && self.columns.is_empty() {
                break;
            }
            let weighing = match noise.filter(|_| !is_negligible) {
                Some(noise) => match self.weigh(noise, &pass, &joint, &estimate, sigma_given) {
                    Some(weighing) => weighing,
                    None => return Ok(pass),
                },
                None if sigma_given => pass.weighing.clone(),
                None => self.diagonal(self.sigma_from_residuals(&pass)),
            };
            let linearised = self.linearise(&estimate.values)?;
            pass = self.absorb(weighing, pass.weights, linearised)?;
            before = Some(estimate);
        }
        Ok(pass)
    }

    /// Returns the weighing by all noise about an estimate; `None` if there is no such covariance.
    fn weigh(
        &self,
        noise: &RowNoise,
        pass: &Pass,
        joint: &Estimate,
        estimate: &Estimate,
        sigma_given: bool,
    ) -> Option<Weighing> {
        let filter = self.blocks.filter();
        let phi = self.significant(pass, estimate);
        let spectra = noise.spectra(&phi, &pass.weighing, filter);
        let all_stated = sigma_given && noise.groups().all(|group| group.stated.is_some());
        let residuals = (!all_stated).then(|| {
            let residuals = self.residuals(self.rows_of(pass), &joint.values, &pass.weights);
            Weighing::covariance_of(&residuals, joint, filter)
        });
        let residuals = residuals.as_ref().map(|left| noise.restored(left, self.rows_of(pass)));
        let groups: Vec<&SignalNoise> = noise.groups().collect();
        pass.weighing.with_signals(&groups, &spectra, residuals.as_deref(), sigma_given, filter)
    }

    /// Returns the values that count in the covariance of the noise.
    fn significant(&self, pass: &Pass, estimate: &Estimate) -> Vec<f64> {
        let first = !pass.weighing.is_compensated();
        if first {
            let spurious = self.spurious_information(&pass.weighing.sigma);
            Weighing::significant(&self.without_spurious(estimate, spurious), false)
        } else {
            Weighing::significant(estimate, false)
        }
    }

    /// Returns true if noise of the signals is a small part of that in the residuals, and moves no parameter by much of its
    /// standard deviation: the channels' own weights are then as good, and cost less.
    fn is_negligible(&self, noise: &RowNoise, pass: &Pass, estimate: &Estimate) -> bool {
        if pass.weighing.is_compensated() {
            return false;
        }
        let phi = self.significant(pass, estimate);
        let spectra = noise.spectra(&phi, &pass.weighing, self.blocks.filter());
        if noise.share(&spectra, &pass.weighing, self.blocks.filter()) > NEGLIGIBLE_SHARE {
            return false;
        }
        let gram = noise.gram(&pass.weighing);
        let moved = &estimate.covariance * (gram * DVector::from_column_slice(&phi));
        (0..estimate.len())
            .filter(|j| estimate.is_determined(*j))
            .all(|j| moved[j].abs() <= NEGLIGIBLE_SD * estimate.covariance[(j, j)].max(0.0).sqrt())
    }

    fn estimate(&self, factor: &Factor, scale: f64, noise: Noise) -> Estimate {
        Estimate::new(factor, self.source.rounding(), scale, noise)
    }

    fn residuals(&self, blocks: &dyn RowBlocks, values: &[f64], weights: &Weights) -> Vec<BlockResidual> {
        residuals(blocks, self.source.channels().len(), values, weights)
    }

    /// Returns σ of the channels from what a pass leaves.
    fn sigma_from_residuals(&self, pass: &Pass) -> Vec<f64> {
        let Solved { factor, joint, .. } = self.solve(pass, 1.0);
        let estimate = self.estimate(&factor, 1.0, Noise::Given);
        let residuals = self.residuals(self.rows_of(pass), &joint.values, &pass.weights);
        raw_sigma(&*self.blocks, self.source.channels(), &self.measured_rms, &estimate, &residuals)
    }

    fn batch(&self, sigma: Vec<f64>, sigma_given: bool) -> Result<Fit, FitError> {
        let mut pass = self.absorb(self.diagonal(sigma), self.no_weights(), None)?;
        if !sigma_given {
            for _ in 0..SIGMA_ROUNDS {
                let weighing = self.diagonal(self.sigma_from_residuals(&pass));
                pass = self.absorb(weighing, pass.weights, None)?;
            }
        }
        pass = self.refine(pass, sigma_given)?;
        let mut conclusion = self.conclude(&pass, sigma_given);
        for _ in 0..outliers::MOST_ROUNDS {
            if conclusion.outliers.iter().all(|count| *count == 0) {
                break;
            }
            let weights = self.weights_of(&pass, &conclusion.joint, &conclusion.check);
            pass = self.absorb(pass.weighing, weights, pass.linearised)?;
            if !sigma_given {
                let weighing = self.diagonal(self.sigma_from_residuals(&pass));
                pass = self.absorb(weighing, pass.weights, pass.linearised)?;
            }
            pass = self.refine(pass, sigma_given)?;
            conclusion = self.conclude(&pass, sigma_given);
        }
        let convergence = self.convergence(&pass, &conclusion);
        self.finish(pass, conclusion, convergence, None)
    }

    /// Returns the weights of the outliers that a joint estimate shows.
    fn weights_of(&self, pass: &Pass, joint: &Estimate, check: &NoiseCheck) -> Weights {
        let reference = Reference::of(joint, check.variance_ratio, self.limit);
        Weights::of(self.rows_of(pass), &reference, &pass.weighing.total)
    }

    /// Draws the conclusions from a factor.
    fn conclude(&self, pass: &Pass, sigma_given: bool) -> Conclusion {
        let Solved { factor, mut joint, mut inverse } = self.solve(pass, 1.0);
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
        // What is known beforehand is not the noise's to scale.
        let mut solved = None;
        if scale > 1.0 && pass.linearised.is_some() {
            let beside = self.solve(pass, scale);
            let estimate = self.estimate(&beside.factor, 1.0, Noise::Given);
            unscaled = Estimate { covariance: &estimate.covariance / scale, ..estimate };
            (solved, joint, inverse) = (Some(beside.factor), beside.joint, beside.inverse);
        } else {
            joint.covariance *= scale;
        }
        let estimate = Estimate { covariance: &unscaled.covariance * scale, noise, ..unscaled.clone() };
        let weights = self.weights_of(pass, &joint, &check);
        let residuals = self.residuals(self.rows_of(pass), &joint.values, &weights);
        let mut conclusion = Conclusion {
            factor,
            solved,
            estimate,
            unscaled,
            noise,
            check,
            joint,
            inverse,
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
        let way = convergence::Way {
            blocks: self.rows_of(pass),
            rounding: self.source.rounding(),
            weighing: &pass.weighing,
            gram: pass.gram.as_ref(),
            weights: pass.weights.as_slice(),
            columns: pass.linearised.as_ref().map(|_| &self.columns),
            parameters: self.parameters,
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
        let lack_of_fit =
            if forgetting.is_none() { self.lack_of_fit(&pass, &conclusion) } else { LackOfFit::default() };
        let (nuisances, known) = match forgetting {
            None => (self.nuisance_fits(&pass, &conclusion), DVector::zeros(self.parameters)),
            Some(span) => self.considered(&pass, &conclusion, span)?,
        };
        let rows = self.rows_of(&pass);
        let Conclusion { mut factor, mut solved, mut estimate, unscaled, check, .. } = conclusion;
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
        let mut inflation = Vec::new();
        let whitened = autocorrelation::whitened(&conclusion.residuals, &weighing.whitening);
        let unit = vec![f64::from(self.blocks.filter().every) * check.variance_scale; weighing.sigma.len()];
        let coloured = autocorrelation::detect(&whitened, self.blocks.filter(), &unit);
        if !coloured.is_empty() && forgetting.is_none() {
            inflation = autocorrelation::inflation(
                rows,
                &conclusion.joint,
                self.parameters,
                &weighing.whitening,
                &conclusion.weights,
                &unit,
                &coloured,
            );
        }
        // What is compensated moves no estimate and informs of nothing.
        let (mut spurious_information, mut bias) = (0.0, Vec::new());
        if let Some(noise) = self.noise.as_ref().filter(|_| !weighing.is_compensated()) {
            spurious_information = conclusion.share * self.spurious_information(&weighing.sigma);
            let informed = self.without_spurious(&unscaled, spurious_information);
            let known = |j: usize| if informed.is_determined(j) { informed.values[j] } else { 0.0 };
            let informed = DVector::from_fn(self.parameters, |j, _| known(j));
            let pull: DMatrix<f64> = noise.gram(weighing) * conclusion.share;
            bias = (&unscaled.covariance * (pull * informed)).iter().map(|b| -b).collect();
        }
        let by: Vec<f64> = (0..self.parameters)
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
            factor = factor.inflate(&estimate.values, &by);
            solved = solved.map(|rows| rows.inflate(&estimate.values, &by));
            estimate = estimate.inflate(&by);
            widened.clone_from(&by);
        }
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
            outliers: conclusion.outliers.get(c).copied().unwrap_or(0),
            rejected: self.rejected(c),
            residual_sigma: (variance[c] * filter.noise_gain).sqrt(),
            autocorrelation: conclusion.coloured.iter().find(|k| k.channel == c).map(|k| k.found),
        });
        let channel_fits = channel_fits.collect();
        let (agreement, error_scores) = self.agreement(&pass, &conclusion.joint, &conclusion.inverse);
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

    /// Returns the nuisance parameters as a pass found them.
    fn nuisance_fits(&self, pass: &Pass, conclusion: &Conclusion) -> Vec<NuisanceFit> {
        let n = self.parameters;
        let (Estimate { values, covariance, .. }, inverse) = (&conclusion.joint, &conclusion.inverse);
        if pass.linearised.is_none() {
            return Vec::new();
        }
        let found = self.columns.nuisances.iter().enumerate();
        // Of independent errors `(N⁻¹)_jk / σ_k`.
        let brought = inverse.rows(0, n) * self.columns.prior.whitening.rows(n, found.len()).transpose();
        found
            .map(|(k, nuisance)| NuisanceFit {
                nuisance: nuisance.clone(),
                expected: self.columns.prior.mean[n + k],
                value: values[n + k],
                sd: covariance[(n + k, n + k)].max(0.0).sqrt().min(nuisance.sigma),
                drawn: nuisance.sigma.powi(2) - 2.0 * inverse[(n + k, n + k)] + covariance[(n + k, n + k)],
                contributions: brought.column(k).iter().copied().collect(),
            })
            .collect()
    }

    /// Returns parameters and errors together, as far as they are determined, if something is known of them together;
    /// autocorrelated rows count as so much noisier.
    fn joint(&self, pass: &Pass, joint: &Estimate, scale: f64, inflation: &[f64]) -> Option<Gaussian> {
        pass.linearised.as_ref()?;
        self.source.beforehand()?;
        let most = inflation.iter().copied().fold(1.0, f64::max);
        let noisier = (most > 1.0).then(|| self.solve(pass, scale * most * most).joint);
        let Estimate { values, covariance, determined, .. } = noisier.as_ref().unwrap_or(joint);
        let kept: Vec<usize> = (0..values.len()).filter(|j| determined.get(*j) == Some(&true)).collect();
        let own = self.source.parameters().iter().map(|p| &p.name);
        let names: Vec<&String> = own.chain(self.columns.nuisances.iter().map(|k| &k.name)).collect();
        Gaussian::new(
            kept.iter().filter_map(|j| names.get(*j).map(|name| (*name).clone())).collect(),
            DVector::from_column_slice(values).select_rows(&kept),
            covariance.select_rows(&kept).select_columns(&kept),
        )
    }

    /// Compares the errors found with what was known of them beforehand.
    fn agreement(
        &self,
        pass: &Pass,
        joint: &Estimate,
        inverse: &DMatrix<f64>,
    ) -> (Option<Agreement>, Option<ErrorScores>) {
        let (n, count) = (self.parameters, self.columns.nuisances.len());
        if pass.linearised.is_none() {
            return (None, None);
        }
        let sigma = |k: usize| self.columns.nuisances[k].sigma;
        let Prior { mean, covariance, .. } = &self.columns.prior;
        let known = DVector::from_fn(count, |k, _| (joint.values[n + k] - mean[n + k]) / sigma(k));
        let told = DMatrix::from_fn(count, count, |i, j| {
            let (c, b) = (joint.covariance[(n + i, n + j)], inverse[(n + i, n + j)]);
            (covariance[(i, j)] + c - 2.0 * b) / (sigma(i) * sigma(j))
        });
        // In standard deviations beforehand: errors of several units.
        let prior = DMatrix::from_fn(count, count, |i, j| covariance[(i, j)] / (sigma(i) * sigma(j)));
        let scores = ErrorScores::new(&known, prior, &told);
        (Agreement::new(&known, told), scores)
    }

    /// Returns what the residuals say against the model.
    fn lack_of_fit(&self, pass: &Pass, conclusion: &Conclusion) -> LackOfFit {
        let values = &conclusion.joint.values;
        let mut roles: Vec<Role> = self.source.parameters().iter().map(Role::of).collect();
        if pass.linearised.is_some() {
            roles.extend(self.columns.nuisances.iter().map(|nuisance| match nuisance.effect {
                Effect::Drift { .. } => Role::Drift,
                _ => Role::Fixed,
            }));
        }
        roles.resize(values.len(), Role::Fixed);
        lack_of_fit::look(&lack_of_fit::Rows {
            blocks: self.rows_of(pass),
            values,
            roles: &roles,
            whitening: &pass.weighing.whitening,
            weights: &conclusion.weights,
            has_drives: self.source.channels().iter().any(|channel| channel.is_drive()),
            is_suspect: !conclusion.coloured.is_empty()
                || conclusion.check.variance_ratio > lack_of_fit::SUSPECT,
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

    /// Returns what errors that are not estimated bring to an estimate that has forgotten older rows: of the rows in the span
    /// `φ̂ − φ = (AᵀWA)⁻¹ AᵀW c_k θ_k` (S. F. Schmidt, 1966, consider parameters); then how much of it is known beforehand.
    fn considered(
        &self,
        pass: &Pass,
        conclusion: &Conclusion,
        span: Span<f64>,
    ) -> Result<(Vec<NuisanceFit>, DVector<f64>), FitError> {
        let Some(rows) = self.linearise(&conclusion.estimate.values)? else {
            return Ok((Vec::new(), DVector::zeros(self.parameters)));
        };
        let first = rows.len() - recent(&conclusion.residuals, span).len().min(rows.len());
        let joint = rows.absorb(first..rows.len(), self.columns.all(), &pass.weighing.whitening, None).r();
        let n = self.parameters;
        let (own, others) =
            (joint.view((0, 0), (n, n)), joint.view((0, n), (n, self.columns.nuisances.len())));
        let moved = own.clone_owned().svd(true, true).solve(&others.clone_owned(), f64::EPSILON);
        let moved = moved.unwrap_or_else(|_| DMatrix::zeros(n, self.columns.nuisances.len()));
        let Prior { mean, colouring, .. } = &self.columns.prior;
        let brought = -(&moved * colouring);
        let of = |(k, nuisance): (usize, &super::Nuisance)| NuisanceFit {
            nuisance: nuisance.clone(),
            expected: mean[n + k],
            value: mean[n + k],
            sd: nuisance.sigma,
            drawn: 0.0,
            contributions: brought.column(k).iter().copied().collect(),
        };
        let found = self.columns.nuisances.iter().enumerate().map(of).collect();
        Ok((found, moved * mean.rows(n, self.columns.nuisances.len())))
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
        let residuals = self.residuals(&*self.blocks, &estimate.values, &weights);
        let channels = self.source.channels();
        raw_sigma(&*self.blocks, channels, &self.measured_rms, &estimate, recent(&residuals, span))
    }

    /// Returns the root mean square, per whitened row, of what noise of the signals brings to the coefficients.
    fn coefficient_noise(&self, weighing: &Weighing) -> Vec<f64> {
        let rows = (self.blocks.len() * weighing.sigma.len()).max(1) as f64;
        match &self.noise {
            Some(noise) => {
                let gram = noise.gram(weighing);
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
        Ok((Pass { weighing, factor, gram: None, linearised: None, weights }, points))
    }
}

/// Returns the residuals of the last seconds, as many as the span.
fn recent(residuals: &[BlockResidual], span: Span<f64>) -> &[BlockResidual] {
    let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
    let end_s = residuals.last().map_or(0.0, |r| r.time_s);
    let first = residuals.partition_point(|r| r.time_s < end_s - span_s);
    residuals.get(first..).unwrap_or(residuals)
}
