//! One trial of a person: poses, coordinates and rates, and the ground's wrench, frame by frame.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Vector3;

use super::alignment::{self, Delay, Looked};
use super::contact::{Contact, Dropped, KeptSoles, contact, counts, soles};
use super::coordinates::Coordinates;
use super::cut_off::cut_off;
use super::error::PersonError;
use super::gaps;
use super::poses::{Poses, poses, upright};
use super::tilt::Tilt;
use super::unmeasured::{Forces, Unmeasured};
use crate::inverse_kinematics::skeleton::Place;
use crate::inverse_kinematics::subject::Subject;
use rigident_fit::parallel;
use rigident_io::motion_capture::ground::GroundWrench;
use rigident_io::motion_capture::trial::Trial;
use rigident_io::motion_capture::zeroing::middle;
use rigident_rows::smoothing::{Smoother, smoothed_at};
use rigident_rows::tree::UnknownZero;

/// Cut-off and delay are found from this many frames at most, …
const LOOKED: usize = 30_000;
/// … and this many before the first that is used.
const BEFORE: usize = 1000;
/// Of a trial the markers of this time are stored in any case, s: pages show it.
pub const SHOWN_S: f64 = 120.0;
/// Of a trial with more frames than these, markers are dropped as soon as poses are found …
const LONG: usize = 60_000;
/// … but for blocks of this many frames each in which plates are loaded, …
const BLOCK: usize = 200;
/// … and this many frames in all.
const MOST_LOADED: usize = 20_000;
/// A plate is loaded from this force on, N.
const LOADED_N: f32 = 25.0;
/// A window is at most this many times as long as its frames.
const LONGEST_WINDOW: usize = 4;
/// Contact is judged with plates that are smoothed this little, Hz: where a foot lands, a wide kernel spreads
/// its load over time in which the foot is elsewhere.
const CONTACT_HZ: f64 = 25.0;
/// Of frames with a load more than this share must have it under a foot, else plates and markers are in
/// different frames.
const UNDER_A_FOOT: f64 = 0.5;

/// Beside a frame with a foot on the floor, where no plate is, other contacts are not sought, s: as far as
/// the smoothing that they are sought with carries its force.
const FLOOR_S: f64 = 0.12;
/// A step beside the plates is shorter, s.
const STEP_S: f64 = 1.0;
/// At most this many contacts of a trial are named.
const NAMED: usize = 3;
/// Fewest frames on one foot that tell whether plates are exchanged.
const FEWEST_SINGLE: usize = 20;

/// A frame that rows are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsedFrame {
    /// The number of the frame in the trial.
    pub number: usize,
    /// The ground's wrench on the person about the laboratory's origin, laboratory axes, N and N m.
    pub wrench: [f32; 6],
}

/// A force plate in the frames that rows are made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UsedPlate {
    /// The name of the plate.
    pub name: String,
    /// The height of the plate's surface, m; `None` if its corners are not known.
    pub height_m: Option<f64>,
    /// The middle of the plate's surface, or of its centres of pressure, m.
    pub middle_m: [f64; 3],
    /// The plate's wrench on the person in each frame, as [`UsedFrame::wrench`].
    pub wrench: Vec<[f32; 6]>,
}

/// The result of the frames of a trial.
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
    /// Root mean square of the distances of each marker from its link, m, with the marker's name.
    pub by_marker: Vec<(String, f64)>,
    /// The plates' mass over the table's, where plates carry most; `None` if the trial is too short.
    pub level: Option<f64>,
    /// Contacts that no plate measures.
    pub unmeasured: Vec<Unmeasured>,
    /// The largest mean force beside the plates in the other frames, N.
    pub beside_n: Option<f64>,
    /// The tilt of the plates, if that is known.
    pub tilt: Option<Tilt>,
}

