//! Sensor drivers on `embedded-hal` traits.
//!
//! Lives here: what turns bus bytes into codes and SI values. May not live here: what is done with them
//! ([`crate::App`]), pins and buses (the boards).

pub mod ads131m08;
pub mod frames;
pub mod imu;
