extern crate std;

use std::boxed::Box;
use std::vec::Vec;

use nalgebra::Vector3;

use super::*;
use crate::calibration::Reading;
use crate::conditioning::KernelError;
use crate::forgetting::{ImuNoise, Span};
use crate::inertia::{InertialParameters, tensor_from_elements};
use crate::random::Random;
use crate::spatial::{AngularRate, Imu, Position, Rotation, Sensor, SpecificForce, Wrench};

const TAPS: usize = 256;
/// Amplitude, frequency in hertz and phase of three sines per axis.
const RATE: [[(f64, f64, f64); 2]; 3] = [
    [(0.5, 0.31, 0.0), (0.4, 0.73, 1.0)],
    [(0.5, 0.41, 2.0), (0.35, 0.89, 0.5)],
    [(0.45, 0.23, 1.5), (0.4, 0.61, 3.0)],
];

/// Returns value and derivative of a sum of sines.
fn sines(terms: &[(f64, f64, f64)], t: f64) -> (f64, f64) {
    terms.iter().fold((0.0, 0.0), |(v, d), (a, f, p)| {
        let w = core::f64::consts::TAU * f;
        (v + a * (w * t + p).sin(), d + a * w * (w * t + p).cos())
    })
}

fn body() -> InertialParameters<Sensor, f64> {
    InertialParameters::from_centre_of_mass(
        20.0,
        Position::new(0.004, -0.002, 0.053),
        tensor_from_elements([0.3813, 0.0185, 0.3791, 0.001, -0.002, 0.003]),
    )
}

const OFFSET: [f64; 6] = [9.0, -1.0, 10.0, 0.4, -0.7, -0.15];

fn mounting<T: Scalar>() -> ImuMounting<T> {
    let f = T::from_f64_const;
    ImuMounting {
        rotation: Rotation::from_quaternion([f(0.5), f(-0.5), f(0.5), f(0.5)]).unwrap(),
        position: Position::new(f(0.01), f(-0.02), f(0.05)),
        accel_scale: [f(1.0), f(0.5), f(1.0)],
        accel_bias: SpecificForce::new(f(0.0), f(0.1), f(0.0)),
        gyro_bias: AngularRate::new(f(0.01), f(0.0), f(-0.02)),
    }
}

/// Returns a reading at time t by Newton and Euler about the centre of mass; specific force of a platform
/// that sways.
fn reading(t: f64) -> Reading<f64> {
    let [wx, wy, wz] = RATE.map(|terms| sines(&terms, t));
    let omega = Vector3::new(wx.0, wy.0, wz.0);
    let alpha = Vector3::new(wx.1, wy.1, wz.1);
    let a = Vector3::new(3.0 * (1.7 * t).sin(), 2.5 * (1.1 * t).cos(), 9.0 + 0.5 * (2.3 * t).sin());
    let body = body();
    let c = body.centre_of_mass().vector();
    let inertia = body.inertia_com();
    let force = (a + alpha.cross(&c) + omega.cross(&omega.cross(&c))) * body.mass;
    let moment = inertia * alpha + omega.cross(&(inertia * omega)) + c.cross(&force);
    let m: ImuMounting<f64> = mounting();
    let p = m.position.vector();
    let at_imu = a + alpha.cross(&p) + omega.cross(&omega.cross(&p));
    let to_imu: Rotation<Imu, Sensor, f64> = m.rotation.inverse();
    let [ax, ay, az] =
        (to_imu * SpecificForce::<Sensor, f64>::from_array(at_imu.into()) + m.accel_bias).array();
    let [sx, sy, sz] = m.accel_scale;
    Reading {
        time_ns: (t * 1e9).round() as u64,
        wrench: Wrench::from_array(core::array::from_fn(|i| {
            OFFSET[i] + if i < 3 { force[i] } else { moment[i - 3] }
        })),
        specific_force: SpecificForce::new(ax / sx, ay / sy, az / sz),
        angular_rate: to_imu * AngularRate::<Sensor, f64>::from_array(omega.into()) + m.gyro_bias,
    }
}

fn narrow(r: &Reading<f64>) -> Reading<f32> {
    Reading {
        time_ns: r.time_ns,
        wrench: Wrench::from_array(r.wrench.array().map(|v| v as f32)),
        specific_force: SpecificForce::from_array(r.specific_force.array().map(|v| v as f32)),
        angular_rate: AngularRate::from_array(r.angular_rate.array().map(|v| v as f32)),
    }
}

