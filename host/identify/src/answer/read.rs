//! Reading answers back from `result.json`.

use rigident_shared::printable;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use super::Answer;
use super::result::{
    DriftChange, EARLIER_SCHEMA, Measured, Parameter, ParameterState, ParameterStep, SCHEMA, Status,
};

/// Why a text is no answer that this program reads.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It is no JSON, or no object of this schema.
    #[error("this is no result of Rigident: {0}; give the result.json that a command of Rigident wrote")]
    Json(#[from] serde_json::Error),
    /// A text in it is none that this program writes.
    #[error("this is no result of Rigident: the text {0:?} in it has control characters, or is too long")]
    Text(String),
    /// It is a result of another version.
    #[error(
        "this is a result of schema {found:?}, and this program reads {SCHEMA:?} and {EARLIER_SCHEMA:?}: \
         identify the recording again with this version (`identify(RECORDING)`)"
    )]
    Schema {
        /// The schema that it names; empty if it names none.
        found: String,
    },
}

#[derive(Deserialize)]
struct Named {
    #[serde(default)]
    schema: String,
}

/// A parameter as it is in a file. Flattened fields are read by way of serde's own buffer, which has no
/// numbers as soon as any crate of the build wants them in full length (`arbitrary_precision`).
#[derive(Deserialize)]
struct Written {
    name: String,
    #[serde(default)]
    owner: String,
    unit: String,
    state: String,
    value: Option<f64>,
    u95: Option<f64>,
    #[serde(default)]
    frame: String,
    truth: Option<f64>,
    #[serde(default)]
    terms: Vec<(String, f64)>,
}

impl<'de> Deserialize<'de> for Parameter {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let Written { name, owner, unit, state, value, u95, frame, truth, terms } =
            Written::deserialize(from)?;
        let measured = value.zip(u95).map(|both| usable(&name, both)).transpose()?;
        let measured =
            || measured.ok_or_else(|| D::Error::custom(format!("{name} is {state} and has no value")));
        let state = match state.as_str() {
            "identified" => ParameterState::Identified(measured()?),
            "prior_dominated" => ParameterState::PriorDominated(measured()?),
            "contradicted" => ParameterState::Contradicted,
            "not_identified" => ParameterState::NotIdentified,
            other => return Err(D::Error::custom(format!("{name} is {other:?}, which is no state"))),
        };
        Ok(Self { name, owner, unit, state, frame, truth, terms })
    }
}

/// Larger than anything that is identified, in any unit.
const LARGEST: f64 = 1e60;

/// Returns a value with its U95, if they can be of a fit.
fn usable<E: serde::de::Error>(name: &str, (value, u95): (f64, f64)) -> Result<Measured, E> {
    if value.abs() < LARGEST && (0.0..LARGEST).contains(&u95) {
        return Ok(Measured { value, u95 });
    }
    let name = printable::name(name);
    Err(E::custom(format!("{name} has the value {value:e} and the u95 {u95:e}, which no fit has")))
}

/// Returns the first key or text that could steer what it is shown by. Warnings may have lines.
fn unfit(value: &serde_json::Value) -> Option<&str> {
    let is_fit = |text: &str| text.len() <= LONGEST_TEXT && printable::are_lines(text);
    match value {
        serde_json::Value::String(text) => (!is_fit(text)).then_some(text),
        serde_json::Value::Array(items) => items.iter().find_map(unfit),
        serde_json::Value::Object(map) => {
            map.iter().find_map(|(key, value)| if is_fit(key) { unfit(value) } else { Some(key) })
        }
        _ => None,
    }
}

/// The longest text of a result, bytes.
const LONGEST_TEXT: usize = 1 << 16;

/// A step of a parameter as it is in a file.
#[derive(Deserialize)]
struct WrittenStep {
    name: String,
    unit: String,
    value: f64,
    u95: f64,
}

impl<'de> Deserialize<'de> for ParameterStep {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let WrittenStep { name, unit, value, u95 } = WrittenStep::deserialize(from)?;
        let step = usable(&name, (value, u95))?;
        Ok(Self { name, unit, step })
    }
}

