//! Prediction of a recording by parameters that were found in another one.

use std::ops::Range;

use super::outliers::Weights;
use super::residuals::{residuals, rms};
use super::{Filter, Fit, FitError, RowBlocks, RowSource, SampleCounts, Silent, condition};

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
        let offsets: Vec<Option<usize>> = channels.iter().map(|c| c.offset).collect();
        let multiplied = Multiplied { blocks: &*blocks, gain_errors, offsets };
        let left = residuals(&multiplied, channels.len(), parameters, &Weights::none(channels.len()));
        Ok(Self {
            residual_rms: rms(&left, channels.len()),
            measured_sd: measured_sd(&*blocks, channels.len(), parameters.len()),
        })
    }
}

/// Row blocks of channels that read too much by their gain errors, their offsets apart.
struct Multiplied<'a> {
    blocks: &'a dyn RowBlocks,
    gain_errors: &'a [f64],
    offsets: Vec<Option<usize>>,
}

impl RowBlocks for Multiplied<'_> {
    fn filter(&self) -> &Filter {
        self.blocks.filter()
    }

    fn counts(&self) -> &SampleCounts {
        self.blocks.counts()
    }

    fn parts(&self) -> &[Range<usize>] {
        self.blocks.parts()
    }

    fn time_s(&self, block: usize) -> f64 {
        self.blocks.time_s(block)
    }

    fn tells(&self, block: usize, channel: usize) -> bool {
        self.blocks.tells(block, channel)
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        self.blocks.write(block, rows, measured);
        let n = (rows.len() / self.offsets.len().max(1)).max(1);
        for (row, (gain, offset)) in rows.chunks_exact_mut(n).zip(self.gain_errors.iter().zip(&self.offsets))
        {
            for (_, a) in row.iter_mut().enumerate().filter(|(j, _)| Some(*j) != *offset) {
                *a *= 1.0 + gain;
            }
        }
    }
}

impl Fit {
    /// Predicts another recording of the same thing, measured by the same sensors.
    ///
    /// # Errors
    /// See [`Prediction::of`].
    pub fn predict(&self, source: &dyn RowSource) -> Result<Prediction, FitError> {
        let gain_errors: Vec<f64> =
            (0..self.channels.len()).map(|c| self.gain(c).map_or(0.0, |gain| gain.value)).collect();
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
