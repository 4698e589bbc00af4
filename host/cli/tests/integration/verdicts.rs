//! One recording, one verdict, whichever way it comes in; and one that cannot be true gives no number.
#![cfg(feature = "simulator")]

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rigident::answer::WITHHELD;
use rigident::application::{Caller, IdentifyOptions, identify};
use rigident::fit::figures::with_u95;
use rigident::recording::Recording;
use rigident::recording::arrays::Numbers;
use rigident::rig::RigFile;
use serde_json::Value;

use crate::program::{json, parameter, rigident, said, status};

/// Rows that are used of a recording.
const ROWS: usize = 300;

/// A file of `docs/examples`.
fn example(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples").join(name);
    fs::read_to_string(path).unwrap()
}

/// Returns the first three seconds of a recording, with some of its columns multiplied.
fn scaled(text: &str, names: &[&str], by: f64) -> String {
    let mut header: Option<Vec<&str>> = None;
    let lines = text.lines().filter(|line| !line.starts_with('#')).map(|line| match &header {
        None => {
            header = Some(line.split(',').collect());
            line.to_owned()
        }
        Some(columns) => {
            let cells = line.split(',').zip(columns).map(|(cell, column)| match names.contains(column) {
                true => format!("{:e}", by * cell.parse::<f64>().unwrap()),
                false => cell.to_owned(),
            });
            cells.collect::<Vec<_>>().join(",")
        }
    });
    lines.take(1 + ROWS).collect::<Vec<_>>().join("\n") + "\n"
}

/// Ways from a recording to an answer: each gets the folder and the name of the recording, and returns the
/// answer.
type Way = fn(&Path, &str) -> Value;

fn of_file(at: &Path, name: &str) -> Value {
    json(&rigident(at, &["identify", &format!("{name}.csv"), "--json", "--out", &format!("{name}.file")]))
}

/// By way of a factor, which has the rows and the verdict of the recording, but neither the recording nor a
/// model.
fn of_factor(at: &Path, name: &str) -> Value {
    let file = format!("{name}.factor");
    let made = rigident(at, &["factor", &format!("{name}.csv"), "-o", &file]);
    assert_eq!(status(&made), 0, "{}", said(&made));
    json(&rigident(at, &["solve", &file, "--json"]))
}

/// Streamed to the device.
fn of_replay(at: &Path, name: &str) -> Value {
    let out = format!("{name}.replay");
    json(&rigident(at, &["replay", &format!("{name}.csv"), "--json", "--out", &out]))
}

