//! Errors of a rig that are larger than stated: named, with their size, and not blamed on one that the
//! recording cannot tell from another. The body's motion and its wrench are written out here.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::answer::contradictions;
use rigident::fit::{Fit, FitOptions, Silent, fit};
use rigident::rig::RigFile;
use rigident::rows::body::{BodySource, prepare};
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

const RATE_HZ: f64 = 200.0;
const G: f64 = 9.80665;
const MASS: f64 = 3.2;
const LEVER: [f64; 3] = [0.05, -0.02, 0.03];
/// The statements about the rig: all errors small.
const STATED: &str = "
[[imu]]
position_m = [0.05, -0.02, 0.03]
accel_noise_mps2 = 0.01
gyro_noise_radps = 5e-4
position_std_m = 0.001
rotation_std_rad = 0.003
skew_std_s = 0.0005
accel_bias_std_mps2 = 0.03
accel_gain_std = 0.001
accel_misalignment_std_rad = 0.001
gyro_bias_std_radps = 0.005
gyro_gain_std = 0.001
[load_cell]
noise_n_nm = [0.05, 0.05, 0.05, 0.002, 0.002, 0.002]
gain_uncertainty = [0.001, 0.001, 0.001, 0.001, 0.001, 0.001]
crosstalk_std = 0.0005
drift_std_n_nm = [0.05, 0.05, 0.05, 0.0025, 0.0025, 0.0025]
range_n_nm = [100, 100, 100, 5, 5, 5]
";
/// Nothing but place and noise is stated.
const DEFAULT: &str = "
[[imu]]
position_m = [0.05, -0.02, 0.03]
accel_noise_mps2 = 0.01
gyro_noise_radps = 5e-4
[load_cell]
noise_n_nm = [0.05, 0.05, 0.05, 0.002, 0.002, 0.002]
";

/// Errors of a rig.
#[derive(Clone, Copy)]
struct Errors {
    gyro_scale: f64,
    accel_scale: f64,
    gain: [f64; 6],
    /// Seconds at rest before the motion.
    rest_s: f64,
    /// The factor of the motion's frequencies.
    faster: f64,
    /// Noise of accelerometer and gyro, m/s² and rad/s.
    imu: [f64; 2],
}

const NONE: Errors =
    Errors { gyro_scale: 0.0, accel_scale: 0.0, gain: [0.0; 6], rest_s: 0.0, faster: 1.0, imu: [0.01, 5e-4] };

/// Returns attitude and body rate at a time: three angles, each a sum of three sines from 0.2 to 1.6 Hz. From
/// rest the acceleration begins without a jump.
fn motion(t: f64, faster: f64, from_rest: bool) -> (Rotation3<f64>, Vector3<f64>) {
    let (mut angles, mut rates) = ([0.0; 3], [0.0; 3]);
    let (u, by) = if from_rest { (t * t / (t + 0.5), t * (t + 1.0) / (t + 0.5).powi(2)) } else { (t, 1.0) };
    for (i, (angle, rate)) in angles.iter_mut().zip(&mut rates).enumerate() {
        for k in 0..3 {
            let w = faster * std::f64::consts::TAU * (0.25 + 0.11 * i as f64 + 0.5 * k as f64);
            *angle += 0.12 * (1.0 - (w * u).cos());
            *rate += 0.12 * w * by * (w * u).sin();
        }
    }
    let [r, p, y] = angles;
    let [r1, p1, y1] = rates;
    let ((sr, cr), (sp, cp)) = (r.sin_cos(), p.sin_cos());
    let rate = Vector3::new(r1 - y1 * sp, p1 * cr + y1 * cp * sr, -p1 * sr + y1 * cp * cr);
    (Rotation3::from_euler_angles(r, p, y), rate)
}

/// Returns the centre of mass, and the tensor about the origin.
fn body() -> (Vector3<f64>, Matrix3<f64>) {
    let com = Vector3::new(0.0, 0.01, 0.053);
    let central = Matrix3::new(0.021, 0.0002, -0.0003, 0.0002, 0.017, 0.0004, -0.0003, 0.0004, 0.012);
    (com, central + MASS * (Matrix3::identity() * com.norm_squared() - com * com.transpose()))
}

