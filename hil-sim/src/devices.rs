//! The converters as the firmware's bus sees them: registers, frames, check words.
//!
//! Lives here: register models of the strain-gauge ADC and the IMU, written from their data sheets and not
//! from the firmware's drivers. May not live here: physics and noise. Before this: [`crate::sensors`]; next:
//! [`crate::rig`].

mod ads131m08;
mod icm42688;

pub use ads131m08::{Ads131m08, FULL_SCALE_V};
pub use icm42688::Icm42688;

/// A device on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// The ADS131M08 behind the load cell.
    LoadCell,
    /// The ICM-42688-P.
    Imu,
    /// Another one, on the second link.
    SecondImu,
}
