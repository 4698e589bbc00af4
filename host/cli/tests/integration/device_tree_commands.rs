//! Several links on the device, as a user types it: demonstrations, replays, and what they refuse.
#![cfg(feature = "simulator")]

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::program::{self, said};

fn rigident(folder: &Path, line: &str) -> Output {
    program::rigident(folder, &line.split(' ').collect::<Vec<_>>())
}

fn answer(folder: &Path, line: &str) -> Value {
    let output = rigident(folder, line);
    let object = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", said(&output));
    object
}

fn complaint(folder: &Path, line: &str) -> String {
    let output = rigident(folder, line);
    assert_eq!(output.status.code(), Some(2), "{line}: {}", String::from_utf8_lossy(&output.stdout));
    said(&output)
}

fn parameters(object: &Value) -> &Vec<Value> {
    object["parameters"].as_array().unwrap()
}

fn named<'a>(object: &'a Value, name: &Value) -> &'a Value {
    parameters(object).iter().find(|p| p["name"] == *name).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Returns how far the values are from the truth, in standard deviations.
fn deviations(object: &Value) -> Vec<f64> {
    let known = parameters(object).iter().filter(|p| p["state"] == "identified");
    known.map(|p| 1.96 * (number(&p["value"]) - number(&p["truth"])) / number(&p["u95"])).collect()
}

/// Errors of many parameters are those of their intervals: their mean square is one, and the largest is not
/// far out. With correlations whose sum of squares is that of some 12 independent ones at least.
fn agree_with_their_intervals(deviations: &[f64]) {
    let mean = deviations.iter().map(|d| d * d).sum::<f64>() / deviations.len() as f64;
    // χ² of 12: outside of this once in ten thousand.
    assert!((0.12..3.2).contains(&mean), "{mean} {deviations:?}");
    // Once in a hundred thousand of one normal number.
    assert!(deviations.iter().all(|d| d.abs() < 4.5), "{deviations:?}");
}

/// Numbers of the answer that must be the same to the last bit.
fn numbers(object: &Value) -> (Value, Value, Value) {
    let parameters =
        parameters(object).iter().map(|p| (p["name"].clone(), p["value"].clone(), p["u95"].clone()));
    let all: Vec<_> = parameters.collect();
    (serde_json::to_value(all).unwrap(), object["condition_number"].clone(), object["channels"].clone())
}

#[test]
fn two_links_are_identified_live_recorded_replayed_to_the_bit_and_identified_again() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let live = answer(place, "demo --body two-links --duration-s 40 --seed 3 --out a --json");
    assert_eq!((&live["status"], &live["source"]["mcu"]), (&"identified".into(), &"inproc".into()));
    assert_eq!(parameters(&live).len(), 25);
    assert_eq!(live["warnings"], Value::Array(Vec::new()), "{}", live["warnings"]);
    agree_with_their_intervals(&deviations(&live));
    assert!(live["standard_parameters"]["note"].as_str().unwrap().contains("only the base parameters above"));
    let written: Value =
        serde_json::from_slice(&std::fs::read(place.join("a/result.json")).unwrap()).unwrap();
    assert_eq!(numbers(&written), numbers(&live));
    assert!(std::fs::read_to_string(place.join("a/report.html")).unwrap().contains("arm"));
    let replayed = answer(place, "replay a/demo.mcap --out b --json");
    assert_eq!(numbers(&replayed), numbers(&live));
    // A recording is worth the same in the other form.
    assert!(rigident(place, "convert a/demo.mcap c.csv").status.success());
    assert_eq!(numbers(&answer(place, "replay c.csv --out c --json")), numbers(&live));
    // In a batch the rows are the same but for the first third of a second, in which the device's attitude
    // settles: what it leaves out is less than a fiftieth, sd² of the difference less than a fiftieth of sd².
    let batch = answer(place, "identify a/demo.mcap --out d --json");
    for p in parameters(&live) {
        let q = named(&batch, &p["name"]);
        let (difference, u95) = (number(&p["value"]) - number(&q["value"]), number(&p["u95"]));
        assert!(difference.abs() < 4.0 / 1.96 * u95 / 50.0_f64.sqrt(), "{p} {q}");
        assert!((number(&q["u95"]) / u95 - 1.0).abs() < 0.02, "{p} {q}");
    }
}

