//! Recordings of trees whose parameters are known, by inverse dynamics that share nothing with the rows.
//!
//! Two links with an IMU each on a load cell, seven axes with torques, people, and how far a fit is from the
//! truth. For tests and for the tables of `docs/trees.md`.
#![allow(clippy::missing_panics_doc, reason = "of trees that are made here")]

use nalgebra::{DVector, Matrix3, Rotation3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{BaseMotion, Joint, Link};

use super::noise::Noise;
use rigident_fit::Fit;
use rigident_io::recording::{ImuColumns, Recording};
use rigident_io::rig::{ImuClass, ImuTable, LoadCellClass, LoadCellTable, RigFile, TreeClass, TreeTable};
use rigident_model::base::BaseParameters;
use rigident_model::dynamics::inverse_dynamics;
use rigident_model::{Model, ModelLink};
use rigident_rows::tree::joints;

fn body(mass: f64, com: [f64; 3], radii: [f64; 3], turn: [f64; 3]) -> Option<[f64; 10]> {
    let turned = Rotation3::from_euler_angles(turn[0], turn[1], turn[2]).into_inner();
    // Moments of an ellipsoid-like body of these radii of gyration: they obey the triangle inequality.
    let [a, b, c] = radii.map(|r| mass * r * r);
    let tensor = turned * Matrix3::from_diagonal(&Vector3::new(b + c, c + a, a + b)) * turned.transpose();
    let body = InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::from_array(com), tensor);
    Some(body.to_vector())
}

fn link(
    name: &str,
    parent: usize,
    joint: Joint<f64>,
    position: [f64; 3],
    nominal: Option<[f64; 10]>,
) -> ModelLink {
    ModelLink::new(
        name,
        if name == "base" { String::new() } else { format!("{name}_joint") },
        Link { parent, joint, rotation: Matrix3::identity(), position: position.into() },
        nominal,
    )
}

/// Makes two links: a base and an arm on a ball.
pub fn two_links() -> Model {
    Model {
        name: "two".to_owned(),
        links: vec![
            link(
                "base",
                0,
                Joint::Free,
                [0.0; 3],
                body(3.0, [0.01, -0.02, 0.03], [0.08, 0.06, 0.05], [0.2, 0.1, 0.4]),
            ),
            link(
                "arm",
                0,
                Joint::Spherical,
                [0.03, 0.0, 0.065],
                body(1.2, [0.02, 0.01, 0.12], [0.03, 0.04, 0.09], [0.1, -0.3, 0.2]),
            ),
        ],
        findings: Vec::new(),
        gravity_mps2: None,
    }
}

/// Makes seven axes on a base held still, like an arm's.
pub fn seven_axes() -> Model {
    let mut links =
        vec![link("base", 0, Joint::Free, [0.0; 3], body(4.0, [0.0, 0.0, 0.06], [0.1; 3], [0.0; 3]))];
    let axes = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
    let lengths = [0.33, 0.0, 0.32, 0.08, 0.38, 0.02, 0.09];
    for (k, length) in lengths.into_iter().enumerate() {
        let mass = 5.0 / (1.0 + 0.6 * k as f64);
        let size = 0.1 / (1.0 + 0.15 * k as f64);
        let turn = [0.1 * k as f64, -0.2, 0.3];
        let com = [0.2 * size, -0.3 * size, 0.9 * size];
        links.push(link(
            &format!("l{}", k + 1),
            k,
            Joint::Revolute(axes[k % 2].into()),
            [0.01 * (k % 3) as f64, 0.0, length],
            body(mass, com, [0.4 * size, 0.5 * size, 0.8 * size], turn),
        ));
    }
    Model { name: "seven".to_owned(), links, findings: Vec::new(), gravity_mps2: None }
}

/// Returns a sum of swings: value, rate, acceleration.
pub(super) fn swing(t: f64, k: usize, size: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for n in 0..4 {
        let w = std::f64::consts::TAU * (0.11 + 0.23 * f64::from(n) + 0.013 * k as f64);
        let phase = ((k * 7 + n as usize * 3) as f64).sin() * 3.0;
        let share = size / (1.0 + 0.5 * f64::from(n));
        let a = w * t + phase;
        sum[0] += share * a.sin();
        sum[1] += share * w * a.cos();
        sum[2] -= share * w * w * a.sin();
    }
    sum
}

