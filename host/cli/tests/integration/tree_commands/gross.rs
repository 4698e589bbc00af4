//! Gross errors of units, signs and axes are refused in words; what is assumed is reported.

use std::process::Command;

use super::*;

/// Says what is complained of once the columns of `two.csv` are changed.
fn with_columns(place: &Path, change: &dyn Fn(&str, f64) -> f64) -> String {
    let csv = std::fs::read_to_string(place.join("two.csv")).unwrap();
    let (header, rows) = csv.split_once('\n').unwrap();
    let names: Vec<&str> = header.split(',').collect();
    let mut text = header.to_owned();
    for row in rows.lines() {
        let cells =
            row.split(',').zip(&names).map(|(cell, name)| change(name, cell.parse().unwrap()).to_string());
        text += "\n";
        text += &cells.collect::<Vec<String>>().join(",");
    }
    std::fs::write(place.join("bad.csv"), text).unwrap();
    std::fs::copy(place.join("two.rig.toml"), place.join("bad.rig.toml")).unwrap();
    complaint(&rigident(place, &["identify", "bad.csv", "--out", "never"]))
}

#[test]
fn units_inverses_and_axes_that_two_sensors_contradict_are_refused_by_name() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    two_links(place, Vector3::z());
    let scaled = |prefix: &'static str, by: f64| {
        with_columns(place, &move |name, v| if name.starts_with(prefix) { v * by } else { v })
    };
    let said = scaled("imu_a", 1.0 / 9.80665);
    assert!(said.contains("looks like g: give scale = 9.80665"), "{said}");
    let said = scaled("imu_a", 1e3 / 9.80665);
    assert!(said.contains("looks like mg"), "{said}");
    let said = scaled("imu1_g", 57.295_78);
    assert!(said.contains("imu1_gx_radps … seem to be in deg/s, 180/π"), "{said}");
    let said = scaled("imu_g", 57.295_78);
    assert!(said.contains("imu0_gx_radps … (imu_gx_radps …) seem to be in deg/s"), "{said}");
    let said = with_columns(place, &|name, v| if matches!(name, "q1_x" | "q1_y" | "q1_z") { -v } else { v });
    assert!(said.contains("does not fit") && said.contains("q1_… seems to be the inverse"), "{said}");
    let said = with_columns(place, &|name, v| {
        if name.starts_with("imu1_gx") || name.starts_with("imu1_gy") { -v } else { v }
    });
    assert!(said.contains("the IMU on arm seem to be turned by 180°"), "{said}");
    assert!(!place.join("never").exists());
}

#[test]
fn rates_that_are_not_those_of_the_positions_are_refused_by_name() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let csv = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
    let said = |by: f64| {
        let mut lines = csv.lines();
        let mut text = format!("{},elbow_radps\n", lines.next().unwrap());
        for (row, line) in lines.enumerate() {
            let _ = writeln!(text, "{line},{}", by * swing(row as f64 / 500.0, 1, 0.9)[1]);
        }
        std::fs::write(place.path().join("arm.csv"), text).unwrap();
        rigident(place.path(), &["identify", "arm.csv", "--model", "arm.urdf", "--out", &format!("o{by}")])
    };
    let right = said(1.0);
    assert!(!String::from_utf8_lossy(&right.stdout).contains("one motion"));
    let degrees = complaint(&said(57.295_78));
    assert!(degrees.contains("elbow_radps seems to be in deg/s, 180/π"), "{degrees}");
    let reversed = complaint(&said(-1.0));
    assert!(reversed.contains("elbow_radps has the opposite sign of elbow_rad"), "{reversed}");
}

