//! A rig calibrated by a steel cylinder, and verified: recordings by Newton's and Euler's laws, with errors
//! of the rig.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Output;

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::rig::RigCalibration;
use serde_json::Value;

use crate::program::{json, rigident, said};

const RATE_HZ: f64 = 200.0;
const GRAVITY: f64 = 9.80665;

const RIG: &str = "[[imu]]\nposition_m = [0.04, -0.03, 0.02]\naccel_noise_mps2 = 0.01\ngyro_noise_radps = \
                   5e-4\n\n\
                   [load_cell]\nnoise_n_nm = [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015]\nrange_n_nm = [100, \
                   100, 100, 5, 5, 5]\n";

const CYLINDER: &str = "name = \"steel cylinder 3\"\nmass_kg = 3.32\nmass_std_kg = \
                        3.3e-4\n\n[cylinder]\ndiameter_m = 0.07\n\
                        diameter_tolerance_m = 2e-5\nlength_m = 0.11\nlength_tolerance_m = 2e-5\n\n[place]\n\
                        position_m = [0, 0, 0.012]\nposition_tolerance_m = [3.5e-5, 3.5e-5, 3.5e-5]\n\
                        rotation_tolerance_deg = [0.05, 0.05, 0.05]\n\n[[mounting]]\nname = \"lying\"\n\
                        rotation_rpy_deg = [90, 0, 0]\nposition_m = [0, 0.055, 0.047]\n";

/// A rigid body, axes of S.
struct Body {
    mass: f64,
    com: Vector3<f64>,
    inertia: Matrix3<f64>,
}

impl Body {
    fn cylinder(lying: bool) -> Self {
        let (mass, radius, length) = (3.32, 0.035_f64, 0.11_f64);
        let across = mass * (0.25 * radius * radius + length * length / 12.0);
        let along = 0.5 * mass * radius * radius;
        let (com, moments) = if lying {
            (Vector3::new(0.0, 0.0, 0.047), Vector3::new(across, along, across))
        } else {
            (Vector3::new(0.0, 0.0, 0.067), Vector3::new(across, across, along))
        };
        Self { mass, com, inertia: Matrix3::from_diagonal(&moments) }
    }

    fn bracket() -> Self {
        Self {
            mass: 3.2,
            com: Vector3::new(0.03, -0.02, 0.08),
            inertia: Matrix3::new(0.02, 0.002, -0.001, 0.002, 0.025, 0.0015, -0.001, 0.0015, 0.015),
        }
    }
}

/// Errors of the rig, within what the data sheets of its default classes allow.
struct Errors {
    gain: [f64; 6],
    accel_gain: [f64; 3],
    gyro_gain: [f64; 3],
    lever_arm: Vector3<f64>,
    turned: Vector3<f64>,
}

impl Errors {
    fn rig() -> Self {
        Self {
            gain: [6e-3, -4e-3, 7e-3, -5e-3, 3e-3, 4e-3],
            accel_gain: [2e-3, -3e-3, -3.5e-3],
            gyro_gain: [3e-3, -2e-3, 2.5e-3],
            lever_arm: Vector3::new(1.5e-3, -1e-3, 2e-3),
            turned: Vector3::new(4e-3, -3e-3, 2e-3),
        }
    }
}

/// Writes the recording of a body on the rig, 20 s, with its rig file beside it.
fn record(at: &Path, name: &str, body: &Body, errors: &Errors, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sigma: f64| -> f64 { sigma * Distribution::<f64>::sample(&StandardNormal, &mut random) };
    let mut text =
        "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,imu_gy_radps,\
                    imu_gz_radps\n"
            .to_owned();
    let offset: [f64; 6] = std::array::from_fn(|c| noise(if c < 3 { 2.0 } else { 0.1 }));
    let imu = Rotation3::new(errors.turned).matrix().transpose();
    let place = Vector3::new(0.04, -0.03, 0.02) + errors.lever_arm;
    for k in 0..(20.0 * RATE_HZ) as usize {
        let t = k as f64 / RATE_HZ;
        let (attitude, rate, turning) = motion(t);
        let gravity = attitude.transpose() * Vector3::new(0.0, 0.0, GRAVITY);
        let specific = |x: &Vector3<f64>| gravity + turning.cross(x) + rate.cross(&rate.cross(x));
        let force = specific(&body.com) * body.mass;
        let moment = body.inertia * turning + rate.cross(&(body.inertia * rate)) + body.com.cross(&force);
        let load = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        let sigma = [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015];
        let read = (0..6).map(|c| load[c] * (1.0 + errors.gain[c]) + offset[c] + noise(sigma[c]));
        let read: Vec<f64> = read.collect();
        let (a, w) = (imu * specific(&place), imu * rate);
        let a: Vec<f64> = (0..3).map(|c| a[c] * (1.0 + errors.accel_gain[c]) + noise(0.01)).collect();
        let w: Vec<f64> = (0..3).map(|c| w[c] * (1.0 + errors.gyro_gain[c]) + noise(5e-4)).collect();
        let cells: Vec<String> = read.iter().chain(&a).chain(&w).map(|v| format!("{v:.9}")).collect();
        let _ = writeln!(text, "{t:.6},{}", cells.join(","));
    }
    fs::write(at.join(format!("{name}.csv")), text).unwrap();
    fs::write(at.join(format!("{name}.rig.toml")), RIG).unwrap();
}

