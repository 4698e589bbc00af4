//! Motions: which one tells most of the body inside what the platform can do.
//!
//! Lives here: the family of motions ([`family`]), what a motion tells and its gradient ([`information`]),
//! the barrier that keeps it inside the limits ([`barrier`]) and the search ([`search`]); the experiment
//! around a motion ([`program`]), what it is worth ([`predict`]) and the objectives side by side
//! ([`compare`](mod@compare)). May not live here: the platform's mechanics and the guarantee that limits are
//! met between samples (`hexapod`).
//!
//! A motion is planned on a grid of time, and only then is the whole experiment proven to keep every limit at
//! every instant; until it does, the motion is made smaller.

pub mod barrier;
pub mod compare;
pub mod coverage;
pub mod family;
pub mod information;
pub mod plan;
pub mod predict;
pub mod program;
pub mod search;

pub use plan::{MotionPlan, Objective, PlanError, Task, plan};
