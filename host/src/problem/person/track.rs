//! One trial of a person: poses, coordinates and rates, and the ground's wrench, frame by frame.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{UnitQuaternion, Vector3};

use super::alignment::{self, Delay, Looked};
use super::contact::{Contact, Dropped, contact, counts, soles};
use super::coordinates::{Coordinates, STRETCH, numbers};
use super::cut_off::cut_off;
use super::gaps;
use super::people::PersonError;
use crate::inverse_kinematics::markers::Seen;
use crate::inverse_kinematics::skeleton::{Place, Pose, Turn};
use crate::inverse_kinematics::solve::Solver;
use crate::inverse_kinematics::subject::Subject;
use crate::problem::smoothing::{Smoother, smoothed_at};
use crate::problem::tree::UnknownZero;
use rigident_fit::parallel;
use rigident_io::motion_capture::ground::GroundWrench;
use rigident_io::motion_capture::trial::Trial;

/// A freedom is not told by a frame if its deviation is so many times the trial's median, …
const UNTOLD: f32 = 2.5;
/// … and larger than this, rad.
const LEAST_UNTOLD: f32 = 0.05;
/// The heading of a trunk that no marker follows is that of the pelvis over so long, s.
const HEADING_S: f64 = 1.0;
/// Their first pose is that to which so many frames before lead, …
const LEAD: usize = 400;
/// … every so many-th of them.
const COARSE: usize = 8;
/// Stretches that tell how well freedoms are usually told, at most about.
const TELLING: usize = 32;
/// Cut-off and delay are found from so many frames at most, …
const LOOKED: usize = 30_000;
/// … and so many before the first that is used.
const BEFORE: usize = 1000;
/// Of a trial the markers of so much are kept in any case, s: pages show it.
pub const SHOWN_S: f64 = 120.0;
/// Of a trial with more frames than these, markers are dropped as soon as poses are found …
const LONG: usize = 60_000;
/// … but for blocks of so many frames each in which plates are loaded, …
const BLOCK: usize = 200;
/// … and so many frames in all.
const MOST_LOADED: usize = 20_000;
/// A plate is loaded from this force on, N.
const LOADED_N: f32 = 25.0;
/// A window is at most so many times as long as its frames.
const LONGEST_WINDOW: usize = 4;
/// The cut-off that frames are first judged with, Hz.
const FIRST_CUT_OFF_HZ: f64 = 10.0;
/// Of frames with a load more than this share must have it under a foot, else plates and markers are in different frames.
const UNDER_A_FOOT: f64 = 0.5;

/// Fewest frames on one foot that tell whether plates are exchanged.
const FEWEST_SINGLE: usize = 20;

/// A frame that rows are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsedFrame {
    /// Its number in the trial.
    pub number: usize,
    /// The ground's wrench on the person about the laboratory's origin, laboratory axes, N and N m.
    pub wrench: [f32; 6],
}

/// A force plate in the frames that rows are made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UsedPlate {
    /// Its name.
    pub name: String,
    /// Its surface's height, m; `None` if its corners are not known.
    pub height_m: Option<f64>,
    /// Its wrench in each frame, as [`UsedFrame::wrench`].
    pub wrench: Vec<[f32; 6]>,
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
    pub frames: Vec<UsedFrame>,
    /// Coordinates of every frame of the recording.
    pub coordinates: Coordinates,
    /// What they are smoothed by.
    pub smoother: Smoother,
    /// Frames among `frames` whose markers are kept: joint centres are drawn by them.
    pub windows: Vec<Range<usize>>,
    /// The plates, in their order.
    pub plates: Vec<UsedPlate>,
    /// Plates whose zero is not known.
    pub unzeroed: Vec<UnknownZero>,
    /// What became of the frames.
    pub report: TrackReport,
}

impl Tracked {
    /// Returns the time of a frame from the trial's first one on, ns.
    pub fn time_ns(&self, number: usize) -> u64 {
        (number as f64 / self.report.rate_hz * 1e9).round() as u64
    }

