//! One body on a load cell with an IMU: an independent simulation of the rig, its errors drawn as stated.

use rigident::diagnosis::Case;
use rigident::fit::parallel;
use rigident::problem::{Problem, ProblemOptions};

use super::super::problem::Normal;
use super::super::rig_errors::{Errors, Motion, Rig, rig_file};
use super::{Planted, Verdict, table_of, verdict};

/// Rigs and noises of each fault.
const SEEDS: u64 = 2;
/// Honest recordings of each kind.
const HONEST: u64 = 150;

pub(super) type Row<'a> = (&'a mut [f64; 6], &'a mut [f64; 3], &'a mut [f64; 3]);

/// Changes wrench, accelerometer and gyro of every row.
pub(super) fn each(case: &mut Case, mut change: impl FnMut(usize, Row)) {
    let recording = &mut case.recording;
    let imu = recording.imus.first_mut().expect("an IMU");
    let wrench = recording.wrench.iter_mut().flatten();
    let both = imu.accel.iter_mut().flatten().zip(imu.gyro.iter_mut().flatten());
    for (k, (w, (a, g))) in wrench.zip(both).enumerate() {
        change(k, (w, a, g));
    }
}

fn force(case: &mut Case, by: f64) {
    each(case, |_, (w, ..)| w[..3].iter_mut().for_each(|v| *v *= by));
}

fn moment(case: &mut Case, by: f64) {
    each(case, |_, (w, ..)| w[3..].iter_mut().for_each(|v| *v *= by));
}

fn accel(case: &mut Case, by: f64) {
    each(case, |_, (_, a, _)| a.iter_mut().for_each(|v| *v *= by));
}

fn gyro(case: &mut Case, by: f64) {
    each(case, |_, (_, _, g)| g.iter_mut().for_each(|v| *v *= by));
}

/// Delays readings of an IMU: they are stamped this many rows too late.
fn late(case: &mut Case, rows: usize, accel: bool, gyro: bool) {
    let imu = case.recording.imus.first_mut().expect("an IMU");
    let of = |values: Option<&mut Vec<[f64; 3]>>| {
        if let Some(values) = values {
            let was = values.clone();
            values.iter_mut().enumerate().for_each(|(k, to)| *to = was[k.saturating_sub(rows)]);
        }
    };
    of(imu.accel.as_mut().filter(|_| accel));
    of(imu.gyro.as_mut().filter(|_| gyro));
}

/// Loses 100 g that sat where the IMU is.
fn lose(case: &mut Case) {
    let half = case.recording.rows() / 2;
    let imu = &case.recording.rig.imu[0];
    let (p, [w, x, y, z]) = (nalgebra::Vector3::from(imu.position_m), imu.rotation_wxyz);
    let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
    each(case, |k, (wrench, a, _)| {
        if k > half {
            let force = turn * nalgebra::Vector3::from(*a) * 0.1;
            let lost = force.iter().chain(&p.cross(&force)).copied().collect::<Vec<_>>();
            wrench.iter_mut().zip(lost).for_each(|(to, lost)| *to -= lost);
        }
    });
}

fn position(case: &mut Case, by: f64) {
    case.recording.rig.imu[0].position_m.iter_mut().for_each(|v| *v *= by);
}

/// Turns by 90° about z.
fn quarter(v: &mut [f64]) {
    (v[0], v[1]) = (-v[1], v[0]);
}

