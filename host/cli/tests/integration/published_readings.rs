//! Readings as drivers publish them: in the axes of the world, without gravity, rates of Euler's angles,
//! another range, another clock, a copied column. Each is the first thing said, in one file and in two with
//! their own clocks.
//!
//! The motion is one of roll, pitch and yaw; all that the sensors read follows from differences of the
//! attitude and of the angular momentum, no regressor.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde_json::Value;

use crate::program::{json, rigident};
use crate::study_length::runs;

type Vector = Vector3<f64>;

const RATE_HZ: f64 = 100.0;
const ROWS: usize = 2400;
const GRAVITY: f64 = 9.80665;
/// Step of the differences, s: second differences err by 1e-8 of it.
const STEP_S: f64 = 2e-4;
const MASS_KG: f64 = 2.1;
const CENTRE_M: [f64; 3] = [0.04, -0.01, 0.07];
const IMU_M: [f64; 3] = [0.05, 0.02, -0.03];

fn angles(t: f64) -> [f64; 3] {
    let of = |all: [(f64, f64); 3]| all.iter().map(|(hz, phase)| 0.22 * (TAU * hz * t + phase).sin()).sum();
    [
        of([(0.23, 0.4), (0.71, 1.1), (1.37, 2.3)]),
        of([(0.31, 2.0), (0.83, 0.2), (1.21, 3.1)]),
        of([(0.19, 1.0), (0.59, 4.2), (1.49, 0.6)]),
    ]
}

/// From S to the world.
fn attitude(t: f64) -> Matrix3<f64> {
    let [roll, pitch, yaw] = angles(t);
    *Rotation3::from_euler_angles(roll, pitch, yaw).matrix()
}

/// The angular rate in the axes of S, rad/s.
fn rate(t: f64) -> Vector {
    let slope = (attitude(t + STEP_S) - attitude(t - STEP_S)) / (2.0 * STEP_S);
    let spin = attitude(t).transpose() * slope;
    Vector::new(spin[(2, 1)] - spin[(1, 2)], spin[(0, 2)] - spin[(2, 0)], spin[(1, 0)] - spin[(0, 1)]) * 0.5
}

/// Specific force in the axes of S at a point of it, m/s².
fn specific_force(t: f64, at: &Vector) -> Vector {
    let place = |t: f64| attitude(t) * at;
    let moved = (place(t + STEP_S) + place(t - STEP_S) - place(t) * 2.0) / (STEP_S * STEP_S);
    attitude(t).transpose() * (moved + Vector::z() * GRAVITY)
}

