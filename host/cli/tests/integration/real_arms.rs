//! A real arm, whose friction no column has: identified in part, predicts what it has not seen, and its
//! faults are named.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Rows that the arm is identified from; the rest is predicted.
const FIRST: usize = 500;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name)
}

/// The lines of the recording, the header first.
fn lines() -> Vec<String> {
    let text = std::fs::read_to_string(data("robot_arms_unisa/fer_exciting.csv")).unwrap();
    text.lines().map(str::to_owned).collect()
}

/// Runs a command on files of a folder about the Franka without its hand; the JSON that it prints.
fn run(folder: &Path, words: &[&str], more: &[&str]) -> Value {
    let panda = data("urdf/panda.urdf");
    let output = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(folder)
        .args(words)
        .arg("--model")
        .arg(panda)
        .args(["--lock", "panda_finger_joint1", "--lock", "panda_finger_joint2", "--json"])
        .args(more)
        .output()
        .unwrap();
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 1)), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn write(folder: &Path, name: &str, lines: &[String]) {
    std::fs::write(folder.join(name).with_extension("csv"), lines.join("\n") + "\n").unwrap();
    let rig = "[recording]\neven_stamps = true\n";
    std::fs::write(folder.join(name).with_extension("rig.toml"), rig).unwrap();
}

fn identify(folder: &Path, file: &str) -> Value {
    run(folder, &["identify", file], &["--friction", "viscous,coulomb,offset", "--out", "out"])
}

#[test]
#[ignore = "needs ../shared/data"]
fn a_real_arm_of_shared_data_is_identified_and_predicts_unseen_motions() {
    let folder = tempfile::tempdir().unwrap();
    let all = lines();
    write(folder.path(), "first", &all[..=FIRST]);
    write(folder.path(), "rest", &[&all[..1], &all[FIRST + 1..]].concat());
    let found = identify(folder.path(), "first.csv");
    assert_eq!((&found["status"], &found["cause"]), (&"partly_identified".into(), &Value::Null), "{found}");
    let predicted = run(folder.path(), &["validate", "out/result.json", "rest.csv"], &[]);
    let own = |channel: &Value| {
        let mut models = channel["models"].as_array().unwrap().iter();
        models.find(|own| own["model"] == "identified").and_then(|own| own["nrmse"].as_f64()).unwrap()
    };
    let nrmse: Vec<f64> = predicted["channels"].as_array().unwrap().iter().map(own).collect();
    // Plain least squares with friction and offsets, standstill left out (its SOURCE.md).
    let plain = [0.47, 0.02, 0.06, 0.09, 0.34, 0.12, 0.19];
    let ratio = nrmse.iter().zip(plain).map(|(own, plain)| (own / plain).ln()).sum::<f64>() / 7.0;
    assert!(nrmse.len() == 7 && ratio.exp() < 1.1, "{nrmse:?}");
}

#[test]
#[ignore = "needs ../shared/data"]
fn swapped_joints_of_a_real_arm_of_shared_data_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut all = lines();
    let swapped = all[0].replace("joint2", "jointX").replace("joint4", "joint2").replace("jointX", "joint4");
    all[0] = swapped;
    write(folder.path(), "swapped", &all);
    let found = identify(folder.path(), "swapped.csv");
    assert_eq!(found["status"], "implausible", "{found}");
    let what = found["cause"]["what"].as_str().unwrap_or_default();
    assert!(what.contains("panda_joint2 and panda_joint4 are swapped"), "{found}");
}
