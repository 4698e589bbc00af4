//! The two ways to the base parameters agree, and neither depends on units or on how an axis lies.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::{Joint, Link};

use super::numerical::{Reduction, residual, sample};
use super::*;
use crate::human::Person;
use crate::tree::{Mimic, ModelLink};

/// Places and axes that are in no way special.
fn number(k: usize) -> f64 {
    ((k * k * 31 + k * 17 + 5) as f64).sin()
}

fn vector(k: usize) -> Vector3<f64> {
    Vector3::new(number(3 * k), number(3 * k + 1), number(3 * k + 2))
}

fn link(n: usize, parent: usize, joint: Joint<f64>, size: f64) -> ModelLink {
    let turn = nalgebra::Rotation3::from_scaled_axis(vector(n + 40)).into_inner();
    ModelLink::new(
        format!("l{n}"),
        if n == 0 { String::new() } else { format!("j{n}") },
        Link { parent, joint, rotation: turn, position: vector(n + 7) * size },
        None,
    )
}

/// Makes a chain of these joints, and a second chain of the same joints on its middle.
fn model(joints: &[Joint<f64>], size: f64) -> Model {
    let mut links = vec![link(0, 0, Joint::Free, size)];
    for branch in [0, joints.len() / 2] {
        let mut parent = branch;
        for joint in joints {
            links.push(link(links.len(), parent, *joint, size));
            parent = links.len() - 1;
        }
    }
    Model { name: "tree".to_owned(), links, findings: Vec::new(), gravity_mps2: None }
}

const FLOATING: Situation = Situation { floating: true, rows: Rows::Base, mimic: false };

fn kinds() -> [Joint<f64>; 6] {
    let skew = Vector3::new(0.3, -0.5, 0.7).normalize();
    [
        Joint::Revolute(skew),
        Joint::Spherical,
        Joint::Prismatic(skew),
        Joint::Universal(Vector3::x(), Vector3::y()),
        Joint::Revolute(-Vector3::y()),
        Joint::Free,
    ]
}

#[test]
fn rules_and_random_motions_agree_for_every_kind_of_joint_and_any_unit_of_length() {
    // Twice each: 7 for revolute, 9 for spherical and universal, 4 for prismatic, 10 for free, and 10 of the
    // base.
    let count = 10 + 2 * (7 + 9 + 4 + 9 + 7 + 10);
    for size in [1e-3, 1.0, 1e3] {
        let found = base_parameters(&model(&kinds(), size), &FLOATING).unwrap();
        assert_eq!(found.parameters.len(), count, "reach of {size} m");
        // Rounding through the rows' own condition, 1/kept.
        assert!(found.disagreement < 1e-13 / found.gap.kept, "{} {:?}", found.disagreement, found.gap);
        assert!(found.gap.dropped < 1e-13 && found.gap.kept > 1e-6, "{:?}", found.gap);
    }
}

#[test]
fn base_parameters_explain_rows_of_motions_they_were_not_found_from() {
    let (a, b) = (model(&kinds(), 1.0), FLOATING);
    let sampled = sample(&a.welded(), &b).unwrap();
    let columns: Vec<usize> = (0..sampled.columns()).collect();
    let reduction = Reduction::of(&sampled, &columns);
    let both = Situation { rows: Rows::Both, ..b };
    let others = sample(&a.welded(), &both).unwrap();
    assert!(residual(&others, &columns, &reduction) < 1e-13 / reduction.gap.kept);
}

#[test]
fn people_have_the_counts_of_the_papers_whatever_their_size() {
    for (height, mass) in [(1.2, 25.0), (1.741, 73.0), (2.1, 130.0)] {
        let person = Person { height_m: height, mass_kg: mass, ..Person::default() };
        let mut small = person.human34().unwrap();
        assert_eq!(base_parameters(&small, &FLOATING).unwrap().parameters.len(), 128);
        let racket = small.clone();
        small.hold_tool("r_hand@0.02,0,-0.1,30,0,10").unwrap();
        let with = base_parameters(&small, &FLOATING).unwrap();
        assert_eq!(with.parameters.len(), 128);
        assert_eq!(with.map(), base_parameters(&racket, &FLOATING).unwrap().map());
        assert_eq!(base_parameters(&person.human58().unwrap(), &FLOATING).unwrap().parameters.len(), 200);
    }
}

