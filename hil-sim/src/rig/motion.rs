//! The platform's controller: a program is loaded, started, stopped.

use super::config::RigError;
use super::follow::Follower;
use hexapod::{Coordinates, Geometry, MotionProgram, Pose, Segment, Trajectory, quintic_integral};

/// Time to come to rest after a stop, s. The plate covers half of it in the program's time.
const STOP_S: f64 = 0.5;

/// The motion of the plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionState {
    /// The plate is at rest, and no program has run since the last one was loaded.
    Holding,
    /// The plate runs its program, or comes to rest after a stop.
    Moving,
    /// The plate's program is over.
    Done,
}

#[derive(Clone, Debug)]
enum Phase {
    Holding {
        loaded: bool,
    },
    Moving {
        start_ns: f64,
        stop_s: Option<f64>,
    },
    Done {
        start_ns: f64,
        stop_s: Option<f64>,
        end_ns: f64,
    },
    /// The plate follows set points; `at_rest` once it has come to the last.
    Following {
        follower: Box<Follower>,
        at_rest: bool,
    },
}

/// The platform and its program.
#[derive(Clone, Debug)]
pub(super) struct Platform {
    trajectory: Trajectory,
    phase: Phase,
    /// Motions that have begun.
    begun: u64,
}

impl Platform {
    pub(super) fn resting(pose: &Pose) -> Self {
        Self { trajectory: Trajectory::resting(pose), phase: Phase::Holding { loaded: false }, begun: 0 }
    }

    /// Returns how many motions have begun: programs, moves, and streams from rest.
    pub(super) fn begun(&self) -> u64 {
        self.begun
    }

    pub(super) fn state(&self) -> MotionState {
        match self.phase {
            Phase::Holding { .. } => MotionState::Holding,
            Phase::Moving { .. } => MotionState::Moving,
            Phase::Following { at_rest: false, .. } => MotionState::Moving,
            Phase::Following { .. } | Phase::Done { .. } => MotionState::Done,
        }
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.trajectory.duration_s()
    }

    /// Returns where it rests; only asked while it rests.
    fn rest(&self) -> Pose {
        match &self.phase {
            Phase::Done { end_ns, .. } => self.coordinates(*end_ns).plate_state().pose(),
            Phase::Following { follower, .. } => {
                follower.coordinates(follower.rest_ns()).plate_state().pose()
            }
            _ => self.trajectory.start_pose(),
        }
    }

    pub(super) fn load(&mut self, program: &MotionProgram, geometry: &Geometry) -> Result<(), RigError> {
        if self.state() == MotionState::Moving {
            return Err(RigError::Busy);
        }
        let here = self.rest();
        let mut whole =
            MotionProgram { start: here, segments: Vec::with_capacity(program.segments.len() + 1) };
        if here != program.start {
            let duration_s = approach_s(&here, &program.start);
            whole.segments.push(Segment::Move { to: program.start, duration_s });
        }
        whole.segments.extend(program.segments.iter().cloned());
        let trajectory = whole.trajectory()?;
        geometry.check(&trajectory)?;
        (self.trajectory, self.phase) = (trajectory, Phase::Holding { loaded: true });
        Ok(())
    }

    pub(super) fn start(&mut self, now_ns: f64) -> Result<(), RigError> {
        match self.phase {
            Phase::Moving { .. } => Err(RigError::Busy),
            Phase::Holding { loaded: true } => {
                self.phase = Phase::Moving { start_ns: now_ns, stop_s: None };
                self.begun += 1;
                Ok(())
            }
            _ => Err(RigError::NoProgram),
        }
    }

    pub(super) fn stop(&mut self, now_ns: f64) {
        match &mut self.phase {
            Phase::Moving { start_ns, stop_s } => {
                stop_s.get_or_insert((now_ns - *start_ns) * 1e-9);
            }
            Phase::Following { follower, .. } => follower.stop(now_ns),
            _ => {}
        }
    }

    /// Stops a motion by set points abruptly; a program stops on its path as ever.
    pub(super) fn stop_abruptly(&mut self, now_ns: f64) {
        match &mut self.phase {
            Phase::Following { follower, .. } => follower.stop_abruptly(now_ns),
            _ => self.stop(now_ns),
        }
    }