/// Attitude, rate and its derivative of S in its own axes, by differences of the attitude.
fn motion(t: f64) -> (Matrix3<f64>, Vector3<f64>, Vector3<f64>) {
    let attitude = |t: f64| {
        let swing = |terms: [(f64, f64, f64); 3]| {
            terms
                .iter()
                .map(|(amplitude, hz, phase)| amplitude * (std::f64::consts::TAU * hz * t + phase).sin())
                .sum()
        };
        let roll = swing([(0.25, 0.2, 0.1), (0.15, 0.7, 1.0), (0.1, 1.6, 1.3)]);
        let pitch = swing([(0.25, 0.3, 2.0), (0.15, 0.9, 0.3), (0.1, 1.4, 0.5)]);
        let yaw = swing([(0.25, 0.4, 0.7), (0.15, 0.8, 1.7), (0.1, 1.2, 2.7)]);
        Rotation3::from_euler_angles(roll, pitch, yaw)
    };
    let h = 1e-4;
    let rate = |t: f64| (attitude(t - h).inverse() * attitude(t + h)).scaled_axis() / (2.0 * h);
    // Both ends of a step turn about nearly the same axis.
    (*attitude(t).matrix(), rate(t), (rate(t + h) - rate(t - h)) / (2.0 * h))
}

fn number(object: &Value, path: &[&str]) -> f64 {
    path.iter().fold(object, |v, key| &v[*key]).as_f64().unwrap_or_else(|| panic!("{path:?} of {object}"))
}

fn u95(result: &Value) -> (f64, f64) {
    let mass = result["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "m").unwrap();
    (number(mass, &["value"]), number(mass, &["u95"]))
}

#[test]
fn a_cylinder_calibrates_a_rig_and_verifies_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("cylinder.toml"), CYLINDER).unwrap();
    let errors = Errors::rig();
    record(at, "upright", &Body::cylinder(false), &errors, 1);
    record(at, "lying", &Body::cylinder(true), &errors, 2);
    record(at, "bracket", &Body::bracket(), &errors, 3);
    record(at, "again", &Body::cylinder(false), &errors, 4);
    check_calibrations(at);
    check_calibrated_answers(at);
    check_verified(at);
}

/// Calibrates the rig by recordings of the cylinder.
fn calibrate_rig(at: &Path, recordings: &[&str], output: &str, more: &[&str]) -> Output {
    let mut line = vec!["calibrate", "rig"];
    line.extend(recordings);
    line.extend(["--reference", "cylinder.toml", "-o", output, "--json"]);
    line.extend(more);
    rigident(at, &line)
}

/// Calibrates by one mounting and by two, whose order does not count and which know no less.
fn check_calibrations(at: &Path) {
    let one = calibrate_rig(at, &["upright.csv"], "one.calibration.toml", &[]);
    assert_eq!(one.status.code(), Some(0), "{}", said(&one));
    let both = calibrate_rig(
        at,
        &["upright.csv", "lying.csv"],
        "both.calibration.toml",
        &["--mounting", "place,lying"],
    );
    assert_eq!(both.status.code(), Some(0), "{}", said(&both));
    // The result in either order is the same, but for where it was linearised.
    let turned = calibrate_rig(
        at,
        &["lying.csv", "upright.csv"],
        "turned.calibration.toml",
        &["--mounting", "lying,place"],
    );
    let (both, turned) = (json(&both), json(&turned));
    for (a, b) in both["errors"].as_array().unwrap().iter().zip(turned["errors"].as_array().unwrap()) {
        let off = (number(a, &["value"]) - number(b, &["value"])).abs();
        assert!(a["name"] == b["name"] && off < 0.1 * number(a, &["sigma"]), "{a} {b}");
    }
    // Two mountings know no less than one.
    let one = json(&one);
    for (one, both) in one["errors"].as_array().unwrap().iter().zip(both["errors"].as_array().unwrap()) {
        assert!(number(both, &["sigma"]) < 1.01 * number(one, &["sigma"]), "{one} {both}");
        assert!(number(one, &["sigma"]) < 1.01 * number(one, &["sigma_before"]), "{one}");
    }
}

