//! The programme of a platform.

use std::path::PathBuf;

use hexapod::experiment::{SHORTEST_S, thesis_program};
use hexapod::{BodyParameters, Geometry, MotionProgram, Segment};

use super::{Attendant, DrivingError};
use rigident_plan::plan_file::PlanFile;
use rigident_present::Stage;

/// The longest experiment, s.
const LONGEST_S: f64 = 3600.0;

/// The programme of a platform: a plan, or the built-in experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Programme {
    /// Length of the built-in experiment, s.
    pub duration_s: f64,
    /// The plan, if there is one.
    pub plan: Option<PathBuf>,
}

/// The motion to be done.
#[derive(Clone, Debug)]
pub struct Planned {
    /// The motion.
    pub program: MotionProgram,
    /// The body that it was made to carry, in P, if it was made for one.
    pub carries: Option<BodyParameters>,
}

impl Programme {
    /// Returns the motion for this machine.
    ///
    /// # Errors
    /// [`DrivingError::Duration`], [`DrivingError::Plan`]: a plan that is not for this machine.
    pub fn planned(&self, geometry: &Geometry, at: &dyn Attendant) -> Result<Planned, DrivingError> {
        if let Some(path) = &self.plan {
            let plan = PlanFile::read(path, geometry)?;
            let carries = plan.carries();
            let made_for =
                carries.map_or_else(String::new, |body| format!(", made for {:.2} kg", body.mass_kg));
            at.hear(&format!("plan: {}{made_for}", plan.title));
            return Ok(Planned { program: plan.program, carries });
        }
        check_duration(self.duration_s)?;
        Ok(Planned { program: thesis_program(geometry, self.duration_s), carries: None })
    }
}

/// Refuses a length, s, into which the built-in experiment does not fit.
///
/// # Errors
/// [`DrivingError::Duration`].
pub fn check_duration(duration_s: f64) -> Result<(), DrivingError> {
    if (SHORTEST_S..=LONGEST_S).contains(&duration_s) {
        Ok(())
    } else {
        Err(DrivingError::Duration(duration_s))
    }
}

/// Returns the parts of a program, and the spans (s) of its first and last pose after a move: the same pose
/// twice.
pub fn stages(program: &MotionProgram) -> (Vec<Stage>, Option<[(f64, f64); 2]>) {
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
