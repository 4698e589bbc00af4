//! The recordings of the sensors of a rig with errors.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident::recording::{ImuColumns, Recording};
use rigident::rig::RigFile;

use super::super::problem::Normal;
use super::errors::{Errors, FULL_SCALE, Noise};
use super::mechanics::{Body, Motion, State};

pub const RATE_HZ: f64 = 200.0;
pub const DURATION_S: f64 = 25.0;
/// Density of air, kg/m³.
const AIR: f64 = 1.2;
/// The point where a cable is fastened, a lost part is, and a swinging part hangs, in S, m.
const SPOT: [f64; 3] = [0.05, 0.03, 0.12];
/// Correlation times of the flicker noise, octaves apart, s.
const OCTAVES: usize = 13;

/// Motions that a rigid body on a rigid mount with one gravity does not make, and sensors that fail in ways
/// that no column represents.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disturbance {
    /// The IMU's samples are taken this much off their stamps, rms, s.
    pub jitter_s: f64,
    /// Each channel's offset goes to this many times its noise, with a time constant of 8 s.
    pub exponential: f64,
    /// Frequency at which flicker noise of the load cell is as strong as the white, Hz.
    pub flicker_hz: f64,
    /// Air that the body displaces, m³.
    pub volume_m3: f64,
    /// Stiffness of a cable to the ground, N/m.
    pub cable_npm: f64,
    /// C_d A, m².
    pub drag_m2: f64,
    /// A part of the body on a spring: mass, kg, and natural frequency, Hz.
    pub elastic: Option<(f64, f64)>,
    /// Mass lost at half time, kg.
    pub lost_kg: f64,
    /// The part that moves at half time: mass, kg, and how far along x, m.
    pub moved: Option<(f64, f64)>,
    /// Range of the accelerometer that nobody stated, m/s².
    pub clip_mps2: Option<f64>,
}

/// A rig with a body on it.
#[derive(Clone, Copy, Debug)]
pub struct Rig {
    pub body: Body,
    pub noise: Noise,
    pub errors: Errors,
    pub disturbance: Disturbance,
    pub rate_hz: f64,
    pub duration_s: f64,
}

impl Rig {
    pub fn lab() -> Self {
        Self {
            body: Body::lab(),
            noise: Noise::lab(),
            errors: Errors::default(),
            disturbance: Disturbance::default(),
            rate_hz: RATE_HZ,
            duration_s: DURATION_S,
        }
    }
}

/// Returns the nominal place of the IMU in S, m.
pub fn nominal_position() -> Vector3<f64> {
    Vector3::new(0.04, -0.03, 0.02)
}

/// Returns the nominal attitude of the IMU in S.
fn nominal_attitude() -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(0.2, -0.4, 1.1)
}

