//! One rigid body on a load cell, with one IMU: the source of its rows.
//!
//! Samples go through the firmware's own pipeline (`rigident_shared::estimator`), on all cores; what is
//! stored of a row block are its eighteen conditioned signals, from which the rows are made as they are
//! needed.

mod blocks;
mod correction;
pub mod errors;
pub mod imu_noise;
mod input;
pub mod input_checks;
pub mod poses;
pub mod prepare;
mod rest;
pub mod sensitivities;
pub mod shares;
mod side_by_side;
mod stated_noise;

use std::ops::Range;

use rigident_shared::calibration::Reading;
use rigident_shared::conditioning::Kernel;
use rigident_shared::estimator::{ConfigError, Estimator, EstimatorConfig};
use rigident_shared::forgetting::ImuNoise;
use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};
use rigident_shared::regressor::{self, SIGNALS, SMOOTHED};
use rigident_shared::screening::{CHANNEL_NAMES, Limits, Rejection};
use rigident_shared::spatial::{AngularRate, Position, Sensor, SpecificForce};

use self::blocks::{BodyBlocks, write_columns, write_rows};
use self::correction::{Correction, is_correctable};
pub use self::input::Input;
use self::shares::{Shares, Split};
use super::white_noise::{Signs, sixth_differences_of};
use rigident_fit::{
    Channel, ESTIMATOR_TAPS, Effect, ErrorRow, Filter, FitError, Gaussian, Kind, Nuisance, Owner, Parameter,
    Progress, RowBlocks, RowSource, SampleCounts, SampleRows, SignalNoise, StatedNoise, Timing,
    filter_width_s, row_every,
};
use rigident_io::rig::ImuTable;

/// Parameters of the body; those of the wrench's offset follow.
const BODY: usize = 10;
/// Channels: the wrench in S.
const WRENCH: usize = 6;
/// Names of the channels.
pub const CHANNELS: [&str; WRENCH] = ["fx", "fy", "fz", "mx", "my", "mz"];
/// σ of force and moment to start from where none is stated, N and N m: only their ratio matters.
const NOMINAL_SIGMA: [f64; WRENCH] = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1];

/// The rows of one body.
#[derive(Clone, Debug)]
pub struct BodySource {
    input: Input,
    /// 1 σ of accelerometer and gyro per sample as the rig file states them.
    stated_noise: [Option<f64>; 2],
    /// 1 σ of accelerometer and gyro per sample by sixth differences of the readings.
    found_noise: [f64; 2],
    /// Noise of the IMU that is no excitation.
    imu_noise: ImuNoise<f64>,
    rate_sigma: f64,
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
    /// Errors of the rig that the signals are corrected for.
    about: Vec<(String, f64)>,
    correction: Option<Correction>,
}

impl BodySource {
    /// Returns the source of readings; `imu` is what the rig file says of the IMU.
    pub fn new(input: Input, imu: Option<&ImuTable>) -> Self {
        let of_sensor = |get: fn(&Reading<f64>) -> [f64; 3]| {
            sixth_differences_of(&input.readings, |r| (r.time_ns, get(r)), 3)
        };
        let found_noise = [of_sensor(|r| r.specific_force.array()), of_sensor(|r| r.angular_rate.array())];
        let imu_noise = imu_noise::imu_noise(imu, &input.readings);
        let rate_sigma = input.gyro_sigma.unwrap_or_else(|| imu_noise::gyro_sigma(&input.readings));
        let known = input.beforehand.clone();
        let source = Self {
            stated_noise: [imu.and_then(|i| i.accel_noise_mps2), imu.and_then(|i| i.gyro_noise_radps)],
            found_noise,
            imu_noise,
            rate_sigma,
            ..Self::of_rows(input)
        };
        match known {
            Some(known) => source.linearised(&known),
            None => source,
        }
    }

