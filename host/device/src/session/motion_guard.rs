//! Believes that the plate moves only while the IMU, and the platform's own reading, show it.
//!
//! Over a third of a second the angular rate and the specific force that the program predicts are compared
//! with those read. When the plate is where the program has it is not known: the delay of [`DELAYS_S`] that
//! explains most is taken.

use std::collections::VecDeque;

use hexapod::{IdealSensors, MotionProgram, PlateState, Pose, Trajectory};
use nalgebra::{Matrix3, Vector3};

use super::SessionError;
use crate::platform::MotionSample;
use crate::platform::tracking::difference;

/// Readings are averaged over this time, s.
const BIN_S: f64 = 0.01;
/// This many of these are checked together.
const BINS: usize = 35;
/// A span longer than this, because readings are rare or missing, is not examined, s.
const LONGEST_S: f64 = 0.8;
/// The time between two checks, s.
const LOOK_S: f64 = 0.05;
/// The plate may be so early and so late, s: clocks and controllers are.
const DELAYS_S: [f64; 2] = [-0.1, 0.25];
/// A plate that comes later is searched for up to here, s.
const LATEST_S: f64 = 1.2;
/// An acceleration of this many m/s² counts as 1 rad/s.
const ACCELERATION: f64 = 5.0;
/// Less motion than this is not judged, rad/s as a root mean square.
const LEAST: f64 = 0.04;
/// The motion below which the plate rests, rad/s as a root mean square.
const RESTS: f64 = 0.01;
/// Motion that is not this often above its noise is not judged.
const ABOVE_NOISE: f64 = 4.0;
/// So few of the readings may be far off, knocks and spikes: they are left out.
const OUTLIERS: usize = 3;
/// Less than this share of the motion is none; an axis that makes more than [`MOST`] of it does not follow
/// either.
const DEAD: f64 = 0.3;
const MOST: f64 = 2.0;
/// The share of the angular rate or the acceleration that an axis must make at least to be judged by itself.
const OF_ALL: f64 = 0.3;
/// An error in time by this much makes turns resemble accelerations, s.
const LEAK_S: f64 = 0.02;
/// A window of which less than this share stays unexplained is one of a plate that follows.
const FOLLOWS: f64 = 0.6;
/// A lag must explain all but this share.
const LAGS: f64 = 0.25;
/// The share by which the bias of the specific force goes with what a check has seen.
const SLOWLY: f64 = 0.05;
/// Consecutive checks before it is believed.
const IN_A_ROW: u32 = 3;
/// The platform's own reading may be so far from the program, m, an angle as the way of a point at [`ARM_M`],
/// for this long, s.
const OFF_M: f64 = 0.008;
const ARM_M: f64 = 0.25;
const OFF_S: f64 = 0.25;

const AXES: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// The way a missing axis is treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// An axis that does not follow ends the motion.
    Each,
    /// An axis that does not follow is found, and done without, by whoever decides: only a plate that does
    /// not move, or late, ends the motion.
    LeftToPlanner,
}

/// Watches the motion of the plate.
pub struct MotionGuard {
    sensors: IdealSensors,
    /// `R_PU`.
    to_plate: Matrix3<f64>,
    gyro_zero: [f64; 3],
    axes: Axes,
    /// Least time from a reading to its arrival, the clocks' difference included, s.
    offset_s: f64,
    /// The specific force read less that predicted, in P, m/s²: bias and mounting.
    bias: Option<[f64; 3]>,
    course: Option<Course>,
}

/// A program under way.
struct Course {
    trajectory: Trajectory,
    clock: Clock,
    bins: VecDeque<Bin>,
    looked_s: f64,
    suspicions: [u32; 3],
    off_since_s: Option<f64>,
}

/// The relation of the device's time to the program's.
enum Clock {
    /// The clock before the first reading, which is the program's zero: in lock-step.
    First(Option<f64>),
    /// The clock of arrivals: the program began at a time of the host, s.
    Host { began_s: f64 },
}

/// Readings that follow each other: when the first was taken, s; sums, and how many.
#[derive(Clone, Copy)]
struct Bin {
    began_s: f64,
    time_s: f64,
    sum: Six,
    count: f64,
}

/// Angular rate, rad/s, and specific force, m/s², both in P.
type Six = [f64; 6];

impl MotionGuard {
    /// Watches by an IMU at a place on the plate, `to_plate` = `R_PU`, whose gyro reads `gyro_zero` at rest,
    /// rad/s in U.
    pub fn new(sensors: IdealSensors, to_plate: Matrix3<f64>, gyro_zero: [f64; 3], axes: Axes) -> Self {
        Self { sensors, to_plate, gyro_zero, axes, offset_s: f64::INFINITY, bias: None, course: None }
    }