#[test]
fn assumptions_about_imus_and_joints_are_reported_and_an_imu_on_no_link_is_refused() {
    let place = tempfile::tempdir().unwrap();
    two_links(place.path(), Vector3::z());
    let warnings = |rig: &str| {
        std::fs::write(place.path().join("two.rig.toml"), rig).unwrap();
        let out = format!("o{}", rig.len());
        in_words(&answer(&rigident(place.path(), &["identify", "two.csv", "--json", "--out", &out])))
    };
    let (imu, position) = ("no [[imu]] table says", "has no position_m");
    let said = warnings(RIG);
    assert!(!said.contains(imu) && !said.contains(position), "{said}");
    let said = warnings(&RIG.replace("[[imu]]\nlink = 1\nclass = \"exact\"\n", ""));
    assert!(
        said.contains("no [[imu]] table says where the IMU of arm (link = 1) sits: assumed at the origin"),
        "{said}"
    );
    let said = warnings(&RIG.replace("position_m = [0.03, 0.0, 0.065]\n", ""));
    assert!(
        said.contains("link arm: has no position_m") && said.contains("assumed at the origin of base"),
        "{said}"
    );
    std::fs::write(place.path().join("two.rig.toml"), RIG.replace("link = 1", "link = 5")).unwrap();
    let said = complaint(&rigident(place.path(), &["identify", "two.csv", "--out", "never"]));
    assert!(said.contains("imu[1].link = 5") && said.contains("links 0 to 1 (base, arm)"), "{said}");
    // Of a robot description, too, whose links the rig file does not list.
    arm_recording(place.path(), 2);
    std::fs::write(place.path().join("arm.rig.toml"), "[[imu]]\nlink = 7\n").unwrap();
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--out", "never"];
    let said = complaint(&rigident(place.path(), &words));
    assert!(
        said.contains("[[imu]] link = 7 is beyond its links, which are 0 to 2 (foot, upper, fore)"),
        "{said}"
    );
}

#[test]
fn a_held_joint_with_an_encoder_s_noise_is_named_as_never_moving() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 1);
    let csv = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
    let mut text = String::new();
    for (row, line) in csv.lines().enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        // t, shoulder, elbow, torques.
        let rates = match row {
            0 => "shoulder_radps,elbow_radps".to_owned(),
            _ => format!("{},{}", swing(row as f64 / 500.0 - 0.002, 0, 0.9)[1], 1e-3 * noise(2 * row)),
        };
        let elbow =
            if row == 0 { "elbow_rad".to_owned() } else { (0.3 + 1e-4 * noise(2 * row + 1)).to_string() };
        let _ = writeln!(text, "{},{},{elbow},{},{},{rates}", cells[0], cells[1], cells[3], cells[4]);
    }
    std::fs::write(place.path().join("arm.csv"), text).unwrap();
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--json", "--out", "o"];
    // What holds the elbow is no more than a constant.
    let friction = ["--friction", "viscous,coulomb,offset"];
    let found = answer(&rigident(place.path(), &[&words[..], &friction].concat()));
    let reasons = found["advice"].to_string();
    assert!(reasons.contains("joint elbow: never moves"), "{reasons}");
    assert!(!reasons.contains("joint shoulder: never moves"), "{reasons}");
}

/// A pipe in place of a file, whose writer takes its time.
#[cfg(unix)]
#[test]
fn stages_longer_than_a_second_are_reported_on_standard_error() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let pipe = place.path().join("slow.csv");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let csv = std::fs::read(place.path().join("arm.csv")).unwrap();
    let writer = std::thread::spawn(move || {
        let mut file = std::fs::OpenOptions::new().write(true).open(pipe).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(1800));
        std::io::Write::write_all(&mut file, &csv).unwrap();
    });
    let words = ["identify", "slow.csv", "--model", "arm.urdf", "--json", "--out", "o"];
    let output = rigident(place.path(), &words);
    writer.join().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(errors.contains("reading slow.csv, 1 s"), "{errors}");
    assert_eq!(answer(&output)["source"]["rows"], 6000);
    // What is done at once is not worth a line.
    let words = ["model", "base-params", "arm.urdf"];
    assert!(rigident(place.path(), &words).stderr.is_empty());
}

#[test]
fn a_factor_of_two_links_answers_as_its_recording_does() {
    let place = tempfile::tempdir().unwrap();
    two_links(place.path(), Vector3::z());
    let identified = answer(&rigident(place.path(), &["identify", "two.csv", "--json", "--out", "o"]));
    let made = rigident(place.path(), &["factor", "two.csv", "-o", "two.factor"]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let solved = answer(&rigident(place.path(), &["solve", "two.factor", "--json"]));
    let of = |found: &Value| found["parameters"].as_array().unwrap().clone();
    assert_eq!(of(&solved).len(), 23);
    for (a, b) in of(&identified).iter().zip(of(&solved)) {
        assert_eq!((&a["name"], &a["state"]), (&b["name"], &b["state"]));
        let (value, u95) = (a["value"].as_f64().unwrap(), a["u95"].as_f64().unwrap());
        // The factor is solved anew: rounding times the condition number.
        assert!((value - b["value"].as_f64().unwrap()).abs() < 1e-7 * u95, "{a} {b}");
        assert!((b["u95"].as_f64().unwrap() / u95 - 1.0).abs() < 1e-7, "{a} {b}");
    }
}
