//! One experiment with one device: configure, start, follow, hold, fetch.
//!
//! Lives here: the order of commands and motions, what is collected on the way, how an experiment ends early.
//! May not live here: files and printing (the callbacks of [`Observer`]), the protocol ([`crate::link`]).

mod adaptive;
mod attend;
mod ending;
pub mod frames;
mod inject;
mod load_guard;
mod motion_guard;
pub mod precision;
mod restart;
mod settings;
pub mod sound;
pub mod streamed;
pub mod suspended;
mod take;
pub mod tracked;
pub mod tree;
pub mod two_links;
pub mod watched;

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use hexapod::MotionProgram;
use rigident_shared::calibration::Reading;
use rigident_shared::wire::{
    Command, Identity, Kept, LinkReadingMessage, ModelSettings, ReadingMessage, Reason, Reply, Settings,
    StateName, Telemetry,
};

pub use adaptive::{Director, Proposal};
pub use inject::Feeding;
pub use load_guard::LoadGuard;
pub use motion_guard::{Axes, MotionGuard};
pub use settings::{DeviceTiming, SettingsError, settings, state_imu_noise, state_memory};
use take::Taking;
pub use take::{Heard, Nobody, Observer, Take, narrow, widen};

use crate::link::{Client, LinkError};
use crate::platform::{Motion, MotionSample, Platform, PlatformError};

/// Examined between messages.
pub use rigident_io::stop::INTERRUPTED;

/// The interval at which the device is informed that the host is there.
const HEARTBEAT_EVERY: Duration = Duration::from_millis(500);
/// A device that streams nothing and answers no heartbeat for this long has hung.
const SILENT: Duration = Duration::from_secs(4);
/// A plate that moves is stopped when it was listened for this long and no reading arrived.
const UNHEARD: Duration = Duration::from_millis(200);
/// The state of the device when every asked-for parameter has its uncertainty.
const STOPPED: (StateName, Reason) = (StateName::Holding, Reason::StopRule);
/// The state of the device when it has not heard the host for longer than its settings allow.
const QUIET: (StateName, Reason) = (StateName::Holding, Reason::HostQuiet);

/// The reason why an experiment ends early.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The link.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The platform.
    #[error(transparent)]
    Platform(#[from] PlatformError),
    /// The device is in a state that it should not be in.
    #[error("the device went to {state:?} ({reason:?}): {advice}")]
    Stopped {
        /// The state.
        state: StateName,
        /// Why.
        reason: Reason,
        /// The advice.
        advice: &'static str,
    },
    /// The device restarted, and what is left.
    #[error("{0}")]
    Restarted(String),
    /// The line does not take another rate, baud.
    #[error(
        "`baud` {0}: {1}; take a slower rate or another serial adapter, and keep its wires short. The line \
         has its usual rate again"
    )]
    Line(u32, &'static str),
    /// The load cell would be overloaded.
    #[error(
        "the load cell's {channel} came to {value:.1} of {range:.1} {unit}: the motion was ended before it \
         overloads the load cell. Take a slower or smaller motion, a lighter body, or a load cell with a \
         larger range; load_max_kg and load_within_m of the rig file bound what is planned for"
    )]
    NearRange {
        /// The channel of the wrench.
        channel: &'static str,
        /// The value read, N or N m.
        value: f64,
        /// The channel's range, N or N m.
        range: f64,
        /// The unit of both.
        unit: &'static str,
    },
    /// The plate does not do what the program says.
    #[error(
        "{0}: the motion was ended. Is the platform switched on and in the mode that it should be in, the \
         rig file's [[imu]] turned as the IMU is, the body free to move?"
    )]
    NotFollowed(String),
    /// Readings cease.
    #[error(
        "the device has sent no reading for {0} s while the plate moves, and without readings nobody sees \
         it: the motion was ended. Check its cable and supply"
    )]
    Unheard(f64),
    /// The observer could not do its part, such as writing.
    #[error("{0}")]
    Observer(String),
}

