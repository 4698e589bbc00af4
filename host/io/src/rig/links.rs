//! `[[link]]`, `[[joint]]`, `[[foot]]` and `[tree]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ColumnSource, TreeClass, is_false};

/// `[[link]]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkTable {
    /// Name of the link.
    pub name: String,
    /// Name of the link it hangs on; absent for the base.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// Kind of the joint that it hangs on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<Joint>,
    /// Axis of a revolute, continuous or prismatic joint, in the link's frame; first axis of a universal one,
    /// x if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// Second axis of a universal joint, y if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second_axis: Option<[f64; 3]>,
    /// Joint in the parent's frame, m; its origin if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Parent axes ← link axes at zero angle.
    #[serde(default = "no_rotation")]
    pub rotation_wxyz: [f64; 4],
    /// For a device that finds the joint's attitude from both links' IMUs: `R_SL` at the start of a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_wxyz: Option<[f64; 4]>,
    /// Assumed mass, kg; given with the two below or not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_mass_kg: Option<f64>,
    /// Centre of mass in the link's frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_com_m: Option<[f64; 3]>,
    /// Tensor about the centre of mass, axes of the link, Ixx, Iyy, Izz, Iyz, Izx, Ixy, kg m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal_inertia_com_kgm2: Option<[f64; 6]>,
}

/// `[[joint]]`: the columns of a joint. Without it, and for keys that are left out, they are named for the
/// joint: `NAME_rad`, `NAME_radps`, `NAME_nm`, or `NAME_m`, `NAME_mps`, `NAME_n` of one that slides.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointTable {
    /// The joint's name in the model; in `[[link]]` tables that of its link.
    pub name: String,
    /// Column of the joint's angle, rad, or length, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<ColumnSource>,
    /// Column of the joint's rate, rad/s or m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<ColumnSource>,
    /// Torque, N m, or force, N, of its drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort: Option<ColumnSource>,
    /// 1 σ of the position per sample, rad or m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_noise: Option<f64>,
    /// 1 σ of the rate per sample, rad/s or m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_noise: Option<f64>,
    /// 1 σ of the effort per sample.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort_noise: Option<f64>,
    /// 1 σ of the position where the joint is at zero, rad or m; that of `[tree]` otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_std: Option<f64>,
    /// 1 σ of the effort's scale, relative; that of `[tree]` otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort_gain_std: Option<f64>,
    /// Cut-off of the low-pass of first order that the effort went through, Hz; positions did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effort_lowpass_hz: Option<f64>,
}

/// `[[foot]]`: a place where the ground pushes on a link, and the sensor of that wrench: columns `NAME_fx_n`
/// … `NAME_mz_nm`, on the foot, in the sensor's axes, about its origin.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FootTable {
    /// Name of the foot, with which its columns begin.
    pub name: String,
    /// The link that it is part of.
    pub link: String,
    /// Origin of the sensor in the link's frame, m.
    #[serde(default)]
    pub position_m: [f64; 3],
    /// Link axes ← sensor axes.
    #[serde(default = "no_rotation")]
    pub rotation_wxyz: [f64; 4],
    /// Foreign names of its columns, by component: `fz = "lf_force"`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, ColumnSource>,
    /// Components that are recorded and not to be believed: `["fx", "fy"]`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unavailable: Vec<String>,
    /// The ground touches it in a point: no moments about the sensor's origin.
    #[serde(default, skip_serializing_if = "is_false")]
    pub point: bool,
    /// It stands where the force measured is above this, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub touching_n: Option<f64>,
    /// 1 σ of fx … mz per sample, N and N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_n_nm: Option<[f64; 6]>,
    /// 1 σ of the zero of each force, N, and of each moment, N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_std_n_nm: Option<[f64; 2]>,
    /// 1 σ of the scale of each component, relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
}

/// `[tree]`: what is known of joints and base.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TreeTable {
    /// Class, from which every uncertainty below follows that is not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub class: Option<TreeClass>,
    /// 1 σ of the zero of each joint that turns, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_zero_std_rad: Option<f64>,
    /// 1 σ of the zero of each joint that slides, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint_zero_std_m: Option<f64>,
    /// 1 σ of the tilt of a base that is held still and has no IMU, about either horizontal axis, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_tilt_std_rad: Option<f64>,
    /// 1 σ of the delay of the joints' positions against wrench and efforts, s, where the base has no IMU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skew_std_s: Option<f64>,
    /// 1 σ of the scale of each effort, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort_gain_std: Option<f64>,
    /// 1 σ of the offset of each effort and of its drift over a recording, relative to the largest effort of
    /// the joint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort_drift_std: Option<f64>,
}

impl TreeTable {
    pub(super) fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Joint {
    /// Does not move.
    Fixed,
    /// Turns about one axis.
    Revolute,
    /// Turns about one axis without end.
    Continuous,
    /// Slides along one axis.
    Prismatic,
    /// Turns about two axes.
    Universal,
    /// Turns about any axis.
    Spherical,
    /// Moves in any way.
    Free,
}
