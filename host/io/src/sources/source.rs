//! The samples of a source with the time of its own clock, and what was lost of them.

use std::fmt;
use std::time::Duration;

use crate::recording::columns::Group;

/// Tells what a source is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// The wrench.
    Wrench,
    /// Accelerometer and gyro.
    Imu,
    /// The pose of what the load cell sits on.
    Pose,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wrench => "wrench",
            Self::Imu => "imu",
            Self::Pose => "pose",
        })
    }
}

/// Holds one sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The time of it by the source's own clock, ns after that clock's zero; `None` if the source does not
    /// say.
    pub time_ns: Option<i64>,
    /// The columns of the source's groups, in their order, SI units.
    pub values: Vec<f64>,
}

/// Tells what kind of clock the times of a source are of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OwnClock {
    /// None: the time of arrival is all there is.
    Arrival,
    /// A clock that counts seconds; sources with the same name share it.
    Seconds(String),
    /// A count of samples whose rate is not known.
    Counts,
}

/// Counts what did not come, or was of no use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Samples that never arrived, by their sequence numbers.
    pub lost: u64,
    /// Samples that arrived twice, or after later ones.
    pub late: u64,
    /// Pieces that are no samples: a wrong check sum, a cut line, a number that is none.
    pub damaged: u64,
    /// Pieces from others than the sender that was first, or that was asked for.
    pub others: u64,
    /// Samples that the sensor itself says are wrong.
    pub faulty: u64,
    /// The status that the sensor gave of the last of these.
    pub status: Option<u32>,
}

/// Says why a source brings nothing, in words that say what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SourceError {
    /// The address.
    #[error("{url}: {reason}")]
    Url {
        /// The address as given.
        url: String,
        /// The fault in it, and how it is to be.
        reason: String,
    },
    /// Nobody is there.
    #[error("{url} cannot be reached: {reason}")]
    Unreachable {
        /// The address as given.
        url: String,
        /// The message of the system, and what to check.
        reason: String,
    },
    /// Somebody is there and says something else.
    #[error("{url}: {reason}")]
    Protocol {
        /// The address as given.
        url: String,
        /// The message, and the advice.
        reason: String,
    },
    /// The source has come to its end, as a file does.
    #[error("{0} has ended")]
    Ended(String),
}

/// Brings a stream of samples.
pub trait Source: Send {
    /// Returns the groups of columns that every sample has.
    fn groups(&self) -> &[Group];

    /// Returns what its times are of.
    fn clock(&self) -> OwnClock;

    /// Waits up to the given time for samples, and appends what arrived.
    ///
    /// # Errors
    /// [`SourceError`] ends the stream.
    fn read(&mut self, timeout: Duration, rows: &mut Vec<Row>) -> Result<(), SourceError>;

    /// Returns what has been lost until now.
    fn losses(&self) -> Losses;

    /// Says in words what to check if it falls silent.
    fn when_silent(&self) -> String;
}
