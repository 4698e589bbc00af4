//! The firmware on the board.
#![no_std]
#![no_main]

use cortex_m::singleton;
use cortex_m_rt::{entry, exception};
#[cfg(feature = "rtt")]
use defmt_rtt as _;
use rigident_cortex_m::stack;
use rigident_firmware::Path;
use rigident_firmware::capture::{Place, Ring};
#[cfg(feature = "storage")]
use rigident_firmware::storage::Store;
#[cfg(feature = "storage")]
use stm32f405::flash::{self, Flash};
use stm32f405::program::{self, Board, Program};
use stm32f405::start;

#[entry]
fn main() -> ! {
    start::forget_the_loader();
    stack::guard();
    let boot = program::boot();
    let ring = singleton!(: Ring = Ring::new()).expect("taken once");
    let (board, place) = instrument();
    #[cfg(feature = "storage")]
    let store = singleton!(: Option<Store<Flash>> = flash::store()).and_then(Option::as_mut);
    let mut program = Program::new(
        &boot,
        board,
        (ring, place),
        #[cfg(feature = "storage")]
        store,
        stack::high_water_and_size,
    );
    loop {
        program.turn();
    }
}

/// Returns the application where it stays: made on a stack of its own, which is gone afterwards.
#[inline(never)]
fn instrument() -> (&'static mut Board, &'static Place) {
    let place: &'static Place = singleton!(: Place = Place::new(None)).expect("taken once");
    let path = singleton!(: Path = Path::EMPTY).expect("taken once");
    (singleton!(: Board = program::instrument(path, place)).expect("taken once"), place)
}

/// Handles the core's timer. A handler of one or two instructions may lose the result of a division or root
/// that it interrupts (Arm's erratum 776924 of the Cortex-M4, revision r0p1): this one is longer.
#[exception]
fn SysTick() {
    program::on_timer();
}

// SAFETY: each handler touches what its module keeps for it.
#[exception]
unsafe fn DefaultHandler(line: i16) {
    program::on_interrupt(line.unsigned_abs());
}