    /// Chooses windows, `count` at most with so many frames each, spread over all frames whose markers there are, and drops the other
    /// markers of the trial but for its first [`SHOWN_S`].
    pub(super) fn keep_windows(&mut self, trial: &mut Trial, count: usize, frames: usize) {
        let margin = self.smoother.half() + (gaps::LONGEST_S * trial.rate_hz).round() as usize + 3;
        let around =
            |window: Range<usize>| window.start.saturating_sub(margin)..window.end.saturating_add(margin);
        let has = |k: &usize| {
            let number = self.frames.get(*k).map_or(0, |frame| frame.number);
            trial.markers.has(around(number..number + 1))
        };
        let all: Vec<usize> = (0..self.frames.len()).filter(has).collect();
        let chosen: Vec<&[usize]> = if all.len() <= count * frames {
            all.chunk_by(|a, b| a + 1 == *b).collect()
        } else {
            let first = |k: usize| (2 * k + 1) * all.len() / (2 * count) - frames / 2;
            (0..count).filter_map(|k| all.get(first(k)..first(k) + frames)).collect()
        };
        // Where there are gaps a window ends.
        let window = |own: &[usize]| {
            let (start, first) = own.first().map(|k| (*k, self.frames[*k].number))?;
            let longest = LONGEST_WINDOW * own.len();
            let near =
                |(j, k): &(usize, &usize)| start + j == **k && self.frames[**k].number < first + longest;
            Some(start..start + own.iter().enumerate().take_while(near).count())
        };
        self.windows = chosen.into_iter().filter_map(window).collect();
        let numbers =
            |w: &Range<usize>| around(self.frames[w.start].number..self.frames[w.end - 1].number + 1);
        let mut kept: Vec<Range<usize>> = self.windows.iter().map(numbers).collect();
        kept.push(0..shown(trial));
        trial.markers.keep(kept);
    }

