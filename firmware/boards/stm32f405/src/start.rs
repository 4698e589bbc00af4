//! The reason of a start, and the end of a program: a note for the next start, and a reset.

use core::sync::atomic::{AtomicU32, Ordering};

use rigident_cortex_m::interrupts;
use rigident_firmware::EventRoom;
use rigident_shared::wire::{BadEnd, ResetReason};

use crate::clock;
use crate::registers::{NVIC_ICER, NVIC_ICPR, RCC_CSR, SCB_AIRCR, SYST_CSR, UNIQUE_ID};

const CLEAR_FLAGS: u32 = 1 << 24;
const BROWN_OUT: u32 = 1 << 25;
const PIN: u32 = 1 << 26;
const POWER_ON: u32 = 1 << 27;
const SOFTWARE: u32 = 1 << 28;
const INDEPENDENT_WATCHDOG: u32 = 1 << 29;
const WINDOW_WATCHDOG: u32 = 1 << 30;

/// The key of the core's reset, and the reset.
const RESET: u32 = 0x05fa << 16 | 1 << 2;

/// The note that the last program left in memory that a reset leaves alone: a mark and why it ended, then
/// [`BadEnd`], then the check of all.
// SAFETY: the section is not initialised; every bit pattern is a value, and what is found there is checked.
#[cfg_attr(target_os = "none", unsafe(link_section = ".uninit.rigident_note"))]
static NOTE: [AtomicU32; WORDS] = [const { AtomicU32::new(0) }; WORDS];
const WORDS: usize = 8;
const MARK: u32 = 0x5249_4400;
/// The program panicked.
pub(crate) const PANICKED: u32 = 1;
/// The core faulted.
pub(crate) const FAULTED: u32 = 2;
const CLOCK_LOST: u32 = 3;

/// The last events, in the same memory.
// SAFETY: the section is not initialised; every bit pattern is a value, and what is found there is checked.
#[cfg_attr(target_os = "none", unsafe(link_section = ".uninit.rigident_events"))]
pub static EVENTS: EventRoom = EventRoom::empty();

/// Returns FNV-1a of 32 bits, of words or of bytes.
fn digest(items: impl Iterator<Item = u32>) -> u32 {
    items.fold(0x811c_9dc5, |hash, item| (hash ^ item).wrapping_mul(0x0100_0193))
}

/// Takes the note of the last program: why it ended, and where. Power coming on leaves none.
fn note() -> Option<(u32, BadEnd)> {
    let words: [u32; WORDS] =
        core::array::from_fn(|k| NOTE.get(k).map_or(0, |word| word.load(Ordering::Relaxed)));
    NOTE.iter().for_each(|word| word.store(0, Ordering::Relaxed));
    let [content @ .., checked] = words;
    if digest(content.into_iter()) != checked {
        return None;
    }
    let [mark, pc, lr, status, address, line, file] = content;
    Some((mark.checked_sub(MARK)?, BadEnd { pc, lr, status, address, line, file }))
}

/// Returns why the chip started, and where the last program ended if that was a panic or a fault. Asking
/// forgets it.
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
    SCB_AIRCR.write(RESET);
    loop {
        core::hint::spin_loop();
    }
}

/// Forgets what the chip's own loader has left on: interrupts, and the core's timer. Until [`go`] no
/// interrupt comes.
pub fn forget_the_loader() {
    SYST_CSR.write(0);
    NVIC_ICER.into_iter().chain(NVIC_ICPR).for_each(|register| register.write(u32::MAX));
}

/// Lets interrupts in.
pub fn go() {
    // SAFETY: no critical section is open: it is called once, from `main`.
    unsafe { interrupts::enable() }
}

/// Ends the program with a note of why and where, and starts the chip anew.
pub(crate) fn end(why: u32, at: &BadEnd) -> ! {
    interrupts::disable();
    let content = [MARK + why, at.pc, at.lr, at.status, at.address, at.line, at.file];
    let words = content.into_iter().chain([digest(content.into_iter())]);
    NOTE.iter().zip(words).for_each(|(slot, word)| slot.store(word, Ordering::Relaxed));
    restart()
}

/// Returns a name's FNV-1a of 32 bits.
#[cfg(target_os = "none")]
pub(crate) fn digest_of(name: &str) -> u32 {
    digest(name.bytes().map(u32::from))
}

/// Handles the interrupt that cannot be masked.
pub fn on_not_maskable() {
    if clock::crystal_has_stopped() {
        // The chip runs on at 16 MHz, with all times wrong: it starts anew.
        end(CLOCK_LOST, &BadEnd::default())
    }
}
