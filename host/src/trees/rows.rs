//! The rows of a recording: base parameters, offsets and drives as columns, filtered.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::tree::{Joint, Link, TreeError};

use super::drive::Term;
use super::{Frame, Input, TreeIdentificationError};
use crate::fit::Factor;
use crate::model::base::{BaseParameters, ROUNDED, Rows};
use crate::model::filter::MomentumFilter;
use crate::model::rows::{MomentumRows, Moving};

/// Makes the rows of an instant, in two parts.
///
/// The base's specific force is measured where its IMU sits, U. The links' momentum is taken about U therefore, U being
/// the root of the tree and the base link fixed to it; the wrench is then brought back to the base's origin.
pub struct RowMaker {
    moving: Moving,
    imu: Vector3<f64>,
    wrench: bool,
    efforts: bool,
    still: bool,
    offset: bool,
    /// Standard columns that stand for the base parameters, and what makes of them the base parameters' own columns;
    /// `None` where these are the same.
    leads: Vec<usize>,
    mix: Option<DMatrix<f64>>,
    drives: Vec<(super::drive::Drive, usize)>,
    columns: usize,
}

/// Names and units of all parameters: base parameters, offsets, drives.
pub fn names_and_units(input: &Input, base: &BaseParameters) -> (Vec<String>, Vec<&'static str>) {
    let (mut names, mut units) = (Vec::new(), Vec::new());
    for parameter in &base.parameters {
        names.push(parameter.name.clone());
        units.push(match parameter.terms.first().map_or(0, |t| t.0 % 10) {
            0 => "kg",
            1..4 => "kg m",
            _ => "kg m2",
        });
    }
    if estimates_offset(input) {
        for (k, name) in PARAMETER_NAMES.iter().enumerate().skip(10) {
            names.push((*name).to_owned());
            units.push(if k < 13 { "N" } else { "N m" });
        }
    }
    for drive in input.drives.iter().filter(|_| input.has_efforts()) {
        for term in &drive.terms {
            names.push(format!("{}.{}", drive.name, term.name()));
            units.push(term.unit(drive.slides));
        }
    }
    (names, units)
}

fn estimates_offset(input: &Input) -> bool {
    input.has_wrench() && input.known_offset.is_none()
}

/// Where among the parameters the wrench's offset stands, if it is estimated.
pub(super) fn offset_at(input: &Input, base: &BaseParameters) -> Option<usize> {
    estimates_offset(input).then_some(base.parameters.len())
}

impl RowMaker {
    /// For a recording.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn new(input: &Input, base: &BaseParameters) -> Result<Self, TreeError> {
        let imu = Vector3::from(input.imu_position);
        let one = Matrix3::identity();
        let root = Link { parent: 0, joint: Joint::Fixed, rotation: one, position: Vector3::zeros() };
        let mut links = vec![root, Link { position: -imu, ..root }];
        let own = input.model.links.iter().skip(1);
        links.extend(own.map(|l| Link { parent: l.link.parent + 1, ..l.link }));
        // Columns of the root are no link's; those of a base held still, without its wrench, are left out too.
        let skip = 10 + 10 * input.model.links.len() - base.standard.len();
        let leads: Vec<usize> =
            base.parameters.iter().filter_map(|p| Some(p.terms.first()?.0 + skip)).collect();
        let map = base.map();
        let square = DMatrix::from_fn(leads.len(), leads.len(), |i, j| map[(i, leads[j] - skip)]);
        // Y = Y_B B on all columns, so Y_B = Y_leads B_leads⁻¹.
        let mix =
            if square == DMatrix::identity(leads.len(), leads.len()) { None } else { square.try_inverse() };
        let (names, _) = names_and_units(input, base);
        let mut drives = Vec::new();
        let mut at = leads.len() + if estimates_offset(input) { 6 } else { 0 };
        for drive in input.drives.iter().filter(|_| input.has_efforts()) {
            drives.push((drive.clone(), at));
            at += drive.terms.len();
        }
        Ok(Self {
            moving: Moving::new(links)?,
            imu,
            wrench: input.has_wrench(),
            efforts: input.has_efforts(),
            still: input.is_static,
            offset: estimates_offset(input),
            leads,
            mix,
            drives,
            columns: names.len(),
        })
    }

    /// Rows of a frame: so many as there are channels.
    ///
    /// # Errors
    /// [`TreeError::Lengths`] if the frame does not fit the tree.
    pub fn rows(&mut self, frame: &Frame) -> Result<MomentumRows, TreeError> {
        let zeros = vec![0.0; self.moving.freedoms()];
        self.moving.set(&frame.positions, &frame.rates, &zeros, &frame.base)?;
        let parts = self.moving.momentum_rows()?;
        Ok(MomentumRows {
            smoothed: self.part(&parts.smoothed, frame, true),
            // In still poses nothing changes.
            differentiated: if self.still {
                vec![0.0; self.channels() * self.columns]
            } else {
                self.part(&parts.differentiated, frame, false)
            },
        })
    }

    fn channels(&self) -> usize {
        (if self.wrench { 6 } else { 0 }) + (if self.efforts { self.moving.freedoms() } else { 0 })
    }

    fn part(&self, all: &[f64], frame: &Frame, smoothed: bool) -> Vec<f64> {
        let stride = self.moving.columns();
        let row = |k: usize| &all[k * stride..(k + 1) * stride];
        let mut out = Vec::with_capacity(self.channels() * self.columns);
        if self.wrench {
            for axis in 0..6 {
                let start = out.len();
                self.select(&mut out, &|c| {
                    let moment = row(axis)[c];
                    if axis < 3 {
                        return moment;
                    }
                    // M about S = M about U + p × F
                    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
                    moment + self.imu[j] * row(k)[c] - self.imu[k] * row(j)[c]
                });
                if self.offset && smoothed {
                    out[start + self.leads.len() + axis] = 1.0;
                }
            }
        }
        if self.efforts {
            for freedom in 0..self.moving.freedoms() {
                let start = out.len();
                self.select(&mut out, &|c| row(6 + freedom)[c]);
                for (drive, at) in &self.drives {
                    let Some((_, factor)) = drive.rates.iter().find(|(k, _)| *k == freedom) else { continue };
                    let rate = drive.rate(&frame.rates);
                    for (k, term) in drive.terms.iter().enumerate() {
                        let value = match (term, smoothed) {
                            (Term::Viscous, true) => rate,
                            // At rest it is nowhere.
                            (Term::Coulomb, true) if rate != 0.0 => rate.signum(),
                            (Term::Offset, true) => 1.0,
                            (Term::Rotor, false) => rate,
                            _ => 0.0,
                        };
                        out[start + at + k] = factor * value;
                    }
                }
            }
        }
        out
    }

    /// One row: base parameters' columns of a row of standard ones, room for the others.
    fn select(&self, out: &mut Vec<f64>, of: &dyn Fn(usize) -> f64) {
        let start = out.len();
        out.resize(start + self.columns, 0.0);
        let lead: Vec<f64> = self.leads.iter().map(|c| of(*c)).collect();
        match &self.mix {
            None => out[start..start + lead.len()].copy_from_slice(&lead),
            Some(mix) => {
                for (k, column) in mix.column_iter().enumerate() {
                    out[start + k] = column.iter().zip(&lead).map(|(m, v)| m * v).sum();
                }
            }
        }
    }
}

