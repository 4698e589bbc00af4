//! One trial of a person: poses, coordinates and rates, and the ground's wrench, frame by frame.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{UnitQuaternion, Vector3};

use super::alignment::{self, Delay};
use super::contact::{Contact, Dropped, contact, counts};
use super::coordinates::{Coordinates, Moved};
use super::cut_off::cut_off;
use super::gaps;
use super::people::PersonError;
use super::smoothing::{Smoother, smoothed_at};
use crate::fit::parallel;
use crate::inverse_kinematics::markers::Seen;
use crate::inverse_kinematics::skeleton::{Place, Pose, Turn};
use crate::inverse_kinematics::solve::{Solved, Solver};
use crate::inverse_kinematics::subject::Subject;
use crate::motion_capture::ground::GroundWrench;
use crate::motion_capture::trial::Trial;

/// A freedom is not told by a frame if its deviation is so many times the trial's median, …
const UNTOLD: f64 = 2.5;
/// … and larger than this, rad.
const LEAST_UNTOLD: f64 = 0.05;
/// The heading of a trunk that no marker follows is that of the pelvis over so long, s.
const HEADING_S: f64 = 1.0;
/// Frames that are solved one after the other: stretches are solved at the same time.
const STRETCH: usize = 1000;
/// Their first pose is that to which every so many-th frame leads.
const COARSE: usize = 8;
/// The cut-off that frames are first judged with, Hz.
const FIRST_CUT_OFF_HZ: f64 = 10.0;
/// Of frames with a load more than this share must have it under a foot, else plates and markers are in different frames.
const UNDER_A_FOOT: f64 = 0.5;

/// A frame that rows are made of.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedFrame {
    /// Its number in the trial.
    pub number: usize,
    /// Its time from the trial's first frame on, ns.
    pub time_ns: u64,
    /// Coordinates and rates.
    pub moved: Moved,
    /// The ground's wrench on the person about the laboratory's origin, laboratory axes, N and N m.
    pub wrench: [f64; 6],
}

/// What became of the frames of a trial.
#[derive(Clone, Debug)]
pub struct TrackReport {
    /// Frames of the recording.
    pub frames: usize,
    /// Frames per second.
    pub rate_hz: f64,
    /// Frames that were dropped, by their reason.
    pub dropped: BTreeMap<Dropped, usize>,
    /// Places of markers that were filled in.
    pub filled: usize,
    /// The cut-off of the smoothing, Hz.
    pub cut_off_hz: f64,
    /// The delay of the plates, if it was found, and whether it was taken out.
    pub delay: Option<(Delay, bool)>,
    /// Root mean square of the distances of markers from their links, m.
    pub rms_m: f64,
    /// The same of every marker, with its name.
    pub by_marker: Vec<(String, f64)>,
}

/// A trial brought to a person's model.
pub struct Tracked {
    /// The trial's name.
    pub name: String,
    /// Frames that rows are made of, in the order of time.
    pub frames: Vec<TrackedFrame>,
    /// The pose of every frame of the recording.
    pub poses: Vec<Option<Pose>>,
    /// What became of the frames.
    pub report: TrackReport,
}

impl Tracked {
    /// Returns why a trial has too few frames, in words.
    pub fn why_unused(&self) -> String {
        let reasons =
            self.report.dropped.iter().map(|(why, count)| format!("{} ({count} frames)", why.words()));
        let reasons: Vec<String> = reasons.collect();
        let why = if reasons.is_empty() { "it is too short".to_owned() } else { reasons.join(", ") };
        format!("{}: {} of {} frames can be used: {why}", self.name, self.frames.len(), self.report.frames)
    }
}

/// How to track a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackOptions {
    /// Cut-off of the smoothing, Hz; `None`: from the data.
    pub cut_off_hz: Option<f64>,
    /// Delay of the plates against the cameras, s; `None`: from the data.
    pub delay_s: Option<f64>,
}

