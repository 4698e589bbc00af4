//! The device's end of the line: frames in, frames out, answers first.

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::{Deque, Vec};
use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{Answer, Kind, Telemetry, encode};

/// Room for answers: two of the longest.
const ANSWERS: usize = 2 * MAX_FRAME;
/// Room for telemetry.
const TELEMETRY: usize = 8192;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Bytes on their way out, and the memory of the last answer.
pub(crate) struct Link {
    answers: Deque<u8, ANSWERS>,
    telemetry: Deque<u8, TELEMETRY>,
    /// A telemetry frame has been begun and must be ended before anything else is sent.
    inside_telemetry: bool,
    telemetry_sequence: u16,
    telemetry_dropped: u32,
    remembered: Option<Remembered>,
}

struct Remembered {
    sequence: u16,
    /// Of the command's payload.
    check: u32,
    frame: Vec<u8, MAX_FRAME>,
}

impl Link {
    pub(crate) const fn new() -> Self {
        Self {
            answers: Deque::new(),
            telemetry: Deque::new(),
            inside_telemetry: false,
            telemetry_sequence: 0,
            telemetry_dropped: 0,
            remembered: None,
        }
    }

    /// Sends the remembered answer once more if this very command was the last one answered.
    pub(crate) fn answer_again(&mut self, sequence: u16, payload: &[u8]) -> bool {
        let Some(remembered) = &self.remembered else { return false };
        if remembered.sequence != sequence || remembered.check != CRC32.checksum(payload) {
            return false;
        }
        if self.answers.capacity() - self.answers.len() >= remembered.frame.len() {
            for byte in &remembered.frame {
                let _ = self.answers.push_back(*byte);
            }
        }
        true
    }

    /// Queues an answer and remembers it. Without room it is not sent; the host will ask again.
    pub(crate) fn answer(&mut self, sequence: u16, command: &[u8], answer: &Answer) {
        let mut bytes = [0; MAX_FRAME];
        let Ok(length) = encode(Kind::Answer, sequence, answer, &mut bytes) else { return };
        let Ok(frame) = Vec::from_slice(bytes.get(..length).unwrap_or_default()) else { return };
        if self.answers.capacity() - self.answers.len() >= length {
            for byte in &frame {
                let _ = self.answers.push_back(*byte);
            }
        }
        self.remembered = Some(Remembered { sequence, check: CRC32.checksum(command), frame });
    }

    /// Forgets the last answer: a new host counts anew.
    pub(crate) fn forget(&mut self) {
        self.remembered = None;
    }

    /// Queues telemetry, or counts it as dropped. Whether it was queued.
    pub(crate) fn telemetry(&mut self, message: &Telemetry) -> bool {
        let mut bytes = [0; MAX_FRAME];
        let sequence = self.telemetry_sequence;
        let length = encode(Kind::Telemetry, sequence, message, &mut bytes).unwrap_or(usize::MAX);
        self.telemetry_sequence = sequence.wrapping_add(1);
        if self.telemetry.capacity() - self.telemetry.len() < length {
            self.telemetry_dropped = self.telemetry_dropped.saturating_add(1);
            return false;
        }
        for byte in bytes.iter().take(length) {
            let _ = self.telemetry.push_back(*byte);
        }
        true
    }

    pub(crate) fn telemetry_dropped(&self) -> u32 {
        self.telemetry_dropped
    }

    /// Bytes waiting.
    pub(crate) fn pending(&self) -> usize {
        self.answers.len() + self.telemetry.len()
    }

    /// Takes bytes to send; how many. Frames are never mixed, and answers go before telemetry.
    pub(crate) fn take(&mut self, out: &mut [u8]) -> usize {
        let mut count = 0;
        for slot in out {
            let byte = if self.inside_telemetry || self.answers.is_empty() {
                let byte = self.telemetry.pop_front();
                self.inside_telemetry = byte.is_some_and(|b| b != 0);
                byte
            } else {
                self.answers.pop_front()
            };
            let Some(byte) = byte else { break };
            *slot = byte;
            count += 1;
        }
        count
    }
}