fn config<T: Scalar>(rate_hz: f64, known: bool) -> EstimatorConfig<T> {
    let f = T::from_f64_const;
    EstimatorConfig {
        rate_hz: f(rate_hz),
        filter_width_s: f(0.1),
        row_every: (rate_hz / 100.0) as u16,
        channel_sigma: [f(5.05), f(5.05), f(10.1), f(0.383), f(0.459), f(0.459)],
        known_offset: if known { OFFSET.map(f) } else { [f(0.0); 6] },
        mounting: mounting(),
        limits: Limits::none(),
    }
}

/// Returns the relative errors of m, of m·c (against m·|c|) and of I (Frobenius).
fn errors(phi: &[f64]) -> [f64; 3] {
    let truth = body();
    let est = InertialParameters::<Sensor, f64>::from_vector(core::array::from_fn(|j| phi[j]));
    [
        (est.mass - truth.mass).abs() / truth.mass,
        (est.first_moment - truth.first_moment).norm() / truth.first_moment.norm(),
        (est.inertia - truth.inertia).norm() / truth.inertia.norm(),
    ]
}

fn run<const N: usize>(rate_hz: f64) -> ([f64; 3], [f64; 3]) {
    let known = N == 10;
    let mut wide = Estimator::<f64, N, TAPS>::new(&config(rate_hz, known)).unwrap();
    let mut single = Estimator::<f32, N, TAPS>::new(&config(rate_hz, known)).unwrap();
    for n in 0..(rate_hz * 30.0) as u32 {
        let r = reading(f64::from(n) / rate_hz);
        wide.absorb(&r);
        single.absorb(&narrow(&r));
    }
    assert_eq!(wide.counters().gaps, 0);
    assert!(wide.counters().blocks > 2900);
    let wide = wide.factor().solve();
    assert!(wide.determined.iter().all(|d| *d));
    (errors(&wide.estimate), errors(&single.factor().solve().estimate.map(f64::from)))
}

/// Noise-free: f64 to 1e-6 and f32 to 1e-4 in mass, first moment and tensor, at both rates, with the offset
/// known and estimated.
#[test]
fn a_body_without_noise_is_recovered() {
    for (wide, single) in [run::<10>(200.0), run::<16>(200.0), run::<10>(1000.0), run::<16>(1000.0)] {
        assert!(wide.iter().all(|e| *e < 1e-6), "{wide:?}");
        assert!(single.iter().all(|e| *e < 1e-4), "{single:?}");
    }
}

#[test]
fn a_rejected_reading_leaves_no_trace_in_the_rows_around_it() {
    let mut estimator = Estimator::<f64, 16, TAPS>::new(&config(1000.0, false)).unwrap();
    for n in 0..10_000_u32 {
        let mut r = reading(f64::from(n) / 1000.0);
        if n % 997 == 0 {
            r.wrench = Wrench::from_array([f64::NAN; 6]);
        } else if n % 1499 == 0 {
            // Missing altogether.
            continue;
        }
        estimator.absorb(&r);
    }
    assert_eq!(estimator.counters().rejected, 11);
    assert_eq!(estimator.counters().gaps, 6);
    assert_eq!(estimator.counters().last_rejection, Some(Rejection::NotFinite(0)));
    let solution = estimator.factor().solve();
    assert!(errors(&solution.estimate).iter().all(|e| *e < 1e-6));
}

#[test]
fn still_rows_give_mass_centre_and_offset_and_no_tensor() {
    let mut estimator = Estimator::<f64, 16, 1>::new(&EstimatorConfig {
        filter_width_s: 0.0,
        row_every: 1,
        mounting: ImuMounting::default(),
        ..config(1.0, false)
    })
    .unwrap();
    let body = body();
    let c = body.centre_of_mass().vector();
    for k in 0..24 {
        let (azimuth, tilt) = (f64::from(k) * 0.9, f64::from(k) * 0.13);
        let a = Vector3::new(tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos()) * 9.80665;
        let force = a * body.mass;
        let moment = c.cross(&force);
        let outcome = estimator.absorb(&Reading {
            time_ns: 0,
            wrench: Wrench::from_array(core::array::from_fn(|i| {
                OFFSET[i] + if i < 3 { force[i] } else { moment[i - 3] }
            })),
            specific_force: SpecificForce::from_array(a.into()),
            angular_rate: AngularRate::zero(),
        });
        assert_eq!(outcome, Outcome::Absorbed);
    }
    let solution = estimator.factor().solve();
    for j in 0..16 {
        assert_eq!(solution.determined[j], !(4..10).contains(&j), "parameter {j}");
    }
    assert!((solution.estimate[0] - 20.0).abs() < 1e-12);
    assert!((solution.estimate[3] - 20.0 * 0.053).abs() < 1e-13);
    assert!((solution.estimate[10] - OFFSET[0]).abs() < 1e-12);
}

