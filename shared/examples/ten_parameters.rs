//! The ten parameters of a body in one's own firmware:
//! `cargo run -p rigident-shared --example ten_parameters`
//!
//! [`Ten`] is all that a microcontroller needs: no heap, no clock, no I/O, single precision, 10 kB of memory.
//! Copy it, and call
//! [`Ten::push`] with each reading. Around it `main` simulates a body, by Newton and Euler about its centre
//! of mass, which shares nothing with the estimator. docs/firmware.md has the words to it.

use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::conditioning::{Conditioner, KernelError};
use rigident_shared::factor::{InformationFactor, Solution};
use rigident_shared::regressor::{SIGNALS, SMOOTHED, block};
use rigident_shared::spatial::{AngularRate, Imu, Position, Sensor, SpecificForce, Wrench};

/// Room for the filter: 0.1 s at 500 readings a second.
const TAPS: usize = 50;
/// Ten parameters, and the six offsets of the load cell.
const N: usize = 16;
/// The number of readings from one row block to the next.
const ROW_EVERY: u16 = 10;

/// The estimator: a filter and a triangle.
pub struct Ten {
    mounting: ImuMounting<f32>,
    filter: Conditioner<f32, SIGNALS, { SIGNALS - SMOOTHED }, TAPS>,
    factor: InformationFactor<f32, N>,
    weight: [f32; 6],
}

impl Ten {
    /// Starts with nothing seen. `position_m` is the IMU's in the load cell's frame, `sigma` the load cell's
    /// noise of a reading, N and N m.
    ///
    /// # Errors
    /// The filter does not fit at this rate.
    pub fn new(rate_hz: f32, position_m: [f32; 3], sigma: [f32; 6]) -> Result<Self, KernelError> {
        let filter = Conditioner::new(rate_hz, 0.1, ROW_EVERY)?;
        // A row block speaks for the readings since the last one.
        let weight = sigma.map(|s| root(f32::from(ROW_EVERY)) / s);
        let mounting = ImuMounting { position: Position::from_array(position_m), ..ImuMounting::PERFECT };
        Ok(Self { mounting, filter, factor: InformationFactor::EMPTY, weight })
    }

    /// Takes a reading. One that is not finite must be left out before.
    pub fn push(&mut self, reading: &Reading<f32>) {
        let Some(filtered) = self.filter.push(&self.mounting.signals(reading)) else { return };
        let rows = block(&self.mounting.mounted(&filtered), &self.mounting.position);
        let mut columns = [[0.0; 6]; N];
        for (column, of_body) in columns.iter_mut().zip(&rows.columns) {
            for ((cell, value), weight) in column.iter_mut().zip(of_body).zip(&self.weight) {
                *cell = value * weight;
            }
        }
        for (channel, weight) in self.weight.iter().enumerate() {
            columns[10 + channel][channel] = *weight;
        }
        let mut wrench = rows.wrench;
        wrench.iter_mut().zip(&self.weight).for_each(|(w, weight)| *w *= weight);
        self.factor.absorb(&columns, &wrench);
    }

    /// Returns what the readings say: m, mc (3), the tensor about the load cell's origin (Ixx, Iyy, Izz, Iyz,
    /// Izx, Ixy), offsets (6), each with its standard deviation, and whether the motion determines it. It
    /// takes milliseconds: call it between readings.
    pub fn answer(&self) -> Solution<f32, N> {
        self.factor.solve()
    }
}

/// Returns a square root without `std`, by Newton's way.
fn root(of: f32) -> f32 {
    let mut x = of.max(1.0);
    for _ in 0..20 {
        x = 0.5 * (x + of / x);
    }
    x
}

/// The simulated body: 3 kg, centre of mass at (0, 10, 50) mm, and its tensor about that, kg m²; and the load
/// cell's offsets.
pub const MASS_KG: f64 = 3.0;
/// The body's centre of mass in S, m.
pub const COM_M: [f64; 3] = [0.0, 0.01, 0.05];
/// The body's principal moments, along the axes of S, kg m².
pub const TENSOR_KGM2: [f64; 3] = [0.006, 0.005, 0.004];
const OFFSET: [f64; 6] = [1.0, -0.5, 2.0, 0.02, -0.01, 0.03];
const IMU_M: [f64; 3] = [0.05, -0.02, 0.03];
const SIGMA: [f64; 6] = [0.1, 0.1, 0.1, 0.005, 0.005, 0.005];
const RATE_HZ: f64 = 500.0;

