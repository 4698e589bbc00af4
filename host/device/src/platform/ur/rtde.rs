//! The controller's real-time data exchange (RTDE, version 2): set points there, the arm's state back.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use hexapod::ARM_STEP_S;
use rigident_io::sources::rtde::{Packages, package};

use super::script::{Order, status};
use super::states;
use crate::platform::PATIENCE;
use crate::platform::clock::Clock;
use crate::platform::{PlatformError, Said, Trace};

/// Packages that are asked for, 1/s: the cycle of a CB3, a quarter of an e-Series'.
const RATE_HZ: f64 = 125.0;
/// Time between two reads of a line on which nothing has arrived.
const READ: Duration = Duration::from_millis(20);
/// A controller that says nothing for longer is lost, s: less than the program on it waits for set points.
pub(super) const SILENT_S: f64 = 0.15;
/// A package that cannot be sent within is lost: likewise.
const WRITE: Duration = Duration::from_millis(100);
/// Points that go in one package.
pub(super) const POINTS: usize = 4;

/// The variables that the controller sends: names and types.
const OUTPUTS: [(&str, &str); 12] = [
    ("timestamp", "DOUBLE"),
    ("actual_q", "VECTOR6D"),
    ("actual_qd", "VECTOR6D"),
    ("robot_mode", "INT32"),
    ("safety_mode", "INT32"),
    ("runtime_state", "UINT32"),
    ("target_speed_fraction", "DOUBLE"),
    ("output_int_register_24", "INT32"),
    ("output_int_register_25", "INT32"),
    ("output_int_register_26", "INT32"),
    ("output_int_register_27", "INT32"),
    ("output_int_register_28", "INT32"),
];

/// The reason that a running program takes no points.
const NOT_TAKEN: &str = "it takes no more set points though a program runs: another program was started on \
                         it, in place of the one from here, or it waits for an answer at its panel";

/// The state of an arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct State {
    /// The controller's clock, s.
    pub timestamp_s: f64,
    /// Positions, rad.
    pub q: [f64; 6],
    /// Rates, rad/s.
    pub qd: [f64; 6],
    pub robot_mode: i32,
    pub safety_mode: i32,
    pub runtime_state: u32,
    /// The speed slider of the panel, as a share.
    pub speed: f64,
    /// Number of the motion that the program follows.
    pub motion: i32,
    /// Status of the program, see `script::status`.
    pub status: i32,
    /// Reason of the program's end, see `script::reason`.
    pub reason: i32,
    /// The last point used.
    pub used: i32,
    /// The last point taken.
    pub taken: i32,
}

impl State {
    /// Returns whether a program runs, and the last that wrote its registers was that of this motion.
    pub fn is_run_of(&self, motion: i32) -> bool {
        self.motion == motion && self.runtime_state == states::PLAYING
    }

    /// Returns whether the program of this motion follows set points, by all that the controller says:
    /// registers keep what a program that is gone has written.
    fn follows(&self, motion: i32) -> bool {
        self.is_run_of(motion)
            && self.status == status::FOLLOWING
            && self.robot_mode == states::RUNNING
            && states::is_safe(self.safety_mode)
    }

    /// Reads a package of data; `None` if it is none, or not of numbers.
    fn read(recipe: u8, payload: &[u8]) -> Option<Self> {
        let (number, mut rest) = payload.split_first()?;
        if *number != recipe {
            return None;
        }
        let mut state = Self { timestamp_s: double(&mut rest)?, ..Self::default() };
        for values in [&mut state.q, &mut state.qd] {
            for value in values {
                *value = double(&mut rest)?;
            }
        }
        (state.robot_mode, state.safety_mode) = (integer(&mut rest)?, integer(&mut rest)?);
        state.runtime_state = integer(&mut rest)?.cast_unsigned();
        state.speed = double(&mut rest)?;
        for value in
            [&mut state.motion, &mut state.status, &mut state.reason, &mut state.used, &mut state.taken]
        {
            *value = integer(&mut rest)?;
        }
        rest.is_empty().then_some(state)
    }

