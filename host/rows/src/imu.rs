//! An IMU against the motion that it was driven through: turns calibrate the gyro, gravity and accelerations
//! the accelerometer.
//!
//! Each axis reads `b + Σ_j M_j u_j`, with `u` the angular rate or the specific force that the program
//! predicts at the IMU, in its axes as the rig file has them: a bias, a scale (the axis' own `M`) and two
//! misalignments.

use hexapod::{IdealSensors, Trajectory};
use rigident_shared::calibration::Reading;
use rigident_shared::screening::Rejection;

use rigident_fit::{Channel, Kind, Owner, Parameter, RowSource, SampleRows, Timing};

/// Unknowns of one axis: bias, and the answer to each of three axes.
pub const OF_AN_AXIS: usize = 4;
/// Names of the six axes, gyro first.
pub const AXES: [&str; 6] = ["gx", "gy", "gz", "ax", "ay", "az"];
/// The program may have begun this much before and after the first reading, s.
const BEGINS_S: [f64; 2] = [-0.5, 1.0];
/// Steps in which that is searched for, s, before it is refined.
const STEP_S: f64 = 0.01;

/// A recording with the motion behind it.
pub struct ImuRun<'a> {
    trajectory: &'a Trajectory,
    sensors: IdealSensors,
    readings: &'a [Reading<f64>],
    rate_hz: f64,
    /// Of the program's beginning after the first reading.
    begins_s: f64,
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
}

impl<'a> ImuRun<'a> {
    /// Takes a recording of `rate_hz` and the program that was driven; when it began is found by the gyro.
    pub fn new(
        trajectory: &'a Trajectory,
        sensors: IdealSensors,
        readings: &'a [Reading<f64>],
        rate_hz: f64,
    ) -> Self {
        let parameter = |axis: &str, k: usize| {
            let (unit, all) = if axis.starts_with('g') {
                ("rad/s", ["gx", "gy", "gz"])
            } else {
                ("m/s2", ["ax", "ay", "az"])
            };
            match k {
                0 => Parameter::new(
                    format!("bias_{axis}"),
                    Owner::Channel(axis.to_owned()),
                    Kind::Offset,
                    unit,
                ),
                k if all[k - 1] == axis => {
                    Parameter::new(format!("scale_{axis}"), Owner::Channel(axis.to_owned()), Kind::Other, "")
                }
                k => {
                    let name = format!("{axis}_of_{}", &all[k - 1][1..]);
                    Parameter::new(name, Owner::Channel(axis.to_owned()), Kind::Other, "")
                }
            }
        };
        let parameters =
            AXES.iter().flat_map(|axis| (0..OF_AN_AXIS).map(move |k| parameter(axis, k))).collect();
        let channel = |(k, axis): (usize, &str)| Channel {
            name: axis.to_owned(),
            unit: if k < 3 { "rad/s" } else { "m/s2" }.to_owned(),
            sigma: None,
            offset: Some(OF_AN_AXIS * k),
            group: (k / 3) as u8,
        };
        let channels = AXES.into_iter().enumerate().map(channel).collect();
        let mut run = Self { trajectory, sensors, readings, rate_hz, begins_s: 0.0, parameters, channels };
        run.begins_s = run.beginning_s();
        run
    }

    /// Returns when the program began after the first reading, s.
    pub fn begins_s(&self) -> f64 {
        self.begins_s
    }

    /// Seconds after the first reading.
    fn time_s(&self, sample: usize) -> f64 {
        let first_ns = self.readings.first().map_or(0, |r| r.time_ns);
        self.readings.get(sample).map_or(0.0, |r| r.time_ns.saturating_sub(first_ns) as f64 * 1e-9)
    }

    /// Returns what the program predicts, angular rate, rad/s, and specific force, m/s², at a time after the
    /// first reading, s.
    fn expected(&self, time_s: f64, begins_s: f64) -> [[f64; 3]; 2] {
        let (force, rate) = self.sensors.imu(&self.trajectory.state(time_s - begins_s));
        [rate, force]
    }

