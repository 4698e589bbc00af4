//! A device's report about its sensors' lines, and of how its last program ended.

use rigident::device::session::Session;
use rigident_shared::wire::{BadEnd, Command, CounterReport, Reply};

use super::doctor_finding::Check;
use super::info::of_end;
use super::monitor_watch::trouble;

const WHAT: &str = "sensors";
/// A stack that has been deeper than this part of its size is not to be trusted with what has not happened yet.
const DEEP: f64 = 0.95;

/// Returns how the lines between the device and its sensors are, by its counters since the last run began.
pub(super) fn sensors(port: &str, session: &mut Session) -> Check {
    let ended = session.identity().ended;
    match session.client().ask("read the counters", &Command::ReadCounters) {
        Ok(Reply::Counters(counters)) => judge(port, ended, &counters),
        Ok(_) => Check::to_do(WHAT, format!("{port}: it answers with something else"), "run it again"),
        Err(why) => Check::to_do(WHAT, format!("{port}: {why}"), "run it again"),
    }
}

fn judge(port: &str, ended: Option<BadEnd>, counters: &CounterReport) -> Check {
    if ended.is_some() {
        let place = of_end(ended);
        let found = format!("{port}: its last program ended badly: {}", place.as_str().unwrap_or_default());
        return Check::to_do(WHAT, found, "please report this line");
    }
    let [deepest, size] = counters.stack_bytes.map(f64::from);
    if deepest > DEEP * size {
        let found = format!("{port}: its stack has been {deepest} bytes deep, of {size}");
        return Check::to_do(WHAT, found, "please report this line");
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
        trouble(&of_lines).iter().map(|counted| format!("{} {}", counted.count, counted.what)).collect();
    if !found.is_empty() {
        let advice =
            "wires no longer than 20 cm, a common ground, DRDY and SYNC away from drives; docs/wiring.md";
        return Check::to_do(WHAT, format!("{port}: samples {}", found.join(", ")), advice);
    }
    let rates: Vec<String> = ["load cell", "IMU", "second IMU"]
        .iter()
        .zip(counters.rate_error_ppm)
        .filter_map(|(name, ppm)| Some(format!("{name} {:+} ppm", ppm?)))
        .collect();
    let rates = if rates.is_empty() { "rates not measured yet".to_owned() } else { rates.join(", ") };
    Check::ok(WHAT, format!("{port}: nothing lost or refused; {rates}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor_finding::Standing;

    #[test]
    fn a_line_that_picks_something_up_a_deep_stack_and_a_bad_end_are_to_be_seen_to() {
        let rates =
            CounterReport { rate_error_ppm: [Some(-40), Some(900), None], ..CounterReport::default() };
        let good = judge("port", None, &rates);
        assert_eq!(
            (good.standing, good.found.contains("load cell -40 ppm, IMU +900 ppm")),
            (Standing::Ok, true)
        );
        let knocked = CounterReport { knocks: [3; 6], load_cell_clipped: 2, ..rates };
        assert_eq!(judge("port", None, &knocked).standing, Standing::Ok);
        for (counters, word) in [
            (CounterReport { load_cell_stale: 4, ..rates }, "4 of the load cell that came again"),
            (CounterReport { overdue_transfers: 1, ..rates }, "1 transfers with sensors that did not end"),
            (CounterReport { stack_bytes: [40_000, 41_000], ..rates }, "40000 bytes deep, of 41000"),
        ] {
            let check = judge("port", None, &counters);
            assert!(check.standing == Standing::ToDo && check.found.contains(word), "{check:?}");
        }
        let end = BadEnd { pc: 0x0800_1234, ..BadEnd::default() };
        assert!(judge("port", Some(end), &rates).found.contains("pc 08001234"));
    }
}
