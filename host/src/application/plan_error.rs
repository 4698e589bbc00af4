//! Why there is no plan.

use hexapod::{MotionError, StrokeError};
use rigident_plan::machine::MachineError;
use rigident_plan::motion::PlanError as MotionPlanError;
use rigident_plan::poses::RegionError;
use rigident_plan::poses::plan::{MOST_ORIENTATIONS, PlanError as PosePlanError};

/// Why there is no plan of poses, or of a motion.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// A pose is held for no time, or for too long.
    #[error("`hold_s` {0}: more than 0 s, and 600 s at most")]
    Hold(f64),
    /// The number of poses that are given.
    #[error(
        "`angles`: {n} poses; {fewest} at least (fewer leave a part of the centre of mass open), \
         {MOST_ORIENTATIONS} at most"
    )]
    Count {
        /// Given.
        n: usize,
        /// The fewest.
        fewest: usize,
    },
    /// Poses that are given.
    #[error("`angles`: {0}")]
    Angles(PosePlanError),
    /// The number, from 1, of a pose that the platform cannot hold.
    #[error("`angles`: the platform cannot hold pose {0}; nothing was written")]
    CannotHold(usize),
    /// A share of the stroke that is none.
    #[error("`reserve` {0}: a share of the stroke from 0 to less than 1, as 0.05")]
    Reserve(f64),
    /// A stroke of legs of which nothing is known.
    #[error("`stroke_m` is the stroke of legs, of which the rig file says nothing")]
    Stroke,
    /// A stroke that the legs do not have.
    #[error(transparent)]
    NoStroke(#[from] StrokeError),
    /// A frequency for a motion that has its own.
    #[error("`highest_hz` goes with `objective` d-optimal: the other motions have frequencies of their own")]
    HighestHz,
    /// The platform of a rig file.
    #[error("{rig}: {error}")]
    Machine {
        /// The rig file.
        rig: String,
        /// What it lacks.
        error: MachineError,
    },
    /// The platform cannot be used so.
    #[error(transparent)]
    Region(#[from] RegionError),
    /// The platform cannot do it.
    #[error(transparent)]
    Platform(#[from] MotionError),
    /// Poses.
    #[error(transparent)]
    Poses(#[from] PosePlanError),
    /// A motion.
    #[error(transparent)]
    Motion(#[from] MotionPlanError),
}