/// One filtered instant.
#[derive(Clone, Debug)]
pub struct BlockRows {
    /// Time of the frame that completed it, s.
    pub time_s: f64,
    /// Coefficients, channel by channel.
    pub rows: Vec<f64>,
    /// Measurements.
    pub measured: Vec<f64>,
}

/// So many frames are done between words on how far it is.
const WATCHED_FRAMES: usize = 256;

/// All filtered instants.
#[derive(Clone, Debug)]
pub struct Filtered {
    /// Rows and measurements.
    pub blocks: Vec<BlockRows>,
    /// Parameters.
    pub columns: usize,
    /// Readings a block stands for.
    pub every: u16,
    /// Variance of whitened, filtered white noise per row.
    pub noise_gain: f64,
    /// `Σ ḣ²`, 1/s².
    pub derivative_noise_gain: f64,
    kernel_gain: f64,
    /// Weights of the samples; empty for still poses.
    pub(super) response: Vec<f64>,
}

/// The rows of a recording, filtered by the kernel of `width_s`; a gap in time starts it anew. `watch` is told now and then
/// which share is done.
///
/// # Errors
/// [`TreeIdentificationError`] if the kernel does not fit the rate, or frames do not fit the tree.
pub fn filter(
    input: &Input,
    mut maker: RowMaker,
    width_s: f64,
    every: u16,
    watch: &dyn Fn(f64),
) -> Result<Filtered, TreeIdentificationError> {
    let measured = |frame: &Frame| -> Vec<f64> {
        let offset = input.known_offset.unwrap_or_default();
        let wrench = frame.wrench.iter().zip(offset).map(|(w, o)| w - o);
        let mut values: Vec<f64> = if input.has_wrench() { wrench.collect() } else { Vec::new() };
        if input.has_efforts() {
            values.extend(&frame.efforts);
        }
        values
    };
    let columns = maker.columns;
    let mut blocks = Vec::new();
    if input.is_static {
        for frame in &input.frames {
            let rows = maker.rows(frame).map_err(TreeIdentificationError::Tree)?.smoothed;
            blocks.push(BlockRows { time_s: 0.0, rows, measured: measured(frame) });
        }
        return Ok(Filtered {
            blocks,
            columns,
            every: 1,
            noise_gain: 1.0,
            derivative_noise_gain: 0.0,
            kernel_gain: 1.0,
            response: Vec::new(),
        });
    }
    let make = || {
        MomentumFilter::new(input.rate_hz, width_s, usize::from(every)).map_err(|error| {
            TreeIdentificationError::Rate {
                rate_hz: input.rate_hz,
                width_s,
                why: match error {
                    rigident_shared::conditioning::KernelError::Invalid => {
                        "that is less than three of them; record faster"
                    }
                    rigident_shared::conditioning::KernelError::TooManyTaps(_) => {
                        "that is more of them than it has room for; take every second one"
                    }
                },
            }
        })
    };
    let mut filter = make()?;
    let period_ns = 1e9 / input.rate_hz;
    let mut before: Option<u64> = None;
    for (n, frame) in input.frames.iter().enumerate() {
        if n % WATCHED_FRAMES == 0 {
            watch(n as f64 / input.frames.len() as f64);
        }
        if before.is_some_and(|t| frame.time_ns.saturating_sub(t) as f64 > 1.5 * period_ns) {
            filter.reset();
        }
        before = Some(frame.time_ns);
        let rows = maker.rows(frame).map_err(TreeIdentificationError::Tree)?;
        if let Some(out) = filter.push(rows, measured(frame)) {
            let time_s = frame.time_ns as f64 * 1e-9;
            blocks.push(BlockRows { time_s, rows: out.rows, measured: out.measured });
        }
    }
    let kernel_gain = filter.noise_gain();
    Ok(Filtered {
        blocks,
        columns,
        every,
        noise_gain: f64::from(every) * kernel_gain,
        derivative_noise_gain: filter.derivative_noise_gain(),
        kernel_gain,
        response: filter.response(),
    })
}

