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
/// Length of a recording, s.
pub const SECONDS: f64 = 15.0;
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

/// Errors of a rig: 36 of the load cell, then three each of scales and axes of the accelerometer, scales and
/// axes of the gyro, place and attitude of the IMU.
pub const RIG_ERRORS: usize = 54;
/// Errors of a recording beside its offsets: a line and a curve of each channel, biases of gyro and
/// accelerometer, the delay.
pub const RECORDING_ERRORS: usize = 19;

/// Returns the rig file: what is drawn is what is stated.
pub fn rig_file(serial: &str, conditions: &Conditions) -> RigFile {
    let [force, moment, accel, gyro] = NOISE;
    let [gain, crosstalk, place, angle, scale] = conditions.of_rig();
    let [drift, gyro_bias, accel_bias, skew] = conditions.of_recording();
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
    pub mass: f64,
    pub com: Vector3<f64>,
    pub central: Matrix3<f64>,
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
}

/// Returns force and moment about the origin that move a body of ten parameters.
pub fn wrench(parameters: &[f64; 10], there: &There) -> [f64; 6] {
    let [m, x, y, z, xx, yy, zz, yz, zx, xy] = *parameters;
    let There { rate, gained, specific } = there;
    let mc = Vector3::new(x, y, z);
    let i = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let push = m * specific + gained.cross(&mc) + rate.cross(&rate.cross(&mc));
    let moment = mc.cross(specific) + i * gained + rate.cross(&(i * rate));
    [push.x, push.y, push.z, moment.x, moment.y, moment.z]
}

fn draw(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

fn vector(random: &mut ChaCha8Rng, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| sigma * draw(random))
}

/// The conditions of a recording.
#[derive(Clone, Copy, PartialEq)]
pub struct Conditions {
    /// The noise by that which is stated.
    pub noisier: f64,
    /// Noise of this time constant, s, as large as the white one; none if it is zero.
    pub slow_s: f64,
    /// The number that the motion's frequencies are divided by.
    pub slower: f64,
    /// The factor on errors of rig and recording, as drawn and as stated.
    pub errors: f64,
    /// The factor on those of the load cell's gains and cross-talk beside that; zero: a calibrated cell.
    pub cell: f64,
}

impl Conditions {
    /// White noise and errors as they are stated.
    pub const STATED: Self = Self { noisier: 1.0, slow_s: 0.0, slower: 1.0, errors: 1.0, cell: 1.0 };

    /// Returns 1 σ of the errors of a rig, as [`OF_RIG`].
    fn of_rig(&self) -> [f64; 5] {
        let [gain, crosstalk, place, angle, scale] = OF_RIG.map(|sigma| sigma * self.errors);
        [gain * self.cell, crosstalk * self.cell, place, angle, scale]
    }

    /// Returns 1 σ of the errors of a recording, as [`OF_RECORDING`].
    fn of_recording(&self) -> [f64; 4] {
        OF_RECORDING.map(|sigma| sigma * self.errors)
    }

