//! The actions of the application on commands.

use core::ops::DerefMut;

use rigident_shared::estimator::TwoLinkReading;
use rigident_shared::estimator::frames::FrameEstimator;
use rigident_shared::estimator::watch::Watch;
use rigident_shared::wire::{
    Command, DecodeError, ErrorCode, EventCode, Kind, ModelSettings, PROTOCOL_VERSION, Reason, Reply,
    SensorFault, SettingName, Settings, Source, StateName, WatchLinkSettings, asks_to_watch,
};

use super::reports::{link_reading_of, reading_of};
use super::{
    App, BringUpError, Duty, HandOver, PendingConfigure, Pulse, Run, SENSORS, SensorErrors, SensorRates,
};
use crate::Path;
use crate::frame_path::FramePath;
use crate::link::{self, Recall};
use crate::log;
use crate::rates::RateMeter;
use crate::sample_path::{SamplePath, Words};
use crate::settings::{Configuration, setting_of, setting_of_tree, setting_of_watch, watch_link};
use crate::storage::Resumption;
use crate::watch_path::WatchPath;

impl<P: DerefMut<Target = Path>> App<P> {
    /// Takes a byte from the host. If it completes a `Configure` for real sensors, the rates to bring them
    /// up with; [`App::sensors_up`] must follow before the next byte.
    pub fn on_byte(&mut self, byte: u8, now_ns: u64) -> Option<SensorRates> {
        self.advance(now_ns);
        if self.restart_asked {
            // Whatever the host asks for now is for the next program.
            return None;
        }
        if byte != 0 {
            // It ends no frame.
            self.decoder.push(byte);
            return None;
        }
        // The frame borrows the decoder, the application is needed to obey: take it out for the while.
        let mut decoder = core::mem::take(&mut self.decoder);
        let frame = decoder.push(byte);
        // Something whole is a host; noise on the line is none.
        if matches!(frame, Some(Ok(_))) {
            self.last_heard_ns = self.now_ns;
            self.line_heard();
        }
        let rates = match frame {
            None => None,
            Some(Ok(frame)) if frame.kind == Kind::Command => {
                self.on_command(frame.sequence, frame.payload, frame.message())
            }
            Some(Ok(frame)) if cfg!(feature = "watch") && frame.kind == Kind::Stream => {
                self.on_streamed(frame.sequence, frame.payload);
                None
            }
            Some(Ok(_)) => None,
            Some(Err(DecodeError::Version(want))) => {
                self.link.refuse(0, ErrorCode::WrongProtocol { have: PROTOCOL_VERSION, want });
                None
            }
            Some(Err(_)) => {
                self.bad_frames = self.bad_frames.saturating_add(1);
                None
            }
        };
        self.decoder = decoder;
        rates
    }

    fn on_command(
        &mut self,
        sequence: u16,
        payload: &[u8],
        command: Result<Command, DecodeError>,
    ) -> Option<SensorRates> {
        let check = link::check(payload);
        if matches!(command, Ok(Command::Hello)) {
            // Maybe a new host, which counts anew.
            self.link.forget();
        }
        match self.link.recall(sequence, check) {
            Recall::New => {}
            Recall::AnsweredAgain => return None,
            Recall::Stale => {
                self.link.refuse(sequence, ErrorCode::Stale);
                return None;
            }
        }
        let answer = match command {
            Err(_) if cfg!(not(feature = "watch")) && asks_to_watch(payload) => Err(ErrorCode::NotBuiltIn),
            Err(_) => Err(ErrorCode::UnknownCommand),
            Ok(Command::Configure(settings)) => match self.may_configure(&settings) {
                Ok(()) => match rates(&settings) {
                    Some(rates) => {
                        self.pending = Some(PendingConfigure { sequence, check, settings });
                        return Some(rates);
                    }
                    None => self.configure(settings),
                },
                Err(error) => Err(error),
            },
            Ok(Command::TakeRow { row: 0 })
                if self.is_busy_with_samples() && self.path.samples().is_some() =>
            {
                if self.run.hand_over != HandOver::Folding(sequence, check) {
                    self.take_snapshot();
                    self.run.hand_over = HandOver::Folding(sequence, check);
                }
                return None;
            }
            Ok(Command::Resume { run, next_reading })
                if self.state == StateName::Idle && self.keeping.has(run) =>
            {
                self.keeping.ask(Resumption { sequence, check, run, next_reading });
                return None;
            }
            Ok(command) => self.obey(&command),
        };
        if let Err(error) = answer {
            self.note_refused(error);
        }
        self.link.answer(sequence, check, &answer);
        None
    }

