//! Somebody at the terminal, beside the rig.

use std::io::{self, IsTerminal, Write};

use crate::Failure;
use crate::device::experiment::Watcher;
use crate::screen::confirm::{self, Agreed};
use crate::screen::tell::tell;
use rigident::application::driving::{Agreement, Attendant, Consent, DrivingError};
use rigident::device::session::Observer;

/// Somebody at the terminal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AtTerminal {
    /// `--yes`: agreed beforehand.
    pub(crate) yes: bool,
    /// Nothing is asked: nothing will move.
    pub(crate) dry_run: bool,
}

impl Attendant for AtTerminal {
    fn hear(&self, words: &str) {
        tell!("{words}");
    }

    fn observer(&self) -> Box<dyn Observer + '_> {
        Box::new(Watcher::new(0))
    }

    fn see(&self, consent: &Consent<'_>) {
        if io::stderr().is_terminal() {
            // Colours and concealment that something before has left on.
            let _ = io::stderr().write_all(b"\x1b[0m");
        }
        tell(format_args!("{consent}"), "");
    }

    fn can_agree(&self) -> Result<(), DrivingError> {
        if self.dry_run { Ok(()) } else { confirm::can_be_asked(self.yes).map_err(not_agreed) }
    }

    fn agree(&self) -> Result<Agreement, DrivingError> {
        let agreed = confirm::agree(self.yes).map_err(not_agreed)?;
        Ok(Agreement { by: agreed.words(), is_after_a_while: agreed == Agreed::AtTerminal })
    }

    fn count_down(&self) -> Result<(), DrivingError> {
        confirm::count_down().map_err(not_agreed)
    }
}

fn not_agreed(failure: Failure) -> DrivingError {
    match failure.status() {
        crate::ExitStatus::Input => DrivingError::NotAgreed(failure.to_string()),
        _ => DrivingError::StoppedBefore(failure.to_string()),
    }
}