    /// Receives that a program begins; `at_host_s` is the time on the host, s, or none in lock-step, where
    /// the first reading is its beginning.
    ///
    /// # Errors
    /// A segment that makes no sense.
    pub(super) fn begins(
        &mut self,
        program: &MotionProgram,
        at_host_s: Option<f64>,
    ) -> Result<(), hexapod::MotionError> {
        let clock = at_host_s.map_or(Clock::First(None), |began_s| Clock::Host { began_s });
        self.course = Some(Course {
            trajectory: program.trajectory()?,
            clock,
            bins: VecDeque::new(),
            looked_s: f64::NEG_INFINITY,
            suspicions: [0; 3],
            off_since_s: None,
        });
        Ok(())
    }

    /// Receives that the program is over, or is being ended.
    pub(super) fn ends(&mut self) {
        self.course = None;
    }

    /// Takes in a reading: its time by the device, s, the host's time of its arrival, s, and what the IMU
    /// read, in U.
    ///
    /// # Errors
    /// The plate does not follow.
    pub(super) fn reading(
        &mut self,
        time_s: f64,
        arrived_s: f64,
        specific_force: &[f32; 3],
        angular_rate: &[f32; 3],
    ) -> Result<(), SessionError> {
        // A reading can be late, never early: the least difference is that of the clocks.
        self.offset_s = self.offset_s.min(arrived_s - time_s);
        let Some(course) = &mut self.course else { return Ok(()) };
        let program_s = course.clock.program_s(time_s, self.offset_s);
        let turn = |v: [f64; 3]| self.to_plate * Vector3::from(v);
        let rate = turn(std::array::from_fn(|k| f64::from(angular_rate[k]) - self.gyro_zero[k]));
        let force = turn(specific_force.map(f64::from));
        let read = [rate.x, rate.y, rate.z, force.x, force.y, force.z];
        if read.iter().all(|v| v.is_finite()) {
            course.put(program_s, &read);
        }
        if !course.is_due() {
            return Ok(());
        }
        let look = Look { course, sensors: &self.sensors, to_plate: &self.to_plate, bias: self.bias };
        let (seen, bias) = look.judge(self.axes);
        if let Some(now) = bias {
            // Slowly: what a delay leaves of gravity comes and goes.
            let of = |k: usize| self.bias.map_or(now[k], |before| before[k] + SLOWLY * (now[k] - before[k]));
            self.bias = Some(std::array::from_fn(of));
        }
        course.believe(seen)
    }

    /// Takes in what the platform itself read.
    ///
    /// # Errors
    /// It is far from where the program has it.
    pub(super) fn sample(&mut self, sample: &MotionSample) -> Result<(), SessionError> {
        let Some((course, measured)) = self.course.as_mut().zip(sample.measured) else { return Ok(()) };
        let off_m = course.off_m(sample.time_s, &measured);
        if off_m < OFF_M {
            course.off_since_s = None;
            return Ok(());
        }
        let since_s = *course.off_since_s.get_or_insert(sample.time_s);
        if sample.time_s - since_s < OFF_S {
            return Ok(());
        }
        Err(SessionError::NotFollowed(format!(
            "the platform's own reading is {:.0} mm from the program at t = {:.2} s, at any delay from {} to \
             {} s",
            1e3 * off_m,
            sample.time_s,
            DELAYS_S[0],
            DELAYS_S[1]
        )))
    }
}

impl Clock {
    fn program_s(&mut self, time_s: f64, offset_s: f64) -> f64 {
        match self {
            Self::First(first_s) => time_s - *first_s.get_or_insert(time_s),
            Self::Host { began_s } => time_s + offset_s - *began_s,
        }
    }
}

impl Course {
    fn put(&mut self, time_s: f64, read: &Six) {
        match self.bins.back_mut() {
            Some(last) if time_s < last.began_s + 0.99 * BIN_S => {
                last.sum.iter_mut().zip(read).for_each(|(sum, v)| *sum += v);
                (last.time_s, last.count) = (last.time_s + time_s, last.count + 1.0);
            }
            _ => self.bins.push_back(Bin { began_s: time_s, time_s, sum: *read, count: 1.0 }),
        }
        while self.bins.len() > BINS + 1 {
            self.bins.pop_front();
        }
    }

