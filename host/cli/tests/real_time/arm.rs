//! An arm of Universal Robots as the platform: its driver, planned and run from two commands, and a client of
//! another maker.

use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use hexapod::{Axis, Geometry, MotionProgram, Pose, Segment, SineTerm};
use rigident::plan::machine;
use rigident::rig::RigFile;
use rigident_sim::serve::ur::{self, UrServer};

use super::runs::{run_at, said};
use super::{Served, python};

/// A rig on an arm.
pub struct OnArm {
    // Its controller goes before the rig.
    pub arm: UrServer,
    pub served: Served,
    pub geometry: Geometry,
}

impl OnArm {
    pub fn new() -> Self {
        Self::at("127.0.0.1:0", "127.0.0.1:0")
    }

    pub fn at(rtde: &str, script: &str) -> Self {
        let served = Served::bare(ur::rig());
        std::fs::write(served.path(ur::MODEL), ur::urdf()).unwrap();
        let rig = RigFile::load(&served.path("rig.toml")).unwrap();
        let geometry = machine::geometry(&rig).unwrap();
        let report = |said: &str| eprintln!("the arm: {said}");
        let arm = UrServer::listen([rtde, script], Arc::clone(&served.rig), report).unwrap();
        Self { arm, served, geometry }
    }
}

pub fn swing(seconds: f64) -> MotionProgram {
    let term = |axis, amplitude, frequency_hz| SineTerm { axis, amplitude, frequency_hz, phase_rad: 0.4 };
    MotionProgram {
        start: Pose { position_m: [0.02, 0.0, 0.01], rpy_rad: [0.0; 3] },
        segments: vec![Segment::Multisine {
            duration_s: seconds,
            ramp_s: 1.0,
            terms: vec![
                term(Axis::Z, 0.02, 0.8),
                term(Axis::Roll, 0.12, 0.6),
                term(Axis::Pitch, 0.1, 0.9),
                term(Axis::Yaw, 0.1, 0.5),
            ],
        }],
    }
}

/// The plan and the run, as the simulator and the README say them.
#[test]
fn a_body_on_an_arm_is_identified_from_two_commands() {
    let on = OnArm::new();
    let served = &on.served;
    let plan = served.path("motion.json");
    let output = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .args(["plan", "motion", "--duration-s", "30", "--rig"])
        .arg(served.path("rig.toml"))
        .arg("--out")
        .arg(&plan)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let shown = String::from_utf8_lossy(&output.stdout).into_owned();
    for words in ["joint rate, rad/s", "joint acceleration, rad/s²", "mass at the flange, kg"] {
        assert!(shown.contains(words), "{shown}");
    }
    let more = ["--yes", "--json", "--plan", plan.to_str().unwrap()];
    let output = run_at(served, &on.arm.url(), "out", &more).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let all = said(&output);
    for words in ["an arm: it is running", "joint rate up to", "NOT checked: torques of the arm's joints"] {
        assert!(all.contains(words), "{words}\n{all}");
    }
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["status"], "identified", "{}", said(&output));
    let truth = ur::rig().body;
    let parameters = result["parameters"].as_array().unwrap();
    let of = |name: &str| {
        let found =
            parameters.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name}: {result}"));
        (found["value"].as_f64().unwrap(), found["u95"].as_f64().unwrap())
    };
    // Intervals of 95 %, of which four are looked at: 4.5 standard deviations.
    let sure = 4.5 / 1.96;
    let (mass, u95) = of("m");
    eprintln!("mass {mass:.4} ± {u95:.4} kg, true {}", truth.mass_kg);
    assert!((mass - truth.mass_kg).abs() < sure * u95 && u95 < 0.02, "{mass} ± {u95}, {}", truth.mass_kg);
    let three = |name: &str| -> Vec<f64> {
        result[name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let (centre, u95) = (three("com_m"), three("com_u95_m"));
    eprintln!("centre {centre:.5?} ± {u95:.5?} m, true {:?}", truth.com_m);
    for k in 0..3 {
        let off = (centre[k] - truth.com_m[k]).abs();
        assert!(off < sure * u95[k] && u95[k] < 2e-3, "{centre:?} ± {u95:?}");
    }
    assert!(result["tracking"]["samples"].as_u64().unwrap() > 400);
}

/// `ur_rtde` of PyPI, which knows nothing of this project, reads the simulated controller and writes its
/// registers.
#[test]
#[ignore = "needs NetFT and ur_rtde in Python"]
fn independent_sensors_client_of_another_maker_reads_the_arm_and_writes_its_registers() {
    // Its ports are fixed; of this address nobody else has them.
    let on = OnArm::at("127.0.0.78:30004", "127.0.0.78:30002");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/real_time/arm_client.py");
    let out = Command::new(python()).arg(script).arg("127.0.0.78").output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let said: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let [q, _] = on.arm.joints();
    for k in 0..6 {
        assert!((said["q"][k].as_f64().unwrap() - q[k]).abs() < 1e-12, "{said}");
    }
    assert_eq!(
        (&said["robot_mode"], &said["safety_mode"], &said["runtime_state"]),
        (&7.into(), &1.into(), &1.into())
    );
    // Its own program has brought the inputs that it wrote to outputs.
    assert_eq!((&said["integer"], &said["double"]), (&4321.into(), &0.625.into()));
}
