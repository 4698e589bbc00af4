//! `rigident identify` of trees and what it writes, as a user types it.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use rigident::model::dynamics::inverse_dynamics;
use rigident::model::{Model, human::Person};
use rigident::rows::named_model::{open, rig_links};
use rigident_shared::tree::BaseMotion;
use serde_json::Value;

use crate::program::{complaint, json as answer, rigident};

mod errors;
mod findings;
mod gross;
mod locked;
mod untrue;

/// Everything that an answer says in words: warnings and notes.
fn in_words(found: &Value) -> String {
    format!("{}{}", found["warnings"], found["notes"])
}

const ARM: &str = r#"<robot name="arm">
  <link name="foot"><inertial><mass value="3"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0.01 0.02 0.15"/><mass value="4"/>
    <inertia ixx="0.05" ixy="0.001" ixz="0.002" iyy="0.05" iyz="0.003" izz="0.01"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.02 -0.01 0.1"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0" ixz="0.001" iyy="0.02" iyz="0" izz="0.004"/></inertial></link>
  <link name="plate"><inertial><mass value="0.3"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
  <joint name="shoulder" type="continuous"><origin xyz="0 0 0.2"/><parent link="foot"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><origin xyz="0 0 0.3" rpy="0 0 0.4"/><parent link="upper"/><child link="fore"/><axis xyz="1 0 0"/></joint>
  <joint name="flange" type="fixed"><origin xyz="0 0 0.25"/><parent link="fore"/><child link="plate"/></joint>
</robot>
"#;

/// A sum of two swings with rate and acceleration.
pub fn swing(t: f64, k: usize, size: f64) -> [f64; 3] {
    let mut out = [0.0; 3];
    for (n, hz) in [0.31 + 0.05 * k as f64, 0.83 + 0.07 * k as f64].into_iter().enumerate() {
        let w = std::f64::consts::TAU * hz;
        let a = w * t + (k * 3 + n) as f64;
        let s = size / (1.0 + n as f64);
        out[0] += s * a.sin();
        out[1] += s * w * a.cos();
        out[2] -= s * w * w * a.sin();
    }
    out
}

/// Noise that repeats itself, of about unit variance.
pub fn noise(k: usize) -> f64 {
    let mut z = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut sum = 0.0;
    for _ in 0..12 {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9).wrapping_add(0x94d0_49bb_1331_11eb);
        sum += ((z >> 11) as f64) / (1_u64 << 53) as f64 - 0.5;
    }
    sum
}

/// Positions and torques of the arm, `moving` of its joints in motion.
fn arm_recording(place: &Path, moving: usize) {
    std::fs::write(place.join("arm.urdf"), ARM).unwrap();
    let model = open(place.join("arm.urdf").to_str().unwrap(), &Person::default()).unwrap().0;
    let base = BaseMotion::still([0.0, 0.0, -9.80665]);
    let mut text = "t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm\n".to_owned();
    for row in 0..6000 {
        let t = f64::from(row) / 500.0;
        let s: Vec<[f64; 3]> =
            (0..2).map(|k| if k < moving { swing(t, k, 0.9) } else { [0.3, 0.0, 0.0] }).collect();
        let part = |n: usize| [s[0][n], s[1][n]];
        let forces = inverse_dynamics(&model, &base, &part(0), &part(1), &part(2)).unwrap();
        let torque = |k: usize| {
            forces[6 + k] + 0.4 * s[k][1] + 0.8 * s[k][1].signum() + 0.05 * noise(2 * row as usize + k)
        };
        let _ = writeln!(text, "{t},{},{},{},{}", s[0][0], s[1][0], torque(0), torque(1));
    }
    std::fs::write(place.join("arm.csv"), text).unwrap();
    std::fs::write(place.join("arm.rig.toml"), "[tree]\nclass = \"exact\"\n").unwrap();
}

const FRICTION: [&str; 2] = ["--friction", "viscous,coulomb"];