    fn note_refused(&mut self, error: ErrorCode) {
        log::refused(error);
        self.events.note(self.now_ns, EventCode::Refused, error.number() as u8);
    }

    /// Tells how the bring-up went that [`App::on_byte`] asked for, and answers the command.
    #[inline(never)]
    pub fn sensors_up(&mut self, result: Result<(), BringUpError>) {
        let Some(pending) = self.pending.take() else { return };
        let answer = match result {
            Ok(()) => self.configure(pending.settings),
            Err(BringUpError::Setting(name)) => Err(ErrorCode::BadSetting(name)),
            Err(BringUpError::Fault(reason)) => {
                self.fail(reason);
                Err(ErrorCode::Sensors)
            }
        };
        if let Err(error) = answer {
            self.note_refused(error);
        }
        self.link.answer(pending.sequence, pending.check, &answer);
    }

    /// Returns whether the settings are possible and the state allows them.
    fn may_configure(&self, settings: &Settings) -> Result<(), ErrorCode> {
        if !matches!(self.state, StateName::Idle | StateName::Configured | StateName::Holding) {
            return Err(ErrorCode::WrongState(self.state));
        }
        check(settings)
    }

    // What is made of settings stays off the stack of everything else.
    #[inline(never)]
    pub(super) fn configure(&mut self, settings: Settings) -> Result<Reply, ErrorCode> {
        set_up(&settings, &mut self.path)?;
        self.duty = Duty::of(&settings);
        self.keeping.configured(settings.rate_hz);
        self.settings = Some(settings);
        self.begin();
        self.pulses = [Pulse::default(); SENSORS];
        self.meters = self.settings.as_ref().and_then(rates).map_or([RateMeter::default(); 3], |rates| {
            [rates.load_cell_hz, rates.imu_hz, rates.second_imu_hz.unwrap_or(0.0)].map(RateMeter::new)
        });
        self.enter(StateName::Configured, Reason::Command);
        Ok(Reply::Done)
    }

    /// Begins to count everything anew.
    pub(super) fn begin(&mut self) {
        self.run = Run::default();
        self.estimation.stop();
        let unaligned_before = self.path.samples().map_or(0, SamplePath::unaligned);
        self.errors = SensorErrors { unaligned_before, ..SensorErrors::default() };
    }

    #[inline(never)]
    fn obey(&mut self, command: &Command) -> Result<Reply, ErrorCode> {
        let wrong_state = Err(ErrorCode::WrongState(self.state));
        match command {
            Command::Hello => {
                self.greeted = true;
                Ok(Reply::Hello(self.identity()))
            }
            // Taken care of before.
            Command::Configure(_) => wrong_state,
            Command::Resume { .. } if self.state != StateName::Idle => wrong_state,
            Command::Resume { .. } => Err(ErrorCode::NotKept),
            Command::Start => self.start(),
            Command::Hold => match self.state {
                StateName::Running => {
                    self.hold(Reason::Command);
                    Ok(Reply::Done)
                }
                StateName::Holding => Ok(Reply::Done),
                _ => wrong_state,
            },
            Command::Reset => {
                self.reset();
                Ok(Reply::Done)
            }
            Command::Inject(batch) => {
                let readings = batch
                    .readings
                    .iter()
                    .map(|message| TwoLinkReading { base: reading_of(message), ..TwoLinkReading::ZERO });
                self.inject(batch.first_index, false, readings)
            }
            Command::InjectLinks(batch) => {
                self.inject(batch.first_index, true, batch.readings.iter().map(link_reading_of))
            }
            Command::TakeRow { row } => {
                self.take_copy(*row)?;
                self.take_row(*row).map(Reply::Row).ok_or(ErrorCode::NoEstimate)
            }
            Command::ReadSettings => self.settings.clone().map(Reply::Settings).map_or(wrong_state, Ok),
            Command::ReadCounters => Ok(Reply::Counters(self.counters())),
            Command::ReadEstimate if self.is_busy_with_samples() && self.path.samples().is_some() => {
                wrong_state
            }
            Command::ReadEstimate => self.estimate_at_once(),
            Command::Heartbeat => Ok(Reply::Done),
            Command::ReadEvents => Ok(Reply::Events(self.events.report())),
            Command::Restart if !self.facts.restarts => Err(ErrorCode::NotBuiltIn),
            Command::Restart => {
                self.ask_for_restart();
                Ok(Reply::Done)
            }
            Command::WatchLink { .. } | Command::LineRate { .. } if cfg!(not(feature = "watch")) => {
                Err(ErrorCode::NotBuiltIn)
            }
            Command::LineRate { baud } => self.set_line_rate(*baud),
            Command::WatchLink { link, settings } => {
                let StateName::Configured = self.state else { return wrong_state };
                self.watch_link(*link, settings)
            }
        }
    }

