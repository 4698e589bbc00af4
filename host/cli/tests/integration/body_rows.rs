//! One body's compact form of its rows, the firmware's pipeline on filtered signals, against the rows
//! themselves, which know nothing of it: the same factor and the same conclusions.
//!
//! At 100 readings a second each has a row, and both filters are one; faster ones average neighbours in the
//! pipeline alone.

use std::ops::Range;

use nalgebra::{DMatrix, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::fit::{
    Channel, Factor, Filter, Fit, FitOptions, Nuisance, Parameter, RowSource, SampleRows, SignalNoise,
    Silent, Timing, fit,
};
use rigident::rig::{ImuTable, LoadCellClass, LoadCellTable};
use rigident::rows::body::{BodySource, Input, errors};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::forgetting::Span;
use rigident_shared::regressor::{self, SMOOTHED};
use rigident_shared::screening::{Limits, Rejection};
use rigident_shared::spatial::{AngularRate, Imu, Position, Rotation, Sensor, SpecificForce, Wrench};

const RATE_HZ: f64 = 100.0;

/// Attitude and place of the IMU where its errors are searched for.
const MOUNTED: ([f64; 4], [f64; 3]) = ([0.8, -0.3, 0.4, 0.2], [0.05, -0.03, 0.08]);

/// Returns the attitude of the IMU with a small turn about the axes of S on top.
fn mounted(turn: Vector3<f64>) -> Rotation<Sensor, Imu, f64> {
    let [w, x, y, z] = MOUNTED.0;
    let own = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let q = UnitQuaternion::from_scaled_axis(turn) * own;
    Rotation::from_quaternion([q.w, q.i, q.j, q.k]).unwrap()
}

/// Both sum the same numbers in another order: some hundred roundings of 1e-16 each, times the condition
/// number.
const ROUNDING: f64 = 1e-10;

/// The rows of one body without their compact form.
struct PlainRows(BodySource);

impl RowSource for PlainRows {
    fn parameters(&self) -> &[Parameter] {
        self.0.parameters()
    }

    fn channels(&self) -> &[Channel] {
        self.0.channels()
    }

    fn timing(&self) -> Timing {
        self.0.timing()
    }

    fn samples(&self) -> usize {
        self.0.samples()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        self.0.time_ns(sample)
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        self.0.rows(sample, rows)
    }

    fn nominal_sigma(&self) -> Vec<f64> {
        self.0.nominal_sigma()
    }

    fn signal_noise(&self) -> Vec<SignalNoise> {
        self.0.signal_noise()
    }

    fn with_signal_noise(
        &self,
        samples: Range<usize>,
        sigma: &[f64],
        seed: u64,
    ) -> Option<Box<dyn RowSource + '_>> {
        self.0.with_signal_noise(samples, sigma, seed)
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        self.0.nuisances()
    }

    /// The readings as they would be without the errors; those of the IMU's place are in the mounting.
    fn with_errors(&self, errors: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        let of = |first: usize| -> [f64; 3] { std::array::from_fn(|k| errors[first + k]) };
        let mut input = self.0.input().clone();
        let (before, mounting) = (input.mounting, &mut input.mounting);
        mounting.position = before.position + Position::from_array(of(0));
        mounting.rotation = mounted(Vector3::from(of(3)));
        let (gyro_bias, gyro_gain, turned, bias, gain) = (of(7), of(10), of(13), of(16), of(19));
        let [yx, zx, zy] = of(22);
        let turned = Rotation3::new(Vector3::from(turned));
        let all = &self.0.input().readings;
        let at = |k: usize| &all[k.min(all.len() - 1)];
        for (k, reading) in input.readings.iter_mut().enumerate() {
            // What it reads now it would have read later.
            let (earlier, later) = (at(k.saturating_sub(1)), at(k + 1));
            let late = |get: &dyn Fn(&Reading<f64>) -> [f64; 3]| -> [f64; 3] {
                let (a, b, now) = (get(earlier), get(later), get(&all[k]));
                std::array::from_fn(|i| now[i] + errors[6] * 0.5 * RATE_HZ * (b[i] - a[i]))
            };
            let rate = late(&|r| r.angular_rate.array());
            let rate = Vector3::from_fn(|i, _| rate[i] / (1.0 + gyro_gain[i]) - gyro_bias[i]);
            let rate = (turned * rate).into();
            let [ax, ay, az] = late(&|r| r.specific_force.array());
            let x = (ax - bias[0]) / (1.0 + gain[0]);
            let y = (ay - bias[1] - yx * x) / (1.0 + gain[1]);
            let z = (az - bias[2] - zx * x - zy * y) / (1.0 + gain[2]);
            reading.angular_rate = AngularRate::from_array(rate);
            reading.specific_force = SpecificForce::new(x, y, z);
        }
        Some(Box::new(Self(BodySource::new(input, None))))
    }

    fn rate_sigma(&self) -> f64 {
        self.0.rate_sigma()
    }

    fn coefficient_noise(&self, filter: &Filter, sigma: &[f64]) -> Option<Vec<f64>> {
        self.0.coefficient_noise(filter, sigma)
    }
}

