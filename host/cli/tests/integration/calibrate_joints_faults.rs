//! Bad input of `rigident calibrate joints`: what is wrong is named, and no wrong number comes with a small
//! interval.

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use rigident::joint_offsets::Pose;
use rigident::joint_offsets::faults::right_angles;
use rigident::laboratory::standing::{contacts, csv};

use crate::calibrate_joints::{Files, offsets};
use crate::calibrate_joints_contacts::flat_poses;
use crate::program::{json, said, status};
use crate::study_length::runs;

/// An identified number may be off by no more than this many U95.
const OFF: f64 = 2.0;

/// Runs changed poses and returns what is said; an answer is to hold the truth.
fn refusal(files: &Files, poses: &[Pose], what: &str) -> Option<String> {
    files.write("poses.csv", &csv(&files.setup, poses));
    let output = files.run(&["--json"]);
    if status(&output) == 2 {
        return Some(said(&output));
    }
    for ((joint, own), truth) in offsets(&json(&output)).iter().zip(&files.truth) {
        if let Some([value, u95]) = own {
            assert!((value - truth).abs() <= OFF * u95, "{what}: {joint} {value} ± {u95}, truth {truth}");
        }
    }
    None
}

/// The refusal of changed poses, with a word that it holds.
fn refused(files: &Files, change: impl Fn(&mut Pose), word: &str) {
    let mut poses = files.poses.clone();
    poses.iter_mut().for_each(change);
    let said = refusal(files, &poses, word).unwrap_or_else(|| panic!("not refused: {word}"));
    assert!(said.contains(word), "{word}: {said}");
}

#[test]
fn an_imu_turned_by_right_angles_is_reported_and_the_turn_to_write_works() {
    let files = Files::new();
    let turns = right_angles().into_iter().map(|turn| UnitQuaternion::from_rotation_matrix(&turn));
    let turns: Vec<_> = turns.filter(|turn| turn.angle() > 1e-6).collect();
    assert_eq!(turns.len(), 23);
    for turn in turns.into_iter().step_by(runs(1, 6) as usize) {
        // The IMU's axes go to the link's by `turn`.
        let mut poses = files.poses.clone();
        poses.iter_mut().for_each(|pose| pose.attitudes[0] *= turn);
        let said = refusal(&files, &poses, "turned").expect("refused");
        let written = said.split("rotation_wxyz = ").nth(1).unwrap_or_else(|| panic!("{turn}: {said}"));
        let list = &written[..=written.find(']').unwrap()];
        files.write(
            "soles.toml",
            &format!("{}\n[[imu]]\nlink = \"pelvis\"\nrotation_wxyz = {list}\n", contacts()),
        );
        let output = files.run(&["--json"]);
        assert_eq!(status(&output), 0, "{turn}: {said} {}", crate::program::said(&output));
        files.write("soles.toml", &contacts());
    }
}

#[test]
fn attitudes_the_other_way_round_are_reported_and_a_world_with_z_down_does_no_harm() {
    let files = Files::new();
    refused(&files, |pose| pose.attitudes[0] = pose.attitudes[0].inverse(), "the other way round");
    // A plane is one from above and from below.
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let mut poses = files.poses.clone();
    poses.iter_mut().for_each(|pose| pose.attitudes[0] = down * pose.attitudes[0]);
    assert!(refusal(&files, &poses, "z down").is_none());
}

