//! Checks whether a recording's attitudes, gyros and joint columns are of one motion, before it is believed.
//!
//! Lives here: gross errors of units, signs and axes, which the fit would take for bodies and which two
//! measurements of one motion contradict. Nothing is differentiated: how far something has turned over a
//! tenth of a second is compared with the integral of its rate. May not live here: |a| against gravity
//! ([`crate::body::input_checks`]), columns that are missing ([`super::prepare`]).

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use rigident_io::motion_capture::registration::nearest_rotation;
use rigident_model::idle::white_noise;

/// The compared values are increments over this, s: long against the noise of gyros, short against turns that
/// do not commute.
pub const SPAN_S: f64 = 0.1;
/// This many of them say enough.
const MOST_SPANS: usize = 2000;
/// Less than this in a span is hardly motion, rad, and m.
const LEAST_TURN: f64 = 0.005;
const LEAST_SLIDE: f64 = 0.001;
/// Nor is what is not this many times the noise.
const NOISES: f64 = 3.0;
/// A gyro's bias up to this is none of the errors meant here, rad/s.
const BIAS: f64 = 0.2;
/// The rms of the difference over that of the motion, from which on the two are not of one motion.
pub const CONTRADICTION: f64 = 0.5;
/// From which on it is worth telling.
const NOTICEABLE: f64 = 0.25;
/// Up to which an error explains it, and is named.
const EXPLAINED: f64 = 0.2;
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

/// Stretches of a recording without a gap, over which increments are compared.
#[derive(Clone, Debug)]
pub struct Spans {
    starts: Vec<usize>,
    length: usize,
    period_s: f64,
}

impl Spans {
    /// Returns the spans of rows at these times, ns.
    pub fn new(time_ns: &[u64], rate_hz: f64) -> Self {
        let length = (SPAN_S * rate_hz).round().clamp(1.0, 1e6) as usize;
        let period_s = 1.0 / rate_hz;
        let longest = (length as f64 + 0.5) * 1e9 * period_s;
        let whole = |start: &usize| match (time_ns.get(*start), time_ns.get(start + length)) {
            (Some(from), Some(to)) => (to.saturating_sub(*from) as f64) < longest,
            _ => false,
        };
        let all: Vec<usize> =
            (0..time_ns.len().saturating_sub(length)).step_by(length).filter(whole).collect();
        let every = all.len().div_ceil(MOST_SPANS).max(1);
        Self { starts: all.into_iter().step_by(every).collect(), length, period_s }
    }

    fn seconds(&self) -> f64 {
        self.length as f64 * self.period_s
    }

    /// Returns the variance of the trapezoidal integral of white noise of unit variance, s².
    fn integral_variance(&self) -> f64 {
        self.seconds() * self.period_s
    }

    /// Returns the trapezoidal integral over every span.
    fn integrals(&self, rate: impl Fn(usize) -> Vector3<f64>) -> Vec<Vector3<f64>> {
        let of = |start: usize| {
            let ends = (rate(start) + rate(start + self.length)) / 2.0;
            (start + 1..start + self.length).fold(ends, |sum, row| sum + rate(row)) * self.period_s
        };
        self.starts.iter().map(|start| of(*start)).collect()
    }
}

fn rms(values: &[Vector3<f64>]) -> f64 {
    let square: f64 = values.iter().map(Vector3::norm_squared).sum();
    (square / values.len().max(1) as f64).sqrt()
}

fn mean(values: &[Vector3<f64>]) -> Vector3<f64> {
    values.iter().sum::<Vector3<f64>>() / values.len().max(1) as f64
}

fn less(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Two accounts of one motion that differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// Rms of the difference over the rms of the motion, noise taken off.
    pub share: f64,
    /// The distance that it moves in a span by its positions or attitudes, rms, rad or m.
    pub moved: f64,
    /// The distance by the rates.
    pub integrated: f64,
    /// The error that explains it, and what to do, in words.
    pub cause: Option<String>,
}

impl Disagreement {
    /// Returns whether the two measurements are of different motions.
    pub fn is_gross(&self) -> bool {
        self.share > CONTRADICTION
    }
}

