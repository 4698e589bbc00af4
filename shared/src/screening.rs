//! The readings that may enter the estimate.
//!
//! Lives here: not-finite, saturated and frozen channels, and gaps in time. May not live here: repair; a
//! rejected reading is counted, named and left out. Before this: [`crate::alignment`]; after it:
//! [`crate::estimator`].

use crate::Scalar;
use crate::calibration::Reading;

/// Channels of one body's reading: wrench (6), specific force (3), angular rate (3).
pub const CHANNELS: usize = 12;
/// Channels of two links' reading: those of one body, then a second IMU's specific force and rate.
pub const TWO_LINK_CHANNELS: usize = 18;
/// The attitude of a joint, which is examined as a whole.
pub const ATTITUDE_CHANNEL: u8 = 18;
/// All there are.
pub const ALL_CHANNELS: usize = 19;

/// The channels' names, as in a recording; an attitude's is its first component's.
pub const CHANNEL_NAMES: [&str; ALL_CHANNELS] = [
    "fx_n",
    "fy_n",
    "fz_n",
    "mx_nm",
    "my_nm",
    "mz_nm",
    "imu_ax_mps2",
    "imu_ay_mps2",
    "imu_az_mps2",
    "imu_gx_radps",
    "imu_gy_radps",
    "imu_gz_radps",
    "imu1_ax_mps2",
    "imu1_ay_mps2",
    "imu1_az_mps2",
    "imu1_gx_radps",
    "imu1_gy_radps",
    "imu1_gz_radps",
    "q1_w",
];

/// Channels come in groups: force, moment, specific force, angular rate, and so on.
const GROUP: usize = 3;

/// Holds what the sensors can show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<T: Scalar> {
    /// Range of each wrench channel, N and N m.
    pub wrench: [T; 6],
    /// Range of the accelerometer, m/s².
    pub specific_force: T,
    /// Range of the gyro, rad/s.
    pub angular_rate: T,
    /// A channel is frozen after this many equal readings while its group moves, a group while another
    /// moves. Zero: never.
    pub frozen_after: u16,
}

impl<T: Scalar> Limits<T> {
    /// Returns no limits: nothing but not-finite values and gaps is rejected.
    pub fn none() -> Self {
        let huge = T::ONE / T::TINY_SQUARE;
        Self { wrench: [huge; 6], specific_force: huge, angular_rate: huge, frozen_after: 0 }
    }

    /// Limits of nothing.
    pub(crate) const ZERO: Self =
        Self { wrench: [T::ZERO; 6], specific_force: T::ZERO, angular_rate: T::ZERO, frozen_after: 0 };
}

/// Tells why a reading was rejected; the channel is an index into [`CHANNEL_NAMES`].
///
/// The tags begin at 1, which leaves 0 for `None`: an estimator that has seen nothing is all zero bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Rejection {
    /// The channel is NaN or infinite.
    NotFinite(u8) = 1,
    /// The channel is at its range.
    Saturated(u8) = 2,
    /// The channel repeats itself while others move.
    Frozen(u8) = 3,
}

/// Checks readings of `C` channels one after the other.
#[derive(Clone, Copy, Debug)]
pub struct Screen<T: Scalar, const C: usize = CHANNELS> {
    /// The value at which, and beyond which, a channel is saturated: its range to within 0.1 %.
    highest: [T; C],
    frozen_after: u16,
    last: [T; C],
    seen: bool,
    /// Tells how many readings in a row each channel has repeated itself.
    equal: [u16; C],
    /// Tells whether one of these is not zero.
    some_equal: bool,
    /// Tells how many readings in a row some channel of each group has changed, without the last `clean`
    /// ones. There are fewer groups than channels.
    moving: [u16; C],
    /// Readings in a row in which every channel has changed, none having repeated itself before.
    clean: u16,
}

impl<T: Scalar> Screen<T> {
    /// Returns a screen that has seen nothing.
    pub fn new(limits: Limits<T>) -> Self {
        let (a, g) = (limits.specific_force, limits.angular_rate);
        let [w0, w1, w2, w3, w4, w5] = limits.wrench;
        Self::of_ranges(&[w0, w1, w2, w3, w4, w5, a, a, a, g, g, g], limits.frozen_after)
    }

