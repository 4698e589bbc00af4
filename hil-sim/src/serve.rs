//! A simulated rig that other programs use as if it were a real one: a serial port and a platform controller.
//!
//! Lives here: the port ([`Port`]), the controllers ([`Controller`] in JSON, [`gcs`] as PI
//! hexapods speak, [`ur`] as arms of Universal Robots do), sensors of other makes ([`sensors`]), the loop
//! between port and firmware ([`carry`]), and the rig file that describes what is served. May not live here:
//! what the bytes mean. Before this: [`crate::runner`], [`crate::link`]; after it: the binary `rigident-sim`.

mod carry;
mod controller;
pub mod gcs;
mod listener;
mod options;
mod port;
mod rig_file;
pub mod sensors;
mod stream;
pub mod ur;

pub use carry::{Firmware, carry};
pub use controller::Controller;
pub use options::{Body, SensorFault, Sensors, SensorsOptions, ServeOptions, Where};
pub use port::Port;
pub use rig_file::rig_file;
pub use stream::{Receiver, StreamServer, Tell};
