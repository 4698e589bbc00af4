use hexapod::experiment::thesis_program;
use hexapod::{Axis, Geometry, Segment, SineTerm};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rigident_sim::rig::{ReadingRow, Readings, RigConfig};

use super::*;
use crate::study_length::runs;

const ALL: [Axis; 6] = [Axis::X, Axis::Y, Axis::Z, Axis::Roll, Axis::Pitch, Axis::Yaw];
/// Motions per kind.
const RUNS: u64 = 20;

fn uniform(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Sines of all six coordinates, as large and fast as the thesis' platform takes.
fn multisine(seed: u64) -> MotionProgram {
    let geometry = Geometry::thesis();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let slow = uniform(&mut random, 0.25, 1.2);
    let mut share = 1.0;
    loop {
        let terms = ALL
            .map(|axis| {
                let turns = matches!(axis, Axis::Roll | Axis::Pitch | Axis::Yaw);
                let amplitude = share
                    * if turns { uniform(&mut random, 0.1, 0.3) } else { uniform(&mut random, 0.02, 0.06) };
                let frequency_hz = slow * uniform(&mut random, 0.7, 1.6);
                SineTerm {
                    axis,
                    amplitude,
                    frequency_hz,
                    phase_rad: uniform(&mut random, 0.0, std::f64::consts::TAU),
                }
            })
            .to_vec();
        let segments = vec![
            Segment::Hold { duration_s: 0.8 },
            Segment::Multisine { duration_s: 8.0, ramp_s: 1.0, terms },
        ];
        let program = MotionProgram { start: geometry.home(), segments };
        if geometry.check(&program.trajectory().unwrap()).is_ok() {
            return program;
        }
        share *= 0.9;
    }
}

fn without(program: &MotionProgram, dead: Axis) -> MotionProgram {
    let mut program = program.clone();
    for segment in &mut program.segments {
        if let Segment::Multisine { terms, .. } = segment {
            terms.retain(|term| term.axis != dead);
        }
    }
    program
}

fn config(noise: f64) -> RigConfig {
    let mut config = RigConfig::thesis_horizontal();
    let imu = &mut config.sensors.imu;
    imu.accel_noise_mps2 = imu.accel_noise_mps2.map(|s| noise * s);
    imu.gyro_noise_radps = imu.gyro_noise_radps.map(|s| noise * s);
    config
}

fn read(config: &RigConfig, program: &MotionProgram, rate_hz: f64, seed: u64) -> Vec<ReadingRow> {
    Readings::new(config, program, rate_hz).unwrap().measured(seed).collect()
}

/// Returns when it was ended, and the words.
fn ended(
    program: &MotionProgram,
    config: &RigConfig,
    rows: &[ReadingRow],
    late_s: f64,
) -> Option<(f64, String)> {
    let sensors = config.payload().sensors().unwrap();
    let to_plate = config.payload().load_cell.rotation().unwrap() * sensors.imu_rotation();
    let mut guard = MotionGuard::new(sensors, to_plate, [0.0; 3], Axes::Each);
    guard.begins(program, Some(0.0)).unwrap();
    for row in rows {
        let time_s = row.time_ns as f64 * 1e-9;
        let [force, rate] = [row.specific_force, row.angular_rate].map(|v| v.map(|v| v as f32));
        if let Err(error) = guard.reading(time_s, time_s + late_s, &force, &rate) {
            return Some((time_s + late_s, error.to_string()));
        }
    }
    None
}

#[test]
fn a_plate_that_follows_is_never_ended() {
    for (noise, rate_hz) in [(1.0, 100.0), (1.0, 1000.0), (10.0, 200.0)] {
        let config = config(noise);
        for seed in 0..runs(RUNS, 5) {
            let whole = thesis_program(&config.geometry, 20.0 + seed as f64);
            let program = if seed % 5 == 0 { whole } else { multisine(seed) };
            let rows = read(&config, &program, rate_hz, seed);
            for late_s in [-0.08, 0.0, 0.1, 0.2] {
                let alarm = ended(&program, &config, &rows, late_s);
                assert_eq!(alarm, None, "noise {noise}, {rate_hz} Hz, motion {seed}, {late_s} s late");
            }
        }
    }
}

#[test]
fn an_axis_that_is_dead_is_named_within_half_a_second_of_its_motion() {
    let config = config(1.0);
    for (k, dead) in ALL.into_iter().enumerate().skip(3) {
        for seed in 0..RUNS {
            let program = multisine(seed);
            let rows = read(&config, &without(&program, dead), 200.0, seed);
            let (time_s, said) = ended(&program, &config, &rows, 0.05).unwrap();
            assert!(
                said.starts_with(&format!("{} of the plate", AXES[k])),
                "{dead:?}, motion {seed}: {said}"
            );
            // From when the axis is to turn by a tenth of a radian per second.
            let trajectory = program.trajectory().unwrap();
            let turns = |t: &f64| trajectory.state(*t).angular_rate[k - 3].abs() > 0.1;
            let begins_s = (0..2000).map(|i| 0.005 * f64::from(i)).find(turns).unwrap();
            assert!(time_s - 0.05 - begins_s < 0.5, "{dead:?}, motion {seed}: {time_s} s, {begins_s} s");
        }
    }
}

/// Accelerations of 2 m/s² among turns that are small.
#[test]
fn a_way_that_is_not_gone_is_named_where_it_is_felt() {
    let config = config(1.0);
    let home = config.geometry.home();
    for (k, dead) in ALL.into_iter().enumerate().take(3) {
        let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 1.0 };
        let turns = ALL.into_iter().skip(3).map(|axis| term(axis, 0.05, 0.7));
        let ways = ALL.into_iter().take(3).zip([1.0, 1.1, 1.2]).map(|(axis, hz)| term(axis, 0.05, hz));
        let terms = turns.chain(ways).collect();
        let segments = vec![
            Segment::Hold { duration_s: 0.8 },
            Segment::Multisine { duration_s: 6.0, ramp_s: 1.0, terms },
        ];
        let program = MotionProgram { start: home, segments };
        let rows = read(&config, &program, 200.0, 3);
        assert_eq!(ended(&program, &config, &rows, 0.0), None);
        let rows = read(&config, &without(&program, dead), 200.0, 3);
        let (time_s, said) = ended(&program, &config, &rows, 0.0).unwrap();
        assert!(said.starts_with(&format!("{} of the plate", AXES[k])) && time_s < 1.8, "{time_s}: {said}");
    }
}

