//! The simulated rig of this process as a platform.

use hexapod::MotionProgram;
use rigident_sim::rig::{MotionState, Rig, RigError, SharedRig};

use super::{Motion, Platform, PlatformError, Stop};

/// The simulated rig in this very process.
pub struct LocalPlatform(pub SharedRig);

impl LocalPlatform {
    fn with<R>(&self, act: impl FnOnce(&mut Rig) -> R) -> R {
        // A thread that panicked holding the rig leaves it as it was: every change to it is complete.
        act(&mut self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }
}

fn refused(error: RigError) -> PlatformError {
    PlatformError::Refused(error.to_string())
}

impl Platform for LocalPlatform {
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        self.with(|rig| rig.load_program(program.clone())).map_err(refused)
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        self.with(Rig::start).map_err(refused)
    }

    fn stop(&mut self, _: Stop) -> Result<(), PlatformError> {
        self.with(Rig::stop);
        Ok(())
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        Ok(match self.with(|rig| rig.motion()) {
            MotionState::Holding => Motion::Holding,
            MotionState::Moving => Motion::Moving,
            MotionState::Done => Motion::Done,
        })
    }
}
