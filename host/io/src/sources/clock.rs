//! The rate of a source's clock against this computer's, by the arrivals of its samples.
//!
//! A sample that was taken at t of its own clock arrives at `a = offset + rate · t + delay`, and delays are
//! never negative but now and then next to nothing. So the line that lies below all points (t, a) and closest
//! to them on average is the clock's, but for the least delay: Moon, Skelly and Towsley, "Estimation and
//! removal of clock skew from network delay measurements", INFOCOM
//! 1999. It is the edge of the points' lower convex hull that spans their mean. What is left of the offset,
//!       the least delay of
//! each source, is found from the signals once they are on one time base (`problem::clocks::skew`).

/// Points closer than this are too few for a rate, s.
const LEAST_SPAN_S: f64 = 0.5;

/// Finds the line under the arrivals of one clock.
#[derive(Clone, Debug, Default)]
pub struct ArrivalLine {
    /// Lower hull, by ascending time.
    hull: Vec<(f64, f64)>,
    count: f64,
    sum_s: f64,
}

/// Gives the time of this computer for a time of a source: `offset_s + rate · t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockLine {
    /// At the zero of the source's clock, s.
    pub offset_s: f64,
    /// Seconds here for a second there.
    pub rate: f64,
}

impl ClockLine {
    /// Returns the time here for a time there, ns.
    pub fn here_ns(&self, there_ns: i64) -> i64 {
        let there = there_ns as f64;
        there_ns + (1e9 * self.offset_s + (self.rate - 1.0) * there).round() as i64
    }
}

impl ArrivalLine {
    /// Notes a sample of `own_s` of the source's clock that arrived at `here_s`; times of one source ascend,
    /// those of several that share a clock nearly so.
    pub fn note(&mut self, own_s: f64, here_s: f64) {
        if !own_s.is_finite() || !here_s.is_finite() {
            return;
        }
        (self.count, self.sum_s) = (self.count + 1.0, self.sum_s + own_s);
        if let Some(last) = self.hull.last_mut()
            && own_s <= last.0
        {
            // Of the same instant the earliest arrival tells; an older one tells next to nothing.
            if own_s == last.0 && here_s < last.1 {
                last.1 = here_s;
            }
            return;
        }
        // Cross product of two edges: the middle point goes if the hull would turn the wrong way.
        let above = |a: (f64, f64), b: (f64, f64), c: (f64, f64)| {
            (b.0 - a.0) * (c.1 - a.1) <= (b.1 - a.1) * (c.0 - a.0)
        };
        while let [.., a, b] = self.hull[..]
            && above(a, b, (own_s, here_s))
        {
            self.hull.pop();
        }
        self.hull.push((own_s, here_s));
    }

    /// Returns the line, `None` before anything arrived. Over less than half a second the rate is taken as
    /// one.
    pub fn line(&self) -> Option<ClockLine> {
        let (first, last) = (self.hull.first()?, self.hull.last()?);
        if last.0 - first.0 < LEAST_SPAN_S {
            let offset_s = self.hull.iter().map(|(own, here)| here - own).fold(f64::INFINITY, f64::min);
            return Some(ClockLine { offset_s, rate: 1.0 });
        }
        let mean = self.sum_s / self.count;
        let after = self.hull.partition_point(|(own, _)| *own <= mean).clamp(1, self.hull.len() - 1);
        let (a, b) = (self.hull.get(after - 1)?, self.hull.get(after)?);
        let rate = (b.1 - a.1) / (b.0 - a.0);
        Some(ClockLine { offset_s: a.1 - rate * a.0, rate })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock 40 ppm fast whose samples wait up to 20 ms, exponentially: the line is found to within the
    /// least delays.
    #[test]
    fn offset_and_drift_are_found_under_delays() {
        let (offset, rate) = (1234.5, 1.0 - 40e-6);
        let mut line = ArrivalLine::default();
        let mut seed = 1_u32;
        for k in 0..30_000 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let delay = -0.005 * (1.0 - f64::from(seed >> 8) / f64::from(1 << 24)).max(1e-9).ln();
            let own = f64::from(k) * 1e-3;
            line.note(own, offset + rate * own + delay);
        }
        let found = line.line().unwrap();
        // Of 30 000 exponential delays of mean 5 ms the hull's are a few microseconds, over half a minute.
        assert!((found.rate - rate).abs() < 5e-6, "{:e}", found.rate - rate);
        let at = |line: &ClockLine, own: f64| line.offset_s + line.rate * own;
        assert!((at(&found, 15.0) - (offset + rate * 15.0)).abs() < 2e-5);
        // Below every arrival.
        assert!(line.hull.iter().all(|(own, here)| at(&found, *own) <= here + 1e-9));
    }

    #[test]
    fn little_time_gives_an_offset_alone() {
        let mut line = ArrivalLine::default();
        assert_eq!(line.line(), None);
        for (own, here) in [(0.0, 5.3), (0.1, 5.11), (0.2, 5.4), (0.2, 5.25), (0.15, 9.0), (f64::NAN, 1.0)] {
            line.note(own, here);
        }
        let found = line.line().unwrap();
        assert!((found.offset_s - 5.01).abs() < 1e-12 && found.rate == 1.0);
        assert_eq!(ClockLine { offset_s: 2.0, rate: 1.5 }.here_ns(1_000_000_000), 3_500_000_000);
    }
}