/// Returns twenty seconds of readings with these errors, by Newton and Euler.
fn readings(errors: &Errors, seed: u64) -> Vec<Reading<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sigma: f64| {
        let unit: f64 = StandardNormal.sample(&mut random);
        sigma * unit
    };
    let (com, inertia) = body();
    let motion = |t: f64| motion(t, errors.faster, errors.rest_s > 0.0);
    let offset = [1.5, -0.8, 2.0, 0.05, -0.03, 0.02];
    let mut all = Vec::new();
    for n in 0..(20.0 * RATE_HZ) as u64 {
        let t = (n as f64 / RATE_HZ - errors.rest_s).max(0.0);
        let (attitude, rate) = motion(t);
        let h = 1e-5;
        let gained = (motion(t + h).1 - motion((t - h).max(0.0)).1) / (t + h - (t - h).max(0.0));
        let gained = if t > 0.0 { gained } else { Vector3::zeros() };
        let force = attitude.inverse() * Vector3::new(0.0, 0.0, G);
        let pressed = |at: Vector3<f64>| gained.cross(&at) + rate.cross(&rate.cross(&at));
        let push = MASS * (force + pressed(com));
        let moment = MASS * com.cross(&force) + inertia * gained + rate.cross(&(inertia * rate));
        let exact = [push.x, push.y, push.z, moment.x, moment.y, moment.z];
        let read = (force + pressed(Vector3::from(LEVER))) * (1.0 + errors.accel_scale);
        let turned = rate * (1.0 + errors.gyro_scale);
        let wrench = std::array::from_fn(|c| {
            exact[c] * (1.0 + errors.gain[c]) + offset[c] + noise(if c < 3 { 0.05 } else { 0.002 })
        });
        all.push(Reading {
            time_ns: n * 5_000_000,
            wrench: Wrench::from_array(wrench),
            specific_force: SpecificForce::from_array(std::array::from_fn(|k| {
                read[k] + noise(errors.imu[0])
            })),
            angular_rate: AngularRate::from_array(std::array::from_fn(|k| turned[k] + noise(errors.imu[1]))),
        });
    }
    all
}

fn identified(rig: &str, errors: &Errors, seed: u64) -> Fit {
    fitted(rig, readings(errors, seed))
}

fn fitted(rig: &str, readings: Vec<Reading<f64>>) -> Fit {
    let rig = RigFile::parse(rig).unwrap();
    let input = prepare::input(&rig, readings, false, RATE_HZ);
    let source = BodySource::new(input, rig.imu.first());
    fit(&source, &FitOptions::default(), &Silent).unwrap()
}

/// A size as a sentence tells it: value, U95, standard deviations, and the standard deviation that these are
/// of.
fn size(said: &str, name: &str) -> [f64; 4] {
    let after = said.split_once(name).unwrap_or_else(|| panic!("{name} in {said}")).1;
    let number = |text: &str| -> f64 {
        let words = text.trim_start_matches([' ', ',']).split([' ', ',', ';']);
        words.into_iter().find_map(|word| word.parse().ok()).unwrap_or_else(|| panic!("{text}"))
    };
    let (u95, of) = (after.split_once('±').unwrap().1, after.split_once("standard deviations of").unwrap().1);
    [number(after), number(u95), number(u95.split_once(", ").unwrap().1), number(of)]
}

/// Checks that the sentence gives the true size, and that its figures belong together.
fn check_size(said: &str, name: &str, truth: f64) {
    let [value, u95, deviations, sd] = size(said, name);
    // Two in a thousand are farther off.
    assert!(
        (value - truth).abs() < 1.6 * u95 && u95 < 0.5 * truth.abs(),
        "{name}: {value} ± {u95} for {truth}"
    );
    // Two digits are printed.
    assert!((deviations * sd / value.abs() - 1.0).abs() < 0.06, "{said}");
}