/// Returns the attitude by three swings (roll, pitch, yaw) and its rate in its own axes.
fn attitude(t: f64, k: usize, size: f64) -> (Matrix3<f64>, Vector3<f64>) {
    let [x, y, z] = [0, 1, 2].map(|i| swing(t, k + i, size));
    let r = Rotation3::from_euler_angles(x[0], y[0], z[0]).into_inner();
    let rx = Rotation3::from_axis_angle(&Vector3::x_axis(), x[0]).into_inner();
    let ry = Rotation3::from_axis_angle(&Vector3::y_axis(), y[0]).into_inner();
    let rate =
        rx.transpose() * (ry.transpose() * Vector3::z() * z[1] + Vector3::y() * y[1]) + Vector3::x() * x[1];
    (r, rate)
}

/// Returns the angular acceleration of [`attitude`]: the derivative of its rate by central differences of
/// order four. Only the truth is made so.
fn change(t: f64, k: usize, size: f64) -> Vector3<f64> {
    let h = 1e-3;
    let w = |n: f64| attitude(t + n * h, k, size).1;
    ((w(1.0) - w(-1.0)) * 8.0 - (w(2.0) - w(-2.0))) / (12.0 * h)
}

/// Returns the rig file of sensors that err by noise alone, on the given number of links.
fn exact_rig(links: usize) -> RigFile {
    RigFile {
        imu: (0..links)
            .map(|link| ImuTable { link, class: Some(ImuClass::Exact), ..ImuTable::default() })
            .collect(),
        load_cell: LoadCellTable { class: Some(LoadCellClass::Exact), ..LoadCellTable::default() },
        tree: TreeTable { class: Some(TreeClass::Exact), ..TreeTable::default() },
        ..RigFile::default()
    }
}

/// Of the wrench, N and N m.
pub const OFFSET: [f64; 6] = [1.0, -2.0, 3.0, 0.1, 0.2, -0.3];
const IMU: [f64; 3] = [0.04, -0.02, 0.03];
const GRAVITY: f64 = 9.80665;

/// Records two links in motion: one IMU each, the arm's attitude, a load cell at the base.
pub fn two_link_recording(model: &Model, rate_hz: f64, seconds: f64, noise: Option<u64>) -> Recording {
    let mut noise = Noise(noise.map(|seed| seed.wrapping_mul(0x2545_f491_4f6c_dd1d)));
    let mut normal = |sigma: f64| noise.normal(sigma);
    let mut recording = Recording { name: "two".to_owned(), rate_hz: Some(rate_hz), ..Recording::default() };
    let mounting = [0.5, 0.5, -0.5, 0.5];
    let to_imu = joints::attitude(&mounting).unwrap().transpose();
    recording.rig = exact_rig(2);
    for (table, position_m) in recording.rig.imu.iter_mut().zip([IMU, [0.0; 3]]) {
        (table.position_m, table.rotation_wxyz) = (position_m, mounting);
    }
    let rows = (seconds * rate_hz) as usize;
    let (mut accel, mut gyros, mut wrench, mut turned) =
        (Vec::new(), [Vec::new(), Vec::new()], Vec::new(), Vec::new());
    for row in 0..rows {
        let t = row as f64 / rate_hz;
        let (r, rate) = attitude(t, 0, 0.35);
        let dw = change(t, 0, 0.35);
        let p = Vector3::new(swing(t, 11, 0.05)[2], swing(t, 12, 0.05)[2], swing(t, 13, 0.05)[2]);
        let force = r.transpose() * (p + Vector3::z() * 9.80665);
        let base = BaseMotion { specific_force: force, rate, angular_acceleration: dw };
        let (joint, spin) = attitude(t, 5, 0.6);
        let q = nalgebra::UnitQuaternion::from_matrix(&joint);
        let positions = [q.w, q.i, q.j, q.k];
        let truth = inverse_dynamics(model, &base, &positions, spin.as_slice(), change(t, 5, 0.6).as_slice())
            .unwrap();
        let lever = Vector3::from(IMU);
        let felt = force + dw.cross(&lever) + rate.cross(&rate.cross(&lever));
        let noisy = |v: Vector3<f64>, n: [f64; 3]| -> [f64; 3] { (to_imu * v + Vector3::from(n)).into() };
        let mut three = |s: f64| [normal(s), normal(s), normal(s)];
        accel.push(noisy(felt, three(0.0)));
        gyros[0].push(noisy(rate, three(1e-4)));
        gyros[1].push(noisy(joint.transpose() * rate + spin, three(1e-4)));
        turned.push(positions);
        wrench.push(std::array::from_fn(|c| truth[c] + OFFSET[c] + normal(if c < 3 { 0.5 } else { 0.03 })));
        recording.time_ns.push((row as f64 * 1e9 / rate_hz).round() as u64);
    }
    let [gyro0, gyro1] = gyros;
    recording.imus = vec![
        ImuColumns { accel: Some(accel), gyro: Some(gyro0) },
        ImuColumns { accel: None, gyro: Some(gyro1) },
    ];
    recording.attitudes = vec![(1, turned)];
    recording.wrench = Some(wrench);
    recording
}

