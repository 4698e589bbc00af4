//! Noise of the IMU in the rows: what rows are whitened by, and what it adds to the factor.
//!
//! With noise Δ in the coefficients the residual of the truth is `w − Δ φ`: its covariance has, beside the
//! load cell's, that of `Δ φ`, which follows from the estimate so far. And `RᵀR` has the expectation
//! `K = E[ΔᵀΔ]` of the whitened Δ too much, which is summed up beside the factor and taken off when it is
//! solved ([`Compensation`]).
//!
//! Of one body Δ is linear in six signals, the accelerometer's axes and the gyro's by their derivative; what
//! the gyro brings to the products of the rates is smaller by its bandwidth and left out. Whitening and K of
//! one row block are made anew at a check, in steps, when a fifth of all rows has come since the last time.
//! Weights that an early estimate made too large are not retained: what was absorbed with them is scaled
//! down.

use super::{EstimatorConfig, Reference};
use crate::Scalar;
use crate::conditioning::Kernel;
use crate::factor::{Compensation, Gram, InformationFactor};
use crate::forgetting::ImuNoise;
use crate::linear_algebra::{ROOM, add_scaled, dot_slices};
use crate::regressor::{self, RegressorBlock, SIGNALS, SMOOTHED};
use crate::whitening::{CHANNELS, Design, LowPass, POLES, Square, Whitening};

/// Parameters that have noise in their coefficients.
pub const BODY: usize = 10;
/// Parameters, the first, that specific force is multiplied by: mass and its moments.
const SEEN_BY_ACCEL: usize = 4;
/// Noisy signals: three axes of the accelerometer, three of the gyro.
const NOISY: usize = 6;
/// Lags, in row blocks, over which the filter's noise is correlated; if it reaches further there is no
/// low-pass.
const LAGS: usize = 16;
/// A parameter counts in the covariance of the noise if it differs from zero by this many standard
/// deviations.
const SIGNIFICANT_SD: u32 = 2;
/// Noise of the IMU does not count in the weights if it is at most this share of every channel's variance.
const NEGLIGIBLE_SHARE: f32 = 0.01;
/// The absorbed rows are scaled down if its noise is found to have this many times the variance it was
/// whitened by.
const TOO_LARGE: f32 = 1.1;
/// A variance that exceeds that of any load cell's noise, N² and N² m².
const WHATEVER_IS_FOUND: f32 = 1e12;
/// The square of how many standard deviations of the estimate count as its uncertainty, as early ones are too
/// small.
const UNCERTAINTY: u32 = 9;

/// The result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refreshed<T: Scalar> {
    /// There is more to do.
    More,
    /// Nothing is left to do.
    Done,
    /// Rows are whitened together from now on; variance of each channel's noise behind the filter.
    Together([T; CHANNELS]),
}

/// Tells what a model's rows hold of noise of the signals.
pub trait RowNoise<T: Scalar, const N: usize>: Copy {
    /// No noise. All bits are zero.
    const UNUSED: Self;

