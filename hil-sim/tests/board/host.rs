//! The host at the other end of the line, with the patience of the real one, in the time of the model.

use rigident_shared::wire::{
    Answer, ClockSource, Command, Consistency, CounterReport, Decoder, EstimateReport, EventMessage,
    Identity, Kept, Kind, Reply, Settings, StateName, Telemetry, encode, frame,
};

use super::chip::{Chip, MS};

/// Tries and patience of the host, as in `host/device/src/link/client.rs`.
const TRIES: u32 = 6;
const PATIENCE: u64 = 700 * MS;
/// A host that is well says something this often.
const HEARTBEAT: u64 = 500 * MS;
/// A device that has not said a word for so long after everything is over is dead.
const MOST_SILENT: u64 = 30_000 * MS;

/// The host's stage in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Greet,
    Configure,
    Resume,
    Start,
    Run,
    Hold,
    Counters,
    Estimate,
    /// Waits until every fault is over, then asks for a restart and sets the device up again.
    Rest,
    Restart,
    Back,
    Again,
    Events,
    Over,
}

/// The plan of the host: its settings, times and misbehaviour.
#[derive(Clone, Debug)]
pub struct Plan {
    pub settings: Settings,
    /// The length of the run, ps.
    pub duration: u64,
    /// Everything is over by then, ps.
    pub calm_after: u64,
    /// Beginning and end of the time in which it says nothing and reads nothing, ps.
    pub sleeps: Option<(u64, u64)>,
    /// Beginning and end of the time in which it fills its line with commands, ps.
    pub floods: Option<(u64, u64)>,
}

/// The outcome of the run.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// The estimate at the end, if there is one.
    pub estimate: Option<EstimateReport>,
    pub counters: Option<CounterReport>,
    /// Messages of the device or the host about events.
    pub words: Vec<String>,
    /// Restarts that the host has seen.
    pub restarts: u32,
    /// True if it was set up again after everything was over.
    pub alive: bool,
    pub started: bool,
    /// The events that the device has kept, its restart included.
    pub events: Vec<EventMessage>,
    pub resumed: bool,
}

pub struct Host {
    plan: Plan,
    stage: Stage,
    decoder: Decoder,
    sequence: u16,
    /// The command that waits for an answer, when it is given up, and how often it was sent.
    asked: Option<(Vec<u8>, u64, u32)>,
    next_heartbeat: u64,
    ends: Option<u64>,
    last_heard: u64,
    kept: Kept,
    motion_begun: bool,
    pub outcome: Outcome,
}

impl Host {
    pub fn new(plan: Plan) -> Self {
        Self {
            plan,
            stage: Stage::Greet,
            decoder: Decoder::new(),
            sequence: 0,
            asked: None,
            next_heartbeat: 0,
            ends: None,
            last_heard: 0,
            kept: Kept::NoStorage,
            motion_begun: false,
            outcome: Outcome::default(),
        }
    }

    fn say(&mut self, word: impl Into<String>) {
        let word = word.into();
        if !self.outcome.words.contains(&word) {
            self.outcome.words.push(word);
        }
    }

    /// Looks at the line; returns whether everything is over.
    pub fn step(&mut self, chip: &Chip) -> bool {
        let now = chip.with(|m| m.now);
        let asleep = self.plan.sleeps.is_some_and(|(from, to)| (from..to).contains(&now));
        if asleep {
            return false;
        }
        let bytes = chip.with(|m| std::mem::take(&mut m.port.to_host));
        for byte in bytes {
            self.take(byte, chip, now);
        }
        self.flood(chip, now);
        match &mut self.asked {
            Some((bytes, until, tries)) if now >= *until => {
                if *tries < TRIES {
                    (*until, *tries) = (now + PATIENCE, *tries + 1);
                    chip.with(|m| m.host_sends(bytes));
                } else {
                    self.asked = None;
                    self.unanswered();
                }
            }
            Some(_) => {}
            None => self.go_on(chip, now),
        }
        if now > self.plan.calm_after + MOST_SILENT + PATIENCE {
            self.stage = Stage::Over;
        }
        self.stage == Stage::Over
    }

