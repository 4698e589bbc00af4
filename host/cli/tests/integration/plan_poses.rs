//! `rigident plan poses` and `rigident montecarlo poses`, as a user types them.

use std::process::Command;

use crate::program::rigident_anywhere as rigident;

fn json(arguments: &[&str]) -> serde_json::Value {
    let output = rigident(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Table 9: 2, 1, 1, 1, 1 with the full stroke, to the digits printed and one more.
#[test]
fn the_thesis_table_9_is_reached_and_the_object_is_that_of_the_contract() {
    for (n, want) in [("2", 2.0), ("3", 1.0), ("4", 1.0), ("5", 1.0), ("6", 1.0)] {
        let plan = json(&["plan", "poses", "--n", n, "--json"]);
        let poses = plan["poses_deg"].as_array().unwrap();
        assert_eq!((plan["n"].to_string(), poses.len().to_string()), (n.to_owned(), n.to_owned()));
        let (stacked, normal) =
            (plan["condition_number"].as_f64().unwrap(), plan["condition_number_normal"].as_f64().unwrap());
        assert!((normal - want).abs() < 0.05, "{n}: {normal}");
        // From the printed angles: Σ (1 − u uᵀ) by its invariants, for which the eigenvalues are tried.
        let mut gram = [[0.0; 3]; 3];
        for pose in poses {
            let [r, p] = [0, 1].map(|k| pose[k].as_f64().unwrap().to_radians());
            let u = [-p.sin(), p.cos() * r.sin(), p.cos() * r.cos()];
            for i in 0..3 {
                for j in 0..3 {
                    gram[i][j] += f64::from(u8::from(i == j)) - u[i] * u[j];
                }
            }
        }
        let eigen = nalgebra::Matrix3::from_fn(|i, j| gram[i][j]).svd(false, false).singular_values;
        assert!((eigen.max() / eigen.min() / normal - 1.0).abs() < 1e-9);
        assert!((stacked * stacked / normal - 1.0).abs() < 1e-12);
    }
}

/// Tables 11 and 12: CNT 3.52, 2.99, 3.27, 3.25 and, relative to the level pose, CNR 13, 1.7, 1.8, 1.8; for n
/// = 4 with the pitch of −15° that gives both.
#[test]
fn the_thesis_poses_have_the_condition_numbers_that_it_prints() {
    for (angles, normal, relative, digit) in [
        ("28.5,-14.5; -29.1,15.5", 3.52, 13.0, 0.05),
        ("28.9,16; -29.1,15.5; 1.7,-31.9", 2.99, 1.75, 0.05),
        ("-28.9,16; 14.1,26.5; 28.2,-15; -19.5,-24.1", 3.27, 1.8, 0.05),
        ("-29.1,15.5; -2.7,30.9; 27.7,-16; -19,-24.4; 29.1,15.5", 3.25, 1.8, 0.05),
    ] {
        let judged = json(&["plan", "poses", "--angles", angles, "--json"]);
        let got = ["condition_number_normal", "condition_number_normal_relative"]
            .map(|key| judged[key].as_f64().unwrap());
        assert!((got[0] - normal).abs() < 0.01 && (got[1] - relative).abs() < digit, "{angles}: {got:?}");
        assert!(judged["held"].as_array().unwrap().iter().all(|held| held == true), "{judged}");
        assert!(judged.get("objective").is_none());
    }
    let steep = json(&["plan", "poses", "--angles", "80,0;0,80", "--json"]);
    assert_eq!(steep["held"].to_string(), "[false,false]");
    for (words, why) in [
        (&["--angles", "80,0;0,80", "--out", "never.json"][..], "cannot hold pose 1"),
        (&["--angles", "1,2,3"], "no roll and pitch"),
        (&["--angles", "1,2"], "2 at least"),
        (&["--angles", "1,200;2,3"], "from -180 to 180"),
        (&["--angles", "1,2;2,3", "--n", "2"], "cannot be used with"),
    ] {
        let output = rigident(&[&["plan", "poses"], words].concat());
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(why), "{words:?}: {said}");
    }
    assert!(!std::path::Path::new("never.json").exists());
}

/// Whenever it comes, but before the program listens.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_search_soon_with_the_best_by_then() {
    let mut interrupted = 0;
    for delay_ms in [200, 400, 600, 900, 1300, 2000] {
        let child = Command::new(env!("CARGO_BIN_EXE_rigident"))
            .args(["plan", "poses", "--n", "30", "--objective", "worst-uncertainty", "--json"])
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(delay_ms));
        let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        let begun = std::time::Instant::now();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(begun.elapsed().as_secs() < 30);
        match output.status.code() {
            Some(1) => {
                assert!(killed.success() && said.contains("stopped by Ctrl-C"), "{said}");
                let plan: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
                assert_eq!(plan["poses_deg"].as_array().unwrap().len(), 30);
                interrupted += 1;
            }
            // Over before, or reported before the program listened.
            other => assert!(matches!(other, Some(0) | None), "{other:?}: {said}"),
        }
    }
    assert!(interrupted > 0);
}

