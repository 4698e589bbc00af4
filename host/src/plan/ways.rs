//! Straight moves from pose to pose, as quick as the legs allow.

use hexapod::{Geometry, Limit, Load, MotionError, MotionProgram, Pose, Segment, Violation};

/// By which a move takes longer where a leg would be too fast.
const LONGER: f64 = 1.25;
/// Moves that take so long are given up, s.
const LONGEST_S: f64 = 1200.0;

/// How quickly the plate is moved where the legs do not ask for more time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Peak of the angular rate, rad/s.
    pub rate_radps: f64,
    /// Shortest move, s.
    pub shortest_s: f64,
}

/// One move, as fast as `pace` says and the legs allow, carrying `load`.
///
/// # Errors
/// A limit that is not kept at any speed, and when.
pub fn straight(
    geometry: &Geometry,
    load: Option<&Load>,
    from: &Pose,
    to: &Pose,
    pace: Pace,
) -> Result<Segment, MotionError> {
    let angle = from.rpy_rad.iter().zip(to.rpy_rad).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    // The quintic's peak rate is 15/8 of its mean.
    let mut duration_s = (1.875 * angle / pace.rate_radps).max(pace.shortest_s);
    loop {
        let segment = Segment::Move { to: *to, duration_s };
        let trajectory = MotionProgram { start: *from, segments: vec![segment.clone()] }.trajectory()?;
        let checked = match load {
            Some(load) => geometry.check_loaded(&trajectory, load),
            None => geometry.check(&trajectory),
        };
        match checked {
            Ok(()) => return Ok(segment),
            Err(MotionError::Limit { violation, .. })
                if time_helps(geometry, load, to, &violation) && duration_s < LONGEST_S =>
            {
                duration_s *= LONGER;
            }
            Err(error) => return Err(error),
        }
    }
}

/// Of a force only what the acceleration adds to the weight.
fn time_helps(geometry: &Geometry, load: Option<&Load>, to: &Pose, violation: &Violation) -> bool {
    match (violation.limit, load) {
        (Limit::LegRate | Limit::LegAcceleration, _) => true,
        (Limit::LegForce, Some(load)) => geometry.check_pose_loaded(to, load).is_ok(),
        _ => false,
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

    #[test]
    fn a_weight_that_is_too_much_is_given_up_at_once_and_named() {
        let mut weak = Geometry::thesis();
        weak.limits.leg_force_n = Some(38.0);
        let load = Load::body(BodyParameters::thesis_horizontal());
        let error = straight(&weak, Some(&load), &weak.home(), &tilted(&weak), PACE).unwrap_err();
        assert!(error.to_string().contains("its limit is 38.0 N"), "{error}");
    }
}
