//! The reasons why the platform does not follow its command.

use hexapod::MotionError;

use super::gcs::words;

/// The reason why the platform does not follow its command.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlatformError {
    /// An address that names no platform.
    #[error("{address} names no platform ({reason}): {HOW}")]
    Address {
        /// The address given.
        address: String,
        /// The fault in it.
        reason: String,
    },
    /// Nobody answers.
    #[error("the platform at {address} does not answer ({reason}): is its controller on, the address right?")]
    Unreachable {
        /// The address where it should be.
        address: String,
        /// The message of the network.
        reason: String,
    },
    /// The platform answered before and does so no more.
    #[error(
        "the platform at {address} was lost at the command {command} ({reason}): check its cable and supply"
    )]
    Lost {
        /// The address where it was.
        address: String,
        /// The command sent to it.
        command: String,
        /// The message of the network.
        reason: String,
    },
    /// The controller refused.
    #[error("the platform refuses: {0}")]
    Refused(String),
    /// The controller refused by a number.
    #[error("the platform's controller refuses the command {command}: error {code}, {}", words(*.code))]
    Controller {
        /// The command sent to it.
        command: String,
        /// The controller's number of the error.
        code: i32,
    },
    /// The program itself.
    #[error("the motion program is beyond the platform: {0}")]
    Motion(#[from] MotionError),
    /// The motion is not watched as it should be.
    #[error("the platform was stopped because the program that watches it said nothing for {0} s")]
    Unwatched(f64),
    /// Set points could not be sent in time.
    #[error(
        "a set point came {:.0} ms after its time, so the motion was ended: this machine or the line to the \
         platform was too busy, or asleep; use a larger lead_s",
        1e3 * .0
    )]
    Late(f64),
    /// Nobody knows where the plate is.
    #[error("{0}")]
    Unseen(String),
    /// The platform stopped before the end, and not by this program's command.
    #[error(
        "the platform stopped after {at_s:.1} of {of_s:.1} s, and not by a command from here: is another \
         program connected to it, or was it not heard from here?"
    )]
    Cut {
        /// The time, s since the start.
        at_s: f64,
        /// The duration of the program, s.
        of_s: f64,
    },
    /// More than the controller takes.
    #[error(
        "the plan is {bytes} bytes as the platform's controller gets it, and it takes {most}: make a plan of \
         fewer segments"
    )]
    TooLong {
        /// Bytes of the command.
        bytes: usize,
        /// The most bytes that the controller takes.
        most: usize,
    },
    /// The arm's controller has ended the motion, or lets it not begin.
    #[error("the arm does not move: {0}")]
    Halted(String),
    /// Ended by the user.
    #[error("stopped by Ctrl-C")]
    Interrupted,
}

/// The form of addresses.
const HOW: &str = "an address looks like tcp://HOST:PORT (rigident-sim), gcs://HOST:PORT or \
                   gcs:///dev/ttyUSB0 (PI hexapods), ur://HOST (arms of Universal Robots), \
                   pose+tcp://HOST:PORT, legs+udp://HOST:PORT or \
                   pose+serial:///dev/ttyUSB0 (CSV lines), with ?rate_hz=100, &lead_s=0.2, &follows=time and \
                   &baud=115200 where they apply";
