//! `[suspension]`: a platform that hangs or rests on springs, and moves freely on them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `[suspension]`: the springs under a platform that carries the body, and what the platform itself weighs.
///
/// P is the frame of the pose columns, fixed in the platform. Its axes at rest, z up, are those of the
/// springs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SuspensionTable {
    /// Stiffness about `at_m` in axes of P at rest, six rows of six: forces (N) and moments (N m) against
    /// small displacements (m) and turns (rad); of the springs alone, without weight. Instead of what
    /// `[[suspension.spring]]` says of stiffness: such tables beside it say where the springs carry the
    /// weight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<[[f64; 6]; 6]>,
    /// 1 σ of the elements of `stiffness`, relative to the geometric mean of the two stiffnesses on the
    /// diagonal; of each spring's where springs are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_std: Option<f64>,
    /// 1 σ of a factor that all springs share, as those of one batch, one load cell or one temperature do:
    /// `stiffness_std` if absent, zero where `stiffness_element_std` is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_common_std: Option<f64>,
    /// 1 σ of each element of `stiffness`, six rows of six, in its unit: what a calibration leaves open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness_element_std: Option<[[f64; 6]; 6]>,
    /// The point of P that `stiffness` is about, and through which the reaction of a locked coordinate goes,
    /// m.
    pub at_m: [f64; 3],
    /// Height above that point at which the springs carry the weight, m: it turns with the platform. That of
    /// the springs' places if absent; a matrix alone needs it where z is free.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchor_height_m: Option<f64>,
    /// 1 σ of each coordinate of the place of each spring, m: a tape measure's if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub place_std_m: Option<f64>,
    /// 1 σ of each axis about either direction across it, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis_std_rad: Option<f64>,
    /// 1 σ of the height at which all springs carry the weight, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchor_height_std_m: Option<f64>,
    /// 1 σ of each stated length of a spring, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_std_m: Option<f64>,
    /// 1 σ of each stated preload and pull, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preload_std: Option<f64>,
    /// 1 σ of the share of the weight that each other spring takes, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share_std: Option<f64>,
    /// 1 σ of the force of springs that rest 10 mm from their rest in the recording, by that of their
    /// stiffness; in proportion to that distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_std: Option<f64>,
    /// Temperature of the springs, steel, less that at which their stiffness was measured, K.
    #[serde(skip_serializing_if = "is_zero")]
    pub temperature_change_k: f64,
    /// 1 σ of it, K.
    #[serde(skip_serializing_if = "is_zero")]
    pub temperature_std_k: f64,
    /// Sides of the platform's plate along x and y, m, whose air may move with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub air_plate_m: Option<[f64; 2]>,
    /// Coordinates that a guide keeps from moving: `["z"]` of a platform that slides and turns on a vertical
    /// column.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub locked: Vec<Coordinate>,
    /// 1 σ of the damping ratio that is looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub damping_ratio_std: Option<f64>,
    /// Cut-off of the smoothing of poses, Hz; chosen from the data if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut_off_hz: Option<f64>,
    /// Origin of S, the frame of the body or of a tree's base link, in P, m.
    pub base_position_m: [f64; 3],
    /// P axes ← axes of S.
    pub base_rotation_wxyz: Option<[f64; 4]>,
    /// The springs one by one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub spring: Vec<SpringTable>,
    /// Where the platform rests with another load.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub rest: Vec<RestTable>,
    /// The bare platform, which is taken off the answer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub platform: Option<SuspendedPlatformTable>,
}

/// A coordinate of the platform at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Coordinate {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
    /// About x.
    Roll,
    /// About y.
    Pitch,
    /// About z.
    Yaw,
}

impl Coordinate {
    /// Returns its place among x, y, z and the turns about them.
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
            Self::Roll => 3,
            Self::Pitch => 4,
            Self::Yaw => 5,
        }
    }
}

/// `[[suspension.spring]]`: a spring that acts on a point of the platform.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpringTable {
    /// The point that it acts on, in P, m.
    pub at_m: [f64; 3],
    /// Axis of the spring in the axes of P at rest with the body on, of any length; of a clamped spring from
    /// the ground to the platform.
    #[serde(default = "up")]
    pub axis: [f64; 3],
    /// Stiffness along its axis, N/m.
    pub axial_npm: f64,
    /// Stiffness across it, N/m; of a hooked spring or a wire what it has besides its tension by `length_m`.
    #[serde(default)]
    pub lateral_npm: f64,
    /// Length at rest, m: a hooked spring or a wire has the stiffness T/L across its tension T, which follows
    /// the load; a clamped one pushes across at half of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// Both ends keep their direction, as those of a coil that stands on its seats do.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub clamped: bool,
    /// Mean diameter of a clamped coil, m: it bends by 0.28 `axial_npm` D² (round wire, Poisson's ratio 0.3).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diameter_m: Option<f64>,
    /// Force on the platform along the axis before the weight comes on, N: what the springs pull against each
    /// other. What of it is not in balance with the weight the springs share.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub preload_n: f64,
    /// Force on the platform along the axis at rest with the body on, N: such a spring takes no share of the
    /// weight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pull_n: Option<f64>,
    /// Mass of the spring, kg, of which a third moves with the platform.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub mass_kg: f64,
    /// 1 σ of either stiffness, relative; that of `[suspension] stiffness_std` if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn up() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// `[[suspension.rest]]`: the pose in which the platform rests with another load than that of the recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RestTable {
    /// True if the body is on the platform.
    #[serde(default = "yes")]
    pub body: bool,
    /// Mass that is added to the load of the recording, kg.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub added_kg: f64,
    /// Centre of mass of the added mass in P, m.
    #[serde(default)]
    pub added_at_m: [f64; 3],
    /// Origin of P in the frame of the recording's poses, m.
    pub position_m: [f64; 3],
    /// Axes of that frame ← P axes.
    pub rotation_wxyz: [f64; 4],
    /// 1 σ of each coordinate of the position, m: 0.1 mm if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_std_m: Option<f64>,
    /// 1 σ of the turn about each axis, rad: 0.0002 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_std_rad: Option<f64>,
}

fn yes() -> bool {
    true
}

/// `[suspension.platform]`: the bare platform in P, as it was weighed or designed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SuspendedPlatformTable {
    /// Mass of the platform, kg.
    pub mass_kg: f64,
    /// Centre of mass of the platform, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, Ixx, Iyy, Izz, Iyz, Izx, Ixy, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// 1 σ of the mass, kg.
    #[serde(default)]
    pub mass_std_kg: f64,
    /// 1 σ of each coordinate of the centre of mass, m.
    #[serde(default)]
    pub com_std_m: f64,
    /// 1 σ of each element of the tensor, kg m².
    #[serde(default)]
    pub inertia_std_kgm2: f64,
}
