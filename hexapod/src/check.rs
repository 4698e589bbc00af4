//! Checks of a pose or a whole motion by every limit.
//!
//! A motion is not checked in steps: what happens between two checks is bounded ([`Geometry::guarantee`] has
//! the bounds), and an interval whose bounds do not show that the limits are met is cut in two.

use super::error::MotionError;
use super::geometry::Geometry;
use super::kinematics::PlateState;
use super::limits::{JointCones, Limit, Violation};
use super::load::Load;
use super::pose::Pose;
use super::trajectory::Trajectory;

/// Intervals that are no longer than this are not cut any more, s.
const SHORTEST_S: f64 = 1e-6;
/// The share of itself by which a bound may lie above a limit that is touched: rounding.
const TOUCH: f64 = 1e-9;
/// Intervals that are examined, about ten seconds of work.
const MOST_LOOKS: u32 = 1_000_000;

impl Geometry {
    /// Checks whether the plate can be at `pose`: lengths, joint angles, `cond(H)`.
    ///
    /// # Errors
    /// The limit, the leg and the value.
    pub fn check_pose(&self, pose: &Pose) -> Result<(), Violation> {
        self.carried_at(pose, None)?;
        self.kept_at(&Trajectory::resting(pose).state(0.0), None)
    }

    /// Checks a pose as [`Self::check_pose`] does, with the forces that carrying `load` takes.
    ///
    /// # Errors
    /// The limit, the leg and the value.
    pub fn check_pose_loaded(&self, pose: &Pose, load: &Load) -> Result<(), Violation> {
        self.carried_at(pose, Some(load))?;
        self.kept_at(&Trajectory::resting(pose).state(0.0), Some(load))
    }

    /// Checks whether the legs can take this state at `time_s`. Forces are left out: see
    /// [`Geometry::check_loaded`].
    ///
    /// # Errors
    /// The first limit that is violated, with leg and time.
    pub fn check_state(&self, state: &PlateState, time_s: f64) -> Result<(), MotionError> {
        self.kept_at(state, None).map_err(|violation| MotionError::Limit { violation, time_s })
    }

    /// Checks whether the arm, if it is one, can hold the plate at a pose.
    fn carried_at(&self, pose: &Pose, load: Option<&Load>) -> Result<(), Violation> {
        let Some(arm) = &self.arm else { return Ok(()) };
        self.payload(load)?;
        arm.check_pose(pose)
    }

    /// Checks the mass at the flange of an arm, if it is one with a limit of that.
    fn payload(&self, load: Option<&Load>) -> Result<(), Violation> {
        let limit = self.arm.as_ref().and_then(|arm| arm.payload_kg);
        let (Some(limit), Some(load)) = (limit, load) else { return Ok(()) };
        let value = load.most_kg();
        if value <= limit {
            return Ok(());
        }
        Err(Violation { limit: Limit::ArmPayload, leg: None, between: None, value, allowed: [0.0, limit] })
    }

    /// Checks whether the arm, if it is one, can drive a motion and carry the load.
    pub(super) fn driven(&self, trajectory: &Trajectory, load: Option<&Load>) -> Result<(), MotionError> {
        let Some(arm) = &self.arm else { return Ok(()) };
        let limit = |(violation, time_s)| MotionError::Limit { violation, time_s };
        self.payload(load).map_err(|violation| limit((violation, 0.0)))?;
        arm.check(trajectory).map_err(limit)
    }

    /// Checks one instant; quick where nothing is wrong.
    fn kept_at(&self, state: &PlateState, load: Option<&Load>) -> Result<(), Violation> {
        if !self.has_joints() {
            return self.margins(state, None).check();
        }
        let load = load.filter(|_| self.limits.of_force().is_some());
        let legs = self.legs_at(&state.position, &state.rotation);
        let (w, dw) = (state.rotation * state.angular_rate, state.rotation * state.angular_acceleration);
        let [min, max] = self.leg_length_m;
        let within = |values: [f64; 6], limit: Option<f64>| {
            limit.is_none_or(|limit| values.iter().all(|value| value.abs() <= limit))
        };
        let cones = |angles: Option<[f64; 6]>, cones: &Option<JointCones>| {
            angles.is_none_or(|a| within(a, cones.as_ref().map(|c| c.half_angle_rad)))
        };
        let limits = &self.limits;
        let [base, plate] = self.joint_angles(&legs, state);
        let kept = load.is_none()
            && legs.lengths.iter().all(|l| (min..=max).contains(l))
            && within(legs.rates(&state.velocity, &w), Some(self.leg_rate_mps))
            && (limits.leg_acceleration_mps2.is_none()
                || within(
                    legs.accelerations(&state.velocity, &w, &state.acceleration, &dw),
                    limits.leg_acceleration_mps2,
                ))
            && cones(base, &limits.base_joints)
            && cones(plate, &limits.plate_joints)
            && self.is_guarded(&legs)
            && limits
                .bulk
                .as_ref()
                .is_none_or(|bulk| bulk.nearest(self, &legs).distance_m >= bulk.clearance_m);
        if kept { Ok(()) } else { self.margins(state, load).check() }
    }

