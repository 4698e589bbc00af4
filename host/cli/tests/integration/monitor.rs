//! `rigident monitor` of recordings: its numbers against those of `identify`, and a file that grows.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::program::{json, parameter, rigident, rigident_anywhere, said, status};

const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/bracket.csv");

/// A copy of the example with its rig file, as far as its first rows; zero: all.
fn part_of_example(place: &Path, name: &str, rows: usize) -> String {
    let text = fs::read_to_string(RECORDING).unwrap();
    let head = text.lines().position(|line| !line.starts_with('#')).unwrap() + 1;
    let kept: Vec<&str> = text.lines().take(if rows == 0 { usize::MAX } else { head + rows }).collect();
    let rig = Path::new(RECORDING).with_extension("rig.toml");
    fs::copy(rig, place.join(name).with_extension("rig.toml")).unwrap();
    let text = kept.join("\n") + "\n";
    fs::write(place.join(name), &text).unwrap();
    text
}

#[test]
fn a_recording_is_shown_with_the_numbers_of_identify() {
    let place = tempfile::tempdir().unwrap();
    let identified = json(&rigident(place.path(), &["identify", RECORDING, "--json", "--out", "a"]));
    let output = rigident_anywhere(&["monitor", RECORDING, "--once", "--json"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let view = json(&output);
    assert_eq!(view["answer"]["status"], identified["status"]);
    let shown = view["answer"]["parameters"].as_array().unwrap();
    assert!(shown.len() > 9);
    for one in shown {
        let found = parameter(&identified, one["name"].as_str().unwrap());
        assert_eq!((&one["now"]["value"], &one["now"]["u95"]), (&found["value"], &found["u95"]), "{one}");
        // The course ends where the answer is.
        let last = one["history"].as_array().unwrap().last();
        assert!(one["now"].is_null() || last == Some(&one["now"]), "{one}");
    }
    let text = rigident_anywhere(&["monitor", RECORDING, "--once"]);
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    for words in ["bracket.csv", "parameter", "weakest", "sensors"] {
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn a_recording_that_grows_is_followed() {
    let place = tempfile::tempdir().unwrap();
    let whole = part_of_example(place.path(), "grows.csv", 0);
    part_of_example(place.path(), "grows.csv", 600);
    let mut child = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(place.path())
        .args(["monitor", "grows.csv", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut next = || -> Value { serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap() };
    let mut readings = vec![next()["answer"]["readings"].as_u64().unwrap()];
    fs::write(place.path().join("grows.csv"), &whole).unwrap();
    let rows = whole.lines().filter(|line| !line.starts_with('#')).count() as u64 - 1;
    while *readings.last().unwrap() < rows {
        readings.push(next()["answer"]["readings"].as_u64().unwrap());
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(readings[0] <= 600 && readings.len() > 1, "{readings:?}");
}

#[test]
fn unusable_sources_are_refused_in_words() {
    for (arguments, words) in [
        (&["monitor", "none.mcap", "--once"][..], "none.mcap"),
        (&["monitor", RECORDING], "--once"),
        (&["monitor", RECORDING, "--demo"], "cannot be used with"),
        (&["monitor", "--start", "--once"], "--rig"),
        (&["monitor", RECORDING, "--once", "--foxglove=here"], "0.0.0.0:8765"),
        (&["monitor", concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"), "--once"], "Cargo.toml"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_rigident"))
            .args(arguments)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        assert_eq!(status(&output), 2, "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(words), "{arguments:?}: {}", said(&output));
    }
}
