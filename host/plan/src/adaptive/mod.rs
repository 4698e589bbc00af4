//! The decision what to do next, made between segments: the closed loop.
//!
//! Lives here: what a motion would tell ([`information`]), the segments there are to choose from
//! ([`library`]) and those made for the purpose ([`design`]), what a factor says ([`Observed`]), what is
//! asked for and how far it is ([`goal`]), the choice ([`choice`]), axes that turn out not to follow
//! ([`axes`]), and the planner that keeps it all from one segment to the next ([`planner`]); the loop
//! against a simulated rig that may not be what the planner believes (`rehearsal`, with the simulator).
//! May not live here: driving and recording (that is [`rigident_device::session`]), motions planned as a
//! whole before anything moves.
//!
//! Rows of the regressor need kinematics only, never the parameters: what a segment will tell is known before
//! it runs. So every candidate's information is computed once, and choosing is a search over sums of
//! matrices.

pub mod axes;
pub mod choice;
pub mod compact;
pub mod design;
mod foreseen;
pub mod goal;
pub mod information;
pub mod library;
pub mod planner;
#[cfg(feature = "simulator")]
pub mod rehearsal;

mod observed;

pub use foreseen::{Forecast, Foreseen};
pub use goal::{Asked, Goal};
pub use information::{Information, RigModel};
pub use observed::Observed;
pub use planner::{Decision, Next, Planner};

#[cfg(all(test, feature = "simulator"))]
mod tests;
