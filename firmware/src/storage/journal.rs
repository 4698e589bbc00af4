//! Records one after the other in flash, by `sequential-storage`: a power cut leaves the last one or the one
//! before.

use core::ops::Range;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use embedded_storage_async::nor_flash as later;
use sequential_storage::Error;
use sequential_storage::cache::Cache;
use sequential_storage::queue::{QueueConfig, QueueStorage};

/// A flash that is only erased when it may be.
pub(super) struct Guarded<F> {
    pub(super) flash: F,
    pub(super) may_erase: bool,
}

/// Tells why the flash did not do what it was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GuardedError {
    /// The flash failed.
    Flash(NorFlashErrorKind),
    /// The flash would have been erased.
    WouldErase,
}

impl NorFlashError for GuardedError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Flash(kind) => *kind,
            Self::WouldErase => NorFlashErrorKind::Other,
        }
    }
}

fn failed(error: impl NorFlashError) -> GuardedError {
    GuardedError::Flash(error.kind())
}

impl<F> ErrorType for Guarded<F> {
    type Error = GuardedError;
}

impl<F: NorFlash> later::ReadNorFlash for Guarded<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), GuardedError> {
        ReadNorFlash::read(&mut self.flash, offset, bytes).map_err(failed)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: NorFlash> later::NorFlash for Guarded<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), GuardedError> {
        if !self.may_erase {
            return Err(GuardedError::WouldErase);
        }
        NorFlash::erase(&mut self.flash, from, to).map_err(failed)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), GuardedError> {
        NorFlash::write(&mut self.flash, offset, bytes).map_err(failed)
    }
}

/// Tells why a journal did not do what it was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JournalError {
    /// The flash failed.
    Flash,
    /// There is no room without erasing what may not be erased.
    Full,
    /// It is not in order, and could not be put in order.
    Damaged,
}

impl From<Error<GuardedError>> for JournalError {
    fn from(error: Error<GuardedError>) -> Self {
        match error {
            Error::Storage { value: GuardedError::Flash(_), .. } => Self::Flash,
            Error::Storage { value: GuardedError::WouldErase, .. } | Error::FullStorage => Self::Full,
            _ => Self::Damaged,
        }
    }
}

/// Runs a future that waits for nothing.
fn at_once<T>(future: impl Future<Output = Result<T, Error<GuardedError>>>) -> Result<T, JournalError> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(result) => result.map_err(JournalError::from),
        // No flash of ours makes it wait.
        Poll::Pending => Err(JournalError::Flash),
    }
}

/// One journal while it is used.
pub(super) struct Journal<'f, F: NorFlash> {
    queue: QueueStorage<&'f mut Guarded<F>, Uncached>,
}

type Uncached = Cache<
    sequential_storage::cache::Uncached,
    sequential_storage::cache::Uncached,
    sequential_storage::cache::Uncached,
    (),
>;

impl<'f, F: NorFlash> Journal<'f, F> {
    /// Returns the journal in this part of the flash: whole sectors, two at least.
    pub(super) fn new(flash: &'f mut Guarded<F>, range: Range<u32>) -> Result<Self, JournalError> {
        let config = QueueConfig::try_new(range).map_err(|_| JournalError::Damaged)?;
        Ok(Self { queue: QueueStorage::new(flash, config, Cache::new_uncached()) })
    }

    /// Appends a record. If the journal is full the oldest sector is erased for it, if that is `allowed`.
    #[inline(never)]
    pub(super) fn append(&mut self, record: &[u8], allowed: bool) -> Result<(), JournalError> {
        at_once(self.queue.push(record, allowed))
    }

    /// Returns the number of bytes for further records, sectors that would have to be erased left out.
    #[inline(never)]
    pub(super) fn room(&mut self) -> Result<u32, JournalError> {
        at_once(self.queue.space_left())
    }

    /// Erases all of it.
    #[inline(never)]
    pub(super) fn erase(&mut self) -> Result<(), JournalError> {
        at_once(self.queue.erase_all())
    }

    /// Shows every record, oldest first, in `buffer`, until `show` has seen enough, which says so by false.
    /// The record that was shown last stays in the buffer. Inlined where it is used, which is in one place:
    /// flash is dear.
    #[inline(always)]
    pub(super) fn each(
        &mut self,
        buffer: &mut [u8],
        mut show: impl FnMut(usize, &[u8]) -> bool,
    ) -> Result<(), JournalError> {
        at_once(async {
            let mut entries = self.queue.iter().await?;
            let mut number = 0;
            while let Some(entry) = entries.next(buffer).await? {
                if !show(number, &entry) {
                    break;
                }
                number += 1;
            }
            Ok(())
        })
    }
}
