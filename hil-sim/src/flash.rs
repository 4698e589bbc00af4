//! A flash that outlives its board, and loses its power.
//!
//! Lives here: [`SimulatedFlash`], cells that are only ever cleared bit by bit and set a sector at a time,
//! how often that happened, and a supply that ends after a set number of bytes. May not live here: what is
//! stored in it. Next:
//! [`crate::runner::WithFlash`], which puts it on the bus of a microcontroller.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_write,
};
use rigident_shared::wire::bus::{FLASH_DONE, FLASH_HEADER_BYTES, FlashOperation, FlashRequest};

/// Bytes of a word, the least that is programmed.
pub const WORD_BYTES: usize = 4;
/// Bytes of a large sector of an STM32F405.
pub const SECTOR_BYTES: usize = 128 * 1024;
/// The number of sectors: two for each journal.
pub const SECTORS: usize = 4;

/// The possible failures of a flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashFault {
    /// The supply ends after this many bytes were programmed or erased: the byte after is half done, and
    /// nothing afterwards.
    PowerCut {
        /// Bytes until then.
        after: u64,
    },
    /// One bit reads inverted, from now on.
    BitRot {
        /// Bit, from the beginning.
        bit: usize,
    },
    /// The flash does not answer.
    Dead,
}

/// The cells, and what happened to them.
#[derive(Clone, Debug)]
pub struct SimulatedFlash {
    cells: Vec<u8>,
    sector: usize,
    /// Erases of each sector.
    wear: Vec<u32>,
    /// Bytes until the supply ends.
    fuel: Option<u64>,
    dead: bool,
    spent: u64,
    overprogrammed: u64,
}

/// A flash that a board, a test and the next board share.
#[derive(Clone, Debug)]
pub struct SharedFlash(Arc<Mutex<SimulatedFlash>>);

impl SharedFlash {
    /// Returns an erased flash with the large sectors of an STM32F405.
    #[must_use]
    pub fn of_board() -> Self {
        Self::new(SECTOR_BYTES, SECTORS)
    }

    /// Returns an erased flash.
    #[must_use]
    pub fn new(sector: usize, sectors: usize) -> Self {
        Self(Arc::new(Mutex::new(SimulatedFlash::new(sector, sectors))))
    }

    /// Returns the flash, also after a panic of another of its users: its cells are what they are.
    pub fn lock(&self) -> MutexGuard<'_, SimulatedFlash> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl SimulatedFlash {
    /// Returns an erased flash.
    #[must_use]
    pub fn new(sector: usize, sectors: usize) -> Self {
        Self {
            cells: vec![0xFF; sector * sectors],
            sector,
            wear: vec![0; sectors],
            fuel: None,
            dead: false,
            spent: 0,
            overprogrammed: 0,
        }
    }

    /// Makes something go wrong.
    pub fn fail(&mut self, fault: FlashFault) {
        match fault {
            FlashFault::PowerCut { after } => self.fuel = Some(after),
            FlashFault::BitRot { bit } => {
                if let Some(cell) = self.cells.get_mut(bit / 8) {
                    *cell ^= 1 << (bit % 8);
                }
            }
            FlashFault::Dead => self.dead = true,
        }
    }

    /// Brings the supply back, for good.
    pub fn power_up(&mut self) {
        (self.fuel, self.dead) = (None, false);
    }

    /// Returns whether the supply has ended.
    #[must_use]
    pub fn is_off(&self) -> bool {
        self.fuel == Some(0)
    }

    /// Returns the number of bytes programmed or erased so far.
    #[must_use]
    pub fn spent(&self) -> u64 {
        self.spent
    }

    /// Returns how often each sector has been erased.
    #[must_use]
    pub fn wear(&self) -> &[u32] {
        &self.wear
    }

    /// Returns the number of bytes that were programmed though they were not erased: a mistake of whoever
    /// programs.
    #[must_use]
    pub fn overprogrammed(&self) -> u64 {
        self.overprogrammed
    }

    /// Returns the cells.
    #[must_use]
    pub fn cells(&self) -> &[u8] {
        &self.cells
    }

    /// Takes the energy for one byte. Returns false if the supply ends with it.
    fn burn(&mut self) -> bool {
        match &mut self.fuel {
            Some(0) => return false,
            Some(fuel) => *fuel -= 1,
            None => {}
        }
        self.spent += 1;
        true
    }

    /// Reads. Returns false if it does not answer.
    #[must_use]
    pub fn read(&self, offset: usize, bytes: &mut [u8]) -> bool {
        let from = offset.checked_add(bytes.len()).and_then(|end| self.cells.get(offset..end));
        match from {
            Some(from) if !self.dead && !self.is_off() => {
                bytes.copy_from_slice(from);
                true
            }
            _ => false,
        }
    }

