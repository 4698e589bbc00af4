use std::io;
use std::time::{Duration, Instant};

use crate::permission::ownership;

/// A byte link to a device: a serial port, or a simulated microcontroller.
pub trait Transport: Send {
    /// Writes all bytes.
    ///
    /// # Errors
    /// The link is gone.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Reads what there is, waiting up to `timeout` for the first byte; 0 if none arrived.
    ///
    /// # Errors
    /// The link is gone. A wait without bytes is not an error.
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize>;

    /// Changes the rate of the line, baud.
    ///
    /// # Errors
    /// It has none, or not this one.
    fn set_baud(&mut self, _baud: u32) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    /// Returns whether the line is out and is expected back: what is written meanwhile is lost, and nothing
    /// comes.
    fn is_out(&self) -> bool {
        false
    }
}

/// A serial port that may vanish and come back under its name: a cable pulled, a device that restarts.
pub struct SerialTransport {
    path: String,
    line: Line,
}

/// Tells whether the port is there.
enum Line {
    Open(Box<dyn serialport::SerialPort>),
    /// Since the first instant; last searched for at the second. What it said as it went.
    Out(Instant, Instant, String),
}

/// A port that has vanished is given up after this long.
const OUT_AT_MOST: Duration = Duration::from_secs(20);
/// The time between searches for a port that has vanished.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Default rate of the serial link, baud. A pseudo-terminal ignores it.
pub const BAUD: u32 = 921_600;

/// The reason why a port cannot be used, in words that say what to do.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// No such port.
    #[error("no port {0}: `ports()` lists those there are; is the cable in, the simulator running?")]
    Missing(String),
    /// The port is there but may not be opened.
    #[error("no permission to open {0}: {advice}, or install the udev rule (`doctor(udev_rule)`)", advice = may_open(.0))]
    Permission(String),
    /// Some other program has it.
    #[error("port {0} is in use by another program: close that one first")]
    Busy(String),
    /// Anything else.
    #[error("{0} cannot be opened as a serial port: {1}; `ports()` lists those that are here")]
    Other(String, String),
}

/// Returns what to type so that a port can be opened.
fn may_open(port: &str) -> String {
    ownership(port).map_or_else(
        || {
            "join the group that owns it (usually `sudo usermod -aG dialout $USER`, then log in again)"
                .to_owned()
        },
        |ownership| ownership.advice(),
    )
}

impl SerialTransport {
    /// Opens a port, 8N1, exclusively.
    ///
    /// # Errors
    /// [`PortError`] says why not.
    pub fn open(path: &str) -> Result<Self, PortError> {
        let opened = Self::port(path).map(|port| Self { path: path.to_owned(), line: Line::Open(port) });
        opened.map_err(|error| {
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

    /// Returns whether the line has a rate: a pseudo-terminal has none.
    pub fn has_rate(&self) -> bool {
        let place = std::fs::canonicalize(&self.path).unwrap_or_default();
        !place.starts_with("/dev/pts")
    }

    fn port(path: &str) -> serialport::Result<Box<dyn serialport::SerialPort>> {
        serialport::new(path, BAUD).timeout(Duration::from_millis(10)).open()
    }

    /// Returns the port, searched for again if it has vanished; `None` while it is out.
    fn line(&mut self) -> io::Result<Option<&mut dyn serialport::SerialPort>> {
        if let Line::Out(since, looked, said) = &mut self.line {
            if since.elapsed() > OUT_AT_MOST {
                let waited = OUT_AT_MOST.as_secs();
                let words = format!("{said}; {} did not come back within {waited} s", self.path);
                return Err(io::Error::new(io::ErrorKind::BrokenPipe, words));
            }
            if looked.elapsed() < LOOK_EVERY {
                return Ok(None);
            }
            *looked = Instant::now();
            match Self::port(&self.path) {
                Ok(port) => self.line = Line::Open(port),
                Err(_) => return Ok(None),
            }
        }
        match &mut self.line {
            Line::Open(port) => Ok(Some(port.as_mut())),
            Line::Out(..) => Ok(None),
        }
    }

    fn goes_out(&mut self, error: &io::Error) {
        let now = Instant::now();
        self.line = Line::Out(now, now, error.to_string());
    }
}

impl Transport for SerialTransport {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(port) = self.line()? else { return Ok(()) };
        if let Err(error) = write_all(port, bytes) {
            self.goes_out(&error);
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let timeout = timeout.max(Duration::from_millis(1));
        let Some(port) = self.line()? else {
            std::thread::sleep(timeout.min(LOOK_EVERY));
            return Ok(0);
        };
        let read = port.set_timeout(timeout).map_err(io::Error::from).and_then(|()| port.read(buffer));
        match read {
            Ok(n) if n > 0 => Ok(n),
            Err(error) if patience(&error) => Ok(0),
            Ok(_) => {
                self.goes_out(&io::ErrorKind::BrokenPipe.into());
                Ok(0)
            }
            Err(error) => {
                self.goes_out(&error);
                Ok(0)
            }
        }
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        match &mut self.line {
            Line::Open(port) => Ok(port.set_baud_rate(baud)?),
            // It comes back with the rate that it starts with.
            Line::Out(..) => Ok(()),
        }
    }

    fn is_out(&self) -> bool {
        matches!(self.line, Line::Out(..))
    }
}

fn write_all(port: &mut dyn serialport::SerialPort, bytes: &[u8]) -> io::Result<()> {
    let mut rest = bytes;
    while !rest.is_empty() {
        match port.write(rest) {
            Ok(0) => return Err(io::ErrorKind::BrokenPipe.into()),
            Ok(n) => rest = rest.get(n..).unwrap_or_default(),
            Err(error) if patience(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Returns true for the two errors that mean "try again"; everything else means that the port is gone.
fn patience(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}

#[cfg(all(test, unix))]
mod tests {
    use std::io::{Read, Write};
    use std::os::unix::fs::symlink;

    use serialport::{SerialPort, TTYPort};

    use super::*;

    /// Reads until something comes.
    fn heard(transport: &mut SerialTransport) -> Vec<u8> {
        let mut buffer = [0; 64];
        let deadline = Instant::now() + Duration::from_secs(10);
        while Instant::now() < deadline {
            let n = transport.read(&mut buffer, Duration::from_millis(20)).unwrap();
            if n > 0 {
                return buffer[..n].to_vec();
            }
        }
        Vec::new()
    }

    #[test]
    fn a_port_that_vanishes_is_waited_for_and_used_again() {
        let place = tempfile::tempdir().unwrap();
        let name = place.path().join("port");
        let appear = || {
            let (device, port) = TTYPort::pair().unwrap();
            symlink(port.name().unwrap(), &name).unwrap();
            (device, port)
        };
        let (mut device, port) = appear();
        let mut transport = SerialTransport::open(name.to_str().unwrap()).unwrap();
        device.write_all(b"one").unwrap();
        assert_eq!(heard(&mut transport), b"one");
        drop((device, port));
        std::fs::remove_file(&name).unwrap();
        while !transport.is_out() {
            transport.read(&mut [0; 8], Duration::from_millis(5)).unwrap();
        }
        // What is said meanwhile is lost, and nobody waits for it.
        transport.write(b"lost").unwrap();
        let (mut device, _port) = appear();
        device.write_all(b"two").unwrap();
        assert_eq!(heard(&mut transport), b"two");
        transport.write(b"three").unwrap();
        let mut said = [0; 5];
        device.set_timeout(Duration::from_secs(5)).unwrap();
        device.read_exact(&mut said).unwrap();
        assert!(&said == b"three" && !transport.is_out());
    }
}
