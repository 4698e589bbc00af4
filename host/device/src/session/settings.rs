use rigident_shared::forgetting::{ImuNoise, MemoryConfig, Span};
use rigident_shared::wire::{
    ImuSettings, LoadCellSettings, MemorySettings, ModelSettings, Settings, Source, StopRule,
    TelemetrySettings,
};

use rigident_fit::outliers;
use rigident_fit::{filter_width_s, row_every};
use rigident_io::rig::{Calibrated, ImuTable, OffsetTable, OffsetWord, RigFile};

/// Estimates are sent at about this rate, 1/s.
const ESTIMATE_RATE_HZ: f64 = 4.0;
/// Range where the rig file states none: beyond any sensor.
const NO_RANGE: f64 = 1e9;

/// The timing of the device in this experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceTiming {
    /// Rate of the load cell, 1/s; 1 for still rows.
    pub rate_hz: f64,
    /// Rows are still poses: no filter.
    pub is_static: bool,
    /// The origin of readings.
    pub source: Source,
    /// Holding after this long without the host; zero where time is simulated.
    pub host_timeout_ms: u32,
}

/// The reason why a rig file does not make settings.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SettingsError {
    /// The gauges' matrix is needed and not there.
    #[error(
        "the rig file has no [load_cell] calibration: the device needs the 6x6 matrix from gauge volts to N \
         and N m"
    )]
    NoCalibration,
    /// The word from_poses where the device needs numbers.
    #[error(
        "the rig file says {0} = \"from_poses\": the device needs numbers; `identify()` calibrates on a \
         recording"
    )]
    FromPoses(&'static str),
    /// No σ.
    #[error("the noise of the load cell is not known: give [load_cell] noise_n_nm")]
    NoNoise,
}

fn numbers(value: Calibrated, key: &'static str) -> Result<[f32; 3], SettingsError> {
    match value {
        Calibrated::Numbers(v) => Ok(v.map(|v| v as f32)),
        Calibrated::FromPoses(_) => Err(SettingsError::FromPoses(key)),
    }
}

fn delay(seconds: f64) -> u32 {
    (seconds * 1e9).round() as u32
}

/// Returns an IMU's settings.
pub(super) fn imu_settings(imu: &ImuTable, timing: &DeviceTiming) -> Result<ImuSettings, SettingsError> {
    Ok(ImuSettings {
        rate_hz: imu.rate_hz.unwrap_or(timing.rate_hz) as f32,
        rotation_wxyz: imu.rotation_wxyz.map(|v| v as f32),
        position_m: imu.position_m.map(|v| v as f32),
        accel_scale: numbers(imu.accel_scale, "accel_scale")?,
        accel_bias_mps2: numbers(imu.accel_bias_mps2, "accel_bias_mps2")?,
        gyro_bias_radps: numbers(imu.gyro_bias_radps, "gyro_bias_radps")?,
        accel_noise_mps2: imu.accel_noise_mps2.unwrap_or(0.0) as f32,
        gyro_noise_radps: imu.gyro_noise_radps.unwrap_or(0.0) as f32,
        group_delay_ns: delay(imu.group_delay_s),
        range_mps2: imu.range_mps2.unwrap_or(NO_RANGE) as f32,
        range_radps: imu.range_radps.unwrap_or(NO_RANGE) as f32,
    })
}

/// States the noise of the first IMU, where the rig file had none.
pub fn state_imu_noise(settings: &mut Settings, noise: &ImuNoise<f64>) {
    settings.imu.accel_noise_mps2 = noise.accel as f32;
    settings.imu.gyro_noise_radps = noise.gyro as f32;
}

/// States how rows are forgotten; `None`: they are not.
pub fn state_memory(settings: &mut Settings, memory: Option<&MemoryConfig<f64>>) {
    settings.memory = match memory {
        None => MemorySettings::Forever,
        Some(MemoryConfig { span: Span::TimeConstant(s), imu_noise: ImuNoise { accel, gyro } }) => {
            MemorySettings::Forgetting {
                time_constant_s: *s as f32,
                accel_noise_mps2: *accel as f32,
                gyro_noise_radps: *gyro as f32,
            }
        }
        Some(MemoryConfig { span: Span::Window(s), .. }) => MemorySettings::Window { length_s: *s as f32 },
    };
}

/// Returns the device's settings from a rig file, and σ where the rig file has none.
///
/// # Errors
/// [`SettingsError`] names what the rig file lacks.
pub fn settings(
    rig: &RigFile,
    timing: &DeviceTiming,
    noise: Option<[f64; 6]>,
    stop: Option<StopRule>,
) -> Result<Settings, SettingsError> {
    let default = ImuTable::default();
    let imu = rig.imu_on(0).unwrap_or(&default);
    let cell = &rig.load_cell;
    let noise = cell.noise_n_nm.or(noise).ok_or(SettingsError::NoNoise)?;
    let calibration = match (cell.calibration, timing.source) {
        (Some(matrix), _) => matrix,
        (None, Source::Injected) => {
            std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))))
        }
        (None, Source::Sensors) => return Err(SettingsError::NoCalibration),
    };
    let known_offset = match cell.offset_n_nm {
        OffsetTable::Known(offset) => Some(offset),
        OffsetTable::Word(OffsetWord::Zero) => Some([0.0; 6]),
        OffsetTable::Word(OffsetWord::Estimate) => None,
    };
    let every = if timing.is_static { 1 } else { row_every(timing.rate_hz) };
    let gains_uncertain = cell.gain_uncertainty.is_some_and(|g| g.iter().any(|s| *s > 0.0));
    let blocks_per_s = timing.rate_hz / f64::from(every);
    Ok(Settings {
        rate_hz: timing.rate_hz as f32,
        source: timing.source,
        model: ModelSettings::Body,
        imu: imu_settings(imu, timing)?,
        load_cell: LoadCellSettings {
            calibration: calibration.map(|row| row.map(|v| v as f32)),
            noise_n_nm: noise.map(|v| v as f32),
            known_offset_n_nm: known_offset.map(|o| o.map(|v| v as f32)),
            group_delay_ns: delay(cell.group_delay_s),
            range_n_nm: cell.range_n_nm.unwrap_or([NO_RANGE; 6]).map(|v| v as f32),
            excitation_v: cell.excitation_v.map(|v| v as f32),
        },
        filter_width_s: if timing.is_static { 0.0 } else { filter_width_s(timing.rate_hz) as f32 },
        row_every: every,
        // As in a batch: gain errors exceed the noise.
        knock_limit_sd: if gains_uncertain { 0.0 } else { outliers::LIMIT_SD as f32 },
        memory: MemorySettings::Forever,
        stop,
        telemetry: TelemetrySettings {
            estimate_every_blocks: (blocks_per_s / ESTIMATE_RATE_HZ).round().clamp(1.0, 1000.0) as u16,
            stream_readings: timing.source == Source::Sensors,
        },
        frozen_after: if timing.is_static { 0 } else { rig.recording.frozen_after },
        host_timeout_ms: timing.host_timeout_ms,
    })
}
