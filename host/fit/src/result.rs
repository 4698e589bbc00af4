//! The result of a fit: everything that an answer is made of.

use nalgebra::DMatrix;

use super::lack_of_fit::LackOfFit;
use super::{
    Agreement, Channel, CheckedRun, Effect, ErrorScores, Estimate, Factor, Filter, Gaussian, Identity,
    Measured, NuisanceFit, Parameter, RigError, RigRows, SignalNoise, StatedNoise,
};

/// Residuals of a channel that stay correlated for longer than the filter explains.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Autocorrelation {
    /// Mean autocorrelation of the residuals between half a filter's width and one and a half.
    pub mean: f64,
    /// Standard deviation of that mean for white noise, whose own mean is nearly zero there.
    pub chance: f64,
    /// Factor by which white noise's intervals are too narrow where they rest on the residuals' slowest part
    /// alone.
    pub factor: f64,
}

/// A channel as the fit found it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelFit {
    /// Name, unit, stated noise.
    pub channel: Channel,
    /// Standard deviation per unfiltered sample that the rows were whitened by.
    pub sigma: f64,
    /// Root mean square of the filtered residuals, outliers weighted as they count.
    pub residual_rms: f64,
    /// Root mean square of the filtered measurements.
    pub measured_rms: f64,
    /// Standard deviation of the filtered measurements.
    pub measured_sd: f64,
    /// Standard deviation per unfiltered sample as differences of the readings show it; zero where they show
    /// none.
    pub noise_floor: f64,
    /// Rows that counted less because an outlier spoilt them.
    pub outliers: u32,
    /// Samples rejected because of this channel.
    pub rejected: u32,
    /// Standard deviation that the filtered residuals should have.
    pub residual_sigma: f64,
    /// `None` if the residuals are no more autocorrelated than the filter explains.
    pub autocorrelation: Option<Autocorrelation>,
}

/// Noise of a group of signals that the coefficients are made of, as the fit counted it.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalFit {
    /// Name, unit, stated noise, noise as differences show it.
    pub noise: SignalNoise,
    /// Standard deviation per sample that rows were weighed by.
    pub sigma: f64,
}

/// Residuals of one filtered row block.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockResidual {
    /// Time of the sample that completed the block, s; zero for still poses.
    pub time_s: f64,
    /// Filtered measurement less the prediction, one a channel.
    pub values: Vec<f64>,
    /// Weight of each row beside 1/σ: less than 1 where an outlier spoilt it, zero where the block tells
    /// nothing of the channel; empty if all count fully.
    pub weights: Vec<f64>,
}

impl BlockResidual {
    /// Returns the residual of a channel as the answer counts it.
    pub fn weighted(&self, channel: usize) -> f64 {
        let weight = self.weights.get(channel).copied().unwrap_or(1.0);
        weight * self.values.get(channel).copied().unwrap_or(0.0)
    }

    /// Returns false if the block tells nothing of a channel.
    pub fn measures(&self, channel: usize) -> bool {
        self.weights.get(channel).is_none_or(|weight| *weight != 0.0)
    }
}

/// The noise of the residuals against what was stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseCheck {
    /// True if every σ was stated; else they are from the residuals.
    pub sigma_given: bool,
    /// Variance of the whitened, filtered noise per row.
    pub noise_gain: f64,
    /// Residual variance relative to what σ lets expect; 1 where every σ comes from the residuals.
    pub variance_ratio: f64,
    /// The covariance was multiplied by this.
    pub variance_scale: f64,
    /// Of that, what efforts of drives leave beside white noise, where errors of the rig would otherwise have
    /// to be larger than stated; 1 elsewhere.
    pub model_error: f64,
    /// Degrees of freedom that parameters and errors took of the rows.
    pub fitted: f64,
    /// χ² per degree of freedom of merged runs' disagreement, where their noise does not explain it.
    pub disagreement: Option<f64>,
}

