//! A logger that sends lines of CSV: over UDP, over a serial line, to a file.

use std::fmt::Write as _;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use super::{Played, Sample};
use crate::serve::port::Port;

/// Tells what is in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The wrench on the body.
    Wrench,
    /// Accelerometer and gyro.
    Imu,
    /// Both.
    Both,
}

impl Quantity {
    /// Returns the names of its columns.
    pub fn header(self) -> String {
        let mut header = String::from("seq,t_s");
        if self != Self::Imu {
            header.push_str(",fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm");
        }
        if self != Self::Wrench {
            header.push_str(",imu_ax_mps2,imu_ay_mps2,imu_az_mps2,imu_gx_radps,imu_gy_radps,imu_gz_radps");
        }
        header
    }

    /// Returns a line.
    pub fn line(self, number: u64, own_s: f64, sample: &Sample) -> String {
        let mut line = format!("{number},{own_s:.6}");
        let mut add = |values: &[f64]| {
            for value in values {
                // A text takes whatever is written.
                let _ = write!(line, ",{value:.9}");
            }
        };
        if self != Self::Imu {
            add(&sample.wrench);
        }
        if self != Self::Wrench {
            add(&sample.accel);
            add(&sample.gyro);
        }
        line.push('\n');
        line
    }
}

/// Serves as the logger. Dropping it switches it off.
pub struct LinesServer {
    terminal: Option<PathBuf>,
    leave: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl LinesServer {
    /// Sends a datagram for every line, and the header once a second.
    ///
    /// # Errors
    /// No socket.
    pub fn to_udp(to: SocketAddr, quantity: Quantity, played: Played) -> io::Result<Self> {
        let socket = UdpSocket::bind(if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" })?;
        Ok(Self::start(None, quantity, played, move |line| {
            // Nobody may be there yet.
            let _ = socket.send_to(line.as_bytes(), to);
            true
        }))
    }

    /// Writes lines on a serial line, of this name if one is given, and the header once a second.
    ///
    /// # Errors
    /// See [`Port::open`].
    pub fn on_port(name: Option<&Path>, quantity: Quantity, played: Played) -> io::Result<Self> {
        let mut port = Port::open(name)?;
        let terminal = port.terminal().to_owned();
        Ok(Self::start(Some(terminal), quantity, played, move |line| port.write(line.as_bytes()).is_ok()))
    }

    /// Hands lines to whoever takes them, until he says no.
    pub fn start(
        terminal: Option<PathBuf>,
        quantity: Quantity,
        played: Played,
        mut send: impl FnMut(&str) -> bool + Send + 'static,
    ) -> Self {
        let leave = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&leave);
        let every = (played.rate_hz as u64).max(1);
        let thread = std::thread::spawn(move || {
            let header = quantity.header() + "\n";
            let mut first = true;
            played.play(&stop, |number, sample| {
                if (std::mem::take(&mut first) || number % every == 0) && !send(&header) {
                    return false;
                }
                send(&quantity.line(number, played.own_s(number), sample))
            });
        });
        Self { terminal, leave, thread: Some(thread) }
    }

    /// Returns the line's path, on a serial line.
    pub fn terminal(&self) -> Option<&Path> {
        self.terminal.as_deref()
    }
}

impl Drop for LinesServer {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        // A panic there has printed itself.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