/// Records seven axes in motion: positions, rates if wished, and torques with noise. `rubs` times a friction
/// of 0.7 N m s, 1.5 N m and 0.2 N m is in them.
pub fn seven_axis_recording(
    model: &Model,
    rate_hz: f64,
    seconds: f64,
    rates: bool,
    noise: Option<u64>,
    rubs: f64,
) -> Recording {
    let mut noise = Noise(noise.map(|seed| seed.wrapping_mul(0x2545_f491_4f6c_dd1d)));
    let mut normal = |sigma: f64| noise.normal(sigma);
    let mut recording =
        Recording { name: "seven".to_owned(), rate_hz: Some(rate_hz), ..Recording::default() };
    recording.rig = exact_rig(0);
    let mut columns: Vec<Vec<String>> = vec![Vec::new(); 21];
    let base = BaseMotion::still([0.0, 0.0, -9.80665]);
    for row in 0..(seconds * rate_hz) as usize {
        let t = row as f64 / rate_hz;
        let swings: Vec<[f64; 3]> = (0..7).map(|k| swing(t, 3 * k + 1, 0.8)).collect();
        let part = |n: usize| swings.iter().map(|s| s[n]).collect::<Vec<f64>>();
        let truth = inverse_dynamics(model, &base, &part(0), &part(1), &part(2)).unwrap();
        for k in 0..7 {
            columns[k].push(format!("{:e}", swings[k][0]));
            columns[7 + k].push(format!("{:e}", swings[k][1]));
            let friction = rubs * (0.7 * swings[k][1] + 1.5 * swings[k][1].signum() + 0.2);
            columns[14 + k].push(format!("{:e}", truth[6 + k] + friction + normal(0.3)));
        }
        recording.time_ns.push((row as f64 * 1e9 / rate_hz).round() as u64);
    }
    for (n, cells) in columns.into_iter().enumerate() {
        let unit = ["rad", "radps", "nm"][n / 7];
        if unit != "radps" || rates {
            recording.extra.push((format!("l{}_joint_{unit}", n % 7 + 1), cells));
        }
    }
    recording
}

/// Returns the recording with noise that is correlated over `time_s` on its forces and torques, white if
/// `time_s` is zero. The standard deviations are those of the other recordings: 0.5 N, 0.03 N m, and 0.3 N m
/// for joints.
pub fn with_remembered_noise(recording: &Recording, time_s: f64, seed: u64) -> Recording {
    let mut noise = Noise(Some(seed.wrapping_mul(0x2545_f491_4f6c_dd1d)));
    let rate_hz = recording.rate_hz.unwrap_or(1.0);
    let rho = if time_s > 0.0 { f64::exp(-1.0 / (rate_hz * time_s)) } else { 0.0 };
    let mut course = |sigma: f64| -> Vec<f64> {
        let mut last = noise.normal(sigma);
        let mut next = || {
            let now = last;
            last = rho * last + (1.0 - rho * rho).sqrt() * noise.normal(sigma);
            now
        };
        (0..recording.rows()).map(|_| next()).collect()
    };
    let mut out = recording.clone();
    if let Some(wrench) = &mut out.wrench {
        for c in 0..6 {
            for (row, n) in wrench.iter_mut().zip(course(if c < 3 { 0.5 } else { 0.03 })) {
                row[c] += n;
            }
        }
    }
    for (_, cells) in out.extra.iter_mut().filter(|(name, _)| name.ends_with("_nm")) {
        for (cell, n) in cells.iter_mut().zip(course(0.3)) {
            *cell = format!("{:e}", cell.parse::<f64>().unwrap_or(f64::NAN) + n);
        }
    }
    out
}

