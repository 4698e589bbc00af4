//! Why motions are refused.

use super::limits::Violation;
use super::program::LONGEST_S;

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
