//! The commands as a user types them: answers, files, exit statuses, complaints.
#![cfg(feature = "simulator")]

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::program::{json, rigident, said, status};

/// Values of the parameters that have one.
fn values(result: &Value) -> Vec<Option<(f64, f64)>> {
    let parameters = result["parameters"].as_array().unwrap();
    parameters.iter().map(|p| Some((p["value"].as_f64()?, p["u95"].as_f64()?))).collect()
}

/// The thesis' test body, lying, about S's origin: 20 kg at 53 mm.
const TRUTH: [f64; 10] = [
    20.0,
    0.0,
    0.0,
    1.06,
    0.3813 + 20.0 * 0.053 * 0.053,
    0.0185 + 20.0 * 0.053 * 0.053,
    0.3791,
    0.0,
    0.0,
    0.0,
];

#[test]
fn a_demonstration_ends_when_the_uncertainties_asked_for_are_reached() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rows = |extra: &[&str], out: &str| {
        let mut words = vec!["demo", "--until", "m=0.03,Ixx=0.0015", "--json", "--out", out];
        words.extend(extra);
        let output = rigident(at, &words);
        assert!(status(&output) < 2, "{}", said(&output));
        assert!(said(&output).contains("the uncertainties asked for were reached"), "{}", said(&output));
        (json(&output)["source"]["rows"].as_u64().unwrap(), json(&output))
    };
    // The demonstration takes a minute, 60 000 rows.
    let (early, result) = rows(&[], "early");
    assert!(early < 50_000, "{early}");
    for (name, u95) in [(0, 0.03), (4, 0.0015)] {
        let (_, reached) = values(&result)[name].unwrap();
        // The answer widens its uncertainties where the residuals exceed the noise that was stated: some per
        // cent at most.
        assert!(reached <= 1.1 * u95, "{reached} {u95}");
    }
    let (whole, _) = rows(&["--keep-going"], "whole");
    assert!(whole > 59_000, "{whole}");
}