    // Of one caller each, and inlined because that takes the least flash.

    /// Forgets settings and path.
    #[inline(always)]
    fn reset(&mut self) {
        *self.path = Path::Empty;
        self.keeping.stop();
        self.settings = None;
        self.begin();
        self.enter(StateName::Idle, Reason::Command);
    }

    /// Takes a copy of what has been absorbed before the first row of the factor.
    #[inline(always)]
    fn take_copy(&mut self, row: u8) -> Result<(), ErrorCode> {
        if row == 0 {
            self.take_snapshot();
            while self.path.samples_mut().is_some_and(|path| !path.fold()) {}
        } else if self.path.samples().is_some() && !matches!(self.run.hand_over, HandOver::Rows(_)) {
            return Err(ErrorCode::NoEstimate);
        }
        Ok(())
    }

    /// Estimates without slices, while no samples are absorbed.
    #[inline(always)]
    fn estimate_at_once(&mut self) -> Result<Reply, ErrorCode> {
        let path = self.path.samples_mut().ok_or(ErrorCode::NoEstimate)?;
        if path.counters().blocks == 0 {
            return Err(ErrorCode::NoEstimate);
        }
        self.estimation.begin(path, self.last_reading);
        self.keeping.again();
        loop {
            if let Some(report) = self.estimation.step(path) {
                return Ok(Reply::Estimate(report.clone()));
            }
        }
    }

    /// Ends a run, and has the device restarted after the answer.
    #[inline(always)]
    fn ask_for_restart(&mut self) {
        if self.state == StateName::Running {
            self.hold(Reason::Command);
        }
        self.restart_asked = true;
        self.events.note(self.now_ns, EventCode::Restart, 0);
    }

    // Off the stack of what samples need.
    #[cold]
    #[inline(never)]
    fn watch_link(&mut self, link: u8, settings: &WatchLinkSettings) -> Result<Reply, ErrorCode> {
        let path = self.path.watch_mut().ok_or(ErrorCode::BadSetting(SettingName::Model))?;
        let settings = watch_link(settings, link).map_err(ErrorCode::BadSetting)?;
        let set = path.set_link(link, &settings);
        set.map(|()| Reply::Done).map_err(|error| ErrorCode::BadSetting(setting_of_watch(error)))
    }

    /// Returns whether samples of the sensors are absorbed: what takes long is then done in slices between
    /// them.
    pub(super) fn is_busy_with_samples(&self) -> bool {
        self.state == StateName::Running && self.duty.from_sensors
    }

    /// Keeps a copy of what has been absorbed, for a factor to hand over. An estimate that still needs its
    /// own begins anew.
    fn take_snapshot(&mut self) {
        let Some(path) = self.path.samples_mut() else { return };
        path.take_snapshot();
        self.keeping.again();
        if self.estimation.needs_snapshot() {
            self.estimation.stop();
            self.run.estimate_due = true;
        }
    }

    fn start(&mut self) -> Result<Reply, ErrorCode> {
        let starts = matches!(self.state, StateName::Configured | StateName::Holding);
        if let (true, Some(sensor)) = (starts && self.listens(), self.sensor_of_another_rate()) {
            self.fail(sensor.reason(SensorFault::Rate));
            return Err(ErrorCode::Sensors);
        }
        match self.state {
            StateName::Configured => {
                if let Some(link) = self.path.watch().and_then(|path| path.watch().unknown_link()) {
                    return Err(ErrorCode::BadSetting(SettingName::Link(link)));
                }
                self.flush_readings();
                match &mut *self.path {
                    Path::Samples(path) => path.restart(),
                    Path::Frames(path) if cfg!(feature = "frames") => path.restart(),
                    Path::Watch(path) if cfg!(feature = "watch") => path.restart(),
                    _ => {}
                }
                self.begin();
            }
            StateName::Holding => self.run.stop_overridden |= self.reason == Reason::StopRule,
            StateName::Running => return Ok(Reply::Done),
            StateName::Idle | StateName::Fault => return Err(ErrorCode::WrongState(self.state)),
        }
        // Whoever streams frames counts them anew.
        self.errors.next_streamed = None;
        // What happened before the run is not attributed to the sensors.
        let pulse = Pulse { bad_in_a_row: 0, last_ns: self.now_ns };
        self.pulses = [pulse; SENSORS];
        self.noise = 0;
        self.absorb(true);
        self.enter(StateName::Running, Reason::Command);
        Ok(Reply::Done)
    }

