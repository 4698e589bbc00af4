//! The notices and refusals of the application, in the words of Python: which argument is the remedy.

use rigident::application::{Error, Notice, TreeOption, notice as words};
use rigident_shared::forgetting::Span;

/// Words what was noticed.
pub fn notice(notice: &Notice) -> String {
    match notice {
        Notice::ColumnsAssumed(assumed) => format!(
            "{assumed}; the wrench is taken to be that on the body. `rigident import` writes a rig file that \
             says so, to be changed"
        ),
        Notice::ColumnsLeftOut(columns) => format!(
            "one rigid body is identified, and columns of other links are not used: {}. Several links \
             need \"link\" tables in the rig, or model=…",
            columns.join(", ")
        ),
        Notice::LockedAtZero(joints) => {
            format!(
                "{}; say lock='JOINT=VALUE' (rad or m) if it was elsewhere",
                words::locked_at_zero(joints)
            )
        }
        Notice::PlatformNotTakenOff => {
            "the rig states the platform: of factors that have it on, without_platform=True takes it off"
                .to_owned()
        }
        Notice::PayloadNotUsed(link) => format!(
            "payload={link:?}: nothing is said of it, because the recording with it cannot be true; this is \
             the answer about the arm"
        ),
        other => other.to_string(),
    }
}

/// Words why there is no answer.
pub fn error(error: &Error) -> String {
    match error {
        Error::Of { of, error: own } => format!("{of}: {}", self::error(own)),
        Error::Assuming { error: own, assumed } => format!("{}\n{assumed}", self::error(own).trim_end()),
        Error::OfRobot { error: own, joint } => format!(
            "{own}. Its columns {joint}_… are of a robot's joints: to identify its links give its \
             description by model=…"
        ),
        Error::OnlyForTrees(option) => format!(
            "{} is for trees of links: say which by model=…, or by \"link\" tables in the rig",
            argument(*option)
        ),
        Error::NoPerson => {
            "height_m, mass_kg and sex describe human34 and human58; the model given is neither".to_owned()
        }
        Error::LockedMoves { joint, moves } => {
            format!(
                "lock {joint}: {moves}: a joint that moves cannot be taken for locked; leave it out of \
                     lock"
            )
        }
        Error::CalibrationOfTree => {
            "calibration is for one body, and this is a tree of links: leave it out".to_owned()
        }
        Error::Span { span, why } => match span {
            Span::TimeConstant(s) => format!("forget_s={s}: {why}"),
            Span::Window(s) => format!("window_s={s}: {why}"),
        },
        Error::NominalSigma(sigma) => format!("nominal_sigma={sigma}: must be finite and greater than zero"),
        Error::PayloadWithoutTare => "payload: needs runs without it, tare=…".to_owned(),
        Error::PayloadAndLinks => {
            "payload: the answer is about what a link carries; write_model and symmetric_sides are about the \
             links: identify these without it"
                .to_owned()
        }
        Error::LoadFile { path, why } => format!("write_load {}: {why}", path.display()),
        Error::OtherLinks { factor, rig } => format!(
            "rig: the factor is of {factor}, and the rig file of {rig}; give the rig that the recordings \
             were taken with, or none"
        ),
        Error::NoOffset(why) => format!("estimate='offset': {why}"),
        Error::NoPlatform => {
            "without_platform: the rig states neither suspension.platform nor the mass of a spring".to_owned()
        }
        Error::Disagree { .. } => format!(
            "{error}. force=True merges them all the same, the intervals \
                                           widened as much"
        ),
        other => other.to_string(),
    }
}

fn argument(option: TreeOption) -> &'static str {
    match option {
        TreeOption::Friction => "friction",
        TreeOption::Drives => "drive",
        TreeOption::SymmetricSides => "symmetric_sides",
        TreeOption::WriteModel => "write_model",
        TreeOption::Payload => "payload",
        TreeOption::NominalSigma => "nominal_sigma",
        TreeOption::Lock => "lock",
        TreeOption::Spherical => "spherical",
        TreeOption::Tool => "tool",
        TreeOption::Person => "height_m (as mass_kg, sex)",
    }
}
