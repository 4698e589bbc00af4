//! The data that an experiment brings, and their observers.

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::frames::TreeFactor;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_shared::wire::{
    CounterReport, EstimateReport, GapCounter, LinkReadingMessage, ReadingMessage, Reason, StateName,
};

use super::{QUIET, STOPPED};
use crate::link::TakenFactor;
use crate::platform::MotionSample;

/// The observer of an experiment.
pub trait Observer {
    /// Receives a reading, in order, with the time on the device's clock.
    ///
    /// # Errors
    /// The experiment is then stopped.
    fn reading(&mut self, reading: &ReadingMessage) -> Result<(), String>;
    /// Receives a reading of two links, in order, with the time on the device's clock.
    ///
    /// # Errors
    /// The experiment is then stopped.
    fn link_reading(&mut self, _reading: &LinkReadingMessage) -> Result<(), String> {
        Ok(())
    }
    /// Receives a new estimate.
    fn estimate(&mut self, _report: &EstimateReport) {}
    /// Receives that a level of a tree's factor was taken, after this many frames: all that is known until
    /// then.
    fn level(&mut self, _factor: &TreeFactor<f64>, _frames: u32) {}
    /// Receives where the plate should be and is.
    ///
    /// # Errors
    /// The experiment is then stopped.
    fn motion(&mut self, _sample: &MotionSample) -> Result<(), String> {
        Ok(())
    }
    /// Hears what the host makes of the device's factor while it runs, in words; nothing where it says
    /// nothing yet.
    fn known(&mut self, _words: Option<String>) {}
    /// Receives often that progress may be shown.
    fn progress(&mut self, _readings: usize) {}
    /// Receives the device's messages that arrived.
    fn heard(&mut self, _heard: &Heard) {}
    /// Receives that the device has changed its state.
    fn state(&mut self, _state: StateName, _reason: Reason) {}
    /// Receives what the device has counted, where it is asked meanwhile.
    fn counters(&mut self, _counters: &CounterReport) {}
}

/// Tells what arrived of the device's messages, and what did not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heard {
    /// Readings that never arrived.
    pub missing: u32,
    /// Messages that never arrived.
    pub lost_messages: u32,
    /// Frames that arrived damaged.
    pub damaged_frames: u32,
    /// The time for which nothing has arrived, s.
    pub silent_s: f64,
}

/// Wants to know nothing.
pub struct Nobody;

impl Observer for Nobody {
    fn reading(&mut self, _: &ReadingMessage) -> Result<(), String> {
        Ok(())
    }
}

/// The data that an experiment brought.
#[derive(Debug, Clone)]
pub struct Take {
    /// Every reading of one body while running, in f64.
    pub readings: Vec<Reading<f64>>,
    /// Every reading of two links.
    pub links: Vec<LinkReadingMessage>,
    /// Every estimate sent.
    pub estimates: Vec<EstimateReport>,
    /// Readings that never arrived.
    pub missing: u32,
    /// The device's factor, in its order of parameters.
    pub factor: Option<TakenFactor>,
    /// The number of times that a level of it was taken and merged; a tree's from frames.
    pub levels: u32,
    /// The device's counters at the end.
    pub counters: CounterReport,
    /// State changes while it lasted.
    pub states: Vec<(StateName, Reason)>,
    /// The number of times that the device had stopped, not hearing the host, and was started again.
    pub resumed: usize,
    /// The number of times that the device had restarted, and went on from what its flash stored.
    pub restarts: usize,
    /// Ended by Ctrl-C.
    pub interrupted: bool,
    /// Ended before the program's end, because it was to last no longer.
    pub cut_short: bool,
    /// The failure in the middle, if there was one; what was taken before is here.
    pub broken: Option<String>,
}

impl Take {
    /// Returns true if nothing broke and nobody stopped it.
    pub fn error_free(&self) -> bool {
        self.broken.is_none() && !self.interrupted
    }
}

/// Returns a reading as the device sent it, in f64 (exactly).
pub fn widen(message: &ReadingMessage) -> Reading<f64> {
    Reading {
        time_ns: message.time_ns,
        wrench: Wrench::from_array(message.wrench.map(f64::from)),
        specific_force: SpecificForce::from_array(message.specific_force.map(f64::from)),
        angular_rate: AngularRate::from_array(message.angular_rate.map(f64::from)),
    }
}

/// Returns a reading as it is sent to the device: rounded to f32.
pub fn narrow(reading: &Reading<f64>) -> ReadingMessage {
    ReadingMessage {
        time_ns: reading.time_ns,
        wrench: reading.wrench.array().map(|v| v as f32),
        specific_force: reading.specific_force.array().map(|v| v as f32),
        angular_rate: reading.angular_rate.array().map(|v| v as f32),
    }
}

/// The data so far.
#[derive(Default)]
pub(super) struct Taking {
    pub(super) readings: Vec<Reading<f64>>,
    pub(super) links: Vec<LinkReadingMessage>,
    pub(super) estimates: Vec<EstimateReport>,
    pub(super) gaps: GapCounter,
    pub(super) streamed: u32,
    pub(super) states: Vec<(StateName, Reason)>,
    pub(super) counters: CounterReport,
    pub(super) interrupted: bool,
    /// The director has ended it before the program's end.
    pub(super) ended: bool,
    /// True if it was to last no longer.
    pub(super) cut_short: bool,
    /// The stop rule has been overridden.
    pub(super) overridden: bool,
    /// The number of times that the device restarted and was continued.
    pub(super) restarts: usize,
    /// The number of times that a run was continued that the device had stopped because it did not hear the
    /// host.
    pub(super) resumed: usize,
    /// Nothing is absorbed meanwhile.
    pub(super) watching: bool,
    /// The data taken of the level of a tree from frames.
    pub(super) level: Option<Box<TreeFactor<f64>>>,
    /// The number of times that it was taken.
    pub(super) levels: u32,
}

impl Taking {
    /// Returns the number of readings or frames.
    pub(super) fn count(&self) -> usize {
        let frames = if self.level.is_some() { self.counters.frames.absorbed as usize } else { 0 };
        self.readings.len() + self.links.len() + frames
    }

    /// Returns the time from the first reading to the last, s.
    pub(super) fn span_s(&self) -> f64 {
        let of_body = [self.readings.first(), self.readings.last()].map(|r| r.map(|r| r.time_ns));
        let of_links = [self.links.first(), self.links.last()].map(|r| r.map(|r| r.base.time_ns));
        let [first, last] = [0, 1].map(|k| of_body[k].or(of_links[k]).unwrap_or(0));
        last.saturating_sub(first) as f64 * 1e-9
    }

    /// Returns true if the device has ended the run because everything asked for is reached.
    pub(super) fn held(&self) -> bool {
        self.states.contains(&STOPPED) && !self.overridden
    }

    /// Returns how often the device has stopped because it did not hear the host.
    pub(super) fn times_quiet(&self) -> usize {
        self.states.iter().filter(|state| **state == QUIET).count()
    }
}
