use rigident::answer::{Estimate, Noise};
use rigident::identification::pooled::PooledFactor;
use rigident::identification::tare::Tare;
use rigident::identification::{Factor, Identification, identify};

use super::simulated::{body, experiment, fixture, input, together};

/// Runs with body and fixture, each with a run of the bare fixture: U95 holds the body alone in 95 % of them.
/// Subtracted as if the fixture were known exactly it does not: with runs alike the variance is twice what is
/// said, and 1.96/√2 standard deviations hold 83.4 %.
#[test]
fn the_uncertainty_of_the_fixture_is_in_that_of_the_body() {
    const RUNS: u64 = 300;
    let (config, total) = experiment(together(&body(), &fixture()), 12.0);
    let (_, bare) = experiment(fixture(), 12.0);
    let truth = body().parameters();
    let (mut held, mut held_without) = ([0_u64; 10], [0_u64; 10]);
    for seed in 0..RUNS {
        let run_input = input(&config, &total, 2 * seed + 1);
        let mut run = identify(&run_input).unwrap();
        let bare_input = input(&config, &bare, 2 * seed + 2);
        let tare = Tare::new(PooledFactor::of(&identify(&bare_input).unwrap(), &bare_input, "fixture"));
        let pooled = PooledFactor::of(&run, &run_input, "total");
        let without = run.states();
        tare.take_off(&pooled, &mut run, &mut []).unwrap();
        let states = run.states();
        for j in 0..10 {
            let tared = states[j].measured().unwrap();
            let error = (tared.value - truth[j]).abs();
            held[j] += u64::from(error <= tared.u95);
            held_without[j] += u64::from(error <= without[j].measured().unwrap().u95);
        }
    }
    // Four standard deviations of a binomial share: 6e-5 each.
    let band = |p: f64| 4.0 * (p * (1.0 - p) / RUNS as f64).sqrt();
    for (j, (held, without)) in held.iter().zip(held_without).enumerate() {
        let (held, without) = (*held as f64 / RUNS as f64, without as f64 / RUNS as f64);
        assert!((held - 0.95).abs() < band(0.95), "{j}: {held}");
        assert!((without - 0.834).abs() < band(0.834), "{j}: {without}");
    }
}

/// The covariance that the factors give is the sum of the two, element by element.
#[test]
fn covariances_of_run_and_fixture_add() {
    let (config, total) = experiment(together(&body(), &fixture()), 12.0);
    let (_, bare) = experiment(fixture(), 30.0);
    let (run_input, bare_input) = (input(&config, &total, 1), input(&config, &bare, 2));
    let run = identify(&run_input).unwrap();
    let fixture = identify(&bare_input).unwrap();
    let (Factor::Sixteen(a), Factor::Sixteen(b)) = (&run.factor, &fixture.factor) else { panic!() };
    let (a, b) = (Estimate::new(a, 1.0, Noise::Given), Estimate::new(b, 1.0, Noise::Given));
    let tare = Tare::new(PooledFactor::of(&fixture, &bare_input, "fixture"));
    let mut tared = run.clone();
    tare.take_off(&PooledFactor::of(&run, &run_input, "total"), &mut tared, &mut []).unwrap();
    let values = |identification: &Identification| -> Vec<f64> {
        identification.states().iter().map(|state| state.measured().unwrap().value).collect()
    };
    let (with, run, fixture) = (values(&tared), values(&run), values(&fixture));
    for i in 0..16 {
        let sd = |k: usize| tared.estimate.covariance(k, k).unwrap().sqrt();
        for j in 0..16 {
            let own = if i < 10 && j < 10 { b.covariance(i, j).unwrap() } else { 0.0 };
            let error = tared.estimate.covariance(i, j).unwrap() - a.covariance(i, j).unwrap() - own;
            assert!(error.abs() < 1e-10 * sd(i) * sd(j), "{i} {j}: {error}");
        }
        let value = run[i] - if i < 10 { fixture[i] } else { 0.0 };
        assert!((with[i] - value).abs() < 1e-9 * sd(i), "{i}");
    }
}
