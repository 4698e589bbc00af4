//! Sources of rows `A φ = y ± σ`: all that a method of identification has to provide.

use std::ops::Range;

use rigident_shared::screening::Rejection;

use super::made_blocks::MadeBlocks;
use super::{
    Channel, ErrorRow, Filter, FitError, Gaussian, Identity, Nuisance, Parameter, Progress, RowBlocks,
    StatedNoise, condition,
};

/// The timing by which the samples of a source follow one another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Timing {
    /// Each sample represents itself: still poses, known values. Nothing is filtered.
    Static,
    /// Samples at a constant rate, filtered together.
    Uniform {
        /// Samples per second.
        rate_hz: f64,
    },
}

/// The rows of one sample, which a source fills in.
///
/// With C channels and N parameters, `smoothed` and `differentiated` are C × N, row by row, and `measured`
/// holds C values. The sample says `measured = smoothed φ + d/dt(differentiated φ)`: what would need an
/// acceleration is given as a momentum instead, and the filter's derivative acts on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleRows {
    /// Coefficients that the filter smooths.
    pub smoothed: Vec<f64>,
    /// Coefficients that the filter differentiates; left zero by a source that has none.
    pub differentiated: Vec<f64>,
    /// Measured values, one a channel.
    pub measured: Vec<f64>,
    /// Channels of which the sample tells nothing, one a channel: no filtered row that it is under has them.
    pub missing: Vec<bool>,
}

impl SampleRows {
    /// Makes room for `channels` rows of `parameters` coefficients, all zero.
    pub fn clear(&mut self, channels: usize, parameters: usize) {
        for rows in [&mut self.smoothed, &mut self.differentiated] {
            rows.clear();
            rows.resize(channels * parameters, 0.0);
        }
        self.measured.clear();
        self.measured.resize(channels, 0.0);
        self.missing.clear();
        self.missing.resize(channels, false);
    }

    /// Returns true if it has channels and tells of none.
    pub(super) fn tells_nothing(&self) -> bool {
        !self.missing.is_empty() && self.missing.iter().all(|missing| *missing)
    }
}

/// Noise of a group of signals that coefficients are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalNoise {
    /// Name of the sensor or group.
    pub name: String,
    /// Unit of σ.
    pub unit: String,
    /// 1 σ per sample as stated.
    pub stated: Option<f64>,
    /// 1 σ per sample as differences of the signals show it: an upper bound where the motion is rough.
    pub found: f64,
}

impl SignalNoise {
    /// Returns 1 σ as stated; where nothing is, as differences show it.
    pub fn size(&self) -> f64 {
        self.stated.unwrap_or(self.found)
    }
}

/// Anything that rows come from: one body, a tree of links, still poses, or a model of one's own.
///
/// Weights, outliers, gain errors, autocorrelation, forgetting, known values, merging, intervals, factor
/// files and reports follow from the rows and need nothing more.
pub trait RowSource: Send + Sync {
    /// Returns the unknowns in the order of the columns.
    fn parameters(&self) -> &[Parameter];

    /// Returns the channels in the order of the rows.
    fn channels(&self) -> &[Channel];

    /// Returns how the samples follow one another.
    fn timing(&self) -> Timing;

    /// Returns the number of samples.
    fn samples(&self) -> usize;

    /// Returns the time of a sample, ns; not used by [`Timing::Static`] sources.
    fn time_ns(&self, sample: usize) -> u64;

    /// Writes the rows of a sample into `rows`, which is cleared before.
    ///
    /// # Errors
    /// [`Rejection`] if a channel of the sample may not be used; the filter then starts anew.
    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection>;

    /// Returns what in columns of unit length is no more than rounding of the model: parameters that differ
    /// by less are not distinguished.
    fn rounding(&self) -> f64 {
        f64::EPSILON * self.parameters().len() as f64
    }

    /// Returns a number that is the same for models whose parameters of equal names are the same quantities:
    /// a hash of the geometry. Zero: the parameters' names and what they are made of say all.
    fn model_fingerprint(&self) -> u64 {
        0
    }

    /// Gives every reading to `take`: its time, ns, if it has one, and its numbers. The default takes the
    /// measured values of all samples.
    fn each_reading(&self, take: &mut dyn FnMut(Option<u64>, &[f64])) {
        let (channels, parameters) = (self.channels().len(), self.parameters().len());
        let mut rows = SampleRows::default();
        for sample in 0..self.samples() {
            rows.clear(channels, parameters);
            let time_ns = (self.timing() != Timing::Static).then(|| self.time_ns(sample));
            // A rejected sample is one of the readings too; its time distinguishes it.
            let good = self.rows(sample, &mut rows).is_ok();
            take(time_ns, if good { rows.measured.as_slice() } else { &[] });
        }
    }

    /// Returns what distinguishes these readings from others, whatever file they are in: a run counts once
    /// where factors are merged.
    fn identity(&self) -> Identity {
        Identity::of(|take| self.each_reading(take))
    }

    /// Returns the name of the signal that a [`Rejection`] numbers; by default that is a channel.
    fn signal_name(&self, signal: u8) -> String {
        self.channels()
            .get(usize::from(signal))
            .map_or_else(|| format!("signal {signal}"), |c| c.name.clone())
    }

