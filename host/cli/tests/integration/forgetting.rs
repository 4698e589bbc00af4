//! A body that changes, and a motion that stops: what `--forget` and `--window` promise, against a simulator
//! that shares none of the estimator's algebra.
#![cfg(feature = "simulator")]

use std::process::Command;

use hexapod::BodyParameters;
use hexapod::experiment::thesis_program;
use hexapod::{MotionProgram, Segment};
use rigident::answer::result::{Measured, ParameterState};
use rigident::fit::Fit;
use rigident::laboratory::{mounting, reading};
use rigident::rig::FROZEN_AFTER;
use rigident::rig::ImuTable;
use rigident::rows::body::Input;
use rigident::rows::body::imu_noise::imu_noise;
use rigident_shared::forgetting::Span;
use rigident_shared::screening::Limits;
use rigident_sim::rig::{ReadingRow, Readings, RigConfig};

use crate::fitting::{fit_body, fit_forgetting, states};
use crate::study_length::runs;

const RATE_HZ: f64 = 200.0;
const TIME_CONSTANT_S: f64 = 5.0;
const FORGETTING: Span<f64> = Span::TimeConstant(TIME_CONSTANT_S);

fn input(config: &RigConfig, rows: impl Iterator<Item = ReadingRow>) -> Input {
    Input {
        readings: rows.map(|row| reading(&row)).collect(),
        is_static: false,
        rate_hz: RATE_HZ,
        mounting: mounting(config),
        channel_sigma: Some(config.sensors.load_cell.noise_n_nm),
        gyro_sigma: None,
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits { frozen_after: FROZEN_AFTER, ..Limits::none() },
    }
}

fn body(found: &Fit) -> Vec<Measured> {
    states(found).iter().take(10).map(|state| state.measured().unwrap()).collect()
}

const CHANGE_S: f64 = 50.0;

/// A body of 20 kg, that is another one of 21 kg from [`CHANGE_S`] on, in the middle of the multisine.
struct Changing {
    before: Readings,
    after: Readings,
    config: RigConfig,
    truth: [f64; 10],
}

impl Changing {
    fn new() -> Self {
        let config = RigConfig::thesis_horizontal();
        let body = BodyParameters {
            mass_kg: config.body.mass_kg + 1.0,
            com_m: [0.005, -0.003, 0.055],
            inertia_com_kgm2: config.body.inertia_com_kgm2.map(|v| 1.05 * v),
        };
        let heavier = RigConfig { body, ..config.clone() };
        let program = thesis_program(&config.geometry, 100.0);
        Self {
            before: Readings::new(&config, &program, RATE_HZ).unwrap(),
            after: Readings::new(&heavier, &program, RATE_HZ).unwrap(),
            config,
            truth: body.parameters(),
        }
    }

    /// Until this long after the change.
    fn until(&self, seconds: f64, seed: u64) -> Input {
        let (change, end) = ((CHANGE_S * RATE_HZ) as usize, ((CHANGE_S + seconds) * RATE_HZ) as usize);
        let rows = self.before.measured(seed).take(change);
        input(&self.config, rows.chain(self.after.measured(seed).take(end).skip(change)))
    }
}

#[test]
fn a_body_that_changes_is_followed_and_its_intervals_hold() {
    let changing = Changing::new();
    let (mut held, mut of) = (0, 0);
    for seed in 1..=runs(6, 2) {
        // After n time constants e⁻ⁿ of the step is left.
        let soon = body(&fit_forgetting(&changing.until(2.0 * TIME_CONSTANT_S, seed), FORGETTING));
        let left = soon[0].value - changing.truth[0];
        assert!((left + (-2.0_f64).exp()).abs() < soon[0].u95, "{left} {soon:?}");
        // After six it is a fraction of the uncertainty.
        let input = changing.until(6.0 * TIME_CONSTANT_S, seed);
        for (m, truth) in body(&fit_forgetting(&input, FORGETTING)).iter().zip(&changing.truth) {
            held += u32::from((m.value - truth).abs() <= m.u95);
            of += 1;
        }
        // The window has left the old body behind altogether.
        let window = Span::Window(5.0 * TIME_CONSTANT_S);
        let windowed = body(&fit_forgetting(&input, window));
        assert!((windowed[0].value - changing.truth[0]).abs() < 1.5 * windowed[0].u95, "{windowed:?}");
        // Without forgetting the change is reported, and the interval holds both bodies.
        let fit = fit_body(&input);
        assert!(fit.lack_of_fit.contradicts());
        let whole = [fit.estimate.measured(0).unwrap()];
        for mass in [changing.truth[0], changing.truth[0] - 1.0] {
            assert!((whole[0].value - mass).abs() < whole[0].u95, "{:?}", whole[0]);
        }
    }
    // Intervals are those of S seconds, and wider by √2 than need be: 99.4 % of them hold; 95 % are promised.
    assert!(held * 100 >= of * 95, "{held} of {of}");
}

