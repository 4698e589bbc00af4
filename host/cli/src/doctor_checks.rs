//! The checks of `rigident doctor`, one function each.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use rigident_shared::wire::{Identity, StateName, Telemetry};

use super::doctor_finding::Check;
use super::doctor_sensors::sensors;
use super::experiment::doubtful_clock;
use super::ports::{Answered, answers, state};
use super::simulated;
use rigident::device::link::LinkError;
use rigident::device::permission::ownership;
use rigident::device::ports::{self, Attached, Port};
use rigident::device::session::Session;

/// The rule that lets a user open a board's port without being in a group.
pub(super) const UDEV_RULE: &str = include_str!("../60-rigident.rules");
const UDEV_FOLDERS: [&str; 4] =
    ["/etc/udev/rules.d", "/run/udev/rules.d", "/usr/lib/udev/rules.d", "/lib/udev/rules.d"];
const UDEV_NAME: &str = "60-rigident.rules";
/// The emulator of `--mcu qemu`.
const EMULATOR: &str = "qemu-system-arm";
/// Recordings are dated by the system's clock: 2025-01-01, s.
const EARLIEST_S: u64 = 1_735_689_600;
/// A device's clock is watched for this long.
const CLOCK_S: f64 = 6.0;
/// A crystal is within 100 ppm with years and temperature; an oscillator without one is off by up to 1 % at 25 °C and 4 % elsewhere.
const CRYSTAL_PPM: f64 = 200.0;
/// An error that is known no better than this does not tell an oscillator, which is off by per cents, from a
/// crystal.
const TELLS_PPM: f64 = 5000.0;

/// Checks everything.
pub(super) fn all(port: Option<&str>) -> Vec<Check> {
    let (mut checks, found) = match port {
        // A port that is named is taken for what it is.
        Some(port) => {
            let named = Port { port: port.to_owned(), kind: Attached::Usb, usb: None };
            (Vec::new(), answers(vec![named], false))
        }
        None => match ports::listed() {
            Ok(ports) => (Vec::new(), answers(ports, false)),
            Err(e) => {
                let advice = "is /sys there, and this no bare container?";
                (vec![Check::to_do("ports", format!("they cannot be listed: {e}"), advice)], Vec::new())
            }
        },
    };
    checks.push(ports_found(&found));
    checks.extend(permissions(&found));
    checks.extend(udev(&found));
    checks.push(emulator());
    checks.push(image());
    let (of_device, session) = device(&found);
    checks.push(of_device);
    checks.push(system_clock(SystemTime::now()));
    if let Some((port, mut session)) = session {
        checks.push(sensors(&port, &mut session));
        checks.push(super::device_events::check(&port, &mut session));
        checks.push(device_clock(&port, &mut session));
    }
    checks
}

fn ports_found(found: &[Answered]) -> Check {
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
        let advice = "plug the device in by a cable that carries data; a converter may need its driver; a simulated device: `rigident-sim serve`";
        return Check::not_here("ports", others, advice);
    }
    Check::ok("ports", asked.join(", "))
}

/// Returns whether this user may open the ports; nothing where the system has no groups.
fn permissions(found: &[Answered]) -> Option<Check> {
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
        Check::to_do(WHAT, format!("this user is not in the group {}", owner.group), owner.what_to_do())
    })
}

/// Returns whether the udev rule is installed; Linux has them.
fn udev(found: &[Answered]) -> Option<Check> {
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
    const INSTALL: &str = "`rigident doctor --udev-rule | sudo tee /etc/udev/rules.d/60-rigident.rules`, then `sudo udevadm control --reload && \
                           sudo udevadm trigger`";
    match installed {
        Some((text, path)) if text.trim_end() == UDEV_RULE.trim_end() => {
            Check::ok(WHAT, path.display().to_string())
        }
        Some((_, path)) => Check::to_do(WHAT, format!("{} is another version's", path.display()), INSTALL),
        None if is_needed => Check::to_do(WHAT, format!("no {UDEV_NAME}"), INSTALL),
        None => Check::not_here(
            WHAT,
            format!("no {UDEV_NAME}; needed without the group, or with ModemManager"),
            INSTALL,
        ),
    }
}

