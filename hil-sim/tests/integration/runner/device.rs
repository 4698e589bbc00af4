//! A plain host for the tests: asks the device, keeps what it sends.

use std::time::{Duration, Instant};

use hexapod::{MotionProgram, Segment};
use rigident_shared::wire::{
    Answer, Command, CounterReport, Decoder, Kind, LinkReadingMessage, ReadingMessage, Reason, Reply,
    Settings, StateName, Telemetry, encode, frame,
};
use rigident_sim::rig::SharedRig;
use rigident_sim::runner::Mcu;

#[path = "../../settings/mod.rs"]
mod of_rig;
pub use of_rig::settings;

/// Longer than any machine takes; a wait this long is a failure.
const PATIENCE: Duration = Duration::from_secs(60);

pub struct Device<'a> {
    mcu: &'a mut dyn Mcu,
    decoder: Decoder,
    sequence: u16,
    pub readings: Vec<ReadingMessage>,
    pub link_readings: Vec<LinkReadingMessage>,
    pub states: Vec<StateName>,
    pub reasons: Vec<Reason>,
    pub estimates: usize,
}

impl<'a> Device<'a> {
    /// Waits until the device announces itself, and says hello.
    pub fn greet(mcu: &'a mut dyn Mcu) -> Self {
        let mut device = Self {
            mcu,
            decoder: Decoder::new(),
            sequence: 0,
            readings: Vec::new(),
            link_readings: Vec::new(),
            states: Vec::new(),
            reasons: Vec::new(),
            estimates: 0,
        };
        let deadline = Instant::now() + PATIENCE;
        while !device.listen(Duration::from_millis(20)).1 {
            assert!(Instant::now() < deadline, "the device does not announce itself");
        }
        assert!(matches!(device.ask(&Command::Hello), Ok(Reply::Hello(_))));
        device
    }

    /// Has the platform hold its pose for a while, and the device run.
    pub fn hold(&mut self, rig: &SharedRig, duration_s: f64) {
        let start = rig.lock().unwrap().pose();
        let program = MotionProgram { start, segments: vec![Segment::Hold { duration_s }] };
        rig.lock().unwrap().load_program(program).unwrap();
        assert_eq!(self.ask(&Command::Start), Ok(Reply::Done));
        rig.lock().unwrap().start().unwrap();
    }

    /// Asks once: the line of these tests is good.
    pub fn ask(&mut self, command: &Command) -> Answer {
        self.sequence += 1;
        let mut bytes = [0; frame::MAX_FRAME];
        let n = encode(Kind::Command, self.sequence, command, &mut bytes).unwrap();
        self.mcu.write(&bytes[..n]).unwrap();
        let deadline = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < deadline, "no answer to {command:?}");
            for (sequence, answer) in self.listen(Duration::from_millis(20)).0 {
                if sequence == self.sequence {
                    return answer;
                }
            }
        }
    }

    /// Takes what comes; the answers, and whether an announcement was among it.
    pub fn listen(&mut self, timeout: Duration) -> (Vec<(u16, Answer)>, bool) {
        let mut bytes = [0; 4096];
        let n = self.mcu.read(&mut bytes, timeout).unwrap();
        let (mut answers, mut announced) = (Vec::new(), false);
        for byte in &bytes[..n] {
            let Some(frame) = self.decoder.push(*byte) else { continue };
            let frame = frame.unwrap();
            if frame.kind == Kind::Answer {
                answers.push((frame.sequence, frame.message().unwrap()));
                continue;
            }
            match frame.message().unwrap() {
                Telemetry::Announce(_) => announced = true,
                Telemetry::State { state, reason } => {
                    self.states.push(state);
                    self.reasons.push(reason);
                }
                Telemetry::Estimate(_) => self.estimates += 1,
                Telemetry::Readings { first, readings } => {
                    assert_eq!(first as usize, self.readings.len(), "a reading is missing");
                    self.readings.extend(readings);
                }
                Telemetry::LinkReadings { first, readings } => {
                    assert_eq!(first as usize, self.link_readings.len(), "a reading is missing");
                    self.link_readings.extend(readings);
                }
                Telemetry::Heartbeat { .. } | Telemetry::Change(_) => {}
            }
        }
        (answers, announced)
    }

    /// Runs a whole program: configure, start, move, hold.
    pub fn run(&mut self, rig: &SharedRig, settings: &Settings, program: &MotionProgram) {
        assert_eq!(self.ask(&Command::Configure(settings.clone())), Ok(Reply::Done));
        rig.lock().unwrap().load_program(program.clone()).unwrap();
        assert_eq!(self.ask(&Command::Start), Ok(Reply::Done));
        rig.lock().unwrap().start().unwrap();
        let deadline = Instant::now() + PATIENCE;
        while !rig.lock().unwrap().is_done() {
            assert!(Instant::now() < deadline, "the program does not end");
            self.listen(Duration::from_millis(20));
        }
        assert_eq!(self.ask(&Command::Hold), Ok(Reply::Done));
    }

    /// Returns the factor's numbers.
    pub fn factor(&mut self) -> Vec<f32> {
        let (mut rows, mut z, mut residual) = (Vec::new(), Vec::new(), 0.0);
        for row in 0.. {
            let Ok(Reply::Row(mut taken)) = self.ask(&Command::TakeRow { row }) else {
                panic!("no row {row}")
            };
            if row == 0 {
                residual = taken.residual_sum_of_squares;
            }
            z.extend(taken.entries.pop());
            rows.extend(taken.entries);
            if row + 1 == taken.parameters {
                break;
            }
        }
        let entries = rows.into_iter().chain(z).chain([residual]);
        entries.collect()
    }

    pub fn counters(&mut self) -> CounterReport {
        match self.ask(&Command::ReadCounters) {
            Ok(Reply::Counters(counters)) => counters,
            other => panic!("{other:?}"),
        }
    }
}
