//! Sockets and lines that wait for a limited time.

use std::io::{self, Read as _};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use super::SourceError;
use super::url::SourceUrl;
use crate::stop;

/// The time that a host may take to answer.
pub const PATIENCE: Duration = Duration::from_secs(3);

/// Returns the addresses of a host.
///
/// # Errors
/// The name has none.
pub fn resolve(url: &SourceUrl, host: &str, port: u16) -> Result<Vec<SocketAddr>, SourceError> {
    let found = (host, port).to_socket_addrs().map_err(|e| url.unreachable(e.to_string()))?;
    let found: Vec<SocketAddr> = found.collect();
    if found.is_empty() {
        return Err(url.unreachable(format!("{host} has no address")));
    }
    Ok(found)
}

/// Connects by TCP.
///
/// # Errors
/// Nobody answers, with what to check.
pub fn tcp(url: &SourceUrl, host: &str, port: u16, look_at: &str) -> Result<TcpStream, SourceError> {
    let mut last = String::new();
    for address in resolve(url, host, port)? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => {
                let set = stream
                    .set_read_timeout(Some(Duration::from_millis(100)))
                    .and_then(|()| stream.set_write_timeout(Some(PATIENCE)))
                    .and_then(|()| stream.set_nodelay(true));
                set.map_err(|e| url.unreachable(e.to_string()))?;
                return Ok(stream);
            }
            Err(error) => last = error.to_string(),
        }
    }
    Err(url.unreachable(format!("{last}; {look_at}")))
}

/// Reads to the end of a stream: at most `most` bytes, within [`PATIENCE`] in all, and no longer than
/// somebody waits for it.
///
/// # Errors
/// The stream's own, or the time is over: whoever sends a byte now and then holds nobody up.
pub fn read_within(stream: &mut TcpStream, most: usize) -> io::Result<Vec<u8>> {
    let (begun, mut bytes, mut buffer) = (Instant::now(), Vec::new(), [0; 4096]);
    stream.set_read_timeout(Some(Duration::from_millis(100)))?;
    while bytes.len() < most {
        if begun.elapsed() > PATIENCE || stop::is_asked() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        let room = most - bytes.len();
        let here = buffer.get_mut(..room.min(4096)).unwrap_or_default();
        match stream.read(here) {
            Ok(0) => break,
            Ok(n) => bytes.extend_from_slice(here.get(..n).unwrap_or_default()),
            Err(error) if is_patience(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(bytes)
}

/// Returns true where a wait has only ended.
pub fn is_patience(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}

/// Opens a serial port, 8N1.
///
/// # Errors
/// It cannot be opened, with what to do.
pub fn serial(url: &SourceUrl, default_baud: u32) -> Result<Box<dyn serialport::SerialPort>, SourceError> {
    let baud = url.integer("baud", 20_000_000)?.unwrap_or(default_baud);
    serialport::new(&url.place, baud).timeout(Duration::from_millis(100)).open().map_err(|error| {
        let text = error.to_string();
        url.unreachable(if text.contains("ermission") {
            format!(
                "{text}; add yourself to the group that owns it, usually `sudo usermod -aG dialout \
                     $USER`, and log in again"
            )
        } else {
            format!("{text}; `ports()` lists those that are here")
        })
    })
}

/// Reads what there is of a serial port, waiting up to the given time; 0 if nothing arrived.
///
/// # Errors
/// The port is gone.
pub fn read_serial(
    url: &SourceUrl,
    port: &mut dyn serialport::SerialPort,
    buffer: &mut [u8],
    timeout: Duration,
) -> Result<usize, SourceError> {
    let gone = |e: &dyn std::fmt::Display| {
        url.unreachable(format!("{e}; was its plug pulled? Plug it in and run again"))
    };
    port.set_timeout(timeout.max(Duration::from_millis(1))).map_err(|e| gone(&e))?;
    match port.read(buffer) {
        Ok(0) => Err(gone(&"it has hung up")),
        Err(error) if is_patience(&error) => Ok(0),
        Err(error) => Err(gone(&error)),
        Ok(n) => Ok(n),
    }
}
