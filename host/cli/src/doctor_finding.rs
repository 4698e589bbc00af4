//! The findings of `rigident doctor`: one line each.

use serde::Serialize;

/// The state of something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Standing {
    /// As it should be.
    Ok,
    /// Something is to be done.
    ToDo,
    /// It is not here, and not everybody needs it.
    NotHere,
}

/// The subject of the check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Check {
    /// A word: `ports`, `permissions`, `udev`, `emulator`, `image`, `device`, `sensors`, `events`, `clocks`.
    pub(super) what: &'static str,
    pub(super) standing: Standing,
    /// The finding.
    pub(super) found: String,
    /// The advice, where something is to be done or could be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) advice: Option<String>,
}

impl Check {
    pub(super) fn ok(what: &'static str, found: impl Into<String>) -> Self {
        Self { what, standing: Standing::Ok, found: found.into(), advice: None }
    }

    pub(super) fn to_do(what: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { what, standing: Standing::ToDo, found: found.into(), advice: Some(advice.into()) }
    }

    pub(super) fn not_here(what: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { what, standing: Standing::NotHere, found: found.into(), advice: Some(advice.into()) }
    }
}
