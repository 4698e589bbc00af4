//! The answer: what text, JSON and page are made of, for every kind of body.
//!
//! `result.json` and `--json` hold an [`Answer`] as it is here, and the documentation of the fields is the
//! schema's (`rigident schema result`). What is not known is absent, never `null`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::payload::PayloadResult;
use super::person::PersonResult;

pub use rigident_fit::Measured;

/// The schema's name.
pub const SCHEMA: &str = "rigident/result/3";
/// The schema before it, which is read too: its implausible answers had states and derived quantities like
/// any other.
pub const EARLIER_SCHEMA: &str = "rigident/result/2";

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

/// How much is identified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Everything asked for.
    Identified,
    /// Some of what was asked for.
    PartlyIdentified,
    /// Nothing of what was asked for.
    #[default]
    NotIdentified,
    /// The recording contradicts what is stated of the rig, or is not that of an unchanging rigid body:
    /// nothing is identified. `warnings` say why.
    Implausible,
    /// The experiment or the command broke off; `error` says why.
    Failed,
}

/// The whole answer about one body, two links, a tree or any other model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Answer {
    /// The name of this schema: `rigident/result/3`.
    #[schemars(extend("const" = SCHEMA))]
    pub schema: String,
    /// How much of what was asked for is identified.
    pub status: Status,
    /// Why the experiment or the command broke off, where `status` is `failed`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Date and time of the run, UTC, as RFC 3339 has it: `2026-11-22T04:19:51Z`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub date: String,
    /// Where the numbers come from.
    pub source: Source,
    /// The tree of links that was identified; absent for one rigid body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelSummary>,
    /// What was found of one person, by `rigident body identify`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<PersonResult>,
    /// What a link carries, by `rigident identify --payload`; the one body is then the payload.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<PayloadResult>,
    /// How several files became one recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_base: Option<TimeBase>,
    /// The part of the recording that the answer rests on, where older rows are forgotten.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub forgotten: Option<Forgotten>,
    /// Every unknown with its state, in the order of the factor's columns.
    pub parameters: Vec<Parameter>,
    /// What the fit of a recording that cannot be true found. It must not be used; it helps to find the
    /// fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<UnusableFit>,
    /// What was known beforehand and is in the estimate.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub known: Vec<KnownValue>,
    /// Fields below that rest on what was known beforehand: `mass_kg`, `com_m`, `inertia_com_kgm2`,
    /// `inertia_origin_kgm2`, `principal`, `body_frame`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub prior_dominated: Vec<String>,
    /// Mass of the one body, kg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Centre of mass of the one body in S, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub com_m: Option<[f64; 3]>,
    /// 95 % expanded uncertainty of `com_m`, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub com_u95_m: Option<[f64; 3]>,
    /// Tensor of the one body about its centre of mass, axes of S, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_com_kgm2: Option<[f64; 6]>,
    /// 95 % expanded uncertainty of `inertia_com_kgm2`, kg m².
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_com_u95_kgm2: Option<[f64; 6]>,
    /// Tensor of the one body about the origin of S, kg m²; its uncertainty is with the parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_origin_kgm2: Option<[f64; 6]>,
    /// Principal moments about the centre of mass and their axes, largest first; empty where the tensor is
    /// not identified.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub principal: Vec<PrincipalMoment>,
    /// The one body in the frame of `[body]` of the rig file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_frame: Option<BodyFrame>,
    /// True if some distribution of mass has these parameters: of one body exactly these, of a tree some
    /// within the uncertainty. Absent if that is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub physically_consistent: Option<bool>,
    /// How far the estimate is from the parameters that bodies can have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub consistency: Option<Consistency>,
    /// Standard parameters of every link of a tree, completed from a nominal model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_parameters: Option<StandardParameters>,
    /// Of a tree, a value for every column of its rows, to predict with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub complete: Option<Complete>,
    /// The true body of `[truth]` of the rig file, never used for the answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<Truth>,
    /// 2-norm condition number of the column-scaled, whitened rows over what they determine; absent if that
    /// is nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition_number: Option<f64>,
    /// Noise and residuals of each measured quantity, in the order of the rows.
    pub channels: Vec<Channel>,
    /// Root mean square of the filtered residuals, channel by channel in the channels' units; absent without
    /// the data.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub residual_rms: Vec<f64>,
    /// Errors of sensors and mounting that were estimated with the parameters, those that were taken as exact
    /// left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub errors: Vec<RigError>,
    /// How these agree with what was known of them beforehand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors_agreement: Option<ErrorsAgreement>,
    /// Noise of the signals that the rows are made of, as far as it counts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub signals: Vec<SignalNoise>,
    /// What each uncertainty is made of, largest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub budget: Vec<Budget>,
    /// What would make the uncertainties smaller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub improvement: Option<String>,
    /// Scales and signs that the recording does not show, and that the answer rests on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rests_on: Vec<Reliance>,
    /// Samples and rows counted.
    pub counts: Counts,
    /// Samples that were not used; also in `counts`.
    pub rejected_rows: u64,
    /// How a platform followed its program, where that was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tracking: Option<Tracking>,
    /// How an experiment that decides for itself went.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<ExperimentSummary>,
    /// The first pose repeated at the end: how much the mean wrench changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<Drift>,
    /// The runs that only a factor is left of, with what the checks of their recordings found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub runs: Vec<Run>,
    /// Something changed while the recording was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
    /// The residuals are those of something that is not rigid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_rigid: Option<NotRigid>,
    /// Channels that drift from still pose to still pose, in the order in which these were taken.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pose_drift: Vec<PoseDrift>,
    /// What would identify the rest, or why it cannot be.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub advice: Vec<String>,
    /// Information that asks for nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Why the recording cannot be true, where `status` is `implausible` and a fault was found that explains
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<Cause>,
    /// What a user should act on before using the numbers.
    pub warnings: Vec<String>,
    /// Time that the command took, s.
    pub elapsed_s: f64,
}

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