    /// Programs: bits become 0, and never 1. Returns false if the supply ended or it does not answer.
    pub fn program(&mut self, offset: usize, bytes: &[u8]) -> bool {
        if self.dead || self.is_off() || offset.saturating_add(bytes.len()) > self.cells.len() {
            return false;
        }
        for (k, byte) in bytes.iter().enumerate() {
            let powered = self.burn();
            let Some(cell) = self.cells.get_mut(offset + k) else { return false };
            // What is half done has some of its bits.
            let cleared = if powered { !*byte } else { !*byte & 0x55 };
            self.overprogrammed += u64::from(powered && *cell != 0xFF && !*byte != 0);
            *cell &= !cleared;
            if !powered {
                return false;
            }
        }
        !self.is_off()
    }

    /// Erases the sector that begins there: byte by byte, as energy lasts. Returns false if the supply ended,
    /// the flash does not answer, or no sector begins there.
    pub fn erase(&mut self, offset: usize) -> bool {
        if self.dead || self.is_off() || !offset.is_multiple_of(self.sector) {
            return false;
        }
        let Some(wear) = self.wear.get_mut(offset / self.sector) else { return false };
        *wear += 1;
        for k in offset..offset + self.sector {
            let powered = self.burn();
            let Some(cell) = self.cells.get_mut(k) else { return false };
            *cell |= if powered { 0xFF } else { 0x55 };
            if !powered {
                return false;
            }
        }
        !self.is_off()
    }

    /// Answers a request of an emulated board in place.
    pub fn transfer(&mut self, bytes: &mut [u8]) {
        let done = bytes.split_first_chunk_mut::<FLASH_HEADER_BYTES>().is_some_and(|(header, data)| {
            FlashRequest::decode(*header).is_some_and(|FlashRequest { operation, offset }| {
                let offset = offset as usize;
                match operation {
                    FlashOperation::Read => self.read(offset, data),
                    FlashOperation::Program => self.program(offset, data),
                    FlashOperation::Erase => self.erase(offset),
                }
            })
        });
        if let Some(first) = bytes.first_mut() {
            *first = if done { FLASH_DONE } else { 0 };
        }
    }
}

/// The flash as a driver of sectors of `SECTOR` bytes sees it.
#[derive(Clone, Debug)]
pub struct FlashDriver<const SECTOR: usize>(pub SharedFlash);

/// The error of a flash that failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashFailed(NorFlashErrorKind);

impl NorFlashError for FlashFailed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

fn done(done: bool) -> Result<(), FlashFailed> {
    if done { Ok(()) } else { Err(FlashFailed(NorFlashErrorKind::Other)) }
}

impl<const SECTOR: usize> ErrorType for FlashDriver<SECTOR> {
    type Error = FlashFailed;
}

impl<const SECTOR: usize> ReadNorFlash for FlashDriver<SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        done(self.0.lock().read(offset as usize, bytes))
    }

    fn capacity(&self) -> usize {
        self.0.lock().cells.len()
    }
}

impl<const SECTOR: usize> NorFlash for FlashDriver<SECTOR> {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        check_erase(self, from, to).map_err(FlashFailed)?;
        (from..to).step_by(SECTOR).try_for_each(|offset| done(self.0.lock().erase(offset as usize)))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        check_write(self, offset, bytes.len()).map_err(FlashFailed)?;
        done(self.0.lock().program(offset as usize, bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_only_cleared_and_a_sector_sets_them_all() {
        let mut flash = SimulatedFlash::new(16, 2);
        assert!(flash.program(4, &[0x0F, 0xAA]));
        assert!(flash.program(4, &[0xF0]));
        assert_eq!(flash.cells()[4..6], [0x00, 0xAA]);
        assert_eq!(flash.overprogrammed(), 1);
        assert!(flash.erase(0) && !flash.erase(8) && !flash.erase(32));
        assert_eq!((flash.cells()[4], flash.wear()), (0xFF, &[1, 0][..]));
    }

    #[test]
    fn a_supply_that_ends_leaves_the_bytes_before_and_a_half_one() {
        let mut flash = SimulatedFlash::new(16, 1);
        flash.fail(FlashFault::PowerCut { after: 2 });
        assert!(!flash.program(0, &[0, 0, 0, 0]));
        assert_eq!(flash.cells()[..4], [0, 0, 0xAA, 0xFF]);
        assert!(flash.is_off() && !flash.program(8, &[0]) && !flash.erase(0) && !flash.read(0, &mut [0]));
        flash.power_up();
        assert!(flash.read(0, &mut [0]) && flash.program(8, &[0]));
    }
}
