extern crate std;
use std::vec::Vec;

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, SMatrix, Vector3};

use super::*;
use crate::estimator::{Estimator, Outcome};
use crate::inertia::{InertialParameters, tensor_from_elements};
use crate::random::Random;
use crate::screening::Limits;
use crate::spatial::{AngularRate, Position, Rotation, Sensor, SpecificForce, Wrench};

const TAPS: usize = 64;
const IMU: ImuNoise<f64> = ImuNoise { accel: 0.1, gyro: 0.004 };

fn config<T: Scalar>() -> EstimatorConfig<T> {
    let f = T::from_f64_const;
    EstimatorConfig {
        rate_hz: f(200.0),
        filter_width_s: f(0.1),
        row_every: 2,
        channel_sigma: [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015].map(f),
        known_offset: [f(0.0); 6],
        mounting: crate::calibration::ImuMounting {
            rotation: Rotation::from_quaternion([f(0.5), f(-0.5), f(0.5), f(0.5)]).unwrap(),
            position: Position::new(f(0.02), f(-0.03), f(0.05)),
            ..crate::calibration::ImuMounting::PERFECT
        },
        limits: Limits::none(),
    }
}

fn body() -> InertialParameters<Sensor, f64> {
    InertialParameters::from_centre_of_mass(
        3.2,
        Position::new(0.03, -0.02, 0.08),
        tensor_from_elements([0.02, 0.025, 0.015, 0.0015, -0.001, 0.002]),
    )
}

/// Returns a reading of two seconds of a sine about each axis and a swaying specific force, with noise.
fn reading(n: u32, random: &mut Random, noisy: bool) -> crate::calibration::Reading<f64> {
    let t = f64::from(n) / 200.0;
    let frequency = [4.0, 5.3, 6.1];
    let omega = Vector3::from(frequency.map(|w| 0.9 * (w * t).sin()));
    let alpha = Vector3::from(frequency.map(|w| 0.9 * w * (w * t).cos()));
    let a = Vector3::new(3.0 * (1.7 * t).sin(), 2.5 * (1.1 * t).cos(), 9.0 + 0.5 * (2.3 * t).sin());
    let body = body();
    let (c, inertia) = (body.centre_of_mass().vector(), body.inertia_com());
    let force = (a + alpha.cross(&c) + omega.cross(&omega.cross(&c))) * body.mass;
    let moment = inertia * alpha + omega.cross(&(inertia * omega)) + c.cross(&force);
    let mounting = config::<f64>().mounting;
    let p = mounting.position.vector();
    let at_imu = a + alpha.cross(&p) + omega.cross(&omega.cross(&p));
    let turn = mounting.rotation.matrix().transpose();
    let mut more = |v: f64, sigma: f64| if noisy { v + sigma * random.normal() } else { v };
    let (felt, rate) = (turn * at_imu, turn * omega);
    let sigma = config::<f64>().channel_sigma;
    let wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
    crate::calibration::Reading {
        time_ns: u64::from(n) * 5_000_000,
        wrench: Wrench::from_array(core::array::from_fn(|c| more(wrench[c], sigma[c]))),
        specific_force: SpecificForce::from_array([felt.x, felt.y, felt.z].map(|v| more(v, IMU.accel))),
        angular_rate: AngularRate::from_array([rate.x, rate.y, rate.z].map(|v| more(v, IMU.gyro))),
    }
}

/// Returns a whitening of the true parameters, finished at once.
fn of_truth(estimator: &Estimator<f64, 10, TAPS>) -> BodyNoise<f64> {
    let mut noise = estimator.noise;
    noise.begin_anew(&config(), &body().to_vector(), &[0.0; 10], 1);
    while noise.step(&config(), 1) != Refreshed::Done {}
    noise
}

fn estimator() -> Estimator<f64, 10, TAPS> {
    let mut estimator = Estimator::<f64, 10, TAPS>::new(&config()).unwrap();
    estimator.set_imu_noise(&IMU).unwrap();
    estimator
}

fn square(of: &Square<f64>) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| of[i][j])
}

/// `T Σ Tᵀ = 1` at frequency zero, and `T S Sᵀ Tᵀ` is diagonal with τ² of the poles.
#[test]
fn whitened_noise_is_white_and_rises_as_its_poles_say() {
    let noise = of_truth(&estimator());
    // Column k of T is columns[k].
    let t = Matrix6::from_fn(|c, k| noise.whitening.columns[k][c]);
    let white = t * square(&noise.refresh.white) * t.transpose();
    assert!((white / 2.0 - Matrix6::identity()).norm() < 1e-12, "a row counts for two samples: {white}");
    let slope = SMatrix::<f64, 6, 3>::from_fn(|c, k| noise.refresh.slope[k][c]);
    let rising = t * slope * slope.transpose() * t.transpose() / 2.0;
    for i in 0..6 {
        for j in 0..6 {
            // 2 τ over the period of the rows, 10 ms.
            let tau = if i == j && i < POLES { 0.005 * noise.whitening.poles[i] } else { 0.0 };
            assert!((rising[(i, j)] - tau * tau).abs() < 1e-12 * rising.norm(), "{i} {j}");
        }
    }
    assert!(noise.whitening.poles[0] > 1.0, "this gyro's noise is felt: {:?}", noise.whitening.poles);
}

