//! The answer: what text, JSON and page are made of, for every kind of body.
//!
//! `result.json` and `--json` hold an [`Answer`] as it is here, and the documentation of the fields is the
//! schema's (`rigident schema result`). What is not known is absent, never `null`.

mod changes;
mod complete;
mod consistency;
mod errors;
mod experiment;
mod parameters;
mod recording;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::payload::PayloadResult;
use super::person::PersonResult;

pub use self::changes::{
    Cause, Change, Changed, Drift, DriftChange, NotRigid, ParameterStep, PoseDrift, WithinMotion,
};
pub use self::complete::{Complete, CompleteDrive, CompleteParameter, CompleteTerm};
pub use self::consistency::{
    BodyFrame, Consistency, NearestBody, PrincipalMoment, StandardLink, StandardParameters, Truth,
};
pub use self::errors::{Budget, Contribution, ErrorsAgreement, Reliance, RigError, SignalNoise};
pub use self::experiment::{ExperimentSummary, SegmentSummary, Tracking};
pub use self::parameters::{KnownValue, Parameter, ParameterState, UnusableFit, UnusableParameter};
pub use self::recording::{
    Channel, Counts, ForgettingKind, Forgotten, ModelSummary, Run, RunVerdict, Source, StreamResult, TimeBase,
};
pub use rigident_fit::Measured;

/// The schema's name.
pub const SCHEMA: &str = "rigident/result/3";
/// The schema before it, which is read too: its implausible answers had states and derived quantities like
/// any other.
pub const EARLIER_SCHEMA: &str = "rigident/result/2";

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
    /// Largest coverage factor of the intervals: Student's, where noise was estimated from few residuals;
    /// absent where it is below 2, as it is but for still poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coverage_factor: Option<f64>,
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
