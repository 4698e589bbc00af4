//! The firmware's messages to a debugger: changes of state and refusals, through `defmt` where that feature
//! is on.
//!
//! Not for the sample path: a message is written with interrupts masked.

use rigident_shared::wire::{ErrorCode, Reason, StateName};

#[cfg(not(feature = "defmt"))]
pub(crate) fn state(_: StateName, _: Reason) {}

#[cfg(not(feature = "defmt"))]
pub(crate) fn refused(_: ErrorCode) {}

#[cfg(feature = "defmt")]
pub(crate) fn state(state: StateName, reason: Reason) {
    let name = match state {
        StateName::Idle => "idle",
        StateName::Configured => "configured",
        StateName::Running => "running",
        StateName::Holding => "holding",
        StateName::Fault => "fault",
    };
    match reason {
        Reason::Boot => defmt::info!("{=str}: power came on", name),
        Reason::Command => defmt::info!("{=str}: commanded", name),
        Reason::HostQuiet => defmt::warn!("{=str}: the host is quiet", name),
        Reason::StopRule => defmt::info!("{=str}: the uncertainty asked for is reached", name),
        Reason::LoadCell(fault) => defmt::error!("{=str}: load cell, {=str}", name, fault_name(fault)),
        Reason::Imu(fault) => defmt::error!("{=str}: IMU, {=str}", name, fault_name(fault)),
        Reason::SecondImu(fault) => defmt::error!("{=str}: second IMU, {=str}", name, fault_name(fault)),
        Reason::Frames(fault) => defmt::error!("{=str}: frames, {=str}", name, fault_name(fault)),
        Reason::LevelFull => defmt::warn!("{=str}: the level is full", name),
    }
}

#[cfg(feature = "defmt")]
pub(crate) fn refused(error: ErrorCode) {
    defmt::warn!("a command was refused: error {=u16}", error.number());
}

#[cfg(feature = "defmt")]
fn fault_name(fault: rigident_shared::wire::SensorFault) -> &'static str {
    use rigident_shared::wire::SensorFault;
    match fault {
        SensorFault::Bus => "the bus failed",
        SensorFault::WrongId => "another chip answers",
        SensorFault::Verify => "a register does not hold",
        SensorFault::Check => "check sums do not fit",
        SensorFault::Restarted => "it restarted by itself",
        SensorFault::Rate => "it has no such rate",
        SensorFault::Silent => "it gives no new samples",
        SensorFault::Resynced => "its filters began anew",
        SensorFault::Stale => "it brings the same sample again",
        SensorFault::Excitation => "its gauges' excitation is missing",
    }
}
