//! Prediction of a recording by parameters that were found in another one.

use std::ops::Range;

use super::outliers::Weights;
use super::residuals::{residuals, rms};
use super::{
    BlockResidual, Filter, Fit, FitError, Progress, RowBlocks, RowSource, SampleCounts, Silent, Whitening,
    condition,
};

/// What parameters leave of a recording.
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
    /// False where the block tells nothing of a channel, as dry friction at rest is unknown; empty if it tells of all.
    pub told: Vec<bool>,
}

/// Returns plain least squares: every row counts alike, in its channel's unit, nothing is known beforehand, nothing is taken for an error of
/// sensors. The usual way, to compare with.
///
/// # Errors
/// [`FitError::NoRows`] if nothing is left to fit.
pub fn plain_least_squares(source: &dyn RowSource, progress: &dyn Progress) -> Result<Vec<f64>, FitError> {
    let blocks = source.condition(progress)?;
    if blocks.is_empty() {
        return Err(condition::no_rows(&*blocks));
    }
    let whitening = Whitening::diagonal(&vec![1.0; source.channels().len()]);
    let factor = blocks.absorb(0..blocks.len(), source.parameters().len(), &whitening, None);
    Ok(factor.solve(source.rounding()).estimate)
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
        let (mut rows, half_s) =
            (vec![0.0; channels.len() * parameters.len()], 0.5 * blocks.filter().width_s);
        let of_block = |(block, left): (usize, &BlockResidual)| {
            let mut measured = vec![0.0; channels.len()];
            blocks.write(block, &mut rows, &mut measured);
            PredictedBlock {
                time_s: left.time_s - half_s,
                predicted: measured.iter().zip(&left.values).map(|(m, left)| m - left).collect(),
                measured,
                told: left.weights.iter().map(|weight| *weight != 0.0).collect(),
            }
        };
        let all: Vec<PredictedBlock> = left.iter().enumerate().map(of_block).collect();
        Ok(Self {
            residual_rms: rms(&left, channels.len()),
            measured_sd: (0..channels.len()).map(|c| measured_sd(&all, c)).collect(),
            blocks: all,
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

/// Returns the standard deviation of a channel's filtered measurements about their mean.
fn measured_sd(blocks: &[PredictedBlock], channel: usize) -> f64 {
    let told = blocks.iter().filter(|block| block.told.get(channel) != Some(&false));
    let values: Vec<f64> = told.filter_map(|block| block.measured.get(channel).copied()).collect();
    let mean =
        |values: &mut dyn Iterator<Item = f64>, count: usize| values.sum::<f64>() / count.max(1) as f64;
    let centre = mean(&mut values.iter().copied(), values.len());
    mean(&mut values.iter().map(|value| (value - centre).powi(2)), values.len()).sqrt()
}
