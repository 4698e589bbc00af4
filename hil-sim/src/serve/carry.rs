use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::link::ByteLink;
use crate::runner::Mcu;

use super::port::Port;

/// The microcontroller as one end of a line that may be made faulty.
pub struct Firmware(pub Box<dyn Mcu>);

impl ByteLink for Firmware {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buffer, timeout)
    }
}

/// The time that one side is waited for while the other may have something.
const TURN: Duration = Duration::from_millis(1);

/// Carries bytes between the port and the firmware until `leave` is set. What the firmware says while nobody
/// has the port open is lost, as on any serial line; a user who does not read holds the firmware's output up,
/// and the rig keeps its time all the same.
///
/// # Errors
/// If either side is gone.
pub fn carry(port: &mut Port, firmware: &mut dyn ByteLink, leave: &AtomicBool) -> io::Result<()> {
    let mut buffer = [0; 4096];
    let mut waiting = VecDeque::new();
    while !leave.load(Ordering::Acquire) {
        if waiting.is_empty() {
            let n = firmware.read(&mut buffer, TURN)?;
            waiting.extend(buffer.iter().take(n));
        } else {
            firmware.read(&mut [], TURN)?;
        }
        if port.in_use()? {
            let taken = port.write(waiting.make_contiguous())?;
            waiting.drain(..taken);
        } else {
            waiting.clear();
        }
        let patience = if waiting.is_empty() { Duration::ZERO } else { TURN };
        let n = port.read(&mut buffer, patience)?;
        if let Some(bytes) = buffer.get(..n).filter(|bytes| !bytes.is_empty()) {
            firmware.write(bytes)?;
        }
    }
    Ok(())
}