#[test]
fn impossible_settings_are_named() {
    let good = config::<f32>(1000.0, true);
    let made = |c: &EstimatorConfig<f32>| Estimator::<f32, 10, TAPS>::new(c).map(|_| ());
    assert_eq!(made(&good), Ok(()));
    let mut bad = good;
    bad.channel_sigma[2] = 0.0;
    assert_eq!(made(&bad), Err(ConfigError::Sigma(2)));
    let bad = EstimatorConfig { filter_width_s: 10.0, ..good };
    assert_eq!(made(&bad), Err(ConfigError::Kernel(KernelError::TooManyTaps(1999))));
    let bad = EstimatorConfig { row_every: 0, ..good };
    assert_eq!(made(&bad), Err(ConfigError::Kernel(KernelError::Invalid)));
}

fn memory<T: Scalar>(span: Span<T>) -> MemoryConfig<T> {
    MemoryConfig {
        span,
        imu_noise: ImuNoise { accel: T::from_f64_const(0.02), gyro: T::from_f64_const(2e-3) },
    }
}

#[test]
fn an_endless_memory_keeps_the_whole_factor() {
    let mut forever = Estimator::<f64, 16, TAPS>::new(&config(200.0, false)).unwrap();
    let mut endless = forever;
    endless.set_memory(&memory(Span::TimeConstant(1e30))).unwrap();
    let mut wide = forever;
    wide.set_memory(&memory(Span::Window(1e4))).unwrap();
    // Segments that nobody puts into the memory are not lost.
    let mut left_alone = endless;
    for n in 0..4000_u32 {
        let r = reading(f64::from(n) / 200.0);
        forever.absorb(&r);
        left_alone.absorb(&r);
        for remembering in [&mut endless, &mut wide] {
            remembering.absorb(&r);
            remembering.remember(0.0);
        }
    }
    let whole = forever.factor();
    let scale = whole.r()[0][0];
    for other in [&endless, &wide, &left_alone] {
        let kept = other.factor();
        assert_eq!(kept.rows(), whole.rows());
        for (a, b) in kept.entries().zip(whole.entries()) {
            // Merges in another order: some hundred roundings of the largest number.
            assert!((a - b).abs() < 1e3 * f64::EPSILON * scale, "{a} {b}");
        }
    }
    assert_eq!(endless.counters().blocks, forever.counters().blocks);
}

#[test]
fn a_look_is_at_the_remembered_rows() {
    let mut estimator = Estimator::<f64, 16, TAPS>::new(&config(200.0, false)).unwrap();
    estimator.set_memory(&memory(Span::Window(5.0))).unwrap();
    let mut looks = 0;
    for n in 0..6000_u32 {
        estimator.absorb(&reading(f64::from(n) / 200.0));
        assert_eq!(estimator.look(6.0), None);
        let Some(deviations) = estimator.remember(6.0) else { continue };
        assert_eq!(deviations, estimator.factor().standard_deviations());
        looks += 1;
    }
    // A hundred blocks a second, in segments of fifty.
    assert!((57..=60).contains(&looks), "{looks}");
    let seconds = f64::from(estimator.factor().rows()) / 600.0;
    assert!((4.0..=5.0).contains(&seconds), "{seconds}");
    estimator.reset();
    assert!(estimator.remembers() && estimator.factor().rows() == 0);
}

