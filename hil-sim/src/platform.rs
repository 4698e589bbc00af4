//! The Stewart platform: where the plate is, how it moves, and whether its six legs can follow.
//!
//! Lives here: [`Geometry`] (joints and legs), [`MotionProgram`] (what was asked for) and [`Trajectory`] (its exact
//! kinematics). May not live here: masses and sensors. Next: [`crate::body`].
//!
//! Frames: A is the base's frame, z up; P is the plate's. Attitudes are roll, pitch, yaw about fixed axes,
//! `R_AP = Rz(yaw) Ry(pitch) Rx(roll)`.

mod geometry;
mod kinematics;
mod program;

pub use geometry::Geometry;
pub use kinematics::{Coordinates, PlateState};
pub(crate) use program::quintic_integral;
pub use program::{Axis, MotionProgram, Segment, SineTerm, Trajectory};

use serde::{Deserialize, Serialize};

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
    pub(crate) fn coordinates(&self) -> [f64; 6] {
        let [x, y, z] = self.position_m;
        let [roll, pitch, yaw] = self.rpy_rad;
        [x, y, z, roll, pitch, yaw]
    }

    /// `R_AP`, by rows.
    pub fn rotation(&self) -> [[f64; 3]; 3] {
        let r = kinematics::rotation_from_rpy(self.rpy_rad);
        std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]))
    }

    pub(crate) fn from_coordinates([x, y, z, roll, pitch, yaw]: [f64; 6]) -> Self {
        Self { position_m: [x, y, z], rpy_rad: [roll, pitch, yaw] }
    }
}

/// Why a motion cannot be driven.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// A leg would be too short or too long. Legs are counted from 1.
    #[error(
        "leg {leg} would be {length_m:.4} m long at t = {time_s:.3} s, it reaches from {min_m:.4} m to {max_m:.4} m: \
         use smaller tilts or translations"
    )]
    LegLength {
        /// 1 to 6.
        leg: usize,
        /// Time in the program, s.
        time_s: f64,
        /// Length asked for, m.
        length_m: f64,
        /// Shortest possible, m.
        min_m: f64,
        /// Longest possible, m.
        max_m: f64,
    },
    /// A leg would have to move too fast.
    #[error(
        "leg {leg} would move at {rate_mps:.3} m/s at t = {time_s:.3} s, its limit is {limit_mps:.3} m/s: give the \
         motion more time"
    )]
    LegRate {
        /// 1 to 6.
        leg: usize,
        /// Time in the program, s.
        time_s: f64,
        /// Speed asked for, m/s, positive when the leg extends.
        rate_mps: f64,
        /// The limit, m/s.
        limit_mps: f64,
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
