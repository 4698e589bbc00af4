//! The device: whether it answers, how its sensors' lines and its clock are, what happened to it.

use std::time::{Duration, Instant};

use rigident_shared::wire::{
    BadEnd, Command, CounterReport, EventMessage, Identity, Reply, StateName, Telemetry,
};

use super::Check;
use crate::events;
use crate::ports::{self, Answered, state};
use crate::session::Session;
use crate::words::{self, trouble};

/// A device's clock is watched for this long, s.
pub(super) const CLOCK_S: f64 = 6.0;
/// A crystal is within 100 ppm with years and temperature; an oscillator without one is off by up to 1 % at
/// 25 °C and 4 % elsewhere.
const CRYSTAL_PPM: f64 = 200.0;
/// An error that is known no better than this does not tell an oscillator, which is off by per cents, from a
/// crystal.
const TELLS_PPM: f64 = 5000.0;
/// A stack that has been deeper than this part of its size is not to be trusted with what has not happened
/// yet.
const DEEP: f64 = 0.95;
/// The newest events that are shown.
const SHOWN: usize = 8;

/// Returns how the device on these ports is, and a session with it if there is only one.
pub(super) fn device(found: &[Answered]) -> (Check, Option<(String, Session)>) {
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
            (Check::ok(WHAT, format!("{}; name one by `port` to look closer", ports.join(", "))), None)
        }
    }
}

fn of_device(port: &str, identity: &Identity) -> Check {
    let found = format!("{port}: {}, same messages as this program", ports::board(identity));
    if identity.state == StateName::Fault {
        let (reason, fault) = words::reason(identity.reason);
        let what = fault.map_or_else(String::new, |fault| format!(": {}", fault.replace('_', " ")));
        let advice = "check the cable and supply of that sensor, and its chip select; then `configure()`";
        return Check::to_do(
            "device",
            format!("{found}; fault of {}{what}", reason.replace('_', " ")),
            advice,
        );
    }
    if let Some(doubt) = words::doubtful_clock(identity.clock) {
        let advice = "the crystal does not start, or is another than the firmware was built for: its solder \
                      joints, or the board's feature; docs/wiring.md";
        return Check::to_do("device", format!("{found}; {doubt}"), advice);
    }
    Check::ok("device", found)
}

/// Returns how the device's clock goes against this machine's monotonic one, by its heartbeats.
pub(super) fn device_clock(port: &str, session: &mut Session) -> Check {
    const WHAT: &str = "clocks";
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
        let advice = "that is no crystal's: it did not start, or is not the one that the firmware was built \
                      for; rates and times are off by as much";
        Check::to_do(WHAT, found, advice)
    } else if within > TELLS_PPM {
        let advice =
            "that says nothing: its messages come too unevenly; look again when this machine has less to do";
        Check::not_here(WHAT, found, advice)
    } else {
        Check::ok(WHAT, found)
    }
}

/// Returns the drift of a clock and its 95 % uncertainty, ppm: the slope of the least-squares line through
/// times here and there, s, and its error by the scatter of the arrivals; a millisecond of scatter at least.
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

/// Returns how the lines between the device and its sensors are, by its counters since the last run began.
pub(super) fn sensors(port: &str, session: &mut Session) -> Check {
    let ended = session.identity().ended;
    match session.client().ask("read the counters", &Command::ReadCounters) {
        Ok(Reply::Counters(counters)) => judge_sensors(port, ended, &counters),
        Ok(_) => Check::to_do("sensors", format!("{port}: it answers with something else"), "run it again"),
        Err(why) => Check::to_do("sensors", format!("{port}: {why}"), "run it again"),
    }
}