    /// Returns the source of readings whose noise nobody asks for, for a quick look at what its rows explain.
    pub fn of_rows(input: Input) -> Self {
        let estimates_offset = input.known_offset.is_none();
        let count = if estimates_offset { BODY + WRENCH } else { BODY };
        let channels = (0..WRENCH).map(|c| Channel {
            name: CHANNELS[c].to_owned(),
            unit: if c < 3 { "N" } else { "N m" }.to_owned(),
            sigma: input.channel_sigma.map(|sigma| sigma[c]),
            offset: estimates_offset.then_some(BODY + c),
            group: u8::from(c >= 3),
        });
        Self {
            stated_noise: [None; 2],
            found_noise: [0.0; 2],
            imu_noise: ImuNoise { accel: 0.0, gyro: 0.0 },
            rate_sigma: 0.0,
            parameters: parameters(count),
            channels: channels.collect(),
            about: Vec::new(),
            correction: None,
            input,
        }
    }

    /// Returns the same source with its signals corrected for the means of errors that all runs of the rig
    /// share: its columns are those of what is left of them.
    #[must_use]
    pub fn linearised(self, known: &Gaussian) -> Self {
        let own = self.input.nuisances.iter().filter(|k| is_correctable(k));
        let errors: Vec<(&Nuisance, f64)> =
            own.filter_map(|k| known.value(&k.name).map(|value| (k, value))).collect();
        let axes = self.input.mounting.rotation.matrix();
        let correction = if errors.iter().all(|(_, value)| *value == 0.0) {
            None
        } else {
            Correction::new(errors.iter().copied(), &axes)
        };
        let about = match correction {
            Some(_) => errors.iter().map(|(k, value)| (k.name.clone(), *value)).collect(),
            None => Vec::new(),
        };
        Self { about, correction, ..self }
    }

    /// Returns the readings and settings.
    pub fn input(&self) -> &Input {
        &self.input
    }

    /// Returns the same source with this known beforehand of the body and of its errors, in place of what
    /// was.
    #[must_use]
    pub fn informed(&self, beforehand: Gaussian) -> Self {
        let input = Input { beforehand: Some(beforehand), ..self.input.clone() };
        Self { input, ..self.without_input() }
    }

    fn config(&self) -> EstimatorConfig<f64> {
        let Input { is_static, rate_hz, known_offset, mounting, limits, .. } = self.input;
        EstimatorConfig {
            rate_hz: if is_static { 1.0 } else { rate_hz },
            filter_width_s: if is_static { 0.0 } else { filter_width_s(rate_hz) },
            row_every: if is_static { 1 } else { row_every(rate_hz) },
            channel_sigma: NOMINAL_SIGMA,
            known_offset: known_offset.unwrap_or_default(),
            mounting,
            limits: if is_static { Limits { frozen_after: 0, ..limits } } else { limits },
        }
    }

    /// Returns the error of a fit whose estimator cannot be set up.
    pub fn refuse(&self, error: ConfigError) -> FitError {
        let (rate_hz, width_s) = (self.input.rate_hz, self.config().filter_width_s);
        match error {
            ConfigError::Kernel(error) => FitError::Filter { rate_hz, width_s, error },
            ConfigError::Sigma(c) => FitError::Sigma {
                channel: CHANNELS.get(usize::from(c)).copied().unwrap_or_default().to_owned(),
                sigma: f64::NAN,
            },
            // Neither is asked of a source.
            ConfigError::Memory | ConfigError::ImuNoise => FitError::Forgetting { span_s: f64::NAN, width_s },
        }
    }