/// The covariance of filtered residuals of the truth is what the rows are whitened by, times the filter's
/// gain; and the Gram matrix of noise alone is K. Noise alone goes through the pipeline, as everything is
/// linear but for the products.
#[test]
fn noise_alone_has_the_covariance_and_the_gram_matrix_that_are_reckoned_with() {
    let mut pipeline = estimator();
    let noise = of_truth(&pipeline);
    let (mut random, phi) = (Random(5), body().to_vector());
    let (mut covariance, mut blocks) = (Matrix6::zeros(), 0.0);
    let mut low_pass = crate::whitening::LowPass::NEW;
    let mut gram = SMatrix::<f64, 10, 10>::zeros();
    let passes = crate::whitening::Passes::of(&noise.whitening);
    for n in 0..400_000_u32 {
        let mut three = |sigma: f64| core::array::from_fn(|_| sigma * random.normal());
        let noisy = crate::calibration::Reading {
            time_ns: u64::from(n) * 5_000_000,
            wrench: Wrench::from_array([0.0; 6]),
            specific_force: SpecificForce::from_array(three(IMU.accel)),
            angular_rate: AngularRate::from_array(three(IMU.gyro)),
        };
        if pipeline.absorb(&noisy) != Outcome::Absorbed {
            continue;
        }
        let block = pipeline.last_block().unwrap();
        let mut error = nalgebra::Vector6::zeros();
        for (column, phi) in block.columns.iter().zip(phi) {
            error += nalgebra::Vector6::from(*column) * phi;
        }
        covariance += error * error.transpose();
        let rows: Vec<_> = block
            .columns
            .iter()
            .enumerate()
            .map(|(j, column)| {
                let mut column = noise.whitening.whiten(column);
                low_pass.pass(j, &passes, &mut column);
                nalgebra::Vector6::from(column)
            })
            .collect();
        low_pass.end();
        gram += SMatrix::<f64, 10, 10>::from_fn(|i, j| rows[i].dot(&rows[j]));
        blocks += 1.0;
    }
    let own = config::<f64>().channel_sigma.map(|s| s * s);
    let mut expected = square(&noise.covariance);
    (0..6).for_each(|c| expected[(c, c)] -= own[c]);
    let found = covariance / (blocks * noise.autocovariance[0][0]);
    let size = |i: usize, j: usize| (expected[(i, i)] * expected[(j, j)]).sqrt();
    let unit = SMatrix::<f64, 10, 10>::from_fn(|i, j| noise.unit.columns[j][i]);
    gram /= blocks;
    // Of 200 000 blocks, of which a quarter is independent: 0.5 % of chance, and four times that.
    for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
        assert!((found[(i, j)] - expected[(i, j)]).abs() < 0.02 * size(i, j), "covariance {i} {j}");
    }
    for (i, j) in (0..10).flat_map(|i| (0..10).map(move |j| (i, j))) {
        let size = (unit[(i, i)] * unit[(j, j)]).sqrt();
        let difference = gram[(i, j)] - unit[(i, j)];
        assert!(difference.abs() < 0.02 * size, "K {i} {j}: {} {}", gram[(i, j)], unit[(i, j)]);
    }
}

