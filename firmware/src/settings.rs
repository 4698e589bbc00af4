//! From the host's settings to the estimator's configuration, every field checked.

use rigident_shared::alignment::AlignerConfig;
use rigident_shared::calibration::{GaugeCalibration, ImuMounting};
use rigident_shared::estimator::{ConfigError, EstimatorConfig};
use rigident_shared::forgetting::{ImuNoise, MemoryConfig, Span};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Rotation, SpecificForce};
use rigident_shared::wire::{MemorySettings, SettingName, Settings, Source};

use crate::sample_path::StopLimits;

/// Highest rate, 1/s.
const MAX_RATE_HZ: f32 = 4000.0;

/// Coverage factor of a 95 % uncertainty.
const COVERAGE: f32 = 1.96;

/// What the settings amount to.
pub(crate) struct Configuration {
    pub(crate) estimator: EstimatorConfig<f32>,
    pub(crate) aligner: AlignerConfig,
    pub(crate) gauges: GaugeCalibration<f32>,
    pub(crate) estimates_offset: bool,
    pub(crate) stop: Option<StopLimits>,
    pub(crate) knock_limit: f32,
    /// `None`: everything is kept.
    pub(crate) memory: Option<MemoryConfig<f32>>,
}

fn all_finite(values: &[f32]) -> bool {
    values.iter().all(|v| v.is_finite())
}

fn positive(values: &[f32]) -> bool {
    values.iter().all(|v| v.is_finite() && *v > 0.0)
}

impl Configuration {
    /// Checks every field; the first that is impossible is named.
    pub(crate) fn new(settings: &Settings) -> Result<Self, SettingName> {
        let (imu, cell) = (&settings.imu, &settings.load_cell);
        let from_sensors = settings.source == Source::Sensors;
        let ensure = |ok: bool, name: SettingName| if ok { Ok(()) } else { Err(name) };
        ensure(positive(&[settings.rate_hz]) && settings.rate_hz <= MAX_RATE_HZ, SettingName::Rate)?;
        ensure(
            !from_sensors || (positive(&[imu.rate_hz]) && imu.rate_hz <= MAX_RATE_HZ),
            SettingName::ImuRate,
        )?;
        let rotation = Rotation::from_quaternion(imu.rotation_wxyz).ok_or(SettingName::ImuRotation)?;
        ensure(all_finite(&imu.position_m), SettingName::ImuPosition)?;
        ensure(positive(&imu.accel_scale), SettingName::AccelScale)?;
        ensure(all_finite(&imu.accel_bias_mps2) && all_finite(&imu.gyro_bias_radps), SettingName::ImuBias)?;
        ensure(positive(&[imu.range_mps2, imu.range_radps]), SettingName::ImuRange)?;
        ensure(
            cell.calibration.iter().all(|row| all_finite(row) && row.iter().any(|v| *v != 0.0)),
            SettingName::Calibration,
        )?;
        ensure(positive(&cell.range_n_nm), SettingName::LoadCellRange)?;
        ensure(cell.known_offset_n_nm.is_none_or(|o| all_finite(&o)), SettingName::KnownOffset)?;
        ensure(settings.stop.as_ref().is_none_or(|stop| all_finite(&stop.u95)), SettingName::StopRule)?;
        let limit = settings.knock_limit_sd;
        ensure(limit.is_finite() && limit >= 0.0, SettingName::KnockLimit)?;
        let estimator = EstimatorConfig {
            rate_hz: settings.rate_hz,
            filter_width_s: settings.filter_width_s,
            row_every: settings.row_every,
            channel_sigma: cell.noise_n_nm,
            known_offset: cell.known_offset_n_nm.unwrap_or_default(),
            mounting: ImuMounting {
                rotation,
                position: Position::from_array(imu.position_m),
                accel_scale: imu.accel_scale,
                accel_bias: SpecificForce::from_array(imu.accel_bias_mps2),
                gyro_bias: AngularRate::from_array(imu.gyro_bias_radps),
            },
            limits: Limits {
                wrench: cell.range_n_nm,
                specific_force: imu.range_mps2,
                angular_rate: imu.range_radps,
                frozen_after: settings.frozen_after,
            },
        };
        Ok(Self {
            estimator,
            aligner: AlignerConfig {
                wrench_delay_ns: cell.group_delay_ns,
                imu_delay_ns: imu.group_delay_ns,
                imu_period_ns: if from_sensors { (1e9 / imu.rate_hz) as u32 } else { 0 },
            },
            gauges: GaugeCalibration { matrix: cell.calibration },
            estimates_offset: cell.known_offset_n_nm.is_none(),
            stop: settings.stop.as_ref().map(|stop| StopLimits {
                standard_deviation: core::array::from_fn(|j| {
                    stop.u95.get(j).filter(|_| stop.asked >> j & 1 == 1).map(|u95| u95 / COVERAGE)
                }),
                minimum_blocks: stop.minimum_blocks,
            }),
            knock_limit: limit,
            memory: match settings.memory {
                MemorySettings::Forever => None,
                MemorySettings::Forgetting { time_constant_s, accel_noise_mps2, gyro_noise_radps } => {
                    Some(MemoryConfig {
                        span: Span::TimeConstant(time_constant_s),
                        imu_noise: ImuNoise { accel: accel_noise_mps2, gyro: gyro_noise_radps },
                    })
                }
                MemorySettings::Window { length_s } => Some(MemoryConfig {
                    span: Span::Window(length_s),
                    imu_noise: ImuNoise { accel: 0.0, gyro: 0.0 },
                }),
            },
        })
    }
}

/// The setting an estimator's refusal is about.
pub(crate) fn setting_of(error: ConfigError) -> SettingName {
    match error {
        ConfigError::Sigma(channel) => SettingName::Noise(channel),
        ConfigError::Kernel(_) => SettingName::Filter,
        ConfigError::Memory => SettingName::Memory,
    }
}
