use std::io;
use std::time::Duration;

use crate::device::permission::ownership;

/// A byte link to a device: a serial port, or a simulated microcontroller.
pub trait Transport: Send {
    /// Writes all bytes.
    ///
    /// # Errors
    /// The link is gone.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Reads what there is, waiting up to `timeout` for the first byte; 0 if none came.
    ///
    /// # Errors
    /// The link is gone. A wait without bytes is not an error.
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;
}

/// A serial port.
pub struct SerialTransport(Box<dyn serialport::SerialPort>);

/// Default rate of the serial link, baud. A pseudo-terminal ignores it.
pub const BAUD: u32 = 921_600;

/// Why a port cannot be used, in words that say what to do.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// No such port.
    #[error("no port {0}: `rigident ports` lists those there are; is the cable in, the simulator running?")]
    Missing(String),
    /// It is there but may not be opened.
    #[error("no permission to open {0}: {advice}, or install the udev rule (`rigident doctor --udev-rule`)", advice = may_open(.0))]
    Permission(String),
    /// Some other program has it.
    #[error("port {0} is in use by another program: close that one first")]
    Busy(String),
    /// Anything else.
    #[error("{0} cannot be opened as a serial port: {1}; `rigident ports` lists those that are here")]
    Other(String, String),
}

/// What to type so that a port can be opened.
fn may_open(port: &str) -> String {
    ownership(port).map_or_else(
        || {
            "join the group that owns it (usually `sudo usermod -aG dialout $USER`, then log in again)"
                .to_owned()
        },
        |ownership| ownership.what_to_do(),
    )
}

impl SerialTransport {
    /// Opens a port, 8N1, exclusively.
    ///
    /// # Errors
    /// [`PortError`] says why not.
    pub fn open(path: &str) -> Result<Self, PortError> {
        let port = serialport::new(path, BAUD).timeout(Duration::from_millis(10)).open();
        port.map(Self).map_err(|error| {
            let text = error.to_string();
            match error.kind() {
                serialport::ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
                    PortError::Permission(path.into())
                }
                serialport::ErrorKind::Io(io::ErrorKind::NotFound) => PortError::Missing(path.into()),
                _ if text.contains("Permission denied") => PortError::Permission(path.into()),
                _ if text.contains("busy") || text.contains("exclusive") => PortError::Busy(path.into()),
                serialport::ErrorKind::NoDevice if !std::path::Path::new(path).exists() => {
                    PortError::Missing(path.into())
                }
                _ => PortError::Other(path.into(), text),
            }
        })
    }
}

impl Transport for SerialTransport {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut rest = bytes;
        while !rest.is_empty() {
            match self.0.write(rest) {
                Ok(0) => return Err(io::ErrorKind::BrokenPipe.into()),
                Ok(n) => rest = rest.get(n..).unwrap_or_default(),
                Err(error) if patience(&error) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.set_timeout(timeout.max(Duration::from_millis(1)))?;
        match self.0.read(buffer) {
            Ok(0) => Err(io::ErrorKind::BrokenPipe.into()),
            Err(error) if patience(&error) => Ok(0),
            other => other,
        }
    }
}

/// Only these two mean "try again"; everything else means that the port is gone.
fn patience(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}
