//! The batch side of the pipeline: a recording's readings, in f64, through the very functions that the
//! firmware runs.
//!
//! Lives here: two passes where the noise is not given, what they leave and what noise that tells ([`residuals`]), the way
//! to the answer ([`course`]), gain errors of the load cell ([`gains`]), calibration of the accelerometer on still poses
//! ([`poses`]). May not
//! live here: file formats, printing. Before this: [`crate::recording`]; after it: [`crate::answer`].

pub(crate) mod coloured;
pub mod course;
pub mod factor_file;
pub mod gains;
pub mod knocks;
pub mod known;
pub mod pooled;
pub mod remembered;
pub mod residuals;
pub mod tare;
pub mod whiteness;

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{ConfigError, Counters, Estimator, EstimatorConfig, Reference};
use rigident_shared::factor::InformationFactor;
use rigident_shared::screening::Limits;

pub use self::course::{Progression, progression};
use self::gains::{ChannelFactors, GainFit};
use self::pooled::{Judgement, RowSet, judge};
pub use self::residuals::BlockResidual;
use self::residuals::{residuals, rms, sigma_from_residuals};
use crate::answer::identifiability::{self, RegressorNoise};
use crate::answer::result::ParameterState;
use crate::answer::{Estimate, Noise};
use crate::fit::ESTIMATOR_TAPS as TAPS;
pub use crate::fit::{FILTER_WIDTH_S, filter_width_s, row_every};
use crate::problem::body::imu_noise::gyro_sigma;
use crate::problem::body::shares::{Shares, Split};
pub use crate::problem::body::{Input, input_checks as plausible};

/// σ of force and moment to start from where none is given, N and N m: only their ratio matters.
const NOMINAL_SIGMA: [f64; 6] = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1];

/// The factor of either model.
#[derive(Clone, Debug, PartialEq)]
pub enum Factor {
    /// The body alone; the wrench offset was known.
    Ten(Box<InformationFactor<f64, 10>>),
    /// The body and the wrench offset.
    Sixteen(Box<InformationFactor<f64, 16>>),
}

impl Factor {
    /// From its numbers; see [`InformationFactor::from_entries`]. `None` if they are not a factor.
    pub fn from_entries(parameters: usize, entries: Vec<f64>, rows: u32) -> Option<Self> {
        match parameters {
            10 => InformationFactor::from_entries(entries, rows).map(|f| Self::Ten(Box::new(f))),
            16 => InformationFactor::from_entries(entries, rows).map(|f| Self::Sixteen(Box::new(f))),
            _ => None,
        }
    }

    /// Scalar rows absorbed.
    pub fn rows(&self) -> u32 {
        match self {
            Self::Ten(f) => f.rows(),
            Self::Sixteen(f) => f.rows(),
        }
    }

    /// Sum of squares of the whitened residuals.
    pub fn residual_sum_of_squares(&self) -> f64 {
        match self {
            Self::Ten(f) => f.residual_sum_of_squares(),
            Self::Sixteen(f) => f.residual_sum_of_squares(),
        }
    }

    /// The same estimate with standard deviations so many times as large; see [`InformationFactor::stretched`].
    pub(crate) fn stretched(&self, estimate: &[f64], by: &[f64]) -> Self {
        fn array<const N: usize>(values: &[f64], otherwise: f64) -> [f64; N] {
            std::array::from_fn(|j| values.get(j).copied().unwrap_or(otherwise))
        }
        match self {
            Self::Ten(f) => Self::Ten(Box::new(f.stretched(&array(estimate, 0.0), &array(by, 1.0)))),
            Self::Sixteen(f) => Self::Sixteen(Box::new(f.stretched(&array(estimate, 0.0), &array(by, 1.0)))),
        }
    }

    /// Estimate and covariance; see [`Estimate::new`].
    pub fn estimate(&self, variance_scale: f64, noise: Noise) -> Estimate {
        match self {
            Self::Ten(f) => Estimate::new(f, variance_scale, noise),
            Self::Sixteen(f) => Estimate::new(f, variance_scale, noise),
        }
    }
}

