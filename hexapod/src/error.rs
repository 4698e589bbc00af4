//! The reasons for which motions are refused.

use super::limits::Violation;
use super::program::LONGEST_S;

/// The reason why a motion cannot be driven.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// A limit of the platform is violated.
    #[error("{violation} at t = {time_s:.3} s: {}", .violation.advice())]
    Limit {
        /// The limit, the leg and the distance.
        violation: Violation,
        /// Time in the program, s.
        time_s: f64,
    },
    /// It cannot be shown in reasonable time that the limits are met.
    #[error(
        "the motion is too quick for its limits to be checked over its whole length, at t = {time_s:.3} s: \
         use lower frequencies or a shorter motion"
    )]
    TooQuickToCheck {
        /// The time up to which the check proceeded, s.
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
        /// The fault in it.
        reason: &'static str,
    },
}
