//! Reset and clock control: RM0090, section 7.

use super::{MS, Machine, PS, US};

const HSI_HZ: f64 = 16e6;
const HSION: u32 = 1;
const HSIRDY: u32 = 1 << 1;
const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const HSEBYP: u32 = 1 << 18;
const CSSON: u32 = 1 << 19;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;
const CSSF: u32 = 1 << 7;
const CSSC: u32 = 1 << 23;
/// Start-up times of the crystal and of the PLL, ps (data sheet: 2 ms, 300 µs at most).
const CRYSTAL_STARTS: u64 = 2 * MS;
const PLL_LOCKS: u64 = 200 * US;

/// The crystal on the oscillator's pins.
#[derive(Clone, Copy, Debug)]
pub struct Crystal {
    /// The crystal's frequency, Hz; zero: it does not start.
    pub hz: f64,
    /// The time at which it stops, ps.
    pub stops: Option<u64>,
}

pub struct Clocks {
    pub crystal: Crystal,
    /// The chip's own oscillator, as a ratio to 16 MHz.
    pub internal: f64,
    control: u32,
    pll: u32,
    configuration: u32,
    interrupts: u32,
    enabled: [u32; 4],
    pub(super) status: u32,
    crystal_ready: Option<u64>,
    pll_ready: Option<u64>,
}

impl Default for Clocks {
    fn default() -> Self {
        let mut clocks = Self {
            crystal: Crystal { hz: 8e6, stops: None },
            internal: 1.0,
            control: 0,
            pll: 0,
            configuration: 0,
            interrupts: 0,
            enabled: [0; 4],
            // Power came on: both flags of the supply, and the pin's.
            status: 0x0e00_0000,
            crystal_ready: None,
            pll_ready: None,
        };
        clocks.reset();
        clocks
    }
}

impl Clocks {
    pub(super) fn reset(&mut self) {
        (self.control, self.pll, self.configuration, self.interrupts) = (0x83, 0x2400_3010, 0, 0);
        (self.crystal_ready, self.pll_ready) = (None, None);
        self.enabled = [0x0010_0000, 0, 0, 0];
    }

    fn internal_hz(&self) -> f64 {
        HSI_HZ * self.internal
    }

    fn pll_input_hz(&self) -> f64 {
        if self.pll & 1 << 22 != 0 { self.crystal.hz } else { self.internal_hz() }
    }

    fn vco_hz(&self) -> f64 {
        let (m, n) = (f64::from(self.pll & 63), f64::from(self.pll >> 6 & 0x1ff));
        self.pll_input_hz() / m.max(1.0) * n
    }

    fn pll_hz(&self) -> f64 {
        self.vco_hz() / f64::from(2 * ((self.pll >> 16 & 3) + 1))
    }

    /// Returns the frequency of the core, Hz.
    pub fn core_hz(&self) -> f64 {
        match self.configuration >> 2 & 3 {
            1 => self.crystal.hz,
            2 => self.pll_hz(),
            _ => self.internal_hz(),
        }
    }

    fn divided(&self, at: u32) -> f64 {
        let field = self.configuration >> at & 7;
        self.core_hz() / if field < 4 { 1.0 } else { f64::from(2_u32 << (field & 3)) }
    }

    /// Returns the frequency of the peripherals' first bus, Hz.
    pub fn apb1_hz(&self) -> f64 {
        self.divided(10)
    }

    /// Returns the frequency of the peripherals' second bus, Hz.
    pub fn apb2_hz(&self) -> f64 {
        self.divided(13)
    }

    /// Returns the frequency of timers at the first bus, Hz.
    pub fn timer_hz(&self) -> f64 {
        if self.configuration >> 10 & 4 == 0 { self.apb1_hz() } else { 2.0 * self.apb1_hz() }
    }

    /// Returns true if a peripheral has its clock: of AHB1 (0), APB1 (2), APB2 (3).
    pub fn feeds(&self, bus: usize, bit: u32) -> bool {
        self.enabled[bus] >> bit & 1 != 0
    }

    pub(super) fn next(&self) -> Option<u64> {
        let stops = self.crystal.stops.filter(|_| self.control & HSERDY != 0);
        [self.crystal_ready, self.pll_ready, stops].into_iter().flatten().min()
    }
}

impl Machine {
    pub(super) fn look_at_clocks(&mut self) {
        let now = self.now;
        let due = |at: &mut Option<u64>| at.is_some_and(|t| t <= now) && at.take().is_some();
        if due(&mut self.clocks.crystal_ready) {
            self.clocks.control |= HSERDY;
        }
        if due(&mut self.clocks.pll_ready) {
            self.clocks.control |= PLLRDY;
        }
        if self.clocks.control & HSERDY != 0 && self.clocks.crystal.stops.is_some_and(|at| at <= now) {
            self.crystal_stops();
        }
    }

    fn crystal_stops(&mut self) {
        let clocks = &mut self.clocks;
        clocks.crystal.hz = 0.0;
        clocks.control &= !HSERDY;
        let guarded = clocks.control & CSSON != 0;
        let uses = match clocks.configuration >> 2 & 3 {
            1 => true,
            2 => clocks.pll & 1 << 22 != 0,
            _ => false,
        };
        // Section 7.2.7: the oscillator is off, and if it was used, the chip runs on its own one.
        if guarded {
            clocks.control &= !HSEON;
            clocks.interrupts |= CSSF;
            self.nvic.not_maskable = true;
        }
        if uses {
            self.clocks.control &= !(PLLON | PLLRDY);
            self.clocks.configuration &= !0xf;
            if !guarded {
                self.breach("the crystal stopped and nobody watched it");
            }
            self.clocks_changed();
        }
    }