    /// Returns whether a whole window is there and has not been examined. The last bin is still being
    /// filled.
    fn is_due(&mut self) -> bool {
        let (Some(first), Some(last)) = (self.bins.front(), self.bins.back()) else { return false };
        let (span_s, now_s) = (last.began_s - first.began_s, last.began_s);
        let due = self.bins.len() > BINS && span_s < LONGEST_S && now_s >= self.looked_s + LOOK_S;
        if due {
            self.looked_s = now_s;
        }
        due
    }

    /// Returns how far a pose is from the program at the delay that suits it best, m.
    fn off_m(&self, time_s: f64, measured: &Pose) -> f64 {
        let steps = ((DELAYS_S[1] - DELAYS_S[0]) / BIN_S).round() as i32;
        (0..=steps).fold(f64::INFINITY, |least: f64, k| {
            let delay_s = DELAYS_S[0] + BIN_S * f64::from(k);
            let d = difference(&self.trajectory.state(time_s - delay_s).pose(), measured);
            let [way, turn] = [&d[..3], &d[3..]].map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt());
            least.min(way + ARM_M * turn)
        })
    }

    /// Believes what is seen several times in a row.
    fn believe(&mut self, seen: Seen) -> Result<(), SessionError> {
        let (kind, said) = match seen {
            Seen::Follows => {
                self.suspicions = [0; 3];
                return Ok(());
            }
            Seen::NotJudged => return Ok(()),
            Seen::Still => (
                0,
                format!(
                    "the plate is commanded to move, and for {} s after the IMU shows none of it",
                    DELAYS_S[1]
                ),
            ),
            Seen::Late(Some(delay_s)) => (
                1,
                format!(
                    "the plate moves {delay_s:.1} s after the program, and at most {} s is taken",
                    DELAYS_S[1]
                ),
            ),
            Seen::Late(None) => (1, "the plate moves otherwise than the program".to_owned()),
            Seen::Axis(axis, share) => (
                2,
                format!(
                    "{} of the plate does not follow: the IMU shows {:.0} % of what the program has it do",
                    AXES[axis],
                    100.0 * share
                ),
            ),
        };
        for (k, suspicion) in self.suspicions.iter_mut().enumerate() {
            *suspicion = if k == kind { *suspicion + 1 } else { 0 };
        }
        // A plate that stands still throughout the window is no chance.
        if self.suspicions[kind] < if kind == 0 { 1 } else { IN_A_ROW } {
            return Ok(());
        }
        let time_s = self.looked_s;
        Err(SessionError::NotFollowed(format!("{said} (t = {time_s:.2} s)")))
    }
}

/// The result of a check.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Seen {
    /// Too little moves to be judged.
    NotJudged,
    Follows,
    Still,
    /// The motion is late, by this much, s, if a delay explains it.
    Late(Option<f64>),
    /// The axis, and the share of its motion that is there.
    Axis(usize, f64),
}

struct Look<'a> {
    course: &'a Course,
    sensors: &'a IdealSensors,
    to_plate: &'a Matrix3<f64>,
    bias: Option<[f64; 3]>,
}

/// The program's prediction for the middle of a bin.
#[derive(Clone, Copy)]
struct Expected {
    six: Six,
    /// Acceleration of the plate's origin in P, m/s².
    origin: [f64; 3],
}

/// The program's predictions, every [`BIN_S`] from a time on, s.
struct Foresight {
    from_s: f64,
    steps: Vec<Expected>,
}

impl Foresight {
    /// Interpolates between the steps on straight lines.
    fn at(&self, time_s: f64) -> Expected {
        let place = ((time_s - self.from_s) / BIN_S).clamp(0.0, (self.steps.len() - 2) as f64);
        let (a, b) = (&self.steps[place as usize], &self.steps[place as usize + 1]);
        let part = place.fract();
        let line = |a: f64, b: f64| a + part * (b - a);
        Expected {
            six: std::array::from_fn(|k| line(a.six[k], b.six[k])),
            origin: std::array::from_fn(|k| line(a.origin[k], b.origin[k])),
        }
    }
}

