//! The last events of a device, kept in memory that survives a reset.
//!
//! An event travels as numbers, so that a host that is older than the device can show those that it has no
//! word for.

use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{Reason, ResetReason, SensorFault, StateName};

/// Events that a device keeps at most.
pub const MAX_EVENTS: usize = 32;

/// The events that a device keeps, oldest first.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct EventReport {
    /// The events; none of a device whose memory survives no reset.
    pub events: Vec<EventMessage, MAX_EVENTS>,
}

/// An event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct EventMessage {
    /// Time since its program had started, ms; of the last one where there were several in a row.
    pub time_ms: u32,
    /// The code of the event: see [`EventCode`].
    pub code: u8,
    /// A detail of the event; its meaning depends on the code.
    pub detail: u8,
    /// Times that it happened in a row; 255 means 255 or more.
    pub count: u8,
}

/// Tells what happened. The numbers stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum EventCode {
    /// A program started; the detail is the number of the [`ResetReason`].
    Started = 1,
    /// The state became idle; of this and the other states the detail is [`number_of_reason`].
    Idle = 2,
    /// The state became configured.
    Configured = 3,
    /// The state became running.
    Running = 4,
    /// The state became holding.
    Holding = 5,
    /// The state became fault.
    Fault = 6,
    /// A command was refused; the detail is the number of the error.
    Refused = 7,
    /// Samples were lost; the detail is the sensor: 0 load cell, 1 IMU, 2 second IMU.
    Lost = 8,
    /// There was no room for bytes from the host.
    Overrun = 9,
    /// Transfers with sensors did not end, or failed.
    Transfers = 10,
    /// The host asked for a restart.
    Restart = 11,
}

impl EventCode {
    const ALL: [Self; 11] = [
        Self::Started,
        Self::Idle,
        Self::Configured,
        Self::Running,
        Self::Holding,
        Self::Fault,
        Self::Refused,
        Self::Lost,
        Self::Overrun,
        Self::Transfers,
        Self::Restart,
    ];

    /// Returns the code of this number; `None` if it is a newer device's.
    pub fn of(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|code| *code as u8 == number)
    }

    /// Returns the code of the event that this state began.
    pub const fn of_state(state: StateName) -> Self {
        match state {
            StateName::Idle => Self::Idle,
            StateName::Configured => Self::Configured,
            StateName::Running => Self::Running,
            StateName::Holding => Self::Holding,
            StateName::Fault => Self::Fault,
        }
    }
}

const REASONS: [Reason; 5] =
    [Reason::Boot, Reason::Command, Reason::HostQuiet, Reason::StopRule, Reason::LevelFull];
const FAULTS: [SensorFault; 10] = [
    SensorFault::Bus,
    SensorFault::WrongId,
    SensorFault::Verify,
    SensorFault::Check,
    SensorFault::Restarted,
    SensorFault::Rate,
    SensorFault::Silent,
    SensorFault::Resynced,
    SensorFault::Stale,
    SensorFault::Excitation,
];
const RESETS: [ResetReason; 9] = [
    ResetReason::PowerOn,
    ResetReason::BrownOut,
    ResetReason::Pin,
    ResetReason::Software,
    ResetReason::Watchdog,
    ResetReason::Panic,
    ResetReason::Fault,
    ResetReason::ClockLost,
    ResetReason::Unknown,
];

/// Returns the number of a reason as the detail of an event: below 16 it is none of a sensor's, else 16 for
/// each sensor and its fault.
pub fn number_of_reason(reason: Reason) -> u8 {
    let of = |sensor: u8, fault: SensorFault| {
        16 * sensor + FAULTS.iter().position(|f| *f == fault).unwrap_or(15) as u8
    };
    match reason {
        Reason::LoadCell(fault) => of(1, fault),
        Reason::Imu(fault) => of(2, fault),
        Reason::SecondImu(fault) => of(3, fault),
        Reason::Frames(fault) => of(4, fault),
        other => REASONS.iter().position(|r| *r == other).unwrap_or(15) as u8,
    }
}

/// Returns the reason of that number; `None` if it is a newer device's.
pub fn reason_of(number: u8) -> Option<Reason> {
    let (sensor, rest) = (number / 16, usize::from(number % 16));
    let fault = FAULTS.get(rest).copied();
    match sensor {
        0 => REASONS.get(rest).copied(),
        1 => fault.map(Reason::LoadCell),
        2 => fault.map(Reason::Imu),
        3 => fault.map(Reason::SecondImu),
        4 => fault.map(Reason::Frames),
        _ => None,
    }
}

/// Returns the number of a reason for a start as the detail of an event.
pub fn number_of_reset(reset: ResetReason) -> u8 {
    RESETS.iter().position(|r| *r == reset).unwrap_or(RESETS.len()) as u8
}

/// Returns the reason for a start of that number; `None` if it is a newer device's.
pub fn reset_of(number: u8) -> Option<ResetReason> {
    RESETS.get(usize::from(number)).copied()
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    #[test]
    fn numbers_are_those_that_were_given_out_and_lead_back() {
        for (reason, number) in [
            (Reason::Boot, 0),
            (Reason::LevelFull, 4),
            (Reason::LoadCell(SensorFault::Bus), 16),
            (Reason::Imu(SensorFault::Silent), 38),
            (Reason::Frames(SensorFault::Excitation), 73),
        ] {
            assert_eq!((number_of_reason(reason), reason_of(number)), (number, Some(reason)));
        }
        assert_eq!([5, 15, 26, 79, 80, 255].map(reason_of), [None; 6]);
        assert_eq!((number_of_reset(ResetReason::Unknown), reset_of(8)), (8, Some(ResetReason::Unknown)));
        assert_eq!(reset_of(9), None);
        let codes: std::vec::Vec<u8> = (0..=255).filter(|n| EventCode::of(*n).is_some()).collect();
        assert_eq!(codes, (1..=11).collect::<std::vec::Vec<u8>>());
    }
}