/// A device that has said hello.
pub struct Session {
    client: Client,
    identity: Identity,
    last_heartbeat: Instant,
    heartbeats: bool,
    /// The last settings.
    settings: Option<Settings>,
    /// Number under which the device keeps the run, if it keeps runs.
    run: Option<u32>,
    /// True if the device was set to two links.
    of_two_links: bool,
    /// True if the device was set to end a run by itself.
    stops_itself: bool,
    /// [`Session::follow_unchecked`] ends a program after this long, s of the device's clock.
    pub at_most_s: Option<f64>,
    /// Ends a motion before the load cell is overloaded.
    pub load_guard: Option<LoadGuard>,
    /// Ends a motion that the plate does not follow.
    pub motion_guard: Option<MotionGuard>,
    /// The host's time is counted from here.
    opened: Instant,
    /// A program is under way.
    moves: bool,
    /// The time for which nothing has been taken in while it was listened.
    unheard: Duration,
}

impl Session {
    /// Notes whether something moves from now on: while it does, readings must come.
    pub fn watches(&mut self, moves: bool) {
        (self.moves, self.unheard) = (moves, Duration::ZERO);
    }

    /// Says hello.
    ///
    /// # Errors
    /// No answer, or firmware of another protocol.
    pub fn open(mut client: Client) -> Result<Self, LinkError> {
        let identity = client.hello()?;
        Ok(Self {
            client,
            identity,
            last_heartbeat: Instant::now(),
            heartbeats: false,
            settings: None,
            run: None,
            of_two_links: false,
            stops_itself: false,
            at_most_s: None,
            load_guard: None,
            motion_guard: None,
            opened: Instant::now(),
            moves: false,
            unheard: Duration::ZERO,
        })
    }

    /// Returns who answered.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Returns the link, for single questions.
    pub fn client(&mut self) -> &mut Client {
        &mut self.client
    }

    /// Sends the settings and reads them back.
    ///
    /// # Errors
    /// The device refuses, or does not hold what was sent.
    pub fn configure(&mut self, settings: &Settings) -> Result<(), LinkError> {
        // Elsewhere new settings take the place of the old ones, which stay if the new ones are refused.
        if matches!(self.identity.state, StateName::Running | StateName::Fault) {
            self.client.ask("reset", &Command::Reset)?;
        }
        self.client.ask("configure", &Command::Configure(settings.clone()))?;
        match self.client.ask("read the settings", &Command::ReadSettings)? {
            Reply::Settings(held) if held == *settings => {}
            _ => return Err(LinkError::Nonsense("read the settings")),
        }
        self.identity.state = StateName::Configured;
        self.heartbeats = settings.host_timeout_ms > 0;
        self.stops_itself = settings.stop.as_ref().is_some_and(|stop| !stop.limits.is_empty());
        self.of_two_links = matches!(settings.model, ModelSettings::TwoLinks(_));
        self.settings = Some(settings.clone());
        Ok(())
    }

    /// Starts the device and the loaded `program`, follows both to the end, and fetches the factor.
    ///
    /// Nothing is checked before: neither limits nor load, nobody is asked, and the guards are those that the
    /// session was given. A real platform is driven by `rigident::application::driving`.
    ///
    /// # Errors
    /// The error that prevents a start. Anything later is stated in [`Take::broken`], with what was taken
    /// before.
    pub fn follow_unchecked(
        &mut self,
        platform: &mut dyn Platform,
        program: &MotionProgram,
        observer: &mut dyn Observer,
    ) -> Result<Take, SessionError> {
        self.start()?;
        let mut taking = Taking::default();
        let outcome = self.set_going(platform, program).and_then(|()| {
            loop {
                self.listen(&mut taking, observer)?;
                self.tell(platform, 0.0, observer)?;
                if INTERRUPTED.load(Ordering::Relaxed) {
                    taking.interrupted = true;
                    return Ok(());
                }
                self.resume(platform, &mut taking)?;
                if self.at_most_s.is_some_and(|most_s| taking.span_s() >= most_s) {
                    (taking.ended, taking.cut_short) = (true, true);
                    return self.tell(platform, 0.0, observer);
                }
                if taking.held() || platform.motion()? == Motion::Done {
                    return self.tell(platform, 0.0, observer);
                }
            }
        });
        Ok(self.finish(platform, taking, outcome, observer))
    }

    /// Starts a loaded program; from now on the plate must follow it.
    fn set_going(
        &mut self,
        platform: &mut dyn Platform,
        program: &MotionProgram,
    ) -> Result<(), SessionError> {
        platform.start()?;
        self.watch_program(program).map_err(SessionError::from)
    }

