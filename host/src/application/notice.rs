//! The findings of a job on the way that a user may want to act on, as values: whoever calls words the
//! remedy.

use std::fmt;

/// The findings where the remedy is another one for each way to call a job. Its text is for users of this
/// library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// Neither the names of the columns nor a rig file say what the columns are: how they were understood.
    ColumnsAssumed(String),
    /// One body is identified, and these columns are of other links.
    ColumnsLeftOut(Vec<String>),
    /// Joints were locked at zero, as the recording has no columns of them.
    LockedAtZero(Vec<String>),
    /// A tool that a link holds changes nothing of the answer.
    Tool {
        /// The tool as it was given.
        words: String,
        /// The link that holds it.
        link: String,
    },
    /// The recording with the payload cannot be true, so nothing is said of the payload. Holds the link as it
    /// was given.
    PayloadNotUsed(String),
    /// The subject of the answer: the payload of a link.
    Payload {
        /// The link.
        link: String,
        /// The recordings without it.
        without: String,
    },
    /// The plates contradict the mass of a person that was given, in words.
    MassContradicted {
        /// The mass that was given, kg.
        given_kg: String,
        /// The mass by the plates, with its unit.
        plates: String,
    },
    /// The rig file states the platform on springs, which was not taken off.
    PlatformNotTakenOff,
    /// The origin of the load in a controller's file: the recordings with and without it.
    LoadOrigin {
        /// The recording with the load.
        with: String,
        /// The recordings without the load.
        without: String,
    },
    /// The frame of a load is turned in its link as the payload was stated.
    LoadTurned,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ColumnsAssumed(assumed) => write!(
                f,
                "{assumed}; the wrench is taken to be that on the body. Where that is wrong, say it in a rig \
                 file"
            ),
            Self::ColumnsLeftOut(columns) => write!(
                f,
                "one rigid body is identified, and columns of other links are not used: {}. Several links \
                 need [[link]] tables in the rig file, or a model",
                columns.join(", ")
            ),
            Self::LockedAtZero(joints) => {
                write!(f, "{}; state the position (rad or m) if it was elsewhere", locked_at_zero(joints))
            }
            Self::Tool { words, link } => {
                write!(f, "tool {words} changes nothing of the answer: {}", tool(link))
            }
            Self::PayloadNotUsed(link) => write!(
                f,
                "payload of {link}: nothing is said of it, because the recording with it cannot be true; \
                 this is the answer about the arm"
            ),
            Self::Payload { link, without } => {
                write!(f, "{} need a run with the bare flange as the tare", payload(link, without))
            }
            Self::MassContradicted { given_kg, plates } => write!(
                f,
                "the mass that was given, {given_kg} kg, contradicts the plates, which say {plates}: weigh \
                 again, or leave it out"
            ),
            Self::PlatformNotTakenOff => f.write_str(
                "the rig file states the platform; it is to be taken off an answer of factors that have it \
                 on",
            ),
            Self::LoadOrigin { with, without } => write!(f, "payload by rigident: {with} less {without}"),
            Self::LoadTurned => f.write_str("turned as the payload's frame"),
        }
    }
}

/// Says which joints were locked at zero, without a remedy.
pub fn locked_at_zero(joints: &[String]) -> String {
    let (verb, them) = if joints.len() == 1 { ("is", "it") } else { ("are", "them") };
    format!("{} {verb} locked at zero: the recording has no column of {them}", joints.join(", "))
}

/// Says why a tool that a link holds changes nothing.
pub fn tool(link: &str) -> String {
    format!(
        "what {link} holds is one body with it, and {link}'s base parameters are those of both. It has no \
         nominal model, so that it is not among the full parameters and not written: they count it to \
         {link}. Identify without the tool, too, and take the difference"
    )
}

/// Says what an answer about a payload is about, up to what controllers that want all beyond the flange need.
pub fn payload(link: &str, without: &str) -> String {
    format!(
        "payload: what {link} carries beyond {without}; friction and offsets are each run's own. Controllers \
         that want all beyond the flange"
    )
}
