//! The firmware on a Raspberry Pi Pico 2, of which the link to the host is here: recordings can be replayed.
//! The driver of the sensors' bus is not written yet.
//!
//! Crystal and PLL with bounded waits; UART0 on GP0 and GP1. No emulator has the chip: this image is built
//! and not run. The kernels' bits are compared on the same core (`src/bin/kernel_bits.rs`).
#![no_std]
#![no_main]

mod registers;

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::singleton;
use cortex_m_rt::{ExceptionFrame, entry, exception};
use embedded_hal::delay::DelayNs;
use registers::*;
use rigident_cortex_m::absent::Absent;
use rigident_cortex_m::interrupts::{pend, unmask};
use rigident_cortex_m::serial::Queues;
use rigident_firmware::progress::{Progress, Turn};
use rigident_firmware::{Buses, Instrument, Path};
use rigident_shared::wire::{BadEnd, ClockSource, ResetReason};

/// Tells the boot ROM what it expects: an image for the secure Arm core (data sheet, 5.9.5).
// SAFETY: the section holds nothing else, and the ROM only reads it.
#[unsafe(link_section = ".start_block")]
#[used]
static IMAGE: [u32; 5] = [0xffff_ded3, 0x1021_0142, 0x0000_01ff, 0, 0xab12_3579];

const BAUD: u32 = 921_600;
const CRYSTAL_HZ: u32 = 12_000_000;
/// The crystal by 125, divided by 5 and by 2.
const CORE_HZ: u32 = 150_000_000;
/// Wake-ups of an idle machine, 1/s.
const LOOKS_HZ: u32 = 1_000;
/// Some 50 ms of a core at 12 MHz.
const LOOKS: u32 = 100_000;
const UART0_INTERRUPT: u16 = 33;

/// The link to the host.
static QUEUES: Queues = Queues::new();

struct NoWait;

impl DelayNs for NoWait {
    fn delay_ns(&mut self, _: u32) {}
}

type Board = Instrument<&'static mut Path, Absent, Absent, Absent, NoWait>;

#[entry]
fn main() -> ! {
    let (reset, ended) = reason();
    let mut core = cortex_m::Peripherals::take().expect("taken once");
    let (clock_hz, source) = clocks();
    start_watchdog();
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(clock_hz / LOOKS_HZ - 1);
    core.SYST.clear_current();
    core.SYST.enable_counter();
    core.SYST.enable_interrupt();
    start_uart(clock_hz);
    let instrument = instrument();
    instrument.booted(reset, source);
    instrument.is_chip([0; 12], ended);
    instrument.can_restart();
    let mut chunk = [0; 64];
    let mut progress = Progress::default();
    loop {
        let turn = Turn { waiting: QUEUES.to_host.len(), ..Turn::default() };
        if progress.goes_on(now_ns(), &turn) {
            WATCHDOG_LOAD.write(WATCHDOG_US);
        }
        let count = QUEUES.receive(&mut chunk);
        instrument.on_bytes(chunk.get(..count).unwrap_or_default(), now_ns());
        instrument.tick(now_ns());
        // Received bytes that found no room, and bytes to send, are the interrupt's.
        if QUEUES.fill(instrument, &mut chunk) || count > 0 {
            pend(UART0_INTERRUPT);
        }
        let sent = QUEUES.to_host.is_empty() && UART_FR.read() & BUSY == 0;
        if instrument.app().restart_is_due() && sent {
            SCB::sys_reset();
        }
        if count == 0 {
            QUEUES.wait();
        }
    }
}

/// Returns the application where it stays: made on a stack of its own, which is gone afterwards.
#[inline(never)]
fn instrument() -> &'static mut Board {
    let path = singleton!(: Path = Path::EMPTY).expect("taken once");
    let buses = Buses { load_cell: Absent, imus: [Absent, Absent], frames: Absent };
    singleton!(: Board = Instrument::new("rp2350", path, buses, NoWait)).expect("taken once")
}

/// Starts crystal, PLL, and what runs by them. Returns the frequency of the core, Hz, and its source. The
/// chip's ring oscillator, whose frequency nobody knows, is left to run where the crystal does not start: the
/// port is then silent.
fn clocks() -> (u32, ClockSource) {
    const RING_HZ: u32 = 11_000_000;
    // IO_BANK0, PADS_BANK0, PLL_SYS, TIMER0, UART0.
    const USED: u32 = 1 << 6 | 1 << 9 | 1 << 14 | 1 << 23 | 1 << 26;
    XOSC_STARTUP.write(CRYSTAL_HZ / 1000 / 256 + 1);
    XOSC_CTRL.write(0xfab << 12 | 0xaa0);
    let source = if wait_for(XOSC_STATUS, 1 << 31, 1 << 31, LOOKS) {
        CLK_REF_CTRL.write(2);
        wait_for(CLK_REF_SELECTED, 1 << 2, 1 << 2, LOOKS);
        ClockSource::Crystal
    } else {
        ClockSource::Slow
    };
    clear(RESETS_RESET, USED);
    wait_for(RESETS_DONE, USED, USED, LOOKS);
    let mut clock_hz = if source == ClockSource::Crystal { CRYSTAL_HZ } else { RING_HZ };
    if source == ClockSource::Crystal && start_pll() {
        // The auxiliary source is PLL_SYS.
        CLK_SYS_CTRL.write(1);
        if wait_for(CLK_SYS_SELECTED, 1 << 1, 1 << 1, LOOKS) {
            clock_hz = CORE_HZ;
        }
    }
    // Of the core's clock.
    CLK_PERI_CTRL.write(1 << 11);
    // A tick each microsecond.
    TICKS_TIMER0_CYCLES.write(CRYSTAL_HZ / 1_000_000);
    TICKS_TIMER0_CTRL.write(1);
    (clock_hz, source)
}

