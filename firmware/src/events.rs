//! The last events, in memory that a reset leaves alone.
//!
//! An event is three words: its number and how often it happened in a row, its time, and what happened with
//! the CRC of all. Nothing else is kept: which one is the newest is seen from the numbers, a reset in the
//! middle of writing loses one event, and what the memory holds when power comes on is none.

use core::sync::atomic::{AtomicU32, Ordering};

use crc::{CRC_16_IBM_3740, Crc};
use heapless::Vec;
use rigident_shared::wire::{EventCode, EventMessage, EventReport, MAX_EVENTS};

const CRC16: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);
const WORDS: usize = 3;
/// Events have numbers of 24 bits; the other eight say how often.
const COUNT_BITS: u32 = 8;
const NUMBERS: u32 = 1 << (32 - COUNT_BITS);

/// Room for the events. A board puts it where a start does not initialise memory: every bit pattern is a
/// value.
pub struct EventRoom([[AtomicU32; WORDS]; MAX_EVENTS]);

impl EventRoom {
    /// Returns room in which nothing has happened.
    pub const fn empty() -> Self {
        Self([const { [const { AtomicU32::new(0) }; WORDS] }; MAX_EVENTS])
    }

    /// Forgets all events, as memory does that loses its power.
    pub fn forget(&self) {
        self.0.iter().flatten().for_each(|word| word.store(0, Ordering::Relaxed));
    }

    /// Returns the event of this place with its number, if what is there is one.
    fn read(&self, place: usize) -> Option<(u32, EventMessage)> {
        let [numbered, time_ms, content] =
            self.0.get(place)?.each_ref().map(|word| word.load(Ordering::Relaxed));
        let (number, count) = (numbered >> COUNT_BITS, numbered as u8);
        let [code, detail, ..] = content.to_be_bytes();
        let is_one = number as usize % MAX_EVENTS == place
            && count > 0
            && content as u16 == check(numbered, time_ms, content);
        is_one.then_some((number, EventMessage { time_ms, code, detail, count }))
    }

    fn write(&self, number: u32, event: &EventMessage) {
        let numbered = number << COUNT_BITS | u32::from(event.count);
        let content = u32::from_be_bytes([event.code, event.detail, 0, 0]);
        let content = content | u32::from(check(numbered, event.time_ms, content));
        let words = [numbered, event.time_ms, content];
        for (slot, word) in self.0.iter().skip(number as usize % MAX_EVENTS).take(1).flatten().zip(words) {
            slot.store(word, Ordering::Relaxed);
        }
    }
}

fn check(numbered: u32, time_ms: u32, content: u32) -> u16 {
    let mut digest = CRC16.digest();
    digest.update(&numbered.to_le_bytes());
    digest.update(&time_ms.to_le_bytes());
    digest.update(&content.to_be_bytes()[..2]);
    digest.finalize()
}

/// Notes events where a board has room for them.
#[derive(Clone, Copy, Default)]
pub(crate) struct Events {
    room: Option<&'static EventRoom>,
    /// Number of the next event.
    next: u32,
}

impl Events {
    /// Goes on behind the newest event of this room.
    pub(crate) fn go_on(room: &'static EventRoom) -> Self {
        // Less than half the range behind another one, across their wrap, is before it.
        let later = |a: u32, b: u32| if b.wrapping_sub(a) % NUMBERS < NUMBERS / 2 { b } else { a };
        let found = (0..MAX_EVENTS).filter_map(|place| room.read(place));
        let newest = found.map(|(number, _)| number).reduce(later);
        Self { room: Some(room), next: newest.map_or(0, |number| (number + 1) % NUMBERS) }
    }

    /// Notes an event; one that is like the newest counts as that one again.
    #[cold]
    #[inline(never)]
    pub(crate) fn note(&mut self, now_ns: u64, code: EventCode, detail: u8) {
        let Some(room) = self.room else { return };
        let time_ms = (now_ns / 1_000_000) as u32;
        let event = EventMessage { time_ms, code: code as u8, detail, count: 1 };
        let before = self.next.wrapping_sub(1) % NUMBERS;
        match room.read(before as usize % MAX_EVENTS) {
            Some((number, last))
                if number == before
                    && (last.code, last.detail) == (event.code, detail)
                    && code != EventCode::Started =>
            {
                room.write(number, &EventMessage { count: last.count.saturating_add(1), ..event });
            }
            _ => {
                room.write(self.next, &event);
                self.next = (self.next + 1) % NUMBERS;
            }
        }
    }

