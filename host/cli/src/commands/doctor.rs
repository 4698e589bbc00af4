use std::process::ExitCode;

use serde_json::json;

use crate::commands::device_arguments::Doctor;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure};
use rigident::device::doctor::{Advice, Check, Standing, UDEV_RULE, all};

/// Runs `rigident doctor`.
pub(crate) fn run(arguments: &Doctor) -> Result<ExitCode, Failure> {
    if arguments.udev_rule {
        say(UDEV_RULE.trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    let checks = all(arguments.device.port.as_deref(), &mut |what| tell!("{what}"));
    let good = checks.iter().all(|check| check.standing != Standing::ToDo);
    if arguments.json {
        let checks: Vec<_> = checks.iter().map(object).collect();
        say(json!({ "ok": good, "checks": checks }));
    } else {
        checks.iter().for_each(|check| say(line(check)));
    }
    Ok(ExitStatus::of(good).into())
}

/// Words an advice.
fn words(advice: &Advice) -> &str {
    match advice {
        Advice::InstallRule => {
            "`rigident doctor --udev-rule | sudo tee /etc/udev/rules.d/60-rigident.rules`, then `sudo \
             udevadm control --reload && \
             sudo udevadm trigger`"
        }
        Advice::InstallEmulator => {
            "`apt install qemu-system-arm`, or `cargo xtask setup`; only `--mcu qemu` needs it"
        }
        Advice::BuildImage => "`cargo xtask firmware`; only `--mcu qemu` needs it",
        Advice::Words(words) => words,
    }
}

fn object(check: &Check) -> serde_json::Value {
    let mut object = json!({ "what": check.what, "standing": check.standing, "found": check.found });
    if let Some(advice) = &check.advice {
        object["advice"] = words(advice).into();
    }
    object
}

fn line(check: &Check) -> String {
    let standing = match check.standing {
        Standing::Ok => "ok",
        Standing::ToDo => "to do",
        Standing::NotHere => "not here",
    };
    let advice =
        check.advice.as_ref().map_or_else(String::new, |advice| format!("\n{:24}{}", "", words(advice)));
    format!("{standing:<9} {:<13} {}{advice}", check.what, check.found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_line_has_its_verdict_and_advice() {
        let check =
            |what, standing, found: &str, advice| Check { what, standing, found: found.to_owned(), advice };
        let ok = check("emulator", Standing::Ok, "QEMU 7.2.1", None);
        assert_eq!(line(&ok), "ok        emulator      QEMU 7.2.1");
        let to_do = check("udev", Standing::ToDo, "no rule", Some("install it".into()));
        assert_eq!(line(&to_do), "to do     udev          no rule\n                        install it");
    }
}
