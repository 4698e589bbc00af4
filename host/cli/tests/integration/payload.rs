//! `rigident identify --payload`: simulated arms with and without a load, and the loads that are written.

use std::path::Path;
use std::process::{Command, Output};

use rigident::fit::payload::Carrier;
use rigident::fit::pool::PooledFactor;
use rigident::fit::tare::Tare;
use rigident::fit::{Fit, FitOptions, Silent};
use rigident::laboratory::arm::{ArmRun, csv};
use rigident::laboratory::trees::seven_axes;
use rigident::model::Model;
use rigident::model::inertial::map_to_parent;
use rigident::model::load::{Language, Load};
use rigident::model::write::generated;
use rigident::problem::{Problem, ProblemOptions};
use rigident::recording::Recording;
use rigident::rows::tree::drive::Friction;
use serde_json::Value;

use crate::study_length::runs;

/// The place of the payload: on the last link, turned.
const PLACE: &str = "l7@0.02,-0.01,0.1,0,30,15";
const FRICTION: &str = "viscous,coulomb,offset";

fn rigident(folder: &Path, line: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rigident")).current_dir(folder).args(line).output().unwrap()
}

fn complaint(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ")
}

fn answer(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
}

/// A box with edges in the ratio 6 : 11 : 18 that is heavy and long by this much, off the flange's axes.
fn payload(mass_kg: f64, length_m: f64) -> Load {
    let [a, b, c] = [6.0, 11.0, 18.0].map(|v| v / 18.0 * length_m);
    let m = mass_kg / 12.0;
    let com_m = [0.12 * length_m, -0.19 * length_m, 0.46 * length_m];
    let own = [m * (b * b + c * c), m * (a * a + c * c), m * (a * a + b * b)];
    let inertia_com_kgm2 = [own[0], own[1], own[2], 0.1 * m * b * c, -0.1 * m * a * c, 0.1 * m * a * b];
    Load { mass_kg, com_m, inertia_com_kgm2 }
}

/// The arm, and the arm with the payload.
fn arms(load: &Load) -> [Model; 2] {
    let bare = seven_axes();
    let mut with = bare.clone();
    with.hold_tool(PLACE).unwrap();
    with.links.last_mut().unwrap().nominal = Some(load.parameters());
    [bare, with]
}

fn run(seed: u64, effort_noise: f64) -> ArmRun {
    ArmRun { rest_s: 1.0, effort_noise, seed, position_noise: 1e-6, rate_noise: 1e-4, ..ArmRun::default() }
}

/// Writes the arm and recordings with and without a load, of the given number of seconds of motion.
fn record(folder: &Path, load: &Load, effort_noise: f64, motion_s: f64) {
    let [bare, with] = arms(load);
    std::fs::write(folder.join("arm.urdf"), generated(&bare, rigident::model::xml::Language::Urdf).unwrap())
        .unwrap();
    for (name, model, seed) in [("without", &bare, 1), ("with", &with, 2)] {
        // The motions are others as well.
        let run = ArmRun { motion: seed as usize, motion_s, ..run(seed, effort_noise) };
        std::fs::write(folder.join(format!("{name}.csv")), csv(&run.recording(model))).unwrap();
        std::fs::write(folder.join(format!("{name}.rig.toml")), "[tree]\nclass = \"exact\"\n").unwrap();
    }
}

fn line<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let words =
        ["identify", "with.csv", "--model", "arm.urdf", "--friction", FRICTION, "--json", "--out", "o"];
    [&words[..], more].concat()
}