#[test]
fn an_error_larger_than_stated_is_named_with_its_size() {
    assert_eq!(contradictions(&identified(STATED, &NONE, 1)), Vec::<String>::new());
    let gyro = contradictions(&identified(STATED, &Errors { gyro_scale: 0.02, ..NONE }, 2));
    // The error that all three axes share, not the share of each that is left beside what is stated.
    check_size(&gyro[0], "gyro_scale_x, gyro_scale_y, gyro_scale_z alike", 0.02);
    let gain = [0.0, 0.0, 0.0, 0.01, 0.0, 0.0];
    let moment = contradictions(&identified(STATED, &Errors { gain, ..NONE }, 3));
    check_size(&moment[0], "gain_mx", 0.01);
}

/// At rest in one attitude |g| is 2 % too large: the accelerometer's bias, its scale or gravity. The sensor
/// is good to a percent, and gravity to a tenth of that.
#[test]
fn errors_that_cannot_be_distinguished_are_all_named_the_likeliest_first() {
    let errors = Errors { accel_scale: 0.02, rest_s: 4.0, ..NONE };
    let said = contradictions(&identified(DEFAULT, &errors, 4));
    assert_eq!(said.len(), 1, "{said:?}");
    check_size(&said[0], "accelerometer_bias_z", 0.02 * G);
    check_size(&said[0], "accelerometer_scale_x, accelerometer_scale_y, accelerometer_scale_z alike", 0.02);
    let after = said[0].split_once(": ").unwrap().1;
    let place = |name: &str| after.find(name).unwrap_or(usize::MAX);
    assert!(
        place("accelerometer_bias_z") < place("gravity") && place("accelerometer_scale_x") < place("gravity")
    );
    // Gravity from a table is not to blame.
    let local = format!("[recording]\ngravity_mps2 = 9.80665\ngravity_std_mps2 = 5e-4\n{DEFAULT}");
    let said = contradictions(&identified(&local, &errors, 4));
    assert!(said[0].contains("accelerometer_bias_z") && !said[0].contains("gravity"), "{said:?}");
}

/// Returns still poses of the body, whose fz drifts by the given number of newtons from the first to the
/// last.
fn poses(count: u32, drift_n: f64, seed: u64) -> Vec<Reading<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let com = Vector3::new(0.0, 0.01, 0.053);
    let one = |k: u32| {
        let axis = Vector3::from_fn(|_, _| normal());
        let force = Rotation3::new(axis) * Vector3::new(0.0, 0.0, G);
        let push = MASS * force;
        let moment = com.cross(&push);
        let drift = drift_n * f64::from(k) / f64::from(count - 1);
        let exact = [push.x, push.y, push.z + drift, moment.x, moment.y, moment.z];
        Reading {
            time_ns: u64::from(k) * 1_000_000_000,
            wrench: Wrench::from_array(std::array::from_fn(|c| {
                exact[c] + if c < 3 { 0.05 } else { 0.002 } * normal()
            })),
            specific_force: SpecificForce::from_array(std::array::from_fn(|k| force[k] + 5e-3 * normal())),
            angular_rate: AngularRate::from_array([0.0; 3]),
        }
    };
    (0..count).map(one).collect()
}

fn identified_poses(drift_n: f64, seed: u64) -> Fit {
    let rig = RigFile::parse("[recording]\nstatic = true\n").unwrap();
    let input = prepare::input(&rig, poses(24, drift_n, seed), true, 1.0);
    let source = BodySource::new(input, rig.imu.first());
    fit(&source, &FitOptions::default(), &Silent).unwrap()
}

