//! MJCF bodies of several joints: chains whose links before the last are no bodies.

use nalgebra::{DMatrix, Vector3};
use rigident_shared::tree::{BaseMotion, Joint};

use crate::base::{Rows, Situation, base_parameters};
use crate::dynamics::inverse_dynamics;
use crate::xml::Language;
use crate::{Model, ModelLink, mjcf, write};

/// Returns a torso with a leg, as in MuJoCo's humanoid; `hip` are the thigh's joints.
fn leg(hip: &str) -> Model {
    let text = format!(
        "<mujoco model=\"leg\"><compiler angle=\"degree\"/><worldbody><body name=\"torso\" pos=\"0 0 1.3\"><freejoint/>
           <inertial pos=\"0.01 0.02 0.1\" mass=\"8\" fullinertia=\"0.2 0.25 0.15 0.01 0.02 0.01\"/>
           <body name=\"thigh\" pos=\"0 -0.1 -0.04\" euler=\"10 0 20\">{hip}
             <inertial pos=\"0.01 0.01 -0.17\" mass=\"4\" fullinertia=\"0.06 0.05 0.02 0.001 0.002 0.003\"/>
             <body name=\"shin\" pos=\"0 0.01 -0.4\">
               <joint name=\"knee\" type=\"hinge\" pos=\"0 0 0.02\" axis=\"0 -1 0\"/>
               <inertial pos=\"0 0.01 -0.15\" mass=\"2\" fullinertia=\"0.03 0.03 0.01 0.001 0.001 0.002\"/>
         </body></body></body></worldbody></mujoco>"
    );
    mjcf::parse(&text, "leg.xml").unwrap().model
}

fn hinge(name: &str, axis: &str, pos: &str) -> String {
    format!("<joint name=\"{name}\" type=\"hinge\" axis=\"{axis}\" pos=\"{pos}\"/>")
}

fn three(pos: &str) -> String {
    hinge("hip_x", "1 0 0", pos) + &hinge("hip_z", "0 0 1", pos) + &hinge("hip_y", "0 1 0", pos)
}

fn number(k: usize) -> f64 {
    ((k * k * 31 + k * 17 + 5) as f64).sin()
}

fn states(model: &Model, count: usize) -> Vec<Vec<f64>> {
    let n = model.freedoms();
    (0..count)
        .map(|s| {
            let part = |k: usize| (0..n).map(|i| 2.0 * number(97 * s + 13 * k + i)).collect::<Vec<f64>>();
            let base = BaseMotion {
                specific_force: Vector3::new(number(s), number(s + 1), 9.0 + number(s + 2)),
                rate: Vector3::new(number(s + 3), number(s + 4), number(s + 5)),
                angular_acceleration: Vector3::new(number(s + 6), number(s + 7), number(s + 8)),
            };
            inverse_dynamics(model, &base, &part(1), &part(2), &part(3)).unwrap()
        })
        .collect()
}

/// Returns the rank of the forces' dependence on the bodies' parameters, by inverse dynamics alone:
/// differences of forces for bodies that are heavier by a bit in one parameter. That is the number of
/// parameters that can be distinguished.
fn rank(model: &Model) -> usize {
    let flat = |m: &Model| states(m, 60).concat();
    let reference = flat(model);
    let mut columns = Vec::new();
    for (i, link) in model.links.iter().enumerate().filter(|(_, l)| l.is_body()) {
        for k in 0..10 {
            let mut other = model.clone();
            let mut phi = link.nominal.unwrap();
            phi[k] += 0.5;
            other.links[i].nominal = Some(phi);
            columns.push(flat(&other).iter().zip(&reference).map(|(a, b)| a - b).collect::<Vec<f64>>());
        }
    }
    let rows = columns[0].len();
    let matrix = DMatrix::from_fn(rows, columns.len(), |r, c| columns[c][r]);
    let s = matrix.svd(false, false).singular_values;
    s.iter().filter(|v| **v > 1e-9 * s.max()).count()
}

const FLOATING: Situation = Situation { floating: true, rows: Rows::Base, mimic: false };

#[test]
fn several_joints_of_a_body_are_a_chain_of_links_that_are_none() {
    let model = leg(&three("0 0 0.01"));
    let names: Vec<&str> = model.links.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["torso", "thigh#1", "thigh#2", "thigh", "shin"]);
    assert_eq!(model.findings, []);
    assert_eq!(
        model.links.iter().map(ModelLink::is_body).collect::<Vec<_>>(),
        [true, false, false, true, true]
    );
}

