//! Why a job has no answer.

use std::fmt;
use std::path::{Path, PathBuf};

use rigident_shared::forgetting::Span;

use super::body_error::BodyError;
use super::calibrate_error::CalibrateError;
use super::device_error::DeviceError;
use super::drive_gains_error::DriveGainsError;
use super::driving_error::DrivingError;
use super::live_error::LiveError;
use super::plan_error::PlanError;
use super::vibration_error::VibrationError;
use super::watch_error::WatchError;
use rigident_fit::FitError;
use rigident_fit::pool::PoolError;
use rigident_fit::prior::KnownError;
use rigident_fit::tare::TareError;
use rigident_identify::answer::{AnswerError, ReadError};
use rigident_identify::problem::ProblemError;
use rigident_identify::problem::clocks::StreamError;
use rigident_io::motion_capture::opensim::OpenSimError;
use rigident_io::motion_capture::trial::TrialError;
use rigident_io::recording::RecordingError;
use rigident_io::rig::RigFileError;
use rigident_io::rig::calibration::CalibrationError;
use rigident_model::ModelError;
use rigident_people::body_segments::StudyError;
use rigident_people::body_segments::opensim::OsimFault;
use rigident_plan::poses::statics::StaticsError;
use rigident_rows::tree::TreePrepareError;

