//! Recordings through the device: their readings are sent, and the factor is fetched.

use std::sync::atomic::Ordering;

use rigident_shared::calibration::Reading;
use rigident_shared::wire::{
    Command, INJECT_BATCH, InjectBatch, LINK_BATCH, LinkBatch, LinkReadingMessage, Reply,
};

use super::{INTERRUPTED, Observer, QUIET, Session, SessionError, Take, Taking, narrow};
use crate::link::{LinkError, TakenFactor};

/// Tells how sending a recording ended.
enum Ended {
    /// All of it was taken, and this is the factor.
    With(TakenFactor),
    /// The device or somebody else ended it, or something broke.
    Early(Result<(), SessionError>),
}

impl Session {
    fn conclude_injected(&mut self, taking: Taking, ended: Ended, observer: &mut dyn Observer) -> Take {
        match ended {
            Ended::With(factor) => Self::taken(taking, Some(factor), Ok(())),
            Ended::Early(outcome) => self.conclude(taking, outcome, observer),
        }
    }

    /// Sends a recording's readings to the device and fetches the factor.
    ///
    /// # Errors
    /// The error that prevents a start. Anything later is stated in [`Take::broken`].
    pub fn inject(
        &mut self,
        readings: &[Reading<f64>],
        observer: &mut dyn Observer,
    ) -> Result<Take, SessionError> {
        let batch = |first_index: u32| {
            let part = readings.get(first_index as usize..).unwrap_or_default().iter().take(INJECT_BATCH);
            Command::Inject(InjectBatch { first_index, readings: part.map(narrow).collect() })
        };
        let (mut taking, ended, sent) = self.send(readings.len(), batch, observer)?;
        taking.readings = readings.get(..sent).unwrap_or(readings).to_vec();
        Ok(self.conclude_injected(taking, ended, observer))
    }

    /// Sends readings of two links to the device, as [`Self::inject`] does those of one body.
    ///
    /// # Errors
    /// The error that prevents a start. Anything later is stated in [`Take::broken`].
    pub fn inject_links(
        &mut self,
        readings: &[LinkReadingMessage],
        observer: &mut dyn Observer,
    ) -> Result<Take, SessionError> {
        let batch = |first_index: u32| {
            let part = readings.get(first_index as usize..).unwrap_or_default().iter().take(LINK_BATCH);
            Command::InjectLinks(LinkBatch { first_index, readings: part.copied().collect() })
        };
        let (mut taking, ended, sent) = self.send(readings.len(), batch, observer)?;
        taking.links = readings.get(..sent).unwrap_or(readings).to_vec();
        Ok(self.conclude_injected(taking, ended, observer))
    }

    /// Starts, and sends the given number of readings by commands that are made of the index of their first
    /// one. A device that restarts is sent again what it does not hold. Returns what arrived meanwhile, how
    /// it ended, and the number of readings that were taken.
    fn send(
        &mut self,
        count: usize,
        batch: impl Fn(u32) -> Command,
        observer: &mut dyn Observer,
    ) -> Result<(Taking, Ended, usize), SessionError> {
        let mut taking = Taking::default();
        let mut sent = 0_u32;
        if let Err(error) = self.start() {
            sent = self.go_on(error.into(), &mut taking)?;
        }
        let mut outcome = Ok(());
        let mut fetched = None;
        loop {
            if sent as usize >= count {
                // A device that restarts now is sent again what its last checkpoint lacks.
                match self.fetch(&mut taking, observer) {
                    Ok(factor) => fetched = Some(factor),
                    Err(error) => outcome = self.go_on(error, &mut taking).map(|next| sent = next),
                }
                if fetched.is_some() || outcome.is_err() {
                    break;
                }
                continue;
            }
            outcome = self.send_one(&batch(sent), &mut sent, &mut taking, observer);
            if let Err(error) = outcome {
                outcome = self.go_on(error, &mut taking).map(|next| sent = next);
            }
            observer.progress(sent as usize);
            taking.interrupted = INTERRUPTED.load(Ordering::Relaxed);
            if outcome.is_err() || taking.interrupted || taking.held() {
                break;
            }
        }
        let ended = match (outcome, fetched) {
            (Ok(()), Some(factor)) => Ended::With(factor),
            (outcome, _) => Ended::Early(outcome),
        };
        Ok((taking, ended, sent as usize))
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
    /// The error that prevents a start.
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
