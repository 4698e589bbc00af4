//! Why a text file of OpenSim's cannot be read.

/// Why it cannot be read, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpenSimError {
    /// A line is not what the format has there.
    #[error("line {line}: {what}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// The fault, and what was expected.
        what: String,
    },
    /// Something is not there.
    #[error("{0}")]
    Missing(String),
}

/// Returns the error of a line.
pub(super) fn at(line: usize, what: impl Into<String>) -> OpenSimError {
    OpenSimError::Line { line, what: what.into() }
}

/// Returns a number of a line.
pub(super) fn number(text: &str, line: usize, name: &str) -> Result<f64, OpenSimError> {
    text.trim().parse().map_err(|_| at(line, format!("{name} is {text:?}, no number")))
}
