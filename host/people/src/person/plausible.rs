//! Checks whether the plates can have measured the person that the cameras saw, by the motion along each axis
//! and by the mass.

use nalgebra::Vector3;

use super::alignment;
use super::compared::{Compared, LEAST_CORRELATION};
use super::error::PersonError;
use super::people::Person;
use super::track::UsedFrame;

/// Mass over squared stature of living people, kg/m². Nobody lives long of starvation below 10 to 13 (Henry
/// 1990), and the heaviest who still walk are near 80; forces in kgf, lbf or counts are off by 4.4 and more.
const BODY_MASS_INDICES: [f64; 2] = [10.0, 80.0];

/// Refuses plates that measured another motion than the cameras: what the table's bodies need explains little
/// of it. Trials before the first one that is looked at move something that the table does not have.
pub(super) fn belong_together(person: &Person, first: usize) -> Result<(), PersonError> {
    for (k, tracked) in person.trials.iter().enumerate().skip(first) {
        let pairs = forces(person, k).into_iter().map(|(_, pair)| pair).collect();
        let Some(compared) = Compared::of(pairs) else { continue };
        let name = || tracked.name.clone();
        if let Some(correlation) = compared.correlation(2, 2).filter(|r| *r < LEAST_CORRELATION) {
            return Err(PersonError::Apart { name: name(), correlation });
        }
        let own = [0, 1].map(|axis| compared.correlation(axis, axis));
        let crossed = [compared.correlation(0, 1), compared.correlation(1, 0)];
        let follows = own.iter().flatten().any(|r| *r > LEAST_CORRELATION);
        if let [Some(a), Some(b)] = crossed
            && !follows
            && a.abs().min(b.abs()) > LEAST_CORRELATION
        {
            return Err(PersonError::Exchanged { name: name(), correlations: [a, b] });
        }
        if let Some((axis, correlation)) = compared.flipped() {
            return Err(PersonError::Flipped { name: name(), axis, correlation });
        }
    }
    Ok(())
}

/// Refuses a mass that nobody of the person's stature has; `share` is the plates' mass over the table's.
pub(super) fn can_weigh(person: &Person, share: f64) -> Result<(), PersonError> {
    let (mass_kg, height_m) = (share * person.subject.person.mass_kg, person.subject.person.height_m);
    let [least, most] = BODY_MASS_INDICES.map(|index| index * height_m * height_m);
    if (least..=most).contains(&mass_kg) {
        return Ok(());
    }
    Err(PersonError::Weight { mass_kg, height_m, least_kg: least, most_kg: most })
}

/// Returns how many times the force that the table's bodies need for all motions the plates measured, in the
/// frames that are used, from one trial on.
pub(super) fn share_of_needed(person: &Person, first: usize) -> Option<f64> {
    let (mut product, mut square) = (0.0, 0.0);
    for trial in first..person.trials.len() {
        for (_, [needed, measured]) in forces(person, trial) {
            product += needed.z * measured.z;
            square += needed.z * needed.z;
        }
    }
    (square > 0.0 && product > 0.0).then(|| product / square)
}

/// Returns the needed force of the table's bodies and the measured force, N, in the used frames of a trial,
/// with the frames' numbers.
pub(super) fn forces(person: &Person, trial: usize) -> Vec<(usize, [Vector3<f64>; 2])> {
    let Some(tracked) = person.trials.get(trial) else { return Vec::new() };
    let none = Vector3::repeat(f64::NAN);
    let centre = |frame: usize| person.table_centre(trial, frame).unwrap_or(none);
    let centres = rigident_fit::parallel::each(tracked.report.frames, centre);
    let needed = alignment::needed(&person.subject, &centres, &tracked.smoother);
    let pair = |frame: &UsedFrame| {
        let [x, y, z, ..] = frame.wrench.map(f64::from);
        let needed = needed.get(frame.number).copied().flatten()?;
        Some((frame.number, [needed, Vector3::new(x, y, z)]))
    };
    tracked.frames.iter().filter_map(pair).collect()
}
