//! Rates that went through a filter, positions and efforts not.

use super::effort_lowpass::lowpass;
use crate::problem::{Problem, ProblemOptions};
use rigident_fit::{FitOptions, Silent};
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::{seven_axes, truth};
use rigident_rows::tree::drive::Friction;

/// Rates behind a low-pass are late and are not used, which a warning says; others are.
#[test]
fn rates_behind_a_filter_are_taken_from_positions() {
    let model = seven_axes();
    let run = ArmRun {
        friction: [2.0, 0.0, 0.2],
        rest_s: 0.0,
        motion_s: 12.0,
        effort_noise: 0.1,
        position_noise: 1e-6,
        rate_noise: 1e-4,
        ..ArmRun::default()
    };
    for filter_hz in [None, Some(15.0)] {
        let mut recording = run.recording(&model);
        filter_hz.into_iter().for_each(|cutoff_hz| lowpass(&mut recording, "_radps", cutoff_hz));
        let friction = Friction::parse(&["viscous,coulomb:0,offset"]).unwrap();
        let options = ProblemOptions { friction, ..ProblemOptions::default() };
        let problem = Problem::from_recording(&recording, Some(&model), &options).unwrap();
        let said = problem.warnings.join(" ");
        assert_eq!(said.contains("later than the slopes of their positions"), filter_hz.is_some(), "{said}");
        let fit =
            problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent).unwrap();
        let mut wanted = truth(&model, problem.tree().unwrap().base());
        (0..7).for_each(|k| wanted.extend(run.friction_of(k)));
        let values = fit.estimate.unjudged();
        let over = |(j, wanted): (usize, &f64)| {
            let u95 = fit.estimate.coverage_factor() * values.covariance[(j, j)].sqrt();
            (values.values[j] - wanted) / u95
        };
        let errors: Vec<f64> = wanted.iter().enumerate().map(over).collect();
        println!("{filter_hz:?} {errors:.2?}");
        let outside = errors.iter().filter(|error| error.abs() > 1.6).count();
        assert!(outside <= 2 && !fit.lack_of_fit.contradicts(), "{filter_hz:?} {errors:.2?}");
    }
}