/// A channel's drift as it is in a file.
#[derive(Deserialize)]
struct WrittenDrift {
    channel: String,
    unit: String,
    value: Option<f64>,
    u95: Option<f64>,
}

impl<'de> Deserialize<'de> for DriftChange {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let WrittenDrift { channel, unit, value, u95 } = WrittenDrift::deserialize(from)?;
        let change = value.zip(u95).map(|both| usable(&channel, both)).transpose()?;
        Ok(Self { channel, unit, change })
    }
}

impl Answer {
    /// Reads the text of `result.json`. One of the schema before this one is brought into this one: an
    /// implausible answer loses its numbers to [`fit`](Self::fit), as it would today.
    ///
    /// # Errors
    /// [`ReadError`] if it is none, or of another schema.
    ///
    /// ```
    /// use rigident_identify::answer::{Answer, ReadError};
    ///
    /// let old = r#"{"schema": "rigident/result/1", "mass_kg": 3.2}"#;
    /// assert!(matches!(Answer::read(old), Err(ReadError::Schema { found }) if found.ends_with("/1")));
    /// ```
    pub fn read(text: &str) -> Result<Self, ReadError> {
        let Named { schema } = serde_json::from_str(text)?;
        if let Some(text) = unfit(&serde_json::from_str(text)?) {
            return Err(ReadError::Text(printable::name(text).to_string()));
        }
        match schema.as_str() {
            SCHEMA => Ok(serde_json::from_str::<Self>(text)?.of_file()),
            EARLIER_SCHEMA => Ok(serde_json::from_str::<Self>(text)?.of_earlier_schema()),
            _ => Err(ReadError::Schema { found: schema }),
        }
    }

    /// Returns the answer of a command that ended without one, with the reason.
    pub fn failed(error: impl Into<String>) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            status: Status::Failed,
            error: Some(error.into()),
            date: super::context::now(),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::result::{Change, Changed, Drift};
    use super::*;

    #[test]
    fn a_failed_command_has_an_answer_too() {
        let failed = Answer::failed("no such file");
        let text = serde_json::to_string(&failed).unwrap();
        assert!(!text.contains("null"), "{text}");
        assert_eq!(Answer::read(&text).unwrap(), failed);
    }

    /// Whatever the form of numbers in the file, and whatever crates of the build want of them.
    #[test]
    fn an_answer_with_numbers_is_read_back() {
        let with = |state, truth| Parameter {
            name: "m".to_owned(),
            unit: "kg".to_owned(),
            state,
            truth,
            ..Parameter::default()
        };
        let measured = Measured { value: 1.234_567_890_123e-7, u95: 2e-9 };
        let answer = Answer {
            schema: SCHEMA.to_owned(),
            parameters: vec![
                with(ParameterState::Identified(measured), Some(1.0)),
                with(ParameterState::PriorDominated(measured), None),
                with(ParameterState::Contradicted, None),
                Parameter {
                    terms: vec![("a.m".to_owned(), 0.5)],
                    ..with(ParameterState::NotIdentified, None)
                },
            ],
            ..Answer::default()
        };
        assert_eq!(Answer::read(&serde_json::to_string(&answer).unwrap()).unwrap(), answer);
        let bare = r#"{"name": "m", "unit": "kg", "state": "identified"}"#;
        assert!(serde_json::from_str::<Parameter>(bare).is_err());
    }

    /// Numbers beside a name, not in an object of their own.
    #[test]
    fn steps_and_drifts_are_read_back() {
        let measured = Measured { value: -1.234_567_890_123e-7, u95: 2e-9 };
        let step =
            |name: &str| ParameterStep { name: name.to_owned(), unit: "kg m2".to_owned(), step: measured };
        let drift = |change| DriftChange { channel: "fx".to_owned(), unit: "N".to_owned(), change };
        let answer = Answer {
            schema: SCHEMA.to_owned(),
            change: Some(Change {
                time_s: measured,
                changed: Changed::Body,
                probability: 1e-9,
                steps: vec![step("a.Jxx"), step("b.Jzz")],
            }),
            drift: Some(Drift { elapsed_s: 12.5, changes: vec![drift(Some(measured)), drift(None)] }),
            ..Answer::default()
        };
        assert_eq!(Answer::read(&serde_json::to_string(&answer).unwrap()).unwrap(), answer);
    }

