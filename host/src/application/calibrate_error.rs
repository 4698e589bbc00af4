//! Why sensors, rigs and robots are not calibrated.

use rigident_identify::joint_offsets::faults::Contradiction;
use rigident_identify::load_cell::LoadCellError;
use rigident_identify::reference::{self, ReferenceError};
use rigident_plan::machine::MachineError;

/// Why a sensor, a rig or a robot is not calibrated.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// The least mass is no share.
    #[error("`least_mass` {0}: a share of the nominal mass, from 0 to less than 1")]
    LeastMass(f64),
    /// No recording of a tree; holds its name, if there is a recording.
    #[error("{}no recording of a tree of links", named(.0.as_deref()))]
    NoTree(Option<String>),
    /// Recordings of other sensors.
    #[error("{name}: has other channels than {first}: give recordings of the same sensors")]
    OtherChannels {
        /// The recording.
        name: String,
        /// The first.
        first: String,
    },
    /// Poses or contacts that cannot be used.
    #[error("{0}")]
    Poses(String),
    /// Poses that contradict each other.
    #[error("{0}")]
    PosesContradict(Contradiction),
    /// A load cell.
    #[error(transparent)]
    LoadCell(#[from] LoadCellError),
    /// The number of a board is none.
    #[error("`board_id` {0}: must be 24 hexadecimal digits, as `info()` shows under unique_id")]
    BoardId(String),
    /// Gravity that is nowhere on Earth, m/s².
    #[error("`gravity_mps2` {0}: on Earth it is between 9.76 and 9.84")]
    Gravity(f64),
    /// The platform.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// A recording without an IMU in motion.
    #[error("there are no readings of an IMU in motion: take the recording of a `run()` with an IMU")]
    NoMotion,
    /// A rig file without the place of an IMU.
    #[error("the rig file has no [[imu]] that says where the IMU is and how it is turned")]
    NoImu,
    /// A program of the platform that cannot be.
    #[error("{0}")]
    Program(String),
    /// The recording is of another program.
    #[error(
        "the IMU was not driven through this program: it leaves {:.0} % of what the gyro read and {:.0} % of \
         what the accelerometer read \
         unexplained (at most {:.0} %); give `plan` or `duration_s` of the run",
        100.0 * gyro, 100.0 * accelerometer, 100.0 * most
    )]
    OtherProgram {
        /// The share of the gyro's readings that is not explained.
        gyro: f64,
        /// The share of the accelerometer's readings that is not explained.
        accelerometer: f64,
        /// The share that may be unexplained.
        most: f64,
    },
    /// The file of a reference body.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// Mountings that are not one for each recording.
    #[error(
        "`mounting` names {asked} mountings of {recordings} recordings: give one for each, in their order, \
         or one for all"
    )]
    Mountings {
        /// Mountings.
        asked: usize,
        /// Recordings.
        recordings: usize,
    },
    /// A fixture of which not all ten parameters are known.
    #[error(
        "`tare`: the runs of the bare fixture do not determine all its ten parameters; record it in full \
         motion"
    )]
    Fixture,
    /// A recording of several links; holds its name.
    #[error("{0}: a reference is one body on a load cell")]
    NotOneBody(String),
    /// Recordings of two rigs.
    #[error("{name}: its rig file is of another rig than that of {first}: calibrate one rig at a time")]
    OtherRig {
        /// The recording.
        name: String,
        /// The first.
        first: String,
    },
    /// A recording that is given twice; holds its name.
    #[error("{0} is given twice: its readings would count twice, without knowing more")]
    Twice(String),
    /// There is nothing to calibrate by.
    #[error("there is no recording")]
    NoRecording,
    /// The rig cannot be calibrated from the recordings.
    #[error(transparent)]
    Rig(#[from] reference::CalibrateError),
}

fn named(recording: Option<&str>) -> String {
    recording.map_or_else(String::new, |name| format!("{name}: "))
}
