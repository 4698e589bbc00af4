//! A motion program from still poses: home, every pose held, the first once more as a check for drift.

use hexapod::{MotionError, MotionProgram, Pose, Segment};

use super::measure::up_in_plate;
use super::reach::{Reach, mean};
use crate::ways::{self, Pace};

/// Fastest turn between poses, rad/s, where the gyro bears it: that of the default experiment.
pub const MOVE_RATE_RADPS: f64 = 1.1;
/// Shortest move, s.
const SHORTEST_S: f64 = 1.0;
/// The shares by which the middle of a path is drawn towards the level pose, as shares of the way.
const DRAWN: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
/// Shares of the limits within which a pose on the way stays; `None` is as far inside as can be.
const WITHIN: [Option<f64>; 3] = [Some(0.97), Some(0.9), None];
/// Strides between two stops on the way out from the level pose, where every path between two poses is
/// barred: the fewer stops the quicker.
const EVERY: [usize; 2] = [5, 1];
/// So often a step is halved where it is barred itself.
const HALVINGS: u32 = 6;

/// Makes the program, within what `reach` may use of the machine, turning at `rate_radps` at most. Home is
/// the same whatever part of the stroke that is.
///
/// # Errors
/// A move that the platform cannot make at any speed.
pub fn program(
    reach: &Reach,
    poses: &[Pose],
    hold_s: f64,
    rate_radps: f64,
) -> Result<MotionProgram, MotionError> {
    let pace = Pace { rate_radps: rate_radps.min(MOVE_RATE_RADPS), shortest_s: SHORTEST_S };
    let geometry = reach.geometry();
    let home = geometry.home();
    let mut segments = vec![Segment::Hold { duration_s: 1.0 }];
    let mut at = home;
    for to in poses.iter().chain(poses.first()) {
        segments.extend(way(reach, &at, to, pace)?);
        segments.push(Segment::Hold { duration_s: hold_s });
        at = *to;
    }
    Ok(MotionProgram { start: home, segments })
}

/// Returns a way without a stop, or with one at the level pose, or in many straight moves by way of it.
fn way(reach: &Reach, from: &Pose, to: &Pose, pace: Pace) -> Result<Vec<Segment>, MotionError> {
    if from == to {
        return Ok(Vec::new());
    }
    let smooth = |from: &Pose, to: &Pose| {
        ways::quickest(reach.geometry(), reach.load(), from, to, paths(reach, from, to), pace)
    };
    if let Ok(segment) = smooth(from, to) {
        return Ok(vec![segment]);
    }
    let level = reach.level();
    if let (Ok(home), Ok(out)) = (smooth(from, &level), smooth(&level, to)) {
        return Ok(vec![home, out]);
    }
    let mut result = Ok(Vec::new());
    for every in EVERY {
        let mut stops = stops(reach, from, every);
        stops.reverse();
        stops.push(level);
        stops.extend(self::stops(reach, to, every));
        stops.push(*to);
        let mut at = *from;
        stops.retain(|stop| std::mem::replace(&mut at, *stop) != *stop);
        let mut at = *from;
        let legs: Result<Vec<_>, _> = stops
            .into_iter()
            .map(|stop| bent(reach, &std::mem::replace(&mut at, stop), &stop, pace, HALVINGS))
            .collect();
        result = legs.map(|legs| legs.concat());
        if result.is_ok() {
            break;
        }
    }
    result
}

/// Returns poses to pass through, one or two at a time: on the straight line, drawn towards the level pose
/// and settled inside the limits.
fn paths(reach: &Reach, from: &Pose, to: &Pose) -> Vec<Vec<Pose>> {
    let level = reach.level();
    let mut paths = Vec::new();
    for shares in [&[0.5][..], &[1.0 / 3.0, 2.0 / 3.0][..]] {
        for drawn in DRAWN {
            for within in WITHIN {
                let via = shares
                    .iter()
                    .map(|share| reach.settled(&mean(&mean(from, to, *share), &level, drawn), within));
                paths.extend(via.collect::<Option<Vec<_>>>());
            }
        }
    }
    paths
}

/// Returns a way that is straight, or leads by a pose half-way that is away from the limits.
fn bent(
    reach: &Reach,
    from: &Pose,
    to: &Pose,
    pace: Pace,
    halvings: u32,
) -> Result<Vec<Segment>, MotionError> {
    let barred = match ways::straight(reach.geometry(), reach.load(), from, to, pace) {
        Ok(segment) => return Ok(vec![segment]),
        Err(error) => error,
    };
    let middle = if halvings > 0 { reach.between(from, to) } else { None };
    let Some(middle) = middle else { return Err(barred) };
    let mut segments = bent(reach, from, &middle, pace, halvings - 1)?;
    segments.extend(bent(reach, &middle, to, pace, halvings - 1)?);
    Ok(segments)
}

