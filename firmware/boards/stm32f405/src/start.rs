//! Why the chip started, and how a program ends: with a note for the next start, and a reset.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use rigident_shared::wire::{BadEnd, ResetReason};

use crate::clock;
use crate::registers::{NVIC_ICER, NVIC_ICPR, RCC_CSR, SCB_CFSR, SCB_FAULT_ADDRESS, SYST_CSR, UNIQUE_ID};

const CLEAR_FLAGS: u32 = 1 << 24;
const BROWN_OUT: u32 = 1 << 25;
const PIN: u32 = 1 << 26;
const POWER_ON: u32 = 1 << 27;
const SOFTWARE: u32 = 1 << 28;
const INDEPENDENT_WATCHDOG: u32 = 1 << 29;
const WINDOW_WATCHDOG: u32 = 1 << 30;

const MEMORY_ADDRESS_IS_KNOWN: u32 = 1 << 7;
const BUS_ADDRESS_IS_KNOWN: u32 = 1 << 15;

/// What the last program left in memory that a reset leaves alone: a mark and why it ended, then [`BadEnd`], then the check of all.
// SAFETY: the section is not initialised; every bit pattern is a value, and what is found there is checked.
#[unsafe(link_section = ".uninit.rigident_note")]
static NOTE: [AtomicU32; WORDS] = [const { AtomicU32::new(0) }; WORDS];
const WORDS: usize = 8;
const MARK: u32 = 0x5249_4400;
const PANICKED: u32 = 1;
const FAULTED: u32 = 2;
const CLOCK_LOST: u32 = 3;

/// FNV-1a of 32 bits, of words or of bytes.
fn digest(items: impl Iterator<Item = u32>) -> u32 {
    items.fold(0x811c_9dc5, |hash, item| (hash ^ item).wrapping_mul(0x0100_0193))
}

/// Takes the note of the last program: why it ended, and where. Power coming on leaves none.
fn note() -> Option<(u32, BadEnd)> {
    let words: [u32; WORDS] =
        core::array::from_fn(|k| NOTE.get(k).map_or(0, |word| word.load(Ordering::Relaxed)));
    NOTE.iter().for_each(|word| word.store(0, Ordering::Relaxed));
    let [told @ .., checked] = words;
    if digest(told.into_iter()) != checked {
        return None;
    }
    let [mark, pc, lr, status, address, line, file] = told;
    Some((mark.checked_sub(MARK)?, BadEnd { pc, lr, status, address, line, file }))
}

/// Returns why the chip started, and where the last program ended if that was a panic or a fault. Asking forgets it.
pub fn reason() -> (ResetReason, Option<BadEnd>) {
    let flags = RCC_CSR.read();
    RCC_CSR.change(0, CLEAR_FLAGS);
    let note = note();
    // Every reset pulls the pin, and power coming on is a brown-out, too: the most special comes first.
    let reason = if flags & (INDEPENDENT_WATCHDOG | WINDOW_WATCHDOG) != 0 {
        ResetReason::Watchdog
    } else if flags & SOFTWARE != 0 {
        return match note {
            Some((PANICKED, end)) => (ResetReason::Panic, Some(end)),
            Some((FAULTED, end)) => (ResetReason::Fault, Some(end)),
            Some((CLOCK_LOST, _)) => (ResetReason::ClockLost, None),
            _ => (ResetReason::Software, None),
        };
    } else if flags & POWER_ON != 0 {
        ResetReason::PowerOn
    } else if flags & BROWN_OUT != 0 {
        ResetReason::BrownOut
    } else if flags & PIN != 0 {
        ResetReason::Pin
    } else {
        ResetReason::Unknown
    };
    (reason, None)
}

/// Returns the chip's own number.
pub fn unique_id() -> [u8; 12] {
    let mut id = [0; 12];
    for (bytes, word) in id.as_chunks_mut::<4>().0.iter_mut().zip(UNIQUE_ID) {
        *bytes = word.read().to_le_bytes();
    }
    id
}

/// Starts anew because the host has asked for it.
pub fn restart() -> ! {
    SCB::sys_reset()
}

/// Forgets what the chip's own loader has left on: interrupts, and the core's timer. Until [`go`] no interrupt comes.
pub fn forget_the_loader() {
    SYST_CSR.write(0);
    NVIC_ICER.into_iter().chain(NVIC_ICPR).for_each(|register| register.write(u32::MAX));
}

/// Lets interrupts in.
pub fn go() {
    // SAFETY: no critical section is open: it is called once, from `main`.
    unsafe { cortex_m::interrupt::enable() }
}

// The loader may jump here with its interrupts on, whose sources nobody serves: none comes before the memory is set up.
// SAFETY of what is in there: the function of this name is called before memory is set up, and touches none.
core::arch::global_asm!(
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    "cpsid i",
    "bx lr",
);

fn end(why: u32, at: &BadEnd) -> ! {
    cortex_m::interrupt::disable();
    let told = [MARK + why, at.pc, at.lr, at.status, at.address, at.line, at.file];
    let words = told.into_iter().chain([digest(told.into_iter())]);
    NOTE.iter().zip(words).for_each(|(slot, word)| slot.store(word, Ordering::Relaxed));
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    // Where, not what: the words would take the formatting code of `core` along.
    let Some(location) = info.location() else { end(PANICKED, &BadEnd::default()) };
    #[cfg(feature = "rtt")]
    defmt::error!("panicked at {=str}:{=u32}", location.file(), location.line());
    let file = digest(location.file().bytes().map(u32::from));
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
    if clock::crystal_has_stopped() {
        // The chip runs on at 16 MHz, with all times wrong: it starts anew.
        end(CLOCK_LOST, &BadEnd::default())
    }
}