    /// Numbers that a stranger wrote in place of an answer.
    #[test]
    fn impossible_numbers_and_steering_texts_are_refused() {
        let with = |name: &str, value: f64, u95: f64| {
            let measured = ParameterState::Identified(Measured { value, u95 });
            let one = Parameter { name: name.to_owned(), state: measured, ..Parameter::default() };
            let answer = Answer { schema: SCHEMA.to_owned(), parameters: vec![one], ..Answer::default() };
            Answer::read(&serde_json::to_string(&answer).unwrap())
        };
        assert!(with("m", 1.0, 0.1).is_ok());
        for (value, u95) in [(1.0, -1.0), (1e308, 0.1), (1.0, 1e308)] {
            let said = with("m", value, u95).unwrap_err().to_string();
            assert!(said.contains("which no fit has"), "{said}");
        }
        for name in ["a\u{1b}[2J", "a\u{9b}b", "\u{202e}", &"x".repeat(1 << 20)] {
            assert!(matches!(with(name, 1.0, 0.1), Err(ReadError::Text(_))));
        }
    }

    /// What was written before the state `contradicted` existed is read as if it were written today.
    #[test]
    fn an_earlier_implausible_answer_loses_its_numbers() {
        let earlier = |status: &str| {
            serde_json::json!({
                "schema": "rigident/result/2", "status": status,
                "source": { "recording": "a", "rows": 9, "mcu": "host" },
                "parameters": [
                    { "name": "m", "unit": "kg", "state": "identified", "value": 3.2, "u95": 0.1 },
                    { "name": "Ixx", "unit": "kg m2", "state": "not_identified" },
                ],
                "mass_kg": 3.2, "physically_consistent": true,
                "consistency": { "distance_sd": 0.0, "probability": 1.0, "reversed": false },
                "channels": [], "counts": { "samples": 9, "rejected": 0, "gaps": 0, "rows": 9 },
                "rejected_rows": 0, "warnings": ["w"], "elapsed_s": 0.1,
            })
            .to_string()
        };
        let honest = Answer::read(&earlier("identified")).unwrap();
        assert_eq!((honest.schema.as_str(), honest.mass_kg, honest.fit), (SCHEMA, Some(3.2), None));
        let untrue = Answer::read(&earlier("implausible")).unwrap();
        let states: Vec<ParameterState> = untrue.parameters.iter().map(|p| p.state).collect();
        assert_eq!(states, [ParameterState::Contradicted, ParameterState::NotIdentified]);
        assert_eq!(
            (untrue.mass_kg, untrue.physically_consistent, untrue.consistency.as_ref()),
            (None, None, None)
        );
        let fit = untrue.fit.as_ref().unwrap();
        let numbers: Vec<(&str, f64, f64)> =
            fit.parameters.iter().map(|p| (p.name.as_str(), p.value, p.u95)).collect();
        assert_eq!((numbers, fit.consistency.is_some()), (vec![("m", 3.2, 0.1)], true));
        assert_eq!(Answer::read(&serde_json::to_string(&untrue).unwrap()).unwrap(), untrue);
    }

    #[test]
    fn texts_that_are_no_answer_are_refused_by_kind() {
        assert!(matches!(Answer::read("t_s,fx_n"), Err(ReadError::Json(_))));
        assert!(matches!(Answer::read("{}"), Err(ReadError::Schema { found }) if found.is_empty()));
        assert!(matches!(Answer::read("{\"schema\": \"rigident/result/3\"}"), Err(ReadError::Json(_))));
    }
}