/// Simulates a motion of the given number of seconds and returns the answer.
///
/// # Errors
/// The filter does not fit.
pub fn identify(seconds: f64, seed: u64) -> Result<Solution<f32, N>, KernelError> {
    let mut ten = Ten::new(RATE_HZ as f32, IMU_M.map(|p| p as f32), SIGMA.map(|s| s as f32))?;
    let mut noise = Noise(seed);
    // Attitude, from S to the earth, by small steps of the rate.
    let mut attitude = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for k in 0..(seconds * RATE_HZ) as u64 {
        let t = k as f64 / RATE_HZ;
        let (rate, turn) = motion(t);
        // The earth's upward axis in S: what an accelerometer reads at rest.
        let at_rest = attitude[2].map(|up| 9.81 * up);
        let at = |place: [f64; 3]| add(at_rest, add(cross(turn, place), cross(rate, cross(rate, place))));
        // About the centre of mass: F = m a, M = I ω̇ + ω × I ω; then to the origin.
        let force = at(COM_M).map(|a| MASS_KG * a);
        let spin: [f64; 3] = core::array::from_fn(|i| TENSOR_KGM2[i] * rate[i]);
        let about: [f64; 3] = core::array::from_fn(|i| TENSOR_KGM2[i] * turn[i]);
        let moment = add(add(about, cross(rate, spin)), cross(COM_M, force));
        let wrench: [f64; 6] = core::array::from_fn(|i| {
            let own = if i < 3 { force[i] } else { moment[i - 3] };
            own + OFFSET[i] + SIGMA[i] * noise.next()
        });
        ten.push(&Reading {
            time_ns: k * 2_000_000,
            wrench: Wrench::<Sensor, f32>::from_array(wrench.map(|w| w as f32)),
            specific_force: SpecificForce::<Imu, f32>::from_array(at(IMU_M).map(|a| a as f32)),
            angular_rate: AngularRate::<Imu, f32>::from_array(rate.map(|w| w as f32)),
        });
        attitude = turned(attitude, motion(t + 0.5 / RATE_HZ).0.map(|w| w / RATE_HZ));
    }
    Ok(ten.answer())
}

/// Returns the rate and its derivative: three axes, each with a frequency of its own.
fn motion(t: f64) -> ([f64; 3], [f64; 3]) {
    let waves = [(2.0, 3.0, 0.0), (1.7, 4.1, 1.0), (2.3, 5.3, 2.0)];
    (
        waves.map(|(a, w, p)| a * (w * t + p).cos()),
        waves.map(|(a, w, p): (f64, f64, f64)| -a * w * (w * t + p).sin()),
    )
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|i| a[i] + b[i])
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns the attitude after a turn by a rotation vector in its own axes (Rodrigues).
fn turned(attitude: [[f64; 3]; 3], by: [f64; 3]) -> [[f64; 3]; 3] {
    let angle = (by[0] * by[0] + by[1] * by[1] + by[2] * by[2]).sqrt();
    if angle == 0.0 {
        return attitude;
    }
    let axis = by.map(|b| b / angle);
    // A row of the attitude is an axis of the earth in S: it turns the other way.
    attitude.map(|row| {
        let along = axis[0] * row[0] + axis[1] * row[1] + axis[2] * row[2];
        let across = cross(axis, row);
        core::array::from_fn(|i| {
            row[i] * angle.cos() - across[i] * angle.sin() + axis[i] * along * (1.0 - angle.cos())
        })
    })
}

/// Noise of variance 1: the sum of twelve even numbers, of a generator after Knuth.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }
}

/// Returns the true values in the order of the answer.
pub fn truth() -> [f64; N] {
    let ([x, y, z], m) = (COM_M, MASS_KG);
    let [a, b, c] = TENSOR_KGM2;
    // Steiner, to the origin of S.
    let ten = [
        m,
        m * x,
        m * y,
        m * z,
        a + m * (y * y + z * z),
        b + m * (z * z + x * x),
        c + m * (x * x + y * y),
        -m * y * z,
        -m * z * x,
        -m * x * y,
    ];
    core::array::from_fn(|i| if i < 10 { ten[i] } else { OFFSET[i - 10] })
}

/// Prints each parameter with its 95 % interval beside the truth.
#[cfg(not(test))]
fn main() {
    let names = "m mcx mcy mcz Ixx Iyy Izz Iyz Izx Ixy fx fy fz mx my mz";
    match identify(20.0, 1) {
        Ok(answer) => {
            for (i, name) in names.split(' ').enumerate() {
                let (value, u95) = (answer.estimate[i], 1.96 * answer.standard_deviation[i]);
                println!("{name:4} {value:10.5} ± {u95:.5}   truth {:8.5}", truth()[i]);
            }
        }
        Err(error) => eprintln!("the filter does not fit: {error:?}"),
    }
}
