//! The messages between host and device, and how they travel.
//!
//! Lives here: framing, checks, message types. May not live here: mathematics, I/O, a clock.

pub mod bus;
