//! `rigident body identify` of people who sit, hold on, jump off boxes and run: what no plate measures is
//! named, and what plates measure is used.

use std::f64::consts::PI;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::simulated_people::{
    Carried, Files, Gait, Posture, Somebody, drop_carried, drop_jump, on_the_seat, ramp, rising, upright,
};

const BODY: Somebody = Somebody { height_m: 1.72, mass_kg: 68.0, skin_m: 0.01, plate_n: 1.0, held: None };

fn write(folder: &Path, name: &str, files: &Files) {
    std::fs::write(folder.join(format!("{name}.trc")), &files.trc).unwrap();
    std::fs::write(folder.join(format!("{name}_grf.mot")), &files.mot).unwrap();
}

/// Exit status, the result, and what was said on standard error, of a motion.
fn identified(
    seconds: f64,
    motion: &dyn Fn(f64) -> Posture,
    carried: &dyn Fn(f64) -> Carried,
) -> (i32, Value, String) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "standing", &BODY.recorded(1.0, &|_| upright(&BODY), &|_| Carried::Both));
    write(folder.path(), "motion", &BODY.recorded(seconds, motion, carried));
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command.current_dir(folder.path()).args(["body", "identify", "motion.trc", "--static", "standing.trc"]);
    let output = command.args(["--height-m", "1.72", "--json", "--out", "out"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let result = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code().unwrap(), result, said)
}

/// Value and U95 of the whole mass, with the table.
#[track_caller]
fn weighs(result: &Value, widest: f64) {
    for field in ["mass_kg", "mass_with_table_kg"] {
        let mass = &result["person"][field];
        let (value, u95) = (mass["value"].as_f64().unwrap(), mass["u95"].as_f64().unwrap());
        assert!((value - BODY.mass_kg).abs() < u95 && u95 < widest, "{field}: {value} ± {u95}");
    }
}

fn contacts(result: &Value) -> Vec<Value> {
    result["person"]["trials"][0]["unmeasured"].as_array().cloned().unwrap_or_default()
}

/// Squats of 35 cm.
fn squat(t: f64) -> Posture {
    let mut p = upright(&BODY);
    let u = 0.5 - 0.5 * (2.0 * PI * t / 2.5).cos();
    p.hip = [p.hip[0] - 0.15 * u, p.hip[1] - 0.35 * u];
    (p.trunk, p.pelvis, p.arms) = (0.7 * u, 0.4 * u, [0.9 * u; 2]);
    p
}

#[test]
fn a_seat_is_named_with_its_time_and_place_and_the_rest_tells_the_mass() {
    let (code, result, said) = identified(18.0, &rising(&BODY, 6.0), &on_the_seat(6.0));
    assert_eq!(code, 0, "{said}");
    let found = contacts(&result);
    // She sits at the beginning, twice between, and at the end.
    assert_eq!(found.len(), 4, "{found:?}");
    for contact in &found {
        assert_eq!(contact["near"], "pelvis", "{contact}");
        let up = contact["force_n"][2].as_f64().unwrap();
        assert!((250.0..560.0).contains(&up), "{contact}");
    }
    let second = found[1]["times_s"].as_array().unwrap();
    let [from, to] = [0, 1].map(|k| second[k].as_f64().unwrap());
    assert!((4.6..5.3).contains(&from) && (7.9..8.5).contains(&to), "{second:?}");
    weighs(&result, 3.0);
    assert!(result["warnings"].to_string().contains("something that no plate measures pushes"));
}

