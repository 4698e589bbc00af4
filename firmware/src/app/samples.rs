//! The application's work with samples, and its results outside the sample path.

use core::ops::DerefMut;

use rigident_shared::estimator::Outcome;
use rigident_shared::wire::{
    ClockSource, ErrorCode, EventCode, Reason, Reply, SensorFault, StateName, Telemetry,
};

use super::reports::{link_message_of, message_of};
use super::{App, HandOver, Pulse, Sensor};
use crate::Path;
use crate::drivers::frames::{AnyFrame, FrameKind};
use crate::frame_path::frame_path;
use crate::rates::RateMeter;
use crate::sample_path::{SamplePath, Words, imu_reading, sample_path};

/// This many consecutive samples of a sensor that could not be read are a fault.
const BAD_TO_FAULT: u16 = 10;
/// A frame of the load cell whose check sum does not fit weighs as this many that do. More than one in a
/// thousand is a fault: what inverts its bits inverts those of the IMU on the same bus, which have no check
/// sum.
const DAMAGED_WEIGHS: u16 = 1_000;
const NOISE_TO_FAULT: u16 = 5 * DAMAGED_WEIGHS;
/// An excitation outside of these parts of the one stated is no drift: a wire is off, or a divider is
/// another.
const EXCITATION_LEAST: f32 = 0.9;
const EXCITATION_MOST: f32 = 1.1;
/// Samples of the load cell come at the rate asked for, to within this much, parts in a million: what its
/// filter and derivative count on. Oscillators of converters are within 100.
const LOAD_CELL_PPM: u32 = 500;
/// Samples of an IMU come at the rate asked for, to within this much, parts in a million. They are dated one
/// by one. A data sheet allows 1 %; far more is another rate.
const IMU_PPM: u32 = 50_000;
/// An estimate waits this long for the next row of a factor that the host has begun to take, ns.
const HAND_OVER_NS: u64 = 1_000_000_000;

/// Ticks without a sample after which the sensors are silent, and slices need not wait for the next one.
const IDLE_TICKS: u8 = 8;

impl<P: DerefMut<Target = Path>> App<P> {
    /// Takes gauge voltages with their capture time, and the voltage that the converter saw of the gauges'
    /// excitation: where the settings state one, the gauges are divided by its ratio to that.
    pub fn on_gauges(&mut self, time_ns: u64, volts: [f32; 6], excitation_v: f32) {
        self.alive_on_path(Sensor::LoadCell, time_ns);
        self.noise = self.noise.saturating_sub(1);
        let stated = self.duty.excitation_v;
        if stated == 0.0 {
            return self.take_measured(&Words::Gauges { time_ns, volts });
        }
        if !(EXCITATION_LEAST * stated..=EXCITATION_MOST * stated).contains(&excitation_v) {
            return self.without_excitation();
        }
        self.starved = 0;
        let ratio = stated / excitation_v;
        self.take_measured(&Words::Gauges { time_ns, volts: volts.map(|v| v * ratio) });
    }

    /// Leaves out a sample of gauges that nothing, or something else, excites.
    #[cold]
    #[inline(never)]
    fn without_excitation(&mut self) {
        if self.listens() {
            self.errors.without_excitation = self.errors.without_excitation.saturating_add(1);
            self.starved = self.starved.saturating_add(1);
            if self.starved >= BAD_TO_FAULT && self.state == StateName::Running {
                self.fail(Sensor::LoadCell.reason(SensorFault::Excitation));
            }
        }
    }

    /// Takes an IMU sample: specific force (m/s²) and angular rate (rad/s) in the IMU's axes.
    pub fn on_imu(&mut self, time_ns: u64, specific_force: [f32; 3], angular_rate: [f32; 3]) {
        self.alive_on_path(Sensor::Imu, time_ns);
        self.take_measured(&Words::Imu(imu_reading(time_ns, specific_force, angular_rate)));
    }

    /// Takes a sample of the second link's IMU: specific force (m/s²) and angular rate (rad/s) in its axes.
    pub fn on_second_imu(&mut self, time_ns: u64, specific_force: [f32; 3], angular_rate: [f32; 3]) {
        self.alive(Sensor::SecondImu, time_ns);
        self.take_measured(&Words::SecondImu(imu_reading(time_ns, specific_force, angular_rate)));
    }