/// From columns in memory, as Python calls it.
fn of_arrays(at: &Path, name: &str) -> Value {
    let text = fs::read_to_string(at.join(format!("{name}.csv"))).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let rows: Vec<Vec<f64>> =
        rows.lines().map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let columns: Vec<Vec<f64>> =
        (0..header.split(',').count()).map(|k| rows.iter().map(|row| row[k]).collect()).collect();
    let arrays: Vec<(String, Numbers<'_>)> =
        header.split(',').zip(&columns).map(|(name, own)| (name.to_owned(), Numbers::Floats(own))).collect();
    let rig = at.join(format!("{name}.rig.toml"));
    let (file, text) = RigFile::load_with_text(&rig).unwrap();
    let recording = Recording::from_arrays(name, &arrays, &file, Some(&text)).unwrap();
    let out = at.join(format!("{name}.arrays"));
    let words = ["identify", name, "--json", "--rig", rig.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let called = rigident_cli::call(words, Some(recording), Arc::new(AtomicBool::new(false)));
    serde_json::from_str(&called.output).unwrap_or_else(|e| panic!("{e}: {:?}", called.failure))
}

/// By the library, as a program calls it.
fn of_library(at: &Path, name: &str) -> Value {
    let path = at.join(format!("{name}.csv"));
    let found = identify(path.into(), &IdentifyOptions::default(), &Caller::default()).unwrap();
    serde_json::to_value(&found.answer).unwrap()
}

/// Through the recording that a device writes.
fn of_mcap(at: &Path, name: &str) -> Value {
    let file = format!("{name}.mcap");
    let packed = rigident(at, &["convert", &format!("{name}.csv"), &file]);
    assert_eq!(status(&packed), 0, "{}", said(&packed));
    json(&rigident(at, &["identify", &file, "--json", "--out", &format!("{name}.packed")]))
}

/// In two files with clocks of their own, the wrench in one of them.
fn of_several_files(at: &Path, name: &str) -> Value {
    let text = fs::read_to_string(at.join(format!("{name}.csv"))).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let rig = fs::read_to_string(at.join(format!("{name}.rig.toml"))).unwrap();
    let mut listing = rig.lines().filter(|line| !line.starts_with("rate_hz")).collect::<Vec<_>>().join("\n");
    for (part, is_of_the_cell) in [("cell", true), ("rest", false)] {
        let takes = |column: &str| column == "t_s" || WRENCH.contains(&column) == is_of_the_cell;
        let kept: Vec<usize> = (0..header.len()).filter(|k| takes(header[*k])).collect();
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            kept.iter().map(|k| cells[*k]).collect::<Vec<_>>().join(",")
        };
        let file = format!("{name}-{part}.csv");
        fs::write(at.join(&file), text.lines().map(row).collect::<Vec<_>>().join("\n") + "\n").unwrap();
        listing += &format!("\n[[stream]]\nfile = \"{file}\"\n");
    }
    let listed = format!("{name}-listed.rig.toml");
    fs::write(at.join(&listed), listing).unwrap();
    json(&rigident(at, &["identify", &listed, "--json", "--out", &format!("{name}.several")]))
}

const WAYS: [(&str, Way); 7] = [
    ("file", of_file),
    ("library", of_library),
    ("arrays", of_arrays),
    ("factor", of_factor),
    ("MCAP", of_mcap),
    ("several files", of_several_files),
    ("replay", of_replay),
];

/// The fault of a recording: the columns that are multiplied, by how much, and what is in its rig file
/// in place of what.
type Fault = (&'static str, &'static [&'static str], f64, [&'static str; 2], &'static str);

/// Requires the verdict of an answer, and that its numbers go with it.
#[track_caller]
fn assert_verdict(answer: &Value, verdict: &str, of: &str) {
    assert_eq!(answer["status"], verdict, "{of}: {}", answer["warnings"]);
    let parameters = answer["parameters"].as_array().unwrap();
    let with = |key: &str| parameters.iter().filter(|p| p.get(key).is_some()).count();
    if verdict == "identified" {
        assert_eq!((with("value"), with("u95")), (parameters.len(), parameters.len()), "{of}");
        assert!(answer.get("fit").is_none(), "{of}");
        return;
    }
    assert_eq!((with("value"), with("u95")), (0, 0), "{of}");
    for state in parameters.iter().map(|p| &p["state"]) {
        assert!(state == "contradicted" || state == "not_identified", "{of}: {state}");
    }
    for derived in WITHHELD {
        assert!(answer.get(derived).is_none(), "{of}: {derived}");
    }
    assert!(!answer["warnings"].as_array().unwrap().is_empty(), "{of}");
}

/// Requires the verdict of a recording by these ways in.
fn assert_verdicts(ways: &[(&str, Way)], name: &str, csv: &str, rig: &str, verdict: &str) {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join(format!("{name}.csv")), csv).unwrap();
    fs::write(place.path().join(format!("{name}.rig.toml")), rig).unwrap();
    let (at, ways) = (place.path(), ways.iter());
    let failed: Vec<String> = std::thread::scope(|scope| {
        let running = ways.map(|(way, answer)| {
            let of = format!("{name} by {way}");
            scope.spawn(move || {
                let judged = std::panic::catch_unwind(|| assert_verdict(&answer(at, name), verdict, &of));
                judged.err().map(|_| of)
            })
        });
        let running: Vec<_> = running.collect();
        running.into_iter().filter_map(|way| way.join().unwrap()).collect()
    });
    assert!(failed.is_empty(), "another verdict than {verdict}: {}", failed.join(", "));
}

const MOMENTS: [&str; 3] = ["mx_nm", "my_nm", "mz_nm"];
const WRENCH: [&str; 6] = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"];

#[test]
fn every_way_in_comes_to_one_verdict_of_a_body() {
    let place = "position_m = [0.05, -0.02, 0.03]";
    let faults: [Fault; 7] = [
        ("honest", &[], 1.0, ["", ""], "identified"),
        ("gyro-reversed", &["imu_gx_radps"], -1.0, ["", ""], "implausible"),
        ("newton-millimetres", &MOMENTS, 1e3, ["", ""], "implausible"),
        ("moments-reversed", &MOMENTS, -1.0, ["", ""], "implausible"),
        ("in-g", &["imu_ax_mps2", "imu_ay_mps2", "imu_az_mps2"], 1.0 / 9.806_65, ["", ""], "implausible"),
        ("degrees", &["imu_gx_radps", "imu_gy_radps", "imu_gz_radps"], 57.295_78, ["", ""], "implausible"),
        ("imu-elsewhere", &[], 1.0, [place, "position_m = [0.35, -0.02, 0.03]"], "implausible"),
    ];
    let (csv, rig) = (example("bracket.csv"), example("bracket.rig.toml"));
    for (name, columns, by, [stated, instead], verdict) in faults {
        let rig = if stated.is_empty() { rig.clone() } else { rig.replace(stated, instead) };
        assert_verdicts(&WAYS, name, &scaled(&csv, columns, by), &rig, verdict);
    }
}

/// Of a tree only its model can say what no bodies have: the factor, which does not hold the model, keeps the
/// verdict.
#[test]
fn every_way_in_comes_to_one_verdict_of_a_tree() {
    let faults: [Fault; 3] = [
        ("honest", &[], 1.0, ["", ""], "identified"),
        ("reversed", &WRENCH, -1.0, ["", ""], "implausible"),
        ("newton-millimetres", &MOMENTS, 1e3, ["", ""], "implausible"),
    ];
    let (csv, rig) = (example("two-links.csv"), example("two-links.rig.toml"));
    for (name, columns, by, _, verdict) in faults {
        // The device would need the accelerometer of the second link.
        assert_verdicts(&WAYS[..6], name, &scaled(&csv, columns, by), &rig, verdict);
    }
}

/// Returns a text or a page without marks, words apart by one space each.
fn without_marks(shown: &str) -> String {
    let mut plain = String::new();
    let mut inside = false;
    for c in shown.chars() {
        match c {
            '<' => inside = true,
            '>' => {
                inside = false;
                plain.push(' ');
            }
            _ if inside => {}
            '\u{2212}' => plain.push('-'),
            c => plain.push(c),
        }
    }
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The numbers of the fit are in `fit` of the JSON object, and nowhere else.
#[test]
fn moments_in_newton_millimetres_give_no_number_anywhere() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    fs::write(at.join("mm.csv"), scaled(&example("bracket.csv"), &MOMENTS, 1e3)).unwrap();
    fs::write(at.join("mm.rig.toml"), example("bracket.rig.toml")).unwrap();
    let output = rigident(at, &["identify", "mm.csv", "--out", "o"]);
    assert_eq!(status(&output), 1);
    let text = String::from_utf8(output.stdout).unwrap();
    let result: Value = serde_json::from_slice(&fs::read(at.join("o/result.json")).unwrap()).unwrap();
    assert_verdict(&result, "implausible", "result.json");
    assert_eq!(result["schema"], "rigident/result/3");
    assert_eq!(parameter(&result, "m")["state"], "contradicted");
    let numbers = result["fit"]["parameters"].as_array().unwrap();
    let mass = numbers.iter().find(|p| p["name"] == "m").unwrap();
    assert!((mass["value"].as_f64().unwrap() - 3.2).abs() < 0.1, "{mass}");

    let page = fs::read_to_string(at.join("o/report.html")).unwrap();
    for shown in [&text, &page] {
        assert!(shown.contains("Not to be used") && shown.contains("contradicted"), "{shown}");
        assert!(!shown.contains("Convergence") && !shown.contains("hysically consistent"), "{shown}");
        // Nothing of the fit with its uncertainty, whatever is between the two.
        let plain = without_marks(shown);
        for number in numbers {
            let [value, u95] = ["value", "u95"].map(|key| number[key].as_f64().unwrap());
            // A small one may resemble an error of the rig.
            let words = with_u95(value, u95, "");
            assert!(value.abs() < 1.0 || !plain.contains(&words), "{} {words}", number["name"]);
        }
    }
    // A file as it was written before the state `contradicted`: what is read of it is the same.
    let mut earlier = result.clone();
    earlier["schema"] = "rigident/result/2".into();
    for parameter in earlier["parameters"].as_array_mut().unwrap() {
        let Some(own) = numbers.iter().find(|number| number["name"] == parameter["name"]) else { continue };
        parameter["state"] = "identified".into();
        (parameter["value"], parameter["u95"]) = (own["value"].clone(), own["u95"].clone());
    }
    earlier.as_object_mut().unwrap().remove("fit");
    fs::write(at.join("earlier.json"), earlier.to_string()).unwrap();
    for file in ["o/result.json", "earlier.json"] {
        let predicted = rigident(at, &["predict", file, "mm.csv", "--json"]);
        assert_eq!(status(&predicted), 2, "{file}");
        assert!(said(&predicted).contains("cannot be true"), "{}", said(&predicted));
        let summed = rigident(at, &["summary", file, file]);
        assert!(said(&summed).contains("left out") && status(&summed) == 1, "{}", said(&summed));
    }
    // The factor has the verdict, too. Merging shows what runs say alone and together: not of such a one.
    for (name, by) in [("mm", 1e3), ("honest", 1.0)] {
        fs::write(at.join(format!("{name}.csv")), scaled(&example("bracket.csv"), &MOMENTS, by)).unwrap();
        fs::write(at.join(format!("{name}.rig.toml")), example("bracket.rig.toml")).unwrap();
        let made = rigident(at, &["factor", &format!("{name}.csv"), "-o", &format!("{name}.factor")]);
        assert_eq!(status(&made), 0, "{}", said(&made));
    }
    assert_verdict(&json(&rigident(at, &["solve", "mm.factor", "--json"])), "implausible", "mm.factor");
    let merged = rigident(at, &["merge", "mm.factor", "honest.factor", "-o", "both.factor", "--force"]);
    let text = String::from_utf8(merged.stdout).unwrap();
    assert!(text.contains("both.factor") && !text.contains("all merged"), "{text}");
}
