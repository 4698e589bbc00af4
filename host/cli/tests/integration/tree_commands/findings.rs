//! Parts that are not used, not written or in another unit are reported with their place.

use super::*;

#[test]
fn a_tool_without_a_nominal_model_is_reported_to_change_nothing() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let words =
        ["identify", "arm.csv", "--model", "arm.urdf", "--tool", "plate@0,0,0.1", "--json", "--out", "o"];
    let found = answer(&rigident(place.path(), &[&words[..], &FRICTION].concat()));
    let said = in_words(&found);
    assert!(
        said.contains("--tool plate@0,0,0.1 changes nothing") && said.contains("take the difference"),
        "{said}"
    );
}

#[test]
fn a_model_that_cannot_be_written_there_leaves_nothing_behind() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--write-model", "none/a.urdf", "--out", "o"];
    let said = complaint(&rigident(place.path(), &words));
    assert!(said.contains("--write-model none/a.urdf: its folder is not there"), "{said}");
    assert!(!place.path().join("o").exists());
    // What another language does not say.
    let words = [
        "identify",
        "arm.csv",
        "--model",
        "arm.urdf",
        "--write-model",
        "a.sdf",
        "--lock",
        "elbow=0.1",
        "--json",
        "--out",
        "p",
    ];
    std::fs::write(place.path().join("arm.csv"), {
        let csv = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
        csv.replace("elbow_rad", "other")
    })
    .unwrap();
    let said = answer(&rigident(place.path(), &words))["warnings"].to_string();
    assert!(said.contains("a.sdf: joints that were locked are fixed in it: elbow=0.1"), "{said}");
}

#[test]
fn columns_in_other_units_are_named_though_the_right_ones_are_there() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let csv = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
    let (header, rows) = csv.split_once('\n').unwrap();
    let said = |header: &str| {
        // A column more, of ones.
        let rows = rows.replace('\n', ",1\n");
        std::fs::write(place.path().join("bad.csv"), format!("{header}\n{rows}")).unwrap();
        complaint(&rigident(place.path(), &["identify", "bad.csv", "--model", "arm.urdf", "--out", "never"]))
    };
    let rate = said(&format!("{header},shoulder_degps"));
    assert!(rate.contains("column shoulder_degps of joint shoulder is in another unit"), "{rate}");
    let torque = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_lbfin,x");
    assert!(torque.contains("column elbow_lbfin of joint elbow is in another unit"), "{torque}");
    let angle = said("t_s,shoulder_rad,elbow_deg,shoulder_nm,elbow_nm,x");
    assert!(angle.contains("column elbow_deg of joint elbow is in another unit"), "{angle}");
    let effort = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_current,x");
    assert!(effort.contains("There are columns elbow_current"), "{effort}");
}

#[test]
fn a_cell_is_named_by_file_and_line() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let csv = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
    let mut lines: Vec<String> = csv.lines().map(str::to_owned).collect();
    let broken = lines[49].rsplit_once(',').map(|(before, _)| format!("{before},nan")).unwrap();
    lines[49] = broken;
    lines.insert(0, "# a comment".to_owned());
    std::fs::write(place.path().join("arm.csv"), lines.join("\n")).unwrap();
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--out", "never"];
    let said = complaint(&rigident(place.path(), &words));
    assert!(said.contains("arm.csv: column elbow_nm, line 51:"), "{said}");
}

#[test]
fn a_robot_s_recording_without_a_model_is_distinguished_from_a_body_s() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let said = complaint(&rigident(place.path(), &["identify", "arm.csv", "--out", "never"]));
    assert!(said.contains("shoulder_… are of a robot's joints") && said.contains("--model FILE"), "{said}");
    // Two links without the rig file that says so.
    two_links(place.path(), Vector3::z());
    std::fs::rename(place.path().join("two.csv"), place.path().join("one.csv")).unwrap();
    let found = answer(&rigident(place.path(), &["identify", "one.csv", "--json", "--out", "o"]));
    let said = in_words(&found);
    assert!(said.contains("columns of other links are not used: imu1_…, q1_…"), "{said}");
}

