//! `rigident calibrate masses`: of clean recordings, beside pulls, wrong gains and missing feet, and of bad
//! input.

use nalgebra::Vector3;
use serde_json::Value;

use super::robot::{Feet, Robot, object, rigident};

#[test]
#[ignore = "needs ../shared/data"]
fn masses_of_a_shared_data_quadruped_predict_unseen_motions() {
    let (robot, folder) = (Robot::read("solo12"), tempfile::tempdir().unwrap());
    robot.write(folder.path(), Feet::WithoutHorizontal, Some(7));
    let text = std::fs::read_to_string(folder.path().join("solo12.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    for (name, lines) in [("first", &lines[1..800]), ("last", &lines[800..])] {
        std::fs::write(
            folder.path().join(format!("{name}.csv")),
            format!("{}\n{}\n", lines_of(&text), lines.join("\n")),
        )
        .unwrap();
    }
    let (model, rig) = (robot.model_file(), "solo12.rig.toml");
    let model = model.to_str().unwrap();
    let output = rigident(
        folder.path(),
        &["calibrate", "masses", model, "first.csv", "--rig", rig, "--json", "--write-model", "new.urdf"],
    );
    let found = object(&output);
    assert_eq!(output.status.code(), Some(0), "{found:#}");
    let ways = found["ways"].as_array().unwrap();
    let nominal = found["nominal_cost"].as_f64().unwrap();
    for way in ways {
        assert!(way["cost"].as_f64().unwrap() < 0.1 * nominal, "{way}");
    }
    assert_eq!(found["chosen"], "consistent");
    let mass = found["whole_mass_kg"].as_f64().unwrap();
    assert!((mass - 2.483_042).abs() < 2e-3, "{mass}");
    let output = rigident(
        folder.path(),
        &["validate", "new.urdf", "last.csv", "--model", model, "--rig", rig, "--json"],
    );
    let found = object(&output);
    let channels = found["channels"].as_array().unwrap();
    let (mut better, mut count) = (0, 0);
    let judged = channels.iter().filter(|channel| channel["models"].is_array());
    for channel in judged {
        let of = |name: &str| {
            let all = channel["models"].as_array().unwrap();
            all.iter().find(|e| e["model"] == name).and_then(|e| e["rms"].as_f64()).unwrap()
        };
        // Rows by which forces were eliminated throughout predict nothing.
        if of("nominal") == 0.0 {
            continue;
        }
        count += 1;
        better += u32::from(of("new") < of("nominal"));
    }
    assert!(count >= 10 && better == count, "{better} of {count}: {found:#}");
}

/// Root mean square of what links' masses are off by, relative.
fn off(robot: &Robot, found: &Value, key: &str) -> f64 {
    let links = robot.tables("link");
    let of = |own: &Value| {
        let truth = links.iter().find(|link| link["name"].as_str() == own["link"].as_str())?;
        let mass = truth["mass_kg"].as_float().filter(|mass| *mass > 0.02)?;
        Some((own[key].as_f64().unwrap() / mass - 1.0).powi(2))
    };
    let squares: Vec<f64> = found["links"].as_array().unwrap().iter().filter_map(of).collect();
    assert!(squares.len() > 10);
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// A twentieth of the weight pulls at the base of a quadruped: it is found and eliminated, and masses are as
/// good as where nothing pulls, which they are not if it is taken for none; nothing is found where nothing
/// pulls, and the whole mass is in its interval.
#[test]
#[ignore = "needs ../shared/data"]
fn a_pull_at_the_base_of_a_shared_data_quadruped_is_found_and_takes_no_part_in_masses() {
    let robot = Robot::read("solo12");
    let masses = |robot: &Robot, more: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        robot.write(folder.path(), Feet::All, Some(5));
        let model = robot.model_file();
        let line = ["calibrate", "masses", model.to_str().unwrap(), "solo12.csv", "--json"];
        object(&rigident(folder.path(), &[&line[..], more].concat()))
    };
    let truth = 2.483_042;
    let force = Vector3::new(1.0, -0.75, 0.0);
    let own = [Vector3::zeros(), force].map(|pull| {
        let found = masses(&robot.pulled(pull), &[]);
        let [mass, u95] = ["identified_whole_mass_kg", "identified_whole_mass_u95_kg"]
            .map(|key| found[key].as_f64().unwrap());
        assert!((mass - truth).abs() < 1.5 * u95, "{mass} ± {u95}");
        let said = found["warnings"].to_string();
        assert_eq!(
            said.contains("something beside the ground pulls at base_link"),
            pull.norm() > 0.0,
            "{said}"
        );
        if let Some(own) = found["external_force_n"].as_array() {
            let own = Vector3::from_iterator(own.iter().map(|v| v.as_f64().unwrap()));
            assert!((own - pull).xy().norm() < 0.1, "{own}");
        }
        off(&robot, &found, "mass_kg")
    });
    let without = masses(&robot.pulled(force), &["--external-wrench", "none"]);
    let worse = off(&robot, &without, "mass_kg");
    println!("{own:?}, {worse}");
    assert!(own[1] < 1.3 * own[0] && worse > 1.5 * own[1], "{own:?}, {worse}");
}

/// Torques of other gains and a foot without a sensor are taken for masses by least squares, which predict
/// the better for it. Both are found and named, and the masses are as good as those without a fault.
#[test]
#[ignore = "needs ../shared/data"]
fn faults_that_no_left_out_motion_of_a_shared_data_quadruped_shows_do_not_become_masses() {
    let robot = Robot::read("solo12");
    let mut gains = robot.rows.clone();
    for (k, joint) in robot.words("joints").iter().enumerate() {
        let at = robot.header.iter().position(|own| *own == format!("{joint}_nm")).unwrap();
        gains.iter_mut().for_each(|row| row[at] *= 0.75 + 0.04 * k as f64);
    }
    let gains =
        Robot { name: robot.name, rows: gains, header: robot.header.clone(), truth: robot.truth.clone() };
    let masses = |robot: &Robot, kind: &str, is_foot_gone: bool| {
        let folder = tempfile::tempdir().unwrap();
        robot.write(folder.path(), Feet::All, Some(5));
        if is_foot_gone {
            let rig = robot.rig(Feet::All);
            let last = rig.rfind("[[foot]]").unwrap();
            std::fs::write(folder.path().join("solo12.rig.toml"), &rig[..last]).unwrap();
        }
        let model = robot.model_file();
        let line = ["calibrate", "masses", model.to_str().unwrap(), "solo12.csv", "--json"];
        let found = object(&rigident(folder.path(), &line));
        let named = found["eliminated"].as_array().unwrap().iter();
        (named.filter(|own| own["kind"] == kind).count(), off(robot, &found, "mass_kg"))
    };
    let (none, clean) = masses(&robot, "effort_scale", false);
    let (scales, of_gains) = masses(&gains, "effort_scale", false);
    let (feet, without_foot) = masses(&robot, "unmeasured_wrench", true);
    println!("{clean} {of_gains} {without_foot}");
    assert!(none == 0 && scales >= 8 && feet == 1, "{none} {scales} {feet}");
    assert!(of_gains < 1.3 * clean && without_foot < 1.3 * clean, "{clean} {of_gains} {without_foot}");
}

fn lines_of(text: &str) -> &str {
    text.lines().next().unwrap()
}

/// Each case has an error, the change of the recording or rig file, and a word that names it.
#[test]
#[ignore = "needs ../shared/data"]
fn bad_input_of_feet_and_torques_of_shared_data_robots_is_named() {
    let (robot, folder) = (Robot::read("solo12"), tempfile::tempdir().unwrap());
    let path = robot.write(folder.path(), Feet::All, Some(3));
    let model = robot.model_file();
    let model = model.to_str().unwrap();
    let (text, rig) = (std::fs::read_to_string(&path).unwrap(), robot.rig(Feet::All));
    let column = robot.header.iter().position(|name| name == "FL_HFE_nm").unwrap();
    let force = robot.header.iter().position(|name| name == "HR_foot_fz_n").unwrap();
    let changed = |at: usize, change: &dyn Fn(f64) -> f64| {
        let line = |(row, line): (usize, &str)| {
            if row == 0 {
                return line.to_owned();
            }
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            cells[at] = change(cells[at].parse().unwrap()).to_string();
            cells.join(",")
        };
        text.lines().enumerate().map(line).collect::<Vec<_>>().join("\n") + "\n"
    };
    let masses = |text: &str, rig: &str| {
        std::fs::write(&path, text).unwrap();
        std::fs::write(folder.path().join("solo12.rig.toml"), rig).unwrap();
        let output = rigident(
            folder.path(),
            &[
                "calibrate",
                "masses",
                model,
                "solo12.csv",
                "--method",
                "ridge",
                "--weight",
                "1",
                "--parts",
                "1",
            ],
        );
        let said = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        (output.status.code(), said)
    };
    let zero = rig.replacen("[[foot]]", "[[foot]]\nname = \"x\"\nlink = \"nowhere\"\n[[foot]]", 1);
    let no_imu = text.replacen("imu_ax_mps2", "old_ax", 1).replacen("imu_ay_mps2", "old_ay", 1).replacen(
        "imu_az_mps2",
        "old_az",
        1,
    );
    let cases = [
        (changed(column, &|v| -v), rig.clone(), Some(1), "FL_HFE has the opposite sign"),
        (changed(column, &|v| 1e3 * v), rig.clone(), Some(1), "N mm"),
        (changed(column, &|v| 1e-9 * v), rig.clone(), Some(1), "FL_HFE hardly changes"),
        (changed(force, &|v| v + 0.4), rig.clone(), None, "foot HR_foot reads fz"),
        (text.clone(), zero, Some(2), "nowhere"),
        (text.clone(), rig.replace("name = \"HL_foot\"", "name = \"HX_foot\""), Some(2), "HX_foot"),
        (no_imu, rig.clone(), Some(2), "imu_ax_mps2"),
        (text.clone(), rig.replacen("[[foot]]", "[[foot]]\nunavailable = [\"f\"]", 1), Some(2), "component"),
    ];
    for (text, rig, status, word) in cases {
        let (code, said) = masses(&text, &rig);
        assert!(said.contains(word), "{word}: {said}");
        if let Some(status) = status {
            assert_eq!(code, Some(status), "{word}: {said}");
        }
    }
}
