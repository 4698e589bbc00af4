//! How deep the stack has been.
//!
//! Start-up paints everything between the end of the statics and the first stack word; what is no longer
//! painted has been used.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Deepest use and size of the stack, bytes. A frame that skipped over painted words without touching them is
/// not seen.
pub fn high_water_and_size() -> (usize, usize) {
    let (lowest, first) = (&raw const _stack_end, &raw const _stack_start);
    let mut word = lowest;
    // SAFETY: both symbols bound the stack's RAM and are word-aligned; the walk stays between them, and
    // volatile reads of memory that nothing but this stack uses are defined on this machine.
    while word < first && unsafe { ptr::read_volatile(word) } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    (first as usize - word as usize, first as usize - lowest as usize)
}
