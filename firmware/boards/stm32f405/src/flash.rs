//! The chip's own flash, where settings and checkpoints are stored: sectors 8 to 11 of an STM32F405, 128 KB
//! each.
//!
//! By RM0090, section 3.6. Code is not fetched while a sector is erased or a word is programmed: one second,
//! two at most, and 16 µs, 100 at most. So sectors are erased where no sample is taken, and the watchdog is
//! fed before each. What was written is read back, since the emulator's controller takes everything and does
//! nothing.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use rigident_firmware::storage::{Layout, Store};

use crate::registers::{
    FLASH_ACR, FLASH_CR, FLASH_KEYR, FLASH_OPTCR, FLASH_OPTKEYR, FLASH_SR, KEPT_BYTES, PWR_CR, PWR_CSR,
    kept_word, wait_for,
};
use crate::watchdog;

/// Bytes of a sector.
const SECTOR_BYTES: usize = 128 * 1024;
/// The first one that is ours.
const FIRST_SECTOR: u32 = 8;

const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
/// Programs.
const PG: u32 = 1;
/// Erases a sector.
const SER: u32 = 1 << 1;
const SECTOR_AT: u32 = 3;
/// Programs words of 32 bits: the supply is 2.7 V or more.
const WORDS: u32 = 0b10 << 8;
const START: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
const BUSY: u32 = 1 << 16;
/// Sequence, parallelism, alignment, protection, operation; cleared by ones.
const ERRORS: u32 = 0b1111 << 4 | 1 << 1;
/// The data cache: on, and emptied.
const DATA_CACHE: u32 = 1 << 10;
const EMPTY_DATA_CACHE: u32 = 1 << 12;
/// Reads until a word is programmed, of five cycles at 168 MHz: 300 µs.
const WORD_LOOKS: u32 = 10_000;
/// Reads until a sector is erased: 3 s.
const SECTOR_LOOKS: u32 = 100_000_000;

/// The part of the flash that is reserved for this.
pub struct Flash(());

/// The error of a flash that did not take what was written, or said that it failed.
#[derive(Clone, Copy, Debug)]
pub struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

const FAILED: Failed = Failed(NorFlashErrorKind::Other);

const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];
const OPTION_LOCK: u32 = 1;
const OPTION_START: u32 = 1 << 1;
/// The chip is held in reset below 2.7 to 3.0 V: level 3, whose bits are both clear. From the factory it is
/// off.
const BROWN_OUT: u32 = 0b11 << 2;
/// The supply is watched: 2.9 V, and says if it is below.
const WATCH_SUPPLY: u32 = 0b111 << 5 | 1 << 4;
const SUPPLY_IS_LOW: u32 = 1 << 2;

/// Has the chip stop where the supply is too low to program flash, if it does not yet: words of 32 bits need
/// 2.7 V, and code that runs on below it may write anything. Returns whether it does from the next start on.
pub fn guard_supply() -> bool {
    PWR_CR.change(0, WATCH_SUPPLY);
    if FLASH_OPTCR.read() & BROWN_OUT == 0 {
        return true;
    }
    if PWR_CSR.read() & SUPPLY_IS_LOW != 0 {
        return false;
    }
    OPTION_KEYS.iter().for_each(|key| FLASH_OPTKEYR.write(*key));
    // Nothing else of the option bytes is changed.
    FLASH_OPTCR.change(BROWN_OUT, 0);
    FLASH_OPTCR.change(0, OPTION_START);
    let done = wait_for(FLASH_SR, BUSY, 0, SECTOR_LOOKS);
    FLASH_OPTCR.change(0, OPTION_LOCK);
    done && FLASH_OPTCR.read() & BROWN_OUT == 0
}

/// Returns the store: half of the room for settings, half for checkpoints. `None` if it does not fit, or the
/// supply is not guarded. To be called once.
pub fn store() -> Option<Store<Flash>> {
    if !guard_supply() {
        return None;
    }
    const HALF: u32 = KEPT_BYTES as u32 / 2;
    Store::new(Flash(()), Layout { settings: 0..HALF, checkpoints: HALF..2 * HALF }).ok()
}

/// Lets the controller do something, and forgets what the data cache has of the cells.
fn unlocked(what: impl FnOnce() -> bool) -> Result<(), Failed> {
    if PWR_CSR.read() & SUPPLY_IS_LOW != 0 {
        return Err(FAILED);
    }
    KEYS.iter().for_each(|key| FLASH_KEYR.write(*key));
    FLASH_SR.write(ERRORS);
    let done = what() && FLASH_SR.read() & ERRORS == 0;
    FLASH_CR.write(LOCK);
    FLASH_ACR.change(DATA_CACHE, 0);
    FLASH_ACR.change(0, EMPTY_DATA_CACHE);
    FLASH_ACR.change(EMPTY_DATA_CACHE, DATA_CACHE);
    if done { Ok(()) } else { Err(FAILED) }
}

impl ErrorType for Flash {
    type Error = Failed;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        check_read(self, offset, bytes.len()).map_err(Failed)?;
        for (byte, at) in bytes.iter_mut().zip(offset as usize..) {
            let word = kept_word(at / 4).ok_or(FAILED)?.read().to_le_bytes();
            *byte = word.get(at % 4).copied().unwrap_or_default();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        KEPT_BYTES
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        check_erase(self, from, to).map_err(Failed)?;
        for start in (from..to).step_by(SECTOR_BYTES) {
            watchdog::feed();
            let sector = FIRST_SECTOR + start / SECTOR_BYTES as u32;
            unlocked(|| {
                FLASH_CR.write(SER | sector << SECTOR_AT | WORDS);
                FLASH_CR.change(0, START);
                wait_for(FLASH_SR, BUSY, 0, SECTOR_LOOKS)
            })?;
            let first = start as usize / 4;
            let is_erased = |k: usize| kept_word(k).is_some_and(|word| word.read() == u32::MAX);
            if !(first..first + SECTOR_BYTES / 4).all(is_erased) {
                return Err(FAILED);
            }
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        check_write(self, offset, bytes.len()).map_err(Failed)?;
        let (words, _) = bytes.as_chunks::<4>();
        let first = offset as usize / 4;
        unlocked(|| {
            FLASH_CR.write(PG | WORDS);
            words.iter().zip(first..).all(|(word, at)| {
                // Cells of this part alone are written, which no code and no constant of the image is in.
                kept_word(at).is_some_and(|cells| {
                    cells.write(u32::from_le_bytes(*word));
                    wait_for(FLASH_SR, BUSY, 0, WORD_LOOKS)
                })
            })
        })?;
        let is_there = |(word, at): (&[u8; 4], usize)| {
            kept_word(at).is_some_and(|cells| cells.read() == u32::from_le_bytes(*word))
        };
        if words.iter().zip(first..).all(is_there) { Ok(()) } else { Err(FAILED) }
    }
}
