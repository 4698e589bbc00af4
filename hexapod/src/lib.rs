//! Mechanics of Stewart platforms.
//!
//! Lives here: a platform's [`Geometry`] (joints, legs, limits), [`Legs`] (vector loop, Jacobian, force
//! transmission at one pose), [`Geometry::forward`], [`LimitMargins`] (every limited quantity beside its
//! limit), [`Guarantee`] (the same of a whole motion), an [`Arm`] that carries the plate, [`Load`] (leg
//! forces) with the bodies that it is made of, [`Payload`] (what perfect sensors on the plate read),
//! [`MotionProgram`] (what is asked of a platform) and
//! [`Trajectory`] (its exact kinematics), the default [`experiment`], and the lines that controllers take:
//! [`gcs`] (PI hexapods) and
//! [`set_points`]. Drivers of real platforms, planning and the simulator
//! use it alike. May not live here: errors of sensors, planning, connections, or anything of the estimator's:
//! the simulator's physics, which the estimator is tested against, is based on this crate.
//!
//! Frames: A is the base's frame, z up; P is the plate's. Attitudes are roll, pitch, yaw about fixed axes,
//! `R_AP = Rz(yaw) Ry(pitch) Rx(roll)`.
#![forbid(unsafe_code)]

mod arm;
mod body;
mod body_set;
mod bulk;
mod check;
mod envelope;
mod error;
pub mod experiment;
mod forward;
pub mod gcs;
mod geometry;
mod guarantee;
mod kinematics;
mod legs;
mod limits;
mod load;
mod margins;
mod mounting;
mod path;
mod payload;
mod pose;
mod program;
mod rotation;
pub mod set_points;
mod sphere;
mod trajectory;
mod travel;

pub use arm::{Arm, ArmPath, ArmPeak, Hinge, STEP_S as ARM_STEP_S};
pub use body::{BodyParameters, FrameMotion, STANDARD_GRAVITY_MPS2};
pub use body_set::BodySet;
pub use bulk::Nearest;
pub use envelope::quintic_integral;
pub use error::MotionError;
pub use forward::ForwardError;
pub use geometry::{Geometry, StrokeError};
pub use guarantee::{Guarantee, Peak};
pub use kinematics::{Coordinates, PlateState};
pub use legs::Legs;
pub use limits::{Bulk, COND_MAX, JointCones, Limit, Limits, Part, Violation};
pub use load::{Bodies, Load};
pub use margins::{LimitMargins, Margin, TravelMargins};
pub use mounting::Mounting;
pub use payload::{
    BadRotation, IdealSensors, Payload, THESIS_ACCEL_RANGE_MPS2, THESIS_GYRO_RANGE_RADPS,
    THESIS_WRENCH_NOISE_N_NM, THESIS_WRENCH_RANGE_N_NM,
};
pub use pose::Pose;
pub use program::{Axis, LONGEST_S, MotionProgram, PROGRAM_LINE_BYTES, Segment, SineTerm};
pub use rotation::rotation_from_rpy;
pub use sphere::Sphere;
pub use trajectory::Trajectory;
pub use travel::Travel;

#[cfg(test)]
mod mechanics_tests;
