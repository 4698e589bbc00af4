//! The load of a link, as an answer has it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use rigident_model::load::Load;

/// What a link of a robot carries, from a recording with it and recordings without it. The one body of the
/// answer is the payload, and its S is the frame said here.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PayloadResult {
    /// The link that carries it.
    pub link: String,
    /// Origin of the payload's frame in the link's frame, m.
    pub position_m: [f64; 3],
    /// Attitude of the payload's frame in the link's frame, a unit quaternion w, x, y, z.
    pub rotation_wxyz: [f64; 4],
    /// The recordings without the payload.
    pub without: String,
    /// The load that a controller can be given; absent if there is none that should be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<ControllerLoad>,
    /// Why there is no load, where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

/// A load as a controller takes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ControllerLoad {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the payload's frame, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of the payload's frame, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m²;
    /// absent of a point mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_com_kgm2: Option<[f64; 6]>,
    /// What the numbers are.
    pub basis: LoadBasis,
}

/// What a load's numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LoadBasis {
    /// Those that were identified.
    Identified,
    /// Those of the nearest body: no body has those that were identified, and noise explains that.
    NearestBody,
    /// Mass and centre of mass were identified and the tensor was not: a point mass.
    PointMass,
}

impl LoadBasis {
    /// Returns what to know of it, for a comment in a file.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Identified => "mass, centre of mass and tensor as identified",
            Self::NearestBody => {
                "the body nearest to what was identified, which is none by itself; noise explains the \
                 difference"
            }
            Self::PointMass => "the tensor was not identified: a point mass at the centre of mass",
        }
    }
}

impl ControllerLoad {
    /// Returns it as it is written.
    pub fn load(&self) -> Load {
        Load {
            mass_kg: self.mass_kg,
            com_m: self.com_m,
            inertia_com_kgm2: self.inertia_com_kgm2.unwrap_or_default(),
        }
    }
}
