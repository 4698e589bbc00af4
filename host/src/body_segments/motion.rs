//! Motions: trials, or parts of them, each with its rows and factor.

use std::ops::Range;

use super::error::StudyError;
use crate::answer::checks;
use crate::fit::pool::PooledFactor;
use crate::fit::{Checks, Fit};
use crate::problem::person::Person;
use crate::problem::tree::TreeSource;

/// Fewest frames that a motion has.
pub(super) const FEWEST_FRAMES: usize = 15;
/// Most frames of a motion: longer trials are more motions.
const MOST_FRAMES: usize = 6000;

/// A motion: a trial, or a part of one.
pub struct Motion {
    /// Its name.
    pub name: String,
    /// The trial, by its number.
    pub trial: usize,
    /// Its frames among those of the trial that rows are made of.
    pub frames: Range<usize>,
    /// 1 σ of every channel, per unfiltered sample.
    pub sigma: Vec<f64>,
    /// Samples that a row stands for.
    pub every: u16,
    /// Its factor, with what its checks found. That residuals of people who are not rigid are as slow as their motion is counted in the
    /// intervals, and no warning.
    pub pooled: PooledFactor,
}

impl Motion {
    /// Returns its rows.
    ///
    /// # Errors
    /// [`StudyError::Source`] if the person has other frames.
    pub fn source(&self, person: &Person) -> Result<TreeSource, StudyError> {
        Ok(source(person, self.trial, &self.frames)?.with_channel_sigma(self.sigma.clone()))
    }

    pub(super) fn of(part: &Part, sigma: &[f64], fit: &Fit) -> Self {
        let found = Checks { warnings: Vec::new(), ..checks(fit, &[], true) };
        Self {
            name: part.name.clone(),
            trial: part.trial,
            frames: part.frames.clone(),
            sigma: sigma.to_vec(),
            every: fit.filter.every,
            pooled: PooledFactor::of(fit, &part.name).checked(&found),
        }
    }
}

/// Frames that become a motion.
pub(super) struct Part {
    pub name: String,
    pub trial: usize,
    pub frames: Range<usize>,
}

/// Parts of some of a person's trials, and why trials have none; a single trial is cut into `asked` parts, a long one into more.
pub(super) fn parts(person: &Person, which: &[usize], asked: usize) -> (Vec<Part>, Vec<String>) {
    let (mut parts, mut left) = (Vec::new(), Vec::new());
    for (trial, tracked) in which.iter().filter_map(|k| Some((*k, person.trials.get(*k)?))) {
        let frames = tracked.frames.len();
        if frames < FEWEST_FRAMES {
            left.push(tracked.why_unused());
            continue;
        }
        let asked = if which.len() == 1 { asked } else { 1 };
        let count = asked.max(frames.div_ceil(MOST_FRAMES)).min(frames / FEWEST_FRAMES).max(1);
        let length = frames.div_ceil(count);
        for (part, first) in (0..frames).step_by(length).enumerate() {
            let own = if count == 1 { String::new() } else { format!(", part {}", part + 1) };
            let name = tracked.name.clone() + &own;
            parts.push(Part { name, trial, frames: first..frames.min(first + length) });
        }
    }
    (parts, left)
}

/// The rows of some frames of a trial, their noise not known.
pub(super) fn source(person: &Person, trial: usize, frames: &Range<usize>) -> Result<TreeSource, StudyError> {
    let input = person.input(trial, frames.clone());
    let input = input.ok_or_else(|| StudyError::NoFrames(format!("trial {} is not there", trial + 1)))?;
    Ok(TreeSource::new(input)?)
}
