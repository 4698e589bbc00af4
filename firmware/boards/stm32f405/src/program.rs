//! The program: what is set up, what the main loop does in a turn, and which interrupt is whose.

use rigident_cortex_m::absent::Absent;
use rigident_firmware::capture::{Answering, Capture, Failures, Lost, Place, Ring, Samples};
use rigident_firmware::progress::{Progress, Turn};
#[cfg(feature = "storage")]
use rigident_firmware::storage::Store;
use rigident_firmware::{Buses, Event, Instrument, Path, Sensor};
use rigident_shared::wire::{BadEnd, ClockSource, ResetReason, StateName};

use crate::clock::{self, Clocks};
#[cfg(feature = "storage")]
use crate::flash::Flash;
use crate::registers::{SYST_CSR, SYST_CVR, SYST_RVR, lines};
use crate::sensors::{self, OnBus};
use crate::time::{self, Time, Wait};
use crate::usart::QUEUES;
use crate::{CHIP, spi, start, usart, watchdog};

/// Wake-ups of an idle machine, and looks at the bus, 1/s.
const LOOKS_HZ: u32 = 1_000;
/// The core's timer: on, with an interrupt, by the core's clock.
const TIMER_ON: u32 = 0b111;
/// The deepest use of the stack is looked at this often, while there is nothing else to do, ns.
const MARK_EVERY_NS: u64 = 1_000_000_000;

/// A sensor as its driver sees it.
type Device = Answering<'static, OnBus>;
/// The drivers with the application.
pub type Board = Instrument<&'static mut Path, Device, Device, Absent, Wait>;
/// Samples that no room was found for.
static LOST: Lost = Lost::new();

/// Tells how the chip came up.
pub struct Boot {
    /// The reason why it was reset.
    pub reset: ResetReason,
    /// The place where the last program ended, if it ended badly.
    pub ended: Option<BadEnd>,
    /// The clocks that the chip runs at.
    pub clocks: Clocks,
}

/// Sets clocks, watchdog, timers, bus and port up. No interrupt comes before [`Program::new`].
pub fn boot() -> Boot {
    let (reset, ended) = start::reason();
    let clocks = clock::start();
    watchdog::start();
    look_up(&clocks);
    time::start(&clocks);
    spi::start();
    usart::start(&clocks);
    Boot { reset, ended, clocks }
}

/// Makes drivers and application; nothing is sent to the sensors yet.
pub fn instrument(path: &'static mut Path, place: &'static Place) -> Board {
    let device = |sensor| Answering::new(OnBus(sensor), sensor, place);
    let buses = Buses {
        load_cell: device(Sensor::LoadCell),
        imus: [device(Sensor::Imu), device(Sensor::SecondImu)],
        frames: Absent,
    };
    Instrument::new(CHIP, path, buses, Wait)
}

/// Holds what the main loop knows between two turns. `S` returns how deep the stack has been, and its size,
/// bytes; a type, so that the stack's bound can be computed.
pub struct Program<'a, S: Fn() -> (usize, usize)> {
    instrument: &'a mut Board,
    samples: Samples<'static>,
    place: &'static Place,
    #[cfg(feature = "storage")]
    store: Option<&'a mut Store<Flash>>,
    clocks: Clocks,
    time: Time,
    listening: [bool; 3],
    overruns: u32,
    baud: u32,
    chunk: [u8; 64],
    progress: Progress,
    failures: Failures,
    stack_mark: S,
    next_mark_ns: u64,
}

impl<'a, S: Fn() -> (usize, usize)> Program<'a, S> {
    /// Returns the program of a chip that has come up, and lets interrupts in.
    #[inline(always)]
    pub fn new(
        boot: &Boot,
        instrument: &'a mut Board,
        (ring, place): (&'static mut Ring, &'static Place),
        #[cfg(feature = "storage")] store: Option<&'a mut Store<Flash>>,
        stack_mark: S,
    ) -> Self {
        let (filled, taken) = ring.split();
        sensors::start(Capture::new(filled, &LOST));
        let clocks = boot.clocks;
        instrument.keeps_events(&start::EVENTS);
        instrument.booted(boot.reset, clocks.source);
        // The emulator has nothing at that address.
        let emulated = clocks.source == ClockSource::Emulated;
        instrument.is_chip(if emulated { [0; 12] } else { start::unique_id() }, boot.ended);
        instrument.can_restart();
        instrument.line_goes_up_to(usart::fastest(&clocks));
        let program = Self {
            instrument,
            samples: Samples::new(taken, &LOST),
            place,
            #[cfg(feature = "storage")]
            store,
            clocks,
            time: Time::new(),
            listening: [false; 3],
            overruns: 0,
            baud: usart::BAUD,
            chunk: [0; 64],
            progress: Progress::default(),
            failures: sensors::failures(),
            stack_mark,
            next_mark_ns: 0,
        };
        start::go();
        program
    }

