use rigident::fit::Fit;
use rigident::fit::pool::PooledFactor;
use rigident::fit::tare::Tare;

use super::simulated::{body, experiment, fixture, input, together};
use crate::fitting::{fit_body, states};
use crate::study_length::runs;

fn tare_of(fixture: &Fit) -> Tare {
    Tare::new(PooledFactor::of(fixture, "fixture")).unwrap()
}

/// Runs with body and fixture, each with a run of the bare fixture: U95 holds the body alone in 95 % of them.
/// Subtracted as if the fixture were known exactly it does not: with runs alike the variance is twice what is
/// said, and 1.96/√2 standard deviations hold 83.4 %.
#[test]
fn the_uncertainty_of_the_fixture_is_in_that_of_the_body() {
    let count = runs(150, 40);
    let (config, total) = experiment(together(&body(), &fixture()), 12.0);
    let (_, bare) = experiment(fixture(), 12.0);
    let truth = body().parameters();
    let (mut held, mut held_without) = ([0_u64; 10], [0_u64; 10]);
    for seed in 0..count {
        let mut run = fit_body(&input(&config, &total, 2 * seed + 1));
        let tare = tare_of(&fit_body(&input(&config, &bare, 2 * seed + 2)));
        let without = states(&run);
        tare.take_off(&mut run).unwrap();
        let with = states(&run);
        for j in 0..10 {
            let tared = with[j].measured().unwrap();
            let error = (tared.value - truth[j]).abs();
            held[j] += u64::from(error <= tared.u95);
            held_without[j] += u64::from(error <= without[j].measured().unwrap().u95);
        }
    }
    // Four standard deviations of a binomial share: 6e-5 each.
    let band = |p: f64| 4.0 * (p * (1.0 - p) / count as f64).sqrt();
    for (j, (held, without)) in held.iter().zip(held_without).enumerate() {
        let (held, without) = (*held as f64 / count as f64, without as f64 / count as f64);
        assert!((held - 0.95).abs() < band(0.95), "{j}: {held}");
        assert!((without - 0.834).abs() < band(0.834), "{j}: {without}");
    }
}

/// The covariance that the factors give is the sum of the two, element by element.
#[test]
fn covariances_of_run_and_fixture_add() {
    let (config, total) = experiment(together(&body(), &fixture()), 12.0);
    let (_, bare) = experiment(fixture(), 30.0);
    let run = fit_body(&input(&config, &total, 1));
    let fixture = fit_body(&input(&config, &bare, 2));
    let [a, b] = [run.estimate.clone(), fixture.estimate.clone()];
    let mut tared = run.clone();
    tare_of(&fixture).take_off(&mut tared).unwrap();
    let values =
        |fit: &Fit| -> Vec<f64> { states(fit).iter().map(|state| state.measured().unwrap().value).collect() };
    let (with, run, fixture) = (values(&tared), values(&run), values(&fixture));
    for i in 0..16 {
        let sd = |k: usize| tared.estimate.covariance(k, k).unwrap().sqrt();
        for j in 0..16 {
            let own = if i < 10 && j < 10 { b.covariance(i, j).unwrap() } else { 0.0 };
            let error = tared.estimate.covariance(i, j).unwrap() - a.covariance(i, j).unwrap() - own;
            assert!(error.abs() < 1e-9 * sd(i) * sd(j), "{i} {j}: {error}");
        }
        let value = run[i] - if i < 10 { fixture[i] } else { 0.0 };
        assert!((with[i] - value).abs() < 1e-9 * sd(i), "{i}: {} {value} ± {}", with[i], sd(i));
    }
}
