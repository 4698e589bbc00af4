use clap::Args;
#[cfg(test)]
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::wire::{MAX_STOP_LIMITS, Settings, StopLimit, StopRule};

use crate::Failure;
use rigident::answer::selection::{SelectionError, select};
use rigident::fit::figures::{shortened, significant, unit_symbol};
use rigident_fit::{Fit, Parameter};

/// Parameters that a warning names; the others are counted.
const NAMED: usize = 4;

/// Row blocks before which the rule is not examined: a second.
const MINIMUM_BLOCKS: u32 = 100;

/// What the device does while it estimates.
#[derive(Args, Debug, Clone, Default)]
pub struct StopCriterion {
    /// End as soon as these have at most these 95 % uncertainties, SI, in the load cell's frame: Ixx=0.002,m=0.01. Any of m,
    /// mc, I, offset, a link, and single names. The device decides; Ctrl-C ends sooner
    #[arg(long, value_name = "NAME=U95", value_delimiter = ',')]
    pub until: Vec<String>,
    /// With --until: report when the uncertainties are reached, but finish the program
    #[arg(long, alias = "go-on", requires = "until")]
    pub keep_going: bool,
}

impl StopCriterion {
    /// Returns what is asked for: `estimate` if that names anything, else what is to become so certain.
    pub(crate) fn asked(&self, estimate: &[String]) -> Vec<String> {
        if !estimate.is_empty() {
            return estimate.to_vec();
        }
        self.until.iter().filter_map(|word| Some(word.split_once('=')?.0.trim().to_owned())).collect()
    }

    /// Refuses what a device that estimates these parameters cannot use.
    ///
    /// # Errors
    /// Bad input.
    pub(crate) fn check(&self, parameters: &[Parameter]) -> Result<(), Failure> {
        stop_rule(&self.until, parameters).map(|_| ()).map_err(Failure::input)
    }

    /// Puts it into the settings of a device that estimates these parameters, in this order.
    ///
    /// # Errors
    /// What cannot be used: bad input.
    pub(crate) fn put_into(&self, settings: &mut Settings, parameters: &[Parameter]) -> Result<(), Failure> {
        settings.stop = stop_rule(&self.until, parameters).map_err(Failure::input)?;
        if let Some(stop) = &mut settings.stop {
            stop.goes_on = self.keep_going;
        }
        Ok(())
    }
}

/// Returns the warning of a run that ended before the device saw its criterion reached: what was asked for and what the
/// device's rows reached, the furthest first.
pub(crate) fn not_reached(stop: &StopRule, found: &Fit) -> String {
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
        return "--until was not reached while the device ran; the answer, made of all its rows, is within it".to_owned();
    }
    short.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let said: Vec<&str> = short.iter().map(|(_, said)| said.trim_end()).collect();
    format!("--until was not reached: {}", shortened(&said, NAMED))
}

fn stop_rule(words: &[String], parameters: &[Parameter]) -> Result<Option<StopRule>, String> {
    if words.is_empty() {
        return Ok(None);
    }
    let mut asked: Vec<(&str, Vec<usize>, f32)> = Vec::new();
    for word in words {
        let (name, number) = word.split_once('=').ok_or_else(|| {
            format!("--until {word}: a name and its largest 95 % uncertainty in SI units, as Ixx=0.002")
        })?;
        let u95 = number.trim().parse::<f32>().ok().filter(|v| v.is_finite() && *v > 0.0).ok_or_else(|| {
            format!("--until {word}: {number:?} is no positive number; relative uncertainties are not supported")
        })?;
        let selected = select(parameters, &[name.to_owned()]).map_err(|error| match error {
            SelectionError::NoOffset => {
                format!(
                    "--until {word}: the rig file states the offset, so it is not estimated; leave it out"
                )
            }
            error @ SelectionError::Unknown { .. } => {
                format!("--until {word}: {}", error.to_string().trim_start_matches("--estimate "))
            }
        })?;
        let name = name.trim();
        if asked.iter().any(|(other, ..)| *other == name) {
            return Err(format!("--until {word}: {name} has a limit already; give each name once"));
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
        return Err(format!(
            "--until: the device takes {MAX_STOP_LIMITS} different uncertainties, and these are {}",
            limits.len()
        ));
    }
    let limits = limits.into_iter().collect();
    Ok(Some(StopRule { limits, minimum_blocks: MINIMUM_BLOCKS, goes_on: false }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_fit::{Kind, Owner};

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

    #[test]
    fn names_and_groups_become_limits_and_anything_else_is_said() {
        let words = |text: &str| text.split(',').map(str::to_owned).collect::<Vec<_>>();
        let rule = |text: &str| stop_rule(&words(text), &parameters(16));
        let stop = rule("I=0.002,m=0.01,Ixx=0.001").unwrap().unwrap();
        let asked: Vec<Option<f32>> = (0..11).map(|j| stop.u95(j)).collect();
        assert_eq!(asked[..5], [Some(0.01), None, None, None, Some(0.001)]);
        assert_eq!(asked[5..], [[Some(0.002); 5].as_slice(), &[None]].concat());
        let again = rule("Ixx=0.001,m=0.01,I=0.002").unwrap().unwrap();
        assert!((0..16).all(|j| again.u95(j) == stop.u95(j)));
        for (text, part) in [
            ("m=1,m=2", "m has a limit already"),
            ("Ixx", "as Ixx=0.002"),
            ("m=-1", "no positive number"),
            ("m=1%", "relative"),
            ("J=1", "no parameter"),
        ] {
            let error = rule(text).unwrap_err();
            assert!(error.starts_with("--until ") && error.contains(part), "{error}");
        }
        let known = stop_rule(&words("offset=1"), &parameters(10)).unwrap_err();
        assert!(known.contains("the rig file states the offset"), "{known}");
        assert_eq!(stop_rule(&[], &parameters(16)), Ok(None));
    }
}
