//! Moves from pose to pose, straight or through others without a stop, as quick as the legs allow.

use hexapod::{Geometry, Load, MotionError, MotionProgram, Pose, Segment, Violation};

/// The factor by which a move takes longer where a leg would be too fast.
const LONGER: f64 = 1.25;
/// So often the last step of that is halved to find what is needed.
const HALVINGS: u32 = 3;
/// Moves that take this long are given up, s.
const LONGEST_S: f64 = 1200.0;
/// Checks of a path before it is checked at every instant: most that cannot be driven show it there.
const LOOKS: u32 = 24;

/// The speed at which the plate is moved where the legs do not ask for more time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Peak of the angular rate, rad/s.
    pub rate_radps: f64,
    /// Shortest move, s.
    pub shortest_s: f64,
}

/// The moving parts, and their load.
#[derive(Clone, Copy, Debug)]
struct Carrier<'a> {
    geometry: &'a Geometry,
    load: Option<&'a Load>,
}

/// Returns one move, as fast as `pace` says and the legs allow, carrying `load`.
///
/// # Errors
/// A limit that is violated at any speed, and when.
pub fn straight(
    geometry: &Geometry,
    load: Option<&Load>,
    from: &Pose,
    to: &Pose,
    pace: Pace,
) -> Result<Segment, MotionError> {
    let angle = from.rpy_rad.iter().zip(to.rpy_rad).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    // The quintic's peak rate is 15/8 of its mean.
    let least_s = (1.875 * angle / pace.rate_radps).max(pace.shortest_s);
    Carrier { geometry, load }.timed(from, &[], to, least_s)
}

/// Returns the quickest of a straight move and smooth paths, each through the poses of one of `ways`.
///
/// # Errors
/// The error of the straight move, where no path is free either.
pub fn quickest(
    geometry: &Geometry,
    load: Option<&Load>,
    from: &Pose,
    to: &Pose,
    ways: impl IntoIterator<Item = Vec<Pose>>,
    pace: Pace,
) -> Result<Segment, MotionError> {
    let carrier = Carrier { geometry, load };
    let mut best = straight(geometry, load, from, to, pace);
    for via in ways {
        let Some(least_s) = carrier.least_s(from, &via, to, pace) else { continue };
        let shortest = best.as_ref().map_or(LONGEST_S, Segment::duration_s);
        if least_s < shortest
            && let Ok(path) = carrier.timed(from, &via, to, least_s)
            && path.duration_s() < shortest
        {
            best = Ok(path);
        }
    }
    best
}

/// Returns the segment through `via` to `to`; straight if `via` is empty.
fn segment(via: &[Pose], to: &Pose, duration_s: f64) -> Segment {
    match via {
        [] => Segment::Move { to: *to, duration_s },
        _ => Segment::Path { via: via.to_vec(), to: *to, duration_s },
    }
}