#[test]
fn a_demonstration_that_decides_for_itself_is_over_soon_and_lists_its_decisions() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let output = rigident(at, &["demo", "--adaptive", "--json", "--out", "a"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let result = json(&output);
    // A minute in the fixed experiment.
    let rows = result["source"]["rows"].as_u64().unwrap();
    assert!(rows < 10_000, "{rows}");
    for (j, (measured, truth)) in values(&result).iter().zip(TRUTH).enumerate() {
        let (value, u95) = measured.unwrap();
        assert!((value - truth).abs() < 5.0 * u95 / 1.96, "parameter {j}: {value} ± {u95}, truth {truth}");
        // A hundredth of the largest principal moment, 0.381 kg m², as estimated.
        assert!(!(4..10).contains(&j) || u95 < 1.1 * 0.00381, "parameter {j}: {u95}");
    }
    let page = fs::read_to_string(at.join("a/report.html")).unwrap();
    assert!(page.contains("<h2>Decisions</h2>") && page.contains("made for it, about home"));

    // A fixed programme, ended when its time is up.
    let output = rigident(at, &["demo", "--at-most-s", "8", "--json", "--out", "c"]);
    assert!(status(&output) < 2, "{}", said(&output));
    let result = json(&output);
    let rows = result["source"]["rows"].as_u64().unwrap();
    assert!((8_000..9_000).contains(&rows), "{rows}");
    assert!(result["warnings"].to_string().contains("--at-most-s"), "{result}");

    // What nothing can reach is said, and what there is by then is stored.
    let output =
        rigident(at, &["demo", "--adaptive", "--until", "Ixx=1e-5", "--at-most-s", "5", "--out", "b"]);
    assert!(status(&output) < 2, "{}", said(&output));
    assert!(said(&output).contains("was expected"), "{}", said(&output));
    assert!(at.join("b/demo.mcap").exists());
    for (words, why) in [
        (&["demo", "--adaptive", "--until-relative", "0"][..], "a share of the largest principal moment"),
        (&["demo", "--adaptive", "--at-most-s", "0"], "--at-most-s 0"),
        (&["demo", "--at-most-s", "nan"], "--at-most-s NaN"),
        (&["demo", "--until-relative", "0.01"], "--adaptive"),
        (&["demo", "--adaptive", "--forget", "5"], "cannot be used with"),
        (&["demo", "--adaptive", "--plan", "p.json"], "cannot be used with"),
    ] {
        let output = rigident(at, words);
        assert_eq!(status(&output), 2, "{words:?}");
        assert!(said(&output).contains(why), "{words:?}: {}", said(&output));
    }
}

/// One demonstration serves several tests' questions: files, truth, replay, conversion.
#[test]
fn the_demonstration_finds_the_body_and_its_recording_replays_to_the_same_bits() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let output = rigident(at, &["demo", "--duration-s", "20", "--json", "--out", "d"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let result = json(&output);
    assert_eq!(result["schema"], "rigident/result/3");
    assert_eq!(result["status"], "identified");
    assert_eq!(result["source"]["mcu"], "inproc");
    assert_eq!(
        result,
        serde_json::from_slice::<Value>(&fs::read(at.join("d/result.json")).unwrap()).unwrap()
    );
    for (j, (measured, truth)) in values(&result).iter().zip(TRUTH).enumerate() {
        let (value, u95) = measured.unwrap();
        // Five σ: one in a hundred thousand experiments of ten parameters.
        assert!((value - truth).abs() < 5.0 * u95 / 1.96, "parameter {j}: {value} ± {u95}, truth {truth}");
    }
    assert_eq!(result["parameters"].as_array().unwrap().len(), 16);
    let page = fs::read_to_string(at.join("d/report.html")).unwrap();
    assert!(page.contains("<svg") && !page.contains("http://") && !page.contains("src="));

    // The recording through the firmware again gives the very factor.
    let output = rigident(at, &["replay", "d/demo.mcap", "--mcu", "inproc", "--json", "--out", "r"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    assert_eq!(json(&output)["parameters"], result["parameters"]);
    assert_eq!(fs::read(at.join("r/demo.factor")).unwrap(), fs::read(at.join("d/demo.factor")).unwrap());

    // The batch in f64 agrees within a hundredth of the uncertainty: f32 costs no more.
    let output = rigident(at, &["identify", "d/demo.mcap", "--json", "--out", "i"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    for (batch, live) in values(&json(&output)).iter().zip(values(&result)) {
        let ((a, _), (b, u95)) = (batch.unwrap(), live.unwrap());
        assert!((a - b).abs() < 0.01 * u95, "{a} {b} {u95}");
    }

    // There and back again, to the byte.
    for (from, to) in [("d/demo.mcap", "a.csv"), ("a.csv", "b.mcap"), ("b.mcap", "c.csv")] {
        let output = rigident(at, &["convert", from, to]);
        assert_eq!(status(&output), 0, "{}", said(&output));
    }
    assert_eq!(fs::read(at.join("a.csv")).unwrap(), fs::read(at.join("c.csv")).unwrap());
    let again = rigident(at, &["convert", "d/demo.mcap", "a.csv"]);
    assert_eq!(status(&again), 2);
}

/// Noise, bias and bandwidth off, through the register models with their quantisation: 1e-3.
#[test]
fn quantisation_costs_less_than_a_thousandth() {
    let place = tempfile::tempdir().unwrap();
    for body in ["horizontal", "vertical"] {
        let output = rigident(
            place.path(),
            &["demo", "--ideal", "--body", body, "--duration-s", "30", "--json", "--out", body],
        );
        let result = json(&output);
        let got: Vec<f64> = values(&result).iter().take(10).map(|v| v.unwrap().0).collect();
        let (c, ic) = match body {
            "horizontal" => (0.053, [0.3813, 0.0185, 0.3791]),
            _ => (0.247, [0.505, 0.505, 0.0162]),
        };
        let shift = 20.0 * c * c;
        let truth = [20.0, 0.0, 0.0, 20.0 * c, ic[0] + shift, ic[1] + shift, ic[2], 0.0, 0.0, 0.0];
        let distance = |range: std::ops::Range<usize>| {
            let norm = |v: &dyn Fn(usize) -> f64| {
                range.clone().map(|j| v(j).powi(2) * if j > 6 { 2.0 } else { 1.0 }).sum::<f64>().sqrt()
            };
            norm(&|j| got[j] - truth[j]) / norm(&|j| truth[j])
        };
        for part in [0..1, 1..4, 4..10] {
            assert!(distance(part.clone()) < 1e-3, "{body} {part:?}: {}", distance(part.clone()));
        }
    }
}

/// The emulated Cortex-M4F gives the bits of the firmware in this process.
#[cfg(feature = "emulator")]
#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_demonstration_is_the_in_process_one_bit_for_bit() {
    let place = tempfile::tempdir().unwrap();
    let demo = |mcu: &str| {
        let output =
            rigident(place.path(), &["demo", "--mcu", mcu, "--duration-s", "20", "--json", "--out", mcu]);
        assert_eq!(status(&output), 0, "{}; without firmware: cargo xtask firmware", said(&output));
        let factor = fs::read(place.path().join(mcu).join("demo.factor")).unwrap();
        (json(&output)["parameters"].clone(), factor)
    };
    assert_eq!(demo("inproc"), demo("qemu"));
}

/// Still poses of a real load cell; the folder lies beside the project.
const END_EFFECTOR: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../../shared/data/endeffector_ati_gamma_imu/0-calibration_fts-accel.csv"
);

fn example(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples").join(name).display().to_string()
}

/// 24 poses of a real load cell. Least squares over the poses by another program gives 0.9323 kg, 43.90 mm
/// and the offsets below, on the sensor; the tensor is not in the data.
fn check_end_effector(result: &Value) {
    let v = values(result);
    let (m, u) = v[0].unwrap();
    // Gains of a load cell of the class 1 %, nobody having stated another: ± 1.96 × 0.58 % in one channel.
    assert!((m - 0.9323).abs() < u && u < 1.96 * 0.0058 * m, "{m} ± {u}");
    let (com, com_u) = (result["com_m"][2].as_f64().unwrap(), result["com_u95_m"][2].as_f64().unwrap());
    assert!((com - 0.0439).abs() < com_u && com_u < 1e-3, "{com} ± {com_u}");
    for (measured, on_sensor) in v[10..].iter().zip([9.077, -1.018, 9.985, 0.4325, -0.6916, -0.1570]) {
        let (offset, u95) = measured.unwrap();
        assert!((offset + on_sensor).abs() < u95, "{offset} ± {u95}");
    }
    assert!(v[4..10].iter().all(Option::is_none));
    assert!(result.get("inertia_com_kgm2").is_none() && result.get("principal").is_none());
}

#[test]
#[ignore = "needs ../shared/data"]
fn an_end_effector_in_shared_data_is_identified_and_its_tensor_is_not() {
    let place = tempfile::tempdir().unwrap();
    for (rig, out) in [("endeffector.rig.toml", "g"), ("endeffector-accelerometer.rig.toml", "a")] {
        let asked = ["--estimate", "m,mc,offset", "--json", "--out", out];
        let rig = example(rig);
        let output =
            rigident(place.path(), &[&["identify", END_EFFECTOR, "--rig", &rig][..], &asked].concat());
        assert_eq!(status(&output), 0, "{}", said(&output));
        check_end_effector(&json(&output));
    }
    // Asked for everything, the exit status says that something is missing.
    let output = rigident(
        place.path(),
        &["identify", END_EFFECTOR, "--rig", &example("endeffector.rig.toml"), "--out", "all"],
    );
    assert_eq!(status(&output), 1);
    let page = fs::read_to_string(place.path().join("all/report.html")).unwrap();
    assert!(page.contains("not identified"));
}

#[cfg(feature = "emulator")]
#[test]
#[ignore = "needs the emulated board and ../shared/data"]
fn the_emulated_board_replays_the_end_effector_in_shared_data() {
    let place = tempfile::tempdir().unwrap();
    for mcu in ["inproc", "qemu"] {
        let rig = example("endeffector.rig.toml");
        let output = rigident(
            place.path(),
            &[
                "replay",
                END_EFFECTOR,
                "--rig",
                &rig,
                "--mcu",
                mcu,
                "--estimate",
                "m,mc,offset",
                "--json",
                "--out",
                mcu,
            ],
        );
        assert_eq!(status(&output), 0, "{}", said(&output));
        check_end_effector(&json(&output));
    }
}

const HEADER: &str = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,\
                      imu_gy_radps,imu_gz_radps\n";

/// A platform that only sways about the vertical: 3 kg, offsets of nothing, a little noise.
pub fn yaw_only(rows: u32, frozen_from: u32) -> String {
    let mut text = HEADER.to_owned();
    let mut state = 1_u64;
    let mut noise = |sigma: f64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        sigma * ((state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0)
    };
    for n in 0..rows {
        let t = f64::from(n) * 0.005;
        let rate = 0.8 * (2.0 * t).sin() + noise(1e-3);
        let gyro = if n >= frozen_from { [0.123, 0.0456, 0.789] } else { [noise(1e-3), noise(1e-3), rate] };
        let row = [
            noise(0.05),
            noise(0.05),
            3.0 * 9.81 + noise(0.05),
            noise(0.01),
            noise(0.01),
            0.05 * 1.6 * (2.0 * t).cos() + noise(0.01),
            noise(0.02),
            noise(0.02),
            9.81 + noise(0.02),
            gyro[0],
            gyro[1],
            gyro[2],
        ];
        let cells: Vec<String> = std::iter::once(t).chain(row).map(|v| format!("{v:?}")).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

#[test]
fn too_little_excitation_gives_no_number_and_says_which_motion_would_help() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("yaw.csv"), yaw_only(4000, u32::MAX)).unwrap();
    let output = rigident(place.path(), &["identify", "yaw.csv", "--json", "--out", "o"]);
    assert_eq!(status(&output), 1, "{}", said(&output));
    let result = json(&output);
    assert_eq!(result["status"], "not_identified");
    for parameter in result["parameters"].as_array().unwrap() {
        let missing = parameter["state"] == "not_identified";
        assert_eq!(parameter.get("value").is_none(), missing, "{parameter}");
    }
    // Mass and the vertical offset cannot be distinguished without tilting.
    assert_eq!(result["parameters"][0]["state"], "not_identified");
    let advice = result["advice"].to_string();
    assert!(advice.contains("attitudes") && advice.contains("S.x"), "{advice}");
}

#[test]
fn a_frozen_sensor_is_named_and_its_rows_are_counted() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("frozen.csv"), yaw_only(4000, 3000)).unwrap();
    let output = rigident(place.path(), &["identify", "frozen.csv", "--json", "--out", "o"]);
    let result = json(&output);
    // Fifty equal readings make it frozen.
    assert_eq!(result["rejected_rows"], 1000 - 50);
    assert!(result["warnings"].to_string().contains("imu_gx_radps"), "{}", result["warnings"]);
}

#[test]
fn a_monte_carlo_prints_one_object_that_follows_from_its_seed() {
    let place = tempfile::tempdir().unwrap();
    let arguments = ["montecarlo", "--runs", "30", "--seed", "5", "--json"];
    let output = rigident(place.path(), &arguments);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let result = json(&output);
    assert_eq!(result["runs"], 30);
    let parameters = result["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 16);
    assert_eq!((&parameters[0]["name"], &parameters[9]["name"]), (&"m".into(), &"Ixy".into()));
    for parameter in parameters {
        let number = |key: &str| parameter[key].as_f64().unwrap();
        let _ = number("bias");
        assert!((number("efficiency") - number("crb_std") / number("std")).abs() < 1e-12);
        assert!((0.0..=1.0).contains(&number("coverage95")));
    }
    assert_eq!(rigident(place.path(), &arguments).stdout, output.stdout);
    // Nothing is written, and bad usage is reported as such.
    assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0);
    assert_eq!(status(&rigident(place.path(), &["montecarlo", "--runs", "1"])), 2);
    assert_eq!(status(&rigident(place.path(), &["montecarlo", "--rate-hz", "-1"])), 2);
    let fast = rigident(place.path(), &["montecarlo", "--rate-hz", "5000", "--mcu", "inproc"]);
    assert!(status(&fast) == 2 && said(&fast).contains("2500"), "{}", said(&fast));
    for many in
        [&["--rate-hz", "1e9"][..], &["--rate-hz", "inf"], &["--rate-hz", "1e6", "--duration-s", "3600"]]
    {
        let output = rigident(place.path(), &[&["montecarlo", "--runs", "2"], many].concat());
        assert_eq!(status(&output), 2, "{many:?}: {}", said(&output));
        assert!(said(&output).contains("1000000 readings"), "{}", said(&output));
    }
}

#[test]
fn a_monte_carlo_of_a_tree_prints_the_same_object() {
    let place = tempfile::tempdir().unwrap();
    let words = ["montecarlo", "--model", "two-links", "--rate-hz", "100", "--runs", "10", "--json"];
    let output = rigident(place.path(), &words);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let result = json(&output);
    assert_eq!(result["runs"], 10);
    let parameters = result["parameters"].as_array().unwrap();
    let names: Vec<&str> = parameters.iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert!(names.contains(&"base.M") && names.contains(&"offset_mz"), "{names:?}");
    for parameter in parameters {
        let number = |key: &str| parameter[key].as_f64().unwrap();
        assert!((number("efficiency") - number("crb_std") / number("std")).abs() < 1e-12);
    }
    assert!(result.get("derived").is_none());
    assert_eq!(rigident(place.path(), &words).stdout, output.stdout);
    for bad in [&["two-links", "--mcu", "inproc"][..], &["two-links", "--rate-hz", "-1"], &["nowhere.urdf"]] {
        let words = [&["montecarlo", "--model"][..], bad].concat();
        assert_eq!(status(&rigident(place.path(), &words)), 2, "{bad:?}");
    }
}

#[test]
fn the_folder_that_a_demonstration_wrote_is_a_recording() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for (body, out) in [("horizontal", "one"), ("two-links", "two")] {
        let demo = rigident(at, &["demo", "--body", body, "--duration-s", "20", "--out", out]);
        assert_eq!(status(&demo), 0, "{}", said(&demo));
        for command in ["identify", "replay"] {
            let again = rigident(at, &[command, out, "--json", "--out", &format!("{out}-{command}")]);
            assert_eq!(status(&again), 0, "{}", said(&again));
            assert_eq!(json(&again)["source"]["recording"], "demo");
        }
    }
    let factor = rigident(at, &["factor", "one", "-o", "one.factor"]);
    assert_eq!(status(&factor), 0, "{}", said(&factor));
}

#[test]
fn the_date_of_a_recording_is_in_its_answer_and_its_factor() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let date = "2026-11-22T04:19:51Z";
    let text = fs::read_to_string(examples.join("bracket.csv")).unwrap();
    fs::write(at.join("dated.csv"), format!("# recorded = \"{date}\"\n{text}")).unwrap();
    fs::copy(examples.join("bracket.rig.toml"), at.join("dated.rig.toml")).unwrap();
    assert_eq!(status(&rigident(at, &["convert", "dated.csv", "packed.mcap"])), 0);
    for file in ["dated.csv", "packed.mcap"] {
        let out = file.replace('.', "-");
        let output = rigident(at, &["identify", file, "--json", "--out", &out]);
        assert_eq!(json(&output)["source"]["recorded"], date, "{}", said(&output));
        let name = file.split('.').next().unwrap();
        let factor = at.join(format!("{out}/{name}.factor"));
        let pooled = rigident::fit::pool::PooledFactor::read(&factor).unwrap();
        // date -u -d 2026-11-22T04:19:51Z +%s
        assert_eq!(pooled.sources[0].recorded_unix_s, Some(1_795_321_191));
    }
}

