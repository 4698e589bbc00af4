//! The one engine gives what the engine of one body gave, as long as that is there to ask.

use nalgebra::DMatrix;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::fit::{Factor, Fit, FitOptions, Silent, fit};
use rigident::identification::{self, Identification, Input, identify};
use rigident::problem::body::BodySource;
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::forgetting::{MemoryConfig, Span};
use rigident_shared::regressor::{self, SMOOTHED};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, SpecificForce, Wrench};

/// Both sum the same numbers in another order: some hundred roundings of 1e-16 each, times the condition number.
const ROUNDING: f64 = 1e-10;

/// Readings of a body of 2 kg, by its equation at angular rates and specific forces that are sums of sines, with white
/// noise of 0.5 N, 0.03 N m, 0.02 m/s² and 1e-3 rad/s.
fn readings(rate_hz: f64, seconds: f64) -> Vec<Reading<f64>> {
    const PHI: [f64; 10] = [2.0, 0.02, -0.03, 0.1, 0.03, 0.02, 0.025, 1e-3, -2e-3, 3e-3];
    const OFFSET: [f64; 6] = [1.0, -2.0, 3.0, 0.1, 0.2, -0.3];
    let mut noise = Distribution::<f64>::sample_iter(StandardNormal, ChaCha8Rng::seed_from_u64(1));
    let mut noisy = |v: f64, sigma: f64| v + sigma * noise.next().unwrap();
    let wave = |t: f64, k: usize| {
        let w = 2.0 + 1.3 * k as f64;
        let phase = (7 * k) as f64;
        [(w * t + phase).sin(), w * (w * t + phase).cos()]
    };
    (0..(rate_hz * seconds) as usize)
        .map(|row| {
            let t = row as f64 / rate_hz;
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

fn input(readings: Vec<Reading<f64>>, rate_hz: f64) -> Input {
    Input {
        readings,
        is_static: false,
        rate_hz,
        mounting: ImuMounting::default(),
        channel_sigma: None,
        gyro_sigma: None,
        known_offset: None,
        gain_sigma: [0.0; 6],
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

fn assert_same_body(new: &Fit, old: &Identification) {
    let factor = match &old.factor {
        identification::Factor::Ten(f) => Factor::from(&**f),
        identification::Factor::Sixteen(f) => Factor::from(&**f),
    };
    assert_same_factor(&new.factor, &factor);
    let of =
        |of: &dyn Fn(&rigident::fit::ChannelFit) -> f64| new.channels.iter().map(of).collect::<Vec<f64>>();
    assert_same(&of(&|c| c.sigma), &old.channel_sigma, "sigma");
    assert_same(&of(&|c| c.residual_rms), &old.residual_rms, "residual rms");
    assert_same(&[new.noise.variance_ratio], &[old.variance_ratio], "variance ratio");
    assert_same(&new.inflation, &old.widening, "inflation");
    assert_same(&[new.spurious_information], &[old.regressor_noise.tensor_information], "information");
    let outliers: Vec<u32> = old.counters.knocks.iter().map(|k| u32::from(*k)).collect();
    assert_eq!(new.channels.iter().map(|c| c.outliers).collect::<Vec<_>>(), outliers);
    assert_eq!(new.counts.blocks, u64::from(old.counters.blocks));
    assert_eq!(
        (new.counts.rejected, new.counts.gaps),
        (u64::from(old.counters.rejected), u64::from(old.counters.gaps))
    );
    let n = new.parameters.len();
    for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
        let (a, b) = (new.estimate.covariance(i, j), old.estimate.covariance(i, j));
        let sd = |k: usize| old.estimate.covariance(k, k).unwrap_or(0.0).sqrt();
        assert!((a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs() <= 1e-8 * sd(i) * sd(j), "{i} {j}: {a:?} {b:?}");
    }
    let coverage = new.estimate.coverage_factor();
    assert!((coverage / old.estimate.coverage_factor - 1.0).abs() < 1e-12);
}

fn both(input: &Input) -> (Fit, Identification) {
    let source = BodySource::new(input.clone(), None);
    (fit(&source, &FitOptions::default(), &Silent).unwrap(), identify(input).unwrap())
}

#[test]
fn one_body_in_three_parts_and_with_what_is_known() {
    let mut input = input(readings(1000.0, 60.0), 1000.0);
    let (new, old) = both(&input);
    assert_same_body(&new, &old);
    // σ too small scale the covariance; an offset that is known is no parameter.
    input.channel_sigma = Some(old.channel_sigma.map(|s| 0.5 * s));
    input.known_offset = Some([0.3, 0.2, -0.1, 0.01, 0.0, 0.02]);
    let (new, old) = both(&input);
    assert!(new.noise.variance_scale > 3.0);
    assert_same_body(&new, &old);
}

#[test]
fn one_body_with_gain_errors() {
    let mut input = input(readings(200.0, 30.0), 200.0);
    input.gain_sigma = [0.01, 0.01, 0.005, 0.01, 0.01, 0.0];
    let (new, old) = both(&input);
    assert_same_body(&new, &old);
    assert_same(&new.channels.iter().map(|c| c.gain).collect::<Vec<_>>(), &old.gains, "gains");
}

#[test]
fn one_body_with_outliers_and_gaps() {
    let mut all = readings(500.0, 40.0);
    for (k, channel, size) in [(3000, 0, 100.0), (9000, 4, 5.0), (9001, 4, 5.0), (15_000, 2, -90.0)] {
        let mut wrench = all[k].wrench.array();
        wrench[channel] += size;
        all[k].wrench = Wrench::from_array(wrench);
    }
    all[6000].angular_rate = AngularRate::new(f64::NAN, 0.0, 0.0);
    all.drain(12_000..12_300);
    let (new, old) = both(&input(all, 500.0));
    assert!(new.channels[0].outliers > 0 && new.counts.rejected == 1 && new.counts.gaps == 1);
    assert_eq!(new.counts.rejected_by_signal, [("imu_gx_radps".to_owned(), 1)]);
    assert_same_body(&new, &old);
}

#[test]
fn one_body_with_autocorrelated_noise() {
    let mut all = readings(200.0, 60.0);
    let (mut state, mut noise) = (1_u64, 0.0);
    for reading in &mut all {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        noise = 0.97 * noise + 0.6 * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5);
        let mut wrench = reading.wrench.array();
        wrench[1] += noise;
        reading.wrench = Wrench::from_array(wrench);
    }
    let (new, old) = both(&input(all, 200.0));
    assert!(new.channels[1].autocorrelation.is_some() && new.largest_inflation() > Some(1.1));
    assert_same_body(&new, &old);
}

#[test]
fn still_poses_of_one_body() {
    let moving = readings(100.0, 60.0);
    let still = moving.iter().step_by(50).map(|r| Reading { angular_rate: AngularRate::zero(), ..*r });
    let input = Input { is_static: true, ..input(still.collect(), 1.0) };
    let (new, old) = both(&input);
    assert_same_body(&new, &old);
}

#[test]
fn one_body_that_forgets_and_in_a_window() {
    let input = input(readings(500.0, 40.0), 500.0);
    let imu_noise = rigident::problem::body::imu_noise::imu_noise(None, &input.readings);
    for span in [Span::TimeConstant(8.0), Span::Window(10.0)] {
        let memory = MemoryConfig { span, imu_noise };
        let (old, way) = identification::remembered::identify_remembered(&input, &memory, 100).unwrap();
        let options = FitOptions { forgetting: Some(span), convergence_points: 100 };
        let new = fit(&BodySource::new(input.clone(), None), &options, &Silent).unwrap();
        assert_same_body(&new, &old);
        assert_eq!(new.convergence.len(), way.len());
        for (new, old) in new.convergence.iter().zip(&way) {
            assert_eq!(new.time_s, old.time_s);
            for (a, b) in new.parameters.iter().zip(&old.parameters) {
                assert_eq!(a.is_some(), b.is_some());
                let (Some(a), Some(b)) = (a, b) else { continue };
                assert!((a.value - b.value).abs() < 1e-6 * b.u95 && (a.u95 / b.u95 - 1.0).abs() < 1e-8);
            }
        }
    }
}

#[test]
fn convergence_of_one_body() {
    let input = input(readings(1000.0, 60.0), 1000.0);
    let old = identify(&input).unwrap();
    let way = identification::progression(&input, &old, 50);
    let options = FitOptions { forgetting: None, convergence_points: 50 };
    let new = fit(&BodySource::new(input, None), &options, &Silent).unwrap();
    // Points of the old way are counted in each of its three parts.
    assert!(new.convergence.len().abs_diff(way.len()) <= 3);
    let (last, wanted) = (new.convergence.last().unwrap(), way.last().unwrap());
    assert_eq!(last.time_s, wanted.time_s);
    for (a, b) in last.parameters.iter().zip(&wanted.parameters) {
        let (a, b) = (a.unwrap(), b.unwrap());
        assert!((a.value - b.value).abs() < 1e-7 * b.u95 && (a.u95 / b.u95 - 1.0).abs() < 1e-8);
    }
}
