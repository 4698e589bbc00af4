use std::process::ExitCode;

use super::arguments::Doctor;
use super::doctor_checks::{self, UDEV_RULE};
use super::doctor_finding::{Check, Standing};
use super::outcome::say;
use super::{ExitStatus, Failure};

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
