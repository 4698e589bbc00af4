//! Why a person is not identified.

use std::fmt;
use std::path::PathBuf;

use rigident_io::motion_capture::opensim::OpenSimError;
use rigident_io::motion_capture::trial::TrialError;
use rigident_people::body_segments::StudyError;
use rigident_people::body_segments::opensim::OsimFault;

/// Why a person is not identified.
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    /// A trial.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// Trials, motions or rows.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A number that an option cannot have.
    #[error("{option}: {value}: {wanted}")]
    Number {
        /// The option.
        option: BodyOption,
        /// The number, in words.
        value: String,
        /// The values that it may have.
        wanted: &'static str,
    },
    /// The forces of the ground of a trial that is none; holds the file.
    #[error("{}: there is no TRC trial for these forces of the ground; C3D files have their plates inside", .0.display())]
    GroundWithoutTrial(PathBuf),
    /// An OpenSim model cannot be read.
    #[error("{path}: {why}", path = path.display())]
    Osim {
        /// The file.
        path: PathBuf,
        /// Why not.
        why: String,
    },
    /// An OpenSim model is to be written without one to write it into; holds the file.
    #[error("{}: an OpenSim model is written into another one: give that one, too", .0.display())]
    WithoutOsim(PathBuf),
    /// The segments cannot be put into an OpenSim model.
    #[error(transparent)]
    IntoOsim(#[from] OsimFault),
    /// The OpenSim model cannot be written.
    #[error(transparent)]
    OsimText(#[from] OpenSimError),
    /// No marker follows the link that holds the tool; holds its name.
    #[error(
        "no marker follows {0} in all trials, so that what it holds cannot be found: put markers on it, or \
         name the link that has some"
    )]
    ToolLink(String),
    /// It was stopped while the firmware took a motion; holds the motion.
    #[error("{0}: interrupted")]
    Interrupted(String),
    /// The failure of what a caller computed beside it.
    #[error(transparent)]
    Beside(Box<dyn std::error::Error + Send + Sync>),
}

/// An option of [`super::BodyOptions`] whose number cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyOption {
    /// [`super::BodyOptions::mass_kg`].
    Mass,
    /// [`super::BodyOptions::height_m`].
    Height,
    /// [`super::BodyOptions::cut_off_hz`].
    CutOff,
    /// [`super::BodyOptions::nominal_sigma`].
    NominalSigma,
    /// [`super::BodyOptions::plate_scale`].
    PlateScale,
    /// [`super::BodyOptions::delay_s`].
    Delay,
    /// [`super::BodyOptions::motions`].
    Motions,
}

impl fmt::Display for BodyOption {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Mass => "mass",
            Self::Height => "stature",
            Self::CutOff => "cut-off frequency",
            Self::NominalSigma => "trust in the table",
            Self::PlateScale => "scale of the plates",
            Self::Delay => "delay",
            Self::Motions => "motions",
        })
    }
}
