//! The notices and refusals of the application, in the words of the command line: which option is the remedy.

use crate::Failure;
use rigident::application::{
    BodyError, BodyOption, CalibrateError, DeviceError, DrivingError, Error, ListingError, LiveError, Notice,
    TreeOption, WatchError,
};
use rigident_fit::pool::PoolError;
use rigident_io::recording::extension;
use rigident_shared::forgetting::Span;

use std::path::Path;

/// The advice about an image without the feature.
const WITHOUT_WATCH: &str = "this device runs an image without the feature `watch`, as the standard one is: \
                             `cargo xtask flash --features watch` puts the \
                             other onto a board, and `cargo xtask firmware` builds that of the emulated \
                             board beside the standard one";

/// Words what was noticed.
pub(crate) fn notice(notice: &Notice) -> String {
    use rigident::application::notice as words;
    match notice {
        Notice::ColumnsAssumed(assumed) => format!(
            "{assumed}; the wrench is taken to be that on the body. `rigident import` writes a rig file that \
             says so, to be changed"
        ),
        Notice::ColumnsLeftOut(columns) => format!(
            "one rigid body is identified, and columns of other links are not used: {}. Several links need \
             [[link]] tables in the rig file, or --model",
            columns.join(", ")
        ),
        Notice::LockedAtZero(joints) => {
            format!(
                "{}; say --lock JOINT=VALUE (rad or m) if it was elsewhere",
                words::locked_at_zero(joints)
            )
        }
        Notice::Tool { words, link } => {
            format!("--tool {words} changes nothing of the answer: {}", words::tool(link))
        }
        Notice::Payload { link, without } => {
            format!("{} need a run with the bare flange as --tare", words::payload(link, without))
        }
        Notice::PayloadNotUsed(link) => format!(
            "--payload {link}: nothing is said of it, because the recording with it cannot be true; this is \
             the answer about the arm"
        ),
        Notice::MassContradicted { given_kg, plates } => format!(
            "--mass-kg {given_kg} contradicts the plates, which say {plates}: weigh again, or leave it out"
        ),
        Notice::PlatformNotTakenOff => {
            "the rig file states the platform: of factors that have it on, --without-platform takes it off"
                .to_owned()
        }
        Notice::LoadOrigin { with, without } => format!("rigident identify --payload, {with} less {without}"),
        Notice::LoadTurned => "turned as --payload says".to_owned(),
    }
}

/// Words why there is no answer.
pub(crate) fn error(error: &Error) -> String {
    match error {
        Error::Of { of, error: own } => format!("{of}: {}", self::error(own)),
        Error::Assuming { error: own, assumed } => format!("{}\n{assumed}", self::error(own).trim_end()),
        Error::Listing(own) => listing(own),
        Error::Factors(own) => factors(own),
        Error::OfRobot { error: own, joint } => format!(
            "{own}. Its columns {joint}_… are of a robot's joints: to identify its links give its \
             description by --model FILE"
        ),
        Error::OnlyForTrees(option) => format!(
            "{} is for trees of links: say which by --model, or by [[link]] tables in the rig file",
            option_of(*option)
        ),
        Error::NoPerson => {
            "--height-m, --mass-kg, --sex and --segment describe human34 and human58; the model given is \
             neither"
                .to_owned()
        }
        Error::LockedMoves { joint, moves } => format!(
            "--lock {joint}: {moves}: a joint that moves cannot be taken for locked; leave it out of --lock"
        ),
        Error::CalibrationOfTree => {
            "--calibration is for one body, and this is a tree of links: leave it out".to_owned()
        }
        Error::Span { span, why } => match span {
            Span::TimeConstant(s) => format!("--forget {s}: {why}"),
            Span::Window(s) => format!("--window {s}: {why}"),
        },
        Error::SpanOfStreams => {
            "--forget and --window: not of several files with clocks of their own, as the uncertainty of \
             their skews is that of a whole run; give one recording"
                .to_owned()
        }
        Error::NominalSigma(sigma) => {
            format!("--nominal-sigma {sigma}: must be finite and greater than zero")
        }
        Error::PayloadAndLinks => {
            "--payload: the answer is about what a link carries; --write-model and --symmetric-sides are \
             about the links: identify these without it"
                .to_owned()
        }
        Error::PayloadOfBody => {
            "--payload: this is one body, and --tare alone takes its fixture off".to_owned()
        }
        Error::LoadFile { path, why } => format!("--write-load {}: {why}", path.display()),
        Error::OtherLinks { factor, rig } => format!(
            "--rig: the factor is of {factor}, and the rig file of {rig}; give the rig file that the \
             recordings were taken with, or none"
        ),
        Error::NoOffset(why) => format!("--estimate offset: {why}"),
        Error::NoPlatform => {
            "--without-platform: the rig file states neither [suspension.platform] nor the mass of a \
             spring"
                .to_owned()
        }
        Error::Disagree { recordings, ratio, shared_offset } => format!(
            "{recordings} disagree {ratio:.1} times as much as their noise explains: they are not runs of \
             one body, mounted alike, with one sensor{}; `rigident solve` of each tells which does not \
             belong. --force merges them all the same, the intervals widened as much",
            if *shared_offset { ", or its offset is not one between them" } else { "" }
        ),
        Error::OtherParameters => {
            "--train has other parameters than the recording: columns are missing in one of them".to_owned()
        }
        Error::ResultOfTree(path) => format!(
            "{} is of a tree of links: give the description that it was identified with, --model FILE",
            path.display()
        ),
        Error::ResultOfBody(path) => format!("{} is of one body, and --model of a tree", path.display()),
        Error::Body(own) => body(own),
        Error::Calibrate(own) => match &**own {
            CalibrateError::Rig(own) => format!("{own}. Nothing was saved"),
            other => other.to_string(),
        },
        Error::Watch(own) if matches!(**own, WatchError::NotBuiltIn) => WITHOUT_WATCH.to_owned(),
        other => other.to_string(),
    }
}

