//! QEMU's mps2-an386: a Cortex-M4F with a serial port, and sensors behind a semihosted bus.
//!
//! Lives here: start-up, interrupts, the serial port, the emulated bus, what happens on a panic. May not live
//! here: anything a second board would need too (that is `rigident-cortex-m`). Next: the binary
//! `src/main.rs`, then the crate `rigident-firmware` that it drives.
#![no_std]

pub mod bus;
pub mod exit;
#[cfg(feature = "storage")]
pub mod flash;
pub mod uart;