impl Carrier<'_> {
    /// Returns the shortest duration from `least_s` on in which every limit is met at every instant, to three
    /// per cent.
    fn timed(&self, from: &Pose, via: &[Pose], to: &Pose, least_s: f64) -> Result<Segment, MotionError> {
        let checked = |duration_s: f64| {
            let segment = segment(via, to, duration_s);
            let trajectory = MotionProgram { start: *from, segments: vec![segment.clone()] }.trajectory()?;
            match self.load {
                Some(load) => self.geometry.check_loaded(&trajectory, load)?,
                None => self.geometry.check(&trajectory)?,
            }
            Ok(segment)
        };
        let mut duration_s = least_s;
        let mut best = loop {
            match checked(duration_s) {
                Ok(segment) => break segment,
                Err(MotionError::Limit { violation, .. })
                    if self.time_helps(to, &violation) && duration_s < LONGEST_S =>
                {
                    duration_s *= LONGER;
                }
                Err(error) => return Err(error),
            }
        };
        if duration_s > least_s {
            let (mut too_quick, mut slow) = (duration_s / LONGER, duration_s);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (too_quick + slow);
                match checked(middle) {
                    Ok(segment) => (best, slow) = (segment, middle),
                    Err(_) => too_quick = middle,
                }
            }
        }
        Ok(best)
    }

    /// Returns how long a path takes at least by the checks of it; `None` where it cannot be driven at any
    /// speed.
    fn least_s(&self, from: &Pose, via: &[Pose], to: &Pose, pace: Pace) -> Option<f64> {
        let segments = vec![segment(via, to, 1.0)];
        let trajectory = MotionProgram { start: *from, segments }.trajectory().ok()?;
        let acceleration = self.geometry.limits.leg_acceleration_mps2;
        (1..LOOKS).try_fold(pace.shortest_s, |most, k| {
            let state = trajectory.state(f64::from(k) / f64::from(LOOKS));
            self.geometry.check_pose(&state.pose()).ok()?;
            // Rates fall with the duration, accelerations with its square.
            let largest = |values: [f64; 6]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let turning = state.angular_rate.norm() / pace.rate_radps;
            if let Some(travel) = &self.geometry.travel {
                let used = travel.margins(&state);
                let of_speed = used.speed_mps / used.speed_limit_mps;
                return Some(most.max(turning).max(of_speed).max(used.rate_radps / used.rate_limit_radps));
            }
            let rates = largest(self.geometry.leg_rates(&state)) / self.geometry.leg_rate_mps;
            let pull = acceleration
                .map_or(0.0, |limit| (largest(self.geometry.leg_accelerations(&state)) / limit).sqrt());
            Some(most.max(turning).max(rates).max(pull))
        })
    }

    /// Returns true if more time helps: with a limit of speed, and with one of force that the weight alone
    /// keeps.
    fn time_helps(&self, to: &Pose, violation: &Violation) -> bool {
        match (violation.limit, self.load) {
            (limit, _) if limit.is_of_speed() => true,
            (limit, Some(load)) if limit.is_of_force() => self.geometry.check_pose_loaded(to, load).is_ok(),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use hexapod::BodyParameters;

    use super::*;

    const PACE: Pace = Pace { rate_radps: 0.5, shortest_s: 1.0 };

    fn tilted(geometry: &Geometry) -> Pose {
        let mut there = geometry.home();
        there.rpy_rad[0] = 0.3;
        there
    }

    #[test]
    fn slow_legs_get_more_time() {
        let mut slow = Geometry::thesis();
        let (there, home) = (tilted(&slow), slow.home());
        let fast = straight(&slow, None, &home, &there, PACE).unwrap().duration_s();
        slow.leg_rate_mps = 0.02;
        let segment = straight(&slow, None, &home, &there, PACE).unwrap();
        assert!(segment.duration_s() > 3.0 * fast);
        slow.leg_rate_mps = 0.0;
        assert!(straight(&slow, None, &home, &there, PACE).is_err());
    }

    /// Everything about the path is examined every millisecond with the mechanics alone.
    #[test]
    fn a_path_is_taken_where_the_straight_line_is_barred_and_keeps_every_limit() {
        let mut geometry = Geometry::thesis();
        geometry.limits.leg_acceleration_mps2 = Some(0.04);
        let tilted = |roll: f64, pitch: f64, position_m| Pose {
            position_m,
            rpy_rad: [roll.to_radians(), pitch.to_radians(), 0.0],
        };
        // Two poses of a plan, on the edge of what the legs can reach.
        let from = tilted(-30.21, -39.35, [0.0741, 0.0609, 0.6418]);
        let to = tilted(53.83, -49.42, [0.0756, -0.0875, 0.6074]);
        let barred = straight(&geometry, None, &from, &to, PACE).unwrap_err();
        let good = vec![
            tilted(-1.76, -34.17, [0.0597, 0.0092, 0.6453]),
            tilted(20.65, -36.85, [0.0601, -0.0304, 0.6361]),
        ];
        let mut low = good.clone();
        low.iter_mut().for_each(|pose| pose.position_m[2] -= 0.1);
        let ways = [vec![geometry.home()], low, good.clone()];
        let path = quickest(&geometry, None, &from, &to, ways, PACE).unwrap();
        assert!(matches!(&path, Segment::Path { via, .. } if *via == good), "{path:?}");
        let duration_s = path.duration_s();
        let trajectory = MotionProgram { start: from, segments: vec![path] }.trajectory().unwrap();
        let mut before = trajectory.state(0.0);
        let (mut passed, mut rate, mut pull) = (f64::INFINITY, 0.0_f64, 0.0_f64);
        for k in 0..=(duration_s * 1000.0) as usize {
            let state = trajectory.state(0.001 * k as f64);
            let pose = state.pose();
            let [low, high] = geometry.leg_length_m;
            assert!(geometry.leg_lengths(&pose).iter().all(|l| (low..=high).contains(l)), "{k}");
            assert!(geometry.condition_number(&pose) <= geometry.limits.cond_max);
            rate = geometry.leg_rates(&state).iter().fold(rate, |m, v| m.max(v.abs()));
            pull = geometry.leg_accelerations(&state).iter().fold(pull, |m, v| m.max(v.abs()));
            // No jump of place or velocity.
            assert!((state.position - before.position).norm() <= 0.002 * (0.1 + before.velocity.norm()));
            assert!((state.velocity - before.velocity).norm() < 0.01, "{k}");
            let gap = |k: usize| pose.position_m[k] - good[1].position_m[k];
            passed = passed.min((0..3).map(gap).map(|g| g * g).sum::<f64>().sqrt());
            before = state;
        }
        assert!(rate <= geometry.leg_rate_mps && pull <= 0.04 && passed < 0.001, "{rate} {pull} {passed}");
        // As quick as it can be, but for three per cent of the time.
        assert!(pull > 0.93 * 0.04, "{rate} {pull}");
        assert_eq!(trajectory.end_pose(), to);
        let error = quickest(&geometry, None, &from, &to, Vec::new(), PACE).unwrap_err();
        assert_eq!(error, barred);
    }

    #[test]
    fn a_weight_that_is_too_much_is_given_up_at_once_and_named() {
        let mut weak = Geometry::thesis();
        weak.limits.leg_force_n = Some(38.0);
        let load = Load::body(BodyParameters::thesis_horizontal());
        let error = straight(&weak, Some(&load), &weak.home(), &tilted(&weak), PACE).unwrap_err();
        assert!(error.to_string().contains("its limit is 38.0 N"), "{error}");
    }
}
