//! The platform's controller, as a program on the network meets it: JSON, one object a line.
//!
//! | line | what it does |
//! |---|---|
//! | `{"cmd":"load","program":…}` | takes a motion program and checks it against the legs |
//! | `{"cmd":"start","quiet_s":0.25}` | starts it; without `quiet_s` it is 2 |
//! | `{"cmd":"stop"}` | brings the plate to rest within half a second |
//! | `{"cmd":"state"}` | nothing |
//!
//! Every line is answered with one: `{"ok":true,"state":"holding|moving|done","time_s":…,"duration_s":…,
//! "pose":…}` or `{"ok":false,"error":"…"}`. A client that goes away, or says nothing for `quiet_s`, while the
//! plate moves by its command stops it.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::rig::{MotionState, Rig, SharedRig};
use crate::runner::lock;
use hexapod::{MotionProgram, PROGRAM_LINE_BYTES, Pose};

use super::listener::{LOOK_AGAIN, Listener};

/// A client that moves the plate and says nothing for this long has hung, s, unless it has named another
/// time.
const QUIET_S: f64 = 2.0;
/// The values that it may name.
const QUIETS_S: std::ops::RangeInclusive<f64> = 0.05..=60.0;

/// Not one enum tagged by `cmd`: such an enum cannot hold floats once any crate of the build asks serde_json
/// for arbitrary precision, and the log decoder does.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    cmd: Verb,
    program: Option<MotionProgram>,
    quiet_s: Option<f64>,
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Verb {
    Load,
    Start,
    Stop,
    State,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    Holding,
    Moving,
    Done,
}

#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Answer {
    Done { ok: bool, state: State, time_s: f64, duration_s: f64, pose: Pose },
    Refused { ok: bool, error: String },
}

/// A controller at work. Dropping it closes every connection.
pub struct Controller(Listener);

impl Controller {
    /// Listens at `address`; port 0 takes a free one.
    ///
    /// # Errors
    /// If the address is taken or cannot be had.
    pub fn listen(address: impl ToSocketAddrs, rig: SharedRig) -> io::Result<Self> {
        Listener::listen(address, move |stream, leave| attend(stream, &rig, leave)).map(Self)
    }

    /// Returns where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }
}

fn attend(stream: TcpStream, rig: &SharedRig, leave: &AtomicBool) {
    let started = converse(stream, rig, leave).unwrap_or(true);
    let mut rig = lock(rig);
    if started && rig.motion() == MotionState::Moving {
        rig.stop();
    }
}

/// Answers lines until the client hangs up. Returns true if it had started a motion.
fn converse(stream: TcpStream, rig: &SharedRig, leave: &AtomicBool) -> io::Result<bool> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(LOOK_AGAIN / 2))?;
    let mut out = stream.try_clone()?;
    let mut input = BufReader::new(stream);
    let mut line = Vec::new();
    let mut started = false;
    let (mut heard, mut quiet_s) = (Instant::now(), QUIET_S);
    loop {
        // What a timed-out read has brought stays in `line`.
        let left = PROGRAM_LINE_BYTES.saturating_sub(line.len()) as u64;
        match (&mut input).take(left).read_until(b'\n', &mut line) {
            Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                if leave.load(Ordering::Acquire) {
                    return Ok(started);
                }
                if started && heard.elapsed().as_secs_f64() > quiet_s {
                    lock(rig).stop();
                }
                continue;
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return if started { Ok(true) } else { Err(e) },
            Ok(_) if line.ends_with(b"\n") => {}
            Ok(_) if line.len() >= PROGRAM_LINE_BYTES => {
                write_line(&mut out, &refused(format!("a line is longer than {PROGRAM_LINE_BYTES} bytes")))?;
                return Ok(started);
            }
            Ok(_) => return Ok(started),
        }
        let answer = match serde_json::from_slice::<Request>(&line) {
            Ok(request) => {
                started |= request.cmd == Verb::Start;
                if let Some(named_s) = request.quiet_s.filter(|s| QUIETS_S.contains(s)) {
                    quiet_s = named_s;
                }
                obey(&mut lock(rig), request)
            }
            Err(e) => refused(format!("not a command: {e}")),
        };
        line.clear();
        heard = Instant::now();
        write_line(&mut out, &answer)?;
    }
}

fn write_line(out: &mut impl Write, answer: &Answer) -> io::Result<()> {
    let mut line = serde_json::to_vec(answer)?;
    line.push(b'\n');
    out.write_all(&line)
}

fn refused(error: String) -> Answer {
    Answer::Refused { ok: false, error }
}

fn obey(rig: &mut Rig, request: Request) -> Answer {
    let done = match (request.cmd, request.program) {
        (Verb::Load, Some(program)) => rig.load_program(program),
        (Verb::Load, None) => return refused("not a command: load comes with a program".to_owned()),
        (Verb::Start, _) => rig.start(),
        (Verb::Stop, _) => {
            rig.stop();
            Ok(())
        }
        (Verb::State, _) => Ok(()),
    };
    if let Err(e) = done {
        return refused(e.to_string());
    }
    let state = match rig.motion() {
        MotionState::Holding => State::Holding,
        MotionState::Moving => State::Moving,
        MotionState::Done => State::Done,
    };
    Answer::Done {
        ok: true,
        state,
        time_s: rig.program_time_s(),
        duration_s: rig.program_duration_s(),
        pose: rig.pose(),
    }
}