/// A trial brought to a person's model.
pub struct Tracked {
    /// The trial's name.
    pub name: String,
    /// Frames that rows are made of, in the order of time.
    pub frames: Vec<UsedFrame>,
    /// Coordinates of every frame of the recording.
    pub coordinates: Coordinates,
    /// The smoother of them.
    pub smoother: Smoother,
    /// Frames among `frames` whose markers are stored: joint centres are drawn by them.
    pub windows: Vec<Range<usize>>,
    /// The plates, in their order.
    pub plates: Vec<UsedPlate>,
    /// Plates whose zero is not known.
    pub unzeroed: Vec<UnknownZero>,
    /// The result of the frames.
    pub report: TrackReport,
}

impl Tracked {
    /// Returns the time of a frame from the trial's first one on, ns.
    pub fn time_ns(&self, number: usize) -> u64 {
        (number as f64 / self.report.rate_hz * 1e9).round() as u64
    }

    /// Chooses windows, `count` at most with the given number of frames each, spread over all frames whose
    /// markers there are, and drops the other markers of the trial but for its first [`SHOWN_S`].
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
        let contacts = self.contacts().map_or_else(String::new, |contacts| format!("; {contacts}"));
        format!(
            "{}: {} of {} frames can be used: {why}{contacts}",
            self.name,
            self.frames.len(),
            self.report.frames
        )
    }

    /// Returns contacts that no plate measures, in words; `None` if there is none.
    pub fn contacts(&self) -> Option<String> {
        let all = &self.report.unmeasured;
        let each: Vec<String> = all.iter().take(NAMED).map(Unmeasured::words).collect();
        let more = match all.len().saturating_sub(NAMED) {
            0 => String::new(),
            more => format!("; and {more} more"),
        };
        (!all.is_empty())
            .then(|| format!("something that no plate measures pushes: {}{more}", each.join("; ")))
    }

    /// Drops all frames: what is left of them is too little, or something carries the person in all of them.
    pub(super) fn drop_all(&mut self, why: Dropped) {
        if !self.frames.is_empty() {
            *self.report.dropped.entry(why).or_default() += self.frames.len();
        }
        self.frames.clear();
        self.plates.iter_mut().for_each(|plate| plate.wrench.clear());
    }
}

/// The options of the tracking of a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackOptions {
    /// Cut-off of the smoothing, Hz; `None`: from the data.
    pub cut_off_hz: Option<f64>,
    /// Delay of the plates against the cameras, s; `None`: from the data.
    pub delay_s: Option<f64>,
    /// The person holds something that the table does not have: what else pushes is not distinguished from
    /// it.
    pub holds: bool,
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
    let posed = Posed { subject, trial, coordinates: &coordinates };
    let Judged { contact, beside, cut_off_hz, smoother, delay_s, delay } = posed.judged(options)?;
    same_laboratory(trial, &contact)?;
    let (frames, plates) = posed.used(&contact, &smoother, cut_off_hz, delay_s);
    let report = TrackReport {
        frames: trial.frames(),
        rate_hz: trial.rate_hz,
        dropped: counts(&contact.dropped),
        filled,
        cut_off_hz,
        delay,
        rms_m,
        by_marker,
        level: beside.level,
        unmeasured: beside.contacts,
        beside_n: beside.most_n,
        tilt: None,
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

/// A trial with a pose of every frame.
struct Posed<'a> {
    subject: &'a Subject,
    trial: &'a Trial,
    coordinates: &'a Coordinates,
}

/// The judgement of a trial's frames, with the smoothing and the delay that it was found by.
struct Judged {
    contact: Contact,
    beside: Beside,
    cut_off_hz: f64,
    smoother: Smoother,
    /// The delay of the plates that is taken out, s.
    delay_s: f64,
    /// The delay that was found, and whether it is taken out.
    delay: Option<(Delay, bool)>,
}

