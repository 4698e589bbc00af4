//! The emulated board's sensor bus: how the board asks the simulator for a sensor transfer.
//!
//! Lives here: the frames of that bus and nothing else. May not live here: pipes, files, a register model.
//! Only boards without sensors of their own use it; a real board has an SPI peripheral instead. Next: the
//! board crate under `firmware/boards`, and `rigident_sim::runner` which answers.
//!
//! The board speaks, the simulator answers; there is never more than one request under way.
//!
//! | request | answer |
//! |---|---|
//! | `[0][0 u16 LE]` poll | `[event u8][time_ns u64 LE]`: what happened, and the capture time of the sample or the time now |
//! | `[1][len u16 LE][len bytes]` load-cell chip selected, `len` bytes clocked | the `len` bytes clocked back |
//! | `[2][len u16 LE][len bytes]` IMU selected, `len` bytes clocked | the `len` bytes clocked back |
//! | `[3][len u16 LE][len bytes]` second link's IMU selected, `len` bytes clocked | the `len` bytes clocked back |
//! | `[4][len u16 LE][len bytes]` source of frames selected, `len` bytes clocked | the `len` bytes clocked back ([`super::tree_frame`]) |
//! | `[5][len u16 LE][len bytes]` flash: a [`FlashRequest`] and its data | the `len` bytes, the first of which tells whether it was done |
//!
//! The simulator answers at once, always: the machine that waits for an answer stands still. With nothing to
//! report it says [`Event::Idle`].

/// Bytes of a request before its payload.
pub const REQUEST_HEADER_BYTES: usize = 3;
/// Bytes of the answer to a poll.
pub const POLL_ANSWER_BYTES: usize = 9;
/// The longest transfer under one chip select: a full IMU FIFO and its register address fit.
pub const MAX_TRANSFER_BYTES: usize = 2304;

/// Tells what the board asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Asks what happened next.
    Poll,
    /// One transfer with the load cell's converter selected.
    TransferLoadCell,
    /// One transfer with the IMU selected.
    TransferImu,
    /// One transfer with the second link's IMU selected.
    TransferSecondImu,
    /// One transfer with the source of frames selected.
    TransferFrame,
    /// One request to the flash that outlives the board.
    TransferFlash,
}

/// A request's first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RequestHeader {
    /// Tells what is asked for.
    pub operation: Operation,
    /// Bytes that follow, and bytes that come back from a transfer; 0 for a poll.
    pub length: u16,
}

/// Tells why a request header cannot be one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestError {
    /// No operation has this number.
    UnknownOperation(u8),
    /// Longer than [`MAX_TRANSFER_BYTES`], or a poll with a payload.
    Length(u16),
}

impl RequestHeader {
    /// The header of a poll.
    pub const POLL: Self = Self { operation: Operation::Poll, length: 0 };

    /// Returns the header's bytes as they are sent.
    pub const fn encode(self) -> [u8; REQUEST_HEADER_BYTES] {
        let [low, high] = self.length.to_le_bytes();
        let operation = match self.operation {
            Operation::Poll => 0,
            Operation::TransferLoadCell => 1,
            Operation::TransferImu => 2,
            Operation::TransferSecondImu => 3,
            Operation::TransferFrame => 4,
            Operation::TransferFlash => 5,
        };
        [operation, low, high]
    }

    /// Reads the header from its bytes.
    pub const fn decode(bytes: [u8; REQUEST_HEADER_BYTES]) -> Result<Self, RequestError> {
        let [operation, low, high] = bytes;
        let length = u16::from_le_bytes([low, high]);
        let operation = match operation {
            0 => Operation::Poll,
            1 => Operation::TransferLoadCell,
            2 => Operation::TransferImu,
            3 => Operation::TransferSecondImu,
            4 => Operation::TransferFrame,
            5 => Operation::TransferFlash,
            unknown => return Err(RequestError::UnknownOperation(unknown)),
        };
        let too_long = match operation {
            Operation::Poll => length != 0,
            _ => length as usize > MAX_TRANSFER_BYTES,
        };
        if too_long { Err(RequestError::Length(length)) } else { Ok(Self { operation, length }) }
    }
}

/// Bytes of a flash request before its data.
pub const FLASH_HEADER_BYTES: usize = 5;
/// The first byte of the answer to a flash request that was done.
pub const FLASH_DONE: u8 = 0xA5;

/// Tells what the board asks of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashOperation {
    /// The data that follow are replaced by what is there.
    Read,
    /// The data that follow are programmed: bits become 0 and never 1.
    Program,
    /// The sector that begins there is erased: all its bits become 1.
    Erase,
}

/// A flash request's first bytes: the operation, then where, u32 LE, bytes from the beginning of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashRequest {
    /// Tells what is asked for.
    pub operation: FlashOperation,
    /// Tells where.
    pub offset: u32,
}

