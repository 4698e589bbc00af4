use std::path::PathBuf;

use clap::Args;
use hexapod::experiment::thesis_program;
use hexapod::{BodyParameters, Geometry, MotionProgram, Segment};

use crate::Failure;
use crate::device::experiment::check_duration;
use rigident::application::planning::unchecked;
use rigident::plan::plan_file::PlanFile;
use rigident::present::Stage;

/// What the platform does.
#[derive(Args, Debug, Clone)]
pub struct Programme {
    /// Length of the default experiment, poses and motion together, s
    #[arg(long, default_value_t = 60.0, value_name = "S")]
    pub duration_s: f64,
    /// Do this instead: a plan that `rigident plan … --out` wrote for this rig
    #[arg(long, value_name = "FILE", conflicts_with = "duration_s")]
    pub plan: Option<PathBuf>,
}

/// The motion to be done.
pub(crate) struct Planned {
    pub(crate) program: MotionProgram,
    /// The body that it was made to carry, in P, if it was made for one.
    pub(crate) carries: Option<BodyParameters>,
}

impl Programme {
    /// Returns the motion for this machine.
    ///
    /// # Errors
    /// A duration that is too short or too long, or a plan that is not for this machine: bad input.
    pub(crate) fn planned(&self, geometry: &Geometry) -> Result<Planned, Failure> {
        if let Some(path) = &self.plan {
            let plan = PlanFile::read(path, geometry).map_err(Failure::input)?;
            let carries = plan.carries();
            let made_for =
                carries.map_or_else(String::new, |body| format!(", made for {:.2} kg", body.mass_kg));
            tell!("plan: {}{made_for}", plan.title);
            return Ok(Planned { program: plan.program, carries });
        }
        check_duration(self.duration_s)?;
        Ok(Planned { program: thesis_program(geometry, self.duration_s), carries: None })
    }

    /// Returns the program alone.
    ///
    /// # Errors
    /// Fails as [`Self::planned`] does.
    pub(crate) fn program(&self, geometry: &Geometry) -> Result<MotionProgram, Failure> {
        Ok(self.planned(geometry)?.program)
    }
}

/// Says that collisions are not checked, where a rig file does not say how thick things are; what else where
/// it gives no joints.
pub(crate) fn tell_collisions(geometry: &Geometry) {
    if let Some(warning) = unchecked(geometry) {
        tell!("rigident: {warning}");
    }
}

/// Returns the parts of a program, and the spans (s) of its first and last pose after a move: the same pose
/// twice.
pub(crate) fn stages(program: &MotionProgram) -> (Vec<Stage>, Option<[(f64, f64); 2]>) {
    let mut stages = Vec::new();
    let mut holds = Vec::new();
    let (mut at, mut poses, mut moved) = (0.0, 0, false);
    for segment in &program.segments {
        let duration = segment.duration_s();
        let name = match segment {
            Segment::Move { .. } | Segment::Path { .. } => {
                moved = true;
                None
            }
            Segment::Hold { .. } => {
                if moved {
                    poses += 1;
                    holds.push((at, at + duration));
                    Some(format!("pose {poses}"))
                } else {
                    Some("home".to_owned())
                }
            }
            Segment::Multisine { .. } | Segment::Sphere(_) => Some("motion".to_owned()),
        };
        if let Some(name) = name {
            stages.push(Stage { start_s: at, name });
        }
        at += duration;
    }
    if let Some(last) = stages.last_mut()
        && holds.len() > 1
    {
        last.name = "pose 1 again".to_owned();
    }
    let ends = match (holds.first(), holds.last()) {
        (Some(first), Some(last)) if holds.len() > 1 => Some([*first, *last]),
        _ => None,
    };
    (stages, ends)
}
