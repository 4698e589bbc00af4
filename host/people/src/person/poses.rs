//! Poses of the frames of a trial: every frame by itself, stretches at the same time.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{UnitQuaternion, Vector3};

use super::coordinates::{Coordinates, STRETCH, numbers};
use super::gaps;
use crate::inverse_kinematics::markers::Seen;
use crate::inverse_kinematics::skeleton::{Pose, Turn};
use crate::inverse_kinematics::solve::Solver;
use crate::inverse_kinematics::subject::Subject;
use rigident_fit::parallel;
use rigident_io::motion_capture::trial::Trial;

/// A freedom is not determined by a frame in which markers are missing if its deviation is this many times
/// the trial's median, …
const UNDETERMINED: f32 = 2.5;
/// … and larger than this, rad: straight legs show the turn about their axis by markers a thumb's breadth
/// off it, bent ones by the shank's. With all markers that is so of a pose itself, and the turn about such
/// an axis moves next to no mass.
const LEAST_UNDETERMINED: f32 = 0.2;
/// The heading of a trunk that no marker follows is that of the pelvis over this time, s.
const HEADING_S: f64 = 1.0;
/// Their first pose is that to which this many frames before lead, …
const LEAD: usize = 400;
/// … with this step between them.
const COARSE: usize = 8;
/// Stretches that tell how well freedoms are usually determined, at most about.
const TELLING: usize = 32;

/// Returns the markers of a person in some frames with short gaps filled, and the number of places filled in.
pub(super) fn seen(trial: &Trial, subject: &Subject, range: Range<usize>) -> (Vec<Seen>, usize) {
    let mut frames: Vec<Seen> = vec![Vec::with_capacity(subject.markers.len()); range.len()];
    let mut filled = 0;
    // A gap is filled by the frames on either side, which may lie outside.
    let margin = (gaps::LONGEST_S * trial.rate_hz).round() as usize + 2;
    let wide = range.start.saturating_sub(margin)..trial.frames().min(range.end + margin);
    for marker in &subject.markers {
        let label = trial.labels.iter().position(|l| *l == marker.name);
        let at = |frame: usize| label.and_then(|l| trial.point(frame, l));
        let mut track: Vec<Option<Vector3<f64>>> = wide.clone().map(at).collect();
        gaps::fill(&mut track, trial.rate_hz);
        let own = track.into_iter().skip(range.start - wide.start);
        for ((frame, place), number) in frames.iter_mut().zip(own).zip(range.clone()) {
            filled += usize::from(place.is_some() && at(number).is_none());
            frame.push(place);
        }
    }
    (frames, filled)
}

/// The information of markers for all frames.
pub(super) struct Poses {
    pub coordinates: Coordinates,
    pub filled: usize,
    pub rms_m: f64,
    pub by_marker: Vec<(String, f64)>,
}

/// The information of markers for frames that follow one another.
struct Stretch {
    /// A row of numbers and one of deviations for every frame; NaN without a pose.
    numbers: Vec<f32>,
    deviations: Vec<f32>,
    /// True for every frame in which all markers of the trial were seen.
    whole: Vec<bool>,
    filled: usize,
    /// Sum of the squared distances of every marker, m², and how many there are.
    distances: Vec<(f64, usize)>,
}

impl Stretch {
    /// Forgets frames that miss markers so that a freedom is not determined that is determined elsewhere, and
    /// all deviations.
    fn forget_missing(&mut self, usual: &[f32]) {
        let is_determined = |deviations: &[f32]| {
            deviations
                .iter()
                .zip(usual)
                .all(|(own, usual)| *own <= LEAST_UNDETERMINED.max(UNDETERMINED * usual))
        };
        let deviations = std::mem::take(&mut self.deviations);
        let frames = (deviations.len() / usual.len().max(1)).max(1);
        let width = (self.numbers.len() / frames).max(1);
        let rows = self.numbers.chunks_exact_mut(width).zip(&self.whole);
        let undetermined = rows
            .zip(deviations.chunks_exact(usual.len().max(1)))
            .filter(|((_, whole), own)| !**whole && !is_determined(own));
        undetermined.for_each(|((row, _), _)| row.fill(f32::NAN));
    }
}

