//! Two links with an IMU each and a load cell at the base, at 1 kHz from the sensor buses.

use std::time::Duration;

use hexapod::experiment::thesis_program;
use nalgebra::{DMatrix, DVector};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{
    EstimatorConfig, JointAttitude, TwoLinkEstimator, TwoLinkReading, TwoLinks,
};
use rigident_shared::factor::InformationFactor;
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Rotation, SpecificForce, Wrench};
use rigident_shared::wire::{
    AttitudeSource, Command, ErrorCode, ImuSettings, InjectBatch, LINK_BATCH, LinkBatch, LinkReadingMessage,
    MemorySettings, ModelSettings, Reason, Reply, SettingName, Settings, Source, StateName, StopLimit,
    StopRule, TwoLinkSettings,
};
use rigident_sim::links::SecondLink;
use rigident_sim::rig::{Rig, RigConfig};
use rigident_sim::runner::{InProcess, Mcu, Pacing, Qemu, QemuOptions};
use rigident_sim::sensors::{PerExperiment, SensorModels};

use super::device::{Device, settings};

fn second() -> SecondLink {
    SecondLink::arm()
}

/// Returns the thesis' noise without what an experiment draws once; the second link is faster than its gyro's
/// range.
fn noisy() -> SensorModels {
    let mut sensors = SensorModels::thesis();
    sensors.load_cell.offset_n_nm = PerExperiment::fixed([3.0, -2.0, 5.0, 0.2, -0.3, 0.1]);
    sensors.imu.accel_bias_mps2 = PerExperiment::ZERO;
    sensors.imu.gyro_bias_radps = PerExperiment::ZERO;
    sensors.imu.gyro_range_radps = 30.0;
    sensors
}

fn quiet() -> SensorModels {
    let mut sensors = SensorModels::ideal();
    sensors.load_cell.offset_n_nm = noisy().load_cell.offset_n_nm;
    sensors.imu.gyro_range_radps = 30.0;
    sensors
}

fn config(sensors: SensorModels) -> RigConfig {
    RigConfig::thesis_horizontal().with_sensors(sensors).with_second(second())
}

fn two_links(config: &RigConfig, time_constant_s: f32) -> Settings {
    let one = settings(config);
    let link = second();
    let imu = ImuSettings {
        rotation_wxyz: link.imu.rotation_wxyz.map(|v| v as f32),
        position_m: link.imu.position_m.map(|v| v as f32),
        ..one.imu
    };
    let attitude = AttitudeSource::FromImus {
        initial_wxyz: link.swing.attitude_wxyz(0.0).map(|v| v as f32),
        time_constant_s,
    };
    let joint_position_m = link.joint_m.map(|v| v as f32);
    let model = ModelSettings::TwoLinks(TwoLinkSettings { imu, joint_position_m, attitude });
    Settings { model, ..one }
}

struct Run {
    readings: Vec<LinkReadingMessage>,
    factor: Vec<f32>,
    rows: u32,
}

fn run(mcu: &mut dyn Mcu, rig: &rigident_sim::rig::SharedRig, settings: &Settings, seconds: f64) -> Run {
    let mut device = Device::greet(mcu);
    let geometry = RigConfig::thesis_horizontal().geometry;
    device.run(rig, settings, &thesis_program(&geometry, seconds));
    let counters = device.counters();
    assert_eq!((counters.rejected, counters.gaps, counters.telemetry_dropped), (0, 0, 0), "{counters:?}");
    assert_eq!((counters.imu_errors, counters.second_imu_errors), (0, 0));
    assert!(counters.unaligned < 10, "{counters:?}");
    assert!(counters.blocks > 90 * seconds as u32, "{counters:?}");
    Run { readings: device.link_readings.clone(), factor: device.factor(), rows: 6 * counters.blocks }
}

fn in_process(config: &RigConfig, settings: &Settings, seconds: f64) -> Run {
    let rig = Rig::new(config.clone()).unwrap().shared();
    run(&mut InProcess::new(rig.clone(), Pacing::LockStep), &rig, settings, seconds)
}