    /// Sets it up for an IMU of this noise, behind this filter.
    fn set_up<const TAPS: usize>(
        &mut self,
        config: &EstimatorConfig<T>,
        kernel: &Kernel<T, TAPS>,
        averaged: u16,
        imu: &ImuNoise<T>,
    );
    /// Starts anew.
    fn reset(&mut self, config: &EstimatorConfig<T>);
    /// Notes a gap in time.
    fn interrupt(&mut self);
    /// Returns true if there is noise to be reckoned with.
    fn counts(&self) -> bool;
    /// Takes what was added to a segment that ends with this row block.
    fn close_segment(&mut self, blocks: u32);
    /// Returns what was added to that segment.
    fn segment(&self) -> Option<&Gram<T, BODY>>;
    /// Keeps what has been added to what has been absorbed up to this row block, a waiting segment and a
    /// memory's share included.
    fn take_snapshot(&mut self, blocks: u32, waiting_segment: bool, memory: Option<&Gram<T, ROOM>>);
    /// Returns what was retained.
    fn snapshot(&self) -> Option<&Gram<T, ROOM>>;
    /// Begins to compensate the factor of a check of everything absorbed up to this row block.
    fn begin_look(&mut self, factor: &InformationFactor<T, N>, blocks: u32);
    /// Begins to compensate the factor of a memory.
    fn begin_memory(&mut self, factor: &InformationFactor<T, N>, memory: &Gram<T, ROOM>);
    /// Begins to compensate the factor of the snapshot.
    fn begin_snapshot(&mut self, factor: &InformationFactor<T, N>);
    /// Does a step of what was begun. Returns true when it is done.
    fn compensate(&mut self, of_snapshot: bool) -> bool;
    /// Returns the compensated factor.
    fn compensated(&self, of_snapshot: bool) -> Option<InformationFactor<T, N>>;
    /// Begins to make the whitening anew from this estimate.
    fn begin_refresh(&mut self, config: &EstimatorConfig<T>, reference: &Reference<T, N>, blocks: u32);
    /// Does a step of making the whitening anew.
    fn refresh(&mut self, config: &EstimatorConfig<T>, blocks: u32) -> Refreshed<T>;
    /// Returns the steps of [`Self::refresh`] before the one after which rows are whitened together for the
    /// first time, where it is near.
    fn steps_to_together(&self) -> Option<u8> {
        None
    }
    /// Returns the factor that all rows absorbed so far are to be multiplied by, if they are; asking takes it
    /// as done.
    fn take_shrink(&mut self, blocks: u32) -> Option<T>;
    /// Goes on from what had been added up to this row block: its rows were whitened by the noise that a
    /// check finds, and are not scaled down.
    fn restore(&mut self, gram: &Gram<T, BODY>, blocks: u32);
    /// Receives that the first check after that is over.
    fn restored(&mut self, config: &EstimatorConfig<T>);
    /// Returns the root mean square, per whitened row, of what noise brings to the coefficients of each
    /// parameter; `None` if nothing is known.
    fn per_row(&self) -> Option<[T; N]>;
}

/// Rows whose noise is the measured side's alone.
#[derive(Clone, Copy, Debug)]
pub struct Noiseless;

impl<T: Scalar, const N: usize> RowNoise<T, N> for Noiseless {
    const UNUSED: Self = Self;
    fn set_up<const TAPS: usize>(
        &mut self,
        _: &EstimatorConfig<T>,
        _: &Kernel<T, TAPS>,
        _: u16,
        _: &ImuNoise<T>,
    ) {
    }
    fn reset(&mut self, _: &EstimatorConfig<T>) {}
    fn interrupt(&mut self) {}
    fn counts(&self) -> bool {
        false
    }
    fn close_segment(&mut self, _: u32) {}
    fn segment(&self) -> Option<&Gram<T, BODY>> {
        None
    }
    fn take_snapshot(&mut self, _: u32, _: bool, _: Option<&Gram<T, ROOM>>) {}
    fn snapshot(&self) -> Option<&Gram<T, ROOM>> {
        None
    }
    fn begin_look(&mut self, _: &InformationFactor<T, N>, _: u32) {}
    fn begin_memory(&mut self, _: &InformationFactor<T, N>, _: &Gram<T, ROOM>) {}
    fn begin_snapshot(&mut self, _: &InformationFactor<T, N>) {}
    fn compensate(&mut self, _: bool) -> bool {
        true
    }
    fn compensated(&self, _: bool) -> Option<InformationFactor<T, N>> {
        None
    }
    fn begin_refresh(&mut self, _: &EstimatorConfig<T>, _: &Reference<T, N>, _: u32) {}
    fn refresh(&mut self, _: &EstimatorConfig<T>, _: u32) -> Refreshed<T> {
        Refreshed::Done
    }
    fn take_shrink(&mut self, _: u32) -> Option<T> {
        None
    }
    fn restore(&mut self, _: &Gram<T, BODY>, _: u32) {}
    fn restored(&mut self, _: &EstimatorConfig<T>) {}
    fn per_row(&self) -> Option<[T; N]> {
        None
    }
}

