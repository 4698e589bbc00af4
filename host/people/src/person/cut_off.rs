//! The cut-off of the smoothing: up to where markers and plates tell of one motion.
//!
//! Two bounds, of which the lower one is taken. What left-out frames say of the coordinates alone
//! ([`rigident_rows::smoothing::best_cut_off`]) knows nothing of skin that moves over bone, nor of a
//! recording that was smoothed before. Therefore the forces that the table's bodies need for the motion are
//! compared with the measured ones, band by band: a band in which they differ by more than half of what was
//! measured adds noise, no information.

use nalgebra::Vector3;

use super::alignment::{Looked, along, needed, total};
use super::coordinates::Coordinates;
use crate::inverse_kinematics::subject::Subject;
use rigident_io::motion_capture::trial::Trial;
use rigident_rows::smoothing::{CUT_OFFS_HZ, HIGHEST, Smoother, best_cut_off};

/// A band is used while what is left of it is less than this share of what was measured, by power.
const LARGEST_SHARE: f64 = 0.5;
/// Fewest frames that tell.
const FEWEST: usize = 20;

/// Returns the cut-off, Hz, by some frames.
pub(super) fn cut_off(subject: &Subject, trial: &Trial, frames: &Looked, coordinates: &Coordinates) -> f64 {
    let series = |k: usize| coordinates.series(k).get(frames.range.clone()).unwrap_or_default().to_vec();
    let highest = best_cut_off(coordinates.width(), series, trial.rate_hz, &CUT_OFFS_HZ);
    let mut below: Option<Vec<Option<[Vector3<f64>; 2]>>> = None;
    let mut best = None;
    let candidates = CUT_OFFS_HZ.iter().filter(|f| **f <= HIGHEST * trial.rate_hz && **f <= highest);
    for cut_off in candidates {
        let Some(smoother) = Smoother::new(*cut_off, trial.rate_hz) else { continue };
        let own = forces(subject, trial, frames, &smoother);
        let share = below.as_ref().and_then(|below| share(below, &own));
        if share.is_some_and(|share| share > LARGEST_SHARE) {
            break;
        }
        best = Some(*cut_off);
        // A wider kernel may leave no frames.
        if own.iter().flatten().count() >= FEWEST {
            below = Some(own);
        }
    }
    best.unwrap_or(highest)
}

/// Forces that are needed and that were measured, smoothed alike, N.
fn forces(
    subject: &Subject,
    trial: &Trial,
    frames: &Looked,
    smoother: &Smoother,
) -> Vec<Option<[Vector3<f64>; 2]>> {
    let needed = needed(subject, &frames.centres, smoother);
    let measured = along(&total(trial, &frames.range, smoother, 0.0), smoother, false);
    let pair = |((needed, measured), used): ((Option<Vector3<f64>>, Vector3<f64>), &bool)| {
        (*used && measured.x.is_finite()).then_some([needed?, measured])
    };
    needed.into_iter().zip(measured).zip(&frames.used).map(pair).collect()
}

/// Returns what is left of a band over what was measured in it, by power; `None` if too few frames are in
/// both.
fn share(below: &[Option<[Vector3<f64>; 2]>], own: &[Option<[Vector3<f64>; 2]>]) -> Option<f64> {
    let (mut left, mut all, mut count) = (0.0, 0.0, 0);
    for (below, own) in below.iter().zip(own) {
        let (Some(below), Some(own)) = (below, own) else { continue };
        let [needed, measured] = [own[0] - below[0], own[1] - below[1]];
        left += (measured - needed).norm_squared();
        all += measured.norm_squared();
        count += 1;
    }
    (count >= FEWEST && all > 0.0).then(|| left / all)
}
