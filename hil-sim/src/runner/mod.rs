//! The host of the firmware when there is no board: this process, or an emulated microcontroller.
//!
//! Lives here: the byte stream to the firmware ([`Mcu`]), its two implementations, and how the simulated
//! sensors are handed to them. May not live here: what the bytes mean, or any physics. Before this:
//! [`crate::rig`]; after it: the host's session, or `rigident-sim serve`.
//!
//! Both run the same crate `rigident-firmware` against the same register models. In lock-step they give the
//! same bits, however fast or loaded the machine is: the firmware's clock is the simulated one, and a sample
//! is handed out only when the firmware asks for it.

use std::io;
use std::time::Duration;

mod bus_flash;
#[cfg(feature = "emulator")]
mod emulator_log;
#[cfg(feature = "firmware-log")]
mod emulator_log_decoded;
#[cfg(all(feature = "emulator", not(feature = "firmware-log")))]
mod emulator_log_unread;
#[cfg(feature = "emulator")]
mod error;
mod frame_bus;
mod in_process;
#[cfg(feature = "emulator")]
mod qemu;
#[cfg(feature = "emulator")]
mod requests;
mod sensor_bus;

#[cfg(feature = "emulator")]
pub use emulator_log::LogLine;
#[cfg(feature = "emulator")]
pub use error::RunnerError;
pub use frame_bus::{FrameBus, FrameGate, frames_of, suspended_frames_of, tracked_frames_of};
pub use in_process::InProcess;
#[cfg(feature = "emulator")]
pub use qemu::{Qemu, QemuOptions, StackUse, firmware_elf, watch_elf};
pub(crate) use sensor_bus::lock;
pub use sensor_bus::{PacedRig, SensorBus, WithFlash};

/// A microcontroller at the other end of a serial line.
///
/// Whoever starts a motion must keep reading: in lock-step the samples wait for room in the device's queues.
pub trait Mcu: Send {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// `BrokenPipe` if the microcontroller is gone; the message says why.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Takes what has arrived, at most `buffer.len()` bytes, waiting up to `timeout` for the first.
    /// 0 means that nothing arrived in time. With an empty buffer the microcontroller works for `timeout`,
    /// and what it sends waits in its queues or, if these are full, is dropped by it.
    ///
    /// # Errors
    /// `BrokenPipe` if the microcontroller is gone; the message says why. What it had sent before is given
    /// out first.
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Returns `"inproc"` or `"qemu"`: what the command line calls it.
    fn name(&self) -> &'static str;
}

/// The source that the simulated clock follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pacing {
    /// The firmware: the next sample is there when it asks. Time stands still while no motion program runs.
    LockStep,
    /// The wall clock: the platform holds its pose, and samples come, while no program runs. A late sample is
    /// handed out late, never dropped.
    RealTime,
}