/// Nothing is stated of the load cell: neither its noise nor its class. What drifts may not make its own
/// tolerance larger.
#[test]
fn poses_that_drift_are_reported_whatever_the_drift() {
    let tolerance = |found: &Fit| {
        let drift = found.nuisances.iter().find(|k| k.nuisance.name == "drift_line_fz").unwrap();
        drift.nuisance.sigma
    };
    let honest: Vec<Fit> = (0..20).map(|seed| identified_poses(0.0, seed)).collect();
    for found in &honest {
        assert!(found.lack_of_fit.pose_drift.is_empty() && contradictions(found).is_empty());
        // One per cent of the weight.
        assert!((tolerance(found) / (0.01 * MASS * G / 3_f64.sqrt()) - 1.0).abs() < 0.1);
    }
    for drift_n in [5.0, 20.0] {
        for (seed, before) in honest.iter().enumerate() {
            let found = identified_poses(drift_n, seed as u64);
            let drifts = found.lack_of_fit.pose_drift.iter().any(|drift| drift.channel == 2);
            assert!(drifts || !contradictions(&found).is_empty(), "{drift_n} N, {seed}");
            // Half of the drift, as a share of the weight, at most.
            assert!(tolerance(&found) < (1.0 + 0.6 * drift_n / (MASS * G)) * tolerance(before));
        }
    }
}

/// Noise that is stated thirty times too large or too small is reported with both figures, whatever the
/// sensor, and nothing of the honest.
#[test]
fn noise_stated_far_from_that_of_readings_is_reported_with_both_figures() {
    let warnings = |rig: &str| {
        let found = identified(rig, &NONE, 5);
        (rigident::answer::Answer::new(&found, rigident::answer::Context::default()).unwrap().warnings, found)
    };
    let (said, honest) = warnings(STATED);
    assert!(said.is_empty(), "{said:?}");
    assert_eq!(honest.stated_noise.len(), 8);
    for noise in &honest.stated_noise {
        // Ninety-five per cent of four thousand differences that overlap: some per cent.
        assert!((noise.found / noise.stated - 1.0).abs() < 0.1, "{noise:?}");
    }
    for (line, wrong, name, figures) in [
        ("accel_noise_mps2 = 0.01", "accel_noise_mps2 = 0.3", "accelerometer", ["0.3", "0.01"]),
        ("accel_noise_mps2 = 0.01", "accel_noise_mps2 = 3e-4", "accelerometer", ["0.0003", "0.01"]),
        ("gyro_noise_radps = 5e-4", "gyro_noise_radps = 0.015", "gyro", ["0.015", "0.0005"]),
        ("gyro_noise_radps = 5e-4", "gyro_noise_radps = 1.5e-5", "gyro", ["0.000015", "0.0005"]),
        ("[0.05, 0.05, 0.05, 0.002", "[0.05, 0.05, 1.5, 0.002", "fz", ["1.5", "0.05"]),
        ("[0.05, 0.05, 0.05, 0.002", "[0.05, 0.05, 0.0015, 0.002", "fz", ["0.0015", "0.05"]),
    ] {
        let (said, found) = warnings(&STATED.replacen(line, wrong, 1));
        let off: Vec<&str> =
            found.stated_noise.iter().filter(|n| n.far_off().is_some()).map(|n| n.name.as_str()).collect();
        assert_eq!(off, [name]);
        let sentence = said.iter().find(|said| said.starts_with(name)).unwrap_or_else(|| panic!("{said:?}"));
        let words: Vec<&str> = sentence.split([' ', ',']).collect();
        assert!(words.contains(&figures[0]), "{sentence}");
        let near = |word: &&str| {
            word.parse::<f64>().is_ok_and(|v| (v / figures[1].parse::<f64>().unwrap() - 1.0).abs() < 0.1)
        };
        assert!(words.iter().any(near), "{sentence}");
    }
}