const BALL: &str = r#"<robot name="ball"><link name="foot"/><link name="v1"/><link name="v2"/>
<link name="arm"><inertial><origin xyz="0.03 -0.02 0.13"/><mass value="2"/><inertia ixx="0.023" ixy="0.002" ixz="0.001" iyy="0.02" iyz="0.003" izz="0.015"/></inertial></link>
<joint name="a1" type="continuous"><origin xyz="0 0 0.4"/><parent link="foot"/><child link="v1"/><axis xyz="0 0 1"/></joint>
<joint name="a2" type="continuous"><parent link="v1"/><child link="v2"/><axis xyz="0 1 0"/></joint>
<joint name="a3" type="continuous"><parent link="v2"/><child link="arm"/><axis xyz="1 0 0"/></joint></robot>"#;

/// Angles and torques of three motors whose axes meet in a point.
fn ball(place: &Path) -> Model {
    std::fs::write(place.join("ball.urdf"), BALL).unwrap();
    let model = open(place.join("ball.urdf").to_str().unwrap(), &Person::default()).unwrap().0;
    let base = BaseMotion::still([0.0, 0.0, -9.80665]);
    let mut csv = "t_s,a1_rad,a2_rad,a3_rad,a1_nm,a2_nm,a3_nm\n".to_owned();
    for row in 0..5000 {
        let t = f64::from(row) / 500.0;
        let s = [0, 1, 2].map(|k| swing(t, k, 0.6));
        let part = |n: usize| s.map(|joint| joint[n]);
        let forces = inverse_dynamics(&model, &base, &part(0), &part(1), &part(2)).unwrap();
        let torque = |k: usize| forces[6 + k] + 0.01 * noise(3 * row as usize + k);
        let _ = writeln!(
            csv,
            "{t},{},{},{},{},{},{}",
            s[0][0],
            s[1][0],
            s[2][0],
            torque(0),
            torque(1),
            torque(2)
        );
    }
    std::fs::write(place.join("ball.csv"), csv).unwrap();
    model
}

