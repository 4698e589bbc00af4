use std::process::ExitCode;

use serde::Serialize;

use super::arguments::Doctor;
use super::doctor_checks::{self, UDEV_RULE};
use super::outcome::say;
use super::{ExitStatus, Failure};

/// How something stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Standing {
    /// As it should be.
    Ok,
    /// Something is to be done.
    ToDo,
    /// It is not here, and not everybody needs it.
    NotHere,
}

/// What was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Check {
    /// A word: `ports`, `permissions`, `udev`, `emulator`, `image`, `device`, `clocks`.
    pub(super) what: &'static str,
    pub(super) standing: Standing,
    /// What was found.
    pub(super) found: String,
    /// What to do, where something is to be done or could be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) advice: Option<String>,
}

impl Check {
    pub(super) fn ok(what: &'static str, found: impl Into<String>) -> Self {
        Self { what, standing: Standing::Ok, found: found.into(), advice: None }
    }

    pub(super) fn to_do(what: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { what, standing: Standing::ToDo, found: found.into(), advice: Some(advice.into()) }
    }

    pub(super) fn not_here(what: &'static str, found: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { what, standing: Standing::NotHere, found: found.into(), advice: Some(advice.into()) }
    }
}

/// `rigident doctor`
pub(super) fn run(arguments: &Doctor) -> Result<ExitCode, Failure> {
    if arguments.udev_rule {
        say(UDEV_RULE.trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    let checks = doctor_checks::all(arguments.device.port.as_deref());
    let good = checks.iter().all(|check| check.standing != Standing::ToDo);
    if arguments.json {
        say(serde_json::json!({ "ok": good, "checks": checks }));
    } else {
        checks.iter().for_each(|check| say(line(check)));
    }
    Ok(ExitStatus::of(good).into())
}

fn line(check: &Check) -> String {
    let standing = match check.standing {
        Standing::Ok => "ok",
        Standing::ToDo => "to do",
        Standing::NotHere => "not here",
    };
    let advice = check.advice.as_ref().map_or_else(String::new, |advice| format!("\n{:24}{advice}", ""));
    format!("{standing:<9} {:<13} {}{advice}", check.what, check.found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_says_how_it_stands_and_what_to_do() {
        assert_eq!(line(&Check::ok("emulator", "QEMU 7.2.1")), "ok        emulator      QEMU 7.2.1");
        let to_do = line(&Check::to_do("udev", "no rule", "install it"));
        assert_eq!(to_do, "to do     udev          no rule\n                        install it");
    }
}
