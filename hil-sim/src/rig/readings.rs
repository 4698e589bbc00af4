//! Float readings at one rate, as they come out of the drivers and the alignment: no registers, no events.
//!
//! The physics is computed once per motion; every experiment (seed) then only costs its noise.

use super::Truth;
use super::config::{Mechanics, RigConfig, RigError};
use crate::sensors::{ImuChain, LoadCellChain, SensorModels};
use hexapod::MotionProgram;

/// One row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingRow {
    /// Time in the program, ns.
    pub time_ns: u64,
    /// Wrench on the body in S, offset included, N, N m.
    pub wrench: [f64; 6],
    /// Specific force at U's origin in U, uncorrected, m/s².
    pub specific_force: [f64; 3],
    /// Angular rate in U, uncorrected, rad/s.
    pub angular_rate: [f64; 3],
}

/// Everything that one motion makes two perfect sensors read.
#[derive(Clone, Debug)]
pub struct Readings {
    sensors: SensorModels,
    mechanics: Mechanics,
    end: hexapod::FrameMotion,
    rows: Vec<ReadingRow>,
}

impl Readings {
    /// Returns rows of `program` at `rate_hz`, the first at its start, the last at or before its end. Delays
    /// that the rig file states are taken off, as the alignment does; undeclared ones remain.
    ///
    /// # Errors
    /// A program the platform cannot follow, a rate that is not positive, a mounting that is no rotation.
    pub fn new(config: &RigConfig, program: &MotionProgram, rate_hz: f64) -> Result<Self, RigError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(RigError::BadRate(rate_hz));
        }
        let mechanics = Mechanics::new(config)?;
        let trajectory = program.trajectory()?;
        config.geometry.check(&trajectory)?;
        let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
        // What the chain's pole will hold back is read that much ahead.
        let cell_shift_s = cell.stated_delay_s() - cell.delay_s - cell.undeclared_delay_s;
        let imu_shift_s = imu.stated_delay_s() - imu.delay_s - imu.undeclared_delay_s;
        let count = (trajectory.duration_s() * rate_hz * (1.0 + 1e-12)).floor() as u64 + 1;
        let rows = (0..count)
            .map(|k| {
                let time_s = k as f64 / rate_hz;
                let plate = trajectory.state(time_s + cell_shift_s);
                let wrench = mechanics.wrench(&plate);
                let (specific_force, angular_rate) = if imu_shift_s == cell_shift_s {
                    mechanics.imu(&plate)
                } else {
                    mechanics.imu(&trajectory.state(time_s + imu_shift_s))
                };
                ReadingRow { time_ns: (time_s * 1e9).round() as u64, wrench, specific_force, angular_rate }
            })
            .collect();
        let end = mechanics.sensor_motion(&trajectory.state(trajectory.duration_s()));
        Ok(Self { sensors: config.sensors.clone(), mechanics, end, rows })
    }

    /// Returns what perfect sensors read.
    pub fn ideal(&self) -> &[ReadingRow] {
        &self.rows
    }

    /// Returns what the configured sensors read in the experiment of this seed.
    pub fn measured(&self, seed: u64) -> ReadingStream<'_> {
        let experiment = self.sensors.draw(seed);
        ReadingStream {
            sensors: &self.sensors,
            rows: self.rows.iter(),
            load_cell: LoadCellChain::new(&self.sensors, &experiment, seed),
            imu: ImuChain::new(&self.sensors, &experiment, seed),
        }
    }

    /// Returns what is really the case in the experiment of this seed; the motion is that of the end.
    pub fn truth(&self, seed: u64) -> Truth {
        Truth::new(&self.mechanics, &self.sensors.draw(seed), self.end)
    }
}

/// Measured rows of one experiment.
#[derive(Clone, Debug)]
pub struct ReadingStream<'a> {
    sensors: &'a SensorModels,
    rows: std::slice::Iter<'a, ReadingRow>,
    load_cell: LoadCellChain,
    imu: ImuChain,
}

impl Iterator for ReadingStream<'_> {
    type Item = ReadingRow;

    #[inline]
    fn next(&mut self) -> Option<ReadingRow> {
        let row = self.rows.next()?;
        let time_s = row.time_ns as f64 * 1e-9;
        let wrench = self.sensors.load_cell.digitise(self.load_cell.read(time_s, row.wrench));
        let (accel, gyro) = self.imu.read(time_s, row.specific_force, row.angular_rate);
        let (specific_force, angular_rate) = self.sensors.imu.digitise(accel, gyro);
        Some(ReadingRow { time_ns: row.time_ns, wrench, specific_force, angular_rate })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.rows.size_hint()
    }
}

impl ExactSizeIterator for ReadingStream<'_> {}