    /// Returns how many links a frame is to have, and what it brings; none if no frames are wanted.
    pub fn frame_links(&self) -> Option<(usize, FrameKind)> {
        let estimator = self.path.frames()?.estimator();
        let kind = if estimator.is_tracked() { FrameKind::Tracked } else { FrameKind::Imu };
        Some((estimator.links(), kind))
    }

    /// Takes a frame of a tree in motion, captured at this time.
    pub fn on_frame(&mut self, time_ns: u64, frame: &AnyFrame<'_>) {
        self.alive(Sensor::Frames, time_ns);
        self.note_number(frame.number());
        if self.state == StateName::Fault {
            return;
        }
        let Some(path) = self.path.frames_mut() else { return };
        if frame_path(path, frame).is_none() {
            return;
        }
        let (full, met) = (path.estimator().is_full(), path.stop_rule_met());
        // With the last frame that the level bears, so that none is turned away.
        if full {
            self.hold(Reason::LevelFull);
        } else if met {
            self.stop_rule_met();
        }
    }

    /// Counts numbers of the series that no frame has.
    pub(super) fn note_number(&mut self, number: u32) {
        let expected = self.errors.next_frame.replace(number.wrapping_add(1));
        let missing = expected.map_or(0, |expected| number.wrapping_sub(expected));
        // Half the range back is a source that started again.
        if missing < u32::MAX / 2 {
            self.errors.frames_missing = self.errors.frames_missing.saturating_add(missing);
        }
    }

    /// Notes a frame of a tree with this number of links, which is not the one configured.
    pub fn on_frame_of_links(&mut self, time_ns: u64, links: u8) {
        self.alive(Sensor::Frames, time_ns);
        if let Some(path) = self.path.frames_mut() {
            path.estimator_mut().reject_links(links);
        }
    }

    /// Leaves out a sample in which some gauges (bit g: gauge g) were at the end of the converter's range.
    pub fn on_clipped(&mut self, time_ns: u64, gauges: u8) {
        self.alive(Sensor::LoadCell, time_ns);
        if self.listens() {
            self.errors.load_cell_clipped = self.errors.load_cell_clipped.saturating_add(1);
            self.errors.clipped_gauges |= gauges;
        }
    }

    /// Counts samples of an IMU that were read too late to know when they were captured.
    pub fn on_late_imu(&mut self, sensor: Sensor, count: u16) {
        if self.listens() {
            let errors = match sensor {
                Sensor::SecondImu => &mut self.errors.second_imu,
                _ => &mut self.errors.imu,
            };
            *errors = errors.saturating_add(u32::from(count));
        }
    }

    /// Counts samples that a sensor signalled and that the board could not keep.
    pub fn on_lost(&mut self, sensor: Sensor, count: u32) {
        if let (true, Some(lost)) = (self.listens(), self.errors.lost.get_mut(sensor as usize)) {
            *lost = lost.saturating_add(count);
            if count > 0 {
                self.events.note(self.now_ns, EventCode::Lost, sensor as u8);
            }
        }
    }

    /// Notes a sample that could not be had. Ten in a row, or a fault that does not pass, end in `Fault`.
    #[cold]
    #[inline(never)]
    pub fn on_sensor_error(&mut self, sensor: Sensor, fault: SensorFault) {
        if !self.listens() {
            return;
        }
        let count = match (sensor, fault) {
            (Sensor::LoadCell, SensorFault::Check) => &mut self.errors.load_cell_crc,
            (Sensor::LoadCell, SensorFault::Stale) => &mut self.errors.load_cell_stale,
            (Sensor::LoadCell, SensorFault::Resynced) => &mut self.errors.load_cell_resyncs,
            (Sensor::LoadCell, _) => &mut self.errors.load_cell_other,
            (Sensor::Imu, _) => &mut self.errors.imu,
            (Sensor::SecondImu, _) => &mut self.errors.second_imu,
            (Sensor::Frames, _) => &mut self.errors.frames_damaged,
        };
        let Some(pulse) = self.pulses.get_mut(sensor as usize) else { return };
        *count = count.saturating_add(1);
        pulse.bad_in_a_row = pulse.bad_in_a_row.saturating_add(1);
        // What has changed by itself stays so until it is set up again.
        let stays = matches!(fault, SensorFault::Restarted | SensorFault::Verify);
        let damaged = (sensor, fault) == (Sensor::LoadCell, SensorFault::Check);
        self.noise = self.noise.saturating_add(if damaged { DAMAGED_WEIGHS } else { 0 });
        if stays || (damaged && self.noise >= NOISE_TO_FAULT) || pulse.bad_in_a_row >= BAD_TO_FAULT {
            self.fail(sensor.reason(fault));
        }
    }

