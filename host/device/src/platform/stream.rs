//! Any other controller: lines of poses or leg lengths at a fixed rate, and nothing back.
//!
//! | address | a line |
//! |---|---|
//! | `pose+tcp://`, `pose+udp://`, `pose+serial://` | `t_s,x_m,y_m,z_m,qw,qx,qy,qz`: the plate in A |
//! | `legs+tcp://`, `legs+udp://`, `legs+serial://` | `t_s,l1_m,l2_m,l3_m,l4_m,l5_m,l6_m` |
//!
//! Time goes from the beginning of the stream in steps of `1/rate_hz`; a line is sent `lead_s` before its
//! time, and one that would be sent after its time ends the motion. With `follows=arrival` a line is sent at
//! its time, and where this machine stood still, all times to come are later by that. No line is sent sooner
//! than 0.95 steps after the one before but the first of a stream, `lead_s` of them. The first stream
//! of a connection begins with the plate at home, every further one where the last one ended, its time at
//! zero again. Each ends with the last pose repeated. The way to a program's start is a stream of its own,
//! and at the end of an experiment one more leads the plate home, for the next connection. A stop, and
//! whatever goes wrong while lines can be sent, leads the plate to rest on its path within half a second
//! after the lines sent already; there it stays. Where the plate really is, nobody says: nothing is measured.

use hexapod::set_points::SetPoint;
use hexapod::{Geometry, Load, MotionProgram, Pose};

use super::address::{Address, Wire};
use super::clock::Clock;
use super::pace::{Pace, Sink, Timing};
use super::way::{self, same};
use super::{Motion, MotionSample, Platform, PlatformError, Said, Stop, Trace, check};

/// The rate of notes of the commanded pose where nothing is checked, 1/s.
const LOOKS_HZ: f64 = 20.0;

/// The content of the lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lines {
    /// Poses of the plate.
    Poses,
    /// Lengths of the legs.
    Legs,
}

/// A controller that takes lines.
pub struct StreamPlatform {
    geometry: Geometry,
    timing: Timing,
    program: Option<MotionProgram>,
    load: Option<Load>,
    /// The pose in which the lines have left the plate.
    at: Pose,
    clock: Clock,
    state: State,
}

enum State {
    Resting(Box<Writer>),
    Moving(Pace<Writer>),
    Gone,
}

struct Writer {
    wire: Box<dyn Wire>,
    lines: Lines,
    geometry: Geometry,
    address: String,
    trace: Option<Trace>,
}

impl StreamPlatform {
    pub(super) fn new(
        address: &Address,
        lines: Lines,
        wire: Box<dyn Wire>,
        geometry: Geometry,
        clock: Clock,
    ) -> Self {
        let writer =
            Writer { wire, lines, geometry: geometry.clone(), address: address.text.clone(), trace: None };
        Self {
            at: geometry.home(),
            geometry,
            timing: address.timing,
            program: None,
            load: None,
            clock,
            state: State::Resting(Box::new(writer)),
        }
    }

    fn home_from(&self, at: &Pose) -> Result<MotionProgram, PlatformError> {
        way::between(at, &self.geometry.home(), &self.geometry, self.load.as_ref())
    }

    /// Takes the writer back from a stream that has ended.
    ///
    /// # Errors
    /// It has not ended, or its end is not known.
    fn rest(&mut self) -> Result<(), PlatformError> {
        if let State::Moving(pace) = &self.state {
            if pace.motion()? == Motion::Moving {
                return Err(PlatformError::Refused("it is moving: stop it or wait".to_owned()));
            }
            self.at = pace.last().unwrap_or(self.at);
            if let State::Moving(pace) = std::mem::replace(&mut self.state, State::Gone) {
                self.state = pace.end().map_or(State::Gone, |writer| State::Resting(Box::new(writer)));
            }
        }
        Ok(())
    }
}

impl Platform for StreamPlatform {
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        self.rest()?;
        check::check(program, &self.geometry, None)?;
        self.program = Some(program.clone());
        Ok(())
    }

    fn way(&mut self, program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        self.rest()?;
        way::between(&self.at, &program.start, &self.geometry, self.load.as_ref()).map(Some)
    }

    fn approach(&mut self, go_on: &dyn Fn() -> bool) -> Result<(), PlatformError> {
        let Some(program) = self.program.clone() else {
            return Err(PlatformError::Refused("no motion program is loaded".to_owned()));
        };
        if let Some(way) = self.way(&program)? {
            let clock = self.clock.clone();
            way::drive(self, &way, go_on, &clock)?;
        }
        self.load(&program)
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        self.rest()?;
        let program = self
            .program
            .take()
            .ok_or_else(|| PlatformError::Refused("no motion program is loaded".to_owned()))?;
        if !same(&self.at, &program.start) {
            return Err(PlatformError::Refused(format!(
                "its plate is at {}, and the program begins at {}",
                check::words(&self.at),
                check::words(&program.start)
            )));
        }
        let trajectory = program.trajectory()?;
        match std::mem::replace(&mut self.state, State::Gone) {
            State::Resting(writer) => {
                self.state =
                    State::Moving(Pace::begin(*writer, trajectory, self.timing, LOOKS_HZ, &self.clock));
                Ok(())
            }
            _ => Err(PlatformError::Refused("its connection is gone".to_owned())),
        }
    }

    fn stop(&mut self, stop: Stop) -> Result<(), PlatformError> {
        if let State::Moving(pace) = &self.state {
            pace.stop(stop);
        }
        Ok(())
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        match &self.state {
            State::Moving(pace) => pace.motion(),
            State::Resting(_) => Ok(Motion::Holding),
            State::Gone => Err(PlatformError::Refused("its connection is gone".to_owned())),
        }
    }

    fn samples(&mut self) -> Vec<MotionSample> {
        if let State::Moving(pace) = &self.state { pace.samples() } else { Vec::new() }
    }

    fn expects(&self) -> Option<Pose> {
        match &self.state {
            State::Moving(pace) => pace.last(),
            _ => Some(self.at),
        }
    }

    fn carries(&mut self, load: Option<Load>) {
        self.load = load;
    }

    fn trace(&mut self, to: Trace) {
        if let State::Resting(writer) = &mut self.state {
            writer.trace = Some(to);
        }
    }

    fn way_home(&self, program: &MotionProgram) -> Result<Option<MotionProgram>, PlatformError> {
        self.home_from(&program.trajectory()?.end_pose()).map(Some)
    }

    fn go_home(&mut self) -> Result<Option<MotionProgram>, PlatformError> {
        self.rest()?;
        let way = self.home_from(&self.at)?;
        if way.segments.is_empty() {
            return Ok(None);
        }
        self.load(&way)?;
        self.start().map(|()| Some(way))
    }
}

impl Sink for Writer {
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError> {
        let point = match self.lines {
            Lines::Legs => SetPoint::Legs(self.geometry.leg_lengths(pose)),
            Lines::Poses => SetPoint::Pose(*pose),
        };
        let line = point.line(time_s);
        self.trace.iter().for_each(|trace| trace(Said::Command(line.trim_end())));
        self.wire.write_all(line.as_bytes()).and_then(|()| self.wire.flush()).map_err(|e| {
            PlatformError::Lost {
                address: self.address.clone(),
                command: line.trim().to_owned(),
                reason: e.to_string(),
            }
        })
    }
}
