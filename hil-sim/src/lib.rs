//! The simulated rig.
//!
//! Lives here: a rig whose platform moves a body bolted to a load cell, the sensors down to the words in
//! their registers, faults of sensors and of the link, and the runners that let the firmware live on it. May
//! not live here: anything that estimates. The physics is its own and in f64: no module of it, nor the
//! platform's mechanics in [`hexapod`], may use the estimator's regressor, and a test reads the sources to
//! make sure.
//!
//! Read in this order: [`hexapod`] (where the plate is and what force that takes), [`links`] (and if more
//! bodies hang on it),
//! [`sensors`] (what a sensor makes of it), [`devices`] (what is in its registers), [`rig`] (all of it
//! together), [`link`] (a serial line that misbehaves). Separate is [`suspension`] (a platform on springs,
//! with links that swing free).
//!
//! The feature `emulator` (default, Unix only) adds the firmware on an emulated board and the rig as other
//! programs see it, over a pseudo-terminal and a network (`serve`).
#![forbid(unsafe_code)]

pub mod devices;
pub mod flash;
pub mod link;
pub mod links;
pub mod rig;
pub mod runner;
pub mod sensors;
#[cfg(feature = "emulator")]
pub mod serve;
pub mod suspension;
