//! Recordings of an arm that cannot be true: each is refused, and the fault is named.

use super::*;

/// Columns of `arm.csv`: positions of shoulder and elbow, then their torques.
const POSITIONS: [usize; 2] = [1, 2];
const TORQUES: [usize; 2] = [3, 4];

/// Identifies the arm with its columns changed, by row and cells; returns exit status and answer.
fn changed(place: &Path, words: &[&str], change: impl Fn(usize, &mut [f64])) -> (i32, Value) {
    let csv = std::fs::read_to_string(place.join("arm.csv")).unwrap();
    let (header, rows) = csv.split_once('\n').unwrap();
    let mut text = format!("{header}\n");
    for (row, line) in rows.lines().enumerate() {
        let mut cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        change(row, &mut cells);
        let _ = writeln!(text, "{}", cells.iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    }
    std::fs::write(place.join("bad.csv"), text).unwrap();
    std::fs::copy(place.join("arm.rig.toml"), place.join("bad.rig.toml")).unwrap();
    identified(place, "bad.csv", words)
}

fn identified(place: &Path, recording: &str, words: &[&str]) -> (i32, Value) {
    let out = tempfile::tempdir_in(place).unwrap();
    let folder = out.path().join("o").display().to_string();
    let all = ["identify", recording, "--model", "arm.urdf", "--json", "--out", &folder];
    let output = rigident(place, &[&all[..], words].concat());
    (output.status.code().unwrap(), answer(&output))
}

fn assert_cause((status, found): &(i32, Value), cause: &str) {
    let said = format!("{cause}: {} {} {}", found["status"], found["warnings"], found["channels"]);
    assert_eq!((*status, &found["status"]), (1, &Value::from("implausible")), "{said}");
    assert!(found["cause"]["what"].as_str().unwrap().contains(cause), "{} {said}", found["cause"]);
    assert!(found["cause"]["confirmed"].as_bool().unwrap(), "{}", found["cause"]);
    // One cause, and what follows from it is information.
    let warnings = found["warnings"].as_array().unwrap();
    assert!(warnings.len() == 1 && warnings[0].as_str().unwrap().contains(cause), "{said}");
}

#[test]
fn degrees_swapped_joints_signs_and_zeros_are_named() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    arm_recording(place, 2);
    assert_eq!(changed(place, &FRICTION, |_, _| {}).1["status"], "identified");
    let degrees = changed(place, &FRICTION, |_, cells| {
        POSITIONS.iter().for_each(|k| cells[*k] = cells[*k].to_degrees());
    });
    assert_cause(&degrees, "positions of the joints are in degrees");
    let swapped = changed(place, &FRICTION, |_, cells| {
        cells.swap(POSITIONS[0], POSITIONS[1]);
        cells.swap(TORQUES[0], TORQUES[1]);
    });
    assert_cause(&swapped, "shoulder and elbow are swapped");
    let reversed = changed(place, &FRICTION, |_, cells| cells[TORQUES[1]] *= -1.0);
    assert_cause(&reversed, "effort of elbow is reversed");
    let zero = changed(place, &FRICTION, |_, cells| cells[POSITIONS[0]] += std::f64::consts::FRAC_PI_2);
    // Gravity turned about the first axis is the same: both are named, and neither is confirmed.
    let cause = &zero.1["cause"];
    assert_eq!(
        (zero.0, &cause["ambiguous"], &cause["confirmed"]),
        (1, &true.into(), &false.into()),
        "{cause}"
    );
    assert_eq!(cause["what"], "the zero of shoulder is off by 90°");
    assert!(cause["alternatives"].to_string().contains("the base stands on a wall, x up"), "{cause}");
    // The key that is advised repairs it.
    let rig = "[tree]\nclass = \"exact\"\n[[joint]]\nname = \"shoulder\"\nposition = \
               { name = \"shoulder_rad\", offset = -1.570796 }\n";
    std::fs::write(place.join("bad.rig.toml"), rig).unwrap();
    assert_eq!(identified(place, "bad.csv", &FRICTION).1["status"], "identified");
}

#[test]
fn units_of_torques_are_recognised_by_the_nominal_model() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    arm_recording(place, 2);
    for (factor, unit) in [(1e3, "N mm"), (1.0 / 9.80665, "kgf m")] {
        let found = changed(place, &FRICTION, |_, cells| TORQUES.iter().for_each(|k| cells[*k] *= factor));
        assert_cause(&found, &format!("the efforts are in {unit}"));
    }
}

#[test]
fn friction_that_is_left_out_and_friction_that_pushes_are_reported() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    arm_recording(place, 2);
    let heavy = |row: usize, cells: &mut [f64]| {
        let t = row as f64 / 500.0;
        for (k, torque) in TORQUES.iter().enumerate() {
            cells[*torque] += 20.0 * swing(t, k, 0.9)[1].signum();
        }
    };
    assert_cause(&changed(place, &[], heavy), "friction of the joints is left out");
    let (status, found) = changed(place, &FRICTION, |row, cells| {
        let rate = swing(row as f64 / 500.0, 1, 0.9)[1];
        cells[TORQUES[1]] -= 1.0 * rate;
    });
    assert_eq!((status, &found["status"]), (1, &Value::from("implausible")), "{found}");
    let warnings = found["warnings"].to_string();
    assert!(
        warnings.contains("friction and rotors take energy") && warnings.contains("elbow.viscous"),
        "{warnings}"
    );
    // `changed` has left the recording: what it says must not become a model.
    let words = ["identify", "bad.csv", "--model", "arm.urdf", "--write-model", "x.urdf", "--out", "w"];
    let output = rigident(place, &[&words[..], &FRICTION].concat());
    let said = crate::program::said(&output);
    assert!(said.contains("--write-model x.urdf: not written"), "{said}");
    assert!(!place.join("x.urdf").exists() && place.join("w/result.json").exists());
}

