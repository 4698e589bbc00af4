//! The controller that obeys the commands.

use std::fmt::Write as _;

use super::frames::Frames;
use super::syntax::Said;
use super::tables::{HELP, MOST_POINTS, PARAMETERS};
use super::travel::{is_reached, limits};
use crate::rig::{MotionState, Rig, RigError, SharedRig};
use crate::runner::lock;
use hexapod::gcs::{
    AXES, FREE_POINTS, GcsPosition, IS_READY, MACRO, MOVING, PATH_BUFFERED, PATH_SOURCE, PATH_THRESHOLD,
    READY, STATUS, answer, error, read_pairs,
};
use hexapod::{MotionError, Pose, gcs};

#[derive(Debug, Default)]
enum Stream {
    #[default]
    Idle,
    Filling(Vec<Pose>),
    Running {
        next_ns: u64,
    },
    /// Ceased, refused or stopped, with this error: until the source is set anew.
    Broken(u16),
}

/// A hexapod's controller, for any number of clients.
pub struct Hexapod {
    rig: SharedRig,
    reference: Pose,
    limits: [[f64; 2]; 6],
    servo: bool,
    referenced: bool,
    referencing: bool,
    target: GcsPosition,
    velocity_mmps: f64,
    frames: Frames,
    error: u16,
    consecutive: bool,
    buffered: bool,
    threshold: usize,
    interval_ms: f64,
    stream: Stream,
    mover: Option<u64>,
    /// A macro runs; what it would do is not simulated.
    in_macro: bool,
}

/// The way a motion is stopped.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stop {
    /// `HLT`.
    Smooth,
    /// `STP` and `#24`, which end macros too.
    Abrupt,
}

type Obeyed = Result<String, u16>;

impl Hexapod {
    /// Makes the controller of a rig that has just been switched on: the servo is on, nothing is referenced.
    pub fn new(rig: SharedRig) -> Self {
        let geometry = lock(&rig).config().geometry.clone();
        Self {
            reference: geometry.home(),
            limits: limits(&geometry),
            rig,
            servo: true,
            referenced: false,
            referencing: false,
            target: GcsPosition::default(),
            velocity_mmps: 100.0,
            frames: Frames::default(),
            error: 0,
            consecutive: false,
            buffered: false,
            threshold: 1,
            interval_ms: 10.0,
            stream: Stream::Idle,
            mover: None,
            in_macro: false,
        }
    }

    /// Does what `client` has said; the bytes to answer, perhaps none.
    pub(super) fn obey(&mut self, said: &Said, client: u64) -> Vec<u8> {
        let shared = self.rig.clone();
        let rig = &mut *lock(&shared);
        self.look(rig);
        let line = match said {
            Said::Byte(byte) => return self.single(rig, *byte),
            Said::TooLong => {
                self.error = error::TOO_LONG;
                return Vec::new();
            }
            Said::Line(line) => line,
        };
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let Some((verb, arguments)) = words.split_first() else { return Vec::new() };
        let verb = verb.to_ascii_uppercase();
        if ["MOV", "MVR", "FRF"].contains(&verb.as_str()) {
            self.mover = Some(client);
        }
        match self.command(rig, &verb, arguments) {
            Ok(answer) => answer.into_bytes(),
            Err(code) => {
                self.error = code;
                Vec::new()
            }
        }
    }

    /// Receives that a client has gone; what it had started is stopped.
    pub(super) fn left(&mut self, client: u64) {
        let shared = self.rig.clone();
        let rig = &mut *lock(&shared);
        if self.mover == Some(client) && rig.motion() == MotionState::Moving {
            self.stop(rig, Stop::Smooth);
        }
    }

    /// Takes in what has happened since.
    fn look(&mut self, rig: &Rig) {
        if self.referencing && rig.motion() != MotionState::Moving {
            (self.referencing, self.referenced) = (false, true);
        }
        if matches!(self.stream, Stream::Running { .. }) && rig.is_starved() {
            (self.stream, self.error) = (Stream::Broken(error::UNDERRUN), error::UNDERRUN);
            self.target = self.position(rig);
        }
    }

    fn position(&self, rig: &Rig) -> GcsPosition {
        self.frames.position(&rig.pose(), &self.reference)
    }

    fn stop(&mut self, rig: &mut Rig, stop: Stop) {
        match stop {
            Stop::Smooth => rig.stop(),
            Stop::Abrupt => {
                self.in_macro = false;
                rig.stop_abruptly();
            }
        }
        (self.referencing, self.error) = (false, error::STOPPED);
        self.stream = if self.consecutive { Stream::Broken(error::STOPPED) } else { Stream::Idle };
        self.target = self.position(rig);
    }

