//! Identification of trees of links: base parameters with their intervals, and the full parameters nearest to a nominal
//! model.
//!
//! Lives here: recordings brought to frames of joints and base ([`prepare`]), which columns joints have ([`columns`]), their rows ([`rows`]), friction ([`drive`]),
//! gain errors of the load cell (`gains`), noise that is not white
//! (`colour`) or that stands in the rows (`rate_noise`), the identification itself (this file), what of it is identified and
//! why not ([`answer`]), whether bodies have it ([`possible`]), whether columns tell of one motion ([`plausible`]), full
//! parameters ([`nearest`]), trees and recordings to try it on ([`simulated`]). May not live here: the
//! formulas of the rows
//! (`rigident_shared::tree`), which parameters there are ([`crate::model::base`]), intervals and the judgement of
//! residuals, which are those of a single body ([`crate::answer`], [`crate::identification::pooled`]). Next: [`prepare`].

pub mod answer;
mod colour;
pub mod columns;
pub mod drive;
mod gains;
pub mod joints;
pub mod nearest;
#[cfg(test)]
mod nearest_tests;
pub(crate) mod noise;
pub mod plausible;
pub mod polynomial;
pub mod possible;
pub mod prepare;
mod rate_noise;
pub mod result;
pub mod rows;
pub mod simulated;
#[cfg(test)]
mod tests;

use nalgebra::{DMatrix, DVector};
use rigident_shared::tree::{BaseMotion, TreeError};

pub use self::colour::Residuals;
use self::drive::Drive;
use self::gains::Channels;
use self::rows::{Filtered, RowMaker};
use crate::answer::identifiability::RegressorNoise;
use crate::answer::{Estimate, Noise};
use crate::fit::Factor;
use crate::identification::pooled::{Judgement, RowSet, judge};
use crate::identification::whiteness::Colour;
use crate::identification::{filter_width_s, row_every};
use crate::model::base::{BaseParameters, ROUNDED, Rows, Situation, base_parameters};
use crate::model::{Model, ModelError};

/// One instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Its time, ns.
    pub time_ns: u64,
    /// Of all joints, as [`crate::model::rows::Moving::set`] takes them.
    pub positions: Vec<f64>,
    /// Likewise, rad/s and m/s.
    pub rates: Vec<f64>,
    /// Specific force at the base's IMU and the base's rate, axes of the base; angular acceleration is not looked at.
    pub base: BaseMotion<f64>,
    /// Wrench on the base link about its origin, N and N m; unused if it is not among the rows.
    pub wrench: [f64; 6],
    /// Force or torque of every freedom's drive, N or N m; empty if they are not among the rows.
    pub efforts: Vec<f64>,
}

/// What is to be identified, and from what.
#[derive(Clone, Debug)]
pub struct Input {
    /// The tree, without fixed joints.
    pub model: Model,
    /// Instants in the order of their times.
    pub frames: Vec<Frame>,
    /// Each is a still pose of its own, without time.
    pub is_static: bool,
    /// Frames per second; not used for still poses.
    pub rate_hz: f64,
    /// Where the base's IMU sits, in the base's frame, m.
    pub imu_position: [f64; 3],
    /// What is measured, on what kind of base.
    pub situation: Situation,
    /// 1 σ per reading: wrench, then efforts, as far as they are among the rows; `None`: from the residuals.
    pub channel_sigma: Option<Vec<f64>>,
    /// The wrench's offset if known; `None`: estimated.
    pub known_offset: Option<[f64; 6]>,
    /// 1 σ of the load cell's relative gain errors, constant over the recording; zero: none.
    pub gain_sigma: [f64; 6],
    /// What turns with the joints and rubs.
    pub drives: Vec<Drive>,
    /// 1 σ of the rates of the links, rad/s: what their noise alone would bring is no information.
    pub rate_sigma: f64,
}

impl Input {
    /// The same of other frames.
    pub(crate) fn with_frames(&self, frames: Vec<Frame>) -> Self {
        Self {
            frames,
            model: self.model.clone(),
            channel_sigma: self.channel_sigma.clone(),
            drives: self.drives.clone(),
            ..*self
        }
    }

    /// The wrench is among the rows.
    pub fn has_wrench(&self) -> bool {
        self.situation.rows != Rows::Joint
    }

    /// The joints' drives are among the rows.
    pub fn has_efforts(&self) -> bool {
        self.situation.rows != Rows::Base
    }

    /// Names of the channels: `fx` … `mz`, then the joints'.
    pub fn channels(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        if self.has_wrench() {
            names.extend(["fx", "fy", "fz", "mx", "my", "mz"].map(str::to_owned));
        }
        if self.has_efforts() {
            names.extend(self.freedom_names());
        }
        names
    }

