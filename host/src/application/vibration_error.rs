//! Why nothing is identified of a platform on springs.

use rigident_vibration::suspension::SuspensionError;
use rigident_vibration::suspension::by_modes::Refused;

/// Why nothing is identified of a platform on springs.
#[derive(Debug, thiserror::Error)]
pub enum VibrationError {
    /// The number of modes cannot be.
    #[error("`modes`: a platform has one to six, with what swings on it up to twelve")]
    Modes,
    /// A rig file of several links; holds the recording's name.
    #[error(
        "{0}: its rig file has several [[link]] tables: identify what swings by `identify()`, and locked \
         postures by \
         `vibration_postures()`"
    )]
    Links(String),
    /// The springs, or what swings on them.
    #[error(transparent)]
    Suspension(#[from] SuspensionError),
    /// Modes that cannot be true.
    #[error("{name}: {why}")]
    Refused {
        /// The recording.
        name: String,
        /// The contradiction.
        why: Refused,
    },
    /// Modes that leave an element of the stiffness open.
    #[error(
        "{name}: {modes} modes do not tell every element of the stiffness: strike the platform so that it \
         moves in all directions"
    )]
    FewModes {
        /// The recording.
        name: String,
        /// The number of its modes.
        modes: usize,
    },
    /// No file of postures, and no recording.
    #[error("no file is given")]
    NoFile,
    /// A rig file beside a file of postures.
    #[error("`rig`: a file of postures has the links itself")]
    RigOfPostures,
    /// A file of postures that is none.
    #[error("{0}")]
    Postures(String),
    /// Recordings of postures on two rigs.
    #[error(
        "{name}: its [suspension] or its [[link]] tables are not those of {first}: give one rig file for all \
         by `rig`"
    )]
    OtherRig {
        /// The recording.
        name: String,
        /// The first.
        first: String,
    },
    /// The recordings are not as long as the modes need.
    #[error(transparent)]
    Spectrum(#[from] rigident_vibration::modal_analysis::ModalError),
    /// The demonstration cannot be simulated.
    #[error("{0}")]
    Simulated(String),
    /// The demonstration lacks what it shows.
    #[error("the postures do not determine all that they should: more noise than the paper's")]
    PaperIncomplete,
}