/// Readings of a body of 2 kg, by its equation at angular rates and specific forces that are sums of sines,
/// with white noise of 0.5 N, 0.03 N m, 0.02 m/s² and 1e-3 rad/s.
fn readings(seconds: f64) -> Vec<Reading<f64>> {
    const PHI: [f64; 10] = [2.0, 0.02, -0.03, 0.1, 0.03, 0.02, 0.025, 1e-3, -2e-3, 3e-3];
    const OFFSET: [f64; 6] = [1.0, -2.0, 3.0, 0.1, 0.2, -0.3];
    let mut noise = Distribution::<f64>::sample_iter(StandardNormal, ChaCha8Rng::seed_from_u64(1));
    let mut noisy = |v: f64, sigma: f64| v + sigma * noise.next().unwrap();
    let wave = |t: f64, k: usize| {
        let w = 2.0 + 1.3 * k as f64;
        let phase = (7 * k) as f64;
        [(w * t + phase).sin(), w * (w * t + phase).cos()]
    };
    (0..(RATE_HZ * seconds) as usize)
        .map(|row| {
            let t = row as f64 / RATE_HZ;
            let turn: [[f64; 2]; 3] = std::array::from_fn(|k| wave(t, k));
            let rate = turn.map(|w| w[0]);
            let force = std::array::from_fn(|k| 6.0 * wave(t, 3 + k)[0] + [1.0, 2.0, 8.0][k]);
            let mut signals = regressor::signals(force, rate, [0.0; 6]);
            signals[SMOOTHED..].copy_from_slice(&turn.map(|w| w[1]));
            let block = regressor::block(&signals, &Position::zero());
            let wrench = std::array::from_fn(|c| {
                let exact: f64 = block.columns.iter().zip(PHI).map(|(column, phi)| column[c] * phi).sum();
                noisy(exact + OFFSET[c], if c < 3 { 0.5 } else { 0.03 })
            });
            Reading {
                time_ns: (t * 1e9).round() as u64,
                wrench: Wrench::from_array(wrench),
                specific_force: SpecificForce::from_array(force.map(|v| noisy(v, 0.02))),
                angular_rate: AngularRate::from_array(rate.map(|v| noisy(v, 1e-3))),
            }
        })
        .collect()
}

fn input(readings: Vec<Reading<f64>>) -> Input {
    Input {
        readings,
        is_static: false,
        rate_hz: RATE_HZ,
        mounting: ImuMounting::default(),
        channel_sigma: None,
        gyro_sigma: None,
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits { frozen_after: 50, ..Limits::none() },
    }
}

/// Rows are whitened alike and say the same: `RᵀR`, `Rᵀz` and the residual sum agree.
fn assert_same_factor(new: &Factor, old: &Factor) {
    let near = |a: &DMatrix<f64>, b: &DMatrix<f64>, what: &str| {
        for ((i, j), wanted) in
            (0..a.nrows()).flat_map(|i| (0..a.ncols()).map(move |j| (i, j))).map(|at| (at, b[at]))
        {
            let scale = if a.nrows() == a.ncols() { (b[(i, i)] * b[(j, j)]).sqrt() } else { b.abs().max() };
            assert!((a[(i, j)] - wanted).abs() <= ROUNDING * scale, "{what} {i} {j}: {} {wanted}", a[(i, j)]);
        }
    };
    let gram = |f: &Factor| f.r().tr_mul(&f.r());
    near(&gram(new), &gram(old), "RᵀR");
    let (a, b) = (new.solve(1e-10), old.solve(1e-10));
    assert_eq!(a.determined, b.determined);
    for (j, (x, y)) in a.estimate.iter().zip(&b.estimate).enumerate() {
        let sd = b.covariance[(j, j)].sqrt();
        assert!((x - y).abs() <= ROUNDING * y.abs() + 1e-7 * sd, "{j}: {x} {y} ± {sd}");
    }
    let (a, b) = (new.residual_sum_of_squares(), old.residual_sum_of_squares());
    assert!((a - b).abs() <= 1e-9 * b, "{a} {b}");
    assert_eq!(new.rows(), old.rows());
}