    /// Returns the scatter of the gyro about the program that begins then; a bias counts nothing.
    fn scatter(&self, begins_s: f64) -> f64 {
        let every = (self.readings.len() / 4000).max(1);
        let (mut sum, mut squares, mut count) = ([0.0; 3], 0.0, 0.0);
        for k in (0..self.readings.len()).step_by(every) {
            let [rate, _] = self.expected(self.time_s(k), begins_s);
            let read = self.readings[k].angular_rate.array();
            let off: [f64; 3] = std::array::from_fn(|i| read[i] - rate[i]);
            if off.iter().all(|v| v.is_finite()) {
                count += 1.0;
                sum.iter_mut().zip(off).for_each(|(sum, v)| *sum += v);
                squares += off.iter().map(|v| v * v).sum::<f64>();
            }
        }
        if count == 0.0 { f64::INFINITY } else { squares - sum.iter().map(|s| s * s).sum::<f64>() / count }
    }

    /// Returns what the program does not explain with these parameters, as a share of the RMS by which the
    /// gyro and the accelerometer vary: near 0 if the IMU was driven through it, near 1 if it was not.
    pub fn unexplained(&self, parameters: &[f64]) -> [f64; 2] {
        // Sums and sums of squares of what was read, and of what the program leaves of it.
        let (mut sums, mut squares) = ([[0.0; 6]; 2], [[0.0; 6]; 2]);
        for (sample, reading) in self.readings.iter().enumerate() {
            let expected = self.expected(self.time_s(sample), self.begins_s);
            let read = [reading.angular_rate.array(), reading.specific_force.array()];
            for (k, value) in read.into_iter().flatten().enumerate().filter(|(_, value)| value.is_finite()) {
                let of = &parameters[OF_AN_AXIS * k..][..OF_AN_AXIS];
                let fitted = of[0] + (0..3).map(|j| of[1 + j] * expected[k / 3][j]).sum::<f64>();
                for (which, value) in [value, value - fitted].into_iter().enumerate() {
                    sums[which][k] += value;
                    squares[which][k] += value * value;
                }
            }
        }
        let count = self.readings.len().max(1) as f64;
        let varies = |which: usize, sensor: usize| -> f64 {
            (3 * sensor..3 * sensor + 3).map(|k| squares[which][k] - sums[which][k].powi(2) / count).sum()
        };
        std::array::from_fn(|sensor| (varies(1, sensor) / varies(0, sensor).max(f64::MIN_POSITIVE)).sqrt())
    }

    fn beginning_s(&self) -> f64 {
        let steps = ((BEGINS_S[1] - BEGINS_S[0]) / STEP_S).round() as i32;
        let (best, _) = (0..=steps)
            .map(|k| BEGINS_S[0] + STEP_S * f64::from(k))
            .map(|at| (at, self.scatter(at)))
            .fold((0.0, f64::INFINITY), |best, now| if now.1 < best.1 { now } else { best });
        let [mut low, mut high] = [best - STEP_S, best + STEP_S];
        for _ in 0..12 {
            let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
            if self.scatter(a) < self.scatter(b) { high = b } else { low = a }
        }
        0.5 * (low + high)
    }
}