    fn single(&mut self, rig: &mut Rig, byte: u8) -> Vec<u8> {
        let moving = rig.motion() == MotionState::Moving;
        match byte {
            STATUS => {
                let bit = |set: bool, n: u16| u16::from(set) << n;
                let status = bit(self.on_target(rig), 15)
                    | bit(moving, 13)
                    | bit(self.servo, 12)
                    | bit(self.error != 0, 8);
                format!("0x{status:04X}\n").into_bytes()
            }
            MOVING => format!("{:X}\n", if moving { 0x3f } else { 0 }).into_bytes(),
            IS_READY => vec![if self.referencing { READY - 1 } else { READY }, b'\n'],
            MACRO => format!("{}\n", u8::from(self.in_macro)).into_bytes(),
            FREE_POINTS => format!("{}\n", MOST_POINTS as usize - self.points()).into_bytes(),
            _ => {
                self.stop(rig, Stop::Abrupt);
                Vec::new()
            }
        }
    }

    fn points(&self) -> usize {
        if let Stream::Filling(points) = &self.stream { points.len() } else { 0 }
    }

    fn on_target(&self, rig: &Rig) -> bool {
        let here = self.position(rig).0;
        rig.motion() != MotionState::Moving
            && here.iter().zip(self.target.0).all(|(a, b)| (a - b).abs() < 1e-3)
    }

    fn command(&mut self, rig: &mut Rig, verb: &str, words: &[&str]) -> Obeyed {
        let none = Ok(String::new());
        match verb {
            "*IDN?" => Ok("Rigident, C-887 simulated, 0, 1.0.0.0\n".to_owned()),
            "CSV?" => Ok("2.0\n".to_owned()),
            "VER?" => Ok(concat!("FW: rigident-sim ", env!("CARGO_PKG_VERSION"), "\n").to_owned()),
            "ERR?" => Ok(format!("{}\n", std::mem::take(&mut self.error))),
            "HLP?" => Ok(answer(
                ["The following commands are valid:".to_owned()]
                    .into_iter()
                    .chain(HELP.iter().map(|(verb, what)| format!("{verb} {what}")))
                    .chain(["end of help".to_owned()]),
            )),
            "HPA?" => {
                Ok(answer(PARAMETERS.iter().map(|(p, what)| format!("0x{p:X}= 0 1 INT motion {what}"))))
            }
            "SAI?" => Ok(answer(AXES.iter().map(|axis| (*axis).to_owned()))),
            "PUN?" => each(words, |i| if i < 3 { "MM" } else { "DEG" }.to_owned()),
            "TRS?" => each(words, |_| "1".to_owned()),
            "SVO?" => each(words, |_| u8::from(self.servo).to_string()),
            "FRF?" => each(words, |_| u8::from(self.referenced).to_string()),
            "TMN?" => each(words, |i| format!("{:.6}", self.limits[i][0])),
            "TMX?" => each(words, |i| format!("{:.6}", self.limits[i][1])),
            "MOV?" => each(words, |i| format!("{:.6}", self.target.0[i])),
            "POS?" => each(words, |i| format!("{:.6}", self.position(rig).0[i])),
            "ONT?" => each(words, |_| u8::from(self.on_target(rig)).to_string()),
            "VLS?" => Ok(format!("{:.6}\n", self.velocity_mmps)),
            "SCT?" => Ok(format!("T={:.6}\n", self.interval_ms)),
            "SPI?" | "KEN?" => self.frames.asked(verb).ok_or(error::UNKNOWN_COMMAND),
            "SPI" | "KEN" | "KSD" => {
                self.idle(rig)?;
                self.frames.obey(verb, words)?;
                self.target = self.position(rig);
                none
            }
            "SPA?" => self.parameters(words),
            "VMO?" => {
                let there = self.aim(words, false)?;
                Ok(format!("{}\n", u8::from(self.reachable(rig, &there).is_ok())))
            }
            "SVO" => self.set_servo(rig, words).and(none),
            "FRF" => self.reference_move(rig, words).and(none),
            "MOV" => self.aim(words, false).and_then(|to| self.go(rig, to)).and(none),
            "MVR" if self.consecutive => Err(error::NOT_ALLOWED),
            "MVR" => self.aim(words, true).and_then(|to| self.go(rig, to)).and(none),
            "VLS" => self.set_velocity(words).and(none),
            "SCT" => self.set_interval(rig, words).and(none),
            "SPA" => self.set_parameters(rig, words).and(none),
            "STP" | "HLT" => {
                self.stop(rig, if verb == "HLT" { Stop::Smooth } else { Stop::Abrupt });
                none
            }
            "MAC" => self.run_macro(words).and(none),
            _ => Err(error::UNKNOWN_COMMAND),
        }
    }