#[test]
fn a_person_whose_pelvis_is_held_still_loses_the_seven_that_only_its_turning_shows() {
    let still = Situation { floating: false, rows: Rows::Base, mimic: false };
    let found = base_parameters(&Person::default().human34().unwrap(), &still).unwrap();
    // The pelvis' six moments of inertia, and the first moment along gravity.
    assert_eq!(found.parameters.len(), 128 - 7);
}

/// The table of a base held still, by hand: gravity along z, joint torques.
#[test]
fn a_base_held_still_regroups_more_and_gravity_counts() {
    let torques = Situation { floating: false, rows: Rows::Joint, mimic: false };
    let one = |axis: Vector3<f64>| {
        let mut m = model(&[Joint::Revolute(axis)], 1.0);
        m.links.truncate(2);
        m.links[1].link.rotation = Matrix3::identity();
        base_parameters(&m, &torques).unwrap()
    };
    // About the vertical gravity has no moment: the moment of inertia alone. About a horizontal axis: two
    // first moments.
    let vertical = one(Vector3::z());
    assert_eq!(vertical.parameters.len(), 1);
    assert_eq!(vertical.parameters[0].name, "l1.Jzz");
    let names: Vec<String> = one(Vector3::y()).parameters.into_iter().map(|p| p.name).collect();
    assert_eq!(names, ["l1.MSz", "l1.MSx", "l1.Jyy"]);
    // Where the file states another gravity, that counts; without any the moment of inertia is left.
    let stated = |axis: Vector3<f64>, gravity: [f64; 3]| {
        let mut m = model(&[Joint::Revolute(axis)], 1.0);
        m.links.truncate(2);
        m.links[1].link.rotation = Matrix3::identity();
        m.gravity_mps2 = Some(gravity);
        base_parameters(&m, &torques).unwrap().parameters.len()
    };
    assert_eq!(stated(Vector3::y(), [0.0; 3]), 1);
    assert_eq!(stated(Vector3::z(), [0.0, 1.6, 0.0]), 3);
    assert_eq!(stated(Vector3::x(), [-9.81, 0.0, 0.0]), 1);
    // A slide: its mass, if it is not horizontal, or if it is: the force is m (ẍ + g·a).
    let mut slide = model(&[Joint::Prismatic(Vector3::x())], 1.0);
    slide.links.truncate(2);
    assert_eq!(base_parameters(&slide, &torques).unwrap().parameters.len(), 1);
}

#[test]
fn a_base_that_moves_identifies_the_same_set_without_torques_and_one_held_still_does_not() {
    let m = model(&kinds()[..5], 1.0);
    let count = |floating, rows| {
        let found = base_parameters(&m, &Situation { floating, rows, mimic: false }).unwrap();
        assert!(found.disagreement < 1e-13 / found.gap.kept, "{} {:?}", found.disagreement, found.gap);
        found.parameters.len()
    };
    assert!(count(false, Rows::Joint) <= count(false, Rows::Both));
    assert!(count(true, Rows::Joint) < count(true, Rows::Base));
    assert_eq!(count(true, Rows::Base), count(true, Rows::Both));
    assert!(count(false, Rows::Base) < count(true, Rows::Base));
}

#[test]
fn mimic_joints_count_as_their_own_unless_they_are_tied() {
    // Two pendulums side by side about parallel axes: one pendulum, once they are tied.
    let z = Joint::Revolute(Vector3::y());
    let mut m = model(&[z], 1.0);
    for l in &mut m.links {
        l.link.rotation = Matrix3::identity();
    }
    m.links[2].mimic = Some(Mimic { leader: "j1".to_owned(), multiplier: 1.0, offset: 0.0 });
    let count = |mimic| {
        let situation = Situation { floating: false, rows: Rows::Joint, mimic };
        base_parameters(&m, &situation).unwrap().parameters.len()
    };
    assert_eq!((count(false), count(true)), (6, 3));
}

#[test]
fn names_are_unique_and_every_parameter_is_led_by_a_column_of_its_own() {
    let found = base_parameters(&model(&kinds(), 1.0), &FLOATING).unwrap();
    let names: std::collections::BTreeSet<_> = found.parameters.iter().map(|p| &p.name).collect();
    let leaders: std::collections::BTreeSet<_> = found.parameters.iter().map(|p| p.terms[0].0).collect();
    assert_eq!((names.len(), leaders.len()), (found.parameters.len(), found.parameters.len()));
}
