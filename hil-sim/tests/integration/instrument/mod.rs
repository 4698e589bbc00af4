//! The application's result of a whole experiment, given over the wire as a recording.

mod consistency;
mod host;
mod knock;
mod memory;
