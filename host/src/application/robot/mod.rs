//! Calibrations of robots: masses of links ([`masses`]), offsets of joints ([`joints`]).

pub mod joints;
pub mod mass_options;
pub mod masses;
mod masses_beside;
mod masses_rows;
mod masses_text;
