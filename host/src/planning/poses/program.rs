//! From still poses to a motion program: home, every pose held, the first once more as a check for drift.

use rigident_sim::platform::{Geometry, Limit, MotionError, MotionProgram, Pose, Segment};

use super::measure::up_in_plate;
use super::reach::{Reach, tilted};

/// Peak of the angular rate on the way, rad/s, where the legs allow it.
const RATE_RADPS: f64 = 0.5;
/// Shortest move, s.
const SHORTEST_S: f64 = 1.0;
/// By which a move takes longer where a leg would be too fast.
const LONGER: f64 = 1.25;
/// Moves that take so long are given up, s.
const LONGEST_S: f64 = 120.0;
/// Stops on the way back to the level pose and out again, where the straight line between two poses is barred.
const STOPS: i32 = 6;

/// The program, within what `reach` may use of the machine. Home is the same whatever part of the stroke that is.
///
/// # Errors
/// A move that the platform cannot make at any speed.
pub fn program(reach: &Reach, poses: &[Pose], hold_s: f64) -> Result<MotionProgram, MotionError> {
    let geometry = reach.geometry();
    let home = geometry.home();
    let mut segments = vec![Segment::Hold { duration_s: 1.0 }];
    let mut at = home;
    for to in poses.iter().chain(poses.first()) {
        segments.extend(way(reach, &at, to)?);
        segments.push(Segment::Hold { duration_s: hold_s });
        at = *to;
    }
    Ok(MotionProgram { start: home, segments })
}

/// Straight, or by way of the level pose.
fn way(reach: &Reach, from: &Pose, to: &Pose) -> Result<Vec<Segment>, MotionError> {
    let geometry = reach.geometry();
    straight(geometry, from, to).map(|segment| vec![segment]).or_else(|_| {
        let mut stops: Vec<Pose> = stops(reach, from);
        stops.reverse();
        stops.push(reach.level());
        stops.extend(self::stops(reach, to));
        stops.push(*to);
        let mut at = *from;
        stops
            .into_iter()
            .map(|stop| {
                let segment = straight(geometry, &at, &stop)?;
                at = stop;
                Ok(segment)
            })
            .collect()
    })
}

/// On the way out from the level pose, both ends left out.
fn stops(reach: &Reach, to: &Pose) -> Vec<Pose> {
    let [roll, pitch, _] = to.rpy_rad;
    let up = up_in_plate([roll, pitch]);
    let tilt = up.z.clamp(-1.0, 1.0).acos();
    (1..STOPS).filter_map(|k| reach.pose(&tilted(&up, tilt * f64::from(k) / f64::from(STOPS)))).collect()
}

/// One move, as fast as the legs allow but not faster than [`RATE_RADPS`].
fn straight(geometry: &Geometry, from: &Pose, to: &Pose) -> Result<Segment, MotionError> {
    let angle = from.rpy_rad.iter().zip(to.rpy_rad).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    // The quintic's peak rate is 15/8 of its mean.
    let mut duration_s = (1.875 * angle / RATE_RADPS).max(SHORTEST_S);
    loop {
        let segment = Segment::Move { to: *to, duration_s };
        let program = MotionProgram { start: *from, segments: vec![segment.clone()] };
        match geometry.check(&program.trajectory()?) {
            Ok(()) => return Ok(segment),
            Err(MotionError::Limit { violation, .. })
                if matches!(violation.limit, Limit::LegRate | Limit::LegAcceleration)
                    && duration_s < LONGEST_S =>
            {
                duration_s *= LONGER;
            }
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::planning::poses::Region;
    use crate::planning::poses::plan::{Task, plan};

    #[test]
    fn every_plan_can_be_driven_from_home_through_all_poses_and_back_to_the_first() {
        for (stroke_m, n) in [(None, 3), (None, 6), (Some(0.20), 5)] {
            let reach = Reach::new(Geometry::thesis(), stroke_m).unwrap();
            let region = Region::of_platform(&reach);
            let poses =
                plan(&reach, &region, &Task::thesis(n), &AtomicBool::new(false), |_| ()).unwrap().poses;
            let program = program(&reach, &poses, 3.0).unwrap();
            let trajectory = program.trajectory().unwrap();
            reach.geometry().check(&trajectory).unwrap();
            // The whole machine starts where the part of it does.
            assert_eq!(program.start, Geometry::thesis().home());
            let holds: Vec<f64> = {
                let mut at = 0.0;
                let mut ends = Vec::new();
                for segment in &program.segments {
                    at += segment.duration_s();
                    if matches!(segment, Segment::Hold { .. }) {
                        ends.push(at - 0.5 * segment.duration_s());
                    }
                }
                ends
            };
            assert_eq!(holds.len(), n + 2);
            for (time_s, pose) in holds[1..].iter().zip(poses.iter().chain(&poses[..1])) {
                let at = trajectory.state(*time_s);
                assert!((0..3).all(|k| (at.rpy[k] - pose.rpy_rad[k]).abs() < 1e-12));
            }
        }
    }

    #[test]
    fn slow_legs_get_more_time() {
        let mut slow = Geometry::thesis();
        slow.leg_rate_mps = 0.02;
        let (mut there, home) = (slow.home(), slow.home());
        there.rpy_rad[0] = 0.3;
        let fast = straight(&Geometry::thesis(), &home, &there).unwrap().duration_s();
        let segment = straight(&slow, &home, &there).unwrap();
        assert!(segment.duration_s() > 3.0 * fast);
        slow.leg_rate_mps = 0.0;
        assert!(straight(&slow, &home, &there).is_err());
    }
}
