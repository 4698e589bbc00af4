//! Prediction of a recording by parameters that were found in another one.

use nalgebra::DMatrix;

use super::linearised::{Columns, Linearised};
use super::outliers::Weights;
use super::residuals::{residuals, rms};
use super::signal_noise::RowNoise;
use super::weighing::Weighing;
use super::{
    BlockResidual, Effect, Factor, Fit, FitError, Nuisance, Progress, RowBlocks, RowSource, Silent,
    Whitening, condition,
};

/// The residuals of a recording by parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Root mean square of the filtered residuals, one a channel, in its unit.
    pub residual_rms: Vec<f64>,
    /// Standard deviation of the filtered measurements about their mean, one a channel, in its unit.
    pub measured_sd: Vec<f64>,
    /// The same over time.
    pub blocks: Vec<PredictedBlock>,
}

/// A filtered sample and what parameters predict of it.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedBlock {
    /// Time that the filter is about, s; zero for still poses.
    pub time_s: f64,
    /// Filtered measurement, one a channel; zero where the block tells nothing of it.
    pub measured: Vec<f64>,
    /// The prediction, likewise.
    pub predicted: Vec<f64>,
    /// False where the block tells nothing of a channel, as dry friction at rest is unknown; empty if it
    /// tells of all.
    pub determined: Vec<bool>,
}

/// Returns plain least squares: every row counts alike, in its channel's unit, nothing is known beforehand,
/// nothing is taken for an error of sensors. The usual way, to compare with.
///
/// # Errors
/// [`FitError::NoRows`] if nothing is left to fit.
pub fn plain_least_squares(source: &dyn RowSource, progress: &dyn Progress) -> Result<Vec<f64>, FitError> {
    let factor = plain_factor(source, &vec![1.0; source.channels().len()], progress)?;
    if factor.rows() == 0 {
        return Err(condition::no_rows(&*source.blocks(progress)?));
    }
    Ok(factor.solve(source.rounding()).estimate)
}

/// Returns the factor of a source's rows, channels with the given σ per unfiltered sample: no row has less
/// weight than another of its channel, and nothing is taken for an error of sensors. Without rows it is
/// empty.
///
/// # Errors
/// [`FitError::Filter`] if the filter does not fit the rate.
pub fn plain_factor(
    source: &dyn RowSource,
    sigma: &[f64],
    progress: &dyn Progress,
) -> Result<Factor, FitError> {
    let mut factors = plain_factors(source, sigma, 1, progress)?;
    Ok(factors.pop().unwrap_or_else(|| Factor::new(source.parameters().len())))
}

/// Returns the same of `parts` of equal length, those without rows left out.
///
/// # Errors
/// [`FitError::Filter`] if the filter does not fit the rate.
pub fn plain_factors(
    source: &dyn RowSource,
    sigma: &[f64],
    parts: usize,
    progress: &dyn Progress,
) -> Result<Vec<Factor>, FitError> {
    let blocks = source.blocks(progress)?;
    let every = f64::from(blocks.filter().every).sqrt();
    let weights: Vec<f64> = sigma.iter().map(|sigma| every / sigma).collect();
    let whitening = Whitening::diagonal(&weights);
    let length = blocks.len().div_ceil(parts.max(1)).max(1);
    let starts = (0..blocks.len()).step_by(length);
    let each = starts.map(|start| {
        let part = start..(start + length).min(blocks.len());
        blocks.absorb(part, source.parameters().len(), &whitening, None)
    });
    Ok(each.filter(|factor| factor.rows() > 0).collect())
}

/// Returns what noise of the signals adds to the normal equations of such rows, N × N and, last, to their
/// right side; `None` if there is none that is felt.
///
/// # Errors
/// [`FitError`] if the filter does not fit the rate.
pub fn plain_noise_gram(
    source: &dyn RowSource,
    sigma: &[f64],
    progress: &dyn Progress,
) -> Result<Option<DMatrix<f64>>, FitError> {
    let blocks = source.blocks(progress)?;
    let every = f64::from(blocks.filter().every);
    let noise = RowNoise::of(source, &*blocks, false)?;
    Ok(noise.map(|noise| noise.gram(&Weighing::diagonal(sigma.to_vec(), every))))
}