    /// Returns where the links are in a frame.
    pub fn places(&self, subject: &Subject, number: usize) -> Option<Vec<Place>> {
        Some(subject.skeleton.places(&self.coordinates.pose(&subject.skeleton, number)?))
    }

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
    trial: &mut Trial,
    subject: &Subject,
    options: &TrackOptions,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Tracked, PersonError> {
    let Poses { mut coordinates, filled, rms_m, by_marker } = poses(subject, trial, progress);
    thin(trial);
    let trial = &*trial;
    upright(subject, &mut coordinates, trial.rate_hz);
    coordinates.join();
    let places = |frame: usize| -> Option<Vec<Place>> {
        Some(subject.skeleton.places(&coordinates.pose(&subject.skeleton, frame)?))
    };
    let soles = parallel::each(trial.frames(), |frame| soles(subject, &places(frame)?));
    let judge = |cut_off_hz: f64, delay_s: f64| {
        contact(trial.rate_hz, &soles, &trial.ground, &|frame| loads(trial, cut_off_hz, delay_s, frame))
    };
    let centre = |frame: usize| {
        let centre = places(frame).map(|places| alignment::centre_of_mass(subject, &places));
        centre.unwrap_or(Vector3::repeat(f64::NAN))
    };
    let look = |judged: &Contact| {
        let range = looked(&judged.dropped);
        let used = judged.dropped[range.clone()].iter().map(Option::is_none).collect();
        Looked { centres: parallel::each(range.len(), |k| centre(range.start + k)), range, used }
    };
    let cut_off_hz = options.cut_off_hz.unwrap_or_else(|| {
        let judged = judge(FIRST_CUT_OFF_HZ, options.delay_s.unwrap_or(0.0));
        cut_off(subject, trial, &look(&judged), &coordinates)
    });
    let smoother = Smoother::new(cut_off_hz, trial.rate_hz)
        .ok_or(PersonError::CutOff { cut_off_hz, rate_hz: trial.rate_hz })?;
    let mut delay_s = options.delay_s.unwrap_or(0.0);
    let mut judged = judge(cut_off_hz, delay_s);
    let delay = match options.delay_s {
        Some(_) => None,
        None => alignment::delay(subject, trial, &look(&judged), &smoother),
    };
    // A delay that is no more than what the table's bodies make of it is none.
    let applied = delay.filter(|d| d.delay_s.abs() > 3.0 * d.sigma_s && d.delay_s.abs() > 1e-3);
    if let Some(found) = applied {
        delay_s = found.delay_s;
        judged = judge(cut_off_hz, delay_s);
    }
    drop(soles);
    same_laboratory(trial, &judged)?;
    let mut frames = Vec::new();
    let height_m = |plate: &GroundWrench| plate.corners_m.map(|corners| corners[0][2]);
    let plates = trial.ground.iter();
    let plates =
        plates.map(|p| UsedPlate { name: p.name.clone(), height_m: height_m(p), wrench: Vec::new() });
    let mut plates: Vec<UsedPlate> = plates.collect();
    let frame = |number: usize| {
        judged.dropped.get(number).filter(|reason| reason.is_none())?;
        coordinates.at(&smoother, number)?;
        let loads = loads(trial, cut_off_hz, delay_s, number)?;
        let wrench = std::array::from_fn(|axis| loads.iter().map(|own| own[axis]).sum::<f64>() as f32);
        Some((UsedFrame { number, wrench }, loads))
    };
    parallel::in_order(trial.frames(), frame, |_, own| {
        let Some((frame, loads)) = own else { return };
        frames.push(frame);
        plates.iter_mut().zip(loads).for_each(|(plate, load)| plate.wrench.push(load.map(|v| v as f32)));
    });
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
    let name = trial.name.clone();
    Ok(Tracked {
        name,
        frames,
        coordinates,
        smoother,
        windows: Vec::new(),
        plates,
        unzeroed: Vec::new(),
        report,
    })
}

/// The first frames of a trial, whose markers are kept in any case.
fn shown(trial: &Trial) -> usize {
    (SHOWN_S * trial.rate_hz).ceil() as usize
}

/// Drops markers of a long trial that no window can be chosen from: of blocks in which nobody is on a plate, or most of the others.
fn thin(trial: &mut Trial) {
    if trial.frames() <= LONG {
        return;
    }
    let is_loaded = |block: &usize| {
        let time_s = |k: usize| trial.time_s(block * BLOCK + k);
        trial.ground.iter().any(|plate| {
            let at = |time_s: f64| ((time_s - plate.first_s) * plate.rate_hz).max(0.0) as usize;
            let own = plate.wrench.get(at(time_s(0))..plate.wrench.len().min(at(time_s(BLOCK))));
            own.is_some_and(|own| own.iter().any(|w| w[2].abs() > LOADED_N))
        })
    };
    let loaded: Vec<usize> = (0..trial.frames().div_ceil(BLOCK)).filter(is_loaded).collect();
    let every = (loaded.len() * BLOCK).div_ceil(MOST_LOADED).max(1);
    let mut kept: Vec<Range<usize>> =
        loaded.iter().step_by(every).map(|block| block * BLOCK..(block + 1) * BLOCK).collect();
    kept.push(0..shown(trial));
    trial.markers.keep(kept);
}

/// Frames that cut-off and delay are found from: from the first one on that is used.
fn looked(dropped: &[Option<Dropped>]) -> Range<usize> {
    let first = dropped.iter().position(Option::is_none).unwrap_or(0).saturating_sub(BEFORE);
    first..dropped.len().min(first + LOOKED)
}

/// The wrench of every plate in a frame, smoothed; `None` where one is not known.
fn loads(trial: &Trial, cut_off_hz: f64, delay_s: f64, frame: usize) -> Option<Vec<[f64; 6]>> {
    let time = trial.time_s(frame) + delay_s;
    trial.ground.iter().map(|plate| smoothed_at(plate, cut_off_hz, time)).collect()
}

/// The markers of a person in some frames, short gaps filled, and how many places were.
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

/// What markers say of all frames.
struct Poses {
    coordinates: Coordinates,
    filled: usize,
    rms_m: f64,
    by_marker: Vec<(String, f64)>,
}

/// The same of frames that follow one another.
struct Stretch {
    /// A row of numbers and one of deviations for every frame; NaN without a pose.
    numbers: Vec<f32>,
    deviations: Vec<f32>,
    filled: usize,
    /// Sum of the squared distances of every marker, m², and how many there are.
    distances: Vec<(f64, usize)>,
}

impl Stretch {
    /// Forgets frames in which a freedom is not told that is told elsewhere, and all deviations.
    fn forget_untold(&mut self, usual: &[f32]) {
        let is_told = |deviations: &[f32]| {
            deviations.iter().zip(usual).all(|(own, usual)| *own <= LEAST_UNTOLD.max(UNTOLD * usual))
        };
        let deviations = std::mem::take(&mut self.deviations);
        let frames = (deviations.len() / usual.len().max(1)).max(1);
        let width = (self.numbers.len() / frames).max(1);
        let rows = self.numbers.chunks_exact_mut(width);
        let untold = rows.zip(deviations.chunks_exact(usual.len().max(1))).filter(|(_, own)| !is_told(own));
        untold.for_each(|(row, _)| row.fill(f32::NAN));
    }
}

/// The pose that the search of a stretch begins at: what some frames before it lead to, one after the other.
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
    let mut all = Stretch {
        numbers: vec![f32::NAN; seen.len() * width],
        deviations: vec![f32::NAN; seen.len() * freedoms],
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

/// The pose of every frame; none where a freedom is not told that the other frames tell.
fn poses(subject: &Subject, trial: &Trial, progress: &(dyn Fn(f64) + Sync)) -> Poses {
    let count = trial.frames().div_ceil(STRETCH);
    let freedoms = subject.skeleton.freedoms();
    let done = AtomicUsize::new(0);
    // Frames of a stretch are solved one after the other, stretches at the same time; some of them tell what is usual.
    let solved = |stretches: Vec<usize>, usual: Option<&[f32]>| {
        parallel::map(parallel::threads(), stretches.len(), |k| {
            let first = stretches[k] * STRETCH;
            let mut own = stretch(subject, trial, first..trial.frames().min(first + STRETCH));
            if let Some(usual) = usual {
                own.forget_untold(usual);
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
        own.forget_untold(&usual);
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

/// Root mean square of the distances of markers from their links, m: of all, and of each.
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

/// Keeps a trunk that no marker follows upright, its front where the pelvis' is on average: people walk so, and do not carry their
/// trunks fixed to the pelvis.
fn upright(subject: &Subject, coordinates: &mut Coordinates, rate_hz: f64) {
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

/// Refuses plates whose load is nowhere near a foot, or under the foot that is in the air.
fn same_laboratory(trial: &Trial, judged: &Contact) -> Result<(), PersonError> {
    let mut away = judged.beside_m.clone();
    if away.is_empty() {
        return Ok(());
    }
    let under = away.iter().filter(|a| **a < 0.15).count();
    if (under as f64) < UNDER_A_FOOT * away.len() as f64 {
        away.sort_by(f32::total_cmp);
        let away_m = f64::from(away[away.len() / 2]);
        return Err(PersonError::Laboratory { name: trial.name.clone(), away_m });
    }
    let [right, wrong] = judged.single;
    if right + wrong >= FEWEST_SINGLE && wrong as f64 > UNDER_A_FOOT * (right + wrong) as f64 {
        return Err(PersonError::OtherFoot { name: trial.name.clone(), wrong, frames: right + wrong });
    }
    Ok(())
}
