//! Errors that do not average out are reported of trees as of one body.

use super::*;

/// Errors that are not stated have the defaults of their class, in the answer, its budget and its words.
#[test]
fn errors_that_nobody_states_rest_on_the_defaults_of_classes() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    std::fs::remove_file(place.path().join("arm.rig.toml")).unwrap();
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--json", "--out", "o"];
    let found = answer(&rigident(place.path(), &[&words[..], &FRICTION].concat()));
    assert_eq!(found["status"], "identified", "{}", in_words(&found));
    let errors = found["errors"].as_array().unwrap();
    for (name, unit, sigma) in [
        ("joint_zero_shoulder", "rad", 0.2_f64.to_radians() / 3.0_f64.sqrt()),
        ("joint_zero_elbow", "rad", 0.2_f64.to_radians() / 3.0_f64.sqrt()),
        ("base_tilt_x", "rad", 0.5_f64.to_radians() / 3.0_f64.sqrt()),
        ("time_skew", "s", 5e-3 / 3.0_f64.sqrt()),
        ("gain_elbow", "1", 0.02 / 3.0_f64.sqrt()),
    ] {
        let own = errors.iter().find(|e| e["name"] == name).unwrap_or_else(|| panic!("{name}: {errors:?}"));
        assert_eq!((&own["unit"], &own["basis"]), (&Value::from(unit), &Value::from("tree industrial")));
        assert!((own["sigma"].as_f64().unwrap() - sigma).abs() < 1e-12 && own["stated"] == false, "{own}");
    }
    // Without --friction offset a torque may have one.
    assert!(errors.iter().any(|e| e["name"] == "effort_offset_elbow"));
    let said = in_words(&found);
    assert!(said.contains("defaults of the classes tree industrial (joint zero 0.002 rad"), "{said}");
    assert!(found["budget"].to_string().contains("effort gain"), "{}", found["budget"]);
    // What is stated exactly is not searched for.
    let page = std::fs::read_to_string(place.path().join("o/report.html")).unwrap();
    assert!(page.contains("joint_zero_elbow"));
}

/// An encoder that is off by many of the standard deviations stated is named, with its size.
#[test]
fn a_joint_whose_zero_is_not_as_stated_is_named_with_its_size() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let text = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
    let mut moved = String::new();
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        // That of the last joint would be determined by no recording: it turns an unknown body.
        if let Ok(shoulder) = cells[1].parse::<f64>() {
            cells[1] = (shoulder + 0.02).to_string();
        }
        let _ = writeln!(moved, "{}", cells.join(","));
    }
    std::fs::write(place.path().join("arm.csv"), moved).unwrap();
    let rig = "[tree]\nclass = \"exact\"\njoint_zero_std_rad = 0.001\n[[joint]]\nname \
               = \"shoulder\"\nzero_std = 0.002\n";
    std::fs::write(place.path().join("arm.rig.toml"), rig).unwrap();
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--json", "--out", "o"];
    let output = rigident(place.path(), &[&words[..], &FRICTION].concat());
    assert_eq!(output.status.code(), Some(1));
    let found = answer(&output);
    assert_eq!(found["status"], "implausible");
    let said = in_words(&found);
    assert!(
        said.contains("joint zero: joint_zero_shoulder 0.0") && said.contains("joint.zero_std"),
        "{said}"
    );
    let errors = found["errors"].as_array().unwrap();
    let own = errors.iter().find(|e| e["name"] == "joint_zero_shoulder").unwrap();
    assert!((own["value"].as_f64().unwrap() - 0.02).abs() < 0.002, "{own}");
    // A standard deviation that is none is refused by name.
    std::fs::write(place.path().join("arm.rig.toml"), rig.replace("0.001", "-0.001")).unwrap();
    let said = complaint(&rigident(place.path(), &[&words[..6], &["never"]].concat()));
    assert!(said.contains("tree.joint_zero_std_rad"), "{said}");
}
