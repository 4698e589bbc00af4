//! Why a platform is not driven, or its way broke off.

use std::path::PathBuf;

use hexapod::MotionError;
use hexapod::experiment::SHORTEST_S;
use rigident_device::platform::PlatformError;
use rigident_device::platform::check::words;
use rigident_device::session::SessionError;
use rigident_plan::carried::CarriedError;
use rigident_plan::machine::MachineError;
use rigident_plan::plan_file::PlanFileError;
use rigident_plan::ranges::RangeError;

/// Why a platform is not driven. Where it has not moved, the text says so.
#[derive(Debug, thiserror::Error)]
pub enum DrivingError {
    /// A bound that is no positive number.
    #[error("`{option}` {value}: a positive number")]
    Number {
        /// Its name.
        option: &'static str,
        /// Its value.
        value: f64,
    },
    /// A share of the speed that is none.
    #[error("`slow` {0}: a share of the program's speed, from 0.01 to 1, as 0.1")]
    Slow(f64),
    /// A goal that is none.
    #[error("`until_relative` {0}: a share of the largest principal moment, between 0 and 1, as 0.01")]
    UntilRelative(f64),
    /// A time that is none.
    #[error("`at_most_s` {0}: a positive number of seconds")]
    AtMost(f64),
    /// Nothing that could be decided on.
    #[error(
        "`adaptive`: no motion about home keeps the platform's limits; `workspace()` shows where it can go"
    )]
    NoChoice,
    /// The machine of a rig file.
    #[error("{}: {error}\nNothing was moved.", rig.display())]
    Machine {
        /// The rig file.
        rig: PathBuf,
        /// What it lacks.
        error: MachineError,
    },
    /// The place of the load cell, or of the IMU.
    #[error(transparent)]
    Place(#[from] MachineError),
    /// A machine of which nothing is known.
    #[error(
        "{} does not say which machine is at {address}: its [platform] must give base_joints_m, \
         plate_joints_m and leg_length_m, or travel_m and travel_rad where joints are not published, so that \
         its limits can be checked before anything moves.\nNothing was moved.",
        rig.display()
    )]
    NotDescribed {
        /// The rig file.
        rig: PathBuf,
        /// The platform's address.
        address: String,
    },
    /// The body that is carried.
    #[error("{0}.\nNothing was moved.")]
    Carried(#[from] CarriedError),
    /// A plan for a body that the bounds do not allow.
    #[error(
        "the plan was made for {kg:.2} kg with their centre of mass {away_m:.3} m from the load cell's \
         origin, and the rig file allows {most_kg:.2} kg within {within_m} m: one of them is wrong.\nNothing \
         was moved."
    )]
    OtherBody {
        /// Mass, kg.
        kg: f64,
        /// Distance of its centre of mass, m.
        away_m: f64,
        /// The heaviest, kg.
        most_kg: f64,
        /// The largest distance, m.
        within_m: f64,
    },
    /// The platform refuses, or does not answer; it has not moved.
    #[error("{0}\nNothing was moved.")]
    Unmoved(PlatformError),
    /// A program beyond the machine's limits.
    #[error(
        "{error}{}\nNothing was moved.",
        if *is_built_in {
            "\nIt is the built-in experiment: make one for this machine by `plan_motion(rig)`, and give it \
             by `plan`."
        } else {
            ""
        }
    )]
    Beyond {
        /// The limit.
        error: PlatformError,
        /// True of the program that is driven where none is given.
        is_built_in: bool,
    },
    /// A program that is none.
    #[error(transparent)]
    Program(#[from] MotionError),
    /// Led to rest, legs or the load cell would be loaded too much.
    #[error(
        "led to rest in {stop_s} s from t = {time_s:.2} s, as every planned end may do, {what}: use a \
         smaller or slower motion (`slow`).\nNothing was moved."
    )]
    Led {
        /// Length of the stop, s.
        stop_s: f64,
        /// Its beginning, s.
        time_s: f64,
        /// What happens in it.
        what: String,
    },
    /// The ranges of the sensors.
    #[error("{0}.\nNothing was moved.")]
    Range(#[from] RangeError),
    /// The sensors send next to nothing.
    #[error("the sensors send nothing: check their supply and wiring (`info()` shows the counters)")]
    Silent,
    /// The second link's IMU sends nothing.
    #[error("the second link's IMU sends nothing: check its supply and wiring")]
    SecondSilent,
    /// The plate moves; the evidence.
    #[error(
        "the plate does not come to rest: {0}. The gyro's zero and the noise are measured at rest: is \
         another program moving the platform, or is something shaking it?\nNothing was moved."
    )]
    Moves(String),
    /// The second link moves; the evidence.
    #[error(
        "the second link does not hang still: {0}. Its gyro's zero is measured at rest, and its attitude at \
         the start is initial_wxyz of its [[link]].\nNothing was moved."
    )]
    SecondMoves(String),
    /// The plate is tilted otherwise than the platform says.
    #[error(
        "the plate is tilted by {degrees:.0} degrees {against}: bring it there first. If it is there, the \
         base is not level, the controller levels it by a coordinate system, or the rotations of [[imu]] or \
         [platform.load_cell] in the rig file are wrong. A platform on a wall or a ceiling is not driven: \
         its forces are others.\nNothing was moved."
    )]
    Tilted {
        /// The angle, degrees.
        degrees: f64,
        /// The attitude that it is compared with, in words.
        against: String,
    },
    /// Somebody has been at the platform; the evidence.
    #[error(
        "since the zero was taken, {0}: somebody, or something, is at the platform. Run again when nobody \
         is.\nNothing was moved."
    )]
    Touched(String),
    /// The plate was moved while its way was shown.
    #[error(
        "the plate was at {} when its way was shown, and is at {}: another program, or its own panel, has \
         moved it. Run again.\nNothing was moved.",
        words(shown),
        words(now)
    )]
    MovedMeanwhile {
        /// The pose that was shown.
        shown: hexapod::Pose,
        /// The pose now.
        now: hexapod::Pose,
    },
    /// The device.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Stopped before the experiment.
    #[error("stopped before the experiment began; nothing was moved")]
    Stopped,
    /// The device saw something on the way to the first pose.
    #[error(
        "on the way to the first pose: {error}.\nThe platform was stopped; nothing was recorded, {kept}."
    )]
    Way {
        /// What it saw.
        error: SessionError,
        /// Where the trace is, in words.
        kept: String,
    },
    /// Stopped on the way to the first pose.
    #[error("stopped on the way to the first pose; nothing was recorded, {0}")]
    StoppedOnTheWay(String),
    /// The platform did not come to the first pose.
    #[error("{error}\nNothing was recorded; {kept}.")]
    NotThere {
        /// What it says.
        error: PlatformError,
        /// Where the trace is, in words.
        kept: String,
    },
    /// Nobody agreed; the reason.
    #[error("{0}")]
    NotAgreed(String),
    /// Somebody stopped it before it moved; how.
    #[error("{0}")]
    StoppedBefore(String),
    /// A file of the run.
    #[error("{}: {error}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why it cannot be made.
        error: std::io::Error,
    },
    /// An option of a single body's; its name.
    #[error("`{0}`: for a single body only, not for a tree of links")]
    OneBody(&'static str),
    /// A length of the built-in experiment.
    #[error(
        "`duration_s` {0}: the five poses and the motion take {SHORTEST_S} s at least, and 3600 s are enough"
    )]
    Duration(f64),
    /// The plan's file.
    #[error(transparent)]
    Plan(#[from] PlanFileError),
}

impl DrivingError {
    /// Returns true where a link, a sensor or a machine failed, rather than what was asked for.
    pub fn is_of_the_link(&self) -> bool {
        match self {
            Self::Unmoved(error) => !matches!(
                error,
                PlatformError::Address { .. } | PlatformError::Motion(_) | PlatformError::TooLong { .. }
            ),
            Self::Silent
            | Self::SecondSilent
            | Self::Moves(_)
            | Self::SecondMoves(_)
            | Self::Tilted { .. }
            | Self::Touched(_)
            | Self::MovedMeanwhile { .. }
            | Self::Session(_)
            | Self::Way { .. }
            | Self::NotThere { .. } => true,
            _ => false,
        }
    }

    /// Returns true where the user stopped it.
    pub fn is_stopped(&self) -> bool {
        matches!(self, Self::Stopped | Self::StoppedOnTheWay(_) | Self::StoppedBefore(_))
    }
}