fn solved<const N: usize>(run: &Run) -> rigident_shared::factor::Solution<f64, N> {
    let entries = run.factor.iter().map(|v| f64::from(*v));
    InformationFactor::<f64, N>::from_entries(entries, run.rows).unwrap().solve()
}

fn truth(config: &RigConfig) -> Vec<f64> {
    let offset = config.sensors.load_cell.offset_n_nm.fixed;
    second().base_parameters(&config.body).into_iter().chain(offset).collect()
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_processor_gives_the_same_bits_of_two_links() {
    for known_offset_n_nm in [None, Some([3.0, -2.0, 5.0, 0.2, -0.3, 0.1])] {
        let config = config(noisy());
        let mut settings = two_links(&config, 5.0);
        settings.load_cell.known_offset_n_nm = known_offset_n_nm;
        let here = in_process(&config, &settings, 12.0);
        let parameters = if known_offset_n_nm.is_some() { 19 } else { 25 };
        assert_eq!(here.factor.len(), parameters * (parameters + 3) / 2 + 1);
        let rig = Rig::new(config.clone()).unwrap().shared();
        let mut qemu = Qemu::spawn(&QemuOptions::default(), rig.clone(), Pacing::LockStep)
            .unwrap_or_else(|e| panic!("{e}"));
        let there = run(&mut qemu, &rig, &settings, 12.0);
        let bits = |run: &Run| -> Vec<u32> {
            let of = |m: &LinkReadingMessage| {
                let base = &m.base;
                let all = base.wrench.iter().chain(&base.specific_force).chain(&base.angular_rate);
                let second = m.specific_force.iter().chain(&m.angular_rate).chain(&m.attitude_wxyz);
                all.chain(second).map(|v| v.to_bits()).collect::<Vec<_>>()
            };
            run.readings.iter().flat_map(of).chain(run.factor.iter().map(|v| v.to_bits())).collect()
        };
        assert!(here.readings.len() > 11_900);
        assert_eq!(bits(&here), bits(&there));
        let stack = qemu.finish(Duration::from_secs(60)).unwrap().expect("the firmware reports its stack");
        assert!(stack.used < stack.size, "{stack:?}");
    }
}

#[test]
fn perfect_sensors_give_the_base_parameters_of_both_links() {
    let config = config(quiet());
    let mut settings = two_links(&config, 0.0);
    settings.load_cell.noise_n_nm = noisy().load_cell.noise_n_nm.map(|v| v as f32);
    // Words without noise repeat themselves.
    settings.frozen_after = 0;
    let run = in_process(&config, &settings, 20.0);
    let solution = solved::<25>(&run);
    assert!(solution.determined.iter().all(|d| *d));
    let truth = truth(&config);
    for (j, (value, truth)) in solution.estimate.iter().zip(&truth).enumerate() {
        // Words of 16 bits cost up to 5e-4 of a tensor unfiltered; a gyro's step of 1e-3 rad/s integrates to
        // some of it.
        let scale: f64 = if j < 10 { 1.0 } else { 0.2 };
        assert!((value - truth).abs() < 2e-3 * scale.max(truth.abs()), "{j}: {value} {truth}");
    }
}

#[test]
fn noise_leaves_both_links_parameters_within_their_uncertainty() {
    let config = config(noisy());
    let mut settings = two_links(&config, 5.0);
    settings.filter_width_s = 0.1;
    let run = in_process(&config, &settings, 40.0);
    let solution = solved::<25>(&run);
    let truth = truth(&config);
    for (j, (value, truth)) in solution.estimate.iter().zip(&truth).enumerate() {
        let sd = solution.standard_deviation[j];
        assert!((value - truth).abs() < 4.0 * sd, "{j}: {value} {truth} {sd}");
        assert!(sd < 0.05 * truth.abs().max(1.0), "{j}: {sd}");
    }
}

/// Converts the settings for the pipeline in double precision, with the attitude that was streamed.
fn wide(settings: &Settings) -> (EstimatorConfig<f64>, TwoLinks<f64>) {
    let mounting = |imu: &ImuSettings| ImuMounting {
        rotation: Rotation::from_quaternion(imu.rotation_wxyz.map(f64::from)).unwrap(),
        position: Position::from_array(imu.position_m.map(f64::from)),
        ..ImuMounting::default()
    };
    let ModelSettings::TwoLinks(links) = &settings.model else { panic!("two links") };
    let config = EstimatorConfig {
        rate_hz: f64::from(settings.rate_hz),
        filter_width_s: f64::from(settings.filter_width_s),
        row_every: settings.row_every,
        channel_sigma: settings.load_cell.noise_n_nm.map(f64::from),
        known_offset: [0.0; 6],
        mounting: mounting(&settings.imu),
        limits: Limits::none(),
    };
    let joint = links.joint_position_m.map(f64::from);
    let model = TwoLinks::new(mounting(&links.imu), [1e9; 2], joint, JointAttitude::Streamed).unwrap();
    (config, model)
}

#[test]
fn single_precision_is_as_good_as_a_batch_of_the_same_rows_in_double() {
    let config = config(noisy());
    // No settling, no knocks: every row of the device is one of the batch.
    let settings = Settings { knock_limit_sd: 0.0, ..two_links(&config, 0.0) };
    let run = in_process(&config, &settings, 20.0);
    let (wide_config, model) = wide(&settings);
    let mut estimator = Box::new(TwoLinkEstimator::<f64, 25, 32>::UNUSED);
    estimator.set_up(&wide_config, &model).unwrap();
    for m in &run.readings {
        estimator.absorb(&TwoLinkReading {
            base: Reading {
                time_ns: m.base.time_ns,
                wrench: Wrench::from_array(m.base.wrench.map(f64::from)),
                specific_force: SpecificForce::from_array(m.base.specific_force.map(f64::from)),
                angular_rate: AngularRate::from_array(m.base.angular_rate.map(f64::from)),
            },
            specific_force: SpecificForce::from_array(m.specific_force.map(f64::from)),
            angular_rate: AngularRate::from_array(m.angular_rate.map(f64::from)),
            attitude: m.attitude_wxyz.map(f64::from),
        });
    }
    let batch = estimator.factor();
    assert_eq!(batch.rows(), run.rows);
    let r = DMatrix::from_fn(25, 25, |i, j| batch.r()[i][j]);
    let exact = r.clone().qr().solve(&DVector::from_row_slice(batch.z())).unwrap();
    let norms: Vec<f64> = r.column_iter().map(|c| c.norm()).collect();
    let singular = DMatrix::from_fn(25, 25, |i, j| r[(i, j)] / norms[j]).singular_values();
    let limit = 20.0 * 1.19e-7 * singular.max() / singular.min() * exact.norm();
    let found = solved::<25>(&run);
    for j in 0..25 {
        let error = (found.estimate[j] - exact[j]).abs();
        assert!(error < limit.max(0.05 * found.standard_deviation[j]), "{j}: {error} {limit}");
    }
}

#[test]
fn a_recording_with_its_attitudes_streamed_gives_the_bits_of_the_run() {
    let config = config(noisy());
    let settings = two_links(&config, 0.0);
    let run = in_process(&config, &settings, 12.0);
    let ModelSettings::TwoLinks(links) = settings.model else { panic!("two links") };
    let links = TwoLinkSettings { attitude: AttitudeSource::Streamed, ..links };
    let streamed =
        Settings { source: Source::Injected, model: ModelSettings::TwoLinks(links), ..settings.clone() };
    let rig = Rig::new(config).unwrap().shared();
    let mut mcu = InProcess::new(rig, Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Configure(streamed)), Ok(Reply::Done));
    assert_eq!(device.ask(&Command::Start), Ok(Reply::Done));
    // Those of one body are refused, and a batch out of order.
    let one = InjectBatch { first_index: 0, readings: [run.readings[0].base].into_iter().collect() };
    assert_eq!(device.ask(&Command::Inject(one)), Err(ErrorCode::WrongState(StateName::Running)));
    let mut first_index = 0;
    for part in run.readings.chunks(LINK_BATCH) {
        let batch = LinkBatch { first_index, readings: part.iter().copied().collect() };
        first_index += part.len() as u32;
        let answer = device.ask(&Command::InjectLinks(batch));
        assert_eq!(answer, Ok(Reply::Injected { next_index: first_index }));
    }
    let bits = |factor: &[f32]| factor.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&device.factor()), bits(&run.factor));
}