/// The moment about the origin of S, N m: what changes the angular momentum, and what carries the weight.
fn moment(t: f64) -> Vector {
    let com = Vector::from(CENTRE_M);
    let own = Matrix3::new(0.013, 0.001, -0.0007, 0.001, 0.016, 0.0009, -0.0007, 0.0009, 0.01);
    let inertia = own + (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * MASS_KG;
    let momentum = |t: f64| attitude(t) * inertia * rate(t);
    let change = (momentum(t + STEP_S) - momentum(t - STEP_S)) / (2.0 * STEP_S);
    let weight = Vector::z() * (MASS_KG * GRAVITY);
    attitude(t).transpose() * (change + (attitude(t) * com).cross(&weight))
}

/// A row: force, moment, accelerometer, gyro.
#[derive(Clone, Copy)]
struct Row {
    time_s: f64,
    all: [Vector; 4],
}

/// Numbers of unit variance that look as if they were drawn.
struct Drawn(u64);

impl Drawn {
    fn next(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }
}

fn honest() -> Vec<Row> {
    let mut drawn = Drawn(11);
    let com = Vector::from(CENTRE_M);
    let row = |k: usize| {
        let time_s = k as f64 / RATE_HZ;
        let mut noisy = |v: Vector, sd: f64| v.map(|v| v + sd * drawn.next());
        let force = noisy(specific_force(time_s, &com) * MASS_KG + Vector::new(1.0, -2.0, 3.0), 0.03);
        let moment = noisy(moment(time_s) + Vector::new(0.1, -0.05, 0.02), 0.001);
        let accel = noisy(specific_force(time_s, &Vector::from(IMU_M)), 0.02);
        Row { time_s, all: [force, moment, accel, noisy(rate(time_s), 0.001)] }
    };
    (0..ROWS).map(row).collect()
}

const WRENCH: &str = "fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm";
const IMU: &str = "imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,imu_gy_radps,imu_gz_radps";

fn table(header: &str, rows: &[Row], groups: std::ops::Range<usize>) -> String {
    let line = |row: &Row| {
        let cells = row.all[groups.clone()].iter().flat_map(Vector::iter).map(|v| format!("{v:.6}"));
        format!("{:.4},{}\n", row.time_s, cells.collect::<Vec<_>>().join(","))
    };
    format!("t_s,{header}\n") + &rows.iter().map(line).collect::<String>()
}

fn rig(place: bool) -> String {
    let place = if place { IMU_M } else { [0.0; 3] };
    format!("[[imu]]\nposition_m = {place:?}\n")
}

/// Identifies rows in one file.
fn in_one(at: &Path, name: &str, rows: &[Row], rig: &str) -> Value {
    fs::write(at.join(format!("{name}.csv")), table(&format!("{WRENCH},{IMU}"), rows, 0..4)).unwrap();
    fs::write(at.join(format!("{name}.rig.toml")), rig).unwrap();
    json(&rigident(at, &["identify", &format!("{name}.csv"), "--json", "--out", &format!("{name}.out")]))
}

/// Identifies rows in two files, each with its own clock.
fn in_two(at: &Path, name: &str, rows: &[Row], rig: &str) -> Value {
    let [wrench, imu] = ["wrench", "imu"].map(|of| format!("{name}-{of}.csv"));
    fs::write(at.join(&wrench), table(WRENCH, rows, 0..2)).unwrap();
    fs::write(at.join(&imu), table(IMU, rows, 2..4)).unwrap();
    let file = format!("{name}-two.rig.toml");
    let streams = format!("[[stream]]\nfile = {wrench:?}\n[[stream]]\nfile = {imu:?}\n");
    fs::write(at.join(&file), format!("{rig}{streams}")).unwrap();
    json(&rigident(at, &["identify", &file, "--json", "--out", &format!("{name}-two.out")]))
}

fn said(result: &Value) -> String {
    let first = |field: &str| result[field].get(0).unwrap_or(&result[field]).as_str().map(str::to_owned);
    first("warnings").or_else(|| first("error")).unwrap_or_else(|| result.to_string())
}

type Plant = fn(&mut Row);

const PUBLISHED: [(&str, Plant, &str); 8] = [
    (
        "world-wrench",
        |r| (r.all[0], r.all[1]) = (attitude(r.time_s) * r.all[0], attitude(r.time_s) * r.all[1]),
        "the wrench is in the axes of the world",
    ),
    (
        "world-accelerometer",
        |r| r.all[2] = attitude(r.time_s) * r.all[2],
        "the accelerometer is in the axes of the world",
    ),
    ("linear", |r| r.all[2] -= attitude(r.time_s).transpose() * Vector::z() * GRAVITY, "taken out of"),
    (
        "euler",
        |r| {
            let [after, before] = [STEP_S, -STEP_S].map(|by| Vector::from(angles(r.time_s + by)));
            r.all[3] = (after - before) / (2.0 * STEP_S) + (r.all[3] - rate(r.time_s));
        },
        "rates of roll, pitch and yaw",
    ),
    ("half", |r| r.all[3] *= 0.5, "the gyro reads 0.50"),
    ("six-tenths", |r| r.all[3] *= 0.6, "the gyro reads 0.60"),
    ("nine-tenths", |r| r.all[3] *= 0.9, "the gyro reads 0.90"),
    ("copied", |r| r.all[1].y = r.all[1].x, "mx_nm and my_nm are the same in every row"),
];

/// Of this motion another fault of the attitude leaves less: it is headed, and not confirmed.
const LIKE_ANOTHER: [(&str, &str); 2] = [("one", "world-accelerometer"), ("two", "world-wrench")];

#[test]
fn readings_as_drivers_publish_them_are_named_first_and_give_no_number() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let rows = honest();
    let mut others = Vec::new();
    for (way, identify) in [("one", in_one as fn(&Path, &str, &[Row], &str) -> Value), ("two", in_two)] {
        let result = identify(at, "honest", &rows, &rig(true));
        assert_eq!(result["status"], "identified", "{way}: {}", said(&result));
        assert!((result["mass_kg"].as_f64().unwrap() / MASS_KG - 1.0).abs() < 0.02, "{result}");
        let most = if way == "one" { PUBLISHED.len() } else { runs(PUBLISHED.len() as u64, 2) as usize };
        for (name, plant, words) in PUBLISHED.into_iter().take(most) {
            let mut rows = rows.clone();
            rows.iter_mut().for_each(plant);
            let result = identify(at, name, &rows, &rig(true));
            let status = result["status"].as_str().unwrap();
            assert!(matches!(status, "implausible" | "failed"), "{way}, {name}: {status}, {}", said(&result));
            if !said(&result).contains(words) {
                assert_eq!(result["cause"]["confirmed"], false, "{way}, {name}: {}", said(&result));
                others.push((way, name));
            }
        }
        let result = identify(at, "left-out", &rows, &rig(false));
        assert!(said(&result).contains("the IMU does not sit at"), "{way}: {}", said(&result));
    }
    assert_eq!(others, LIKE_ANOTHER);
}