#[test]
fn a_plate_that_stops_or_comes_late_is_reported_within_half_a_second() {
    let config = config(1.0);
    for seed in 0..RUNS {
        let program = multisine(seed);
        let mut rows = read(&config, &program, 200.0, seed);
        rows.truncate(800);
        let at = program.trajectory().unwrap().state(4.0).pose();
        let rest = MotionProgram { start: at, segments: vec![Segment::Hold { duration_s: 4.0 }] };
        let later = |row: ReadingRow| ReadingRow { time_ns: row.time_ns + 4_000_000_000, ..row };
        rows.extend(read(&config, &rest, 200.0, seed + 100).into_iter().map(later));
        let (time_s, said) = ended(&program, &config, &rows, 0.05).unwrap();
        assert!(time_s > 4.05 && time_s < 4.55, "motion {seed}: {time_s}");
        assert!(said.contains("is commanded to move") || said.contains("does not follow"), "{said}");

        let mut late = program.clone();
        late.segments.insert(0, Segment::Hold { duration_s: 0.5 });
        let (time_s, said) = ended(&program, &config, &read(&config, &late, 200.0, seed), 0.05).unwrap();
        assert!(time_s < 0.8 + 0.55, "motion {seed}: {time_s}: {said}");
    }
}

/// One that begins in time and falls behind: at four fifths of the speed.
#[test]
fn a_plate_that_falls_behind_is_reported_with_the_delay_or_the_axis() {
    let config = config(1.0);
    let home = config.geometry.home();
    let slower = |speed: f64| {
        let term = SineTerm { axis: Axis::Roll, amplitude: 0.2, frequency_hz: 0.5 * speed, phase_rad: 0.0 };
        let pitch = SineTerm { axis: Axis::Pitch, frequency_hz: 0.4 * speed, ..term };
        let segments = vec![Segment::Multisine { duration_s: 12.0, ramp_s: 1.0, terms: vec![term, pitch] }];
        MotionProgram { start: home, segments }
    };
    let rows = read(&config, &slower(0.8), 200.0, 1);
    let (time_s, said) = ended(&slower(1.0), &config, &rows, 0.0).unwrap();
    // A quarter of a second is reached after five quarters.
    assert!(time_s < 3.0, "{time_s}: {said}");
}

#[test]
fn the_platforms_own_reading_ends_it_when_it_is_far_off_and_not_when_it_is_late() {
    let config = config(1.0);
    let program = multisine(3);
    let trajectory = program.trajectory().unwrap();
    let sensors = config.payload().sensors().unwrap();
    let run = |late_s: f64, off_m: f64| {
        let mut guard = MotionGuard::new(sensors.clone(), Matrix3::identity(), [0.0; 3], Axes::Each);
        guard.begins(&program, Some(0.0)).unwrap();
        (0..160).map(|k| 0.05 * f64::from(k)).find_map(|time_s| {
            let mut measured = trajectory.state(time_s - late_s).pose();
            measured.position_m[2] -= if time_s > 3.0 { off_m } else { 0.0 };
            let sample =
                MotionSample { time_s, commanded: trajectory.state(time_s).pose(), measured: Some(measured) };
            guard.sample(&sample).err().map(|error| (time_s, error.to_string()))
        })
    };
    assert_eq!(run(0.2, 0.0), None);
    assert_eq!(run(0.0, 0.004), None);
    let (time_s, said) = run(0.1, 0.03).unwrap();
    assert!((3.2..3.5).contains(&time_s) && said.contains("own reading"), "{time_s}: {said}");
}
