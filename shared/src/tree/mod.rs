//! Trees of links: their rows for the factor.
//!
//! Lives here: the fixed-size description of a tree, the motion of its links from the motion of its joints,
//! and the rows of base link and joints, with accelerations ([`rows`]) and without ([`momentum`]). May not
//! live here: reading models, angles and their sines (a joint's attitude comes in as a matrix, which an IMU
//! or an encoder gives alike), what of the parameters is identifiable. Next: [`joint`], then [`motion`], then
//! [`rows`].
//!
//! Everything is written in the base link's frame S, about its origin, so that a link's block is moved there
//! once and a joint's row is a product with the joint's screw; nothing is passed down the tree. Column
//! `10 i + k` belongs to parameter k of φ of link i, in that link's own frame. Only the base's specific
//! force, rate and angular acceleration enter, all of them what an ideal IMU at S reads: gravity is in the
//! first, no attitude is needed.

pub mod base;
pub mod joint;
pub mod momentum;
pub mod motion;
#[cfg(test)]
mod oracle;
pub mod rows;
#[cfg(test)]
mod tests;

pub use joint::{Joint, JointMotion, Link, TreeError};
pub use motion::{BaseMotion, LinkState, Screw};