/// Returns the pose at which the search of a stretch begins, found from some of the frames before it one
/// after the other.
fn start(subject: &Subject, trial: &Trial, first: usize) -> Option<Pose> {
    let mut solver = Solver::new(&subject.skeleton, &subject.markers);
    let before = (first.saturating_sub(LEAD)..first).step_by(COARSE);
    before.fold(None, |last: Option<Pose>, frame| {
        let (seen, _) = seen(trial, subject, frame..frame + 1);
        let start = last.or_else(|| subject.first_pose(&seen[0]))?;
        Some(solver.solve(&seen[0], &start)?.pose)
    })
}

fn stretch(subject: &Subject, trial: &Trial, frames: Range<usize>) -> Stretch {
    let mut solver = Solver::new(&subject.skeleton, &subject.markers);
    let mut last = start(subject, trial, frames.start);
    let (seen, filled) = seen(trial, subject, frames);
    let width = numbers(&subject.skeleton.zero()).count();
    let freedoms = subject.skeleton.freedoms();
    let recorded: Vec<bool> = subject.markers.iter().map(|m| trial.labels.contains(&m.name)).collect();
    let is_whole = |seen: &Seen| seen.iter().zip(&recorded).all(|(own, recorded)| own.is_some() || !recorded);
    let mut all = Stretch {
        numbers: vec![f32::NAN; seen.len() * width],
        deviations: vec![f32::NAN; seen.len() * freedoms],
        whole: seen.iter().map(is_whole).collect(),
        filled,
        distances: vec![(0.0, 0); subject.markers.len()],
    };
    let rows = all.numbers.chunks_exact_mut(width).zip(all.deviations.chunks_exact_mut(freedoms));
    for (frame, (row, deviations)) in seen.iter().zip(rows) {
        let start = last.take().or_else(|| subject.first_pose(frame));
        let Some(found) = start.and_then(|start| solver.solve(frame, &start)) else { continue };
        row.iter_mut().zip(numbers(&found.pose)).for_each(|(to, v)| *to = v);
        deviations.iter_mut().zip(&found.deviations).for_each(|(to, v)| *to = *v as f32);
        for ((sum, count), distance) in all.distances.iter_mut().zip(&found.distances_m) {
            let Some(distance) = distance else { continue };
            *sum += distance * distance;
            *count += 1;
        }
        last = Some(found.pose);
    }
    all
}