/// Why a job has no answer: its kind, with what a caller needs to word the remedy. Its text is for users of
/// this library.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A recording or its rig file.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Several files with clocks of their own.
    #[error(transparent)]
    Streams(Box<StreamError>),
    /// The list of several files.
    #[error(transparent)]
    Listing(#[from] ListingError),
    /// Recording, rig and model pose no problem, or it has no fit.
    #[error(transparent)]
    Problem(Box<ProblemError>),
    /// A model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Columns of a tree.
    #[error(transparent)]
    Columns(#[from] TreePrepareError),
    /// The calibration of a rig.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The prior knowledge.
    #[error(transparent)]
    Known(#[from] KnownError),
    /// The fixture.
    #[error(transparent)]
    Tare(#[from] TareError),
    /// Factors.
    #[error(transparent)]
    Factors(#[from] PoolError),
    /// Rows.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The request.
    #[error(transparent)]
    Answer(#[from] AnswerError),
    /// An answer that cannot be read.
    #[error("{path}: {error}", path = path.display())]
    Result {
        /// The file.
        path: PathBuf,
        /// Why not.
        error: ReadError,
    },
    /// Gains of drives.
    #[error(transparent)]
    DriveGains(#[from] DriveGainsError),
    /// A list of columns of drives.
    #[error("{0}")]
    Friction(String),
    /// Something of one of several things that were given.
    #[error("{of}: {error}")]
    Of {
        /// The thing.
        of: String,
        /// The fault in it.
        error: Box<Error>,
    },
    /// The fault, and what was assumed before.
    #[error("{error}\n{assumed}")]
    Assuming {
        /// The fault.
        error: Box<Error>,
        /// The assumptions, in words.
        assumed: String,
    },
    /// No fit, and the fault of the recording that explains it.
    #[error("{error}. Most likely {what}: {remedy}")]
    Explained {
        /// Why there is no fit.
        error: Box<ProblemError>,
        /// The fault.
        what: String,
        /// The remedy.
        remedy: String,
    },
    /// It is no recording of a body, but has columns of a robot's joints.
    #[error(
        "{error}. Its columns {joint}_… are of a robot's joints: to identify its links give its description \
         as the model"
    )]
    OfRobot {
        /// Why it is none of a body.
        error: Box<ProblemError>,
        /// The first of the joints.
        joint: String,
    },
    /// An option of trees where nothing says which tree.
    #[error("{0}: for trees of links: say which by a model, or by [[link]] tables in the rig file")]
    OnlyForTrees(TreeOption),
    /// A person is described and the model is of none.
    #[error(
        "stature, mass, sex and lengths of segments describe human34 and human58; the model given is neither"
    )]
    NoPerson,
    /// A joint that is to be locked moves.
    #[error("joint {joint}: {moves}: a joint that moves cannot be taken for locked")]
    LockedMoves {
        /// The joint.
        joint: String,
        /// The place where it is seen to move, and the distance.
        moves: String,
    },
    /// A calibration of the rig, where a tree is identified.
    #[error("the calibration of a rig is for one body, and this is a tree of links: leave it out")]
    CalibrationOfTree,
    /// A span of forgetting that cannot be.
    #[error("{} of {} s: {why}", span_in_words(*.span), seconds(*.span))]
    Span {
        /// The span.
        span: Span<f64>,
        /// Why not, and what is wanted.
        why: String,
    },
    /// Forgetting, where a tree of links is replayed.
    #[error("{}: for a single body only, not for a tree of links", match .0 {
        Span::TimeConstant(_) => "`forget_s`",
        Span::Window(_) => "`window_s`",
    })]
    SpanOfTree(Span<f64>),
    /// Forgetting, where several files have clocks of their own.
    #[error(
        "forgetting: not of several files with clocks of their own, as the uncertainty of their skews is \
         that of a whole run; give one recording"
    )]
    SpanOfStreams,
    /// The trust in a nominal model is no standard deviation.
    #[error("the nominal model's relative standard deviation {0}: must be finite and greater than zero")]
    NominalSigma(f64),
    /// A payload is asked for together with the links' standard parameters.
    #[error(
        "the answer about a payload is about what a link carries; a written model and symmetric sides are \
         about the links"
    )]
    PayloadAndLinks,
    /// A payload of one body.
    #[error("a payload needs a tree of links: this is one body, and the tare alone takes its fixture off")]
    PayloadOfBody,
    /// The place of a payload is none.
    #[error(transparent)]
    PayloadPlace(ModelError),
    /// The payload has no runs without it.
    #[error("a payload needs runs without it as the tare")]
    PayloadWithoutTare,
    /// The file of a load cannot be written.
    #[error("load {path}: {why}", path = path.display())]
    LoadFile {
        /// The file.
        path: PathBuf,
        /// Why not.
        why: String,
    },
    /// The rig file's links are not those that a factor is of.
    #[error(
        "the rig file: the factor is of {factor}, and the rig file of {rig}; give the rig file that the \
         recordings were taken with, or none"
    )]
    OtherLinks {
        /// The subject of the factor.
        factor: String,
        /// The subject of the rig file.
        rig: String,
    },
    /// An offset is asked for that merged runs do not have in common.
    #[error("offset: {0}")]
    NoOffset(String),
    /// The platform is to be taken off, and nothing states it.
    #[error(
        "the platform cannot be taken off: the rig file states neither [suspension.platform] nor the mass of \
         a spring"
    )]
    NoPlatform,
    /// Runs that are merged disagree too much to be of one body.
    #[error("{}", disagree(recordings, *ratio, *shared_offset))]
    Disagree {
        /// The runs.
        recordings: String,
        /// Their disagreement in units of their noise.
        ratio: f64,
        /// They were to have one offset.
        shared_offset: bool,
    },
    /// The recording that plain least squares are trained on has other parameters.
    #[error(
        "the recording to train on has other parameters than the recording: columns are missing in one of \
         them"
    )]
    OtherParameters,
    /// A result of a tree, without the tree's description; holds the file.
    #[error("{} is of a tree of links: give the description that it was identified with", .0.display())]
    ResultOfTree(PathBuf),
    /// A result of one body, beside the description of a tree; holds the file.
    #[error("{} is of one body, and the model of a tree", .0.display())]
    ResultOfBody(PathBuf),
    /// A result from which nothing can be predicted.
    #[error("{path}: {why}", path = path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// Why not.
        why: String,
    },
    /// A result of another body or tree than the first.
    #[error("{path}: it is of {of}, and the first of {first}", path = path.display())]
    OtherSubject {
        /// The file.
        path: PathBuf,
        /// The subject of the result in `path`, in words.
        of: String,
        /// The subject of the first result, in words.
        first: String,
    },
    /// A person.
    #[error(transparent)]
    Body(Box<BodyError>),
    /// A sensor, a rig or a robot.
    #[error(transparent)]
    Calibrate(Box<CalibrateError>),
    /// A platform on springs.
    #[error(transparent)]
    Vibration(Box<VibrationError>),
    /// A plan.
    #[error(transparent)]
    Plan(Box<PlanError>),
    /// Still poses.
    #[error(transparent)]
    Statics(#[from] StaticsError),
    /// A file of text that cannot be read, in [`Error::Of`] with its name.
    #[error("cannot be read: {0}")]
    Text(std::io::Error),
    /// A recorded experiment makes no answer.
    #[error("{}{error}", broken.as_ref().map_or_else(String::new, |why| format!("{why}\n")))]
    Unanswered {
        /// Why the experiment broke off, if it did.
        broken: Option<String>,
        /// Why there is no answer.
        error: Box<Error>,
    },
    /// A device.
    #[error(transparent)]
    Device(Box<DeviceError>),
    /// Live sources.
    #[error(transparent)]
    Live(Box<LiveError>),
    /// A platform that is not driven.
    #[error(transparent)]
    Driving(Box<DrivingError>),
    /// A watch.
    #[error(transparent)]
    Watch(Box<WatchError>),
    /// A file that cannot be read.
    #[error("{path} cannot be read: {why}", path = path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        why: String,
    },
    /// The caller stopped the job.
    #[error("stopped before there was an answer")]
    Stopped,
}

impl From<StreamError> for Error {
    fn from(error: StreamError) -> Self {
        match error {
            StreamError::File(error) => Self::Recording(error),
            StreamError::Rig(error) => error.into(),
            other => Self::Streams(Box::new(other)),
        }
    }
}

impl From<ProblemError> for Error {
    fn from(error: ProblemError) -> Self {
        Self::Problem(Box::new(error))
    }
}

impl From<RigFileError> for Error {
    fn from(error: RigFileError) -> Self {
        Self::Recording(RecordingError::Rig(error))
    }
}

impl From<DeviceError> for Error {
    fn from(error: DeviceError) -> Self {
        Self::Device(Box::new(error))
    }
}

