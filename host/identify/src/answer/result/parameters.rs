//! The unknowns with their states, and what is known of them beforehand.

use rigident_fit::Measured;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::consistency::Consistency;

/// The state of a parameter. One that is not identified has no number, here or anywhere.
///
/// ```
/// use rigident_identify::answer::result::ParameterState;
///
/// fn value(state: ParameterState) -> Option<f64> {
///     match state {
///         ParameterState::Identified(m) | ParameterState::PriorDominated(m) => Some(m.value),
///         ParameterState::Contradicted | ParameterState::NotIdentified => None,
///     }
/// }
/// assert_eq!(value(ParameterState::default()), None);
/// ```
/// ```compile_fail,E0532
/// use rigident_identify::answer::result::ParameterState;
///
/// fn value(state: ParameterState) -> Option<f64> {
///     match state {
///         ParameterState::Identified(m) | ParameterState::PriorDominated(m) => Some(m.value),
///         ParameterState::NotIdentified(m) => Some(m.value),
///     }
/// }
/// ```
/// Nor has the fit that it was made of, outside of this crate:
/// ```compile_fail,E0616
/// fn value(fit: &rigident_fit::Fit) -> f64 {
///     fit.estimate.values[9]
/// }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "state", rename_all = "snake_case")]
pub enum ParameterState {
    /// The data alone determine it.
    Identified(Measured),
    /// The data determine it only together with what was known before.
    PriorDominated(Measured),
    /// The fit has a number for it, and the recording cannot be true: that number is in `fit` and must not be
    /// used.
    Contradicted,
    /// The data say nothing about it.
    #[default]
    NotIdentified,
}

impl ParameterState {
    /// Returns value and 95 % uncertainty, where there are any.
    pub fn measured(&self) -> Option<Measured> {
        match *self {
            Self::Identified(measured) | Self::PriorDominated(measured) => Some(measured),
            Self::Contradicted | Self::NotIdentified => None,
        }
    }

    /// Returns the same, to be changed.
    pub fn measured_mut(&mut self) -> Option<&mut Measured> {
        match self {
            Self::Identified(measured) | Self::PriorDominated(measured) => Some(measured),
            Self::Contradicted | Self::NotIdentified => None,
        }
    }

    /// Returns true if the value rests on what was known before.
    pub fn is_prior_dominated(&self) -> bool {
        matches!(self, Self::PriorDominated(_))
    }

    /// Returns true if the data alone determine it.
    pub fn is_identified(&self) -> bool {
        matches!(self, Self::Identified(_))
    }
}

/// One unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Parameter {
    /// Its name, unique in the answer: `m`, `arm.MSx`, `offset_fx`.
    pub name: String,
    /// The link, drive or channel that it belongs to; absent for the one body's own.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub owner: String,
    /// Its SI unit in ASCII: `kg`, `kg m`, `kg m2`.
    pub unit: String,
    /// State, and value with 95 % expanded uncertainty where there are any.
    #[serde(flatten)]
    pub state: ParameterState,
    /// The frame that it is expressed in: `S`, or a link's; absent where there is none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub frame: String,
    /// Its true value, where it is known; never used for the answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<f64>,
    /// Standard parameters that a base parameter combines and their constant weights, the one that names it
    /// first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<(String, f64)>,
}

/// What the fit of a recording that cannot be true found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnusableFit {
    /// The parameters whose state is `contradicted`, with the numbers of the fit.
    pub parameters: Vec<UnusableParameter>,
    /// How far the fit is from the parameters that bodies can have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub consistency: Option<Consistency>,
}

/// A parameter of a fit that must not be used.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnusableParameter {
    /// Its name, as in `parameters` of the answer.
    pub name: String,
    /// Its SI unit in ASCII.
    pub unit: String,
    /// The value that the fit has.
    pub value: f64,
    /// The 95 % expanded uncertainty that the fit has; it does not hold.
    pub u95: f64,
}

/// A quantity known beforehand.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KnownValue {
    /// The name that it was stated by, with its unit: `mass_kg`, `symmetry y`.
    pub name: String,
    /// Its value, SI; zero for a plane of symmetry.
    pub value: f64,
    /// Its standard uncertainty (1 σ), SI.
    pub sigma: f64,
    /// The statement in words.
    pub text: String,
}