    /// Returns the highest rate of a joint, rad/s.
    pub fn fastest(&self) -> f64 {
        self.qd.iter().fold(0.0, |most, rate| rate.abs().max(most))
    }
}

fn double(rest: &mut &[u8]) -> Option<f64> {
    let (eight, after) = rest.split_first_chunk::<8>()?;
    *rest = after;
    Some(f64::from_be_bytes(*eight)).filter(|value| value.is_finite())
}

fn integer(rest: &mut &[u8]) -> Option<i32> {
    let (four, after) = rest.split_first_chunk::<4>()?;
    *rest = after;
    Some(i32::from_be_bytes(*four))
}

/// The line to a controller.
pub(super) struct Rtde {
    stream: TcpStream,
    packages: Packages,
    address: String,
    outputs: u8,
    inputs: u8,
    clock: Clock,
    state: State,
    heard_s: f64,
    /// True if it sends its state.
    runs: bool,
    /// Number of the motion, of the newest point, and the newest points, the newest first.
    pub motion: i32,
    pub newest: i32,
    points: [[f64; 6]; POINTS],
    /// True if another program runs in place of this motion's.
    pub replaced: bool,
    pub trace: Option<Trace>,
}

impl Rtde {
    /// Agrees with the controller on the variables of either side, and starts; nothing moves.
    ///
    /// # Errors
    /// It does not answer, or lacks something.
    pub(super) fn new(stream: TcpStream, address: String, clock: Clock) -> Result<Self, PlatformError> {
        let unreachable = |e: std::io::Error| PlatformError::Unreachable {
            address: address.clone(),
            reason: e.to_string(),
        };
        stream.set_write_timeout(Some(WRITE)).map_err(unreachable)?;
        stream.set_read_timeout(Some(READ)).map_err(unreachable)?;
        stream.set_nodelay(true).map_err(unreachable)?;
        let mut rtde = Self {
            stream,
            packages: Packages::default(),
            address,
            outputs: 0,
            inputs: 0,
            heard_s: clock.now_s(),
            clock,
            state: State::default(),
            runs: false,
            motion: 0,
            newest: 0,
            points: [[0.0; 6]; POINTS],
            replaced: false,
            trace: None,
        };
        if rtde.ask(b'V', &2_u16.to_be_bytes())? != [1] {
            return Err(refused(
                "it does not know version 2 of RTDE: update PolyScope to 3.10, 5.4 or later",
            ));
        }
        let mut wanted = RATE_HZ.to_be_bytes().to_vec();
        wanted.extend(OUTPUTS.map(|(name, _)| name).join(",").bytes());
        let answer = rtde.ask(b'O', &wanted)?;
        rtde.outputs = recipe(&answer, &OUTPUTS.map(|(name, kind)| (name.to_owned(), kind)))?;
        let inputs = inputs();
        let names: Vec<&str> = inputs.iter().map(|(name, _)| name.as_str()).collect();
        let answer = rtde.ask(b'I', names.join(",").as_bytes())?;
        rtde.inputs = recipe(&answer, &inputs)?;
        Ok(rtde)
    }

    /// Has the controller send its state from now on: somebody must listen then.
    pub(super) fn run(&mut self) -> Result<(), PlatformError> {
        if !self.runs {
            if self.ask(b'S', &[])?.first() != Some(&1) {
                return Err(refused("it does not start to send its state"));
            }
            (self.runs, self.heard_s) = (true, self.clock.now_s());
        }
        Ok(())
    }

    /// Has it send nothing more: nobody listens.
    pub(super) fn pause(&mut self) -> Result<(), PlatformError> {
        if std::mem::take(&mut self.runs) {
            self.ask(b'P', &[])?;
        }
        Ok(())
    }