#[test]
fn signs_units_and_exchanged_columns_are_reported() {
    let files = Files::new();
    for k in (0..7).step_by(runs(1, 6) as usize) {
        let name = files.setup.tree.joint_name(files.setup.joints[k]).to_owned();
        for (what, change) in [
            ("sign", Box::new(|q: f64| -q) as Box<dyn Fn(f64) -> f64>),
            ("degrees", Box::new(|q: f64| q.to_degrees() / 8.0)),
            ("half", Box::new(|q: f64| 0.5 * q)),
        ] {
            if what != "sign" && k % 3 > 0 {
                continue;
            }
            let mut poses = files.poses.clone();
            poses.iter_mut().for_each(|pose| pose.positions[k] = change(pose.positions[k]));
            let said = refusal(&files, &poses, &format!("{what} {name}"));
            if what == "sign" {
                let said = said.unwrap_or_else(|| panic!("{name}"));
                assert!(said.contains(&format!("{name} counts the other way")), "{said}");
            }
        }
    }
    // Angles of shanks that turn little do not look too large in degrees.
    refused(
        &files,
        |pose| pose.positions[4] = pose.positions[4].clamp(-0.2, 0.2).to_degrees(),
        "left_shank_z",
    );
    refused(&files, |pose| pose.positions.swap(3, 10), "left_knee_y and right_knee_y are exchanged");
    let mut poses = files.poses.clone();
    poses.iter_mut().enumerate().for_each(|(k, pose)| pose.stands[k % 2] = k % 3 > 0);
    assert!(refusal(&files, &poses, "honest").is_none());
}

#[test]
fn a_floor_that_leans_or_a_step_gives_no_wrong_number() {
    let files = Files::new();
    let mut named = 0;
    for degrees in [0.1, 0.3, 0.6, 1.0, 2.0, 5.0] {
        for axis in [Vector3::x_axis(), Vector3::y_axis()] {
            let lean = UnitQuaternion::from_axis_angle(&axis, f64::to_radians(degrees));
            for one_way in [false, true] {
                let mut poses = files.poses.clone();
                for pose in &mut poses {
                    if one_way {
                        let (_, _, yaw) = pose.attitudes[0].euler_angles();
                        let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw);
                        pose.attitudes[0] = UnitQuaternion::from_rotation_matrix(&back) * pose.attitudes[0];
                    }
                    pose.attitudes[0] = lean * pose.attitudes[0];
                }
                let said = refusal(&files, &poses, &format!("floor {degrees} {axis:?} {one_way}"));
                if said.is_some_and(|said| said.contains("the floor leans")) {
                    named += 1;
                }
            }
        }
    }
    assert!(named >= 12, "{named}");
    let mut named = 0;
    for mm in [1.0, 3.0, 6.0, 10.0, 20.0, 50.0] {
        let poses = flat_poses(&files.setup, 40, &files.truth, &|_| {}, &[], [1e-3 * mm, 0.0]);
        let said = refusal(&files, &poses, &format!("step {mm}"));
        named += u32::from(
            said.is_some_and(|said| said.contains("the sole left stands") && said.contains("higher")),
        );
    }
    assert!(named >= 4, "{named}");
}

#[test]
fn one_foot_on_a_step_in_some_poses_is_named_with_the_foot() {
    let files = Files::new();
    let mut poses = flat_poses(&files.setup, 40, &files.truth, &|_| {}, &[], [0.0; 2]);
    let raised = flat_poses(&files.setup, 3, &files.truth, &|_| {}, &[], [0.03, 0.0]);
    poses[5..8].clone_from_slice(&raised);
    for (k, pose) in poses.iter_mut().enumerate() {
        pose.name = format!("pose {}", k + 1);
    }
    files.write("poses.csv", &csv(&files.setup, &poses));
    let output = files.run(&[]);
    let said = said(&output);
    assert_eq!(status(&output), 0, "{said}");
    for name in ["pose 6", "pose 7", "pose 8"] {
        assert!(said.contains(&format!("{name} is left out")), "{said}");
    }
}

#[test]
fn an_imu_mounted_askew_gives_no_wrong_number() {
    let files = Files::new();
    for degrees in [0.2, 0.5, 1.0, 3.0, 10.0] {
        for axis in [Vector3::x_axis(), Vector3::y_axis()] {
            let askew = UnitQuaternion::from_axis_angle(&axis, f64::to_radians(degrees));
            let mut poses = files.poses.clone();
            poses.iter_mut().for_each(|pose| pose.attitudes[0] *= askew);
            refusal(&files, &poses, &format!("mounting {degrees} {axis:?}"));
        }
    }
}
