//! What is wrong with a recording: a fault, changes, drift, what is not rigid.

use rigident_fit::Measured;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A fault that explains why a recording cannot be true.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cause {
    /// The fault in words.
    pub what: String,
    /// What to do about it.
    #[serde(alias = "mend")]
    pub remedy: String,
    /// True if the recording can be true without this fault, and without no other one. Else it only leaves
    /// much less unexplained, or is one of several.
    pub confirmed: bool,
    /// True if the recording can be true without any one of several faults, this and `alternatives`: it does
    /// not tell which.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub ambiguous: bool,
    /// Residuals without it over those with it, geometric mean of the channels.
    pub residuals_left: f64,
    /// Other faults that explain as much.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<String>,
}

/// Change of the mean wrench between the first pose and its repetition.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Drift {
    /// Time between the two poses, s.
    pub elapsed_s: f64,
    /// Last less first, channel by channel, with its 95 % uncertainty.
    pub changes: Vec<DriftChange>,
}

/// Change of one channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct DriftChange {
    /// Name of the channel.
    pub channel: String,
    /// Its SI unit.
    pub unit: String,
    /// Last less first, and its 95 % uncertainty; absent if it was not measured.
    #[serde(flatten)]
    pub change: Option<Measured>,
}

/// A change at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Change {
    /// Time from the beginning of the recording, s, with its 95 % uncertainty.
    pub time_s: Measured,
    /// The thing that changed.
    pub changed: Changed,
    /// Probability, at most, that an honest recording shows as much anywhere.
    pub probability: f64,
    /// Parameters that changed beyond their uncertainty, the most certain first.
    pub steps: Vec<ParameterStep>,
}

/// The thing that changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Changed {
    /// What is identified: something loosened, was added or lost.
    Body,
    /// The offset of a channel: the load cell, or what it is bolted to.
    Offset,
    /// One or the other: the motion does not tell.
    Either,
}

/// Change of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ParameterStep {
    /// Name of the parameter.
    pub name: String,
    /// Its SI unit in ASCII.
    pub unit: String,
    /// After less before, with its 95 % uncertainty.
    #[serde(flatten)]
    pub step: Measured,
}

/// Something that moves within what should be rigid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NotRigid {
    /// The motion that explains the residuals best.
    pub motion: WithinMotion,
    /// Lowest and highest natural frequency that explain the residuals of a resonance, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<[f64; 2]>,
    /// Number of bursts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bursts: Option<u64>,
    /// Probability, at most, that an honest recording shows as much.
    pub probability: f64,
}

/// The motion that explains the residuals of what is not rigid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WithinMotion {
    /// A part swings: an elastic mount, liquid, a load that hangs.
    Resonance,
    /// Something pulls as the body turns: a cable, a hose.
    Spring,
    /// Bursts of noise: something rattles or knocks.
    Bursts,
}

/// Drift of one channel from still pose to still pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PoseDrift {
    /// Name of the channel.
    pub channel: String,
    /// Probability that a line and a curve over the poses explain as much by chance (F-test).
    pub probability: f64,
    /// Correlation of the residuals from pose to pose.
    pub correlation: f64,
    /// Probability of so much correlation by chance.
    pub correlation_probability: f64,
}
