//! A model of the STM32F405 as its drivers see it: registers, interrupts and time.
//!
//! Made from the reference manual RM0090 (sections in each file), the data sheet DS8626 and the ARMv7-M
//! manual, not from the drivers. What the manual forbids is kept in [`Machine::breaches`]: silicon would do
//! something else there, and nobody knows what. Time moves by accesses, each of which takes [`CYCLES`] of the
//! core; whatever the chip does by itself (transfers, bytes on the line, the timers, erasing) happens at its
//! own time, and interrupts come between two accesses.

mod clocks;
mod flash;
mod pins;
mod port;
mod spi;
mod supply;
mod timer;

use std::cell::{Cell, RefCell};
use std::panic;
use std::rc::Rc;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rigident_cortex_m::model;
use rigident_sim::devices::Device;
use rigident_sim::rig::{BusEvent, Rig};
use stm32f405::program;
use stm32f405::start;

use super::faults::What;

pub use clocks::Crystal;
pub use flash::Pace;
pub use pins::EdgeFault;
pub use spi::BusFault;
pub use supply::Reset;

/// Time of one access with what the program does around it, cycles of the core.
const CYCLES: u64 = 5;
/// Entry into a handler and return from it, cycles (ARM's reference manual of the core: 12 and 12).
const HANDLER_CYCLES: u64 = 24;
const PS: u64 = 1_000_000_000_000;
/// One microsecond, ps.
pub const US: u64 = 1_000_000;
/// One millisecond, ps.
pub const MS: u64 = 1_000 * US;
/// The longest that the program computes without a look at what waits, ps.
const SLICE: u64 = 5 * US;

/// The chip. Its parts are in the [`Machine`].
pub struct Chip {
    machine: RefCell<Machine>,
    masked: Cell<bool>,
    /// A handler runs: all have one priority.
    handles: Cell<bool>,
}

/// Everything that has a state.
pub struct Machine {
    pub now: u64,
    pub rig: Rig,
    pub clocks: clocks::Clocks,
    pub flash: flash::Flash,
    pub supply: supply::Supply,
    pub pins: pins::Pins,
    pub timer: timer::Timer,
    pub spi: spi::Spi,
    pub port: port::Port,
    nvic: Nvic,
    next_sensors: u64,
    /// The longest that the program computes at a look at the time, ps.
    pub computing: u64,
    /// The program stands still at one look at the time in this many, and for how long, ps.
    pub long_computing: (u32, u64),
    /// Disturbances of the sensors, with their times, ps.
    pub later: Vec<(u64, What)>,
    random: ChaCha8Rng,
    /// Acts that the manual forbids and that were done.
    pub breaches: Vec<String>,
    reset: Option<Reset>,
    pub resets: Vec<Reset>,
}

#[derive(Default)]
struct Nvic {
    enabled: [u32; 3],
    pended: [u32; 3],
    /// The core's timer waits, and the interrupt that cannot be masked.
    tick: bool,
    not_maskable: bool,
}

enum Handler {
    NotMaskable,
    Tick,
    Line(u16),
}