/// Rms of the difference of increments over that of the larger, white noise of this rms taken off.
fn share(moved: &[Vector3<f64>], integrated: &[Vector3<f64>], noise: f64) -> f64 {
    let motion = rms(moved).max(rms(integrated));
    let difference = rms(&less(moved, integrated));
    (difference.powi(2) - noise.powi(2)).max(0.0).sqrt() / motion.max(f64::MIN_POSITIVE)
}

/// The information of a link's attitude and the gyros on its turning against the base.
#[derive(Clone, Copy, Debug)]
pub struct Turning<'a> {
    /// The link's number in the recording.
    pub number: usize,
    /// The link's name.
    pub name: &'a str,
    /// S axes ← link axes, w, x, y, z.
    pub attitudes: &'a [[f64; 4]],
    /// The link's rate, link axes, rad/s.
    pub rate: &'a [Vector3<f64>],
    /// The base's rate, axes of S, rad/s; `None`: held still.
    pub base: Option<&'a [Vector3<f64>]>,
    /// `R_LU` by which the link's rate was brought to the link's axes.
    pub mounting: UnitQuaternion<f64>,
}

/// The orders that four columns can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    AsSaid,
    Inverse,
    ScalarLast,
}

/// A possible deviation from what is stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Error {
    order: Order,
    against_world: bool,
    link_in_degrees: bool,
    base_in_degrees: bool,
}

const NO_ERROR: Error =
    Error { order: Order::AsSaid, against_world: false, link_in_degrees: false, base_in_degrees: false };

impl Error {
    fn count(self) -> usize {
        usize::from(self.order != Order::AsSaid)
            + usize::from(self.against_world)
            + usize::from(self.link_in_degrees)
            + usize::from(self.base_in_degrees)
    }

    /// Returns all combinations of errors; those of the base only if `with_base`.
    fn all(with_base: bool) -> Vec<Self> {
        let both = [false, true];
        let mut all = Vec::new();
        for order in [Order::AsSaid, Order::Inverse, Order::ScalarLast] {
            for against_world in both {
                for link_in_degrees in both {
                    for base_in_degrees in both {
                        all.push(Self { order, against_world, link_in_degrees, base_in_degrees });
                    }
                }
            }
        }
        // Without the base's rate nothing of it can be wrong; what the world sees has no part of it.
        all.retain(|e| with_base || !(e.against_world || e.base_in_degrees));
        all.retain(|e| *e != NO_ERROR && !(e.against_world && e.base_in_degrees));
        all
    }

    fn words(self, number: usize, name: &str) -> String {
        let q = format!("q{number}_…");
        let degrees = |imu: String| {
            format!(
                "{imu} seem to be in deg/s, 180/π = 57.3 times too large: give scale = 0.0174532925 for them \
                 in [recording] columns of the rig file"
            )
        };
        let order = match self.order {
            Order::AsSaid => None,
            Order::Inverse => Some(format!(
                "{q} seems to be the inverse: it must bring vectors from the axes of {name} to those of S; \
                 negate q{number}_x, q{number}_y and q{number}_z"
            )),
            Order::ScalarLast => Some(format!(
                "{q} seems to have its scalar part last: w comes first; exchange the names in [recording] \
                 columns of the rig file"
            )),
        };
        let parts = [
            order,
            self.against_world.then(|| {
                format!(
                    "{q} seems to be relative to the world: it must be relative to S, so multiply it by \
                         the inverse of the base's"
                )
            }),
            self.link_in_degrees.then(|| degrees(format!("imu{number}_gx_radps …"))),
            self.base_in_degrees.then(|| degrees("imu0_gx_radps … (imu_gx_radps …)".to_owned())),
        ];
        parts.into_iter().flatten().collect::<Vec<String>>().join("; and ")
    }
}

/// Increments under some error's assumption: turned, by the link's gyro, by the base's; link axes, rad.
struct Increments {
    turned: Vec<Vector3<f64>>,
    own: Vec<Vector3<f64>>,
    carried: Vec<Vector3<f64>>,
}

impl Increments {
    /// Returns the turns by the gyros, with a bias taken off that is none of the errors meant here.
    fn integrated(&self, seconds: f64) -> Vec<Vector3<f64>> {
        let plain = less(&self.own, &self.carried);
        let bias = mean(&less(&plain, &self.turned));
        if bias.norm() > BIAS * seconds { plain } else { plain.iter().map(|p| p - bias).collect() }
    }
}

