//! The result object of schema 1: one body. It goes when the commands print [`super::result::Answer`].

use serde::Serialize;

use super::result::{ParameterState, Status, TimeBase};

/// The schema's name.
pub const SCHEMA_1: &str = "rigident/result/1";

/// One parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its SI unit.
    pub unit: String,
    /// State, value, uncertainty.
    #[serde(flatten)]
    pub state: ParameterState,
    /// The frame it is in.
    pub frame: &'static str,
}

/// Where the answer comes from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResultSource {
    /// The recording.
    pub recording: String,
    /// Its readings.
    pub rows: usize,
    /// Their rate, 1/s; absent for still poses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Who estimated: `inproc`, `qemu`, `port` or `host`.
    pub mcu: String,
    /// What the answer is a memory of; absent where nothing is forgotten.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<MemoryResult>,
}

/// What an answer is a memory of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MemoryResult {
    /// `forgetting` or `window`.
    pub kind: &'static str,
    /// The time constant, or the window's length, s.
    pub span_s: f64,
    /// Seconds of rows that the answer rests on, older ones weighted as they are remembered.
    pub effective_s: f64,
}

impl std::fmt::Display for MemoryResult {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { kind, span_s, effective_s } = self;
        if *kind == "window" {
            return write!(
                f,
                "the answer is that of the last {effective_s:.1} s of rows (--window {span_s}) and of nothing before"
            );
        }
        write!(
            f,
            "the answer is a memory of {effective_s:.1} s of rows (--forget {span_s}): what the motion renews is forgotten \
             with that time constant, what it does not renew is kept as it was last seen"
        )
    }
}

/// Principal moments about the centre of mass, largest first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PrincipalResult {
    /// Moments, kg m².
    pub moments_kgm2: [f64; 3],
    /// Their 95 % uncertainty.
    pub moments_u95_kgm2: [f64; 3],
    /// Unit axes in S; `null` where two moments cannot be told apart.
    pub axes: [Option<[f64; 3]>; 3],
    /// 95 % uncertainty of their directions, rad.
    pub axes_u95_rad: [Option<f64>; 3],
}

/// The body nearest to an answer that no body has, in the metric of the answer's covariance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConsistentResult {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in S, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of S, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Tensor about S's origin, kg m².
    pub inertia_origin_kgm2: [f64; 6],
    /// How far the answer is from it, standard deviations.
    pub distance_sd: f64,
}

/// The body in the customer's frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BodyFrameResult {
    /// Its name.
    pub name: String,
    /// Centre of mass, m.
    pub com_m: [f64; 3],
    /// Its 95 % uncertainty.
    pub com_u95_m: [f64; 3],
    /// Inertia tensor about the frame's origin, kg m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_origin_kgm2: Option<[f64; 6]>,
    /// Its 95 % uncertainty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_origin_u95_kgm2: Option<[f64; 6]>,
}

/// A quantity known beforehand.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnownResult {
    /// Its name, with the unit.
    pub name: String,
    /// Its value, SI.
    pub value: f64,
    /// Its standard uncertainty, 1 σ.
    pub sigma: f64,
}