#[rustfmt::skip]
const FAULTS: [Planted; 62] = [
    Planted { name: "gyro in deg/s", named: "the gyro is in deg/s", plant: |c| gyro(c, 180.0 / std::f64::consts::PI) },
    Planted { name: "gyro in rpm", named: "the gyro is in rpm", plant: |c| gyro(c, 30.0 / std::f64::consts::PI) },
    Planted { name: "gyro in mrad/s", named: "the gyro is in mrad/s", plant: |c| gyro(c, 1e3) },
    Planted { name: "accelerometer in g", named: "g", plant: |c| accel(c, 1.0 / 9.80665) },
    Planted { name: "accelerometer in mg", named: "mg", plant: |c| accel(c, 1e3 / 9.80665) },
    Planted { name: "accelerometer 30 % too large", named: "accelerometer scale", plant: |c| accel(c, 1.3) },
    Planted { name: "accelerometer 10 % too small", named: "accelerometer scale", plant: |c| accel(c, 0.9) },
    Planted { name: "accelerometer 1 % too large", named: "accelerometer scale", plant: |c| accel(c, 1.01) },
    Planted { name: "force in kgf", named: "the force is in kgf", plant: |c| force(c, 1.0 / 9.80665) },
    Planted { name: "force in gf", named: "the force is in gf", plant: |c| force(c, 1e3 / 9.80665) },
    Planted { name: "force in lbf", named: "the force is in lbf", plant: |c| force(c, 1.0 / 4.448_221_615) },
    Planted { name: "force in kN", named: "the force is in kN", plant: |c| force(c, 1e-3) },
    Planted { name: "moment in N mm", named: "the moment is in N mm", plant: |c| moment(c, 1e3) },
    Planted { name: "moment in N cm", named: "the moment is in N cm", plant: |c| moment(c, 1e2) },
    Planted { name: "moment in kgf m", named: "the moment is in kgf m", plant: |c| moment(c, 1.0 / 9.80665) },
    Planted { name: "moment in lbf in", named: "the moment is in lbf in", plant: |c| moment(c, 1.0 / (4.448_221_615 * 0.0254)) },
    Planted { name: "moment in lbf ft", named: "the moment is in lbf ft", plant: |c| moment(c, 1.0 / (4.448_221_615 * 0.3048)) },
    Planted { name: "moments negated", named: "the moment is reversed", plant: |c| moment(c, -1.0) },
    Planted { name: "forces negated", named: "the force is reversed", plant: |c| force(c, -1.0) },
    Planted { name: "wrench on the sensor", named: "the sign of the other body", plant: |c| { force(c, -1.0); moment(c, -1.0); } },
    Planted { name: "accelerometer reversed", named: "the accelerometer is reversed", plant: |c| accel(c, -1.0) },
    Planted { name: "gyro reversed", named: "the gyro is reversed", plant: |c| gyro(c, -1.0) },
    Planted { name: "gyro x reversed", named: "the gyro has x reversed", plant: |c| each(c, |_, (_, _, g)| g[0] = -g[0]) },
    Planted { name: "gyro z reversed", named: "the gyro has z reversed", plant: |c| each(c, |_, (_, _, g)| g[2] = -g[2]) },
    Planted { name: "accelerometer y reversed", named: "the accelerometer has y reversed", plant: |c| each(c, |_, (_, a, _)| a[1] = -a[1]) },
    Planted { name: "accelerometer z reversed", named: "the accelerometer has z reversed", plant: |c| each(c, |_, (_, a, _)| a[2] = -a[2]) },
    Planted { name: "fx reversed", named: "the force has x reversed", plant: |c| each(c, |_, (w, ..)| w[0] = -w[0]) },
    Planted { name: "fz reversed", named: "the force has z reversed", plant: |c| each(c, |_, (w, ..)| w[2] = -w[2]) },
    Planted { name: "mz reversed", named: "the moment has z reversed", plant: |c| each(c, |_, (w, ..)| w[5] = -w[5]) },
    Planted { name: "gyro x and y swapped", named: "the gyro has x and y swapped", plant: |c| each(c, |_, (_, _, g)| g.swap(0, 1)) },
    Planted { name: "gyro y and z swapped", named: "the gyro has y and z swapped", plant: |c| each(c, |_, (_, _, g)| g.swap(1, 2)) },
    Planted { name: "accelerometer x and y swapped", named: "the accelerometer has x and y swapped", plant: |c| each(c, |_, (_, a, _)| a.swap(0, 1)) },
    Planted { name: "fx and fy swapped", named: "the force has x and y swapped", plant: |c| each(c, |_, (w, ..)| w.swap(0, 1)) },
    Planted { name: "mx and my swapped", named: "the moment has x and y swapped", plant: |c| each(c, |_, (w, ..)| w.swap(3, 4)) },
    Planted { name: "gyro turned by 90°", named: "the gyro is turned by 90° about z", plant: |c| each(c, |_, (_, _, g)| quarter(g)) },
    Planted { name: "accelerometer turned by 90°", named: "the accelerometer is turned by 90° about z", plant: |c| each(c, |_, (_, a, _)| quarter(a)) },
    Planted { name: "IMU turned by 90°", named: "the IMU is turned by 90° about z", plant: |c| each(c, |_, (_, a, g)| { quarter(a); quarter(g); }) },
    Planted { name: "IMU turned by 180° about x", named: "the IMU is turned by 180° about x", plant: |c| each(c, |_, (_, a, g)| for v in [a, g] { v[1] = -v[1]; v[2] = -v[2]; }) },
    Planted { name: "force turned by 90°", named: "the force is turned by 90° about z", plant: |c| each(c, |_, (w, ..)| quarter(&mut w[..3])) },
    Planted { name: "moment turned by 90°", named: "the moment is turned by 90° about z", plant: |c| each(c, |_, (w, ..)| quarter(&mut w[3..])) },
    Planted { name: "rotation_wxyz inverted", named: "rotation_wxyz is the inverse", plant: |c| c.recording.rig.imu[0].rotation_wxyz[1..].iter_mut().for_each(|v| *v = -*v) },
    Planted { name: "rotation_wxyz as x, y, z, w", named: "rotation_wxyz is in the order x, y, z, w", plant: |c| c.recording.rig.imu[0].rotation_wxyz.rotate_left(1) },
    Planted { name: "position_m in mm", named: "position_m of the IMU is in millimetres", plant: |c| position(c, 1e3) },
    Planted { name: "position_m in cm", named: "position_m of the IMU is in centimetres", plant: |c| position(c, 1e2) },
    Planted { name: "position_m reversed", named: "position_m of the IMU is reversed", plant: |c| position(c, -1.0) },
    Planted { name: "lever arm 2 cm off", named: "lever arm", plant: |c| c.recording.rig.imu[0].position_m[0] += 0.02 },
    Planted { name: "IMU 20 ms late", named: "the IMU is late by 20 ms", plant: |c| late(c, 4, true, true) },
    Planted { name: "IMU 50 ms late", named: "the IMU is late by 50 ms", plant: |c| late(c, 10, true, true) },
    Planted { name: "gyro 20 ms late", named: "the gyro is late by 20 ms", plant: |c| late(c, 4, false, true) },
    Planted { name: "accelerometer 10 ms late", named: "the accelerometer is late by 10 ms", plant: |c| late(c, 2, true, false) },
    Planted { name: "fz 50 % too large", named: "gain_fz", plant: |c| each(c, |_, (w, ..)| w[2] *= 1.5) },
    Planted { name: "mx 10 % too large", named: "gain_mx", plant: |c| each(c, |_, (w, ..)| w[3] *= 1.1) },
    Planted { name: "gyro bias 0.1 rad/s", named: "gyro_bias", plant: |c| each(c, |_, (_, _, g)| g[1] += 0.1) },
    Planted { name: "mz zero throughout", named: "mz_nm", plant: |c| each(c, |_, (w, ..)| w[5] = 0.0) },
    Planted { name: "fx constant", named: "fx_n", plant: |c| each(c, |_, (w, ..)| w[0] = 1.25) },
    Planted { name: "gyro x zero", named: "imu_gx_radps", plant: |c| each(c, |_, (_, _, g)| g[0] = 0.0) },
    Planted { name: "accelerometer z constant", named: "imu_az_mps2", plant: |c| each(c, |_, (_, a, _)| a[2] = 9.81) },
    Planted { name: "gyro spike of 35 rad/s", named: "imu_gx_radps", plant: |c| each(c, |k, (_, _, g)| if k == 2000 { g[0] += 35.0 }) },
    Planted { name: "accelerometer spike", named: "imu_ay_mps2", plant: |c| each(c, |k, (_, a, _)| if k == 1500 { a[1] += 300.0 }) },
    Planted { name: "100 g lost at half time", named: "something changed", plant: lose },
    Planted { name: "gyro quantised to 0.05 rad/s", named: "gyro", plant: |c| each(c, |_, (_, _, g)| g.iter_mut().for_each(|v| *v = (*v / 0.05).round() * 0.05)) },
    Planted { name: "accelerometer saturates at 12 m/s², not stated", named: "accelerometer", plant: |c| each(c, |_, (_, a, _)| a.iter_mut().for_each(|v| *v = v.clamp(-12.0, 12.0))) },
];

