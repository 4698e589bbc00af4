//! `rigident body identify` on recorded people: whole masses against scales and plates, and motions that were
//! left out.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name)
}

/// The result of trials of a folder.
fn identify(folder: &Path, line: &[&str], files: &[(&str, &str)]) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command.current_dir(folder).args(["body", "identify", "--json", "--out", "out"]).args(line);
    for (option, file) in files {
        if !option.is_empty() {
            command.arg(option);
        }
        command.arg(data(file));
    }
    let output = command.output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Value and U95 of a mass.
fn mass(result: &Value, field: &str) -> (f64, f64) {
    let mass = &result["person"][field];
    (mass["value"].as_f64().unwrap(), mass["u95"].as_f64().unwrap())
}

/// Checks that a mass is within 1 % of the true one, and that its interval, of at most 3 %, says so.
#[track_caller]
fn weighs(result: &Value, true_kg: f64) {
    for field in ["mass_kg", "mass_with_table_kg"] {
        let (value, u95) = mass(result, field);
        assert!((value / true_kg - 1.0).abs() < 0.01, "{field}: {value} ± {u95}, {true_kg}");
        assert!((value - true_kg).abs() < u95 && u95 < 0.03 * true_kg, "{field}: {value} ± {u95}, {true_kg}");
    }
}

const GAIT: &[(&str, &str)] = &[
    ("", "human_gait2354_subject01_walk/subject01_walk1.trc"),
    ("--static", "human_gait2354_subject01_walk/subject01_static.trc"),
];

#[test]
#[ignore = "needs ../shared/data"]
fn strides_of_shared_data_are_predicted_no_worse_than_by_the_table_on_any_axis() {
    let folder = tempfile::tempdir().unwrap();
    let result = identify(folder.path(), &["--height-m", "1.8", "--parts", "strides"], GAIT);
    assert_eq!(result["person"]["motions"], 2);
    no_worse(&result);
}