#[test]
fn base_parameters_are_as_many_as_inverse_dynamics_can_tell_apart() {
    let slide = "<joint name=\"out\" type=\"slide\" axis=\"0 1 1\"/>";
    for (hip, count) in [
        // One point: 9 of a ball, 7 of the knee beside the torso's ten.
        (three("0 0 0.01"), Some(26)),
        // Two through one point: a universal joint.
        (hinge("a", "1 0 0", "0 0 0") + &hinge("b", "0 1 0", "0 0 0"), Some(26)),
        // Apart, skew, and with a slide: all of the thigh's.
        (hinge("a", "1 0 0", "0 0 0") + &hinge("b", "0 1 0", "0.02 0 0.05"), None),
        (hinge("a", "1 0.3 0", "0 0 0.01") + &hinge("b", "0 1 0.2", "0 0 0.01"), None),
        (slide.to_owned() + &hinge("b", "0 1 0.2", "0 0 0.01"), None),
        (slide.to_owned() + &three("0 0.02 0"), None),
    ] {
        let model = leg(&hip);
        let found = base_parameters(&model, &FLOATING).unwrap();
        assert_eq!(found.parameters.len(), rank(&model), "{hip}");
        assert!(count.is_none_or(|count| found.parameters.len() == count), "{hip}");
        assert_eq!(found.standard_count(), 30);
        let names: std::collections::BTreeSet<&str> =
            found.parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names.len(), found.parameters.len(), "{names:?}");
        for parameter in &found.parameters {
            for (column, _) in &parameter.terms {
                assert!(!found.standard[*column].contains('#'), "{parameter:?}");
            }
        }
        // On a base held still the joints' rows know fewer, found by the same two ways.
        let still = Situation { floating: false, rows: Rows::Joint, mimic: false };
        assert!(base_parameters(&model, &still).unwrap().parameters.len() < found.parameters.len());
    }
}

#[test]
fn three_hinges_through_one_point_may_be_a_ball() {
    let mut model = leg(&three("0 0 0.01"));
    model.declare_spherical(&["hip_x", "hip_z", "hip_y"].map(str::to_owned)).unwrap();
    assert_eq!(model.links.len(), 3);
    assert_eq!(model.links[1].link.joint, Joint::Spherical);
    assert_eq!(base_parameters(&model, &FLOATING).unwrap().parameters.len(), 26);
    let mut apart = leg(&(hinge("a", "1 0 0", "0 0 0")
        + &hinge("b", "0 0 1", "0 0.01 0")
        + &hinge("c", "0 1 0", "0 0 0")));
    let said = apart.declare_spherical(&["a", "b", "c"].map(str::to_owned)).unwrap_err().to_string();
    assert!(said.contains("the axis of b misses"), "{said}");
}

#[test]
fn such_bodies_are_written_with_their_joints_and_have_the_same_inverse_dynamics() {
    let slide = "<joint name=\"out\" type=\"slide\" axis=\"0 1 1\" pos=\"0.03 0 0\"/>";
    let model =
        leg(&(slide.to_owned() + &hinge("a", "1 0.3 0", "0 0 0.01") + &hinge("b", "0 1 0.2", "0.02 0 0.05")));
    let wanted = states(&model, 5).concat();
    let scale = wanted.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for language in [Language::Urdf, Language::Mjcf] {
        let text = write::generated(&model, language).unwrap();
        let again = write::parse(&text, "again").unwrap().model;
        assert_eq!(again.freedoms(), model.freedoms());
        for (a, b) in states(&again, 5).concat().iter().zip(&wanted) {
            assert!((a - b).abs() < 1e-9 * scale, "{language:?}: {a} {b}");
        }
        if language == Language::Mjcf {
            assert_eq!(text.matches("<body").count(), 3, "{text}");
            // Written without the free joint of its base, it hangs on the world.
            let bodies: Vec<&str> =
                again.links.iter().filter(|l| l.is_body()).map(|l| l.name.as_str()).collect();
            assert_eq!(bodies, ["world", "torso", "thigh", "shin"]);
        }
    }
    let said = write::generated(&model, Language::Sdf).unwrap_err().to_string();
    assert!(said.contains("thigh#1") && said.contains("`spherical`"), "{said}");
}

#[test]
fn unread_attributes_of_a_joint_are_reported_and_do_not_cast_doubt_on_the_links() {
    let joint = "<joint name=\"hip\" type=\"ball\" armature=\"0.01\" damping=\"0.5\" stiffness=\"0\"/>";
    let said: Vec<String> = leg(joint).findings.iter().map(ToString::to_string).collect();
    // What a hinge does by itself has columns.
    let turning = joint.replace("\"ball\"", "\"hinge\" axis=\"0 1 0\"");
    assert!(leg(&turning).findings.is_empty());
    assert!(
        matches!(said.as_slice(), [one] if one.contains("joint hip") && one.contains("armature, damping:") && !one.contains("stiffness")),
        "{said:?}"
    );
    assert!(leg(&hinge("hip", "0 1 0", "0 0 0")).findings.is_empty());
}

/// Ranges are in the file's unit, a force that is not the same both ways is limited by the smaller one, and
/// what is switched off is none.
#[test]
fn limits_of_joints_are_read_with_their_classes() {
    let text = r#"<mujoco><default><joint range="-90 45"/></default><worldbody><body name="a"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <body name="b"><joint name="hinge" actuatorfrcrange="-20 30"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <body name="c"><joint name="slide" type="slide" range="-0.1 0.2"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <body name="d"><joint name="free" limited="false" range="x"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        </body></body></body></body></worldbody></mujoco>"#;
    let model = mjcf::parse(text, "x").unwrap().model;
    let limits = |name: &str| model.links[model.joint(name).unwrap()].limits;
    let [low, high] = limits("hinge").position.unwrap();
    assert!(
        (low + std::f64::consts::FRAC_PI_2).abs() < 1e-12
            && (high - std::f64::consts::FRAC_PI_4).abs() < 1e-12
    );
    assert_eq!((limits("hinge").effort, limits("hinge").velocity), (Some(20.0), None));
    assert_eq!(limits("slide").position, Some([-0.1, 0.2]));
    assert_eq!(limits("free").position, None);
}
