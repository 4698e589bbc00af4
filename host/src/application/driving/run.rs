//! The motion, and how the platform is left.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use hexapod::Pose;

use super::super::{Error, Loaded};
use super::{Attendant, Decisions, Directing, DrivingError, Prepared, Request, TraceFile};
use rigident_device::platform::{Platform, PlatformError, check};
use rigident_device::session::{INTERRUPTED, Observer, Session, SessionError, Take, sound, two_links};

/// A motion that was agreed to: it alone can begin.
pub struct Agreed<'a>(pub(super) Prepared<'a>);

/// The plate at the first pose: from here on is recorded.
pub struct AtStart<'a>(Prepared<'a>);

/// The recording of a motion.
pub struct Driven {
    /// Everything that the device sent.
    pub take: Take,
    /// Segments that were decided on, and their results.
    pub decisions: Option<Decisions>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
}

impl<'a> Agreed<'a> {
    /// Brings the plate to its first pose. The device is heard meanwhile: nobody may keep it waiting.
    ///
    /// # Errors
    /// The way was not finished; nothing was recorded.
    pub fn approached(
        self,
        request: &Request,
        platform: &mut dyn Platform,
        session: &mut Session,
        (at, trace): (&dyn Attendant, &TraceFile),
    ) -> Result<AtStart<'a>, Error> {
        if request.fixed.is_some() {
            at.hear("to the first pose");
            approach(platform, session, (at, trace))?;
        }
        Ok(AtStart(self.0))
    }
}

impl<'a> AtStart<'a> {
    /// Returns what was prepared.
    pub fn prepared(&self) -> &Prepared<'a> {
        &self.0
    }

    /// Returns the longest time that the motion takes, s.
    pub fn longest_s(&self, request: &Request) -> f64 {
        request.longest_s(self.0.directing.as_ref())
    }

    /// Drives the platform while the device estimates, and leaves it at rest.
    ///
    /// # Errors
    /// The link broke at once; what breaks later ends the recording, and [`Take::broken`] says so.
    pub fn drive(
        self,
        request: &Request,
        platform: &mut dyn Platform,
        session: &mut Session,
        (at, observer): (&dyn Attendant, &mut dyn Observer),
    ) -> Result<Driven, Error> {
        let longest_s = self.longest_s(request);
        let Prepared { mut directing, from, warnings, .. } = self.0;
        let most = if directing.is_some() { "at most " } else { "" };
        at.hear(&format!("the experiment takes {most}{longest_s:.0} s"));
        session.at_most_s = request.options.end.at_most_s;
        let take = match (&mut directing, &request.fixed) {
            (Some(directing), _) => session.follow_decided_unchecked(platform, directing, observer),
            (None, Some(program)) => session.follow_unchecked(platform, program, observer),
            (None, None) => return Err(DrivingError::NoChoice.into()),
        }
        .map_err(DrivingError::from)?;
        let mut driven = Driven { take, decisions: directing.map(Directing::concluded), warnings };
        driven.leave(platform, from.as_ref());
        if let Some(own) = &driven.decisions {
            driven.warnings.extend(own.warnings.iter().cloned());
        }
        Ok(driven)
    }
}

impl Driven {
    /// Leaves the platform, and warns of how it was left.
    fn leave(&mut self, platform: &mut dyn Platform, from: Option<&Pose>) {
        let take = &self.take;
        if let (Some(home), Some(at)) = (from, platform.expects())
            && (take.broken.is_some() || take.interrupted)
            && check::words(&at) != check::words(home)
        {
            self.warnings.push(format!(
                "the plate was left at {}; the next run over this address begins at home: bring it there \
                 first",
                check::words(&at)
            ));
        }
        match platform.release() {
            Ok(left) => self.warnings.extend(left),
            Err(error) => {
                let why = format!("the platform's controller could not be left as it was found: {error}");
                self.warnings.push(why);
            }
        }
    }

    /// Returns the recording with its model; what is wrong with it goes to the warnings.
    ///
    /// # Errors
    /// Readings that make no rows.
    pub fn loaded(&mut self, request: &Request) -> Result<Loaded, Error> {
        let (rig, rate_hz, take) = (&request.rig, request.rate_hz, &mut self.take);
        let mut read = match &request.links {
            Some(_) => two_links::recording("run", rig, rate_hz, &take.links),
            None => sound::recording("run", rig, rate_hz, &take.readings),
        };
        self.warnings.extend(sound::judge(&mut read, take));
        match &request.links {
            Some((model, _)) => Loaded::of_links(&read, model),
            None => {
                let readings = std::mem::take(&mut take.readings);
                Ok(Loaded::of_readings("run", rig, readings, Some(rate_hz), false))
            }
        }
    }
}

fn approach(
    platform: &mut dyn Platform,
    session: &mut Session,
    (at, trace): (&dyn Attendant, &TraceFile),
) -> Result<(), DrivingError> {
    let (near, mut why) = (AtomicBool::new(false), None);
    session.watches(true);
    let go_on = || ![&INTERRUPTED, &near].iter().any(|stop| stop.load(Ordering::Relaxed));
    let approached = std::thread::scope(|scope| {
        let moving = scope.spawn(|| platform.approach(&go_on));
        while !moving.is_finished() {
            match session.watch(0.1, &mut *at.observer()) {
                Ok(_) if go_on() => continue,
                Err(error @ (SessionError::NearRange { .. } | SessionError::Unheard(_))) => {
                    near.store(true, Ordering::Relaxed);
                    why = Some(error);
                }
                // What else is wrong with the device is found out by the experiment itself.
                _ => {}
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        moving.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    });
    session.watches(false);
    let kept = format!("what went over the line to the platform is in {}", trace.path().display());
    match (approached, why) {
        (_, Some(error)) => Err(DrivingError::Way { error, kept }),
        (Ok(()), None) => Ok(()),
        (Err(PlatformError::Interrupted), None) => Err(DrivingError::StoppedOnTheWay(kept)),
        (Err(error), None) => Err(DrivingError::NotThere { error, kept }),
    }
}