/// Returns an honest recording: errors of the rig drawn as its file states, or as its classes let expect.
fn honest_case(seed: u64, stated: bool) -> Case {
    let known = if stated { Errors::data_sheet() } else { Errors::default_classes() };
    let nominal = Rig::lab();
    let mut file = rig_file(&known, &nominal.noise);
    if seed % 2 == 1 {
        // Noise that nobody states is found.
        file.load_cell.noise_n_nm = None;
        file.imu[0].accel_noise_mps2 = None;
        file.imu[0].gyro_noise_radps = None;
    }
    let errors = known.draw(1.0, &mut Normal::new(2_000_000 + seed));
    let recording = Rig { errors, ..nominal }.record(&Motion::lab(), &file, seed);
    Case { recording, model: None, options: ProblemOptions::default() }
}

pub(super) fn truth(_: &Problem) -> Vec<Option<f64>> {
    let body = Rig::lab().body;
    let (c, m) = (body.com, body.mass);
    let i = body.inertia + (nalgebra::Matrix3::identity() * c.norm_squared() - c * c.transpose()) * m;
    let phi = [m, m * c.x, m * c.y, m * c.z, i.m11, i.m22, i.m33, i.m23, i.m13, i.m12];
    phi.into_iter().map(Some).chain(std::iter::repeat_n(None, 6)).collect()
}

/// Returns the table of faults.
pub fn table() -> String {
    table_of(&FAULTS, SEEDS, |fault, seed| {
        let mut case = honest_case(10 + seed, true);
        (fault.plant)(&mut case);
        verdict(&mut case, &truth)
    })
}

/// Returns honest recordings by kinds.
pub fn honest() -> Vec<(String, Vec<Verdict>)> {
    [
        (true, "one body, errors of the rig as its file states"),
        (false, "one body, errors of the rig as its classes let expect"),
    ]
    .into_iter()
    .map(|(stated, name)| {
        let all = parallel::map(parallel::threads(), HONEST as usize, |k| {
            verdict(&mut honest_case(1000 + k as u64, stated), &truth)
        });
        (name.to_owned(), all)
    })
    .collect()
}
