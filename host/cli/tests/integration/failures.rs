//! Commands that fail or are broken off: their words, their exit status, the object that they leave.
#![cfg(feature = "simulator")]

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::commands::yaw_only;
use crate::program::{json, rigident, said, status};

#[test]
fn bad_input_ends_with_two_and_words_that_help() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let good = yaw_only(400, u32::MAX);
    fs::write(at.join("noise.png"), [0_u8, 1, 2, 255]).unwrap();
    fs::write(at.join("binary.csv"), [0_u8, 159, 146, 150]).unwrap();
    fs::write(at.join("binary.mcap"), [0_u8, 159, 146, 150]).unwrap();
    fs::write(at.join("nan.csv"), good.replacen("9.8", "NaN", 1)).unwrap();
    fs::write(at.join("unit.csv"), good.replace("fx_n", "fx_lbf")).unwrap();
    fs::write(at.join("short.csv"), good.replace("my_nm,", "my,")).unwrap();
    fs::write(at.join("rate.csv"), &good).unwrap();
    fs::write(at.join("rate.rig.toml"), "[recording]\nrate_hz = 100.0\n").unwrap();
    fs::write(at.join("key.csv"), &good).unwrap();
    fs::write(at.join("key.rig.toml"), "[load_cell]\nnoise_nm = 1\n").unwrap();
    let mut lines: Vec<&str> = good.lines().collect();
    lines.swap(10, 20);
    fs::write(at.join("time.csv"), lines.join("\n")).unwrap();
    fs::create_dir(at.join("full")).unwrap();
    fs::write(at.join("full/mine.txt"), "mine").unwrap();
    fs::write(at.join("good.csv"), &good).unwrap();
    for (arguments, words) in [
        (&["identify", "none.csv"][..], "none.csv"),
        (&["identify", "noise.png"], ".csv, .mcap, .db3, .bag, .parquet, .mat, .tdms or .xlsx"),
        (&["identify", "binary.csv"], "binary"),
        (&["identify", "binary.mcap"], "binary"),
        (&["identify", "nan.csv"], "NaN"),
        (&["identify", "unit.csv"], "fx_n"),
        (&["identify", "short.csv"], "my_nm"),
        (&["identify", "rate.csv"], "rate_hz"),
        (&["identify", "key.csv"], "noise_nm"),
        (&["identify", "time.csv"], "line"),
        (&["identify", "good.csv", "--out", "full"], "not empty"),
        (&["identify", "good.csv", "--estimate", "m,colour"], "colour"),
        (&["demo", "--duration-s", "3"], "--duration-s"),
        (&["demo", "--mcu", "abacus"], "abacus"),
        (&["replay", "none.mcap"], "none.mcap"),
    ] {
        let output = rigident(at, arguments);
        assert_eq!(status(&output), 2, "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(words), "{arguments:?}: {}", said(&output));
        assert!(output.stdout.is_empty());
    }
    assert_eq!(fs::read(at.join("full/mine.txt")).unwrap(), b"mine");
}

#[test]
fn a_failure_is_one_object_too_where_one_was_asked_for() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    fs::write(at.join("binary.csv"), [0_u8, 159, 146, 150]).unwrap();
    fs::write(at.join("binary.factor"), [0_u8, 159, 146, 150]).unwrap();
    for (arguments, status_is, words) in [
        (&["identify", "none.csv"][..], 2, "none.csv"),
        (&["identify", "binary.csv"], 2, "binary"),
        (&["identify", "binary.csv", "--estimate", "colour"], 2, "binary"),
        (&["replay", "none.mcap"], 2, "none.mcap"),
        (&["solve", "binary.factor"], 2, "binary"),
        (&["demo", "--mcu", "abacus"], 2, "abacus"),
        (&["montecarlo", "--runs", "1"], 2, "--runs"),
        (&["plan", "poses", "--n", "4", "--rig", "none.rig.toml"], 2, "none.rig.toml"),
        (&["workspace", "--rig", "none.rig.toml"], 2, "none.rig.toml"),
        (&["info", "--port", "/dev/no-such-port"], 3, "rigident ports"),
        (&["frobnicate"], 2, "frobnicate"),
    ] {
        let output = rigident(at, &[arguments, &["--json"]].concat());
        assert_eq!(status(&output), status_is, "{arguments:?}: {}", said(&output));
        let object = json(&output);
        assert_eq!(object["status"], "failed", "{arguments:?}");
        assert!(object["error"].as_str().unwrap().contains(words), "{arguments:?}: {object}");
        // People read it beside the object.
        assert!(said(&output).contains(words), "{arguments:?}: {}", said(&output));
    }
    let help = rigident(at, &["identify", "--json", "--help"]);
    assert!(status(&help) == 0 && String::from_utf8_lossy(&help.stdout).contains("Usage"));
}

#[test]
fn a_port_that_is_not_there_ends_with_three() {
    let place = tempfile::tempdir().unwrap();
    let output = rigident(place.path(), &["info", "--port", "/dev/no-such-port"]);
    assert_eq!(status(&output), 3);
    assert!(said(&output).contains("rigident ports"), "{}", said(&output));
}