#[cfg(feature = "emulator")]
#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_board_gives_the_recording_and_the_answer_of_this_process() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let here = answer(place, "demo --body two-links --duration-s 20 --out a --json");
    let there = answer(place, "demo --body two-links --duration-s 20 --mcu qemu --out b --json");
    assert_eq!((&there["source"]["mcu"], numbers(&there)), (&"qemu".into(), numbers(&here)));
    // But for the board's name every byte is the same.
    for folder in ["a", "b"] {
        assert!(rigident(place, &format!("convert {folder}/demo.mcap {folder}.csv")).status.success());
    }
    let rows = |folder: &str| {
        let text = std::fs::read_to_string(place.join(format!("{folder}.csv"))).unwrap();
        text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(rows("a") == rows("b"));
    // So does a recording's beginning.
    let head: Vec<String> = rows("a").into_iter().take(801).collect();
    std::fs::write(place.join("head.csv"), head.join("\n")).unwrap();
    std::fs::rename(place.join("a.rig.toml"), place.join("head.rig.toml")).unwrap();
    let [here, there] = ["inproc", "qemu"]
        .map(|mcu| numbers(&answer(place, &format!("replay head.csv --mcu {mcu} --out {mcu} --json"))));
    assert_eq!(here, there);
}

#[test]
fn a_person_comes_off_the_device_level_by_level_and_identify_finds_the_same() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    let output = rigident(place, "demo --body human34 --seed 2 --out a --json");
    let live: Value =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)));
    // While it ran, and at the end.
    let taken = said(&output);
    let times = taken.split_once("from the device ").and_then(|(_, rest)| rest.split(' ').next());
    assert!(times.unwrap().parse::<u32>().unwrap() >= 2, "{taken}");
    assert_eq!((parameters(&live).len(), &live["source"]["rows"]), (128, &6000.into()));
    assert_eq!(live["warnings"], Value::Array(Vec::new()));
    let known = deviations(&live);
    assert!(known.len() > 120, "{}", known.len());
    agree_with_their_intervals(&known);
    // χ² of 128, correlated as they are, of which half at least are independent: 64 ± 5 sd.
    let mean = known.iter().map(|d| d * d).sum::<f64>() / known.len() as f64;
    assert!((mean - 1.0).abs() < 5.0 * (2.0_f64 / 64.0).sqrt(), "{mean}");
    // Filtered momentum against single frames: two ways through the same noise, whose spreads differ by a few
    // per cent; of two estimates of one quantity, one efficient, the difference has the difference of the
    // variances.
    let batch = answer(place, "identify a/demo.csv --model human34 --out b --json");
    for p in parameters(&live).iter().filter(|p| p["state"] == "identified") {
        let q = named(&batch, &p["name"]);
        let ratio = number(&q["u95"]) / number(&p["u95"]);
        assert!((0.97..1.1).contains(&ratio), "{p} {q}");
        let spread = (1.1_f64.powi(2) - 1.0).sqrt() * number(&p["u95"]) / 1.96;
        assert!((number(&p["value"]) - number(&q["value"])).abs() < 4.5 * spread, "{p} {q}");
    }
    // The frames again; where a level ends depends on the time that passes, and with it the last digits of
    // single precision.
    let replayed = answer(place, "replay a/demo.csv --model human34 --out c --json");
    for (p, q) in
        parameters(&live).iter().zip(parameters(&replayed)).filter(|(p, _)| p["state"] == "identified")
    {
        assert_eq!(p["name"], q["name"]);
        assert!(
            (number(&p["value"]) - number(&q["value"])).abs() < 0.05 / 1.96 * number(&p["u95"]),
            "{p} {q}"
        );
    }
}

#[cfg(feature = "emulator")]
#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_board_takes_a_person_s_frames() {
    let place = tempfile::tempdir().unwrap();
    let here = answer(place.path(), "demo --body human34 --duration-s 6 --out a --json");
    let there = answer(place.path(), "demo --body human34 --duration-s 6 --mcu qemu --out b --json");
    assert_eq!(there["source"]["mcu"], "qemu");
    for (p, q) in parameters(&here).iter().zip(parameters(&there)) {
        assert_eq!((&p["name"], &p["state"]), (&q["name"], &q["state"]));
        if p["state"] == "identified" {
            let difference = number(&p["value"]) - number(&q["value"]);
            assert!(difference.abs() < 0.05 / 1.96 * number(&p["u95"]), "{p} {q}");
        }
    }
}

#[test]
fn without_noise_two_links_are_found_to_the_resolution_of_the_converters() {
    let place = tempfile::tempdir().unwrap();
    let found = answer(place.path(), "demo --body two-links --ideal --duration-s 20 --out a --json");
    assert_eq!(found["rejected_rows"], 0);
    for p in parameters(&found) {
        let truth = number(&p["truth"]);
        // As in the simulator's own test: words of 16 bits, and a gyro's step that integrates.
        let scale: f64 = if p["name"].as_str().unwrap().starts_with("arm") { 0.2 } else { 1.0 };
        assert!((number(&p["value"]) - truth).abs() < 2e-3 * scale.max(truth.abs()), "{p}");
    }
}

