//! Factors of several runs, and the bare fixture taken off: by hand of a user, and by Monte Carlo.
#![cfg(feature = "simulator")]

mod collection;
mod commands;
mod gains;
mod refused;
pub mod simulated;
mod tare;