    fn clocks_changed(&mut self) {
        let hz = self.clocks.core_hz();
        let most = 30e6 * f64::from(self.flash.wait_states() + 1);
        if hz > most * 1.001 {
            self.breach(format!("{:.0} MHz with {} wait states", hz / 1e6, self.flash.wait_states()));
        }
        let (apb1, apb2) = (self.clocks.apb1_hz(), self.clocks.apb2_hz());
        if apb1 > 42.5e6 || apb2 > 85e6 {
            self.breach(format!("buses at {apb1} and {apb2} Hz"));
        }
        if hz > 144e6 && !self.supply.is_scaled_up() {
            self.breach("more than 144 MHz at the lower voltage scale");
        }
        let now = self.now;
        let (timer_hz, core_hz) = (self.clocks.timer_hz(), hz);
        self.timer.change_clock(now, timer_hz, core_hz);
    }

    pub(super) fn read_clocks(&mut self, offset: usize) -> u32 {
        match offset {
            0x00 => self.clocks.control,
            0x04 => self.clocks.pll,
            0x08 => self.clocks.configuration,
            0x0c => self.clocks.interrupts,
            0x30 => self.clocks.enabled[0],
            0x34 => self.clocks.enabled[1],
            0x40 => self.clocks.enabled[2],
            0x44 => self.clocks.enabled[3],
            0x74 => self.clocks.status,
            _ => 0,
        }
    }

    pub(super) fn write_clocks(&mut self, offset: usize, value: u32) {
        match offset {
            0x00 => self.write_control(value),
            0x04 => {
                if self.clocks.control & PLLON != 0 {
                    self.breach("the PLL's factors are changed while it runs");
                } else {
                    self.clocks.pll = value;
                }
            }
            0x08 => self.write_configuration(value),
            0x0c => {
                if value & CSSC != 0 {
                    self.clocks.interrupts &= !CSSF;
                }
            }
            0x10 | 0x14 | 0x20 | 0x24 => self.hold_in_reset(offset, value),
            0x30 => self.clocks.enabled[0] = value,
            0x34 => self.clocks.enabled[1] = value,
            0x40 => self.clocks.enabled[2] = value,
            0x44 => self.clocks.enabled[3] = value,
            0x74 => {
                if value & 1 << 24 != 0 {
                    self.clocks.status &= 0x00ff_ffff;
                }
            }
            _ => self.breach(format!("RCC {offset:#x} is written")),
        }
    }

    fn write_control(&mut self, value: u32) {
        let now = self.now;
        let clocks = &mut self.clocks;
        let (system, before) = (clocks.configuration >> 2 & 3, clocks.control);
        let mut on = value & (HSION | HSEON | HSEBYP | CSSON | PLLON | 0xf8);
        // What the core runs on cannot be switched off.
        match system {
            0 => on |= HSION,
            1 => on |= HSEON,
            _ => on |= PLLON | if clocks.pll & 1 << 22 != 0 { HSEON } else { HSION },
        }
        let ready = before & (HSIRDY | HSERDY | PLLRDY);
        clocks.control = on | ready;
        if on & HSION != 0 {
            clocks.control |= HSIRDY
        } else {
            clocks.control &= !HSIRDY
        }
        if on & HSEON == 0 {
            clocks.control &= !HSERDY;
            clocks.crystal_ready = None;
        } else if before & HSEON == 0 && clocks.crystal.hz > 0.0 {
            clocks.crystal_ready = Some(now + CRYSTAL_STARTS);
        }
        if on & PLLON == 0 {
            clocks.control &= !PLLRDY;
            clocks.pll_ready = None;
        } else if before & PLLON == 0 {
            let has_input = clocks.control & if clocks.pll & 1 << 22 != 0 { HSERDY } else { HSIRDY } != 0;
            let input = clocks.pll_input_hz() / f64::from((clocks.pll & 63).max(1));
            let locks = (0.95e6..=2.1e6).contains(&input) && (100e6..=432e6).contains(&clocks.vco_hz());
            clocks.pll_ready = (has_input && locks).then_some(now + PLL_LOCKS);
        }
    }

    fn write_configuration(&mut self, value: u32) {
        let clocks = &mut self.clocks;
        let ready = match value & 3 {
            0 => HSIRDY,
            1 => HSERDY,
            _ => PLLRDY,
        };
        let system = if clocks.control & ready != 0 { value & 3 } else { clocks.configuration >> 2 & 3 };
        clocks.configuration = value & !0xc | system << 2;
        self.clocks_changed();
    }

    fn hold_in_reset(&mut self, offset: usize, value: u32) {
        match offset {
            0x10 => {
                if value & 3 != 0 {
                    self.deselect_all();
                    self.pins.reset_ports(value & 3);
                }
                if value & 1 << 22 != 0 {
                    self.spi.reset_dma();
                }
            }
            0x20 => {
                if value & 1 != 0 {
                    self.timer.reset_counter();
                }
                if value & 1 << 17 != 0 {
                    self.port.reset();
                }
            }
            0x24 => {
                if value & 1 << 12 != 0 {
                    self.spi.reset_port();
                }
                if value & 1 << 14 != 0 {
                    self.pins.reset_routing();
                }
            }
            _ => {}
        }
    }
}

/// Ticks of a clock in a time, ps.
pub(super) fn ticks(hz: f64, time: u64) -> f64 {
    hz * (time as f64 / PS as f64)
}
