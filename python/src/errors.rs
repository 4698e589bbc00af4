//! Failures as exceptions.

use pyo3::prelude::*;
use rigident::application::Error;
use rigident_cli::{Failure, Place};
use rigident_shared::printable;

use crate::worded;

/// Why a job has no answer, worded for Python, with its exit status and its place.
#[derive(Debug)]
pub struct Refused {
    message: String,
    failure: Box<Failure>,
}

impl From<Error> for Refused {
    fn from(error: Error) -> Self {
        let message = printable::lines(&worded::error(&error)).to_string();
        Self { message, failure: Box::new(error.into()) }
    }
}

impl Refused {
    /// Returns that of arguments that cannot be.
    pub fn usage(message: String) -> Self {
        let message = printable::lines(&message).to_string();
        Self { failure: Box::new(Failure::input(&message)), message }
    }

    /// Makes the exception.
    pub fn raised(&self, py: Python<'_>, messages: &[String]) -> PyErr {
        exception(py, &self.message, &self.failure, messages)
    }
}

/// Makes the exception of the library's refusal, in the library's words.
pub fn refused(py: Python<'_>, error: impl Into<Error>) -> PyErr {
    Refused::from(error.into()).raised(py, &[])
}

/// Makes the exception of a command's failure.
pub fn raised(py: Python<'_>, failure: &Failure, messages: &[String]) -> PyErr {
    exception(py, &failure.to_string(), failure, messages)
}

fn exception(py: Python<'_>, message: &str, failure: &Failure, messages: &[String]) -> PyErr {
    let place = failure.place().map(|Place { file, line, index, column }| (file, line, index, column));
    let exception = py
        .import("rigident._errors")
        .and_then(|module| module.getattr("RigidentError"))
        .and_then(|class| class.call1((message, failure.status() as i32, place, messages)));
    exception.map_or_else(|error| error, PyErr::from_value)
}

/// Returns the value of a name, of those there are.
///
/// # Errors
/// There is no such name; lists them.
pub fn named<'a, T>(what: &str, name: &str, all: &'a [(&str, T)]) -> Result<&'a T, Refused> {
    all.iter().find(|(own, _)| *own == name).map(|(_, value)| value).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|(own, _)| *own).collect();
        Refused::usage(format!("{what} {name:?}: must be one of {}", names.join(", ")))
    })
}
