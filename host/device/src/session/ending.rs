//! The end of an experiment: the plate at rest, what the device holds fetched, the way home.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use rigident_shared::wire::{Command, Reason, Reply, StateName};

use super::take::{Nobody, Taking};
use super::{INTERRUPTED, Observer, Session, SessionError, Take, tree, two_links};
use crate::link::{LinkError, TakenFactor};
use crate::platform::{Motion, Platform, PlatformError, Stop};
use rigident_fit::Factor;

/// The time that a platform may take to come to rest.
const REST: Duration = Duration::from_secs(4);
/// The time to wait for readings that were counted but have not come.
const STRAGGLERS: Duration = Duration::from_secs(2);

impl Session {
    /// Ends the motion first, then the recording.
    pub(super) fn finish(
        &mut self,
        platform: &mut dyn Platform,
        mut taking: Taking,
        outcome: Result<(), SessionError>,
        observer: &mut dyn Observer,
    ) -> Take {
        self.unwatched();
        // Whatever went wrong, the plate must not go on.
        let at_rest = if outcome.is_err() || taking.held() || taking.interrupted || taking.ended {
            let alarm = outcome.is_err() || taking.interrupted;
            let stop = if alarm { Stop::Alarm } else { Stop::Planned };
            self.bring_to_rest(platform, stop, &mut taking, observer)
        } else {
            Ok(())
        };
        let mut take = self.conclude(taking, outcome, observer);
        if at_rest.is_ok() && take.broken.is_none() && !take.interrupted {
            take.broken = self.go_home(platform).err();
        }
        match (at_rest, &mut take.broken) {
            (Ok(()), Some(broken)) => broken.push_str("\nThe platform is at rest."),
            (Ok(()), None) => {}
            (Err(unknown), broken) => {
                let said = format!(
                    "The platform could not be seen at rest ({unknown}): use its own emergency stop."
                );
                *broken = Some(broken.take().map_or(said.clone(), |b| format!("{b}\n{said}")));
            }
        }
        take
    }

    /// Leaves the plate where the next connection expects it. What went wrong, otherwise.
    fn go_home(&mut self, platform: &mut dyn Platform) -> Result<(), String> {
        const WHERE: &str = "on the way home after the experiment";
        let failed = |e: PlatformError| format!("{WHERE}: {e}");
        let Some(way) = platform.go_home().map_err(failed)? else { return Ok(()) };
        // The way is watched as the experiment was. A device that holds says nothing: set anew it reads, and
        // absorbs nothing.
        if let Some(settings) = self.settings.clone() {
            self.identity.state = StateName::Holding;
            self.configure(&settings).map_err(|e| format!("{WHERE}: {e}"))?;
        }
        self.watch_program(&way).map_err(failed)?;
        let mut taking = Taking { watching: true, ..Taking::default() };
        let outcome = loop {
            match platform.motion().map_err(failed) {
                Ok(Motion::Moving) => {}
                ended => break ended.map(drop),
            }
            if INTERRUPTED.load(Ordering::Relaxed) {
                break Err(format!("stopped by Ctrl-C {WHERE}"));
            }
            if let Err(seen) = self.listen(&mut taking, &mut Nobody) {
                break Err(format!("{WHERE}: {seen}"));
            }
        };
        self.unwatched();
        if outcome.is_err() {
            self.bring_to_rest(platform, Stop::Alarm, &mut taking, &mut Nobody)?;
        }
        outcome
    }

    /// Stops the platform and sees it at rest, taking in what comes meanwhile; a planned stop becomes an
    /// alarm where something goes wrong on the way, or somebody says stop. Why it could not be seen at rest,
    /// otherwise.
    fn bring_to_rest(
        &mut self,
        platform: &mut dyn Platform,
        mut stop: Stop,
        taking: &mut Taking,
        observer: &mut dyn Observer,
    ) -> Result<(), String> {
        let mut stopping = platform.stop(stop);
        let mut deadline = Instant::now() + REST;
        loop {
            // In lock-step the plate moves only while the device is heard. What is broken there has been
            // reported.
            let heard = self.listen(taking, observer);
            let late = Instant::now() > deadline;
            if stop == Stop::Planned && (late || heard.is_err() || INTERRUPTED.load(Ordering::Relaxed)) {
                stop = Stop::Alarm;
                stopping = platform.stop(stop);
                deadline = Instant::now() + REST;
            }
            match platform.motion() {
                Ok(Motion::Holding | Motion::Done) => return stopping.map_err(|e| e.to_string()),
                Ok(Motion::Moving) if Instant::now() < deadline => {}
                Ok(Motion::Moving) => return Err(format!("it still moves after {} s", REST.as_secs())),
                Err(error) => return Err(error.to_string()),
            }
            if heard.is_err() {
                std::thread::sleep(Duration::from_millis(20));
            }
        }
    }

    pub(super) fn conclude(
        &mut self,
        mut taking: Taking,
        outcome: Result<(), SessionError>,
        observer: &mut dyn Observer,
    ) -> Take {
        let mut factor = None;
        let outcome = match outcome {
            Ok(()) => self.fetch(&mut taking, observer).map(|fetched| factor = Some(fetched)),
            // The device is in reach and holds what it has taken in.
            Err(stopped @ SessionError::Stopped { reason: Reason::HostQuiet, .. }) => {
                factor = self.fetch(&mut taking, observer).ok();
                Err(stopped)
            }
            Err(error) => {
                let (error, left) = self.left_of(error, &mut taking);
                factor = left;
                Err(error)
            }
        };
        Self::taken(taking, factor, outcome)
    }

    /// Returns what an experiment brought.
    pub(super) fn taken(
        taking: Taking,
        factor: Option<TakenFactor>,
        outcome: Result<(), SessionError>,
    ) -> Take {
        // Of a level what was taken is here, whatever became of the rest.
        let taken = taking.level.as_deref().filter(|level| level.rows() > 0);
        let factor = factor.or_else(|| taken.map(|level| TakenFactor::exact(Factor::from(level))));
        Take {
            readings: taking.readings,
            links: taking.links,
            levels: taking.levels,
            estimates: taking.estimates,
            missing: taking.gaps.missing,
            factor,
            counters: taking.counters,
            states: taking.states,
            resumed: taking.resumed,
            restarts: taking.restarts,
            interrupted: taking.interrupted,
            cut_short: taking.cut_short,
            broken: outcome.err().map(|e| e.to_string()),
        }
    }

    pub(super) fn fetch(
        &mut self,
        taking: &mut Taking,
        observer: &mut dyn Observer,
    ) -> Result<TakenFactor, SessionError> {
        match self.client.ask("hold", &Command::Hold) {
            // A device in Fault still gives what it has.
            Ok(_) | Err(LinkError::Refused { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        if let Reply::Counters(counters) = self.client.ask("read the counters", &Command::ReadCounters)? {
            taking.counters = counters;
        }
        let deadline = Instant::now() + STRAGGLERS;
        self.sort(taking, observer)?;
        while taking.streamed < taking.counters.readings && Instant::now() < deadline {
            self.listen(taking, observer)?;
            if taking.streamed == 0 {
                break;
            }
        }
        if let Some(level) = &mut taking.level {
            tree::take_level(&mut self.client, level)?;
            taking.levels += 1;
            return Ok(TakenFactor::exact(Factor::from(&**level)));
        }
        if self.of_two_links {
            return Ok(two_links::factor(&mut self.client)?);
        }
        Ok(self.client.factor()?)
    }
}
