//! The experiment around a motion: the static step first, as in the thesis, and its first pose again at the
//! end.

use hexapod::experiment::THESIS_POSES_DEG;
use hexapod::{Geometry, Limits, Load, MotionError, MotionProgram, Pose, Segment, Violation};

use crate::ways::{self, Pace};

/// Moves from pose to pose.
const PACE: Pace = Pace { rate_radps: 1.1, shortest_s: 0.0 };
/// Shortest motion worth planning, s.
pub const SHORTEST_MOTION_S: f64 = 6.0;
/// The share of the legs' speeds, accelerations and forces that the static step uses at most.
const SPARE: f64 = 0.985;
/// Shares of the thesis' tilts that are tried.
const TILTS: [f64; 8] = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3];
/// Shares that are tried besides where the travel of the plate is all that is known: it may be a few degrees.
const SMALL_TILTS: [f64; 3] = [0.2, 0.1, 0.05];

/// The experiment with a place for a motion about home.
#[derive(Clone, Debug)]
pub struct Frame {
    home: Pose,
    before: Vec<Segment>,
    after: Vec<Segment>,
    /// Time for the motion, s.
    pub motion_s: f64,
    /// The time when it begins, s.
    pub begin_s: f64,
}

/// The reason why there is no experiment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// The experiment is too short.
    #[error(
        "{asked_s} s are too short: the static step takes {static_s:.1} s on this platform, and a motion \
         should have {SHORTEST_MOTION_S} s; give `duration_s` {least:.0} or more, or plan a motion without \
         it (`plan_motion(no_poses)`)",
        least = (static_s + SHORTEST_MOTION_S).ceil()
    )]
    TooShort {
        /// Asked for, s.
        asked_s: f64,
        /// The static step, s.
        static_s: f64,
    },
    /// Not even small tilts are possible.
    #[error("the platform can do no static step, plan a motion without it (`plan_motion(no_poses)`): {0}")]
    Poses(MotionError),
    /// Not even home is possible.
    #[error(
        "the platform cannot stand level at home: {0}; that is no matter of time or tilts, look at \
         [platform] and the body"
    )]
    Home(Violation),
}

/// Checks whether the plate can be at home.
///
/// # Errors
/// The violation at home.
pub fn stands(geometry: &Geometry, load: &Load) -> Result<(), FrameError> {
    geometry.check_pose_loaded(&geometry.home(), load).map_err(FrameError::Home)
}

impl Frame {
    /// Makes the frame with the static step of the thesis: home, the five orientations of Table 11 (less
    /// tilted where the legs do not reach that far, are too weak for `load` or too slow for the time there
    /// is), home; the motion; the first pose again.
    ///
    /// # Errors
    /// A duration that is too short, or a platform that can hardly tilt.
    pub fn with_poses(geometry: &Geometry, load: &Load, duration_s: f64) -> Result<Self, FrameError> {
        let mut error = None;
        let mut shortest: Option<f64> = None;
        let small = SMALL_TILTS.into_iter().filter(|_| !geometry.has_joints());
        for tilt in TILTS.into_iter().chain(small) {
            match Self::tilted(geometry, load, duration_s, tilt) {
                Ok(frame) if frame.motion_s >= SHORTEST_MOTION_S => return Ok(frame),
                Ok(frame) => {
                    let static_s = duration_s - frame.motion_s;
                    shortest = Some(shortest.map_or(static_s, |s| s.min(static_s)));
                }
                Err(e) => error = Some(e),
            }
        }
        Err(match (shortest, error) {
            (None, Some(error)) => FrameError::Poses(error),
            (static_s, _) => {
                FrameError::TooShort { asked_s: duration_s, static_s: static_s.unwrap_or(duration_s) }
            }
        })
    }

    /// Makes the frame of the motion alone, a second of rest on either side.
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

    fn tilted(geometry: &Geometry, load: &Load, duration_s: f64, tilt: f64) -> Result<Self, MotionError> {
        let home = geometry.home();
        let poses = THESIS_POSES_DEG.map(|[roll, pitch]| Pose {
            rpy_rad: [tilt * roll.to_radians(), tilt * pitch.to_radians(), 0.0],
            ..home
        });
        let hold_s = (0.03 * duration_s).clamp(0.6, 3.0);
        // The whole experiment is guaranteed to a per cent: what just passes by itself would not pass then.
        let mut slower = geometry.within(SPARE);
        slower.leg_length_m = geometry.leg_length_m;
        slower.limits = Limits {
            leg_acceleration_mps2: slower.limits.leg_acceleration_mps2,
            leg_jerk_mps3: slower.limits.leg_jerk_mps3,
            leg_force_n: slower.limits.leg_force_n,
            leg_push_n: slower.limits.leg_push_n,
            leg_pull_n: slower.limits.leg_pull_n,
            leg_buckling_nm2: slower.limits.leg_buckling_nm2,
            ..geometry.limits.clone()
        };
        slower.travel = geometry.travel.as_ref().map(|travel| travel.slower(SPARE));
        let way = |from: &Pose, to: &Pose| ways::straight(&slower, Some(load), from, to, PACE);
        let mut before = vec![Segment::Hold { duration_s: 0.5 * hold_s }];
        let mut at = home;
        for to in poses.iter().chain([&home]) {
            before.push(way(&at, to)?);
            before.push(Segment::Hold { duration_s: if *to == home { 0.25 * hold_s } else { hold_s } });
            at = *to;
        }
        let [first, ..] = poses;
        let after = vec![way(&home, &first)?, Segment::Hold { duration_s: hold_s }];
        let begin_s = before.iter().map(Segment::duration_s).sum();
        let motion_s = duration_s - begin_s - after.iter().map(Segment::duration_s).sum::<f64>();
        Ok(Self { home, before, after, motion_s, begin_s })
    }

    /// Returns where the motion begins and ends.
    pub fn home(&self) -> Pose {
        self.home
    }

    /// Returns the whole experiment.
    pub fn around(&self, motion: Segment) -> MotionProgram {
        let segments =
            self.before.iter().cloned().chain([motion]).chain(self.after.iter().cloned()).collect();
        MotionProgram { start: self.home, segments }
    }

    /// Returns all but the motion.
    pub fn without_motion(&self) -> MotionProgram {
        let segments = self.before.iter().chain(&self.after).cloned().collect();
        MotionProgram { start: self.home, segments }
    }
}
