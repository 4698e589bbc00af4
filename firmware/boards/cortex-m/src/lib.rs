//! Holds what boards with a Cortex-M share: registers and interrupts as such, the byte queue of a serial port, how deep the
//! stack has been, and a check of the kernels' bits.
//!
//! May not live here: which registers a chip has, pins, clocks.
#![no_std]

pub mod absent;
pub mod interrupts;
pub mod kernel_bits;
mod memory;
pub mod registers;
pub mod ring;
pub mod serial;
pub mod stack;