    fn set_velocity(&mut self, words: &[&str]) -> Result<(), u16> {
        let [v] = words else { return Err(error::PARAMETER_COUNT) };
        let v: f64 = v.parse().map_err(|_| error::NUMBER)?;
        self.velocity_mmps = Some(v).filter(|v| (0.001..=500.0).contains(v)).ok_or(error::VELOCITY)?;
        Ok(())
    }

    /// Sets the interval, which counts in tenths of a millisecond.
    fn set_interval(&mut self, rig: &Rig, words: &[&str]) -> Result<(), u16> {
        let ["T", ms] = words else { return Err(error::SYNTAX) };
        let ms: f64 = ms.parse().map_err(|_| error::NUMBER)?;
        self.idle(rig)?;
        let ms = Some(ms).filter(|ms| (1.0..=1000.0).contains(ms)).ok_or(error::RANGE)?;
        self.interval_ms = (10.0 * ms).round() / 10.0;
        Ok(())
    }

    fn run_macro(&mut self, words: &[&str]) -> Result<(), u16> {
        self.in_macro = match words {
            ["START" | "NSTART", _, ..] => true,
            ["STOP", ..] => false,
            _ => return Err(error::SYNTAX),
        };
        Ok(())
    }

    fn idle(&self, rig: &Rig) -> Result<(), u16> {
        if rig.motion() == MotionState::Moving { Err(error::IN_MOTION) } else { Ok(()) }
    }

    fn set_servo(&mut self, rig: &mut Rig, words: &[&str]) -> Result<(), u16> {
        for (axis, on) in read_pairs(words)? {
            axis_number(axis)?;
            let on = if on == 1.0 {
                true
            } else if on == 0.0 {
                false
            } else {
                return Err(error::RANGE);
            };
            if !on && rig.motion() == MotionState::Moving {
                self.stop(rig, Stop::Abrupt);
            }
            self.servo = on;
        }
        Ok(())
    }

    fn reference_move(&mut self, rig: &mut Rig, words: &[&str]) -> Result<(), u16> {
        for axis in words {
            axis_number(axis)?;
        }
        if !self.servo {
            return Err(error::NOT_ALLOWED);
        }
        self.idle(rig)?;
        let duration_s = self.duration_s(&self.position(rig), &GcsPosition::default()).max(1.0);
        let home = self.reference;
        rig.move_to(&home, duration_s).map_err(code)?;
        (self.target, self.referencing, self.referenced) = (GcsPosition::default(), true, false);
        Ok(())
    }

    /// Returns the target with some axes changed.
    fn aim(&self, words: &[&str], relative: bool) -> Result<GcsPosition, u16> {
        let mut to = self.target;
        for (axis, value) in read_pairs(words)? {
            let at = to.0.get_mut(axis_number(axis)?).ok_or(error::AXIS)?;
            *at = if relative { *at + value } else { value };
        }
        Ok(to)
    }

    fn reachable(&self, rig: &Rig, to: &GcsPosition) -> Result<Pose, u16> {
        let inside = to.0.iter().zip(&self.limits).all(|(v, [lo, hi])| (lo..=hi).contains(&v));
        let pose = self.frames.pose(to, &self.reference);
        if inside && is_reached(&rig.config().geometry, &pose) { Ok(pose) } else { Err(error::POSITION) }
    }

    fn go(&mut self, rig: &mut Rig, to: GcsPosition) -> Result<(), u16> {
        if !self.servo || !self.referenced {
            return Err(error::NOT_ALLOWED);
        }
        let pose = self.reachable(rig, &to)?;
        if self.consecutive {
            self.stream_on(rig, pose)?;
        } else {
            let duration_s = self.duration_s(&self.position(rig), &to);
            rig.move_to(&pose, duration_s).map_err(code)?;
        }
        self.target = to;
        Ok(())
    }

    /// Returns a move's duration: its peak rate, 15/8 of the mean, stays below the velocity; a rotation
    /// counts as the way of a point 0.25 m from the axis.
    fn duration_s(&self, from: &GcsPosition, to: &GcsPosition) -> f64 {
        let way =
            |range: std::ops::Range<usize>| range.map(|i| (to.0[i] - from.0[i]).powi(2)).sum::<f64>().sqrt();
        let longest = way(0..3).max(way(3..6).to_radians() * 250.0);
        (1.875 * longest / self.velocity_mmps).max(0.1)
    }

