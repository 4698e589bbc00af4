//! The time that rows and base parameters take, and that which Pinocchio takes for the same.
//!
//! Lives here: the trees that are timed, ours and theirs under one clock in one run. Pinocchio's figure is
//! its `computeJointTorqueRegressor`, called from Python, less the same call on an empty model: so what
//! Python costs is out.

use std::fmt::Write as _;
use std::hint::black_box;
use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::Instant;

use nalgebra::Vector3;
use rigident_shared::tree::{BaseMotion, TreeError};

use super::base::{Rows, Situation, base_parameters};
use super::dynamics::regressor_by_unit_changes;
use super::finding::ModelError;
use super::rows::Moving;
use super::tree::Model;

/// The script that asks Pinocchio.
const SCRIPT: &str = include_str!("speed_pinocchio.py");
/// Each figure is the best of this many: what else runs only slows down.
const TRIES: usize = 25;
/// Calls in a try.
const CALLS: usize = 200;

/// A figure of one model.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// Degrees of freedom, the base's six included where it moves.
    pub freedoms: usize,
    /// One call of motion and rows, µs.
    pub regressor_us: f64,
    /// One call of the rows by a unit change of each parameter of inverse dynamics, µs.
    pub unit_changes_us: f64,
    /// Base parameters from scratch, both ways, ms.
    pub base_parameters_ms: f64,
    /// The number of them.
    pub count: usize,
}

fn best(tries: usize, mut job: impl FnMut()) -> f64 {
    let seconds = (0..tries).map(|_| {
        let started = Instant::now();
        job();
        started.elapsed().as_secs_f64()
    });
    seconds.fold(f64::INFINITY, f64::min)
}

/// Times a model: all rows of a moving base, joint rows of one held still.
///
/// # Errors
/// [`ModelError`] if it has no base parameters.
pub fn time(model: &Model, floating: bool) -> Result<Timed, ModelError> {
    let welded = model.welded();
    let refuse = |e: TreeError| ModelError::Structure { what: model.name.clone(), problem: format!("{e:?}") };
    let mut moving = Moving::new(welded.tree()).map_err(refuse)?;
    let number = |k: usize| ((k * 37 + 11) % 41) as f64 / 41.0 + 0.1;
    let q: Vec<f64> = (0..moving.coordinates()).map(number).collect();
    let v: Vec<f64> = (0..moving.freedoms()).map(|k| number(k + 5)).collect();
    let dv: Vec<f64> = (0..moving.freedoms()).map(|k| number(k + 9)).collect();
    let base = BaseMotion {
        specific_force: Vector3::new(0.3, -0.2, 9.7),
        rate: Vector3::new(0.1, 0.2, -0.3),
        angular_acceleration: Vector3::new(-0.4, 0.5, 0.6),
    };
    let still = BaseMotion::still([0.0, 0.0, -9.80665]);
    let mut failed = None;
    let seconds = best(TRIES, || {
        for _ in 0..CALLS {
            let done = if floating {
                moving
                    .set(black_box(&q), black_box(&v), black_box(&dv), &base)
                    .and_then(|()| moving.all_rows().map(|rows| black_box(rows)[0]))
            } else {
                moving
                    .set(black_box(&q), black_box(&v), black_box(&dv), &still)
                    .and_then(|()| moving.joint_rows().map(|rows| black_box(rows)[0]))
            };
            failed = failed.or(done.err());
        }
    });
    if let Some(error) = failed {
        return Err(refuse(error));
    }
    let motion = if floating { &base } else { &still };
    let unit_changes_s = best(5, || {
        let _ = black_box(regressor_by_unit_changes(&welded, motion, black_box(&q), &v, &dv));
    });
    let rows = if floating { Rows::Base } else { Rows::Joint };
    let situation = Situation { floating, rows, mimic: false };
    let count = base_parameters(model, &situation)?.parameters.len();
    let base_parameters_s = best(5, || {
        let _ = black_box(base_parameters(black_box(model), &situation));
    });
    Ok(Timed {
        freedoms: moving.freedoms() + if floating { 6 } else { 0 },
        regressor_us: seconds / CALLS as f64 * 1e6,
        unit_changes_us: unit_changes_s * 1e6,
        base_parameters_ms: base_parameters_s * 1e3,
        count,
    })
}

