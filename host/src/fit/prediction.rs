//! Prediction of a recording by parameters that were found in another one.

use super::outliers::Weights;
use super::residuals::{residuals, rms};
use super::{Fit, FitError, RowBlocks, RowSource, Silent, condition};

/// What parameters leave of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Root mean square of the filtered residuals, one a channel, in its unit.
    pub residual_rms: Vec<f64>,
    /// Standard deviation of the filtered measurements about their mean, one a channel, in its unit.
    pub measured_sd: Vec<f64>,
}

impl Prediction {
    /// Predicts the samples of a source by `parameters`, in the order of its columns; `gain_errors` are relative, one a
    /// channel. Outliers count fully.
    ///
    /// # Errors
    /// [`FitError::Columns`] if there are not as many numbers as the source has columns and channels,
    /// [`FitError::NoRows`] if nothing is left to predict.
    pub fn of(source: &dyn RowSource, parameters: &[f64], gain_errors: &[f64]) -> Result<Self, FitError> {
        let channels = source.channels();
        for (given, wanted) in
            [(parameters.len(), source.parameters().len()), (gain_errors.len(), channels.len())]
        {
            if given != wanted {
                return Err(FitError::Columns { given, wanted });
            }
        }
        let blocks = source.condition(&Silent)?;
        if blocks.is_empty() {
            return Err(condition::no_rows(&*blocks));
        }
        let left = residuals(&*blocks, channels, parameters, gain_errors, &Weights::none(channels.len()));
        Ok(Self {
            residual_rms: rms(&left, channels.len()),
            measured_sd: measured_sd(&*blocks, channels.len(), parameters.len()),
        })
    }
}

impl Fit {
    /// Predicts another recording of the same thing, measured by the same sensors.
    ///
    /// # Errors
    /// See [`Prediction::of`].
    pub fn predict(&self, source: &dyn RowSource) -> Result<Prediction, FitError> {
        let gain_errors: Vec<f64> = self.channels.iter().map(|c| c.gain).collect();
        Prediction::of(source, &self.estimate.values, &gain_errors)
    }
}

/// Returns the standard deviation of each channel's filtered measurements about their mean.
fn measured_sd(blocks: &dyn RowBlocks, channels: usize, parameters: usize) -> Vec<f64> {
    let (mut rows, mut measured) = (vec![0.0; channels * parameters], vec![0.0; channels]);
    let n = blocks.len().max(1) as f64;
    let mut mean = |of: &dyn Fn(usize, f64) -> f64| {
        let mut sums = vec![0.0; channels];
        for block in 0..blocks.len() {
            blocks.write(block, &mut rows, &mut measured);
            for (c, (sum, value)) in sums.iter_mut().zip(&measured).enumerate() {
                *sum += of(c, *value);
            }
        }
        sums.iter_mut().for_each(|sum| *sum /= n);
        sums
    };
    let centre = mean(&|_, value| value);
    let variance = mean(&|c, value| (value - centre.get(c).copied().unwrap_or(0.0)).powi(2));
    variance.into_iter().map(f64::sqrt).collect()
}