/// Warnings of a result that name this option.
fn warnings_of(result: &Value, option: &str) -> usize {
    let warnings = result["warnings"].as_array().unwrap();
    warnings.iter().filter(|warning| warning.as_str().unwrap().contains(option)).count()
}

#[test]
fn a_stop_criterion_that_is_not_reached_is_a_warning_of_every_kind_of_body() {
    let place = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples");
    let bracket = examples.join("bracket.csv").display().to_string();
    for words in [
        &["demo", "--duration-s", "20", "--until", "m=1e-9"][..],
        &["demo", "--body", "two-links", "--duration-s", "20", "--until", "body=1e-9"],
        &["demo", "--body", "human34", "--duration-s", "4", "--until", "torso=1e-9"],
        &["replay", &bracket, "--until", "m=1e-7"],
        &["replay", &bracket, "--until", "Ixx=1e-7", "--keep-going"],
    ] {
        let output = rigident(place.path(), &[words, &["--json"]].concat());
        assert!(status(&output) < 2, "{words:?}: {}", said(&output));
        assert_eq!(warnings_of(&json(&output), "--until"), 1, "{words:?}: {}", said(&output));
    }
    let reached = rigident(place.path(), &["replay", &bracket, "--until", "m=1", "--json"]);
    assert_eq!(warnings_of(&json(&reached), "--until"), 0);
}