#[test]
fn three_revolutes_that_meet_are_identified_from_their_angles_and_torques() {
    let place = tempfile::tempdir().unwrap();
    let model = ball(place.path());
    let words = ["identify", "ball.csv", "--model", "ball.urdf", "--json", "--out"];
    let found = answer(&rigident(
        place.path(),
        &[&words[..], &["o", "--spherical", "a1,a2,a3", "--write-model", "out.urdf"]].concat(),
    ));
    assert_eq!(found["status"], "identified", "{found:#}");
    // A body turned about a point, gravity fixed: its first moment and its tensor about the point.
    let parameters = found["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 9, "{found:#}");
    let phi = model.links[model.link("arm").unwrap()].nominal.unwrap();
    for (name, value) in [
        ("arm.MSx", phi[1]),
        ("arm.MSy", phi[2]),
        ("arm.MSz", phi[3]),
        ("arm.Jxx", phi[4]),
        ("arm.Jxy", phi[9]),
    ] {
        let p = parameters.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name}: {found:#}"));
        let (got, u95) = (p["value"].as_f64().unwrap(), p["u95"].as_f64().unwrap());
        assert!((got - value).abs() < 3.0 * u95, "{p} {value}");
    }
    let text = std::fs::read_to_string(place.path().join("out.urdf")).unwrap();
    assert!(text.contains("<link name=\"v1\"/>") && text.contains("joint name=\"a2\""), "{text}");
}

#[test]
fn columns_of_one_revolute_joint_are_refused_for_a_spherical_joint() {
    let place = tempfile::tempdir().unwrap();
    ball(place.path());
    let csv = std::fs::read_to_string(place.path().join("ball.csv")).unwrap();
    std::fs::write(place.path().join("ball.csv"), csv.replace("a1_rad", "other")).unwrap();
    let words = ["identify", "ball.csv", "--model", "ball.urdf", "--spherical", "a1,a2,a3", "--out", "never"];
    let said = complaint(&rigident(place.path(), &words));
    assert!(said.contains("a3 is a spherical joint here") && said.contains("angles of all three"), "{said}");
}

#[test]
fn options_of_people_are_refused_for_robots() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    for words in [&["--height-m", "1.8"][..], &["--segment", "thigh=0.4"], &["--sex", "female"]] {
        let identify = [&["identify", "arm.csv", "--model", "arm.urdf", "--out", "never"], words].concat();
        let count = [&["model", "base-params", "arm.urdf"], words].concat();
        for words in [identify, count] {
            let said = complaint(&rigident(place.path(), &words));
            assert!(said.contains("describe human34 and human58"), "{said}");
        }
    }
}

fn example(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples").join(name).display().to_string()
}

#[test]
fn the_example_of_two_links_is_identified() {
    let place = tempfile::tempdir().unwrap();
    let recording = example("two-links.csv");
    let found = answer(&rigident(place.path(), &["identify", &recording, "--json", "--out", "o"]));
    assert_eq!(found["status"], "identified", "{found:#}");
    // 10 + 7 and six offsets; the truth that its rig file names.
    assert_eq!(found["parameters"].as_array().unwrap().len(), 23);
    let mass = found["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "base.M").unwrap();
    let (value, u95) = (mass["value"].as_f64().unwrap(), mass["u95"].as_f64().unwrap());
    assert!((value - 3.4).abs() < 2.0 * u95 && u95 < 0.05, "{mass}");
    let output =
        rigident(place.path(), &["model", "base-params", &example("two-links.rig.toml"), "--floating"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("17 base parameters of 20"));
}

/// The antennas, lasers and frames of published descriptions are such: mass without inertia, rounded moments,
/// moments without mass.
#[test]
fn odd_links_on_fixed_joints_are_corrected_with_a_word_and_block_nothing() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let truth = open(place.path().join("arm.urdf").to_str().unwrap(), &Person::default()).unwrap().0;
    let odd = |name: &str, mass: &str, [x, y, z]: [&str; 3]| {
        let holder = &truth.links.last().unwrap().name;
        format!(
            "<link name=\"{name}\"><inertial><mass value=\"{mass}\"/><inertia ixx=\"{x}\" ixy=\"0\" \
             ixz=\"0\" iyy=\"{y}\" iyz=\"0\" izz=\"{z}\"/></inertial></link><joint name=\"to_{name}\" \
             type=\"fixed\"><parent link=\"{holder}\"/><child link=\"{name}\"/></joint>"
        )
    };
    let links = odd("antenna", "0.01", ["0", "0", "0"])
        + &odd("laser", "0.01", ["1e-6", "1e-6", "2.001e-6"])
        + &odd("frame", "0", ["1e-6", "1e-6", "1e-6"]);
    std::fs::write(place.path().join("odd.urdf"), ARM.replace("</robot>", &(links + "</robot>"))).unwrap();
    for (n, file) in ["out.urdf", "out.xml"].into_iter().enumerate() {
        let out = format!("o{n}");
        let words =
            ["identify", "arm.csv", "--model", "odd.urdf", "--json", "--out", &out, "--write-model", file];
        let found = answer(&rigident(place.path(), &[&words[..], &FRICTION].concat()));
        let said = in_words(&found);
        for why in [
            "antenna: no distribution of mass",
            "ball of 0.027 m",
            "plate a tenth as thick as wide",
            "frame: it has moments of inertia and no mass; where every link has to be a body it is left out",
        ] {
            assert!(said.contains(why), "{why}: {said}");
        }
        let full = found["standard_parameters"]["links"].as_array().unwrap();
        assert_eq!(full.len(), 6, "{full:?}");
        let written = open(place.path().join(file).to_str().unwrap(), &Person::default()).unwrap().0;
        let torques = |model: &Model| {
            let base = BaseMotion::still([0.0, 0.0, -9.80665]);
            inverse_dynamics(model, &base, &[0.5, -0.8], &[1.0, 2.0], &[-3.0, 4.0]).unwrap()[6..].to_vec()
        };
        for (a, b) in torques(&written).iter().zip(torques(&truth)) {
            assert!((a - b).abs() < 0.05, "{file}: {a} {b}");
        }
    }
}
