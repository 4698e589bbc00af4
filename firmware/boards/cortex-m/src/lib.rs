//! Holds what boards with a Cortex-M share: registers and interrupts as such, the byte queue of a serial
//! port, how deep the stack has been, and a check of the kernels' bits.
//!
//! On a computer there are no registers: whoever runs the drivers there brings a model of the chip
//! ([`model`]).
//!
//! May not live here: which registers a chip has, pins, clocks.
#![cfg_attr(target_os = "none", no_std)]

pub mod absent;
pub mod interrupts;
pub mod kernel_bits;
#[cfg(target_os = "none")]
mod memory;
#[cfg(not(target_os = "none"))]
pub mod model;
pub mod registers;
pub mod ring;
pub mod serial;
#[cfg(target_os = "none")]
pub mod stack;