#[test]
fn a_base_on_a_wall_is_reported_and_its_key_corrects_it() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    arm_recording(place, 2);
    // The description's base is turned by 90° about x against the base that was recorded.
    let turned =
        ARM.replace("<origin xyz=\"0 0 0.2\"/>", "<origin xyz=\"0 -0.2 0\" rpy=\"1.5707963267948966 0 0\"/>");
    assert_ne!(turned, ARM);
    std::fs::write(place.join("arm.urdf"), turned).unwrap();
    let found = identified(place, "arm.csv", &FRICTION);
    assert_cause(&found, "on a wall, y down");
    let remedy = found.1["cause"]["remedy"].as_str().unwrap();
    assert!(remedy.contains("gravity_direction = [0.0, 1.0, 0.0]"), "{remedy}");
    let rig = "[recording]\ngravity_direction = [0.0, 2.0, 0.0]\n[tree]\nclass = \"exact\"\n";
    std::fs::write(place.join("arm.rig.toml"), rig).unwrap();
    let (_, found) = identified(place, "arm.csv", &FRICTION);
    assert_eq!(found["status"], "identified", "{}", found["warnings"]);
    let viscous =
        found["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "elbow.viscous").unwrap();
    assert!(
        (viscous["value"].as_f64().unwrap() - 0.4).abs() < 2.0 * viscous["u95"].as_f64().unwrap(),
        "{viscous}"
    );
    let rig = "[recording]\ngravity_direction = [0.0, 0.0, 0.0]\n";
    std::fs::write(place.join("arm.rig.toml"), rig).unwrap();
    let out = rigident(place, &["identify", "arm.csv", "--model", "arm.urdf", "--out", "never"]);
    assert!(complaint(&out).contains("gravity_direction"), "{}", complaint(&out));
}

#[test]
fn a_dead_torque_a_spiking_rate_and_motion_beyond_the_limits_are_reported() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    arm_recording(place, 2);
    let (status, found) = changed(place, &FRICTION, |_, cells| cells[TORQUES[1]] = 0.0);
    assert_eq!((status, &found["status"]), (2, &Value::from("failed")));
    assert!(found["error"].as_str().unwrap().contains("elbow_nm never changes"), "{found}");
    let (status, found) = changed(place, &FRICTION, |row, cells| {
        if row == 3000 {
            cells[POSITIONS[0]] += 2.0;
        }
    });
    assert_eq!((status, &found["status"]), (0, &Value::from("identified")));
    assert!(found["warnings"].to_string().contains("of shoulder_rad"), "{}", found["warnings"]);
    // A description whose limits the motion leaves: a word, or, far beyond, no answer.
    for (upper, status, word) in [(1.0, 0, "identified"), (0.05, 1, "implausible")] {
        let limited = ARM.replace(
            "\"elbow\" type=\"continuous\">",
            &format!(
                "\"elbow\" type=\"revolute\"><limit lower=\"-{upper}\" upper=\"{upper}\" velocity=\"100\" \
             effort=\"1000\"/>"
            ),
        );
        assert_ne!(limited, ARM);
        std::fs::write(place.join("arm.urdf"), limited).unwrap();
        let (exit, found) = identified(place, "arm.csv", &FRICTION);
        assert_eq!((exit, &found["status"]), (status, &Value::from(word)), "{}", found["warnings"]);
        assert!(found["warnings"].to_string().contains("elbow is at"), "{}", found["warnings"]);
    }
}

#[test]
fn coupled_columns_are_added_as_the_rig_file_says() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    arm_recording(place, 2);
    // The elbow's encoder counts the shoulder too, and from another zero, in degrees.
    let couple = |_: usize, cells: &mut [f64]| {
        cells[POSITIONS[1]] = (cells[POSITIONS[1]] + cells[POSITIONS[0]]).to_degrees() + 30.0;
    };
    let _ = changed(place, &FRICTION, couple);
    let rig = "[tree]\nclass = \"exact\"\n[[joint]]\nname = \"elbow\"\nposition = \
               { name = \"elbow_rad\", scale = 0.017453292519943295, offset = -0.5235987755982988, plus = { shoulder_rad = -1.0 } }\n";
    std::fs::write(place.join("bad.rig.toml"), rig).unwrap();
    let values = |found: &Value| -> Vec<f64> {
        let all = found["parameters"].as_array().unwrap();
        all.iter().map(|p| p["value"].as_f64().unwrap()).collect()
    };
    let (corrected, plain) =
        (identified(place, "bad.csv", &FRICTION).1, identified(place, "arm.csv", &FRICTION).1);
    for (a, b) in values(&corrected).iter().zip(values(&plain)) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
    std::fs::write(place.join("bad.rig.toml"), rig.replace("shoulder_rad", "shoulder_deg")).unwrap();
    let (status, found) = identified(place, "bad.csv", &FRICTION);
    assert_eq!(status, 2);
    assert!(
        found["error"].as_str().unwrap().contains("\"shoulder_deg\", which the rig file adds"),
        "{found}"
    );
}