/// The whole object.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResultObject {
    /// [`SCHEMA_1`].
    pub schema: &'static str,
    /// How much is identified.
    pub status: Status,
    /// Where it comes from.
    pub source: ResultSource,
    /// How several files became one recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_base: Option<TimeBase>,
    /// Ten parameters, and the offset where it was estimated.
    pub parameters: Vec<Parameter>,
    /// What was known beforehand.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub known: Vec<KnownResult>,
    /// Fields below that rest on what was known beforehand: `com_m`, `inertia_com_kgm2`, …
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub prior_dominated: Vec<&'static str>,
    /// Mass, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Centre of mass in S, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_m: Option<[f64; 3]>,
    /// Its 95 % uncertainty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_u95_m: Option<[f64; 3]>,
    /// Tensor about the centre of mass, axes of S, kg m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_com_kgm2: Option<[f64; 6]>,
    /// Its 95 % uncertainty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_com_u95_kgm2: Option<[f64; 6]>,
    /// Tensor about S's origin, kg m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_origin_kgm2: Option<[f64; 6]>,
    /// Principal moments and axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub principal: Option<PrincipalResult>,
    /// In `[body]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body_frame: Option<BodyFrameResult>,
    /// Whether some distribution of mass has these parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physically_consistent: Option<bool>,
    /// The nearest body, where `physically_consistent` is false.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub consistent: Option<ConsistentResult>,
    /// 2-norm, column-scaled whitened rows, over what the rows determine; absent if that is nothing.
    #[serde(skip_serializing_if = "is_not_finite")]
    pub condition_number: f64,
    /// Root mean square of the residuals of the filtered rows, N and N m; absent without the data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual_rms: Option<[f64; 6]>,
    /// Channels whose residuals are more coloured than the filter explains, the worst first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub coloured_residuals: Vec<ColourResult>,
    /// Readings not used.
    pub rejected_rows: u32,
    /// How the platform followed its program, where that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking: Option<serde_json::Value>,
    /// What would identify the rest.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub advice: Vec<String>,
    /// What broke the experiment off; absent where nothing did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// What to know.
    pub warnings: Vec<String>,
    /// Time the command took, s.
    pub elapsed_s: f64,
}

/// A channel with coloured residuals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColourResult {
    /// `fx` to `mz`.
    pub channel: &'static str,
    /// Factor by which white noise's intervals are too narrow where they rest on its slowest part alone.
    pub factor: f64,
}

/// JSON has no word for it.
fn is_not_finite(value: &f64) -> bool {
    !value.is_finite()
}

#[cfg(test)]
mod tests {
    use super::super::result::Measured;
    use super::*;

    fn nothing_identified() -> ResultObject {
        ResultObject {
            tracking: None,
            error: None,
            schema: SCHEMA_1,
            status: Status::NotIdentified,
            source: ResultSource {
                recording: "still".into(),
                rows: 7,
                rate_hz: None,
                mcu: "host".into(),
                memory: None,
            },
            time_base: None,
            parameters: vec![Parameter {
                name: "m".into(),
                unit: "kg".into(),
                state: ParameterState::NotIdentified,
                frame: "S",
            }],
            known: Vec::new(),
            prior_dominated: Vec::new(),
            mass_kg: None,
            com_m: None,
            com_u95_m: None,
            inertia_com_kgm2: None,
            inertia_com_u95_kgm2: None,
            inertia_origin_kgm2: None,
            principal: None,
            body_frame: None,
            physically_consistent: None,
            consistent: None,
            condition_number: f64::INFINITY,
            coloured_residuals: Vec::new(),
            residual_rms: Some([0.0; 6]),
            rejected_rows: 0,
            advice: Vec::new(),
            warnings: Vec::new(),
            elapsed_s: 0.5,
        }
    }

    #[test]
    fn what_is_not_known_is_absent_and_never_null() {
        let json = serde_json::to_value(nothing_identified()).unwrap();
        let keys: Vec<&str> = json.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(
            keys,
            [
                "elapsed_s",
                "parameters",
                "rejected_rows",
                "residual_rms",
                "schema",
                "source",
                "status",
                "warnings"
            ]
        );
        assert_eq!(
            (json["schema"].as_str(), json["status"].as_str()),
            (Some(SCHEMA_1), Some("not_identified"))
        );
        assert!(!json.to_string().contains("null"));
    }

    #[test]
    fn a_parameter_that_is_not_identified_has_no_number() {
        let parameter = |state| {
            serde_json::to_string(&Parameter { name: "Ixx".into(), unit: "kg m2".into(), state, frame: "S" })
                .unwrap()
        };
        assert_eq!(
            parameter(ParameterState::NotIdentified),
            r#"{"name":"Ixx","unit":"kg m2","state":"not_identified","frame":"S"}"#
        );
        assert_eq!(
            parameter(ParameterState::Identified(Measured { value: 0.5, u95: 0.25 })),
            r#"{"name":"Ixx","unit":"kg m2","state":"identified","value":0.5,"u95":0.25,"frame":"S"}"#
        );
    }
}
