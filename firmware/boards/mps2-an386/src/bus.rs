//! The sensors: SPI devices whose transfers travel to the simulator over two named pipes.
//!
//! The pipes are opened by semihosting: the whole machine stands still while it waits for an answer, so what
//! the firmware computes does not depend on how fast either side is. Frames: [`rigident_shared::wire::bus`].

use core::cell::RefCell;
use core::ffi::CStr;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{self, ErrorKind, ErrorType, SpiDevice};
#[cfg(feature = "storage")]
use rigident_shared::wire::bus::{FLASH_DONE, FLASH_HEADER_BYTES, FlashOperation, FlashRequest};
use rigident_shared::wire::bus::{
    MAX_TRANSFER_BYTES, Operation, POLL_ANSWER_BYTES, PollAnswer, REQUEST_HEADER_BYTES, RequestHeader,
};
use semihosting::experimental::env;
use semihosting::fs::File;
use semihosting::io::{Read as _, Write as _};

use crate::exit;
#[cfg(feature = "storage")]
use crate::flash::Data;

const PATH_BYTES: usize = 256;
const FRAME_BYTES: usize = REQUEST_HEADER_BYTES + MAX_TRANSFER_BYTES;

/// The two pipes, and room for one request.
pub struct Pipes {
    request: File,
    answer: File,
    frame: [u8; FRAME_BYTES],
}

impl Pipes {
    /// Opens the pipes named by the first two arguments of the command line: requests, then answers.
    ///
    /// # Panics
    /// If they are not given or cannot be opened: there is nothing to run on.
    pub fn open() -> Self {
        // Not `expect`, which would take the formatting code of the errors along.
        let Ok(arguments) = env::args::<{ 4 * PATH_BYTES }>() else {
            panic!("semihosting gives a command line")
        };
        let mut paths = (&arguments).skip(1);
        let mut next = || {
            let mut path = [0; PATH_BYTES];
            let Some(Ok(given)) = paths.next() else { panic!("two pipes on the command line") };
            // The last byte stays zero.
            for (to, from) in path.iter_mut().take(PATH_BYTES - 1).zip(given.bytes()) {
                *to = from;
            }
            path
        };
        let (request, answer) = (next(), next());
        let (Ok(request), Ok(answer)) =
            (CStr::from_bytes_until_nul(&request), CStr::from_bytes_until_nul(&answer))
        else {
            panic!("the last byte is zero")
        };
        let (Ok(request), Ok(answer)) = (File::create(request), File::open(answer)) else {
            panic!("both pipes open")
        };
        Self { request, answer, frame: [0; FRAME_BYTES] }
    }

    /// Asks what happened next. Ends the run if the simulator is gone or talks nonsense.
    pub fn poll(&mut self) -> PollAnswer {
        let mut answer = [0; POLL_ANSWER_BYTES];
        write_all(&mut self.request, &RequestHeader::POLL.encode());
        read_all(&mut self.answer, &mut answer);
        PollAnswer::decode(answer).unwrap_or_else(|| exit::bus_gone())
    }

    /// Makes one request to the flash. Returns true if it was done.
    #[cfg(feature = "storage")]
    pub fn flash(&mut self, operation: FlashOperation, offset: u32, data: Data<'_>) -> bool {
        let count = match &data {
            Data::None => 0,
            Data::Out(bytes) => bytes.len(),
            Data::In(bytes) => bytes.len(),
        };
        let length = FLASH_HEADER_BYTES + count;
        let header = RequestHeader { operation: Operation::TransferFlash, length: length as u16 }.encode();
        let Some(request) = self.frame.get_mut(..REQUEST_HEADER_BYTES + length) else { return false };
        let head = header.into_iter().chain(FlashRequest { operation, offset }.encode());
        let bytes = if let Data::Out(bytes) = &data { *bytes } else { &[] };
        let all = head.chain(bytes.iter().copied().chain(core::iter::repeat(0)));
        request.iter_mut().zip(all).for_each(|(slot, byte)| *slot = byte);
        write_all(&mut self.request, request);
        let Some(answer) = request.get_mut(..length) else { return false };
        read_all(&mut self.answer, answer);
        if let Data::In(bytes) = data {
            bytes.iter_mut().zip(answer.iter().skip(FLASH_HEADER_BYTES)).for_each(|(slot, b)| *slot = *b);
        }
        answer.first() == Some(&FLASH_DONE)
    }

