//! Calibrations, vibration, still poses and summaries of the library are those of the commands, to the last
//! bit.

use std::fs;
use std::path::Path;

use hexapod::experiment::thesis_program;
use rigident::application::{
    self, CalibrateError, Caller, DrivenImu, Error, IdentifyOptions, JointOptions, LoadCellOptions,
    MassOptions, ReferenceOptions, ReferenceRuns, StaticsOptions, StiffnessOptions, Tree, VibrationError,
};
use serde::Serialize;

use crate::calibrate_joints::Files;
use crate::library::{example, still_poses};
use crate::program::{rigident, said, status};

/// A body whose parameters are known: that of `bracket.csv`.
const BRACKET: &str = "name = \"bracket\"\nmass_kg = 3.2\nmass_std_kg = 1e-3\n[measured]\ncom_m = [0.0, \
     0.01, 0.053]\n\
     com_std_m = [1e-4, 1e-4, 1e-4]\ninertia_com_kgm2 = [0.021, 0.017, 0.012, 0.0004, -0.0003, 0.0002]\n\
     inertia_com_std_kgm2 = [1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4]\n";

/// The body that `rigident vibration demo --body horizontal` has on its springs.
const HORIZONTAL: &str = "name = \"horizontal\"\nmass_kg = 20.0\nmass_std_kg = 2e-3\n[measured]\ncom_m = \
     [0.0, 0.0, 0.053]\n\
     com_std_m = [1e-4, 1e-4, 1e-4]\ninertia_com_kgm2 = [0.3813, 0.0185, 0.3791, 0.0, 0.0, 0.0]\n\
     inertia_com_std_kgm2 = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]\n";

/// Runs a command, and compares its object with what the library found, but for words of a remedy that name
/// an option.
#[track_caller]
fn assert_prints(at: &Path, words: &[&str], found: &impl Serialize, is_good: bool) {
    let printed = rigident(at, &[words, &["--json"]].concat());
    assert_eq!(status(&printed), i32::from(!is_good), "{words:?}: {}", said(&printed));
    let printed = String::from_utf8(printed.stdout).unwrap();
    let own = match printed.trim().lines().count() {
        1 => serde_json::to_string(found).unwrap(),
        _ => serde_json::to_string_pretty(found).unwrap(),
    };
    let own = own.replace(&format!("{}/", at.display()), "");
    let is_of_the_run = |line: &&str| line.contains("\"date\":") || line.contains("\"elapsed_s\":");
    let lines = |text: &str| -> Vec<String> {
        text.trim().lines().filter(|line| !is_of_the_run(line)).map(str::to_owned).collect()
    };
    let (printed, own) = (lines(&printed), lines(&own));
    assert_eq!(printed.len(), own.len(), "{words:?}\n{}\n{}", printed.join("\n"), own.join("\n"));
    for (command, library) in printed.iter().zip(&own) {
        assert!(command == library || command.contains("--"), "{words:?}\n{command}\n{library}");
        assert!(!library.contains("--"), "{words:?}\n{library}");
    }
}

#[test]
fn sensors_and_rigs_are_calibrated_as_by_the_commands() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let caller = Caller::default();
    fs::write(at.join("bracket.toml"), BRACKET).unwrap();
    for name in ["bracket.csv", "bracket.rig.toml"] {
        fs::copy(example(name), at.join(name)).unwrap();
    }
    let options = ReferenceOptions { reference: at.join("bracket.toml"), ..ReferenceOptions::default() };
    let recordings = [at.join("bracket.csv")];
    let verified = ReferenceRuns::read(&recordings, &options, &caller).unwrap().verify(&caller).unwrap();
    let words = ["verify", "bracket.csv", "--reference", "bracket.toml"];
    assert_prints(at, &words, &verified, verified.passed);
    let options = ReferenceOptions { is_uncalibrated: true, ..options };
    let runs = ReferenceRuns::read(&recordings, &options, &caller).unwrap();
    let found = runs.calibrate(&caller).unwrap();
    let words =
        ["calibrate", "rig", "bracket.csv", "--reference", "bracket.toml", "-o", "own.calibration.toml"];
    let printed = rigident(at, &words);
    assert_eq!(status(&printed), 0, "{}", said(&printed));
    let kept = fs::read_to_string(at.join("own.calibration.toml")).unwrap();
    let same = |text: &str| -> Vec<String> {
        let is_own = |line: &&str| !["date", "checksum", "recordings"].iter().any(|k| line.starts_with(k));
        text.lines().filter(is_own).map(str::to_owned).collect()
    };
    assert_eq!(same(&kept), same(&found.calibration("own", 365).to_toml()));

    let mut weights = "mass_kg,x_m,y_m,z_m,down_x,down_y,down_z,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v\n".to_owned();
    let places = [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.1, 0.05], [0.0, -0.1, 0.0]];
    for (k, down) in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].into_iter().enumerate() {
        for (n, [x, y, z]) in places.into_iter().enumerate() {
            for mass in [0.0, 1.0, 2.0] {
                let [fx, fy, fz] = down.map(|d: f64| -mass * 9.80665 * d);
                let wrench = [fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx];
                let noise = 1e-7 * (17.0 * (k * 12 + n * 3) as f64 + mass).sin();
                let volts = wrench.map(|v| (1e-5 * v + noise).to_string());
                let [a, b, c] = down;
                weights += &format!("{mass},{x},{y},{z},{a},{b},{c},{}\n", volts.join(","));
            }
        }
    }
    fs::write(at.join("weights.csv"), weights).unwrap();
    let weights = at.join("weights.csv");
    let found = application::load_cell(&weights, &LoadCellOptions::default(), &caller).unwrap();
    assert_prints(at, &["calibrate", "load-cell", "weights.csv"], &found, found.is_identified());
    let wrong = LoadCellOptions { board_id: Some("xyz".to_owned()), ..LoadCellOptions::default() };
    let refused = application::load_cell(&weights, &wrong, &caller).unwrap_err();
    assert!(matches!(&refused, Error::Calibrate(why) if matches!(**why, CalibrateError::BoardId(_))));
    let driven = DrivenImu::read(&at.join("bracket.csv"), None).unwrap();
    let refused = driven.calibrate(&thesis_program(&driven.geometry, 60.0)).unwrap_err();
    let is_kind = |why: &CalibrateError| matches!(why, CalibrateError::OtherProgram { .. });
    assert!(matches!(&refused, Error::Calibrate(why) if is_kind(why)), "{refused:?}");
}

