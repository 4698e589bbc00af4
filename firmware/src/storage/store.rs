use core::ops::Range;

use embedded_storage::nor_flash::NorFlash;
use postcard_schema::Schema;
use postcard_schema::key::hash::fnv1a64::hash_ty_path;
use rigident_shared::wire::{CounterReport, Kept, KeptRun, SCHEMA_HASH, Settings};
use serde::{Deserialize, Serialize};

use super::journal::{Guarded, Journal, JournalError};
use super::record::{self, HEADER_BYTES, RECORD_BYTES, RecordError, RecordKind, Writer};
use crate::version::FIRMWARE_HASH;

/// Holds what precedes the factor's numbers in a checkpoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct CheckpointHead {
    /// The events until then.
    pub counters: CounterReport,
    /// Index of the reading that `Inject` is to bring next.
    pub next_index: u32,
    /// Number of the next reading that is streamed.
    pub next_reading: u32,
    /// Time, ns.
    pub time_ns: u64,
    /// Rows in the factor.
    pub rows: u32,
}

/// Hash of everything that is recorded.
const SCHEMA: u64 =
    SCHEMA_HASH ^ u64::from_le_bytes(hash_ty_path::<(Settings, CheckpointHead)>("rigident/kept"));

/// Tells where in the flash each item is stored: bytes from its beginning, whole sectors, two at least each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The journal of settings.
    pub settings: Range<u32>,
    /// The journal of checkpoints.
    pub checkpoints: Range<u32>,
}

/// Tells that a layout is not one of whole sectors, two at least for each journal, apart and within the
/// flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayoutError;

/// Tells why something was not stored or not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The flash fails.
    Flash,
    /// There is no room left for it.
    Full,
    /// The content cannot be read, or could not be written.
    Damaged,
    /// There is no such run.
    NoSuchRun,
}

impl From<JournalError> for StoreError {
    fn from(error: JournalError) -> Self {
        match error {
            JournalError::Flash => Self::Flash,
            JournalError::Full => Self::Full,
            JournalError::Damaged => Self::Damaged,
        }
    }
}

/// The flash with what is stored in it, and room for one record. A board keeps it beside its [`crate::Path`],
/// off its stack.
pub struct Store<F> {
    flash: Guarded<F>,
    layout: Layout,
    writer: Writer,
    buffer: [u8; RECORD_BYTES],
}

impl<F: NorFlash> Store<F> {
    /// Returns a store in this part of a flash. Nothing is read yet.
    ///
    /// # Errors
    /// [`LayoutError`] if the layout does not fit the flash.
    pub fn new(flash: F, layout: Layout) -> Result<Self, LayoutError> {
        let (sector, capacity) = (F::ERASE_SIZE as u32, flash.capacity() as u32);
        let fits = |range: &Range<u32>| {
            range.start.is_multiple_of(sector)
                && range.end.is_multiple_of(sector)
                && range.end <= capacity
                && range.end.saturating_sub(range.start) >= 2 * sector
        };
        let Layout { settings, checkpoints } = &layout;
        let apart = settings.end <= checkpoints.start || checkpoints.end <= settings.start;
        // Records are written in whole words.
        let words = RECORD_BYTES.is_multiple_of(F::WRITE_SIZE);
        if !(fits(settings) && fits(checkpoints) && apart && words) {
            return Err(LayoutError);
        }
        let writer = Writer { schema: SCHEMA, firmware: FIRMWARE_HASH };
        let flash = Guarded { flash, may_erase: false };
        Ok(Self { flash, layout, writer, buffer: [0; RECORD_BYTES] })
    }

    /// Makes the store write as the firmware of this hash does.
    #[must_use]
    pub fn written_by(mut self, firmware: u32) -> Self {
        self.writer.firmware = firmware;
        self
    }

    /// Gives the flash back.
    pub fn into_flash(self) -> F {
        self.flash.flash
    }

    /// Tells what is stored. A journal that a power cut left in disorder is put in order, for which a sector
    /// may be erased: not while samples are taken.
    pub fn look(&mut self) -> Kept {
        self.flash.may_erase = true;
        let found = self.find();
        self.flash.may_erase = false;
        found.unwrap_or_else(|error| match error {
            StoreError::Flash => Kept::NoStorage,
            _ => Kept::Damaged,
        })
    }

