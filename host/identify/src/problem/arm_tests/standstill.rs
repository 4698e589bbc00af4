use crate::problem::{Problem, ProblemOptions};
use rigident_fit::{Fit, FitOptions, Silent};
use rigident_io::recording::Recording;
use rigident_laboratory::arm::ArmRun;
use rigident_laboratory::trees::{seven_axes, truth};
use rigident_rows::tree::drive::Friction;

fn identified(recording: &Recording, lists: &[&str]) -> (Problem, Fit) {
    let options = ProblemOptions { friction: Friction::parse(lists).unwrap(), ..ProblemOptions::default() };
    let problem = Problem::from_recording(recording, Some(&seven_axes()), &options).unwrap();
    let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
    (problem, fit)
}

fn u95(fit: &Fit, j: usize) -> f64 {
    fit.estimate.coverage_factor() * fit.estimate.unjudged().covariance[(j, j)].sqrt()
}

/// Value and U95 of the Coulomb friction of every joint.
fn coulomb(fit: &Fit) -> Vec<(f64, f64)> {
    let own = fit.parameters.iter().enumerate().filter(|(_, p)| p.name.ends_with(".coulomb"));
    own.map(|(j, _)| (fit.estimate.unjudged().values[j], u95(fit, j))).collect()
}

const ALL: [&str; 1] = ["viscous,coulomb,offset"];

/// Rest on both sides says nothing of friction and takes nothing of what the motion says: intervals are as
/// wide as of the motion alone, and hold the truth. Before, noise of 5e-8 rad/s made them two hundred times
/// as wide.
#[test]
fn rest_leaves_friction_alone() {
    for (rate_noise, seed) in [(0.0, 1), (5e-8, 2), (1e-3, 3)] {
        let run = ArmRun { rate_noise, seed, ..ArmRun::default() };
        let rested = identified(&run.recording(&seven_axes()), &ALL);
        let motion = identified(&ArmRun { rest_s: 0.0, ..run.clone() }.recording(&seven_axes()), &ALL);
        for (k, (own, alone)) in coulomb(&rested.1).into_iter().zip(coulomb(&motion.1)).enumerate() {
            let wanted = run.friction_of(k)[1];
            println!("{rate_noise} joint {k}: {own:?} {alone:?} {wanted}");
            assert!(own.1 < 1.1 * alone.1, "joint {k}: {own:?}, the motion alone {alone:?}");
            // Of 21 one at most is beyond 1.6 U95 once in 30.
            assert!((own.0 - wanted).abs() < 1.6 * own.1, "joint {k}: {own:?}, true {wanted}");
        }
        let is_noted =
            rested.0.notes.iter().any(|note| note.contains("standing still") && note.contains("l7_joint 10"));
        assert!(is_noted, "{:?}", rested.0.notes);
        assert!(motion.0.notes.iter().all(|note| !note.contains("standing still")), "{:?}", motion.0.notes);
    }
}

/// Gravity at rest stays, where there is no dry friction: the rows of rest are among those of the fit. A
/// joint that is at rest still alone takes no other's rows away.
#[test]
fn only_rows_of_dry_friction_are_left_out() {
    let run = ArmRun { rate_noise: 1e-4, friction: [2.0, 0.0, 0.2], ..ArmRun::default() };
    let recording = run.recording(&seven_axes());
    let rows = |lists: &[&str]| identified(&recording, lists).1.factor.rows();
    let (all, none, one) =
        (rows(&["viscous"]), rows(&["viscous,coulomb"]), rows(&["viscous", "l3_joint=coulomb"]));
    assert!(none < all && one < all, "{all} {none} {one}");
    let (left_out, of_one) = ((all - none) as f64, (all - one) as f64);
    assert!((of_one / left_out * 7.0 - 1.0).abs() < 0.1, "{all} {none} {one}");
}

/// A joint that is held for half of the time, and for three quarters, beside others that move: σ from the
/// residuals is that of the rows there are, and what holds the joint is not taken for its links.
#[test]
fn one_joint_that_rests_takes_nothing_from_the_others() {
    let model = seven_axes();
    for (held_s, seed) in [(10.0, 4), (15.0, 5)] {
        let held_s = [[0.0; 6].as_slice(), &[held_s]].concat();
        let run = ArmRun { rest_s: 0.0, rate_noise: 1e-4, held_s, seed, ..ArmRun::default() };
        let (problem, fit) = identified(&run.recording(&model), &ALL);
        for (k, channel) in fit.channels.iter().enumerate() {
            let wanted = 0.3 * 0.9_f64.powi(k as i32);
            // Some 150 independent samples a joint and more: 6 % each.
            assert!(
                (channel.sigma / wanted - 1.0).abs() < 0.2,
                "joint {k}: {}, true {wanted}",
                channel.sigma
            );
        }
        let wanted = truth(&model, problem.tree().unwrap().base());
        let determined = wanted.iter().enumerate().filter(|(j, _)| fit.estimate.is_determined(*j));
        let (inside, all): (Vec<bool>, usize) = {
            let all: Vec<bool> = determined
                .map(|(j, wanted)| (fit.estimate.unjudged().values[j] - wanted).abs() < u95(&fit, j))
                .collect();
            let count = all.len();
            (all.into_iter().filter(|inside| *inside).collect(), count)
        };
        // Of 30 and more at 95 %.
        assert!(all > 25 && inside.len() + 6 >= all, "{} of {all}", inside.len());
    }
}

/// Nothing tells of the dry friction of a joint that never moves; that is said.
#[test]
fn dry_friction_of_a_joint_that_never_moves_is_not_sought() {
    let held_s = [[0.0; 6].as_slice(), &[20.0]].concat();
    let run = ArmRun { rate_noise: 1e-4, held_s, ..ArmRun::default() };
    let (problem, fit) = identified(&run.recording(&seven_axes()), &ALL);
    let last = fit.parameters.iter().position(|p| p.name == "l7_joint.coulomb").unwrap();
    assert!(!fit.estimate.is_determined(last) && fit.estimate.is_determined(last - 1));
    assert!(problem.notes.iter().any(|note| note.contains("never moving: l7_joint")), "{:?}", problem.notes);
}
