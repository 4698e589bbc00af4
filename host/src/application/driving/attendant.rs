//! Whoever is at the rig.

use rigident_shared::wire::ReadingMessage;

use super::{Consent, DrivingError};
use rigident_device::session::Observer;

/// Whoever is at the rig: hears what is done, sees what is to move, and agrees to it or not.
pub trait Attendant: Sync {
    /// Hears what is done, in words.
    fn hear(&self, words: &str);

    /// Sees the readings before the experiment.
    fn observer(&self) -> Box<dyn Observer + '_> {
        Box::new(Unseen)
    }

    /// Sees what would be driven.
    fn see(&self, consent: &Consent<'_>);

    /// Refuses early what could not be agreed to later.
    ///
    /// # Errors
    /// [`DrivingError::NotAgreed`] with the reason.
    fn can_agree(&self) -> Result<(), DrivingError>;

    /// Agrees that the platform moves.
    ///
    /// # Errors
    /// [`DrivingError::NotAgreed`], [`DrivingError::StoppedBefore`].
    fn agree(&self) -> Result<Agreement, DrivingError>;

    /// Counts down to the motion.
    ///
    /// # Errors
    /// [`DrivingError::StoppedBefore`].
    fn count_down(&self) -> Result<(), DrivingError>;
}

/// The form of an agreement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// The form in words, for the trace.
    pub by: &'static str,
    /// True if time has passed since the motion was shown: the load cell is compared with its zero once more.
    pub is_after_a_while: bool,
}

/// Nobody: hears nothing, and agrees to nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nobody;

impl Attendant for Nobody {
    fn hear(&self, _words: &str) {}

    fn see(&self, _consent: &Consent<'_>) {}

    fn can_agree(&self) -> Result<(), DrivingError> {
        Err(DrivingError::NotAgreed("nothing was moved: nobody is there who could agree".to_owned()))
    }

    fn agree(&self) -> Result<Agreement, DrivingError> {
        self.can_agree().and(Err(DrivingError::Stopped))
    }

    fn count_down(&self) -> Result<(), DrivingError> {
        Err(DrivingError::Stopped)
    }
}

/// Sees nothing of the readings.
struct Unseen;

impl Observer for Unseen {
    fn reading(&mut self, _reading: &ReadingMessage) -> Result<(), String> {
        Ok(())
    }
}
