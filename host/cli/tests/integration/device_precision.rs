//! Recordings with next to no noise through the device, which counts in single precision.
#![cfg(feature = "simulator")]

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

const MASS: f64 = 3.2;
const COM: [f64; 3] = [0.02, -0.01, 0.08];

/// Three sums of sines with their derivatives, angles of 0.3 to 0.9 rad each.
fn sines(t: f64, first: usize) -> (Vector3<f64>, Vector3<f64>) {
    let mut out = (Vector3::zeros(), Vector3::zeros());
    for axis in 0..3 {
        for k in 0..3 {
            let n = (first + 3 * axis + k) as f64;
            let (size, w) = (0.3 + 0.2 * (1.7 * n).sin().abs(), 1.0 + 5.0 * (2.3 * n).sin().abs());
            out.0[axis] += size * (w * t + n).sin();
            out.1[axis] += size * w * (w * t + n).cos();
        }
    }
    out
}

/// Half a minute of a rigid body by Newton and Euler about S, to the last digit of double precision.
fn exact_recording() -> String {
    let com = Vector3::from(COM);
    let central = Matrix3::new(0.02, 0.001, 0.0, 0.001, 0.03, 0.002, 0.0, 0.002, 0.015);
    let inertia = central + (Matrix3::identity() * com.dot(&com) - com * com.transpose()) * MASS;
    let mut text =
        "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,imu_gy_radps,\
                    imu_gz_radps\n"
            .to_owned();
    for k in 0..6000 {
        let t = f64::from(k) / 200.0;
        let (w, dw) = sines(t, 0);
        let a = sines(t, 20).0 * 3.0 + Vector3::new(0.0, 0.0, 9.81);
        let force = (a + dw.cross(&com) + w.cross(&w.cross(&com))) * MASS + Vector3::new(1.0, 2.0, -3.0);
        let moment =
            com.cross(&a) * MASS + inertia * dw + w.cross(&(inertia * w)) + Vector3::new(0.1, 0.2, -0.1);
        let numbers: Vec<String> =
            [force, moment, a, w].iter().flat_map(|v| v.iter().map(f64::to_string)).collect();
        writeln!(text, "{t},{}", numbers.join(",")).unwrap();
    }
    text
}

fn answer(folder: &Path, line: &str) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(folder)
        .args(line.split(' '))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{line}: {said}");
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{line}: {e}: {said}"))
}

fn value(found: &Value, name: &str) -> f64 {
    let parameters = found["parameters"].as_array().unwrap();
    parameters.iter().find(|p| p["name"] == name).unwrap()["value"].as_f64().unwrap()
}

#[test]
fn one_body_without_noise_is_replayed_to_six_digits() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("a.csv"), exact_recording()).unwrap();
    let exact = "[[imu]]\nclass = \"exact\"\n[load_cell]\nclass = \"exact\"\n";
    // Estimated, and stated by somebody who believes in nine digits.
    for (noise, folder) in [("", "b"), ("noise_n_nm = [1e-9, 1e-9, 1e-9, 1e-9, 1e-9, 1e-9]\n", "c")] {
        std::fs::write(place.path().join("a.rig.toml"), format!("{exact}{noise}")).unwrap();
        let found = answer(place.path(), &format!("replay a.csv --out {folder} --json"));
        assert_eq!((&found["status"], &found["source"]["mcu"]), (&"identified".into(), &"inproc".into()));
        assert!(found["notes"].to_string().contains("single precision"), "{}", found["notes"]);
        for (name, truth) in ["m", "mcx", "mcy", "mcz"].iter().zip([1.0, COM[0], COM[1], COM[2]]) {
            assert!(
                (value(&found, name) - MASS * truth).abs() < 1e-6 * MASS,
                "{name}: {}",
                value(&found, name)
            );
        }
    }
}

#[test]
fn two_links_of_a_noise_too_small_for_the_device_are_replayed_all_the_same() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    answer(place, "demo --body two-links --ideal --duration-s 20 --out a --json");
    let output = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(place)
        .args(["convert", "a/demo.mcap", "b.csv"])
        .output()
        .unwrap();
    assert!(output.status.success());
    let plain = answer(place, "replay b.csv --out b --json");
    let rig = std::fs::read_to_string(place.join("b.rig.toml")).unwrap();
    let at = rig.find("noise_n_nm").unwrap();
    let end = at + rig[at..].find(']').unwrap() + 1;
    let tiny = format!("{}noise_n_nm = [1e-9, 1e-9, 1e-9, 1e-9, 1e-9, 1e-9]{}", &rig[..at], &rig[end..]);
    std::fs::write(place.join("b.rig.toml"), tiny).unwrap();
    let found = answer(place, "replay b.csv --out c --json");
    assert_eq!(found["source"]["mcu"], "inproc");
    assert!(found["notes"].to_string().contains("single precision"), "{}", found["notes"]);
    let mass = plain["parameters"][0]["name"].as_str().unwrap();
    let (kept, m) = (value(&plain, mass), value(&found, mass));
    assert!((m / kept - 1.0).abs() < 1e-3, "{m} {kept}");
}
