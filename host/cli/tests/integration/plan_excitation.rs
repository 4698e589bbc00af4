//! `rigident plan excitation`, as a user types it.

use std::path::Path;

use crate::program::{complaint, json, rigident, said, status};

/// An arm of two joints with limits and a box, and a tool.
pub const ARM: &str = r#"<robot name="arm"><link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
<link name="upper"><inertial><origin xyz="0.02 0.01 0.2"/><mass value="3"/><inertia ixx="0.04" iyy="0.05" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0.01 0.02 0.15"/><mass value="1.5"/><inertia ixx="0.01" iyy="0.012" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/><axis xyz="1 0 0"/><limit lower="-2" upper="2" velocity="2" effort="20"/></joint>
<joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0 0 0.3"/></joint></robot>"#;

fn place() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("arm.urdf"), ARM).unwrap();
    place
}

fn plan(place: &Path, more: &[&str]) -> std::process::Output {
    let words = ["plan", "excitation", "arm.urdf", "--duration-s", "4", "--restarts", "1"];
    rigident(place, &[&words[..], more].concat())
}

#[test]
fn a_trajectory_is_written_for_identify_and_for_ros() {
    let place = place();
    let output = plan(place.path(), &["-o", "a.csv", "-o", "a.yaml", "--floor-m", "0", "--json"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let object = json(&output);
    assert_eq!(object["joints"].as_array().unwrap().len(), 2);
    assert!(object["u95_over_before"].as_f64().unwrap() < 1.0);
    for joint in object["joints"].as_array().unwrap() {
        assert!(
            joint["range_share"].as_f64().unwrap() <= 0.95 && joint["speed_share"].as_f64().unwrap() <= 0.9
        );
        assert!(joint["effort_share"].as_f64().unwrap() <= 0.8);
    }
    assert!(object["nearest"]["distance_m"].as_f64().unwrap() >= 0.01);
    let table = std::fs::read_to_string(place.path().join("a.csv")).unwrap();
    assert!(table.starts_with("t_s,shoulder_rad,shoulder_radps,elbow_rad,elbow_radps\n"));
    assert_eq!(table.lines().count(), 802);
    let message = std::fs::read_to_string(place.path().join("a.yaml")).unwrap();
    assert!(
        message.contains(
            "joint_names:\n- \"shoulder\"\n- \"elbow\"\npoints:\n- positions: [0.000000, 0.000000]"
        )
    );
    // Columns are those that `identify` and `predict` read.
    let output = rigident(place.path(), &["predict", "arm.urdf", "a.csv", "--json"]);
    assert!(!said(&output).contains("_rad"), "{}", said(&output));
    assert!(complaint(&plan(place.path(), &["-o", "a.csv"])).contains("a.csv"));
}

#[test]
fn joints_that_are_held_stand_in_the_files_and_not_in_the_plan() {
    let place = place();
    let output =
        plan(place.path(), &["--joints", "elbow", "--start", "shoulder=0.3", "-o", "a.csv", "--json"]);
    let object = json(&output);
    assert!(said(&output).contains("--lock"), "{}", said(&output));
    assert_eq!(object["held"], serde_json::json!([{"name": "shoulder", "at": 0.3}]));
    let table = std::fs::read_to_string(place.path().join("a.csv")).unwrap();
    assert!(table.lines().nth(100).unwrap().contains(",0.300000000,0.000000000,"));
}

#[test]
fn bad_input_is_named() {
    let place = place();
    let refused = |more: &[&str]| complaint(&plan(place.path(), more));
    std::fs::write(place.path().join("wrong.toml"), "[[box]]\nlink = \"hand\"\nsize_m = [1, 1, 1]\n")
        .unwrap();
    std::fs::write(place.path().join("flat.toml"), "[[box]]\nlink = \"tool\"\nsize_m = [1, 0, 1]\n").unwrap();
    for (more, said) in [
        (&["--bandwidth-hz", "0.3"][..], "two harmonics: --duration-s 6.6"),
        (&["--joints", "wrist"], "there are shoulder, elbow"),
        (&["--start", "wrist=1"], "no joint wrist"),
        (&["--start", "elbow=3"], "joint elbow starts at 3.0000"),
        (&["--effort", "elbow=0.1"], "joint elbow needs"),
        (&["--speed", "elbow=-1"], "above zero"),
        (&["--range", "elbow=1"], "JOINT=LOW,HIGH"),
        (&["--boxes", "wrong.toml"], "no link hand"),
        (&["--boxes", "flat.toml"], "size_m"),
        (&["--boxes", "none.toml"], "none.toml"),
        (&["-o", "a.txt"], ".csv or .yaml"),
        (&["--effort-share", "2"], "1 at most"),
        (&["--floor-m", "0.9"], "floor"),
        (&["--friction", "wrist=viscous"], "no joint wrist"),
        (&["--rows", "base", "--friction", "viscous"], "--rows both"),
        (&["--lock", "shoulder,elbow"], "no joint that moves"),
    ] {
        let words = refused(more);
        assert!(words.contains(said), "{more:?}: {words}");
    }
    let without = ARM.replace(" velocity=\"2\" effort=\"20\"", " velocity=\"0\" effort=\"0\"");
    std::fs::write(place.path().join("arm.urdf"), without).unwrap();
    let words = refused(&[]);
    assert!(words.contains("--speed elbow=1") && words.contains("--effort elbow=50"), "{words}");
    let output = rigident(place.path(), &["plan", "excitation", "human34"]);
    assert!(complaint(&output).contains("person"));
}