/// Identifies a bracket with and without the calibration, which narrows the mass' interval about the truth.
fn check_calibrated_answers(at: &Path) {
    let of = |command: &str, name: &str, more: &[&str]| {
        let out = format!("out-{name}");
        let mut line = vec![command, "bracket.csv", "--json", "--out", &out];
        line.extend(more);
        let output = rigident(at, &line);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        json(&output)
    };
    let before = u95(&of("identify", "before", &[]));
    let answer = of("identify", "after", &["--calibration", "both.calibration.toml"]);
    let after = u95(&answer);
    assert!(after.1 < before.1 / 8.0, "{before:?} {after:?}");
    assert!((after.0 - 3.2).abs() < 1.5 * after.1, "{after:?}");
    assert!(answer["notes"].to_string().contains("calibration both of "), "{}", answer["notes"]);
    let named = answer["errors"].as_array().unwrap().iter().find(|e| e["name"] == "gain_fz").unwrap();
    assert!(
        named["basis"].as_str().unwrap().starts_with("both of ") && named["expected"].is_number(),
        "{named}"
    );
    // The rig file's key does the same as the option.
    let rig = format!("{RIG}\n[calibration]\nfile = \"both.calibration.toml\"\n");
    fs::write(at.join("calibrated.rig.toml"), rig).unwrap();
    assert_eq!(u95(&of("identify", "key", &["--rig", "calibrated.rig.toml"])), after);
    // The answer of a device's run is the host's.
    let replayed = u95(&of("replay", "replayed", &["--calibration", "both.calibration.toml"]));
    assert!((replayed.0 - after.0).abs() < 0.05 * after.1 && (replayed.1 / after.1 - 1.0).abs() < 0.05);
}

/// Verifies the rig by the cylinder, and by another mounting than that of the recording.
fn check_verified(at: &Path) {
    let verify = |name: &str, more: &[&str]| {
        let mut line = vec!["verify", name, "--reference", "cylinder.toml", "--json"];
        line.extend(more);
        let output = rigident(at, &line);
        (output.status.code(), json(&output))
    };
    for more in [&[][..], &["--calibration", "one.calibration.toml"]] {
        let (code, verified) = verify("again.csv", more);
        assert_eq!((code, &verified["passed"]), (Some(0), &Value::Bool(true)), "{verified}");
        let quantities = verified["recordings"][0]["quantities"].as_array().unwrap();
        let limit = number(&verified["recordings"][0], &["e_n_limit"]);
        assert!(quantities.len() == 10 && quantities.iter().all(|q| number(q, &["e_n"]).abs() <= limit));
    }
    let (_, verified) = verify("upright.csv", &["--calibration", "one.calibration.toml"]);
    assert!(verified["recordings"][0]["warnings"].to_string().contains("count twice"), "{verified}");
    // A mounting that is not the one of the recording is another body.
    let (code, verified) = verify("again.csv", &["--mounting", "lying"]);
    assert_eq!((code, &verified["passed"]), (Some(1), &Value::Bool(false)));
}

#[test]
fn another_body_or_another_rig_calibrates_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("cylinder.toml"), CYLINDER).unwrap();
    record(at, "bracket", &Body::bracket(), &Errors::rig(), 5);
    record(at, "upright", &Body::cylinder(false), &Errors::rig(), 6);
    let calibrate = |recording: &str, more: &[&str]| {
        let mut line = vec!["calibrate", "rig", recording, "--reference", "cylinder.toml", "-o", "no.toml"];
        line.extend(more);
        let output = rigident(at, &line);
        assert!(output.status.code() != Some(2) || !at.join("no.toml").exists());
        output
    };
    for (recording, more, words) in [
        ("bracket.csv", &[][..], "the body is not the reference"),
        ("upright.csv", &["--mounting", "lying"], "the body is not the reference"),
        ("upright.csv", &["--mounting", "standing"], "there are lying"),
        ("upright.csv", &["--mounting", "place,lying"], "names 2 mountings of 1 recordings"),
    ] {
        let output = calibrate(recording, more);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains(words), "{words}: {}", said(&output));
    }
    let verified = rigident(at, &["verify", "bracket.csv", "--reference", "cylinder.toml", "--json"]);
    assert_eq!(verified.status.code(), Some(1));
    assert!(
        json(&verified)["recordings"][0]["warnings"].to_string().contains("the body is not the reference")
    );

    let twice = calibrate("upright.csv", &["upright.csv"]);
    assert!(twice.status.code() == Some(2) && said(&twice).contains("given twice"), "{}", said(&twice));

    // A rotation far beyond what the class allows is named.
    let mut worse = Errors::rig();
    worse.turned.z = 0.04;
    record(at, "worse", &Body::cylinder(false), &worse, 7);
    let output = calibrate("worse.csv", &[]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("imu_rotation_z"), "{}", said(&output));

    let output = calibrate("upright.csv", &[]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    fs::write(at.join("moved.rig.toml"), RIG.replace("0.04, -0.03", "0.05, -0.03")).unwrap();
    let line = ["identify", "upright.csv", "--rig", "moved.rig.toml", "--calibration", "no.toml"];
    let output = rigident(at, &line);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("imu.position_m"), "{}", said(&output));
    // An old one is reported, and used.
    let made = RigCalibration::load(&at.join("no.toml")).unwrap();
    let old = RigCalibration { date: "2020-01-01T00:00:00Z".to_owned(), ..made }.sealed();
    fs::write(at.join("old.toml"), old.to_toml()).unwrap();
    let line = ["identify", "upright.csv", "--calibration", "old.toml", "--json", "--out", "old"];
    let output = rigident(at, &line);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(json(&output)["warnings"].to_string().contains("calibrate the rig again"));
}