fn assert_same(new: &[f64], old: &[f64], what: &str) {
    assert_eq!(new.len(), old.len(), "{what}");
    for (a, b) in new.iter().zip(old) {
        assert!((a - b).abs() <= 1e-9 * b.abs(), "{what}: {new:?} {old:?}");
    }
}

fn assert_same_fit(new: &Fit, plain: &Fit) {
    assert_same_factor(&new.factor, &plain.factor);
    let of = |fit: &Fit, of: &dyn Fn(&rigident::fit::ChannelFit) -> f64| -> Vec<f64> {
        fit.channels.iter().map(of).collect()
    };
    let same = |get: &dyn Fn(&rigident::fit::ChannelFit) -> f64, what: &str| {
        assert_same(&of(new, get), &of(plain, get), what);
    };
    same(&|c| c.sigma, "sigma");
    same(&|c| c.residual_rms, "residual rms");
    same(&|c| c.measured_rms, "measured rms");
    same(&|c| f64::from(c.outliers), "outliers");
    for (a, b) in new.nuisances.iter().zip(&plain.nuisances) {
        assert!((a.value - b.value).abs() < 1e-9, "{}: {} {}", a.nuisance.name, a.value, b.value);
    }
    assert_same(&[new.noise.variance_ratio], &[plain.noise.variance_ratio], "variance ratio");
    assert_same(&[new.spurious_information], &[plain.spurious_information], "information");
    let (a, b) = (&new.counts, &plain.counts);
    assert_eq!((a.samples, a.rejected, a.gaps, a.blocks), (b.samples, b.rejected, b.gaps, b.blocks));
    assert_eq!(new.inflation.len(), plain.inflation.len());
    for (a, b) in new.inflation.iter().zip(&plain.inflation) {
        assert!((a / b - 1.0).abs() < 1e-8, "inflation: {a} {b}");
    }
    let n = new.parameters.len();
    for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
        let (a, b) = (new.estimate.covariance(i, j), plain.estimate.covariance(i, j));
        let sd = |k: usize| plain.estimate.covariance(k, k).unwrap_or(0.0).sqrt();
        assert!((a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs() <= 1e-8 * sd(i) * sd(j), "{i} {j}: {a:?} {b:?}");
    }
    assert!((new.estimate.coverage_factor() / plain.estimate.coverage_factor() - 1.0).abs() < 1e-12);
    assert_eq!(new.convergence.len(), plain.convergence.len());
    for (new, plain) in new.convergence.iter().zip(&plain.convergence) {
        assert_eq!(new.time_s, plain.time_s);
        for (a, b) in new.parameters.iter().zip(&plain.parameters) {
            assert_eq!(a.is_some(), b.is_some());
            let (Some(a), Some(b)) = (a, b) else { continue };
            assert!((a.value - b.value).abs() < 1e-6 * b.u95 && (a.u95 / b.u95 - 1.0).abs() < 1e-6);
        }
    }
}

/// Fits both forms, which must agree, and returns the fit.
fn both(input: &Input, options: &FitOptions) -> Fit {
    let source = BodySource::new(input.clone(), None);
    let new = fit(&source, options, &Silent).unwrap();
    let plain = fit(&PlainRows(source), options, &Silent).unwrap();
    assert_same_fit(&new, &plain);
    new
}

#[test]
fn noise_from_the_residuals_and_noise_stated_too_small_with_a_known_offset() {
    let mut input = input(readings(60.0));
    let options = FitOptions { convergence_points: 20, ..FitOptions::default() };
    let found = both(&input, &options);
    input.channel_sigma = Some(std::array::from_fn(|c| 0.5 * found.channels[c].sigma));
    input.known_offset = Some([0.3, 0.2, -0.1, 0.01, 0.0, 0.02]);
    assert!(both(&input, &options).noise.variance_scale > 3.0);
}

