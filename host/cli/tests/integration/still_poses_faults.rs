//! Still poses by gravity columns with one wrong axis or unit: nothing gets a number, and the fault is named.
//!
//! The poses are made here, from weight and lever alone.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::program::{json, rigident, said};

const MASS_KG: f64 = 7.4;
const CENTRE_M: [f64; 3] = [0.012, -0.008, 0.094];
const OFFSET: [f64; 6] = [3.1, -1.7, 5.5, 0.11, -0.07, 0.03];

/// Pseudo-random numbers between −1 and 1.
struct Drawn(u64);

impl Drawn {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Returns a wrench with its offset and noise where gravity is this in S.
fn wrench(gravity: [f64; 3], mass_kg: f64, noise: [f64; 2], drawn: &mut Drawn) -> [f64; 6] {
    let [fx, fy, fz] = gravity.map(|g| -mass_kg * g);
    let [cx, cy, cz] = CENTRE_M;
    let mut wrench = [fx, fy, fz, cy * fz - cz * fy, cz * fx - cx * fz, cx * fy - cy * fx];
    for (k, load) in wrench.iter_mut().enumerate() {
        *load += OFFSET[k] + noise[k / 3] * drawn.next();
    }
    wrench
}

/// Returns a vector of unit length in any direction.
fn direction<const N: usize>(drawn: &mut Drawn) -> [f64; N] {
    let length = |v: &[f64; N]| v.iter().map(|x| x * x).sum::<f64>();
    let all = std::iter::repeat_with(|| std::array::from_fn(|_| drawn.next()));
    let found = all.into_iter().find(|v| (0.2..1.0).contains(&length(v))).unwrap();
    found.map(|x| x / length(&found).sqrt())
}

/// Gravity and wrench of each pose: nine readings.
fn poses(count: usize, noise: [f64; 2], mass_kg: f64) -> Vec<[f64; 9]> {
    let mut drawn = Drawn(7);
    let pose = |_| {
        let gravity = direction(&mut drawn).map(|x| 9.80665 * x);
        let own = wrench(gravity, mass_kg, noise, &mut drawn);
        std::array::from_fn(|k| if k < 3 { gravity[k] } else { own[k - 3] })
    };
    (0..count).map(pose).collect()
}

/// Attitude, w, x, y, z of S to axes with z up, and wrench of each pose: ten readings.
fn attitudes(count: usize) -> Vec<[f64; 10]> {
    let mut drawn = Drawn(11);
    let pose = |_| {
        let [w, x, y, z] = direction(&mut drawn);
        let down = [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)];
        let own = wrench(down.map(|up| -9.80665 * up), MASS_KG, [0.05, 2e-3], &mut drawn);
        std::array::from_fn(|k| if k < 4 { [w, x, y, z][k] } else { own[k - 4] })
    };
    (0..count).map(pose).collect()
}

fn identify<const N: usize>(at: &Path, name: &str, poses: &[[f64; N]]) -> Value {
    let (columns, key) = match N {
        9 => ("gx_mps2,gy_mps2,gz_mps2", ""),
        _ => ("qw,qx,qy,qz", "attitude_wxyz = [\"qw\", \"qx\", \"qy\", \"qz\"]\n"),
    };
    let mut text = format!("{columns},fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n");
    for pose in poses {
        let cells = pose.map(|v| format!("{v:.5}"));
        text += &(cells.join(",") + "\n");
    }
    fs::write(at.join(format!("{name}.csv")), text).unwrap();
    fs::write(at.join(format!("{name}.rig.toml")), format!("[recording]\nstatic = true\n{key}")).unwrap();
    let output =
        rigident(at, &["identify", &format!("{name}.csv"), "--json", "--out", &format!("{name}.out")]);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{name}: {}", said(&output));
    json(&output)
}

