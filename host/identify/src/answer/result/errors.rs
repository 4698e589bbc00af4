//! Errors of sensors and mounting, and what uncertainties are made of.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A scale or a sign that the recording does not show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reliance {
    /// The scale or sign.
    pub what: String,
    /// What it does to the answer, ∝ for what is proportional to it.
    pub effect: String,
    /// Expanded uncertainty of it that the intervals count, %; none if they count nothing of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub u95_percent: Option<f64>,
    /// What that is known by: a key of the rig file, a class, a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub basis: Option<String>,
}

/// An error of sensors or mounting.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RigError {
    /// Its name: `lever_arm_x`.
    pub name: String,
    /// The errors that it is one of: `lever arm`.
    pub group: String,
    /// Unit in ASCII.
    pub unit: String,
    /// Estimate, what was known beforehand included.
    pub value: f64,
    /// Its 95 % expanded uncertainty.
    pub u95: f64,
    /// Value beforehand: zero unless a calibration of the rig says otherwise.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub expected: f64,
    /// Standard deviation beforehand, about that.
    pub sigma: f64,
    /// The key of the rig file, class of data sheets or calibration that this is from.
    pub basis: String,
    /// True if the rig file or a calibration states it; else it is a default.
    pub stated: bool,
    /// Share of the variance beforehand that the recording has taken away.
    #[serde(alias = "told")]
    pub learned: f64,
    /// The estimate in the standard deviations that it would have if it were drawn as stated; absent where
    /// the recording says nothing of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pull: Option<f64>,
}

/// How the errors found agree with what was known of them beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ErrorsAgreement {
    /// χ² of the errors found against what was known beforehand.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: f64,
    /// Probability that errors drawn as stated agree no better.
    pub probability: f64,
}

/// Noise of a group of signals that the rows are made of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SignalNoise {
    /// Sensor or group.
    pub name: String,
    /// Unit of σ in ASCII.
    pub unit: String,
    /// 1 σ per sample that rows were weighed by.
    pub sigma: f64,
    /// True if the rig file states it.
    pub stated: bool,
}

/// What the uncertainty of a quantity is made of.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Budget {
    /// The quantity: `m`, `com_x`, `Ixx_com`, or a parameter's name.
    pub quantity: String,
    /// Unit in ASCII.
    pub unit: String,
    /// Combined standard uncertainty.
    pub sd: f64,
    /// Contributions, the largest first.
    pub contributions: Vec<Contribution>,
}

/// Contribution of a source to an uncertainty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Contribution {
    /// The source: `noise`, or a group of errors.
    pub source: String,
    /// Standard uncertainty that it brings, in the unit of the quantity.
    pub sd: f64,
    /// Share of the variance.
    pub share: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