    fn find(&mut self) -> Result<Kept, StoreError> {
        let found = self.scan(Wanted::Settings)?;
        match found.kept {
            Kept::Run(run) => Ok(self.scan(Wanted::Checkpoints(run.run))?.kept),
            other => Ok(other),
        }
    }

    /// Goes through a journal.
    #[inline(never)]
    fn scan(&mut self, wanted: Wanted) -> Result<Scan, StoreError> {
        let Self { flash, layout, writer, buffer } = self;
        let writer = *writer;
        let (range, kept) = match wanted {
            Wanted::Settings | Wanted::SettingsAt(_) => (layout.settings.clone(), Kept::Nothing),
            Wanted::Checkpoints(run) => {
                (layout.checkpoints.clone(), Kept::Run(KeptRun { run, ..KeptRun::default() }))
            }
            Wanted::CheckpointAt(_) => (layout.checkpoints.clone(), Kept::Nothing),
        };
        let mut scan = Scan { kept, last: None, length: 0 };
        Journal::new(flash, range)?.each(buffer, |number, bytes| match wanted {
            Wanted::Settings => {
                (scan.kept, scan.last) = (kept_settings(bytes, writer), Some(number));
                true
            }
            Wanted::Checkpoints(run) => {
                if let (Some((head, _)), Kept::Run(kept)) = (checkpoint(bytes, writer, run), &mut scan.kept) {
                    let checkpoints = kept.checkpoints.saturating_add(1);
                    *kept = KeptRun { checkpoints, ..reported(kept, &head) };
                    scan.last = Some(number);
                }
                true
            }
            Wanted::SettingsAt(wanted) | Wanted::CheckpointAt(wanted) => {
                if number == wanted {
                    scan.length = bytes.len();
                }
                number < wanted
            }
        })?;
        Ok(scan)
    }

    /// Begins a run with these settings: they are stored, with the number after that of the run before, and
    /// room is prepared for checkpoints. Sectors may be erased: not while samples are taken.
    ///
    /// # Errors
    /// [`StoreError`] says why not. The run before is then still stored, or nothing.
    pub fn begin_run(&mut self, settings: &Settings) -> Result<KeptRun, StoreError> {
        self.flash.may_erase = true;
        let begun = self.begin_erasing(settings);
        self.flash.may_erase = false;
        begun
    }

    fn begin_erasing(&mut self, settings: &Settings) -> Result<KeptRun, StoreError> {
        let before = match self.find() {
            Ok(Kept::Run(run)) => run.run,
            Err(StoreError::Flash) => return Err(StoreError::Flash),
            Err(_) => {
                // What could not be put in order is of no use to anybody.
                Journal::new(&mut self.flash, self.layout.settings.clone())?.erase()?;
                Journal::new(&mut self.flash, self.layout.checkpoints.clone())?.erase()?;
                0
            }
            Ok(_) => 0,
        };
        let run = before.wrapping_add(1).max(1);
        let payload = self.buffer.get_mut(HEADER_BYTES..).unwrap_or_default();
        let length = postcard::to_slice(settings, payload).map_err(|_| StoreError::Damaged)?.len();
        let record = record::seal(&mut self.buffer, RecordKind::Settings, self.writer, run, length);
        let record = record.ok_or(StoreError::Damaged)?;
        Journal::new(&mut self.flash, self.layout.settings.clone())?.append(record, true)?;
        self.prepare()?;
        Ok(KeptRun { run, ..KeptRun::default() })
    }

    /// Makes half of the room free: from the record of the new run on all checkpoints are void.
    fn prepare(&mut self) -> Result<(), StoreError> {
        let range = self.layout.checkpoints.clone();
        let half = (range.end - range.start) / 2;
        let mut journal = Journal::new(&mut self.flash, range)?;
        if journal.room().is_ok_and(|room| room >= half.saturating_sub(F::ERASE_SIZE as u32 / 8)) {
            return Ok(());
        }
        Ok(journal.erase()?)
    }

    /// Returns the number of bytes in which checkpoints are stored.
    pub fn checkpoint_bytes(&self) -> u32 {
        self.layout.checkpoints.end - self.layout.checkpoints.start
    }