    /// Returns the application, to look at.
    pub fn instrument(&self) -> &Board {
        self.instrument
    }

    /// Does one turn of the main loop, and sleeps at its end if there was nothing to do.
    // In the frame of `main`, whose room it shares.
    #[inline(always)]
    pub fn turn(&mut self) {
        let Self { instrument, samples, chunk, listening, .. } = self;
        let count = usart::receive(chunk);
        let now_ns = self.time.now_ns();
        instrument.on_bytes_pausing(chunk.get(..count).unwrap_or_default(), now_ns, || {
            // Nobody may interrupt while the sensors are brought up.
            *listening = [false; 3];
            sensors::listen(*listening);
        });
        let wanted = instrument.app().wanted();
        if wanted != *listening {
            samples.clear();
            sensors::listen(wanted);
            *listening = wanted;
        }
        let mut idle = count == 0;
        let running = instrument.app().state().0 == StateName::Running;
        let mut turn = Turn { needed: if running { wanted } else { [false; 3] }, ..Turn::default() };
        while let Some(sample) = samples.take() {
            idle = false;
            if let Some(came) = turn.came.get_mut(sample.sensor as usize) {
                *came = true;
            }
            self.place.set(Some(sample));
            let capture_time_ns = self.time.of(sample.ticks);
            instrument.on_event(Event { sensor: sample.sensor, capture_time_ns });
            self.place.set(None);
            send(instrument, chunk);
        }
        for (sensor, lost) in samples.newly_lost() {
            instrument.on_lost(sensor, lost);
        }
        let before = core::mem::replace(&mut self.failures, sensors::failures());
        instrument.on_failed_transfers(
            self.failures.overdue.wrapping_sub(before.overdue),
            self.failures.failed.wrapping_sub(before.failed),
        );
        instrument.on_overruns(QUEUES.newly_overrun(&mut self.overruns));
        instrument.tick(self.time.now_ns());
        send(instrument, chunk);
        let rate = instrument.app().line_rate().unwrap_or(usart::BAUD);
        if rate != self.baud && instrument.tx_pending() == 0 && usart::change_rate(&self.clocks, rate) {
            self.baud = rate;
        }
        turn.waiting = QUEUES.to_host.len();
        let now_ns = self.time.now_ns();
        if self.progress.goes_on(now_ns, &turn) {
            watchdog::feed();
        }
        #[cfg(feature = "storage")]
        if let Some(store) = &mut self.store {
            // The answer goes out first: code stands still while a sector is erased.
            let quiet = QUEUES.to_host.is_empty() && QUEUES.from_host.is_empty();
            instrument.tend_when_quiet(store, quiet);
        }
        if instrument.app().restart_is_due() && usart::has_sent() {
            start::restart();
        }
        if idle && now_ns >= self.next_mark_ns {
            self.next_mark_ns = now_ns + MARK_EVERY_NS;
            let (deepest, size) = (self.stack_mark)();
            instrument.stack_was(deepest as u32, size as u32);
        }
        if idle {
            QUEUES.wait();
        }
    }
}

fn look_up(clocks: &Clocks) {
    SYST_RVR.write(clocks.core_hz / LOOKS_HZ - 1);
    SYST_CVR.write(0);
    SYST_CSR.write(TIMER_ON);
}

fn send(instrument: &mut Board, chunk: &mut [u8]) {
    if QUEUES.fill(instrument, chunk) {
        usart::send();
    }
}

/// Handles the interrupt of the core's timer.
pub fn on_timer() {
    sensors::on_look();
}

/// Handles the interrupt of this number: each handler touches what its module keeps for it.
pub fn on_interrupt(line: u16) {
    match line {
        lines::EXTI1 | lines::EXTI15_10 => sensors::on_edges(),
        lines::DMA2_STREAM0 => sensors::on_transferred(),
        lines::USART2 => usart::on_interrupt(),
        _ => {}
    }
}
