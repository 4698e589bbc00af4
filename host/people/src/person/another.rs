//! Frames of a trial as another subject would have them, whose joints and markers are where these markers
//! allow it, too, and whose skin slides in another way.

use std::ops::Range;

use super::coordinates::Coordinates;
use super::poses::seen;
use super::track::{Tracked, UsedFrame};
use crate::inverse_kinematics::markers::Seen;
use crate::inverse_kinematics::skeleton::Pose;
use crate::inverse_kinematics::soft::Soft;
use crate::inverse_kinematics::solve::Solver;
use crate::inverse_kinematics::subject::Subject;
use rigident_io::motion_capture::trial::Trial;
use rigident_rows::moved::Moved;

/// Returns coordinates and rates of some of a trial's frames that rows are made of, by their place among
/// them, with the poses of another subject, each with its frame; one that this one has no pose of is left
/// out. With `soft` markers have slid.
pub fn frames_as(
    (subject, soft): (&Subject, Option<&Soft>),
    trial: &Trial,
    tracked: &Tracked,
    frames: Range<usize>,
) -> Vec<(UsedFrame, Moved)> {
    let own = tracked.frames.get(frames).unwrap_or_default();
    let (Some(first), Some(last)) = (own.first(), own.last()) else { return Vec::new() };
    let smoother = &tracked.smoother;
    let start = first.number.saturating_sub(smoother.half());
    let end = trial.frames().min(last.number + smoother.half() + 1);
    let near = |frame: usize| tracked.coordinates.pose(&subject.skeleton, frame);
    let near: Vec<Option<Pose>> = (start..end).map(near).collect();
    let (mut seen, _) = seen(trial, subject, start..end);
    if let Some(soft) = soft {
        let posed = seen.iter_mut().zip(&near).filter_map(|(seen, near)| Some((seen, near.as_ref()?)));
        posed.for_each(|(seen, near)| soft.take_from(subject, near, seen));
    }
    let poses = poses(subject, &seen, &near);
    let coordinates = Coordinates::of(&subject.skeleton, &poses);
    let moved = |frame: &UsedFrame| Some((*frame, coordinates.at(smoother, frame.number - start)?));
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
