//! How an experiment went.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An experiment that decides for itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExperimentSummary {
    /// Seconds of the rig from the first reading to the last.
    pub rig_s: f64,
    /// What was asked for, in words.
    pub goal: String,
    /// True if it was reached.
    pub reached: bool,
    /// The worst 95 % uncertainty over what was asked for; absent while it is not known what that is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_ratio: Option<f64>,
    /// What was said last that can be reached in the time there is, over what was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_ratio: Option<f64>,
    /// The same as the 95 % uncertainty of the worst element of the tensors, kg m², while the moment of which
    /// a share was asked for is not known well enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_moment_u95_kgm2: Option<f64>,
    /// The segments, in their order.
    pub decisions: Vec<SegmentSummary>,
}

/// A segment that was decided on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SegmentSummary {
    /// Its beginning, from the first reading, s.
    pub begun_s: f64,
    /// Its duration, s; absent if its end was not seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lasted_s: Option<f64>,
    /// Its name.
    pub name: String,
    /// The parameter that was furthest off before it.
    pub furthest: String,
    /// The worst uncertainty over what is asked for, before it; absent while it is infinite.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<f64>,
    /// The same as expected at its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<f64>,
    /// The same at its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached: Option<f64>,
}

/// The tracking error of a platform: measured less commanded pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tracking {
    /// Samples of the measured motion.
    pub samples: u64,
    /// Root mean square of the position's error, x, y, z of A, m.
    pub rms_m: [f64; 3],
    /// Root mean square of the attitude's error, as rotations about x, y, z of A, rad.
    pub rms_rad: [f64; 3],
    /// Largest distance, m.
    pub largest_m: f64,
    /// Largest angle, rad.
    pub largest_rad: f64,
    /// Delay of the platform that makes the errors smallest, s.
    pub delay_s: f64,
    /// Root mean square of the position's error with this delay taken off, m.
    pub rms_without_delay_m: [f64; 3],
    /// Root mean square of the attitude's error with this delay taken off, rad.
    pub rms_without_delay_rad: [f64; 3],
}
