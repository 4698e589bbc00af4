//! Mechanics of Stewart platforms.
//!
//! Lives here: a platform's [`Geometry`] (joints, legs, limits), [`Legs`] (vector loop, Jacobian, force transmission at one
//! pose), [`Geometry::forward`], [`LimitMargins`] (every limited quantity beside its limit), [`Guarantee`] (the same of a whole
//! motion), [`Load`] (leg forces) with the bodies that it is made of, [`MotionProgram`] (what is asked of a platform) and
//! [`Trajectory`] (its exact kinematics), and the default [`experiment`]. Drivers of real platforms, planning and the simulator
//! use it alike. May not live here: sensors, planning, connections, or anything of the estimator's: the simulator's physics,
//! which the estimator is tested against, stands on this crate.
//!
//! Frames: A is the base's frame, z up; P is the plate's. Attitudes are roll, pitch, yaw about fixed axes,
//! `R_AP = Rz(yaw) Ry(pitch) Rx(roll)`.

mod body;
mod check;
pub mod experiment;
mod forward;
mod geometry;
mod guarantee;
mod kinematics;
mod legs;
mod limits;
mod load;
mod mounting;
mod program;
mod sphere;
mod trajectory;

pub use body::{BodyParameters, FrameMotion};
pub use forward::ForwardError;
pub use geometry::{Geometry, StrokeError};
pub use guarantee::{Guarantee, Peak};
pub use kinematics::{Coordinates, PlateState, rotation_from_rpy};
pub use legs::Legs;
pub use limits::{COND_MAX, JointCones, Limit, LimitMargins, Limits, Margin, Violation};
pub use load::{Bodies, Load};
pub use mounting::Mounting;
pub use program::{Axis, MotionProgram, Segment, SineTerm};
pub use sphere::Sphere;
pub use trajectory::{LONGEST_S, Trajectory, quintic_integral};

use serde::{Deserialize, Serialize};

/// Standard gravity, m/s².
pub const STANDARD_GRAVITY_MPS2: f64 = 9.80665;

/// Position and attitude of the plate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin of the plate's frame in A, m.
    pub position_m: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes of A, rad.
    pub rpy_rad: [f64; 3],
}

impl Pose {
    /// The six coordinates x, y, z, roll, pitch, yaw.
    pub fn coordinates(&self) -> [f64; 6] {
        let [x, y, z] = self.position_m;
        let [roll, pitch, yaw] = self.rpy_rad;
        [x, y, z, roll, pitch, yaw]
    }

    /// `R_AP`, by rows.
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        let r = kinematics::rotation_from_rpy(self.rpy_rad);
        std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]))
    }

    /// The pose of these six coordinates.
    pub fn from_coordinates([x, y, z, roll, pitch, yaw]: [f64; 6]) -> Self {
        Self { position_m: [x, y, z], rpy_rad: [roll, pitch, yaw] }
    }
}

/// Why a motion cannot be driven.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// A limit of the platform is not kept.
    #[error("{violation} at t = {time_s:.3} s: {}", .violation.advice())]
    Limit {
        /// Which limit, which leg, how far.
        violation: Violation,
        /// Time in the program, s.
        time_s: f64,
    },
    /// It cannot be shown in reasonable time that the limits are kept.
    #[error(
        "the motion is too quick for its limits to be checked over its whole length, at t = {time_s:.3} s: use lower \
         frequencies or a shorter motion"
    )]
    TooQuickToCheck {
        /// How far the check came, s.
        time_s: f64,
    },
    /// Longer than a day.
    #[error("the motion program takes {duration_s:e} s, {LONGEST_S} s are the most")]
    TooLong {
        /// s.
        duration_s: f64,
    },
    /// A segment makes no sense by itself. Segments are counted from 1.
    #[error("segment {segment} of the motion program: {reason}")]
    BadSegment {
        /// 1 for the first; 0 for the start pose.
        segment: usize,
        /// What is wrong with it.
        reason: &'static str,
    },
}

#[cfg(test)]
mod mechanics_tests;
