//! Rows and base parameters against Pinocchio, another library from the kinematics up.
//!
//! `pinocchio/vectors.json` holds what it said of a tree with every kind of joint, `pinocchio/record.py` how
//! it was asked. Counts of base parameters are checked against its regressors live in tests that are ignored
//! unless asked for: `RIGIDENT_PYTHON` (or `python3`) must have the wheel `pin`, which `cargo xtask setup`
//! installs.

use crate::program::python;
use std::path::{Path, PathBuf};
use std::process::Command;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rigident::model::rows::Moving;
use rigident_shared::tree::{BaseMotion, Joint, Link};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_column_slice(&numbers(value))
}

fn here(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/pinocchio").join(name)
}

#[test]
fn rows_of_every_kind_of_joint_are_pinocchio_s() {
    let recorded: Value =
        serde_json::from_str(&std::fs::read_to_string(here("vectors.json")).unwrap()).unwrap();
    let tables = recorded["links"].as_array().unwrap();
    let links: Vec<Link<f64>> = tables
        .iter()
        .map(|table| {
            let axis = |k: usize| vector(&table["axes"][k]);
            Link {
                parent: table["parent"].as_u64().unwrap() as usize,
                joint: match table["kind"].as_str().unwrap() {
                    "revolute" => Joint::Revolute(axis(0)),
                    "prismatic" => Joint::Prismatic(axis(0)),
                    "universal" => Joint::Universal(axis(0), axis(1)),
                    "spherical" => Joint::Spherical,
                    _ => Joint::Free,
                },
                rotation: Matrix3::from_row_slice(&numbers(&table["rotation"])),
                position: vector(&table["position"]),
            }
        })
        .collect();
    let kinds: std::collections::BTreeSet<&str> =
        tables.iter().filter_map(|table| table["kind"].as_str()).collect();
    assert_eq!(kinds.len(), 5, "every kind is in the recorded tree");
    let phi = DVector::from_vec(tables.iter().flat_map(|table| numbers(&table["phi"])).collect());
    let mut moving = Moving::new(links).unwrap();
    for case in recorded["cases"].as_array().unwrap() {
        let base = BaseMotion {
            specific_force: vector(&case["base"]["specific_force"]),
            rate: vector(&case["base"]["rate"]),
            angular_acceleration: vector(&case["base"]["change"]),
        };
        moving.set(&numbers(&case["q"]), &numbers(&case["v"]), &numbers(&case["dv"]), &base).unwrap();
        let (rows, columns) = (6 + moving.freedoms(), moving.columns());
        let all = DMatrix::from_row_slice(rows, columns, moving.all_rows().unwrap());
        let wanted = DMatrix::from_row_slice(rows, columns, &numbers(&case["regressor"]));
        // Chains of six links in double precision: some hundred roundings.
        let scale = wanted.abs().max();
        assert!((&all - &wanted).abs().max() < 1e-13 * scale, "{}", (&all - &wanted).abs().max() / scale);
        let forces = DVector::from_vec(numbers(&case["forces"]));
        assert!((&all * &phi - &forces).abs().max() < 1e-12 * forces.abs().max());
        // Base and joint rows alone are the same rows.
        let base_rows = DMatrix::from_row_slice(6, columns, moving.base_rows().unwrap());
        let joint_rows = DMatrix::from_row_slice(rows - 6, columns, moving.joint_rows().unwrap());
        assert_eq!(base_rows, all.rows(0, 6));
        assert_eq!(joint_rows, all.rows(6, rows - 6));
    }
}

/// Model, options, count that must come out.
const COUNTS: [(&str, &[&str], usize); 9] = [
    ("solo12.urdf", &["--floating"], 94),
    ("g1_29dof_rev_1_0.urdf", &["--floating"], 213),
    ("jvrc1.urdf", &["--floating"], 318),
    ("jvrc1.urdf", &["--floating", "--mimic"], 284),
    ("panda.urdf", &["--floating"], 67),
    ("ur5_robot.urdf", &[], 36),
    ("panda.urdf", &["--lock", "panda_finger_joint1,panda_finger_joint2"], 43),
    ("ur5_robot.urdf", &["--rows", "base"], 43),
    ("double_pendulum.urdf", &[], 6),
];

/// Returns what `rigident model base-params` prints of a model.
fn base_parameters(path: &Path, options: &[&str]) -> Vec<u8> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    let output =
        command.args(["model", "base-params"]).arg(path).args(options).arg("--json").output().unwrap();
    assert!(output.status.success(), "{}: {}", path.display(), String::from_utf8_lossy(&output.stderr));
    output.stdout
}

