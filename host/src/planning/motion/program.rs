//! The experiment around a motion: the static step first, as in the thesis, and its first pose again at the end.

use rigident_sim::experiment::THESIS_POSES_DEG;
use rigident_sim::platform::{Geometry, MotionError, MotionProgram, Pose, Segment};

/// Peak rate on the way from pose to pose, rad/s.
const RATE_RADPS: f64 = 1.1;
/// Shortest motion worth planning, s.
pub const SHORTEST_MOTION_S: f64 = 6.0;
/// Shares of the thesis' tilts that are tried, and by how much moves take longer each time.
const TILTS: [f64; 8] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3];
const PACES: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 5.0, 8.0];

/// The experiment with a place for a motion about home.
#[derive(Clone, Debug)]
pub struct Frame {
    home: Pose,
    before: Vec<Segment>,
    after: Vec<Segment>,
    /// Time for the motion, s.
    pub motion_s: f64,
    /// When it begins, s.
    pub begin_s: f64,
}

/// Why there is no experiment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// Too short.
    #[error(
        "{asked_s} s are too short: the static step takes {static_s:.1} s on this platform, and a motion should have \
         {SHORTEST_MOTION_S} s; give --duration-s {least:.0} or more, or leave the static step out by --no-poses",
        least = (static_s + SHORTEST_MOTION_S).ceil()
    )]
    TooShort {
        /// Asked for, s.
        asked_s: f64,
        /// The static step, s.
        static_s: f64,
    },
    /// Not even small tilts.
    #[error("the platform can do no static step: {0}")]
    Poses(MotionError),
}

impl Frame {
    /// The static step of the thesis: home, the five orientations of Table 11 (less tilted where the legs do not reach that
    /// far, more slowly where they are slow), home; the motion; the first pose again.
    ///
    /// # Errors
    /// A duration that is too short, or a platform that can hardly tilt.
    pub fn with_poses(geometry: &Geometry, duration_s: f64) -> Result<Self, FrameError> {
        let mut error = None;
        let mut shortest: Option<f64> = None;
        for tilt in TILTS {
            for pace in PACES {
                let frame = Self::tilted(geometry, duration_s, tilt, pace);
                let whole = MotionProgram {
                    start: frame.home,
                    segments: frame.before.iter().chain(&frame.after).cloned().collect(),
                };
                let checked = whole.trajectory().and_then(|t| geometry.check(&t));
                match checked {
                    Ok(()) if frame.motion_s >= SHORTEST_MOTION_S => return Ok(frame),
                    Ok(()) => {
                        let static_s = duration_s - frame.motion_s;
                        shortest = Some(shortest.map_or(static_s, |s| s.min(static_s)));
                        break;
                    }
                    Err(e) => error = Some(e),
                }
            }
        }
        Err(match (shortest, error) {
            (None, Some(error)) => FrameError::Poses(error),
            (static_s, _) => {
                FrameError::TooShort { asked_s: duration_s, static_s: static_s.unwrap_or(duration_s) }
            }
        })
    }

    /// The motion alone, a second of rest on either side.
    ///
    /// # Errors
    /// A duration that is too short.
    pub fn bare(geometry: &Geometry, duration_s: f64) -> Result<Self, FrameError> {
        let rest = vec![Segment::Hold { duration_s: 1.0 }];
        let motion_s = duration_s - 2.0;
        if motion_s < SHORTEST_MOTION_S {
            return Err(FrameError::TooShort { asked_s: duration_s, static_s: 2.0 });
        }
        Ok(Self { home: geometry.home(), before: rest.clone(), after: rest, motion_s, begin_s: 1.0 })
    }

    fn tilted(geometry: &Geometry, duration_s: f64, tilt: f64, pace: f64) -> Self {
        let home = geometry.home();
        let poses = THESIS_POSES_DEG.map(|[roll, pitch]| Pose {
            rpy_rad: [tilt * roll.to_radians(), tilt * pitch.to_radians(), 0.0],
            ..home
        });
        let hold_s = (0.03 * duration_s).clamp(0.6, 3.0);
        let way = |from: &Pose, to: &Pose| {
            let square: f64 = from.rpy_rad.iter().zip(to.rpy_rad).map(|(a, b)| (a - b).powi(2)).sum();
            Segment::Move { to: *to, duration_s: 1.875 * pace * square.sqrt() / RATE_RADPS }
        };
        let mut before = vec![Segment::Hold { duration_s: 0.5 * hold_s }];
        let mut at = home;
        for to in poses.iter().chain([&home]) {
            before.push(way(&at, to));
            before.push(Segment::Hold { duration_s: if *to == home { 0.25 * hold_s } else { hold_s } });
            at = *to;
        }
        let [first, ..] = poses;
        let after = vec![way(&home, &first), Segment::Hold { duration_s: hold_s }];
        let begin_s = before.iter().map(Segment::duration_s).sum();
        let motion_s = duration_s - begin_s - after.iter().map(Segment::duration_s).sum::<f64>();
        Self { home, before, after, motion_s, begin_s }
    }

    /// Where the motion begins and ends.
    pub fn home(&self) -> Pose {
        self.home
    }

    /// The whole experiment.
    pub fn around(&self, motion: Segment) -> MotionProgram {
        let segments =
            self.before.iter().cloned().chain([motion]).chain(self.after.iter().cloned()).collect();
        MotionProgram { start: self.home, segments }
    }

    /// All but the motion.
    pub fn without_motion(&self) -> MotionProgram {
        let segments = self.before.iter().chain(&self.after).cloned().collect();
        MotionProgram { start: self.home, segments }
    }
}
