//! The end of a run: with a line in the log and an exit status.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};

/// Exit status after a panic.
pub const PANIC_STATUS: i32 = 101;
/// Exit status after a fault of the processor.
pub const FAULT_STATUS: i32 = 102;
/// Exit status when the simulator went away.
pub const BUS_STATUS: i32 = 103;

/// Ends the run in good order.
pub fn success() -> ! {
    let (used, size) = rigident_cortex_m::stack::high_water_and_size();
    // The runner reads this line.
    defmt::info!("stack: {=usize} of {=usize} bytes used", used, size);
    semihosting::process::exit(0)
}

/// Ends the run because the simulator does not answer any more.
pub fn bus_gone() -> ! {
    defmt::error!("the sensor bus is gone: the simulator closed its pipes");
    semihosting::process::exit(BUS_STATUS)
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    static PANICKED: AtomicBool = AtomicBool::new(false);
    cortex_m::interrupt::disable();
    // A panic inside the logger must not log again.
    if !PANICKED.swap(true, Ordering::Relaxed) {
        // Where, not what: the words would take the formatting code of `core` along.
        match info.location() {
            Some(location) => defmt::error!("panicked at {=str}:{=u32}", location.file(), location.line()),
            None => defmt::error!("panicked"),
        }
    }
    semihosting::process::exit(PANIC_STATUS)
}

#[defmt::panic_handler]
fn defmt_panic() -> ! {
    semihosting::process::exit(PANIC_STATUS)
}

// SAFETY: it touches no state of the program it interrupts, and does not return.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!("hard fault at {=u32:#010x}, called from {=u32:#010x}", frame.pc(), frame.lr());
    semihosting::process::exit(FAULT_STATUS)
}
