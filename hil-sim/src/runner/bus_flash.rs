//! The flash as the firmware in this process reaches it: over the bus, as an emulated board does.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_write,
};
use rigident_firmware::storage::{Layout, Store};
use rigident_shared::wire::bus::{FLASH_DONE, FLASH_HEADER_BYTES, FlashOperation, FlashRequest};

use super::sensor_bus::SensorBus;
use crate::flash::{SECTOR_BYTES, SECTORS, WORD_BYTES};

/// A bus that the drivers and the poll share.
pub(super) type SharedBus = Arc<Mutex<Box<dyn SensorBus>>>;

/// Returns the bus, also after a panic of another of its users: its state is whole between calls.
pub(super) fn lock(bus: &SharedBus) -> MutexGuard<'_, Box<dyn SensorBus>> {
    bus.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Bytes in one request.
const CHUNK: usize = 2048;

/// The flash behind a bus, with the large sectors of an STM32F405.
pub(super) struct BusFlash(SharedBus);

/// The error of a flash that failed, or of which there is none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

/// Returns a store in that flash: half of it for settings, half for checkpoints.
pub(super) fn store(bus: SharedBus) -> Option<Store<BusFlash>> {
    let (half, end) = ((SECTOR_BYTES * SECTORS / 2) as u32, (SECTOR_BYTES * SECTORS) as u32);
    Store::new(BusFlash(bus), Layout { settings: 0..half, checkpoints: half..end }).ok()
}

impl BusFlash {
    fn ask(&self, operation: FlashOperation, offset: u32, data: &mut [u8]) -> Result<(), Failed> {
        let header = FlashRequest { operation, offset }.encode();
        let mut request = [&header, &*data].concat();
        lock(&self.0).transfer_flash(&mut request);
        match request.split_at_checked(FLASH_HEADER_BYTES) {
            Some(([FLASH_DONE, ..], answer)) => {
                data.copy_from_slice(answer);
                Ok(())
            }
            _ => Err(Failed(NorFlashErrorKind::Other)),
        }
    }
}

impl ErrorType for BusFlash {
    type Error = Failed;
}

impl ReadNorFlash for BusFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        let mut at = offset;
        bytes.chunks_mut(CHUNK).try_for_each(|part| {
            let from = at;
            at += part.len() as u32;
            self.ask(FlashOperation::Read, from, part)
        })
    }

    fn capacity(&self) -> usize {
        SECTOR_BYTES * SECTORS
    }
}

impl NorFlash for BusFlash {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        check_erase(self, from, to).map_err(Failed)?;
        (from..to).step_by(SECTOR_BYTES).try_for_each(|at| self.ask(FlashOperation::Erase, at, &mut []))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        check_write(self, offset, bytes.len()).map_err(Failed)?;
        let mut at = offset;
        bytes.chunks(CHUNK).try_for_each(|part| {
            let from = at;
            at += part.len() as u32;
            self.ask(FlashOperation::Program, from, &mut part.to_vec())
        })
    }
}