#[test]
fn less_stroke_is_worse_and_the_worst_uncertainty_is_least_when_that_is_asked_for() {
    let full = json(&["plan", "poses", "--n", "4", "--json"]);
    let part = json(&["plan", "poses", "--n", "4", "--stroke-m", "0.2", "--json"]);
    let normal = |plan: &serde_json::Value| plan["condition_number_normal"].as_f64().unwrap();
    assert!(normal(&part) > 1.5 * normal(&full));
    let worst = |objective: &str| {
        let plan =
            json(&["plan", "poses", "--n", "4", "--stroke-m", "0.2", "--objective", objective, "--json"]);
        let u95 = &plan["predicted_u95"];
        ["mcx", "mcy", "mcz"].map(|name| u95[name].as_f64().unwrap()).into_iter().fold(0.0, f64::max)
    };
    let least = worst("worst-uncertainty");
    assert!(least < worst("condition") && least < worst("determinant"));
}

#[cfg(feature = "simulator")]
#[test]
fn impossible_plans_are_reported_with_status_2_and_nothing_on_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let rig = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let joints = "base_joints_m = \
                  [[0.45,0,0],[-0.2,0.4,0],[-0.2,-0.4,0],[0.3,0.3,0],[-0.45,0,0],[0.3,-0.3,0]]\n\
                  plate_joints_m = \
                  [[0.2,0.1,0],[-0.2,0.1,0],[-0.2,-0.1,0],[0.2,0.1,0],[-0.2,0,0],[0.2,-0.1,0]]\n";
    let without = rig("without.rig.toml", "[recording]\nrate_hz = 200.0\n");
    let unreachable =
        rig("unreachable.rig.toml", &format!("[platform]\n{joints}leg_length_m = [0.02, 0.03]\n"));
    let existing = rig("there.svg", "");
    for (arguments, part) in [
        (vec!["plan", "poses", "--n", "1"], "2 orientations at least"),
        (vec!["plan", "poses", "--n", "2", "--objective", "worst-uncertainty"], "3 orientations at least"),
        (vec!["plan", "poses", "--n", "500"], "30 at most"),
        (vec!["plan", "poses", "--n", "3", "--stroke-m", "0.5"], "the legs"),
        (vec!["plan", "poses", "--n", "3", "--stroke-m", "nan"], "--stroke-m"),
        (vec!["plan", "poses", "--n", "3", "--rig", &without], "no [platform]"),
        (vec!["plan", "poses", "--n", "3", "--rig", &unreachable], "leg "),
        (vec!["montecarlo", "poses", "--from", "1"], "2 orientations at least"),
        (vec!["montecarlo", "poses", "--from", "5", "--to", "3"], "fewest first"),
        (vec!["montecarlo", "poses", "--plot", &existing], "there.svg"),
    ] {
        let output = rigident(&arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(part), "{arguments:?}: {said}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
}

#[cfg(feature = "simulator")]
#[test]
fn the_montecarlo_of_still_poses_predicts_its_findings() {
    let folder = tempfile::tempdir().unwrap();
    let plot = folder.path().join("plot.svg");
    let arguments = ["montecarlo", "poses", "--from", "3", "--to", "4", "--json", "--plot"];
    let object = json(&[&arguments[..], &[plot.to_str().unwrap(), "--plot-n", "4"]].concat());
    assert_eq!(object["runs"], 2500);
    let cells = object["experiments"].as_array().unwrap();
    assert_eq!(cells.len(), 2 * 2 * 3);
    for cell in cells.iter().filter(|c| c["errors"] != "bias") {
        for figures in cell["estimators"].as_array().unwrap() {
            for axis in 0..3 {
                let [got, want] =
                    ["u997_mm", "predicted_u997_mm"].map(|key| figures[key][axis].as_f64().unwrap());
                // Four standard errors of a spread of 2 500 runs, 1.4 % each.
                assert!((got / want - 1.0).abs() < 0.06, "{cell}");
            }
        }
    }
    assert!(std::fs::read_to_string(&plot).unwrap().ends_with("</svg>\n"));
    let normality = object["normality"].as_array().unwrap();
    assert!(normality.iter().all(|n| n["correlation"][0].as_f64().unwrap() > 0.999));
}

/// The firmware takes a thousand readings a second and identifies what still poses can tell.
#[cfg(feature = "simulator")]
#[test]
fn a_plan_on_disk_is_driven_by_the_demonstration_and_by_no_other_machine() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let plan = path("poses.json");
    json(&["plan", "poses", "--n", "4", "--hold-s", "1", "--json", "--out", &plan]);
    let result = json(&["demo", "--plan", &plan, "--estimate", "m,mc", "--json", "--out", &path("answer")]);
    let (com, mass) = (&result["com_m"], result["mass_kg"].as_f64().unwrap());
    // 4 s of 1 kHz: the prediction of one reading, 0.65 kg and 0.08 kg m, over √4000, and the offset of a
    // minute's poses.
    assert!((mass - 20.0).abs() < 0.1, "{mass}");
    assert!((com[2].as_f64().unwrap() - 0.053).abs() < 1e-3, "{com}");
    let again = rigident(&["plan", "poses", "--n", "4", "--out", &plan]);
    assert_eq!(again.status.code(), Some(2));
    let text = std::fs::read_to_string(&plan).unwrap();
    std::fs::write(path("other.json"), text.replacen("0.4", "0.5", 1)).unwrap();
    let other = rigident(&["demo", "--plan", &path("other.json"), "--out", &path("nothing")]);
    let said = String::from_utf8_lossy(&other.stderr).into_owned();
    assert_eq!(other.status.code(), Some(2), "{said}");
    assert!(said.contains("another rig: base joint 1"), "{said}");
    let both = rigident(&["demo", "--plan", &plan, "--duration-s", "30"]);
    assert_eq!(both.status.code(), Some(2));
}

