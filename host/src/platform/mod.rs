//! What moves the rig's plate.
//!
//! Lives here: the [`Platform`] trait and its drivers. May not live here: planning of motions, sensors.
//! A motion program is uploaded whole and started; the controller follows it in its own time.

mod network;

pub use network::NetworkPlatform;

use rigident_sim::platform::MotionProgram;
use rigident_sim::rig::{MotionState, Rig, RigError, SharedRig};

/// What the platform is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Holding a pose; no program is running.
    Holding,
    /// Following a program.
    Moving,
    /// The program has ended.
    Done,
}

/// Why the platform does not do as told.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PlatformError {
    /// Nobody answers.
    #[error("the platform at {address} does not answer ({reason}): is its controller on, the address right?")]
    Unreachable {
        /// Where it should be.
        address: String,
        /// What the network said.
        reason: String,
    },
    /// The controller refused.
    #[error("the platform refuses: {0}")]
    Refused(String),
}

/// A platform that follows programs.
pub trait Platform: Send {
    /// Checks and takes a program; nothing moves yet.
    ///
    /// # Errors
    /// Out of reach, too fast, or no answer.
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError>;
    /// Starts the loaded program.
    ///
    /// # Errors
    /// Nothing is loaded, or no answer.
    fn start(&mut self) -> Result<(), PlatformError>;
    /// Brings the plate to rest as fast as is smooth, and holds it.
    ///
    /// # Errors
    /// No answer.
    fn stop(&mut self) -> Result<(), PlatformError>;
    /// What it is doing.
    ///
    /// # Errors
    /// No answer.
    fn motion(&mut self) -> Result<Motion, PlatformError>;
}

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

    fn stop(&mut self) -> Result<(), PlatformError> {
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