fn judge_sensors(port: &str, ended: Option<BadEnd>, counters: &CounterReport) -> Check {
    if ended.is_some() {
        let place = words::bad_end(ended).unwrap_or_default();
        let found = format!("{port}: its last program ended badly: {place}");
        return Check::to_do("sensors", found, "please report this line");
    }
    let [deepest, size] = counters.stack_bytes.map(f64::from);
    if deepest > DEEP * size {
        let found = format!("{port}: its stack has been {deepest} bytes deep, of {size}");
        return Check::to_do("sensors", found, "please report this line");
    }
    // What the rig does to a sensor, a knock or a clipped gauge, is no matter of its line.
    let of_lines = CounterReport {
        load_cell_crc_errors: counters.load_cell_crc_errors,
        load_cell_errors: counters.load_cell_errors,
        load_cell_stale: counters.load_cell_stale,
        load_cell_resyncs: counters.load_cell_resyncs,
        without_excitation: counters.without_excitation,
        overdue_transfers: counters.overdue_transfers,
        failed_transfers: counters.failed_transfers,
        imu_errors: counters.imu_errors,
        second_imu_errors: counters.second_imu_errors,
        lost: counters.lost,
        ..CounterReport::default()
    };
    let found: Vec<String> =
        trouble(&of_lines).iter().map(|(count, what)| format!("{count} {what}")).collect();
    if !found.is_empty() {
        let advice =
            "wires no longer than 20 cm, a common ground, DRDY and SYNC away from drives; docs/wiring.md";
        return Check::to_do("sensors", format!("{port}: samples {}", found.join(", ")), advice);
    }
    let rates: Vec<String> = ["load cell", "IMU", "second IMU"]
        .iter()
        .zip(counters.rate_error_ppm)
        .filter_map(|(name, ppm)| Some(format!("{name} {:+} ppm", ppm?)))
        .collect();
    let rates = if rates.is_empty() { "rates not measured yet".to_owned() } else { rates.join(", ") };
    Check::ok("sensors", format!("{port}: nothing lost or refused; {rates}"))
}

/// Returns the events of a device, those before its last reset included.
pub(super) fn last_events(port: &str, session: &mut Session) -> Check {
    match events::ask(session) {
        Ok(kept) => Check::ok("events", found(port, &kept)),
        Err(why) => Check::to_do("events", format!("{port}: {why}"), "run it again"),
    }
}

fn found(port: &str, kept: &[EventMessage]) -> String {
    if kept.is_empty() {
        return format!("{port}: it keeps none");
    }
    let newest = kept.iter().skip(kept.len().saturating_sub(SHOWN)).map(events::in_words).collect::<Vec<_>>();
    format!("{port}: of {} the last: {}", kept.len(), newest.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Standing;

    #[test]
    fn a_clock_that_runs_fast_is_distinguished_from_arrivals_that_scatter() {
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
    fn a_line_that_picks_something_up_a_deep_stack_and_a_bad_end_are_to_be_seen_to() {
        let rates =
            CounterReport { rate_error_ppm: [Some(-40), Some(900), None], ..CounterReport::default() };
        let good = judge_sensors("port", None, &rates);
        assert_eq!(
            (good.standing, good.found.contains("load cell -40 ppm, IMU +900 ppm")),
            (Standing::Ok, true)
        );
        let knocked = CounterReport { knocks: [3; 6], load_cell_clipped: 2, ..rates };
        assert_eq!(judge_sensors("port", None, &knocked).standing, Standing::Ok);
        for (counters, word) in [
            (CounterReport { load_cell_stale: 4, ..rates }, "4 of the load cell that came again"),
            (CounterReport { overdue_transfers: 1, ..rates }, "1 transfers with sensors that did not end"),
            (CounterReport { stack_bytes: [40_000, 41_000], ..rates }, "40000 bytes deep, of 41000"),
        ] {
            let check = judge_sensors("port", None, &counters);
            assert!(check.standing == Standing::ToDo && check.found.contains(word), "{check:?}");
        }
        let end = BadEnd { pc: 0x0800_1234, ..BadEnd::default() };
        assert!(judge_sensors("port", Some(end), &rates).found.contains("pc 08001234"));
    }

    #[test]
    fn events_are_reported_in_words_and_unknown_ones_by_their_numbers() {
        let event = |time_ms, code, detail, count| EventMessage { time_ms, code, detail, count };
        let all = [
            event(0, 1, 4, 1),
            event(12, 4, 1, 1),
            event(4_250, 8, 1, 3),
            event(5_000, 6, 38, 1),
            event(5_100, 7, 3, 255),
            event(6_000, 99, 7, 1),
        ];
        assert_eq!(
            found("p", &all),
            "p: of 6 the last: 0.000 s started (watchdog); 0.012 s running (command); \
             4.250 s samples lost (IMU), 3 times; 5.000 s fault (imu: silent); \
             5.100 s command refused (error 3), 255 times or more; 6.000 s event 99 (7)"
        );
        assert_eq!(found("p", &[]), "p: it keeps none");
        // The last eight of more.
        let many: Vec<_> = (0..20).map(|k| event(k, 9, 0, 1)).collect();
        assert!(found("p", &many).starts_with("p: of 20 the last: 0.012 s bytes of the host lost"));
    }
}
