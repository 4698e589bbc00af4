//! The messages of a device in words: its estimate, its states and reasons, its counters, its start.

use rigident_shared::screening::CHANNEL_NAMES;
use rigident_shared::wire::{
    BadEnd, ClockSource, Consistency, CounterReport, EstimateReport, Identity, Reason, ResetReason,
    SensorFault, StateName,
};

/// Parameters of one body with the offset.
const ONE_BODY: usize = 16;
/// Noise alone seldom takes an answer so far from what a body can have, standard deviations.
const DOUBTFUL_SD: f32 = 3.0;

/// Returns what the device's own estimate comes to: its condition, its largest relative standard deviation,
/// and whether a body can have it.
pub fn estimate(report: &EstimateReport) -> String {
    // Against the largest of its kind: a true zero has no relative uncertainty of its own.
    let worst = [0..1, 1..4, 4..10]
        .into_iter()
        .filter_map(|kind| {
            let values = report.estimate.get(kind.clone())?;
            let scale = values.iter().fold(0.0_f32, |s, v| s.max(v.abs()));
            let sds = report.standard_deviation.get(kind)?;
            Some(100.0 * sds.iter().fold(0.0_f32, |s, v| s.max(*v)) / scale)
        })
        .filter(|v| v.is_finite())
        .fold(0.0_f32, f32::max);
    let apart = match report.consistency {
        // Of several links it is never judged.
        Consistency::NotDetermined if report.estimate.len() <= ONE_BODY => {
            ", no body determined yet".to_owned()
        }
        _ if report.distance_sd > DOUBTFUL_SD => format!(", {:.1} sd from any body", report.distance_sd),
        _ => String::new(),
    };
    format!("condition {:.1}, worst relative sd {worst:.1} %{apart}", report.condition_number)
}

/// Returns board, version and hash of a device's firmware, each with its label.
pub fn device_notes(identity: &Identity) -> Vec<(String, String)> {
    let [major, minor, patch] = identity.firmware_version;
    let board: String = identity.board.iter().take_while(|b| **b != 0).map(|b| char::from(*b)).collect();
    vec![
        ("Board".to_owned(), board),
        ("Firmware".to_owned(), format!("{major}.{minor}.{patch}")),
        ("Firmware, hash of its sources".to_owned(), format!("{:08x}", identity.firmware_hash)),
    ]
}

/// Returns the warning of a device whose times are not those of a crystal.
pub fn doubtful_clock(clock: ClockSource) -> Option<String> {
    matches!(clock, ClockSource::Internal | ClockSource::Slow)
        .then(|| format!("the device takes its time from {}", time_from(clock)))
}

/// Returns what started a device.
pub fn started_by(reset: ResetReason) -> &'static str {
    match reset {
        ResetReason::PowerOn => "power coming on",
        ResetReason::BrownOut => "a supply that sagged: look at its cable and what else hangs on it",
        ResetReason::Pin => "the reset pin",
        ResetReason::Software => "its own program",
        ResetReason::Watchdog => "its watchdog, because the program had stopped",
        ResetReason::Panic => "a panic of its program",
        ResetReason::Fault => "a fault of its processor",
        ResetReason::ClockLost => "the loss of its crystal",
        ResetReason::Unknown => "something that it does not say",
    }
}

/// Returns what a device takes its time from.
pub fn time_from(clock: ClockSource) -> &'static str {
    match clock {
        ClockSource::Simulated => "the simulator",
        ClockSource::Crystal => "a crystal",
        ClockSource::Internal => {
            "the chip's own oscillator, because the crystal does not start: off by up to 1 % at 25 °C, 4 % \
             elsewhere"
        }
        ClockSource::Slow => "the chip's own oscillator, unmultiplied: the board is too slow for its sensors",
        ClockSource::Emulated => "the emulator",
    }
}

/// Returns a word for a reason, and for what is wrong with a sensor where it is that.
pub fn reason(reason: Reason) -> (&'static str, Option<&'static str>) {
    match reason {
        Reason::Boot => ("boot", None),
        Reason::Command => ("command", None),
        Reason::HostQuiet => ("host_quiet", None),
        Reason::StopRule => ("stop_rule", None),
        Reason::LoadCell(fault) => ("load_cell", Some(of_fault(fault))),
        Reason::Imu(fault) => ("imu", Some(of_fault(fault))),
        Reason::SecondImu(fault) => ("second_imu", Some(of_fault(fault))),
        Reason::Frames(fault) => ("frames", Some(of_fault(fault))),
        Reason::LevelFull => ("level_full", None),
    }
}

/// Returns a word for why a device started anew.
pub fn reset(reset: ResetReason) -> &'static str {
    match reset {
        ResetReason::PowerOn => "power_on",
        ResetReason::BrownOut => "brown_out",
        ResetReason::Pin => "pin",
        ResetReason::Software => "software",
        ResetReason::Watchdog => "watchdog",
        ResetReason::Panic => "panic",
        ResetReason::Fault => "fault",
        ResetReason::ClockLost => "clock_lost",
        ResetReason::Unknown => "unknown",
    }
}

