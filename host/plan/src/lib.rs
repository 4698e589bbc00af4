//! The decision before anything moves: which poses and motions of the platform, or of a robot's joints, give
//! most information about the body.
//!
//! Lives here: the platform that a rig file describes ([`machine`], [`mod@arm`]) with body and
//! sensors ([`equipment`]),
//! what the plate may carry before that is known ([`carried`]), what the sensors are to read ([`ranges`]),
//! where it can be tilted to ([`workspace`]), still poses ([`poses`]), motions ([`motion`]) and the search
//! for them ([`descent`]), trajectories of joints ([`excitation`]), moves between them ([`ways`]), plans on
//! disk ([`plan_file`]). May not live here: the platform's mechanics (that is `hexapod`), driving it
//! ([`rigident_device::platform`]), what a user types and sees (the crate `rigident_cli`). Next:
//! [`rigident_device::session`], which follows a plan.

pub mod adaptive;
pub mod arm;
pub mod carried;
pub mod descent;
pub mod equipment;
pub mod excitation;
pub mod machine;
pub mod motion;
pub mod plan_file;
pub mod poses;
pub mod ranges;
pub mod ways;
pub mod workspace;

#[cfg(test)]
#[path = "../../cli/tests/integration/study_length.rs"]
mod study_length;