/// Returns the same recording by coarse encoders: white noise of `sigma` on the joints' rates, rad/s.
pub fn with_noise_of_rates(recording: &Recording, sigma: f64, seed: u64) -> Recording {
    let mut noise = Noise(Some(seed.wrapping_mul(977)));
    let mut out = recording.clone();
    for (_, cells) in out.extra.iter_mut().filter(|(name, _)| name.ends_with("_radps")) {
        for cell in cells {
            *cell = (cell.parse::<f64>().unwrap_or(f64::NAN) + noise.normal(sigma)).to_string();
        }
    }
    out
}

/// Returns the recording as a load cell with random relative gain errors of standard deviations `sigma`
/// measures it. The wrench offset has no gain error.
pub fn with_gain_errors(recording: &Recording, sigma: [f64; 6], seed: u64) -> Recording {
    let mut noise = Noise(Some(seed.wrapping_mul(0x9e6d_62d0_6f6a_9a9b)));
    let gains = sigma.map(|s| noise.normal(s));
    let mut out = recording.clone();
    for row in out.wrench.iter_mut().flatten() {
        for ((value, gain), offset) in row.iter_mut().zip(gains).zip(OFFSET) {
            *value += gain * (*value - offset);
        }
    }
    out.rig.load_cell.gain_uncertainty = Some(sigma);
    out
}

/// The motion of a tree of spherical and revolute joints at one instant.
#[derive(Clone)]
pub struct TreeInstant {
    /// The base's motion.
    pub base: BaseMotion<f64>,
    /// Coordinates of all joints, as [`inverse_dynamics`] takes them.
    pub positions: Vec<f64>,
    /// Their rates, rad/s.
    pub rates: Vec<f64>,
    /// Their accelerations, rad/s².
    pub accelerations: Vec<f64>,
    /// Attitude relative to the base and rate in its own axes, rad/s, of every link.
    pub links: Vec<(Matrix3<f64>, Vector3<f64>)>,
}

impl TreeInstant {
    /// Returns the motion at a time, s: swings of every joint, and of the base if it moves.
    pub fn new(model: &Model, base_moves: bool, t: f64) -> Self {
        let size = |_: &str, joint: &Joint<f64>| if matches!(joint, Joint::Spherical) { 0.4 } else { 0.5 };
        Self::of_sizes(model, if base_moves { 0.3 } else { 0.0 }, &size, t)
    }

    /// Returns the motion at a time, s, whose swings have these sizes, rad: of the base, held still if zero,
    /// and of the joint of each link.
    pub fn of_sizes(model: &Model, of_base: f64, size: &dyn Fn(&str, &Joint<f64>) -> f64, t: f64) -> Self {
        let base = if of_base > 0.0 {
            let (r, rate) = attitude(t, 0, of_base);
            let force = r.transpose() * Vector3::z() * GRAVITY;
            BaseMotion { specific_force: force, rate, angular_acceleration: change(t, 0, of_base) }
        } else {
            BaseMotion::still([0.0, 0.0, -GRAVITY])
        };
        let mut links = vec![(Matrix3::identity(), base.rate)];
        let (mut q, mut v, mut dv) = (Vec::new(), Vec::new(), Vec::new());
        for (i, link) in model.links.iter().enumerate().skip(1) {
            let (k, size) = (3 * i + 1, size(&link.name, &link.link.joint));
            let (own, spin) = match &link.link.joint {
                Joint::Spherical => {
                    let (own, spin) = attitude(t, k, size);
                    let turn = nalgebra::UnitQuaternion::from_matrix(&own);
                    q.extend([turn.w, turn.i, turn.j, turn.k]);
                    v.extend(spin.iter());
                    dv.extend(change(t, k, size).iter());
                    (own, spin)
                }
                Joint::Revolute(axis) => {
                    let [angle, speed, acceleration] = swing(t, k, size);
                    q.push(angle);
                    v.push(speed);
                    dv.push(acceleration);
                    let axis = nalgebra::Unit::new_normalize(*axis);
                    (Rotation3::from_axis_angle(&axis, angle).into_inner(), axis.into_inner() * speed)
                }
                _ => (Matrix3::identity(), Vector3::zeros()),
            };
            let relative = link.link.rotation * own;
            let (before, carried) = links[link.link.parent];
            links.push((before * relative, relative.transpose() * carried + spin));
        }
        Self { base, positions: q, rates: v, accelerations: dv, links }
    }