    /// A name for every freedom: the joint's, numbered where it has several.
    pub fn freedom_names(&self) -> Vec<String> {
        let links = self.model.links.iter().skip(1);
        links
            .flat_map(|l| {
                let several = l.link.joint.freedoms();
                (0..several).map(move |k| match several {
                    1 => l.joint_name.clone(),
                    _ => format!("{}[{k}]", l.joint_name),
                })
            })
            .collect()
    }
}

/// Why there is no identification.
#[derive(Debug, thiserror::Error)]
pub enum TreeIdentificationError {
    /// The model has no base parameters.
    #[error("{0}")]
    Model(#[from] ModelError),
    /// A device's factor is of something else.
    #[error(
        "the device's factor has {device} parameters, the model with its offset {model}: was it set to another one?"
    )]
    Device {
        /// Of the factor.
        device: usize,
        /// Of the model.
        model: usize,
    },
    /// Frames that do not fit the tree: a mistake of the program's.
    #[error("the frames do not fit the model ({0:?})")]
    Tree(TreeError),
    /// Nothing was left to absorb.
    #[error(
        "no usable rows: {frames} frames, and no stretch of them without a gap is as long as the filter of {width_s} s"
    )]
    NoRows {
        /// Frames given.
        frames: usize,
        /// Width of the filter.
        width_s: f64,
    },
    /// The filter does not fit the rate.
    #[error("at {rate_hz} frames per second there is no filter of {width_s} s: {why}")]
    Rate {
        /// The rate.
        rate_hz: f64,
        /// Width of the filter.
        width_s: f64,
        /// What to do.
        why: &'static str,
    },
}

/// What the recording says.
#[derive(Clone, Debug)]
pub struct TreeIdentification {
    /// The base parameters that were estimated, in the order of the estimate.
    pub base: BaseParameters,
    /// Names of all parameters: base parameters, then offsets, then those of the drives.
    pub names: Vec<String>,
    /// Their units.
    pub units: Vec<&'static str>,
    /// All rows, whitened by `channel_sigma`.
    pub factor: Factor,
    /// Solution with its covariance.
    pub estimate: Estimate,
    /// Combinations that the rows say nothing of: shares of the column-scaled parameters.
    pub lost: Vec<Vec<(usize, f64)>>,
    /// σ used per reading, N and N m, channel by channel.
    pub channel_sigma: Vec<f64>,
    /// Whether σ was given.
    pub sigma_given: bool,
    /// Variance of the whitened, filtered noise per row.
    pub noise_gain: f64,
    /// Residual variance relative to what σ lets expect.
    pub variance_ratio: f64,
    /// What the covariance was multiplied by.
    pub variance_scale: f64,
    /// How the noise is known.
    pub noise: Noise,
    /// Root mean square of the filtered residuals, channel by channel.
    pub residual_rms: Vec<f64>,
    /// Root mean square of the filtered measurements.
    pub measured_rms: Vec<f64>,
    /// Filtered residuals of every row block.
    pub residuals: Vec<Residuals>,
    /// 1 σ that they should have, channel by channel.
    pub residual_sigma: Vec<f64>,
    /// What the noise of the rates would bring to the columns of moments of inertia.
    pub regressor_noise: RegressorNoise,
    /// Channels whose residuals show noise beyond what the filter explains, the worst first.
    pub colour: Vec<Colour>,
    /// Factor on the standard deviation of each parameter for it, in the factor and the estimate; empty: none.
    pub widening: Vec<f64>,
    /// Error of each parameter that noise of the rates is expected to make; the standard deviations in the factor and the
    /// estimate count it.
    pub rate_bias: Vec<f64>,
    /// Relative gain errors of the load cell as far as they show; zero where they have no σ.
    pub gains: [f64; 6],
    /// Filtered row blocks.
    pub blocks: usize,
}

impl TreeIdentification {
    /// The largest factor on an interval for coloured noise, if they count it.
    pub fn widened(&self) -> Option<f64> {
        self.widening.iter().copied().reduce(f64::max)
    }
}

/// σ of force and moment to start from where none is given: only ratios matter.
const NOMINAL_SIGMA: (f64, f64) = (1.0, 0.1);

fn starting_sigma(input: &Input) -> Vec<f64> {
    let force = |c: usize| input.has_wrench() && c < 3;
    (0..input.channels().len()).map(|c| if force(c) { NOMINAL_SIGMA.0 } else { NOMINAL_SIGMA.1 }).collect()
}

/// Identifies a tree.
///
/// # Errors
/// [`TreeIdentificationError`] if there are no rows.
pub fn identify(input: &Input) -> Result<TreeIdentification, TreeIdentificationError> {
    identify_watched(input, &|_, _| {})
}

