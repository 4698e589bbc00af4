//! Robot descriptions that others published, read as Pinocchio reads them.
//!
//! The wheel `example-robot-data` has 69 URDFs; `pinocchio/robots.py` asks Pinocchio. `RIGIDENT_PYTHON` (or
//! `python3`) must have both, which `cargo xtask setup` installs.

use crate::program::python;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use rigident::model::inertial::impossibility;
use rigident::model::passive::Passive;
use rigident::model::{Model, urdf, write};
use rigident_shared::tree::Joint;
use serde_json::Value;

/// Returns what Pinocchio says of texts, or of all published robots if there are none.
fn asked(texts: &[String]) -> Vec<(String, Option<Value>)> {
    let python = python();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/pinocchio/robots.py");
    let piped = || (Stdio::piped(), Stdio::piped());
    let (stdin, stdout) = piped();
    let mut child =
        Command::new(python).arg(script).stdin(stdin).stdout(stdout).stderr(Stdio::null()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(serde_json::to_string(texts).unwrap().as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    let items: Vec<(String, Value)> = serde_json::from_slice(&output.stdout).unwrap();
    items.into_iter().map(|(what, said)| (what, Some(said).filter(|said| !said.is_null()))).collect()
}

/// Compares freedoms and the inertias of all bodies with Pinocchio's.
fn compare(model: &Model, pinocchio: &Value, what: &str) {
    assert_eq!(model.freedoms() as u64, pinocchio["nv"].as_u64().unwrap(), "{what}");
    let bodies = pinocchio["bodies"].as_object().unwrap();
    let moving: Vec<_> = model.welded().links;
    assert_eq!(moving.iter().filter(|link| link.is_body()).count(), bodies.len(), "{what}");
    for link in moving.iter().filter(|link| link.is_body()) {
        let said: Vec<f64> =
            bodies[&link.joint_name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        // Theirs goes by columns of the upper triangle.
        let wanted = [0, 1, 2, 3, 4, 6, 9, 8, 7, 5].map(|k| said[k]);
        let own = link.nominal.unwrap_or_default();
        for (k, (a, b)) in own.iter().zip(wanted).enumerate() {
            // Sums of a few dozen links: roundings of the largest number of their kind.
            let range = if k == 0 {
                0..1
            } else if k < 4 {
                1..4
            } else {
                4..10
            };
            let scale = wanted[range].iter().fold(wanted[0].abs(), |m, v| m.max(v.abs()));
            assert!((a - b).abs() <= 1e-12 * scale, "{what}: {} {k}: {a} {b}", link.name);
        }
    }
}

#[test]
#[ignore = "needs Pinocchio and example-robot-data in Python"]
fn published_robots_that_pinocchio_reads_are_read_with_the_same_inertias() {
    let all = asked(&[]);
    let place = tempfile::tempdir().unwrap();
    let (mut read, mut odd, mut repaired) = (0, 0, 0);
    for (path, said) in &all {
        let Some(said) = said else { continue };
        let model = urdf::read(Path::new(path)).unwrap_or_else(|error| panic!("{error}"));
        compare(&model, said, path);
        read += 1;
        let (possible, found) = model.possible();
        odd += usize::from(!found.is_empty());
        let is_body = |phi: &Option<_>| phi.as_ref().is_none_or(|phi| impossibility(phi).is_none());
        repaired += usize::from(!found.is_empty() && possible.iter().all(is_body));
        // With repaired inertias and friction they are written as they are stored.
        let names: Vec<&str> = model.links.iter().map(|link| link.name.as_str()).collect();
        let new = names.iter().zip(&possible).filter_map(|(name, phi)| Some((*name, (*phi)?)));
        let damped = model.links.iter().map(|link| {
            (link.joint_name.as_str(), Passive { damping: 0.125, friction: 0.25, ..link.passive[0] })
        });
        let changed = write::with_passive(&write::with_parameters(&model, new), damped);
        let target = place.path().join(format!("{read}.urdf"));
        write::write(&changed, Some(Path::new(path)), &target).unwrap_or_else(|error| panic!("{error}"));
    }
    // One has a <robot> without a name and holds nothing.
    assert_eq!((all.len(), read), (69, 68));
    // Negative moments of whole bodies are not repaired.
    assert_eq!((odd, repaired), (29, 27));
}

/// Parts of a joint of this type, and of the link that it holds.
const ODD: [(&str, &str, &str); 24] = [
    ("planar", "", ""),
    ("planar", "<axis xyz=\"0 1 0\"/>", ""),
    ("floating", "", ""),
    ("fixed", "<mimic joint=\"j\"/>", ""),
    ("continuous", "<mimic joint=\"j\"/>", ""),
    ("continuous", "<mimic joint=\"nowhere\"/>", ""),
    ("planar", "<mimic joint=\"j\"/>", ""),
    ("continuous", "<dynamics damping=\"1\"/>", ""),
    ("continuous", "<dynamics friction=\"1\"/>", ""),
    ("continuous", "", "<inertial/>"),
    ("continuous", "", "<inertial><mass value=\"1\"/></inertial>"),
    (
        "continuous",
        "",
        "<inertial><mass/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>",
    ),
    ("continuous", "", "<inertial><mass value=\"many\"/></inertial>"),
    (
        "continuous",
        "",
        "<inertial><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>",
    ),
    ("continuous", "", "<visual/>"),
    ("continuous", "", "<collision><geometry/></collision>"),
    ("continuous", "", "<visual><geometry><box size=\"a b c\"/></geometry></visual>"),
    ("continuous", "", "<visual><geometry><box/></geometry></visual>"),
    ("continuous", "", "<visual><geometry><cylinder radius=\"1\"/></geometry></visual>"),
    ("continuous", "", "<visual><geometry><mesh/></geometry></visual>"),
    ("continuous", "", "<visual><geometry><cone/></geometry></visual>"),
    ("continuous", "", "<visual><origin xyz=\"0 0\"/><geometry><sphere radius=\"1\"/></geometry></visual>"),
    (
        "continuous",
        "",
        "<visual><geometry><sphere radius=\"1\"/></geometry><material \
         name=\"m\"><texture/></material></visual>",
    ),
    ("continuous", "", "<visual><geometry><sphere radius=\"1\"/></geometry><material/></visual>"),
];

#[test]
#[ignore = "needs Pinocchio in Python"]
fn odd_descriptions_that_a_live_pinocchio_reads_are_read() {
    let text = |(kind, joint, link): &(&str, &str, &str)| {
        format!(
            "<robot name=\"r\"><link name=\"a\"/><link name=\"b\">{link}</link><joint name=\"j\" \
             type=\"{kind}\"><parent link=\"a\"/><child link=\"b\"/>{joint}</joint></robot>"
        )
    };
    let loose = [
        "<sensor:camera x:y=\"1\"/>",
        "<!-- a -- b -->",
        "<gazebo>a & b &deg;</gazebo>",
        "<material><texture/></material>",
    ];
    let good = text(&("continuous", "", ""));
    let loose = loose.map(|part| good.replace("<robot name=\"r\">", &format!("<robot name=\"r\">{part}")));
    let others = [format!("\n<?xml version=\"1.0\"?>{good}"), format!("<!DOCTYPE robot>{good}")];
    let texts: Vec<String> = ODD.iter().map(text).chain(loose).chain(others).collect();
    for (text, said) in asked(&texts) {
        let said = said.unwrap_or_else(|| panic!("Pinocchio does not read {text}"));
        let model = urdf::parse(&text, "odd").unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(model.freedoms() as u64, said["nv"].as_u64().unwrap(), "{text}");
        let moving = model.links.iter().filter(|link| link.link.joint != Joint::Fixed);
        let mass: f64 = moving.filter_map(|link| Some(link.nominal?[0])).sum();
        let bodies = said["bodies"].as_object().unwrap();
        let wanted: f64 = bodies.values().map(|own| own[0].as_f64().unwrap()).sum();
        assert_eq!(mass, wanted, "{text}");
    }
}
