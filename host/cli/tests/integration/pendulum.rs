//! A row source that is not in the tree is identified as any body is.

use rigident::answer::{Answer, Context};
use rigident::fit::pool::PooledFactor;
use rigident::fit::{FitOptions, Measured, Noise, Silent, fit};
use rigident::present;

#[path = "../../../examples/pendulum.rs"]
mod source;

const BODY: [f64; 3] = [2.0, 0.6, 0.25];
const OFFSETS: [f64; 2] = [1.0, 0.3];

fn truth() -> Vec<f64> {
    BODY.into_iter().chain(OFFSETS).collect()
}

fn found(seed: u64) -> Vec<Measured> {
    let fit = fit(&source::simulated(BODY, 10, seed, 0.0), &FitOptions::default(), &Silent).unwrap();
    (0..5).map(|j| fit.estimate.measured(j).unwrap()).collect()
}

/// 40 runs of five parameters, counted as three independent ones a run: 0.95 ± 3 √(0.05 · 0.95 / 120).
#[test]
fn intervals_of_a_pendulum_hold_the_truth_as_often_as_stated() {
    let mut inside = 0;
    for seed in 1..=40 {
        for (found, truth) in found(seed).iter().zip(truth()) {
            inside += u32::from((found.value - truth).abs() <= found.u95);
        }
    }
    let share = f64::from(inside) / 200.0;
    assert!((share - 0.95).abs() < 3.0 * (0.05_f64 * 0.95 / 120.0).sqrt(), "{share}");
}

/// The noise is found: 0.3 N and 0.02 N m, to three standard deviations of 2000 filtered samples worth some
/// 500.
#[test]
fn noise_of_a_pendulum_s_channels_is_found() {
    let fit = fit(&source::simulated(BODY, 20, 7, 0.0), &FitOptions::default(), &Silent).unwrap();
    for (channel, sigma) in fit.channels.iter().zip([0.3, 0.3, 0.02]) {
        assert!((channel.sigma / sigma - 1.0).abs() < 0.1, "{}: {}", channel.channel.name, channel.sigma);
        assert_eq!((channel.outliers, channel.autocorrelation), (0, None));
    }
    assert!(!fit.noise.sigma_given && matches!(fit.estimate.noise, Noise::Estimated { .. }));
}

/// 40 N for one sample are some 7 N behind the filter, sixty standard deviations.
#[test]
fn a_knock_on_a_pendulum_counts_less() {
    let fit = fit(&source::simulated(BODY, 20, 3, 40.0), &FitOptions::default(), &Silent).unwrap();
    assert!(fit.channels[0].outliers > 0 && fit.channels[1].outliers == 0);
    for (j, truth) in truth().into_iter().enumerate() {
        let found = fit.estimate.measured(j).unwrap();
        assert!((found.value - truth).abs() < 2.0 * found.u95, "{j}: {found:?} {truth}");
    }
}

/// Factor files of two runs merge, each with its own offsets, and the answer has a text, an object and a
/// page.
#[test]
fn a_pendulum_has_a_factor_file_runs_that_merge_and_a_report() {
    let options = FitOptions { convergence_points: 20, ..FitOptions::default() };
    let runs = [1, 2].map(|seed| fit(&source::simulated(BODY, 20, seed, 0.0), &options, &Silent).unwrap());
    let files = runs.iter().map(|run| PooledFactor::of(run, "pendulum").to_bytes());
    let pools: Vec<PooledFactor> =
        files.map(|bytes| PooledFactor::from_bytes(&bytes, "pendulum.factor").unwrap()).collect();
    let merged = PooledFactor::merged(pools, false).unwrap().fit();
    assert_eq!(merged.parameters.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["m", "ml", "J"]);
    for (j, truth) in BODY.into_iter().enumerate() {
        let (one, both) = (runs[0].estimate.measured(j).unwrap(), merged.estimate.measured(j).unwrap());
        assert!((both.value - truth).abs() < 2.0 * both.u95, "{j}: {both:?} {truth}");
        // Twice the rows: half the variance, but for what σ from residuals leaves.
        assert!((one.u95 / both.u95 / 2.0_f64.sqrt() - 1.0).abs() < 0.1, "{j}: {one:?} {both:?}");
    }
    assert!(!runs[0].convergence.is_empty());
    let answer = Answer::new(&runs[0], Context::default()).unwrap();
    let object = serde_json::to_value(&answer).unwrap();
    assert_eq!(object["schema"], "rigident/result/3");
    assert!(present::plain::text(&answer).contains("ml"));
    let series = present::Series::new(&runs[0], &answer, false, 0.0);
    assert!(present::report(&answer, &series).contains("ml"));
}
