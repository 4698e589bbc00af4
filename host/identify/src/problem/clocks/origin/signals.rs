//! The signals that a stream and the wrench have of a motion, at any instants of their own clocks.

use nalgebra::{UnitQuaternion, Vector3};

use crate::problem::clocks::kernel::Weights;
use crate::problem::clocks::{Stream, StreamSet};
use rigident_io::recording::columns::Group;

/// Half the kernel's width, periods of the slower stream, and the least, ns.
const HALF_PERIODS: f64 = 3.5;
const LEAST_HALF_NS: i64 = 40_000_000;
/// Channels of a wrench.
pub(super) const CHANNELS: usize = 6;
/// The terms that the wrench is linear in: specific force, angular acceleration, products of rates, one.
pub(super) const COLUMNS: usize = 13;

/// Instants at which a stream's kernel is sought.
const INSTANTS: usize = 16;

/// Variances of noise after the kernel.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    pub(super) wrench: [f64; CHANNELS],
    pub(super) columns: [f64; COLUMNS],
}

/// A stream beside the wrench.
pub(crate) struct Signals {
    wrench: Vec<Vec<f64>>,
    wrench_ns: Vec<i64>,
    /// Specific force, or what the attitude has of it at rest.
    accel: Option<Vec<Vec<f64>>>,
    gyro: Option<Vec<Vec<f64>>>,
    attitude: Option<Vec<UnitQuaternion<f64>>>,
    own_ns: Vec<i64>,
    pub(super) half_ns: i64,
}

impl Signals {
    /// Returns what the wrench and a stream see; `None` of a stream that sees neither force nor rate of the
    /// base.
    pub(super) fn of(set: &StreamSet, k: usize) -> Option<Self> {
        let (reference, stream) = (set.streams.get(set.reference)?, set.streams.get(k)?);
        let of = |stream: &Stream, wanted: Group| {
            stream.groups.iter().find(|(group, _)| *group == wanted).map(|(_, columns)| columns.clone())
        };
        let wrench = of(reference, Group::Wrench).or_else(|| of(reference, Group::Gauges))?;
        let (accel, gyro) = (of(stream, Group::Accel(0)), of(stream, Group::Gyro(0)));
        let attitude = stream.attitude.clone();
        if accel.is_none() && gyro.is_none() && attitude.is_none() {
            return None;
        }
        let slower = reference.rate_hz.min(stream.rate_hz);
        if slower <= 0.0 {
            return None;
        }
        let half_ns = ((HALF_PERIODS * 1e9 / slower) as i64).max(LEAST_HALF_NS);
        let (wrench_ns, own_ns) = (reference.time_ns.clone(), stream.time_ns.clone());
        Some(Self { wrench, wrench_ns, accel, gyro, attitude, own_ns, half_ns })
    }

    /// Returns the times of the wrench's first and last reading, s.
    pub(super) fn wrench_ends_s(&self) -> (f64, f64) {
        ends_s(&self.wrench_ns)
    }

    /// Returns those of the stream by its own clock, s.
    pub(super) fn own_ends_s(&self) -> (f64, f64) {
        ends_s(&self.own_ns)
    }

    /// Returns the middle of the stream by its own clock, s.
    pub(super) fn middle_s(&self) -> f64 {
        let (from, to) = self.own_ends_s();
        0.5 * (from + to)
    }

    /// Returns how long both run at the same time as they are stamped, s; negative if they do not.
    pub(super) fn overlap_s(&self) -> f64 {
        let ((a, b), (c, d)) = (self.wrench_ends_s(), self.own_ends_s());
        b.min(d) - a.max(c)
    }

    /// Returns the wrench at a time, s; `None` where it has a gap or has ended.
    pub(super) fn wrench(&self, at_s: f64) -> Option<[f64; CHANNELS]> {
        let weights = Weights::at(&self.wrench_ns, (1e9 * at_s) as i64, self.half_ns)?;
        Some(std::array::from_fn(|c| self.wrench.get(c).map_or(0.0, |column| weights.apply(column))))
    }

    /// Returns specific force, rate and angular acceleration at a time of the stream's clock, s.
    pub(super) fn motion(&self, at_s: f64) -> Option<[[f64; 3]; 3]> {
        let at_ns = (1e9 * at_s) as i64;
        let weights = Weights::at(&self.own_ns, at_ns, self.half_ns)?;
        let three = |columns: &Vec<Vec<f64>>| std::array::from_fn(|c| weights.apply(&columns[c]));
        let slope = |columns: &Vec<Vec<f64>>| {
            std::array::from_fn(|c| {
                let samples = columns[c].get(weights.range.clone()).unwrap_or_default();
                samples.iter().zip(&weights.slope).map(|(y, w)| y * w).sum()
            })
        };
        let mut found = [[0.0; 3]; 3];
        if let Some(attitude) = &self.attitude {
            let (up, rate, turned) = turn(attitude.get(weights.range.clone())?, &weights);
            found = [up, rate, turned];
        }
        if let Some(accel) = &self.accel {
            found[0] = three(accel);
        }
        if let Some(gyro) = &self.gyro {
            (found[1], found[2]) = (three(gyro), slope(gyro));
        }
        Some(found)
    }