/// Told what is being done, and which share of it is; zero: that is not known.
pub type Watch<'a> = &'a dyn Fn(&str, f64);

/// The same, watched.
///
/// # Errors
/// As [`identify`].
pub fn identify_watched(
    input: &Input,
    watch: Watch<'_>,
) -> Result<TreeIdentification, TreeIdentificationError> {
    watch("base parameters", 0.0);
    let base = base_parameters(&input.model, &input.situation)?;
    let maker = RowMaker::new(input, &base).map_err(TreeIdentificationError::Tree)?;
    let filtered = filter(input, maker, &|share| watch("rows of the frames", share))?;
    watch("estimate", 0.0);
    let mut sigma = input.channel_sigma.clone().unwrap_or_else(|| starting_sigma(input));
    let fitter = Fitter::new(input, &base, &filtered);
    let mut fit = fitter.fit(&sigma, 1.0);
    if input.channel_sigma.is_none() {
        // Weights from the residuals of the unweighted fit, then once more from those of the weighted one.
        for _ in 0..2 {
            sigma = filtered.gained(&fit.1, fitter.offset).raw_sigma(&fit.0);
            fit = fitter.fit(&sigma, 1.0);
        }
    }
    conclude(input, base, &fitter, fit, sigma)
}

/// How a device makes rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceRows {
    /// As here: momentum rows, filtered.
    Filtered,
    /// Of every frame by itself, with the accelerations in it.
    Frames,
}

/// Judges a factor that a device made by the readings it was made of. Its base parameters stand in the order of the standard
/// columns that stand for them.
///
/// # Errors
/// [`TreeIdentificationError`] if there are no rows, or the factor is of other parameters.
pub fn conclude_device(
    input: &Input,
    factor: Factor,
    made: DeviceRows,
) -> Result<TreeIdentification, TreeIdentificationError> {
    let mut base = base_parameters(&input.model, &input.situation)?;
    base.parameters.sort_by_key(|p| p.terms.first().map(|(column, _)| *column));
    let columns = rows::names_and_units(input, &base).0.len();
    if factor.parameters() != columns {
        return Err(TreeIdentificationError::Device { device: factor.parameters(), model: columns });
    }
    let maker = RowMaker::new(input, &base).map_err(TreeIdentificationError::Tree)?;
    let mut filtered = filter(input, maker, &|_| {})?;
    if made == DeviceRows::Frames {
        // What is left of its rows is the noise of single frames.
        filtered.noise_gain = 1.0;
    }
    let sigma = input.channel_sigma.clone().unwrap_or_else(|| starting_sigma(input));
    // The device knows of no gain errors.
    let fitter = Fitter { filtered: &filtered, offset: rows::offset_at(input, &base), channels: None };
    conclude(input, base, &fitter, (factor, [0.0; 6]), sigma)
}

/// How well what was found explains another recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Root mean square of what is left of the filtered measurements, channel by channel.
    pub residual_rms: Vec<f64>,
    /// Standard deviation of the filtered measurements.
    pub measured_sd: Vec<f64>,
}

/// Predicts a recording of the same tree with the same columns by what was found in another one.
///
/// # Errors
/// [`TreeIdentificationError`] if there are no rows.
pub fn predict(input: &Input, found: &TreeIdentification) -> Result<Prediction, TreeIdentificationError> {
    let maker = RowMaker::new(input, &found.base).map_err(TreeIdentificationError::Tree)?;
    let filtered = filter(input, maker, &|_| {})?;
    let filtered = filtered.gained(&found.gains, rows::offset_at(input, &found.base));
    let (residual_rms, _) = filtered.rms(&found.estimate.values);
    Ok(Prediction { residual_rms, measured_sd: filtered.measured_sd() })
}

/// What is left of measurements whose rows were made otherwise, columns in the order of the names.
pub fn residual(found: &TreeIdentification, rows: &DMatrix<f64>, measured: &DVector<f64>) -> DVector<f64> {
    measured - rows * DVector::from_column_slice(&found.estimate.values)
}

/// The filtered rows of a recording.
fn filter(input: &Input, maker: RowMaker, watch: &dyn Fn(f64)) -> Result<Filtered, TreeIdentificationError> {
    let every = if input.is_static { 1 } else { row_every(input.rate_hz) };
    let width_s = filter_width_s(input.rate_hz);
    let filtered = rows::filter(input, maker, width_s, every, watch)?;
    if filtered.blocks.is_empty() {
        return Err(TreeIdentificationError::NoRows { frames: input.frames.len(), width_s });
    }
    Ok(filtered)
}

/// Rows to factors, gain errors eliminated where the load cell has any.
struct Fitter<'a> {
    filtered: &'a Filtered,
    offset: Option<usize>,
    channels: Option<Channels>,
}

