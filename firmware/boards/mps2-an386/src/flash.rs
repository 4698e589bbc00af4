//! The flash: a request to the simulator, which keeps its cells and so outlives the board.
//!
//! The sectors are those of an STM32F405, so that results here hold there.

use core::cell::RefCell;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_write,
};
use rigident_firmware::storage::{Layout, Store};
use rigident_shared::wire::bus::FlashOperation;

use crate::bus::Pipes;

/// Bytes of a sector.
pub const SECTOR_BYTES: usize = 128 * 1024;
/// Two for each journal.
const SECTORS: usize = 4;
/// Bytes in one request.
const CHUNK: usize = 2048;

/// The flash behind the pipes.
pub struct Flash<'a>(&'a RefCell<Pipes>);

/// The error of a flash that failed, or that the simulator has not.
#[derive(Clone, Copy, Debug)]
pub struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

/// Returns a store in that flash: half of it for settings, half for checkpoints. `None` if that does not fit
/// it.
pub fn store(pipes: &RefCell<Pipes>) -> Option<Store<Flash<'_>>> {
    const HALF: u32 = (SECTOR_BYTES * SECTORS / 2) as u32;
    Store::new(Flash(pipes), Layout { settings: 0..HALF, checkpoints: HALF..2 * HALF }).ok()
}

impl Flash<'_> {
    fn ask(&self, operation: FlashOperation, offset: u32, data: Data<'_>) -> Result<(), Failed> {
        let done = self.0.try_borrow_mut().is_ok_and(|mut pipes| pipes.flash(operation, offset, data));
        if done { Ok(()) } else { Err(Failed(NorFlashErrorKind::Other)) }
    }
}

/// The data that go with a request.
pub enum Data<'a> {
    /// Nothing.
    None,
    /// Bytes to be programmed.
    Out(&'a [u8]),
    /// The place for bytes that are read.
    In(&'a mut [u8]),
}

impl ErrorType for Flash<'_> {
    type Error = Failed;
}

impl ReadNorFlash for Flash<'_> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let mut at = offset;
        bytes.chunks_mut(CHUNK).try_for_each(|part| {
            let from = at;
            at += part.len() as u32;
            self.ask(FlashOperation::Read, from, Data::In(part))
        })
    }

    fn capacity(&self) -> usize {
        SECTOR_BYTES * SECTORS
    }
}

impl NorFlash for Flash<'_> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        check_erase(self, from, to).map_err(Failed)?;
        (from..to).step_by(SECTOR_BYTES).try_for_each(|at| self.ask(FlashOperation::Erase, at, Data::None))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        check_write(self, offset, bytes.len()).map_err(Failed)?;
        let mut at = offset;
        bytes.chunks(CHUNK).try_for_each(|part| {
            let from = at;
            at += part.len() as u32;
            self.ask(FlashOperation::Program, from, Data::Out(part))
        })
    }
}
