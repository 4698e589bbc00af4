//! The simulated rig as served: JSON over TCP.

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use hexapod::{Geometry, MotionProgram, PROGRAM_LINE_BYTES, Pose, Trajectory};
use serde::{Deserialize, Serialize};

use super::address::PATIENCE;
use super::pace::UNWATCHED_S;
use super::{Motion, MotionSample, Platform, PlatformError, way};

/// A program whose clock stood still so much before its end was cut short, s.
const END_S: f64 = 1e-3;
/// Samples are taken no more often than so, s.
const SAMPLE_S: f64 = 0.05;
/// A controller that hears nothing for so long while the plate moves stops it, s.
const QUIET_S: f64 = 0.25;
/// It hears something so often.
const HEARD_EVERY: Duration = Duration::from_millis(50);

/// A controller that speaks one JSON object per line over TCP: `load`, `start`, `stop`, `state`.
pub struct NetworkPlatform {
    geometry: Geometry,
    line: Arc<Mutex<Line>>,
    /// While the plate moves.
    keeper: Option<Keeper>,
    program: Option<MotionProgram>,
    trajectory: Option<Trajectory>,
    samples: Vec<MotionSample>,
    sampled_s: f64,
    /// Duration of the program that was loaded, the way to its start included, s.
    loaded_s: f64,
    /// Duration of the program that was started, s, until it has ended or was stopped from here.
    started_s: Option<f64>,
}

/// The line to the controller.
struct Line {
    address: String,
    stream: BufReader<TcpStream>,
    /// Whether it has answered before.
    known: bool,
    asked: Instant,
    /// What broke it.
    broken: Option<PlatformError>,
}

/// Lets the controller hear something while the plate moves, as long as somebody watches it: a host that has hung or was stopped
/// says nothing, and then the controller stops the plate.
struct Keeper {
    leave: Arc<AtomicBool>,
    watched: Arc<Mutex<Instant>>,
    thread: Option<JoinHandle<()>>,
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked leaves what it had put in: every change is complete.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Keeper {
    fn new(line: &Arc<Mutex<Line>>) -> Self {
        let (leave, watched) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(Instant::now())));
        let (told, line, last) = (Arc::clone(&leave), Arc::clone(line), Arc::clone(&watched));
        let thread = thread::spawn(move || {
            while !told.load(Ordering::Acquire) && lock(&last).elapsed().as_secs_f64() < UNWATCHED_S {
                thread::sleep(HEARD_EVERY / 2);
                let mut line = lock(&line);
                // What is wrong is told to whoever asks next.
                if line.asked.elapsed() > HEARD_EVERY && line.ask(&Request::State).is_err() {
                    return;
                }
            }
        });
        Self { leave, watched, thread: Some(thread) }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

#[derive(Serialize)]
#[serde(tag = "cmd", rename_all = "lowercase")]
enum Request<'a> {
    Load { program: &'a MotionProgram },
    Start { quiet_s: f64 },
    Stop,
    State,
}

#[derive(Deserialize)]
struct Answer {
    ok: bool,
    #[serde(default)]
    state: String,
    #[serde(default)]
    error: String,
    #[serde(default)]
    time_s: f64,
    #[serde(default)]
    duration_s: f64,
    pose: Option<Pose>,
}

impl NetworkPlatform {
    /// Connects to `tcp://HOST:PORT`; `geometry` bounds the way to a program's start.
    ///
    /// # Errors
    /// The address is not one, or nobody answers.
    pub fn connect(address: &str, geometry: &Geometry) -> Result<Self, PlatformError> {
        let unreachable = |reason: String| PlatformError::Unreachable { address: address.to_owned(), reason };
        let host = address
            .strip_prefix("tcp://")
            .ok_or_else(|| unreachable("an address looks like tcp://127.0.0.1:7447".to_owned()))?;
        let mut last = "the name has no address".to_owned();
        for socket in host.to_socket_addrs().map_err(|e| unreachable(e.to_string()))? {
            match TcpStream::connect_timeout(&socket, PATIENCE) {
                Ok(stream) => {
                    stream
                        .set_read_timeout(Some(PATIENCE))
                        .and_then(|()| stream.set_write_timeout(Some(PATIENCE)))
                        .and_then(|()| stream.set_nodelay(true))
                        .map_err(|e| unreachable(e.to_string()))?;
                    let line = Line {
                        address: address.to_owned(),
                        stream: BufReader::new(stream),
                        known: false,
                        asked: Instant::now(),
                        broken: None,
                    };
                    return Ok(Self {
                        geometry: geometry.clone(),
                        line: Arc::new(Mutex::new(line)),
                        keeper: None,
                        program: None,
                        trajectory: None,
                        samples: Vec::new(),
                        sampled_s: f64::NEG_INFINITY,
                        loaded_s: 0.0,
                        started_s: None,
                    });
                }
                Err(error) => last = error.to_string(),
            }
        }
        Err(unreachable(last))
    }

