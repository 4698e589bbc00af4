//! Plans for a platform.

use std::path::PathBuf;

use hexapod::BodyParameters;
use pyo3::prelude::*;
use rigident::application::{MotionOptions, PoseObjective, PoseOptions, plan_motion, plan_poses};
use rigident::plan::motion::Objective;

use crate::answers::text;
use crate::calls::watched;
use crate::errors::{Refused, named};
use crate::jobs::caller;

/// A plan: the object, the plan's file, warnings and notes.
type Planned = (String, String, Vec<String>);

/// The way poses are planned, as the fields of the command line say it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PoseWords {
    rig: Option<PathBuf>,
    n: usize,
    stroke_m: Option<f64>,
    margin: Option<f64>,
    objective: String,
    hold_s: Option<f64>,
}

/// The way a motion is planned, likewise.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct MotionWords {
    rig: Option<PathBuf>,
    objective: String,
    duration_s: f64,
    body: Option<String>,
    no_poses: bool,
    highest_hz: Option<f64>,
    stroke_m: Option<f64>,
}

impl PoseWords {
    fn typed(self) -> Result<PoseOptions, Refused> {
        let all = [PoseObjective::Condition, PoseObjective::Determinant, PoseObjective::WorstUncertainty];
        let default = PoseOptions::default();
        Ok(PoseOptions {
            rig: self.rig,
            n: Some(self.n),
            stroke_m: self.stroke_m,
            margin: self.margin.unwrap_or(default.margin),
            objective: *named("objective", &self.objective, &all.map(|own| (own.name(), own)))?,
            hold_s: self.hold_s.unwrap_or(default.hold_s),
            ..PoseOptions::default()
        })
    }
}

impl MotionWords {
    fn typed(self) -> Result<MotionOptions, Refused> {
        let objectives = [
            ("d-optimal", Objective::DOptimal),
            ("spheres", Objective::Spheres),
            ("rpy", Objective::RollPitchYaw),
            ("multisine", Objective::Multisine),
        ];
        let bodies = [
            ("horizontal", BodyParameters::thesis_horizontal()),
            ("vertical", BodyParameters::thesis_vertical()),
        ];
        let body = self.body.map(|name| {
            let body = *named("body", &name, &bodies)?;
            Ok::<_, Refused>((body, format!("the thesis' test body with plates, {name}")))
        });
        Ok(MotionOptions {
            rig: self.rig,
            objective: *named("objective", &self.objective, &objectives)?,
            duration_s: self.duration_s,
            body: body.transpose()?,
            poses: !self.no_poses,
            highest_hz: self.highest_hz,
            stroke_m: self.stroke_m,
            ..MotionOptions::default()
        })
    }
}

/// Plans still poses of a platform.
///
/// # Errors
/// Raises `RigidentError` if there are none.
#[pyfunction]
pub fn poses(py: Python<'_>, options: PoseWords) -> PyResult<Planned> {
    let done = watched(py, move |stop| -> Result<Planned, Refused> {
        let planned = plan_poses(&options.typed()?, &stop, &caller(&stop))?;
        let (file, _) = planned.file()?;
        let object = text(serde_json::to_string(&planned.object()))?;
        Ok((object, file.text(), planned.warnings))
    })?;
    done.map_err(|why| why.raised(py, &[]))
}

/// Plans a motion of a platform.
///
/// # Errors
/// Raises `RigidentError` if there is none.
#[pyfunction]
pub fn motion(py: Python<'_>, options: MotionWords) -> PyResult<Planned> {
    let done = watched(py, move |stop| -> Result<Planned, Refused> {
        let planned = plan_motion(&options.typed()?, &stop, &caller(&stop))?;
        let object = text(serde_json::to_string(&planned.object()))?;
        Ok((object, planned.file().text(), planned.warnings))
    })?;
    done.map_err(|why| why.raised(py, &[]))
}
