//! From still poses to a motion program: home, every pose held, the first once more as a check for drift.

use hexapod::{MotionError, MotionProgram, Pose, Segment};

use super::measure::up_in_plate;
use super::reach::Reach;
use crate::plan::ways::{self, Pace};

/// Moves from pose to pose.
const PACE: Pace = Pace { rate_radps: 0.5, shortest_s: 1.0 };
/// Of the way out from the level pose in small strides every such one is a stop where the straight line between two poses is
/// barred: the fewer the quicker.
const EVERY: [usize; 2] = [5, 1];
/// So often a step is halved where it is barred itself.
const HALVINGS: u32 = 6;

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
    if let Ok(segment) = ways::straight(reach.geometry(), reach.load(), from, to, PACE) {
        return Ok(vec![segment]);
    }
    let mut result = Ok(Vec::new());
    for every in EVERY {
        let mut stops = stops(reach, from, every);
        stops.reverse();
        stops.push(reach.level());
        stops.extend(self::stops(reach, to, every));
        stops.push(*to);
        let mut at = *from;
        let legs: Result<Vec<_>, _> = stops
            .into_iter()
            .map(|stop| bent(reach, &std::mem::replace(&mut at, stop), &stop, HALVINGS))
            .collect();
        result = legs.map(|legs| legs.concat());
        if result.is_ok() {
            break;
        }
    }
    result
}

/// Straight, or by way of a pose half-way that is away from the limits.
fn bent(reach: &Reach, from: &Pose, to: &Pose, halvings: u32) -> Result<Vec<Segment>, MotionError> {
    let barred = match ways::straight(reach.geometry(), reach.load(), from, to, PACE) {
        Ok(segment) => return Ok(vec![segment]),
        Err(error) => error,
    };
    let middle = if halvings > 0 { reach.between(from, to) } else { None };
    let Some(middle) = middle else { return Err(barred) };
    let mut segments = bent(reach, from, &middle, halvings - 1)?;
    segments.extend(bent(reach, &middle, to, halvings - 1)?);
    Ok(segments)
}

/// On the way out from the level pose to `to`'s orientation.
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
    use crate::plan::poses::Region;
    use crate::plan::poses::plan::{Task, plan};

    /// Whatever two poses a search may choose on the border, with and without a margin and half-way in.
    #[test]
    fn there_is_a_way_between_any_two_poses_of_the_border() {
        for (stroke_m, margin) in [(None, 0.01), (None, 0.0), (Some(0.20), 0.01), (Some(0.10), 0.0)] {
            let reach = Reach::new(Geometry::thesis(), stroke_m).unwrap().with_margin(margin).unwrap();
            let region = Region::of_platform(&reach);
            let border: Vec<Pose> = (0..14)
                .map(|k| {
                    let share = if k % 3 == 2 { 0.6 } else { 1.0 };
                    crate::plan::poses::plan::held(
                        &reach,
                        &region.direction([(0.01 + f64::from(k)) / 14.0, share]),
                    )
                    .unwrap()
                })
                .collect();
            let (mut bent, mut barred) = (0, Vec::new());
            for (k, from) in border.iter().enumerate() {
                for to in &border[k + 1..] {
                    let segments = match way(&reach, from, to) {
                        Ok(segments) => segments,
                        Err(error) => {
                            barred.push(format!("{:?} {:?}: {error}", from.rpy_rad, to.rpy_rad));
                            continue;
                        }
                    };
                    bent += usize::from(segments.len() > 1);
                    let program = MotionProgram { start: *from, segments };
                    reach.geometry().check(&program.trajectory().unwrap()).unwrap();
                }
            }
            assert!(barred.is_empty(), "{stroke_m:?} {margin}: {barred:#?}");
            assert!(bent > 5, "{bent}");
        }
    }

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
}