    #[inline(never)]
    pub(super) fn alive(&mut self, sensor: Sensor, time_ns: u64) {
        self.alive_on_path(sensor, time_ns);
    }

    /// Notes a sample as [`Self::alive`] does, in the frame of its caller, for one body's samples, whose
    /// instructions count.
    #[inline(always)]
    fn alive_on_path(&mut self, sensor: Sensor, time_ns: u64) {
        self.advance(time_ns);
        let pulse = Pulse { bad_in_a_row: 0, last_ns: self.now_ns };
        if let Some(slot) = self.pulses.get_mut(sensor as usize) {
            *slot = pulse;
        }
        if self.meters.get_mut(sensor as usize).is_some_and(|meter| meter.note(time_ns)) {
            self.look_at_rate();
        }
    }

    #[cold]
    #[inline(never)]
    fn look_at_rate(&mut self) {
        if let (StateName::Running, Some(sensor)) = (self.state, self.sensor_of_another_rate()) {
            self.fail(sensor.reason(SensorFault::Rate));
        }
    }

    /// Returns the first sensor whose samples come at another rate than the one asked for, by a clock that
    /// can tell.
    pub(super) fn sensor_of_another_rate(&self) -> Option<Sensor> {
        if matches!(self.facts.clock, ClockSource::Internal | ClockSource::Slow) {
            return None;
        }
        let most = |sensor| if sensor == Sensor::LoadCell { LOAD_CELL_PPM } else { IMU_PPM };
        let is_off = |(sensor, meter): &(Sensor, &RateMeter)| {
            meter.error_ppm().is_some_and(|ppm| ppm.unsigned_abs() > most(*sensor))
        };
        Sensor::ALL.into_iter().zip(&self.meters).find(is_off).map(|(sensor, _)| sensor)
    }

    /// Counts transfers with sensors that did not end, or ended with an error.
    pub fn on_failed_transfers(&mut self, overdue: u32, failed: u32) {
        if self.listens() {
            self.errors.overdue_transfers = self.errors.overdue_transfers.saturating_add(overdue);
            self.errors.failed_transfers = self.errors.failed_transfers.saturating_add(failed);
            if overdue > 0 || failed > 0 {
                self.events.note(self.now_ns, EventCode::Transfers, 0);
            }
        }
    }

    /// Takes what a sensor said, unless a recording is taken instead.
    #[inline(always)]
    fn take_measured(&mut self, words: &Words) {
        if self.duty.from_sensors {
            self.take(words);
        }
    }

