//! Progress of the program: a board feeds its watchdog by it, not by its main loop's turning alone.
//!
//! A sensor that is silent is a fault that the application tells within a quarter of a second, and that no
//! restart heals. What a restart may heal is an application that does not tell it, or a port whose interrupt
//! no longer comes.

/// The time without progress after which the watchdog is no longer fed, ns.
const PATIENCE_NS: u64 = 2_000_000_000;
/// Load cell, IMU, second IMU.
const SENSORS: usize = 3;

/// The progress of its program that a board sees in one turn of the main loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Turn {
    /// The sensors whose samples a run needs now: all false unless it is running.
    pub needed: [bool; SENSORS],
    /// The sensors whose samples the application was given in this turn.
    pub came: [bool; SENSORS],
    /// Bytes that wait for the port's interrupt.
    pub waiting: usize,
}

/// Watches what has gone on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    sampled_ns: [u64; SENSORS],
    waiting: usize,
    sent_ns: u64,
}

impl Progress {
    /// Returns whether everything goes on: the watchdog is to be fed.
    pub fn goes_on(&mut self, now_ns: u64, turn: &Turn) -> bool {
        for ((last_ns, needed), came) in self.sampled_ns.iter_mut().zip(turn.needed).zip(turn.came) {
            if came || !needed {
                *last_ns = now_ns;
            }
        }
        if turn.waiting == 0 || turn.waiting != self.waiting {
            (self.waiting, self.sent_ns) = (turn.waiting, now_ns);
        }
        let late = |last_ns: &u64| now_ns.saturating_sub(*last_ns) > PATIENCE_NS;
        !self.sampled_ns.iter().any(late) && !late(&self.sent_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Returns the first millisecond in which the watchdog is not fed, of ten seconds.
    fn starves(turn: impl Fn(u64) -> Turn) -> Option<u64> {
        let mut progress = Progress::default();
        (0..10_000).find(|ms| !progress.goes_on(ms * MS, &turn(*ms)))
    }

    #[test]
    fn a_loop_that_turns_without_a_needed_sensor_is_not_fed() {
        let both = [true, true, false];
        let all_comes = |_| Turn { needed: both, came: both, waiting: 0 };
        let imu_stops = |ms| Turn { needed: both, came: [true, ms < 1000, false], waiting: 0 };
        let not_running = |_| Turn::default();
        assert_eq!([starves(all_comes), starves(imu_stops), starves(not_running)], [None, Some(3000), None]);
        // A run that begins late has its time.
        let begins =
            |ms| Turn { needed: [ms >= 5000, false, false], came: [ms >= 6500, false, false], waiting: 0 };
        assert_eq!(starves(begins), None);
    }

    #[test]
    fn a_port_that_sends_no_more_is_not_fed_and_one_that_has_nothing_to_send_is() {
        let stuck =
            |ms: u64| Turn { waiting: if ms < 4000 { ms as usize % 50 } else { 50 }, ..Turn::default() };
        assert_eq!(starves(stuck), Some(6001));
        assert_eq!(
            starves(|ms| Turn { waiting: if ms % 900 == 0 { 0 } else { 7 }, ..Turn::default() }),
            None
        );
    }
}