    fn lost(&self, command: &str, reason: impl ToString) -> PlatformError {
        PlatformError::Lost {
            address: self.address.clone(),
            command: command.to_owned(),
            reason: reason.to_string(),
        }
    }

    /// Sends a package and waits for the answer of its type.
    fn ask(&mut self, kind: u8, payload: &[u8]) -> Result<Vec<u8>, PlatformError> {
        let name = format!("RTDE {:?}", char::from(kind));
        self.stream.write_all(&package(kind, payload)).map_err(|e| self.lost(&name, e))?;
        let deadline_s = self.clock.now_s() + PATIENCE.as_secs_f64();
        while self.clock.now_s() < deadline_s {
            while let Some((found, payload)) = self.packages.next().map_err(|why| refused(&why))? {
                if found == kind {
                    return Ok(payload.to_vec());
                }
            }
            self.take(&name)?;
        }
        Err(self.lost(&name, format!("no answer within {} s: is this an RTDE port?", PATIENCE.as_secs())))
    }

    /// Takes the bytes that have arrived, after at most the time of one read; returns whether there was
    /// something.
    fn take(&mut self, command: &str) -> Result<bool, PlatformError> {
        let mut buffer = [0; 8192];
        match self.stream.read(&mut buffer) {
            Ok(0) => Err(self.lost(command, "it closed the connection")),
            Ok(n) => {
                self.packages.feed(buffer.get(..n).unwrap_or_default());
                Ok(n == buffer.len())
            }
            Err(e)
                if matches!(
                    e.kind(),
                    ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted
                ) =>
            {
                Ok(false)
            }
            Err(e) => Err(self.lost(command, e)),
        }
    }

    /// Takes in every state that has arrived; does not wait.
    fn listen(&mut self) -> Result<(), PlatformError> {
        self.stream.set_nonblocking(true).map_err(|e| self.lost("state", e))?;
        let mut more = Ok(true);
        while matches!(more, Ok(true)) {
            more = self.take("state");
        }
        self.stream.set_nonblocking(false).map_err(|e| self.lost("state", e))?;
        while let Some((kind, payload)) = self.packages.next().map_err(|why| refused(&why))? {
            if kind == b'U'
                && let Some(state) = State::read(self.outputs, payload)
            {
                (self.state, self.heard_s) = (state, self.clock.now_s());
            }
        }
        more.map(drop)
    }

    /// Returns the newest state, which is not older than [`SILENT_S`].
    ///
    /// # Errors
    /// The controller is silent or gone.
    pub(super) fn now(&mut self) -> Result<State, PlatformError> {
        self.listen()?;
        let silent_s = self.clock.now_s() - self.heard_s;
        if silent_s > SILENT_S {
            return Err(self.lost("state", format!("it has said nothing for {:.0} ms", 1e3 * silent_s)));
        }
        Ok(self.state)
    }

    /// Returns a state that has yet to arrive, within this time, s.
    ///
    /// # Errors
    /// None comes.
    pub(super) fn fresh(&mut self, within_s: f64) -> Result<State, PlatformError> {
        let ran = self.runs;
        self.run()?;
        // Packages that have waited here are old.
        self.listen()?;
        let begun_s = self.clock.now_s();
        let before_s = self.heard_s;
        while self.heard_s <= before_s {
            if self.clock.now_s() - begun_s > within_s {
                return Err(self.lost("state", format!("it has said nothing for {within_s} s")));
            }
            self.clock.wait_s(0.004);
            self.listen()?;
        }
        if !ran {
            self.pause()?;
        }
        Ok(self.state)
    }

    /// Begins a motion of a new number; no point of it is there yet.
    pub(super) fn begin(&mut self, motion: i32) {
        (self.motion, self.newest, self.replaced) = (motion, 0, false);
        self.points = [self.state.q; POINTS];
    }

