//! This computer: its ports and who may open them, the emulator and its image, the clock.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

use super::{Advice, Check};
use crate::link::LinkError;
use crate::microcontroller::greeted_image;
use crate::permission::ownership;
use crate::ports::{Answered, state};

/// The rule that lets a user open a board's port without being in a group.
pub const UDEV_RULE: &str = include_str!("../../60-rigident.rules");
const UDEV_FOLDERS: [&str; 4] =
    ["/etc/udev/rules.d", "/run/udev/rules.d", "/usr/lib/udev/rules.d", "/lib/udev/rules.d"];
const UDEV_NAME: &str = "60-rigident.rules";
/// The emulator of the emulated board.
const EMULATOR: &str = "qemu-system-arm";
/// Recordings are dated by the system's clock: 2025-01-01, s.
const EARLIEST_S: u64 = 1_735_689_600;

/// Returns which ports were asked.
pub(super) fn ports_found(found: &[Answered]) -> Check {
    let asked: Vec<String> = found
        .iter()
        .filter(|(_, answer)| answer.is_some())
        .map(|(port, answer)| format!("{} ({})", port.port, state(answer.as_ref()).replace('_', " ")))
        .collect();
    if asked.is_empty() {
        let others = match found.len() {
            0 => "no serial port".to_owned(),
            1 => format!("no USB serial port; {} is there", found[0].0.port),
            n => format!("no USB serial port; {n} others are there"),
        };
        let advice = "plug the device in by a cable that carries data; a converter may need its driver; a \
                      simulated device: `rigident-sim serve`";
        return Check::not_here("ports", others, advice);
    }
    Check::ok("ports", asked.join(", "))
}

/// Returns whether this user may open the ports; nothing where the system has no groups.
pub(super) fn permissions(found: &[Answered]) -> Option<Check> {
    const WHAT: &str = "permissions";
    if let Some((port, Some(Err(why)))) =
        found.iter().find(|(_, answer)| state(answer.as_ref()) == "no_permission")
    {
        return Some(Check::to_do(WHAT, format!("{} may not be opened", port.port), why.to_string()));
    }
    if found.iter().any(|(_, answer)| matches!(answer, Some(Ok(_)))) {
        return Some(Check::ok(WHAT, "the device's port can be opened"));
    }
    let port = found.first().map_or("/dev/ttyS0", |(port, _)| port.port.as_str());
    let Some(owner) = ownership(port) else {
        return cfg!(target_os = "linux").then(|| {
            Check::not_here(WHAT, "there is no port to look at", "look again with the device plugged in")
        });
    };
    Some(if owner.has_group {
        Check::ok(WHAT, format!("this user may open ports of the group {}", owner.group))
    } else {
        Check::to_do(WHAT, format!("this user is not in the group {}", owner.group), owner.advice())
    })
}

/// Returns whether the udev rule is installed; Linux has them.
pub(super) fn udev(found: &[Answered]) -> Option<Check> {
    if !cfg!(target_os = "linux") {
        return None;
    }
    let installed =
        UDEV_FOLDERS.iter().map(|folder| Path::new(folder).join(UDEV_NAME)).find(|path| path.exists());
    let is_needed = found.iter().any(|(_, answer)| state(answer.as_ref()) == "no_permission");
    Some(judge_udev(
        installed.map(|path| (std::fs::read_to_string(&path).unwrap_or_default(), path)),
        is_needed,
    ))
}

fn judge_udev(installed: Option<(String, PathBuf)>, is_needed: bool) -> Check {
    const WHAT: &str = "udev";
    match installed {
        Some((text, path)) if text.trim_end() == UDEV_RULE.trim_end() => {
            Check::ok(WHAT, path.display().to_string())
        }
        Some((_, path)) => {
            Check::to_do(WHAT, format!("{} is another version's", path.display()), Advice::InstallRule)
        }
        None if is_needed => Check::to_do(WHAT, format!("no {UDEV_NAME}"), Advice::InstallRule),
        None => Check::not_here(
            WHAT,
            format!("no {UDEV_NAME}; needed without the group, or with ModemManager"),
            Advice::InstallRule,
        ),
    }
}