/// Recordings that begin with rest, and ones of slow motion, with IMUs from good to poor, noise stated or
/// not: nothing is accused, and what is determined is right. An interval of 95 % is left by more than its
/// double once in ten thousand.
#[test]
fn honest_recordings_with_noisy_imus_are_neither_accused_nor_wrong() {
    let (com, inertia) = body();
    let mc = com * MASS;
    let truth = [
        MASS,
        mc.x,
        mc.y,
        mc.z,
        inertia[(0, 0)],
        inertia[(1, 1)],
        inertia[(2, 2)],
        inertia[(1, 2)],
        inertia[(2, 0)],
        inertia[(0, 1)],
    ];
    for imu in [[0.01, 5e-4], [0.03, 2e-3], [0.1, 6e-3], [0.3, 0.02]] {
        for (rest_s, faster) in [(8.0, 1.0), (0.0, 0.1)] {
            for is_stated in [true, false] {
                let errors = Errors { imu, rest_s, faster, ..NONE };
                let stated = format!("accel_noise_mps2 = {}\ngyro_noise_radps = {}\n", imu[0], imu[1]);
                let rig = DEFAULT.replace("accel_noise_mps2 = 0.01\ngyro_noise_radps = 5e-4\n", &stated);
                let rig =
                    if is_stated { rig } else { "[[imu]]\nposition_m = [0.05, -0.02, 0.03]\n".to_owned() };
                let fit = identified(&rig, &errors, 11);
                let said = format!("IMU {imu:?}, rest {rest_s}, stated {is_stated}: {:?}", fit.lack_of_fit);
                assert!(!fit.lack_of_fit.contradicts(), "{said}");
                assert_eq!(contradictions(&fit), Vec::<String>::new(), "{said}");
                for (j, truth) in truth.iter().enumerate() {
                    let Some(found) = fit.estimate.measured(j) else { continue };
                    let off = (found.value - truth).abs() / found.u95;
                    assert!(off < 2.0, "{said}, parameter {j}: {found:?}, {truth}");
                }
                assert!(fit.estimate.measured(0).is_some_and(|m| m.u95 < 0.05 * MASS), "{said}");
            }
        }
    }
}

/// Readings with noise of the load cell that is exponentially correlated, of time constants from 0.04 to 20 s
/// an octave apart: 1/f, of this standard deviation in all.
fn with_flicker(mut readings: Vec<Reading<f64>>, sigma: [f64; 6], seed: u64) -> Vec<Reading<f64>> {
    const OCTAVES: i32 = 10;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let kept = |octave: i32| (-1.0 / (0.04 * 2f64.powi(octave) * RATE_HZ)).exp();
    let mut state = [[0.0; 6]; OCTAVES as usize];
    for (n, reading) in readings.iter_mut().enumerate() {
        let mut wrench = reading.wrench.array();
        for (octave, state) in (0..OCTAVES).zip(&mut state) {
            let kept = if n == 0 { 0.0 } else { kept(octave) };
            for (c, own) in state.iter_mut().enumerate() {
                let fresh: f64 = StandardNormal.sample(&mut random);
                *own = kept * *own + (1.0 - kept * kept).sqrt() * fresh;
                wrench[c] += sigma[c] * *own / f64::from(OCTAVES).sqrt();
            }
        }
        reading.wrench = Wrench::from_array(wrench);
    }
    readings
}

/// Slow motion, whose gyro tells little, beside a load cell with 1/f noise: the errors of the rig that such
/// noise resembles are not accused. A gyro that reads a tenth too little beside white noise still is.
#[test]
fn slow_noise_of_the_load_cell_accuses_no_error_of_the_rig() {
    let rig = "[[imu]]\nposition_m = [0.05, -0.02, 0.03]\n";
    for seed in 0..4 {
        let slow = Errors { faster: 0.25, ..NONE };
        let noisy = with_flicker(readings(&slow, seed), [0.1, 0.1, 0.1, 0.004, 0.004, 0.004], seed);
        let fit = fitted(rig, noisy);
        assert_eq!(contradictions(&fit), Vec::<String>::new(), "{seed}");
        assert!(!fit.lack_of_fit.contradicts(), "{seed}: {:?}", fit.lack_of_fit);
        let mass = fit.estimate.measured(0).unwrap();
        assert!((mass.value - MASS).abs() < 2.0 * mass.u95 && mass.u95 < 0.05 * MASS, "{seed}: {mass:?}");
    }
    let scaled = identified(rig, &Errors { gyro_scale: -0.1, ..NONE }, 1);
    assert!(contradictions(&scaled)[0].contains("gyro_scale"), "{:?}", contradictions(&scaled));
}
