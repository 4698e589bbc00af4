//! `--known` and `--symmetry` as a user types them.
#![cfg(feature = "simulator")]

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::program::{json, parameter, rigident, said};

fn number(parameter: &Value, field: &str) -> f64 {
    parameter[field].as_f64().unwrap()
}

#[test]
fn a_known_mass_narrows_a_recording_s_answer_and_bad_statements_write_nothing() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let demo = rigident(at, &["demo", "--duration-s", "20", "--json", "--out", "d"]);
    assert_eq!(demo.status.code(), Some(0), "{}", said(&demo));
    let without = json(&demo);

    let stated = ["--known", "mass_kg=20.001±0.001", "--symmetry", "y±1e-4"];
    for command in [&["identify", "d/demo.mcap"][..], &["replay", "d/demo.mcap"], &["solve", "d/demo.factor"]]
    {
        let output = rigident(at, &[command, &stated, &["--json", "--out", command[0]]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let result = json(&output);
        let mass = parameter(&result, "m");
        // Two independent measurements of one mass: the inverse variances add.
        let alone = number(parameter(&without, "m"), "u95") / 1.96;
        let together = 1.96 / (alone.powi(-2) + 0.001_f64.powi(-2)).sqrt();
        assert!((number(mass, "u95") / together - 1.0).abs() < 0.01, "{mass} {together}");
        assert!(number(parameter(&result, "mcy"), "u95") <= 1.97 * 20.0 * 1e-4);
        assert_eq!(mass["state"], "identified", "the data alone do it too");
        assert_eq!(result["known"][0]["name"], "mass_kg");
        assert_eq!(result["known"].as_array().unwrap().len(), 2);
        assert!(result.get("prior_dominated").is_none());
    }
    let page = fs::read_to_string(at.join("identify/report.html")).unwrap();
    assert!(page.contains("mass_kg = 20.001 ± 0.001 (1 σ)"));
    // What is stored is the data's alone, so a known quantity cannot be counted twice.
    assert_eq!(fs::read(at.join("replay/demo.factor")).unwrap(), fs::read(at.join("d/demo.factor")).unwrap());

    for (statements, complaint) in [
        (&["--known", "mass_kg=25±0.01"][..], "contradicts"),
        (&["--known", "mass_kg=20±0"], "standard uncertainty of 0"),
        (&["--known", "mass_kg=20±1e-16"], "the smallest usable is"),
        (&["--known", "mass_kg=20±-1"], "standard uncertainty of -1"),
        (&["--known", "mass_kg=20±NaN"], "standard uncertainty of NaN"),
        (&["--known", "mass_kg=20"], "NAME=VALUE±SIGMA"),
        (&["--known", "mass=20±1"], "no such quantity"),
        (&["--known", "mass_kg=20±0.01", "--known", "mass_kg=21±0.01"], "stated twice, as 20 and as 21"),
        (&["--known", "com_z_m=0.3±0.001"], "com_z_m = 0.3"),
        (&["--symmetry", "z±0.001"], "contradicts"),
        (&["--symmetry", "w"], "normal of the plane"),
    ] {
        for command in [["identify", "d/demo.mcap"], ["solve", "d/demo.factor"]] {
            let output = rigident(at, &[&command, statements, &["--out", "refused"]].concat());
            let words = said(&output);
            assert_eq!(output.status.code(), Some(2), "{statements:?}: {words}");
            assert!(words.contains(complaint) && output.stdout.is_empty(), "{statements:?}: {words}");
            assert!(!at.join("refused").exists(), "{statements:?}");
        }
    }
}

/// The real load cell's still poses: they say nothing of the tensor, so what a person says of it is all there
/// is.
#[test]
#[ignore = "needs ../shared/data"]
fn parameters_known_only_beforehand_are_prior_dominated_in_shared_data() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = root.join("../../../shared/data/endeffector_ati_gamma_imu/0-calibration_fts-accel.csv");
    let data = data.display().to_string();
    let rig = root.join("../../docs/examples/endeffector.rig.toml").display().to_string();
    let place = tempfile::tempdir().unwrap();
    let identify = |more: &[&str]| {
        rigident(
            place.path(),
            &[&["identify", data.as_str(), "--rig", rig.as_str(), "--json"], more].concat(),
        )
    };
    let output = identify(&["--estimate", "m,mc,offset", "--known", "mass_kg=0.932±0.002", "--out", "mass"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(number(parameter(&json(&output), "m"), "u95") <= 1.97 * 0.002);

    let tensor = ["ixx_kgm2=0.0029±1e-5", "iyy_kgm2=0.0029±1e-5", "izz_kgm2=0.0012±1e-5"]
        .map(|t| ["--known", t])
        .concat();
    let output = identify(&[&tensor[..], &["--out", "tensor"]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let result = json(&output);
    assert_eq!(result["status"], "partly_identified");
    for (name, state) in [("m", "identified"), ("Ixx", "prior_dominated"), ("Iyz", "not_identified")] {
        assert_eq!(parameter(&result, name)["state"], state, "{name}");
    }
    let ixx = parameter(&result, "Ixx");
    // Nothing else is known of it: the value as stated, and σ times a coverage factor from the data's
    // residuals.
    assert!((number(ixx, "value") - 0.0029).abs() < 1e-12);
    assert!((1.95e-5..2.2e-5).contains(&number(ixx, "u95")), "{ixx}");
    assert!(parameter(&result, "Iyz").get("value").is_none());
    assert!(result.get("inertia_com_kgm2").is_none(), "three of its elements are unknown");

    let output = identify(&["--known", "ixx_kgm2=0.003±0.0005", "--out", "loose"]);
    let result = json(&output);
    assert_eq!(parameter(&result, "Ixx")["state"], "not_identified");
    assert!(result["warnings"].to_string().contains("too loose to identify Ixx"), "{}", result["warnings"]);

    // A plane of symmetry needs the body's size for the products of inertia, and says so.
    let warned = |more: &[&str], out: &str| {
        let result = json(&identify(&[&["--symmetry", "y", "--out", out], more].concat()));
        (parameter(&result, "Iyz")["state"] == "not_identified", result["warnings"].to_string())
    };
    let (free, words) = warned(&[], "plane");
    assert!(free && words.contains("symmetry y: Iyz and Ixy stay free"), "{words}");
    let (free, words) = warned(&tensor, "plane-and-size");
    assert!(!free && !words.contains("stay free"), "{words}");

    let all = ["iyz_kgm2=0±1e-5", "izx_kgm2=0±1e-5", "ixy_kgm2=0±1e-5"].map(|t| ["--known", t]).concat();
    let output = identify(&[&tensor[..], &all, &["--out", "all"]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let result = json(&output);
    let fields: Vec<&str> =
        result["prior_dominated"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert_eq!(fields, ["inertia_com_kgm2", "inertia_origin_kgm2", "principal"]);
    assert!(result["inertia_com_kgm2"].is_array());
    let page = fs::read_to_string(place.path().join("all/report.html")).unwrap();
    assert!(page.contains("Only with what was known beforehand: Ixx, Iyy, Izz, Iyz, Izx, Ixy"));
}
