//! An Xsens MTi on a serial line: MTData2 with packet counter, fine time, acceleration and rate of turn.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use super::{Played, Sample};
use crate::serve::port::Port;

/// Serves as the IMU. Dropping it pulls its plug.
pub struct XsensServer {
    terminal: PathBuf,
    leave: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl XsensServer {
    /// Streams on a serial line, of this name if one is given.
    ///
    /// # Errors
    /// See [`Port::open`].
    pub fn open(name: Option<&Path>, played: Played) -> io::Result<Self> {
        let mut port = Port::open(name)?;
        let terminal = port.terminal().to_owned();
        let leave = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&leave);
        let thread = std::thread::spawn(move || {
            played.play(&stop, |number, sample| {
                // A line that nobody reads is full; what it does not take is gone.
                port.write(&message(number, played.own_s(number), sample)).is_ok()
            });
        });
        Ok(Self { terminal, leave, thread: Some(thread) })
    }

    /// Returns the line's path.
    pub fn terminal(&self) -> &Path {
        &self.terminal
    }
}

impl Drop for XsensServer {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        // A panic there has printed itself.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn message(number: u64, own_s: f64, sample: &Sample) -> Vec<u8> {
    let mut data = vec![0x10, 0x20, 2];
    data.extend((number as u16).to_be_bytes());
    data.extend([0x10, 0x60, 4]);
    // Ticks of 100 µs.
    data.extend(((1e4 * own_s).round() as u64 as u32).to_be_bytes());
    for (identifier, values) in [([0x40, 0x20], sample.accel), ([0x80, 0x20], sample.gyro)] {
        data.extend(identifier);
        data.push(12);
        values.iter().for_each(|v| data.extend((*v as f32).to_be_bytes()));
    }
    let mut bytes = vec![0xFA, 0xFF, 0x36, data.len() as u8];
    bytes.extend(&data);
    let sum = bytes.iter().skip(1).fold(0_u8, |sum, b| sum.wrapping_add(*b));
    bytes.push(0_u8.wrapping_sub(sum));
    bytes
}
