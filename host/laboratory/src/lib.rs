//! Simulated recordings and bodies, for demonstrations, tests and tables.
//!
//! Lives here: trees of known parameters and recordings of them ([`trees`]), of arms as they are run
//! ([`arm`]), of humanoids that stand still ([`standing`]) and that move on their feet ([`on_feet`]) and pick
//! something up ([`picks_up`]), of any robot that stands, touches and is held ([`contacts`]), of people as a
//! laboratory records them ([`laboratory`]), readings, mounting, limits and rig files of the simulated rig in
//! the pipeline's types, and people in motion ([`person`]). May not live here: experiments and their
//! judgement (`rigident_study`).

pub mod arm;
pub mod contacts;
pub mod laboratory;
mod noise;
pub mod on_feet;
pub mod person;
pub mod picks_up;
mod rig;
mod rig_file;
pub mod standing;
pub mod suspended;
pub mod trees;

pub use rig::{limits, mounting, reading};
pub use rig_file::{rig_file, two_link_file};
