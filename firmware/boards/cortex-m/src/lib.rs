//! What boards with a Cortex-M share: the byte queue of a serial port, how deep the stack has been.
//!
//! May not live here: registers of one chip, pins, clocks.
#![no_std]

pub mod ring;
pub mod serial;
pub mod stack;