/// Asserts that nothing has a number and that a cause is named.
fn assert_named(result: &Value, name: &str, cause: &str) {
    assert_eq!(result["status"], "implausible", "{name}");
    let parameters = result["parameters"].as_array().unwrap();
    assert!(!parameters.is_empty() && parameters.iter().all(|p| !p["value"].is_number()), "{name}");
    let found = &result["cause"];
    assert!(format!("{} {}", found["what"], found["alternatives"]).contains(cause), "{name}: {found}");
}

fn reversed(pose: &mut [f64; 9], at: usize) {
    pose[at] = -pose[at];
}

type Fault = (&'static str, fn(&mut [f64; 9]), &'static str);

const FAULTS: [Fault; 10] = [
    ("gx", |p| reversed(p, 0), "the gravity vector has x reversed"),
    ("gy", |p| reversed(p, 1), "the gravity vector has y reversed"),
    ("gz", |p| reversed(p, 2), "the gravity vector has z reversed"),
    ("fx", |p| reversed(p, 3), "the force has x reversed"),
    ("fz", |p| reversed(p, 5), "the force has z reversed"),
    ("my", |p| reversed(p, 7), "the moment has y reversed"),
    ("gravity-swapped", |p| p.swap(0, 1), "the gravity vector has x and y swapped"),
    ("moments-swapped", |p| p.swap(6, 7), "the moment has x and y swapped"),
    ("turned", |p| (p[0], p[1]) = (p[1], -p[0]), "the gravity vector is turned by 90° about z"),
    ("n-mm", |p| p[6..].iter_mut().for_each(|m| *m *= 1000.0), "the moment is in N mm"),
];

#[test]
fn a_wrong_axis_of_still_poses_is_named_and_nothing_gets_a_number() {
    let place = tempfile::tempdir().unwrap();
    let right = poses(12, [0.05, 2e-3], MASS_KG);
    for (name, fault, cause) in FAULTS {
        let mut wrong = right.clone();
        wrong.iter_mut().for_each(fault);
        let result = identify(place.path(), name, &wrong);
        assert_named(&result, name, cause);
    }
}

/// The change of a pose by attitude, with its name and cause.
type Turn = (&'static str, fn(&mut [f64; 10]), &'static str);

const TURNS: [Turn; 4] = [
    ("xyzw", |p| p[..4].rotate_left(1), "the attitudes are in the order x, y, z, w"),
    ("inverse", |p| p[1..4].iter_mut().for_each(|v| *v = -*v), "the attitudes are the inverse ones"),
    (
        "cell",
        |p| [4, 7].into_iter().for_each(|k| (p[k], p[k + 1]) = (p[k + 1], -p[k])),
        "turned by 90° about z",
    ),
    ("halves", |p| p[4..].rotate_left(3), "force and moment are exchanged"),
];

#[test]
fn attitudes_of_another_order_or_frame_are_named_and_right_ones_are_not() {
    let place = tempfile::tempdir().unwrap();
    let right = attitudes(12);
    assert_ne!(identify(place.path(), "right", &right)["status"], "implausible");
    for (name, fault, cause) in TURNS {
        let mut wrong = right.clone();
        wrong.iter_mut().for_each(fault);
        assert_named(&identify(place.path(), name, &wrong), name, cause);
    }
}

#[test]
fn right_poses_and_poses_of_a_noisy_cell_are_not_accused() {
    let place = tempfile::tempdir().unwrap();
    for (name, noise, mass_kg) in
        [("right", [0.05, 2e-3], MASS_KG), ("noisy", [2.0, 0.2], MASS_KG), ("light", [0.2, 0.01], 0.04)]
    {
        let result = identify(place.path(), name, &poses(12, noise, mass_kg));
        assert_ne!(result["status"], "implausible", "{name}: {}", result["warnings"]);
        // Of what is not identified nothing rests on anything.
        let says = result["notes"].to_string().contains("sign of all moments");
        assert_eq!(says, result["status"] != "not_identified", "{name}: {}", result["notes"]);
    }
}