    /// Returns the filter of this configuration.
    fn filter(config: &EstimatorConfig<f64>) -> Result<Filter, ConfigError> {
        if config.filter_width_s == 0.0 {
            return Ok(Filter::default());
        }
        let (kernel, averaged) =
            Kernel::<f64, ESTIMATOR_TAPS>::for_rows(config.rate_hz, config.filter_width_s, config.row_every)
                .map_err(ConfigError::Kernel)?;
        let on_samples = |weights: &[f64]| -> Vec<f64> {
            weights.iter().flat_map(|w| std::iter::repeat_n(*w, usize::from(averaged))).collect()
        };
        Ok(Filter {
            rate_hz: config.rate_hz,
            width_s: config.filter_width_s,
            every: config.row_every,
            noise_gain: kernel.noise_gain(),
            derivative_noise_gain: kernel.derivative_noise_gain(),
            response: on_samples(kernel.smooth()),
            derivative: on_samples(kernel.derivative()),
        })
    }
}

/// Returns the first parameters of one body: ten of its own, then six of the wrench's offset.
pub fn parameters(count: usize) -> Vec<Parameter> {
    (0..count.min(BODY + WRENCH)).map(parameter).collect()
}

fn parameter(j: usize) -> Parameter {
    let (owner, kind) = match j {
        0 => (Owner::Link(String::new()), Kind::Mass),
        1..4 => (Owner::Link(String::new()), Kind::FirstMoment),
        4..BODY => (Owner::Link(String::new()), Kind::Inertia),
        _ => (Owner::Channel(CHANNELS.get(j - BODY).copied().unwrap_or_default().to_owned()), Kind::Offset),
    };
    let name = PARAMETER_NAMES.get(j).copied().unwrap_or_default();
    let unit = PARAMETER_UNITS.get(j).copied().unwrap_or_default();
    Parameter { frame: "S".to_owned(), ..Parameter::new(name, owner, kind, unit) }
}

