//! `rigident plan motion` and `rigident plan compare`, as a user types them, and what their predictions are
//! worth.

#![cfg(feature = "simulator")]

use std::process::Command;
use std::sync::atomic::AtomicBool;

use rigident::plan::equipment::Equipment;
use rigident::plan::motion::{Objective, Task, plan};
use rigident::study::Campaign;
use rigident_sim::rig::RigConfig;

use crate::program::rigident_anywhere as rigident;
use crate::study_length::runs;

fn refused(arguments: &[&str]) -> String {
    let output = rigident(arguments);
    assert_eq!(output.status.code(), Some(2));
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn the_object_is_that_of_the_contract_and_the_plan_is_for_this_machine_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.json");
    let path = path.to_str().unwrap();
    let words =
        ["plan", "motion", "--duration-s", "25", "--objective", "spheres", "--stroke-m", "0.2", "--json"];
    let output = rigident(&[&words[..], &["--out", path]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((object["duration_s"].as_f64().unwrap() - 25.0).abs() < 1e-9);
    assert!(object["condition_number"].as_f64().unwrap() > 1.0);
    for name in ["m", "mcx", "Ixx", "Ixy"] {
        assert!(object["predicted_u95"][name].as_f64().unwrap() > 0.0, "{name}");
    }
    let limits = object["limits"].as_object().unwrap();
    for name in ["leg_length", "leg_rate", "conditioning", "angular_rate"] {
        assert!((0.0..1.0).contains(&limits[name].as_f64().unwrap()), "{name}");
    }
    let refusal = refused(&[&words[..], &["--out", path]].concat());
    assert!(refusal.contains("motion.json"), "{refusal}");
    // A machine whose first plate joint is elsewhere.
    let text = std::fs::read_to_string(path).unwrap();
    let mut other: serde_json::Value = serde_json::from_str(&text).unwrap();
    other["plate_joints_m"][0][0] = 0.2.into();
    let other_path = folder.path().join("other.json");
    std::fs::write(&other_path, other.to_string()).unwrap();
    let refusal = refused(&["demo", "--plan", other_path.to_str().unwrap()]);
    assert!(refusal.contains("another rig") && refusal.contains("plate joint 1"), "{refusal}");
}

/// Roll, pitch and yaw are made as large as the stroke allows.
#[test]
fn a_plan_leaves_a_twentieth_of_the_stroke_unused_by_default() {
    let folder = tempfile::tempdir().unwrap();
    let thesis = hexapod::Geometry::thesis();
    let keeps = |name: &str, more: &[&str]| {
        let path = folder.path().join(name);
        let words = ["plan", "motion", "--objective", "rpy", "--duration-s", "25", "--no-poses", "--out"];
        let output = rigident(&[&words[..], &[path.to_str().unwrap()], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let plan = rigident::plan::plan_file::PlanFile::read(&path, &thesis).unwrap();
        let trajectory = plan.program.trajectory().unwrap();
        [0.05, 0.06].map(|share| thesis.clone().with_reserve(share).check(&trajectory).is_ok())
    };
    assert_eq!(keeps("own.json", &[]), [true, false]);
    assert_eq!(keeps("none.json", &["--reserve", "0"]), [false, false]);
    assert!(refused(&["plan", "motion", "--reserve", "1"]).contains("--reserve"));
}

/// The body of a rig file is what the legs carry: twice the mass, twice the forces and the same
/// uncertainties.
#[test]
fn the_body_is_any_that_the_rig_file_allows_and_never_its_truth() {
    let folder = tempfile::tempdir().unwrap();
    let config = RigConfig::thesis_horizontal();
    let plan = |name: &str, platform: &str, truth_kg: f64| {
        let (g, b) = (&config.geometry, config.body);
        let path = folder.path().join(format!("{name}.rig.toml"));
        let text = format!(
            "[platform]\nbase_joints_m = {:?}\nplate_joints_m = {:?}\nleg_length_m = {:?}\nleg_rate_mps = \
             {}\n{platform}\n\
             [truth]\nmass_kg = {truth_kg:?}\ncom_m = {:?}\ninertia_com_kgm2 = {:?}\n",
            g.base_joints_m, g.plate_joints_m, g.leg_length_m, g.leg_rate_mps, b.com_m, b.inertia_com_kgm2
        );
        std::fs::write(&path, text).unwrap();
        let words = ["plan", "motion", "--objective", "rpy", "--duration-s", "25", "--no-poses", "--json"];
        let output = rigident(&[&words[..], &["--rig", path.to_str().unwrap()]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let bound = |kg: f64| format!("load_max_kg = {kg:?}\nload_within_m = 0.1");
    let (once, twice) = (plan("once", &bound(10.0), 5.0), plan("twice", &bound(20.0), 5.0));
    assert!(once["body"].to_string().contains("load_max_kg"), "{once}");
    let force = |plan: &serde_json::Value| plan["peaks"]["leg_force"]["seen"].as_f64().unwrap();
    assert!((force(&twice) / force(&once) - 2.0).abs() < 1e-3, "{} {}", force(&once), force(&twice));
    let u95 = |plan: &serde_json::Value| plan["predicted_u95"]["Ixx"].as_f64().unwrap();
    assert!((u95(&twice) / u95(&once) - 1.0).abs() < 1e-2);
    let other = plan("other", &bound(10.0), 7.0);
    assert_eq!(force(&other), force(&once), "[truth] is used for nothing");
    assert_eq!(plan("none", "", 7.0)["predicted_u95"], plan("none", "", 20.0)["predicted_u95"]);
}

/// Five minutes of motion are searched for during some five seconds.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_search_soon_with_the_best_by_then() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("motion.json");
    let motion = ["plan", "motion", "--duration-s", "300", "--json", "--out", out.to_str().unwrap()];
    for (words, key) in
        [(&motion[..], "motion_s"), (&["plan", "compare", "--duration-s", "300", "--json"], "motions")]
    {
        let child = Command::new(env!("CARGO_BIN_EXE_rigident"))
            .args(words)
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(1500));
        let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(killed.success());
        let begun = std::time::Instant::now();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("stopped by Ctrl-C"), "{said}");
        // One step of the search and the guarantee of five minutes: seconds, and 41 s where twenty others
        // shared two cores.
        assert!(begun.elapsed().as_secs() < 600, "{:?}", begun.elapsed());
        let object: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(!object[key].is_null(), "{object}");
    }
    assert!(out.exists());
}

#[test]
fn a_duration_that_is_too_short_says_how_much_is_needed() {
    let refusal = refused(&["plan", "motion", "--duration-s", "12", "--objective", "rpy"]);
    assert!(refusal.contains("too short") && refusal.contains("--duration-s"), "{refusal}");
}

/// The standard error of a standard deviation from n runs is its `1/√(2n)`: 4 % at night. All ten together
/// within 10 %, each within 10 % and two and a half of its standard errors.
#[test]
fn predictions_agree_with_many_runs() {
    let count = runs(300, 80);
    let config = RigConfig::thesis_vertical();
    let task = Task {
        objective: Objective::Multisine,
        duration_s: 22.0,
        rate_hz: 200.0,
        ..Task::new(Equipment::from(&config))
    };
    let stop = AtomicBool::new(false);
    let made = plan(&task, &stop, |_| ()).unwrap();
    let campaign = Campaign { program: Some(made.program), ..Campaign::new(config) };
    let verdict = campaign.prepare().unwrap().run(count, 3, &stop, |_| ()).unwrap();
    let ratios: Vec<f64> = made
        .prediction
        .parameters
        .iter()
        .zip(&verdict.parameters)
        .map(|(u95, found)| 1.96 * found.std / u95)
        .collect();
    let rms = (ratios.iter().map(|r| r * r).sum::<f64>() / 10.0).sqrt();
    let chance = 2.5 / (2.0 * count as f64).sqrt();
    assert!((rms - 1.0).abs() < 0.1, "{ratios:?}");
    assert!(ratios.iter().all(|r| (r - 1.0).abs() < 0.1 + chance), "{ratios:?}");
}
