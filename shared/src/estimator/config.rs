//! The settings of an estimator, and what follows from them.

use crate::Scalar;
use crate::calibration::ImuMounting;
use crate::conditioning::{Kernel, KernelError};
use crate::forgetting::{MemoryConfig, Plan, Rows, Span};
use crate::regressor::WRENCH;
use crate::screening::Limits;

/// Everything that fixes what the estimator does with a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorConfig<T: Scalar> {
    /// Rate of the readings, 1/s. Without filter (still rows) it is not used.
    pub rate_hz: T,
    /// Width of the FIR, s; zero for still rows, which have no time.
    pub filter_width_s: T,
    /// A row block is absorbed once in this many readings, with weight √`row_every`.
    pub row_every: u16,
    /// 1 σ of the unfiltered wrench per reading: N, N m.
    pub channel_sigma: [T; 6],
    /// Wrench offset that is known, on-body sign, taken off first: N, N m.
    pub known_offset: [T; 6],
    /// The IMU's scale, bias and mounting.
    pub mounting: ImuMounting<T>,
    /// Ranges of the sensors.
    pub limits: Limits<T>,
}

impl<T: Scalar> EstimatorConfig<T> {
    /// Takes the known offset off the wrench among conditioned signals.
    #[inline(always)]
    pub(super) fn take_off_offset(&self, signals: &mut [T]) {
        for (w, offset) in signals.iter_mut().skip(WRENCH).zip(self.known_offset) {
            *w -= offset;
        }
    }
}

/// Tells why an estimator cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConfigError {
    /// A σ is not positive and finite.
    Sigma(u8),
    /// The filter does not fit.
    Kernel(KernelError),
    /// The memory's span is impossible.
    Memory,
    /// The noise of the IMU is negative or not finite.
    ImuNoise,
}

pub(super) fn check_sigma<T: Scalar>(config: &EstimatorConfig<T>) -> Result<(), ConfigError> {
    for (channel, sigma) in config.channel_sigma.iter().enumerate() {
        if !sigma.is_finite() || *sigma <= T::ZERO {
            return Err(ConfigError::Sigma(channel as u8));
        }
    }
    Ok(())
}

/// Returns √row_every / σ per channel.
pub(super) fn weights<T: Scalar>(config: &EstimatorConfig<T>) -> [T; 6] {
    let root = T::from_u32(u32::from(config.row_every)).sqrt();
    config.channel_sigma.map(|sigma| root / sigma)
}

pub(super) fn plan<T: Scalar, const N: usize, const TAPS: usize>(
    config: &EstimatorConfig<T>,
    kernel: &Kernel<T, TAPS>,
    memory: &MemoryConfig<T>,
) -> Option<Plan<T, N>> {
    let (Span::TimeConstant(span_s) | Span::Window(span_s)) = memory.span;
    let EstimatorConfig { rate_hz, filter_width_s, row_every, mounting, .. } = config;
    if *filter_width_s <= T::ZERO || span_s < *filter_width_s {
        return None;
    }
    let every = T::from_u32(u32::from(*row_every));
    Plan::new(
        memory,
        &Rows {
            block_s: every / *rate_hz,
            weights: weights(config),
            noise_gain: kernel.noise_gain(),
            derivative_noise_gain: kernel.derivative_noise_gain(),
            independence: every * kernel.noise_gain(),
            lever_arm2: mounting.position.array().map(|x| x * x).into_iter().sum(),
        },
    )
}

/// Returns the nominal time between readings, by bisection on integers: a float-to-u64 conversion is not in
/// `Scalar`.
pub(super) fn period_ns<T: Scalar>(rate_hz: T, filter_width_s: T) -> u64 {
    if filter_width_s <= T::ZERO {
        return 0;
    }
    let (mut low, mut high) = (0_u32, u32::MAX / 2);
    while low < high {
        let middle = low + (high - low).div_ceil(2);
        if T::from_u32(middle) * rate_hz <= T::from_u32(1_000_000_000) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    u64::from(low)
}
