//! The depth of the stack so far.
//!
//! Start-up paints everything between the end of the statics and the first stack word; what is no longer
//! painted has been used.

use core::ptr;
use core::sync::atomic::{AtomicUsize, Ordering};

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Bytes at the stack's end that nothing may touch.
const GUARD: usize = 256;
const MPU_CTRL: usize = 0xe000_ed94;
const MPU_RBAR: usize = 0xe000_ed9c;
const MPU_RASR: usize = 0xe000_eda0;
/// The address at which the guard begins, once there is one.
static GUARDED: AtomicUsize = AtomicUsize::new(0);

/// Has the core fault where the stack would run over what lies below it. Its fault handler works on all the
/// same: the guard does not hold there.
pub fn guard() {
    let from = (&raw const _stack_end as usize).next_multiple_of(GUARD);
    // SAFETY: registers of the core's protection unit, by the architecture's manual: region 0, nobody's, 2⁸
    // bytes; everything else as without the unit. Nothing lives in the guard: it is the stack's own end.
    unsafe {
        ptr::write_volatile(MPU_RBAR as *mut u32, from as u32 | 1 << 4);
        ptr::write_volatile(MPU_RASR as *mut u32, 1 << 28 | 7 << 1 | 1);
        ptr::write_volatile(MPU_CTRL as *mut u32, 1 << 2 | 1);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    GUARDED.store(from + GUARD, Ordering::Relaxed);
}

/// Returns deepest use and size of the stack, bytes. A frame that skipped over painted words without touching
/// them is not seen.
pub fn high_water_and_size() -> (usize, usize) {
    let (end, first) = (&raw const _stack_end, &raw const _stack_start);
    // What the guard takes cannot be read, and is no room.
    let guarded = GUARDED.load(Ordering::Relaxed);
    let lowest = if guarded == 0 { end } else { end.with_addr(guarded) };
    let mut word = lowest;
    // SAFETY: both symbols bound the stack's RAM and are word-aligned; the walk stays between them, and
    // volatile reads of memory that nothing but this stack uses are defined on this machine.
    while word < first && unsafe { ptr::read_volatile(word) } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    (first as usize - word as usize, first as usize - lowest as usize)
}