impl Turning<'_> {
    fn attitude(&self, row: usize, order: Order) -> UnitQuaternion<f64> {
        let [a, b, c, d] = self.attitudes.get(row).copied().unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let said = |w, x, y, z| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
        match order {
            Order::AsSaid => said(a, b, c, d),
            Order::Inverse => said(a, -b, -c, -d),
            Order::ScalarLast => said(d, a, b, c),
        }
    }

    fn increments(&self, spans: &Spans, error: Error) -> Increments {
        let at = |row: usize| self.attitude(row, error.order);
        let unit = |degrees: bool| if degrees { 1.0 / DEGREES } else { 1.0 };
        let (own, base) = (unit(error.link_in_degrees), unit(error.base_in_degrees));
        let rate = |rates: &[Vector3<f64>], row: usize| rates.get(row).copied().unwrap_or_default();
        let base_seen = self.base.filter(|_| !error.against_world);
        Increments {
            turned: spans
                .starts
                .iter()
                .map(|start| (at(*start).inverse() * at(start + spans.length)).scaled_axis())
                .collect(),
            own: spans.integrals(|row| rate(self.rate, row) * own),
            carried: spans.integrals(|row| match base_seen {
                Some(rates) => at(row).inverse() * rate(rates, row) * base,
                None => Vector3::zeros(),
            }),
        }
    }

    /// Rms of the white noise of an increment of the attitude less that of the gyros, rad.
    fn noise(&self, spans: &Spans) -> f64 {
        let mut before = [1.0, 0.0, 0.0, 0.0];
        // q and −q are one attitude.
        let continuous: Vec<[f64; 4]> = self
            .attitudes
            .iter()
            .map(|q| {
                let along: f64 = q.iter().zip(before).map(|(a, b)| a * b).sum();
                before = if along < 0.0 { q.map(|v| -v) } else { *q };
                before
            })
            .collect();
        let variance = |of: &dyn Fn(usize) -> Vec<f64>, axes: usize| {
            (0..axes).map(|k| white_noise(&of(k)).powi(2)).sum::<f64>()
        };
        // An angle is twice a quaternion's vector part, and there are two ends.
        let attitude = 8.0 * variance(&|k| continuous.iter().map(|q| q[k]).collect(), 4);
        let gyro = |rates: &[Vector3<f64>]| variance(&|k| rates.iter().map(|w| w[k]).collect(), 3);
        let gyros = gyro(self.rate) + self.base.map_or(0.0, gyro);
        (attitude + gyros * spans.integral_variance()).sqrt()
    }

    /// Compares how the attitude changes with what the gyros say; `None` if they agree, or little moves.
    pub fn disagreement(&self, spans: &Spans) -> Option<Disagreement> {
        let judge = |error: Error, noise: f64| {
            let increments = self.increments(spans, error);
            let integrated = increments.integrated(spans.seconds());
            let share = share(&increments.turned, &integrated, noise);
            (share, rms(&increments.turned), rms(&integrated), increments)
        };
        let noise = self.noise(spans);
        let (share, moved, integrated, increments) = judge(NO_ERROR, noise);
        if moved.max(integrated) < LEAST_TURN.max(NOISES * noise) || share <= NOTICEABLE {
            return None;
        }
        // Noise in deg/s is not this noise.
        let left = |error: Error| {
            let (left, turned, ..) = judge(error, 0.0);
            (turned > LEAST_TURN && left < EXPLAINED.min(share / 2.0)).then_some((left, error))
        };
        // A single error rather than two, and of those the one that leaves least.
        let errors: Vec<(f64, Error)> =
            Error::all(self.base.is_some()).into_iter().filter_map(left).collect();
        let order =
            |a: &&(f64, Error), b: &&(f64, Error)| a.1.count().cmp(&b.1.count()).then(a.0.total_cmp(&b.0));
        let named = errors.iter().min_by(order).map(|(_, error)| *error);
        let cause =
            named.map(|error| error.words(self.number, self.name)).or_else(|| self.turned(&increments));
        Some(Disagreement { share, moved, integrated, cause })
    }

    /// Returns whether the gyro's axes are turned against the link's: turned + carried = X own (Wahba's
    /// problem).
    fn turned(&self, increments: &Increments) -> Option<String> {
        let of_link: Vec<Vector3<f64>> =
            increments.turned.iter().zip(&increments.carried).map(|(t, c)| t + c).collect();
        let product = of_link.iter().zip(&increments.own).map(|(a, b)| a * b.transpose());
        let product = product.sum::<Matrix3<f64>>();
        // About a single axis nothing can be determined of it.
        let singular = product.singular_values();
        if singular[1] < 1e-3 * singular[0] {
            return None;
        }
        let x = nearest_rotation(&product)?;
        let own: Vec<Vector3<f64>> = increments.own.iter().map(|w| x * w).collect();
        let left = rms(&less(&of_link, &own)) / rms(&own).max(f64::MIN_POSITIVE);
        if left > EXPLAINED {
            return None;
        }
        let x = UnitQuaternion::from_matrix(&x);
        let now = x * self.mounting;
        Some(format!(
            "the axes of the IMU on {} seem to be turned by {:.0}° against what [[imu]] link = {} says: by \
             these readings its rotation_wxyz is [{:.3}, {:.3}, {:.3}, {:.3}]",
            self.name,
            x.angle().to_degrees(),
            self.number,
            now.w,
            now.i,
            now.j,
            now.k
        ))
    }
}

