//! The platform's controller as PI hexapods speak: General Command Set 2.0, in ASCII over TCP or a serial
//! line.
//!
//! Lives here: the commands' syntax (`syntax`), the controller that obeys them ([`Hexapod`]), and the
//! servers. May not live here: how the plate moves ([`crate::rig`]).
//!
//! The commands are those that a C-887 hexapod controller needs to be driven; `HLP?` lists them. The meaning
//! of the lines, and its source, is in [`hexapod::gcs`], which the driver reads too.
//!
//! Differences from the vendor's: a stream whose points cease brakes and sets error 220; a client that goes
//! away stops what it had started. How long a stop takes is not published: here 0.3 s smoothly (`HLT`) and
//! 0.05 s abruptly (`STP`, `#24`). `SCT` is rounded to tenths of a millisecond, as a controller with a cycle
//! of its own must round somewhere.

mod controller;
mod frames;
mod server;
mod syntax;
mod tables;
mod travel;

pub use controller::Hexapod;
pub use server::{Client, GcsPort, GcsServer};
pub use travel::limits;
