//! The rates at which samples come, by the device's clock.
//!
//! Samples are taken at the times of their signals, and the filters count on the rate that was asked for: a
//! converter whose oscillator has 8.0 instead of 8.192 MHz would make every inertia 2.4 % too large without a
//! word.

/// Signals are counted for this long, ns.
const WINDOW_NS: u64 = 1_000_000_000;
/// Samples that are missing in a row after which the count begins anew: over more the number of periods is
/// not sure.
const MOST_MISSING: u64 = 8;

/// Counts the periods of one sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RateMeter {
    /// Asked for, ns; zero: nothing is.
    period_ns: u32,
    /// Two samples less than this apart are neighbours, ns; zero before the first.
    near_ns: u32,
    last_ns: u64,
    /// The count is over at this time, ns.
    full_ns: u64,
    periods: u32,
    error_ppm: Option<i32>,
}

impl RateMeter {
    /// Returns a meter of samples that should come at this rate, 1/s.
    #[must_use]
    pub fn new(rate_hz: f32) -> Self {
        let period_ns = 1_000_000_000_u32.checked_div(rate_hz as u32).unwrap_or(0);
        Self { period_ns, ..Self::default() }
    }

    /// Returns by how much the rate is higher than the one asked for, parts in a million; `None` before a
    /// second has been counted.
    #[must_use]
    pub const fn error_ppm(&self) -> Option<i32> {
        self.error_ppm
    }

    /// Takes the time of a sample; returns whether a second is full, so that [`Self::error_ppm`] is new.
    #[inline(always)]
    pub fn note(&mut self, time_ns: u64) -> bool {
        let gap_ns = time_ns.wrapping_sub(self.last_ns);
        self.last_ns = time_ns;
        // Of two samples in a row, which nearly all are.
        if gap_ns < u64::from(self.near_ns) {
            self.periods += 1;
            return time_ns >= self.full_ns && self.close();
        }
        self.pass_over(gap_ns);
        false
    }

    /// Passes over a sample if some before it are missing, or it is the first.
    #[cold]
    #[inline(never)]
    fn pass_over(&mut self, gap_ns: u64) {
        let period_ns = u64::from(self.period_ns);
        let periods = gap_ns.saturating_add(period_ns / 2).checked_div(period_ns).unwrap_or(0);
        if self.near_ns == 0 || periods > MOST_MISSING {
            self.begin();
        } else {
            // A few at most, as above.
            self.periods += periods as u32;
        }
    }

    /// Counts from the last sample on.
    fn begin(&mut self) {
        self.near_ns = self.period_ns.saturating_add(self.period_ns / 2);
        self.full_ns = self.last_ns.saturating_add(WINDOW_NS);
        self.periods = 0;
    }

    #[cold]
    #[inline(never)]
    fn close(&mut self) -> bool {
        let took_ns = self.last_ns - self.full_ns.saturating_sub(WINDOW_NS);
        let counted_ns = u64::from(self.periods) * u64::from(self.period_ns);
        // Both are some 10⁹ and their difference is less: no product is larger than 10¹⁶.
        let early_ns = counted_ns.cast_signed() - took_ns.cast_signed();
        self.error_ppm = (early_ns * 1_000_000).checked_div(took_ns.cast_signed()).map(|ppm| ppm as i32);
        self.begin();
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Measures samples of an oscillator that is this much fast, of which those that `keeps` refuses are
    /// lost.
    fn measured(rate_hz: f32, ppm: f64, keeps: impl Fn(u64) -> bool) -> Option<i32> {
        let mut meter = RateMeter::new(rate_hz);
        let period_ns = 1e9 / (f64::from(rate_hz) * (1.0 + 1e-6 * ppm));
        for k in (0..3 * rate_hz as u64).filter(|k| keeps(*k)) {
            // The timer's step is 250 ns.
            let time_ns = 5_000_000_000 + (k as f64 * period_ns / 250.0) as u64 * 250;
            meter.note(time_ns);
        }
        meter.error_ppm()
    }

    #[test]
    fn an_oscillator_that_is_off_shows_within_a_part_in_a_million() {
        for rate_hz in [250.0, 500.0, 1000.0, 2000.0, 4000.0] {
            // The last three: 8.0 instead of 8.192 MHz, the divisor 16256 instead of 16384, the chip's own
            // oscillator.
            for ppm in [0.0, 50.0, -50.0, 499.0, -23_437.5, 7_874.0, 40_000.0] {
                let seen = measured(rate_hz, ppm, |_| true).unwrap();
                assert!((f64::from(seen) - ppm).abs() <= 2.0, "{rate_hz} Hz, {ppm} ppm: {seen}");
            }
        }
    }

    #[test]
    fn samples_that_are_lost_do_not_change_the_rate() {
        for keeps in [|k: u64| k % 10 != 3, |k| k % 100 > 6, |k| !(400..700).contains(&k)] {
            let seen = measured(1000.0, 120.0, keeps).unwrap();
            assert!((seen - 120).abs() <= 2, "{seen}");
        }
    }

    #[test]
    fn nothing_is_said_before_a_second_is_full_nor_of_a_rate_that_is_none() {
        let mut meter = RateMeter::new(1000.0);
        for k in 1..=1000 {
            assert!(!meter.note(k * 1_000_000));
        }
        assert_eq!(meter.error_ppm(), None);
        assert!(meter.note(1_001_000_000));
        assert_eq!(meter.error_ppm(), Some(0));
        let mut none = RateMeter::default();
        assert!((0..5000).all(|k| !none.note(k * 1_000_000)));
    }
}
