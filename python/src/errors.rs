//! Failures as exceptions.

use pyo3::prelude::*;
use rigident_cli::{Failure, Place};

/// Makes the exception of a failure.
pub fn raised(py: Python<'_>, failure: &Failure, told: &[String]) -> PyErr {
    let place = failure.place().map(|Place { file, line, index, column }| (file, line, index, column));
    let exception = py
        .import("rigident._errors")
        .and_then(|module| module.getattr("RigidentError"))
        .and_then(|class| class.call1((failure.to_string(), failure.status() as i32, place, told)));
    exception.map_or_else(|error| error, PyErr::from_value)
}
