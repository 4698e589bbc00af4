//! The application: one function a job, typed options in, typed answers out.
//!
//! [`application`] has the jobs; the rest re-exports the crates below it. One way leads from a recording to
//! an answer: [`recording`], [`motion_capture`], [`rig`] and [`model`] are what comes in, [`rows`],
//! [`vibration`] and [`people`] make rows of it, [`fit`] holds the information factor, [`answer`] reads it,
//! [`present`] shows it; a [`mod@reference`] body calibrates a rig and verifies it. [`device`] has the
//! firmware make the factor while its platform moves as [`plan`] found best; `study` tests the intervals; the
//! crate `rigident_cli` joins all into commands. The pipeline of a sample is in `rigident_shared`, mechanics
//! of the platform in `hexapod`, the simulated rig in `rigident_sim`.
//!
//! Features: `simulator` (default) brings the simulated rig and what needs one: `demo`, `montecarlo`, and
//! `replay` through firmware in this process. `emulator` (default) adds the emulated board, `--mcu qemu`, on
//! Unix. Everything else, down to the library's types, is there without both.

pub mod application;
pub mod schema;

pub use rigident_device as device;
pub use rigident_fit as fit;
pub use rigident_fit::motion_selection;
pub use rigident_identify::{
    answer, diagnosis, drive_gains, joint_offsets, load_cell, mass_properties, problem, reference,
};
pub use rigident_io::{factor_table, motion_capture, recording, rig, sources, union};
#[cfg(feature = "simulator")]
pub use rigident_laboratory as laboratory;
pub use rigident_model as model;
pub use rigident_people as people;
pub use rigident_plan as plan;
pub use rigident_present as present;
pub use rigident_rows as rows;
#[cfg(feature = "simulator")]
pub use rigident_study as study;
pub use rigident_vibration as vibration;
