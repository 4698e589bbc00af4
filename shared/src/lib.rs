//! The common part of both sides of the wire: the mathematics of the estimator and the messages.
//!
//! Lives here: pure functions and small state machines, `no_std`, without heap, I/O or clock, generic over
//! `f32` (target) and `f64` (host). May not live here: drivers, files, anything that waits. The mathematics
//! knows no serde; [`wire`] knows no mathematics.
//!
//! A sample's way, in reading order: [`calibration`] → [`alignment`] → [`regressor`] → [`conditioning`] →
//! [`factor`] → [`estimator`]. The firmware that drives it is the crate `rigident-firmware`.
#![no_std]

pub mod alignment;
pub mod calibration;
pub mod conditioning;
pub mod consistency;
pub mod estimator;
pub mod factor;
pub mod forgetting;
pub mod inertia;
mod linear_algebra;
pub mod printable;
#[cfg(test)]
mod random;
pub mod regressor;
mod scalar;
pub mod screening;
pub mod spatial;
pub mod tree;
pub mod whitening;
pub mod wire;

pub use scalar::Scalar;