/// Returns the pose of every frame; none where markers are missing and a freedom is not determined that the
/// other frames determine.
pub(super) fn poses(subject: &Subject, trial: &Trial, progress: &(dyn Fn(f64) + Sync)) -> Poses {
    let count = trial.frames().div_ceil(STRETCH);
    let freedoms = subject.skeleton.freedoms();
    let done = AtomicUsize::new(0);
    // Frames of a stretch are solved one after the other, stretches at the same time; some of them tell what
    // is usual.
    let solved = |stretches: Vec<usize>, usual: Option<&[f32]>| {
        parallel::map(parallel::threads(), stretches.len(), |k| {
            let first = stretches[k] * STRETCH;
            let mut own = stretch(subject, trial, first..trial.frames().min(first + STRETCH));
            if let Some(usual) = usual {
                own.forget_missing(usual);
            }
            progress((1 + done.fetch_add(1, Ordering::Relaxed)) as f64 / count as f64);
            own
        })
    };
    let every = count.div_ceil(TELLING).max(1);
    let telling = solved((0..count).step_by(every).collect(), None);
    let usual: Vec<f32> = (0..freedoms)
        .map(|k| {
            let all = telling.iter().flat_map(|s| s.deviations.iter().skip(k).step_by(freedoms));
            let mut all: Vec<f32> = all.copied().filter(|v| !v.is_nan()).collect();
            all.sort_by(f32::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(0.0)
        })
        .collect();
    let others = solved((0..count).filter(|k| k % every != 0).collect(), Some(&usual));
    let (mut telling, mut others) = (telling.into_iter(), others.into_iter());
    let mut distances = vec![(0.0, 0_usize); subject.markers.len()];
    let (mut filled, mut all) = (0, Vec::with_capacity(count));
    for k in 0..count {
        let Some(mut own) = (if k % every == 0 { telling.next() } else { others.next() }) else { break };
        own.forget_missing(&usual);
        filled += own.filled;
        for ((sum, count), own) in distances.iter_mut().zip(&own.distances) {
            *sum += own.0;
            *count += own.1;
        }
        all.push(own.numbers);
    }
    let coordinates = Coordinates::new(&subject.skeleton, all);
    let (rms_m, by_marker) = rms(subject, &distances);
    Poses { coordinates, filled, rms_m, by_marker }
}

/// Returns the root mean square of the distances of markers from their links, m: of all markers, and of each.
fn rms(subject: &Subject, distances: &[(f64, usize)]) -> (f64, Vec<(String, f64)>) {
    let rms = |(sum, count): (f64, usize)| (sum / count.max(1) as f64).sqrt();
    let whole = distances.iter().fold((0.0, 0), |all, own| (all.0 + own.0, all.1 + own.1));
    let each = subject.markers.iter().zip(distances).map(|(m, own)| (m.name.clone(), rms(*own)));
    (rms(whole), each.collect())
}

/// Returns the same of the first frames of a trial.
pub(super) fn distances(subject: &Subject, trial: &Trial, frames: usize) -> (f64, Vec<(String, f64)>) {
    rms(subject, &stretch(subject, trial, 0..trial.frames().min(frames)).distances)
}

/// Keeps a trunk that no marker follows upright, its front where the pelvis' is on average: people walk so,
/// and do not carry their trunks fixed to the pelvis.
pub(super) fn upright(subject: &Subject, coordinates: &mut Coordinates, rate_hz: f64) {
    let Some(trunk) = subject.unseen_trunk else { return };
    let half = (HEADING_S * rate_hz / 2.0).ceil() as usize;
    let skeleton = &subject.skeleton;
    let pelvis = |frame: usize| Some(coordinates.pose(skeleton, frame)?.attitude);
    let pelvis = parallel::each(coordinates.frames(), pelvis);
    let fronts: Vec<Option<Vector3<f64>>> = pelvis.iter().map(|p| Some(p.as_ref()? * Vector3::x())).collect();
    let heading = |frame: usize| {
        let near = &fronts[frame.saturating_sub(half)..fronts.len().min(frame + half + 1)];
        let sum: Vector3<f64> = near.iter().flatten().sum();
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sum.y.atan2(sum.x))
    };
    for (frame, pelvis) in pelvis.iter().enumerate() {
        let (Some(pelvis), Some(mut pose)) = (pelvis, coordinates.pose(skeleton, frame)) else { continue };
        if let Some(own) = pose.turns.get_mut(trunk) {
            *own = Turn::Ball(pelvis.inverse() * heading(frame));
        }
        coordinates.set(frame, numbers(&pose));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_with_all_markers_are_kept_though_a_turn_is_hardly_shown() {
        // A straight arm shows the turn about its axis to 0.6 rad; in the last frame a marker is missing,
        // too.
        let mut own = Stretch {
            numbers: vec![1.0; 8],
            deviations: vec![0.1, 0.1, 0.6, 0.6],
            whole: vec![true, true, true, false],
            filled: 0,
            distances: Vec::new(),
        };
        own.forget_missing(&[0.1]);
        let kept: Vec<bool> =
            own.numbers.chunks_exact(2).map(|row| row.iter().all(|v| !v.is_nan())).collect();
        assert_eq!(kept, [true, true, true, false]);
    }
}
