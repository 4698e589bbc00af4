//! The end of a program on the core itself: handlers of panics and faults, and the first two instructions.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use rigident_shared::wire::BadEnd;

use crate::registers::{SCB_CFSR, SCB_FAULT_ADDRESS};
use crate::start::{self, FAULTED, PANICKED, digest_of, end};

const MEMORY_ADDRESS_IS_KNOWN: u32 = 1 << 7;
const BUS_ADDRESS_IS_KNOWN: u32 = 1 << 15;

// The loader may jump here with its interrupts on, whose sources nobody serves: none comes before the memory
// is set up. SAFETY of what is in there: the function of this name is called before memory is set up, and
// touches none.
core::arch::global_asm!(
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "cpsid i",
    "bx lr",
);

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    // Where, not what: the words would take the formatting code of `core` along.
    let Some(location) = info.location() else { end(PANICKED, &BadEnd::default()) };
    #[cfg(feature = "rtt")]
    defmt::error!("panicked at {=str}:{=u32}", location.file(), location.line());
    let file = digest_of(location.file());
    end(PANICKED, &BadEnd { line: location.line(), file, ..BadEnd::default() })
}

#[cfg(feature = "rtt")]
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    end(PANICKED, &BadEnd::default())
}

// SAFETY: it touches no state of the program it interrupts, and does not return.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    #[cfg(feature = "rtt")]
    defmt::error!("hard fault at {=u32:#010x}, called from {=u32:#010x}", frame.pc(), frame.lr());
    let status = SCB_CFSR.read();
    let [memory, bus] = SCB_FAULT_ADDRESS;
    let address = match (status & MEMORY_ADDRESS_IS_KNOWN, status & BUS_ADDRESS_IS_KNOWN) {
        (0, 0) => 0,
        (0, _) => bus.read(),
        _ => memory.read(),
    };
    end(FAULTED, &BadEnd { pc: frame.pc(), lr: frame.lr(), status, address, ..BadEnd::default() })
}

// SAFETY: it touches clock registers alone.
#[exception]
unsafe fn NonMaskableInt() {
    start::on_not_maskable();
}