    fn inject(
        &mut self,
        first_index: u32,
        two_links: bool,
        readings: impl Iterator<Item = TwoLinkReading<f32>>,
    ) -> Result<Reply, ErrorCode> {
        let injecting = self.settings.as_ref().is_some_and(|s| s.source == Source::Injected)
            && self.path.samples().is_some_and(|path| path.has_two_links() == two_links);
        if self.state != StateName::Running || !injecting {
            return Err(ErrorCode::WrongState(self.state));
        }
        if first_index != self.run.injected_next {
            return Err(ErrorCode::OutOfOrder { expected: self.run.injected_next });
        }
        for reading in readings {
            self.take(&Words::Aligned(reading));
            self.run.injected_next = self.run.injected_next.wrapping_add(1);
            // The stop rule must see every estimate, whatever the size of the batches.
            self.work();
            if self.state != StateName::Running {
                break;
            }
        }
        Ok(Reply::Injected { next_index: self.run.injected_next })
    }
}

/// Returns the rates at which the sensors are to be brought up for these settings; `None`: none are.
pub(super) fn rates(settings: &Settings) -> Option<SensorRates> {
    (settings.source == Source::Sensors && !is_tree(settings)).then_some(SensorRates {
        load_cell_hz: settings.rate_hz,
        imu_hz: settings.imu.rate_hz,
        second_imu_hz: match &settings.model {
            ModelSettings::TwoLinks(links) => Some(links.imu.rate_hz),
            _ => None,
        },
    })
}

/// Returns true for a tree, whose frames come by themselves: there is nothing to bring up.
fn is_tree(settings: &Settings) -> bool {
    matches!(settings.model, ModelSettings::Tree(_) | ModelSettings::Suspended(..) | ModelSettings::Watch(_))
}

/// Returns whether a path can be made of these settings.
#[inline(never)]
fn check(settings: &Settings) -> Result<(), ErrorCode> {
    match Configuration::new(settings).map_err(ErrorCode::BadSetting)? {
        Configuration::Samples(configuration) => {
            SamplePath::check(&configuration).map_err(|error| ErrorCode::BadSetting(setting_of(error)))
        }
        Configuration::Tree(links, config, _) if cfg!(feature = "frames") => {
            FrameEstimator::check(&links, &config)
                .map(drop)
                .map_err(|error| ErrorCode::BadSetting(setting_of_tree(error)))
        }
        Configuration::Watch(config, feet) if cfg!(feature = "watch") => {
            Watch::check(&config, &feet).map_err(|error| ErrorCode::BadSetting(setting_of_watch(error)))
        }
        Configuration::Tree(..) | Configuration::Watch(..) => Err(ErrorCode::NotBuiltIn),
    }
}

/// Sets up a new path for these settings, which have been checked.
#[inline(never)]
fn set_up(settings: &Settings, path: &mut Path) -> Result<(), ErrorCode> {
    match Configuration::new(settings).map_err(ErrorCode::BadSetting)? {
        Configuration::Samples(configuration) => match SamplePath::place(path) {
            Some(path) => {
                path.set_up(&configuration).map_err(|error| ErrorCode::BadSetting(setting_of(error)))
            }
            None => Err(ErrorCode::BadSetting(SettingName::Model)),
        },
        Configuration::Tree(links, config, stop) if cfg!(feature = "frames") => {
            FramePath::set_up(path, &links, &config, stop.as_ref())
                .map_err(|error| ErrorCode::BadSetting(setting_of_tree(error)))
        }
        Configuration::Watch(config, feet) if cfg!(feature = "watch") => {
            WatchPath::set_up(path, &config, &feet)
                .map_err(|error| ErrorCode::BadSetting(setting_of_watch(error)))
        }
        Configuration::Tree(..) | Configuration::Watch(..) => Err(ErrorCode::NotBuiltIn),
    }
}