/// Checks that motions that were left out are predicted no worse than by the table beyond chance.
#[track_caller]
fn no_worse(found: &Value) {
    for channel in found["person"]["left_out"].as_array().unwrap() {
        assert!(channel["gain_sd"].as_f64().unwrap() > -2.0, "{channel}");
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn walking_people_of_shared_data_weigh_as_much_as_scales_and_plates_say() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, line: &[&str], files: &[(&str, &str)]| {
        let own = folder.path().join(name);
        std::fs::create_dir(&own).unwrap();
        identify(&own, line, files)
    };
    // Weighed: 72.6 kg.
    let gait = run("gait", &["--height-m", "1.8"], GAIT);
    weighs(&gait, 72.6);
    // Scales make the mass better known, and change nothing of what the plates say.
    let weighed = run("weighed", &["--height-m", "1.8", "--mass-kg", "72.6"], GAIT);
    weighs(&weighed, 72.6);
    assert!(mass(&weighed, "mass_with_table_kg").1 < 0.9 * mass(&gait, "mass_with_table_kg").1);
    // One part of the walk after the other is left out: on every axis no worse than the table, and better but
    // for the lateral force.
    no_worse(&gait);
    for channel in gait["person"]["left_out"].as_array().unwrap() {
        let of = |field: &str| channel[field].as_f64().unwrap();
        assert!(channel["name"] == "fy" || of("rms") < of("table_rms"), "{channel}");
    }
    // Nothing but the plates is touched, and these are level.
    for trial in gait["person"]["trials"].as_array().unwrap() {
        assert!(trial.get("unmeasured").is_none(), "{trial}");
        assert!(trial["tilt_deg"][0]["value"].as_f64().unwrap().abs() < 0.6, "{trial}");
    }
    // A head is a twelfth of people, and left and right are one person's.
    let segment = |name: &str| {
        let all = gait["person"]["segments"].as_array().unwrap().clone();
        all.into_iter().find(|s| s["name"] == name).unwrap()["mass_kg"]["value"].as_f64().unwrap()
    };
    assert!((4.3..6.3).contains(&segment("head")), "{}", segment("head"));
    assert!((segment("l_thigh") / segment("r_thigh") - 1.0).abs() < 0.1);
    // By the plates while standing: 60.75 kg. Neither trunk nor arms have markers.
    let files = [
        ("", "human_btk_pig_60kg_functional/FunctionalWalk.c3d"),
        ("--static", "human_btk_pig_60kg_functional/FunctionalStatic.c3d"),
    ];
    let walk = run("functional", &["--height-m", "1.68"], &files);
    weighs(&walk, 60.75);
    assert!(!walk["warnings"].to_string().contains("not the cameras' vertical"), "{}", walk["warnings"]);
    no_worse(&walk);
    // Of the model: 85.27 kg; the balance of forces says 84.71.
    let files = [
        ("", "human_rajagopal2016_walk/markers_walk.trc"),
        ("--ground", "human_rajagopal2016_walk/grf_walk.mot"),
    ];
    weighs(&run("rajagopal", &[], &files), 85.27);
    // A step of 0.4 s alone does not tell the mass to 10 %, and no number is given; with the standing trial
    // it does. By the plates 46.30 kg.
    let walk = ("", "human_btk_pig_47kg_fullbody/PiG_Motion-FlatFoot-Full.c3d");
    let standing = "human_btk_pig_47kg_fullbody/PiG_Calibration-FlatFoot-Full.c3d";
    let short = run("short", &["--height-m", "1.505"], &[walk, ("--static", standing)]);
    assert!(short["person"].get("mass_kg").is_none(), "{}", short["person"]["mass_kg"]);
    assert_eq!(short["person"]["segments"].as_array().unwrap().len(), 0);
    let both = run("both", &["--height-m", "1.505"], &[walk, ("", standing)]);
    let (value, u95) = mass(&both, "mass_with_table_kg");
    assert!((value / 46.3 - 1.0).abs() < 0.01 && (value - 46.3).abs() < u95, "{value} ± {u95}");
    no_worse(&short);
    no_worse(&both);
}

#[test]
#[ignore = "needs ../shared/data"]
fn standing_alone_shared_data_tell_the_mass_and_little_else() {
    let folder = tempfile::tempdir().unwrap();
    let files = [("", "human_btk_pig_60kg_functional/FunctionalStatic.c3d")];
    let found = identify(folder.path(), &["--height-m", "1.68"], &files);
    let (value, u95) = mass(&found, "mass_kg");
    // Two plates that were always loaded, each with a zero known to 5 N: 1.96 · √2 · 5 N / g = 1.41 kg; and a
    // scale of 1 % that both share and 1 % of each: 1.96 · 1 % · √1.5 · 60.75 kg = 1.46 kg. Together 2.03 kg.
    // The plates' own scales follow the moments, which the joints' errors blur: the mass may move by half of
    // that.
    assert!((value - 60.75).abs() < 0.6 * u95 && (1.9..2.4).contains(&u95), "{value} ± {u95}");
    // Breathing and skin move as much as the segments do, and count as slow noise: of these nothing is said
    // beyond the table.
    let segments = found["person"]["segments"].as_array().unwrap();
    assert!(segments.iter().all(|segment| segment["identified"] == false), "{segments:?}");
    // With the walk, in which both plates have time without load, their zeros are known. Standing, they read
    // 595.72 N together; without load in the walk 0.80 N and −2.77 N (medians): 597.69 N, 60.95 kg.
    let files = [files[0], ("", "human_btk_pig_60kg_functional/FunctionalWalk.c3d")];
    let both = tempfile::tempdir().unwrap();
    let both = identify(both.path(), &["--height-m", "1.68"], &files);
    let (value, u95) = mass(&both, "mass_kg");
    // Scales alone are 1.46 kg.
    assert!((value - 60.95).abs() < u95 && u95 < 1.6, "{value} ± {u95}");
    // By themselves the rows tell nothing of a tensor: all that are there rest on the table.
    let tensors = found["parameters"].as_array().unwrap().iter().filter(|p| {
        p["name"].as_str().unwrap().contains(".J") && p["state"]["state"] == "identified"
            || p["name"].as_str().unwrap().contains(".J") && p["state"] == "identified"
    });
    assert_eq!(tensors.count(), 0);
}

#[test]
#[ignore = "needs ../shared/data"]
fn a_model_of_shared_data_s_person_is_written_and_weighs_as_much_as_she() {
    let folder = tempfile::tempdir().unwrap();
    let line = ["--height-m", "1.8", "--write-model", "subject.urdf", "--symmetric-sides"];
    let found = identify(folder.path(), &line, GAIT);
    let urdf = std::fs::read_to_string(folder.path().join("subject.urdf")).unwrap();
    let masses = urdf.split("<mass value=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    let written: f64 = masses.map(|m| m.parse::<f64>().unwrap()).sum();
    let segments = found["person"]["segments"].as_array().unwrap();
    let of = |name: &str| {
        let own = segments.iter().find(|s| s["name"] == name).unwrap();
        own["mass_kg"]["value"].as_f64().unwrap()
    };
    let identified: f64 = segments.iter().map(|s| s["mass_kg"]["value"].as_f64().unwrap()).sum();
    assert!((written - identified).abs() < 1e-6 * identified, "{written} {identified}");
    assert!((identified / 72.6 - 1.0).abs() < 0.01, "{identified}");
    for segment in ["thigh", "shank", "foot", "upper_arm"] {
        let (left, right) = (of(&format!("l_{segment}")), of(&format!("r_{segment}")));
        assert!((left - right).abs() < 1e-9 * left, "{segment}: {left} {right}");
    }
    let page = std::fs::read_to_string(folder.path().join("out/motion.html")).unwrap();
    assert!(page.contains("subject01_walk1") && page.contains("</html>"));
}

const FULL_BODY: &[(&str, &str)] = &[
    ("", "human_btk_pig_47kg_fullbody/PiG_Motion-FlatFoot-Full.c3d"),
    ("", "human_btk_pig_47kg_fullbody/PiG_Calibration-FlatFoot-Full.c3d"),
    ("--static", "human_btk_pig_47kg_fullbody/PiG_Calibration-FlatFoot-Full.c3d"),
];

/// All 128 parameters at 100 frames a second: the firmware's rows are those of the same frames in double
/// precision.
fn streams_to(mcu: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let result = identify(folder.path(), &["--height-m", "1.505", "--mcu", mcu], FULL_BODY);
    assert_eq!(result["parameters"].as_array().unwrap().len(), 128);
    assert_eq!(result["source"]["rate_hz"], 100.0);
    let device = result["person"]["device"].clone();
    let number = |key: &str| device[key].as_f64().unwrap();
    assert!(number("frames") > 50.0 && number("rows") > 300.0, "{device}");
    assert!(number("share_of_allowed") <= 1.0 && number("from_answer_sd") < 0.05, "{device}");
    let warned =
        result["warnings"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains("frames "));
    assert!(!warned, "{}", result["warnings"]);
    device
}

#[test]
#[ignore = "needs ../shared/data"]
fn the_firmware_makes_the_same_of_shared_data() {
    streams_to("inproc");
}

#[test]
#[ignore = "needs ../shared/data and the emulated board"]
fn the_emulated_board_makes_the_same_of_shared_data() {
    let (there, here) = (streams_to("qemu"), streams_to("inproc"));
    assert_eq!(there["largest_difference_sd"], here["largest_difference_sd"]);
}

#[test]
#[ignore = "needs ../shared/data"]
fn who_holds_nothing_in_shared_data_holds_nothing_within_its_interval() {
    let folder = tempfile::tempdir().unwrap();
    let files = [FULL_BODY[0], ("--tare", FULL_BODY[1].1), FULL_BODY[2]];
    let result = identify(folder.path(), &["--height-m", "1.505", "--tool", "nothing"], &files);
    let tool = &result["person"]["tool"];
    assert_eq!((tool["name"].as_str(), tool["link"].as_str()), (Some("nothing"), Some("r_hand")));
    let inside = |m: &Value| m["value"].as_f64().unwrap().abs() <= m["u95"].as_f64().unwrap();
    assert!(inside(&tool["mass_kg"]), "{tool}");
    let all = ["first_moment_kgm", "inertia_kgm2"].map(|key| tool[key].as_array().unwrap().clone()).concat();
    assert_eq!(all.len(), 9);
    assert!(all.iter().filter(|m| inside(m)).count() >= 8, "{tool}");
    // Nobody knows where nothing has its centre.
    assert!(tool.get("com_m").is_none());
}

/// Writes the walk on a treadmill with forces turned about the transverse axis by some degrees into a folder,
/// with the standing trial.
fn turned_walk(folder: &Path, degrees: f64) {
    let read =
        |name: &str| std::fs::read_to_string(data("human_gait2354_subject01_walk").join(name)).unwrap();
    let (s, c) = degrees.to_radians().sin_cos();
    let mot = read("subject01_walk1_grf.mot");
    let lines = mot.lines().map(|line| {
        let cells: Vec<f64> = line.split('\t').filter_map(|cell| cell.trim().parse().ok()).collect();
        if cells.len() < 19 {
            return line.to_owned();
        }
        let mut cells = cells;
        // Columns of x and y of both forces and free moments; y is up.
        for at in [1, 7, 13, 16] {
            let [x, y] = [cells[at], cells[at + 1]];
            (cells[at], cells[at + 1]) = (c * x - s * y, s * x + c * y);
        }
        cells.iter().map(f64::to_string).collect::<Vec<_>>().join("\t")
    });
    std::fs::write(folder.join("walk_grf.mot"), lines.collect::<Vec<_>>().join("\n")).unwrap();
    std::fs::write(folder.join("walk.trc"), read("subject01_walk1.trc")).unwrap();
    std::fs::write(folder.join("standing.trc"), read("subject01_static.trc")).unwrap();
}

#[test]
#[ignore = "needs ../shared/data"]
fn plates_of_shared_data_that_lean_are_named_with_degrees_and_make_no_head_heavier() {
    for degrees in [-2.0, 2.0, 5.7] {
        let folder = tempfile::tempdir().unwrap();
        turned_walk(folder.path(), degrees);
        let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
        command.current_dir(folder.path()).args(["body", "identify", "walk.trc", "--static", "standing.trc"]);
        let output = command.args(["--height-m", "1.8", "--json", "--out", "out"]).output().unwrap();
        let result: Value = serde_json::from_slice(&output.stdout).unwrap();
        let lean = result["person"]["trials"][0]["tilt_deg"][0]["value"].as_f64().unwrap();
        assert!((lean + degrees).abs() < 0.6, "{degrees}: {lean}");
        assert!(result["warnings"].to_string().contains("not the cameras' vertical"), "{degrees}");
        let segments = result["person"]["segments"].as_array().unwrap();
        // A slope is a contradiction: nothing is reported.
        assert_eq!(segments.is_empty(), degrees > 5.0);
        assert_eq!(output.status.code(), Some(i32::from(degrees > 5.0)));
        for head in segments.iter().filter(|s| s["name"] == "head") {
            let kg = head["mass_kg"]["value"].as_f64().unwrap();
            assert!((4.3..6.0).contains(&kg), "{degrees}: {kg}");
        }
    }
}

#[test]
#[ignore = "needs ../shared/data"]
fn raised_arms_in_shared_data_make_nobody_taller() {
    // She is 1.80 m tall, and stands with her arms raised sidewards: with their markers she was 1.92 m.
    let folder = tempfile::tempdir().unwrap();
    let height_m = identify(folder.path(), &[], GAIT)["person"]["height_m"].as_f64().unwrap();
    assert!((height_m - 1.8).abs() < 0.04, "{height_m}");
}
