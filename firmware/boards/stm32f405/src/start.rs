//! Why the chip started, and how a program ends: with a note for the next start, and a reset.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use rigident_shared::wire::ResetReason;

use crate::clock;
use crate::registers::RCC_CSR;

const CLEAR_FLAGS: u32 = 1 << 24;
const BROWN_OUT: u32 = 1 << 25;
const PIN: u32 = 1 << 26;
const POWER_ON: u32 = 1 << 27;
const SOFTWARE: u32 = 1 << 28;
const INDEPENDENT_WATCHDOG: u32 = 1 << 29;
const WINDOW_WATCHDOG: u32 = 1 << 30;

/// What the last program left in memory that a reset leaves alone: a mark, and why it ended.
// SAFETY: the section is not initialised; every bit pattern is a value, and what is found there is checked.
#[unsafe(link_section = ".uninit.rigident_note")]
static NOTE: AtomicU32 = AtomicU32::new(0);
const MARK: u32 = 0x5249_4400;
const PANICKED: u32 = 1;
const FAULTED: u32 = 2;
const CLOCK_LOST: u32 = 3;

/// Returns why the chip started. Asking forgets it.
pub fn reason() -> ResetReason {
    let flags = RCC_CSR.read();
    RCC_CSR.change(0, CLEAR_FLAGS);
    let note = NOTE.load(Ordering::Relaxed);
    NOTE.store(0, Ordering::Relaxed);
    // Every reset pulls the pin, and power coming on is a brown-out, too: the most special comes first.
    if flags & (INDEPENDENT_WATCHDOG | WINDOW_WATCHDOG) != 0 {
        ResetReason::Watchdog
    } else if flags & SOFTWARE != 0 {
        match note.checked_sub(MARK) {
            Some(PANICKED) => ResetReason::Panic,
            Some(FAULTED) => ResetReason::Fault,
            Some(CLOCK_LOST) => ResetReason::ClockLost,
            _ => ResetReason::Software,
        }
    } else if flags & POWER_ON != 0 {
        ResetReason::PowerOn
    } else if flags & BROWN_OUT != 0 {
        ResetReason::BrownOut
    } else if flags & PIN != 0 {
        ResetReason::Pin
    } else {
        ResetReason::Unknown
    }
}

fn end(why: u32) -> ! {
    cortex_m::interrupt::disable();
    NOTE.store(MARK + why, Ordering::Relaxed);
    SCB::sys_reset()
}

#[panic_handler]
fn panic(_info: &PanicInfo) -> ! {
    // Where, not what: the words would take the formatting code of `core` along.
    #[cfg(feature = "rtt")]
    if let Some(location) = _info.location() {
        defmt::error!("panicked at {=str}:{=u32}", location.file(), location.line());
    }
    end(PANICKED)
}

#[cfg(feature = "rtt")]
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    end(PANICKED)
}

// SAFETY: it touches no state of the program it interrupts, and does not return.
#[exception]
unsafe fn HardFault(_frame: &ExceptionFrame) -> ! {
    #[cfg(feature = "rtt")]
    defmt::error!("hard fault at {=u32:#010x}, called from {=u32:#010x}", _frame.pc(), _frame.lr());
    end(FAULTED)
}

// SAFETY: it touches clock registers alone.
#[exception]
unsafe fn NonMaskableInt() {
    if clock::crystal_has_stopped() {
        // The chip runs on at 16 MHz, with all times wrong: it starts anew.
        end(CLOCK_LOST)
    }
}