    fn ask(&mut self, request: &Request) -> Result<Answer, PlatformError> {
        lock(&self.line).ask(request)
    }
}

impl Line {
    /// Says a line and takes the answer. What broke it once is told ever after.
    fn ask(&mut self, request: &Request) -> Result<Answer, PlatformError> {
        if let Some(broken) = &self.broken {
            return Err(broken.clone());
        }
        let answered = self.exchange(request);
        self.asked = Instant::now();
        if let Err(error @ (PlatformError::Lost { .. } | PlatformError::Unreachable { .. })) = &answered {
            self.broken = Some(error.clone());
        }
        answered
    }

    fn exchange(&mut self, request: &Request) -> Result<Answer, PlatformError> {
        let (known, address) = (self.known, self.address.clone());
        let command = match request {
            Request::Load { .. } => "load",
            Request::Start { .. } => "start",
            Request::Stop => "stop",
            Request::State => "state",
        };
        let unreachable = |reason: String| {
            let address = address.clone();
            if known {
                PlatformError::Lost { address, command: command.to_owned(), reason }
            } else {
                PlatformError::Unreachable { address, reason }
            }
        };
        let mut line = serde_json::to_string(request).map_err(|e| unreachable(e.to_string()))?;
        line.push('\n');
        let most = PROGRAM_LINE_BYTES;
        if line.len() > most {
            return Err(PlatformError::TooLong { bytes: line.len(), most });
        }
        self.stream.get_mut().write_all(line.as_bytes()).map_err(|e| unreachable(e.to_string()))?;
        let mut reply = String::new();
        match self.stream.read_line(&mut reply) {
            Ok(0) => Err(unreachable("it closed the connection".to_owned())),
            Ok(_) => {
                let answer: Answer = serde_json::from_str(&reply)
                    .map_err(|e| unreachable(format!("its answer is not understood: {e}")))?;
                self.known = true;
                if answer.ok { Ok(answer) } else { Err(PlatformError::Refused(answer.error)) }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Err(unreachable(format!("no answer within {} s", PATIENCE.as_secs())))
            }
            Err(error) => Err(unreachable(error.to_string())),
        }
    }
}

impl Platform for NetworkPlatform {
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        self.loaded_s = self.ask(&Request::Load { program })?.duration_s;
        self.trajectory = Some(program.trajectory()?);
        self.program = Some(program.clone());
        Ok(())
    }

    fn way(&mut self, program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        let here = self.ask(&Request::State)?.pose;
        here.map(|here| way::between(&here, &program.start, &self.geometry)).transpose()
    }

    fn approach(&mut self, go_on: &dyn Fn() -> bool) -> Result<(), PlatformError> {
        let Some(program) = self.program.clone() else { return Ok(()) };
        if let Some(way) = self.way(&program)? {
            way::drive(self, &way, go_on)?;
        }
        self.load(&program)
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        self.sampled_s = f64::NEG_INFINITY;
        let started_s = self.ask(&Request::Start { quiet_s: QUIET_S })?.duration_s;
        if started_s != self.loaded_s {
            self.stop()?;
            return Err(PlatformError::Refused(
                "another program has loaded another motion meanwhile; it was stopped: let one program at a time have the platform"
                    .to_owned(),
            ));
        }
        self.started_s = Some(started_s);
        self.keeper = Some(Keeper::new(&self.line));
        Ok(())
    }

    fn stop(&mut self) -> Result<(), PlatformError> {
        self.started_s = None;
        self.ask(&Request::Stop).map(drop)
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        if let Some(keeper) = &self.keeper {
            *lock(&keeper.watched) = Instant::now();
        }
        let answer = self.ask(&Request::State)?;
        if answer.state != "moving" {
            self.keeper = None;
        }
        if let (Some(trajectory), Some(pose), "moving") =
            (&self.trajectory, answer.pose, answer.state.as_str())
            && answer.time_s >= self.sampled_s + SAMPLE_S
        {
            self.sampled_s = answer.time_s;
            // The controller has put the way to the start before the program.
            let time_s = answer.time_s - (answer.duration_s - trajectory.duration_s());
            let commanded = trajectory.state(time_s).pose();
            self.samples.push(MotionSample { time_s, commanded, measured: Some(pose) });
        }
        if let Some(of_s) = self.started_s {
            let own = answer.duration_s == of_s;
            let (goes_on, ended) = match answer.state.as_str() {
                "moving" => (own, false),
                "done" => (false, own && answer.time_s >= of_s - END_S),
                _ => (false, false),
            };
            if !goes_on {
                self.started_s = None;
                if !ended {
                    // Another has stopped it, or given it another program.
                    return Err(PlatformError::Cut { at_s: answer.time_s, of_s });
                }
            }
        }
        match answer.state.as_str() {
            "holding" => Ok(Motion::Holding),
            "moving" => Ok(Motion::Moving),
            "done" => Ok(Motion::Done),
            other => Err(PlatformError::Refused(format!("it reports an unknown state, {other:?}"))),
        }
    }

    fn samples(&mut self) -> Vec<MotionSample> {
        std::mem::take(&mut self.samples)
    }
}