/// Noise of the IMU in one body's rows.
#[derive(Clone, Copy, Debug)]
pub struct BodyNoise<T: Scalar> {
    imu: ImuNoise<T>,
    counts: bool,
    /// Autocovariance of white noise of unit variance after the filter, at the lags of the row blocks; and
    /// that of its derivative.
    autocovariance: [[T; LAGS]; 2],
    /// Time from one row block to the next, s.
    period_s: T,
    /// Rows are whitened together.
    together: bool,
    whitening: Whitening<T>,
    low_pass: LowPass<T>,
    /// Covariance of the noise that rows are whitened by, per sample.
    covariance: Square<T>,
    /// The addition of a row block.
    unit: Gram<T, BODY>,
    /// The additions of the row blocks up to `counted`, those of closed segments left out.
    gram: Gram<T, BODY>,
    counted: u32,
    segment: Gram<T, BODY>,
    snapshot: Gram<T, ROOM>,
    /// Row blocks when the whitening was made.
    refreshed: u32,
    refresh: Refresh<T>,
    /// All rows absorbed so far are to be multiplied by this.
    shrink: Option<T>,
    of_look: Compensation<T>,
    of_snapshot: Compensation<T>,
}

/// A whitening on its way.
#[derive(Clone, Copy, Debug)]
struct Refresh<T: Scalar> {
    stage: Stage,
    /// The significant part of the estimate, and its uncertainty: variances.
    parameters: [T; BODY],
    variances: [T; BODY],
    /// White part of the noise, columns of its rising part, and both together, per sample.
    white: Square<T>,
    slope: [[T; CHANNELS]; POLES],
    covariance: Square<T>,
    design: Design<T>,
    whitening: Whitening<T>,
    /// See [`BodyNoise::signal_gains`].
    gains: [T; CHANNELS],
    unit: Gram<T, BODY>,
    /// The most that a variance was taken too small.
    excess: T,
}

/// Tells what is done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Idle,
    /// The share of this signal in the residuals.
    Spectrum(u8),
    /// The covariance of all noise.
    Begin,
    Design,
    Finish,
    /// The addition of this signal to a row block.
    Unit(u8),
    /// Is noise larger than it was taken to be?
    Compare,
    Take,
    /// The additions of row blocks until then.
    Count,
}

impl<T: Scalar> Refresh<T> {
    const UNUSED: Self = Self {
        stage: Stage::Idle,
        parameters: [T::ZERO; BODY],
        variances: [T::ZERO; BODY],
        white: [[T::ZERO; CHANNELS]; CHANNELS],
        slope: [[T::ZERO; CHANNELS]; POLES],
        covariance: [[T::ZERO; CHANNELS]; CHANNELS],
        design: Design::UNUSED,
        whitening: Whitening { columns: [[T::ZERO; CHANNELS]; CHANNELS], poles: [T::ZERO; POLES] },
        gains: [T::ZERO; CHANNELS],
        unit: Gram::ZERO,
        excess: T::ZERO,
    };
}

/// Returns the block of a unit change of noisy signal `k`, as the IMU's axes lie.
#[inline(never)]
fn change<T: Scalar>(config: &EstimatorConfig<T>, k: usize) -> RegressorBlock<T> {
    let mounting = &config.mounting;
    let (axis, first) = if k < 3 { (k, 0) } else { (k - 3, SMOOTHED) };
    let mut scale = T::ONE;
    if k < 3 {
        scale = mounting.accel_scale.get(axis).copied().unwrap_or_default();
    }
    let turn = mounting.rotation.matrix();
    let mut signals = [T::ZERO; SIGNALS];
    for (slot, entry) in signals.iter_mut().skip(first).zip(turn.as_slice().iter().skip(3 * axis).take(3)) {
        *slot = *entry * scale;
    }
    regressor::block(&signals, &mounting.position)
}

/// Adds what noisy signal `k`, of which each channel has these variances, brings to a row block; above the
/// diagonal.
#[inline(never)]
fn add_signal<T: Scalar>(
    config: &EstimatorConfig<T>,
    whitening: &Whitening<T>,
    gains: &[T; CHANNELS],
    k: usize,
    unit: &mut Gram<T, BODY>,
) {
    let mut whitened = change(config, k).columns;
    // The accelerometer is in the first columns alone: products with all others are zero.
    let used = if k < 3 { SEEN_BY_ACCEL } else { BODY };
    for column in whitened.iter_mut().take(used) {
        let from = *column;
        *column = [T::ZERO; CHANNELS];
        for (t, a) in whitening.columns.iter().zip(from) {
            if a != T::ZERO {
                add_scaled(column, t, a);
            }
        }
    }
    for (j, (column, own)) in unit.columns.iter_mut().zip(&whitened).take(used).enumerate() {
        let mut weighted = *own;
        for (w, gain) in weighted.iter_mut().zip(gains) {
            *w *= *gain;
        }
        for (entry, other) in column.iter_mut().zip(&whitened).take(j + 1) {
            *entry += dot_slices(&weighted, other);
        }
    }
}