/// Offsets of the simulated load cell are an error of the thesis' estimator, and of no other.
#[cfg(feature = "simulator")]
#[test]
fn a_recording_s_still_poses_are_judged_by_every_estimator() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name).to_str().unwrap().to_owned();
    let (plan, out, recording) = (at("poses.json"), at("day1"), at("day1/demo.mcap"));
    assert!(rigident(&["plan", "poses", "--n", "4", "--out", &plan]).status.success());
    assert!(rigident(&["demo", "--plan", &plan, "--estimate", "m,mc", "--out", &out]).status.success());
    let found = json(&["statics", &recording, "--json"]);
    assert_eq!(found["poses"], 5, "{found}");
    let truth = [0.0, 0.0, 0.053];
    for (k, name) in
        ["measured forces", "measured forces, relative", "gravity from the attitude"].iter().enumerate()
    {
        let estimator = &found["estimators"][k];
        assert_eq!(estimator["name"], *name);
        for axis in 0..3 {
            let [value, u95] = ["com_m", "u95_m"].map(|key| estimator[key][axis].as_f64().unwrap());
            assert!((value - truth[axis]).abs() < 2.5 * u95, "{name} {axis}: {value} ± {u95}");
            assert!(k == 0 || u95 < 1e-3, "{name} {axis}: ± {u95}");
        }
    }
    assert_eq!(found["differences_n_nm"].as_array().unwrap().len(), 5);
    for (words, why) in
        [(&["--reference", "6"][..], "there are 5 still poses"), (&["--reference", "0"], "counted from 1")]
    {
        let output = rigident(&[&["statics", &recording], words].concat());
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stderr).contains(why));
    }
    let moving = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/examples/bracket.csv");
    let output = rigident(&["statics", moving]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("0 still poses"));
}
