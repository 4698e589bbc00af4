//! No platform: the body is moved by hand, by a robot, by anything that is not driven from here.

use hexapod::MotionProgram;

use super::{Motion, Platform, PlatformError, Stop};

/// Represents whoever moves the body.
#[derive(Debug, Default)]
pub struct ByHand {
    stopped: bool,
}

impl Platform for ByHand {
    fn load(&mut self, _: &MotionProgram) -> Result<(), PlatformError> {
        Ok(())
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        self.stopped = false;
        Ok(())
    }

    fn stop(&mut self, _: Stop) -> Result<(), PlatformError> {
        self.stopped = true;
        Ok(())
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        Ok(if self.stopped { Motion::Holding } else { Motion::Moving })
    }
}
