//! What a link carries, and the load that its controller is told.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::result::{Answer, Status};
use crate::model::load::Load;

/// What a link of a robot carries, from a recording with it and recordings without it. The one body of the answer is the payload,
/// and its S is the frame said here.
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
    /// The load that a controller can be told; absent if there is none that should be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<ControllerLoad>,
    /// Why there is no load, where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

/// A load as a controller is told it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ControllerLoad {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the payload's frame, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of the payload's frame, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m²; absent of a point mass.
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
                "the body nearest to what was identified, which is none by itself; noise explains the difference"
            }
            Self::PointMass => "the tensor was not identified: a point mass at the centre of mass",
        }
    }
}

impl ControllerLoad {
    /// Returns the load of an answer about one body.
    ///
    /// # Errors
    /// Says why no controller should be told one.
    fn of(answer: &Answer) -> Result<Self, String> {
        if matches!(answer.status, Status::Implausible | Status::Failed) {
            return Err("the numbers are not to be used: the warnings say why".to_owned());
        }
        let mass_kg = answer.mass_kg.ok_or("the mass is not identified")?;
        let com_m = answer.com_m.ok_or("the centre of mass is not identified")?;
        let Some(tensor) = answer.inertia_com_kgm2 else {
            return Ok(Self { mass_kg, com_m, inertia_com_kgm2: None, basis: LoadBasis::PointMass });
        };
        if answer.physically_consistent == Some(true) {
            return Ok(Self { mass_kg, com_m, inertia_com_kgm2: Some(tensor), basis: LoadBasis::Identified });
        }
        let nearest = answer.consistency.as_ref().and_then(|found| found.nearest_body.as_ref());
        let body = nearest.ok_or("no body has these parameters")?;
        Ok(Self {
            mass_kg: body.mass_kg,
            com_m: body.com_m,
            inertia_com_kgm2: Some(body.inertia_com_kgm2),
            basis: LoadBasis::NearestBody,
        })
    }

    /// Returns it as it is written.
    pub fn load(&self) -> Load {
        Load {
            mass_kg: self.mass_kg,
            com_m: self.com_m,
            inertia_com_kgm2: self.inertia_com_kgm2.unwrap_or_default(),
        }
    }
}

impl PayloadResult {
    /// Returns the same with the load of the answer about it, or why there is none.
    #[must_use]
    pub(super) fn with_load(self, answer: &Answer) -> Self {
        match ControllerLoad::of(answer) {
            Ok(load) => Self { load: Some(load), refused: None, ..self },
            Err(why) => Self { load: None, refused: Some(why), ..self },
        }
    }
}

/// Returns what would identify more of a payload.
pub(super) fn advice(answer: &Answer) -> Vec<String> {
    let open: Vec<&str> =
        answer.parameters.iter().filter(|p| !p.state.is_identified()).map(|p| p.name.as_str()).collect();
    if open.is_empty() {
        return Vec::new();
    }
    let how = if answer.mass_kg.is_none() || answer.com_m.is_none() {
        "tilt the flange about two axes as far as it goes, in both runs"
    } else {
        "turn the last joints fast and about several axes, in both runs; what is light and small beside the arm stays a point mass"
    };
    vec![format!("of the payload {} stay open: {how}", open.join(", "))]
}