#[test]
fn the_stop_rule_looks_at_the_second_link_s_parameters_too() {
    let config = config(noisy());
    // The second link's Iyy, which the base's motion alone would not tell for long.
    let mut limit = StopLimit { u95: 0.008, ..StopLimit::default() };
    limit.add(14);
    let stop = StopRule { limits: [limit].into_iter().collect(), minimum_blocks: 100, goes_on: false };
    let stop = Some(stop);
    let settings = Settings { stop, ..two_links(&config, 5.0) };
    let rig = Rig::new(config.clone()).unwrap().shared();
    let mut mcu = InProcess::new(rig.clone(), Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Configure(settings)), Ok(Reply::Done));
    rig.lock().unwrap().load_program(thesis_program(&config.geometry, 40.0)).unwrap();
    assert_eq!(device.ask(&Command::Start), Ok(Reply::Done));
    rig.lock().unwrap().start().unwrap();
    while !rig.lock().unwrap().is_done() && !device.reasons.contains(&Reason::StopRule) {
        device.listen(Duration::from_millis(20));
    }
    assert!(device.reasons.contains(&Reason::StopRule));
    assert!(rig.lock().unwrap().now_ns() < 30_000_000_000);
    let factor = device.factor();
    let blocks = device.counters().blocks;
    let run = Run { readings: Vec::new(), factor, rows: 6 * blocks };
    let sd = solved::<25>(&run).standard_deviation[14];
    assert!(sd * 1.96 <= 0.008 && sd * 1.96 > 0.006, "{sd}");
}