    /// Checks whether the legs can follow `trajectory` at every instant. Forces are left out.
    ///
    /// # Errors
    /// A limit that is violated, or cannot be shown to be met, with leg and time.
    pub fn check(&self, trajectory: &Trajectory) -> Result<(), MotionError> {
        self.kept(trajectory, None)
    }

    /// Checks a motion as [`Geometry::check`] does, with the forces that moving `load` takes.
    ///
    /// # Errors
    /// A limit that is violated, or cannot be shown to be met, with leg and time.
    pub fn check_loaded(&self, trajectory: &Trajectory, load: &Load) -> Result<(), MotionError> {
        self.kept(trajectory, Some(load))
    }

    /// Returns true if it can be shown in the given number of checks that every limit is met at every
    /// instant, those of forces with what may be carried, and that the plate turns no faster than so.
    pub fn proves(
        &self,
        trajectory: &Trajectory,
        load: Option<&Load>,
        rate_limit_radps: f64,
        most_looks: u32,
    ) -> bool {
        if self.driven(trajectory, load).is_err() {
            return false;
        }
        let load = load.filter(|_| self.limits.of_force().is_some());
        let bounds = self.bounds_with(load, rate_limit_radps);
        let mut stack: Vec<(f64, f64)> =
            trajectory.seams_s().windows(2).map(|pair| (pair[0], pair[1])).collect();
        if stack.is_empty() {
            stack.push((0.0, 0.0));
        }
        let mut looks = 0;
        while let Some((from, to)) = stack.pop() {
            let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
            looks += 1;
            if bounds.shown(trajectory, middle, half) {
                continue;
            }
            if looks > most_looks || half <= SHORTEST_S {
                return false;
            }
            stack.extend([(middle, to), (from, middle)]);
        }
        true
    }

