//! A laboratory with rigs whose errors outlive a recording, by Newton and Euler: nothing of it is the
//! estimator's.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::rig::RigFile;
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

/// Readings per second.
pub const RATE_HZ: f64 = 100.0;
const SECONDS: f64 = 15.0;
const G: f64 = 9.80665;
const LEVER: [f64; 3] = [0.05, -0.02, 0.03];
/// Full scale of the load cell, N and N m.
const RANGE: [f64; 6] = [200.0, 200.0, 200.0, 10.0, 10.0, 10.0];
/// 1 σ of the errors of a rig: gains; cross-talk as a share of the range; place of the IMU, m; its attitude
/// and angles between axes, rad; scales of its axes.
const OF_RIG: [f64; 5] = [0.005, 0.002, 0.0015, 0.003, 0.002];
/// 1 σ of the errors of a recording: drift as a share of the range; biases of gyro and accelerometer, rad/s
/// and m/s²; delay, s.
const OF_RECORDING: [f64; 4] = [2e-4, 0.003, 0.02, 3e-4];
/// Noise of a reading: N, N m, m/s², rad/s.
const NOISE: [f64; 4] = [0.1, 0.004, 0.02, 1e-3];

/// Returns the rig file: what is drawn is what is stated.
pub fn rig_file(serial: &str, errors: f64) -> RigFile {
    let [force, moment, accel, gyro] = NOISE;
    let [gain, crosstalk, place, angle, scale] = OF_RIG.map(|sigma| sigma * errors);
    let [drift, gyro_bias, accel_bias, skew] = OF_RECORDING.map(|sigma| sigma * errors);
    let drift = RANGE.map(|range| range * drift);
    let gain = [gain; 6];
    let text = format!(
        "[recording]\ngravity_std_mps2 = 1e-6\n[[imu]]\nserial = {serial:?}\nposition_m = {LEVER:?}\n\
         accel_noise_mps2 = {accel}\ngyro_noise_radps = {gyro}\nposition_std_m = {place}\n\
         rotation_std_rad = {angle}\nskew_std_s = {skew}\naccel_bias_std_mps2 = {accel_bias}\n\
         accel_gain_std = {scale}\naccel_misalignment_std_rad = {angle}\n\
         gyro_bias_std_radps = {gyro_bias}\ngyro_gain_std = {scale}\ngyro_rotation_std_rad = {angle}\n\
         [load_cell]\nserial = {serial:?}\n\
         noise_n_nm = [{force}, {force}, {force}, {moment}, {moment}, {moment}]\n\
         gain_uncertainty = {gain:?}\ncrosstalk_std = {crosstalk}\n\
         drift_std_n_nm = {drift:?}\nrange_n_nm = {RANGE:?}\n"
    );
    RigFile::parse(&text).unwrap()
}

/// A rigid body: mass, kg; centre of mass, m; tensor about it, kg m².
#[derive(Clone, Copy)]
pub struct Body {
    mass: f64,
    com: Vector3<f64>,
    central: Matrix3<f64>,
}

impl Body {
    /// Returns a body of a mass, about 0.3 m large.
    pub fn of_mass(mass: f64) -> Self {
        let central = Matrix3::new(0.021, 0.0015, -0.002, 0.0015, 0.017, 0.001, -0.002, 0.001, 0.012);
        Self { mass, com: Vector3::new(0.02, -0.03, 0.06), central: central * (mass / 3.2) }
    }

    /// Returns its tensor about the origin of S.
    fn tensor(&self) -> Matrix3<f64> {
        let c = self.com;
        self.central + self.mass * (Matrix3::identity() * c.norm_squared() - c * c.transpose())
    }

