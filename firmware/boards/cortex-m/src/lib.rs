//! What boards with a Cortex-M share: the byte queue of a serial port, how deep the stack has been, and a
//! check of the kernels' bits.
//!
//! May not live here: registers of one chip, pins, clocks.
#![no_std]

pub mod kernel_bits;
pub mod ring;
pub mod serial;
pub mod stack;
