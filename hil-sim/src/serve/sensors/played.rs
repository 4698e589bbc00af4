//! The motion of a body as one device samples it, in real time, with what goes wrong on the way.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use hexapod::experiment::thesis_program;
use hexapod::{MotionProgram, Segment};
use nalgebra::{Quaternion, UnitQuaternion};

use crate::rig::{Readings, RigConfig, RigError};

/// Returns the rig's body and the motion that it makes: the thesis' experiment of the given length, s, and
/// home again.
pub fn body_moved(duration_s: f64, seed: u64) -> (RigConfig, MotionProgram) {
    let config = RigConfig::thesis_horizontal().with_seed(seed);
    let mut program = thesis_program(&config.geometry, duration_s);
    program.segments.push(Segment::Move { to: program.start, duration_s: 2.0 });
    program.segments.push(Segment::Hold { duration_s: 2.0 });
    (config, program)
}

/// Returns a rig file for the devices on this rig, as their owner writes it; `more` is added to it.
pub fn sensors_rig_file(config: &RigConfig, more: &str) -> String {
    let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
    let largest = |noise: [f64; 3]| noise.into_iter().fold(0.0_f64, f64::max);
    let norm = config.imu.rotation_wxyz.iter().map(|v| v * v).sum::<f64>().sqrt();
    let body = config.body;
    format!(
        "# A simulated body with sensors of other makes.\n[[imu]]\nclass = \"exact\"\nposition_m = \
         {:?}\nrotation_wxyz = {:?}\n\
         accel_noise_mps2 = {:?}\ngyro_noise_radps = {:?}\n\n[load_cell]\nclass = \"exact\"\nnoise_n_nm = \
         {:?}\n\
         offset_n_nm = \"estimate\"\n\n[truth]\nmass_kg = {:?}\ncom_m = {:?}\ninertia_com_kgm2 = \
         {:?}\n{more}",
        config.imu.position_m,
        config.imu.rotation_wxyz.map(|v| v / norm),
        largest(imu.accel_noise_mps2),
        largest(imu.gyro_noise_radps),
        cell.noise_n_nm,
        body.mass_kg,
        body.com_m,
        body.inertia_com_kgm2,
    )
}

/// Holds one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The wrench on the body, by the sensor, in S, N and N m.
    pub wrench: [f64; 6],
    /// Specific force in U, m/s².
    pub accel: [f64; 3],
    /// Angular rate in U, rad/s.
    pub gyro: [f64; 3],
    /// The pose of S in the earth's axes: x, y, z in m, w, x, y, z.
    pub pose: [f64; 7],
}

/// Tells what goes wrong between a device and whoever listens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delivery {
    /// Share of samples that are lost.
    pub lose: f64,
    /// Samples come up to this much late, s.
    pub jitter_s: f64,
    /// The device falls silent after this long, s.
    pub stops_after_s: Option<f64>,
    /// Every number is multiplied by it: another unit.
    pub scale: f64,
}

impl Default for Delivery {
    fn default() -> Self {
        Self { lose: 0.0, jitter_s: 0.0, stops_after_s: None, scale: 1.0 }
    }
}

/// Tells what one device samples, and when.
#[derive(Clone, Debug)]
pub struct Played {
    samples: Vec<Sample>,
    /// Samples a second of the device's own clock.
    pub rate_hz: f64,
    /// The own clock's reading at the start, s.
    pub zero_s: f64,
    period: Duration,
    delivery: Delivery,
    begun: Instant,
}

impl Played {
    /// Makes a device that samples at `rate_hz` of a clock that is fast by `drift` and begins at `zero_s`;
    /// the motion begins at `begun`.
    ///
    /// # Errors
    /// A motion that the platform cannot make.
    pub fn new(
        (config, program): &(RigConfig, MotionProgram),
        (rate_hz, drift, zero_s): (f64, f64, f64),
        delivery: Delivery,
        begun: Instant,
    ) -> Result<Self, RigError> {
        let real_hz = rate_hz * (1.0 + drift);
        let readings = Readings::new(config, program, real_hz)?;
        let trajectory = program.trajectory()?;
        let [w, x, y, z] = config.load_cell.rotation_wxyz;
        let cell = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let samples = readings
            .measured(config.seed)
            .map(|row| {
                let plate = trajectory.state(row.time_ns as f64 * 1e-9).pose();
                let [w, x, y, z] = plate.quaternion_wxyz();
                let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)) * cell;
                let [px, py, pz] = plate.position_m;
                let scaled = |v: f64| v * delivery.scale;
                Sample {
                    wrench: row.wrench.map(scaled),
                    accel: row.specific_force.map(scaled),
                    gyro: row.angular_rate.map(scaled),
                    pose: [px, py, pz, q.w, q.i, q.j, q.k],
                }
            })
            .collect();
        Ok(Self { samples, rate_hz, zero_s, period: Duration::from_secs_f64(1.0 / real_hz), delivery, begun })
    }

    /// Returns the reading of the own clock at a sample, s.
    pub fn own_s(&self, number: u64) -> f64 {
        self.zero_s + number as f64 / self.rate_hz
    }

    /// Returns a sample; of the end its last second again and again.
    pub fn sample(&self, number: u64) -> Sample {
        let (count, last) = (self.samples.len() as u64, (self.rate_hz as u64).max(1));
        let k = if number < count {
            number
        } else {
            count - last.min(count) + (number - count) % last.min(count)
        };
        self.samples[k as usize]
    }

    /// Returns the number of the next sample that is still to be taken.
    pub fn next(&self) -> u64 {
        (self.begun.elapsed().as_secs_f64() / self.period.as_secs_f64()).ceil() as u64
    }

    /// Returns when a sample is handed over; none if it is lost.
    pub fn due(&self, number: u64) -> Option<Instant> {
        let chance = |salt: u64| {
            // Steele's splitmix64 of the number.
            let mut z = number.wrapping_add(salt).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (z ^ (z >> 31)) as f64 / u64::MAX as f64
        };
        if chance(1) < self.delivery.lose {
            return None;
        }
        let late = Duration::from_secs_f64(self.delivery.jitter_s * chance(2));
        Some(self.begun + self.period.mul_f64(number as f64) + late)
    }

    /// Returns whether the device has fallen silent.
    pub fn is_silent(&self) -> bool {
        self.delivery.stops_after_s.is_some_and(|after_s| self.begun.elapsed().as_secs_f64() > after_s)
    }

    /// Hands samples over, each at its time, until asked to end, or `send` says no.
    pub fn play(&self, leave: &AtomicBool, mut send: impl FnMut(u64, &Sample) -> bool) {
        let mut number = self.next();
        while !leave.load(Ordering::Acquire) {
            if self.is_silent() {
                std::thread::sleep(Duration::from_millis(20));
                continue;
            }
            if let Some(due) = self.due(number) {
                let wait = due.saturating_duration_since(Instant::now());
                if wait > Duration::from_millis(100) {
                    std::thread::sleep(Duration::from_millis(50));
                    continue;
                }
                std::thread::sleep(wait);
                if !send(number, &self.sample(number)) {
                    return;
                }
            }
            number += 1;
        }
    }
}