fn robot(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/urdf").join(file)
}

#[test]
#[ignore = "needs ../shared/data"]
fn robots_in_shared_data_have_as_many_base_parameters_as_pinocchio_found() {
    for (file, options, count) in COUNTS {
        let found: Value = serde_json::from_slice(&base_parameters(&robot(file), options)).unwrap();
        assert_eq!(found["count"], count, "{file} {options:?}");
    }
}

/// Rank, and that every row is a combination of ours, by its regressor and numpy's singular values.
#[test]
#[ignore = "needs ../shared/data and Pinocchio in Python"]
fn base_parameters_of_robots_in_shared_data_are_those_of_a_live_pinocchio() {
    let place = tempfile::tempdir().unwrap();
    let answer = place.path().join("answer.json");
    for (file, options, count) in COUNTS {
        let path = robot(file);
        std::fs::write(&answer, base_parameters(&path, options)).unwrap();
        let mut command = Command::new(python());
        let output =
            command.arg(here("check_base.py")).args([&path, &answer]).args(options).output().unwrap();
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        let judged: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(judged["rank"], count, "{file} {options:?}");
        // Regrouping loses nothing: what its rows have outside the span of ours is rounding.
        let outside = judged["outside"].as_f64().unwrap();
        assert!(outside < 1e-11, "{file} {options:?}: {outside}");
    }
}

/// A chain with every kind of joint that URDF and MJCF and Pinocchio's readers of both share.
const CHAIN: &str = r#"<robot name="chain">
<link name="base"><inertial><mass value="3"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.02"/></inertial></link>
<link name="a"><inertial><origin xyz="0.01 0.02 0.15" rpy="0.1 0.2 0.3"/><mass value="4"/><inertia ixx="0.05" ixy="0.001" ixz="0.002" iyy="0.05" iyz="0.003" izz="0.01"/></inertial></link>
<link name="b"><inertial><origin xyz="0.02 -0.01 0.1"/><mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0.001" iyy="0.02" iyz="0" izz="0.004"/></inertial></link>
<link name="plate"><inertial><origin xyz="0 0.1 0"/><mass value="0.5"/><inertia ixx="2e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="1e-3"/></inertial></link>
<link name="c"><inertial><origin xyz="0.02 0 0"/><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0.001" iyy="0.01" iyz="0" izz="0.004"/></inertial></link>
<joint name="ja" type="continuous"><origin xyz="0 0 0.2" rpy="0.3 -0.1 0.2"/><parent link="base"/><child link="a"/><axis xyz="0.6 0 0.8"/></joint>
<joint name="jb" type="prismatic"><origin xyz="0 0 0.3" rpy="0 0 0.4"/><parent link="a"/><child link="b"/><axis xyz="0 0.6 0.8"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="jp" type="fixed"><origin xyz="0.1 0 0.05" rpy="0 1 0"/><parent link="b"/><child link="plate"/></joint>
<joint name="jc" type="continuous"><origin xyz="0 0.1 0.25"/><parent link="b"/><child link="c"/><axis xyz="1 0 0"/></joint>
</robot>"#;

