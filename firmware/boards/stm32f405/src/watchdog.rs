//! The independent watchdog: the chip starts anew when the main loop has not come round for six seconds:
//! a sector of flash takes two to erase at most, and the watchdog's oscillator may be half as fast again.

use crate::registers::{DBGMCU_APB1_FZ, IWDG_KR, IWDG_PR, IWDG_RLR};

const START: u32 = 0xcccc;
const FEED: u32 = 0xaaaa;
const UNLOCK: u32 = 0x5555;
/// 32 kHz by 64, counted down from 3000.
const DIVIDE_BY_64: u32 = 4;
const COUNTS: u32 = 3000;

/// Starts it; it cannot be stopped. It stands still while a debugger holds the core.
pub fn start() {
    DBGMCU_APB1_FZ.change(0, 1 << 12);
    IWDG_KR.write(START);
    IWDG_KR.write(UNLOCK);
    IWDG_PR.write(DIVIDE_BY_64);
    IWDG_RLR.write(COUNTS);
    IWDG_KR.write(FEED);
}

/// Tells it that the program has come round.
pub fn feed() {
    IWDG_KR.write(FEED);
}