    /// Sends a control point, rad, once the program has taken all but three: a package has four.
    pub(super) fn point(&mut self, q: &[f64; 6]) -> Result<(), PlatformError> {
        let begun_s = self.clock.now_s();
        loop {
            let state = self.now()?;
            let taken = if state.motion == self.motion { state.taken } else { 0 };
            let behind = self.newest.saturating_sub(taken);
            if behind < POINTS as i32 {
                break;
            }
            if self.clock.now_s() - begun_s > SILENT_S {
                // A program that has ended takes nothing any more; whoever looks says so.
                if state.follows(self.motion) {
                    self.replaced = true;
                    return Err(PlatformError::Halted(NOT_TAKEN.to_owned()));
                }
                break;
            }
            self.clock.wait_s(0.002);
        }
        self.points.rotate_right(1);
        self.points[0] = *q;
        self.newest += 1;
        self.order(Order::Follow)
    }

    /// Sends the points that are known, with an order.
    pub(super) fn order(&mut self, order: Order) -> Result<(), PlatformError> {
        let mut payload = vec![self.inputs];
        for number in [self.motion, self.newest, order as i32] {
            payload.extend(number.to_be_bytes());
        }
        payload.extend(self.points.iter().flatten().flat_map(|q| q.to_be_bytes()));
        let name = format!("{order:?} {} of motion {}", self.newest, self.motion);
        if let Some(trace) = &self.trace {
            let q = self.points[0].map(|q| format!("{q:.6}")).join(",");
            trace(Said::Command(&format!("{name}: {q}")));
        }
        self.stream.write_all(&package(b'U', &payload)).map_err(|e| self.lost(&name, e))
    }

    /// Notes the state in the trace.
    pub(super) fn note(&self) {
        if let Some(trace) = &self.trace {
            let s = &self.state;
            let q = s.q.map(|q| format!("{q:.6}")).join(",");
            trace(Said::Reply(&format!(
                "t={:.3} robot_mode={} safety_mode={} runtime_state={} status={} reason={} used={} q={q}",
                s.timestamp_s, s.robot_mode, s.safety_mode, s.runtime_state, s.status, s.reason, s.used
            )));
        }
    }
}

/// Returns the names and types of the variables that are sent.
fn inputs() -> Vec<(String, &'static str)> {
    let integers = (24..27).map(|k| (format!("input_int_register_{k}"), "INT32"));
    integers.chain((24..48).map(|k| (format!("input_double_register_{k}"), "DOUBLE"))).collect()
}

/// Returns the number of a recipe that the controller has accepted.
fn recipe(answer: &[u8], wanted: &[(String, &str)]) -> Result<u8, PlatformError> {
    let (number, types) = answer.split_first().ok_or_else(|| refused("its answer to a set-up is empty"))?;
    let types = String::from_utf8_lossy(types);
    let types: Vec<&str> = types.split(',').collect();
    if types.len() != wanted.len() {
        return Err(refused(&format!(
            "{} variables were asked for, it answers for {}",
            wanted.len(),
            types.len()
        )));
    }
    for ((name, kind), found) in wanted.iter().zip(types) {
        match found {
            "NOT_FOUND" => {
                return Err(refused(&format!("it has no {name}: update PolyScope to 3.10, 5.4 or later")));
            }
            "IN_USE" => {
                return Err(refused(&format!(
                    "{name} is in use by another program or a field bus: end the other connection first"
                )));
            }
            found if found != *kind => {
                return Err(refused(&format!(
                    "its {name} is a {}, and a {kind} is needed",
                    rigident_shared::printable::name(found)
                )));
            }
            _ => {}
        }
    }
    Ok(*number)
}

pub(super) fn refused(why: &str) -> PlatformError {
    PlatformError::Refused(why.to_owned())
}

/// A point comes as often as the script's spline needs one, 1/s.
pub(super) const POINTS_HZ: f64 = 1.0 / ARM_STEP_S;