impl Chip {
    /// Returns a chip at its first power-on, wired to this rig, and makes it this thread's.
    pub fn new(rig: Rig, seed: u64) -> Rc<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(77);
        let machine = Machine {
            now: 0,
            rig,
            clocks: clocks::Clocks::default(),
            flash: flash::Flash::new(),
            supply: supply::Supply::default(),
            pins: pins::Pins::default(),
            timer: timer::Timer::default(),
            spi: spi::Spi::default(),
            port: port::Port::default(),
            nvic: Nvic::default(),
            next_sensors: 0,
            computing: 12 * US,
            long_computing: (0, 0),
            later: Vec::new(),
            random,
            breaches: Vec::new(),
            reset: None,
            resets: Vec::new(),
        };
        let chip = Rc::new(Self {
            machine: RefCell::new(machine),
            masked: Cell::new(false),
            handles: Cell::new(false),
        });
        model::put(chip.clone());
        chip
    }

    /// Looks at the machine, or does something to it.
    pub fn with<R>(&self, what: impl FnOnce(&mut Machine) -> R) -> R {
        what(&mut self.machine.borrow_mut())
    }

    /// Returns the time, s.
    pub fn now_s(&self) -> f64 {
        self.with(|m| m.now as f64 / PS as f64)
    }

    /// Brings the chip out of reset: interrupts are let in, as the architecture has it.
    pub fn begins(&self) {
        self.masked.set(false);
        self.handles.set(false);
    }

    fn access<R>(&self, cycles: u64, what: impl FnOnce(&mut Machine) -> R) -> R {
        let result = {
            let mut machine = self.machine.borrow_mut();
            let spent = cycles * machine.cycle();
            machine.spend(spent);
            what(&mut machine)
        };
        self.serve();
        result
    }

    /// Computes: the main loop looks at the time now and then, and computes between these looks. Interrupts
    /// come in between.
    fn compute(&self) {
        let mut left = self.machine.borrow_mut().time_computed();
        while left > 0 {
            let slice = left.min(SLICE);
            left -= slice;
            self.machine.borrow_mut().spend(slice);
            self.serve();
        }
    }

    /// Ends the program if the chip was reset; else calls the handlers of what waits.
    fn serve(&self) {
        if self.machine.borrow().reset.is_some() {
            panic::resume_unwind(Box::new(Restarted));
        }
        while let Some(handler) = self.next_handler() {
            let before = self.handles.replace(true);
            match handler {
                Handler::NotMaskable => start::on_not_maskable(),
                Handler::Tick => program::on_timer(),
                Handler::Line(line) => program::on_interrupt(line),
            }
            self.handles.set(before);
            let mut machine = self.machine.borrow_mut();
            let spent = HANDLER_CYCLES * machine.cycle();
            machine.spend(spent);
        }
    }

    fn next_handler(&self) -> Option<Handler> {
        let machine = &mut *self.machine.borrow_mut();
        if std::mem::take(&mut machine.nvic.not_maskable) {
            return Some(Handler::NotMaskable);
        }
        if self.masked.get() || self.handles.get() {
            return None;
        }
        if std::mem::take(&mut machine.nvic.tick) {
            return Some(Handler::Tick);
        }
        let line = machine.waiting_line()?;
        machine.nvic.pended[usize::from(line / 32)] &= !(1 << (line % 32));
        Some(Handler::Line(line))
    }
}

/// The payload of the unwinding that ends a program when its chip is reset.
pub struct Restarted;

impl model::Chip for Chip {
    fn read(&self, address: usize) -> u32 {
        if address == timer::COUNT && !self.handles.get() && !self.masked.get() {
            self.compute();
        }
        self.access(CYCLES, |machine| machine.read(address))
    }

    fn write(&self, address: usize, value: u32) {
        self.access(CYCLES, |machine| machine.write(address, value));
    }

    fn name_memory(&self, register: usize, memory: usize) {
        self.access(CYCLES, |machine| machine.name_memory(register, memory));
    }

    fn hold_interrupts(&self, held: bool) {
        self.masked.set(held);
        self.access(1, |_| ());
    }

    fn holds_interrupts(&self) -> bool {
        self.masked.get()
    }

    fn sleep(&self) {
        // An interrupt that is held back wakes the core all the same.
        loop {
            let mut machine = self.machine.borrow_mut();
            if machine.reset.is_some() || machine.is_woken() {
                break;
            }
            let until = machine.next().max(machine.now);
            machine.run_until(until);
        }
        self.serve();
    }
}

impl Machine {
    /// Returns a cycle of the core, ps.
    fn cycle(&self) -> u64 {
        (PS as f64 / self.clocks.core_hz()) as u64
    }

    fn breach(&mut self, what: impl Into<String>) {
        let what = what.into();
        if !self.breaches.contains(&what) {
            self.breaches.push(what);
        }
    }

    /// Draws a number below `below`.
    pub fn draw(&mut self, below: u64) -> u64 {
        self.random.next_u64() % below.max(1)
    }

    fn time_computed(&mut self) -> u64 {
        let (every, long) = self.long_computing;
        if every > 0 && self.draw(u64::from(every)) == 0 {
            return long;
        }
        let most = self.computing;
        most / 4 + self.draw(most)
    }

    /// Lets the program take this time, ps; it stands still while the flash is busy, for that is where it is.
    fn spend(&mut self, time: u64) {
        let until = self.now + time;
        self.run_until(until);
        if let Some(end) = self.flash.busy_until() {
            self.run_until(end.max(self.now));
        }
    }

