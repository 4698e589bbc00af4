//! Checks of a recording that its factor keeps: what its rows cannot tell once they are merged.

use serde::{Deserialize, Serialize};

/// The findings of the checks of a recording when its factor was made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Checks {
    /// True if the recording contradicts what is stated of the rig, or is not that of one unchanging rigid
    /// body.
    pub contradicted: bool,
    /// Warnings, in words.
    pub warnings: Vec<String>,
}

/// A run behind a factor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckedRun {
    /// Name of its recording.
    pub recording: String,
    /// The findings of its checks; `None`: the file carries none.
    pub checks: Option<Checks>,
}

impl CheckedRun {
    /// Returns true if the checks found the recording not to be used.
    pub fn is_contradicted(&self) -> bool {
        self.checks.as_ref().is_some_and(|checks| checks.contradicted)
    }
}