impl Look<'_> {
    fn expected(&self, time_s: f64) -> Expected {
        let state: PlateState = self.course.trajectory.state(time_s);
        let (force, rate) = self.sensors.imu(&state);
        let [force, rate] = [force, rate].map(|v| self.to_plate * Vector3::from(v));
        let origin = state.rotation.transpose() * state.acceleration;
        Expected { six: [rate.x, rate.y, rate.z, force.x, force.y, force.z], origin: origin.into() }
    }

    fn foresight(&self, from_s: f64, to_s: f64) -> Foresight {
        let steps = ((to_s - from_s) / BIN_S).ceil() as usize + 2;
        let steps = (0..steps).map(|k| self.expected(from_s + BIN_S * k as f64)).collect();
        Foresight { from_s, steps }
    }

    /// Returns what is seen, and the bias where the plate rests or follows.
    fn judge(&self, axes: Axes) -> (Seen, Option<[f64; 3]>) {
        let bins = self.course.bins.iter().take(BINS);
        let (times, measured): (Vec<f64>, Vec<Six>) =
            bins.map(|bin| (bin.time_s / bin.count, bin.sum.map(|sum| sum / bin.count))).unzip();
        let (Some(first), Some(last)) = (times.first(), times.last()) else { return (Seen::NotJudged, None) };
        let foresight = self.foresight(first - DELAYS_S[1], last - DELAYS_S[0]);
        let expected_at = |delay_s: f64| times.iter().map(|t| foresight.at(t - delay_s)).collect::<Vec<_>>();
        let delays = || {
            let steps = ((DELAYS_S[1] - DELAYS_S[0]) / BIN_S).round() as i32;
            (0..=steps).map(|k| DELAYS_S[0] + BIN_S * f64::from(k))
        };
        let noise = noise(&measured);

        // At every delay that may be it moves: otherwise it may just rest.
        let least = delays().map(|d| motion(&sixes(&expected_at(d)))).fold(f64::INFINITY, f64::min);
        if least < LEAST.max(ABOVE_NOISE * noise) {
            let most = delays().map(|d| motion(&sixes(&expected_at(d)))).fold(0.0, f64::max);
            let rests = most < RESTS && motion(&measured) < RESTS.max(ABOVE_NOISE * noise);
            return (Seen::NotJudged, rests.then(|| bias(&measured, &expected_at(0.0))));
        }
        let beyond_noise = (motion(&measured).powi(2) - noise * noise).max(0.0).sqrt();
        if beyond_noise < DEAD * least {
            return (Seen::Still, None);
        }
        let (best, rest) = delays()
            .map(|d| (d, unexplained(&measured, &sixes(&expected_at(d)))))
            .fold((0.0, f64::INFINITY), |best, now| if now.1 < best.1 { now } else { best });
        let expected = expected_at(best);
        let axis = self.axis(&measured, &expected, noise);
        match axis {
            Some((axis, share)) if axes == Axes::Each => return (Seen::Axis(axis, share), None),
            Some(_) => return (Seen::Follows, None),
            None => {}
        }
        if rest < FOLLOWS {
            return (Seen::Follows, self.bias.map(|_| bias(&measured, &expected)));
        }
        let earlier = self.foresight(first - LATEST_S, *last);
        let lagging = |delay_s: f64| {
            let six: Vec<Six> = times.iter().map(|t| earlier.at(t - delay_s).six).collect();
            (delay_s, unexplained(&measured, &six))
        };
        let later = ((LATEST_S - DELAYS_S[1]) / BIN_S) as i32;
        let mut lags = (1..=later).map(|k| lagging(DELAYS_S[1] + BIN_S * f64::from(k)));
        (Seen::Late(lags.find(|(_, rest)| *rest < LAGS).map(|(delay_s, _)| delay_s)), None)
    }

    /// Returns the axis that does not follow, with its share: turns first, as a missing turn changes what is
    /// felt along the others.
    fn axis(&self, measured: &[Six], expected: &[Expected], noise: f64) -> Option<(usize, f64)> {
        let turns = [0, 1, 2].map(|k| {
            let pairs: Vec<[f64; 2]> = measured.iter().zip(expected).map(|(m, f)| [m[k], f.six[k]]).collect();
            Share::of(&pairs)
        });
        let all = turns.iter().map(|turn| turn.predicted * turn.predicted).sum::<f64>().sqrt();
        let dead = |share: f64| !(DEAD..MOST).contains(&share);
        let judged =
            |turn: &Share| turn.predicted > LEAST.max(ABOVE_NOISE * noise) && turn.predicted > OF_ALL * all;
        let axis = turns.iter().position(|turn| judged(turn) && dead(turn.share));
        if let Some(k) = axis {
            return Some((3 + k, turns[k].share));
        }
        if turns.iter().any(|turn| judged(turn) && !(0.6..1.6).contains(&turn.share)) {
            return None;
        }
        // What is felt beyond what the turns make: f − (f predicted − a) is the acceleration.
        let ways = [0, 1, 2].map(|k| {
            let raw = |(m, f): (&Six, &Expected)| [m[3 + k] - f.six[3 + k] + f.origin[k], f.origin[k]];
            let pairs: Vec<[f64; 2]> = measured.iter().zip(expected).map(raw).collect();
            match self.bias {
                Some(bias) => Share::of(&pairs.iter().map(|[m, f]| [m - bias[k], *f]).collect::<Vec<_>>()),
                None => Share::of(&without_mean(pairs)),
            }
        });
        let all_ways = ways.iter().map(|way| way.predicted * way.predicted).sum::<f64>().sqrt();
        // Delay and scale leave this much of gravity and of the turns in it.
        let leak = 9.81 * all * LEAK_S + ACCELERATION * noise;
        let judged = |way: &Share| {
            way.predicted > (3.0 * leak).max(ACCELERATION * LEAST) && way.predicted > OF_ALL * all_ways
        };
        ways.iter().position(|way| judged(way) && dead(way.share)).map(|k| (k, ways[k].share))
    }
}

