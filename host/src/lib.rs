//! Library of the host command line.
//!
//! One way leads from a recording to an answer: [`recording`], [`rig`] and [`model`] are what comes in, [`fit`] holds the
//! information factor, [`answer`] reads it, [`present`] shows it. [`device`] has the firmware make the factor while
//! [`platform`] moves as [`plan`] found best; [`montecarlo`] tests the intervals; [`cli`] joins all into commands. The
//! pipeline of a sample is in `rigident_shared`, physics in `rigident_sim`.

pub mod answer;
#[cfg(feature = "simulator")]
pub mod cli;
pub mod device;
pub mod fit;
pub mod identification;
pub mod model;
#[cfg(feature = "simulator")]
pub mod montecarlo;
#[cfg(feature = "simulator")]
pub mod plan;
#[cfg(feature = "simulator")]
pub mod platform;
pub mod present;
pub mod recording;
pub mod rig;
#[cfg(feature = "simulator")]
pub mod simulated;
pub mod trees;
