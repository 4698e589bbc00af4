//! What moves the rig's plate.
//!
//! Lives here: the [`Platform`] trait and its drivers ([`connect`] chooses by the address): the simulated rig in this
//! process (`LocalPlatform`) or as served ([`NetworkPlatform`]), PI hexapods ([`gcs`]), lines of set points ([`stream`]);
//! what is checked before ([`check`]) and compared after ([`tracking`]). May not live here: planning of motions, sensors.
//!
//! A motion program is loaded whole and checked, approached, and started; the platform follows it in its own time.

mod address;
mod by_hand;
pub mod check;
mod error;
pub mod gcs;
#[cfg(feature = "simulator")]
mod local;
mod network;
mod pace;
pub mod stream;
pub mod tracking;
mod way;

pub use address::{checks_itself, connect, port_of};
pub use by_hand::ByHand;
pub use error::PlatformError;
#[cfg(feature = "simulator")]
pub use local::LocalPlatform;
pub use network::NetworkPlatform;

use hexapod::{MotionProgram, Pose};

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

/// Where the plate should be and is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionSample {
    /// Time since the program's beginning, s, on the host's clock.
    pub time_s: f64,
    /// What the program says for that time.
    pub commanded: Pose,
    /// What the controller said then, if it says anything.
    pub measured: Option<Pose>,
}

/// A platform that follows programs.
pub trait Platform: Send {
    /// Checks and takes a program; nothing moves yet.
    ///
    /// # Errors
    /// Out of reach, too fast, or no answer.
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError>;
    /// Returns the way to the program's start from where the plate stands, or from where getting ready will leave it: what
    /// [`Platform::approach`] will drive; `None` where the controller adds it to the program.
    ///
    /// # Errors
    /// There is no straight way, or no answer.
    fn way(&mut self, _program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        Ok(None)
    }
    /// Makes the platform ready and brings the loaded program's plate to its start, as a motion of its own.
    /// The plate may move; it stops when `go_on` says no.
    ///
    /// # Errors
    /// The controller refuses, no answer, or told to stop.
    fn approach(&mut self, _go_on: &dyn Fn() -> bool) -> Result<(), PlatformError> {
        Ok(())
    }
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
    /// What it is doing. Whoever started a motion must ask often: a platform that nobody watches is stopped.
    ///
    /// # Errors
    /// No answer; what broke the motion, once.
    fn motion(&mut self) -> Result<Motion, PlatformError>;
    /// Where the plate must stand before anything is sent, if the platform goes by that; after a motion, where it was left.
    fn expects(&self) -> Option<Pose> {
        None
    }
    /// Starts the way to where the next connection expects the plate, and returns it; `None` if it stands there, or may be
    /// anywhere.
    ///
    /// # Errors
    /// It moves, its end is not known, or there is no way.
    fn go_home(&mut self) -> Result<Option<MotionProgram>, PlatformError> {
        Ok(None)
    }
    /// What of the state in which it was found its owner should know before anything moves, a sentence each.
    fn found(&self) -> Vec<String> {
        Vec::new()
    }
    /// Leaves it in the state in which it was found, the plate at rest.
    ///
    /// # Errors
    /// It does not come to rest, refuses, or does not answer.
    fn release(&mut self) -> Result<(), PlatformError> {
        Ok(())
    }
    /// What was commanded and measured since the last time.
    fn samples(&mut self) -> Vec<MotionSample> {
        Vec::new()
    }
}
