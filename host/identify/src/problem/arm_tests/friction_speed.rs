//! Arms whose dry friction does not jump, by another law than that of the columns.

use crate::problem::{Problem, ProblemOptions};
use rigident_fit::{Fit, FitOptions, Silent};
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::seven_axes;
use rigident_rows::tree::drive::Friction;

fn identified(run: &ArmRun, list: &str) -> Fit {
    let model = seven_axes();
    let options = ProblemOptions { friction: Friction::parse(&[list]).unwrap(), ..ProblemOptions::default() };
    let problem = Problem::from_recording(&run.recording(&model), Some(&model), &options).unwrap();
    problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent).unwrap()
}

/// Errors of viscous and Coulomb friction of every joint, over their U95.
fn errors(fit: &Fit, run: &ArmRun) -> Vec<f64> {
    let values = fit.estimate.unjudged();
    let of = |word: &str, which: usize| {
        let own = fit.parameters.iter().enumerate().filter(move |(_, p)| p.name.ends_with(word));
        let error = move |(k, (j, _)): (usize, (usize, _))| {
            let u95 = fit.estimate.coverage_factor() * values.covariance[(j, j)].sqrt();
            (values.values[j] - run.friction_of(k)[which]) / u95
        };
        own.enumerate().map(error).collect::<Vec<f64>>()
    };
    [of(".viscous", 0), of(".coulomb", 1)].concat()
}

/// With the speed that the recording shows nothing changes and friction is inside of its interval; with a
/// jump in its place most of it is not.
#[test]
fn friction_that_turns_over_smoothly_is_no_change() {
    for (slip, seed) in [(0.02, 11), (0.05, 12)] {
        let run = ArmRun { slip, seed, rest_s: 0.0, rate_noise: 1e-3, ..ArmRun::default() };
        let fit = identified(&run, "viscous,coulomb,offset");
        assert!(!fit.lack_of_fit.contradicts(), "{:?}", fit.lack_of_fit);
        let own = errors(&fit, &run);
        println!("{slip}: {own:.2?}");
        // Of 14 one at most is beyond 1.6 U95 once in 40.
        assert!(own.iter().all(|error| error.abs() < 1.6), "{slip}: {own:.2?}");
        let jump = errors(&identified(&run, "viscous,coulomb:0,offset"), &run);
        println!("{slip}: {jump:.2?}");
        let outside = jump.iter().filter(|error| error.abs() > 1.6).count();
        assert!(outside >= 4, "{slip}: {jump:.2?}");
    }
}

/// Friction that jumps is found to: its speed is no part of the fit, or below what the noise of the rate
/// shows.
#[test]
fn friction_that_jumps_has_no_speed() {
    let run = ArmRun { rest_s: 0.0, rate_noise: 1e-4, seed: 13, ..ArmRun::default() };
    let fit = identified(&run, "viscous,coulomb,offset");
    let own = errors(&fit, &run);
    println!("{own:.2?}");
    assert!(own.iter().all(|error| error.abs() < 1.6), "{own:.2?}");
}
