//! Motions: trials, or parts of them, each with its rows and factor.

use std::ops::Range;

use super::error::StudyError;
use crate::person::strides::period_s;
use crate::person::{Person, Tracked};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Checks, Fit};
use rigident_identify::answer::checks;
use rigident_rows::tree::TreeSource;

/// Fewest frames that a motion has.
pub(super) const FEWEST_FRAMES: usize = 15;
/// Most frames of a motion: longer trials are more motions.
pub(super) const MOST_FRAMES: usize = 6000;
/// A stride of which less is used counts to the one before.
const WHOLE_STRIDE: f64 = 0.4;

/// A motion: a trial, or a part of one.
pub struct Motion {
    /// The name of the motion.
    pub name: String,
    /// The trial, by its number.
    pub trial: usize,
    /// The frames of the motion, as indices into the frames of the trial that rows are made of.
    pub frames: Range<usize>,
    /// 1 σ of every channel, per unfiltered sample.
    pub sigma: Vec<f64>,
    /// Samples that a row represents.
    pub every: u16,
    /// The factor of the motion, with the findings of its checks. Residuals of people, who are not rigid, are
    /// as slow as their motion: the intervals count that, and there is no warning of it.
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

    /// Takes σ of every channel `by` times as large.
    pub(super) fn widen(&mut self, by: f64) {
        self.sigma.iter_mut().for_each(|sigma| *sigma *= by);
        self.pooled = self.pooled.with_noise_times(by);
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

/// The way trials become motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parts {
    /// A single trial is cut into this many parts of equal length.
    Equal(usize),
    /// Every trial is cut into strides.
    Strides,
}

/// Parts of some of a person's trials, and why trials have none; a long trial is cut into several in any
/// case.
///
/// # Errors
/// [`StudyError::NoStrides`] if a trial has none.
pub(super) fn parts(
    person: &Person,
    which: &[usize],
    asked: Parts,
) -> Result<(Vec<Part>, Vec<String>), StudyError> {
    let (mut parts, mut left) = (Vec::new(), Vec::new());
    for (trial, tracked) in which.iter().filter_map(|k| Some((*k, person.trials.get(*k)?))) {
        let frames = tracked.frames.len();
        if frames < FEWEST_FRAMES {
            left.push(tracked.why_unused());
            continue;
        }
        let cuts = match asked {
            Parts::Strides => strides(tracked)?,
            Parts::Equal(asked) => {
                let asked = if which.len() == 1 { asked } else { 1 };
                let count = asked.max(frames.div_ceil(MOST_FRAMES)).min(frames / FEWEST_FRAMES).max(1);
                (0..frames).step_by(frames.div_ceil(count)).collect()
            }
        };
        let ends = cuts.iter().skip(1).copied().chain([frames]);
        for (part, (first, end)) in cuts.iter().zip(ends).enumerate() {
            let own = match asked {
                _ if cuts.len() == 1 => String::new(),
                Parts::Equal(_) => format!(", part {}", part + 1),
                Parts::Strides => format!(", stride {}", part + 1),
            };
            parts.push(Part { name: tracked.name.clone() + &own, trial, frames: *first..end });
        }
    }
    Ok((parts, left))
}

/// Returns the used frames at which strides begin; a stride that is mostly missing belongs to the one before.
fn strides(tracked: &Tracked) -> Result<Vec<usize>, StudyError> {
    let period_s = period_s(tracked).ok_or_else(|| StudyError::NoStrides(tracked.name.clone()))?;
    let period = period_s * tracked.report.rate_hz;
    let first = tracked.frames.first().map_or(0, |frame| frame.number);
    let stride = |number: usize| ((number - first) as f64 / period) as usize;
    let mut cuts = vec![0];
    for (k, frame) in tracked.frames.iter().enumerate() {
        let last = cuts.last().copied().unwrap_or(0);
        if stride(frame.number) != stride(tracked.frames[last].number) {
            cuts.push(k);
        }
    }
    let ends: Vec<usize> = cuts.iter().skip(1).copied().chain([tracked.frames.len()]).collect();
    let whole = |(cut, end): &(usize, usize)| (end - cut) as f64 > WHOLE_STRIDE * period;
    let kept: Vec<usize> = cuts.into_iter().zip(ends).filter(whole).map(|(cut, _)| cut).collect();
    // What comes first is the first one's.
    Ok(if kept.is_empty() { vec![0] } else { std::iter::once(0).chain(kept.into_iter().skip(1)).collect() })
}

/// Returns the rows of some frames of a trial, with unknown noise.
pub(super) fn source(person: &Person, trial: usize, frames: &Range<usize>) -> Result<TreeSource, StudyError> {
    let input = person.input(trial, frames.clone());
    let input = input.ok_or_else(|| StudyError::NoFrames(format!("trial {} is not there", trial + 1)))?;
    Ok(TreeSource::new(input)?)
}