#[test]
fn an_arm_is_identified_from_positions_and_torques_and_written_in_three_languages() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let truth = open(place.path().join("arm.urdf").to_str().unwrap(), &Person::default()).unwrap().0;
    for (n, file) in ["out.urdf", "out.xml", "out.sdf"].into_iter().enumerate() {
        let out = format!("o{n}");
        let words =
            ["identify", "arm.csv", "--model", "arm.urdf", "--json", "--out", &out, "--write-model", file];
        let output = rigident(place.path(), &[&words[..], &FRICTION].concat());
        let found = answer(&output);
        assert_eq!(found["status"], "identified", "{}", found["advice"]);
        assert_eq!(output.status.code(), Some(0));
        let parameters = found["parameters"].as_array().unwrap();
        for (name, value) in [("shoulder.viscous", 0.4), ("elbow.viscous", 0.4), ("elbow.coulomb", 0.8)] {
            let p = parameters.iter().find(|p| p["name"] == name).unwrap();
            let (got, u95) = (p["value"].as_f64().unwrap(), p["u95"].as_f64().unwrap());
            assert!((got - value).abs() < 2.0 * u95 && u95 < 0.05, "{p}");
        }
        let full = &found["standard_parameters"];
        assert!(full["note"].as_str().unwrap().contains("only the base parameters above are identified"));
        assert_eq!(full["links"].as_array().unwrap().len(), 4, "links on fixed joints are on their own");
        // The file has the same parameters, and its torques are those of the truth to the noise.
        let written = open(place.path().join(file).to_str().unwrap(), &Person::default()).unwrap().0;
        let torques = |model: &Model| {
            let base = BaseMotion::still([0.0, 0.0, -9.80665]);
            inverse_dynamics(model, &base, &[0.5, -0.8], &[1.0, 2.0], &[-3.0, 4.0]).unwrap()[6..].to_vec()
        };
        for (a, b) in torques(&written).iter().zip(torques(&truth)) {
            assert!((a - b).abs() < 0.05, "{file}: {a} {b}");
        }
    }
    let text = std::fs::read_to_string(place.path().join("out.urdf")).unwrap();
    assert!(text.contains("rpy=\"0 0 0.4\""), "the file is kept but for its inertias");
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--out", "o4", "--write-model", "out.urdf"];
    assert!(complaint(&rigident(place.path(), &words)).contains("nothing is overwritten"));
}

const LEG: &str = r#"<mujoco model="leg"><compiler angle="radian"/><worldbody>
  <body name="thigh" pos="0 0 1" euler="0.1 0 0.2">
    <joint name="hip_x" type="hinge" axis="1 0 0" pos="0 0 0.01"/>
    <joint name="hip_z" type="hinge" axis="0 0 1" pos="0 0 0.01"/>
    <joint name="hip_y" type="hinge" axis="0 1 0" pos="0 0 0.01"/>
    <inertial pos="0.02 0.01 -0.2" mass="4" fullinertia="0.06 0.05 0.02 0.001 0.002 0.003"/>
    <body name="shin" pos="0 0.01 -0.4"><joint name="knee" type="hinge" axis="0 -1 0"/>
      <inertial pos="0.01 0.01 -0.2" mass="2" fullinertia="0.03 0.03 0.01 0.001 0.001 0.002"/></body>
  </body></worldbody></mujoco>"#;

