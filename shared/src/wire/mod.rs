//! The messages between host and device, and how they travel.
//!
//! Lives here: framing and checks ([`frame`]), the messages ([`messages`]), the sensor bus of emulated boards
//! ([`bus`]), frames of a tree in motion ([`tree_frame`]) and of a robot that is watched ([`watch_frame`]).
//! May not live here: mathematics, I/O, a clock. Next: the firmware's `link` and the host's.
//!
//! One frame on the line:
//!
//! | part | bytes | |
//! |---|---|---|
//! | COBS of: | | no zero inside, so a zero ends the frame and any loss is over with the next zero |
//! | · protocol version | 1 | outside postcard: it can be read whatever the schema |
//! | · kind | 1 | 0 command, 1 answer, 2 telemetry, 3 frame of a robot that is watched |
//! | · sequence number | 2 | little-endian; an answer repeats its command's, telemetry and frames count by themselves |
//! | · payload | 0–1024 | postcard; of a frame [`watch_frame`] |
//! | · CRC-32 | 4 | little-endian, ISO-HDLC, over everything before it |
//! | zero | 1 | |
//!
//! A command that is not answered is sent again with the same number; the device answers a repeat from memory
//! and does not act twice. A frame is not answered: the device counts what became of it ([`StreamReport`]).

pub mod bus;
pub mod events;
pub mod frame;
pub mod links;
pub mod messages;
pub mod tree_frame;
pub mod watch;
pub mod watch_frame;

pub use events::{
    EventCode, EventMessage, EventReport, MAX_EVENTS, number_of_reason, number_of_reset, reason_of, reset_of,
};
pub use frame::{DecodeError, Decoder, Frame, Kind, encode, encode_payload};
pub use links::*;
pub use messages::*;
pub use watch::*;
pub use watch_frame::WatchFrame;

/// Counts what is missing from a numbered series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GapCounter {
    next: Option<u32>,
    /// Numbers that never arrived.
    pub missing: u32,
    /// Stretches of missing numbers.
    pub gaps: u32,
}

impl GapCounter {
    /// Notes `count` items, the first of which has number `first`. How many were missing before it.
    pub fn note(&mut self, first: u32, count: u32) -> u32 {
        let missing = match self.next {
            // Further back than half the range is a repeat or a restart, not a gap.
            Some(next) if first.wrapping_sub(next) < u32::MAX / 2 => first.wrapping_sub(next),
            _ => 0,
        };
        self.next = Some(first.wrapping_add(count));
        self.missing = self.missing.saturating_add(missing);
        self.gaps = self.gaps.saturating_add(u32::from(missing > 0));
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_rule_asks_for_the_least_uncertainty_of_a_parameter() {
        let limit = |u95, parameters: &[usize]| {
            let mut limit = StopLimit { u95, ..StopLimit::default() };
            parameters.iter().for_each(|j| limit.add(*j));
            limit
        };
        let limits = [limit(0.1, &[0, 8, 127]), limit(0.01, &[8]), limit(0.2, &[128])];
        let rule = StopRule { limits: limits.into_iter().collect(), ..StopRule::default() };
        assert_eq!([0, 1, 8, 127, 128].map(|j| rule.u95(j)), [Some(0.1), None, Some(0.01), Some(0.1), None]);
    }

    #[test]
    fn missing_numbers_are_counted_and_repeats_are_not() {
        let mut counter = GapCounter::default();
        assert_eq!(counter.note(10, 4), 0);
        assert_eq!(counter.note(14, 4), 0);
        assert_eq!(counter.note(20, 4), 2);
        assert_eq!(counter.note(20, 4), 0);
        assert_eq!(counter.note(24, 1), 0);
        assert_eq!((counter.missing, counter.gaps), (2, 1));
    }
}