/// Returns whether the emulator is here.
pub(super) fn emulator() -> Check {
    let said = Command::new(EMULATOR).arg("-version").output();
    let said = said.ok().filter(|output| output.status.success());
    match said {
        Some(output) => {
            let text = String::from_utf8_lossy(&output.stdout);
            Check::ok("emulator", text.lines().next().unwrap_or(EMULATOR).trim())
        }
        None => Check::not_here("emulator", format!("no {EMULATOR} in PATH"), Advice::InstallEmulator),
    }
}

/// Returns whether the image of the emulated board is this version's.
pub(super) fn image() -> Check {
    const WHAT: &str = "image";
    match greeted_image() {
        Err(why) => Check::not_here(WHAT, why, Advice::BuildImage),
        Ok((path, Err(LinkError::Silent(_)))) => Check::to_do(
            WHAT,
            format!("{}: it does not answer in the emulator", path.display()),
            Advice::BuildImage,
        ),
        Ok((path, Err(why))) => Check::to_do(WHAT, format!("{}: {why}", path.display()), Advice::BuildImage),
        Ok((path, Ok([image, own]))) if image.firmware_hash == own.firmware_hash => {
            Check::ok(WHAT, format!("{}: answers, made of the sources of this program", path.display()))
        }
        Ok((path, Ok([image, own]))) => {
            let found = format!(
                "{}: made of other sources ({:08x}, this program's are {:08x})",
                path.display(),
                image.firmware_hash,
                own.firmware_hash
            );
            Check::to_do(WHAT, found, Advice::BuildImage)
        }
    }
}

/// Returns whether the system's clock was ever set.
pub(super) fn system_clock(now: SystemTime) -> Check {
    let seconds = now.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let date = humantime::format_rfc3339_seconds(now);
    if seconds < EARLIEST_S {
        return Check::to_do(
            "clocks",
            format!("the system says {date}"),
            "set the date (`timedatectl`): recordings are dated by it",
        );
    }
    Check::ok("clocks", format!("the system says {date}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Standing;

    #[test]
    fn a_rule_of_another_version_is_to_be_replaced_and_none_is_no_fault_where_the_port_opens() {
        let path = || PathBuf::from("/etc/udev/rules.d/60-rigident.rules");
        assert_eq!(judge_udev(Some((UDEV_RULE.to_owned(), path())), true).standing, Standing::Ok);
        assert_eq!(judge_udev(Some(("# old".to_owned(), path())), false).standing, Standing::ToDo);
        assert_eq!(judge_udev(None, false).standing, Standing::NotHere);
        let to_do = judge_udev(None, true);
        assert!(to_do.standing == Standing::ToDo && to_do.advice == Some(Advice::InstallRule));
    }

    #[test]
    fn every_line_of_the_rule_is_one_that_udev_reads() {
        for line in UDEV_RULE.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
            for pair in line.split(", ") {
                let (key, value) = pair.split_once('=').unwrap();
                let value = value.trim_start_matches('=');
                assert!(value.starts_with('"') && value.ends_with('"') && value.len() > 2, "{pair}");
                let name = key.trim_end_matches(['!', '+']).split('{').next().unwrap();
                assert!(
                    ["ACTION", "GOTO", "SUBSYSTEM", "ATTR", "ATTRS", "TAG", "ENV", "LABEL"].contains(&name),
                    "{pair}"
                );
            }
        }
    }

    #[test]
    fn a_system_clock_that_was_never_set_is_reported() {
        assert_eq!(system_clock(UNIX_EPOCH).standing, Standing::ToDo);
        assert_eq!(
            system_clock(UNIX_EPOCH + std::time::Duration::from_secs(EARLIEST_S)).standing,
            Standing::Ok
        );
    }
}