    /// Goes to a pose in the given time, s; a move by set points that is under way gives way to it.
    pub(super) fn go(
        &mut self,
        now_ns: f64,
        to: &Pose,
        duration_s: f64,
        geometry: &Geometry,
    ) -> Result<(), RigError> {
        self.follow(now_ns, |follower| follower.go(now_ns, to, duration_s, geometry))
    }

    /// Returns whether the points of a stream ceased.
    pub(super) fn starved(&self, now_ns: f64) -> bool {
        matches!(&self.phase, Phase::Following { follower, .. } if follower.starved(now_ns))
    }

    /// Orders the plate to pass a pose at a time.
    pub(super) fn pass(
        &mut self,
        now_ns: f64,
        at_ns: f64,
        pose: &Pose,
        geometry: &Geometry,
    ) -> Result<(), RigError> {
        self.follow(now_ns, |follower| follower.pass(now_ns, at_ns, pose, geometry))
    }

    fn follow(
        &mut self,
        now_ns: f64,
        act: impl FnOnce(&mut Follower) -> Result<(), RigError>,
    ) -> Result<(), RigError> {
        if let Phase::Following { follower, at_rest } = &mut self.phase {
            act(follower)?;
            self.begun += u64::from(*at_rest);
            *at_rest = false;
            return Ok(());
        }
        if self.state() == MotionState::Moving {
            return Err(RigError::Busy);
        }
        let mut follower = Box::new(Follower::resting(&self.rest(), now_ns));
        act(&mut follower)?;
        self.phase = Phase::Following { follower, at_rest: false };
        self.begun += 1;
        Ok(())
    }

    /// Returns when the running program is over, to the nanosecond; `None` if none runs.
    pub(super) fn end_ns(&self) -> Option<u64> {
        match &self.phase {
            &Phase::Moving { start_ns, stop_s } => {
                let last_s =
                    stop_s.map_or(self.duration_s(), |s| (s + STOP_S).min(self.duration_s() + STOP_S));
                Some((start_ns + 1e9 * last_s).round() as u64)
            }
            Phase::Following { follower, at_rest: false } => Some(follower.rest_ns().round() as u64),
            _ => None,
        }
    }

    /// Notices that the program is over.
    pub(super) fn settle(&mut self, now_ns: f64) {
        if let Phase::Following { follower, at_rest } = &mut self.phase {
            *at_rest |= now_ns >= follower.rest_ns();
        }
        if let (Phase::Moving { start_ns, stop_s }, Some(end)) = (&self.phase, self.end_ns())
            && now_ns >= end as f64
        {
            self.phase = Phase::Done { start_ns: *start_ns, stop_s: *stop_s, end_ns: end as f64 };
        }
    }

    pub(super) fn elapsed_s(&self, now_ns: f64) -> f64 {
        match self.phase {
            Phase::Holding { .. } | Phase::Following { .. } => 0.0,
            Phase::Moving { start_ns, .. } => (now_ns - start_ns) * 1e-9,
            Phase::Done { start_ns, end_ns, .. } => (end_ns - start_ns) * 1e-9,
        }
    }

    /// Returns the coordinates at a time of the rig's clock. After a stop at program time `t₀` the program's
    /// own time slows down, `τ' = 1 − q(u)` with the quintic q and `u = (t − t₀)/T`, so the plate stays on
    /// its path: `q̇ = q' τ'`, `q̈ = q'' τ'² + q' τ''`.
    pub(super) fn coordinates(&self, time_ns: f64) -> Coordinates {
        let (t, stop_s) = match self.phase {
            Phase::Following { ref follower, .. } => return follower.coordinates(time_ns),
            Phase::Holding { .. } => return self.trajectory.coordinates(0.0),
            Phase::Done { stop_s, end_ns, .. } if time_ns >= end_ns => (f64::INFINITY, stop_s),
            Phase::Moving { start_ns, stop_s } | Phase::Done { start_ns, stop_s, .. } => {
                ((time_ns - start_ns) * 1e-9, stop_s)
            }
        };
        match stop_s {
            Some(t0) if t > t0 => {
                let u = ((t - t0) / STOP_S).min(1.0);
                let (integral, [value, slope, _]) = quintic_integral(u);
                let mut c = self.trajectory.coordinates(t0 + STOP_S * (u - integral));
                let (d1, d2) = (1.0 - value, -slope / STOP_S);
                for (rate, acceleration) in c.rate.iter_mut().zip(&mut c.acceleration) {
                    *acceleration = *acceleration * d1 * d1 + *rate * d2;
                    *rate *= d1;
                }
                c
            }
            _ => self.trajectory.coordinates(t),
        }
    }
}