/// Returns the covariance of the load cell's noise per sample.
fn of_load_cell<T: Scalar>(config: &EstimatorConfig<T>) -> Square<T> {
    Whitening::diagonal(&config.channel_sigma.map(|sigma| sigma * sigma)).columns
}

/// Adds `by v vᵀ`.
fn add_square<T: Scalar>(to: &mut Square<T>, v: &[T; CHANNELS], by: T) {
    for (row, a) in to.iter_mut().zip(v) {
        add_scaled(row, v, by * *a);
    }
}

/// Returns `vᵀ of v`.
fn spread<T: Scalar>(of: &Square<T>, v: &[T; CHANNELS]) -> T {
    let mut sum = T::ZERO;
    for (row, a) in of.iter().zip(v) {
        sum += dot_slices(row, v) * *a;
    }
    sum
}

/// Returns the diagonal.
fn diagonal<T: Scalar>(of: &Square<T>) -> [T; CHANNELS] {
    let mut diagonal = [T::ZERO; CHANNELS];
    for (c, (slot, row)) in diagonal.iter_mut().zip(of).enumerate() {
        *slot = row.get(c).copied().unwrap_or_default();
    }
    diagonal
}

impl<T: Scalar> BodyNoise<T> {
    /// Returns what rows are whitened together by, if they are.
    #[inline(always)]
    pub fn together(&mut self) -> Option<(&Whitening<T>, &mut LowPass<T>)> {
        self.together.then_some((&self.whitening, &mut self.low_pass))
    }

    /// Returns the variance of white noise behind the filter, and that of its derivative's over it.
    fn gains(&self) -> (T, T) {
        let [[white, ..], [derivative, ..]] = self.autocovariance;
        (white, derivative / white)
    }

    #[inline(never)]
    fn begin(&mut self, config: &EstimatorConfig<T>) {
        self.whitening = Whitening::diagonal(&super::config::weights(config));
        self.unit = Gram::ZERO;
        for k in 0..NOISY {
            let gains = self.signal_gains(&self.whitening, k);
            add_signal(config, &self.whitening, &gains, k, &mut self.unit);
        }
        self.unit.mirror();
        self.covariance = of_load_cell(config);
        (self.together, self.low_pass, self.shrink) = (false, LowPass::NEW, None);
        (self.gram, self.segment, self.snapshot) = (Gram::ZERO, Gram::ZERO, Gram::ZERO);
        (self.counted, self.refreshed, self.refresh.stage) = (0, 0, Stage::Idle);
    }

    /// Counts what has been added up to this row block.
    #[inline(never)]
    fn count(&mut self, blocks: u32) {
        self.gram.add(&self.unit, T::from_u32(blocks.wrapping_sub(self.counted)));
        self.counted = blocks;
    }

    /// Returns what has been added up to this row block.
    #[inline(never)]
    fn total(&self, blocks: u32) -> Gram<T, BODY> {
        let (mut gram, mut unit, mut counted) = (self.gram, &self.unit, self.counted);
        if self.refresh.stage == Stage::Count {
            gram.add(unit, T::from_u32(self.refreshed.wrapping_sub(counted)));
            (unit, counted) = (&self.refresh.unit, self.refreshed);
        }
        gram.add(unit, T::from_u32(blocks.wrapping_sub(counted)));
        gram
    }

    #[inline(never)]
    fn keep(&mut self, blocks: u32, waiting_segment: bool, memory: Option<&Gram<T, ROOM>>) {
        match memory {
            Some(memory) => self.snapshot = *memory,
            // Nothing is beside the body's parameters.
            None => self.snapshot.columns.iter_mut().take(BODY).for_each(|column| *column = [T::ZERO; ROOM]),
        }
        let total = self.total(blocks);
        self.snapshot.add(&total, T::ONE);
        if waiting_segment {
            self.snapshot.add(&self.segment, T::ONE);
        }
    }