impl Filtered {
    /// Variance of white noise after the filter, relative to before.
    pub(super) fn kernel_gain(&self) -> f64 {
        self.kernel_gain
    }

    /// The factor of all rows, whitened by σ per reading: a block stands for `every` of them.
    pub fn absorb(&self, sigma: &[f64]) -> Factor {
        let mut factor = Factor::new(self.columns);
        let root = f64::from(self.every).sqrt();
        let mut whitened: Vec<(Vec<f64>, f64)> = Vec::new();
        for block in &self.blocks {
            whitened.clear();
            for ((row, value), sigma) in block.rows.chunks_exact(self.columns).zip(&block.measured).zip(sigma)
            {
                let weight = root / sigma;
                whitened.push((row.iter().map(|v| v * weight).collect(), value * weight));
            }
            factor.absorb(whitened.iter().map(|(row, value)| (row.as_slice(), *value)));
        }
        factor
    }

    /// What is left of each channel's measurement, block by block.
    pub fn residuals<'a>(&'a self, parameters: &'a [f64]) -> impl Iterator<Item = Vec<f64>> + 'a {
        self.blocks.iter().map(move |block| {
            let rows = block.rows.chunks_exact(self.columns).zip(&block.measured);
            rows.map(|(row, value)| value - row.iter().zip(parameters).map(|(a, b)| a * b).sum::<f64>())
                .collect()
        })
    }

    /// Root mean squares of residuals and measurements, channel by channel.
    pub fn rms(&self, parameters: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let channels = self.blocks.first().map_or(0, |b| b.measured.len());
        let mut sums = (vec![0.0; channels], vec![0.0; channels]);
        for (residual, block) in self.residuals(parameters).zip(&self.blocks) {
            for (k, (r, m)) in residual.iter().zip(&block.measured).enumerate() {
                sums.0[k] += r * r;
                sums.1[k] += m * m;
            }
        }
        let n = self.blocks.len().max(1) as f64;
        let root = |sums: Vec<f64>| sums.into_iter().map(|s: f64| (s / n).sqrt()).collect();
        (root(sums.0), root(sums.1))
    }

    /// Standard deviations of the measurements about their means, channel by channel.
    pub fn measured_sd(&self) -> Vec<f64> {
        let channels = self.blocks.first().map_or(0, |b| b.measured.len());
        let n = self.blocks.len().max(1) as f64;
        (0..channels)
            .map(|k| {
                let values = || self.blocks.iter().map(|b| b.measured[k]);
                let mean = values().sum::<f64>() / n;
                (values().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
            })
            .collect()
    }

    /// Raw σ of each channel: residual variance over `Σh²`, for the degrees of freedom that are left.
    pub fn raw_sigma(&self, factor: &Factor) -> Vec<f64> {
        let solution = factor.solve(ROUNDED);
        let determined = solution.determined.iter().filter(|d| **d).count() as f64;
        let (rms, measured) = self.rms(&solution.estimate);
        let channels = rms.len().max(1) as f64;
        let dof = (self.blocks.len() as f64 * self.noise_gain.min(1.0) - determined / channels).max(1.0);
        let left = dof / (dof + determined / channels);
        let raw: Vec<f64> = rms.iter().map(|r| r / (self.kernel_gain * left).sqrt()).collect();
        // A channel that fits exactly must not outweigh all others, and no channel is known better than its digits.
        let largest = raw.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        raw.iter()
            .zip(&measured)
            .map(|(r, m)| r.max(1e-6 * largest).max(1e-12 * m).max(1e-12 * f64::MIN_POSITIVE.sqrt()))
            .collect()
    }
}

/// Whether the base's wrench, the joints' drives, or both are measured.
pub fn rows_of(wrench: bool, efforts: bool) -> Option<Rows> {
    match (wrench, efforts) {
        (true, true) => Some(Rows::Both),
        (true, false) => Some(Rows::Base),
        (false, true) => Some(Rows::Joint),
        (false, false) => None,
    }
}
