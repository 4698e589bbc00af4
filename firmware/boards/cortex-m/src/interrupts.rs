//! Interrupts by their numbers, and sections that none comes into.

pub use bare_metal::{CriticalSection, Mutex};

use crate::registers::Register;

/// Registers of the interrupt controller hold 32 lines each.
const LINES: usize = 32;
const SET_ENABLE: usize = 0xe000_e100;
const CLEAR_ENABLE: usize = 0xe000_e180;
const SET_PENDING: usize = 0xe000_e200;

#[inline]
fn mark(registers: usize, number: u16) {
    let number = usize::from(number);
    // SAFETY: a register of the controller (ARMv7-M, B3.4), for boards give fixed numbers, below its number
    // of lines. No critical section here relies on a masked line.
    let register = unsafe { Register::new(registers + 4 * (number / LINES)) };
    register.write(1 << (number % LINES));
}

/// Lets an interrupt in.
#[inline]
pub fn unmask(number: u16) {
    mark(SET_ENABLE, number);
}

/// Keeps an interrupt out.
#[inline]
pub fn mask(number: u16) {
    mark(CLEAR_ENABLE, number);
}

/// Has an interrupt's handler run.
#[inline]
pub fn pend(number: u16) {
    mark(SET_PENDING, number);
}

/// Does something that no interrupt comes into.
#[cfg(target_os = "none")]
#[inline]
pub fn free<R>(what: impl FnOnce(&CriticalSection) -> R) -> R {
    cortex_m::interrupt::free(what)
}

/// Does something that no interrupt of the model comes into.
#[cfg(not(target_os = "none"))]
pub fn free<R>(what: impl FnOnce(&CriticalSection) -> R) -> R {
    let chip = crate::model::chip();
    let held = chip.holds_interrupts();
    chip.hold_interrupts(true);
    // SAFETY: the model runs in one thread, and calls no handler while they are held back.
    let section = unsafe { CriticalSection::new() };
    let result = what(&section);
    if !held {
        chip.hold_interrupts(false);
    }
    result
}

/// Lets interrupts in from now on.
///
/// # Safety
/// No critical section may be open.
pub unsafe fn enable() {
    // SAFETY: the caller's promise.
    #[cfg(target_os = "none")]
    unsafe {
        cortex_m::interrupt::enable()
    }
    #[cfg(not(target_os = "none"))]
    crate::model::chip().hold_interrupts(false);
}

/// Keeps all interrupts out from now on.
pub fn disable() {
    #[cfg(target_os = "none")]
    cortex_m::interrupt::disable();
    #[cfg(not(target_os = "none"))]
    crate::model::chip().hold_interrupts(true);
}

/// Sleeps until an interrupt waits.
pub fn sleep() {
    #[cfg(target_os = "none")]
    cortex_m::asm::wfi();
    #[cfg(not(target_os = "none"))]
    crate::model::chip().sleep();
}
