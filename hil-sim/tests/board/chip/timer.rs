//! TIM2 and the core's timer: RM0090, section 18; ARMv7-M, B3.3.

use super::clocks::ticks;
use super::{Machine, PS};

/// Address of the count.
pub const COUNT: usize = 0x4000_0024;

#[derive(Default)]
pub struct Timer {
    control: u32,
    flags: u32,
    modes: [u32; 2],
    channels: u32,
    divider: u32,
    /// The divider in force, taken over at an update.
    in_force: u32,
    highest: u32,
    captured: [u32; 4],
    /// The count at a time, and how fast it goes, Hz.
    count: f64,
    since: u64,
    hz: f64,
    core: CoreTimer,
    /// The count of a reset: as if the chip had been on for long.
    pub begins_at: u32,
}

#[derive(Default)]
struct CoreTimer {
    control: u32,
    reload: u32,
    next: Option<u64>,
    period: u64,
}

impl Timer {
    pub(super) fn reset(&mut self) {
        // A latched level is gone with the registers; what the crystal does is not.
        *self = Self { hz: 16e6, begins_at: self.begins_at, ..Self::default() };
    }

    pub(super) fn reset_counter(&mut self) {
        let core = std::mem::take(&mut self.core);
        *self = Self { hz: self.hz, since: self.since, core, begins_at: self.begins_at, ..Self::default() };
    }

    fn count_at(&self, at: u64) -> f64 {
        if self.control & 1 == 0 {
            return self.count;
        }
        self.count + ticks(self.hz / f64::from(self.in_force + 1), at.saturating_sub(self.since))
    }

    /// Returns the counter's value at a time.
    pub fn shown(&self, at: u64) -> u32 {
        (self.count_at(at) as u64 % (u64::from(self.highest) + 1)) as u32
    }

    fn settle(&mut self, now: u64) {
        (self.count, self.since) = (self.count_at(now), now);
    }

    pub(super) fn change_clock(&mut self, now: u64, timer_hz: f64, core_hz: f64) {
        self.settle(now);
        self.hz = timer_hz;
        self.core.period = (f64::from(self.core.reload + 1) / core_hz * PS as f64) as u64;
    }

    /// Notes an edge on a channel's input (1 to 3), at a time, ps; `rises`: its direction; `lasts`: the time
    /// that the level stays, ps.
    pub(super) fn edge(&mut self, channel: usize, rises: bool, at: u64, lasts: u64) {
        let k = channel - 1;
        let mode = self.modes[k / 2] >> (8 * (k % 2)) & 0xff;
        let on = self.channels >> (4 * k) & 0xb;
        // Its own input, no divider; the polarity; switched on.
        if mode & 0xf != 1 || on & 1 == 0 || (on & 2 == 0) != rises || self.control & 1 == 0 {
            return;
        }
        let filter = match mode >> 4 {
            0 => 0,
            1 => 2,
            2 => 4,
            _ => 8,
        };
        let delay = (f64::from(filter) / self.hz * PS as f64) as u64;
        if lasts < delay {
            return;
        }
        let bit = 1 << channel;
        if self.flags & bit != 0 {
            self.flags |= bit << 8;
        }
        self.flags |= bit;
        self.captured[k] = self.shown(at + delay);
    }

    pub(super) fn next(&self) -> Option<u64> {
        self.core.next
    }

    pub(super) fn later(&mut self, time: u64) {
        self.core.next = self.core.next.map(|at| at + time);
    }

    pub(super) fn read_tick(&self, offset: usize) -> u32 {
        match offset {
            0 => self.core.control,
            4 => self.core.reload,
            _ => 0,
        }
    }

    pub(super) fn write_tick(&mut self, offset: usize, value: u32, now: u64, core_hz: f64) {
        match offset {
            0 => self.core.control = value & 7,
            4 => self.core.reload = value & 0xff_ffff,
            _ => {}
        }
        self.core.period = (f64::from(self.core.reload + 1) / core_hz * PS as f64) as u64;
        self.core.next =
            (self.core.control & 3 == 3 && self.core.reload > 0).then_some(now + self.core.period);
    }
}

impl Machine {
    pub(super) fn look_at_timer(&mut self) {
        let now = self.now;
        while let Some(next) = self.timer.core.next.filter(|next| *next <= now) {
            self.timer.core.next = Some(next + self.timer.core.period.max(1));
            self.nvic.tick = true;
        }
    }

    pub(super) fn read_timer(&mut self, offset: usize) -> u32 {
        if !self.clocks.feeds(2, 0) {
            return 0;
        }
        let timer = &mut self.timer;
        match offset {
            0x00 => timer.control,
            0x10 => timer.flags,
            0x18 | 0x1c => timer.modes[(offset - 0x18) / 4],
            0x20 => timer.channels,
            0x24 => timer.shown(self.now),
            0x28 => timer.divider,
            0x2c => timer.highest,
            0x34..=0x40 => {
                let k = (offset - 0x34) / 4;
                timer.flags &= !(2 << k);
                timer.captured[k]
            }
            _ => 0,
        }
    }

    pub(super) fn write_timer(&mut self, offset: usize, value: u32) {
        if !self.clocks.feeds(2, 0) {
            return self.breach("TIM2 is written without its clock");
        }
        let now = self.now;
        let hz = self.clocks.timer_hz();
        let timer = &mut self.timer;
        match offset {
            0x00 => {
                timer.settle(now);
                (timer.control, timer.hz) = (value, hz);
            }
            0x10 => timer.flags &= value,
            0x14 => {
                timer.settle(now);
                if value & 1 != 0 {
                    (timer.in_force, timer.count) = (timer.divider, f64::from(timer.begins_at));
                    timer.flags |= 1;
                }
            }
            0x18 | 0x1c => timer.modes[(offset - 0x18) / 4] = value,
            0x20 => timer.channels = value,
            0x28 => timer.divider = value & 0xffff,
            0x2c => timer.highest = value,
            _ => self.breach(format!("TIM2 {offset:#x} is written")),
        }
    }
}
