//! Recordings through the device: their readings are sent, and the factor is fetched.

use std::sync::atomic::Ordering;

use rigident_shared::calibration::Reading;
use rigident_shared::wire::{
    Command, INJECT_BATCH, InjectBatch, LINK_BATCH, LinkBatch, LinkReadingMessage, Reply,
};

use super::{INTERRUPTED, Observer, QUIET, Session, SessionError, Take, Taking, narrow};
use crate::device::link::LinkError;

impl Session {
    /// Sends a recording's readings to the device and fetches the factor.
    ///
    /// # Errors
    /// What prevents a start. Anything later is told in [`Take::broken`].
    pub fn inject(
        &mut self,
        readings: &[Reading<f64>],
        observer: &mut dyn Observer,
    ) -> Result<Take, SessionError> {
        let batches = readings.chunks(INJECT_BATCH).map(|part| {
            |first_index| {
                Command::Inject(InjectBatch { first_index, readings: part.iter().map(narrow).collect() })
            }
        });
        let (mut taking, outcome, sent) = self.send(batches, observer)?;
        taking.readings = readings.get(..sent).unwrap_or(readings).to_vec();
        Ok(self.conclude(taking, outcome, observer))
    }

    /// Likewise, readings of two links.
    ///
    /// # Errors
    /// What prevents a start. Anything later is told in [`Take::broken`].
    pub fn inject_links(
        &mut self,
        readings: &[LinkReadingMessage],
        observer: &mut dyn Observer,
    ) -> Result<Take, SessionError> {
        let batches = readings.chunks(LINK_BATCH).map(|part| {
            |first_index| {
                Command::InjectLinks(LinkBatch { first_index, readings: part.iter().copied().collect() })
            }
        });
        let (mut taking, outcome, sent) = self.send(batches, observer)?;
        taking.links = readings.get(..sent).unwrap_or(readings).to_vec();
        Ok(self.conclude(taking, outcome, observer))
    }

    /// Starts, and sends commands that are made of the index of their first reading. What came meanwhile, how it ended, and
    /// how many readings were taken.
    fn send<C: FnOnce(u32) -> Command>(
        &mut self,
        batches: impl Iterator<Item = C>,
        observer: &mut dyn Observer,
    ) -> Result<(Taking, Result<(), SessionError>, usize), SessionError> {
        self.start()?;
        let mut taking = Taking::default();
        let mut sent = 0_u32;
        let mut outcome = Ok(());
        for batch in batches {
            match self.client.ask("inject", &batch(sent)) {
                Ok(Reply::Injected { next_index }) => sent = next_index,
                Ok(_) => outcome = Err(LinkError::Nonsense("inject").into()),
                Err(error) => outcome = Err(error.into()),
            }
            if let Err(error) = self.sort(&mut taking, observer) {
                outcome = Err(error);
            } else if taking.times_quiet() > 0 {
                let (state, reason) = QUIET;
                outcome = Err(SessionError::Stopped { state, reason, advice: super::advice(reason) });
            }
            observer.progress(sent as usize);
            taking.interrupted = INTERRUPTED.load(Ordering::Relaxed);
            if outcome.is_err() || taking.interrupted || taking.held() {
                break;
            }
        }
        Ok((taking, outcome, sent as usize))
    }
}
