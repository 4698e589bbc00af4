//! The recording that the answer is of: its origin, its channels and counts, its files.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::parameters::ParameterState;

/// A run that only a factor is left of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// Name of its recording.
    pub recording: String,
    /// What the checks found when the factor was made.
    pub verdict: RunVerdict,
}

/// What the checks of a recording found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RunVerdict {
    /// Nothing against it.
    Plausible,
    /// It contradicts what is stated of the rig, or is not that of an unchanging rigid body.
    Implausible,
    /// The factor carries no checks.
    NotChecked,
}

/// The origin of the numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Source {
    /// Name of the recording, or of several that were merged.
    pub recording: String,
    /// Date and time of the recording, RFC 3339; absent where it states none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded: Option<String>,
    /// Samples of the recording.
    pub rows: u64,
    /// Their rate, 1/s; absent for still poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Length of the recording, s; absent for still poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// The estimator that ran: `inproc`, `qemu` or a port for firmware, `host` for the program itself.
    pub mcu: String,
}

/// The model that a tree was identified by.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelSummary {
    /// Its name.
    pub name: String,
    /// What was measured, on what kind of base, as a sentence.
    pub situation: String,
    /// Number of base parameters that rows of this kind can tell apart.
    pub base_parameters: u64,
    /// Number of standard parameters of its links.
    pub standard_parameters: u64,
}

/// What an answer rests on where older rows are forgotten.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Forgotten {
    /// `exponential` (with a time constant) or `window` (nothing before it counts).
    pub kind: ForgettingKind,
    /// The time constant, or the window's length, s.
    pub span_s: f64,
    /// Seconds of rows that the answer rests on, older ones weighted as they count.
    pub effective_s: f64,
}

/// The way in which older rows are forgotten.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ForgettingKind {
    /// What the motion renews is forgotten with a time constant.
    Exponential,
    /// Only the last rows count.
    Window,
}

/// A measured quantity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Channel {
    /// Its name: `fx`, or a joint's.
    pub name: String,
    /// Its SI unit: `N` or `N m`.
    pub unit: String,
    /// Standard deviation of its white noise per unfiltered sample, stated or found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// True if `sigma` was stated; else it comes from the residuals.
    pub sigma_given: bool,
    /// Root mean square of the filtered residuals; absent without the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_rms: Option<f64>,
    /// Root mean square of the filtered measurements; absent without the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured_rms: Option<f64>,
    /// Relative gain error as far as it shows; absent where none was allowed for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Filtered rows that count less because an outlier spoilt them.
    pub outliers: u64,
    /// Samples rejected because of this channel.
    pub rejected: u64,
    /// Factor by which white noise's intervals would be too narrow where they rest on the residuals' slowest
    /// part alone; absent if the residuals are no more autocorrelated than the filter explains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub autocorrelation: Option<f64>,
}

/// Samples and rows counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Counts {
    /// Samples in the recording.
    pub samples: u64,
    /// Samples rejected by screening.
    pub rejected: u64,
    /// Gaps in time, at which the filter started anew.
    pub gaps: u64,
    /// Scalar rows in the factor.
    pub rows: u64,
}

/// One of several files on the common time base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StreamResult {
    /// The file as listed in the rig file.
    pub file: String,
    /// Quantities taken from it: `wrench`, `accelerometer`, …
    pub carries: Vec<String>,
    /// Its measured rate, 1/s.
    pub rate_hz: f64,
    /// Its rows.
    pub rows: usize,
    /// Rows not used: frozen or beyond the range.
    pub discarded: usize,
    /// Delay of its stamps against those of the wrench, s; absent for that one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skew_s: Option<ParameterState>,
}

/// The common time base of several files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimeBase {
    /// Its rate, 1/s.
    pub rate_hz: f64,
    /// Whole width of the kernel that every stream went through, s.
    pub kernel_width_s: f64,
    /// The streams, in the order of the rig file.
    pub streams: Vec<StreamResult>,
}
