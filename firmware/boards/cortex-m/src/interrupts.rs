//! Interrupts by their numbers.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

#[derive(Clone, Copy)]
struct Line(u16);

// SAFETY: boards give fixed numbers, below their controller's number of lines.
unsafe impl InterruptNumber for Line {
    fn number(self) -> u16 {
        self.0
    }
}

/// Lets an interrupt in.
#[inline]
pub fn unmask(number: u16) {
    // SAFETY: no critical section here relies on a masked line.
    unsafe { NVIC::unmask(Line(number)) }
}

/// Keeps an interrupt out.
#[inline]
pub fn mask(number: u16) {
    NVIC::mask(Line(number));
}

/// Has an interrupt's handler run.
#[inline]
pub fn pend(number: u16) {
    NVIC::pend(Line(number));
}