/// Returns the stops on the way out from the level pose to `to`'s orientation.
fn stops(reach: &Reach, to: &Pose, every: usize) -> Vec<Pose> {
    let [roll, pitch, _] = to.rpy_rad;
    let strides = reach.strides(&up_in_plate([roll, pitch])).unwrap_or_default();
    let last = strides.len().saturating_sub(1);
    let kept = |k: usize| k == last || (k + 1).is_multiple_of(every);
    strides.into_iter().enumerate().filter(|(k, _)| kept(*k)).map(|(_, pose)| pose).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use hexapod::Geometry;

    use super::*;
    use crate::poses::Region;
    use crate::poses::plan::{Task, plan};
    use crate::study_length::runs;

    /// Any two poses that a search may choose on the border, with and without a margin and half-way in, are
    /// joined by a way.
    #[test]
    fn there_is_a_way_between_any_two_poses_of_the_border() {
        let settings = [(None, 0.01), (None, 0.0), (Some(0.20), 0.01), (Some(0.10), 0.0)];
        for (stroke_m, margin) in settings.into_iter().step_by(runs(1, 3) as usize) {
            let reach = Reach::new(Geometry::thesis(), stroke_m).unwrap().with_margin(margin).unwrap();
            let region = Region::of_platform(&reach);
            let border: Vec<Pose> = (0..14)
                .map(|k| {
                    let share = if k % 3 == 2 { 0.6 } else { 1.0 };
                    crate::poses::plan::held(&reach, &region.direction([(0.01 + f64::from(k)) / 14.0, share]))
                        .unwrap()
                })
                .collect();
            let pace = Pace { rate_radps: MOVE_RATE_RADPS, shortest_s: SHORTEST_S };
            let (mut bent, mut paths, mut pairs, mut barred) = (0, 0, 0, Vec::new());
            for (k, from) in border.iter().enumerate() {
                for to in &border[k + 1..] {
                    let segments = match way(&reach, from, to, pace) {
                        Ok(segments) => segments,
                        Err(error) => {
                            barred.push(format!("{:?} {:?}: {error}", from.rpy_rad, to.rpy_rad));
                            continue;
                        }
                    };
                    bent += usize::from(segments.len() > 1);
                    paths += usize::from(matches!(segments.as_slice(), [Segment::Path { .. }]));
                    pairs += 1;
                    let program = MotionProgram { start: *from, segments };
                    reach.geometry().check(&program.trajectory().unwrap()).unwrap();
                }
            }
            assert!(barred.is_empty(), "{stroke_m:?} {margin}: {barred:#?}");
            // Hardly any stop on the way, and many a way is no straight line.
            assert!(50 * bent <= pairs && 6 * paths > pairs, "{bent} {paths} {pairs}");
        }
    }

    #[test]
    fn every_plan_can_be_driven_from_home_through_all_poses_and_back_to_the_first() {
        for (stroke_m, n) in [(None, 3), (None, 6), (Some(0.20), 5)] {
            let reach = Reach::new(Geometry::thesis(), stroke_m).unwrap();
            let region = Region::of_platform(&reach);
            let poses =
                plan(&reach, &region, &Task::thesis(n), &AtomicBool::new(false), |_| ()).unwrap().poses;
            let program = program(&reach, &poses, 3.0, MOVE_RATE_RADPS).unwrap();
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
    fn five_poses_of_the_default_plan_take_half_a_minute() {
        for thick in [false, true] {
            takes_half_a_minute(thick);
        }
    }

    fn takes_half_a_minute(thick: bool) {
        let mut geometry = Geometry::thesis();
        geometry.limits.bulk = thick.then_some(hexapod::Bulk {
            leg_radius_m: 0.025,
            joint_length_m: 0.08,
            plate_radius_m: Some(0.02),
            base_radius_m: Some(0.02),
            clearance_m: 0.0,
        });
        let reach = Reach::new(geometry, None).unwrap().with_margin(0.01).unwrap();
        let region = Region::of_platform(&reach);
        let poses = plan(&reach, &region, &Task::thesis(5), &AtomicBool::new(false), |_| ()).unwrap().poses;
        let program = program(&reach, &poses, 3.0, MOVE_RATE_RADPS).unwrap();
        assert!(program.duration_s() < 35.0, "{}", program.duration_s());
        let trajectory = program.trajectory().unwrap();
        // Examined every two milliseconds: no limit overstepped, no turn beyond the pace, no jump of the
        // velocity.
        let mut before = trajectory.state(0.0);
        for k in 0..=(program.duration_s() * 500.0) as usize {
            let time_s = 0.002 * k as f64;
            let state = trajectory.state(time_s);
            reach.geometry().check_state(&state, time_s).unwrap();
            assert!(state.angular_rate.norm() < 1.02 * MOVE_RATE_RADPS, "{time_s}");
            assert!((state.velocity - before.velocity).norm() < 0.01, "{time_s}");
            assert!((state.angular_rate - before.angular_rate).norm() < 0.02, "{time_s}");
            before = state;
        }
    }
}