/// In f32 and in steps as `(RᵀR − K)⁻¹ Rᵀz` in f64 by normal equations, with the sandwich; for noise of a
/// tenth of the information. With more than half of a direction's, that direction is as uncertain as what was
/// found there.
#[test]
fn compensation_is_the_solution_of_the_compensated_normal_equations() {
    let mut random = Random(7);
    let mut factor = InformationFactor::<f64, 10>::new();
    for _ in 0..40 {
        let columns: [[f64; 6]; 10] = core::array::from_fn(|_| core::array::from_fn(|_| random.normal()));
        factor.absorb(&columns, &core::array::from_fn(|_| random.normal() + 2.0));
    }
    let r = DMatrix::from_fn(10, 10, |i, j| factor.r()[i][j]);
    let information = r.tr_mul(&r);
    let z = DVector::from_column_slice(factor.z());
    let half = DMatrix::from_fn(10, 10, |_, _| random.normal());
    let k = half.tr_mul(&half) * (0.1 * information.norm() / half.tr_mul(&half).norm());
    let gram =
        Gram::<f32, 10> { columns: core::array::from_fn(|j| core::array::from_fn(|i| k[(i, j)] as f32)) };
    let mut compensation = Compensation::<f32>::UNUSED;
    let mut compensated = |times: f32| -> InformationFactor<f32, 10> {
        compensation.begin(&factor.cast(|v| v as f32), &gram, times);
        while !compensation.step() {}
        compensation.factor()
    };
    let solved = compensated(1.0).solve();
    let inverse = Cholesky::new(&information - &k).unwrap().inverse();
    let estimate = &inverse * r.tr_mul(&z);
    let covariance = &inverse * &information * &inverse;
    for j in 0..10 {
        let sd = covariance[(j, j)].sqrt();
        assert!(
            (f64::from(solved.estimate[j]) - estimate[j]).abs() < 1e-4 * sd.max(estimate[j].abs()),
            "{j}"
        );
        assert!((f64::from(solved.standard_deviation[j]) / sd - 1.0).abs() < 1e-4, "{j}");
    }
    assert_eq!(compensated(0.0).solve().estimate, factor.cast(|v| v as f32).solve().estimate);
    // Ten times as much is more than there is in some direction.
    let filled = compensated(10.0).solve();
    assert!(filled.determined.iter().all(|d| *d));
    let (value, sd) = (filled.estimate, filled.standard_deviation);
    let least = |j: usize| 0.5 * f64::from(solved.standard_deviation[j]);
    assert!((0..10).all(|j| value[j].is_finite() && f64::from(sd[j]) > least(j)));
    assert!((0..10).any(|j| sd[j] > 2.0 * solved.standard_deviation[j]), "{sd:?}");
}

/// Noise of the IMU that is ten times the load cell's: the device's estimate is unbiased and its deviations
/// are right, in f32 and in f64 alike; a gap starts the low-passes anew.
#[test]
fn an_estimate_beside_the_imu_s_noise_is_calibrated() {
    let truth = body().to_vector();
    let (mut squares, mut runs) = ([0.0; 10], 0.0);
    for seed in 1..=20_u64 {
        let mut random = Random(1000 + seed);
        let mut single = Estimator::<f32, 10, TAPS>::new(&config()).unwrap();
        single.set_imu_noise(&ImuNoise { accel: IMU.accel as f32, gyro: IMU.gyro as f32 }).unwrap();
        let mut until_look = 50;
        for n in 0..4000_u32 {
            let r = reading(n, &mut random, true);
            if n == 2000 {
                continue;
            }
            let outcome = single.absorb(&crate::calibration::Reading {
                time_ns: r.time_ns,
                wrench: Wrench::from_array(r.wrench.array().map(|v| v as f32)),
                specific_force: SpecificForce::from_array(r.specific_force.array().map(|v| v as f32)),
                angular_rate: AngularRate::from_array(r.angular_rate.array().map(|v| v as f32)),
            });
            match outcome {
                Outcome::Absorbed => until_look -= i32::from(until_look > 0),
                _ if until_look == 0 && single.look(6.0).is_some() => until_look = 50,
                _ => {}
            }
        }
        assert!(single.noise.together && single.counters().gaps == 1);
        single.take_snapshot();
        while !single.fold() {}
        while !single.compensate() {}
        let solution = single.folded().solve();
        for j in 0..10 {
            let error = f64::from(solution.estimate[j]) - truth[j];
            squares[j] += (error / f64::from(solution.standard_deviation[j])).powi(2);
        }
        runs += 1.0;
    }
    for (j, square) in squares.iter().enumerate() {
        let ratio = square / runs;
        // χ² of 20 over 20: beyond 0.35 and 2.3 in two of a thousand.
        assert!((0.3..2.4).contains(&ratio), "parameter {j}: {ratio}");
    }
}

#[test]
fn without_noise_of_the_imu_nothing_changes() {
    let mut random = Random(3);
    let mut plain = Estimator::<f64, 10, TAPS>::new(&config()).unwrap();
    let mut noiseless = plain;
    noiseless.set_imu_noise(&ImuNoise { accel: 0.0, gyro: 0.0 }).unwrap();
    let mut small = plain;
    small.set_imu_noise(&ImuNoise { accel: 1e-5, gyro: 1e-7 }).unwrap();
    for n in 0..2000_u32 {
        let r = reading(n, &mut random, false);
        for estimator in [&mut plain, &mut noiseless, &mut small] {
            estimator.absorb(&r);
            if n % 100 == 99 {
                while estimator.look(0.0).is_none() {}
            }
        }
    }
    assert_eq!(plain.factor(), noiseless.factor());
    assert_eq!(
        plain.factor(),
        small.factor(),
        "below a hundredth of every channel's variance rows have its weight alone"
    );
    let refused = ImuNoise { accel: -1.0, gyro: 0.0 };
    assert_eq!(plain.set_imu_noise(&refused), Err(crate::estimator::ConfigError::ImuNoise));
}