    /// Appends a checkpoint of this run: what its head says, and the factor's numbers, which `write` leaves
    /// in the slice it is given. Returns the number of bytes of flash that it took. Nothing is erased.
    ///
    /// # Errors
    /// [`StoreError::Full`] if nothing is left of what was prepared. What was stored before is still there.
    pub fn keep(
        &mut self,
        run: u32,
        head: &CheckpointHead,
        write: impl FnOnce(&mut [u8]) -> Option<usize>,
    ) -> Result<u32, StoreError> {
        let payload = self.buffer.get_mut(HEADER_BYTES..).unwrap_or_default();
        let begun = postcard::to_slice(head, payload).map_err(|_| StoreError::Damaged)?.len();
        let numbers = payload.get_mut(begun..).and_then(write);
        let length = begun + numbers.ok_or(StoreError::Damaged)?;
        let record = record::seal(&mut self.buffer, RecordKind::Checkpoint, self.writer, run, length);
        let record = record.ok_or(StoreError::Damaged)?;
        let took = record.len() as u32;
        Journal::new(&mut self.flash, self.layout.checkpoints.clone())?.append(record, false)?;
        Ok(took)
    }

    /// Returns the settings of the run with this number.
    ///
    /// # Errors
    /// [`StoreError::NoSuchRun`] if the last run stored is another one.
    pub fn settings(&mut self, run: u32) -> Result<Settings, StoreError> {
        let last = self.scan(Wanted::Settings)?.last.ok_or(StoreError::NoSuchRun)?;
        let length = self.scan(Wanted::SettingsAt(last))?.length;
        let bytes = self.buffer.get(..length).unwrap_or_default();
        let record =
            record::open(bytes, RecordKind::Settings, self.writer).map_err(|_| StoreError::Damaged)?;
        if record.run != run {
            return Err(StoreError::NoSuchRun);
        }
        postcard::from_bytes(record.payload).map_err(|_| StoreError::Damaged)
    }

    /// Returns the last checkpoint of a run, and the factor's numbers; `None` if there is none.
    ///
    /// # Errors
    /// [`StoreError`] says why it cannot be read.
    pub fn checkpoint(&mut self, run: u32) -> Result<Option<(CheckpointHead, &[u8])>, StoreError> {
        let Some(last) = self.scan(Wanted::Checkpoints(run))?.last else { return Ok(None) };
        let length = self.scan(Wanted::CheckpointAt(last))?.length;
        let writer = self.writer;
        Ok(checkpoint(self.buffer.get(..length).unwrap_or_default(), writer, run))
    }
}

/// Tells what a journal is gone through for.
#[derive(Clone, Copy)]
enum Wanted {
    /// The last settings.
    Settings,
    /// The last checkpoint of this run.
    Checkpoints(u32),
    /// The record of settings with this number, in the buffer.
    SettingsAt(usize),
    /// A checkpoint is wanted at this index.
    CheckpointAt(usize),
}

/// Holds what was found.
struct Scan {
    kept: Kept,
    /// Number of the last record that was wanted.
    last: Option<usize>,
    /// Bytes of the one that is in the buffer.
    length: usize,
}

/// Returns what a record of settings says.
fn kept_settings(bytes: &[u8], writer: Writer) -> Kept {
    match record::open(bytes, RecordKind::Settings, writer) {
        Ok(record) => Kept::Run(KeptRun { run: record.run, ..KeptRun::default() }),
        Err(RecordError::OtherFirmware(hash)) => Kept::OtherFirmware { hash },
        Err(RecordError::Damaged) => Kept::Damaged,
    }
}

/// Returns a checkpoint of this run, if the bytes are one.
fn checkpoint(bytes: &[u8], writer: Writer, run: u32) -> Option<(CheckpointHead, &[u8])> {
    let record = record::open(bytes, RecordKind::Checkpoint, writer).ok().filter(|r| r.run == run)?;
    postcard::take_from_bytes(record.payload).ok()
}

/// Returns the report of a run with this checkpoint.
pub(super) fn reported(run: &KeptRun, head: &CheckpointHead) -> KeptRun {
    KeptRun {
        readings: head.counters.readings,
        blocks: head.counters.blocks,
        next_index: head.next_index,
        time_ns: head.time_ns,
        ..*run
    }
}
