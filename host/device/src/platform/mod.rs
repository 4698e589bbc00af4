//! The drive of the rig's plate.
//!
//! Lives here: the [`Platform`] trait and its drivers ([`connect`] chooses by the address): the simulated rig
//! in this process (`LocalPlatform`) or as served ([`NetworkPlatform`]), PI hexapods ([`gcs`]), arms of
//! Universal Robots ([`ur`]), lines of set points ([`stream`]); what is checked before ([`check`]) and
//! compared after ([`tracking`]). May not live here: planning of motions, sensors.
//!
//! A motion program is loaded whole and checked, approached, and started; the platform follows it in its own
//! time.

mod address;
mod by_hand;
pub mod check;
mod clock;
mod error;
pub mod gcs;
#[cfg(feature = "simulator")]
mod local;
mod network;
mod pace;
pub mod stops;
pub mod stream;
pub mod tracking;
pub mod ur;
mod way;

pub use address::{Wire, checks_itself, connect, connect_simulated, port_of};
pub use by_hand::ByHand;
pub use clock::World;
pub use error::PlatformError;
#[cfg(feature = "simulator")]
pub use local::LocalPlatform;
pub use network::NetworkPlatform;
pub use pace::Watch;
pub use way::near;

use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;

use hexapod::{Load, MotionProgram, Pose};

/// The time that a controller may take to answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// Connects to the first address of a place that answers within a time.
///
/// # Errors
/// The place has no address, or the message of the last one that was tried.
fn tcp(place: impl ToSocketAddrs, within: Duration) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::other("the name has no address");
    for socket in place.to_socket_addrs()? {
        match TcpStream::connect_timeout(&socket, within) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// The activity of the platform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Holding a pose; no program is running.
    Holding,
    /// Following a program.
    Moving,
    /// The program has ended.
    Done,
}

/// The reason why a plate is brought to rest, which determines how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The motion has done what it was for: the plate goes to rest on its path, with no more force than the
    /// path has.
    Planned,
    /// Something is wrong, or somebody says stop: as fast as is smooth, and abruptly where that does not stop
    /// it.
    Alarm,
}

/// The traffic on the line to a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Said<'a> {
    /// A command from here.
    Command(&'a str),
    /// A reply from there.
    Reply(&'a str),
}

/// Takes what goes over the line, as it goes; it must not wait.
pub type Trace = Arc<dyn Fn(Said<'_>) + Send + Sync>;

/// The place where the plate should be and is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionSample {
    /// Time since the program's beginning, s, on the host's clock.
    pub time_s: f64,
    /// The pose of the program for that time.
    pub commanded: Pose,
    /// The pose that the controller reported then, if any.
    pub measured: Option<Pose>,
}

/// A platform that follows programs.
pub trait Platform: Send {
    /// Checks and takes a program; nothing moves yet.
    ///
    /// # Errors
    /// Out of reach, too fast, or no answer.
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError>;
    /// Returns the way to the program's start from where the plate is, or from where getting ready will leave
    /// it: what [`Platform::approach`] will drive; `None` where the controller adds it to the program.
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
    /// The controller refuses, no answer, or a command to stop.
    fn approach(&mut self, _go_on: &dyn Fn() -> bool) -> Result<(), PlatformError> {
        Ok(())
    }
    /// Starts the loaded program.
    ///
    /// # Errors
    /// Nothing is loaded, or no answer.
    fn start(&mut self) -> Result<(), PlatformError>;
    /// Brings the plate to rest, and holds it; an alarm takes the place of a planned stop.
    ///
    /// # Errors
    /// No answer.
    fn stop(&mut self, stop: Stop) -> Result<(), PlatformError>;
    /// Returns what it is doing. Whoever started a motion must ask often: a platform that nobody watches is
    /// stopped.
    ///
    /// # Errors
    /// No answer; what broke the motion, once.
    fn motion(&mut self) -> Result<Motion, PlatformError>;
    /// Returns where the plate is at rest, as far as the platform knows.
    ///
    /// # Errors
    /// It moves, or no answer.
    fn stands(&mut self) -> Result<Option<Pose>, PlatformError> {
        Ok(self.expects())
    }
    /// Returns where the plate must be before anything is sent, if the platform goes by that; after a motion,
    /// where it was left.
    fn expects(&self) -> Option<Pose> {
        None
    }
    /// Tells what the legs carry, so that the ways that the platform drives by itself are checked for their
    /// forces too.
    fn carries(&mut self, _load: Option<Load>) {}
    /// Hands on all that goes over the line from now on.
    fn trace(&mut self, _to: Trace) {}
    /// Returns the way that [`Platform::go_home`] will drive from the program's end; `None` if the plate
    /// stays there.
    ///
    /// # Errors
    /// There is no straight way.
    fn way_home(&self, _program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        Ok(None)
    }
    /// Starts the way to where the next connection expects the plate, and returns it; `None` if it is there,
    /// or may be anywhere.
    ///
    /// # Errors
    /// It moves, its end is not known, or there is no way.
    fn go_home(&mut self) -> Result<Option<MotionProgram>, PlatformError> {
        Ok(None)
    }
    /// Returns what of the state in which it was found its owner should know before anything moves, a
    /// sentence each.
    fn found(&self) -> Vec<String> {
        Vec::new()
    }
    /// Leaves it in the state in which it was found, the plate at rest; what is left otherwise, a sentence
    /// each.
    ///
    /// # Errors
    /// It does not come to rest, and nothing was changed then; it refuses, or does not answer.
    fn release(&mut self) -> Result<Vec<String>, PlatformError> {
        Ok(Vec::new())
    }
    /// Returns what was commanded and measured since the last time.
    fn samples(&mut self) -> Vec<MotionSample> {
        Vec::new()
    }
}
