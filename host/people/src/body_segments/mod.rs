//! One person's segments from trials with cameras and force plates: solved, and validated on what was left
//! out.
//!
//! Lives here: one factor a motion, merged and solved beside the table of people ([`Study`]), predictions of
//! motions that were left out ([`left_out`]), plates that contradict the motion ([`plates`]), segments with
//! intervals ([`segments`]), and the same in bodies of OpenSim's ([`opensim`]). May not live here: how rows
//! are made ([`crate::person`]), and how anything is shown.

mod calibration;
pub mod choice;
mod error;
mod ground;
pub mod left_out;
mod motion;
pub mod opensim;
pub mod plates;
pub mod report;
mod rigidity;
pub mod segments;
mod study;
pub mod tool;

pub use error::{DrawError, StudyError};
pub use ground::PlateScale;
pub use motion::{Motion, Parts};
pub use study::{Segments, Study, StudyOptions};
