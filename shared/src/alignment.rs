//! Two sensors, two clocks' worth of samples, one row.
//!
//! Lives here: bringing IMU readings to the instants of the load cell. May not live here: filtering. Before
//! this: the drivers; after it: [`crate::estimator`].
//!
//! Capture times come from one clock; each sensor's stated group delay is taken off first. IMU values are
//! interpolated by the cubic through the four readings around the instant: 4e-7 of a 2 Hz signal at 200 Hz.

use crate::Scalar;
use crate::calibration::Reading;
use crate::spatial::{AngularRate, Imu, Sensor, SpecificForce, Wrench};

/// A load-cell sample with its capture time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchReading<T: Scalar> {
    /// Capture time, ns.
    pub time_ns: u64,
    /// Wrench on the body, in S.
    pub wrench: Wrench<Sensor, T>,
}

/// An IMU sample with its capture time, in the IMU's axes, uncorrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuReading<T: Scalar> {
    /// Capture time, ns.
    pub time_ns: u64,
    /// Specific force at the IMU's origin.
    pub specific_force: SpecificForce<Imu, T>,
    /// Angular rate.
    pub angular_rate: AngularRate<Imu, T>,
}

/// Holds what is known of the two sensors' timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AlignerConfig {
    /// Group delay of the load cell's converter and filter, ns.
    pub wrench_delay_ns: u32,
    /// Group delay of the IMU's filters, ns.
    pub imu_delay_ns: u32,
    /// Nominal time between IMU readings, ns; across twice as much nothing is interpolated.
    pub imu_period_ns: u32,
}

const NEIGHBOURS: usize = 4;
const PENDING: usize = 32;

/// Pairs load-cell samples with interpolated IMU values.
#[derive(Clone, Debug)]
pub struct Aligner<T: Scalar> {
    config: AlignerConfig,
    /// One by the nominal time between IMU readings, 1/ns.
    unit: T,
    /// The last four IMU readings, delays taken off; the oldest is at `oldest`, the others follow around.
    around: [ImuReading<T>; NEIGHBOURS],
    oldest: u8,
    filled: u8,
    /// A ring: `waiting` of them from `first` on.
    pending: [WrenchReading<T>; PENDING],
    first: u8,
    waiting: u8,
    dropped: u32,
}

impl<T: Scalar> Aligner<T> {
    /// The aligner before it is set up: [`Self::set_up`] must follow.
    pub const UNUSED: Self = {
        let none = ImuReading {
            time_ns: 0,
            specific_force: SpecificForce::zero(),
            angular_rate: AngularRate::zero(),
        };
        Self {
            config: AlignerConfig { wrench_delay_ns: 0, imu_delay_ns: 0, imu_period_ns: 0 },
            unit: T::ZERO,
            around: [none; NEIGHBOURS],
            oldest: 0,
            filled: 0,
            pending: [WrenchReading { time_ns: 0, wrench: Wrench::zero() }; PENDING],
            first: 0,
            waiting: 0,
            dropped: 0,
        }
    };

    /// Returns an aligner without readings.
    pub fn new(config: AlignerConfig) -> Self {
        let mut aligner = Self::UNUSED;
        aligner.set_up(config);
        aligner
    }

    /// Makes it an aligner without readings that has dropped none.
    pub fn set_up(&mut self, config: AlignerConfig) {
        self.config = config;
        self.unit = T::ONE / T::from_u32(config.imu_period_ns.max(1));
        self.dropped = 0;
        self.reset();
    }

    /// Forgets all readings; the count of dropped ones stays.
    pub fn reset(&mut self) {
        (self.filled, self.waiting) = (0, 0);
    }