impl FlashRequest {
    /// Returns the request's bytes as they are sent.
    pub const fn encode(self) -> [u8; FLASH_HEADER_BYTES] {
        let [a, b, c, d] = self.offset.to_le_bytes();
        let operation = match self.operation {
            FlashOperation::Read => 0,
            FlashOperation::Program => 1,
            FlashOperation::Erase => 2,
        };
        [operation, a, b, c, d]
    }

    /// Reads the request from its bytes. Returns `None` if no operation has this number.
    pub const fn decode(bytes: [u8; FLASH_HEADER_BYTES]) -> Option<Self> {
        let [operation, a, b, c, d] = bytes;
        let operation = match operation {
            0 => FlashOperation::Read,
            1 => FlashOperation::Program,
            2 => FlashOperation::Erase,
            _ => return None,
        };
        Some(Self { operation, offset: u32::from_le_bytes([a, b, c, d]) })
    }
}

/// Tells what a poll reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Nothing; the time is now.
    Idle,
    /// The load cell's converter has a frame, captured at the time given.
    LoadCellReady,
    /// The IMU has a packet, captured at the time given.
    ImuReady,
    /// The simulation is over: say what is left to say and leave.
    Exit,
    /// The second link's IMU has a packet, captured at the time given.
    SecondImuReady,
    /// There is a frame, captured at the time given.
    FrameReady,
}

/// The answer to a poll.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PollAnswer {
    /// Tells what happened.
    pub event: Event,
    /// Capture time of the sample, or the time now, ns.
    pub time_ns: u64,
}

impl PollAnswer {
    /// Returns the answer's bytes as they are sent.
    pub const fn encode(self) -> [u8; POLL_ANSWER_BYTES] {
        let event = match self.event {
            Event::Idle => 0,
            Event::LoadCellReady => 1,
            Event::ImuReady => 2,
            Event::Exit => 3,
            Event::SecondImuReady => 4,
            Event::FrameReady => 5,
        };
        let [a, b, c, d, e, f, g, h] = self.time_ns.to_le_bytes();
        [event, a, b, c, d, e, f, g, h]
    }

    /// Reads the answer from its bytes. Returns `None` if no event has this number.
    pub const fn decode(bytes: [u8; POLL_ANSWER_BYTES]) -> Option<Self> {
        let [event, a, b, c, d, e, f, g, h] = bytes;
        let event = match event {
            0 => Event::Idle,
            1 => Event::LoadCellReady,
            2 => Event::ImuReady,
            3 => Event::Exit,
            4 => Event::SecondImuReady,
            5 => Event::FrameReady,
            _ => return None,
        };
        Some(Self { event, time_ns: u64::from_le_bytes([a, b, c, d, e, f, g, h]) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_these_bytes() {
        assert_eq!(RequestHeader::POLL.encode(), [0, 0, 0]);
        let frame = RequestHeader { operation: Operation::TransferLoadCell, length: 30 };
        assert_eq!(frame.encode(), [1, 30, 0]);
        let fifo = RequestHeader { operation: Operation::TransferImu, length: 0x0123 };
        assert_eq!(fifo.encode(), [2, 0x23, 0x01]);
    }

    #[test]
    fn every_header_is_either_a_request_or_refused_and_never_both() {
        for operation in 0..=u8::MAX {
            for length in (0..=u16::MAX).step_by(97).chain([2304, 2305]) {
                let [low, high] = length.to_le_bytes();
                let bytes = [operation, low, high];
                match RequestHeader::decode(bytes) {
                    Ok(header) => assert_eq!(header.encode(), bytes),
                    Err(RequestError::UnknownOperation(n)) => assert!(n == operation && n > 5),
                    Err(RequestError::Length(n)) => {
                        assert!(n == length && (usize::from(n) > MAX_TRANSFER_BYTES || operation == 0));
                    }
                }
            }
        }
    }

    #[test]
    fn flash_requests_are_these_bytes() {
        let request = FlashRequest { operation: FlashOperation::Program, offset: 0x0102_0304 };
        assert_eq!(request.encode(), [1, 4, 3, 2, 1]);
        for operation in [FlashOperation::Read, FlashOperation::Program, FlashOperation::Erase] {
            let request = FlashRequest { operation, offset: u32::MAX - 7 };
            assert_eq!(FlashRequest::decode(request.encode()), Some(request));
        }
        assert_eq!(FlashRequest::decode([3, 0, 0, 0, 0]), None);
    }

    #[test]
    fn poll_answers_are_these_bytes() {
        let answer = PollAnswer { event: Event::ImuReady, time_ns: 0x0102_0304_0506_0708 };
        assert_eq!(answer.encode(), [2, 8, 7, 6, 5, 4, 3, 2, 1]);
        let more = [Event::SecondImuReady, Event::FrameReady];
        for event in [Event::Idle, Event::LoadCellReady, Event::ImuReady, Event::Exit].into_iter().chain(more)
        {
            let answer = PollAnswer { event, time_ns: u64::MAX - 5 };
            assert_eq!(PollAnswer::decode(answer.encode()), Some(answer));
        }
        assert_eq!(PollAnswer::decode([6, 0, 0, 0, 0, 0, 0, 0, 0]), None);
    }
}
