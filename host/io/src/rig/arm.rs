//! `[platform.arm]`: an arm that carries the plate.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A number for every joint, or one each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum OfJoints {
    /// Of every joint.
    Every(f64),
    /// Of each, from the base to the flange.
    Each([f64; 6]),
}

impl OfJoints {
    /// Returns one for each joint.
    pub fn each(&self) -> [f64; 6] {
        match self {
            Self::Every(value) => [*value; 6],
            Self::Each(values) => *values,
        }
    }
}

/// An arm of six hinges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ArmTable {
    /// File of the arm's model, beside the rig file: a URDF.
    pub model: String,
    /// The link of the model that is the plate.
    pub flange: String,
    /// Positions of the joints with the plate in its reference pose, rad, from the base to the flange.
    pub home_rad: [f64; 6],
    /// Largest accelerations of the joints, rad/s².
    pub acceleration_radps2: OfJoints,
    /// Largest rates of the joints, rad/s, where they are to be less than the model's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_radps: Option<OfJoints>,
    /// Heaviest mass at the flange, kg: sensor, adapter and body together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload_kg: Option<f64>,
}

impl ArmTable {
    /// Finds the model beside the rig file.
    pub(super) fn beside(&mut self, rig: &Path) {
        let beside = rig.parent().unwrap_or(Path::new("")).join(&self.model);
        self.model = beside.display().to_string();
    }
}