/// Tracks a trial, in which nobody was seen before, with a person's model.
///
/// # Errors
/// [`PersonError`] if markers or plates cannot be what they are said to be.
pub fn track(
    trial: &Trial,
    subject: &Subject,
    options: &TrackOptions,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Tracked, PersonError> {
    let (seen, filled) = seen(trial, subject, 0..trial.frames());
    let solved = poses(subject, seen, progress);
    let (rms_m, by_marker) = distances(subject, &solved);
    let mut poses: Vec<Option<Pose>> = solved.into_iter().map(|s| Some(s?.pose)).collect();
    upright(subject, &mut poses, trial.rate_hz);
    let coordinates = Coordinates::new(&subject.skeleton, &poses);
    let places: Vec<Option<Vec<Place>>> =
        poses.iter().map(|pose| Some(subject.skeleton.places(pose.as_ref()?))).collect();
    let cut_off_hz = options.cut_off_hz.unwrap_or_else(|| {
        let all = wrenches(trial, FIRST_CUT_OFF_HZ, options.delay_s.unwrap_or(0.0));
        let first = contact(subject, trial.rate_hz, &places, &trial.ground, &all);
        let used: Vec<bool> = first.dropped.iter().map(Option::is_none).collect();
        cut_off(subject, trial, &places, &used, &coordinates.series)
    });
    let smoother = Smoother::new(cut_off_hz, trial.rate_hz)
        .ok_or(PersonError::CutOff { cut_off_hz, rate_hz: trial.rate_hz })?;
    let judge = |delay_s: f64| {
        let all = wrenches(trial, cut_off_hz, delay_s);
        (contact(subject, trial.rate_hz, &places, &trial.ground, &all), all)
    };
    let (mut judged, mut all) = judge(options.delay_s.unwrap_or(0.0));
    let used: Vec<bool> = judged.dropped.iter().map(Option::is_none).collect();
    let delay = match options.delay_s {
        Some(_) => None,
        None => alignment::delay(subject, trial, &places, &used, &smoother),
    };
    // A delay that is no more than what the table's bodies make of it is none.
    let applied = delay.filter(|d| d.delay_s.abs() > 3.0 * d.sigma_s && d.delay_s.abs() > 1e-3);
    if let Some(found) = applied {
        (judged, all) = judge(found.delay_s);
    }
    same_laboratory(trial, &judged)?;
    drop(places);
    let mut frames = Vec::new();
    for (number, dropped) in judged.dropped.iter().enumerate() {
        let sum = all.iter().try_fold([0.0; 6], |sum, of| {
            let own = (*of.get(number)?)?;
            Some(std::array::from_fn(|axis| sum[axis] + own[axis]))
        });
        let (None, Some(wrench)) = (dropped, sum) else { continue };
        let Some(moved) = coordinates.at(&smoother, number) else { continue };
        let time_ns = (number as f64 / trial.rate_hz * 1e9).round() as u64;
        frames.push(TrackedFrame { number, time_ns, moved, wrench });
    }
    let report = TrackReport {
        frames: trial.frames(),
        rate_hz: trial.rate_hz,
        dropped: counts(&judged.dropped),
        filled,
        cut_off_hz,
        delay: delay.map(|d| (d, applied.is_some())),
        rms_m,
        by_marker,
    };
    Ok(Tracked { name: trial.name.clone(), frames, poses, report })
}

/// The wrench of every plate at every frame.
fn wrenches(trial: &Trial, cut_off_hz: f64, delay_s: f64) -> Vec<Vec<Option<[f64; 6]>>> {
    let of = |plate: &GroundWrench| -> Vec<Option<[f64; 6]>> {
        let at = |frame: usize| {
            let time = trial.time_s(frame) + delay_s;
            smoothed_at(&plate.wrench, plate.first_s, plate.rate_hz, cut_off_hz, time)
        };
        (0..trial.frames()).map(at).collect()
    };
    trial.ground.iter().map(of).collect()
}

/// The markers of a person in some frames, short gaps filled, and how many places were.
pub(super) fn seen(trial: &Trial, subject: &Subject, range: Range<usize>) -> (Vec<Seen>, usize) {
    let mut frames: Vec<Seen> = vec![Vec::with_capacity(subject.markers.len()); range.len()];
    let mut filled = 0;
    for marker in &subject.markers {
        let label = trial.labels.iter().position(|l| *l == marker.name);
        let mut track: Vec<Option<Vector3<f64>>> =
            range.clone().map(|frame| label.and_then(|l| trial.point(frame, l))).collect();
        filled += gaps::fill(&mut track, trial.rate_hz);
        for (frame, place) in frames.iter_mut().zip(track) {
            frame.push(place);
        }
    }
    (frames, filled)
}

/// Where the search of every stretch begins: at what some frames before it lead to, one after the other.
fn starts(subject: &Subject, seen: &[Seen]) -> Vec<Option<Pose>> {
    let mut solver = Solver::new(&subject.skeleton, &subject.markers);
    let mut last: Option<Pose> = None;
    let mut starts = vec![None];
    // Beyond the last stretch's beginning nobody needs them.
    let last_start = seen.len().saturating_sub(1) / STRETCH * STRETCH;
    for k in (0..last_start).step_by(COARSE) {
        let start = last.take().or_else(|| subject.first_pose(&seen[k]));
        last = start.and_then(|start| solver.solve(&seen[k], &start)).map(|found| found.pose);
        if (k + COARSE).is_multiple_of(STRETCH) {
            starts.push(last.clone());
        }
    }
    starts
}

/// The pose of every frame; none where a freedom is not told that the other frames tell.
fn poses(subject: &Subject, seen: Vec<Seen>, progress: &(dyn Fn(f64) + Sync)) -> Vec<Option<Solved>> {
    let starts = starts(subject, &seen);
    let stretches = seen.chunks(STRETCH).count();
    let done = AtomicUsize::new(0);
    let solved = parallel::map(parallel::threads(), stretches, |stretch| {
        let mut solver = Solver::new(&subject.skeleton, &subject.markers);
        let mut last = starts.get(stretch).cloned().flatten();
        let frames = seen.iter().skip(stretch * STRETCH).take(STRETCH);
        let solved: Vec<Option<Solved>> = frames
            .map(|frame| {
                let start = last.clone().or_else(|| subject.first_pose(frame));
                let found = start.and_then(|start| solver.solve(frame, &start));
                last = found.as_ref().map(|f| f.pose.clone());
                found
            })
            .collect();
        progress((1 + done.fetch_add(1, Ordering::Relaxed)) as f64 / stretches as f64);
        solved
    });
    drop(seen);
    let solved: Vec<Option<Solved>> = solved.into_iter().flatten().collect();
    let freedoms = subject.skeleton.freedoms();
    let usual: Vec<f64> = (0..freedoms)
        .map(|k| {
            let mut all: Vec<f64> = solved.iter().flatten().map(|s| s.deviations[k]).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied().unwrap_or(0.0)
        })
        .collect();
    let is_told = |s: &Solved| {
        s.deviations.iter().zip(&usual).all(|(own, usual)| *own <= LEAST_UNTOLD.max(UNTOLD * usual))
    };
    solved.into_iter().map(|s| s.filter(&is_told)).collect()
}

/// Keeps a trunk that no marker follows upright, its front where the pelvis' is on average: people walk so, and do not carry their
/// trunks fixed to the pelvis.
fn upright(subject: &Subject, poses: &mut [Option<Pose>], rate_hz: f64) {
    let Some(trunk) = subject.unseen_trunk else { return };
    let half = (HEADING_S * rate_hz / 2.0).ceil() as usize;
    let front = |pose: &Option<Pose>| pose.as_ref().map(|pose| pose.attitude * Vector3::x());
    let fronts: Vec<Option<Vector3<f64>>> = poses.iter().map(front).collect();
    let heading = |frame: usize| {
        let near = &fronts[frame.saturating_sub(half)..fronts.len().min(frame + half + 1)];
        let sum: Vector3<f64> = near.iter().flatten().sum();
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sum.y.atan2(sum.x))
    };
    for (frame, pose) in poses.iter_mut().enumerate() {
        let Some(pose) = pose else { continue };
        let turn = pose.attitude.inverse() * heading(frame);
        if let Some(own) = pose.turns.get_mut(trunk) {
            *own = Turn::Ball(turn);
        }
    }
}

/// Refuses plates whose load is nowhere near a foot.
fn same_laboratory(trial: &Trial, judged: &Contact) -> Result<(), PersonError> {
    let mut away = judged.beside_m.clone();
    if away.is_empty() {
        return Ok(());
    }
    let under = away.iter().filter(|a| **a < 0.15).count();
    if (under as f64) < UNDER_A_FOOT * away.len() as f64 {
        away.sort_by(f64::total_cmp);
        return Err(PersonError::Laboratory { name: trial.name.clone(), away_m: away[away.len() / 2] });
    }
    Ok(())
}

/// Root mean square of the distances of markers from their links, of all and of each.
fn distances(subject: &Subject, solved: &[Option<Solved>]) -> (f64, Vec<(String, f64)>) {
    let rms = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), d| (sum + d * d, count + 1));
        (sum / count.max(1) as f64).sqrt()
    };
    let all = rms(&mut solved.iter().flatten().flat_map(|s| s.distances_m.iter().flatten().copied()));
    let each = subject.markers.iter().enumerate().map(|(m, marker)| {
        let mut own = solved.iter().flatten().filter_map(|s| s.distances_m.get(m).copied().flatten());
        (marker.name.clone(), rms(&mut own))
    });
    (all, each.collect())
}