    /// Returns its ten parameters in the order m, mc, Ixx, Iyy, Izz, Iyz, Izx, Ixy.
    pub fn parameters(&self) -> [f64; 10] {
        let (mc, i) = (self.mass * self.com, self.tensor());
        [self.mass, mc.x, mc.y, mc.z, i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(1, 2)], i[(2, 0)], i[(0, 1)]]
    }

    /// Returns force and moment about the origin that move it: angular rate and acceleration, and the
    /// specific force at the origin.
    fn wrench(&self, rate: Vector3<f64>, gained: Vector3<f64>, specific: Vector3<f64>) -> [f64; 6] {
        let c = self.com;
        let push = self.mass * (specific + gained.cross(&c) + rate.cross(&rate.cross(&c)));
        let i = self.tensor();
        let moment = self.mass * c.cross(&specific) + i * gained + rate.cross(&(i * rate));
        [push.x, push.y, push.z, moment.x, moment.y, moment.z]
    }
}

fn draw(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

fn vector(random: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sigma * draw(random))
}

/// The conditions of a recording.
#[derive(Clone, Copy)]
pub struct Conditions {
    /// The noise by that which is stated.
    pub noisier: f64,
    /// Noise of this time constant, s, as large as the white one; none if it is zero.
    pub slow_s: f64,
    /// The number that the motion's frequencies are divided by.
    pub slower: f64,
    /// The factor on errors of rig and recording, as drawn and as stated.
    pub errors: f64,
}

impl Conditions {
    /// White noise and errors as they are stated.
    pub const STATED: Self = Self { noisier: 1.0, slow_s: 0.0, slower: 1.0, errors: 1.0 };
}

/// Errors that all recordings of a rig share.
pub struct Rig {
    /// The wrench read by the wrench that is there.
    cell: [[f64; 6]; 6],
    place: Vector3<f64>,
    attitude: Rotation3<f64>,
    accel: Matrix3<f64>,
    gyro: Matrix3<f64>,
}

impl Rig {
    /// Draws a rig.
    pub fn new(seed: u64, errors: f64) -> Self {
        let [gain, crosstalk, place, angle, scale] = OF_RIG.map(|sigma| sigma * errors);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut cell = [[0.0; 6]; 6];
        for (to, row) in cell.iter_mut().enumerate() {
            for (from, entry) in row.iter_mut().enumerate() {
                let z = draw(&mut random);
                *entry = if to == from { 1.0 + gain * z } else { crosstalk * RANGE[to] / RANGE[from] * z };
            }
        }
        let accel = Matrix3::from_diagonal(&vector(&mut random, scale));
        // Axes that are not square: x leans towards y and z, y towards z.
        let lean = vector(&mut random, angle);
        let lean = Matrix3::new(0.0, lean.x, lean.y, 0.0, 0.0, lean.z, 0.0, 0.0, 0.0);
        let gyro = Matrix3::from_diagonal(&vector(&mut random, scale));
        let turned = Rotation3::new(vector(&mut random, angle)).into_inner();
        Self {
            cell,
            place: Vector3::from(LEVER) + vector(&mut random, place),
            attitude: Rotation3::new(vector(&mut random, angle)),
            accel: Matrix3::identity() + accel + lean,
            gyro: (Matrix3::identity() + gyro) * turned,
        }
    }

