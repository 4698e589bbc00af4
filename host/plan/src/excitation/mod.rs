//! Trajectories of a robot's joints that tell most of its links.
//!
//! A Fourier series for each joint ([`family`]) is sought by [`crate::descent`] that makes the information on
//! the base parameters large ([`information`]) inside the limits of joints ([`limits`]) and away from
//! collisions ([`collisions`], of [`boxes`] round the links, [`oriented_box`]); it is examined once more on a
//! finer grid ([`resampled`]), and what it will tell is read off the factor that the pipeline makes of it
//! ([`predict`]). [`plan()`] does all of this, [`files`] writes it. May not live here: reading models
//! ([`rigident_model`]), the rows of a recording ([`rigident_rows::tree`]). Next: [`plan()`].

pub mod boxes;
pub mod collisions;
pub mod family;
pub mod files;
pub mod information;
pub mod limits;
pub mod oriented_box;
mod plan;
pub mod predict;
pub mod problem;
pub mod resampled;
mod start;
#[cfg(test)]
mod tests;

pub use plan::{Excitation, ExcitationError, Stage, Task, movable, plan};
pub use start::clear_start;