    /// Returns 1 σ of the white noise of force, moment, specific force and angular rate.
    pub fn noise(&self) -> [f64; 4] {
        let [force, moment, accel, gyro] = NOISE;
        [force * self.noisier, moment * self.noisier, accel, gyro]
    }
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
    pub fn new(seed: u64, conditions: &Conditions) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        Self::of(&std::array::from_fn(|_| draw(&mut random)), conditions)
    }

    /// Returns the rig of given errors, each in its standard deviations.
    pub fn of(z: &[f64; RIG_ERRORS], conditions: &Conditions) -> Self {
        let [gain, crosstalk, place, angle, scale] = conditions.of_rig();
        let mut cell = [[0.0; 6]; 6];
        for (to, row) in cell.iter_mut().enumerate() {
            for (from, entry) in row.iter_mut().enumerate() {
                let z = z[6 * to + from];
                *entry = if to == from { 1.0 + gain * z } else { crosstalk * RANGE[to] / RANGE[from] * z };
            }
        }
        let three = |first: usize, sigma: f64| sigma * Vector3::new(z[first], z[first + 1], z[first + 2]);
        let accel = Matrix3::from_diagonal(&three(36, scale));
        // Axes that are not square: x leans towards y and z, y towards z.
        let lean = three(39, angle);
        let lean = Matrix3::new(0.0, lean.x, lean.y, 0.0, 0.0, lean.z, 0.0, 0.0, 0.0);
        let gyro = Matrix3::from_diagonal(&three(42, scale));
        let turned = Rotation3::new(three(45, angle)).into_inner();
        Self {
            cell,
            place: Vector3::from(LEVER) + three(48, place),
            attitude: Rotation3::new(three(51, angle)),
            accel: Matrix3::identity() + accel + lean,
            gyro: (Matrix3::identity() + gyro) * turned,
        }
    }

    /// Returns the wrench that the load cell reads of one that is there, without its offset.
    fn of_cell(&self, exact: &[f64; 6]) -> [f64; 6] {
        self.cell.map(|row| row.iter().zip(exact).map(|(a, b)| a * b).sum())
    }

    /// Returns the wrench that the load cell would read, if the IMU reads what an ideal one at the nominal
    /// place reads of the motion; errors of the recording are in their standard deviations. `exact` is the
    /// wrench that is there.
    pub fn wrench_read(
        &self,
        exact: impl Fn(&There) -> [f64; 6],
        motion: &Motion,
        t: f64,
        own: &[f64; RECORDING_ERRORS],
        conditions: &Conditions,
    ) -> [f64; 6] {
        let [drift, gyro_bias, accel_bias, skew] = conditions.of_recording();
        let of = |first: usize, sigma: f64| sigma * Vector3::new(own[first], own[first + 1], own[first + 2]);
        let seen = motion.at(t - skew * own[18]);
        let lever = Vector3::from(LEVER);
        let read = seen.specific + seen.gained.cross(&lever) + seen.rate.cross(&seen.rate.cross(&lever));
        let turn = |inverse: Option<Matrix3<f64>>| self.attitude * inverse.unwrap_or_else(Matrix3::identity);
        let (gyro, accel) = (turn(self.gyro.try_inverse()), turn(self.accel.try_inverse()));
        let rate = gyro * (seen.rate - of(12, gyro_bias));
        let gained = gyro * seen.gained;
        let arm = self.place;
        let specific =
            accel * (read - of(15, accel_bias)) - gained.cross(&arm) - rate.cross(&rate.cross(&arm));
        let mut wrench = self.of_cell(&exact(&There { rate, gained, specific }));
        let s = 2.0 * t / (SECONDS - 1.0 / RATE_HZ) - 1.0;
        for (c, wrench) in wrench.iter_mut().enumerate() {
            *wrench += drift * RANGE[c] * (own[2 * c] * s + own[2 * c + 1] * (1.5 * s * s - 0.5));
        }
        wrench
    }

    /// Returns the readings of a recording: what is its own, and its motion, are drawn by the seed.
    pub fn record(&self, body: &Body, seed: u64, conditions: &Conditions) -> Vec<Reading<f64>> {
        let parameters = body.parameters();
        self.record_of(|_, there| wrench(&parameters, there), seed, conditions)
    }

    /// Returns the same of a machine, on which this wrench acts at a time, s.
    pub fn record_of(
        &self,
        exact: impl Fn(f64, &There) -> [f64; 6],
        seed: u64,
        conditions: &Conditions,
    ) -> Vec<Reading<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let motion = Motion::new(&mut random, conditions.slower);
        let [drifting, gyro_bias, accel_bias, skew] = conditions.of_recording();
        let noise = conditions.noise();
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
                let sums = self.of_cell(&exact(t, &there));
                let late = motion.at(t + skew);
                let arm = self.place;
                let read = late.specific + late.gained.cross(&arm) + late.rate.cross(&late.rate.cross(&arm));
                let read = self.accel * (self.attitude.inverse() * read) + accel_bias;
                let turned = self.gyro * (self.attitude.inverse() * late.rate) + gyro_bias;
                let s = 2.0 * n as f64 / (last - 1) as f64 - 1.0;
                let wrench = std::array::from_fn(|c| {
                    let [constant, line, curve] = offsets[c];
                    let sigma = noise[usize::from(c > 2)];
                    let drift = constant + line * s + curve * (1.5 * s * s - 0.5);
                    if conditions.slow_s > 0.0 {
                        slow[c] = kept * slow[c] + (1.0 - kept * kept).sqrt() * sigma * draw(&mut random);
                    }
                    sums[c] + drift + slow[c] + sigma * draw(&mut random)
                });
                let accel = std::array::from_fn(|k| read[k] + noise[2] * draw(&mut random));
                let gyro = std::array::from_fn(|k| turned[k] + noise[3] * draw(&mut random));
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
pub struct Motion {
    /// Amplitude, rad or m; frequency, rad/s; phase: three of each of six.
    sines: [[[f64; 3]; 3]; 6],
}

/// Rate and its slope in the body's axes, and the specific force at the origin.
#[derive(Clone, Copy)]
pub struct There {
    pub rate: Vector3<f64>,
    pub gained: Vector3<f64>,
    pub specific: Vector3<f64>,
}

impl Motion {
    /// Returns the motion of the recording of a seed.
    pub fn of_seed(seed: u64, slower: f64) -> Self {
        Self::new(&mut ChaCha8Rng::seed_from_u64(seed), slower)
    }

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

    /// Returns the motion at a time, s.
    pub fn at(&self, t: f64) -> There {
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
