//! The simulated rig as served: JSON over TCP.

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use hexapod::{Geometry, Load, MotionProgram, PROGRAM_LINE_BYTES, Pose, Trajectory};
use serde::{Deserialize, Serialize};

use super::clock::Clock;
use super::pace::UNWATCHED_S;
use super::{Motion, MotionSample, PATIENCE, Platform, PlatformError, Said, Stop, Trace, tcp, way};

/// A program whose clock stood still this long before its end was cut short, s.
const END_S: f64 = 1e-3;
/// Samples are taken no more often than so, s.
const SAMPLE_S: f64 = 0.05;
/// A controller that hears nothing for this long while the plate moves stops it, s.
const QUIET_S: f64 = 0.25;
/// The controller hears something this often.
const HEARD_EVERY: Duration = Duration::from_millis(50);

/// A controller that speaks one JSON object per line over TCP: `load`, `start`, `stop`, `state`.
pub struct NetworkPlatform {
    geometry: Geometry,
    load: Option<Load>,
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

/// The longest answer, bytes.
const LONGEST_ANSWER: usize = 64 << 10;
/// An answer is whole within this time while the plate may move, s: before the controller stops it for having
/// heard nothing.
const ANSWER_S: f64 = 0.8 * QUIET_S;

/// The line to the controller.
struct Line {
    address: String,
    stream: BufReader<TcpStream>,
    /// True if the controller has answered before.
    known: bool,
    asked: Instant,
    /// True while the plate may move: it was started, and has not been seen at rest since.
    moves: bool,
    /// The error that broke it.
    broken: Option<PlatformError>,
    /// The trace in which all that goes over it is noted.
    trace: Option<Trace>,
}

/// Lets the controller hear something while the plate moves, as long as somebody watches it: a host that has
/// hung or was stopped says nothing, and then the controller stops the plate.
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
        let (leaving, line, last) = (Arc::clone(&leave), Arc::clone(line), Arc::clone(&watched));
        let thread = thread::spawn(move || {
            while !leaving.load(Ordering::Acquire) && lock(&last).elapsed().as_secs_f64() < UNWATCHED_S {
                thread::sleep(HEARD_EVERY / 2);
                let mut line = lock(&line);
                // What is wrong is reported to whoever asks next.
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
        let stream = tcp(host, PATIENCE).map_err(|e| unreachable(e.to_string()))?;
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
            moves: false,
            broken: None,
            trace: None,
        };
        Ok(Self {
            geometry: geometry.clone(),
            load: None,
            line: Arc::new(Mutex::new(line)),
            keeper: None,
            program: None,
            trajectory: None,
            samples: Vec::new(),
            sampled_s: f64::NEG_INFINITY,
            loaded_s: 0.0,
            started_s: None,
        })
    }

    fn ask(&mut self, request: &Request) -> Result<Answer, PlatformError> {
        lock(&self.line).ask(request)
    }
}

impl Line {
    /// Says a line and takes the answer. What broke it once is reported ever after.
    fn ask(&mut self, request: &Request) -> Result<Answer, PlatformError> {
        if let Some(broken) = self.broken.clone() {
            if matches!(request, Request::Stop) {
                self.say_stop();
            }
            return Err(broken);
        }
        self.moves |= matches!(request, Request::Start { .. });
        let answered = self.exchange(request);
        self.asked = Instant::now();
        match &answered {
            Ok(answer) => self.moves &= !matches!(request, Request::State) || answer.state == "moving",
            Err(error @ (PlatformError::Lost { .. } | PlatformError::Unreachable { .. })) => {
                self.broken = Some(error.clone());
                if self.moves {
                    self.say_stop();
                }
            }
            Err(_) => {}
        }
        answered
    }

