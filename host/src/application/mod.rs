//! The jobs of Rigident as plain functions: typed options in, typed answers out; nothing is printed, and no
//! process ends.
//!
//! [`identify`] goes from a recording to an answer, [`see_streams`] looks at several clocks,
//! [`factor`](factor()) to all that a recording says of its body, [`merge`] joins factors, [`solve`] answers
//! by one, [`predict`](predict()) computes what a model says of a recording, [`body`](body()) goes from
//! trials to a person's segments. [`replay`](replay()) has the firmware identify a recording, [`Live`]
//! identifies sensors as they run, [`watch`](watch()) has the firmware find what changes of a link.
//! [`vibration`] has platforms on springs, [`robot`] masses and joint offsets of robots, [`sensors`] IMU and
//! load cell, [`ReferenceRuns`] a rig calibrated and verified by a reference body, [`statics`](statics())
//! still poses, [`summary`](summary()) several results. The command line and Python call these functions, so
//! that their numbers are the same to the last bit. Whoever calls shows progress, may stop the work and words
//! remedies: [`Caller`]. Why there is no answer is an [`Error`].
//!
//! ```
//! use rigident::application::{Caller, IdentifyOptions, identify};
//!
//! let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/bracket.csv");
//! let found = identify(bracket.into(), &IdentifyOptions::default(), &Caller::default())?;
//! assert!((found.answer.mass_kg.unwrap() - 3.2).abs() < 0.03);
//! # Ok::<(), rigident::application::Error>(())
//! ```
//!
//! Lives here: what a job takes and in which order it is done. May not live here: words of options, printing,
//! exit statuses; and mathematics, which is in the rooms below.

pub mod bare_platform;
pub mod body;
mod body_error;
mod calibrate_error;
mod calibration;
mod caller;
mod covariance;
pub mod device;
mod device_error;
mod drift;
mod drive_gains;
mod drive_gains_error;
pub mod driving;
mod driving_error;
mod error;
pub mod experiment;
pub mod factor;
mod identify;
pub mod live;
mod live_error;
pub mod loaded;
mod locked_joints;
mod merge;
pub mod monitor;
mod motion_plots;
mod next_move;
pub mod notice;
pub mod payload;
mod plan_error;
pub mod planning;
pub mod predict;
pub mod recorded;
pub mod reference;
pub mod replay;
pub mod report;
pub mod robot;
pub mod sensors;
mod solve;
pub mod span;
pub mod statics;
mod streams_seen;
pub mod summary;
pub mod tare;
pub mod tree;
pub mod vibration;
mod vibration_error;
pub mod watch;
mod watch_error;
mod written_model;

pub use body::{BodyOptions, IdentifiedPerson, body};
pub use body_error::{BodyError, BodyOption};
pub use calibrate_error::CalibrateError;
pub use calibration::calibrate;
pub use caller::Caller;
pub use covariance::Covariance;
pub use device_error::DeviceError;
pub use drive_gains::{DriveGain, DriveGainOptions, DriveGains, drive_gains};
pub use drive_gains_error::DriveGainsError;
pub use driving_error::DrivingError;
pub use error::{Error, ListingError, TreeOption};
pub use experiment::{Concluded, Course, Experiment};
pub use factor::{FactorOptions, Reduced, factor};
pub use identify::{IdentifyOptions, identify};
pub use live::{Live, LiveOptions};
pub use live_error::LiveError;
pub use loaded::Loaded;
pub use merge::{Merged, agreement, merge, merge_files};
pub use next_move::NextMove;
pub use notice::Notice;
pub use payload::{Load, write_loads};
pub use plan_error::PlanError;
pub use planning::{
    ComparedMotions, MotionOptions, PlannedMotion, PlannedPoses, PoseObjective, PoseOptions, compare_motions,
    plan_motion, plan_poses,
};
pub use predict::{PredictOptions, Predicted, predict};
pub use recorded::Recorded;
pub use reference::{ReferenceOptions, ReferenceRuns};
pub use replay::{Connected, Replay, ReplayOptions, replay};
pub use report::{Identified, Report};
pub use robot::joints::{JointOptions, joint_offsets};
pub use robot::mass_options::{ExternalWrench, MassOptions};
pub use robot::masses::masses;
pub use sensors::imu::DrivenImu;
pub use sensors::load_cell::{LoadCellOptions, load_cell};
pub use solve::{SolveOptions, solve};
pub use statics::{StaticsOptions, statics};
pub use streams_seen::{StreamClock, StreamCurve, StreamSeen, StreamsSeen, see_streams};
pub use summary::summary;
pub use tare::Fixture;
pub use tree::{Changes, Tree};
pub use vibration::identify::{VibrationOptions, vibration_identify, vibration_of, vibration_recording};
#[cfg(feature = "simulator")]
pub use vibration::paper::vibration_paper;
pub use vibration::postures::vibration_postures;
pub use vibration::stiffness::{StiffnessOptions, vibration_stiffness};
pub use vibration_error::VibrationError;
pub use watch::{WatchOptions, WatchedLink, watch};
pub use watch_error::WatchError;
pub use written_model::WrittenModel;
