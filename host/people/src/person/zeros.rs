//! Zeros of the force plates of all trials.

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;

use rigident_io::motion_capture::trial::Trial;
use rigident_io::motion_capture::zeroing::{self, UNKNOWN_ZERO_N, UNKNOWN_ZERO_NM};
use rigident_rows::tree::UnknownZero;

/// Tells of plates whose zero drifts.
pub(super) fn drifts(trials: &[Trial]) -> Vec<String> {
    let plates = trials.iter().flat_map(|trial| trial.ground.iter().map(move |plate| (trial, plate)));
    let told = plates.filter_map(|(trial, plate)| {
        let drift = zeroing::drift(plate)?;
        Some(format!(
            "{}, {}: its zero drifts by {drift:.0} N between the first and the last time without load: the mass is wrong by up to {:.1} kg",
            trial.name,
            plate.name,
            drift.abs() / GRAVITY
        ))
    });
    told.collect()
}

/// Zeros every plate by its own time without load, else by that of the same plate in another trial. Returns what to know, and the
/// plates of each trial whose zero is not known: none if plates `are_zeroed` before every trial.
pub(super) fn zero(trials: &mut [Trial], are_zeroed: bool) -> (Vec<String>, Vec<Vec<UnknownZero>>) {
    let own: Vec<Vec<Option<[f64; 6]>>> =
        trials.iter().map(|t| t.ground.iter().map(zeroing::offset).collect()).collect();
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
                        "{}, {}: always loaded, its zero is taken as it was recorded, as known to {UNKNOWN_ZERO_N} N (1 σ): record some \
                         time without load, or say `plates_zeroed` if its amplifier was reset right before each trial",
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