    /// Returns what the wrench is linear in at a time of the stream's clock, s.
    pub(super) fn columns(&self, at_s: f64) -> Option<[f64; COLUMNS]> {
        let [a, w, turned] = self.motion(at_s)?;
        Some([
            a[0],
            a[1],
            a[2],
            turned[0],
            turned[1],
            turned[2],
            w[0] * w[0],
            w[1] * w[1],
            w[2] * w[2],
            w[0] * w[1],
            w[1] * w[2],
            w[2] * w[0],
            1.0,
        ])
    }

    /// Returns the variances of noise that smoothed wrenches and columns have.
    pub(super) fn noise(&self) -> Noise {
        let gains = |times: &[i64]| {
            let at = |k: usize| {
                let time = times.get(k * times.len() / INSTANTS)?;
                let weights = Weights::at(times, *time, self.half_ns)?;
                let squares = |weights: &[f64]| weights.iter().map(|w| w * w).sum::<f64>();
                Some((squares(&weights.value), squares(&weights.slope)))
            };
            (1..INSTANTS).find_map(at).unwrap_or((0.0, 0.0))
        };
        let (of_wrench, _) = gains(&self.wrench_ns);
        let (value, slope) = gains(&self.own_ns);
        let wrench = std::array::from_fn(|c| of_wrench * self.wrench.get(c).map_or(0.0, |y| white_noise(y)));
        let three = |columns: &Option<Vec<Vec<f64>>>, of: &dyn Fn(&[f64]) -> f64| -> [f64; 3] {
            std::array::from_fn(|c| columns.as_ref().and_then(|all| all.get(c)).map_or(0.0, |y| of(y)))
        };
        let (a, w) = (three(&self.accel, &white_noise), three(&self.gyro, &white_noise));
        let square = |y: &[f64]| y.iter().map(|v| v * v).sum::<f64>() / y.len().max(1) as f64;
        let size = three(&self.gyro, &square);
        let product = |i: usize, j: usize| value * (size[i] * w[j] + size[j] * w[i]);
        let twice = |i: usize| 4.0 * value * size[i] * w[i];
        let columns = [
            value * a[0],
            value * a[1],
            value * a[2],
            slope * w[0],
            slope * w[1],
            slope * w[2],
            twice(0),
            twice(1),
            twice(2),
            product(0, 1),
            product(1, 2),
            product(2, 0),
            0.0,
        ];
        Noise { wrench, columns }
    }

    /// Returns how many times the wrench's variance is larger than that of its noise, by the liveliest
    /// channel.
    pub(super) fn liveliness(&self) -> f64 {
        let ratio = |column: &Vec<f64>| {
            let count = column.len().max(4) as f64;
            let mean = column.iter().sum::<f64>() / count;
            let variance = column.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
            variance / white_noise(column).max(1e-12 * variance.max(f64::MIN_POSITIVE))
        };
        self.wrench.iter().map(ratio).fold(0.0, f64::max)
    }
}

/// Returns the variance of white noise in a smooth signal: third differences of what is smooth are small, and
/// of white noise their variance is 20 times its own.
fn white_noise(signal: &[f64]) -> f64 {
    let squares = signal.windows(4).map(|v| (v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]).powi(2)).sum::<f64>();
    squares / 20.0 / signal.len().max(4) as f64
}

fn ends_s(times: &[i64]) -> (f64, f64) {
    let seconds = |ns: Option<&i64>| ns.map_or(0.0, |ns| *ns as f64 * 1e-9);
    (seconds(times.first()), seconds(times.last()))
}

/// Returns upwards, the rate and its slope by the attitudes under a window: the cubic through their turns
/// from the middle one.
fn turn(window: &[UnitQuaternion<f64>], weights: &Weights) -> ([f64; 3], [f64; 3], [f64; 3]) {
    let middle = window.get(window.len() / 2).copied().unwrap_or_else(UnitQuaternion::identity);
    let (mut angle, mut rate) = (Vector3::zeros(), Vector3::zeros());
    for ((q, value), slope) in window.iter().zip(&weights.value).zip(&weights.slope) {
        let theta = (middle.inverse() * q).scaled_axis();
        angle += theta * *value;
        rate += theta * *slope;
    }
    let up = (middle * UnitQuaternion::from_scaled_axis(angle)).inverse() * Vector3::z();
    // Its slope is noise at the rates of cameras; the products of the rates tell enough.
    (up.into(), rate.into(), [0.0; 3])
}
