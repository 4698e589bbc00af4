//! What the application does when told.

use rigident_shared::wire::{
    Command, DecodeError, ErrorCode, InjectBatch, Kind, PROTOCOL_VERSION, Reason, Reply, Settings, Source,
    StateName,
};

use super::reports::reading_of;
use super::{App, BringUpError, Duty, PendingConfigure, Pulse, Run, SensorErrors, SensorRates};
use crate::answer::{FactorSnapshot, solve};
use crate::link::{self, Recall};
use crate::log;
use crate::sample_path::{SamplePath, Words};
use crate::settings::{Configuration, setting_of};

impl App {
    /// Takes a byte from the host. If it completes a `Configure` for real sensors, the rates to bring them
    /// up with; [`App::sensors_up`] must follow before the next byte.
    pub fn on_byte(&mut self, byte: u8, now_ns: u64) -> Option<SensorRates> {
        self.advance(now_ns);
        self.last_heard_ns = self.now_ns;
        // The frame borrows the decoder, the application is needed to obey: take it out for the while.
        let mut decoder = core::mem::take(&mut self.decoder);
        let rates = match decoder.push(byte) {
            None => None,
            Some(Ok(frame)) if frame.kind == Kind::Command => {
                self.on_command(frame.sequence, frame.payload, frame.message())
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
            Err(_) => Err(ErrorCode::UnknownCommand),
            Ok(Command::Configure(settings)) => match self.may_configure(&settings) {
                Ok(()) if settings.source == Source::Sensors => {
                    let rates = SensorRates { load_cell_hz: settings.rate_hz, imu_hz: settings.imu.rate_hz };
                    self.pending = Some(PendingConfigure { sequence, check, settings });
                    return Some(rates);
                }
                Ok(()) => self.configure(settings),
                Err(error) => Err(error),
            },
            Ok(command) => self.obey(&command),
        };
        if let Err(error) = answer {
            log::refused(error);
        }
        self.link.answer(sequence, check, &answer);
        None
    }

    /// Tells how the bring-up went that [`App::on_byte`] asked for, and answers the command.
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
            log::refused(error);
        }
        self.link.answer(pending.sequence, pending.check, &answer);
    }

    /// Whether the settings are possible and the state allows them.
    fn may_configure(&self, settings: &Settings) -> Result<(), ErrorCode> {
        if !matches!(self.state, StateName::Idle | StateName::Configured | StateName::Holding) {
            return Err(ErrorCode::WrongState(self.state));
        }
        set_up(settings, &mut None)
    }

    fn configure(&mut self, settings: Settings) -> Result<Reply, ErrorCode> {
        set_up(&settings, &mut self.path)?;
        self.duty = Duty::of(&settings);
        self.settings = Some(settings);
        self.begin();
        (self.load_cell, self.imu) = (Pulse::default(), Pulse::default());
        self.enter(StateName::Configured, Reason::Command);
        Ok(Reply::Done)
    }

    /// Everything counted is counted from here on.
    fn begin(&mut self) {
        self.run = Run::default();
        let unaligned_before = self.path.as_ref().map_or(0, SamplePath::unaligned);
        self.errors = SensorErrors { unaligned_before, ..SensorErrors::default() };
    }

    fn obey(&mut self, command: &Command) -> Result<Reply, ErrorCode> {
        let wrong_state = Err(ErrorCode::WrongState(self.state));
        match command {
            Command::Hello => {
                self.greeted = true;
                Ok(Reply::Hello(self.identity()))
            }
            // Taken care of before.
            Command::Configure(_) => wrong_state,
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
                self.path = None;
                self.settings = None;
                self.begin();
                self.enter(StateName::Idle, Reason::Command);
                Ok(Reply::Done)
            }
            Command::Inject(batch) => self.inject(batch),
            Command::ReadSettings => self.settings.clone().map(Reply::Settings).map_or(wrong_state, Ok),
            Command::ReadCounters => Ok(Reply::Counters(self.counters())),
            Command::ReadEstimate => {
                let path = self.path.as_ref().ok_or(ErrorCode::NoEstimate)?;
                if path.counters().blocks == 0 {
                    return Err(ErrorCode::NoEstimate);
                }
                let factor = path.factor();
                let solved = solve(&factor);
                self.report(&factor, &solved).map(Reply::Estimate).ok_or(ErrorCode::NoEstimate)
            }
            Command::ReadFactor { offset } => {
                if *offset == 0 {
                    self.run.snapshot = self.path.as_ref().map(|path| FactorSnapshot::new(&path.factor()));
                }
                let snapshot = self.run.snapshot.as_ref().ok_or(ErrorCode::NoEstimate)?;
                snapshot
                    .chunk(*offset)
                    .map(Reply::Factor)
                    .ok_or(ErrorCode::BadOffset { total: snapshot.total() })
            }
            Command::Heartbeat => Ok(Reply::Done),
        }
    }

    fn start(&mut self) -> Result<Reply, ErrorCode> {
        match self.state {
            StateName::Configured => {
                self.flush_readings();
                if let Some(path) = &mut self.path {
                    path.restart();
                }
                self.begin();
            }
            StateName::Holding => self.run.stop_overridden |= self.reason == Reason::StopRule,
            StateName::Running => return Ok(Reply::Done),
            StateName::Idle | StateName::Fault => return Err(ErrorCode::WrongState(self.state)),
        }
        // What happened before the run is not held against the sensors.
        let pulse = Pulse { bad_in_a_row: 0, last_ns: self.now_ns };
        (self.load_cell, self.imu) = (pulse, pulse);
        self.absorb(true);
        self.enter(StateName::Running, Reason::Command);
        Ok(Reply::Done)
    }

    fn inject(&mut self, batch: &InjectBatch) -> Result<Reply, ErrorCode> {
        let injecting = self.settings.as_ref().is_some_and(|s| s.source == Source::Injected);
        if self.state != StateName::Running || !injecting {
            return Err(ErrorCode::WrongState(self.state));
        }
        if batch.first_index != self.run.injected_next {
            return Err(ErrorCode::OutOfOrder { expected: self.run.injected_next });
        }
        for message in &batch.readings {
            self.take(&Words::Aligned(reading_of(message)));
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

/// A new path for these settings. On an error `path` holds none that is of use.
#[inline(never)]
fn set_up(settings: &Settings, path: &mut Option<SamplePath>) -> Result<(), ErrorCode> {
    let configuration = Configuration::new(settings).map_err(ErrorCode::BadSetting)?;
    let refused = |error| ErrorCode::BadSetting(setting_of(error));
    let path = path.insert(SamplePath::new(&configuration).map_err(refused)?);
    configuration.memory.as_ref().map_or(Ok(()), |memory| path.set_memory(memory)).map_err(refused)
}
