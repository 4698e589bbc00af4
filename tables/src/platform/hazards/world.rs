//! A machine with its controller, the line to it and what goes wrong with them, in a time of their own.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigident::device::platform::{self, Stop, Watch};
use rigident_sim::rig::{BusEvent, MotionState, Rig, RigConfig, SharedRig};
use rigident_sim::serve::Receiver;
use rigident_sim::serve::gcs::Client;

use super::referee::{Referee, STEP_S};

/// A byte takes this long over the line, s.
const LATENCY_S: f64 = 5e-4;
/// A read that nothing arrives for takes this long, s.
const READ_S: f64 = 0.02;

/// A fault of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    None,
    /// Somebody says stop, or the plan ends.
    Stop(Stop),
    /// The host stands still for this long, s.
    HostStalled(f64),
    LinkCut,
    /// From then on the controller takes this much longer over the line for everything, s.
    ControllerLate(f64),
    /// The rate's interval is none of the controller's.
    Rounding,
    /// The controller's clock goes faster by this share, all the time.
    BufferEmpty(f64),
    /// A reference move meets an error this long after its beginning, s.
    ReferenceError(f64),
    /// Another client says this.
    SecondClient(&'static str),
    /// Another client moves the pivot point, before or after the way to the start.
    PivotMoved(bool),
    ServoOff,
}

/// The far end of the line.
pub enum Controller {
    Gcs { host: Client, other: Client },
    Lines(Box<Receiver>),
}

struct State {
    now_s: f64,
    rig: SharedRig,
    controller: Controller,
    fault: Fault,
    /// The number of the motion in which it happens, and how long after its beginning, s.
    when: (usize, f64),
    motions: usize,
    fails_s: Option<f64>,
    failed: bool,
    referenced_s: Option<f64>,
    late_s: f64,
    cut: bool,
    to_machine: VecDeque<(f64, Vec<u8>)>,
    to_host: VecDeque<(f64, u8)>,
    watch: Option<Watch>,
    /// The referee's last step.
    seen: u64,
    referee: Referee,
}

/// The world.
pub struct World(Mutex<State>);

impl World {
    /// Makes the world of a rig at home, its controller by the address's scheme.
    pub fn new(
        config: RigConfig,
        lines: bool,
        fault: Fault,
        when: (usize, f64),
        referee: Referee,
    ) -> Arc<Self> {
        let rig = Rig::new(config).expect("a simulated rig").shared();
        let controller = if lines {
            Controller::Lines(Box::new(Receiver::new(Arc::clone(&rig), Arc::new(|_: &str| ()))))
        } else {
            let [host, other] = Client::of_one(Arc::clone(&rig));
            Controller::Gcs { host, other }
        };
        Arc::new(Self(Mutex::new(State {
            now_s: 0.0,
            rig,
            controller,
            fault,
            when,
            motions: 0,
            fails_s: None,
            failed: false,
            referenced_s: None,
            late_s: 0.0,
            cut: false,
            to_machine: VecDeque::new(),
            to_host: VecDeque::new(),
            watch: None,
            seen: 0,
            referee,
        })))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the line's end at the host.
    pub fn wire(self: &Arc<Self>) -> Box<dyn platform::Wire> {
        Box::new(Line(Arc::clone(self)))
    }

    /// Lets another client say something.
    pub fn other_says(&self, words: &str) {
        self.state().other_says(words);
    }

    /// Lets time go on.
    pub fn passes(&self, duration_s: f64) {
        let mut state = self.state();
        let until_s = state.now_s + duration_s;
        state.advance(until_s);
    }

    /// Returns the time when something went wrong, s; `None` if nothing did.
    pub fn failed_s(&self) -> Option<f64> {
        let state = self.state();
        state.fails_s.filter(|_| state.failed)
    }

    /// Reads what the referee saw.
    pub fn referee<R>(&self, read: impl FnOnce(&Referee) -> R) -> R {
        read(&self.state().referee)
    }

    /// Returns true if the machine itself moves, and the pose of its plate.
    pub fn machine(&self) -> (bool, hexapod::Pose) {
        let state = self.state();
        let rig = state.rig.lock().unwrap_or_else(PoisonError::into_inner);
        (rig.motion() == MotionState::Moving, rig.pose())
    }
}

impl platform::World for World {
    fn now_s(&self) -> f64 {
        self.state().now_s
    }