fn emulator() -> Check {
    let said = Command::new(EMULATOR).arg("--version").output();
    let said = said.ok().filter(|output| output.status.success());
    match said {
        Some(output) => {
            let text = String::from_utf8_lossy(&output.stdout);
            Check::ok("emulator", text.lines().next().unwrap_or(EMULATOR).trim())
        }
        None => {
            let advice = "`apt install qemu-system-arm`, or `cargo xtask setup`; only `--mcu qemu` needs it";
            Check::not_here("emulator", format!("no {EMULATOR} in PATH"), advice)
        }
    }
}

/// Returns whether the image of the emulated board is this version's.
fn image() -> Check {
    const WHAT: &str = "image";
    const BUILD: &str = "`cargo xtask firmware`; only `--mcu qemu` needs it";
    match simulated::greeted_image() {
        Err(why) => Check::not_here(WHAT, why, BUILD),
        Ok((path, Err(LinkError::Silent(_)))) => {
            Check::to_do(WHAT, format!("{}: it does not answer in the emulator", path.display()), BUILD)
        }
        Ok((path, Err(why))) => Check::to_do(WHAT, format!("{}: {why}", path.display()), BUILD),
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
            Check::to_do(WHAT, found, BUILD)
        }
    }
}

/// Returns how the device on these ports is, and a session with it if there is only one.
fn device(found: &[Answered]) -> (Check, Option<(String, Session)>) {
    const WHAT: &str = "device";
    const FLASH: &str = "flash the firmware that belongs to this version of rigident";
    let answered: Vec<(&str, &Identity)> = found
        .iter()
        .filter_map(|(port, answer)| Some((port.port.as_str(), answer.as_ref()?.as_ref().ok()?)))
        .collect();
    let others = found.iter().find(|(_, answer)| state(answer.as_ref()) == "other_firmware");
    match (answered.as_slice(), others) {
        ([(port, identity)], _) => {
            (of_device(port, identity), ports::open(port).ok().map(|s| ((*port).to_owned(), s)))
        }
        ([], Some((port, Some(Err(why))))) => {
            (Check::to_do(WHAT, format!("{}: {why}", port.port), FLASH), None)
        }
        ([], _) => {
            match found.iter().find_map(|(port, answer)| Some((port, answer.as_ref()?.as_ref().err()?))) {
                Some((port, why)) => {
                    (Check::to_do(WHAT, format!("{}: {why}", port.port), "if it is a device's port"), None)
                }
                None => (Check::not_here(WHAT, "none", "see ports"), None),
            }
        }
        (several, _) => {
            let ports: Vec<&str> = several.iter().map(|(port, _)| *port).collect();
            (Check::ok(WHAT, format!("{}; name one by --port to look closer", ports.join(", "))), None)
        }
    }
}

fn of_device(port: &str, identity: &Identity) -> Check {
    let found = format!("{port}: {}, same messages as this program", ports::board(identity));
    if identity.state == StateName::Fault {
        let (reason, fault) = super::device_words::of_reason(identity.reason);
        let what = fault.map_or_else(String::new, |fault| format!(": {}", fault.replace('_', " ")));
        let advice =
            "check the cable and supply of that sensor, and its chip select; then `rigident configure`";
        return Check::to_do(
            "device",
            format!("{found}; fault of {}{what}", reason.replace('_', " ")),
            advice,
        );
    }
    if let Some(doubt) = doubtful_clock(identity.clock) {
        let advice = "the crystal does not start, or is another than the firmware was built for: its solder joints, or the board's feature; docs/wiring.md";
        return Check::to_do("device", format!("{found}; {doubt}"), advice);
    }
    Check::ok("device", found)
}

