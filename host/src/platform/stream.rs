//! Any other controller: lines of poses or leg lengths at a fixed rate, and nothing back.
//!
//! | address | a line |
//! |---|---|
//! | `pose+tcp://`, `pose+udp://`, `pose+serial://` | `t_s,x_m,y_m,z_m,qw,qx,qy,qz`: the plate in A |
//! | `legs+tcp://`, `legs+udp://`, `legs+serial://` | `t_s,l1_m,l2_m,l3_m,l4_m,l5_m,l6_m` |
//!
//! Time goes from the beginning of the stream in steps of `1/rate_hz`; a line is sent `lead_s` before its time, and one that would be sent
//! after its time ends the motion. The first stream
//! of a connection begins with the plate at home, every further one where the last one ended, its time at zero again.
//! Each goes to its program's start and ends with the last pose repeated. At the end of an experiment one more stream leads
//! the plate home, for the next connection. A stop, and whatever goes wrong while lines can be sent, leads the plate to
//! rest on its path within half a second after the lines sent already; there it stays. Where the plate really is, nobody
//! says: nothing is measured.

use hexapod::set_points::SetPoint;
use hexapod::{Geometry, Limit, MotionError, MotionProgram, Pose, Segment, Trajectory};

use super::address::{Address, Wire};
use super::pace::{Pace, Sink, Timing};
use super::{Motion, MotionSample, Platform, PlatformError, check};

/// How often nothing is looked at, 1/s: how often what is commanded is noted.
const LOOKS_HZ: f64 = 20.0;

/// Poses that are nearer than this are the same, m and rad.
const SAME: f64 = 1e-6;
/// The longest way to a program's start, s.
const LONGEST_S: f64 = 120.0;

fn far(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).fold(0.0, |m: f64, (p, q)| m.max((p - q).abs()))
}

fn same(a: &Pose, b: &Pose) -> bool {
    far(a.position_m, b.position_m).max(far(a.rpy_rad, b.rpy_rad)) < SAME
}

/// How long the way takes at most at 0.1 m/s or 0.4 rad/s.
fn gentle_s(from: &Pose, to: &Pose) -> f64 {
    (1.875 * (far(from.position_m, to.position_m) / 0.1).max(far(from.rpy_rad, to.rpy_rad) / 0.4)).max(0.5)
}

/// What the lines hold.
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
    trajectory: Option<Trajectory>,
    /// Where the lines have left the plate.
    at: Pose,
    state: State,
    approach_s: f64,
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
}

impl StreamPlatform {
    pub(super) fn new(address: &Address, lines: Lines, wire: Box<dyn Wire>, geometry: Geometry) -> Self {
        let writer = Writer { wire, lines, geometry: geometry.clone(), address: address.text.clone() };
        Self {
            at: geometry.home(),
            geometry,
            timing: address.timing,
            trajectory: None,
            state: State::Resting(Box::new(writer)),
            approach_s: 0.0,
        }
    }

    /// From where the plate is to a pose: gently, and as slowly as the legs need it.
    fn way(&self, to: &Pose) -> Result<MotionProgram, PlatformError> {
        if same(&self.at, to) {
            return Ok(MotionProgram { start: *to, segments: Vec::new() });
        }
        let mut duration_s = gentle_s(&self.at, to);
        loop {
            let segments = vec![Segment::Move { to: *to, duration_s }];
            let way = MotionProgram { start: self.at, segments };
            match check::check(&way, &self.geometry, None) {
                Ok(_) => return Ok(way),
                Err(PlatformError::Motion(MotionError::Limit { violation, .. }))
                    if matches!(violation.limit, Limit::LegRate | Limit::LegAcceleration)
                        && duration_s < LONGEST_S =>
                {
                    duration_s *= 2.0;
                }
                Err(other) => return Err(other),
            }
        }
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
        let way = self.way(&program.start)?;
        let approach_s = way.duration_s();
        let segments = way.segments.into_iter().chain(program.segments.iter().cloned()).collect();
        let whole = MotionProgram { start: way.start, segments };
        check::check(&whole, &self.geometry, None)?;
        (self.trajectory, self.approach_s) = (Some(whole.trajectory()?), approach_s);
        Ok(())
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        self.rest()?;
        let trajectory = self
            .trajectory
            .take()
            .ok_or_else(|| PlatformError::Refused("no motion program is loaded".to_owned()))?;
        match std::mem::replace(&mut self.state, State::Gone) {
            State::Resting(writer) => {
                self.state = State::Moving(Pace::begin(*writer, trajectory, self.timing, LOOKS_HZ));
                Ok(())
            }
            _ => Err(PlatformError::Refused("its connection is gone".to_owned())),
        }
    }

    fn stop(&mut self) -> Result<(), PlatformError> {
        if let State::Moving(pace) = &self.state {
            pace.stop();
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
        let mut samples = if let State::Moving(pace) = &self.state { pace.samples() } else { Vec::new() };
        for sample in &mut samples {
            sample.time_s -= self.approach_s;
        }
        samples
    }

    fn expects(&self) -> Option<Pose> {
        match &self.state {
            State::Moving(pace) => pace.last(),
            _ => Some(self.at),
        }
    }

    fn go_home(&mut self) -> Result<bool, PlatformError> {
        self.rest()?;
        let home = self.geometry.home();
        if same(&self.at, &home) {
            return Ok(false);
        }
        self.load(&MotionProgram { start: home, segments: Vec::new() })?;
        self.start().map(|()| true)
    }
}

impl Sink for Writer {
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError> {
        let point = match self.lines {
            Lines::Legs => SetPoint::Legs(self.geometry.leg_lengths(pose)),
            Lines::Poses => SetPoint::Pose(*pose),
        };
        let line = point.line(time_s);
        self.wire.write_all(line.as_bytes()).and_then(|()| self.wire.flush()).map_err(|e| {
            PlatformError::Lost {
                address: self.address.clone(),
                command: line.trim().to_owned(),
                reason: e.to_string(),
            }
        })
    }
}