    fn flood(&mut self, chip: &Chip, now: u64) {
        let floods = self.plan.floods.is_some_and(|(from, to)| (from..to).contains(&now));
        if floods && chip.with(|m| m.host_backlog()) < 200 {
            for command in [Command::ReadCounters, Command::Heartbeat, Command::ReadSettings] {
                let bytes = self.encoded(&command);
                chip.with(|m| m.host_sends(&bytes));
            }
        }
    }

    fn encoded(&mut self, command: &Command) -> Vec<u8> {
        self.sequence = self.sequence.wrapping_add(1);
        let mut bytes = vec![0; frame::MAX_FRAME];
        let length = encode(Kind::Command, self.sequence, command, &mut bytes).unwrap();
        bytes.truncate(length);
        bytes
    }

    fn ask(&mut self, command: &Command, chip: &Chip, now: u64) {
        let bytes = self.encoded(command);
        chip.with(|m| m.host_sends(&bytes));
        self.asked = Some((bytes, now + PATIENCE, 1));
    }

    fn unanswered(&mut self) {
        match self.stage {
            // A host asks on until somebody is there.
            Stage::Greet => self.say("no answer"),
            Stage::Back => {}
            Stage::Restart => self.stage = Stage::Back,
            Stage::Again | Stage::Events => self.stage = Stage::Over,
            _ => {
                self.say("no answer");
                self.stage = Stage::Rest;
            }
        }
    }

    fn go_on(&mut self, chip: &Chip, now: u64) {
        match self.stage {
            Stage::Greet | Stage::Back => self.ask(&Command::Hello, chip, now),
            Stage::Configure | Stage::Again => {
                let settings = self.plan.settings.clone();
                self.ask(&Command::Configure(settings), chip, now);
            }
            Stage::Resume => {
                let Kept::Run(run) = self.kept else { return self.stage = Stage::Rest };
                self.ask(&Command::Resume { run: run.run, next_reading: run.readings }, chip, now);
            }
            Stage::Start => self.ask(&Command::Start, chip, now),
            Stage::Run if self.ends.is_some_and(|ends| now >= ends) => {
                self.stage = Stage::Hold;
            }
            Stage::Run => {
                if now >= self.next_heartbeat {
                    self.next_heartbeat = now + HEARTBEAT;
                    let bytes = self.encoded(&Command::Heartbeat);
                    chip.with(|m| m.host_sends(&bytes));
                }
            }
            Stage::Hold => self.ask(&Command::Hold, chip, now),
            Stage::Counters => self.ask(&Command::ReadCounters, chip, now),
            Stage::Estimate => self.ask(&Command::ReadEstimate, chip, now),
            Stage::Rest if now > self.plan.calm_after => self.stage = Stage::Restart,
            Stage::Rest => {}
            Stage::Restart => self.ask(&Command::Restart, chip, now),
            Stage::Events => self.ask(&Command::ReadEvents, chip, now),
            Stage::Over => {}
        }
    }

    fn take(&mut self, byte: u8, chip: &Chip, now: u64) {
        let frame = match self.decoder.push(byte) {
            Some(Ok(frame)) => frame,
            _ => return,
        };
        self.last_heard = now;
        if frame.kind == Kind::Answer {
            let sequence = frame.sequence;
            let answer: Option<Answer> = frame.message().ok();
            if let (true, Some(answer)) = (sequence == self.sequence_asked(), answer) {
                self.asked = None;
                self.answered(answer, chip, now);
            }
            return;
        }
        match frame.message() {
            Ok(Telemetry::Announce(identity)) => self.announced(&identity),
            Ok(Telemetry::State { state: StateName::Fault, reason }) => {
                self.say(format!("{reason:?}"));
                if matches!(self.stage, Stage::Run | Stage::Hold | Stage::Start) {
                    (self.asked, self.stage) = (None, Stage::Counters);
                }
            }
            Ok(Telemetry::State { state: StateName::Holding, reason }) if self.stage == Stage::Run => {
                self.say(format!("{reason:?}"));
                self.stage = Stage::Hold;
            }
            _ => {}
        }
    }

