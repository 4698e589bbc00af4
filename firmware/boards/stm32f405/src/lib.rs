//! Boards with an STM32F405, F446 or F411: registers, clocks, buses, interrupts, start and end.
//!
//! Written on the register level: the hardware abstraction layers wait for ready bits without a bound, so
//! that a crystal that does not start would hang the board in silence. Every wait here ends. The registers
//! are named here ([`registers`]), because the published descriptions of three chips are 51 to 230 MB of
//! sources and 8 to 18 seconds of compilation for each chip, of which these boards use sixty words.
//!
//! All of it but [`ends`] runs on a computer, too, against a model of the chip's registers
//! (`hil-sim/tests/board`).
//!
//! The image also runs in QEMU's `netduinoplus2`, where the clock registers read zero ([`clock`]).
//!
//! May not live here: what another chip would need too (that is `rigident-cortex-m`), or anything portable.
#![cfg_attr(target_os = "none", no_std)]

pub mod clock;
#[cfg(target_os = "none")]
pub mod ends;
#[cfg(feature = "storage")]
pub mod flash;
pub mod pins;
pub mod program;
pub mod registers;
pub mod sensors;
pub mod spi;
pub mod start;
pub mod time;
pub mod usart;
pub mod watchdog;

/// The chip that this is built for, as reported to the host.
pub const CHIP: &str = if cfg!(feature = "f446") {
    "stm32f446"
} else if cfg!(feature = "f411") {
    "stm32f411"
} else {
    "stm32f405"
};
