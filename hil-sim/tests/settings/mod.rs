//! Settings that the rig file of a simulated rig holds.

use rigident_shared::wire::{
    ImuSettings, LoadCellSettings, MemorySettings, ModelSettings, Settings, Source, TelemetrySettings,
};
use rigident_sim::rig::RigConfig;

/// Returns the settings that a rig file would give for the rig.
pub fn settings(rig: &RigConfig) -> Settings {
    let nanoseconds = |s: f64| (1e9 * s).round() as u32;
    let (cell, unit) = (&rig.sensors.load_cell, &rig.sensors.imu);
    Settings {
        rate_hz: rig.adc_hz as f32,
        source: Source::Sensors,
        model: ModelSettings::Body,
        imu: ImuSettings {
            rate_hz: rig.imu_hz as f32,
            rotation_wxyz: rig.imu.rotation_wxyz.map(|v| v as f32),
            position_m: rig.imu.position_m.map(|v| v as f32),
            accel_scale: [1.0; 3],
            accel_bias_mps2: [0.0; 3],
            gyro_bias_radps: [0.0; 3],
            accel_noise_mps2: 0.0,
            gyro_noise_radps: 0.0,
            group_delay_ns: nanoseconds(rig.imu_group_delay_s()),
            range_mps2: unit.accel_range_mps2 as f32,
            range_radps: unit.gyro_range_radps as f32,
        },
        load_cell: LoadCellSettings {
            calibration: rig.gauge_calibration.map(|row| row.map(|v| v as f32)),
            noise_n_nm: cell.noise_n_nm.map(|v| v as f32),
            known_offset_n_nm: None,
            group_delay_ns: nanoseconds(rig.load_cell_group_delay_s()),
            range_n_nm: cell.range_n_nm.map(|v| v as f32),
            excitation_v: None,
        },
        filter_width_s: 0.06,
        row_every: 10,
        knock_limit_sd: 6.0,
        memory: MemorySettings::Forever,
        stop: None,
        telemetry: TelemetrySettings { estimate_every_blocks: 25, stream_readings: true },
        frozen_after: 20,
        host_timeout_ms: 0,
    }
}