/// A run that only a factor is left of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// Name of its recording.
    pub recording: String,
    /// What the checks found when the factor was made.
    pub verdict: RunVerdict,
}

/// What the checks of a recording found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RunVerdict {
    /// Nothing against it.
    Plausible,
    /// It contradicts what is stated of the rig, or is not that of an unchanging rigid body.
    Implausible,
    /// The factor carries no checks.
    NotChecked,
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

/// The origin of the numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Source {
    /// Name of the recording, or of several that were merged.
    pub recording: String,
    /// Date and time of the recording, RFC 3339; absent where it states none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded: Option<String>,
    /// Samples of the recording.
    pub rows: u64,
    /// Their rate, 1/s; absent for still poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Length of the recording, s; absent for still poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// The estimator that ran: `inproc`, `qemu` or a port for firmware, `host` for the program itself.
    pub mcu: String,
}

/// The model that a tree was identified by.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelSummary {
    /// Its name.
    pub name: String,
    /// What was measured, on what kind of base, as a sentence.
    pub situation: String,
    /// Number of base parameters that rows of this kind can tell apart.
    pub base_parameters: u64,
    /// Number of standard parameters of its links.
    pub standard_parameters: u64,
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

/// What an answer rests on where older rows are forgotten.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Forgotten {
    /// `exponential` (with a time constant) or `window` (nothing before it counts).
    pub kind: ForgettingKind,
    /// The time constant, or the window's length, s.
    pub span_s: f64,
    /// Seconds of rows that the answer rests on, older ones weighted as they count.
    pub effective_s: f64,
}

/// The way in which older rows are forgotten.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ForgettingKind {
    /// What the motion renews is forgotten with a time constant.
    Exponential,
    /// Only the last rows count.
    Window,
}

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

/// A value for every column of the rows of a tree, to predict with. They belong together: what is not
/// identified has the value that fits best beside the nominal model, or, where there is none, beside zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Complete {
    /// What they are, in a sentence.
    pub note: String,
    /// Base parameters of the links and offsets, in the order of `parameters`.
    pub links: Vec<CompleteParameter>,
    /// What the drives of the joints have beside them: friction, offsets, rotors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drives: Vec<CompleteDrive>,
}

/// A parameter that may be identified or not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CompleteParameter {
    /// Its name, as in `parameters`.
    pub name: String,
    /// Its value in the SI unit of its parameter.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// True if the data alone determine it.
    pub identified: bool,
}

/// A drive's parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CompleteDrive {
    /// Its name, that of its joint.
    pub name: String,
    /// The joints that it turns with: `joint_5+joint_6`.
    pub turns_with: String,
    /// Its columns.
    pub terms: Vec<CompleteTerm>,
}

/// A parameter of a drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CompleteTerm {
    /// Its word, as `--friction` takes it: `viscous`, `stribeck:0.05`.
    pub term: String,
    /// Its value in the SI unit of its parameter; absent where only a sum is known, which the links have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Its unit.
    pub unit: String,
    /// True if the data alone determine it by itself.
    pub identified: bool,
    /// The base parameters that it occurs together with only: their sums are identified or not, see
    /// `parameters`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub together_with: Vec<String>,
}