#[test]
fn a_payload_is_identified_and_written_for_its_controllers() {
    let place = tempfile::tempdir().unwrap();
    let load = payload(3.0, 0.25);
    record(place.path(), &load, 0.02, 20.0);
    let files = ["a.script", "a.cpp", "a.json", "a.dat", "a.urdf"];
    let mut words = line(&["--tare", "without.csv", "--payload", PLACE]);
    files.iter().for_each(|file| words.extend(["--write-load", file]));
    let output = rigident(place.path(), &words);
    let found = answer(&output);
    assert_eq!(found["status"], "identified", "{} {}", found["warnings"], found["advice"]);
    assert_eq!(output.status.code(), Some(0));
    let phi = load.parameters();
    let parameters = found["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 10);
    for (p, truth) in parameters.iter().zip(phi) {
        let (value, u95) = (p["value"].as_f64().unwrap(), p["u95"].as_f64().unwrap());
        assert!((value - truth).abs() < 1.6 * u95, "{p} {truth}");
        assert_eq!(p["frame"], "l7's payload");
    }
    assert!(parameters[0]["u95"].as_f64().unwrap() < 0.05, "{}", parameters[0]);
    let own_load = &found["payload"];
    assert_eq!(
        (own_load["link"].as_str(), own_load["load"]["basis"].as_str()),
        (Some("l7"), Some("identified"))
    );
    assert_eq!(own_load["without"], "without");
    for file in files {
        let path = place.path().join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        let again = Language::of_path(&path).unwrap().read(&text).unwrap();
        for (k, own) in ["mass_kg", "com_m", "inertia_com_kgm2"].into_iter().enumerate() {
            let own: Vec<f64> = match &own_load["load"][own] {
                Value::Array(all) => all.iter().map(|v| v.as_f64().unwrap()).collect(),
                one => vec![one.as_f64().unwrap()],
            };
            let read = match k {
                0 => vec![again.mass_kg],
                1 => again.com_m.to_vec(),
                _ => again.inertia_com_kgm2.to_vec(),
            };
            for (a, b) in own.iter().zip(read) {
                assert!((a - b).abs() < 2e-8, "{file} {k}: {a} {b}\n{text}");
            }
        }
    }
    // A second time nothing is overwritten.
    std::fs::remove_dir_all(place.path().join("o")).unwrap();
    let again = ["--tare", "without.csv", "--payload", PLACE, "--write-load", "a.dat"];
    let said = complaint(&rigident(place.path(), &line(&again)));
    assert!(said.contains("--write-load a.dat: the file is there already"), "{said}");
}

#[test]
fn products_have_the_sign_of_the_matrix() {
    // Mass in the first and third quadrant of x, y: the element Ixy is negative.
    let load = Load { mass_kg: 2.0, com_m: [0.0; 3], inertia_com_kgm2: [0.02, 0.02, 0.035, 0.0, 0.0, -0.01] };
    let script = Language::UniversalRobots.write(&load, "f", &[]).unwrap();
    assert_eq!(script, "set_target_payload(2.0, [0.0, 0.0, 0.0], [0.02, 0.02, 0.035, -0.01, 0.0, 0.0])\n");
    let call = Language::FrankaCall.write(&load, "f", &[]).unwrap();
    assert!(call.contains("{{0.02, -0.01, 0.0, -0.01, 0.02, 0.0, 0.0, 0.0, 0.035}}"), "{call}");
    // The axis of least moment lies along (1, 1, 0): X or Y of the principal frame.
    let dat = Language::Kuka.write(&load, "f", &[]).unwrap();
    assert!(dat.contains("A 45.0") || dat.contains("A -45.0"), "{dat}");
    let least =
        if dat.contains("A 45.0") { "J {X 0.01,Y 0.03,Z 0.035}" } else { "J {X 0.03,Y 0.01,Z 0.035}" };
    assert!(dat.contains(least), "{dat}");
}

#[test]
fn a_small_payload_is_a_point_mass_and_a_tiny_one_is_not_identified() {
    let place = tempfile::tempdir().unwrap();
    let words = line(&[
        "--tare",
        "without.csv",
        "--payload",
        PLACE,
        "--write-load",
        "b.script",
        "--write-load",
        "b.urdf",
    ]);
    record(place.path(), &payload(0.8, 0.05), 0.1, 20.0);
    let output = rigident(place.path(), &words);
    let found = answer(&output);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(found["payload"]["load"]["basis"], "point_mass", "{found:#}");
    let text = std::fs::read_to_string(place.path().join("b.script")).unwrap();
    assert!(text.contains("a point mass") && !text.contains("], ["), "{text}");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("b.urdf: not written: a URDF link needs a tensor"), "{said}");
    assert!(!place.path().join("b.urdf").exists());

    let place = tempfile::tempdir().unwrap();
    record(place.path(), &payload(0.005, 0.05), 0.3, 8.0);
    let output = rigident(place.path(), &words);
    let found = answer(&output);
    assert_eq!((output.status.code(), found["status"].as_str()), (Some(1), Some("not_identified")));
    assert_eq!(found["payload"]["refused"], "the mass is not identified");
    assert!(found["payload"]["load"].is_null() && found["mass_kg"].is_null());
    assert!(!place.path().join("b.script").exists());
}

