//! The place of a model of the chip, which replaces registers and the core where the drivers run on a
//! computer.

use std::cell::RefCell;
use std::rc::Rc;

/// A chip as its drivers see it.
pub trait Chip {
    /// Returns what a register holds.
    fn read(&self, address: usize) -> u32;
    /// Gives a register a value.
    fn write(&self, address: usize, value: u32);
    /// Gives a register the address of memory of this process, which the chip may read and write.
    fn name_memory(&self, register: usize, memory: usize);
    /// Holds interrupts back, or lets them in again.
    fn hold_interrupts(&self, held: bool);
    /// Returns whether interrupts are held back.
    fn holds_interrupts(&self) -> bool;
    /// Sleeps until an interrupt waits.
    fn sleep(&self);
}

thread_local! {
    static CHIP: RefCell<Option<Rc<dyn Chip>>> = const { RefCell::new(None) };
}

/// Puts a chip there, for this thread.
pub fn put(chip: Rc<dyn Chip>) {
    CHIP.with(|place| place.replace(Some(chip)));
}

/// Returns this thread's chip.
///
/// # Panics
/// If none was put there.
pub(crate) fn chip() -> Rc<dyn Chip> {
    CHIP.with(|place| place.borrow().clone()).expect("no model of the chip")
}

pub(crate) fn read(address: usize) -> u32 {
    chip().read(address)
}

pub(crate) fn write(address: usize, value: u32) {
    chip().write(address, value);
}

pub(crate) fn name_memory(register: usize, memory: usize) {
    chip().name_memory(register, memory);
}