    /// Returns the variance behind filter and whitening that noisy signal `k` brings to each channel.
    #[inline(never)]
    fn signal_gains(&self, whitening: &Whitening<T>, k: usize) -> [T; CHANNELS] {
        let [white, derivative] = &self.autocovariance;
        let (sigma, autocovariance) =
            if k < 3 { (self.imu.accel, white) } else { (self.imu.gyro, derivative) };
        let mut gains = [T::ZERO; CHANNELS];
        for (c, gain) in gains.iter_mut().enumerate() {
            *gain = sigma * sigma * whitening.gain(c, autocovariance);
        }
        gains
    }

    /// Adds what noisy signal `k` leaves in the residuals of the estimate, its uncertainty included.
    #[inline(never)]
    fn add_spectrum(&mut self, config: &EstimatorConfig<T>, k: usize) {
        let (_, rise) = self.gains();
        let columns = change(config, k).columns;
        let Refresh { parameters, variances, white, slope, .. } = &mut self.refresh;
        let mut error = [T::ZERO; CHANNELS];
        for (column, parameter) in columns.iter().zip(parameters.iter()) {
            add_scaled(&mut error, column, *parameter);
        }
        // What the estimate's uncertainty adds fades, and is taken as white.
        let uncertain = match slope.get_mut(k.wrapping_sub(3)) {
            Some(slope) => {
                *slope = [T::ZERO; CHANNELS];
                add_scaled(slope, &error, self.imu.gyro);
                self.imu.gyro * self.imu.gyro * rise
            }
            None => {
                let variance = self.imu.accel * self.imu.accel;
                add_square(white, &error, variance);
                variance
            }
        };
        for (column, variance) in columns.iter().zip(variances.iter()) {
            if *variance > T::ZERO {
                add_square(white, column, uncertain * *variance);
            }
        }
    }

    /// Puts the covariance of all noise together. Returns whether it is to be whitened by.
    #[inline(never)]
    fn begin_design(&mut self, config: &EstimatorConfig<T>) -> bool {
        let (_, rise) = self.gains();
        let Refresh { white, slope, covariance, design, .. } = &mut self.refresh;
        *covariance = *white;
        for slope in slope.iter() {
            add_square(covariance, slope, rise);
        }
        let share = T::ONE + T::from_f32(NEGLIGIBLE_SHARE);
        let mut all = config.channel_sigma.iter().zip(diagonal(covariance));
        let counts = all.any(|(sigma, variance)| variance > share * *sigma * *sigma);
        (counts || self.together) && design.begin(white, slope)
    }

    /// Returns the most that the variance of a channel, as rows are whitened now, is larger than it was taken
    /// to be.
    #[inline(never)]
    fn excess(&self) -> T {
        let mut most = T::ONE;
        for c in 0..CHANNELS {
            let mut row = [T::ZERO; CHANNELS];
            for (slot, column) in row.iter_mut().zip(&self.whitening.columns) {
                *slot = column.get(c).copied().unwrap_or_default();
            }
            most = most.max(spread(&self.refresh.covariance, &row) / spread(&self.covariance, &row));
        }
        most
    }

    /// Begins to make the whitening anew from these parameters and their standard deviations.
    #[inline(never)]
    fn begin_anew(&mut self, config: &EstimatorConfig<T>, parameters: &[T], deviations: &[T], blocks: u32) {
        let new = blocks.wrapping_sub(self.refreshed);
        if !self.counts || new < self.refreshed / 4 {
            return;
        }
        let k = T::from_u32(SIGNIFICANT_SD);
        let both = self.refresh.parameters.iter_mut().zip(&mut self.refresh.variances);
        for ((parameter, variance), (value, sd)) in both.zip(parameters.iter().zip(deviations)) {
            (*parameter, *variance) = (T::ZERO, T::ZERO);
            if value.abs() > k * *sd {
                (*parameter, *variance) = (*value, T::from_u32(UNCERTAINTY) * *sd * *sd);
            }
        }
        self.refresh.white = of_load_cell(config);
        self.refresh.stage = Stage::Spectrum(0);
    }

