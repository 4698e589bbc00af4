//! Several files as one recording, by every command that takes a recording.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::simulated::write_thesis;

use crate::program::{rigident, said};

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = rigident(folder, arguments);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)))
}

fn values(result: &Value) -> Vec<(f64, f64)> {
    let all = result["parameters"].as_array().unwrap();
    all.iter().map(|p| (p["value"].as_f64().unwrap(), p["u95"].as_f64().unwrap())).collect()
}

#[test]
fn several_files_give_a_factor_and_a_fixture_as_one_recording_does() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write_thesis(&at.join("first"), 1);
    write_thesis(&at.join("second"), 2);
    let whole = values(&json(at, &["identify", "first/run.rig.toml", "--json", "--out", "o"]));
    for arguments in [
        &["factor", "first/run.rig.toml", "-o", "first.factor"][..],
        &["factor", "second", "--rig", "first/run.rig.toml", "-o", "second.factor"],
    ] {
        let output = rigident(at, arguments);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    }
    // What the skews leave uncertain is in the factor: the same intervals, not narrower ones.
    let solved = values(&json(at, &["solve", "first.factor", "--json"]));
    assert_eq!(whole.len(), 16);
    for ((value, u95), (again, again_u95)) in whole.iter().zip(&solved) {
        assert!((value - again).abs() < 1e-6 * u95 && (u95 / again_u95 - 1.0).abs() < 1e-6);
    }
    // As a tare they say the same, as files or as a factor; of the body nothing is left.
    let tared = |tare: &str, out: &str| {
        json(
            at,
            &["identify", "first/run.rig.toml", "--json", "--out", out, "--tare", tare, "--estimate", "m"],
        )
    };
    let words = |result: &Value| {
        let all = result["notes"].as_array().unwrap().iter();
        let tare = all.filter_map(Value::as_str).find_map(|w| w.strip_prefix("tare: a fixture of ")).unwrap();
        tare.to_owned()
    };
    let (files, factor) = (words(&tared("second/run.rig.toml", "p")), words(&tared("second.factor", "q")));
    assert_eq!(files, factor);
    let mass: f64 = files.split(' ').next().unwrap().parse().unwrap();
    assert!((mass - 20.0).abs() < 0.1, "{files}");
}

#[test]
fn commands_for_one_clock_give_advice_for_several() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    fs::write(at.join("run.rig.toml"), "[[stream]]\nfile = \"wrench.csv\"\n").unwrap();
    fs::write(at.join("wrench.csv"), "t,fx\n0,1\n").unwrap();
    fs::write(at.join("other.rig.toml"), "").unwrap();
    for (arguments, words) in [
        (&["replay", "run.rig.toml"][..], &["rigident identify run.rig.toml", "one clock"][..]),
        (&["replay", "wrench.csv", "--rig", "run.rig.toml"], &["rigident identify run.rig.toml"]),
        (&["replay", ".", "--rig", "run.rig.toml"], &["rigident identify run.rig.toml"]),
        (&["convert", "run.rig.toml", "new.mcap"], &["rigident identify run.rig.toml", "`rigident convert`"]),
        (
            &["convert", "wrench.csv", "new.mcap", "--rig", "run.rig.toml"],
            &["rigident identify run.rig.toml"],
        ),
        (&["identify", "wrench.csv", "--rig", "run.rig.toml"], &["give the rig file itself, run.rig.toml"]),
        (&["factor", "wrench.csv", "--rig", "run.rig.toml", "-o", "f"], &["give the rig file itself"]),
        (&["identify", "run.rig.toml", "--rig", "other.rig.toml"], &["without --rig"]),
        (&["factor", ".", "-o", "f"], &["folder", "--rig"]),
    ] {
        let output = rigident(at, arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        for word in words {
            assert!(said(&output).contains(word), "{arguments:?}: {}", said(&output));
        }
    }
    assert!(!at.join("new.mcap").exists() && !at.join("f").exists());
}
