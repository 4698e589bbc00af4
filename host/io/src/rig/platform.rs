//! `[body]`, `[platform]` and `[truth]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::arm::ArmTable;

/// `[body]`: the customer's frame, in S.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BodyTable {
    /// Name of the body.
    pub name: String,
    /// Origin in S, m.
    pub position_m: [f64; 3],
    /// Body axes to S.
    pub rotation_wxyz: [f64; 4],
}

impl Default for BodyTable {
    fn default() -> Self {
        Self { name: String::new(), position_m: [0.0; 3], rotation_wxyz: [1.0, 0.0, 0.0, 0.0] }
    }
}

/// `[platform]`: a hexapod, or an arm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlatformTable {
    /// Joints of the six legs on the base, in A, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_joints_m: Option<[[f64; 3]; 6]>,
    /// Joints of the six legs on the plate, in P, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_joints_m: Option<[[f64; 3]; 6]>,
    /// Shortest and longest leg, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_length_m: Option<[f64; 2]>,
    /// Largest rate of a leg, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_rate_mps: Option<f64>,
    /// Largest acceleration of a leg, m/s².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_acceleration_mps2: Option<f64>,
    /// Largest jerk of a leg, m/s³.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_jerk_mps3: Option<f64>,
    /// Largest force of a leg, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_force_n: Option<f64>,
    /// Largest force of a leg that pushes, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_push_n: Option<f64>,
    /// Largest force of a leg that pulls, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_pull_n: Option<f64>,
    /// Largest force of a leg that pushes, times its length squared, N m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_buckling_nm2: Option<f64>,
    /// Largest angle of a base joint from its axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_joint_angle_rad: Option<f64>,
    /// Axes of the base joints in A.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_joint_axes: Option<[[f64; 3]; 6]>,
    /// Largest angle of a plate joint from its axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_joint_angle_rad: Option<f64>,
    /// Axes of the plate joints in P.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_joint_axes: Option<[[f64; 3]; 6]>,
    /// Radius of a leg, m: collisions are looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leg_radius_m: Option<f64>,
    /// Length of a leg that belongs to its joint at either end, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_length_m: Option<f64>,
    /// Radius of the bars between any two of the plate's joints, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_radius_m: Option<f64>,
    /// Radius of the bars between any two of the base's joints, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_radius_m: Option<f64>,
    /// Least distance of their surfaces, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearance_m: Option<f64>,
    /// Largest condition number of the legs' Jacobian, lengths over four times the plate joints' r.m.s.
    /// radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cond_max: Option<f64>,
    /// Of a machine whose joints are not published: how far the plate goes along x, y, z to either side of
    /// its reference pose, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel_m: Option<[f64; 3]>,
    /// Largest roll, pitch and yaw to either side, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub travel_rad: Option<[f64; 3]>,
    /// All of that can be used at once, not only with the other axes at zero.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub travel_together: bool,
    /// Largest speed of the plate's origin, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_speed_mps: Option<f64>,
    /// Largest angular rate of the plate, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate_rate_radps: Option<f64>,
    /// The heaviest body that is ever put on the load cell, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_max_kg: Option<f64>,
    /// No part of it is farther from the load cell's origin, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_within_m: Option<f64>,
    /// Parts that the legs carry and the load cell does not measure: plate, load cell, adapter.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub part: Vec<PartTable>,
    /// The load cell's frame S on the plate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load_cell: Option<PlaceTable>,
    /// The arm whose flange is the plate; `travel_m` and `travel_rad` are the part of its reach that may be
    /// used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm: Option<ArmTable>,
}

/// `[[platform.part]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartTable {
    /// Name of the part.
    #[serde(default)]
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in P, m.
    pub com_m: [f64; 3],
    /// About the centre of mass, axes of P, kg m².
    #[serde(default)]
    pub inertia_com_kgm2: [f64; 6],
}

/// A frame on the plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaceTable {
    /// Origin, m.
    pub position_m: [f64; 3],
    /// Orientation.
    pub rotation_wxyz: [f64; 4],
}

/// `[truth]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruthTable {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in S, m.
    pub com_m: [f64; 3],
    /// About the centre of mass, axes of S, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Apparent offset of the wrench, on-body sign, N and N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub apparent_offset_n_nm: Option<[f64; 6]>,
}