    /// Returns the sequence number of the command that waits.
    fn sequence_asked(&self) -> u16 {
        let Some((bytes, ..)) = &self.asked else { return u16::MAX };
        let mut decoder = Decoder::new();
        let mut found = None;
        for byte in bytes {
            if let Some(Ok(frame)) = decoder.push(*byte) {
                found = Some(frame.sequence);
            }
        }
        found.unwrap_or(u16::MAX)
    }

    fn announced(&mut self, identity: &Identity) {
        match self.stage {
            Stage::Greet | Stage::Back | Stage::Over | Stage::Rest => {}
            Stage::Restart => (self.asked, self.stage) = (None, Stage::Back),
            _ => {
                self.outcome.restarts += 1;
                self.say(format!("started by {:?}", identity.reset));
                (self.asked, self.stage) = (None, Stage::Greet);
            }
        }
    }

    fn answered(&mut self, answer: Answer, chip: &Chip, now: u64) {
        match (self.stage, answer) {
            (Stage::Greet, Ok(Reply::Hello(identity))) => {
                self.kept = identity.kept;
                if identity.clock != ClockSource::Crystal {
                    self.say(format!("time from {:?}", identity.clock));
                }
                let goes_on =
                    self.ends.is_some() && matches!(identity.kept, Kept::Run(run) if run.readings > 0);
                self.stage = if goes_on { Stage::Resume } else { Stage::Configure };
                if self.ends.is_some() && !goes_on {
                    self.say("started anew");
                    self.outcome.started = false;
                }
            }
            (Stage::Configure, Ok(Reply::Done)) => self.stage = Stage::Start,
            (Stage::Resume, Ok(Reply::Done)) => {
                self.outcome.resumed = true;
                self.stage = Stage::Start;
            }
            (Stage::Resume, Err(error)) => {
                self.say(format!("resume: {error:?}"));
                self.stage = Stage::Configure;
            }
            (Stage::Start, Ok(Reply::Done)) => {
                self.stage = Stage::Run;
                self.outcome.started = true;
                if !std::mem::replace(&mut self.motion_begun, true) {
                    chip.with(|m| m.rig.start()).unwrap();
                    self.ends = Some(now + self.plan.duration);
                }
            }
            (Stage::Hold, Ok(Reply::Done)) => {
                self.stage = Stage::Counters;
            }
            (Stage::Counters, Ok(Reply::Counters(counters))) => {
                self.outcome.counters = Some(counters);
                self.stage = Stage::Estimate;
            }
            (Stage::Estimate, Ok(Reply::Estimate(report))) => {
                if report.consistency != Consistency::NotDetermined {
                    self.outcome.estimate = Some(report);
                }
                self.stage = Stage::Rest;
            }
            (Stage::Restart, _) => self.stage = Stage::Back,
            (Stage::Back, Ok(Reply::Hello(_))) => self.stage = Stage::Again,
            (Stage::Again, answer) => {
                self.outcome.alive = answer == Ok(Reply::Done);
                if let Err(error) = answer {
                    self.say(format!("again: {error:?}"));
                }
                self.stage = Stage::Events;
            }
            (Stage::Events, answer) => {
                if let Ok(Reply::Events(report)) = answer {
                    self.outcome.events = report.events.to_vec();
                }
                self.stage = Stage::Over;
            }
            (stage, Err(error)) => {
                self.say(format!("{stage:?}: {error:?}"));
                self.stage = Stage::Rest;
            }
            _ => {}
        }
    }
}
