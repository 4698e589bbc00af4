//! Arms that warm up, or whose friction grows with the load: neither is a change of the arm.

use crate::problem::{Problem, ProblemOptions};
use rigident_fit::lack_of_fit::Changed;
use rigident_fit::{Fit, FitOptions, Silent};
use rigident_io::recording::Recording;
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::{seven_axes, truth};
use rigident_rows::tree::drive::Friction;

fn run() -> ArmRun {
    ArmRun {
        slip: 0.02,
        rest_s: 0.0,
        motion_s: 16.0,
        rate_hz: 100.0,
        effort_noise: 0.1,
        rate_noise: 1e-4,
        seed: 21,
        ..ArmRun::default()
    }
}

/// The fit, and the errors of the base parameters over their U95.
fn fitted(recording: &Recording) -> (Fit, Vec<f64>) {
    let model = seven_axes();
    let friction = Friction::parse(&["viscous,coulomb,offset"]).unwrap();
    let options = ProblemOptions { friction, ..ProblemOptions::default() };
    let problem = Problem::from_recording(recording, Some(&model), &options).unwrap();
    let fit = problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent).unwrap();
    let wanted = truth(&model, problem.tree().unwrap().base());
    let values = fit.estimate.unjudged();
    let over = |(j, wanted): (usize, &f64)| {
        (values.values[j] - wanted) / (fit.estimate.coverage_factor() * values.covariance[(j, j)].sqrt())
    };
    let errors = wanted.iter().enumerate().map(over).collect();
    (fit, errors)
}

/// The errors of friction of a kind that a fit has, by drives.
fn found(fit: &Fit, kind: &str) -> Vec<f64> {
    let own = fit.nuisances.iter().filter(|found| found.nuisance.name.starts_with(kind));
    own.map(|found| found.value).collect()
}

fn assert_inside(errors: &[f64]) {
    println!("{errors:.2?}");
    let outside = errors.iter().filter(|error| error.abs() > 1.0).count();
    assert!(outside <= 5 && errors.iter().all(|error| error.abs() < 1.8), "{errors:.2?}");
}

/// Friction that falls by a tenth is that; a third of the last link that gets lost meanwhile is a change of a
/// body.
#[test]
fn friction_that_falls_is_no_change_and_a_loss_is_one() {
    let run = ArmRun { warming: 0.1, ..run() };
    let mut recording = run.recording(&seven_axes());
    let (fit, errors) = fitted(&recording);
    assert!(!fit.lack_of_fit.contradicts(), "{:?}", fit.lack_of_fit);
    let falls = found(&fit, "friction_drift_coulomb_line");
    println!("{falls:.3?}");
    // The line of what falls by 0.095 is 0.04 or so to either side.
    assert!(falls.len() >= 3 && falls.iter().all(|share| (-0.07..-0.02).contains(share)), "{falls:?}");
    assert_inside(&errors);

    let mut model = seven_axes();
    for phi in model.links.last_mut().unwrap().nominal.iter_mut() {
        *phi = phi.map(|own| 0.7 * own);
    }
    let lighter = run.recording(&model);
    for ((_, cells), (_, own)) in recording.extra.iter_mut().zip(lighter.extra) {
        let half = cells.len() / 2;
        cells[half..].clone_from_slice(&own[half..]);
    }
    let change = fitted(&recording).0.lack_of_fit.change.unwrap();
    assert!(change.changed == Changed::Body && (change.time_s - 8.0).abs() < 0.5, "{change:?}");
}

/// Where nothing of the kind is there, nothing is found but by another law at reversals.
#[test]
fn friction_that_grows_with_the_load_takes_no_part_in_bodies() {
    for load in [0.0, 0.08] {
        let (fit, errors) = fitted(&ArmRun { load, ..run() }.recording(&seven_axes()));
        let found = found(&fit, "friction_load");
        println!("{load}: {found:.3?}");
        assert!(!fit.lack_of_fit.contradicts(), "{:?}", fit.lack_of_fit);
        assert!(load == 0.0 || found.len() >= 3, "{found:?}");
        assert!(found.iter().all(|own| (own - load).abs() < 0.04), "{load}: {found:?}");
        assert_inside(&errors);
    }
}