    /// Makes one transfer under one chip select: the parts in order, zeros sent where a part only reads.
    fn transfer(&mut self, device: Operation, parts: &mut [spi::Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let length = parts.iter().map(|part| sent(part).1).sum::<usize>();
        let header = RequestHeader { operation: device, length: u16::try_from(length).unwrap_or(u16::MAX) };
        let request = self.frame.get_mut(..REQUEST_HEADER_BYTES + length).ok_or(ErrorKind::Other)?;

        let mut slots = request.iter_mut();
        slots.by_ref().zip(header.encode()).for_each(|(slot, byte)| *slot = byte);
        for part in parts.iter() {
            let (bytes, length) = sent(part);
            let mut bytes = bytes.iter();
            // Zipped this way round so that no slot is taken in vain when the part ends.
            for (_, slot) in (0..length).zip(slots.by_ref()) {
                *slot = bytes.next().copied().unwrap_or(0);
            }
        }
        write_all(&mut self.request, request);

        let answer = request.get_mut(..length).ok_or(ErrorKind::Other)?;
        read_all(&mut self.answer, answer);
        let mut bytes = answer.iter();
        for part in parts {
            let length = sent(part).1;
            let mut wanted = received(part).iter_mut();
            for (_, byte) in (0..length).zip(bytes.by_ref()) {
                if let Some(slot) = wanted.next() {
                    *slot = *byte;
                }
            }
        }
        Ok(())
    }
}

/// Returns what a part sends, and how many bytes it clocks.
fn sent<'a>(part: &'a spi::Operation<'_, u8>) -> (&'a [u8], usize) {
    match part {
        spi::Operation::Read(input) => (&[], input.len()),
        spi::Operation::Write(output) => (output, output.len()),
        spi::Operation::Transfer(input, output) => (output, input.len().max(output.len())),
        spi::Operation::TransferInPlace(both) => (both, both.len()),
        spi::Operation::DelayNs(_) => (&[], 0),
    }
}

/// Returns where a part puts what comes back.
fn received<'a>(part: &'a mut spi::Operation<'_, u8>) -> &'a mut [u8] {
    match part {
        spi::Operation::Read(input) | spi::Operation::Transfer(input, _) => input,
        spi::Operation::TransferInPlace(both) => both,
        spi::Operation::Write(_) | spi::Operation::DelayNs(_) => &mut [],
    }
}

fn write_all(pipe: &mut File, mut bytes: &[u8]) {
    while !bytes.is_empty() {
        match pipe.write(bytes) {
            Ok(n) if n > 0 => bytes = bytes.get(n..).unwrap_or_default(),
            _ => exit::bus_gone(),
        }
    }
}

fn read_all(pipe: &mut File, mut bytes: &mut [u8]) {
    while !bytes.is_empty() {
        match pipe.read(bytes) {
            Ok(n) if n > 0 => bytes = bytes.get_mut(n..).unwrap_or_default(),
            _ => exit::bus_gone(),
        }
    }
}

/// A sensor as its driver sees it.
pub struct Sensor<'a> {
    pipes: &'a RefCell<Pipes>,
    select: Operation,
}

impl<'a> Sensor<'a> {
    /// Returns the load cell's converter.
    pub fn load_cell(pipes: &'a RefCell<Pipes>) -> Self {
        Self { pipes, select: Operation::TransferLoadCell }
    }

    /// Returns the IMU.
    pub fn imu(pipes: &'a RefCell<Pipes>) -> Self {
        Self { pipes, select: Operation::TransferImu }
    }

    /// Returns the second link's IMU.
    pub fn second_imu(pipes: &'a RefCell<Pipes>) -> Self {
        Self { pipes, select: Operation::TransferSecondImu }
    }

    /// Returns the source of frames.
    pub fn frames(pipes: &'a RefCell<Pipes>) -> Self {
        Self { pipes, select: Operation::TransferFrame }
    }
}

impl ErrorType for Sensor<'_> {
    type Error = ErrorKind;
}

impl SpiDevice for Sensor<'_> {
    fn transaction(&mut self, parts: &mut [spi::Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.pipes.try_borrow_mut().map_err(|_| ErrorKind::Other)?.transfer(self.select, parts)
    }
}

/// Emulated sensors settle at once, and the processor's time is not theirs: nothing is waited for.
pub struct NoWait;

impl DelayNs for NoWait {
    fn delay_ns(&mut self, _: u32) {}
}