/// A body of three hinges, as MuJoCo's files have them: its joints' columns, base and full parameters, the
/// file written again.
#[test]
fn a_leg_with_three_hinges_in_one_body_is_identified_and_written() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("leg.xml"), LEG).unwrap();
    let read = |file: &str| open(place.path().join(file).to_str().unwrap(), &Person::default()).unwrap().0;
    let truth = read("leg.xml");
    let joints = ["hip_x", "hip_z", "hip_y", "knee"];
    let base = BaseMotion::still([0.0, 0.0, -9.80665]);
    let mut text = "t_s".to_owned();
    for unit in ["rad", "radps", "nm"] {
        text += &joints.map(|joint| format!(",{joint}_{unit}")).concat();
    }
    for row in 0..6000 {
        let t = f64::from(row) / 500.0;
        let s: Vec<[f64; 3]> = (0..4).map(|k| swing(t, k, 0.6)).collect();
        let part = |n: usize| s.iter().map(|s| s[n]).collect::<Vec<f64>>();
        let forces = inverse_dynamics(&truth, &base, &part(0), &part(1), &part(2)).unwrap();
        let torques = (0..4).map(|k| forces[6 + k] + 0.02 * noise(4 * row as usize + k));
        let all: Vec<String> =
            part(0).into_iter().chain(part(1)).chain(torques).map(|v| format!("{v:e}")).collect();
        let _ = write!(text, "\n{t},{}", all.join(","));
    }
    std::fs::write(place.path().join("leg.csv"), &text).unwrap();
    for (n, file) in ["out.xml", "out.urdf"].into_iter().enumerate() {
        let out = format!("o{n}");
        let words =
            ["identify", "leg.csv", "--model", "leg.xml", "--json", "--out", &out, "--write-model", file];
        let output = rigident(place.path(), &words);
        let found = answer(&output);
        assert_eq!(found["status"], "identified", "{} {}", found["warnings"], found["advice"]);
        let parameters = found["parameters"].as_array().unwrap();
        let links = found["standard_parameters"]["links"].as_array().unwrap();
        // Two bodies of ten parameters, less what joints on a base held still leave open; no link between the
        // hinges.
        assert!(parameters.len() < 20 && links.len() == 2, "{}", parameters.len());
        for (j, parameter) in parameters.iter().enumerate() {
            assert!(!parameter["name"].as_str().unwrap().contains('#'), "{j}: {parameter}");
        }
        let written = read(file);
        let torques = |model: &Model| {
            let q = [0.5, -0.8, 0.3, 0.4];
            inverse_dynamics(model, &base, &q, &[1.0, 2.0, -1.5, 1.0], &[-3.0, 4.0, 2.0, 5.0]).unwrap()[6..]
                .to_vec()
        };
        for (a, b) in torques(&written).iter().zip(torques(&truth)) {
            assert!((a - b).abs() < 0.02, "{file}: {a} {b}");
        }
    }
    // Without the hinges' columns it is said what to do.
    std::fs::write(
        place.path().join("less.csv"),
        text.replacen("hip_z_rad", "x", 1).replacen("hip_z_radps", "y", 1).replacen("hip_z_nm", "z", 1),
    )
    .unwrap();
    let said =
        complaint(&rigident(place.path(), &["identify", "less.csv", "--model", "leg.xml", "--out", "never"]));
    assert!(said.contains("hip_z"), "{said}");
}

#[test]
fn a_joint_that_never_moves_and_the_links_behind_it_are_named() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 1);
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--json", "--out", "o"];
    let output = rigident(place.path(), &[&words[..], &FRICTION].concat());
    assert_eq!(output.status.code(), Some(1));
    let found = answer(&output);
    assert_eq!(found["status"], "partly_identified");
    let reasons = found["advice"].to_string();
    assert!(reasons.contains("joint elbow: never moves"), "{reasons}");
    assert!(reasons.contains("the rows see only") && reasons.contains("elbow.viscous"), "{reasons}");
    for p in found["parameters"].as_array().unwrap() {
        if p["state"] == "not_identified" {
            assert!(p.get("value").is_none());
        }
    }
    // Locked it is one body with the upper arm.
    let words = ["identify", "arm.csv", "--model", "arm.urdf", "--lock", "elbow", "--out", "p"];
    let text = String::from_utf8_lossy(&rigident(place.path(), &words).stdout).into_owned();
    assert!(text.contains("base parameters of 10 standard ones"), "{text}");
}

