//! What to do with the platform before it moves: which poses and motions tell most of the body.
//!
//! Lives here: the platform that a rig file describes ([`machine`]) with body and sensors ([`equipment`]), what the plate may carry before
//! that is known ([`carried`]), what the sensors are to read ([`ranges`]), where it can be tilted to ([`workspace`]), still
//! poses ([`poses`]), moves between them ([`ways`]), plans on disk ([`plan_file`]). May not live here: the platform's mechanics (that is
//! `hexapod`), driving it ([`crate::platform`]), what a user types and sees ([`crate::cli`]). Next:
//! [`crate::device::session`], which follows a plan.

pub mod adaptive;
pub mod carried;
pub mod equipment;
pub mod machine;
pub mod motion;
pub mod plan_file;
pub mod poses;
pub mod ranges;
pub mod ways;
pub mod workspace;