impl<'a> Fitter<'a> {
    fn new(input: &Input, base: &BaseParameters, filtered: &'a Filtered) -> Self {
        let offset = rows::offset_at(input, base);
        let some = input.has_wrench() && input.gain_sigma.iter().any(|s| *s > 0.0);
        Self { filtered, offset, channels: some.then(|| Channels::new(filtered, offset, input.gain_sigma)) }
    }

    /// The factor for these σ, the noise's variance taken `scale` times as large beside the gains' prior, and the gains.
    fn fit(&self, sigma: &[f64], scale: f64) -> (Factor, [f64; 6]) {
        match &self.channels {
            None => (self.filtered.absorb(sigma), [0.0; 6]),
            Some(channels) => {
                let root = (f64::from(self.filtered.every) / scale).sqrt();
                let weights: Vec<f64> = sigma.iter().map(|s| root / s).collect();
                let (factor, gains) = channels.fit(&weights);
                let residual = factor.residual_sum_of_squares();
                let rows = factor.rows();
                (factor.discount(1.0 / scale).with_residual(residual, rows), gains)
            }
        }
    }
}

fn conclude(
    input: &Input,
    base: BaseParameters,
    fitter: &Fitter,
    (mut factor, mut gains): (Factor, [f64; 6]),
    sigma: Vec<f64>,
) -> Result<TreeIdentification, TreeIdentificationError> {
    let filtered = fitter.filtered;
    let mut solution = factor.solve(ROUNDED);
    let determined = solution.determined.iter().filter(|d| **d).count();
    let sigma_given = input.channel_sigma.is_some();
    let rows = RowSet {
        rows: u32::try_from(factor.rows()).unwrap_or(u32::MAX),
        noise_gain: filtered.noise_gain,
        sigma_given,
    };
    let Judgement { noise, variance_ratio, variance_scale, .. } =
        judge(&[rows], factor.residual_sum_of_squares(), determined as f64);
    // The prior of the gains is not the noise's to scale.
    if variance_scale > 1.0 && fitter.channels.is_some() {
        (factor, gains) = fitter.fit(&sigma, variance_scale);
        solution = factor.solve(ROUNDED);
    }
    let filtered = &*filtered.gained(&gains, fitter.offset);
    let estimate = Estimate::of_numbers(
        solution.estimate.clone(),
        solution.covariance.clone() * variance_scale,
        solution.determined.clone(),
        solution.condition_number,
        noise,
    );
    let (residual_rms, measured_rms) = filtered.rms(&solution.estimate);
    let variance: Vec<f64> = sigma.iter().map(|s| s * s * variance_scale).collect();
    let residuals = colour::residuals(filtered, &solution.estimate);
    let colour = colour::colour(filtered, &residuals, input.rate_hz, &variance);
    let (mut estimate, mut widening) = (estimate, Vec::new());
    if !colour.is_empty() {
        widening = colour::widening(filtered, &estimate, &sigma, &variance, &colour, input.rate_hz);
    }
    let rate_bias = rate_noise::bias(input, &base, fitter.filtered, &solution, &sigma)?;
    let stretch: Vec<f64> = rate_bias
        .iter()
        .enumerate()
        .map(|(j, bias)| {
            let white = estimate.covariance[(j, j)].sqrt();
            let coloured = widening.get(j).copied().unwrap_or(1.0) * white;
            if white > 0.0 { coloured.hypot(*bias) / white } else { 1.0 }
        })
        .collect();
    if stretch.iter().any(|s| *s > 1.0) {
        factor = factor.inflate(&estimate.values, &stretch);
        estimate = estimate.stretched(&stretch);
    }
    let from = if input.has_wrench() { 3.min(sigma.len()) } else { 0 };
    let moment_sigma = sigma[from..].iter().copied().fold(f64::INFINITY, f64::min);
    let weight = filtered.blocks.len() as f64 * f64::from(filtered.every);
    let (names, units) = rows::names_and_units(input, &base);
    Ok(TreeIdentification {
        names,
        units,
        base,
        lost: solution.null_directions,
        estimate,
        sigma_given,
        noise_gain: filtered.noise_gain,
        variance_ratio,
        variance_scale,
        noise,
        residual_rms,
        measured_rms,
        regressor_noise: RegressorNoise {
            tensor_information: weight * filtered.derivative_noise_gain * input.rate_sigma.powi(2)
                / (moment_sigma * moment_sigma),
        },
        rate_bias,
        residuals,
        residual_sigma: variance.iter().map(|v| (v * filtered.kernel_gain()).sqrt()).collect(),
        colour,
        widening,
        gains,
        blocks: filtered.blocks.len(),
        channel_sigma: sigma,
        factor,
    })
}