fn system_clock(now: SystemTime) -> Check {
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

/// The device's clock against this machine's monotonic one, by its heartbeats.
fn device_clock(port: &str, session: &mut Session) -> Check {
    const WHAT: &str = "clocks";
    tell!("{port}: its clock is watched for {CLOCK_S:.0} s");
    let (started, mut beats) = (Instant::now(), Vec::new());
    while started.elapsed().as_secs_f64() < CLOCK_S {
        if let Err(why) = session.client().listen(Duration::from_millis(5)) {
            return Check::to_do(WHAT, format!("{port}: {why}"), "run it again");
        }
        let now_s = started.elapsed().as_secs_f64();
        while let Some(message) = session.client().next_telemetry() {
            if let Telemetry::Heartbeat { time_ns } = message {
                beats.push((now_s, time_ns as f64 * 1e-9));
            }
        }
    }
    judge_drift(port, drift(&beats))
}

fn judge_drift(port: &str, drift: Option<(f64, f64)>) -> Check {
    const WHAT: &str = "clocks";
    let Some((ppm, within)) = drift else {
        return Check::to_do(
            WHAT,
            format!("{port}: too few heartbeats came"),
            "is it running, or another program on the port?",
        );
    };
    let found = format!("{port}: its clock against this machine's {ppm:+.0} ± {within:.0} ppm");
    if ppm.abs() - within > CRYSTAL_PPM {
        let advice = "that is no crystal's: it did not start, or is not the one that the firmware was built for; rates and times are off by as much";
        Check::to_do(WHAT, found, advice)
    } else if within > TELLS_PPM {
        let advice =
            "that tells nothing: its messages come too unevenly; look again when this machine has less to do";
        Check::not_here(WHAT, found, advice)
    } else {
        Check::ok(WHAT, found)
    }
}

/// Drift of a clock and its 95 % uncertainty, ppm: the slope of the least-squares line through times here and there, s, and
/// what the scatter of the arrivals lets it be off by; a millisecond of scatter at least.
fn drift(beats: &[(f64, f64)]) -> Option<(f64, f64)> {
    const LEAST_SCATTER_S: f64 = 1e-3;
    let n = beats.len();
    if n < 4 {
        return None;
    }
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| beats.iter().map(f).sum::<f64>() / n as f64;
    let (here, there) = (mean(&|b| b.0), mean(&|b| b.1));
    let spread: f64 = beats.iter().map(|b| (b.1 - there).powi(2)).sum();
    let delay = |b: &(f64, f64)| (b.0 - here) - (b.1 - there);
    // Delays against the device's time: their slope is what it is slow by.
    let slope = beats.iter().map(|b| (b.1 - there) * delay(b)).sum::<f64>() / spread;
    if !slope.is_finite() {
        return None;
    }
    let rest: f64 = beats.iter().map(|b| (delay(b) - slope * (b.1 - there)).powi(2)).sum();
    let scatter = (rest / (n - 2) as f64).sqrt().max(LEAST_SCATTER_S);
    let t = rigident_fit::Noise::Estimated { degrees_of_freedom: (n - 2) as f64 }.coverage_factor();
    Some((-slope * 1e6, t * scatter / spread.sqrt() * 1e6))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor_finding::Standing;

    #[test]
    fn a_clock_that_runs_fast_is_told_from_arrivals_that_scatter() {
        // 1 % fast, delays of 0 to 4 ms.
        let beats = |rate: f64| -> Vec<(f64, f64)> {
            (0..6).map(|k| (f64::from(k) / rate + 1e-3 * f64::from(k * 7 % 5), f64::from(k))).collect()
        };
        let (ppm, within) = drift(&beats(1.01)).unwrap();
        assert!((ppm - 1e4).abs() < within && within < 3000.0, "{ppm} {within}");
        let (ppm, within) = drift(&beats(1.0)).unwrap();
        assert!(ppm.abs() < within, "{ppm} {within}");
        assert_eq!((drift(&beats(1.0)[..3]), drift(&[(1.0, 5.0); 5])), (None, None));
    }

    #[test]
    fn a_clock_is_called_good_only_where_that_is_known() {
        let standing = |drift| judge_drift("/dev/ttyACM0", drift).standing;
        assert_eq!(standing(Some((20.0, 300.0))), Standing::Ok);
        assert_eq!(standing(Some((9_000.0, 300.0))), Standing::ToDo);
        assert_eq!(standing(Some((-100_000.0, 140_000.0))), Standing::NotHere);
        assert_eq!(standing(None), Standing::ToDo);
    }

    #[test]
    fn a_rule_of_another_version_is_to_be_replaced_and_none_is_no_fault_where_the_port_opens() {
        let path = || PathBuf::from("/etc/udev/rules.d/60-rigident.rules");
        assert_eq!(judge_udev(Some((UDEV_RULE.to_owned(), path())), true).standing, Standing::Ok);
        assert_eq!(judge_udev(Some(("# old".to_owned(), path())), false).standing, Standing::ToDo);
        assert_eq!(judge_udev(None, false).standing, Standing::NotHere);
        let to_do = judge_udev(None, true);
        assert!(to_do.standing == Standing::ToDo && to_do.advice.unwrap().contains("--udev-rule"));
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
    fn a_system_clock_that_was_never_set_is_told() {
        assert_eq!(system_clock(UNIX_EPOCH).standing, Standing::ToDo);
        assert_eq!(system_clock(UNIX_EPOCH + Duration::from_secs(EARLIEST_S)).standing, Standing::Ok);
    }
}