fn start_pll() -> bool {
    PLL_CS.write(1);
    PLL_FBDIV.write(125);
    // Power, and the oscillator's.
    clear(PLL_PWR, 1 | 1 << 5);
    let locked = wait_for(PLL_CS, 1 << 31, 1 << 31, LOOKS);
    PLL_PRIM.write(5 << 16 | 2 << 12);
    clear(PLL_PWR, 1 << 3);
    locked
}

fn start_uart(clock_hz: u32) {
    for (function, pad) in [(GPIO0_CTRL, GPIO0_PAD), (GPIO1_CTRL, GPIO1_PAD)] {
        // Input on, pulled up and no longer down: a line that is open is silent, and does not stay at 2.2 V
        // (erratum E9).
        set(pad, 1 << 6 | 1 << 3);
        clear(pad, 1 << 2);
        function.write(2);
        // Its output is let out, its isolation taken off.
        clear(pad, 1 << 7 | 1 << 8);
    }
    // In 64ths of a baud divider, rounded.
    let divider = (4 * clock_hz + BAUD / 2) / BAUD;
    UART_IBRD.write(divider / 64);
    UART_FBRD.write(divider % 64);
    // Eight bits, queues on.
    UART_LCR_H.write(0b11 << 5 | 1 << 4);
    UART_CR.write(1 | 1 << 8 | 1 << 9);
    UART_IMSC.write(RECEIVE);
    unmask(UART0_INTERRUPT);
}

/// Received, or nothing more for a while.
const RECEIVE: u32 = 1 << 4 | 1 << 6;
const SEND: u32 = 1 << 5;
const BUSY: u32 = 1 << 3;
const EMPTY: u32 = 1 << 4;
const FULL: u32 = 1 << 5;

/// Takes what has come and sends what can be sent. Without room it is silent until the main loop has made
/// some.
fn on_uart() {
    UART_ICR.write(RECEIVE | SEND);
    let mut listen = true;
    while UART_FR.read() & EMPTY == 0 {
        if QUEUES.from_host.room() == 0 {
            listen = false;
            break;
        }
        // The data are the lower eight bits.
        QUEUES.from_host.push(UART_DR.read() as u8);
    }
    while UART_FR.read() & FULL == 0 {
        let Some(byte) = QUEUES.to_host.pop() else { break };
        UART_DR.write(u32::from(byte));
    }
    let receive = if listen { RECEIVE } else { 0 };
    UART_IMSC.write(receive | if QUEUES.to_host.is_empty() { 0 } else { SEND });
}

fn now_ns() -> u64 {
    loop {
        let high = TIMER_RAWH.read();
        let low = TIMER_RAWL.read();
        // At most once in 71 minutes it is not the same.
        if TIMER_RAWH.read() == high {
            return (u64::from(high) << 32 | u64::from(low)) * 1000;
        }
    }
}

#[exception]
fn SysTick() {}

/// Time of the watchdog, without progress, µs.
const WATCHDOG_US: u32 = 6_000_000;
const MARK: u32 = 0x5249_4400;
const PANICKED: u32 = 1;
const FAULTED: u32 = 2;

/// Starts the watchdog: everything but the oscillators starts anew.
fn start_watchdog() {
    TICKS_WATCHDOG_CYCLES.write(CRYSTAL_HZ / 1_000_000);
    TICKS_WATCHDOG_CTRL.write(1);
    PSM_WDSEL.write(0x01ff_fff3);
    WATCHDOG_LOAD.write(WATCHDOG_US);
    // On; it stands still while a debugger holds a core.
    WATCHDOG_CTRL.write(1 << 30 | 0b111 << 24);
}

/// Returns why the chip started, and where the last program ended if that was a panic or a fault. Asking
/// forgets it.
fn reason() -> (ResetReason, Option<BadEnd>) {
    let [mark, first, second, third] = WATCHDOG_SCRATCH.map(Register::read);
    WATCHDOG_SCRATCH.iter().for_each(|register| register.write(0));
    let end = BadEnd::default();
    match mark.wrapping_sub(MARK) {
        PANICKED => (ResetReason::Panic, Some(BadEnd { line: first, ..end })),
        FAULTED => (ResetReason::Fault, Some(BadEnd { pc: first, lr: second, status: third, ..end })),
        _ if WATCHDOG_REASON.read() & 1 != 0 => (ResetReason::Watchdog, None),
        _ => (ResetReason::Unknown, None),
    }
}

fn end(why: u32, words: [u32; 3]) -> ! {
    cortex_m::interrupt::disable();
    let [mark, first, second, third] = WATCHDOG_SCRATCH;
    mark.write(MARK + why);
    [first, second, third].iter().zip(words).for_each(|(register, word)| register.write(word));
    SCB::sys_reset()
}

// SAFETY: it touches no state of the program it interrupts, and does not return.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    end(FAULTED, [frame.pc(), frame.lr(), SCB_CFSR.read()])
}

// SAFETY: the handler touches what the port keeps for it.
#[exception]
unsafe fn DefaultHandler(line: i16) {
    if line.unsigned_abs() == UART0_INTERRUPT {
        on_uart();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    end(PANICKED, [info.location().map_or(0, core::panic::Location::line), 0, 0])
}
