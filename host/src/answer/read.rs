//! Reading answers back from `result.json`.

use serde::Deserialize;

use super::Answer;
use super::result::{SCHEMA, Status};

/// Why a text is no answer that this program reads.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It is no JSON, or no object of this schema.
    #[error("this is no result of Rigident: {0}; give the result.json that a command of Rigident wrote")]
    Json(#[from] serde_json::Error),
    /// It is a result of another version.
    #[error(
        "this is a result of schema {found:?}, and this program reads {SCHEMA:?}: identify the recording again with this \
         version (`rigident identify RECORDING`)"
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

impl Answer {
    /// Reads the text of `result.json`.
    ///
    /// # Errors
    /// [`ReadError`] if it is none, or of another schema.
    ///
    /// ```
    /// use rigident::answer::{Answer, ReadError};
    ///
    /// let old = r#"{"schema": "rigident/result/1", "mass_kg": 3.2}"#;
    /// assert!(matches!(Answer::read(old), Err(ReadError::Schema { found }) if found.ends_with("/1")));
    /// ```
    pub fn read(text: &str) -> Result<Self, ReadError> {
        let Named { schema } = serde_json::from_str(text)?;
        if schema != SCHEMA {
            return Err(ReadError::Schema { found: schema });
        }
        Ok(serde_json::from_str(text)?)
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
    use super::*;

    #[test]
    fn a_failed_command_has_an_answer_too() {
        let failed = Answer::failed("no such file");
        let text = serde_json::to_string(&failed).unwrap();
        assert!(!text.contains("null"), "{text}");
        assert_eq!(Answer::read(&text).unwrap(), failed);
    }

    #[test]
    fn what_is_no_answer_is_refused_by_its_kind() {
        assert!(matches!(Answer::read("t_s,fx_n"), Err(ReadError::Json(_))));
        assert!(matches!(Answer::read("{}"), Err(ReadError::Schema { found }) if found.is_empty()));
        assert!(matches!(Answer::read("{\"schema\": \"rigident/result/2\"}"), Err(ReadError::Json(_))));
    }
}
