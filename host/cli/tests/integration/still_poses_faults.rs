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

/// Gravity and wrench of each pose: nine readings.
fn poses(count: usize, noise: [f64; 2], mass_kg: f64) -> Vec<[f64; 9]> {
    let mut drawn = Drawn(7);
    let pose = |_| {
        let direction = std::iter::repeat_with(|| [drawn.next(), drawn.next(), drawn.next()])
            .find(|v| (0.2..1.0).contains(&v.iter().map(|x| x * x).sum::<f64>()))
            .unwrap();
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [gx, gy, gz] = direction.map(|x| 9.80665 * x / length);
        let [fx, fy, fz] = [gx, gy, gz].map(|g| -mass_kg * g);
        let [cx, cy, cz] = CENTRE_M;
        let wrench = [fx, fy, fz, cy * fz - cz * fy, cz * fx - cx * fz, cx * fy - cy * fx];
        let mut reading = [gx, gy, gz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for (k, load) in wrench.into_iter().enumerate() {
            reading[3 + k] = load + OFFSET[k] + noise[k / 3] * drawn.next();
        }
        reading
    };
    (0..count).map(pose).collect()
}

fn identify(at: &Path, name: &str, poses: &[[f64; 9]]) -> Value {
    let mut text = "gx_mps2,gy_mps2,gz_mps2,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n".to_owned();
    for pose in poses {
        let cells = pose.map(|v| format!("{v:.5}"));
        text += &(cells.join(",") + "\n");
    }
    fs::write(at.join(format!("{name}.csv")), text).unwrap();
    fs::write(at.join(format!("{name}.rig.toml")), "[recording]\nstatic = true\n").unwrap();
    let output =
        rigident(at, &["identify", &format!("{name}.csv"), "--json", "--out", &format!("{name}.out")]);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{name}: {}", said(&output));
    json(&output)
}

fn reversed(pose: &mut [f64; 9], at: usize) {
    pose[at] = -pose[at];
}

type Fault = (&'static str, fn(&mut [f64; 9]), &'static str);

const FAULTS: [Fault; 10] = [
    ("gx", |p| reversed(p, 0), "the gravity columns has x reversed"),
    ("gy", |p| reversed(p, 1), "the gravity columns has y reversed"),
    ("gz", |p| reversed(p, 2), "the gravity columns has z reversed"),
    ("fx", |p| reversed(p, 3), "the force has x reversed"),
    ("fz", |p| reversed(p, 5), "the force has z reversed"),
    ("my", |p| reversed(p, 7), "the moment has y reversed"),
    ("gravity-swapped", |p| p.swap(0, 1), "the gravity columns has x and y swapped"),
    ("moments-swapped", |p| p.swap(6, 7), "the moment has x and y swapped"),
    ("turned", |p| (p[0], p[1]) = (p[1], -p[0]), "the gravity columns is turned by 90° about z"),
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
        assert_eq!(result["status"], "implausible", "{name}");
        let numbers =
            result["parameters"].as_array().unwrap().iter().filter(|p| p["state"]["value"].is_number());
        assert_eq!(numbers.count(), 0, "{name}");
        let found = &result["cause"];
        assert!(format!("{} {}", found["what"], found["alternatives"]).contains(cause), "{name}: {found}");
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