#[test]
fn a_memory_that_does_not_fit_is_refused_and_changes_nothing() {
    let mut estimator = Estimator::<f32, 10, TAPS>::new(&config(200.0, true)).unwrap();
    for span in
        [Span::TimeConstant(0.05), Span::Window(0.05), Span::TimeConstant(f32::NAN), Span::Window(-1.0)]
    {
        assert_eq!(estimator.set_memory(&memory(span)), Err(ConfigError::Memory));
    }
    let deaf =
        MemoryConfig { imu_noise: ImuNoise { accel: f32::NAN, gyro: 0.0 }, ..memory(Span::Window(5.0)) };
    assert_eq!(estimator.set_memory(&deaf), Err(ConfigError::Memory));
    assert!(!estimator.remembers());
    let still = EstimatorConfig { filter_width_s: 0.0, row_every: 1, ..config(1.0, true) };
    let mut poses = Estimator::<f32, 10, TAPS>::new(&still).unwrap();
    assert_eq!(poses.set_memory(&memory(Span::Window(5.0))), Err(ConfigError::Memory));
}

/// Finds what the IMU's noise alone brings into the rows, by putting noise alone through the pipeline: the
/// reason for what counts as excited.
#[test]
fn noise_at_rest_is_no_excitation() {
    let noise = ImuNoise { accel: 0.02, gyro: 2e-3 };
    let mut random = Random(41);
    let mut estimator = Estimator::<f64, 10, TAPS>::new(&EstimatorConfig {
        mounting: ImuMounting { position: Position::new(0.06, -0.04, 0.02), ..ImuMounting::default() },
        ..config(200.0, false)
    })
    .unwrap();
    estimator.set_memory(&MemoryConfig { span: Span::TimeConstant(5.0), imu_noise: noise }).unwrap();
    for n in 0..40_000_u32 {
        let mut axes = |sigma: f64| core::array::from_fn(|_| sigma * random.normal());
        let reading = Reading {
            time_ns: u64::from(n) * 5_000_000,
            wrench: Wrench::from_array([0.0; 6]),
            specific_force: SpecificForce::from_array(axes(noise.accel)),
            angular_rate: AngularRate::from_array(axes(noise.gyro)),
        };
        estimator.absorb(&reading);
        estimator.remember(0.0);
        // Four hundred seconds free of gravity and still: no segment says anything.
        let since = estimator.counters().blocks % u32::from(estimator.segment_blocks().unwrap());
        assert_eq!(estimator.factor().rows() / 6, since, "{n}");
    }
}

/// At rest next to nothing is known of the body. What such a reference leaves unexplained must not pass for
/// noise later on, or no knock is ever large against it.
#[test]
fn a_knock_is_reported_after_a_run_that_began_at_rest() {
    for span in [Span::TimeConstant(1e6), Span::TimeConstant(10.0), Span::Window(10.0)] {
        let mut estimator = Estimator::<f64, 16, TAPS>::new(&config(200.0, false)).unwrap();
        estimator.set_memory(&memory(span)).unwrap();
        let sigma = estimator.config().channel_sigma;
        let mut random = Random(3);
        let mut noisy = |values: [f64; 6], sd: [f64; 6]| -> [f64; 6] {
            core::array::from_fn(|c| values[c] + sd[c] * random.normal())
        };
        for n in 0..6000_u32 {
            // Two seconds at rest, in steps as the platform sways.
            let mut r = reading((f64::from(n) / 200.0 - 2.0).max(0.0));
            r.time_ns = u64::from(n) * 5_000_000;
            if n < 400 {
                r.angular_rate = mounting().gyro_bias;
            }
            let [ax, ay, az] = r.specific_force.array();
            let [gx, gy, gz] = r.angular_rate.array();
            let imu = noisy([ax, ay, az, gx, gy, gz], [0.02, 0.02, 0.02, 2e-3, 2e-3, 2e-3]);
            r.specific_force = SpecificForce::new(imu[0], imu[1], imu[2]);
            r.angular_rate = AngularRate::new(imu[3], imu[4], imu[5]);
            let mut wrench = noisy(r.wrench.array(), sigma);
            if (4000..4020).contains(&n) {
                wrench[0] += 200.0;
            }
            r.wrench = Wrench::from_array(wrench);
            estimator.absorb(&r);
            estimator.remember(6.0);
            assert!(!(2000..4000).contains(&n) || estimator.counters().knocks == [0; 6], "{span:?} {n}");
        }
        // 0.1 s under a filter of 0.1 s, a hundred blocks a second.
        let [fx, others @ ..] = estimator.counters().knocks;
        assert!((10..=22).contains(&fx) && others == [0; 5], "{span:?}: {:?}", estimator.counters().knocks);
        let rms = estimator.channel_statistics().rms().unwrap();
        let kernel = estimator.kernel().noise_gain();
        for (rms, sigma) in rms.into_iter().zip(sigma) {
            assert!(rms < 2.0 * sigma * kernel.sqrt(), "{span:?}: {rms}");
        }
    }
}

