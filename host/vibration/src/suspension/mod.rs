//! Bodies on a platform that springs carry: no load cell, no actuator, only the motion that springs allow.
//!
//! Lives here: the springs' law ([`springs`]), errors of their places ([`geometry`]), rests with other loads
//! ([`rests`]), the bare platform ([`bare`]), locked postures ([`postures`]), poses brought to coordinates
//! about rest (`track`), the source of rows ([`source`]), and the way to it from a recording and a rig file
//! ([`mod@prepare`]). May not live here: the rows of a tree ([`rigident_rows::tree`]).

pub mod bare;
mod bridged;
pub mod by_modes;
mod cut_off;
pub mod free_decay;
pub mod geometry;
mod imu_errors;
pub mod modal;
pub mod mount;
pub mod posture_checks;
pub mod posture_file;
pub mod posture_modes;
pub mod posture_sets;
pub mod postures;
pub mod preload;
pub mod prepare;
pub mod recorded_postures;
mod release;
pub mod rests;
pub mod settled;
pub mod source;
pub mod springs;
pub mod stiffness;
pub mod support;
pub mod suspects;
mod track;
mod track_noise;
mod whitened;

pub use mount::Instant;
pub use prepare::{PreparedSuspension, prepare};
pub use source::SuspendedSource;

use rigident_rows::tree::{TreePrepareError, TreeSourceError};

/// The reason that a recording on springs makes no rows.
#[derive(Debug, thiserror::Error)]
pub enum SuspensionError {
    /// Columns or keys are missing.
    #[error("{name}: {missing} missing: {advice}")]
    Missing {
        /// The recording.
        name: String,
        /// The missing part, with its verb.
        missing: String,
        /// The advice.
        advice: String,
    },
    /// A pose is none.
    #[error(
        "{place}: {pose:?} is no pose x, y, z, qw, qx, qy, qz with a unit quaternion: correct it, or remove \
         the row"
    )]
    Pose {
        /// The place of it.
        place: String,
        /// The text there.
        pose: [f64; 7],
    },
    /// The cut-off does not fit the rate.
    #[error(
        "a cut-off of {cut_off_hz} Hz cannot be at {rate_hz} poses a second: cut_off_hz of [suspension] must \
         be below a quarter of that"
    )]
    CutOff {
        /// The cut-off, Hz.
        cut_off_hz: f64,
        /// Poses per second.
        rate_hz: f64,
    },
    /// Too few rows are left.
    #[error(
        "{name}: no pose is left: {rows} poses at {rate_hz:.0} a second, and smoothing at {cut_off_hz} Hz \
         takes {taps} without a gap: record longer, or raise cut_off_hz of [suspension]"
    )]
    Short {
        /// The recording.
        name: String,
        /// The number of rows.
        rows: usize,
        /// Rows per second.
        rate_hz: f64,
        /// The cut-off, Hz.
        cut_off_hz: f64,
        /// Rows under the kernel.
        taps: usize,
    },
    /// Time has gaps.
    #[error(
        "{name}: {gaps} gaps in time, the first before {first}, leave no more than {longest_s:.1} s in a \
             row: modes need samples at a constant rate; fill the missing rows in, or record anew"
    )]
    Gaps {
        /// The recording.
        name: String,
        /// The number of gaps.
        gaps: usize,
        /// The row after the first.
        first: String,
        /// The longest stretch between them, s.
        longest_s: f64,
    },
    /// A locked coordinate moves.
    #[error(
        "{name}: {coordinate} is locked by [suspension], and it moves by {moves:.2e} {unit} (rms), \
             {share:.0} % of the largest free one: take it out of `locked`, or look whether the pose columns \
             are in other axes"
    )]
    NotLocked {
        /// The recording.
        name: String,
        /// The coordinate.
        coordinate: String,
        /// Root mean square.
        moves: f64,
        /// The unit of the coordinate.
        unit: &'static str,
        /// The motion as a share of the largest free coordinate's, %.
        share: f64,
    },
    /// A posture cannot be used.
    #[error("{file}: {why}")]
    Posture {
        /// The file.
        file: String,
        /// The one concerned, and why not.
        why: String,
    },
    /// The vibration has no modes.
    #[error("{name}: {error}")]
    Modes {
        /// The recording.
        name: String,
        /// Why.
        error: Box<crate::modal_analysis::ModalError>,
    },
    /// Joints or links do not fit the model.
    #[error(transparent)]
    Tree(#[from] TreePrepareError),
    /// The model has no base parameters.
    #[error(transparent)]
    Source(#[from] TreeSourceError),
}