    fn kept(&self, trajectory: &Trajectory, load: Option<&Load>) -> Result<(), MotionError> {
        self.driven(trajectory, load)?;
        let load = load.filter(|_| self.limits.of_force().is_some());
        let at = |time_s: f64| {
            self.kept_at(&trajectory.state(time_s), load)
                .map_err(|violation| MotionError::Limit { violation, time_s })
        };
        at(0.0)?;
        let bounds = self.bounds_of(load);
        let (mut looks, mut stack) = (0, Vec::new());
        for pair in trajectory.seams_s().windows(2) {
            stack.push((pair[0], pair[1]));
            while let Some((from, to)) = stack.pop() {
                let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
                at(middle)?;
                looks += 1;
                if looks > MOST_LOOKS {
                    return Err(MotionError::TooQuickToCheck { time_s: middle });
                }
                let Some(violation) = bounds.beyond(trajectory, middle, half, TOUCH) else { continue };
                if half <= SHORTEST_S {
                    return Err(MotionError::Limit { violation, time_s: middle });
                }
                stack.extend([(middle, to), (from, middle)]);
            }
            at(pair[1])?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::*;
    use super::*;
    use crate::body::BodyParameters;

    fn refused(g: &Geometry, segments: Vec<Segment>, load: Option<&Load>) -> MotionError {
        let program = MotionProgram { start: g.home(), segments };
        g.kept(&program.trajectory().unwrap(), load).unwrap_err()
    }

    /// A multiple of 250 Hz vanishes, or is a slow ramp, wherever one samples in steps of 4 ms.
    #[test]
    fn a_shake_that_hides_between_looks_in_steps_is_found() {
        let g = Geometry::thesis();
        let term = SineTerm {
            axis: Axis::Roll,
            amplitude: 0.1,
            frequency_hz: 250.0,
            phase_rad: std::f64::consts::FRAC_PI_2,
        };
        let shake = Segment::Multisine { duration_s: 10.0, ramp_s: 4.0, terms: vec![term] };
        let error = refused(&g, vec![shake], None);
        assert!(
            matches!(error, MotionError::Limit { violation: Violation { limit: Limit::LegRate, .. }, .. }),
            "{error}"
        );
        let mut there = g.home();
        there.position_m[2] += 0.02;
        let moves = [there, g.home()].map(|to| Segment::Move { to, duration_s: 0.0015 });
        let hold = Segment::Hold { duration_s: 0.0005 };
        let error = refused(&g, vec![hold].into_iter().chain(moves).collect(), None);
        assert!(error.to_string().contains("m/s"), "{error}");
    }

    /// A program that is refused oversteps at the time stated; one that is passed does not, examined every
    /// 0.2 ms.
    #[test]
    fn the_first_overstepping_is_named_and_passed_programs_keep_the_limits() {
        let g = Geometry::thesis();
        let (mut passed, mut stopped) = (0, 0);
        for k in 0..12 {
            let term = |axis, share| SineTerm {
                axis,
                amplitude: 0.06 * f64::from(k) * share,
                frequency_hz: 0.3 + 0.05 * f64::from(k % 7),
                phase_rad: 0.3,
            };
            let terms = vec![term(Axis::Roll, 1.0), term(Axis::Z, 0.1), term(Axis::Yaw, -0.7)];
            let shake = Segment::Multisine { duration_s: 6.0, ramp_s: 2.0, terms };
            let program = MotionProgram { start: g.home(), segments: vec![shake] };
            let trajectory = program.trajectory().unwrap();
            let first = (0..=30_000)
                .map(|i| f64::from(i) * 2e-4)
                .find(|t| g.check_state(&trajectory.state(*t), *t).is_err());
            match (g.check(&trajectory), first) {
                (Ok(()), None) => passed += 1,
                (Err(MotionError::Limit { time_s, .. }), Some(first)) => {
                    assert!(time_s > first - 2e-4, "{time_s} {first}");
                    assert!(g.check_state(&trajectory.state(time_s), time_s).is_err());
                    stopped += 1;
                }
                (got, first) => panic!("{k}: {got:?} {first:?}"),
            }
        }
        assert!(passed > 1 && stopped > 3, "{passed} {stopped}");
    }

    #[test]
    fn a_hold_of_any_length_takes_one_look_and_a_day_is_the_longest_program() {
        let g = Geometry::thesis();
        let hold =
            |duration_s| MotionProgram { start: g.home(), segments: vec![Segment::Hold { duration_s }] };
        g.check(&hold(86_000.0).trajectory().unwrap()).unwrap();
        for duration_s in [1e5, 1e300] {
            let error = hold(duration_s).trajectory().unwrap_err().to_string();
            assert!(error.contains("86400 s"), "{error}");
        }
    }

    #[test]
    fn a_move_that_ends_on_a_limit_is_driven_to_it() {
        let mut g = Geometry::thesis();
        let mut up = g.home();
        up.position_m[2] += 0.05;
        let longest = g.leg_lengths(&up).into_iter().fold(0.0, f64::max);
        // Home is where it was: the start is given.
        g.leg_length_m[1] = longest;
        let start = Geometry::thesis().home();
        let program = MotionProgram { start, segments: vec![Segment::Move { to: up, duration_s: 2.0 }] };
        g.check(&program.trajectory().unwrap()).unwrap();
        g.leg_length_m[1] = longest - 1e-7;
        assert!(g.check(&program.trajectory().unwrap()).is_err());
    }

    #[test]
    fn a_force_limit_names_leg_and_time_where_the_load_is_known() {
        let mut g = Geometry::thesis();
        g.limits.leg_force_n = Some(30.0);
        let load = Load::body(BodyParameters::thesis_horizontal());
        let hold = vec![Segment::Hold { duration_s: 1.0 }];
        let error = refused(&g, hold.clone(), Some(&load)).to_string();
        assert!(error.contains("leg 1 would carry") && error.contains("t = 0.000 s"), "{error}");
        let program = MotionProgram { start: g.home(), segments: hold };
        g.check(&program.trajectory().unwrap()).unwrap();
    }

    #[test]
    fn a_shake_too_quick_to_be_bounded_is_refused_rather_than_passed() {
        let g = Geometry::thesis();
        let term = SineTerm { axis: Axis::Z, amplitude: 1e-12, frequency_hz: 1e9, phase_rad: 0.0 };
        let shake = Segment::Multisine { duration_s: 1.0, ramp_s: 0.5, terms: vec![term] };
        assert!(
            g.check(&MotionProgram { start: g.home(), segments: vec![shake] }.trajectory().unwrap()).is_err()
        );
    }
}