/// Returns the time of a gentle move: the quintic's peak rate, 15/8 of the mean, stays below 0.15 m/s and 0.6
/// rad/s on each coordinate.
fn approach_s(from: &Pose, to: &Pose) -> f64 {
    let longest =
        |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).fold(0.0_f64, |m, (p, q)| m.max((p - q).abs()));
    let metres = longest(&from.position_m, &to.position_m);
    let radians = longest(&from.rpy_rad, &to.rpy_rad);
    (1.875 * metres / 0.15).max(1.875 * radians / 0.6).max(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexapod::{Axis, SineTerm};

    fn swing() -> MotionProgram {
        let geometry = Geometry::thesis();
        MotionProgram {
            start: geometry.home(),
            segments: vec![Segment::Multisine {
                duration_s: 8.0,
                ramp_s: 1.0,
                terms: vec![SineTerm { axis: Axis::Roll, amplitude: 0.2, frequency_hz: 0.6, phase_rad: 0.3 }],
            }],
        }
    }

    fn moving() -> Platform {
        let geometry = Geometry::thesis();
        let mut p = Platform::resting(&geometry.home());
        p.load(&swing(), &geometry).unwrap();
        p.start(1e9).unwrap();
        p
    }

    #[test]
    fn a_stop_brings_the_plate_to_rest_with_continuous_rate_and_acceleration() {
        let mut p = moving();
        p.stop(3.3e9);
        assert_eq!(p.end_ns(), Some(3_800_000_000));
        let h = 1e-5;
        for k in 0..1600 {
            let t = 3.0 + k as f64 * 1e-3;
            let at = |s: f64| p.coordinates(s * 1e9);
            let slope = (at(t + h).value[3] - at(t - h).value[3]) / (2.0 * h);
            assert!((slope - at(t).rate[3]).abs() < 1e-6, "rate at {t}");
            let slope = (at(t + h).rate[3] - at(t - h).rate[3]) / (2.0 * h);
            assert!((slope - at(t).acceleration[3]).abs() < 1e-4, "acceleration at {t}");
        }
        p.settle(3.8e9);
        assert_eq!(p.state(), MotionState::Done);
        assert_eq!(p.coordinates(3.8e9).rate, [0.0; 6]);
        assert_eq!(p.coordinates(9e9), p.coordinates(3.8e9));
    }

    #[test]
    fn the_next_program_starts_where_the_plate_was_stopped() {
        let mut p = moving();
        p.stop(3.3e9);
        p.settle(3.8e9);
        let rest = p.coordinates(3.8e9).value;
        p.load(&swing(), &Geometry::thesis()).unwrap();
        p.start(5e9).unwrap();
        assert_eq!(p.coordinates(5e9).value, rest);
        assert!(p.duration_s() > 8.0);
        // And ends where the program says.
        assert_eq!(p.coordinates(99e9).plate_state().pose(), Geometry::thesis().home());
    }

    #[test]
    fn only_a_resting_platform_takes_a_program_and_only_a_loaded_one_starts() {
        let geometry = Geometry::thesis();
        let mut p = Platform::resting(&geometry.home());
        assert_eq!(p.start(0.0), Err(RigError::NoProgram));
        p.load(&swing(), &geometry).unwrap();
        p.start(0.0).unwrap();
        assert_eq!(p.load(&swing(), &geometry), Err(RigError::Busy));
        assert_eq!(p.start(0.0), Err(RigError::Busy));
        p.settle(8e9);
        assert_eq!(p.start(9e9), Err(RigError::NoProgram));
    }
}