impl Posed<'_> {
    /// Returns where the links are in a frame.
    fn places(&self, frame: usize) -> Option<Vec<Place>> {
        Some(self.subject.skeleton.places(&self.coordinates.pose(&self.subject.skeleton, frame)?))
    }

    /// Returns the table's centre of mass in a frame, m; NaN without a pose.
    fn centre(&self, frame: usize) -> Vector3<f64> {
        let centre = self.places(frame).map(|places| alignment::centre_of_mass(self.subject, &places));
        centre.unwrap_or(Vector3::repeat(f64::NAN))
    }

    /// Judges every frame by feet and plates.
    fn contact(&self, soles: &[Option<KeptSoles>], delay_s: f64) -> Contact {
        let trial = self.trial;
        contact(trial.rate_hz, soles, &trial.ground, &|frame| loads(trial, CONTACT_HZ, delay_s, frame))
    }

    /// Returns the frames that cut-off and delay are found from.
    fn looked(&self, judged: &Contact) -> Looked {
        let range = looked(&judged.dropped);
        let used = judged.dropped[range.clone()].iter().map(Option::is_none).collect();
        Looked { centres: parallel::each(range.len(), |k| self.centre(range.start + k)), range, used }
    }

    /// Judges every frame, and finds the cut-off of the smoothing and the delay of the plates.
    fn judged(&self, options: &TrackOptions) -> Result<Judged, PersonError> {
        let (subject, trial) = (self.subject, self.trial);
        let soles = parallel::each(trial.frames(), |frame| soles(subject, &self.places(frame)?));
        let mut delay_s = options.delay_s.unwrap_or(0.0);
        let mut contact = self.contact(&soles, delay_s);
        let about =
            |frame: usize| Some((self.places(frame)?, sum(&loads(trial, CONTACT_HZ, delay_s, frame)?)));
        let beside = if options.holds {
            Beside::default()
        } else {
            beside_the_plates(subject, trial, &contact, &|frame| self.centre(frame), &about)
        };
        beside.leave_out(&mut contact);
        let cut_off_hz = options
            .cut_off_hz
            .unwrap_or_else(|| cut_off(subject, trial, &self.looked(&contact), self.coordinates));
        let smoother = Smoother::new(cut_off_hz, trial.rate_hz)
            .ok_or(PersonError::CutOff { cut_off_hz, rate_hz: trial.rate_hz })?;
        let delay = match options.delay_s {
            Some(_) => None,
            None => alignment::delay(subject, trial, &self.looked(&contact), &smoother),
        };
        // A delay that is no more than what the table's bodies make of it is none.
        let applied = delay.filter(|d| d.delay_s.abs() > 3.0 * d.sigma_s && d.delay_s.abs() > 1e-3);
        if let Some(found) = applied {
            delay_s = found.delay_s;
            contact = self.contact(&soles, delay_s);
            beside.leave_out(&mut contact);
        }
        let delay = delay.map(|d| (d, applied.is_some()));
        Ok(Judged { contact, beside, cut_off_hz, smoother, delay_s, delay })
    }

    /// Returns the frames that rows are made of, and what each plate measured in them.
    fn used(
        &self,
        judged: &Contact,
        smoother: &Smoother,
        cut_off_hz: f64,
        delay_s: f64,
    ) -> (Vec<UsedFrame>, Vec<UsedPlate>) {
        let mut frames = Vec::new();
        let plate = |own: &GroundWrench| UsedPlate {
            name: own.name.clone(),
            height_m: own.corners_m.map(|corners| corners[0][2]),
            middle_m: middle(own),
            wrench: Vec::new(),
        };
        let mut plates: Vec<UsedPlate> = self.trial.ground.iter().map(plate).collect();
        let frame = |number: usize| {
            judged.dropped.get(number).filter(|reason| reason.is_none())?;
            self.coordinates.at(smoother, number)?;
            let loads = loads(self.trial, cut_off_hz, delay_s, number)?;
            Some((UsedFrame { number, wrench: sum(&loads).map(|v| v as f32) }, loads))
        };
        parallel::in_order(self.trial.frames(), frame, |_, own| {
            let Some((frame, loads)) = own else { return };
            frames.push(frame);
            plates.iter_mut().zip(loads).for_each(|(plate, load)| plate.wrench.push(load.map(|v| v as f32)));
        });
        (frames, plates)
    }
}

