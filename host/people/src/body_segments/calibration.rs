//! The uncertainty of the parameters from joint centres and marker places.
//!
//! Of a person there are as many as the markers allow: joints and markers drawn from what the calibration
//! leaves open. Each has her own poses and rows, and other parameters explain the same forces; how far these
//! scatter is `C = D Dᵀ`, D one column a draw.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{DMatrix, DVector};

use super::error::DrawError;
use super::motion::Motion;
use crate::inverse_kinematics::subject::Subject;
use crate::person::Person;
use crate::person::another::frames_as;
use rigident_fit::{Factor, Fingerprint, FitError, Silent, parallel, plain_factor};
use rigident_io::motion_capture::trial::Trial;
use rigident_rows::tree::TreeSource;

/// Draws: a standard deviation is known to one in √(2 · 16).
const DRAWS: usize = 16;

/// Returns D: how parameters change with joints and markers, one column a draw.
///
/// # Errors
/// [`DrawError`] if a person with other joints has no rows.
pub fn draws(
    person: &Person,
    trials: &[Trial],
    motions: &[Motion],
    known: &Factor,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<DMatrix<f64>, DrawError> {
    let solved = |subject: &Subject| -> Result<DVector<f64>, DrawError> {
        let mut all = known.clone();
        let (mut last, mut first) = (None, None);
        // All motions of a trial have its noise.
        for motion in motions {
            if last.replace(motion.trial) != Some(motion.trial) {
                let found = windows(person, trials, motion, subject, &mut first)?;
                found.iter().for_each(|factor| all.merge(factor));
            }
        }
        Ok(DVector::from_vec(all.solve(f64::EPSILON).estimate))
    };
    let done = AtomicUsize::new(0);
    // The person as she was found, then the draws.
    let found = parallel::map(parallel::threads(), 1 + DRAWS, |k| {
        progress(done.fetch_add(1, Ordering::Relaxed) as f64 / (1 + DRAWS) as f64);
        let Some(draw) = k.checked_sub(1) else { return solved(&person.subject).map(Some) };
        let mut number = 0;
        // Either sign, the same for everybody.
        let sign = || {
            number += 1;
            let mut hash = Fingerprint::default();
            [draw as u64, number].into_iter().for_each(|v| hash.add(v));
            if hash.finish() >> 63 == 0 { 1.0 } else { -1.0 }
        };
        person.subject.another(sign).map(|other| solved(&other)).transpose()
    });
    let found: Vec<DVector<f64>> =
        found.into_iter().filter_map(Result::transpose).collect::<Result<_, _>>()?;
    let (about, others) =
        found.split_first().ok_or(FitError::NoRows { samples: 0, rejected: 0, width_s: 0.0 })?;
    let columns: Vec<DVector<f64>> =
        others.iter().map(|other| (other - about) / (DRAWS as f64).sqrt()).collect();
    Ok(if columns.is_empty() { DMatrix::zeros(about.len(), 0) } else { DMatrix::from_columns(&columns) })
}

/// Returns the factors of the windows of a motion's trial, as a subject has them, and the `first` rows of the
/// subject's model.
fn windows(
    person: &Person,
    trials: &[Trial],
    motion: &Motion,
    subject: &Subject,
    first: &mut Option<TreeSource>,
) -> Result<Vec<Factor>, DrawError> {
    let (Some(tracked), Some(trial)) = (person.trials.get(motion.trial), trials.get(motion.trial)) else {
        return Ok(Vec::new());
    };
    // As much as all of the trial's frames weigh against the table.
    let looked: usize = tracked.windows.iter().map(Range::len).sum();
    let share = (looked as f64 / tracked.frames.len().max(1) as f64).sqrt();
    let sigma: Vec<f64> = motion.sigma.iter().map(|sigma| sigma * share).collect();
    let factor = |window: &Range<usize>| {
        let frames = frames_as(subject, trial, tracked, window.clone());
        let input = Person::input_of(subject, tracked, frames);
        let source = match first {
            Some(first) => first.of_same_model(input)?,
            None => TreeSource::new(input)?,
        };
        let factor = plain_factor(&source, &sigma, &Silent)?;
        first.get_or_insert(source);
        Ok(factor)
    };
    tracked.windows.iter().map(factor).collect()
}