    pub(super) fn take(&mut self, words: &Words) {
        if self.state == StateName::Fault {
            return;
        }
        self.run.idle_ticks = 0;
        let mut words = Some(words);
        while let Some(path) = self.path.samples_mut() {
            let Some(outcome) = sample_path(path, words.take()) else { return };
            if outcome == Outcome::Absorbed {
                self.last_reading = message_of(&path.reading().base);
                self.run.blocks_since_estimate = self.run.blocks_since_estimate.saturating_add(1);
                self.keeping.note(path.counters().readings);
                let every = self.duty.estimate_every_blocks;
                if every > 0 && self.run.blocks_since_estimate >= every {
                    self.run.blocks_since_estimate = 0;
                    self.run.estimate_due = true;
                }
            }
            self.run.path_behind |= path.take_behind();
            // Where every reading is a row block, none is light.
            let light = outcome != Outcome::Absorbed || self.duty.every_reading;
            self.run.slice_fits = light && !path.take_stepped();
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
        let Some(path) = self.path.samples() else { return };
        self.last_reading = message_of(&path.reading().base);
        if path.has_two_links() {
            let _ = self.run.link_batch.push(link_message_of(path.reading()));
            if self.run.link_batch.is_full() {
                self.flush_readings();
            }
            return;
        }
        // There is room: a full batch is sent at once.
        let _ = self.run.batch.push(self.last_reading);
        if self.run.batch.is_full() {
            self.flush_readings();
        }
    }

    /// Does the work that need not be done within a sample: solving, the stop rule, telemetry. Call it after
    /// every event. While samples of the sensors are absorbed an estimate is made a slice at a time, after
    /// readings that took next to nothing.
    #[inline]
    pub fn work(&mut self) {
        let estimate = self.run.estimate_due || self.estimation.is_busy() || self.link.has_prepared();
        let wanted = estimate || self.keeping.is_under_way();
        if wanted || self.run.hand_over != HandOver::None || self.run.path_behind || self.state_unsent {
            self.work_off();
        }
    }

    #[inline(never)]
    fn work_off(&mut self) {
        let behind = core::mem::take(&mut self.run.path_behind);
        let stop_due = behind && self.path.samples_mut().is_some_and(SamplePath::catch_up);
        if self.is_busy_with_samples() {
            let idle = self.run.idle_ticks >= IDLE_TICKS;
            if core::mem::take(&mut self.run.slice_fits) || idle {
                self.slice();
            }
        } else {
            while self.slice() {}
        }
        if stop_due {
            self.stop_rule_met();
        }
        if self.state_unsent {
            let (state, reason) = self.state();
            self.state_unsent = !self.link.telemetry(&Telemetry::State { state, reason });
        }
    }

    /// Ends the run, or tells that it might end, once.
    #[cold]
    #[inline(never)]
    fn stop_rule_met(&mut self) {
        if self.state != StateName::Running || self.run.stop_overridden {
            return;
        }
        let goes_on = self.settings.as_ref().and_then(|s| s.stop.as_ref()).is_some_and(|stop| stop.goes_on);
        if goes_on {
            self.run.stop_overridden = true;
            self.enter(StateName::Running, Reason::StopRule);
        } else {
            self.hold(Reason::StopRule);
        }
    }

    /// Does a slice of what is asked for. Returns true if there was one to do.
    #[inline(never)]
    fn slice(&mut self) -> bool {
        let Some(path) = self.path.samples_mut() else { return false };
        if let HandOver::Folding(sequence, check) = self.run.hand_over {
            if path.fold() {
                let answer = self.take_row(0).map(Reply::Row).ok_or(ErrorCode::NoEstimate);
                self.link.answer(sequence, check, &answer);
            }
            return true;
        }
        if self.estimation.is_busy() {
            if let Some(report) = self.estimation.step(path) {
                self.link.prepare(&Telemetry::Estimate(report.clone()));
            }
            return true;
        }
        if self.link.queue_prepared() {
            return true;
        }
        let taken = match self.run.hand_over {
            HandOver::Rows(at_ns) => self.now_ns.saturating_sub(at_ns) < HAND_OVER_NS,
            _ => false,
        };
        if !taken && self.keeping.is_under_way() {
            return self.checkpoint();
        }
        let begins = self.run.estimate_due && !taken && !self.keeping.needs_snapshot();
        if begins {
            self.run.estimate_due = false;
            self.estimation.begin(path, self.last_reading);
        }
        begins
    }

    /// Does a slice of a checkpoint. True: there was one to do.
    fn checkpoint(&mut self) -> bool {
        let counters = self.counters();
        let Some(path) = self.path.samples_mut() else { return false };
        if self.keeping.is_folding() {
            if path.fold() {
                self.keeping.ready();
            }
            return true;
        }
        path.take_snapshot();
        let streamed = self.run.batch.len() + self.run.link_batch.len();
        let keeping = &mut self.keeping;
        (keeping.counters, keeping.time_ns) = (counters, self.now_ns);
        (keeping.next_index, keeping.next_reading) =
            (self.run.injected_next, self.run.batch_first.wrapping_add(streamed as u32));
        keeping.begin();
        true
    }

    pub(super) fn flush_readings(&mut self) {
        self.run.slice_fits = false;
        let batch = core::mem::take(&mut self.run.batch);
        if !batch.is_empty() {
            let first = self.run.batch_first;
            self.run.batch_first = first.wrapping_add(batch.len() as u32);
            self.link.telemetry(&Telemetry::Readings { first, readings: batch });
        }
        if !self.run.link_batch.is_empty() {
            let readings = core::mem::take(&mut self.run.link_batch);
            let first = self.run.batch_first;
            self.run.batch_first = first.wrapping_add(readings.len() as u32);
            self.link.telemetry(&Telemetry::LinkReadings { first, readings });
        }
    }
}