    /// Returns why the reading may not be used, if so; see [`Screen::check_values`].
    #[inline]
    pub fn check(&mut self, reading: &Reading<T>) -> Result<(), Rejection> {
        self.check_read(|| {
            let [fx, fy, fz, mx, my, mz] = reading.wrench.array();
            let [ax, ay, az] = reading.specific_force.array();
            let [gx, gy, gz] = reading.angular_rate.array();
            [fx, fy, fz, mx, my, mz, ax, ay, az, gx, gy, gz]
        })
    }
}

impl<T: Scalar, const C: usize> Screen<T, C> {
    /// Lets nothing pass that is not zero: [`Self::of_ranges`] must take its place.
    pub const UNUSED: Self = Self {
        highest: [T::ZERO; C],
        frozen_after: 0,
        last: [T::ZERO; C],
        seen: false,
        equal: [0; C],
        some_equal: false,
        moving: [0; C],
        clean: 0,
    };

    /// Returns a screen that has seen nothing, of channels with these ranges.
    pub fn of_ranges(ranges: &[T; C], frozen_after: u16) -> Self {
        Self { highest: ranges.map(|range| T::from_f32(0.999) * range), frozen_after, ..Self::UNUSED }
    }

    /// Returns why the values may not be used, if so.
    ///
    /// A saturated channel touches its range to within 0.1 %. A channel that is exactly zero is only frozen
    /// together with its whole group: an axis may well be at rest.
    #[inline]
    pub fn check_values(&mut self, values: [T; C]) -> Result<(), Rejection> {
        self.check_read(|| values)
    }

    /// Checks values as [`Self::check_values`] does. They are read where they lie, and again where they are
    /// kept: nearly all readings take no other copy.
    #[inline]
    fn check_read(&mut self, read: impl Fn() -> [T; C]) -> Result<(), Rejection> {
        let values = read();
        // Most readings are within all ranges and repeat nothing. Four at a time, which the compiler writes
        // out.
        let (fours, rest) = values.as_chunks::<4>();
        let (highest, rest_highest) = self.highest.as_chunks::<4>();
        let (last, rest_last) = self.last.as_chunks::<4>();
        let mut ordinary = self.seen && !self.some_equal;
        for ((values, highest), last) in fours.iter().zip(highest).zip(last) {
            ordinary = ordinary && are_ordinary(values, highest, last);
        }
        ordinary = ordinary && are_ordinary(rest, rest_highest, rest_last);
        if !ordinary {
            return self.judge(&read());
        }
        self.last = read();
        self.clean = self.clean.saturating_add(1);
        Ok(())
    }

    #[cold]
    #[inline(never)]
    fn judge(&mut self, values: &[T; C]) -> Result<(), Rejection> {
        let mut history = History {
            highest: &self.highest,
            frozen_after: self.frozen_after,
            last: &mut self.last,
            seen: &mut self.seen,
            equal: &mut self.equal,
            moving: self.moving.get_mut(..C.div_ceil(GROUP)).unwrap_or_default(),
        };
        let verdict = history.judge(values, self.clean);
        if !matches!(verdict, Err(Rejection::NotFinite(_))) {
            self.some_equal = self.equal.iter().any(|e| *e != 0);
            self.clean = 0;
        }
        verdict
    }
}

/// Returns whether every value is within its range and differs from the last one.
#[inline(always)]
fn are_ordinary<T: Scalar>(values: &[T], highest: &[T], last: &[T]) -> bool {
    // A comparison with NaN is false.
    values
        .iter()
        .zip(highest)
        .zip(last)
        .all(|((value, highest), last)| value.abs() < *highest && value != last)
}

/// The state of a screen of any number of channels: one piece of code judges them all.
struct History<'a, T> {
    highest: &'a [T],
    frozen_after: u16,
    last: &'a mut [T],
    seen: &'a mut bool,
    equal: &'a mut [u16],
    moving: &'a mut [u16],
}

