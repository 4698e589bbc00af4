//! Library of the command line and of Python.
//!
//! One way leads from a recording to an answer: [`recording`], [`motion_capture`], [`rig`] and [`model`] are
//! what comes in, [`fit`] holds the information factor, [`answer`] reads it, [`present`] shows it,
//! [`monitor`] while it grows; a [`mod@reference`] body calibrates a rig and verifies it. [`device`] has the
//! firmware make the factor while [`platform`] moves as [`plan`] found best; `montecarlo` tests the
//! intervals; the crate `rigident_cli` joins all into commands. The pipeline of a sample is in
//! `rigident_shared`, mechanics of the platform in `hexapod`, the simulated rig in `rigident_sim`.
//!
//! Features: `simulator` (default) brings the simulated rig and what needs one: `demo`, `montecarlo`, and `replay` through
//! firmware in this process. `emulator` (default) adds the emulated board, `--mcu qemu`, on Unix. Everything else, down to the
//! library's types, is there without both.

pub mod answer;
pub mod application;
pub mod body_segments;
pub mod device;
pub mod diagnosis;
pub mod drive_gains;
pub mod inverse_kinematics;
pub mod joint_offsets;
pub mod load_cell;
pub mod mass_properties;
pub mod modal_analysis;
pub mod monitor;
#[cfg(feature = "simulator")]
pub mod montecarlo;
pub mod named_model;
mod named_table;
pub mod plan;
pub mod platform;
pub mod present;
pub mod problem;
pub mod reference;
pub mod schema;
pub mod simulated;
pub use rigident_fit as fit;
pub use rigident_fit::motion_selection;
pub use rigident_io::{factor_table, motion_capture, recording, rig, sources, union};
pub use rigident_model as model;

#[cfg(test)]
#[path = "../cli/tests/integration/study_length.rs"]
mod study_length;
