//! The uncertainty of the parameters from joint centres, marker places, and skin that slides.
//!
//! Of a person there are as many as the markers allow: joints and markers drawn from what the calibration
//! leaves open, and markers that slide with the joints' angles as skin does. Each has her own poses and rows,
//! and other parameters explain the same forces; how far these scatter is `C = D Dᵀ`, D one column a draw.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::{DMatrix, DVector};

use super::error::DrawError;
use super::motion::Motion;
use crate::inverse_kinematics::skeleton::Pose;
use crate::inverse_kinematics::soft::Soft;
use crate::inverse_kinematics::subject::Subject;
use crate::person::another::frames_as;
use crate::person::{Person, Tracked};
use rigident_fit::{Factor, FitError, Silent, parallel, plain_factor};
use rigident_io::motion_capture::trial::Trial;
use rigident_rows::tree::TreeSource;

/// Draws: a standard deviation is known to one in √(2 · 32).
const DRAWS: usize = 32;
/// Poses of a trial that the mean turn of each joint comes from.
const POSES: usize = 50;

/// A person as markers allow her, whose skin slides unless she is the one that was found.
pub(super) struct Drawn {
    subject: Subject,
    soft: Option<Soft>,
}

/// Returns D: how parameters that `solved` finds for a person change with joints, markers and skin, one
/// column a draw.
///
/// # Errors
/// [`DrawError`] if a person with other joints has no rows.
pub(super) fn draws(
    person: &Person,
    progress: &(dyn Fn(f64) + Sync),
    solved: &(dyn Fn(&Drawn) -> Result<DVector<f64>, DrawError> + Sync),
) -> Result<DMatrix<f64>, DrawError> {
    let poses = poses(person);
    let done = AtomicUsize::new(0);
    // The person as she was found, then the draws.
    let found = parallel::map(parallel::threads(), 1 + DRAWS, |k| {
        progress(done.fetch_add(1, Ordering::Relaxed) as f64 / (1 + DRAWS) as f64);
        let Some(draw) = k.checked_sub(1) else {
            return solved(&Drawn { subject: person.subject.clone(), soft: None }).map(Some);
        };
        // The same for everybody.
        let mut signs = Signs::of(draw as u64);
        let mut sign = || signs.next();
        let Some(subject) = person.subject.another(&mut sign) else { return Ok(None) };
        let soft = Some(Soft::drawn(&subject, &poses, sign));
        solved(&Drawn { subject, soft }).map(Some)
    });
    let found: Vec<DVector<f64>> =
        found.into_iter().filter_map(Result::transpose).collect::<Result<_, _>>()?;
    let (about, others) =
        found.split_first().ok_or(FitError::NoRows { samples: 0, rejected: 0, width_s: 0.0 })?;
    let columns: Vec<DVector<f64>> =
        others.iter().map(|other| (other - about) / (DRAWS as f64).sqrt()).collect();
    Ok(if columns.is_empty() { DMatrix::zeros(about.len(), 0) } else { DMatrix::from_columns(&columns) })
}

/// Independent numbers, 1 or −1 (SplitMix64: G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom
/// number generators", OOPSLA 2014).
struct Signs(u64);

impl Signs {
    /// Returns those of a number.
    fn of(number: u64) -> Self {
        Self(Self(number).mixed())
    }

    fn mixed(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn next(&mut self) -> f64 {
        if self.mixed() >> 63 == 0 { 1.0 } else { -1.0 }
    }
}

/// Returns some poses of all trials.
fn poses(person: &Person) -> Vec<Pose> {
    let of = |tracked: &Tracked| -> Vec<Pose> {
        let some = tracked.frames.iter().step_by(tracked.frames.len().div_ceil(POSES).max(1));
        some.filter_map(|frame| tracked.coordinates.pose(&person.subject.skeleton, frame.number)).collect()
    };
    person.trials.iter().flat_map(of).collect()
}

/// Returns the factor of the windows of some motions' trials, as a drawn person has them.
///
/// # Errors
/// [`DrawError`] if they have no rows.
pub(super) fn factor_as(
    drawn: &Drawn,
    person: &Person,
    trials: &[Trial],
    motions: &[Motion],
) -> Result<Option<Factor>, DrawError> {
    let (mut last, mut first) = (None, None);
    let mut all: Vec<Factor> = Vec::new();
    // All motions of a trial have its noise.
    for motion in motions {
        if last.replace(motion.trial) != Some(motion.trial) {
            all.extend(windows(person, trials, motion, drawn, &mut first)?);
        }
    }
    Ok((!all.is_empty()).then(|| Factor::merged(&all)))
}

/// Returns the factors of the windows of a motion's trial, as a drawn person has them, and the `first` rows
/// of her model.
fn windows(
    person: &Person,
    trials: &[Trial],
    motion: &Motion,
    Drawn { subject, soft }: &Drawn,
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
        let frames = frames_as((subject, soft.as_ref()), trial, tracked, window.clone());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_are_independent_of_one_another() {
        const COUNT: usize = 300;
        let draws: Vec<Vec<f64>> = (0..DRAWS as u64)
            .map(|draw| {
                let mut signs = Signs::of(draw);
                (0..COUNT).map(|_| signs.next()).collect()
            })
            .collect();
        for (k, a) in draws.iter().enumerate() {
            let mean = a.iter().sum::<f64>() / COUNT as f64;
            assert!(mean.abs() < 4.0 / (COUNT as f64).sqrt(), "draw {k}: {mean}");
            for (j, b) in draws.iter().enumerate().skip(k + 1) {
                let along = a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / COUNT as f64;
                assert!(along.abs() < 4.5 / (COUNT as f64).sqrt(), "draws {k} and {j}: {along}");
            }
        }
    }
}