#[cfg(unix)]
#[test]
fn a_second_ctrl_c_ends_at_once_and_still_leaves_an_object() {
    let place = tempfile::tempdir().unwrap();
    // A recording that never comes.
    assert!(Command::new("mkfifo").arg(place.path().join("f.csv")).status().unwrap().success());
    let mut child = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(place.path())
        .args(["identify", "f.csv", "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let stop = |pid: u32| Command::new("kill").args(["-INT", &pid.to_string()]).status().unwrap();
    let mut heard = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    // Until there is a handler the first would end it by the signal.
    std::thread::sleep(std::time::Duration::from_millis(1000));
    assert!(stop(child.id()).success());
    while !line.contains("Ctrl-C again") {
        line.clear();
        assert!(std::io::BufRead::read_line(&mut heard, &mut line).unwrap() > 0, "it ended by the first");
    }
    assert!(stop(child.id()).success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(status(&output), 130);
    assert_eq!(json(&output)["status"], "failed");
}

#[test]
fn a_folder_with_something_in_it_is_refused_before_anything_else() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    fs::create_dir(at.join("full")).unwrap();
    fs::write(at.join("full/notes.txt"), "mine").unwrap();
    // Neither rig file nor port nor recording is there: these would be complained of first.
    let run =
        ["run", "--port", "none", "--rig", "none.toml", "--platform", "tcp://127.0.0.1:1", "--out", "full"];
    for words in
        [run.as_slice(), &["identify", "none.csv", "--out", "full"], &["replay", "none.csv", "--out", "full"]]
    {
        let output = rigident(at, words);
        assert_eq!(status(&output), 2, "{}", said(&output));
        assert!(said(&output).contains("full is not empty"), "{}", said(&output));
    }
    assert_eq!(fs::read_dir(at.join("full")).unwrap().count(), 1);
}

#[test]
fn failures_after_the_folder_is_made_leave_their_error_in_it() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let demo = rigident(at, &["demo", "--duration-s", "20", "--out", "d"]);
    assert_eq!(status(&demo), 0, "{}", said(&demo));
    let words = ["replay", "d/demo.mcap", "--known", "mass_kg=3±0.001", "--out", "e", "--json"];
    let output = rigident(at, &words);
    assert_eq!(status(&output), 2, "{}", said(&output));
    let left: Value = serde_json::from_str(&fs::read_to_string(at.join("e/result.json")).unwrap()).unwrap();
    assert_eq!((&left["status"], &left["error"]), (&json(&output)["status"], &json(&output)["error"]));
    assert!(left["error"].as_str().unwrap().contains("mass_kg"), "{left}");
}

#[test]
fn a_reader_of_complaints_that_has_gone_away_is_no_crash() {
    let place = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command.current_dir(place.path()).args(["identify", "none.csv"]);
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let status = command.stdout(writer.try_clone().unwrap()).stderr(writer).status().unwrap();
    assert_eq!(status.code(), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn an_answer_that_cannot_be_printed_is_a_failure() {
    let place = tempfile::tempdir().unwrap();
    let bracket = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/bracket.csv");
    for words in [&["schema", "rig"][..], &["identify", bracket.to_str().unwrap(), "--json"]] {
        let program = || {
            let mut program = Command::new(env!("CARGO_BIN_EXE_rigident"));
            program.current_dir(place.path()).args(words);
            program
        };
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = program().stdout(full).output().unwrap();
        assert_eq!(status(&output), 2, "{words:?}: {}", said(&output));
        assert!(!said(&output).is_empty());
        // A reader that has read enough, as `head`.
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        assert_eq!(status(&program().stdout(writer).output().unwrap()), 0, "{words:?}");
    }
}

#[test]
fn a_rig_file_of_another_model_is_refused_by_solve() {
    let place = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let of = |name: &str| examples.join(name).display().to_string();
    for name in ["bracket", "two-links"] {
        let words = ["factor", &of(&format!("{name}.csv")), "-o", &format!("{name}.factor")];
        let output = rigident(place.path(), &words);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
    for (factor, rig, expected) in [
        ("bracket.factor", "bracket.rig.toml", 0),
        ("bracket.factor", "two-links.rig.toml", 2),
        ("two-links.factor", "two-links.rig.toml", 0),
        ("two-links.factor", "bracket.rig.toml", 2),
    ] {
        let output = rigident(place.path(), &["solve", factor, "--rig", &of(rig), "--json"]);
        assert_eq!(status(&output), expected, "{factor} {rig}: {}", said(&output));
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_before_a_map_is_complete_ends_with_1() {
    let place = tempfile::tempdir().unwrap();
    let child = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(place.path())
        .args(["workspace", "--step-deg", "0.2", "--json"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Until there is a handler it would be ended by the signal.
    std::thread::sleep(std::time::Duration::from_millis(1000));
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(status(&output), 1, "{}", said(&output));
    assert_eq!(json(&output)["status"], "failed");
}

#[test]
fn examples_of_the_help_that_end_early_end_well() {
    let place = tempfile::tempdir().unwrap();
    let help = rigident(place.path(), &["demo", "--help"]);
    let text = String::from_utf8(help.stdout).unwrap();
    let examples: Vec<&str> =
        text.lines().filter(|line| line.trim().starts_with("rigident demo --until")).collect();
    assert!(!examples.is_empty(), "{text}");
    for example in examples {
        let words: Vec<&str> = example.split_whitespace().skip(1).chain(["--out", "out"]).collect();
        let output = rigident(place.path(), &words);
        assert_eq!(status(&output), 0, "{example}: {}", said(&output));
    }
}