#[test]
fn robots_still_poses_and_summaries_are_those_of_the_commands() {
    let files = Files::new();
    let (at, caller) = (files.at(), Caller::default());
    let path = |name: &str| at.join(name);
    let robot = path("robot.urdf").display().to_string();
    let poses = (path("poses.csv"), path("soles.toml"));
    let found =
        application::joint_offsets(&robot, &poses.0, &poses.1, &JointOptions::default(), &caller).unwrap();
    let words = ["calibrate", "joints", "robot.urdf", "poses.csv", "--contacts", "soles.toml"];
    assert_prints(at, &words, &found, found.offsets.iter().all(|offset| offset.value.is_some()));

    for name in ["picks-up.csv", "picks-up.rig.toml", "picks-up.urdf", "bracket.csv", "bracket.rig.toml"] {
        fs::copy(example(name), path(name)).unwrap();
    }
    let tree = Tree { model: Some(path("picks-up.urdf").display().to_string()), ..Tree::default() };
    let options = MassOptions { tree, ..MassOptions::default() };
    let found = application::masses(&[path("picks-up.csv")], &options, &caller).unwrap();
    assert_prints(at, &["calibrate", "masses", "picks-up.urdf", "picks-up.csv"], &found, found.is_believed);
    let wrong = MassOptions { least_mass: 1.0, ..options };
    let refused = application::masses(&[path("picks-up.csv")], &wrong, &caller).unwrap_err();
    assert!(matches!(&refused, Error::Calibrate(why) if matches!(**why, CalibrateError::LeastMass(1.0))));

    still_poses().write(at, "still", "[recording]\nstatic = true\n[load_cell]\nclass = \"exact\"\n");
    let found = application::statics(&path("still.csv"), &StaticsOptions::default()).unwrap();
    assert_prints(at, &["statics", "still.csv"], &found, found.is_whole());

    let bracket = path("bracket.csv").into();
    let answer = application::identify(bracket, &IdentifyOptions::default(), &caller).unwrap().answer;
    for (name, by) in [("a.json", 1.0), ("b.json", 1.01)] {
        let mut answer = serde_json::to_value(&answer).unwrap();
        let mass = &mut answer["parameters"][0]["value"];
        *mass = (by * mass.as_f64().unwrap()).into();
        fs::write(path(name), answer.to_string()).unwrap();
    }
    let found = application::summary(&[path("a.json"), path("b.json")]).unwrap();
    assert_prints(at, &["summary", "a.json", "b.json"], &found, found.summary.surprising.is_empty());
}

#[test]
fn platforms_on_springs_are_identified_as_by_the_commands() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let caller = Caller::default();
    let made = rigident(at, &["vibration", "demo", "--body", "horizontal", "--out", "springs"]);
    assert_eq!(status(&made), 0, "{}", said(&made));
    fs::write(at.join("body.toml"), HORIZONTAL).unwrap();
    let swing = at.join("springs/swing.csv");
    let found = application::vibration_identify(&swing, &Default::default(), &caller).unwrap();
    assert_prints(at, &["vibration", "identify", "springs/swing.csv"], &found, found.is_identified());
    for (name, factor) in &found.factors {
        assert!(fs::read(at.join("springs").join(name)).unwrap() == factor.to_bytes(), "{name}");
    }
    let options = StiffnessOptions { body: at.join("body.toml"), ..StiffnessOptions::default() };
    let found = application::vibration_stiffness(&swing, &options, &caller).unwrap();
    let words = ["vibration", "stiffness", "springs/swing.csv", "--body", "body.toml"];
    assert_prints(at, &words, &found, found.is_believed);

    fs::copy(example("two-link-postures.toml"), at.join("postures.toml")).unwrap();
    let found = application::vibration_postures(&[at.join("postures.toml")], None, &caller).unwrap();
    assert_prints(at, &["vibration", "postures", "postures.toml"], &found, found.is_complete());
    let refused = application::vibration_postures(&[swing.clone(), swing], None, &caller);
    assert!(matches!(refused, Err(Error::Vibration(_) | Error::Model(_))), "{refused:?}");
    let refused = application::vibration_postures(&[], None, &caller).unwrap_err();
    assert!(matches!(&refused, Error::Vibration(why) if matches!(**why, VibrationError::NoFile)));
}
