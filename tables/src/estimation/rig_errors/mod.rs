//! Errors of sensors and mounting that do not average out: an independent simulation of the rig, through the
//! program as a user would run it with a rig file.

mod all;
mod calibration;
mod errors;
mod mechanics;
mod recording;
mod single;
mod study;

pub use all::table as all_table;
pub use calibration::table as calibration_table;
pub use errors::{Errors, Noise};
pub use mechanics::Motion;
pub use recording::{Flicker, Rig, rig_file};
pub use single::table;
