//! The portable application of the microcontroller.
//!
//! Lives here: the states and commands ([`App`]), what happens to every sample ([`sample_path`]), the
//! device's end of the line, the sensor drivers, and the [`Instrument`] that joins them. May not live here:
//! pins, clocks, interrupts, anything of one board (that is `firmware/boards`), or mathematics that the host
//! needs too (that is `rigident_shared`).
//!
//! No heap, no I/O, no clock: bytes, samples and the time are handed in, bytes are taken out.
#![no_std]

mod answer;
mod app;
pub mod drivers;
mod instrument;
mod link;
mod log;
#[cfg(any(feature = "plant-double", feature = "plant-panic"))]
mod planted;
pub mod sample_path;
mod settings;

pub use app::{App, BringUpError, FIRMWARE_HASH, Sensor, SensorRates};
pub use instrument::{Event, Instrument};