/// A body that weighs 1.8 % less than its file says, and one weighed in pounds: both commands refuse both, by
/// the mass. A χ² of ten parameters lets the first pass.
#[test]
fn a_reference_weighed_wrongly_is_refused_by_both_commands() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let none = Errors {
        gain: [0.0; 6],
        accel_gain: [0.0; 3],
        gyro_gain: [0.0; 3],
        lever_arm: Vector3::zeros(),
        turned: Vector3::zeros(),
    };
    record(at, "upright", &Body::cylinder(false), &none, 8);
    for (mass, refused) in [("3.32", None), ("3.379", Some("weighed wrongly")), ("7.319", Some("pounds"))] {
        fs::write(at.join("weighed.toml"), CYLINDER.replace("mass_kg = 3.32", &format!("mass_kg = {mass}")))
            .unwrap();
        let verified = rigident(at, &["verify", "upright.csv", "--reference", "weighed.toml", "--json"]);
        let line = [
            "calibrate",
            "rig",
            "upright.csv",
            "--reference",
            "weighed.toml",
            "-o",
            "weighed.calibration.toml",
        ];
        let output = rigident(at, &line);
        let Some(cause) = refused else {
            assert_eq!(
                (verified.status.code(), output.status.code()),
                (Some(0), Some(0)),
                "{}",
                said(&output)
            );
            fs::remove_file(at.join("weighed.calibration.toml")).unwrap();
            continue;
        };
        assert_eq!((verified.status.code(), output.status.code()), (Some(1), Some(2)), "{}", said(&output));
        assert!(!at.join("weighed.calibration.toml").exists());
        let warnings = json(&verified)["recordings"][0]["warnings"].to_string();
        for words in [cause, "m is 3.3", "E_n -"] {
            assert!(said(&output).contains(words) && warnings.contains(words), "{words}: {}", said(&output));
        }
    }
}

/// The cylinder is 0.3 mm off and nobody has said how well it is placed: the lever arm's interval holds the
/// truth, and what was assumed is said, in the calibration's own output and in the answers that rest on it.
#[test]
fn a_place_of_unknown_tolerance_makes_no_sure_lever_arm() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let open: Vec<&str> = CYLINDER.lines().filter(|line| !line.contains("n_tolerance")).collect();
    fs::write(at.join("open.toml"), open.join("\n")).unwrap();
    let mut body = Body::cylinder(false);
    body.com.x += 3e-4;
    let errors = Errors::rig();
    record(at, "upright", &body, &errors, 9);
    let line = [
        "calibrate",
        "rig",
        "upright.csv",
        "--reference",
        "open.toml",
        "-o",
        "open.calibration.toml",
        "--json",
    ];
    let output = rigident(at, &line);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let found = json(&output);
    assert!(found["notes"].to_string().contains("place.position_tolerance_m"), "{found}");
    for (axis, truth) in ["x", "y", "z"].iter().zip(errors.lever_arm.iter()) {
        let own = found["errors"]
            .as_array()
            .unwrap()
            .iter()
            .find(|e| e["name"] == format!("lever_arm_{axis}"))
            .unwrap();
        assert!((number(own, &["value"]) - truth).abs() < number(own, &["u95"]), "{own} {truth}");
    }
    let line =
        ["identify", "upright.csv", "--calibration", "open.calibration.toml", "--json", "--out", "open"];
    assert!(json(&rigident(at, &line))["notes"].to_string().contains("place.position_tolerance_m"));
}