/// Returns the rig file of somebody who knows the standard deviations `known`.
pub fn rig_file(known: &Errors, noise: &Noise) -> RigFile {
    let q = nominal_attitude();
    let text = known.rig_file(&nominal_position(), &[q.w, q.i, q.j, q.k], noise);
    RigFile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

impl Rig {
    /// Records the motion; all noise follows from the seed.
    pub fn record(&self, motion: &Motion, rig: &RigFile, seed: u64) -> Recording {
        let mut normal = Normal::new(seed);
        let count = (self.duration_s * self.rate_hz) as usize;
        let times: Vec<f64> = (0..count).map(|k| k as f64 / self.rate_hz).collect();
        let loads = self.loads(motion, &times);
        let wrench = self.cell(&times, loads, &mut normal);
        let (accel, gyro) = self.imu(motion, &times, &mut normal);
        Recording {
            name: "simulated".to_owned(),
            rig: rig.clone(),
            time_ns: times.iter().map(|t| (t * 1e9).round() as u64).collect(),
            rate_hz: Some(self.rate_hz),
            wrench: Some(wrench),
            imus: vec![ImuColumns { accel: Some(accel), gyro: Some(gyro) }],
            ..Recording::default()
        }
    }

    /// Returns the loads on the cell, on-body sign.
    fn loads(&self, motion: &Motion, times: &[f64]) -> Vec<[f64; 6]> {
        let spot = Vector3::from(SPOT);
        let half = 0.5 * self.duration_s;
        let begin = motion.state(0.0).attitude * spot;
        let Disturbance { volume_m3, cable_npm, drag_m2, elastic, lost_kg, moved, .. } = self.disturbance;
        let mut swing = elastic.map(|(mass, hz)| Swing::new(mass, hz, spot));
        let mut of = |t: f64| {
            let state = motion.state(t);
            let late = t >= half;
            let body = match (elastic, moved) {
                (Some((mass, _)), _) => self.body.without(mass, &spot),
                (_, Some((mass, by))) if late => {
                    self.body.without(mass, &spot).without(-mass, &(spot + Vector3::x() * by))
                }
                _ if late && lost_kg > 0.0 => self.body.without(lost_kg, &spot),
                _ => self.body,
            };
            let (mut force, mut moment) = body.wrench(&state);
            let mut from_outside = |own: Vector3<f64>, at: &Vector3<f64>| {
                force -= own;
                moment -= at.cross(&own);
            };
            let up = state.attitude.transpose() * Vector3::z();
            from_outside(up * (AIR * volume_m3 * super::mechanics::GRAVITY), &self.body.com);
            let stretched = state.attitude.transpose() * (state.attitude * spot - begin);
            from_outside(-stretched * cable_npm, &spot);
            let centre = self.body.com + spot;
            let speed = state.rate.cross(&centre);
            from_outside(-speed * (0.5 * AIR * drag_m2 * speed.norm()), &centre);
            if let Some(swing) = &mut swing {
                let own = swing.step(motion, t, 1.0 / self.rate_hz, &state);
                from_outside(-own, &spot);
            }
            [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        };
        times.iter().map(|t| of(*t)).collect()
    }

    /// Returns what the load cell reads of these loads.
    fn cell(&self, times: &[f64], loads: Vec<[f64; 6]>, normal: &mut Normal) -> Vec<[f64; 6]> {
        let Errors { cell_gain, crosstalk, drift, .. } = &self.errors;
        let mut flicker: [Flicker; 6] = self
            .noise
            .cell
            .map(|sigma| Flicker::new(sigma, self.disturbance.flicker_hz, self.rate_hz, normal));
        let pairs = times.iter().zip(loads);
        pairs
            .map(|(t, load)| {
                let at = 2.0 * t / self.duration_s - 1.0;
                std::array::from_fn(|to| {
                    let leaked: f64 = (0..6)
                        .map(|from| crosstalk[to][from] * FULL_SCALE[to] / FULL_SCALE[from] * load[from])
                        .sum();
                    let moved = drift[0][to] * at + drift[1][to] * 0.5 * (3.0 * at * at - 1.0);
                    let sigma = self.noise.cell[to];
                    let settled = self.disturbance.exponential * sigma * (1.0 - (-t / 8.0).exp());
                    let noise = sigma * normal.draw() + flicker[to].next(normal);
                    load[to] * (1.0 + cell_gain[to]) + leaked + moved + settled + noise
                })
            })
            .collect()
    }

    /// Returns what accelerometer and gyro read.
    fn imu(&self, motion: &Motion, times: &[f64], normal: &mut Normal) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let Errors { lever_arm, rotation, skew, .. } = &self.errors;
        let position = nominal_position() + Vector3::from(*lever_arm);
        let turned =
            Rotation3::new(Vector3::from(*rotation)).matrix() * nominal_attitude().to_rotation_matrix();
        let to_imu: Matrix3<f64> = turned.transpose();
        times
            .iter()
            .map(|t| {
                let off = self.disturbance.jitter_s * normal.draw();
                let state = motion.state(t - skew + off);
                let (accel, gyro) =
                    (self.accel(&(to_imu * state.force_at(&position))), self.gyro(&(to_imu * state.rate)));
                let clip = self.disturbance.clip_mps2.unwrap_or(f64::INFINITY);
                (
                    accel.map(|v| (v + self.noise.accel * normal.draw()).clamp(-clip, clip)),
                    gyro.map(|v| v + self.noise.gyro * normal.draw()),
                )
            })
            .unzip()
    }

    fn accel(&self, force: &Vector3<f64>) -> [f64; 3] {
        let Errors { accel_bias, accel_gain, misalignment, .. } = &self.errors;
        let [yx, zx, zy] = misalignment;
        let read = [
            force.x * (1.0 + accel_gain[0]),
            force.y * (1.0 + accel_gain[1]) + yx * force.x,
            force.z * (1.0 + accel_gain[2]) + zx * force.x + zy * force.y,
        ];
        std::array::from_fn(|k| read[k] + accel_bias[k])
    }

    fn gyro(&self, rate: &Vector3<f64>) -> [f64; 3] {
        let Errors { gyro_bias, gyro_gain, gyro_rotation, .. } = &self.errors;
        let rate = Rotation3::new(Vector3::from(*gyro_rotation)).inverse() * rate;
        std::array::from_fn(|k| rate[k] * (1.0 + gyro_gain[k]) + gyro_bias[k])
    }
}

/// Flicker noise: a sum of first-order processes, an octave apart, of equal variance.
pub struct Flicker {
    /// Value and decay from sample to sample.
    parts: [(f64, f64); OCTAVES],
    sigma: f64,
}

impl Flicker {
    /// Returns 1/f noise as strong as white noise of `sigma` at `corner_hz`: with the variance v an octave
    /// its density is `v / (ln 2 f)`, that of the white noise `2 σ² / rate`.
    pub fn new(sigma: f64, corner_hz: f64, rate_hz: f64, normal: &mut Normal) -> Self {
        let sigma = sigma * (2.0 * 2.0_f64.ln() * corner_hz / rate_hz).sqrt();
        let part = |k: usize| (sigma * normal.draw(), (-TAU * 0.01 * 2.0_f64.powi(k as i32) / rate_hz).exp());
        let mut part = part;
        Self { parts: std::array::from_fn(&mut part), sigma }
    }

    /// Returns the next sample.
    pub fn next(&mut self, normal: &mut Normal) -> f64 {
        if self.sigma == 0.0 {
            return 0.0;
        }
        for (value, decay) in &mut self.parts {
            *value = *decay * *value + self.sigma * (1.0 - *decay * *decay).sqrt() * normal.draw();
        }
        self.parts.iter().map(|p| p.0).sum()
    }
}

/// A point mass on a spring that pulls alike to all sides: `m (a + q̈) = −k q − d q̇`, a being the specific
/// force less its value at rest.
struct Swing {
    mass: f64,
    /// rad/s
    natural: f64,
    at: Vector3<f64>,
    place: Vector3<f64>,
    speed: Vector3<f64>,
}

/// Damping ratio of what swings.
const DAMPING: f64 = 0.03;
/// Steps of its motion between two samples.
const STEPS: usize = 4;

impl Swing {
    fn new(mass: f64, hz: f64, at: Vector3<f64>) -> Self {
        let zero = Vector3::zeros();
        Self { mass, natural: TAU * hz, at, place: zero, speed: zero }
    }

    /// Returns the force that the body exerts on it at a time, after which it goes on to the next sample.
    fn step(&mut self, motion: &Motion, t: f64, period: f64, state: &State) -> Vector3<f64> {
        let (w, d) = (self.natural, DAMPING);
        if t == 0.0 {
            self.place = -state.force_at(&self.at) / (w * w);
        }
        let force = -(self.place * (w * w) + self.speed * (2.0 * d * w)) * self.mass;
        let h = period / STEPS as f64;
        for k in 0..STEPS {
            let at = |by: f64| motion.state(t + (k as f64 + by) * h).force_at(&self.at);
            let (a, b, c) = (at(0.0), at(0.5), at(1.0));
            let slope = |x: &Vector3<f64>, v: &Vector3<f64>, f: &Vector3<f64>| {
                (*v, -f - x * (w * w) - v * (2.0 * d * w))
            };
            let (x, v) = (self.place, self.speed);
            let k1 = slope(&x, &v, &a);
            let k2 = slope(&(x + k1.0 * (0.5 * h)), &(v + k1.1 * (0.5 * h)), &b);
            let k3 = slope(&(x + k2.0 * (0.5 * h)), &(v + k2.1 * (0.5 * h)), &b);
            let k4 = slope(&(x + k3.0 * h), &(v + k3.1 * h), &c);
            self.place += (k1.0 + (k2.0 + k3.0) * 2.0 + k4.0) * (h / 6.0);
            self.speed += (k1.1 + (k2.1 + k3.1) * 2.0 + k4.1) * (h / 6.0);
        }
        force
    }
}
