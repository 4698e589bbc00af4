//! Recordings of a reference body: a rig calibrated by them, and verified.

mod runs;
mod verify;

pub use runs::{ReferenceOptions, ReferenceRun, ReferenceRuns, RigError, RigErrors};
pub use verify::{Verification, Verified};
