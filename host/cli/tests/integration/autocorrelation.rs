//! Noise of the load cell that is not white: distinguished from chance, and by how much intervals on white
//! noise are too small.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::fit::autocorrelation::{Coloured, detect};
use rigident::fit::{BlockResidual, ESTIMATOR_TAPS, FILTER_WIDTH_S, Filter, RowSource, Silent, row_every};
use rigident::rows::body::{BodySource, Input};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{Estimator, EstimatorConfig, Outcome};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

fn config(rate_hz: f64) -> EstimatorConfig<f64> {
    EstimatorConfig {
        rate_hz,
        filter_width_s: FILTER_WIDTH_S,
        row_every: row_every(rate_hz),
        channel_sigma: [1.0; 6],
        known_offset: [0.0; 6],
        mounting: ImuMounting::default(),
        limits: Limits::none(),
    }
}

/// The filter that a fit takes for the rows'.
fn filter(rate_hz: f64) -> Filter {
    let readings =
        (0..1000).map(|k| Reading { time_ns: (f64::from(k) * 1e9 / rate_hz) as u64, ..Reading::default() });
    let input = Input {
        readings: readings.collect(),
        is_static: false,
        rate_hz,
        mounting: ImuMounting::default(),
        channel_sigma: Some([1.0; 6]),
        gyro_sigma: None,
        known_offset: None,
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits::none(),
    };
    BodySource::new(input, None).condition(&Silent).unwrap().filter().clone()
}

/// Rows as the estimator makes them of noise that obeys `n ← ρ n + √(1 − ρ²) g`, of unit variance.
fn residuals(rate_hz: f64, rho: f64, readings: usize, seed: u64) -> Vec<BlockResidual> {
    let mut normal = Distribution::<f64>::sample_iter(StandardNormal, ChaCha8Rng::seed_from_u64(seed));
    let mut pipeline = Box::new(Estimator::<f64, 10, ESTIMATOR_TAPS>::new(&config(rate_hz)).unwrap());
    let mut noise = [0.0; 6];
    let mut rows = Vec::new();
    for k in 0..readings {
        for n in &mut noise {
            let fresh = normal.next().unwrap();
            *n = if k == 0 { fresh } else { rho * *n + (1.0 - rho * rho).sqrt() * fresh };
        }
        let time_s = k as f64 / rate_hz;
        let reading = Reading {
            time_ns: (time_s * 1e9) as u64,
            wrench: Wrench::from_array(noise),
            specific_force: SpecificForce::zero(),
            angular_rate: AngularRate::zero(),
        };
        if pipeline.absorb(&reading) == Outcome::Absorbed {
            let values = pipeline.last_block().unwrap().wrench.to_vec();
            rows.push(BlockResidual { time_s, values, weights: Vec::new() });
        }
    }
    rows
}

fn found(rate_hz: f64, rho: f64, seconds: f64, seed: u64) -> Vec<Coloured> {
    let rows = residuals(rate_hz, rho, (seconds * rate_hz) as usize, seed);
    detect(&rows, &filter(rate_hz), &[1.0; 6], 0.0)
}

#[test]
fn the_filter_is_a_symmetric_kernel_of_the_noise_gain_that_the_pipeline_states() {
    for rate_hz in [100.0, 200.0, 250.0, 1000.0] {
        let stated = Estimator::<f64, 10, ESTIMATOR_TAPS>::new(&config(rate_hz)).unwrap().noise_gain();
        let Filter { response, every, .. } = filter(rate_hz);
        let energy: f64 = response.iter().map(|h| h * h).sum();
        assert!((energy * f64::from(every) / stated - 1.0).abs() < 1e-12, "{rate_hz}");
        assert!((response.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{rate_hz}");
        for (early, late) in response.iter().zip(response.iter().rev()) {
            assert!((early - late).abs() < 1e-14, "{rate_hz}");
        }
    }
}

/// The sum over all lags is one: what makes the covariance of white noise right.
#[test]
fn all_lags_of_the_filtered_noise_together_are_the_noise_before_it() {
    for rate_hz in [100.0, 200.0, 250.0, 500.0, 1000.0] {
        let filter = filter(rate_hz);
        let white = filter.white_autocovariance();
        let sum = white[0] + 2.0 * white[1..].iter().sum::<f64>();
        assert!((sum * f64::from(filter.every) - 1.0).abs() < 1e-3, "{rate_hz}: {sum}");
    }
}

#[test]
fn white_noise_gives_no_warning() {
    for seed in 0..100 {
        assert_eq!(found(200.0, 0.0, 20.0, seed), [], "seed {seed}");
    }
    // As few rows as are examined.
    for seed in 0..1000 {
        assert_eq!(found(200.0, 0.0, 0.9, seed), [], "seed {seed}");
    }
    assert_eq!(found(1000.0, 0.0, 20.0, 1), []);
}

#[test]
fn autocorrelated_noise_is_named_in_a_second_too() {
    let rho = f64::exp(-1.0 / (200.0 * 0.05));
    let named: usize = (0..50).map(|seed| found(200.0, rho, 0.9, seed).len()).sum();
    assert!(named > 6 * 50 / 2, "{named} of 300 channels");
    assert_eq!(found(200.0, rho, 0.7, 1), [], "too few rows");
}

/// Autoregressive noise of correlation time τ: the spectrum at zero frequency is (1 + ρ)/(1 − ρ) times the
/// white one's.
#[test]
fn autocorrelated_noise_is_named_with_its_factor() {
    for (tau_s, seconds) in [(0.05, 60.0), (0.2, 240.0)] {
        let rho = f64::exp(-1.0 / (200.0 * tau_s));
        let expected = ((1.0 + rho) / (1.0 - rho)).sqrt();
        for seed in 0..5 {
            // All six channels have that noise, and each is named with its own factor, the worst first.
            let channels = found(200.0, rho, seconds, seed);
            assert_eq!(channels.len(), 6, "{tau_s} s, seed {seed}: {channels:?}");
            // The largest of six estimates, each good to about √(τ/T) of its variance times a few.
            let worst = channels[0].found.factor / expected;
            assert!((0.8..1.5).contains(&worst), "{tau_s} s, seed {seed}: {worst}");
            for c in &channels {
                let ratio = c.found.factor / expected;
                assert!((0.5..1.5).contains(&ratio), "{tau_s} s, seed {seed}, {}: {ratio}", c.channel);
            }
        }
    }
}
