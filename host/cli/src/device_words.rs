//! Words for the reasons that a device gives.

use rigident_shared::wire::{Reason, ResetReason, SensorFault};

/// Returns a word for a reason, and for what is wrong with a sensor where it is that.
pub(super) fn of_reason(reason: Reason) -> (&'static str, Option<&'static str>) {
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
pub(super) fn of_reset(reset: ResetReason) -> &'static str {
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