    /// Says stop without waiting for an answer: whoever answers no more may still hear.
    fn say_stop(&mut self) {
        let line = serde_json::to_string(&Request::Stop).unwrap_or_default();
        self.trace.iter().for_each(|trace| trace(Said::Command(&line)));
        let stream = self.stream.get_mut();
        // If it is gone, the controller's own watch stops the plate.
        let _ = stream.set_write_timeout(Some(HEARD_EVERY)).and_then(|()| writeln!(stream, "{line}"));
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
        let within = match request {
            Request::Start { .. } | Request::Stop => Duration::from_secs_f64(ANSWER_S),
            Request::State if self.moves => Duration::from_secs_f64(ANSWER_S),
            Request::Load { .. } | Request::State => PATIENCE,
        };
        self.trace.iter().for_each(|trace| trace(Said::Command(line.trim_end())));
        self.stream.get_mut().write_all(line.as_bytes()).map_err(|e| unreachable(e.to_string()))?;
        match answer(&mut self.stream, within) {
            Ok(None) => Err(unreachable("it closed the connection".to_owned())),
            Ok(Some(reply)) => {
                let said = String::from_utf8_lossy(&reply);
                self.trace.iter().for_each(|trace| trace(Said::Reply(said.trim_end())));
                let answer: Answer = serde_json::from_slice(&reply)
                    .map_err(|e| unreachable(format!("its answer is not understood: {e}")))?;
                self.known = true;
                if answer.ok { Ok(answer) } else { Err(PlatformError::Refused(answer.error)) }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Err(unreachable(format!("no whole answer within {} s", within.as_secs_f64())))
            }
            Err(error) => Err(unreachable(error.to_string())),
        }
    }
}

/// Takes a line that is whole within this time, of at most [`LONGEST_ANSWER`] bytes; `None` at the end of the
/// stream.
fn answer(stream: &mut BufReader<TcpStream>, within: Duration) -> std::io::Result<Option<Vec<u8>>> {
    let (begun, mut line) = (Instant::now(), Vec::new());
    loop {
        let left = within.saturating_sub(begun.elapsed());
        // What has arrived already is taken, however late somebody checks.
        stream.get_ref().set_read_timeout(Some(left.max(Duration::from_millis(1))))?;
        let here = match stream.fill_buf() {
            Ok([]) => return Ok(None),
            Ok(here) => here,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        let end = here.iter().position(|byte| *byte == b'\n');
        let used = end.map_or(here.len(), |end| end + 1);
        line.extend_from_slice(&here[..used]);
        stream.consume(used);
        if line.len() > LONGEST_ANSWER {
            let why = format!("its answer is longer than {LONGEST_ANSWER} bytes");
            return Err(std::io::Error::new(ErrorKind::InvalidData, why));
        }
        if end.is_some() {
            return Ok(Some(line));
        }
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
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

    fn carries(&mut self, load: Option<Load>) {
        self.load = load;
    }

    fn trace(&mut self, to: Trace) {
        lock(&self.line).trace = Some(to);
    }

    fn stands(&mut self) -> Result<Option<Pose>, PlatformError> {
        Ok(self.ask(&Request::State)?.pose)
    }

    fn way(&mut self, program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        let here = self.stands()?;
        here.map(|here| way::between(&here, &program.start, &self.geometry, self.load.as_ref())).transpose()
    }

    fn approach(&mut self, go_on: &dyn Fn() -> bool) -> Result<(), PlatformError> {
        let Some(program) = self.program.clone() else { return Ok(()) };
        if let Some(way) = self.way(&program)? {
            way::drive(self, &way, go_on, &Clock::of_this_machine())?;
        }
        self.load(&program)
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        self.sampled_s = f64::NEG_INFINITY;
        let started_s = self.ask(&Request::Start { quiet_s: QUIET_S })?.duration_s;
        if started_s != self.loaded_s {
            self.stop(Stop::Alarm)?;
            return Err(PlatformError::Refused(
                "another program has loaded another motion meanwhile; it was stopped: let one program at a \
                 time have the platform"
                    .to_owned(),
            ));
        }
        self.started_s = Some(started_s);
        self.keeper = Some(Keeper::new(&self.line));
        Ok(())
    }

    fn stop(&mut self, _: Stop) -> Result<(), PlatformError> {
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

#[cfg(test)]
mod tests {
    use std::net::TcpListener;
    use std::sync::mpsc::{Receiver, channel};

    use super::*;

    /// Returns a controller that answers in order until somebody asks for the state of a moving plate, and
    /// then does as `then` says; gives the lines that it heard.
    fn controller(then: impl Fn(&mut TcpStream) + Send + 'static) -> (NetworkPlatform, Receiver<String>) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("tcp://{}", listener.local_addr().unwrap());
        let (heard, hears) = channel();
        thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let mut lines = BufReader::new(stream.try_clone().unwrap());
            let mut moves = false;
            let mut line = String::new();
            while lines.read_line(&mut line).unwrap_or(0) > 0 {
                let said = std::mem::take(&mut line);
                moves |= said.contains("start");
                let asked = said.contains("state");
                if heard.send(said).is_err() {
                    return;
                }
                if moves && asked {
                    let mut stream = stream.try_clone().unwrap();
                    then(&mut stream);
                } else {
                    let _ = writeln!(stream, r#"{{"ok":true,"state":"holding","duration_s":2.0}}"#);
                }
            }
        });
        (NetworkPlatform::connect(&address, &Geometry::default()).unwrap(), hears)
    }

    fn started(platform: &mut NetworkPlatform) {
        platform.loaded_s = 2.0;
        platform.start().unwrap();
    }

    /// Sends a byte now and then, for as long as somebody waits.
    fn drip(stream: &mut TcpStream) {
        let mut stream = stream.try_clone().unwrap();
        thread::spawn(move || {
            while stream.write_all(b" ").is_ok() {
                thread::sleep(Duration::from_millis(20));
            }
        });
    }

    fn flood(stream: &mut TcpStream) {
        let mut stream = stream.try_clone().unwrap();
        thread::spawn(move || while stream.write_all(&[b' '; 4096]).is_ok() {});
    }

    /// The behaviour of a controller in place of an answer, and words of the error.
    type Hostile = (fn(&mut TcpStream), &'static str);

    #[test]
    fn an_answer_without_end_does_not_hold_back_the_stop() {
        let hostile: [Hostile; 3] = [
            (drip, "no whole answer within 0.2 s"),
            (flood, "longer than 65536 bytes"),
            (|_| (), "no whole answer"),
        ];
        for (then, part) in hostile {
            let (mut platform, heard) = controller(then);
            started(&mut platform);
            let begun = Instant::now();
            let error = platform.motion().unwrap_err();
            assert!(
                matches!(&error, PlatformError::Lost { .. }) && error.to_string().contains(part),
                "{error}"
            );
            assert!(begun.elapsed() < Duration::from_secs(2), "{:?}", begun.elapsed());
            let mut stops = heard.iter().filter(|line| line.contains("stop"));
            assert!(stops.next().is_some());
            // Whoever stops then is heard, too, and informed what is wrong.
            assert!(platform.stop(Stop::Alarm).is_err());
            assert!(stops.next().is_some());
        }
    }

    #[test]
    fn a_late_answer_at_rest_is_waited_for() {
        let (mut platform, _heard) = controller(|stream| {
            thread::sleep(Duration::from_millis(50));
            let _ = stream.write_all(b"{\"ok\":true,\"state\":\"moving\",\"dura");
            thread::sleep(Duration::from_millis(50));
            let _ = stream.write_all(b"tion_s\":2.0,\"time_s\":0.1}\n");
        });
        started(&mut platform);
        assert_eq!(platform.motion().unwrap(), Motion::Moving);
    }
}
