//! Two sensors, two clocks' worth of samples, one row.
//!
//! Lives here: bringing IMU readings to the instants of the load cell. May not live here: filtering. Before
//! this: the drivers; after it: [`crate::estimator`].
//!
//! Capture times come from one clock; each sensor's stated group delay is taken off first. IMU values are
//! interpolated by the cubic through the four readings around the instant: 4e-7 of a 2 Hz signal at 200 Hz.

use heapless::Deque;

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

/// What is known of the two sensors' timing.
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
    /// The last four IMU readings, oldest first, delays taken off.
    around: [ImuReading<T>; NEIGHBOURS],
    filled: usize,
    pending: Deque<WrenchReading<T>, PENDING>,
    ready: Deque<Reading<T>, PENDING>,
    dropped: u32,
}

impl<T: Scalar> Aligner<T> {
    /// An aligner without readings.
    pub fn new(config: AlignerConfig) -> Self {
        let none = ImuReading {
            time_ns: 0,
            specific_force: SpecificForce::zero(),
            angular_rate: AngularRate::zero(),
        };
        Self {
            config,
            around: [none; NEIGHBOURS],
            filled: 0,
            pending: Deque::new(),
            ready: Deque::new(),
            dropped: 0,
        }
    }

    /// Forgets all readings; the count of dropped ones stays.
    pub fn reset(&mut self) {
        self.filled = 0;
        self.pending.clear();
        self.ready.clear();
    }

    /// Load-cell samples for which no IMU neighbours could be had.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Takes an IMU reading. One that is not later than its predecessor starts anew.
    pub fn push_imu(&mut self, mut reading: ImuReading<T>) {
        reading.time_ns = reading.time_ns.saturating_sub(u64::from(self.config.imu_delay_ns));
        let [_, b, c, d] = self.around;
        if self.filled > 0 && reading.time_ns <= d.time_ns {
            self.filled = 0;
        }
        self.around = [b, c, d, reading];
        self.filled = (self.filled + 1).min(NEIGHBOURS);
        self.match_pending();
    }

    /// Takes a load-cell reading.
    pub fn push_wrench(&mut self, mut reading: WrenchReading<T>) {
        reading.time_ns = reading.time_ns.saturating_sub(u64::from(self.config.wrench_delay_ns));
        if self.pending.push_back(reading).is_err() {
            self.pending.pop_front();
            self.dropped = self.dropped.saturating_add(1);
            // The queue had room for one once its oldest entry was gone.
            let _ = self.pending.push_back(reading);
        }
        self.match_pending();
    }

    /// The next aligned reading, oldest first.
    pub fn pop(&mut self) -> Option<Reading<T>> {
        self.ready.pop_front()
    }

    fn match_pending(&mut self) {
        if self.filled < NEIGHBOURS {
            return;
        }
        let [_, b, c, _] = self.around;
        while let Some(wrench) = self.pending.front().copied() {
            if wrench.time_ns > c.time_ns {
                return;
            }
            self.pending.pop_front();
            let wide = c.time_ns - b.time_ns > 2 * u64::from(self.config.imu_period_ns);
            if wrench.time_ns < b.time_ns || wide || self.ready.push_back(self.interpolate(&wrench)).is_err()
            {
                self.dropped = self.dropped.saturating_add(1);
            }
        }
    }

    fn interpolate(&self, wrench: &WrenchReading<T>) -> Reading<T> {
        // Times relative to the wanted instant, in units of the nominal period.
        let unit = T::from_u32(self.config.imu_period_ns.max(1));
        let tau = self.around.map(|r| {
            let ns = r.time_ns.wrapping_sub(wrench.time_ns).cast_signed();
            T::from_i32(i32::try_from(ns).unwrap_or(if ns < 0 { i32::MIN } else { i32::MAX })) / unit
        });
        let (mut force, mut rate) = ([T::ZERO; 3], [T::ZERO; 3]);
        for (i, (reading, ti)) in self.around.iter().zip(tau).enumerate() {
            // Lagrange: w_i = Π_{j≠i} τ_j / (τ_j − τ_i)
            let mut weight = T::ONE;
            for (j, tj) in tau.iter().enumerate() {
                if i != j {
                    weight *= *tj / (*tj - ti);
                }
            }
            for (sum, v) in force.iter_mut().zip(reading.specific_force.array()) {
                *sum += weight * v;
            }
            for (sum, v) in rate.iter_mut().zip(reading.angular_rate.array()) {
                *sum += weight * v;
            }
        }
        Reading {
            time_ns: wrench.time_ns,
            wrench: wrench.wrench,
            specific_force: SpecificForce::from_array(force),
            angular_rate: AngularRate::from_array(rate),
        }
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
                aligner.push_imu(imu(next_imu, next_imu + 700_000));
                next_imu += 900_000;
            } else {
                let wrench = Wrench::from_array([next_wrench as f64; 6]);
                aligner.push_wrench(WrenchReading { time_ns: next_wrench + 1_500_000, wrench });
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
            aligner.push_imu(imu(n * 1_000_000, n * 1_000_000));
            aligner.push_wrench(WrenchReading { time_ns: n * 1_000_000, wrench: Wrench::default() });
            while let Some(r) = aligner.pop() {
                assert_eq!(r.specific_force, imu(r.time_ns, 0).specific_force);
            }
        }
    }

    #[test]
    fn nothing_is_interpolated_across_a_gap_of_the_imu() {
        let config = AlignerConfig { wrench_delay_ns: 0, imu_delay_ns: 0, imu_period_ns: 1_000_000 };
        let mut aligner = Aligner::<f64>::new(config);
        for n in 0..30_u64 {
            if !(10..20).contains(&n) {
                aligner.push_imu(imu(n * 1_000_000, n * 1_000_000));
            }
            aligner.push_wrench(WrenchReading { time_ns: n * 1_000_000, wrench: Wrench::default() });
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