    #[inline(never)]
    fn step(&mut self, config: &EstimatorConfig<T>, blocks: u32) -> Refreshed<T> {
        let stage = self.refresh.stage;
        self.refresh.stage = match stage {
            Stage::Idle => return Refreshed::Done,
            Stage::Spectrum(k) => {
                self.add_spectrum(config, usize::from(k));
                if usize::from(k) + 1 < NOISY { Stage::Spectrum(k + 1) } else { Stage::Begin }
            }
            Stage::Begin if self.begin_design(config) => Stage::Design,
            Stage::Begin => Stage::Idle,
            Stage::Design if self.refresh.design.step() => Stage::Finish,
            Stage::Design => Stage::Design,
            Stage::Finish => {
                let every = T::from_u32(u32::from(config.row_every));
                self.refresh.whitening = self.refresh.design.finish(every, self.period_s);
                Stage::Unit(0)
            }
            Stage::Unit(k) => {
                if k == 0 {
                    self.refresh.unit = Gram::ZERO;
                    self.refresh.gains = self.signal_gains(&self.refresh.whitening, 0);
                }
                let Refresh { whitening, gains, unit, .. } = &mut self.refresh;
                add_signal(config, whitening, gains, usize::from(k), unit);
                // The axes of a sensor have the same; those of the gyro are reckoned with the last of the
                // accelerometer.
                if k == 2 {
                    self.refresh.gains = self.signal_gains(&self.refresh.whitening, 3);
                }
                if usize::from(k) + 1 < NOISY { Stage::Unit(k + 1) } else { Stage::Compare }
            }
            Stage::Compare => {
                self.refresh.excess = self.excess();
                self.refresh.unit.mirror();
                Stage::Take
            }
            Stage::Take => {
                self.refreshed = blocks;
                self.whitening = self.refresh.whitening;
                (self.together, self.refresh.stage) = (true, Stage::Count);
                let (gain, _) = self.gains();
                let mut variance = diagonal(&self.refresh.covariance);
                for variance in &mut variance {
                    *variance *= gain;
                }
                return Refreshed::Together(variance);
            }
            Stage::Count => {
                self.count(self.refreshed);
                let excess = self.refresh.excess;
                self.shrink = (excess > T::from_f32(TOO_LARGE)).then(|| T::ONE / excess.sqrt());
                (self.unit, self.covariance) = (self.refresh.unit, self.refresh.covariance);
                self.refresh.stage = Stage::Idle;
                return Refreshed::Done;
            }
        };
        Refreshed::More
    }
}

impl<T: Scalar, const N: usize> RowNoise<T, N> for BodyNoise<T> {
    const UNUSED: Self = Self {
        imu: ImuNoise { accel: T::ZERO, gyro: T::ZERO },
        counts: false,
        autocovariance: [[T::ZERO; LAGS]; 2],
        period_s: T::ZERO,
        together: false,
        whitening: Whitening { columns: [[T::ZERO; CHANNELS]; CHANNELS], poles: [T::ZERO; POLES] },
        low_pass: LowPass::UNUSED,
        covariance: [[T::ZERO; CHANNELS]; CHANNELS],
        unit: Gram::ZERO,
        gram: Gram::ZERO,
        counted: 0,
        segment: Gram::ZERO,
        snapshot: Gram::ZERO,
        refreshed: 0,
        refresh: Refresh::UNUSED,
        shrink: None,
        of_look: Compensation::UNUSED,
        of_snapshot: Compensation::UNUSED,
    };

    #[inline(never)]
    fn set_up<const TAPS: usize>(
        &mut self,
        config: &EstimatorConfig<T>,
        kernel: &Kernel<T, TAPS>,
        averaged: u16,
        imu: &ImuNoise<T>,
    ) {
        self.imu = *imu;
        self.counts = imu.accel > T::ZERO || imu.gyro > T::ZERO;
        let step = usize::from(config.row_every / averaged.max(1)).max(1);
        let times = T::from_u32(u32::from(averaged));
        for (sums, taps) in self.autocovariance.iter_mut().zip([kernel.smooth(), kernel.derivative()]) {
            for (lag, sum) in sums.iter_mut().enumerate() {
                *sum = dot_slices(taps, taps.get(lag * step..).unwrap_or_default()) * times;
            }
        }
        let fits = kernel.smooth().len() <= LAGS * step && config.filter_width_s > T::ZERO;
        self.period_s =
            if fits { T::from_u32(u32::from(config.row_every)) / config.rate_hz } else { T::ZERO };
        RowNoise::<T, N>::reset(self, config);
    }