    /// Returns the wrench on the base link of these bodies, N and N m; `None` if a joint is neither spherical
    /// nor revolute.
    pub fn wrench(&self, model: &Model) -> Option<[f64; 6]> {
        let all = inverse_dynamics(model, &self.base, &self.positions, &self.rates, &self.accelerations)?;
        all.first_chunk().copied()
    }
}

/// Records a tree of spherical and revolute joints on a base that moves: an IMU on every link, attitudes of
/// all links, the wrench on the base, its offset zero. For people; without noise.
pub fn person_recording(model: &Model, rate_hz: f64, seconds: f64) -> Recording {
    let mut recording =
        Recording { name: "person".to_owned(), rate_hz: Some(rate_hz), ..Recording::default() };
    let links = model.links.len();
    recording.rig = exact_rig(links);
    let mut gyros = vec![Vec::new(); links];
    let mut turned = vec![Vec::new(); links];
    let (mut accel, mut wrench) = (Vec::new(), Vec::new());
    for row in 0..(seconds * rate_hz) as usize {
        let now = TreeInstant::new(model, true, row as f64 / rate_hz);
        wrench.push(now.wrench(model).unwrap_or([f64::NAN; 6]));
        accel.push(now.base.specific_force.into());
        for (i, (attitude, rate)) in now.links.into_iter().enumerate() {
            let turn = nalgebra::UnitQuaternion::from_matrix(&attitude);
            turned[i].push([turn.w, turn.i, turn.j, turn.k]);
            gyros[i].push(rate.into());
        }
        recording.time_ns.push((row as f64 * 1e9 / rate_hz).round() as u64);
    }
    recording.imus = gyros.into_iter().map(|gyro| ImuColumns { accel: None, gyro: Some(gyro) }).collect();
    recording.imus[0].accel = Some(accel);
    recording.attitudes = turned.into_iter().enumerate().skip(1).collect();
    recording.wrench = Some(wrench);
    recording
}

/// Records a tree of revolute joints on a base that is held still: positions, rates if wished, and torques of
/// all joints; without noise.
pub fn arm_recording(model: &Model, rate_hz: f64, seconds: f64, rates: bool) -> Recording {
    let mut recording = Recording { name: "arm".to_owned(), rate_hz: Some(rate_hz), ..Recording::default() };
    recording.rig = exact_rig(0);
    let joints = model.links.len().saturating_sub(1);
    let mut columns: Vec<Vec<String>> = vec![Vec::new(); 3 * joints];
    for row in 0..(seconds * rate_hz) as usize {
        let now = TreeInstant::new(model, false, row as f64 / rate_hz);
        let all = inverse_dynamics(model, &now.base, &now.positions, &now.rates, &now.accelerations);
        let torques = all.map_or_else(|| vec![f64::NAN; joints], |mut all| all.split_off(6));
        let numbers = now.positions.iter().chain(&now.rates).chain(&torques);
        columns.iter_mut().zip(numbers).for_each(|(cells, value)| cells.push(format!("{value:e}")));
        recording.time_ns.push((row as f64 * 1e9 / rate_hz).round() as u64);
    }
    let names = model.links.iter().skip(1).map(|link| link.joint_name.as_str());
    let names =
        ["rad", "radps", "nm"].into_iter().flat_map(|unit| names.clone().map(move |name| (name, unit)));
    for ((name, unit), cells) in names.zip(columns) {
        if unit != "radps" || rates {
            recording.extra.push((format!("{name}_{unit}"), cells));
        }
    }
    recording
}

/// White noise of the sensors of a tree, 1 σ per reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeNoise {
    /// Wrench on the base, N and N m.
    pub wrench: [f64; 6],
    /// Torques of joints, N m.
    pub torque: f64,
    /// Accelerometer of the base, m/s².
    pub accel: f64,
    /// Gyros of the base and of links, rad/s.
    pub gyro: f64,
    /// Attitudes of links, rad about any axis.
    pub attitude: f64,
    /// Positions of joints, rad.
    pub position: f64,
    /// Rates of joints, rad/s.
    pub rate: f64,
}