impl CompleteTerm {
    /// Returns its word without a number: `stribeck` of `stribeck:0.05`.
    pub fn name(&self) -> &str {
        Self::name_in(&self.term)
    }

    /// Returns what a word is without its number.
    pub fn name_in(word: &str) -> &str {
        word.split(':').next().unwrap_or(word)
    }
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

/// A measured quantity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Channel {
    /// Its name: `fx`, or a joint's.
    pub name: String,
    /// Its SI unit: `N` or `N m`.
    pub unit: String,
    /// Standard deviation of its white noise per unfiltered sample, stated or found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// True if `sigma` was stated; else it comes from the residuals.
    pub sigma_given: bool,
    /// Root mean square of the filtered residuals; absent without the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_rms: Option<f64>,
    /// Root mean square of the filtered measurements; absent without the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured_rms: Option<f64>,
    /// Relative gain error as far as it shows; absent where none was allowed for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Filtered rows that count less because an outlier spoilt them.
    pub outliers: u64,
    /// Samples rejected because of this channel.
    pub rejected: u64,
    /// Factor by which white noise's intervals would be too narrow where they rest on the residuals' slowest
    /// part alone; absent if the residuals are no more autocorrelated than the filter explains.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub autocorrelation: Option<f64>,
}

/// Samples and rows counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Counts {
    /// Samples in the recording.
    pub samples: u64,
    /// Samples rejected by screening.
    pub rejected: u64,
    /// Gaps in time, at which the filter started anew.
    pub gaps: u64,
    /// Scalar rows in the factor.
    pub rows: u64,
}

/// An experiment that decides for itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExperimentSummary {
    /// Seconds of the rig from the first reading to the last.
    pub rig_s: f64,
    /// What was asked for, in words.
    pub goal: String,
    /// True if it was reached.
    pub reached: bool,
    /// The worst 95 % uncertainty over what was asked for; absent while it is not known what that is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_ratio: Option<f64>,
    /// What was said last that can be reached in the time there is, over what was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_ratio: Option<f64>,
    /// The same as the 95 % uncertainty of the worst element of the tensors, kg m², while the moment of which
    /// a share was asked for is not known well enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_moment_u95_kgm2: Option<f64>,
    /// The segments, in their order.
    pub decisions: Vec<SegmentSummary>,
}

/// A segment that was decided on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SegmentSummary {
    /// Its beginning, from the first reading, s.
    pub begun_s: f64,
    /// Its duration, s; absent if its end was not seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lasted_s: Option<f64>,
    /// Its name.
    pub name: String,
    /// The parameter that was furthest off before it.
    pub furthest: String,
    /// The worst uncertainty over what is asked for, before it; absent while it is infinite.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<f64>,
    /// The same as expected at its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<f64>,
    /// The same at its end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached: Option<f64>,
}

/// The tracking error of a platform: measured less commanded pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tracking {
    /// Samples of the measured motion.
    pub samples: u64,
    /// Root mean square of the position's error, x, y, z of A, m.
    pub rms_m: [f64; 3],
    /// Root mean square of the attitude's error, as rotations about x, y, z of A, rad.
    pub rms_rad: [f64; 3],
    /// Largest distance, m.
    pub largest_m: f64,
    /// Largest angle, rad.
    pub largest_rad: f64,
    /// Delay of the platform that makes the errors smallest, s.
    pub delay_s: f64,
    /// Root mean square of the position's error with this delay taken off, m.
    pub rms_without_delay_m: [f64; 3],
    /// Root mean square of the attitude's error with this delay taken off, rad.
    pub rms_without_delay_rad: [f64; 3],
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

/// One of several files on the common time base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StreamResult {
    /// The file as listed in the rig file.
    pub file: String,
    /// Quantities taken from it: `wrench`, `accelerometer`, …
    pub carries: Vec<String>,
    /// Its measured rate, 1/s.
    pub rate_hz: f64,
    /// Its rows.
    pub rows: usize,
    /// Rows not used: frozen or beyond the range.
    pub discarded: usize,
    /// Delay of its stamps against those of the wrench, s; absent for that one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skew_s: Option<ParameterState>,
}

/// The common time base of several files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimeBase {
    /// Its rate, 1/s.
    pub rate_hz: f64,
    /// Whole width of the kernel that every stream went through, s.
    pub kernel_width_s: f64,
    /// The streams, in the order of the rig file.
    pub streams: Vec<StreamResult>,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
