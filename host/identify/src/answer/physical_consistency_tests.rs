//! The distance of a tree's base parameters from those that bodies have.

use nalgebra::DVector;

use super::*;
use crate::problem::{Problem, ProblemOptions};
use rigident_fit::{Fit, FitOptions, Silent};
use rigident_io::recording::Recording;
use rigident_laboratory::trees::{seven_axes, seven_axis_recording, two_link_recording, two_links};

fn fitted(recording: &Recording, model: &Model) -> (Problem, Fit) {
    let problem = Problem::from_recording(recording, Some(model), &ProblemOptions::default()).unwrap();
    let fit = problem.fit(&FitOptions::default(), &Silent).unwrap();
    (problem, fit)
}

fn judge(model: &Model, recording: &Recording) -> PhysicalConsistency {
    let (problem, fit) = fitted(recording, model);
    let tree = problem.tree().unwrap();
    of_base_parameters(&tree.input().model, &BaseEstimate::of(&fit, tree.base())).unwrap()
}

#[test]
fn parameters_of_bodies_are_possible_with_noise_and_without() {
    let two = two_links();
    for noise in [None, Some(3), Some(8)] {
        let judged = judge(&two, &two_link_recording(&two, 200.0, 20.0, noise));
        assert!(judged.is_consistent() && judged.warning().is_none(), "{noise:?} {judged:?}");
    }
    let seven = seven_axes();
    let recording = seven_axis_recording(&seven, 200.0, 20.0, true, Some(4), 0.0);
    let judged = judge(&seven, &recording);
    assert!(judged.is_consistent(), "{judged:?}");
}

/// The rows are linear in the masses: bodies a thousand times as heavy are as near, in standard deviations.
#[test]
fn the_unit_of_mass_does_not_matter() {
    let two = two_links();
    let distance = |scale: f64, turned: f64| {
        let mut recording = two_link_recording(&two, 200.0, 20.0, Some(3));
        recording.wrench.iter_mut().flatten().flatten().for_each(|v| *v *= turned * scale);
        recording.rig.load_cell.noise_n_nm = recording.rig.load_cell.noise_n_nm.map(|n| n.map(|v| v * scale));
        judge(&two, &recording)
    };
    for turned in [1.0, -1.0] {
        let one = distance(1.0, turned);
        for scale in [0.01, 100.0, 1000.0] {
            let other = distance(scale, turned);
            assert_eq!(other.is_consistent(), one.is_consistent(), "{scale} {other:?} {one:?}");
            assert_eq!(other.reversed, one.reversed);
            assert!(
                (other.distance_sd - one.distance_sd).abs() < 0.01 + 0.01 * one.distance_sd,
                "{other:?} {one:?}"
            );
        }
    }
}

#[test]
fn reversed_signs_are_recognised_and_other_mistakes_are_reported() {
    let two = two_links();
    let mut reversed = two_link_recording(&two, 200.0, 20.0, Some(3));
    reversed.wrench.iter_mut().flatten().flatten().for_each(|v| *v = -*v);
    let judged = judge(&two, &reversed);
    assert!(judged.reversed && !judged.is_consistent(), "{judged:?}");
    assert!(judged.warning().unwrap().contains("wrench_sign"));
    // More than all was taken off the arm: the whole is heavy enough, the arm is no body.
    let mut hollow = two_links();
    hollow.links[1].nominal = hollow.links[1].nominal.map(|phi| phi.map(|v| -v));
    let judged = judge(&two, &two_link_recording(&hollow, 200.0, 20.0, Some(3)));
    assert!(!judged.reversed && !judged.is_consistent(), "{judged:?}");
    assert!(judged.warning().unwrap().contains("standard deviations away"));
    let seven = seven_axes();
    let mut recording = seven_axis_recording(&seven, 200.0, 20.0, true, Some(4), 0.0);
    let torques = recording.extra.iter_mut().filter(|(name, _)| name.ends_with("_nm"));
    torques.flat_map(|(_, cells)| cells).for_each(|cell| *cell = (-cell.parse::<f64>().unwrap()).to_string());
    let judged = judge(&seven, &recording);
    assert!(judged.reversed, "{judged:?}");
}

/// A single body's ten are all there is to know: the distance is that of the nearest body.
#[test]
fn it_is_as_far_as_the_nearest_of_many_bodies_tried() {
    let two = two_links();
    let mut hollow = two_links();
    hollow.links[1].nominal = hollow.links[1].nominal.map(|phi| phi.map(|v| -v));
    let wrong = two_link_recording(&hollow, 200.0, 20.0, Some(3));
    let (problem, fit) = fitted(&wrong, &two);
    let base = problem.tree().unwrap().base();
    let data = BaseEstimate::of(&fit, base);
    let judged = of_base_parameters(&two, &data).unwrap();
    let best = (&data.r * &data.values - &data.z).norm_squared();
    let map = base.map();
    // Random bodies around the truth: none is nearer.
    let mut seed = 9_u64;
    let mut uniform = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let truth = two.nominal();
    let mut tried = 0;
    for _ in 0..2000 {
        let share = 0.4 * (uniform() + 0.5);
        let phi: Vec<f64> = truth.iter().map(|v| v + share * uniform() * (v.abs() + 0.01)).collect();
        let is_body = phi
            .chunks_exact(10)
            .all(|link| rigident_model::inertial::impossibility(&std::array::from_fn(|k| link[k])).is_none());
        if !is_body {
            continue;
        }
        tried += 1;
        let square = (&data.r * (map.clone() * DVector::from_vec(phi)) - &data.z).norm_squared() - best;
        assert!(square >= judged.distance_sd.powi(2) * 0.95);
    }
    assert!(tried > 100, "{tried}");
}