impl RowSource for ImuRun<'_> {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        Timing::Uniform { rate_hz: self.rate_hz }
    }

    fn samples(&self) -> usize {
        self.readings.len()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        self.readings.get(sample).map_or(0, |reading| reading.time_ns)
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let Some(reading) = self.readings.get(sample) else { return Err(Rejection::NotFinite(0)) };
        let read = [reading.angular_rate.array(), reading.specific_force.array()];
        let expected = self.expected(self.time_s(sample), self.begins_s);
        let width = self.parameters.len();
        for (k, value) in read.into_iter().flatten().enumerate() {
            if !value.is_finite() {
                return Err(Rejection::NotFinite(k as u8));
            }
            rows.measured[k] = value;
            let row = &mut rows.smoothed[width * k + OF_AN_AXIS * k..][..OF_AN_AXIS];
            row[0] = 1.0;
            row[1..].copy_from_slice(&expected[k / 3]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use hexapod::experiment::thesis_program;
    use rigident_sim::rig::{Readings, RigConfig};

    use super::*;
    use rigident_fit::{FitOptions, Silent, fit};
    use rigident_laboratory::reading;

    /// Gains, misalignments and biases put on what the simulated IMU reads.
    #[test]
    fn scales_misalignments_and_biases_are_found_inside_their_intervals_with_a_late_beginning() {
        let config = RigConfig::thesis_horizontal();
        let program = thesis_program(&config.geometry, 40.0);
        let simulated = Readings::new(&config, &program, 200.0).unwrap();
        let gyro = [[1.01, 0.004, -0.002], [-0.003, 0.99, 0.005], [0.001, -0.006, 1.004]];
        let accel = [[0.985, 0.002, 0.003], [0.004, 1.012, -0.005], [-0.002, 0.006, 0.995]];
        let bias = [0.01, -0.02, 0.015, 0.2, -0.1, 0.15];
        let (mut off, mut largest) = (0, 0.0_f64);
        for seed in 1..=4 {
            let experiment = simulated.truth(seed).experiment;
            let readings: Vec<Reading<f64>> = simulated
                .measured(seed)
                .map(|row| {
                    let turned = |m: &[[f64; 3]; 3], v: [f64; 3], own: [f64; 3], b: &[f64]| {
                        // What the simulated sensor has added of its own is left out of the truth.
                        let v: [f64; 3] = std::array::from_fn(|j| v[j] - own[j]);
                        std::array::from_fn(|i| b[i] + (0..3).map(|j| m[i][j] * v[j]).sum::<f64>())
                    };
                    let mut row = row;
                    row.time_ns += 300_000_000;
                    row.angular_rate =
                        turned(&gyro, row.angular_rate, experiment.gyro_bias_radps, &bias[..3]);
                    row.specific_force =
                        turned(&accel, row.specific_force, experiment.accel_bias_mps2, &bias[3..]);
                    reading(&row)
                })
                .collect();
            let trajectory = program.trajectory().unwrap();
            let sensors = config.payload().sensors().unwrap();
            let run = ImuRun::new(&trajectory, sensors, &readings, 200.0);
            assert!(run.begins_s().abs() < 2e-3, "{}", run.begins_s());
            let found = fit(&run, &FitOptions::default(), &Silent).unwrap();
            let value = |j| found.estimate.measured(j).unwrap().value;
            let values: Vec<f64> = (0..found.parameters.len()).map(value).collect();
            assert!(run.unexplained(&values).iter().all(|share| *share < 0.05));
            for (j, parameter) in found.parameters.iter().enumerate() {
                let (axis, k) = (j / OF_AN_AXIS, j % OF_AN_AXIS);
                let matrix = if axis < 3 { &gyro } else { &accel };
                let truth = if k == 0 { bias[axis] } else { matrix[axis % 3][k - 1] };
                let measured = found.estimate.measured(j).unwrap();
                let error = (measured.value - truth).abs();
                largest = largest.max(error / measured.u95);
                off += usize::from(error > measured.u95);
                let most = if k == 0 { 0.02 } else { 2e-3 };
                assert!(measured.u95 < most, "{}: {measured:?}", parameter.name);
            }
        }
        let readings: Vec<Reading<f64>> = simulated.measured(1).map(|row| reading(&row)).collect();
        let other = thesis_program(&config.geometry, 25.0).trajectory().unwrap();
        let run = ImuRun::new(&other, config.payload().sensors().unwrap(), &readings, 200.0);
        let found = fit(&run, &FitOptions::default(), &Silent).unwrap();
        let values: Vec<f64> = (0..found.parameters.len())
            .map(|j| found.estimate.measured(j).map_or(0.0, |m| m.value))
            .collect();
        assert!(run.unexplained(&values).iter().all(|share| *share > 0.6));
        // Of 96 at 95 %: 5 ± 2.
        assert!(off <= 12 && largest < 3.0, "{off} of 96, the largest at {largest} U95");
    }
}
