//! The uncertainties at which a device ends its run by itself.

use rigident_shared::wire::{MAX_STOP_LIMITS, StopLimit, StopRule};

use rigident_fit::figures::{shortened, significant, unit_symbol};
use rigident_fit::{Fit, Parameter};
use rigident_identify::answer::selection::{SelectionError, select};

/// Parameters that a warning names; the others are counted.
const NAMED: usize = 4;
/// Row blocks before which the rule is not examined: a second.
const MINIMUM_BLOCKS: u32 = 100;

/// The accuracy at which a device that estimates may stop.
///
/// ```
/// use rigident_device::stop_criterion::StopCriterion;
/// use rigident_fit::{Kind, Owner, Parameter};
///
/// let mass = Parameter::new("m".to_owned(), Owner::Link(String::new()), Kind::Mass, "kg");
/// let criterion = StopCriterion { until: vec!["m=0.01".to_owned()], keep_going: false };
/// let rule = criterion.rule(&[mass])?.unwrap();
/// assert_eq!(rule.u95(0), Some(0.01));
/// # Ok::<(), rigident_device::stop_criterion::StopError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StopCriterion {
    /// Parameters or groups with their largest 95 % uncertainty in SI units, `NAME=U95`, in the load cell's
    /// frame.
    pub until: Vec<String>,
    /// The device reports that they are reached, and goes on.
    pub keep_going: bool,
}

/// The reason why a device cannot use a stop criterion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StopError {
    /// A word is no name with a number.
    #[error("`until` {0}: a name and its largest 95 % uncertainty in SI units, as Ixx=0.002")]
    NoPair(String),
    /// The number is none that an uncertainty could be.
    #[error("`until` {word}: {number:?} is no positive number; relative uncertainties are not supported")]
    NoUncertainty {
        /// The word.
        word: String,
        /// The number in it.
        number: String,
    },
    /// The offset is known.
    #[error("`until` {0}: the rig file states the offset, so it is not estimated; leave it out")]
    OffsetKnown(String),
    /// There is no such parameter.
    #[error("`until` {word}: {error}")]
    Unknown {
        /// The word.
        word: String,
        /// The error, which names those that there are.
        error: SelectionError,
    },
    /// A name has two limits.
    #[error("`until` {word}: {name} has a limit already; give each name once")]
    Twice {
        /// The second word.
        word: String,
        /// The name.
        name: String,
    },
    /// There are more different uncertainties than the device takes.
    #[error("`until`: the device takes {MAX_STOP_LIMITS} different uncertainties, and these are {0}")]
    TooMany(usize),
}

impl StopCriterion {
    /// Returns what must be identified: `asked` if that names anything, else what is to become so certain.
    pub fn asked(&self, asked: &[String]) -> Vec<String> {
        if !asked.is_empty() {
            return asked.to_vec();
        }
        self.until.iter().filter_map(|word| Some(word.split_once('=')?.0.trim().to_owned())).collect()
    }

    /// Returns the rule for a device that estimates these parameters, in this order; `None` if nothing is to
    /// be reached.
    ///
    /// # Errors
    /// [`StopError`]: a word cannot be used.
    pub fn rule(&self, parameters: &[Parameter]) -> Result<Option<StopRule>, StopError> {
        if self.until.is_empty() {
            return Ok(None);
        }
        let mut asked: Vec<(&str, Vec<usize>, f32)> = Vec::new();
        for word in &self.until {
            let (name, selected, u95) = limit(word, parameters)?;
            if asked.iter().any(|(other, ..)| *other == name) {
                return Err(StopError::Twice { word: word.clone(), name: name.to_owned() });
            }
            asked.push((name, selected, u95));
        }
        // A single name refines its group, wherever it is.
        asked.sort_by_key(|(_, selected, _)| std::cmp::Reverse(selected.len()));
        let mut limits: Vec<StopLimit> = Vec::new();
        for j in 0..parameters.len() {
            let Some((.., u95)) = asked.iter().rev().find(|(_, selected, _)| selected.contains(&j)) else {
                continue;
            };
            let at = limits.iter().position(|limit| limit.u95 == *u95).unwrap_or_else(|| {
                limits.push(StopLimit { u95: *u95, ..StopLimit::default() });
                limits.len() - 1
            });
            limits[at].add(j);
        }
        if limits.len() > MAX_STOP_LIMITS {
            return Err(StopError::TooMany(limits.len()));
        }
        let limits = limits.into_iter().collect();
        Ok(Some(StopRule { limits, minimum_blocks: MINIMUM_BLOCKS, goes_on: self.keep_going }))
    }
}