#[test]
fn a_clock_that_is_a_second_off_is_a_clock() {
    let place = tempfile::tempdir().unwrap();
    let rows = honest();
    let late = (1.0 * RATE_HZ) as usize;
    let both = rows.iter().zip(&rows[late..]);
    let mixed: Vec<Row> = both
        .map(|(before, now)| Row { all: [now.all[0], now.all[1], before.all[2], before.all[3]], ..*now })
        .collect();
    let result = in_one(place.path(), "late", &mixed, &rig(true));
    assert_eq!(result["status"], "implausible");
    assert!(said(&result).contains("the IMU's clock is late by 1.00 s"), "{}", said(&result));
}

/// The answer says once on which scales it rests, with the size that its intervals count.
#[test]
fn an_answer_says_on_which_scales_it_rests() {
    let place = tempfile::tempdir().unwrap();
    let result = in_one(place.path(), "honest", &honest(), &rig(true));
    let of = |what: &str| {
        let all = result["rests_on"].as_array().unwrap().iter();
        all.filter(|one| one["what"] == what).cloned().collect::<Vec<_>>()
    };
    let [gain] = &of("load-cell gain")[..] else { panic!("{}", result["rests_on"]) };
    // The default class is 1 %, a limit: 1.96/√3 % of one channel, less by √3 where three weigh alike.
    let u95 = gain["u95_percent"].as_f64().unwrap();
    assert!((0.65..1.14).contains(&u95), "{gain}");
    assert_eq!(of("accelerometer scale").len(), 1);
    // A ratio of two such gains.
    let [ratio] = &of("scale of the moments against the forces")[..] else {
        panic!("{}", result["rests_on"])
    };
    assert!((ratio["u95_percent"].as_f64().unwrap() / u95 - 2f64.sqrt()).abs() < 1e-3, "{ratio}");
    let notes = result["notes"].as_array().unwrap().iter();
    assert_eq!(notes.filter(|note| note.as_str().unwrap().starts_with("rests on")).count(), 1);
}
