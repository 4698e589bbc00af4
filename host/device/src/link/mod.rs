//! The host's end of the line.
//!
//! Lives here: byte transports ([`Transport`]) and the [`Client`] that asks, waits, asks again, and sorts
//! answers from telemetry. May not live here: what an experiment is ([`crate::session`]).

mod client;
mod transport;

pub use client::{Client, LinkError, TakenFactor};
pub use transport::{BAUD, PortError, SerialTransport, Transport};