fn of_fault(fault: SensorFault) -> &'static str {
    match fault {
        SensorFault::Bus => "bus",
        SensorFault::WrongId => "wrong_id",
        SensorFault::Verify => "verify",
        SensorFault::Check => "check",
        SensorFault::Restarted => "restarted",
        SensorFault::Rate => "rate",
        SensorFault::Silent => "silent",
        SensorFault::Resynced => "resynced",
        SensorFault::Stale => "stale",
        SensorFault::Excitation => "excitation",
    }
}

/// Returns where a device's last program ended, in what a person who has its sources can look up; `None` if
/// it did not end badly.
pub fn bad_end(ended: Option<BadEnd>) -> Option<String> {
    let BadEnd { pc, lr, status, address, line, file } = ended?;
    Some(if line > 0 {
        format!("line {line} of the file whose name has the FNV-1a {file:08x}")
    } else {
        format!("pc {pc:08x}, lr {lr:08x}, cfsr {status:08x}, address {address:08x}")
    })
}

/// Returns a word for a state.
pub fn state(state: StateName) -> &'static str {
    match state {
        StateName::Idle => "idle",
        StateName::Configured => "configured",
        StateName::Running => "running",
        StateName::Holding => "holding",
        StateName::Fault => "fault",
    }
}

/// Returns a state with its reason in words.
pub fn phase(state: StateName, reason: Reason) -> String {
    let (why, fault) = self::reason(reason);
    let why = why.replace('_', " ");
    match (state, reason) {
        (StateName::Fault, _) => format!("fault of {why}: {}", fault.unwrap_or_default().replace('_', " ")),
        (StateName::Holding, Reason::StopRule) => "holding: what was asked for is reached".to_owned(),
        (StateName::Holding, Reason::HostQuiet) => "holding: it did not hear its host".to_owned(),
        (state, _) => self::state(state).to_owned(),
    }
}

/// Returns what the counters of a device say of its sensors: how often, and what; nothing that never
/// happened.
pub fn trouble(counters: &CounterReport) -> Vec<(u64, String)> {
    let reason = match counters.last_rejection {
        1 => " (not finite)",
        2 => " (saturated)",
        3 => " (frozen)",
        _ => "",
    };
    let mut found = Vec::new();
    let mut add = |count: u64, what: String| {
        if count > 0 {
            found.push((count, what));
        }
    };
    for (k, (name, count)) in CHANNEL_NAMES.iter().zip(counters.rejected_by_channel).enumerate() {
        let last = if k == usize::from(counters.last_rejected_channel) { reason } else { "" };
        add(count.into(), format!("rejected by {name}{last}"));
    }
    let gauges: Vec<String> =
        (0..8).filter(|gauge| counters.clipped_gauges >> gauge & 1 == 1).map(|g: u8| g.to_string()).collect();
    for (name, count) in CHANNEL_NAMES.iter().zip(counters.knocks) {
        add(count.into(), format!("knocks in {name}"));
    }
    for (count, name) in counters.lost.into_iter().zip(["load cell", "IMU", "second IMU"]) {
        add(count.into(), format!("of the {name} lost, for which the board had no room"));
    }
    for (count, what) in [
        (counters.load_cell_clipped, format!("clipped (gauge {})", gauges.join(", "))),
        (counters.load_cell_crc_errors, "of the load cell with a wrong check sum".to_owned()),
        (counters.load_cell_errors, "of the load cell without a sample".to_owned()),
        (counters.load_cell_stale, "of the load cell that came again".to_owned()),
        (counters.load_cell_resyncs, "of the load cell whose filters began anew".to_owned()),
        (counters.without_excitation, "of the load cell without its excitation".to_owned()),
        (counters.overdue_transfers, "transfers with sensors that did not end".to_owned()),
        (counters.failed_transfers, "transfers with sensors that failed".to_owned()),
        (counters.imu_errors, "of the IMU not read".to_owned()),
        (counters.second_imu_errors, "of the second IMU not read".to_owned()),
        (counters.unaligned, "without an IMU sample beside them".to_owned()),
        (counters.gaps, "gaps".to_owned()),
    ] {
        add(count.into(), what);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_become_words_and_zeros_are_left_out() {
        assert!(trouble(&CounterReport::default()).is_empty());
        let mut counters = CounterReport {
            last_rejection: 2,
            last_rejected_channel: 3,
            gaps: 1,
            load_cell_clipped: 4,
            ..CounterReport::default()
        };
        (counters.rejected_by_channel[3], counters.clipped_gauges) = (5, 0b10);
        let said: Vec<String> =
            trouble(&counters).iter().map(|(count, what)| format!("{count} {what}")).collect();
        let rejected = format!("5 rejected by {} (saturated)", CHANNEL_NAMES[3]);
        assert_eq!(said, [rejected.as_str(), "4 clipped (gauge 1)", "1 gaps"]);
    }
}