#[test]
fn missing_and_unsuitable_inputs_are_named() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    let csv = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
    let said = |header: &str, options: &[&str]| {
        let (_, rows) = csv.split_once('\n').unwrap();
        std::fs::write(place.path().join("bad.csv"), format!("{header}\n{rows}")).unwrap();
        let words = [&["identify", "bad.csv", "--model", "arm.urdf", "--out", "never"], options].concat();
        let said = complaint(&rigident(place.path(), &words));
        assert!(!place.path().join("never").exists());
        said
    };
    let no_torque = said("t_s,shoulder_rad,elbow_rad,a,b", &[]);
    assert!(
        no_torque.contains("the wrench fx_n … mz_nm and the joints' efforts (JOINT_nm) are both missing"),
        "{no_torque}"
    );
    let one_torque = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,b", &[]);
    assert!(
        one_torque.contains("the efforts (JOINT_nm, or JOINT_n of what slides) of elbow are missing"),
        "{one_torque}"
    );
    let no_angle = said("t_s,shoulder_rad,x,shoulder_nm,elbow_nm", &[]);
    assert!(no_angle.contains("the position of joint elbow (elbow_rad) is missing"), "{no_angle}");
    let degrees = said("t_s,shoulder_rad,elbow_deg,shoulder_nm,c", &["--estimate", "fore"]);
    assert!(degrees.contains("elbow_deg") && degrees.contains("another unit"), "{degrees}");
    let nobody = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm", &["--estimate", "hand"]);
    assert!(nobody.contains("--estimate hand"), "{nobody}");
    let drive = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm", &["--drive", "m=wrist"]);
    assert!(drive.contains("there is no joint wrist; there are shoulder, elbow"), "{drive}");
    let known = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm", &["--known", "mass_kg=1±0.1"]);
    assert!(known.contains("--known mass_kg") && known.contains("LINK.mass_kg="), "{known}");
    let sides = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm", &["--symmetric-sides"]);
    assert!(sides.contains("no two links are named for left and right"), "{sides}");
    std::fs::write(place.path().join("one.csv"), &csv).unwrap();
    let single = complaint(&rigident(place.path(), &["identify", "one.csv", "--write-model", "x.urdf"]));
    assert!(single.contains("--write-model is for trees of links"), "{single}");
    for (option, word) in [
        (["--nominal-sigma", "0.5"], "--nominal-sigma"),
        (["--height-m", "1.6"], "--height-m"),
        (["--segment", "thigh=0.4"], "--segment"),
    ] {
        let words = [&["identify", "one.csv"][..], &option].concat();
        let said = complaint(&rigident(place.path(), &words));
        assert!(said.contains(word) && said.contains("trees of links"), "{said}");
    }
    let person = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm", &["--mass-kg", "60"]);
    assert!(person.contains("--mass-kg") && person.contains("human34"), "{person}");
    let tare = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm", &["--tare", "bad.csv"]);
    assert!(tare.contains("tare") && tare.contains("bad.csv") && tare.contains("count twice"), "{tare}");
    // What a rig file has and a tree has no use for.
    std::fs::write(
        place.path().join("bad.rig.toml"),
        "[[stream]]\nfile = \"bad.csv\"\n[[stream]]\nfile = \"one.csv\"\n",
    )
    .unwrap();
    let streams = said("t_s,shoulder_rad,elbow_rad,shoulder_nm,elbow_nm", &[]);
    assert!(streams.contains("[[stream]]"), "{streams}");
    let rig = "[load_cell]\ngain_uncertainty = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]\n[body]\nname \
               = \"b\"\n[truth]\nmass_kg = 1.0\n\
               com_m = [0.0, 0.0, 0.0]\ninertia_com_kgm2 = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]\n[[joint]]\nname \
               = \"elbow\"\neffort_noise = 0.05\n";
    std::fs::write(place.path().join("one.rig.toml"), rig).unwrap();
    let words = ["identify", "one.csv", "--model", "arm.urdf", "--json", "--out", "noted"];
    let warnings = in_words(&answer(&rigident(place.path(), &[&words[..], &FRICTION].concat())));
    for word in ["gain_uncertainty", "[body]", "[truth]", "the noise of some channels is stated"] {
        assert!(warnings.contains(word), "{word}: {warnings}");
    }
    let page = std::fs::read_to_string(place.path().join("noted/report.html")).unwrap();
    assert!(
        page.contains("<h2>Standard parameters <span class=\"tag\">not identified</span>")
            && page.contains("[truth]")
    );
}

const RIG: &str = r#"
[recording]
rate_hz = 200.0
[load_cell]
class = "exact"
[[imu]]
link = 0
class = "exact"
position_m = [0.02, 0.01, -0.03]
[[imu]]
link = 1
class = "exact"
[[link]]
name = "base"
[[link]]
name = "arm"
parent = "base"
joint = "revolute"
axis = [0, 0, 1]
position_m = [0.03, 0.0, 0.065]
"#;