impl RowSource for BodySource {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        if self.input.is_static { Timing::Static } else { Timing::Uniform { rate_hz: self.input.rate_hz } }
    }

    fn samples(&self) -> usize {
        self.input.readings.len()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        self.input.readings.get(sample).map_or(0, |r| r.time_ns)
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let Input { mounting, known_offset, .. } = &self.input;
        let reading = self.input.readings.get(sample).ok_or(Rejection::NotFinite(0))?;
        let mut signals = mounting.mounted(&mounting.signals(reading));
        if let Some(bad) = signals.iter().position(|v| !v.is_finite()) {
            return Err(Rejection::NotFinite(u8::try_from(bad).unwrap_or(u8::MAX)));
        }
        let wrench = signals.iter_mut().skip(SMOOTHED - WRENCH);
        wrench.zip(known_offset.unwrap_or_default()).for_each(|(value, offset)| *value -= offset);
        if let Some(correction) = &self.correction {
            correction.signals(&mut signals);
        }
        let position = self.position();
        let (mut smoothed, mut differentiated) = (signals, [0.0; SIGNALS]);
        smoothed[SMOOTHED..].fill(0.0);
        differentiated[SMOOTHED..].copy_from_slice(&signals[SMOOTHED..]);
        let n = self.parameters.len();
        let block = regressor::block(&smoothed, &position);
        write_rows(&block, n, &mut rows.smoothed, &mut rows.measured);
        let block = regressor::block(&differentiated, &position);
        write_columns(&block, n, &mut rows.differentiated);
        Ok(())
    }

    fn signal_name(&self, signal: u8) -> String {
        CHANNEL_NAMES.get(usize::from(signal)).map_or_else(|| format!("signal {signal}"), |n| (*n).to_owned())
    }

    fn nominal_sigma(&self) -> Vec<f64> {
        NOMINAL_SIGMA.to_vec()
    }

    fn each_reading(&self, take: &mut dyn FnMut(Option<u64>, &[f64])) {
        for reading in &self.input.readings {
            let mut numbers = [0.0; 12];
            let own = [reading.specific_force.array(), reading.angular_rate.array()];
            let own = reading.wrench.array().into_iter().chain(own.into_iter().flatten());
            numbers.iter_mut().zip(own).for_each(|(number, own)| *number = own);
            take(Some(reading.time_ns), &numbers);
        }
    }

    fn blocks<'a>(&'a self, progress: &dyn Progress) -> Result<Box<dyn RowBlocks + 'a>, FitError> {
        // Compact as they are.
        self.condition(progress)
    }

    fn condition(&self, progress: &dyn Progress) -> Result<Box<dyn RowBlocks>, FitError> {
        progress.stage("rows", 0.0);
        let config = self.config();
        let refuse = |error| self.refuse(error);
        let readings = &self.input.readings;
        let shares = Shares::new(readings, &config, Split::of(readings.len())).map_err(refuse)?;
        type Blocks = Vec<(f64, [f64; SIGNALS])>;
        let take = |blocks: &mut Blocks,
                    reading: &Reading<f64>,
                    pipeline: &Estimator<f64, BODY, ESTIMATOR_TAPS>| {
            blocks.extend(pipeline.last_signals().map(|signals| (reading.time_ns as f64 * 1e-9, *signals)));
        };
        let done = shares.absorb::<BODY, Blocks>(NOMINAL_SIGMA, Vec::new, take).map_err(refuse)?;
        let mut parts = Vec::new();
        let mut blocks: Blocks = Vec::with_capacity(done.counters.blocks as usize);
        for part in done.parts {
            parts.push(blocks.len()..blocks.len() + part.len());
            blocks.extend(part);
        }
        let counters = done.counters;
        let filter = Self::filter(&config).map_err(refuse)?;
        let mut rates =
            if self.has_signal_errors() { self.smooth_rates(&blocks, &filter) } else { Vec::new() };
        let mut axes = self.input.mounting.rotation.matrix();
        if let Some(correction) = &self.correction {
            blocks.iter_mut().for_each(|(_, signals)| correction.signals(signals));
            rates.iter_mut().for_each(|rate| *rate = correction.rate(*rate));
            axes = correction.axes(&axes);
        }
        let by_signal = counters.rejected_by_channel.iter().enumerate().filter(|(_, count)| **count > 0);
        Ok(Box::new(BodyBlocks {
            filter,
            counts: SampleCounts {
                samples: u64::from(counters.readings),
                rejected: u64::from(counters.rejected),
                by_signal: by_signal.map(|(c, count)| (c as u8, u64::from(*count))).collect(),
                gaps: u64::from(counters.gaps),
            },
            parts,
            is_static: self.input.is_static,
            blocks,
            rates,
            axes,
            lever_arm: self.position(),
        }))
    }

    fn signal_noise(&self) -> Vec<SignalNoise> {
        let of = |name: &str, unit: &str, stated, found| SignalNoise {
            name: name.to_owned(),
            unit: unit.to_owned(),
            stated,
            found,
        };
        let [accel, gyro] = self.stated_noise;
        // Differences of still poses show no noise, and their rate is not examined.
        if self.input.is_static {
            return vec![of("accelerometer", "m/s2", accel, 0.0)];
        }
        vec![
            of("accelerometer", "m/s2", accel, self.found_noise[0]),
            of("gyro", "rad/s", gyro, self.found_noise[1]),
        ]
    }

    fn with_signal_noise(
        &self,
        samples: Range<usize>,
        sigma: &[f64],
        seed: u64,
    ) -> Option<Box<dyn RowSource + '_>> {
        let of = |k: usize| sigma.get(k).copied().unwrap_or(0.0);
        let (accel, gyro) = (of(0), of(1));
        let mut signs = Signs::new(seed);
        let readings = self.input.readings.get(samples).unwrap_or_default().iter().map(|reading| {
            let mut noise = |sigma: f64| std::array::from_fn(|_| sigma * signs.draw());
            Reading {
                specific_force: reading.specific_force + SpecificForce::from_array(noise(accel)),
                angular_rate: reading.angular_rate + AngularRate::from_array(noise(gyro)),
                ..*reading
            }
        });
        // Noise is not screened.
        let limits = Limits { frozen_after: 0, ..Limits::none() };
        let input = Input { readings: readings.collect(), limits, ..self.input.without_readings() };
        Some(Box::new(Self { input, ..self.without_input() }))
    }

    fn channel_noise(&self) -> Vec<f64> {
        stated_noise::channel_noise(&self.input)
    }

    fn stated_noise(&self) -> Vec<StatedNoise> {
        stated_noise::stated_noise(&self.input, self.stated_noise)
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        self.input.nuisances.clone()
    }

    fn error_observations(&self) -> Vec<ErrorRow> {
        self.input.rests.clone()
    }

    fn beforehand(&self) -> Option<&Gaussian> {
        self.input.beforehand.as_ref()
    }

    fn corrected_for(&self) -> &[(String, f64)] {
        &self.about
    }

    fn rate_sigma(&self) -> f64 {
        self.rate_sigma
    }

    /// Counts only the derivative's noise in the products with ω: that of ω itself is smaller by its
    /// bandwidth.
    fn coefficient_noise(&self, filter: &Filter, sigma: &[f64]) -> Option<Vec<f64>> {
        let lever_arm2: f64 = self.input.mounting.position.array().iter().map(|x| x * x).sum();
        let turning = self.imu_noise.gyro.powi(2) * filter.derivative_noise_gain;
        let specific = self.imu_noise.accel.powi(2) * filter.noise_gain + lever_arm2 * turning;
        let weight = |c: usize| sigma.get(c).map_or(0.0, |s| f64::from(filter.every) / (s * s));
        let [fx, fy, fz, mx, my, mz] = std::array::from_fn(weight);
        let squares = [
            (fx + fy + fz) * specific,
            (fy + fz) * turning + (my + mz) * specific,
            (fz + fx) * turning + (mz + mx) * specific,
            (fx + fy) * turning + (mx + my) * specific,
            mx * turning,
            my * turning,
            mz * turning,
            (my + mz) * turning,
            (mz + mx) * turning,
            (mx + my) * turning,
        ];
        // The offset's coefficients are exact.
        let of = |j: usize| squares.get(j).map_or(0.0, |square| (square / WRENCH as f64).sqrt());
        Some((0..self.parameters.len()).map(of).collect())
    }
}