fn body(error: &BodyError) -> String {
    match error {
        BodyError::Number { option, value, wanted } => {
            let name = match option {
                BodyOption::PlateScale => return format!("--plate-scale-percent: {wanted}"),
                BodyOption::Delay => return format!("--delay-s: {wanted}"),
                BodyOption::Mass => "--mass-kg",
                BodyOption::Height => "--height-m",
                BodyOption::CutOff => "--cut-off-hz",
                BodyOption::NominalSigma => "--nominal-sigma",
                BodyOption::Motions => "--motions",
            };
            format!("{name} {value}: {wanted}")
        }
        BodyError::GroundWithoutTrial(path) => format!(
            "--ground {}: there is no TRC trial for it; C3D files have their plates inside",
            path.display()
        ),
        BodyError::Osim { path, why } => format!("--osim {}: {why}", path.display()),
        BodyError::WithoutOsim(path) => format!(
            "--write-model {}: an OpenSim model is written into another one: name that with --osim FILE",
            path.display()
        ),
        BodyError::ToolLink(link) => format!(
            "--tool-link {link}: no marker follows {link} in all trials, so that what it holds cannot be \
             found: put markers on it, or name the link that has some"
        ),
        other => other.to_string(),
    }
}

fn listing(error: &ListingError) -> String {
    match error {
        ListingError::TwoRigs(path) => format!(
            "{} is a rig file itself, whose [[stream]] files are the recording: give it without --rig",
            path.display()
        ),
        ListingError::Folder(path) => format!(
            "{} is a folder without a bag of ROS 2 (metadata.yaml with .mcap or .db3): of files with clocks \
             of their own give the rig file that lists them as [[stream]] by --rig",
            path.display()
        ),
        ListingError::OneOfSeveral { .. } => error.to_string(),
        ListingError::NotSingle { given, listing, job } => format!(
            "{} is no single recording: `rigident {job}` takes one CSV or MCAP file of one clock; several \
             files with clocks \
             of their own, which a rig file lists as [[stream]], are for `rigident identify`, `factor` and \
             `--tare`: `rigident \
             identify {}{}`",
            given.display(),
            listing.display(),
            if listing.is_dir() { " --rig RIG" } else { "" }
        ),
    }
}

/// Says why factors are not read or merged, and what to do with a file that is a recording by its name.
fn factors(error: &PoolError) -> String {
    let name = match error {
        PoolError::File { name, .. } | PoolError::Access { name, .. } => name.as_str(),
        _ => "",
    };
    match extension(Path::new(name)).as_str() {
        "csv" | "mcap" | "db3" | "bag" | "mat" | "tdms" | "xlsx" | "xlsm" => format!(
            "{error}; it is a recording by its name: `rigident factor {name} -o NEW.factor` makes one of it"
        ),
        "parquet" => format!("{error}; of a table of factors `rigident merge` makes one"),
        _ => error.to_string(),
    }
}

/// Returns the option by which something is asked of a tree.
pub(crate) fn option_of(option: TreeOption) -> &'static str {
    match option {
        TreeOption::Friction => "--friction",
        TreeOption::Drives => "--drive",
        TreeOption::SymmetricSides => "--symmetric-sides",
        TreeOption::WriteModel => "--write-model",
        TreeOption::Payload => "--payload",
        TreeOption::NominalSigma => "--nominal-sigma",
        TreeOption::Lock => "--lock",
        TreeOption::Spherical => "--spherical",
        TreeOption::Tool => "--tool",
        TreeOption::Person => "--height-m (as --mass-kg, --sex, --segment)",
    }
}

impl From<DeviceError> for Failure {
    fn from(error: DeviceError) -> Self {
        Error::from(error).into()
    }
}

impl From<DrivingError> for Failure {
    fn from(error: DrivingError) -> Self {
        Error::from(error).into()
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let error = match error {
            Error::Body(own) => match *own {
                BodyError::Beside(own) => match own.downcast::<Self>() {
                    Ok(failure) => return *failure,
                    Err(other) => BodyError::Beside(other).into(),
                },
                other => other.into(),
            },
            other => other,
        };
        let failure = match &error {
            Error::Stopped => Self::interrupted(&error),
            Error::Driving(own) if own.is_stopped() => Self::interrupted(own),
            Error::Driving(own) if own.is_of_the_link() => Self::link(own),
            Error::Live(own) if matches!(**own, LiveError::StoppedLooking) => Self::interrupted(own),
            Error::Device(own) if own.is_of_the_link() => Self::link(own),
            Error::Live(own) if own.is_of_the_link() => Self::link(own),
            Error::Watch(own) if matches!(**own, WatchError::NotBuiltIn) => Self::link(self::error(&error)),
            other => Self::input(self::error(other)),
        };
        failure.at_place_of(&error)
    }
}
