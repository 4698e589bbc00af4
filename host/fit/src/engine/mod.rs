//! The fit of a source's rows: weights, nuisance parameters, outliers, autocorrelation, forgetting.
//!
//! Rows are absorbed and solved ([`rows`]), weighed until the estimate stays ([`refining`]), concluded from
//! ([`conclusion`]), compared with what was known of errors ([`errors`]), widened ([`widening`]) and put
//! together ([`finish`]); or absorbed in the order of time ([`forgetting`]).

mod conclusion;
mod errors;
mod finish;
mod forgetting;
mod refining;
mod rows;
mod scatter;
mod spurious;
mod widening;

use nalgebra::DMatrix;

use super::autocorrelation::Coloured;
use super::compensation::{NoiseGram, compensate};
use super::condition;
use super::linearised::{Columns, Linearised};
use super::outliers::{self, Reference, Weights};
use super::residuals::measured_rms;
use super::signal_noise::RowNoise;
use super::weighing::Weighing;
use super::{
    BlockResidual, DeviceFactor, Estimate, Factor, Fit, FitError, FitOptions, Noise, NoiseCheck, Progress,
    RowBlocks, RowSource,
};
pub use spurious::LEAST_EXCITATION;

/// Rounds of weights from residuals where no σ is stated: from the unweighted fit, then once more.
const SIGMA_ROUNDS: usize = 2;

/// Row blocks of which each one's share of the degrees of freedom is reckoned.
const MOST_LEVERAGES: usize = 500;

/// Fits the parameters of a source to its rows.
///
/// Samples are filtered to row blocks ([`RowSource::condition`]) and absorbed, whitened by the covariance of
/// all noise: that of the channels, and that which noise of the signals in the coefficients leaves in the
/// residuals. What the latter adds to the normal equations is taken off. Noise that is not stated comes from
/// the residuals and from differences of the signals. Errors that do not average out are nuisance parameters;
/// outliers are given less weight; the covariance is inflated where residuals are larger than stated or
/// autocorrelated.
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
    let estimate = device_estimate(device, source.channels().len(), source.rounding());
    Ok(Fit { device: Some(Box::new(estimate)), ..found })
}

/// Returns the estimate of a device with the given number of channels, beside the noise that was stated to
/// it.
pub fn device_estimate(device: &DeviceFactor, channels: usize, rounding: f64) -> Estimate {
    let compensated = device.gram.as_ref().and_then(|gram| {
        compensate(&device.factor, &NoiseGram::in_factor(gram, &device.factor, channels), rounding)
    });
    let factor = compensated.as_ref().map_or(&device.factor, |compensated| &compensated.factor);
    Estimate::new(factor, rounding, 1.0, Noise::Given)
}

/// A source with its row blocks.
struct Engine<'a> {
    source: &'a dyn RowSource,
    blocks: Box<dyn RowBlocks + 'a>,
    options: FitOptions,
    parameters: usize,
    /// Root mean square of the filtered measurements.
    measured_rms: Vec<f64>,
    measured_sd: Vec<f64>,
    columns: Columns,
    /// Noise of the signals in the rows.
    noise: Option<RowNoise<'a>>,
    row_noise_gain: f64,
    limit: f64,
    /// Largest σ of the channels that still poses can have; `None`: not bounded.
    largest_sigma: Option<Vec<f64>>,
}

/// Rows absorbed.
struct Pass<'a> {
    weighing: Weighing,
    /// Of all columns, without what is known beforehand.
    factor: Factor,
    /// The addition of the noise of the signals to it; `None`: nothing that counts.
    gram: Option<DMatrix<f64>>,
    /// The rows with the columns of nuisance parameters; `None`: without them.
    linearised: Option<Linearised<'a>>,
    weights: Weights,
}

/// The solution of a pass.
struct Solved {
    /// Nuisance parameters eliminated.
    factor: Factor,
    /// The rows over all columns, without what is known beforehand.
    rows: Factor,
    /// Of all columns.
    joint: Estimate,
    /// The same with directions that noise fills as least squares find them: residuals are examined about it.
    about: Estimate,
    /// Of the parameters alone.
    own: Estimate,
    /// Of all columns by least squares: its covariance is what is taken of the noise.
    least_squares: Estimate,
}

/// The conclusion of a pass.
struct Conclusion {
    /// Nuisance parameters eliminated.
    factor: Factor,
    /// The same beside the noise as it is, where it is larger than stated.
    solved: Option<Factor>,
    /// The rows over all columns beside the noise as it is, without what is known beforehand.
    rows: Factor,
    estimate: Estimate,
    /// The same, variance not scaled by the residuals.
    unscaled: Estimate,
    noise: Noise,
    check: NoiseCheck,
    /// Of all columns, beside the noise as it is.
    joint: Estimate,
    /// The same with directions that noise fills as least squares find them.
    about: Estimate,
    residuals: Vec<BlockResidual>,
    weights: Weights,
    outliers: Vec<u32>,
    residual_rms: Vec<f64>,
    coloured: Vec<Coloured>,
    /// Share of all row blocks that the factor holds.
    share: f64,
}

impl<'a> Engine<'a> {
    pub(super) fn new(
        source: &'a dyn RowSource,
        options: FitOptions,
        progress: &dyn Progress,
    ) -> Result<Self, FitError> {
        let blocks = source.blocks(progress)?;
        if blocks.is_empty() {
            return Err(condition::no_rows(&*blocks));
        }
        let (channels, parameters) = (source.channels(), source.parameters().len());
        let columns = Columns::of(source);
        let noise = RowNoise::of(source, &*blocks, !columns.is_empty())?;
        // Where rows are forgotten the nuisance parameters are not estimated, and errors may exceed the
        // noise.
        let unweighted = options.forgetting.is_some() && !columns.is_empty();
        let measured = measured_rms(&*blocks, channels.len(), parameters);
        let mut engine = Self {
            source,
            options,
            parameters,
            measured_rms: measured.iter().map(|(rms, _)| *rms).collect(),
            measured_sd: measured.iter().map(|(_, sd)| *sd).collect(),
            columns,
            noise,
            row_noise_gain: blocks.filter().row_noise_gain(),
            limit: if unweighted { 0.0 } else { outliers::LIMIT_SD },
            largest_sigma: None,
            blocks,
        };
        engine.largest_sigma = engine.largest_sigma();
        Ok(engine)
    }

    /// Returns the stated σ of all channels; `None` if one has none.
    pub(super) fn stated_sigma(&self) -> Option<Vec<f64>> {
        self.source.channels().iter().map(|c| c.sigma).collect()
    }

    pub(super) fn check(&self, sigma: &[f64]) -> Result<(), FitError> {
        let mut channels = self.source.channels().iter().zip(sigma);
        match channels.find(|(_, s)| !(s.is_finite() && **s > 0.0)) {
            Some((channel, sigma)) => Err(FitError::Sigma { channel: channel.name.clone(), sigma: *sigma }),
            None => Ok(()),
        }
    }

    pub(super) fn no_weights(&self) -> Weights {
        Weights::none(self.source.channels().len())
    }

    pub(super) fn batch(&self, sigma: Vec<f64>, sigma_given: bool) -> Result<Fit, FitError> {
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
            let weights = self.weights_of(&pass, &conclusion.about, &conclusion.check);
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
    pub(super) fn weights_of(&self, pass: &Pass, joint: &Estimate, check: &NoiseCheck) -> Weights {
        let reference = Reference::of(joint, check.variance_ratio, self.limit);
        Weights::of(self.rows_of(pass), &reference, &pass.weighing.total)
    }
}