const ASK: &str = r#"
import json, sys
import numpy as np
import pinocchio as pin
path, q, v, a = sys.argv[1], *json.loads(sys.argv[2])
model = pin.buildModelFromMJCF(path) if path.endswith(".xml") else pin.buildModelFromUrdf(path)
model.gravity.linear[:] = [0, 0, -9.80665]
full = []
for joint, angle in zip(list(model.joints)[1:], q):
    full += [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
print(json.dumps(list(pin.rnea(model, model.createData(), np.array(full), np.array(v), np.array(a)))))
"#;

#[test]
#[ignore = "needs Pinocchio in Python"]
fn written_models_have_the_inverse_dynamics_of_a_live_pinocchio() {
    use rigident::model::dynamics::inverse_dynamics;
    use rigident::model::{write, xml::Language};
    let given = write::parse(CHAIN, "chain").unwrap().model;
    // Other parameters than the file's, written into it and into new files.
    let changed = given.links.iter().map(|l| (l.name.as_str(), l.nominal.unwrap().map(|v| 1.25 * v)));
    let model = write::with_parameters(&given, changed);
    let place = tempfile::tempdir().unwrap();
    let (q, v, a) = ([0.5, -0.3, 1.2], [0.7, 0.4, -1.1], [2.0, -1.5, 0.8]);
    let wanted = inverse_dynamics(&model, &BaseMotion::still([0.0, 0.0, -9.80665]), &q, &v, &a).unwrap();
    let texts = [
        ("edited.urdf", write::edited(&model, CHAIN, "chain").unwrap()),
        ("new.urdf", write::generated(&model, Language::Urdf).unwrap()),
        ("new.xml", write::generated(&model, Language::Mjcf).unwrap()),
    ];
    for (name, text) in texts {
        let path = place.path().join(name);
        std::fs::write(&path, text).unwrap();
        let output = Command::new(python())
            .args(["-c", ASK])
            .arg(&path)
            .arg(serde_json::json!([q, v, a]).to_string())
            .output()
            .unwrap();
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let got = numbers(&serde_json::from_slice(&output.stdout).unwrap());
        assert_eq!(got.len(), 3);
        for (a, b) in got.iter().zip(&wanted[6..]) {
            assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{name}: {got:?} {wanted:?}");
        }
    }
}

/// A torso with a leg whose thigh has the joints `hip`, as MuJoCo's files have them.
fn leg(hip: &str) -> String {
    format!(
        "<mujoco model=\"leg\"><compiler angle=\"degree\"/><worldbody><body name=\"torso\" pos=\"0 0 1.3\"><freejoint/>
           <inertial pos=\"0.01 0.02 0.1\" mass=\"8\" fullinertia=\"0.2 0.25 0.15 0.01 0.02 0.01\"/>
           <body name=\"thigh\" pos=\"0 -0.1 -0.04\" euler=\"10 0 20\">{hip}
             <inertial pos=\"0.01 0.01 -0.17\" mass=\"4\" fullinertia=\"0.06 0.05 0.02 0.001 0.002 0.003\"/>
             <body name=\"shin\" pos=\"0 0.01 -0.4\"><joint name=\"knee\" type=\"hinge\" pos=\"0 0 0.02\" axis=\"0 -1 0\"/>
               <inertial pos=\"0 0.01 -0.15\" mass=\"2\" fullinertia=\"0.03 0.03 0.01 0.001 0.001 0.002\"/>
         </body></body></body></worldbody></mujoco>"
    )
}

const RANK: &str = r#"
import sys
import numpy as np
import pinocchio as pin
model = pin.buildModelFromMJCF(sys.argv[1])
data, rng, rows = model.createData(), np.random.default_rng(1), []
for _ in range(40):
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-2, 2, model.nv))
    v, a = rng.uniform(-3, 3, model.nv), rng.uniform(-9, 9, model.nv)
    rows.append(pin.computeJointTorqueRegressor(model, data, q, v, a)[:6].copy())
s = np.linalg.svd(np.vstack(rows), compute_uv=False)
print(int((s > 1e-10 * s[0]).sum()))
"#;

/// Legs whose hips have several joints, and how many base parameters the six base rows tell apart.
fn legs() -> [(String, usize); 4] {
    let hinge = |name: &str, axis: &str, pos: &str| {
        format!("<joint name=\"{name}\" type=\"hinge\" axis=\"{axis}\" pos=\"{pos}\"/>")
    };
    let three = |pos: &str| hinge("x", "1 0 0", pos) + &hinge("z", "0 0 1", pos) + &hinge("y", "0 1 0", pos);
    let slide = "<joint name=\"out\" type=\"slide\" axis=\"0 1 1\"/>";
    [
        (leg(&three("0 0 0.01")), 26),
        (leg(&(hinge("a", "1 0 0", "0 0 0") + &hinge("b", "0 1 0", "0 0 0"))), 26),
        (leg(&(hinge("a", "1 0 0", "0 0 0") + &hinge("b", "0 1 0", "0.02 0 0.05"))), 27),
        (leg(&(slide.to_owned() + &three("0 0.02 0"))), 27),
    ]
}

#[test]
fn bodies_with_several_joints_have_as_many_base_parameters_as_pinocchio_found() {
    let place = tempfile::tempdir().unwrap();
    for (text, count) in legs() {
        let path = place.path().join("leg.xml");
        std::fs::write(&path, &text).unwrap();
        let found: Value = serde_json::from_slice(&base_parameters(&path, &["--floating"])).unwrap();
        assert_eq!((&found["count"], &found["standard"]), (&count.into(), &30.into()), "{text}");
    }
}

/// Pinocchio makes one composite joint of them.
#[test]
#[ignore = "needs Pinocchio in Python"]
fn bodies_with_several_joints_have_the_rank_of_a_live_pinocchio_s_regressor() {
    let place = tempfile::tempdir().unwrap();
    for (text, count) in legs() {
        let path = place.path().join("leg.xml");
        std::fs::write(&path, &text).unwrap();
        let output = Command::new(python()).args(["-c", RANK]).arg(&path).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), count.to_string(), "{text}");
    }
}
