//! The times at which data are stored: decided here, done by [`super::Store`] when a board asks for it.

use rigident_shared::wire::{CounterReport, Kept, KeptRun};

/// A checkpoint is due after this long, in readings of the rate set, s.
const EVERY_S: f32 = 10.0;
/// Parts of the room: after this many equal parts of it have been used the interval doubles, each time.
const PARTS: u32 = 16;

/// Tells what a board's store is to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Duty {
    /// Nothing.
    None,
    /// See what is there.
    Look,
    /// Keep the settings that are new.
    Settings,
    /// Keep the checkpoint of this run that is ready.
    Checkpoint(u32),
    /// Go on with the run that the host has named.
    Resume(Resumption),
}

/// Holds what the host has asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Resumption {
    pub(crate) sequence: u16,
    /// Check sum of the command's payload.
    pub(crate) check: u32,
    pub(crate) run: u32,
    pub(crate) next_reading: u32,
}

/// Tells how far a checkpoint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// No checkpoint is wanted.
    Rest,
    /// One is to be made.
    Due,
    /// The checkpoint's factor is being put together.
    Folding,
    /// The checkpoint can be stored.
    Ready,
}

/// Holds what is stored and what is to be stored.
pub(crate) struct Keeping {
    kept: Kept,
    /// Somebody has checked.
    looked: bool,
    settings_are_new: bool,
    resumption: Option<Resumption>,
    phase: Phase,
    /// Readings between checkpoints, before the interval doubles.
    every: u32,
    /// Bytes of flash that the run's checkpoints have taken, and that there were.
    used: u32,
    room: u32,
    /// Readings at the last checkpoint.
    last: u32,
    /// The content of a checkpoint on its way beside the factor.
    pub(crate) counters: CounterReport,
    pub(crate) next_index: u32,
    pub(crate) next_reading: u32,
    pub(crate) time_ns: u64,
}

impl Keeping {
    pub(crate) fn new() -> Self {
        Self {
            kept: Kept::NoStorage,
            looked: false,
            settings_are_new: false,
            resumption: None,
            phase: Phase::Rest,
            every: 0,
            used: 0,
            room: 0,
            last: 0,
            counters: CounterReport::default(),
            next_index: 0,
            next_reading: 0,
            time_ns: 0,
        }
    }

    /// Returns what the hello says.
    pub(crate) fn kept(&self) -> Kept {
        self.kept
    }

    /// Returns whether a run of this number is stored, and can be continued.
    pub(crate) fn has(&self, run: u32) -> bool {
        cfg!(feature = "storage") && matches!(self.kept, Kept::Run(kept) if kept.run == run)
    }

    pub(crate) fn duty(&self) -> Duty {
        match (self.looked, self.kept, self.phase) {
            (false, ..) => Duty::Look,
            (_, Kept::NoStorage, _) => Duty::None,
            _ if self.settings_are_new => Duty::Settings,
            (_, Kept::Run(run), Phase::Ready) => Duty::Checkpoint(run.run),
            _ => self.resumption.map_or(Duty::None, Duty::Resume),
        }
    }

    /// Notes what was found.
    pub(crate) fn found(&mut self, kept: Kept) {
        (self.kept, self.looked) = (kept, true);
    }

    /// Receives that a run begins whose settings are to be stored.
    pub(crate) fn configured(&mut self, rate_hz: f32) {
        if !cfg!(feature = "storage") {
            return;
        }
        self.stop();
        self.settings_are_new = true;
        (self.used, self.last) = (0, 0);
        self.every = (rate_hz * EVERY_S) as u32;
    }

    /// Receives that the settings are stored, or not: without them no checkpoint is.
    pub(crate) fn begun(&mut self, run: Option<KeptRun>, room: u32) {
        self.settings_are_new = false;
        self.kept = run.map_or(Kept::Damaged, Kept::Run);
        self.room = room;
    }

    pub(crate) fn ask(&mut self, resumption: Resumption) {
        self.resumption = Some(resumption);
    }

    /// Receives that the host was answered.
    pub(crate) fn answered(&mut self) {
        self.resumption = None;
    }

    /// Goes on with a run after this many readings.
    pub(crate) fn resumed(&mut self, rate_hz: f32, readings: u32, room: u32) {
        self.stop();
        self.settings_are_new = false;
        self.every = (rate_hz * EVERY_S) as u32;
        (self.last, self.used, self.room) = (readings, 0, room);
    }

    /// Makes no checkpoint.
    pub(crate) fn stop(&mut self) {
        self.phase = Phase::Rest;
    }

    /// Checks whether one is due after this many readings.
    pub(crate) fn note(&mut self, readings: u32) {
        if !cfg!(feature = "storage") {
            return;
        }
        let doublings = self.used.checked_div(self.room / PARTS).unwrap_or(0).min(31);
        let every = self.every.saturating_mul(1 << doublings);
        if self.phase == Phase::Rest && every > 0 && readings.wrapping_sub(self.last) >= every {
            self.make();
        }
    }

    /// Makes a checkpoint due now, if there is anything new.
    pub(crate) fn hurry(&mut self, readings: u32) {
        if !cfg!(feature = "storage") {
            return;
        }
        if readings == self.last {
            return;
        }
        // One on its way would lack the last readings.
        self.again();
        if self.phase == Phase::Rest {
            self.make();
        }
    }

    fn make(&mut self) {
        let Kept::Run(run) = self.kept else { return };
        if !run.full && !self.settings_are_new {
            self.phase = Phase::Due;
        }
    }

    /// Returns whether there is something to be done between samples.
    pub(crate) fn is_under_way(&self) -> bool {
        cfg!(feature = "storage") && matches!(self.phase, Phase::Due | Phase::Folding)
    }

    /// Returns whether the path's snapshot is needed.
    pub(crate) fn needs_snapshot(&self) -> bool {
        cfg!(feature = "storage") && matches!(self.phase, Phase::Folding | Phase::Ready)
    }

    pub(crate) fn is_folding(&self) -> bool {
        self.phase == Phase::Folding
    }

    /// Receives that the snapshot is taken.
    pub(crate) fn begin(&mut self) {
        self.phase = Phase::Folding;
    }

    pub(crate) fn ready(&mut self) {
        self.phase = Phase::Ready;
    }

    /// Receives that somebody else has taken a snapshot.
    pub(crate) fn again(&mut self) {
        if self.needs_snapshot() {
            self.phase = Phase::Due;
        }
    }

    /// Receives that the checkpoint has taken this many bytes of flash; none: there is no room, or it cannot
    /// be written.
    pub(crate) fn written(&mut self, bytes: Option<u32>) {
        self.phase = Phase::Rest;
        let Kept::Run(run) = &mut self.kept else { return };
        let Some(bytes) = bytes else {
            run.full = true;
            return;
        };
        self.used = self.used.saturating_add(bytes);
        self.last = self.counters.readings;
        *run = KeptRun {
            run: run.run,
            readings: self.counters.readings,
            blocks: self.counters.blocks,
            next_index: self.next_index,
            time_ns: self.time_ns,
            checkpoints: run.checkpoints.saturating_add(1),
            full: false,
        };
    }
}
