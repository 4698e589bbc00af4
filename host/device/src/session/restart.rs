//! A device that restarted: what it holds from its flash, and what is lost.

use std::fmt::Write as _;

use rigident_shared::wire::{Command, ErrorCode, Kept, Reason, Reply, StateName};

use super::take::Taking;
use super::{Session, SessionError};
use crate::link::{LinkError, TakenFactor};

/// A device that restarts more often during one recording has no supply to speak of.
const MOST_RESTARTS: usize = 10_000;

impl SessionError {
    /// Returns whether the device may have restarted: whether it is idle again shows with the next hello.
    fn is_restart(&self) -> bool {
        match self {
            Self::Stopped { state: StateName::Idle, reason: Reason::Boot, .. } => true,
            Self::Link(LinkError::Refused { code, .. }) => {
                matches!(code, ErrorCode::WrongState(StateName::Idle) | ErrorCode::NoEstimate)
            }
            _ => false,
        }
    }
}

impl Session {
    /// Says hello to a device that restarted and lets it hold what its flash keeps of the run: how many
    /// readings it has taken, and the index of the one that it expects. `None`: it keeps nothing of it.
    fn take_up(&mut self, next_reading: u32) -> Result<Option<(u32, u32)>, LinkError> {
        self.identity = self.client.hello()?;
        // What was said until now was of the restart.
        while self.client.next_telemetry().is_some() {}
        let (Kept::Run(kept), Some(run), Some(settings)) =
            (self.identity.kept, self.run, self.settings.clone())
        else {
            return Ok(None);
        };
        if kept.run != run || self.identity.state != StateName::Idle {
            return Ok(None);
        }
        match self.client.ask("resume", &Command::Resume { run, next_reading }) {
            Ok(_) => {}
            Err(LinkError::Refused { code: ErrorCode::NotKept, .. }) => return Ok(None),
            Err(error) => return Err(error),
        }
        self.identity.state = StateName::Holding;
        match self.client.ask("read the settings", &Command::ReadSettings)? {
            Reply::Settings(held) if held == settings => Ok(Some((kept.readings, kept.next_index))),
            _ => Ok(None),
        }
    }

    /// Goes on with a recording that is sent to the device: the index of the reading that it expects next.
    /// Nothing of it is lost, since all of it is here.
    ///
    /// # Errors
    /// The last error, if it was no restart or there were too many restarts.
    pub(super) fn go_on(
        &mut self,
        mut error: SessionError,
        taking: &mut Taking,
    ) -> Result<u32, SessionError> {
        while error.is_restart() && taking.restarts < MOST_RESTARTS {
            taking.restarts += 1;
            match self.begin_again() {
                Ok(Some(next)) => return Ok(next),
                Ok(None) => break,
                // It may restart in the middle of this, too.
                Err(again) => error = again.into(),
            }
        }
        Err(error)
    }

    /// Lets a device that restarted absorb again: the index of the reading that it expects next. `None`: it
    /// has not restarted.
    fn begin_again(&mut self) -> Result<Option<u32>, LinkError> {
        let held = self.take_up(0)?;
        if held.is_none() && self.identity.state != StateName::Idle {
            return Ok(None);
        }
        if held.is_none()
            && let Some(settings) = self.settings.clone()
        {
            self.configure(&settings)?;
        }
        self.start()?;
        Ok(Some(held.map_or(0, |(_, next)| next)))
    }

    /// Fetches what a device that restarted in the middle of an experiment still holds, and says what is
    /// lost. The readings that arrived are here whatever it says.
    pub(super) fn left_of(
        &mut self,
        error: SessionError,
        taking: &mut Taking,
    ) -> (SessionError, Option<TakenFactor>) {
        if !error.is_restart() {
            return (error, None);
        }
        let came = taking.readings.len() + taking.links.len();
        let mut words = format!(
            "the device restarted in the middle of the experiment: check its supply. {came} readings had \
             come, and {} of those that it numbered before had not",
            taking.gaps.missing
        );
        let held = self.take_up(taking.streamed);
        let factor = match held {
            Ok(Some((readings, _))) => {
                let _ = write!(
                    words,
                    "; its flash kept a checkpoint of {readings} readings, so that its own estimate lacks {} \
                     that are here. What it read between the last that came and the restart is in neither",
                    came.saturating_sub(readings as usize)
                );
                if let Ok(Reply::Counters(counters)) =
                    self.client.ask("read the counters", &Command::ReadCounters)
                {
                    taking.counters = counters;
                }
                self.client.any_factor().ok()
            }
            _ => {
                words.push_str("; it keeps nothing of the run, and the answer is from what had come");
                None
            }
        };
        (SessionError::Restarted(words), factor)
    }
}