impl From<LiveError> for Error {
    fn from(error: LiveError) -> Self {
        Self::Live(Box::new(error))
    }
}

impl From<WatchError> for Error {
    fn from(error: WatchError) -> Self {
        Self::Watch(Box::new(error))
    }
}

impl From<BodyError> for Error {
    fn from(error: BodyError) -> Self {
        Self::Body(Box::new(error))
    }
}

impl From<DrivingError> for Error {
    fn from(error: DrivingError) -> Self {
        Self::Driving(Box::new(error))
    }
}

impl From<PlanError> for Error {
    fn from(error: PlanError) -> Self {
        Self::Plan(Box::new(error))
    }
}

impl From<CalibrateError> for Error {
    fn from(error: CalibrateError) -> Self {
        Self::Calibrate(Box::new(error))
    }
}

impl From<VibrationError> for Error {
    fn from(error: VibrationError) -> Self {
        Self::Vibration(Box::new(error))
    }
}

impl From<TrialError> for Error {
    fn from(error: TrialError) -> Self {
        BodyError::from(error).into()
    }
}

impl From<StudyError> for Error {
    fn from(error: StudyError) -> Self {
        BodyError::from(error).into()
    }
}

impl From<OsimFault> for Error {
    fn from(error: OsimFault) -> Self {
        BodyError::from(error).into()
    }
}

impl From<OpenSimError> for Error {
    fn from(error: OpenSimError) -> Self {
        BodyError::from(error).into()
    }
}

impl Error {
    /// Returns the same error, of one of several things that were given.
    #[must_use]
    pub fn of(self, thing: impl fmt::Display) -> Self {
        Self::Of { of: thing.to_string(), error: Box::new(self) }
    }

    /// Reads a file of text.
    pub(super) fn text_of(path: &Path) -> Result<String, Self> {
        rigident_files::read_text(path).map_err(|error| Self::Text(error).of(path.display()))
    }
}

/// Why a path is no recording of several files.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ListingError {
    /// A rig file that lists the recording's files, beside another rig file.
    #[error(
        "{} is a rig file itself, whose [[stream]] files are the recording: give it without another rig file",
        .0.display()
    )]
    TwoRigs(PathBuf),
    /// A folder with neither a bag nor a rig file that lists its files.
    #[error(
        "{} is a folder without a bag of ROS 2 (metadata.yaml with .mcap or .db3): of files with clocks of \
         their own give the rig file that lists them as [[stream]], too",
        .0.display()
    )]
    Folder(PathBuf),
    /// A rig file lists several files, and one of them was given.
    #[error(
        "{listing} lists several files as one recording ([[stream]]): give the rig file itself, {listing}, \
         in place of {}",
        given.display(), listing = listing.display()
    )]
    OneOfSeveral {
        /// The rig file.
        listing: PathBuf,
        /// The file that was given.
        given: PathBuf,
    },
    /// Several files, given to a job that takes one.
    #[error(
        "{} is no single recording: `{job}()` takes one CSV or MCAP file of one clock; several files with \
         clocks of their own, \
         which a rig file lists as [[stream]], are for `identify()` and `factor()`, and may be a `tare`",
        given.display()
    )]
    NotSingle {
        /// The path that was given.
        given: PathBuf,
        /// The rig file, or the folder, that names several files.
        listing: PathBuf,
        /// The job, by its name.
        job: &'static str,
    },
}

/// The options that apply to trees of links alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeOption {
    /// Columns of friction.
    Friction,
    /// Drives that turn with several joints.
    Drives,
    /// Right links mirror left ones.
    SymmetricSides,
    /// A model to be written.
    WriteModel,
    /// The load of a link.
    Payload,
    /// The trust in the nominal model.
    NominalSigma,
    /// Locked joints.
    Lock,
    /// Three joints that are a spherical one.
    Spherical,
    /// A body that a link holds.
    Tool,
    /// The person whose body it is.
    Person,
}

impl fmt::Display for TreeOption {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Friction => "columns of friction",
            Self::Drives => "drives",
            Self::SymmetricSides => "symmetric sides",
            Self::WriteModel => "a model to be written",
            Self::Payload => "a payload",
            Self::NominalSigma => "trust in the nominal model",
            Self::Lock => "locked joints",
            Self::Spherical => "spherical joints",
            Self::Tool => "tools",
            Self::Person => "stature, mass, sex and segments of a person",
        })
    }
}

fn span_in_words(span: Span<f64>) -> &'static str {
    match span {
        Span::TimeConstant(_) => "a time constant",
        Span::Window(_) => "a window",
    }
}

fn seconds(span: Span<f64>) -> f64 {
    match span {
        Span::TimeConstant(s) | Span::Window(s) => s,
    }
}

/// Says how much runs disagree, without a remedy.
fn disagree(recordings: &str, ratio: f64, shared_offset: bool) -> String {
    format!(
        "{recordings} disagree {ratio:.1} times as much as their noise explains: they are not runs of one \
         body, mounted alike, with one sensor{}; the answer of each tells which does not belong",
        if shared_offset { ", or its offset is not one between them" } else { "" }
    )
}
