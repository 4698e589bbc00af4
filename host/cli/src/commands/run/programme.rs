use std::path::PathBuf;

use clap::Args;
use hexapod::{Geometry, MotionProgram};

use crate::Failure;
use crate::commands::run::at_terminal::AtTerminal;
use rigident::application::driving;
use rigident::application::planning::unchecked;

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

impl Programme {
    /// Returns it as the application takes it.
    pub(crate) fn typed(&self) -> driving::Programme {
        driving::Programme { duration_s: self.duration_s, plan: self.plan.clone() }
    }

    /// Returns the program for this machine.
    ///
    /// # Errors
    /// A duration that is too short or too long, or a plan that is not for this machine: bad input.
    pub(crate) fn program(&self, geometry: &Geometry) -> Result<MotionProgram, Failure> {
        let terminal = AtTerminal { yes: false, dry_run: false };
        Ok(self.typed().planned(geometry, &terminal)?.program)
    }
}

/// Says that collisions are not checked, where a rig file does not say how thick things are; what else where
/// it gives no joints.
pub(crate) fn tell_collisions(geometry: &Geometry) {
    if let Some(warning) = unchecked(geometry) {
        tell!("rigident: {warning}");
    }
}