    /// Returns standard deviations to start from where none is stated; only their ratios matter.
    fn nominal_sigma(&self) -> Vec<f64> {
        self.channels().iter().map(|c| if c.unit == "N m" { 0.1 } else { 1.0 }).collect()
    }

    /// Filters the samples into row blocks that need the source no more. The default stores the rows; a
    /// source with a more compact form of its rows may keep that.
    ///
    /// # Errors
    /// [`FitError`] if the filter does not fit the rate.
    fn condition(&self, progress: &dyn Progress) -> Result<Box<dyn RowBlocks>, FitError> {
        condition::condition(self, progress)
    }

    /// Returns the row blocks as they are gone through in a fit: what the rows of a long recording need is
    /// bounded.
    ///
    /// # Errors
    /// [`FitError`] if the filter does not fit the rate.
    fn blocks<'a>(&'a self, progress: &dyn Progress) -> Result<Box<dyn RowBlocks + 'a>, FitError> {
        Ok(Box::new(MadeBlocks::new(self, progress)?))
    }

    /// Returns the groups of signals that the coefficients are made of and that have noise, each with its σ.
    fn signal_noise(&self) -> Vec<SignalNoise> {
        Vec::new()
    }

    /// Returns the source of some of its samples with noise added to the signals that the coefficients are
    /// made of.
    ///
    /// The noise has the standard deviation `sigma`, one a group of [`RowSource::signal_noise`], each value
    /// of either sign by a pattern that `seed` decides; the opposite σ give the opposite noise. `None` if the
    /// source knows of no noise.
    fn with_signal_noise(
        &self,
        _samples: Range<usize>,
        _sigma: &[f64],
        _seed: u64,
    ) -> Option<Box<dyn RowSource + '_>> {
        None
    }

    /// Returns true if the noise of each signal is known, so that rows can be weighed by it and what it adds
    /// be taken off; else its order is, and intervals count what it may move.
    fn signal_noise_is_known(&self) -> bool {
        true
    }

    /// Returns how many of the errors, the first ones, rows tell of. Others are only counted: an estimate is
    /// that for no such error, and its covariance has what these may move. Where noise of the signals is in
    /// the columns of errors as in the measured side, an error that all have in common would explain the
    /// noise.
    fn determined_errors(&self) -> usize {
        usize::MAX
    }

    /// Returns true if the noise of the signals is white before the rows are filtered. What other noise
    /// leaves in the residuals, where it counts, resembles a part that swings or a body that changes, and is
    /// not taken for one.
    fn signal_noise_is_white(&self) -> bool {
        true
    }

    /// Returns the errors of sensors and mounting that do not average out, each with what is known of it
    /// beforehand. They are estimated with the parameters, and eliminated.
    fn nuisances(&self) -> Vec<Nuisance> {
        Vec::new()
    }

    /// Returns what else the source knows of its errors, beside its rows.
    fn error_observations(&self) -> Vec<ErrorRow> {
        Vec::new()
    }

    /// Returns what is known beforehand of errors, and of parameters, together: a mean and a covariance, by
    /// the names of
    /// [`RowSource::nuisances`] and of [`RowSource::parameters`]. It takes the place of the nuisance
    /// parameters' own σ; names that the source does not have count for nothing.
    fn beforehand(&self) -> Option<&Gaussian> {
        None
    }

    /// Returns errors by name with the values that the signals are corrected for: the columns are those of
    /// what is left, while what is known beforehand, and what is found, are of the whole.
    fn corrected_for(&self) -> &[(String, f64)] {
        &[]
    }

    /// Returns the source with its signals corrected for errors, one for each number of an
    /// [`super::Effect::Signal`] among
    /// [`RowSource::nuisances`]: the truth if those are the sensors' errors. Not used where the row blocks have
    /// [`RowBlocks::sensitivities`].
    fn with_errors(&self, _errors: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        None
    }

    /// Returns a source of the same samples whose coefficients are the columns of errors about `parameters`,
    /// what each error changes in what they predict: one for each number of an [`super::Effect::Signal`]
    /// among [`RowSource::nuisances`]. `None` if they are to be found by [`RowSource::with_errors`].
    fn error_columns(&self, _parameters: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        None
    }

    /// Returns the noise that is stated of sensors and channels beside what their readings show, where both
    /// are known.
    fn stated_noise(&self) -> Vec<StatedNoise> {
        Vec::new()
    }

    /// Returns the standard deviation of each channel per sample as differences of its readings show it; zero
    /// where they show none, empty if it is not known.
    fn channel_noise(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Returns the standard deviation of the rates of turn among the signals, rad/s: information that their
    /// noise alone would bring to a moment of inertia counts for nothing.
    fn rate_sigma(&self) -> f64 {
        0.0
    }

    /// Returns the root mean square, per whitened row, of what noise of the signals alone brings to the
    /// coefficients of each parameter; `None` if it is to be found by [`RowSource::with_signal_noise`].
    /// `sigma` are those of the channels.
    fn coefficient_noise(&self, _filter: &Filter, _sigma: &[f64]) -> Option<Vec<f64>> {
        None
    }
}
