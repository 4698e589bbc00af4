//! Several files with clocks of their own as one recording.
#![cfg(feature = "simulator")]

mod commands;
mod gravity;
mod real;
mod refused;
pub mod simulated;
