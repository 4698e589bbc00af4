//! A device that does not keep everything.

use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::forgetting::{ImuNoise, MemoryConfig, Span};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Rotation, SpecificForce, Wrench};
use rigident_shared::wire::{
    Command, ErrorCode, MemorySettings, ReadingMessage, SettingName, Settings, StopLimit, StopRule,
};
use rigident_sim::rig::RigConfig;

use super::host::{Host, RATE_HZ, message, readings, settings};

const FORGETTING: MemorySettings =
    MemorySettings::Forgetting { time_constant_s: 5.0, accel_noise_mps2: 0.02, gyro_noise_radps: 1.9e-3 };
const WINDOW: MemorySettings = MemorySettings::Window { length_s: 12.0 };

fn rows(config: &RigConfig, seconds: f64) -> Vec<ReadingMessage> {
    readings(config, seconds).measured(1).map(|row| message(&row)).collect()
}

fn span(memory: MemorySettings) -> MemoryConfig<f64> {
    match memory {
        MemorySettings::Forever => panic!("no span"),
        MemorySettings::Forgetting { time_constant_s, accel_noise_mps2, gyro_noise_radps } => MemoryConfig {
            span: Span::TimeConstant(f64::from(time_constant_s)),
            imu_noise: ImuNoise { accel: f64::from(accel_noise_mps2), gyro: f64::from(gyro_noise_radps) },
        },
        MemorySettings::Window { length_s } => MemoryConfig {
            span: Span::Window(f64::from(length_s)),
            imu_noise: ImuNoise { accel: 0.0, gyro: 0.0 },
        },
    }
}

/// Runs the pipeline in double precision.
fn wide(settings: &Settings, rows: &[ReadingMessage]) -> Box<Estimator<f64, 16, 64>> {
    let config = EstimatorConfig {
        rate_hz: RATE_HZ,
        filter_width_s: f64::from(settings.filter_width_s),
        row_every: settings.row_every,
        channel_sigma: settings.load_cell.noise_n_nm.map(f64::from),
        known_offset: [0.0; 6],
        mounting: ImuMounting {
            rotation: Rotation::from_quaternion(settings.imu.rotation_wxyz.map(f64::from)).unwrap(),
            position: Position::from_array(settings.imu.position_m.map(f64::from)),
            ..ImuMounting::default()
        },
        limits: Limits { frozen_after: settings.frozen_after, ..Limits::none() },
    };
    let mut estimator = Box::new(Estimator::new(&config).unwrap());
    estimator.set_memory(&span(settings.memory)).unwrap();
    for row in rows {
        estimator.absorb(&Reading {
            time_ns: row.time_ns,
            wrench: Wrench::from_array(row.wrench.map(f64::from)),
            specific_force: SpecificForce::from_array(row.specific_force.map(f64::from)),
            angular_rate: AngularRate::from_array(row.angular_rate.map(f64::from)),
        });
        estimator.remember(f64::from(settings.knock_limit_sd));
    }
    estimator
}

#[test]
fn the_device_remembers_as_double_precision_does() {
    let config = RigConfig::thesis_horizontal();
    let rows = rows(&config, 40.0);
    for memory in [FORGETTING, WINDOW] {
        let settings = Settings { memory, ..settings(&config) };
        let mut host = Host::start(&settings);
        assert_eq!(host.inject(0, &rows), rows.len() as u32);
        let device = host.factor::<16>();
        let wide = wide(&settings, &rows).factor();
        assert_eq!(device.rows(), wide.rows());
        // 5 s and what of a segment has come since; four to five fifths of 12 s.
        let seconds = f64::from(device.rows()) / 600.0;
        let held = if memory == FORGETTING { 4.5..5.5 } else { 9.6..12.0 };
        assert!(held.contains(&seconds), "{seconds}");
        let (a, b) = (device.solve(), wide.solve());
        let norm = b.estimate.iter().map(|v| v * v).sum::<f64>().sqrt();
        let rule = 20.0 * f64::from(f32::EPSILON) * b.condition_number * norm;
        for j in 0..16 {
            let allowed = (0.05 * b.standard_deviation[j]).max(rule);
            assert!((a.estimate[j] - b.estimate[j]).abs() < allowed, "{memory:?} {j}: {a:?} {b:?}");
            // sd at the digits that a triangle in f32 has at this condition.
            assert!((a.standard_deviation[j] / b.standard_deviation[j] - 1.0).abs() < 1e-3, "{j}");
        }
    }
}

#[test]
fn the_stop_rule_judges_the_remembered_rows() {
    let config = RigConfig::thesis_horizontal();
    let rows = rows(&config, 60.0);
    let run = |memory, mass_u95| {
        let mut limit = StopLimit { u95: mass_u95, ..StopLimit::default() };
        limit.add(0);
        let stop = StopRule { limits: [limit].into_iter().collect(), minimum_blocks: 100, goes_on: false };
        let settings = Settings { memory, stop: Some(stop), ..settings(&config) };
        Host::start(&settings).inject(0, &rows)
    };
    // Five seconds never know the mass to 30 g; a minute does. To 200 g they know it as soon.
    let (forever, short) = (run(MemorySettings::Forever, 0.03), run(FORGETTING, 0.03));
    assert!((forever as usize) < rows.len(), "{forever}");
    assert_eq!(short as usize, rows.len());
    assert!((run(FORGETTING, 0.2) as usize) < rows.len());
}

#[test]
fn a_memory_begins_anew_with_the_run() {
    let config = RigConfig::thesis_horizontal();
    let rows = rows(&config, 20.0);
    let settings = Settings { memory: FORGETTING, ..settings(&config) };
    let mut host = Host::start(&settings);
    host.inject(0, &rows);
    let first = host.factor::<16>();
    host.ask(&Command::Hold).unwrap();
    host.ask(&Command::Configure(settings)).unwrap();
    host.ask(&Command::Start).unwrap();
    host.inject(0, &rows);
    assert_eq!(host.factor::<16>(), first);
}

#[test]
fn impossible_memories_are_refused() {
    let config = RigConfig::thesis_horizontal();
    let good = Settings { memory: FORGETTING, ..settings(&config) };
    let forgetting = |time_constant_s, accel_noise_mps2| MemorySettings::Forgetting {
        time_constant_s,
        accel_noise_mps2,
        gyro_noise_radps: 1.9e-3,
    };
    let mut host = Host::start(&good);
    host.ask(&Command::Hold).unwrap();
    for memory in [
        forgetting(0.0, 0.02),
        forgetting(f32::INFINITY, 0.02),
        forgetting(f32::NAN, 0.02),
        // Shorter than the filter of 60 ms.
        forgetting(0.05, 0.02),
        forgetting(5.0, -1.0),
        MemorySettings::Window { length_s: 0.05 },
        MemorySettings::Window { length_s: -1.0 },
    ] {
        let answer = host.ask(&Command::Configure(Settings { memory, ..good.clone() }));
        assert_eq!(answer, Err(ErrorCode::BadSetting(SettingName::Memory)), "{memory:?}");
    }
    // Still poses have no time.
    let still = Settings { filter_width_s: 0.0, row_every: 1, ..good };
    assert_eq!(host.ask(&Command::Configure(still)), Err(ErrorCode::BadSetting(SettingName::Memory)));
}