/// Returns the number of the first frames of a trial whose markers are stored in any case.
fn shown(trial: &Trial) -> usize {
    (SHOWN_S * trial.rate_hz).ceil() as usize
}

/// Drops markers of a long trial that no window can be chosen from: of blocks in which nobody is on a plate,
/// or most of the others.
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

/// Returns the wrench of every plate in a frame, smoothed; `None` where one is not known.
fn loads(trial: &Trial, cut_off_hz: f64, delay_s: f64, frame: usize) -> Option<Vec<[f64; 6]>> {
    let time = trial.time_s(frame) + delay_s;
    trial.ground.iter().map(|plate| smoothed_at(plate, cut_off_hz, time)).collect()
}

fn sum(loads: &[[f64; 6]]) -> [f64; 6] {
    std::array::from_fn(|axis| loads.iter().map(|own| own[axis]).sum())
}

/// The forces on a person beside the plates.
#[derive(Default)]
struct Beside {
    level: Option<f64>,
    frames: Vec<Range<usize>>,
    contacts: Vec<Unmeasured>,
    most_n: Option<f64>,
}

impl Beside {
    /// Takes the frames of these contacts out of those that are used.
    fn leave_out(&self, judged: &mut Contact) {
        for frames in &self.frames {
            let own = judged.dropped.get_mut(frames.clone()).unwrap_or_default();
            own.iter_mut().filter(|reason| reason.is_none()).for_each(|r| *r = Some(Dropped::Unmeasured));
        }
    }
}

/// Finds what pushes beside the plates, in the frames that feet and plates let be used.
fn beside_the_plates(
    subject: &Subject,
    trial: &Trial,
    judged: &Contact,
    centre: &(dyn Fn(usize) -> Vector3<f64> + Sync),
    about: &dyn Fn(usize) -> Option<(Vec<Place>, [f64; 6])>,
) -> Beside {
    // Beside a step on the floor smoothed motion holds a force that no plate has. Feet that hardly load a
    // plate for long, or until the end, are of somebody who sits.
    let frames = |seconds: f64| (seconds * trial.rate_hz).ceil() as usize;
    let reach = frames(FLOOR_S);
    let off = |why: &Option<Dropped>| matches!(why, Some(Dropped::FootOff | Dropped::FootHalfOff));
    let runs = judged.dropped.chunk_by(|a, b| off(a) == off(b));
    let used =
        [judged.dropped.iter().position(Option::is_none), judged.dropped.iter().rposition(Option::is_none)];
    let mut steps = Vec::with_capacity(judged.dropped.len());
    for run in runs {
        let at = Some(steps.len());
        let is_step = off(&run[0]) && used[0] < at && at < used[1] && run.len() < frames(STEP_S);
        steps.extend(std::iter::repeat_n(is_step, run.len()));
    }
    let is_used = |frame: usize| {
        let near = frame.saturating_sub(reach)..steps.len().min(frame + reach + 1);
        let near = steps.get(near).unwrap_or_default();
        judged.dropped.get(frame).is_some_and(Option::is_none) && !near.contains(&true)
    };
    let Some(forces) = Forces::of(subject, trial, &is_used, centre) else { return Beside::default() };
    let Some(level) = forces.level().filter(|_| forces.go_with_the_motion()) else {
        return Beside::default();
    };
    let frames = forces.pushed(level);
    let contacts = frames.iter().filter_map(|own| forces.contact(subject, own, level, about)).collect();
    Beside { level: Some(level), most_n: forces.largest_mean(level, &frames), frames, contacts }
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