    /// Lets time go by in which nothing happens: what was to come comes as much later. Sensors are silent
    /// from then on, and the line must be.
    pub fn skip(&mut self, time: u64) {
        self.now += time;
        self.next_sensors = u64::MAX;
        self.timer.later(time);
        self.supply.later(time);
    }

    /// Returns the time when something happens next by itself, ps.
    fn next(&self) -> u64 {
        let next = [
            self.clocks.next(),
            self.flash.next(),
            self.supply.next(),
            self.spi.next(),
            self.port.next(),
            self.timer.next(),
            Some(self.next_sensors),
        ];
        next.into_iter().flatten().min().unwrap_or(u64::MAX)
    }

    /// Runs everything that the chip and what is around it do by themselves until then, in its order.
    fn run_until(&mut self, until: u64) {
        while self.reset.is_none() {
            let next = self.next();
            if next > until {
                self.now = until;
                return;
            }
            self.now = self.now.max(next);
            self.look_at_supply();
            self.look_at_clocks();
            self.look_at_flash();
            self.look_at_timer();
            self.look_at_transfer();
            self.look_at_line();
            if self.now >= self.next_sensors {
                self.look_at_sensors();
            }
        }
    }

    fn look_at_sensors(&mut self) {
        loop {
            match self.rig.next_event_before(self.now / 1_000) {
                BusEvent::Idle => break,
                BusEvent::LoadCellReady(at) => self.signal(Device::LoadCell, at * 1_000),
                BusEvent::ImuReady(at) => self.signal(Device::Imu, at * 1_000),
                BusEvent::SecondImuReady(at) => self.signal(Device::SecondImu, at * 1_000),
            }
        }
        let now = self.now;
        let mut due = Vec::new();
        self.later.retain(|(at, what)| {
            if *at <= now {
                due.push(*what);
                false
            } else {
                true
            }
        });
        due.into_iter().for_each(|what| what.happen(&mut self.rig));
        self.look_at_glitches();
        self.plan_sensors();
    }

    /// Returns the time when the last fault that ends by itself is over, ps.
    pub fn ends_of_faults(&self) -> u64 {
        let spi = self.spi.faults.iter().map(|(.., to)| *to);
        let pins = self.pins.faults.iter().map(|(.., to)| *to);
        let sags = self.supply.sags.iter().map(|(_, to, _)| *to);
        let line = self.port.noise.map(|(_, to, _)| to);
        let cut = self.supply.cut.map(|at| at + PS);
        let later = self.later.iter().map(|(at, _)| *at);
        spi.chain(pins).chain(sags).chain(line).chain(cut).chain(later).max().unwrap_or(0)
    }

    /// Registers of a sensor may have changed its rate.
    fn plan_sensors(&mut self) {
        let due = self.rig.next_due_ns().map_or(u64::MAX, |at| at * 1_000);
        let later = self.later.iter().map(|(at, _)| *at).min().unwrap_or(u64::MAX);
        self.next_sensors = due.min(self.pins.next_glitch()).min(later).max(self.now + 1);
    }

    fn lines(&self) -> [u32; 3] {
        let mut lines = self.nvic.pended;
        let mut mark = |line: usize, on: bool| lines[line / 32] |= u32::from(on) << (line % 32);
        let [first, upper] = self.pins.waiting();
        mark(7, first);
        mark(40, upper);
        mark(38, self.port.waits());
        mark(56, self.spi.waits());
        lines
    }

    fn waiting_line(&self) -> Option<u16> {
        let lines = self.lines();
        (0..96).find(|n| lines[n / 32] & self.nvic.enabled[n / 32] & 1 << (n % 32) != 0).map(|n| n as u16)
    }

    fn is_woken(&self) -> bool {
        self.nvic.tick || self.nvic.not_maskable || self.waiting_line().is_some()
    }