#[test]
fn unusable_payloads_are_named() {
    let place = tempfile::tempdir().unwrap();
    record(place.path(), &payload(3.0, 0.2), 0.05, 8.0);
    let said = |more: &[&str]| complaint(&rigident(place.path(), &line(more)));
    let bare = said(&["--payload", "l7"]);
    assert!(bare.contains("--tare"), "{bare}");
    let link = said(&["--tare", "without.csv", "--payload", "hand"]);
    assert!(link.contains("--payload hand: there is no link hand; the links are base, l1"), "{link}");
    let numbers = said(&["--tare", "without.csv", "--payload", "l7@1,2"]);
    assert!(numbers.contains("--payload l7@1,2: the place is x,y,z in m"), "{numbers}");
    let base = said(&["--tare", "without.csv", "--payload", "base"]);
    assert!(base.contains("cannot be put on the link base"), "{base}");
    let ending = said(&["--tare", "without.csv", "--payload", "l7", "--write-load", "a.txt"]);
    assert!(ending.contains("--write-load a.txt: its name must end in .script"), "{ending}");
    let itself = said(&["--tare", "with.csv", "--payload", "l7"]);
    assert!(itself.contains("would count twice"), "{itself}");
    let model = said(&["--tare", "without.csv", "--payload", "l7", "--write-model", "a.urdf"]);
    assert!(model.contains("identify these without it"), "{model}");
    // A tare of another arm: its factor has other parameters.
    let factor =
        ["factor", "without.csv", "--model", "arm.urdf", "--lock", "l7_joint=0", "-o", "other.factor"];
    let joint = seven_axes().links[7].joint_name.clone();
    let factor: Vec<String> = factor.map(|word| word.replace("l7_joint", &joint)).to_vec();
    let text = std::fs::read_to_string(place.path().join("without.csv")).unwrap();
    std::fs::write(place.path().join("without.csv"), text.replace(&format!("{joint}_"), "left_out_"))
        .unwrap();
    let factor: Vec<&str> = factor.iter().map(String::as_str).collect();
    let output = rigident(place.path(), &factor);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let other = said(&["--tare", "other.factor", "--payload", "l7"]);
    assert!(other.contains("is of another model than the run"), "{other}");
}