/// The share of a predicted signal in the one read.
#[derive(Clone, Copy)]
struct Share {
    /// Root mean square of what is predicted.
    predicted: f64,
    share: f64,
}

impl Share {
    /// Makes a line of pairs read, predicted; the most distant few are left out.
    fn of(pairs: &[[f64; 2]]) -> Self {
        let fit = |pairs: &[[f64; 2]]| {
            let sum = |f: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(f).sum::<f64>();
            sum(&|[m, f]| m * f) / sum(&|[_, f]| f * f).max(f64::MIN_POSITIVE)
        };
        let share = fit(pairs);
        let mut kept = pairs.to_vec();
        kept.sort_by(|[m, f], [n, g]| (m - share * f).abs().total_cmp(&(n - share * g).abs()));
        kept.truncate(pairs.len().saturating_sub(OUTLIERS));
        let predicted = (pairs.iter().map(|[_, f]| f * f).sum::<f64>() / pairs.len().max(1) as f64).sqrt();
        Self { predicted, share: fit(&kept) }
    }
}

fn without_mean(mut pairs: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let n = pairs.len().max(1) as f64;
    for k in [0, 1] {
        let mean = pairs.iter().map(|pair| pair[k]).sum::<f64>() / n;
        pairs.iter_mut().for_each(|pair| pair[k] -= mean);
    }
    pairs
}

/// Returns the mean of the specific force read less that predicted, m/s².
fn bias(measured: &[Six], expected: &[Expected]) -> [f64; 3] {
    let n = measured.len().max(1) as f64;
    std::array::from_fn(|k| {
        measured.iter().zip(expected).map(|(m, f)| m[3 + k] - f.six[3 + k]).sum::<f64>() / n
    })
}

fn sixes(expected: &[Expected]) -> Vec<Six> {
    expected.iter().map(|f| f.six).collect()
}

/// Returns the specific force without its mean, which holds gravity and the bias; all as rad/s.
fn moving(six: &[Six]) -> Vec<Six> {
    let n = six.len().max(1) as f64;
    let mean: Six =
        std::array::from_fn(|k| if k < 3 { 0.0 } else { six.iter().map(|s| s[k]).sum::<f64>() / n });
    six.iter()
        .map(|s| std::array::from_fn(|k| (s[k] - mean[k]) / if k < 3 { 1.0 } else { ACCELERATION }))
        .collect()
}

/// Returns the mean of the squares of the rows, the largest few left out.
fn squares(rows: impl Iterator<Item = f64>) -> f64 {
    let mut squares: Vec<f64> = rows.collect();
    squares.sort_by(f64::total_cmp);
    squares.truncate(squares.len().saturating_sub(OUTLIERS));
    squares.iter().sum::<f64>() / squares.len().max(1) as f64
}

/// Returns the root mean square of a motion, rad/s.
fn motion(six: &[Six]) -> f64 {
    squares(moving(six).iter().map(|s| s.iter().map(|v| v * v).sum())).sqrt()
}

/// Returns the share of the energy predicted that is not in what is read.
fn unexplained(measured: &[Six], expected: &[Six]) -> f64 {
    let (m, f) = (moving(measured), moving(expected));
    let distance = |(a, b): (&Six, &Six)| a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
    squares(m.iter().zip(&f).map(distance)) / motion(expected).powi(2).max(f64::MIN_POSITIVE)
}

/// Returns the noise of averaged readings, rad/s: by how much one differs from the middle of its neighbours.
fn noise(measured: &[Six]) -> f64 {
    let rows = measured.windows(3).map(|w| {
        (0..6)
            .map(|k| {
                let scale = if k < 3 { 1.0 } else { ACCELERATION };
                ((w[1][k] - 0.5 * (w[0][k] + w[2][k])) / scale).powi(2) / 1.5
            })
            .sum::<f64>()
    });
    squares(rows).sqrt()
}

#[cfg(all(test, feature = "simulator"))]
#[path = "motion_guard_tests.rs"]
mod tests;
