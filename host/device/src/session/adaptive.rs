use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use hexapod::MotionProgram;
use rigident_shared::wire::{Command, EstimateReport};

use super::{INTERRUPTED, Observer, STOPPED, Session, SessionError, Take, Taking};
use crate::platform::{Motion, Platform, PlatformError};
use rigident_fit::Factor;

/// The proposal to a platform.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// Starting where the last one ended.
    pub program: MotionProgram,
    /// True if it is to be driven; else it is only asked whether the platform would take it.
    pub drive: bool,
}

/// The part that decides between segments.
pub trait Director: Send {
    /// Returns what comes next; `None` ends the experiment. The plate is at rest meanwhile.
    ///
    /// # Errors
    /// The factor cannot be used.
    fn next(&mut self, factor: &Factor) -> Result<Option<Proposal>, String>;
    /// Receives that the platform does not take what was proposed; another proposal is asked for.
    fn refused(&mut self, error: &PlatformError);
    /// Receives that the platform would take what is not to be driven; another proposal is asked for.
    fn taken(&mut self);
    /// Receives that the segment begins, this long after the first reading, s.
    fn begins(&mut self, time_s: f64);
    /// Returns whether, by a new estimate, everything asked for seems reached: a factor is then worth its
    /// reading.
    fn may_be_reached(&mut self, report: &EstimateReport) -> bool;
    /// Returns whether everything asked for is reached, this long after the first reading, s.
    fn is_reached(&mut self, factor: &Factor, time_s: f64) -> bool;
}

/// The end of a segment.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ended {
    /// The segment ended at its end.
    Whole,
    /// The segment ended before: by the stop rule, the device or the user.
    Early,
}

impl Session {
    /// Follows programs decided one after the other, as [`Session::follow_unchecked`] follows one, and checks
    /// as little. The device runs all the while; its factor is read between segments.
    ///
    /// # Errors
    /// The error that prevents a start. Anything later is stated in [`Take::broken`], with what was taken
    /// before.
    pub fn follow_decided_unchecked(
        &mut self,
        platform: &mut dyn Platform,
        director: &mut dyn Director,
        observer: &mut dyn Observer,
    ) -> Result<Take, SessionError> {
        self.start()?;
        let mut taking = Taking::default();
        let outcome = self.segments(platform, director, &mut taking, observer);
        Ok(self.finish(platform, taking, outcome, observer))
    }

    fn segments(
        &mut self,
        platform: &mut dyn Platform,
        director: &mut dyn Director,
        taking: &mut Taking,
        observer: &mut dyn Observer,
    ) -> Result<(), SessionError> {
        loop {
            let factor = self.client.factor()?.compensated();
            let next = self.meanwhile(taking, observer, || director.next(&factor))?;
            let Some(Proposal { program, drive }) = next.map_err(SessionError::Observer)? else {
                return Ok(());
            };
            if INTERRUPTED.load(Ordering::Relaxed) {
                taking.interrupted = true;
                return Ok(());
            }
            match platform.load(&program) {
                Ok(()) if drive => {}
                Ok(()) => {
                    director.taken();
                    self.listen(taking, observer)?;
                    continue;
                }
                Err(
                    error @ (PlatformError::Refused(_)
                    | PlatformError::Controller { .. }
                    | PlatformError::Motion(_)),
                ) => {
                    director.refused(&error);
                    // Refusals can be many, and nobody may keep the device waiting.
                    self.listen(taking, observer)?;
                    continue;
                }
                Err(other) => return Err(other.into()),
            }
            self.approach(platform, taking, observer)?;
            if taking.interrupted {
                return Ok(());
            }
            let begun_s = taking.span_s();
            director.begins(begun_s);
            self.set_going(platform, &program)?;
            match self.segment(begun_s, platform, director, taking, observer)? {
                Ended::Early => return Ok(()),
                Ended::Whole => {}
            }
        }
    }

    /// Makes the platform ready. The device is heard meanwhile.
    fn approach(
        &mut self,
        platform: &mut dyn Platform,
        taking: &mut Taking,
        observer: &mut dyn Observer,
    ) -> Result<(), SessionError> {
        let approach = |astray: &AtomicBool| {
            platform.approach(&|| ![&INTERRUPTED, astray].iter().any(|stop| stop.load(Ordering::Relaxed)))
        };
        match self.heard(taking, observer, approach) {
            // The device, or the load cell, has stopped it.
            (_, Err(error)) => Err(error),
            (Err(PlatformError::Interrupted), heard) => {
                taking.interrupted = true;
                heard
            }
            (Err(other), _) => Err(other.into()),
            (Ok(()), heard) => heard,
        }
    }

    /// Does something that takes its time. A device that waits for nobody is heard meanwhile; one in
    /// lock-step waits.
    fn meanwhile<T: Send>(
        &mut self,
        taking: &mut Taking,
        observer: &mut dyn Observer,
        work: impl FnOnce() -> T + Send,
    ) -> Result<T, SessionError> {
        if !self.heartbeats {
            return Ok(work());
        }
        let (done, heard) = self.heard(taking, observer, |_| work());
        heard.map(|()| done)
    }

    /// Does work while the device is listened to. The work's flag is set when the device is not heard any
    /// more, or what it says is a reason to end.
    fn heard<T: Send>(
        &mut self,
        taking: &mut Taking,
        observer: &mut dyn Observer,
        work: impl FnOnce(&AtomicBool) -> T + Send,
    ) -> (T, Result<(), SessionError>) {
        let astray = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let working = scope.spawn(|| work(&astray));
            let mut heard = Ok(());
            while !working.is_finished() {
                if heard.is_ok() {
                    heard = self.listen(taking, observer);
                    astray.store(heard.is_err(), Ordering::Relaxed);
                } else {
                    std::thread::sleep(Duration::from_millis(5));
                }
            }
            match working.join() {
                Ok(done) => (done, heard),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    }

    fn segment(
        &mut self,
        begun_s: f64,
        platform: &mut dyn Platform,
        director: &mut dyn Director,
        taking: &mut Taking,
        observer: &mut dyn Observer,
    ) -> Result<Ended, SessionError> {
        let mut judged = taking.estimates.len();
        loop {
            self.listen(taking, observer)?;
            self.tell(platform, begun_s, observer)?;
            if INTERRUPTED.load(Ordering::Relaxed) {
                taking.interrupted = true;
                return Ok(Ended::Early);
            }
            let fresh = taking.estimates.get(judged..).unwrap_or_default();
            let looks_so = fresh.iter().any(|report| director.may_be_reached(report));
            judged = taking.estimates.len();
            if looks_so && director.is_reached(&self.client.factor()?.compensated(), taking.span_s()) {
                taking.ended = true;
                return Ok(Ended::Early);
            }
            if taking.states.contains(&STOPPED) && !taking.overridden {
                // The device believes the noise that was stated to it; whoever decides knows the noise there
                // is.
                if !director.is_reached(&self.client.factor()?.compensated(), taking.span_s()) {
                    taking.overridden = true;
                    self.client.ask("go on", &Command::Start)?;
                }
            }
            self.resume(platform, taking)?;
            if taking.held() {
                return Ok(Ended::Early);
            }
            if platform.motion()? == Motion::Done {
                self.tell(platform, begun_s, observer)?;
                self.unwatched();
                return Ok(Ended::Whole);
            }
        }
    }
}