/// What the recording says.
#[derive(Clone, Debug)]
pub struct Identification {
    /// The factor of all rows, whitened by `channel_sigma`, gain errors eliminated.
    pub factor: Factor,
    /// Solution with its covariance.
    pub estimate: Estimate,
    /// σ used, N and N m, per unfiltered reading.
    pub channel_sigma: [f64; 6],
    /// Whether σ was given; else it comes from the residuals.
    pub sigma_given: bool,
    /// Factor on the standard deviation of each parameter for coloured noise, in the factor and the estimate; empty: none.
    pub widening: Vec<f64>,
    /// Variance of the whitened, filtered noise per row.
    pub noise_gain: f64,
    /// Residual variance relative to what σ lets expect; 1 where σ comes from the residuals.
    pub variance_ratio: f64,
    /// Root mean square of the residuals, N and N m.
    pub residual_rms: [f64; 6],
    /// Residuals of every row block.
    pub residuals: Vec<BlockResidual>,
    /// Relative gain errors of the load cell as far as they show; zero where they have no σ.
    pub gains: [f64; 6],
    /// What the gyro's noise alone would bring.
    pub regressor_noise: RegressorNoise,
    /// Channels whose residuals show noise beyond what the filter explains, the worst first.
    pub colour: Vec<whiteness::Colour>,
    /// What happened to the readings.
    pub counters: Counters,
}

impl Identification {
    /// What became of each parameter: ten, or sixteen with the offset.
    pub fn states(&self) -> Vec<ParameterState> {
        identifiability::states(&self.estimate, self.regressor_noise)
    }

    /// The largest factor on an interval for coloured noise, if they count it.
    pub fn widened(&self) -> Option<f64> {
        self.widening.iter().copied().reduce(f64::max)
    }

    /// What knocks are told by.
    fn reference(&self, input: &Input) -> Reference<f64, 16> {
        knocks::reference(input, &self.estimate, self.variance_ratio)
    }

    /// How its intervals were scaled.
    fn judgement(&self) -> Judgement {
        let rows =
            RowSet { rows: self.factor.rows(), noise_gain: self.noise_gain, sigma_given: self.sigma_given };
        let determined = self.estimate.determined.iter().filter(|d| **d).count();
        judge(&[rows], self.factor.residual_sum_of_squares(), determined as f64)
    }
}

/// Why there is no identification.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentificationError {
    /// Nothing was left to absorb.
    #[error(
        "no usable rows: of {readings} readings {rejected} were rejected and the rest is shorter than the filter of {width_s} s"
    )]
    NoRows {
        /// Readings given.
        readings: u32,
        /// Readings rejected.
        rejected: u32,
        /// Width of the filter.
        width_s: f64,
    },
    /// The filter does not fit the rate, or a σ is impossible.
    #[error("the estimator cannot be set up ({0:?}): check rate_hz and noise_n_nm in the rig file")]
    Config(ConfigError),
}

/// Identifies the body in S.
///
/// # Errors
/// [`IdentificationError`] if no row could be absorbed.
pub fn identify(input: &Input) -> Result<Identification, IdentificationError> {
    if input.known_offset.is_some() {
        run::<10>(input, |f| Factor::Ten(Box::new(f)))
    } else {
        run::<16>(input, |f| Factor::Sixteen(Box::new(f)))
    }
}

/// The same conclusions for a factor that the firmware made of these readings, whitened by
/// `input.channel_sigma`. `sigma_given` is false if that σ was itself estimated from these readings.
///
/// Gain errors multiply the parameters, so the factor does not hold them: where they have a σ, it is the readings
/// that are concluded from.
///
/// # Errors
/// [`IdentificationError`] if there is no row, or no σ that it was whitened by.
pub fn conclude_firmware(
    input: &Input,
    factor: Factor,
    sigma_given: bool,
) -> Result<Identification, IdentificationError> {
    let sigma = input.channel_sigma.unwrap_or(NOMINAL_SIGMA);
    let shares = shares(input, sigma)?;
    match factor {
        Factor::Ten(f) => {
            let absorbed = absorb::<10>(input, &shares, sigma)?;
            let told = conclude(sigma_given, input, &shares, &f, &absorbed, |f| Factor::Ten(Box::new(f)));
            Ok(with_colour(told, input, &shares, &absorbed))
        }
        Factor::Sixteen(f) => {
            let absorbed = absorb::<16>(input, &shares, sigma)?;
            let told = conclude(sigma_given, input, &shares, &f, &absorbed, |f| Factor::Sixteen(Box::new(f)));
            Ok(with_colour(told, input, &shares, &absorbed))
        }
    }
}

fn config(input: &Input, channel_sigma: [f64; 6]) -> EstimatorConfig<f64> {
    EstimatorConfig {
        rate_hz: if input.is_static { 1.0 } else { input.rate_hz },
        filter_width_s: if input.is_static { 0.0 } else { filter_width_s(input.rate_hz) },
        row_every: if input.is_static { 1 } else { row_every(input.rate_hz) },
        channel_sigma,
        known_offset: input.known_offset.unwrap_or_default(),
        mounting: input.mounting,
        limits: if input.is_static { Limits { frozen_after: 0, ..input.limits } } else { input.limits },
    }
}