/// Days at 1 kHz in single precision: a sum that stalls would leave residuals or uncertainties behind, a
/// counter that wraps its count. The same twenty seconds come again and again, so that the truth is known:
/// what double precision makes of ten and of twenty times. An hour after a change, 72 hours where
/// `RIGIDENT_NIGHTLY` is set.
#[test]
fn in_days_at_1_khz_no_sum_stalls_and_no_counter_wraps() {
    const RATE_HZ: f64 = 1000.0;
    const CYCLE: usize = 20_000;
    const FEW: u64 = 10;
    let hours = if std::env::var_os("RIGIDENT_NIGHTLY").is_some() { 72 } else { 1 };
    let cycles = hours * 180;
    let mut random = Random(5);
    let sigma = config::<f64>(RATE_HZ, false).channel_sigma;
    let rows: Vec<Reading<f64>> = (0..CYCLE)
        .map(|k| {
            let row = reading(k as f64 / RATE_HZ);
            let noise: [f64; 6] = core::array::from_fn(|i| sigma[i] * random.normal());
            let wrench = row.wrench.array();
            Reading { wrench: Wrench::from_array(core::array::from_fn(|i| wrench[i] + noise[i])), ..row }
        })
        .collect();
    let narrow_rows: Vec<Reading<f32>> = rows.iter().map(narrow).collect();
    let time_ns = |cycle: u64, k: usize| (cycle * CYCLE as u64 + k as u64) * 1_000_000;
    let mut wide = Box::new(Estimator::<f64, 16, TAPS>::new(&config(RATE_HZ, false)).unwrap());
    let [few, twice] = [0, 1].map(|part| {
        for cycle in part * FEW..(part + 1) * FEW {
            for (k, row) in rows.iter().enumerate() {
                wide.absorb(&Reading { time_ns: time_ns(cycle, k), ..*row });
            }
        }
        wide.factor()
    });
    // What the second ten cycles have added, every further ten add, too; the first one has no jump from an
    // end to a beginning.
    let more = (cycles - FEW) as f64 / FEW as f64;
    let expected = |first: f64, second: f64| first + more * (second - first);
    let mut device = Box::new(Estimator::<f32, 16, TAPS>::new(&config(RATE_HZ, false)).unwrap());
    for cycle in 0..cycles {
        for (k, row) in narrow_rows.iter().enumerate() {
            device.absorb(&Reading { time_ns: time_ns(cycle, k), ..*row });
        }
    }
    let counters = device.counters();
    assert_eq!((u64::from(counters.readings), counters.gaps), (cycles * CYCLE as u64, 0));
    let device = device.factor();
    let close = |got: f64, first: f64, second: f64, most: f64| {
        let ratio = got / expected(first, second);
        assert!((ratio - 1.0).abs() < most, "{ratio}");
    };
    close(f64::from(device.rows()), f64::from(few.rows()), f64::from(twice.rows()), 1e-6);
    let squares = [few.residual_sum_of_squares(), twice.residual_sum_of_squares()];
    close(f64::from(device.residual_sum_of_squares()), squares[0], squares[1], 2e-3);
    let (few, twice, many) = (few.solve(), twice.solve(), device.solve());
    let weight = |sd: f64| 1.0 / (sd * sd);
    for j in 0..16 {
        let sd = [few.standard_deviation[j], twice.standard_deviation[j]];
        close(weight(f64::from(many.standard_deviation[j])), weight(sd[0]), weight(sd[1]), 5e-3);
        // What the first cycle lacks is worth less with every further one: the estimate goes as a constant
        // and a part by their number.
        let by_number = 2.0 * (few.estimate[j] - twice.estimate[j]);
        let limit = twice.estimate[j] - 0.5 * by_number;
        let expected = limit + by_number * FEW as f64 / cycles as f64;
        let off = (f64::from(many.estimate[j]) - expected).abs();
        // The digits that a triangle in single precision has at this condition.
        let norm = twice.estimate.iter().map(|v| v * v).sum::<f64>().sqrt();
        let digits = 20.0 * f64::from(f32::EPSILON) * twice.condition_number * norm;
        assert!(off < (0.1 * sd[1]).max(digits), "{j}: {off}, {} of {} cycles, {digits}", sd[1], 2 * FEW);
    }
}
