use clap::Args;
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::wire::{MAX_PARAMETERS, Settings, StopRule};

use super::Failure;
use crate::answer::assemble::Asked;

/// Row blocks before which the rule is not looked at: a second.
const MINIMUM_BLOCKS: u32 = 100;

/// What the device does while it estimates.
#[derive(Args, Debug, Clone, Default)]
pub struct Course {
    /// End as soon as these have at most these 95 % uncertainties, SI, in the load cell's frame: Ixx=0.002,m=0.01. Any of m,
    /// mc, I, offset, and single names. The device decides; Ctrl-C ends sooner
    #[arg(long, value_name = "NAME=U95", value_delimiter = ',')]
    pub until: Vec<String>,
    /// With --until: report when the uncertainties are reached, but finish the program
    #[arg(long, alias = "go-on", requires = "until")]
    pub keep_going: bool,
}

impl Course {
    /// Puts it into the device's settings.
    ///
    /// # Errors
    /// What cannot be used: bad input.
    pub(super) fn put_into(&self, settings: &mut Settings) -> Result<(), Failure> {
        settings.stop = stop_rule(&self.until).map_err(Failure::input)?;
        let estimated = if settings.load_cell.known_offset_n_nm.is_some() { 10 } else { 16 };
        let beyond = |stop: &StopRule| (estimated..16).find(|j| stop.asked >> j & 1 == 1);
        if let Some(j) = settings.stop.as_ref().and_then(beyond) {
            return Err(Failure::input(format!(
                "--until {}: the rig file states the offset, so it is not estimated; leave it out",
                PARAMETER_NAMES[j]
            )));
        }
        Ok(())
    }
}

fn stop_rule(words: &[String]) -> Result<Option<StopRule>, String> {
    if words.is_empty() {
        return Ok(None);
    }
    let mut limits: Vec<(&str, Vec<usize>, f32)> = Vec::new();
    for word in words {
        let (name, number) = word.split_once('=').ok_or_else(|| {
            format!("--until {word}: a name and its largest 95 % uncertainty in SI units, as Ixx=0.002")
        })?;
        let u95 = number.trim().parse::<f32>().ok().filter(|v| v.is_finite() && *v > 0.0).ok_or_else(|| {
            format!("--until {word}: {number:?} is no positive number; relative uncertainties are not supported")
        })?;
        let Asked(parameters) = Asked::parse(&[name.to_owned()])
            .map_err(|error| format!("--until {word}: {}", error.trim_start_matches("--estimate ")))?;
        let name = name.trim();
        if limits.iter().any(|(other, ..)| *other == name) {
            return Err(format!("--until {word}: {name} has a limit already; give each name once"));
        }
        limits.push((name, parameters, u95));
    }
    // A single name refines its group, wherever it stands.
    limits.sort_by_key(|(_, parameters, _)| std::cmp::Reverse(parameters.len()));
    let mut stop = StopRule { asked: 0, u95: [0.0; MAX_PARAMETERS], minimum_blocks: MINIMUM_BLOCKS };
    for (_, parameters, u95) in limits {
        for j in parameters {
            stop.asked |= 1 << j;
            if let Some(limit) = stop.u95.get_mut(j) {
                *limit = u95;
            }
        }
    }
    Ok(Some(stop))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_groups_become_limits_and_anything_else_is_said() {
        let rule = |text: &str| stop_rule(&text.split(',').map(str::to_owned).collect::<Vec<_>>());
        let stop = rule("I=0.002,m=0.01,Ixx=0.001").unwrap().unwrap();
        assert_eq!(stop.asked, 0b11_1111_0001);
        assert_eq!(stop.u95[..5], [0.01, 0.0, 0.0, 0.0, 0.001]);
        assert_eq!(stop.u95[5..10], [0.002; 5]);
        assert_eq!(rule("Ixx=0.001,m=0.01,I=0.002"), rule("I=0.002,m=0.01,Ixx=0.001"));
        for (text, part) in [
            ("m=1,m=2", "m has a limit already"),
            ("Ixx", "as Ixx=0.002"),
            ("m=-1", "no positive number"),
            ("m=1%", "relative"),
            ("J=1", "no such parameter"),
        ] {
            let error = rule(text).unwrap_err();
            assert!(error.starts_with("--until ") && error.contains(part), "{error}");
        }
        assert_eq!(stop_rule(&[]), Ok(None));
    }
}