fn run<const N: usize>(
    input: &Input,
    wrap: impl Fn(InformationFactor<f64, N>) -> Factor,
) -> Result<Identification, IdentificationError> {
    let mut sigma = input.channel_sigma.unwrap_or(NOMINAL_SIGMA);
    let shares = shares(input, sigma)?;
    let mut absorbed = absorb::<N>(input, &shares, sigma)?;
    if input.channel_sigma.is_none() {
        // Weights from the residuals of the unweighted fit, then once more from those of the weighted one.
        for _ in 0..2 {
            sigma = sigma_from_residuals(input, &shares, &absorbed);
            absorbed = absorb::<N>(input, &shares, sigma)?;
        }
    }
    let sigma_given = input.channel_sigma.is_some();
    let mut identification = conclude(sigma_given, input, &shares, &absorbed.factor, &absorbed, &wrap);
    for _ in 0..knocks::MOST_ROUNDS {
        let before = identification.counters.knocks;
        if before == [0; 6] {
            break;
        }
        let shares = shares.watching(identification.reference(input));
        absorbed = absorb::<N>(input, &shares, sigma)?;
        if !sigma_given {
            sigma = sigma_from_residuals(input, &shares, &absorbed);
            absorbed = absorb::<N>(input, &shares, sigma)?;
        }
        identification = conclude(sigma_given, input, &shares, &absorbed.factor, &absorbed, &wrap);
    }
    Ok(with_colour(identification, input, &shares, &absorbed))
}

/// Where residuals are coloured, the same estimate with the intervals that they leave.
fn with_colour<const N: usize>(
    white: Identification,
    input: &Input,
    shares: &Shares,
    absorbed: &Absorbed<N>,
) -> Identification {
    if white.colour.is_empty() {
        return white;
    }
    let config = absorbed.settings.config();
    let scale = white.judgement().variance_scale;
    let noise = coloured::Noise {
        white: &white_rows(config),
        variance: &config.channel_sigma.map(|s| s * s * scale),
        colour: &white.colour,
        row_period_s: row_period_s(config),
    };
    let watching = shares.watching(white.reference(input));
    let widening = coloured::widening_of_body::<N>(&watching, config.channel_sigma, &white.estimate, &noise);
    Identification {
        factor: white.factor.stretched(&white.estimate.values, &widening),
        estimate: white.estimate.stretched(&widening),
        widening,
        ..white
    }
}

/// Autocovariance of the rows for white noise of unit variance before the filter.
fn white_rows(config: &EstimatorConfig<f64>) -> Vec<f64> {
    whiteness::white_autocovariance(&whiteness::impulse_response(config), config.row_every)
}

fn row_period_s(config: &EstimatorConfig<f64>) -> f64 {
    f64::from(config.row_every) / config.rate_hz
}

/// How the readings are shared out over the cores.
fn shares(input: &Input, sigma: [f64; 6]) -> Result<Shares<'_>, IdentificationError> {
    let split = Split::of(input.readings.len());
    Shares::new(&input.readings, &config(input, sigma), split).map_err(IdentificationError::Config)
}

/// `absorbed` are the same readings, whitened by the same σ, as the factor.
fn conclude<const N: usize>(
    sigma_given: bool,
    input: &Input,
    shares: &Shares,
    factor: &InformationFactor<f64, N>,
    absorbed: &Absorbed<N>,
    wrap: impl Fn(InformationFactor<f64, N>) -> Factor,
) -> Identification {
    let settings = &*absorbed.settings;
    let sigma = settings.config().channel_sigma;
    // The prior of the gains is not the noise's to scale, so with gains the fit is scaled and not its covariance.
    let with_gains = |scale: f64| absorbed.fit_gains(&input.gain_sigma, scale);
    let fit = with_gains(1.0);
    let (factor, gains) = fit.map_or((*factor, [0.0; 6]), |fit| (fit.factor, fit.gains));
    let determined = factor.solve().determined.iter().filter(|d| **d).count();
    let counters = absorbed.counters;
    let noise_gain = settings.noise_gain();
    let rows = RowSet { rows: factor.rows(), noise_gain, sigma_given };
    let Judgement { noise, variance_ratio, variance_scale: scale, .. } =
        judge(&[rows], factor.residual_sum_of_squares(), determined as f64);
    let widened = if scale > 1.0 { with_gains(scale) } else { None };
    let estimate = match widened {
        Some(fit) => Estimate::new(&fit.factor, 1.0, noise),
        None => Estimate::new(&factor, scale, noise),
    };
    let factor = wrap(factor);
    let watching = shares.watching(knocks::reference(input, &estimate, variance_ratio));
    let (residuals, knocks) = residuals::<N>(&watching, sigma, &estimate, &gains);
    let counters = Counters { knocks, ..counters };
    let gyro = input.gyro_sigma.unwrap_or_else(|| gyro_sigma(&input.readings));
    let moment_sigma = sigma[3..].iter().copied().fold(f64::INFINITY, f64::min);
    let weight = f64::from(counters.blocks) * f64::from(settings.config().row_every);
    Identification {
        factor,
        estimate,
        channel_sigma: sigma,
        sigma_given,
        widening: Vec::new(),
        noise_gain,
        variance_ratio,
        residual_rms: rms(&residuals),
        colour: colour(input, settings.config(), &residuals, scale),
        residuals,
        gains,
        regressor_noise: RegressorNoise {
            tensor_information: weight * settings.kernel().derivative_noise_gain() * gyro * gyro
                / (moment_sigma * moment_sigma),
        },
        counters,
    }
}