/// Samples and rows counted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Counts {
    /// Samples in the source.
    pub samples: u64,
    /// Samples rejected by screening.
    pub rejected: u64,
    /// Gaps in time, at which the filter started anew.
    pub gaps: u64,
    /// Rejected samples by the signal that was the reason, as far as there were any.
    pub rejected_by_signal: Vec<(String, u64)>,
    /// Row blocks absorbed, of one row a channel each.
    pub blocks: u64,
}

/// The part of a recording that the answer rests on, where older rows are forgotten.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forgotten {
    /// True for a window; else older rows are forgotten exponentially.
    pub is_window: bool,
    /// The time constant, or the window's length, s.
    pub span_s: f64,
    /// Seconds of rows that the answer rests on.
    pub effective_s: f64,
}

/// The estimate as rows arrived.
#[derive(Clone, Debug, PartialEq)]
pub struct Convergence {
    /// Time of the sample that completed the rows, s.
    pub time_s: f64,
    /// Each parameter; `None` while the rows do not determine it.
    pub parameters: Vec<Option<Measured>>,
}

/// The prior knowledge that is in the estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// Each known value.
    pub statements: Vec<PriorStatement>,
    /// The estimate from the data alone.
    pub data_alone: Box<Estimate>,
}

/// One known value.
#[derive(Clone, Debug, PartialEq)]
pub struct PriorStatement {
    /// The name it was stated by: `mass_kg`, `symmetry y`, `arm.M`.
    pub name: String,
    /// The parameter that it is first about.
    pub parameter: usize,
    /// Stated value, SI; zero for a plane of symmetry.
    pub value: f64,
    /// Its standard deviation, SI.
    pub sigma: f64,
    /// True for a plane of symmetry.
    pub is_symmetry: bool,
    /// Parameters that a plane of symmetry leaves free because the size of its link is not known; empty
    /// otherwise.
    pub free: Vec<usize>,
    /// The statement in words.
    pub text: String,
}

/// The result of a fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The unknowns, in the order of the columns.
    pub parameters: Vec<Parameter>,
    /// The channels, in the order of the rows.
    pub channels: Vec<ChannelFit>,
    /// Noise of the signals that rows were weighed by; empty where it counts nothing.
    pub signals: Vec<SignalFit>,
    /// Noise that is stated, beside what readings show; empty where only a factor is at hand.
    pub stated_noise: Vec<StatedNoise>,
    /// The errors of sensors and mounting that were estimated with the parameters and eliminated.
    pub nuisances: Vec<NuisanceFit>,
    /// The agreement of these errors with what was known of them beforehand; `None` if the rows tell nothing
    /// of them.
    pub agreement: Option<Agreement>,
    /// The scores of these errors against what was known of them, in their order.
    pub error_scores: Option<ErrorScores>,
    /// Parameters and these errors together, as far as they are determined; `None` unless something was known
    /// of them together ([`super::RowSource::beforehand`]).
    pub joint: Option<Gaussian>,
    /// Covariance that was added after the fit, by its source: a fixture taken off, several clocks.
    pub added: Vec<(String, DMatrix<f64>)>,
    /// The device's own result from the same samples; `None` without one.
    pub device: Option<Box<Estimate>>,
    /// All rows, whitened; gain errors eliminated, covariance inflated for autocorrelation and noise of the
    /// signals.
    pub factor: Factor,
    /// Solution with its covariance, known values and a fixture counted.
    pub estimate: Estimate,
    /// The rows that `estimate` solves, whitened by their true σ, where these are not those of `factor` with
    /// their variance scaled: a fixture was taken off, or gain errors were fitted with the larger noise.
    /// Known values are not in it.
    pub solved: Option<Factor>,
    /// The rows that `estimate` solves with the errors that other recordings of the rig share as columns;
    /// `None` where these are not known apart. Known values are not in it.
    pub rig_rows: Option<RigRows>,
    /// The share in columns of unit length that is no more than rounding ([`super::RowSource::rounding`]).
    pub rounding: f64,
    /// The model's ([`super::RowSource::model_fingerprint`]).
    pub model_fingerprint: u64,
    /// What tells the readings of each run from others ([`super::RowSource::identity`]).
    pub identities: Vec<Identity>,
    /// What was known beforehand, if anything.
    pub prior: Option<Prior>,
    /// The residuals against the noise that was stated.
    pub noise: NoiseCheck,
    /// Factor on the standard deviation of each parameter for autocorrelated residuals; empty: none.
    pub inflation: Vec<f64>,
    /// Factor by which [`Fit::factor`] holds each standard deviation larger for all that does not average
    /// out; empty: none.
    pub widened: Vec<f64>,
    /// Error of each parameter that noise of the regressor's own signals is expected to make, counted in the
    /// intervals; empty: none was stated or found.
    pub signal_bias: Vec<f64>,
    /// Information that noise of the rates alone brings to a moment of inertia, 1/(kg m²)².
    pub spurious_information: f64,
    /// Residuals of each row block; empty where only a factor is at hand.
    pub residuals: Vec<BlockResidual>,
    /// The filter that the rows went through; the identity where only a factor is at hand.
    pub filter: Filter,
    /// Samples and rows counted.
    pub counts: Counts,
    /// The evidence of the residuals against the model; nothing where only a factor is at hand.
    pub lack_of_fit: LackOfFit,
    /// The runs whose factors alone are in it, with what their own checks found; empty of a recording.
    pub runs: Vec<CheckedRun>,
    /// The basis of the answer where older rows are forgotten.
    pub forgotten: Option<Forgotten>,
    /// The estimate on its way; empty where only a factor is at hand.
    pub convergence: Vec<Convergence>,
}