    /// Returns the readings of a recording: what is its own, and its motion, are drawn by the seed.
    pub fn record(&self, body: &Body, seed: u64, conditions: &Conditions) -> Vec<Reading<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let motion = Motion::new(&mut random, conditions.slower);
        let [drifting, gyro_bias, accel_bias, skew] = OF_RECORDING.map(|sigma| sigma * conditions.errors);
        let mut slow = [0.0; 6];
        let kept = (-1.0 / (RATE_HZ * conditions.slow_s.max(1e-6))).exp();
        let skew = skew * draw(&mut random);
        let (gyro_bias, accel_bias) = (vector(&mut random, gyro_bias), vector(&mut random, accel_bias));
        let offsets: [[f64; 3]; 6] = std::array::from_fn(|c| {
            let own = |share: f64, random: &mut ChaCha8Rng| share * RANGE[c] * draw(random);
            [own(0.01, &mut random), own(drifting, &mut random), own(drifting, &mut random)]
        });
        let last = (SECONDS * RATE_HZ) as u64;
        (0..last)
            .map(|n| {
                let t = n as f64 / RATE_HZ;
                let there = motion.at(t);
                let exact = body.wrench(there.rate, there.gained, there.specific);
                let late = motion.at(t + skew);
                let arm = self.place;
                let read = late.specific + late.gained.cross(&arm) + late.rate.cross(&late.rate.cross(&arm));
                let read = self.accel * (self.attitude.inverse() * read) + accel_bias;
                let turned = self.gyro * (self.attitude.inverse() * late.rate) + gyro_bias;
                let s = 2.0 * n as f64 / (last - 1) as f64 - 1.0;
                let wrench = std::array::from_fn(|c| {
                    let sum: f64 = self.cell[c].iter().zip(&exact).map(|(a, b)| a * b).sum();
                    let [constant, line, curve] = offsets[c];
                    let sigma = conditions.noisier * NOISE[usize::from(c > 2)];
                    let drift = constant + line * s + curve * (1.5 * s * s - 0.5);
                    if conditions.slow_s > 0.0 {
                        slow[c] = kept * slow[c] + (1.0 - kept * kept).sqrt() * sigma * draw(&mut random);
                    }
                    sum + drift + slow[c] + sigma * draw(&mut random)
                });
                let accel = std::array::from_fn(|k| read[k] + NOISE[2] * draw(&mut random));
                let gyro = std::array::from_fn(|k| turned[k] + NOISE[3] * draw(&mut random));
                Reading {
                    time_ns: n * 10_000_000,
                    wrench: Wrench::from_array(wrench),
                    specific_force: SpecificForce::from_array(accel),
                    angular_rate: AngularRate::from_array(gyro),
                }
            })
            .collect()
    }
}

/// A platform's motion: three angles and three ways, each a sum of sines.
struct Motion {
    /// Amplitude, rad or m; frequency, rad/s; phase: three of each of six.
    sines: [[[f64; 3]; 3]; 6],
}

/// Rate and its slope in the body's axes, and the specific force at the origin.
struct There {
    rate: Vector3<f64>,
    gained: Vector3<f64>,
    specific: Vector3<f64>,
}

impl Motion {
    fn new(random: &mut ChaCha8Rng, slower: f64) -> Self {
        let mut sines = [[[0.0; 3]; 3]; 6];
        for (axis, sums) in sines.iter_mut().enumerate() {
            for (k, [amplitude, frequency, phase]) in sums.iter_mut().enumerate() {
                let hz = 0.2 + 0.45 * k as f64 + 0.07 * axis as f64 + 0.02 * draw(random);
                *frequency = std::f64::consts::TAU * hz / slower;
                *amplitude = if axis < 3 { 0.12 } else { 0.02 } * (1.0 + 0.2 * draw(random));
                *phase = draw(random) * 3.0;
            }
        }
        Self { sines }
    }

    /// Returns the n-th slope of a coordinate.
    fn slope(&self, axis: usize, order: u8, t: f64) -> f64 {
        let of = |[a, w, phase]: &[f64; 3]| {
            let x = w * t + phase;
            match order {
                0 => a * x.sin(),
                1 => a * w * x.cos(),
                _ => -a * w * w * x.sin(),
            }
        };
        self.sines[axis].iter().map(of).sum()
    }

    fn rate(&self, t: f64) -> Vector3<f64> {
        let [(sr, cr), (sp, cp)] = [0, 1].map(|axis| self.slope(axis, 0, t).sin_cos());
        let [r, p, y] = [0, 1, 2].map(|axis| self.slope(axis, 1, t));
        Vector3::new(r - y * sp, p * cr + y * cp * sr, -p * sr + y * cp * cr)
    }

    fn at(&self, t: f64) -> There {
        let [r, p, y] = [0, 1, 2].map(|axis| self.slope(axis, 0, t));
        let attitude = Rotation3::from_euler_angles(r, p, y);
        let way = Vector3::from_fn(|k, _| self.slope(3 + k, 2, t));
        let h = 1e-4;
        let gained = (8.0 * (self.rate(t + h) - self.rate(t - h))
            - (self.rate(t + 2.0 * h) - self.rate(t - 2.0 * h)))
            / (12.0 * h);
        There { rate: self.rate(t), gained, specific: attitude.inverse() * (way + Vector3::new(0.0, 0.0, G)) }
    }
}