/// Returns the recording with white noise and a random wrench offset of standard deviations `offset`, N and
/// N m, and that offset.
pub fn with_noise_and_offset(
    recording: &Recording,
    sigma: &TreeNoise,
    offset: [f64; 6],
    seed: u64,
) -> (Recording, [f64; 6]) {
    let mut noise = Noise(Some(seed.wrapping_mul(0x2545_f491_4f6c_dd1d)));
    let offset = offset.map(|sigma| noise.normal(sigma));
    let mut out = recording.clone();
    for row in out.wrench.iter_mut().flatten() {
        for ((value, sigma), offset) in row.iter_mut().zip(sigma.wrench).zip(offset) {
            *value += offset + noise.normal(sigma);
        }
    }
    for imu in &mut out.imus {
        for (signal, sigma) in [(&mut imu.gyro, sigma.gyro), (&mut imu.accel, sigma.accel)] {
            signal.iter_mut().flatten().flatten().for_each(|value| *value += noise.normal(sigma));
        }
    }
    for q in out.attitudes.iter_mut().flat_map(|(_, rows)| rows) {
        let turn = [0; 3].map(|_| noise.normal(sigma.attitude));
        let was = nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]);
        let is = was * nalgebra::UnitQuaternion::from_scaled_axis(turn.into()).into_inner();
        *q = [is.w, is.i, is.j, is.k];
    }
    for (name, cells) in &mut out.extra {
        let of = [("_radps", sigma.rate), ("_rad", sigma.position), ("_nm", sigma.torque)];
        let own = of.iter().find(|(unit, _)| name.ends_with(unit)).map_or(0.0, |(_, sigma)| *sigma);
        for cell in cells.iter_mut().filter(|_| own > 0.0) {
            *cell = format!("{:e}", cell.parse::<f64>().unwrap_or(f64::NAN) + noise.normal(own));
        }
    }
    (out, offset)
}

/// Returns the base parameters of a model's nominal bodies, in the order of `base`.
pub fn truth(model: &Model, base: &BaseParameters) -> Vec<f64> {
    let nominal = model.nominal();
    let skip = nominal.len() - base.standard.len();
    (base.map() * DVector::from_column_slice(&nominal[skip..])).as_slice().to_vec()
}

/// Returns the largest error of a fit over the largest parameter of the same unit; `truth` are its first
/// parameters.
pub fn worst(truth: &[f64], found: &Fit) -> f64 {
    let mut worst: f64 = 0.0;
    for (j, wanted) in truth.iter().enumerate() {
        let alike = truth.iter().zip(&found.parameters).filter(|(_, p)| p.unit == found.parameters[j].unit);
        let scale = alike.map(|(v, _)| v.abs()).fold(0.0, f64::max);
        worst = worst.max((found.estimate.unjudged().values[j] - wanted).abs() / scale);
    }
    worst
}

/// Shares of intervals that hold the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Share of parameters inside their intervals.
    pub inside: f64,
    /// Share of parameters inside their intervals if the intervals did not count autocorrelation.
    pub inside_as_white: f64,
    /// Share of the runs that warned of autocorrelation.
    pub warned: f64,
}

/// Returns how often the intervals of runs with seeds 1 to `runs` hold the truth, which each run gives beside
/// its fit.
pub fn coverage(runs: u64, mut run: impl FnMut(u64) -> (Vec<f64>, Fit)) -> Coverage {
    let (mut inside, mut as_white, mut all, mut warned) = (0.0, 0.0, 0.0, 0.0);
    for seed in 1..=runs {
        let (truth, found) = run(seed);
        warned += f64::from(u8::from(found.channels.iter().any(|c| c.autocorrelation.is_some())));
        for (j, wanted) in truth.iter().enumerate() {
            let Some(m) = found.estimate.measured(j) else { continue };
            let inflation = found.inflation.get(j).copied().unwrap_or(1.0);
            all += 1.0;
            inside += f64::from(u8::from((m.value - wanted).abs() <= m.u95));
            as_white += f64::from(u8::from((m.value - wanted).abs() <= m.u95 / inflation));
        }
    }
    Coverage { inside: inside / all, inside_as_white: as_white / all, warned: warned / runs.max(1) as f64 }
}