impl BodySource {
    /// Returns the place of the IMU in S.
    fn position(&self) -> Position<Sensor, f64> {
        let off = self.correction.map_or([0.0; 3], |correction| correction.lever_arm.into());
        self.input.mounting.position + Position::from_array(off)
    }

    fn has_signal_errors(&self) -> bool {
        self.input.nuisances.iter().any(|k| matches!(k.effect, Effect::Signal(_)))
    }

    /// Returns the rate of turn in the axes of S that belongs to each block, filtered as its signals are.
    fn smooth_rates(&self, blocks: &[(f64, [f64; SIGNALS])], filter: &Filter) -> Vec<[f64; 3]> {
        let Input { readings, mounting, .. } = &self.input;
        let mut at = 0;
        blocks
            .iter()
            .map(|(time_s, _)| {
                // The reading that completed it.
                while readings.get(at + 1).is_some_and(|r| r.time_ns as f64 * 1e-9 <= *time_s) {
                    at += 1;
                }
                let from = (at + 1).saturating_sub(filter.response.len());
                let under = readings.get(from..=at).unwrap_or_default();
                let sum = |sum: AngularRate<_, f64>, (h, reading): (&f64, &Reading<f64>)| {
                    let [x, y, z] = (reading.angular_rate - mounting.gyro_bias).array();
                    sum + AngularRate::new(h * x, h * y, h * z)
                };
                let rate = filter.response.iter().zip(under).fold(AngularRate::zero(), sum);
                (mounting.rotation * rate).array()
            })
            .collect()
    }

    fn without_input(&self) -> Self {
        Self {
            input: self.input.without_readings(),
            parameters: self.parameters.clone(),
            channels: self.channels.clone(),
            about: self.about.clone(),
            ..*self
        }
    }
}
