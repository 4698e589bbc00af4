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
            outcome = self.send_one(&batch(sent), &mut sent, &mut taking, observer);
            observer.progress(sent as usize);
            taking.interrupted = INTERRUPTED.load(Ordering::Relaxed);
            if outcome.is_err() || taking.interrupted || taking.held() {
                break;
            }
        }
        Ok((taking, outcome, sent as usize))
    }

    fn send_one(
        &mut self,
        command: &Command,
        sent: &mut u32,
        taking: &mut Taking,
        observer: &mut dyn Observer,
    ) -> Result<(), SessionError> {
        let answered = match self.client.ask("inject", command) {
            Ok(Reply::Injected { next_index }) => {
                *sent = next_index;
                Ok(())
            }
            Ok(_) => Err(LinkError::Nonsense("inject").into()),
            Err(error) => Err(error.into()),
        };
        self.sort(taking, observer)?;
        if taking.times_quiet() > 0 {
            let (state, reason) = QUIET;
            return Err(SessionError::Stopped { state, reason, advice: super::advice(reason) });
        }
        answered
    }

    /// Starts a device that readings are sent to as they come.
    ///
    /// # Errors
    /// What prevents a start.
    pub fn begin_feeding(&mut self) -> Result<Feeding, SessionError> {
        self.start()?;
        Ok(Feeding { taking: Taking::default(), sent: 0, outcome: Ok(()) })
    }

    /// Sends readings to the device, and hands them to the observer; returns false once no more are taken.
    pub fn feed(
        &mut self,
        feeding: &mut Feeding,
        readings: &[Reading<f64>],
        observer: &mut dyn Observer,
    ) -> bool {
        for part in readings.chunks(INJECT_BATCH) {
            if !feeding.goes_on() {
                return false;
            }
            let narrowed: Vec<_> = part.iter().map(narrow).collect();
            for reading in &narrowed {
                if let Err(why) = observer.reading(reading) {
                    feeding.outcome = Err(SessionError::Observer(why));
                    return false;
                }
            }
            let batch = InjectBatch { first_index: feeding.sent, readings: narrowed.into_iter().collect() };
            let Feeding { taking, sent, outcome } = feeding;
            *outcome = self.send_one(&Command::Inject(batch), sent, taking, observer);
            taking.readings.extend_from_slice(part);
        }
        observer.progress(feeding.taking.readings.len());
        feeding.goes_on()
    }

    /// Ends it and fetches the factor.
    pub fn end_feeding(&mut self, feeding: Feeding, observer: &mut dyn Observer) -> Take {
        self.conclude(feeding.taking, feeding.outcome, observer)
    }
}

/// Keeps account of readings that are sent to a device as they come.
pub struct Feeding {
    taking: Taking,
    sent: u32,
    outcome: Result<(), SessionError>,
}

impl Feeding {
    /// Returns true while the device takes readings.
    pub fn goes_on(&self) -> bool {
        self.outcome.is_ok() && !self.taking.held()
    }
}