#[test]
fn options_of_one_body_are_refused_by_name_before_anything_is_done() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for body in ["two-links", "human34"] {
        for option in [
            "--known mass_kg=3±0.1",
            "--symmetry y",
            "--forget 20",
            "--window 20",
            "--until nose=0.1",
            "--adaptive",
            "--at-most-s 20",
            "--estimate nose",
        ] {
            let complaint = complaint(place, &format!("demo --body {body} --out o {option}"));
            assert!(complaint.contains(option.split(' ').next().unwrap()), "{complaint}");
        }
    }
    assert!(complaint(place, "demo --body human34 --plan motion.json").contains("--plan"));
    assert!(complaint(place, "demo --body human34 --duration-s 1").contains("--duration-s 1"));
    assert_eq!(std::fs::read_dir(place).unwrap().count(), 0);
    answer(place, "demo --body two-links --duration-s 20 --out a --json");
    for option in ["--known mass_kg=3±0.1", "--forget 9", "--until nose=0.1", "--estimate nose"] {
        let complaint = complaint(place, &format!("replay a/demo.mcap --out o {option}"));
        assert!(complaint.contains(option.split(' ').next().unwrap()), "{complaint}");
    }
    assert!(!place.join("o").exists());
}

#[test]
fn inputs_missing_for_the_device_are_named() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    answer(place, "demo --body human34 --duration-s 4 --out a --json");
    // Without accelerations it is a recording still, but makes no frames.
    let text = std::fs::read_to_string(place.join("a/demo.csv")).unwrap();
    std::fs::write(place.join("b.csv"), text.replace("alpha4_x_radps2", "something")).unwrap();
    std::fs::copy(place.join("a/demo.rig.toml"), place.join("b.rig.toml")).unwrap();
    let missing = complaint(place, "replay b.csv --model human34 --out o");
    assert!(missing.contains("alpha4_x_radps2") && missing.contains("rigident identify"), "{missing}");
    let port = complaint(place, "replay a/demo.csv --model human34 --mcu /dev/ttyACM9 --out o");
    assert!(port.contains("sensor bus"), "{port}");
    let model = complaint(place, "replay a/demo.csv --model human58 --out o");
    assert!(model.contains("23 links"), "{model}");
    assert!(complaint(place, "replay a/demo.csv --lock neck --out o").contains("--lock"));
    let rig = std::fs::read_to_string(place.join("b.rig.toml")).unwrap();
    std::fs::write(place.join("c.rig.toml"), rig.replace("\"zero\"", "\"estimate\"")).unwrap();
    let offset = complaint(place, "replay a/demo.csv --model human34 --rig c.rig.toml --out o");
    assert!(offset.contains("offset_n_nm"), "{offset}");
    assert!(!place.join("o").exists());
}

/// Seconds of the recording that an answer is made of.
fn seconds(found: &Value) -> f64 {
    number(&found["source"]["duration_s"])
}

#[test]
fn the_device_decides_when_two_links_and_a_person_are_known_well_enough() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for (line, asked, u95) in [
        ("demo --body two-links --duration-s 40", "I", 0.02),
        ("demo --body human34 --duration-s 30", "torso", 0.1),
    ] {
        let folder = if asked == "I" { "t" } else { "p" };
        let output = rigident(place, &format!("{line} --until {asked}={u95} --out {folder} --json"));
        assert!(said(&output).contains("the uncertainties asked for were reached"), "{}", said(&output));
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!((2.0..20.0).contains(&seconds(&found)), "{}", found["source"]);
        let is_asked = |p: &&Value| {
            let name = p["name"].as_str().unwrap();
            if asked == "I" { name.contains(".J") } else { name.starts_with("torso.") }
        };
        for p in parameters(&found).iter().filter(is_asked).filter(|p| p["state"] == "identified") {
            // The device judges by the noise stated; noise of the rates and autocorrelation widen the
            // intervals.
            assert!(number(&p["u95"]) < 1.5 * u95, "{p}");
        }
        // The same again where it is only reported.
        let line = format!("{line} --until {asked}={u95} --keep-going --out {folder}2 --json");
        let output = rigident(place, &line);
        assert!(said(&output).contains("the uncertainties asked for were reached"), "{}", said(&output));
        let whole: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(seconds(&whole) > 28.0, "{}", whole["source"]);
        agree_with_their_intervals(&deviations(&whole));
    }
    // What is replayed ends where it ended.
    let again = answer(place, "replay t/demo.mcap --until I=0.02 --out u --json");
    let live: Value = serde_json::from_slice(&std::fs::read(place.join("t/result.json")).unwrap()).unwrap();
    assert!((seconds(&again) - seconds(&live)).abs() < 0.01, "{} {}", again["source"], live["source"]);
}