    /// Returns the load-cell samples for which no IMU neighbours could be had.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Drops and counts the load-cell readings that wait in vain: for an IMU which no longer comes, for more
    /// than two of its periods, or between two readings of it that are further apart.
    pub fn give_up_waiting(&mut self) {
        let last = (usize::from(self.first) + usize::from(self.waiting)).wrapping_sub(1) % PENDING;
        let config = &self.config;
        let most_ns = 2 * u64::from(config.imu_period_ns);
        let wrench_ns = self.pending[last].time_ns.saturating_add(u64::from(config.wrench_delay_ns));
        let imu_ns = match self.filled {
            0 => 0,
            _ => self.imu(NEIGHBOURS as u8 - 1).time_ns.saturating_add(u64::from(config.imu_delay_ns)),
        };
        let gone = wrench_ns.saturating_sub(imu_ns) > most_ns;
        let (before_ns, after_ns) = (self.imu(2).time_ns, self.imu(3).time_ns);
        let apart = usize::from(self.filled) == NEIGHBOURS && after_ns - before_ns > most_ns;
        while self.front().is_some_and(|wrench| gone || (apart && wrench.time_ns <= after_ns)) {
            self.drop_first();
            self.dropped = self.dropped.saturating_add(1);
        }
    }

    /// Returns the k-th oldest of the last IMU readings.
    #[inline(always)]
    fn imu(&self, k: u8) -> &ImuReading<T> {
        &self.around[usize::from((self.oldest + k) % NEIGHBOURS as u8)]
    }

    /// Takes an IMU reading. One that is not later than its predecessor starts anew. Ask for what it
    /// completed ([`Self::pop`]) before the next one is given.
    #[inline]
    pub fn push_imu(&mut self, reading: &ImuReading<T>) {
        let time_ns = reading.time_ns.saturating_sub(u64::from(self.config.imu_delay_ns));
        if self.filled > 0 && time_ns <= self.imu(3).time_ns {
            self.filled = 0;
        }
        self.around[usize::from(self.oldest % NEIGHBOURS as u8)] = ImuReading { time_ns, ..*reading };
        self.oldest = (self.oldest + 1) % NEIGHBOURS as u8;
        self.filled = (self.filled + 1).min(NEIGHBOURS as u8);
    }

    /// Takes a load-cell reading.
    #[inline]
    pub fn push_wrench(&mut self, time_ns: u64, wrench: Wrench<Sensor, T>) {
        let time_ns = time_ns.saturating_sub(u64::from(self.config.wrench_delay_ns));
        if usize::from(self.waiting) == PENDING {
            self.drop_first();
            self.dropped = self.dropped.saturating_add(1);
        }
        let place = (usize::from(self.first) + usize::from(self.waiting)) % PENDING;
        self.pending[place] = WrenchReading { time_ns, wrench };
        self.waiting += 1;
    }

    #[inline(always)]
    fn drop_first(&mut self) {
        self.first = (self.first + 1) % PENDING as u8;
        self.waiting = self.waiting.saturating_sub(1);
    }

    #[inline(always)]
    fn front(&self) -> Option<&WrenchReading<T>> {
        (self.waiting > 0).then(|| &self.pending[usize::from(self.first) % PENDING])
    }

    /// Returns whether [`Self::pop`] has something to do.
    #[inline]
    pub fn is_ready(&self) -> bool {
        usize::from(self.filled) == NEIGHBOURS
            && self.front().is_some_and(|wrench| wrench.time_ns <= self.imu(2).time_ns)
    }

    /// Returns the next aligned reading, oldest first.
    pub fn pop(&mut self) -> Option<Reading<T>> {
        let mut reading = Reading::default();
        self.pop_into(&mut reading).then_some(reading)
    }

    /// Puts the next aligned reading, oldest first, where it is to stay, and says whether there was one; what
    /// is there is else left alone.
    #[inline(always)]
    pub fn pop_into(&mut self, reading: &mut Reading<T>) -> bool {
        let found = self.is_ready() && (self.has_neighbours() || self.drop_without_neighbours());
        if let (true, Some(wrench)) = (found, self.front()) {
            self.interpolate(wrench, reading);
            self.drop_first();
        }
        found
    }

    /// Returns whether the first that waits, which is not later than the readings around, is not before them
    /// either, and these are near each other.
    #[inline(always)]
    fn has_neighbours(&self) -> bool {
        let (before_ns, after_ns) = (self.imu(1).time_ns, self.imu(2).time_ns);
        self.front().is_some_and(|wrench| wrench.time_ns >= before_ns)
            && after_ns - before_ns <= 2 * u64::from(self.config.imu_period_ns)
            // Nanoseconds between neighbours fit 32 bits.
            && self.imu(3).time_ns - self.imu(0).time_ns <= u64::from(u32::MAX / 2)
    }