    fn wait_until(&self, time_s: f64) {
        let mut state = self.state();
        let mut until_s = time_s;
        if let (Fault::HostStalled(stall_s), Some(at_s), false) = (state.fault, state.fails_s, state.failed)
            && at_s <= time_s
        {
            // Nobody watches meanwhile.
            let watch = state.watch.take();
            state.advance(at_s);
            state.fails();
            until_s = time_s.max(at_s + stall_s);
            state.advance(at_s + stall_s);
            state.watch = watch;
        }
        state.advance(until_s);
    }

    fn begins(&self, watch: Watch) {
        let mut state = self.state();
        state.motions += 1;
        state.watch = Some(watch);
        if state.motions == state.when.0 {
            state.fails_s = Some(state.now_s + state.when.1);
        }
    }
}

impl State {
    fn other_says(&mut self, words: &str) {
        if let Controller::Gcs { other, .. } = &mut self.controller {
            other.say(words.as_bytes());
        }
    }

    fn advance(&mut self, until_s: f64) {
        while self.now_s < until_s {
            self.now_s = until_s.min(((self.now_s / STEP_S).floor() + 1.0) * STEP_S + 1e-12);
            let gained_s = if let Fault::BufferEmpty(share) = self.fault { share * self.now_s } else { 0.0 };
            {
                let mut rig = self.rig.lock().unwrap_or_else(PoisonError::into_inner);
                let until_ns = (1e9 * (self.now_s + gained_s)).round() as u64;
                while rig.next_event_before(until_ns) != BusEvent::Idle {}
            }
            while self.to_machine.front().is_some_and(|(at_s, _)| *at_s <= self.now_s) {
                let Some((_, bytes)) = self.to_machine.pop_front() else { break };
                self.machine_hears(&bytes);
            }
            if !self.failed && self.fails_s.is_some_and(|at_s| at_s <= self.now_s) {
                self.fails();
            }
            if let Some(watch) = &self.watch {
                watch.looks(self.now_s);
            }
            // Once in each step, whoever waits for how long.
            let step = (self.now_s / STEP_S + 1e-6).floor() as u64;
            if step > self.seen {
                self.seen = step;
                let pose = self.rig.lock().unwrap_or_else(PoisonError::into_inner).pose();
                self.referee.sees(self.now_s, &pose);
            }
        }
    }

    fn machine_hears(&mut self, bytes: &[u8]) {
        let answer = match &mut self.controller {
            Controller::Lines(receiver) => {
                receiver.feed(bytes);
                return;
            }
            Controller::Gcs { host, .. } => host.say(bytes),
        };
        if bytes == b"FRF\n" {
            self.referenced_s = Some(self.now_s);
        }
        let mut answer = answer;
        if let (Fault::ReferenceError(after_s), Some(since_s), false) =
            (self.fault, self.referenced_s, self.failed)
            && bytes == b"ERR?\n"
            && self.now_s > since_s + after_s
        {
            self.fails_s = Some(self.now_s);
            self.fails();
            answer = b"1004\n".to_vec();
        }
        let at_s = self.now_s + LATENCY_S + self.late_s;
        self.to_host.extend(answer.into_iter().map(|byte| (at_s, byte)));
    }

    fn fails(&mut self) {
        self.failed = true;
        self.referee.phase = 1;
        match self.fault {
            Fault::Stop(stop) => self.watch.iter().for_each(|watch| watch.stop(stop)),
            Fault::LinkCut => {
                self.cut = true;
                if let Controller::Gcs { host, .. } = &mut self.controller {
                    host.leave();
                }
            }
            Fault::ControllerLate(late_s) => self.late_s = late_s,
            Fault::SecondClient(words) => self.other_says(words),
            Fault::ServoOff => self.other_says("SVO X 0 Y 0 Z 0 U 0 V 0 W 0\n"),
            _ => {}
        }
    }
}

struct Line(Arc<World>);

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut state = self.0.state();
        let deadline_s = state.now_s + READ_S;
        loop {
            if state.cut {
                return Ok(0);
            }
            match state.to_host.front().copied() {
                Some((at_s, byte)) if at_s <= state.now_s => {
                    state.to_host.pop_front();
                    buffer[0] = byte;
                    return Ok(1);
                }
                _ if state.now_s >= deadline_s => return Err(io::ErrorKind::TimedOut.into()),
                _ => {
                    let next_s = (state.now_s + LATENCY_S).min(deadline_s);
                    state.advance(next_s);
                }
            }
        }
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut state = self.0.state();
        if state.cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let at_s = state.now_s + LATENCY_S + state.late_s;
        state.to_machine.push_back((at_s, bytes.to_vec()));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
