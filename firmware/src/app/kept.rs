//! The data that the application stores in flash, and how it goes on from them.

use core::ops::DerefMut;

use embedded_storage::nor_flash::NorFlash;
use rigident_shared::estimator::Counters;
use rigident_shared::wire::{CounterReport, ErrorCode, Reason, Reply, Settings, StateName};

use super::commands::rates;
use super::{App, BringUpError, SensorErrors, SensorRates};
use crate::Path;
use crate::storage::{CheckpointHead, Duty, Resumption, Store};

impl<P: DerefMut<Target = Path>> App<P> {
    /// Returns what is to be done with the flash next. While samples are taken it is nothing that might
    /// erase.
    pub(crate) fn duty(&self) -> Duty {
        match self.keeping.duty() {
            Duty::Settings | Duty::Look if self.is_busy_with_samples() => Duty::None,
            duty => duty,
        }
    }

    /// Sees what is stored.
    pub(crate) fn look<F: NorFlash>(&mut self, store: &mut Store<F>) {
        self.keeping.found(store.look());
    }

    /// Keeps the settings.
    #[inline(never)]
    pub(crate) fn keep_settings<F: NorFlash>(&mut self, store: &mut Store<F>) {
        let run = self.settings.as_ref().and_then(|settings| store.begin_run(settings).ok());
        self.keeping.begun(run, store.checkpoint_bytes() / 2);
    }

    /// Keeps a checkpoint of this run.
    #[inline(never)]
    pub(crate) fn keep_checkpoint<F: NorFlash>(&mut self, store: &mut Store<F>, run: u32) {
        let (keeping, path) = (&self.keeping, &self.path);
        let kept = path.samples().and_then(|path| {
            let head = CheckpointHead {
                counters: keeping.counters,
                next_index: keeping.next_index,
                next_reading: keeping.next_reading,
                time_ns: keeping.time_ns,
                rows: path.folded_rows(),
            };
            store.keep(run, &head, |numbers| path.write_factor(numbers)).ok()
        });
        self.keeping.written(kept);
    }

    /// Returns the rates at which the sensors are to be brought up to go on with a run of these settings.
    pub(crate) fn rates(&self, settings: &Settings) -> Option<SensorRates> {
        rates(settings)
    }

    /// Goes on with a run, whose sensors have come up or not, and answers the host.
    #[inline(never)]
    pub(crate) fn resume<F: NorFlash>(
        &mut self,
        store: &mut Store<F>,
        asked: Resumption,
        settings: Option<Settings>,
        sensors: Result<(), BringUpError>,
    ) {
        let answer = match (settings, sensors) {
            (None, _) => Err(ErrorCode::NotKept),
            (_, Err(BringUpError::Setting(name))) => Err(ErrorCode::BadSetting(name)),
            (_, Err(BringUpError::Fault(reason))) => {
                self.fail(reason);
                Err(ErrorCode::Sensors)
            }
            (Some(settings), Ok(())) => self.take_up(store, asked, settings),
        };
        self.keeping.answered();
        self.link.answer(asked.sequence, asked.check, &answer);
    }

    fn take_up<F: NorFlash>(
        &mut self,
        store: &mut Store<F>,
        asked: Resumption,
        settings: Settings,
    ) -> Result<Reply, ErrorCode> {
        let room = store.checkpoint_bytes() / 2;
        let rate_hz = settings.rate_hz;
        self.configure(settings)?;
        let restored = match store.checkpoint(asked.run) {
            Ok(Some((head, factor))) => self.restore(&head, factor).then_some(head.counters.readings),
            Ok(None) => Some(0),
            Err(_) => None,
        };
        let Some(readings) = restored else {
            *self.path = Path::Empty;
            self.settings = None;
            self.keeping.stop();
            self.enter(StateName::Idle, Reason::Boot);
            return Err(ErrorCode::NotKept);
        };
        self.run.batch_first = self.run.batch_first.max(asked.next_reading);
        self.keeping.resumed(rate_hz, readings, room);
        self.enter(StateName::Holding, Reason::Command);
        Ok(Reply::Done)
    }

    /// Takes up what a checkpoint holds. Returns false if it is not of these settings.
    fn restore(&mut self, head: &CheckpointHead, factor: &[u8]) -> bool {
        let report = &head.counters;
        let Some(path) = self.path.samples_mut() else { return false };
        if !path.restore(factor, head.rows, &counters(report)) {
            return false;
        }
        let unaligned_now = path.unaligned();
        self.errors = SensorErrors {
            load_cell_crc: report.load_cell_crc_errors,
            load_cell_other: report.load_cell_errors,
            load_cell_clipped: report.load_cell_clipped,
            clipped_gauges: report.clipped_gauges,
            load_cell_stale: report.load_cell_stale,
            load_cell_resyncs: report.load_cell_resyncs,
            without_excitation: report.without_excitation,
            overdue_transfers: report.overdue_transfers,
            failed_transfers: report.failed_transfers,
            imu: report.imu_errors,
            second_imu: report.second_imu_errors,
            // The value reported is what the path counts from here on less this.
            unaligned_before: unaligned_now.wrapping_sub(report.unaligned),
            ..SensorErrors::default()
        };
        (self.run.injected_next, self.run.batch_first) = (head.next_index, head.next_reading);
        true
    }
}

/// Returns the estimator's counters, of what was reported of them.
fn counters(report: &CounterReport) -> Counters {
    Counters {
        readings: report.readings,
        rejected: report.rejected,
        rejected_by_channel: report.rejected_by_channel,
        gaps: report.gaps,
        blocks: report.blocks,
        knocks: report.knocks,
        last_rejection: None,
    }
}