impl<T: Scalar> History<'_, T> {
    #[inline(never)]
    fn judge(&mut self, values: &[T], clean: u16) -> Result<(), Rejection> {
        let mut verdict = Ok(());
        for (channel, (value, highest)) in values.iter().zip(self.highest).enumerate() {
            if !value.is_finite() {
                return Err(Rejection::NotFinite(channel as u8));
            }
            if value.abs() >= *highest && verdict.is_ok() {
                verdict = Err(Rejection::Saturated(channel as u8));
            }
        }
        for moving in self.moving.iter_mut() {
            *moving = moving.saturating_add(clean);
        }
        let seen = core::mem::replace(self.seen, true);
        for ((equal, last), value) in self.equal.iter_mut().zip(self.last.iter_mut()).zip(values) {
            if seen {
                *equal = if *last == *value { equal.saturating_add(1) } else { 0 };
            }
            *last = *value;
        }
        if seen {
            for (moving, group) in self.moving.iter_mut().zip(self.equal.chunks(GROUP)) {
                let moved = group.contains(&0);
                *moving = if moved { moving.saturating_add(1) } else { 0 };
            }
        }
        verdict?;
        self.frozen(values).map_or(Ok(()), |channel| Err(Rejection::Frozen(channel)))
    }

    fn frozen(&self, values: &[T]) -> Option<u8> {
        let after = self.frozen_after;
        if after == 0 || self.equal.iter().all(|e| *e < after) {
            return None;
        }
        let others_move = self.moving.iter().any(|m| *m >= after);
        let groups = self.equal.chunks(GROUP).zip(values.chunks(GROUP));
        for (k, ((group, values), moving)) in groups.zip(self.moving.iter()).enumerate() {
            let together = others_move && group.iter().all(|e| *e >= after);
            for (offset, (equal, value)) in group.iter().zip(values).enumerate() {
                let alone = *moving >= after && *value != T::ZERO;
                if *equal >= after && (alone || together) {
                    return Some((GROUP * k + offset) as u8);
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::{AngularRate, SpecificForce, Wrench};

    fn limits() -> Limits<f64> {
        Limits {
            wrench: [660.0, 660.0, 1980.0, 60.0, 60.0, 60.0],
            specific_force: 156.0,
            angular_rate: 1.309,
            frozen_after: 20,
        }
    }

    fn moving(n: u32) -> [f64; CHANNELS] {
        core::array::from_fn(|c| 0.5 + 0.01 * f64::from((n * 7 + c as u32 * 13) % 31))
    }

    fn reading(v: [f64; CHANNELS]) -> Reading<f64> {
        Reading {
            time_ns: 0,
            wrench: Wrench::from_array([v[0], v[1], v[2], v[3], v[4], v[5]]),
            specific_force: SpecificForce::new(v[6], v[7], v[8]),
            angular_rate: AngularRate::new(v[9], v[10], v[11]),
        }
    }

    #[test]
    fn moving_and_resting_sensors_pass() {
        let mut screen = Screen::new(limits());
        for n in 0..100 {
            assert_eq!(screen.check(&reading(moving(n))), Ok(()));
        }
        // Everything at rest: no evidence of a fault.
        for _ in 0..100 {
            assert_eq!(screen.check(&reading(moving(0))), Ok(()));
        }
        // An axis exactly at rest while the others turn.
        for n in 0..100 {
            let mut v = moving(n);
            v[11] = 0.0;
            assert_eq!(screen.check(&reading(v)), Ok(()));
        }
    }

    #[test]
    fn the_channel_at_its_range_is_named() {
        let mut screen = Screen::new(limits());
        let mut v = moving(0);
        v[2] = -1980.0;
        assert_eq!(screen.check(&reading(v)), Err(Rejection::Saturated(2)));
        v[2] = 0.0;
        v[9] = 1.309;
        assert_eq!(screen.check(&reading(v)), Err(Rejection::Saturated(9)));
        v[4] = f64::NAN;
        assert_eq!(screen.check(&reading(v)), Err(Rejection::NotFinite(4)));
    }

    #[test]
    fn a_frozen_channel_and_a_dead_sensor_are_named() {
        for (channels, name) in [(4..5, 4), (9..12, 9)] {
            let mut screen = Screen::new(limits());
            let mut rejected = 0;
            for n in 0..50 {
                let mut v = moving(n);
                v[channels.clone()].fill(if name == 9 { 0.0 } else { 3.5 });
                match screen.check(&reading(v)) {
                    Ok(()) => assert!(n < 20),
                    Err(rejection) => {
                        assert_eq!(rejection, Rejection::Frozen(name));
                        rejected += 1;
                    }
                }
            }
            // The first reading repeats nothing; then twenty repeats are needed.
            assert_eq!(rejected, 50 - 20);
        }
    }
}