    fn reset(&mut self, config: &EstimatorConfig<T>) {
        if self.counts {
            self.begin(config);
        }
    }

    #[inline]
    fn interrupt(&mut self) {
        self.low_pass.reset();
    }

    fn counts(&self) -> bool {
        self.counts
    }

    fn close_segment(&mut self, blocks: u32) {
        self.segment = self.total(blocks);
        (self.gram, self.counted) = (Gram::ZERO, blocks);
    }

    fn segment(&self) -> Option<&Gram<T, BODY>> {
        self.counts.then_some(&self.segment)
    }

    fn take_snapshot(&mut self, blocks: u32, waiting_segment: bool, memory: Option<&Gram<T, ROOM>>) {
        if self.counts {
            self.keep(blocks, waiting_segment, memory);
        }
    }

    fn snapshot(&self) -> Option<&Gram<T, ROOM>> {
        self.counts.then_some(&self.snapshot)
    }

    fn begin_look(&mut self, factor: &InformationFactor<T, N>, blocks: u32) {
        let gram = self.total(blocks);
        // Some of the rows may be left out.
        let share = T::from_u32(factor.rows()) / T::from_u32(blocks.max(1).saturating_mul(CHANNELS as u32));
        self.of_look.begin(factor, &gram, share);
    }

    fn begin_memory(&mut self, factor: &InformationFactor<T, N>, memory: &Gram<T, ROOM>) {
        self.of_look.begin(factor, memory, T::ONE);
    }

    fn begin_snapshot(&mut self, factor: &InformationFactor<T, N>) {
        self.of_snapshot.begin(factor, &self.snapshot, T::ONE);
    }

    fn compensate(&mut self, of_snapshot: bool) -> bool {
        if of_snapshot { self.of_snapshot.step() } else { self.of_look.step() }
    }

    fn compensated(&self, of_snapshot: bool) -> Option<InformationFactor<T, N>> {
        let of = if of_snapshot { &self.of_snapshot } else { &self.of_look };
        self.counts.then(|| of.factor())
    }

    fn begin_refresh(&mut self, config: &EstimatorConfig<T>, reference: &Reference<T, N>, blocks: u32) {
        self.begin_anew(config, &reference.parameters, &reference.standard_deviation, blocks);
    }

    fn refresh(&mut self, config: &EstimatorConfig<T>, blocks: u32) -> Refreshed<T> {
        self.step(config, blocks)
    }

    fn steps_to_together(&self) -> Option<u8> {
        match self.refresh.stage {
            Stage::Compare if !self.together => Some(1),
            Stage::Take if !self.together => Some(0),
            _ => None,
        }
    }

    fn take_shrink(&mut self, blocks: u32) -> Option<T> {
        let by = self.shrink.take();
        if let Some(by) = by {
            self.count(blocks);
            self.gram.scale(by * by);
        }
        by
    }

    fn restore(&mut self, gram: &Gram<T, BODY>, blocks: u32) {
        if self.counts {
            (self.gram, self.counted) = (*gram, blocks);
            // No noise that is found is larger than this.
            self.covariance = [[T::ZERO; CHANNELS]; CHANNELS];
            for (c, row) in self.covariance.iter_mut().enumerate() {
                if let Some(variance) = row.get_mut(c) {
                    *variance = T::from_f32(WHATEVER_IS_FOUND);
                }
            }
        }
    }

    fn restored(&mut self, config: &EstimatorConfig<T>) {
        if self.counts && !self.together {
            self.covariance = of_load_cell(config);
        }
    }

    fn per_row(&self) -> Option<[T; N]> {
        let of = |j: usize| {
            let square = self.unit.columns.get(j).and_then(|column| column.get(j));
            square.map_or(T::ZERO, |square| (*square / T::from_u32(CHANNELS as u32)).max(T::ZERO).sqrt())
        };
        self.counts.then(|| core::array::from_fn(of))
    }
}

#[cfg(test)]
#[path = "noise_tests.rs"]
mod tests;