/// Honest runs agree within what they state; one that is heavier is reported.
#[test]
fn repeated_runs_are_summed_up_and_one_that_differs_is_reported() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    for seed in ["1", "2", "3"] {
        let output = rigident(at, &["demo", "--seed", seed, "--duration-s", "20", "--out", seed]);
        assert!(status(&output) < 2, "{}", said(&output));
    }
    let output = rigident(at, &["summary", "1", "2", "3", "--json"]);
    assert_eq!(status(&output), 0, "{}", said(&output));
    let summary = json(&output);
    let m = &summary["quantities"][0];
    assert_eq!((&m["name"], &m["runs"], &m["truth"]), (&"m".into(), &3.into(), &20.0.into()));
    let [mean, stated] = ["mean", "stated_std"].map(|key| m[key].as_f64().unwrap());
    assert!((mean - 20.0).abs() < 4.0 * stated, "{m}");

    let mut other: serde_json::Value =
        serde_json::from_slice(&fs::read(at.join("3/result.json")).unwrap()).unwrap();
    other["parameters"][0]["value"] = (mean + 1.0).into();
    fs::write(at.join("heavier.json"), other.to_string()).unwrap();
    let output = rigident(at, &["summary", "1", "2", "heavier.json", "--json"]);
    assert_eq!((status(&output), json(&output)["surprising"].to_string()), (1, r#"["m"]"#.to_owned()));
    other["status"] = "implausible".into();
    fs::write(at.join("impossible.json"), other.to_string()).unwrap();
    let output = rigident(at, &["summary", "1", "2", "impossible.json"]);
    assert_eq!(status(&output), 0);
    assert!(said(&output).contains("left out"), "{}", said(&output));
    for words in [&["summary", "1"][..], &["summary", "1", "nowhere"]] {
        assert_eq!(status(&rigident(at, words)), 2);
    }
}