impl Prediction {
    /// Predicts the samples of a source by `parameters`, in the order of its columns, measured by sensors
    /// with these `errors`, by their names; what drifts is another time's. Outliers count fully.
    ///
    /// # Errors
    /// [`FitError::Columns`] if there are not as many parameters as the source has columns,
    /// [`FitError::NoRows`] if nothing is left to predict.
    pub fn of(
        source: &dyn RowSource,
        parameters: &[f64],
        errors: &[(String, f64)],
    ) -> Result<Self, FitError> {
        let own = blocks_for(source, &[parameters])?;
        let columns = Columns::of(source);
        let error = |(nuisance, corrected): (&Nuisance, &f64)| match nuisance.effect {
            Effect::Drift { .. } => 0.0,
            _ => errors.iter().find(|(name, _)| *name == nuisance.name).map_or(0.0, |e| e.1 - corrected),
        };
        let errors: Vec<f64> = columns.nuisances.iter().zip(&columns.corrected).map(error).collect();
        let linearised = if errors.iter().any(|error| *error != 0.0) {
            Some(Linearised::new(source, &*own, &columns, parameters)?)
        } else {
            None
        };
        let blocks = linearised.as_ref().map_or(&*own, |blocks| blocks as &dyn RowBlocks);
        let values: Vec<f64> = match &linearised {
            Some(_) => parameters.iter().chain(&errors).copied().collect(),
            None => parameters.to_vec(),
        };
        Ok(Self::by(blocks, source.channels().len(), &values))
    }

    /// Predicts the samples of a source by several parameters, one prediction each, without errors of
    /// sensors.
    ///
    /// # Errors
    /// See [`Prediction::of`].
    pub fn of_each<const N: usize>(
        source: &dyn RowSource,
        parameters: [&[f64]; N],
    ) -> Result<[Self; N], FitError> {
        let own = blocks_for(source, &parameters)?;
        Ok(parameters.map(|values| Self::by(&*own, source.channels().len(), values)))
    }

    /// Predicts blocks by the values of all their columns.
    fn by(blocks: &dyn RowBlocks, channels: usize, values: &[f64]) -> Self {
        let left = residuals(blocks, channels, values, &Weights::none(channels));
        let (mut rows, half_s) = (vec![0.0; channels * values.len()], 0.5 * blocks.filter().width_s);
        let of_block = |(block, left): (usize, &BlockResidual)| {
            let mut measured = vec![0.0; channels];
            blocks.write(block, &mut rows, &mut measured);
            PredictedBlock {
                time_s: left.time_s - half_s,
                predicted: measured.iter().zip(&left.values).map(|(m, left)| m - left).collect(),
                measured,
                determined: left.weights.iter().map(|weight| *weight != 0.0).collect(),
            }
        };
        let all: Vec<PredictedBlock> = left.iter().enumerate().map(of_block).collect();
        Self {
            residual_rms: rms(&left, channels),
            measured_sd: (0..channels).map(|c| measured_sd(&all, c)).collect(),
            blocks: all,
        }
    }
}

/// Returns the row blocks of a source, for parameters that must fit its columns.
fn blocks_for<'a>(
    source: &'a dyn RowSource,
    parameters: &[&[f64]],
) -> Result<Box<dyn RowBlocks + 'a>, FitError> {
    let wanted = source.parameters().len();
    if let Some(given) = parameters.iter().map(|own| own.len()).find(|given| *given != wanted) {
        return Err(FitError::Columns { given, wanted });
    }
    let blocks = source.blocks(&Silent)?;
    if blocks.is_empty() { Err(condition::no_rows(&*blocks)) } else { Ok(blocks) }
}

impl Fit {
    /// Predicts another recording of the same thing, measured by the same sensors.
    ///
    /// # Errors
    /// See [`Prediction::of`].
    pub fn predict(&self, source: &dyn RowSource) -> Result<Prediction, FitError> {
        let errors: Vec<(String, f64)> =
            self.nuisances.iter().map(|error| (error.nuisance.name.clone(), error.value)).collect();
        Prediction::of(source, &self.estimate.values, &errors)
    }
}

/// Returns the standard deviation of a channel's filtered measurements about their mean.
fn measured_sd(blocks: &[PredictedBlock], channel: usize) -> f64 {
    let determined = blocks.iter().filter(|block| block.determined.get(channel) != Some(&false));
    let values: Vec<f64> = determined.filter_map(|block| block.measured.get(channel).copied()).collect();
    let mean =
        |values: &mut dyn Iterator<Item = f64>, count: usize| values.sum::<f64>() / count.max(1) as f64;
    let centre = mean(&mut values.iter().copied(), values.len());
    mean(&mut values.iter().map(|value| (value - centre).powi(2)), values.len()).sqrt()
}
