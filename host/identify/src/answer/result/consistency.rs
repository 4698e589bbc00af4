//! The one body, and links as bodies: axes, frames, standard parameters, whether such bodies can be.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A principal moment of inertia about the centre of mass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PrincipalMoment {
    /// The moment, kg m².
    pub moment_kgm2: f64,
    /// Its 95 % expanded uncertainty, kg m².
    pub u95_kgm2: f64,
    /// Its unit axis in S; absent where two moments cannot be distinguished.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// 95 % expanded uncertainty of the axis' direction, rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_u95_rad: Option<f64>,
}

/// The one body in the customer's frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BodyFrame {
    /// Name of the frame.
    pub name: String,
    /// Centre of mass, m.
    pub com_m: [f64; 3],
    /// Its 95 % expanded uncertainty, m.
    pub com_u95_m: [f64; 3],
    /// Tensor about the frame's origin, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_origin_kgm2: Option<[f64; 6]>,
    /// Its 95 % expanded uncertainty, kg m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_origin_u95_kgm2: Option<[f64; 6]>,
}

/// The distance of an estimate from the parameters that bodies can have.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Consistency {
    /// Distance to the nearest possible body or bodies, standard deviations; zero if the estimate is one.
    pub distance_sd: f64,
    /// Probability that noise alone makes the distance this large or larger, at least; below 1e-4 it is taken
    /// for a mistake in the data or the model.
    pub probability: f64,
    /// True if bodies of negative mass have the parameters: a sign is wrong, and nothing is identified.
    pub reversed: bool,
    /// The nearest body, where no body has the one body's ten parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nearest_body: Option<NearestBody>,
}

/// The numbers of a body, without uncertainty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NearestBody {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Tensor about the frame's origin, kg m².
    pub inertia_origin_kgm2: [f64; 6],
}

/// Standard parameters of all links: nearest to the nominal model among those that the base parameters allow.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StandardParameters {
    /// What they are, in a sentence.
    pub note: String,
    /// Relative standard deviation (1 σ) that the nominal model is trusted with.
    pub nominal_sigma: f64,
    /// True if right links were made mirror images of left ones.
    pub symmetric_sides: bool,
    /// Distance of their base parameters from those identified, standard deviations.
    pub distance_sd: f64,
    /// The largest distance of a single identified parameter, in its own standard deviations.
    pub largest_parameter_sd: f64,
    /// True if the search came to its end.
    pub converged: bool,
    /// The links that have mass.
    pub links: Vec<StandardLink>,
}

/// A link's standard parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StandardLink {
    /// Its name.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of the link, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// `[m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy]` about the link's origin, SI.
    pub parameters: [f64; 10],
    /// Relative distance from the nominal model's: `√(2 D)` with D the log-determinant divergence of the
    /// pseudo-inertias.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_from_nominal: Option<f64>,
    /// Those of `parameters` that the data alone determine by themselves: `mcx`, `Izz`. The others are known
    /// in combinations only, or are the nominal model's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub identified: Vec<String>,
}

/// What is really the case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Truth {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in S, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of S, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Principal moments, largest first, kg m².
    pub moments_kgm2: [f64; 3],
    /// Centre of mass in the customer's frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_frame_com_m: Option<[f64; 3]>,
    /// Tensor about the origin of the customer's frame, kg m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_frame_inertia_origin_kgm2: Option<[f64; 6]>,
}