impl Fit {
    /// Returns the relative gain error of a channel; `None` if its gain was taken as exact.
    pub fn gain(&self, channel: usize) -> Option<&NuisanceFit> {
        self.nuisances.iter().find(|k| k.nuisance.effect == Effect::Gain { channel })
    }

    /// Returns the estimate from the data alone, without what was known beforehand.
    pub fn data_alone(&self) -> &Estimate {
        self.prior.as_ref().map_or(&self.estimate, |prior| &prior.data_alone)
    }

    /// Returns the rows that the estimate from the data alone solves, whitened by their true σ.
    pub fn scaled_factor(&self) -> Factor {
        self.solved.clone().unwrap_or_else(|| self.factor.discount(self.noise.variance_scale))
    }

    /// Says of which instrument each error is that other recordings share.
    pub fn name_instruments(&mut self, name: impl Fn(&RigError) -> String) {
        self.rig_rows = self.rig_rows.take().map(|rows| rows.of_instruments(name));
    }

    /// Returns the same rows with the errors that other recordings share as columns, as far as these are
    /// known apart.
    pub fn rows(&self) -> RigRows {
        self.rig_rows.clone().unwrap_or_else(|| RigRows::plain(self.scaled_factor()))
    }

    /// Returns the factor with all standard deviations as much larger as the most that one parameter is.
    ///
    /// Factors that differ from parameter to parameter keep the estimate, also where it is next to
    /// undetermined: a direction that is no parameter's own then claims what the rows do not say. Bodies have
    /// to be judged by the rows.
    pub fn evenly_widened(&self) -> Factor {
        let most = self.widened.iter().copied().fold(1.0, f64::max);
        if most <= 1.0 {
            return self.factor.clone();
        }
        let back: Vec<f64> = self.widened.iter().map(|by| 1.0 / by).collect();
        self.factor.inflate(&self.data_alone().values, &back).discount(most * most)
    }

    /// Returns the largest factor on an interval for autocorrelated residuals; `None` if they are white.
    pub fn largest_inflation(&self) -> Option<f64> {
        self.inflation.iter().copied().reduce(f64::max)
    }
}