#[test]
fn wrenches_far_off_count_less_on_a_device_of_two_links() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    answer(place, "demo --body two-links --duration-s 20 --seed 5 --out a --json");
    assert!(rigident(place, "convert a/demo.mcap a.csv").status.success());
    let clean = answer(place, "replay a.csv --out b --json");
    let text = std::fs::read_to_string(place.join("a.csv")).unwrap();
    let at =
        text.lines().find(|l| l.starts_with("t_s")).unwrap().split(',').position(|n| n == "fz_n").unwrap();
    let mut row = 0;
    let spoilt: Vec<String> = text
        .lines()
        .map(|line| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if line.starts_with(|c: char| c.is_ascii_digit()) {
                row += 1;
                // Twenty blows of 400 N, 20 ms each, when the device has had the time to know the body.
                if row > 10_000 && row % 500 < 20 {
                    cells[at] = (cells[at].parse::<f64>().unwrap() + 400.0).to_string();
                }
            }
            cells.join(",")
        })
        .collect();
    std::fs::write(place.join("a.csv"), spoilt.join("\n")).unwrap();
    let found = answer(place, "replay a.csv --out c --json");
    let (before, after) = (&parameters(&clean)[0], &parameters(&found)[0]);
    // 400 N for 4 % of half of the time are 8 N on average, 0.8 kg; a redescending weight leaves a small part
    // of that.
    assert!((number(&before["value"]) - number(&after["value"])).abs() < 0.08, "{before} {after}");
    let fz = found["channels"].as_array().unwrap().iter().find(|c| c["name"] == "fz").unwrap();
    assert!(number(&fz["outliers"]) > 20.0, "{fz}");
}

#[test]
fn gain_errors_of_several_links_are_counted_from_readings_of_the_device() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    answer(place, "demo --body two-links --duration-s 20 --out a --json");
    answer(place, "demo --body human34 --duration-s 6 --out p --json");
    assert!(rigident(place, "convert a/demo.mcap a.csv").status.success());
    std::fs::copy(place.join("p/demo.csv"), place.join("p.csv")).unwrap();
    std::fs::copy(place.join("p/demo.rig.toml"), place.join("p.rig.toml")).unwrap();
    for (name, model) in [("a", ""), ("p", " --model human34")] {
        let plain = answer(place, &format!("replay {name}.csv{model} --out {name}1 --json"));
        let path = place.join(format!("{name}.rig.toml"));
        let rig = std::fs::read_to_string(&path).unwrap();
        let gains = "[load_cell]\ngain_uncertainty = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]";
        std::fs::write(&path, rig.replace("[load_cell]", gains)).unwrap();
        let found = answer(place, &format!("replay {name}.csv{model} --out {name}2 --json"));
        let batch = answer(place, &format!("identify {name}.csv{model} --out {name}3 --json"));
        let mass = &parameters(&plain)[0];
        let (m, same) = (&parameters(&found)[0], named(&batch, &mass["name"]));
        let u95 = |p: &Value| number(&p["u95"]) / number(&p["value"]);
        assert!(u95(m) > 2.0 * u95(mass), "{m} {mass}");
        assert!((u95(m) / u95(same) - 1.0).abs() < 0.05, "{m} {same}");
    }
}

#[test]
fn a_second_gyro_that_stands_still_is_named_and_nothing_of_it_is_absorbed() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    answer(place, "demo --body two-links --duration-s 20 --out a --json");
    assert!(rigident(place, "convert a/demo.mcap b.csv").status.success());
    let text = std::fs::read_to_string(place.join("b.csv")).unwrap();
    let at =
        text.lines().find(|l| l.starts_with("t_s")).unwrap().split(',').position(|n| n == "imu1_gz_radps");
    let mut row = 0;
    let spoilt: Vec<String> = text
        .lines()
        .map(|line| {
            row += usize::from(!line.starts_with('#') && !line.starts_with('t'));
            let mut cells: Vec<&str> = line.split(',').collect();
            if (9_000..10_000).contains(&row) {
                cells[at.unwrap()] = "0.25";
            }
            cells.join(",")
        })
        .collect();
    std::fs::write(place.join("b.csv"), spoilt.join("\n")).unwrap();
    let found = answer(place, "replay b.csv --out b --json");
    let warnings = found["warnings"].to_string();
    assert!(warnings.contains("rejected because of imu1_gz_radps"), "{warnings}");
}
