//! Any other controller: lines of poses or leg lengths at a fixed rate, and nothing back.
//!
//! | address | a line |
//! |---|---|
//! | `pose+tcp://`, `pose+udp://`, `pose+serial://` | `t_s,x_m,y_m,z_m,qw,qx,qy,qz`: the plate in A |
//! | `legs+tcp://`, `legs+udp://`, `legs+serial://` | `t_s,l1_m,l2_m,l3_m,l4_m,l5_m,l6_m` |
//!
//! Time goes from the beginning of the stream in steps of `1/rate_hz`; a line is sent `lead_s` before its time. The stream begins
//! with the plate at home, goes to the program's start, and ends with the last pose repeated. A stop leads the plate to
//! rest on its path within half a second after the lines sent already. Where the plate really is, nobody says: nothing is measured.

use rigident_sim::platform::{Geometry, MotionProgram, Pose, Segment, Trajectory};

use super::address::{Address, Wire};
use super::pace::{Pace, Sink, Timing};
use super::{Motion, MotionSample, Platform, PlatformError, check, quaternion};

/// How long the way from home to the program's start takes at most at 0.1 m/s or 0.4 rad/s.
fn approach_s(from: &Pose, to: &Pose) -> f64 {
    let far = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).fold(0.0_f64, |m, (p, q)| m.max((p - q).abs()));
    (1.875 * (far(&from.position_m, &to.position_m) / 0.1).max(far(&from.rpy_rad, &to.rpy_rad) / 0.4))
        .max(0.5)
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
    /// Until its program is started.
    sink: Option<Writer>,
    pace: Option<Pace<Writer>>,
    approach_s: f64,
}

struct Writer {
    wire: Box<dyn Wire>,
    lines: Lines,
    geometry: Geometry,
    address: String,
}

impl StreamPlatform {
    pub(super) fn new(address: &Address, lines: Lines, wire: Box<dyn Wire>, geometry: Geometry) -> Self {
        let sink = Writer { wire, lines, geometry: geometry.clone(), address: address.text.clone() };
        Self {
            geometry,
            timing: address.timing,
            trajectory: None,
            sink: Some(sink),
            pace: None,
            approach_s: 0.0,
        }
    }
}

impl Platform for StreamPlatform {
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        let home = self.geometry.home();
        let mut whole = MotionProgram { start: home, segments: Vec::new() };
        self.approach_s = 0.0;
        if program.start != home {
            self.approach_s = approach_s(&home, &program.start);
            whole.segments.push(Segment::Move { to: program.start, duration_s: self.approach_s });
        }
        whole.segments.extend(program.segments.iter().cloned());
        check::check(&whole, &self.geometry)?;
        self.trajectory = Some(whole.trajectory()?);
        Ok(())
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        let trajectory = self
            .trajectory
            .take()
            .ok_or_else(|| PlatformError::Refused("no motion program is loaded".to_owned()))?;
        let sink = self
            .sink
            .take()
            .ok_or_else(|| PlatformError::Refused("its stream was sent; connect again".to_owned()))?;
        self.pace = Some(Pace::begin(sink, trajectory, self.timing, 20.0));
        Ok(())
    }

    fn stop(&mut self) -> Result<(), PlatformError> {
        if let Some(pace) = &self.pace {
            pace.stop();
        }
        Ok(())
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        self.pace.as_ref().map_or(Ok(Motion::Holding), Pace::motion)
    }

    fn samples(&mut self) -> Vec<MotionSample> {
        let mut samples = self.pace.as_ref().map_or_else(Vec::new, Pace::samples);
        for sample in &mut samples {
            sample.time_s -= self.approach_s;
        }
        samples
    }
}

impl Sink for Writer {
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError> {
        let numbers: Vec<f64> = match self.lines {
            Lines::Legs => self.geometry.leg_lengths(pose).to_vec(),
            Lines::Poses => pose.position_m.into_iter().chain(quaternion(pose)).collect(),
        };
        let mut line = format!("{time_s:.6}");
        for number in numbers {
            line.push_str(&format!(",{number:.9}"));
        }
        line.push('\n');
        self.wire.write_all(line.as_bytes()).and_then(|()| self.wire.flush()).map_err(|e| {
            PlatformError::Lost {
                address: self.address.clone(),
                command: line.trim().to_owned(),
                reason: e.to_string(),
            }
        })
    }

    fn look(&mut self) -> Result<Option<Pose>, PlatformError> {
        Ok(None)
    }

    fn halt(&mut self) -> Result<bool, PlatformError> {
        Ok(false)
    }

    fn at_rest(&mut self) -> Result<Option<bool>, PlatformError> {
        Ok(None)
    }
}