/// Returns a tree of the size and shape of a kind of robot, as URDF: limbs of the given number of revolute
/// joints each, the first ones of which may hang on the end of the first limb.
fn limbs(name: &str, limbs: &[(usize, bool)]) -> String {
    let mut links = String::new();
    let mut joints = String::new();
    let link = |out: &mut String, name: &str| {
        let _ = writeln!(
            out,
            "<link name=\"{name}\"><inertial><origin xyz=\"0.01 0.02 0.1\"/><mass value=\"2\"/><inertia \
             ixx=\"0.02\" iyy=\"0.025\" izz=\"0.01\" ixy=\"0.001\" ixz=\"0.002\" \
             iyz=\"-0.001\"/></inertial></link>"
        );
    };
    link(&mut links, "base");
    let mut end_of_first = "base".to_owned();
    for (limb, (length, on_first)) in limbs.iter().enumerate() {
        let mut parent = if *on_first { end_of_first.clone() } else { "base".to_owned() };
        for k in 0..*length {
            let child = format!("limb{limb}_{k}");
            link(&mut links, &child);
            let axis = ["0 0 1", "0 1 0", "1 0 0"][(k + limb) % 3];
            let (x, y) = (0.03 * (k as f64 - 1.0), 0.02 * (limb as f64 - 1.5));
            let _ = writeln!(
                joints,
                "<joint name=\"{child}_joint\" type=\"continuous\"><origin xyz=\"{x} {y} 0.21\" rpy=\"0.1 \
                 {y} {x}\"/><parent link=\"{parent}\"/><child link=\"{child}\"/><axis \
                 xyz=\"{axis}\"/></joint>"
            );
            parent = child;
        }
        if limb == 0 {
            end_of_first = parent;
        }
    }
    format!("<robot name=\"{name}\">\n{links}{joints}</robot>\n")
}

/// Returns the trees that are timed when no model is named: name, URDF, and whether the base moves.
pub fn shapes() -> Vec<(&'static str, String, bool)> {
    // The humanoid: two joints of the waist with two arms of seven and a neck of two on them, two legs of
    // six, and two grippers' worth of single joints.
    let humanoid = [(2, false), (8, true), (8, true), (2, true), (6, false), (6, false)];
    vec![
        ("arm6", limbs("arm6", &[(6, false)]), false),
        ("arm7", limbs("arm7", &[(7, false)]), false),
        ("quadruped18", limbs("quadruped18", &[(3, false); 4]), true),
        ("humanoid38", limbs("humanoid38", &humanoid), true),
    ]
}

/// One model for Pinocchio.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Asked {
    /// File of its URDF.
    pub path: String,
    /// True if the base moves.
    pub floating: bool,
}

/// Pinocchio's version, and for every model degrees of freedom and µs of a call.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
pub struct Pinocchio {
    /// Version of Pinocchio.
    pub version: String,
    /// One entry for each model.
    pub models: Vec<(usize, f64)>,
}

/// Times Pinocchio.
///
/// # Errors
/// Returns in words why it cannot be timed.
pub fn pinocchio(python: &str, models: &[Asked]) -> Result<Pinocchio, String> {
    let text = serde_json::to_string(models).map_err(|e| e.to_string())?;
    let mut child = Command::new(python)
        .args(["-c", SCRIPT])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| format!("{python}: {e}"))?;
    if let Some(mut input) = child.stdin.take() {
        input.write_all(text.as_bytes()).map_err(|e| e.to_string())?;
    }
    let output = child.wait_with_output().map_err(|e| e.to_string())?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{python}: {}", said.lines().last().unwrap_or_default()));
    }
    serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())
}