#[test]
fn gain_errors() {
    let mut input = input(readings(30.0));
    input.nuisances = errors::of_cell(
        &LoadCellTable {
            class: Some(LoadCellClass::Exact),
            gain_uncertainty: Some([0.01, 0.01, 0.005, 0.01, 0.01, 0.0]),
            ..LoadCellTable::default()
        },
        input.readings.iter().map(|reading| reading.wrench.array()),
    );
    both(&input, &FitOptions::default());
}

#[test]
fn outliers_and_gaps() {
    let mut all = readings(60.0);
    for (k, channel, size) in [(600, 0, 100.0), (1800, 4, 5.0), (1801, 4, 5.0), (3000, 2, -90.0)] {
        let mut wrench = all[k].wrench.array();
        wrench[channel] += size;
        all[k].wrench = Wrench::from_array(wrench);
    }
    all[1200].angular_rate = AngularRate::new(f64::NAN, 0.0, 0.0);
    all.drain(2400..2460);
    let found = both(&input(all), &FitOptions::default());
    assert!(found.channels[0].outliers > 0 && found.counts.rejected == 1 && found.counts.gaps == 1);
    assert_eq!(found.counts.rejected_by_signal, [("imu_gx_radps".to_owned(), 1)]);
}

#[test]
fn autocorrelated_noise() {
    let mut all = readings(60.0);
    let (mut state, mut noise) = (1_u64, 0.0);
    for reading in &mut all {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        noise = 0.94 * noise + 0.9 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5);
        let mut wrench = reading.wrench.array();
        wrench[1] += noise;
        reading.wrench = Wrench::from_array(wrench);
    }
    let found = both(&input(all), &FitOptions::default());
    assert!(found.channels[1].autocorrelation.is_some() && found.largest_inflation() > Some(1.1));
}

#[test]
fn still_poses() {
    let moving = readings(60.0);
    let still = moving.iter().step_by(50).map(|r| Reading { angular_rate: AngularRate::zero(), ..*r });
    both(&Input { is_static: true, ..input(still.collect()) }, &FitOptions::default());
}

#[test]
fn forgetting_and_a_window() {
    let input = input(readings(40.0));
    for span in [Span::TimeConstant(8.0), Span::Window(10.0)] {
        both(&input, &FitOptions { forgetting: Some(span), convergence_points: 50, ..FitOptions::default() });
    }
}

/// The columns of the IMU's errors, by derivatives of the signals, against differences of readings with these
/// errors.
#[test]
fn errors_of_the_imu() {
    let mut input = input(readings(30.0));
    input.mounting.rotation = mounted(Vector3::zeros());
    input.mounting.position = Position::from_array(MOUNTED.1);
    // What an IMU reads that is mounted so, of the same motion.
    let to_imu = input.mounting.rotation.inverse();
    for reading in &mut input.readings {
        reading.specific_force =
            to_imu * SpecificForce::<Sensor, f64>::from_array(reading.specific_force.array());
        reading.angular_rate = to_imu * AngularRate::<Sensor, f64>::from_array(reading.angular_rate.array());
    }
    input.nuisances =
        errors::nuisances(&ImuTable::default(), &LoadCellTable::default(), &input.readings, false);
    let source = BodySource::new(input, None);
    let new = fit(&source, &FitOptions::default(), &Silent).unwrap();
    let plain = fit(&PlainRows(source), &FitOptions::default(), &Silent).unwrap();
    assert_eq!(new.nuisances.len(), 25 + 6 + 30 + 12);
    for (a, b) in new.nuisances.iter().zip(&plain.nuisances) {
        let name = &a.nuisance.name;
        // A derivative over two rows of a motion of 1.4 Hz at the most is 0.13 % short.
        assert!((a.value - b.value).abs() < 0.02 * b.sd, "{name}: {} {} ± {}", a.value, b.value, b.sd);
        assert!((a.sd / b.sd - 1.0).abs() < 5e-3, "{name}: {} {}", a.sd, b.sd);
    }
    for j in 0..new.parameters.len() {
        let sd = plain.estimate.covariance(j, j).unwrap().sqrt();
        assert!((new.estimate.covariance(j, j).unwrap().sqrt() / sd - 1.0).abs() < 5e-3, "{j}");
        let (a, b) = (new.estimate.measured(j).unwrap().value, plain.estimate.measured(j).unwrap().value);
        assert!((a - b).abs() < 0.02 * sd, "{j}: {a} {b} ± {sd}");
    }
}
