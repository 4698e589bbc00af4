//! Frames of a trial as another subject would have them, whose joints and markers are where these markers allow it, too.

use std::ops::Range;

use super::coordinates::Coordinates;
use super::smoothing::Smoother;
use super::track::{Tracked, TrackedFrame, seen};
use crate::inverse_kinematics::markers::Seen;
use crate::inverse_kinematics::skeleton::Pose;
use crate::inverse_kinematics::solve::Solver;
use crate::inverse_kinematics::subject::Subject;
use crate::motion_capture::trial::Trial;

/// Returns some of a trial's frames that rows are made of, by their place among them, with the poses of another subject; a frame that
/// this one has no pose of is left out.
pub fn frames_as(
    subject: &Subject,
    trial: &Trial,
    tracked: &Tracked,
    frames: Range<usize>,
) -> Vec<TrackedFrame> {
    let own = tracked.frames.get(frames).unwrap_or_default();
    let (Some(first), Some(last)) = (own.first(), own.last()) else { return Vec::new() };
    let Some(smoother) = Smoother::new(tracked.report.cut_off_hz, trial.rate_hz) else { return Vec::new() };
    let start = first.number.saturating_sub(smoother.half());
    let end = trial.frames().min(last.number + smoother.half() + 1);
    let poses = poses(subject, &seen(trial, subject, start..end).0, &tracked.poses[start..end]);
    let coordinates = Coordinates::new(&subject.skeleton, &poses);
    let moved = |frame: &TrackedFrame| {
        let moved = coordinates.at(&smoother, frame.number - start)?;
        Some(TrackedFrame { moved, ..frame.clone() })
    };
    own.iter().filter_map(moved).collect()
}

/// Poses sought from those that there are; a trunk that no marker follows stays as it is.
fn poses(subject: &Subject, seen: &[Seen], near: &[Option<Pose>]) -> Vec<Option<Pose>> {
    let mut solver = Solver::new(&subject.skeleton, &subject.markers);
    let solved = seen.iter().zip(near).map(|(seen, near)| {
        let near = near.as_ref()?;
        let mut pose = solver.solve(seen, near)?.pose;
        if let Some(trunk) = subject.unseen_trunk
            && let (Some(own), Some(kept)) = (pose.turns.get_mut(trunk), near.turns.get(trunk))
        {
            *own = *kept;
        }
        Some(pose)
    });
    solved.collect()
}