/// Returns the name, the parameters and the uncertainty of a word.
fn limit<'a>(word: &'a str, parameters: &[Parameter]) -> Result<(&'a str, Vec<usize>, f32), StopError> {
    let (name, number) = word.split_once('=').ok_or_else(|| StopError::NoPair(word.to_owned()))?;
    let u95 = number.trim().parse::<f32>().ok().filter(|v| v.is_finite() && *v > 0.0);
    let u95 =
        u95.ok_or_else(|| StopError::NoUncertainty { word: word.to_owned(), number: number.to_owned() })?;
    let selected = select(parameters, &[name.to_owned()]).map_err(|error| match error {
        SelectionError::NoOffset => StopError::OffsetKnown(word.to_owned()),
        error @ SelectionError::Unknown { .. } => StopError::Unknown { word: word.to_owned(), error },
    })?;
    Ok((name.trim(), selected, u95))
}

/// Returns the warning of a run that ended before the device saw its criterion reached: what was asked for
/// and what the device's rows reached, the furthest first.
pub fn not_reached(stop: &StopRule, found: &Fit) -> String {
    let asked =
        found.parameters.iter().enumerate().filter_map(|(j, p)| Some((j, p, f64::from(stop.u95(j)?))));
    let mut short: Vec<(f64, String)> = asked
        .map(|(j, parameter, u95)| (j, parameter, u95, found.estimate.u95(j)))
        .filter(|(.., u95, reached)| reached > u95)
        .map(|(_, parameter, u95, reached)| {
            let said = if reached.is_finite() {
                let (reached, u95) = (significant(reached, 2), significant(u95, 3));
                format!("{} ± {reached} instead of ± {u95} {}", parameter.name, unit_symbol(&parameter.unit))
            } else {
                format!("{} is not determined", parameter.name)
            };
            (reached / u95, said)
        })
        .collect();
    if short.is_empty() {
        return "`until` was not reached while the device ran; the answer, made of all its rows, is within it"
            .to_owned();
    }
    short.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let said: Vec<&str> = short.iter().map(|(_, said)| said.trim_end()).collect();
    format!("`until` was not reached: {}", shortened(&said, NAMED))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_fit::{Kind, Owner};
    use rigident_shared::inertia::PARAMETER_NAMES;

    fn parameters(count: usize) -> Vec<Parameter> {
        let kind = |j: usize| match j {
            0 => Kind::Mass,
            1..4 => Kind::FirstMoment,
            4..10 => Kind::Inertia,
            _ => Kind::Offset,
        };
        let owner =
            |j: usize| if j < 10 { Owner::Link(String::new()) } else { Owner::Channel("fx".to_owned()) };
        let names = PARAMETER_NAMES.iter().take(count).enumerate();
        names.map(|(j, name)| Parameter::new((*name).to_owned(), owner(j), kind(j), "")).collect()
    }

    fn rule(text: &str, count: usize) -> Result<Option<StopRule>, StopError> {
        let until = text.split(',').filter(|word| !word.is_empty()).map(str::to_owned).collect();
        StopCriterion { until, keep_going: false }.rule(&parameters(count))
    }

    #[test]
    fn names_and_groups_become_limits_and_anything_else_is_refused() {
        let stop = rule("I=0.002,m=0.01,Ixx=0.001", 16).unwrap().unwrap();
        let asked: Vec<Option<f32>> = (0..11).map(|j| stop.u95(j)).collect();
        assert_eq!(asked[..5], [Some(0.01), None, None, None, Some(0.001)]);
        assert_eq!(asked[5..], [[Some(0.002); 5].as_slice(), &[None]].concat());
        let again = rule("Ixx=0.001,m=0.01,I=0.002", 16).unwrap().unwrap();
        assert!((0..16).all(|j| again.u95(j) == stop.u95(j)));
        assert!(matches!(rule("m=1,m=2", 16), Err(StopError::Twice { name, .. }) if name == "m"));
        assert_eq!(rule("Ixx", 16), Err(StopError::NoPair("Ixx".to_owned())));
        for text in ["m=-1", "m=1%"] {
            assert!(matches!(rule(text, 16), Err(StopError::NoUncertainty { .. })), "{text}");
        }
        assert!(matches!(rule("J=1", 16), Err(StopError::Unknown { .. })));
        assert_eq!(rule("offset=1", 10), Err(StopError::OffsetKnown("offset=1".to_owned())));
        assert_eq!(rule("", 16), Ok(None));
    }
}