    /// Watches a program: from now on readings must come, and the IMU must show it.
    fn watch_program(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        self.watches(true);
        let now_s = self.heartbeats.then(|| self.opened.elapsed().as_secs_f64());
        match &mut self.motion_guard {
            Some(guard) => guard.begins(program, now_s).map_err(PlatformError::from),
            None => Ok(()),
        }
    }

    /// Ends the watch of a motion: the plate rests, or is being brought to rest.
    fn unwatched(&mut self) {
        self.watches(false);
        if let Some(guard) = &mut self.motion_guard {
            guard.ends();
        }
    }

    /// Collects readings for the given time without absorbing them, the platform at rest.
    ///
    /// # Errors
    /// The link, or a sensor fault.
    pub fn watch(
        &mut self,
        seconds: f64,
        observer: &mut dyn Observer,
    ) -> Result<Vec<Reading<f64>>, SessionError> {
        Ok(self.watched(seconds, observer)?.readings)
    }

    /// Watches readings of two links, as [`Self::watch`] does those of one body.
    ///
    /// # Errors
    /// The link, or a sensor fault.
    pub fn watch_links(
        &mut self,
        seconds: f64,
        observer: &mut dyn Observer,
    ) -> Result<Vec<LinkReadingMessage>, SessionError> {
        Ok(self.watched(seconds, observer)?.links)
    }

    fn watched(&mut self, seconds: f64, observer: &mut dyn Observer) -> Result<Taking, SessionError> {
        let mut taking = Taking { watching: true, ..Taking::default() };
        let deadline = Instant::now() + Duration::from_secs_f64(seconds);
        // What was queued before does not count.
        while self.client.next_telemetry().is_some() {}
        while Instant::now() < deadline && !INTERRUPTED.load(Ordering::Relaxed) {
            self.listen(&mut taking, observer)?;
        }
        Ok(taking)
    }

    fn start(&mut self) -> Result<(), LinkError> {
        if self.identity.kept != Kept::NoStorage {
            let identity = self.client.hello()?;
            self.run = if let Kept::Run(kept) = identity.kept { Some(kept.run) } else { None };
        }
        // What was said before belongs to no run.
        while self.client.next_telemetry().is_some() {}
        self.client.ask("start", &Command::Start).map(drop)
    }

    /// Starts again what the device has stopped because it did not hear the host, as long as the platform
    /// still moves: the readings of that time are missing, the others are one experiment.
    ///
    /// # Errors
    /// [`SessionError::Stopped`] if the motion is over: its rest was not taken in.
    fn resume(&mut self, platform: &mut dyn Platform, taking: &mut Taking) -> Result<(), SessionError> {
        let quiet = taking.times_quiet();
        if quiet <= taking.resumed {
            return Ok(());
        }
        let (state, reason) = QUIET;
        if platform.motion()? != Motion::Moving {
            return Err(SessionError::Stopped { state, reason, advice: advice(reason) });
        }
        taking.resumed = quiet;
        self.client.ask("go on", &Command::Start).map(drop).map_err(SessionError::from)
    }

    fn listen(&mut self, taking: &mut Taking, observer: &mut dyn Observer) -> Result<(), SessionError> {
        let (before, asked) = (taking.count(), Instant::now());
        self.client.listen(Duration::from_millis(20))?;
        let waited = asked.elapsed();
        self.sort(taking, observer)?;
        self.unheard = if taking.count() > before { Duration::ZERO } else { self.unheard + waited };
        if self.moves && self.heartbeats && taking.level.is_none() && self.unheard > UNHEARD {
            self.moves = false;
            return Err(SessionError::Unheard(UNHEARD.as_secs_f64()));
        }
        observer.progress(taking.count());
        observer.heard(&Heard {
            missing: taking.gaps.missing,
            lost_messages: self.client.lost_telemetry,
            damaged_frames: self.client.bad_frames,
            silent_s: self.client.silence().as_secs_f64(),
        });
        if self.heartbeats && self.last_heartbeat.elapsed() > HEARTBEAT_EVERY {
            if self.last_heartbeat.elapsed() > SILENT {
                self.client.listen_anew();
            }
            self.last_heartbeat = Instant::now();
            // Nobody waits for the answer: while one is waited for the platform is not watched.
            self.client.tell("heartbeat", &Command::Heartbeat)?;
        }
        if self.heartbeats && self.client.silence() > SILENT {
            return Err(LinkError::Silent("heartbeat").into());
        }
        Ok(())
    }