    /// Returns the events, oldest first: those whose numbers lead up to the newest.
    pub(crate) fn report(&self) -> EventReport {
        let mut events = Vec::new();
        if let Some(room) = self.room {
            for back in (1..=MAX_EVENTS as u32).rev() {
                let number = self.next.wrapping_sub(back) % NUMBERS;
                let event = room.read(number as usize % MAX_EVENTS).filter(|(found, _)| *found == number);
                if let Some((_, event)) = event {
                    // There is room for as many.
                    let _ = events.push(event);
                }
            }
        }
        EventReport { events }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::boxed::Box;

    use super::*;

    fn room() -> &'static EventRoom {
        Box::leak(Box::new(EventRoom::empty()))
    }

    fn details(events: &Events) -> std::vec::Vec<u8> {
        events.report().events.iter().map(|event| event.detail).collect()
    }

    #[test]
    fn the_last_32_are_kept_in_order_across_starts() {
        let room = room();
        for start in 0..40_u8 {
            // Each start goes on where the last one was.
            let mut events = Events::go_on(room);
            events.note(u64::from(start) * 1_000_000_000, EventCode::Started, start);
            let expected: std::vec::Vec<u8> = (start.saturating_sub(31)..=start).collect();
            assert_eq!(details(&events), expected);
        }
        assert_eq!(Events::go_on(room).report().events.first().map(|e| e.time_ms), Some(8_000));
    }

    #[test]
    fn numbers_wrap_without_losing_the_order() {
        let room = room();
        let mut events = Events { room: Some(room), next: NUMBERS - 5 };
        for detail in 0..20 {
            events.note(0, EventCode::Refused, detail);
        }
        assert_eq!(events.next, 15);
        assert_eq!(details(&Events::go_on(room)), (0..20).collect::<std::vec::Vec<u8>>());
    }

    #[test]
    fn the_same_again_is_counted_and_takes_no_room() {
        let mut events = Events::go_on(room());
        events.note(1_000_000, EventCode::Started, 0);
        for k in 0..300_u64 {
            events.note(k * 1_000_000, EventCode::Lost, 1);
        }
        events.note(0, EventCode::Lost, 2);
        // Starts are noted one by one.
        events.note(0, EventCode::Started, 4);
        events.note(0, EventCode::Started, 4);
        let report = events.report().events;
        assert_eq!(report.iter().map(|e| e.count).collect::<std::vec::Vec<_>>(), [1, 255, 1, 1, 1]);
        assert_eq!(report[1].time_ms, 299);
    }

    #[test]
    fn one_flipped_bit_anywhere_loses_that_event_and_no_other() {
        for (word, bit) in (0..WORDS).flat_map(|word| (0..32).map(move |bit| (word, bit))) {
            let room = room();
            let mut events = Events::go_on(room);
            (0..40).for_each(|detail| events.note(7_000_000, EventCode::Refused, detail));
            room.0[3][word].fetch_xor(1 << bit, Ordering::Relaxed);
            // Event 35 is at place 3.
            let expected: std::vec::Vec<u8> = (8..40).filter(|k| *k != 35).collect();
            assert_eq!(details(&events), expected, "word {word}, bit {bit}");
            assert_eq!(details(&Events::go_on(room)), expected, "word {word}, bit {bit}");
        }
    }

    #[test]
    fn random_memory_at_power_on_is_no_event() {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 32) as u32
        };
        for _ in 0..2_000 {
            let room =
                EventRoom(core::array::from_fn(|_| core::array::from_fn(|_| AtomicU32::new(random()))));
            assert!((0..MAX_EVENTS).all(|place| room.read(place).is_none()));
        }
        let room = EventRoom(core::array::from_fn(|_| core::array::from_fn(|_| AtomicU32::new(u32::MAX))));
        assert!((0..MAX_EVENTS).all(|place| room.read(place).is_none()));
    }
}