/// Compares a joint's positions with its rates; `None` if they agree, or little moves. `columns` are their
/// names.
pub fn joint_disagreement(
    spans: &Spans,
    positions: &[f64],
    rates: &[f64],
    slides: bool,
    columns: [&str; 2],
) -> Option<Disagreement> {
    let at = |values: &[f64], row: usize| values.get(row).copied().unwrap_or_default();
    let increment = |start: &usize| at(positions, start + spans.length) - at(positions, *start);
    let moved: Vec<Vector3<f64>> = spans.starts.iter().map(|s| Vector3::x() * increment(s)).collect();
    let integrated = spans.integrals(|row| Vector3::x() * at(rates, row));
    let noise = (2.0 * white_noise(positions).powi(2)
        + white_noise(rates).powi(2) * spans.integral_variance())
    .sqrt();
    let share = share(&moved, &integrated, noise);
    let (rms_moved, rms_integrated) = (rms(&moved), rms(&integrated));
    let least = if slides { LEAST_SLIDE } else { LEAST_TURN };
    if rms_moved.max(rms_integrated) < least.max(NOISES * noise) || share <= NOTICEABLE {
        return None;
    }
    // Increments = factor · integrals
    let product =
        |a: &[Vector3<f64>], b: &[Vector3<f64>]| a.iter().zip(b).map(|(a, b)| a.x * b.x).sum::<f64>();
    let factor = product(&moved, &integrated) / product(&integrated, &integrated).max(f64::MIN_POSITIVE);
    let scaled: Vec<Vector3<f64>> = integrated.iter().map(|v| v * factor).collect();
    let explained = rms(&less(&moved, &scaled)) < EXPLAINED * rms_moved;
    let cause = explained.then(|| factor_in_words(factor, slides, columns));
    Some(Disagreement { share, moved: rms_moved, integrated: rms_integrated, cause })
}

/// Returns what a factor between increments of positions and integrals of rates tells.
fn factor_in_words(factor: f64, slides: bool, [position, rate]: [&str; 2]) -> String {
    let is = |known: f64| (factor.abs() / known - 1.0).abs() < 0.1;
    let unit = match slides {
        _ if is(1.0) => None,
        false if is(1.0 / DEGREES) => Some((rate, "deg/s", "180/π = 57.3 times")),
        false if is(DEGREES) => Some((position, "deg", "180/π = 57.3 times")),
        true if is(1e-3) => Some((rate, "mm/s", "1000 times")),
        true if is(1e3) => Some((position, "mm", "1000 times")),
        _ => {
            return format!(
                "{position} changes by {factor:.4} times the integral of {rate}: is one of them geared, or \
                 in another unit? Give its scale in [[joint]] of the rig file"
            );
        }
    };
    let sign = format!("{rate} has the opposite sign of {position}");
    match unit {
        None => format!(
            "{sign}: give scale = -1 for one of them in [[joint]] of the rig file, by the model's axis"
        ),
        Some((column, unit, times)) => {
            let said = format!(
                "{column} seems to be in {unit}, {times} too large: give its scale in [[joint]] of the rig \
                 file"
            );
            if factor < 0.0 { format!("{said}; and {sign}") } else { said }
        }
    }
}

#[cfg(test)]
#[path = "input_checks_tests.rs"]
mod tests;
