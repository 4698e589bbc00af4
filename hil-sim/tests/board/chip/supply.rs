//! The supply, what resets the chip, and the independent watchdog: RM0090, sections 5, 6 and 21.

use super::{Machine, PS};

/// The reason why the chip was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power came on.
    Power,
    /// The supply was too low for a while.
    BrownOut,
    Watchdog,
    Software,
}

/// Below this the chip has no power, V.
const POWER_ON_V: f64 = 1.7;
/// Brown-out level 3, falling (data sheet: 2.75 to 2.86 V).
const BROWN_OUT_V: f64 = 2.8;
/// The voltage detector's highest threshold, falling (2.83 to 2.96 V).
const DETECTOR_V: f64 = 2.9;

pub struct Supply {
    control: u32,
    /// Beginning, end and voltage of each sag, ps and V.
    pub sags: Vec<(u64, u64, f64)>,
    /// Frequency of the watchdog's oscillator, Hz: 17 to 47 kHz.
    pub watchdog_hz: f64,
    watchdog: Option<Watchdog>,
    unlocked: bool,
    waits_until: u64,
    /// The supply goes away at this time, ps, and comes back half a second later.
    pub cut: Option<u64>,
}

struct Watchdog {
    divider: u32,
    reload: u32,
    bites: u64,
}

impl Default for Supply {
    fn default() -> Self {
        Self {
            control: 0x4000,
            sags: Vec::new(),
            watchdog_hz: 32e3,
            watchdog: None,
            unlocked: false,
            waits_until: 0,
            cut: None,
        }
    }
}

impl Supply {
    pub(super) fn reset(&mut self) {
        (self.control, self.watchdog, self.unlocked) = (0x4000, None, false);
    }

    pub(super) fn later(&mut self, time: u64) {
        if let Some(watchdog) = &mut self.watchdog {
            watchdog.bites += time;
        }
    }

    pub(super) fn is_scaled_up(&self) -> bool {
        self.control & 1 << 14 != 0
    }

    /// Returns the supply's voltage at a time, V.
    pub fn volts(&self, now: u64) -> f64 {
        let sags = self.sags.iter().filter(|(from, to, _)| (*from..*to).contains(&now));
        sags.map(|(.., volts)| *volts).fold(3.3, f64::min)
    }

    pub(super) fn next(&self) -> Option<u64> {
        let begins = self.sags.iter().map(|(from, ..)| *from).filter(|from| *from > self.waits_until).min();
        [begins, self.cut, self.watchdog.as_ref().map(|w| w.bites)].into_iter().flatten().min()
    }
}

impl Watchdog {
    fn feed(&mut self, now: u64, hz: f64) {
        let counts = f64::from(self.reload + 1) * f64::from(4_u32 << self.divider.min(6));
        self.bites = now + (counts / hz * PS as f64) as u64;
    }
}

impl Machine {
    pub(super) fn look_at_supply(&mut self) {
        let now = self.now;
        if self.supply.watchdog.as_ref().is_some_and(|w| w.bites <= now) {
            self.reset(Reset::Watchdog);
        }
        if self.supply.cut.is_some_and(|at| at <= now) {
            self.supply.cut = None;
            self.supply.waits_until = now + PS / 2;
            self.reset(Reset::Power);
        }
        let volts = self.supply.volts(now);
        // Until the sag is over it is looked at no more.
        let ends = self.supply.sags.iter().filter(|(from, to, _)| (*from..*to).contains(&now));
        let Some(ends) = ends.map(|(_, to, _)| *to).max().filter(|ends| *ends > self.supply.waits_until)
        else {
            return;
        };
        self.supply.waits_until = ends;
        if volts < POWER_ON_V {
            self.reset(Reset::Power);
        } else if volts < BROWN_OUT_V && self.flash.guards_supply() {
            self.reset(Reset::BrownOut);
        } else if volts < BROWN_OUT_V {
            self.breach("the program runs on below 2.8 V");
        }
    }

    pub(super) fn note_reset(&mut self, why: Reset) {
        // Section 7.3.21: every reset pulls the pin, and power that comes on sets the brown-out's flag, too.
        self.clocks.status |= match why {
            Reset::Power => 0x0e00_0000,
            Reset::BrownOut => 0x0600_0000,
            Reset::Watchdog => 0x2400_0000,
            Reset::Software => 0x1400_0000,
        };
    }

    /// Keeps the chip in reset until the supply is back.
    pub(super) fn wait_for_supply(&mut self) {
        self.now = self.now.max(self.supply.waits_until);
        self.next_sensors = self.now;
    }

    pub(super) fn read_supply(&mut self, offset: usize) -> u32 {
        if !self.clocks.feeds(2, 28) {
            return 0;
        }
        match offset {
            0x00 => self.supply.control,
            0x04 => {
                let watched = self.supply.control & 1 << 4 != 0;
                let threshold = 2.2 + 0.1 * f64::from(self.supply.control >> 5 & 7);
                let low = watched && self.supply.volts(self.now) < threshold.min(DETECTOR_V);
                u32::from(low) << 2 | 1 << 14
            }
            _ => 0,
        }
    }

    pub(super) fn write_supply(&mut self, offset: usize, value: u32) {
        if !self.clocks.feeds(2, 28) {
            return self.breach("PWR is written without its clock");
        }
        if offset == 0 {
            self.supply.control = value;
        }
    }

    pub(super) fn write_watchdog(&mut self, offset: usize, value: u32) {
        let (now, hz) = (self.now, self.supply.watchdog_hz);
        let supply = &mut self.supply;
        match (offset, &mut supply.watchdog) {
            (0, _) if value == 0x5555 => supply.unlocked = true,
            (0, watchdog) if value == 0xcccc => {
                let mut new = Watchdog { divider: 0, reload: 0xfff, bites: 0 };
                new.feed(now, hz);
                *watchdog = Some(new);
            }
            (0, Some(watchdog)) if value == 0xaaaa => {
                watchdog.feed(now, hz);
                supply.unlocked = false;
            }
            (4, Some(watchdog)) if supply.unlocked => watchdog.divider = value & 7,
            (8, Some(watchdog)) if supply.unlocked => watchdog.reload = value & 0xfff,
            _ => self.breach(format!("IWDG {offset:#x} is given {value:#x}")),
        }
    }
}
