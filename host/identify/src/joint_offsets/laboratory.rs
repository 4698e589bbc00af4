//! The laboratory's humanoid, with the types of this crate.
#![allow(dead_code, reason = "tests use a part of it")]

#[path = "../../../laboratory/src/noise.rs"]
mod noise;
#[path = "../../../laboratory/src/standing.rs"]
pub mod standing;
