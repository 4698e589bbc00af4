//! A device that runs by itself, or by another program's doing: it is heard, and nothing is changed.

use std::time::{Duration, Instant};

use rigident_shared::wire::{Command, Reply, Settings};

use super::{Observer, Session, SessionError, Taking};
use crate::link::LinkError;

/// The counters are asked for this often.
const COUNTERS_EVERY: Duration = Duration::from_secs(1);

impl Session {
    /// Returns the settings that the device has; `None` if it has none.
    ///
    /// # Errors
    /// The link.
    pub fn held_settings(&mut self) -> Result<Option<Settings>, LinkError> {
        match self.client.ask("read the settings", &Command::ReadSettings) {
            Ok(Reply::Settings(settings)) => {
                self.heartbeats = settings.host_timeout_ms > 0;
                Ok(Some(settings))
            }
            Ok(_) => Err(LinkError::Nonsense("read the settings")),
            Err(LinkError::Refused { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Starts a configured device; nothing else is moved.
    ///
    /// # Errors
    /// The link, or the device refuses.
    pub fn set_running(&mut self) -> Result<(), LinkError> {
        self.start()
    }

    /// Hears the device until `until` says so. A device that waits for a host is informed that one is there.
    ///
    /// # Errors
    /// The link, a sensor's fault, or a restart.
    pub fn attend(
        &mut self,
        until: &dyn Fn() -> bool,
        observer: &mut dyn Observer,
    ) -> Result<(), SessionError> {
        let mut taking = Taking { watching: true, ..Taking::default() };
        let mut asked: Option<Instant> = None;
        while !until() {
            self.listen(&mut taking, observer)?;
            // The observer has them.
            taking.readings.clear();
            taking.links.clear();
            taking.estimates.clear();
            if asked.is_none_or(|asked| asked.elapsed() > COUNTERS_EVERY) {
                asked = Some(Instant::now());
                if let Reply::Counters(counters) =
                    self.client.ask("read the counters", &Command::ReadCounters)?
                {
                    observer.counters(&counters);
                }
            }
        }
        Ok(())
    }
}