    fn stream_on(&mut self, rig: &mut Rig, pose: Pose) -> Result<(), u16> {
        let interval_ns = (self.interval_ms * 1e6) as u64;
        let threshold = if self.buffered { self.threshold } else { 1 };
        let mut passed = Ok(());
        match &mut self.stream {
            Stream::Broken(error) => return Err(*error),
            Stream::Running { next_ns } => {
                passed = rig.pass_through(&pose, *next_ns);
                *next_ns += interval_ns;
            }
            idle => {
                let mut points = match std::mem::take(idle) {
                    Stream::Filling(points) => points,
                    _ => Vec::new(),
                };
                points.push(pose);
                if points.len() < threshold {
                    *idle = Stream::Filling(points);
                    return Ok(());
                }
                // What was left of another stream is forgotten.
                rig.stop();
                let mut next_ns = rig.now_ns() + 2 * interval_ns;
                for point in &points {
                    passed = passed.and_then(|()| rig.pass_through(point, next_ns));
                    next_ns += interval_ns;
                }
                *idle = Stream::Running { next_ns };
            }
        }
        passed.map_err(|e| {
            rig.stop();
            let code = code(e);
            self.stream = Stream::Broken(code);
            code
        })
    }

    fn parameter(&self, number: u32) -> usize {
        match number {
            PATH_SOURCE => usize::from(self.consecutive),
            PATH_BUFFERED => usize::from(self.buffered),
            PATH_THRESHOLD => self.threshold,
            _ => self.points(),
        }
    }

    fn parameters(&self, words: &[&str]) -> Obeyed {
        let asked: Vec<u32> = if words.is_empty() {
            PARAMETERS.iter().map(|(p, _)| *p).collect()
        } else {
            named(words, 2)?.into_iter().map(|(p, _)| p).collect()
        };
        Ok(answer(asked.into_iter().map(|p| format!("X 0x{p:X}={}", self.parameter(p)))))
    }

    fn set_parameters(&mut self, rig: &mut Rig, words: &[&str]) -> Result<(), u16> {
        for (number, value) in named(words, 3)? {
            let value: f64 = value.and_then(|v| v.parse().ok()).ok_or(error::NUMBER)?;
            let flag = || if value == 0.0 || value == 1.0 { Ok(value == 1.0) } else { Err(error::RANGE) };
            self.idle(rig)?;
            match number {
                PATH_SOURCE => {
                    self.consecutive = flag()?;
                    self.stream = Stream::Idle;
                    self.target = self.position(rig);
                }
                PATH_BUFFERED => self.buffered = flag()?,
                PATH_THRESHOLD if (1.0..=MOST_POINTS).contains(&value) => self.threshold = value as usize,
                PATH_THRESHOLD => return Err(error::RANGE),
                _ => return Err(error::READ_ONLY),
            }
        }
        Ok(())
    }
}

fn code(error: RigError) -> u16 {
    match error {
        RigError::Motion(MotionError::Limit { violation, .. }) if violation.limit.is_of_speed() => {
            error::VELOCITY
        }
        RigError::Motion(_) => error::POSITION,
        RigError::Late => error::UNDERRUN,
        _ => error::IN_MOTION,
    }
}

fn axis_number(name: &str) -> Result<usize, u16> {
    gcs::axis_number(name).ok_or(error::AXIS)
}

/// Reads `X 0x19001900 [value] …`: axis, parameter, and a value if there are three of each.
fn named<'a>(words: &[&'a str], of_each: usize) -> Result<Vec<(u32, Option<&'a str>)>, u16> {
    if words.is_empty() || !words.len().is_multiple_of(of_each) {
        return Err(error::PARAMETER_COUNT);
    }
    words
        .chunks_exact(of_each)
        .map(|part| {
            let (axis, number) = (part.first().ok_or(error::SYNTAX)?, part.get(1).ok_or(error::SYNTAX)?);
            axis_number(axis)?;
            let hex = number.strip_prefix("0x").or_else(|| number.strip_prefix("0X"));
            let number =
                hex.map_or_else(|| number.parse().ok(), |digits| u32::from_str_radix(digits, 16).ok());
            let known = number.filter(|n| PARAMETERS.iter().any(|(p, _)| p == n));
            Ok((known.ok_or(error::UNKNOWN_PARAMETER)?, part.get(2).copied()))
        })
        .collect()
}

/// Writes `X=value` for the named axes, or all.
fn each(words: &[&str], value: impl Fn(usize) -> String) -> Obeyed {
    let axes = if words.is_empty() {
        (0..AXES.len()).collect()
    } else {
        words.iter().map(|w| axis_number(w)).collect::<Result<Vec<_>, _>>()?
    };
    Ok(answer(axes.into_iter().map(|i| {
        let mut line = String::new();
        // Writing to a string does not fail.
        let _ = write!(line, "{}={}", AXES[i], value(i));
        line
    })))
}
