//! The device's end of the line: frames in, frames out, answers first.

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::{Deque, Vec};
use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{Answer, ErrorCode, Kind, Telemetry, encode};

/// Room for answers: two of the longest.
const ANSWERS: usize = 2 * MAX_FRAME;
/// Room for telemetry.
const TELEMETRY: usize = 8064;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Bytes on their way out, and the memory of the last answer.
pub(crate) struct Link {
    answers: Deque<u8, ANSWERS>,
    telemetry: Deque<u8, TELEMETRY>,
    /// A telemetry frame has been begun and must be ended before anything else is sent.
    inside_telemetry: bool,
    telemetry_sequence: u16,
    telemetry_dropped: u32,
    /// A frame of telemetry that is to be queued next.
    prepared: Vec<u8, MAX_FRAME>,
    remembered: Option<Remembered>,
}

struct Remembered {
    sequence: u16,
    /// Check sum of the command's payload.
    check: u32,
    frame: Vec<u8, MAX_FRAME>,
}

/// Tells what the memory says of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Recall {
    /// The command is to be obeyed.
    New,
    /// The command was the last one; its answer is on its way again.
    AnsweredAgain,
    /// The command is older than the last one.
    Stale,
}

/// Returns what a command's payload is identified by.
pub(crate) fn check(payload: &[u8]) -> u32 {
    CRC32.checksum(payload)
}

/// Queues a whole frame or nothing.
fn push<const N: usize>(queue: &mut Deque<u8, N>, frame: &[u8]) -> bool {
    let room = queue.capacity() - queue.len() >= frame.len();
    if room {
        for byte in frame {
            // There is room for all of them.
            let _ = queue.push_back(*byte);
        }
    }
    room
}

impl Link {
    pub(crate) const fn new() -> Self {
        Self {
            answers: Deque::new(),
            telemetry: Deque::new(),
            inside_telemetry: false,
            telemetry_sequence: 0,
            telemetry_dropped: 0,
            prepared: Vec::new(),
            remembered: None,
        }
    }

    /// Returns whether a command is new, the one that was answered last (which is answered again from
    /// memory), or older than that: a copy that was late on a line that overtakes, and must not act a second
    /// time.
    pub(crate) fn recall(&mut self, sequence: u16, check: u32) -> Recall {
        let Some(remembered) = &self.remembered else { return Recall::New };
        // Numbers wrap: the half behind is older.
        if sequence.wrapping_sub(remembered.sequence).cast_signed() < 0 {
            return Recall::Stale;
        }
        if remembered.sequence != sequence || remembered.check != check {
            return Recall::New;
        }
        push(&mut self.answers, &remembered.frame);
        Recall::AnsweredAgain
    }

    /// Queues an answer and stores it. Without room it is not sent; the host will ask again.
    pub(crate) fn answer(&mut self, sequence: u16, check: u32, answer: &Answer) {
        let mut bytes = [0; MAX_FRAME];
        let Ok(length) = encode(Kind::Answer, sequence, answer, &mut bytes) else { return };
        let Ok(frame) = Vec::from_slice(bytes.get(..length).unwrap_or_default()) else { return };
        push(&mut self.answers, &frame);
        self.remembered = Some(Remembered { sequence, check, frame });
    }

    /// Queues an error that is no command's answer to store.
    pub(crate) fn refuse(&mut self, sequence: u16, error: ErrorCode) {
        let mut bytes = [0; MAX_FRAME];
        let answer: Answer = Err(error);
        if let Ok(length) = encode(Kind::Answer, sequence, &answer, &mut bytes) {
            push(&mut self.answers, bytes.get(..length).unwrap_or_default());
        }
    }

    /// Forgets the last answer: a new host counts anew.
    pub(crate) fn forget(&mut self) {
        self.remembered = None;
    }

    /// Makes a frame of telemetry, to be queued with [`Self::queue_prepared`] or before the next one.
    pub(crate) fn prepare(&mut self, message: &Telemetry) {
        self.queue_prepared();
        let sequence = self.telemetry_sequence;
        self.telemetry_sequence = sequence.wrapping_add(1);
        // There is room for the longest frame.
        let _ = self.prepared.resize_default(MAX_FRAME);
        let length = encode(Kind::Telemetry, sequence, message, &mut self.prepared).unwrap_or(0);
        self.prepared.truncate(length);
    }

    /// Queues what was prepared. Returns true if there was something.
    pub(crate) fn queue_prepared(&mut self) -> bool {
        let waits = !self.prepared.is_empty();
        if waits && !push(&mut self.telemetry, &self.prepared) {
            self.telemetry_dropped = self.telemetry_dropped.saturating_add(1);
        }
        self.prepared.clear();
        waits
    }

    /// Returns whether something is prepared.
    pub(crate) fn has_prepared(&self) -> bool {
        !self.prepared.is_empty()
    }

    /// Queues telemetry, or counts it as dropped. Returns true if it was queued.
    pub(crate) fn telemetry(&mut self, message: &Telemetry) -> bool {
        self.queue_prepared();
        let mut bytes = [0; MAX_FRAME];
        let sequence = self.telemetry_sequence;
        let length = encode(Kind::Telemetry, sequence, message, &mut bytes).unwrap_or(usize::MAX);
        self.telemetry_sequence = sequence.wrapping_add(1);
        let queued = bytes.get(..length).is_some_and(|frame| push(&mut self.telemetry, frame));
        self.telemetry_dropped = self.telemetry_dropped.saturating_add(u32::from(!queued));
        queued
    }

    pub(crate) fn telemetry_dropped(&self) -> u32 {
        self.telemetry_dropped
    }

    /// Returns the number of bytes waiting.
    pub(crate) fn pending(&self) -> usize {
        self.answers.len() + self.telemetry.len()
    }

    /// Takes bytes to send. Returns their number. Frames are never mixed, and answers go before telemetry.
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
