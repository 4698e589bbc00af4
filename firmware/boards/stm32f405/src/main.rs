//! The firmware on the board.
#![no_std]
#![no_main]

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::singleton;
use cortex_m_rt::{entry, exception};
#[cfg(feature = "rtt")]
use defmt_rtt as _;
use rigident_cortex_m::absent::Absent;
use rigident_cortex_m::stack;
use rigident_firmware::capture::{Answering, Capture, Lost, Place, Ring, Samples};
use rigident_firmware::progress::{Progress, Turn};
#[cfg(feature = "storage")]
use rigident_firmware::storage::Store;
use rigident_firmware::{Buses, Event, Instrument, Path, Sensor};
use rigident_shared::wire::{ClockSource, StateName};
use stm32f405::clock::{self, Clocks};
#[cfg(feature = "storage")]
use stm32f405::flash::{self, Flash};
use stm32f405::registers::interrupts;
use stm32f405::sensors::{self, OnBus};
use stm32f405::time::{self, Time, Wait};
use stm32f405::usart::QUEUES;
use stm32f405::{CHIP, spi, start, usart, watchdog};

/// Wake-ups of an idle machine, and looks at the bus, 1/s.
const LOOKS_HZ: u32 = 1_000;
/// How deep the stack has been is looked at this often, while there is nothing else to do, ns.
const MARK_EVERY_NS: u64 = 1_000_000_000;

/// A sensor as its driver sees it.
type Device = Answering<'static, OnBus>;
type Board = Instrument<&'static mut Path, Device, Device, Absent, Wait>;

/// Samples that no room was found for.
static LOST: Lost = Lost::new();

#[entry]
fn main() -> ! {
    start::forget_the_loader();
    stack::guard();
    let (reset, ended) = start::reason();
    let core = cortex_m::Peripherals::take().expect("taken once");
    let clocks = clock::start();
    watchdog::start();
    look_up(core.SYST, &clocks);
    time::start(&clocks);
    spi::start();
    usart::start(&clocks);
    let place = singleton!(: Place = Place::new(None)).expect("taken once");
    let ring = singleton!(: Ring = Ring::new()).expect("taken once");
    let (filled, taken) = ring.split();
    sensors::start(Capture::new(filled, &LOST));
    let mut samples = Samples::new(taken, &LOST);
    let device = |sensor| Answering::new(OnBus(sensor), sensor, place);
    let instrument = instrument(Buses {
        load_cell: device(Sensor::LoadCell),
        imus: [device(Sensor::Imu), device(Sensor::SecondImu)],
        frames: Absent,
    });
    instrument.booted(reset, clocks.source);
    // The emulator has nothing at that address.
    let emulated = clocks.source == ClockSource::Emulated;
    instrument.is_chip(if emulated { [0; 12] } else { start::unique_id() }, ended);
    instrument.can_restart();
    instrument.line_goes_up_to(usart::fastest(&clocks));
    #[cfg(feature = "storage")]
    let mut store = singleton!(: Option<Store<Flash>> = flash::store()).and_then(Option::as_mut);
    let mut time = Time::new();
    let mut listening = [false; 3];
    let mut overruns = 0;
    let mut baud = usart::BAUD;
    let mut chunk = [0; 64];
    let (mut progress, mut failures, mut next_mark_ns) = (Progress::default(), sensors::failures(), 0);
    start::go();
    loop {
        let count = usart::receive(&mut chunk);
        instrument.on_bytes_pausing(chunk.get(..count).unwrap_or_default(), time.now_ns(), || {
            // Nobody may interrupt while the sensors are brought up.
            listening = [false; 3];
            sensors::listen(listening);
        });
        let wanted = instrument.app().wanted();
        if wanted != listening {
            samples.clear();
            sensors::listen(wanted);
            listening = wanted;
        }
        let mut idle = count == 0;
        let running = instrument.app().state().0 == StateName::Running;
        let mut turn = Turn { needed: if running { wanted } else { [false; 3] }, ..Turn::default() };
        while let Some(sample) = samples.take() {
            idle = false;
            if let Some(came) = turn.came.get_mut(sample.sensor as usize) {
                *came = true;
            }
            place.set(Some(sample));
            instrument.on_event(Event { sensor: sample.sensor, capture_time_ns: time.of(sample.ticks) });
            place.set(None);
            send(instrument, &mut chunk);
        }
        for (sensor, lost) in samples.newly_lost() {
            instrument.on_lost(sensor, lost);
        }
        let before = core::mem::replace(&mut failures, sensors::failures());
        instrument.on_failed_transfers(
            failures.overdue.wrapping_sub(before.overdue),
            failures.failed.wrapping_sub(before.failed),
        );
        instrument.on_overruns(QUEUES.newly_overrun(&mut overruns));
        instrument.tick(time.now_ns());
        send(instrument, &mut chunk);
        let rate = instrument.app().line_rate().unwrap_or(usart::BAUD);
        if rate != baud && instrument.tx_pending() == 0 && usart::change_rate(&clocks, rate) {
            baud = rate;
        }
        turn.waiting = QUEUES.to_host.len();
        let now_ns = time.now_ns();
        if progress.goes_on(now_ns, &turn) {
            watchdog::feed();
        }
        let quiet = QUEUES.to_host.is_empty() && QUEUES.from_host.is_empty();
        #[cfg(feature = "storage")]
        if let Some(store) = &mut store {
            // The answer goes out first: code stands still while a sector is erased.
            instrument.tend_when_quiet(store, quiet);
        }
        if instrument.app().restart_is_due() && quiet && usart::has_sent() {
            start::restart();
        }
        if idle && now_ns >= next_mark_ns {
            next_mark_ns = now_ns + MARK_EVERY_NS;
            let (deepest, size) = stack::high_water_and_size();
            instrument.stack_was(deepest as u32, size as u32);
        }
        if idle {
            QUEUES.wait();
        }
    }
}

/// The application where it stays: made on a stack of its own, which is gone afterwards.
#[inline(never)]
fn instrument(buses: Buses<Device, Device, Absent>) -> &'static mut Board {
    let path = singleton!(: Path = Path::EMPTY).expect("taken once");
    singleton!(: Board = Instrument::new(CHIP, path, buses, Wait)).expect("taken once")
}

fn look_up(mut timer: SYST, clocks: &Clocks) {
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(clocks.core_hz / LOOKS_HZ - 1);
    timer.clear_current();
    timer.enable_counter();
    timer.enable_interrupt();
}

fn send(instrument: &mut Board, chunk: &mut [u8]) {
    if QUEUES.fill(instrument, chunk) {
        usart::send();
    }
}

/// A handler of one or two instructions may lose the result of a division or root that it interrupts (Arm's erratum 776924 of the
/// Cortex-M4, revision r0p1): this one is longer.
#[exception]
fn SysTick() {
    sensors::on_look();
}

// SAFETY: each handler touches what its module keeps for it.
#[exception]
unsafe fn DefaultHandler(line: i16) {
    match line.unsigned_abs() {
        interrupts::EXTI1 | interrupts::EXTI15_10 => sensors::on_edges(),
        interrupts::DMA2_STREAM0 => sensors::on_transferred(),
        interrupts::USART2 => usart::on_interrupt(),
        _ => {}
    }
}
