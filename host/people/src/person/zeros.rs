//! Zeros of the force plates of all trials.

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;
use nalgebra::Vector3;

use rigident_io::motion_capture::ground::GroundWrench;
use rigident_io::motion_capture::trial::Trial;
use rigident_io::motion_capture::zeroing::{self, UNKNOWN_ZERO_N, UNKNOWN_ZERO_NM};
use rigident_rows::tree::UnknownZero;

use super::contact::is_inside;

/// Tells of plates whose zero drifts.
pub(super) fn drifts(trials: &[Trial]) -> Vec<String> {
    let said = |trial: &Trial| -> Vec<String> {
        let feet = Feet::of(trial);
        let of = |plate: &GroundWrench| {
            let drift = zeroing::drift(plate, &feet.on(plate))?;
            Some(format!(
                "{}, {}: its zero drifts by {drift:.0} N between the first and the last time without load: \
                 the mass is wrong by up to {:.1} kg",
                trial.name,
                plate.name,
                drift.abs() / GRAVITY
            ))
        };
        trial.ground.iter().filter_map(of).collect()
    };
    trials.iter().flat_map(said).collect()
}

/// Zeros every plate by its own time without load, else by that of the same plate in another trial. Returns
/// what to know, and the plates of each trial whose zero is not known: none if plates `are_zeroed` before
/// every trial.
pub(super) fn zero(trials: &mut [Trial], are_zeroed: bool) -> (Vec<String>, Vec<Vec<UnknownZero>>) {
    let offsets = |trial: &Trial| {
        let feet = Feet::of(trial);
        trial.ground.iter().map(|plate| zeroing::offset(plate, &feet.on(plate))).collect()
    };
    let own: Vec<Vec<Option<[f64; 6]>>> = trials.iter().map(offsets).collect();
    let corners: Vec<Vec<Option<[[f64; 3]; 4]>>> =
        trials.iter().map(|t| t.ground.iter().map(|plate| plate.corners_m).collect()).collect();
    let (mut notes, mut unzeroed) = (Vec::new(), vec![Vec::new(); own.len()]);
    for (k, trial) in trials.iter_mut().enumerate() {
        for (p, plate) in trial.ground.iter_mut().enumerate() {
            let is_same = |t: usize| plate.corners_m.is_some() && corners[t].get(p) == Some(&plate.corners_m);
            let mut others = (0..own.len()).filter(|t| is_same(*t));
            let other = others.find_map(|t| own[t].get(p).copied().flatten());
            match own[k][p].or(other) {
                Some(offset) => zeroing::take_off(plate, &offset),
                None if are_zeroed => {}
                None => {
                    notes.push(format!(
                        "{}, {}: always loaded, its zero is taken as it was recorded, as known to \
                         {UNKNOWN_ZERO_N} N (1 σ): record some time without load, or say `plates_zeroed` if \
                         its amplifier was reset right before each trial",
                        trial.name, plate.name
                    ));
                    unzeroed[k].push(UnknownZero {
                        at_m: zeroing::middle(plate),
                        sigma: [UNKNOWN_ZERO_N, UNKNOWN_ZERO_NM],
                    });
                }
            }
        }
    }
    (notes, unzeroed)
}

/// A marker is of a foot if it is at most this much above the lowest one while it stands, m, …
const ANKLE_M: f64 = 0.15;
/// … and the foot stands while it is no more than this above where it is in a tenth of all frames.
const RAISED_M: f64 = 0.03;
/// A foot is on a plate if one of its markers is no farther from where the plate is pressed, m.
const ON_IT_M: f64 = 0.12;
/// Frames of a trial that tell how low markers are, about.
const TELLING: usize = 500;

/// The markers of a trial's feet.
struct Feet<'a> {
    trial: &'a Trial,
    /// Each label with its height while the foot stands, m.
    lows: Vec<(usize, f64)>,
}

impl<'a> Feet<'a> {
    fn of(trial: &'a Trial) -> Self {
        let every = trial.frames().div_ceil(TELLING).max(1);
        let low = |label: usize| {
            let frames = (0..trial.frames()).step_by(every);
            let mut heights: Vec<f64> = frames.filter_map(|f| Some(trial.point(f, label)?.z)).collect();
            heights.sort_by(f64::total_cmp);
            heights.get(heights.len() / 10).copied()
        };
        let mut lows: Vec<(usize, f64)> =
            (0..trial.labels.len()).filter_map(|label| Some((label, low(label)?))).collect();
        let floor = lows.iter().map(|(_, z)| *z).fold(f64::INFINITY, f64::min);
        lows.retain(|(_, z)| z - floor < ANKLE_M);
        Self { trial, lows }
    }

    /// Returns whether a foot stands on a plate at a time, s, as the markers show it.
    fn on(&self, plate: &GroundWrench) -> impl Fn(f64) -> bool {
        let (trial, corners) = (self.trial, plate.corners_m);
        let pressed = Vector3::from(zeroing::pressed(plate));
        let is_over = move |at: &Vector3<f64>| corners.is_none_or(|corners| is_inside(&corners, at));
        move |time_s: f64| {
            let frame = ((time_s - trial.first_s) * trial.rate_hz).round().max(0.0) as usize;
            let stands = |(label, low): &(usize, f64)| {
                trial.point(frame, *label).is_some_and(|at| {
                    at.z - low < RAISED_M && (at - pressed).xy().norm() < ON_IT_M && is_over(&at)
                })
            };
            frame < trial.frames() && self.lows.iter().any(stands)
        }
    }
}
