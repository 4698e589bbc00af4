//! The firmware on the emulated board.
#![no_std]
#![no_main]

use core::cell::RefCell;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::singleton;
use cortex_m_rt::{entry, exception};
// The global logger: frames on the emulator's standard output.
use defmt_semihosting as _;
use mps2_an386::bus::{self, NoWait, Pipes};
#[cfg(feature = "storage")]
use mps2_an386::flash;
use mps2_an386::uart::QUEUES;
use mps2_an386::{exit, uart};
use rigident_firmware::{Buses, Event, Instrument, Path, Sensor};
use rigident_shared::wire::bus::{Event as BusEvent, PollAnswer};

/// Core clock and wake-ups of an idle machine, 1/s.
const CLOCK_HZ: u32 = 25_000_000;
const LOOKS_HZ: u32 = 1_000;

/// A sensor as its driver sees it.
type Device = bus::Sensor<'static>;
type Board = Instrument<&'static mut Path, Device, Device, Device, NoWait>;

#[entry]
fn main() -> ! {
    let mut core = cortex_m::Peripherals::take().expect("taken once");
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(CLOCK_HZ / LOOKS_HZ - 1);
    core.SYST.clear_current();
    core.SYST.enable_counter();
    core.SYST.enable_interrupt();

    let pipes: &_ = singleton!(: RefCell<Pipes> = RefCell::new(Pipes::open())).expect("taken once");
    #[cfg(feature = "storage")]
    let mut store = flash::store(pipes);
    let instrument = instrument(pipes);
    let mut now_ns = 0;
    let mut chunk = [0; 64];
    uart::start();
    defmt::info!("rigident on mps2-an386, firmware {=u32:08x}", rigident_firmware::FIRMWARE_HASH);
    loop {
        #[cfg(feature = "storage")]
        if let Some(store) = &mut store {
            instrument.tend(store);
        }
        let n = uart::receive(&mut chunk);
        instrument.on_bytes(chunk.get(..n).unwrap_or_default(), now_ns);
        if QUEUES.fill(instrument, &mut chunk) {
            uart::send();
        }
        if instrument.tx_pending() > 0 {
            // A sample is asked for when its output will find room. On a board with real sensors samples do
            // not wait; here they can, and none is lost however slow the host reads.
            QUEUES.wait();
            continue;
        }
        let PollAnswer { event, time_ns } = pipes.borrow_mut().poll();
        now_ns = time_ns;
        instrument.tick(now_ns);
        let sensor = match event {
            BusEvent::LoadCellReady => Sensor::LoadCell,
            BusEvent::ImuReady => Sensor::Imu,
            BusEvent::SecondImuReady => Sensor::SecondImu,
            BusEvent::FrameReady => Sensor::Frames,
            BusEvent::Exit => exit::success(),
            BusEvent::Idle => {
                if QUEUES.fill(instrument, &mut chunk) {
                    uart::send();
                }
                QUEUES.wait();
                continue;
            }
        };
        instrument.on_event(Event { sensor, capture_time_ns: time_ns });
    }
}

/// The application where it stays: made on a stack of its own, which is gone afterwards.
// `singleton!` hands it out once; it is no part of the pipes.
#[allow(clippy::mut_from_ref)]
#[inline(never)]
fn instrument(pipes: &'static RefCell<Pipes>) -> &'static mut Board {
    let buses = Buses {
        load_cell: bus::Sensor::load_cell(pipes),
        imus: [bus::Sensor::imu(pipes), bus::Sensor::second_imu(pipes)],
        frames: bus::Sensor::frames(pipes),
    };
    let path = singleton!(: Path = Path::EMPTY).expect("taken once");
    singleton!(: Board = Instrument::new("mps2-an386", path, buses, NoWait)).expect("taken once")
}

/// Handles the core's timer. It is longer than the two instructions of Arm's erratum 776924 of the Cortex-M4:
/// a result of a division may be lost by them.
#[exception]
fn SysTick() {
    core::hint::black_box([0_u32; 4]);
}

// SAFETY: it only touches the serial port, which the main loop leaves to it.
#[exception]
unsafe fn DefaultHandler(line: i16) {
    match line.unsigned_abs() {
        uart::RECEIVED => uart::on_received(),
        uart::SENT => uart::on_sent(),
        _ => defmt::panic!("interrupt {=i16} has no handler", line),
    }
}