#[test]
fn feet_that_hardly_touch_their_plates_are_no_plates_without_load() {
    // While she sits the seat has 93 % of her: 23 N are left on each plate, and rest.
    let seat = |t: f64| {
        let u = (t / 6.0).rem_euclid(1.0);
        if (0.30..0.88).contains(&u) { on_the_seat(6.0)(t) } else { Carried::SeatOf(0.93) }
    };
    let (code, result, said) = identified(18.0, &rising(&BODY, 6.0), &seat);
    assert_eq!(code, 0, "{said}");
    let found = contacts(&result);
    assert_eq!(found.len(), 4, "{found:?}");
    assert!(found.iter().all(|contact| contact["near"] == "pelvis"), "{found:?}");
    weighs(&result, 3.0);
    let warnings = result["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(result["notes"].to_string().contains("always loaded"), "{}", result["notes"]);
}

#[test]
fn who_sits_all_the_time_has_no_mass() {
    let seated = |t: f64| {
        let mut p = rising(&BODY, 6.0)(0.4);
        p.trunk += 0.1 * (2.0 * t).sin();
        p.arms[0] += 0.3 * (3.0 * t).sin();
        p
    };
    let (code, result, said) = identified(8.0, &seated, &|_| Carried::Seat(-0.30));
    assert_eq!(code, 2, "{result}");
    assert!(said.contains("living people of that stature") && said.contains("seat"), "{said}");
}

/// Exit status, the result, and what was said, of a motion alone, with some options.
fn alone(files: &Files, options: &[&str]) -> (i32, Value, String) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "motion", files);
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command.current_dir(folder.path()).args(["body", "identify", "motion.trc", "--json", "--out", "out"]);
    let output = command.args(options).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let result = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code().unwrap(), result, said)
}

#[test]
fn a_stature_is_that_of_an_upright_frame_or_not_claimed() {
    // She sits in the first frame, and rises.
    let rises = BODY.recorded(6.0, &rising(&BODY, 6.0), &on_the_seat(6.0));
    let (_, result, said) = alone(&rises, &[]);
    let height_m = result["person"]["height_m"].as_f64().unwrap_or_else(|| panic!("{said}"));
    assert!((height_m / BODY.height_m - 1.0).abs() < 0.08, "{height_m}");
    assert!(!result["warnings"].to_string().contains("upright in no frame"), "{}", result["warnings"]);
    // She sits all the time: her legs do not tell how tall she is.
    let sits = BODY.recorded(2.0, &|_| rising(&BODY, 6.0)(0.4), &|_| Carried::Seat(-0.30));
    let (code, _, said) = alone(&sits, &[]);
    assert!(code == 2 && said.contains("upright in no frame") && said.contains("--height-m"), "{said}");
}

#[test]
fn a_stature_that_is_not_the_markers_is_named_with_both() {
    let squats = BODY.recorded(2.0, &squat, &|_| Carried::Both);
    let (_, result, said) = alone(&squats, &["--height-m", "1.95"]);
    assert!(result["warnings"].to_string().contains("the stature is given as 1.95 m"), "{result} {said}");
    for (given, words) in
        [("1.2", "given as 1.200 m, and by the markers it is about 1."), ("1720", "unit right")]
    {
        let (code, _, said) = alone(&squats, &["--height-m", given]);
        assert!(code == 2 && said.contains(words), "{said}");
    }
}

