//! Recordings with one gross fault each, as a user makes them: each is named for what it is.
#![cfg(feature = "simulator")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn rigident(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rigident")).args(arguments).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(output)))
}

/// The demonstration's recording as CSV, and the text of its rig file.
fn recording(at: &Path) -> String {
    let demo = rigident(at, &["demo", "--duration-s", "20", "--json", "--out", "d"]);
    assert_eq!(demo.status.code(), Some(0), "{}", said(&demo));
    let converted = rigident(at, &["convert", "d/demo.mcap", "a.csv"]);
    assert_eq!(converted.status.code(), Some(0), "{}", said(&converted));
    fs::read_to_string(at.join("a.rig.toml")).unwrap()
}

#[test]
fn one_wrong_line_in_the_rig_file_is_named_and_nothing_gets_a_number() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rig = recording(at);
    let identify = |name: &str, text: &str| {
        assert_ne!(text, rig);
        fs::write(at.join(name), text).unwrap();
        rigident(at, &["identify", "a.csv", "--rig", name, "--json", "--out", &format!("{name}.out")])
    };

    let sign = identify("sign.toml", &rig.replace("\"on_body\"", "\"on_sensor\""));
    assert_eq!(sign.status.code(), Some(1), "{}", said(&sign));
    let result = json(&sign);
    assert!(result["parameters"].as_array().unwrap().iter().all(|p| p["state"] == "not_identified"));
    assert!(result["warnings"].to_string().contains("the mass comes out negative: is wrench_sign right?"));
    // It was turned about every axis: there is nothing to advise.
    assert!(
        result.get("advice").is_none_or(|a| a.as_array().is_some_and(Vec::is_empty)),
        "{}",
        result["advice"]
    );

    let scaled = |scale: f64| {
        let column = |k| format!("imu_a{k}_mps2 = {{ name = \"imu_a{k}_mps2\", scale = {scale:?} }}");
        let columns = format!("[recording]\ncolumns = {{ {} }}", ["x", "y", "z"].map(column).join(", "));
        rig.replace("[recording]", &columns)
    };
    for (name, text, words) in [
        ("g.toml", scaled(1.0 / 9.80665), "looks like g"),
        ("still.toml", rig.replace("static = false", "static = true"), "the gyro is more than"),
    ] {
        let output = identify(name, &text);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", said(&output));
        let object = json(&output);
        assert!(said(&output).contains(words) && object["status"] == "failed", "{name}: {}", said(&output));
        assert!(object.get("parameters").is_none(), "{name}: {object}");
    }
}

const HEADER: &str = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,\
                      imu_gy_radps,imu_gz_radps\n";

#[test]
fn a_recording_that_never_changes_is_a_frozen_sensor_and_one_row_is_too_few() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rows = |count: u32, row: &str| -> String {
        let lines: String = (0..count).map(|n| format!("{:.3},{row}\n", f64::from(n) * 1e-3)).collect();
        format!("{HEADER}{lines}")
    };
    fs::write(at.join("zero.csv"), rows(2000, "0,0,0,0,0,0,0,0,0,0,0,0")).unwrap();
    fs::write(at.join("same.csv"), rows(2000, "1,2,30,0.1,0.2,0.3,0.1,0.2,9.8,0,0,0.01")).unwrap();
    fs::write(at.join("one.csv"), rows(1, "1,2,30,0.1,0.2,0.3,0.1,0.2,9.8,0,0,0.01")).unwrap();
    fs::write(at.join("one.rig.toml"), "[load_cell]\nnoise_n_nm = [1, 1, 1, 0.1, 0.1, 0.1]\n").unwrap();
    for name in ["zero.csv", "same.csv"] {
        let output = rigident(at, &["identify", name, "--json"]);
        assert_eq!(output.status.code(), Some(2), "{name}: {}", said(&output));
        assert!(said(&output).contains("the load cell is frozen"), "{name}: {}", said(&output));
    }
    let warnings =
        json(&rigident(at, &["identify", "one.csv", "--json", "--out", "o"]))["warnings"].to_string();
    assert!(warnings.contains("too few rows: 6 equations for 16 unknowns"), "{warnings}");
    assert!(!warnings.contains("times smaller"), "{warnings}");
}
