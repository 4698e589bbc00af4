//! A body on springs.

use std::path::PathBuf;

use pyo3::prelude::*;
use rigident::application::{VibrationOptions, vibration_of, vibration_recording};

use crate::answers::{Answered, Kept, beside, text};
use crate::calls::watched;
use crate::errors::Refused;
use crate::jobs::{caller, plain};

/// A body on springs: the whole object, its answers by the modes and by the motion, the factors by their
/// files' names, the page.
#[derive(IntoPyObject)]
pub struct Found {
    json: String,
    exit_status: i32,
    by_modes: Option<Answered>,
    by_motion: Option<Answered>,
    factors: Vec<Kept>,
    page: String,
}

/// Identifies one body on springs by its modes and by its motion.
///
/// # Errors
/// Raises `RigidentError` if there is no answer.
#[pyfunction]
#[pyo3(signature = (recording, rig, modes))]
pub fn identify_vibration(
    py: Python<'_>,
    recording: PathBuf,
    rig: Option<PathBuf>,
    modes: Option<usize>,
) -> PyResult<Found> {
    let done = watched(py, move |stop| -> Result<Found, Refused> {
        plain(&recording.to_string_lossy())?;
        let options = VibrationOptions { rig, modes };
        let found = vibration_of(vibration_recording(&recording, &options)?, modes, &caller(&stop))?;
        let page = found.page(&found.spectrum()?);
        let [by_modes, by_motion] =
            found.answers().map(|answer| answer.map(|answer| beside(answer, &page, None)).transpose());
        Ok(Found {
            json: text(serde_json::to_string_pretty(&found))?,
            exit_status: i32::from(!found.is_identified()),
            by_modes: by_modes?,
            by_motion: by_motion?,
            factors: found.factors.iter().map(|(name, own)| (own.to_bytes(), (*name).to_owned())).collect(),
            page,
        })
    })?;
    done.map_err(|why| why.raised(py, &[]))
}
