//! What the application does with samples, and what it makes of them outside the sample path.

use rigident_shared::alignment::ImuReading;
use rigident_shared::estimator::Outcome;
use rigident_shared::spatial::{AngularRate, SpecificForce};
use rigident_shared::wire::{Reason, SensorFault, StateName, Telemetry};

use super::reports::message_of;
use super::{App, Pulse, Sensor};
use crate::answer::solve;
use crate::sample_path::{SamplePath, Words, sample_path};

/// So many samples of a sensor in a row that could not be had are a fault.
const BAD_TO_FAULT: u16 = 10;

impl App {
    /// Takes gauge voltages with their capture time.
    pub fn on_gauges(&mut self, time_ns: u64, volts: [f32; 6]) {
        self.alive(Sensor::LoadCell, time_ns);
        self.take(&Words::Gauges { time_ns, volts });
    }

    /// Takes an IMU sample: specific force (m/s²) and angular rate (rad/s) in the IMU's axes.
    pub fn on_imu(&mut self, time_ns: u64, specific_force: [f32; 3], angular_rate: [f32; 3]) {
        self.alive(Sensor::Imu, time_ns);
        self.take(&Words::Imu(ImuReading {
            time_ns,
            specific_force: SpecificForce::from_array(specific_force),
            angular_rate: AngularRate::from_array(angular_rate),
        }));
    }

    /// Leaves out a sample in which some gauges (bit g: gauge g) were at the end of the converter's range.
    pub fn on_clipped(&mut self, time_ns: u64, gauges: u8) {
        self.alive(Sensor::LoadCell, time_ns);
        if self.listens() {
            self.errors.load_cell_clipped = self.errors.load_cell_clipped.saturating_add(1);
            self.errors.clipped_gauges |= gauges;
        }
    }

    /// Counts IMU samples that were read too late to know when they were captured.
    pub fn on_late_imu(&mut self, count: u16) {
        if self.listens() {
            self.errors.imu = self.errors.imu.saturating_add(u32::from(count));
        }
    }

    /// Notes a sample that could not be had. Ten in a row, or a fault that does not pass, end in `Fault`.
    pub fn on_sensor_error(&mut self, sensor: Sensor, fault: SensorFault) {
        if !self.listens() {
            return;
        }
        let (count, pulse) = match (sensor, fault) {
            (Sensor::LoadCell, SensorFault::Check) => (&mut self.errors.load_cell_crc, &mut self.load_cell),
            (Sensor::LoadCell, _) => (&mut self.errors.load_cell_other, &mut self.load_cell),
            (Sensor::Imu, _) => (&mut self.errors.imu, &mut self.imu),
        };
        *count = count.saturating_add(1);
        pulse.bad_in_a_row = pulse.bad_in_a_row.saturating_add(1);
        if fault == SensorFault::Restarted || pulse.bad_in_a_row >= BAD_TO_FAULT {
            self.fail(sensor.reason(fault));
        }
    }

    fn alive(&mut self, sensor: Sensor, time_ns: u64) {
        self.advance(time_ns);
        let pulse = Pulse { bad_in_a_row: 0, last_ns: self.now_ns };
        match sensor {
            Sensor::LoadCell => self.load_cell = pulse,
            Sensor::Imu => self.imu = pulse,
        }
    }

    pub(super) fn take(&mut self, words: &Words) {
        let from_sensors = !matches!(words, Words::Aligned(_));
        if from_sensors != self.duty.from_sensors || self.state == StateName::Fault {
            return;
        }
        let mut words = Some(words);
        while let Some(path) = &mut self.path {
            let Some(outcome) = sample_path(path, words.take()) else { return };
            if outcome == Outcome::Absorbed {
                self.last_reading = message_of(path.reading());
                self.run.blocks_since_estimate = self.run.blocks_since_estimate.saturating_add(1);
                let every = self.duty.estimate_every_blocks;
                if every > 0 && self.run.blocks_since_estimate >= every {
                    self.run.blocks_since_estimate = 0;
                    self.run.estimate_due = true;
                }
            }
            self.run.path_behind |= path.take_behind();
            let more = path.has_more();
            if self.duty.stream && self.state != StateName::Holding {
                self.stream();
            }
            if !more {
                return;
            }
        }
    }

    #[inline(never)]
    fn stream(&mut self) {
        let Some(path) = &self.path else { return };
        self.last_reading = message_of(path.reading());
        // There is room: a full batch is sent at once.
        let _ = self.run.batch.push(self.last_reading);
        if self.run.batch.is_full() {
            self.flush_readings();
        }
    }

    /// What need not be done within a sample: solving, the stop rule, telemetry. Call it after every event.
    #[inline]
    pub fn work(&mut self) {
        if self.run.estimate_due || self.run.path_behind || self.state_unsent {
            self.work_off();
        }
    }

    #[inline(never)]
    fn work_off(&mut self) {
        let behind = core::mem::take(&mut self.run.path_behind);
        let stop_due = behind && self.path.as_mut().is_some_and(SamplePath::catch_up);
        if core::mem::take(&mut self.run.estimate_due) {
            self.estimate();
        }
        if stop_due && self.state == StateName::Running && !self.run.stop_overridden {
            self.hold(Reason::StopRule);
        }
        if self.state_unsent {
            let (state, reason) = self.state();
            self.state_unsent = !self.link.telemetry(&Telemetry::State { state, reason });
        }
    }

    fn estimate(&mut self) {
        let Some(path) = &self.path else { return };
        let factor = path.factor();
        let solved = solve(&factor);
        if let Some(report) = self.report(&factor, &solved) {
            self.link.telemetry(&Telemetry::Estimate(report));
        }
    }

    pub(super) fn flush_readings(&mut self) {
        let batch = core::mem::take(&mut self.run.batch);
        if !batch.is_empty() {
            let first = self.run.batch_first;
            self.run.batch_first = first.wrapping_add(batch.len() as u32);
            self.link.telemetry(&Telemetry::Readings { first, readings: batch });
        }
    }
}