#[test]
fn impossible_settings_of_two_links_are_named() {
    let config = config(noisy());
    let rig = Rig::new(config.clone()).unwrap().shared();
    let mut mcu = InProcess::new(rig, Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    let good = two_links(&config, 5.0);
    let ModelSettings::TwoLinks(links) = good.model.clone() else { panic!("two links") };
    let with = |change: fn(&mut TwoLinkSettings)| {
        let mut links = links;
        change(&mut links);
        Settings { model: ModelSettings::TwoLinks(links), ..good.clone() }
    };
    let window = MemorySettings::Window { length_s: 10.0 };
    for (bad, name) in [
        (with(|l| l.joint_position_m[1] = f32::NAN), SettingName::Joint),
        (with(|l| l.attitude = AttitudeSource::Streamed), SettingName::Joint),
        (with(|l| l.imu.rotation_wxyz = [0.0; 4]), SettingName::SecondImu),
        (with(|l| l.imu.rate_hz = 0.0), SettingName::SecondImu),
        (with(|l| l.imu.range_radps = -1.0), SettingName::SecondImu),
        (Settings { memory: window, ..good.clone() }, SettingName::Memory),
    ] {
        assert_eq!(device.ask(&Command::Configure(bad)), Err(ErrorCode::BadSetting(name)));
    }
}

#[test]
fn a_second_imu_that_is_not_there_is_reported() {
    let config = RigConfig::thesis_horizontal();
    let rig = Rig::new(config.clone()).unwrap().shared();
    let mut mcu = InProcess::new(rig, Pacing::LockStep);
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Configure(two_links(&config, 5.0))), Err(ErrorCode::Sensors));
    device.listen(Duration::from_millis(10));
    assert_eq!(device.states.last(), Some(&StateName::Fault));
    assert!(matches!(device.reasons.last(), Some(Reason::SecondImu(_))));
}