    fn read(&mut self, address: usize) -> u32 {
        match address {
            0x4002_3800..=0x4002_38ff => self.read_clocks(address & 0xff),
            0x4002_3c00..=0x4002_3cff => self.flash.read(address & 0xff),
            0x0808_0000..=0x080f_ffff => self.read_cells(address - 0x0808_0000),
            0x1fff_7a10 | 0x1fff_7a14 | 0x1fff_7a18 => {
                [0x0031_0043, 0x3133_470b, 0x3039_3731][(address & 15) / 4]
            }
            0x4000_7000..=0x4000_70ff => self.read_supply(address & 0xff),
            0x4002_0000..=0x4002_07ff => self.read_pins(address),
            0x4001_3800..=0x4001_38ff | 0x4001_3c00..=0x4001_3cff => self.read_edges(address),
            0x4000_0000..=0x4000_00ff => self.read_timer(address & 0xff),
            0x4000_4400..=0x4000_44ff => self.read_port(address & 0xff),
            0x4001_3000..=0x4001_30ff => self.read_spi(address & 0xff),
            0x4002_6400..=0x4002_64ff => self.read_dma(address & 0xff),
            0xe000_e010..=0xe000_e01f => self.timer.read_tick(address & 0xf),
            0xe000_e100..=0xe000_e10b | 0xe000_e180..=0xe000_e18b => self.nvic.enabled[(address & 0xf) / 4],
            0xe000_e200..=0xe000_e20b | 0xe000_e280..=0xe000_e28b => self.lines()[(address & 0xf) / 4],
            0xe004_2008 => 0,
            _ => {
                self.breach(format!("{address:#010x} is read, where nothing is"));
                0
            }
        }
    }

    fn write(&mut self, address: usize, value: u32) {
        let word = (address & 0xf) / 4;
        match address {
            0x4002_3800..=0x4002_38ff => self.write_clocks(address & 0xff, value),
            0x4002_3c00..=0x4002_3cff => self.write_flash(address & 0xff, value),
            0x0808_0000..=0x080f_ffff => self.program(address - 0x0808_0000, value),
            0x4000_3000..=0x4000_30ff => self.write_watchdog(address & 0xff, value),
            0x4000_7000..=0x4000_70ff => self.write_supply(address & 0xff, value),
            0x4002_0000..=0x4002_07ff => self.write_pins(address, value),
            0x4001_3800..=0x4001_38ff | 0x4001_3c00..=0x4001_3cff => self.write_edges(address, value),
            0x4000_0000..=0x4000_00ff => self.write_timer(address & 0xff, value),
            0x4000_4400..=0x4000_44ff => self.write_port(address & 0xff, value),
            0x4001_3000..=0x4001_30ff => self.write_spi(address & 0xff, value),
            0x4002_6400..=0x4002_64ff => self.write_dma(address & 0xff, value),
            0xe000_e010..=0xe000_e01f => {
                let (now, hz) = (self.now, self.clocks.core_hz());
                self.timer.write_tick(address & 0xf, value, now, hz);
            }
            0xe000_e100..=0xe000_e10b => self.nvic.enabled[word] |= value,
            0xe000_e180..=0xe000_e18b => self.nvic.enabled[word] &= !value,
            0xe000_e200..=0xe000_e20b => self.nvic.pended[word] |= value,
            0xe000_e280..=0xe000_e28b => self.nvic.pended[word] &= !value,
            0xe000_ed0c if value >> 16 == 0x05fa => {
                if value & 4 != 0 {
                    self.reset(Reset::Software);
                }
            }
            0xe004_2008 => {}
            _ => self.breach(format!("{value:#x} is written to {address:#010x}, where nothing is")),
        }
    }

    /// Resets the chip. Its registers are as after that; flash, sensors and the line go on.
    pub fn reset(&mut self, why: Reset) {
        if self.reset.is_some() {
            return;
        }
        self.note_reset(why);
        // What the flash was doing is half done.
        self.flash.loses_power(&mut self.random);
        self.reset = Some(why);
        self.resets.push(why);
    }

    /// Brings the chip out of reset. Returns whether it had been in it.
    pub fn comes_up(&mut self) -> bool {
        if self.reset.take().is_none() {
            return false;
        }
        self.clocks.reset();
        self.flash.reset();
        self.supply.reset();
        self.deselect_all();
        self.pins.reset();
        self.timer.reset();
        self.spi.reset();
        self.port.reset();
        self.nvic = Nvic::default();
        self.next_sensors = self.now;
        self.wait_for_supply();
        true
    }
}
