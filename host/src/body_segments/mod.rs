//! One person's segments from trials with cameras and force plates: solved, and validated on what was left out.
//!
//! Lives here: one factor a motion, merged and solved beside the table of people ([`Study`]), predictions of motions that were left out
//! ([`left_out`]), segments with intervals ([`segments`]), and
//! the same in bodies of OpenSim's ([`opensim`]). May not live here: how rows are made
//! ([`crate::problem::person`]), and how anything is shown.

mod calibration;
pub mod choice;
pub mod left_out;
pub mod opensim;
pub mod report;
pub mod segments;
mod study;
pub mod tool;

pub use study::{Motion, Study, StudyError, StudyOptions};
