//! Readings as drivers publish them, and settings that are left out: each in three sizes, or of three
//! motions.
//!
//! The attitude is that of the simulated motion; nothing of the search for faults is used.

use nalgebra::{Matrix3, Vector3};
use rigident::diagnosis::Case;
use rigident::rows::tree::ProblemOptions;

use super::super::problem::Normal;
use super::super::rig_errors::{Errors, Motion, Rig, rig_file};
use super::body::{each, truth};
use super::{Planted, Verdict, table_of, verdict};

/// Sizes of each fault.
const SIZES: u64 = 3;
const GRAVITY_MPS2: f64 = 9.80665;

/// A recording before its fault, with how S was turned at each row: from S to the world.
struct Moved {
    case: Case,
    attitudes: Vec<Matrix3<f64>>,
    rate_hz: f64,
}

/// Returns an honest recording of one of three motions; errors of the rig as its file states, half as large.
fn moved(size: usize) -> Moved {
    let known = Errors::data_sheet();
    let nominal = Rig::lab();
    let mut file = rig_file(&known, &nominal.noise);
    (file.load_cell.noise_n_nm, file.imu[0].accel_noise_mps2, file.imu[0].gyro_noise_radps) =
        (None, None, None);
    let errors = known.draw(0.5, &mut Normal::new(5_000_000 + size as u64));
    let motion = match size {
        0 => Motion::lab(),
        1 => Motion::brisk(),
        _ => Motion::lab().with_rest(4.0, 7.0),
    };
    let rig = Rig { errors, ..nominal };
    let recording = rig.record(&motion, &file, 70 + size as u64);
    let at = |k: usize| motion.state(k as f64 / rig.rate_hz).attitude;
    let attitudes = (0..recording.rows()).map(at).collect();
    Moved {
        case: Case { recording, model: None, options: ProblemOptions::default() },
        attitudes,
        rate_hz: rig.rate_hz,
    }
}

/// Returns the rotations from S to a world whose heading is not that of the start.
fn world(moved: &Moved, size: usize) -> Vec<Matrix3<f64>> {
    let heading = [0.0, 0.7, 2.5][size];
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), heading).into_inner();
    moved.attitudes.iter().map(|attitude| turn * attitude).collect()
}

/// Returns the rotation from the IMU's axes to those of S.
fn mounted(case: &Case) -> Matrix3<f64> {
    let [w, x, y, z] = case.recording.rig.imu[0].rotation_wxyz;
    let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
    *turn.to_rotation_matrix().matrix()
}

fn set(to: &mut [f64], v: Vector3<f64>) {
    to.iter_mut().zip(v.iter()).for_each(|(to, v)| *to = *v);
}

fn world_wrench(moved: &mut Moved, size: usize) {
    let world = world(moved, size);
    each(&mut moved.case, |k, (w, ..)| {
        let (force, moment) = (Vector3::new(w[0], w[1], w[2]), Vector3::new(w[3], w[4], w[5]));
        set(&mut w[..3], world[k] * force);
        set(&mut w[3..], world[k] * moment);
    });
}

fn world_accelerometer(moved: &mut Moved, size: usize) {
    let (world, imu) = (world(moved, size), mounted(&moved.case));
    each(&mut moved.case, |k, (_, a, _)| *a = (world[k] * imu * Vector3::from(*a)).into());
}

fn weightless_wrench(moved: &mut Moved, size: usize) {
    let share = [1.0, 0.9, 0.5][size];
    let body = Rig::lab().body;
    let attitudes = moved.attitudes.clone();
    each(&mut moved.case, |k, (w, ..)| {
        let weight = attitudes[k].transpose() * Vector3::z() * (share * body.mass * GRAVITY_MPS2);
        let own = body.com.cross(&weight);
        w.iter_mut().zip(weight.iter().chain(own.iter())).for_each(|(to, own)| *to -= own);
    });
}

fn linear_acceleration(moved: &mut Moved, _: usize) {
    let (attitudes, imu) = (moved.attitudes.clone(), mounted(&moved.case));
    each(&mut moved.case, |k, (_, a, _)| {
        let up = imu.transpose() * attitudes[k].transpose() * Vector3::z() * GRAVITY_MPS2;
        *a = (Vector3::from(*a) - up).into();
    });
}

/// Replaces rates by those of the IMU's roll, pitch and yaw, by the derivatives of its attitude.
fn euler_rates(moved: &mut Moved, _: usize) {
    let imu = mounted(&moved.case);
    let attitudes = moved.attitudes.clone();
    each(&mut moved.case, |k, (_, _, g)| {
        let (roll, pitch, _) = nalgebra::Rotation3::from_matrix_unchecked(attitudes[k] * imu).euler_angles();
        let [x, y, z] = *g;
        let yaw = (y * roll.sin() + z * roll.cos()) / pitch.cos();
        *g = [x + yaw * pitch.sin(), y * roll.cos() - z * roll.sin(), yaw];
    });
}

/// Stamps the IMU too late.
fn late(moved: &mut Moved, size: usize) {
    let rows = ([0.4, 1.0, 2.0][size] * moved.rate_hz) as usize;
    let imu = &mut moved.case.recording.imus[0];
    for values in [&mut imu.accel, &mut imu.gyro].into_iter().flatten() {
        let was = values.clone();
        values.iter_mut().enumerate().for_each(|(k, to)| *to = was[k.saturating_sub(rows)]);
    }
}

fn gyro(moved: &mut Moved, size: usize) {
    let by = [0.5, 0.6, 0.9][size];
    each(&mut moved.case, |_, (_, _, g)| g.iter_mut().for_each(|v| *v *= by));
}

fn copied(moved: &mut Moved, size: usize) {
    each(&mut moved.case, |_, (w, a, g)| match size {
        0 => w[1] = w[0],
        1 => a[2] = a[1],
        _ => g[0] = g[2],
    });
}

/// A fault by its name, by what must be said of it, and how it comes into a recording.
type Published = (Planted, Plant);
type Plant = fn(&mut Moved, usize);

fn faults() -> Vec<Published> {
    let of = |name, named| Planted { name, named, plant: |_| {} };
    vec![
        (of("wrench in the axes of the world", "the wrench is in the axes of the world"), world_wrench),
        (
            of("accelerometer in the axes of the world", "the accelerometer is in the axes of the world"),
            world_accelerometer,
        ),
        (of("weight taken out of the wrench", "weight has been taken out of the wrench"), weightless_wrench),
        (of("gravity taken out of the accelerometer", "taken out of"), linear_acceleration),
        (of("rates of Euler's angles as rates", "rates of roll, pitch and yaw"), euler_rates),
        (of("clock of the IMU 0.4, 1, 2 s late", "clock is late"), late),
        (of("gyro times 0.5, 0.6, 0.9", "the gyro reads"), gyro),
        (of("a copied column", "copied"), copied),
        (of("position_m left out", "the IMU does not sit"), |moved, _| {
            moved.case.recording.rig.imu[0].position_m = [0.0; 3];
        }),
    ]
}

/// Returns the table of what drivers publish.
pub fn table() -> String {
    let (planted, plants): (Vec<Planted>, Vec<Plant>) = faults().into_iter().unzip();
    table_of(&planted, SIZES, |fault, size| {
        let own = planted.iter().position(|other| other.name == fault.name).expect("one of them");
        let mut moved = moved(size as usize);
        (plants[own])(&mut moved, size as usize);
        run(moved)
    })
}

fn run(mut moved: Moved) -> Verdict {
    verdict(&mut moved.case, &truth)
}