fn colour(
    input: &Input,
    config: &EstimatorConfig<f64>,
    residuals: &[BlockResidual],
    variance_scale: f64,
) -> Vec<whiteness::Colour> {
    if input.is_static {
        return Vec::new();
    }
    let variance = config.channel_sigma.map(|s| s * s * variance_scale);
    whiteness::colour(residuals, &white_rows(config), row_period_s(config), config.row_every, &variance)
}

/// Readings taken in.
struct Absorbed<const N: usize> {
    factor: InformationFactor<f64, N>,
    counters: Counters,
    /// Only where the load cell's gains are uncertain.
    channels: Option<ChannelFactors>,
    /// An estimator like those that took them: filter, weights.
    settings: Box<Estimator<f64, N, TAPS>>,
}

impl<const N: usize> Absorbed<N> {
    /// The fit with gains, the noise's variance taken `scale` times as large; `None` if they are certain.
    fn fit_gains(&self, gain_sigma: &[f64; 6], scale: f64) -> Option<GainFit<N>> {
        let config = self.settings.config();
        let root = (f64::from(config.row_every) / scale).sqrt();
        self.channels.as_ref().map(|c| c.fit(&config.channel_sigma.map(|sigma| root / sigma), gain_sigma))
    }

    /// Factor with the gains eliminated, and the gains; without them the factor as it is.
    fn factor_and_gains(&self, gain_sigma: &[f64; 6]) -> (InformationFactor<f64, N>, [f64; 6]) {
        self.fit_gains(gain_sigma, 1.0).map_or((self.factor, [0.0; 6]), |fit| (fit.factor, fit.gains))
    }
}

fn absorb<const N: usize>(
    input: &Input,
    shares: &Shares,
    sigma: [f64; 6],
) -> Result<Absorbed<N>, IdentificationError> {
    let config = config(input, sigma);
    let settings = Box::new(Estimator::new(&config).map_err(IdentificationError::Config)?);
    let start = || channels(input);
    let done = shares
        .absorb::<N, Option<ChannelFactors>>(sigma, start, take_channels)
        .map_err(IdentificationError::Config)?;
    if done.counters.blocks == 0 {
        return Err(IdentificationError::NoRows {
            readings: done.counters.readings,
            rejected: done.counters.rejected,
            width_s: config.filter_width_s,
        });
    }
    let channels = done.parts.into_iter().reduce(merge_channels).flatten();
    Ok(Absorbed { factor: done.factor, counters: done.counters, channels, settings })
}

/// Needed only where the load cell's gains are uncertain.
fn channels(input: &Input) -> Option<ChannelFactors> {
    input.gain_sigma.iter().any(|s| *s > 0.0).then(ChannelFactors::default)
}

fn take_channels<const N: usize>(
    channels: &mut Option<ChannelFactors>,
    _: &Reading<f64>,
    estimator: &Estimator<f64, N, TAPS>,
) {
    // Where gains are uncertain no row is taken for spoilt.
    if let (Some(channels), Some(block)) = (channels, estimator.last_block()) {
        channels.absorb(&block);
    }
}

fn merge_channels(mut a: Option<ChannelFactors>, b: Option<ChannelFactors>) -> Option<ChannelFactors> {
    if let (Some(a), Some(b)) = (&mut a, &b) {
        a.merge(b);
    }
    a
}