/// Base and arm: IMUs, the arm's attitude, the wrench.
fn two_links(place: &Path, axis: Vector3<f64>) {
    std::fs::write(place.join("two.rig.toml"), RIG).unwrap();
    let nominal = |k: f64| {
        format!(
            "nominal_mass_kg = {}\nnominal_com_m = [0.02, {}, 0.05]\nnominal_inertia_com_kgm2 = [0.02, \
             0.025, 0.015, 0.001, 0.002, 0.003]\n",
            2.0 * k,
            0.03 * k
        )
    };
    // The truth has masses; the user's rig file does not.
    let truth = RIG
        .replace("name = \"base\"\n[[link]]", &format!("name = \"base\"\n{}[[link]]", nominal(1.0)))
        .replace("axis = ", &format!("{}axis = ", nominal(0.7)));
    std::fs::write(place.join("truth.toml"), truth).unwrap();
    let model = rig_links::read(&place.join("truth.toml")).unwrap();
    let mut text = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,imu_gy_radps,imu_gz_radps,imu1_gx_radps,imu1_gy_radps,imu1_gz_radps,q1_w,q1_x,q1_y,q1_z\n"
        .to_owned();
    for row in 0..4000 {
        let t = f64::from(row) / 200.0;
        let angles = [0, 1, 2].map(|k| swing(t, k, 0.35));
        let at = |t: f64| {
            let a = [0, 1, 2].map(|k| swing(t, k, 0.35));
            let rx = UnitQuaternion::from_euler_angles(a[0][0], 0.0, 0.0);
            let ry = UnitQuaternion::from_euler_angles(0.0, a[1][0], 0.0);
            rx.inverse() * (ry.inverse() * Vector3::z() * a[2][1] + Vector3::y() * a[1][1])
                + Vector3::x() * a[0][1]
        };
        let h = 1e-3;
        let change = ((at(t + h) - at(t - h)) * 8.0 - (at(t + 2.0 * h) - at(t - 2.0 * h))) / (12.0 * h);
        let turned = UnitQuaternion::from_euler_angles(angles[0][0], angles[1][0], angles[2][0]);
        let (rate, force) = (at(t), turned.inverse() * (Vector3::z() * 9.80665));
        let base = BaseMotion { specific_force: force, rate, angular_acceleration: change };
        let q = swing(t, 4, 0.8);
        let w = inverse_dynamics(&model, &base, &[q[0]], &[q[1]], &[q[2]]).unwrap();
        let p = Vector3::new(0.02, 0.01, -0.03);
        let felt = force + change.cross(&p) + rate.cross(&rate.cross(&p));
        let arm = UnitQuaternion::from_scaled_axis(axis * q[0]);
        let spin = arm.inverse() * rate + axis * q[1];
        let mut cells: Vec<f64> = vec![t];
        cells.extend((0..6).map(|c| w[c] + if c < 3 { 0.1 } else { 0.01 } * noise(6 * row as usize + c)));
        cells.extend(felt.iter().chain(rate.iter()).chain(spin.iter()));
        cells.extend([arm.w, arm.i, arm.j, arm.k]);
        let cells: Vec<String> = cells.iter().map(ToString::to_string).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    std::fs::write(place.join("two.csv"), text).unwrap();
}

#[test]
fn two_links_with_an_imu_each_are_identified_by_the_rig_file_s_links() {
    let place = tempfile::tempdir().unwrap();
    two_links(place.path(), Vector3::z());
    let output = rigident(place.path(), &["identify", "two.csv", "--json", "--out", "o"]);
    let found = answer(&output);
    assert_eq!((found["status"].as_str(), output.status.code()), (Some("identified"), Some(0)), "{found:#}");
    // 10 + 7, and the six offsets.
    assert_eq!(found["parameters"].as_array().unwrap().len(), 23);
    let mass = found["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "base.M").unwrap();
    let (value, u95) = (mass["value"].as_f64().unwrap(), mass["u95"].as_f64().unwrap());
    assert!((value - 3.4).abs() < 2.0 * u95 && u95 < 0.01, "{mass}");
    assert!(found["model"]["situation"].as_str().unwrap().starts_with("the base moves"));
    assert!(found.get("standard_parameters").is_none(), "there is no nominal model");
    assert_eq!(
        found,
        serde_json::from_slice::<Value>(&std::fs::read(place.path().join("o/result.json")).unwrap()).unwrap()
    );
    assert_eq!(found["physically_consistent"], true);
    let text = rigident(place.path(), &["identify", "two.csv", "--out", "p"]);
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(text.contains("base.M") && text.contains("(with arm.m)") && text.contains("offset_fx"), "{text}");
}

#[test]
fn a_load_cell_that_reports_the_reaction_is_recognised_and_nothing_is_identified() {
    let place = tempfile::tempdir().unwrap();
    two_links(place.path(), Vector3::z());
    let reversed = RIG.replace("rate_hz = 200.0\n", "rate_hz = 200.0\nwrench_sign = \"on_sensor\"\n");
    std::fs::write(place.path().join("two.rig.toml"), reversed).unwrap();
    let output = rigident(place.path(), &["identify", "two.csv", "--json", "--out", "o"]);
    let found = answer(&output);
    assert_eq!((found["status"].as_str(), output.status.code()), (Some("implausible"), Some(1)), "{found:#}");
    let cause = found["cause"]["what"].as_str().unwrap();
    assert!(cause.contains("the sign of the other body"), "{cause}");
    assert!(found.get("physically_consistent").is_none());
    assert_eq!(found["fit"]["consistency"]["reversed"], true);
    assert!(found["parameters"].as_array().unwrap().iter().all(|p| p.get("value").is_none()));
    assert!(found["notes"].to_string().contains("negative mass"), "{}", found["notes"]);
}

#[test]
fn attitudes_that_the_joint_cannot_have_and_missing_gyros_are_named() {
    let place = tempfile::tempdir().unwrap();
    two_links(place.path(), Vector3::x());
    let said = complaint(&rigident(place.path(), &["identify", "two.csv", "--out", "o"]));
    assert!(
        said.contains("does not fit the model")
            && said.contains("the attitude q1_… of link arm is turned by"),
        "{said}"
    );
    two_links(place.path(), Vector3::z());
    let csv = std::fs::read_to_string(place.path().join("two.csv")).unwrap();
    let without = |word: &str, by: &str| {
        std::fs::write(place.path().join("two.csv"), csv.replace(word, by)).unwrap();
        complaint(&rigident(place.path(), &["identify", "two.csv", "--out", "o"]))
    };
    let said = without("imu1_", "other1_");
    assert!(
        said.contains("imu1_gx_radps … of link arm is missing") && said.contains("not differentiated"),
        "{said}"
    );
    let said = without("q1_", "other1_");
    assert!(
        said.contains("the motion of joint arm (link arm) is missing") && said.contains("--lock arm"),
        "{said}"
    );
    let said = without("imu_g", "other_g");
    assert!(said.contains("angular rate imu_gx_radps … of the base link is missing"), "{said}");
    let said = without("imu1_", "imu5_");
    assert!(said.contains("links 0 to 1 (base, arm)"), "{said}");
}

#[test]
fn other_people_s_files_are_checked() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("good.urdf"), ARM).unwrap();
    let bad = ARM.replace("izz=\"0.004\"", "izz=\"0.05\"");
    std::fs::write(place.path().join("bad.urdf"), bad).unwrap();
    let good = rigident(place.path(), &["model", "check", "good.urdf"]);
    assert_eq!(good.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&good.stdout).contains("nothing strange found"));
    let bad = rigident(place.path(), &["model", "check", "bad.urdf", "--json"]);
    assert_eq!(bad.status.code(), Some(1));
    let found = answer(&bad);
    assert_eq!(found["findings"][0]["place"], "link fore");
    assert!(found["findings"][0]["text"].as_str().unwrap().contains("exceeds the sum of the others"));
    let none = rigident(place.path(), &["model", "check", "none.urdf"]);
    assert_eq!(none.status.code(), Some(2));
    assert!(complaint(&none).contains("none.urdf"));
}