/// Poses and multisine, then a pose held for the given time.
fn stopping(config: &RigConfig, seconds: f64) -> MotionProgram {
    let mut program = thesis_program(&config.geometry, 60.0);
    if let Some(Segment::Hold { duration_s }) = program.segments.last_mut() {
        *duration_s = seconds;
    }
    program
}

#[test]
fn where_the_motion_stops_the_answer_and_its_intervals_stay() {
    let config = RigConfig::thesis_horizontal();
    let still_s = 20.0 * TIME_CONSTANT_S;
    let program = stopping(&config, still_s);
    let readings = Readings::new(&config, &program, RATE_HZ).unwrap();
    for seed in 1..=runs(3, 1) {
        let rows = |seconds: f64| readings.measured(seed).take((seconds * RATE_HZ) as usize);
        let stopped_s = program.duration_s() - still_s;
        let before = body(&fit_forgetting(&input(&config, rows(stopped_s)), FORGETTING));
        let whole = input(&config, rows(program.duration_s()));
        let after = body(&fit_forgetting(&whole, FORGETTING));
        for (j, (a, b)) in before.iter().zip(&after).enumerate() {
            // What is not renewed is retained; the six sums of weight and offset that rest renews pull at it
            // by no more than they were uncertain. Plain forgetting would have widened the intervals by e¹⁰.
            assert!(b.u95 < 1.1 * a.u95, "seed {seed}, {j}: {a:?} {b:?}");
            assert!((a.value - b.value).abs() < a.u95, "seed {seed}, {j}: {a:?} {b:?}");
        }
        // A window has nothing left of the motion, and says so instead of giving numbers.
        let window = Span::Window(4.0 * TIME_CONSTANT_S);
        let states = states(&fit_forgetting(&whole, window));
        assert!(states[4..10].iter().all(|s| *s == ParameterState::NotIdentified), "{states:?}");
    }
}

#[test]
fn a_memory_longer_than_the_run_is_the_batch() {
    let config = RigConfig::thesis_horizontal();
    let readings = Readings::new(&config, &thesis_program(&config.geometry, 40.0), RATE_HZ).unwrap();
    let input = input(&config, readings.measured(1));
    let batch = fit_body(&input);
    for span in [Span::TimeConstant(1e30), Span::Window(1e6)] {
        let kept = fit_forgetting(&input, span);
        assert_eq!(kept.factor.rows(), batch.factor.rows());
        for (a, b) in body(&kept).iter().zip(body(&batch)) {
            // Other merges in another order: rounding alone, far below the condition number times ε.
            assert!((a.value - b.value).abs() < 1e-9 * b.u95.max(1e-3), "{a:?} {b:?}");
            assert!((a.u95 / b.u95 - 1.0).abs() < 1e-9, "{a:?} {b:?}");
        }
    }
}

#[test]
fn noise_that_nobody_states_is_read_off_the_readings() {
    let config = RigConfig::thesis_horizontal();
    let readings = Readings::new(&config, &thesis_program(&config.geometry, 40.0), 1000.0).unwrap();
    let found = imu_noise(None, &input(&config, readings.measured(3)).readings);
    let imu = &config.sensors.imu;
    let largest = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
    // Band limits of the sensor make differences smaller, the motion makes them larger: a factor of two does.
    for (found, stated) in
        [(found.accel, largest(imu.accel_noise_mps2)), (found.gyro, largest(imu.gyro_noise_radps))]
    {
        assert!(found > 0.5 * stated && found < 2.0 * stated, "{found} {stated}");
    }
    // A statement that the readings belie does not count.
    let stated =
        ImuTable { gyro_noise_radps: Some(1e-5), accel_noise_mps2: Some(1.0), ..ImuTable::default() };
    let held = imu_noise(Some(&stated), &input(&config, readings.measured(3)).readings);
    assert!((held.gyro, held.accel) == (found.gyro, 1.0), "{held:?}");
    let unknown = imu_noise(None, &[]);
    assert!(unknown.accel > 0.0 && unknown.gyro > 0.0);
}

#[test]
fn options_that_exclude_each_other_are_refused() {
    let said = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_rigident")).args(arguments).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, text) = said(&["demo", "--forget", "10", "--window", "10"]);
    assert!(code == Some(2) && text.contains("cannot be used with"), "{text}");
    let (code, text) = said(&["demo", "--window", "0.01"]);
    assert!(code == Some(2) && text.contains("--window 0.01: shorter than the filter"), "{text}");
}