#[test]
fn a_tool_in_the_hand_is_parted_from_the_person() {
    let held = (5.0, [0.02, 0.0, -0.2], 0.15);
    let folder = tempfile::tempdir().unwrap();
    let works = |t: f64| {
        let swing = |hz: f64, begin: f64| (2.0 * PI * hz * t + begin).sin();
        let mut p = squat(0.6 * t);
        p.arms = [0.5 + 0.4 * swing(0.7, 0.0), 0.5 + 0.4 * swing(0.55, 1.0)];
        p.elbows = [0.8 + 0.4 * swing(0.45, 2.0), 0.8 + 0.5 * swing(0.8, 0.5)];
        p
    };
    write(folder.path(), "standing", &BODY.recorded(1.0, &|_| upright(&BODY), &|_| Carried::Both));
    write(folder.path(), "bare", &BODY.recorded(5.0, &works, &|_| Carried::Both));
    let with = Somebody { held: Some(held), ..BODY };
    write(folder.path(), "with", &with.recorded(5.0, &works, &|_| Carried::Both));
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command.current_dir(folder.path()).args(["body", "identify", "with.trc", "--static", "standing.trc"]);
    command.args(["--tool", "drill", "--tool-link", "r_hand", "--tare", "bare.trc", "--plates-zeroed"]);
    let output = command.args(["--height-m", "1.72", "--json", "--out", "out"]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let result: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{said}"));
    // The person is she without it.
    weighs(&result, 3.0);
    let tool = &result["person"]["tool"];
    let inside = |found: &Value, true_value: f64, widest: f64| {
        let (value, u95) = (found["value"].as_f64().unwrap(), found["u95"].as_f64().unwrap());
        assert!((value - true_value).abs() < u95 && u95 < widest, "{true_value}: {tool}");
    };
    inside(&tool["mass_kg"], held.0, 1.0);
    inside(&tool["com_m"][2], held.1[2], 0.3);
}

#[test]
fn a_rail_is_named_where_the_hand_is() {
    // Squats with a rail pushed down upon with 120 N for two seconds of six.
    let push = |t: f64| 120.0 * ramp(t, 4.0, 4.3) * (1.0 - ramp(t, 6.2, 6.5));
    let rail = |t: f64| if push(t) > 0.0 { Carried::Hand([0.25, 1.0], push(t)) } else { Carried::Both };
    let (code, result, said) = identified(12.0, &squat, &rail);
    assert_eq!(code, 0, "{said}");
    let found = contacts(&result);
    assert_eq!(found.len(), 1, "{found:?}");
    let [from, to] = [0, 1].map(|k| found[0]["times_s"][k].as_f64().unwrap());
    assert!(from < 4.2 && to > 6.3 && to - from < 3.2, "{found:?}");
    assert!((found[0]["most_n"].as_f64().unwrap() - 120.0).abs() < 25.0, "{found:?}");
    weighs(&result, 3.0);
}

#[test]
fn squats_touch_nothing_but_the_plates() {
    let (code, result, said) = identified(10.0, &squat, &|_| Carried::Both);
    assert_eq!(code, 0, "{said}");
    assert_eq!(contacts(&result).len(), 0);
    weighs(&result, 3.0);
}

#[test]
fn a_jump_from_a_box_tells_the_mass_without_the_box() {
    let (code, result, said) = identified(6.0, &drop_jump(&BODY), &drop_carried);
    assert_eq!(code, 0, "{said}");
    let found = contacts(&result);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0]["times_s"][1].as_f64().unwrap() > 1.9 && found[0]["force_n"][2].as_f64().unwrap() > 550.0
    );
    weighs(&result, 4.0);
}

#[test]
fn who_runs_loses_no_frame_because_a_foot_is_in_the_air_or_on_its_toe() {
    let slow = Gait { speed_mps: 2.5, step_s: 0.36, stance_s: 0.25 };
    let fast = Gait { speed_mps: 4.0, step_s: 0.32, stance_s: 0.16 };
    for gait in [slow, fast] {
        // A plate under one step of each foot alone: the steps before and after it are on the floor.
        let two = |t: f64| (2..4).contains(&((t / gait.step_s) as i32)).then(|| gait.carried(t));
        let carried = |t: f64| two(t).unwrap_or(Carried::Elsewhere);
        let (code, result, said) = identified(2.5, &|t| gait.posture(&BODY, t), &carried);
        assert_eq!(code, 0, "{said}");
        let trial = &result["person"]["trials"][0];
        assert!(trial["dropped"].to_string().contains("a foot is on the floor beside the plates"), "{trial}");
        assert_eq!(contacts(&result).len(), 0, "{trial}");
        weighs(&result, 10.0);
        let (code, result, said) = identified(2.5, &|t| gait.posture(&BODY, t), &|t| gait.carried(t));
        assert_eq!(code, 0, "{said}");
        let trial = &result["person"]["trials"][0];
        let used = trial["used"].as_u64().unwrap();
        assert!(used > 200, "{trial}");
        assert_eq!(contacts(&result).len(), 0, "{trial}");
        weighs(&result, 5.0);
    }
}