/// Efforts of both runs in mN m: the arm is 1000 times too heavy, and nothing is said of the payload. Of one
/// run alone as well.
#[test]
fn efforts_in_another_unit_say_nothing_of_a_payload() {
    let place = tempfile::tempdir().unwrap();
    record(place.path(), &payload(3.0, 0.2), 0.05, 8.0);
    let scaled = |name: &str| {
        let text = std::fs::read_to_string(place.path().join(name)).unwrap();
        let names: Vec<String> = text.lines().next().unwrap().split(',').map(str::to_owned).collect();
        let rows = text.lines().skip(1).map(|line| {
            let cells = line.split(',').zip(&names).map(|(cell, name)| match name.ends_with("_nm") {
                true => format!("{:e}", 1000.0 * cell.parse::<f64>().unwrap()),
                false => cell.to_owned(),
            });
            cells.collect::<Vec<_>>().join(",")
        });
        let all: Vec<String> = std::iter::once(names.join(",")).chain(rows).collect();
        std::fs::write(place.path().join(name), all.join("\n") + "\n").unwrap();
    };
    for name in ["with.csv", "without.csv"] {
        scaled(name);
        let words = line(&["--tare", "without.csv", "--payload", PLACE, "--write-load", "a.script"]);
        let output = rigident(place.path(), &words);
        let found = answer(&output);
        assert_eq!(
            (output.status.code(), found["status"].as_str()),
            (Some(1), Some("implausible")),
            "{name}"
        );
        assert!(found["payload"]["load"].is_null() && found["mass_kg"].is_null(), "{name}");
        assert!(!place.path().join("a.script").exists());
        std::fs::remove_dir_all(place.path().join("o")).unwrap();
    }
}

fn fitted(model: &Model, recording: &Recording) -> Fit {
    let friction = Friction::parse(&[FRICTION.to_owned()]).unwrap();
    let options = ProblemOptions { friction, ..ProblemOptions::default() };
    let problem = Problem::from_recording(recording, Some(model), &options).unwrap();
    problem.fit(&FitOptions::default(), &Silent).unwrap()
}

/// Scales of the efforts that are off alike in both runs, 2 % (1 σ): the arm weighs some 15 kg, the payload
/// 3.
#[test]
fn intervals_hold_the_truth_where_scales_of_torques_are_off() {
    let load = payload(3.0, 0.25);
    let [bare, with] = arms(&load);
    let place = bare.moving_place(&bare.place("--payload", PLACE).unwrap());
    let map = map_to_parent(&place.rotation, &place.position);
    let to_link = nalgebra::DMatrix::from_fn(10, 10, |i, j| map[(i, j)]);
    let carrier = Carrier { link: "l7".to_owned(), to_link, frame: "l7".to_owned() };
    let truth = load.parameters();
    let (mut inside, mut all, mut mass_u95) = (0, 0, 0.0);
    let count = runs(6, 2);
    for seed in 1..=count {
        let fit = |model: &Model, noise: u64| {
            let run = ArmRun { motion_s: 8.0, motion: noise as usize % 2, ..run(10 * seed + noise, 0.1) };
            let mut recording = run.recording(model);
            recording.name = format!("{seed} {noise}");
            recording.rig.tree.effort_gain_std = Some(0.02);
            for (k, (name, cells)) in recording.extra.iter_mut().enumerate() {
                // Six draws of ± 1 σ and less: a standard deviation of 1.
                let draw = ((k as f64 + 1.0) * (seed as f64 * 1.37 + 0.3)).sin() * std::f64::consts::SQRT_2;
                if name.ends_with("_nm") {
                    for cell in cells {
                        *cell = format!("{:e}", (1.0 + 0.02 * draw) * cell.parse::<f64>().unwrap());
                    }
                }
            }
            (fitted(&bare, &recording), recording.name)
        };
        let ((with, _), (without, name)) = (fit(&with, 1), fit(&bare, 2));
        let tare = Tare::of_run(&without, PooledFactor::of(&without, &name)).unwrap();
        let found = tare.payload(&with, &carrier).unwrap();
        for (j, truth) in truth.iter().enumerate() {
            let m = found.estimate.measured(j).unwrap();
            inside += i32::from((m.value - truth).abs() <= m.u95);
            all += 1;
        }
        mass_u95 += found.estimate.measured(0).unwrap().u95 / count as f64;
    }
    // By chance 3 of 60 values are outside; of ten of one run, which are correlated, as many as three runs'
    // worth of two.
    assert!(inside >= all - 8 * all / 60 - 1, "{inside} of {all}");
    // The payload's own 2 % and what the noise leaves; errors of each run's own would leave 2 % of the arm as
    // well.
    assert!(mass_u95 < 0.1, "{mass_u95}");
}