    fn sort(&mut self, taking: &mut Taking, observer: &mut dyn Observer) -> Result<(), SessionError> {
        let mut guarded = Ok(());
        let arrived_s = self.opened.elapsed().as_secs_f64();
        while let Some(message) = self.client.next_telemetry() {
            match message {
                Telemetry::Readings { first, readings } => {
                    taking.gaps.note(first, readings.len() as u32);
                    taking.streamed = first.saturating_add(readings.len() as u32);
                    // Whoever guards comes before whoever writes or shows.
                    for reading in &readings {
                        guarded = guarded.and_then(|()| self.guarded(reading, arrived_s));
                    }
                    for reading in &readings {
                        observer.reading(reading).map_err(SessionError::Observer)?;
                        taking.readings.push(widen(reading));
                    }
                }
                Telemetry::Estimate(report) => {
                    observer.estimate(&report);
                    taking.estimates.push(report);
                }
                Telemetry::State { state, reason } => {
                    taking.states.push((state, reason));
                    observer.state(state, reason);
                    if state == StateName::Fault {
                        return Err(SessionError::Stopped { state, reason, advice: advice(reason) });
                    }
                }
                Telemetry::Announce(_) => {
                    return Err(SessionError::Stopped {
                        state: StateName::Idle,
                        reason: Reason::Boot,
                        advice: "it restarted in the middle of the experiment: check its supply",
                    });
                }
                Telemetry::LinkReadings { first, readings } => {
                    taking.gaps.note(first, readings.len() as u32);
                    taking.streamed = first.saturating_add(readings.len() as u32);
                    // Taken before the start or after the end it was not absorbed, and its attitude is none.
                    let absorbed = |r: &&LinkReadingMessage| r.attitude_wxyz != [0.0; 4];
                    let taken = || readings.iter().filter(|r| taking.watching || absorbed(r));
                    for reading in taken() {
                        guarded = guarded.and_then(|()| self.guarded(&reading.base, arrived_s));
                    }
                    let taken: Vec<LinkReadingMessage> = taken().copied().collect();
                    for reading in &taken {
                        observer.link_reading(reading).map_err(SessionError::Observer)?;
                        taking.links.push(*reading);
                    }
                }
                // Changes come of robots that are watched.
                Telemetry::Heartbeat { .. } | Telemetry::Change(_) => {}
            }
        }
        guarded
    }

    /// Monitors load cell and IMU while something moves; what follows the first alarm is the way to rest.
    fn guarded(&mut self, reading: &ReadingMessage, arrived_s: f64) -> Result<(), SessionError> {
        if let Some(guard) = &mut self.load_guard {
            let looked = guard.reading(&reading.wrench);
            if looked.is_err() {
                self.load_guard = None;
            }
            looked?;
        }
        let Some(guard) = &mut self.motion_guard else { return Ok(()) };
        let time_s = reading.time_ns as f64 * 1e-9;
        let looked = guard.reading(time_s, arrived_s, &reading.specific_force, &reading.angular_rate);
        if looked.is_err() {
            guard.ends();
        }
        looked
    }

    /// Hands on where the plate should be and is, for a program that began this long after the first, s.
    fn tell(
        &mut self,
        platform: &mut dyn Platform,
        begun_s: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), SessionError> {
        let mut follows = Ok(());
        for sample in platform.samples() {
            if let Some(guard) = &mut self.motion_guard {
                follows = follows.and_then(|()| guard.sample(&sample));
            }
            let sample = MotionSample { time_s: sample.time_s + begun_s, ..sample };
            observer.motion(&sample).map_err(SessionError::Observer)?;
        }
        follows
    }
}

fn advice(reason: Reason) -> &'static str {
    match reason {
        Reason::LoadCell(_) => "check the cable and supply of the load cell's converter, then run again",
        Reason::Imu(_) => "check the cable and supply of the IMU, then run again",
        Reason::SecondImu(_) => "check the cable and supply of the second link's IMU, then run again",
        Reason::Frames(_) => {
            "no frames come, or damaged ones only: check their source and its cable, then run again"
        }
        Reason::LevelFull => "take the factor's rows, then start again: nothing of it is lost",
        Reason::HostQuiet => {
            "the host was too busy or the cable was out for longer than the device waits, and the rest of \
             the motion was not taken in; run again on a host that is less busy, and not in the background"
        }
        Reason::Boot | Reason::Command | Reason::StopRule => "run again",
    }
}