    /// Drops what waits until something has neighbours. Returns false if nothing does.
    #[cold]
    #[inline(never)]
    fn drop_without_neighbours(&mut self) -> bool {
        while self.is_ready() {
            if self.has_neighbours() {
                return true;
            }
            self.drop_first();
            self.dropped = self.dropped.saturating_add(1);
        }
        false
    }

    #[inline(always)]
    fn interpolate(&self, wrench: &WrenchReading<T>, reading: &mut Reading<T>) {
        let around: [&ImuReading<T>; NEIGHBOURS] = core::array::from_fn(|k| self.imu(k as u8));
        (reading.time_ns, reading.wrench) = (wrench.time_ns, wrench.wrench);
        // Times relative to the wanted instant, in units of the nominal period.
        let unit = self.unit;
        let [t0, t1, t2, t3] = around.map(|r| {
            T::from_i32((r.time_ns as u32).wrapping_sub(wrench.time_ns as u32).cast_signed()) * unit
        });
        if t1 == T::ZERO {
            (reading.specific_force, reading.angular_rate) =
                (around[1].specific_force, around[1].angular_rate);
            return;
        }
        // Lagrange: w_i = Π_{j≠i} τ_j / (τ_j − τ_i), over one denominator.
        let (h01, h02, h03, h12, h13, h23) = (t1 - t0, t2 - t0, t3 - t0, t2 - t1, t3 - t1, t3 - t2);
        let (without0, without1, without2, without3) =
            (h12 * h13 * h23, h02 * h03 * h23, h01 * h03 * h13, h01 * h02 * h12);
        let (outer, inner) = (t0 * t3, t1 * t2);
        let inverse = T::ONE / (without0 * (h01 * h02 * h03));
        let weights = [
            inner * t3 * without0 * inverse,
            -(outer * t2 * without1 * inverse),
            outer * t1 * without2 * inverse,
            -(inner * t0 * without3 * inverse),
        ];
        let combined = |of: fn(&ImuReading<T>) -> [T; 3]| {
            let values = around.map(of);
            core::array::from_fn(|axis| {
                (weights[0] * values[0][axis] + weights[1] * values[1][axis])
                    + (weights[2] * values[2][axis] + weights[3] * values[3][axis])
            })
        };
        reading.specific_force = SpecificForce::from_array(combined(|r| r.specific_force.array()));
        reading.angular_rate = AngularRate::from_array(combined(|r| r.angular_rate.array()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cubic(t_ns: u64) -> f64 {
        let t = t_ns as f64 * 1e-9;
        1.0 + 2.0 * t - 30.0 * t * t + 400.0 * t * t * t
    }

    fn imu(t_ns: u64, capture_ns: u64) -> ImuReading<f64> {
        ImuReading {
            time_ns: capture_ns,
            specific_force: SpecificForce::new(cubic(t_ns), 0.0, 9.8),
            angular_rate: AngularRate::new(0.0, -cubic(t_ns), 0.0),
        }
    }

    #[test]
    fn a_cubic_is_reproduced_between_readings_and_delays_are_taken_off() {
        let config =
            AlignerConfig { wrench_delay_ns: 1_500_000, imu_delay_ns: 700_000, imu_period_ns: 900_000 };
        let mut aligner = Aligner::<f64>::new(config);
        let mut seen = 0;
        let (mut next_imu, mut next_wrench) = (0_u64, 0_u64);
        for _ in 0..400 {
            if next_imu <= next_wrench {
                aligner.push_imu(&imu(next_imu, next_imu + 700_000));
                next_imu += 900_000;
            } else {
                let wrench = Wrench::from_array([next_wrench as f64; 6]);
                aligner.push_wrench(next_wrench + 1_500_000, wrench);
                next_wrench += 1_000_000;
            }
            while let Some(r) = aligner.pop() {
                assert_eq!(r.wrench.array()[0], r.time_ns as f64);
                assert!((r.specific_force.array()[0] - cubic(r.time_ns)).abs() < 1e-12);
                assert!((r.angular_rate.array()[1] + cubic(r.time_ns)).abs() < 1e-12);
                seen += 1;
            }
        }
        assert!(seen > 180);
        // Only samples before the second IMU reading can have no neighbours.
        assert!(aligner.dropped() <= 2);
    }

    #[test]
    fn coinciding_readings_are_passed_bit_for_bit() {
        let config = AlignerConfig { wrench_delay_ns: 0, imu_delay_ns: 0, imu_period_ns: 1_000_000 };
        let mut aligner = Aligner::<f64>::new(config);
        for n in 0..50_u64 {
            aligner.push_imu(&imu(n * 1_000_000, n * 1_000_000));
            aligner.push_wrench(n * 1_000_000, Wrench::default());
            while let Some(r) = aligner.pop() {
                assert_eq!(r.specific_force, imu(r.time_ns, 0).specific_force);
            }
        }
    }

    /// Aligns 200 readings of a load cell at 500 Hz with an IMU of which only those readings come that
    /// `comes` names. Returns the numbers of those that are neither aligned nor counted when the run ends,
    /// and of those that its end has counted.
    fn left_at_the_end(comes: impl Fn(u64) -> bool) -> (u32, u32) {
        let config =
            AlignerConfig { wrench_delay_ns: 1_000_000, imu_delay_ns: 7_000_000, imu_period_ns: 2_000_000 };
        let mut aligner = Aligner::<f64>::new(config);
        let mut came = 0;
        for k in 1..=200_u64 {
            let time_ns = 1_000_000_000 + k * 2_000_000;
            aligner.push_wrench(time_ns, Wrench::zero());
            if comes(k) {
                let (specific_force, angular_rate) = (SpecificForce::zero(), AngularRate::zero());
                aligner.push_imu(&ImuReading { time_ns: time_ns + 700_000, specific_force, angular_rate });
            }
            came += core::iter::from_fn(|| aligner.pop()).count() as u32;
        }
        let before = aligner.dropped();
        aligner.give_up_waiting();
        (200 - came - aligner.dropped(), aligner.dropped() - before)
    }

    #[test]
    fn readings_that_wait_for_a_lost_imu_are_counted_when_the_run_ends() {
        // Of an IMU that is well some are on their way, and stay so; of one that has gone none is forgotten.
        let (on_the_way, given_up) = left_at_the_end(|_| true);
        assert!((1..=6).contains(&on_the_way) && given_up == 0, "{on_the_way} {given_up}");
        for stops in [198, 195, 180, 100] {
            let (forgotten, given_up) = left_at_the_end(|k| k < stops);
            assert!(forgotten == 0 && given_up > 3, "{stops}: {forgotten} {given_up}");
        }
    }

    #[test]
    fn readings_that_wait_for_a_slow_imu_are_counted_when_the_run_ends() {
        // An IMU that a changed setting makes eight times as slow: its last reading comes with the 200th, the
        // 199th and so on.
        for phase in 0..8 {
            let (on_the_way, _) = left_at_the_end(|k| k < 50 || k % 8 == phase);
            assert!(on_the_way <= 8, "{phase}: {on_the_way}");
        }
    }

    #[test]
    fn nothing_is_interpolated_across_a_gap_of_the_imu() {
        let config = AlignerConfig { wrench_delay_ns: 0, imu_delay_ns: 0, imu_period_ns: 1_000_000 };
        let mut aligner = Aligner::<f64>::new(config);
        for n in 0..30_u64 {
            if !(10..20).contains(&n) {
                aligner.push_imu(&imu(n * 1_000_000, n * 1_000_000));
            }
            aligner.push_wrench(n * 1_000_000, Wrench::default());
        }
        let mut times = std::vec::Vec::new();
        while let Some(r) = aligner.pop() {
            times.push(r.time_ns / 1_000_000);
        }
        assert!(times.iter().all(|t| *t < 9 || *t > 20 || *t == 9 || *t == 20), "{times:?}");
        assert!(aligner.dropped() >= 10);
    }
    extern crate std;
}
