//! Checks whether a recording can be what its rig file says, before it is believed.
//!
//! Lives here: gross errors of units and of kind that the fit itself would take for a body: an accelerometer
//! in g, a load cell that says nothing, a moving body taken for still poses. May not live here: single bad
//! readings ([`rigident_shared::screening`]), what the residuals tell afterwards.

use rigident_shared::calibration::Reading;

use super::Input;
use super::errors::GRAVITY;
use rigident_io::recording::Recording;
use rigident_io::rig::FROZEN_AFTER;

/// The specific force at rest is within this factor of gravity, either way.
const FACTOR: f64 = 2.0;
/// Length of the stretches that are compared for their quiet, s.
const STRETCH_S: f64 = 1.0;
/// The quietest tenth of the stretches is the nearest to rest that there is.
const QUIETEST: usize = 10;
/// Rotation may press the IMU by ω² and ω̇ times its lever, m, at least this one, without a unit being wrong;
const LEVER_M: f64 = 1.0;
/// no IMU on a load cell is further away than this,
const FARTHEST_M: f64 = 3.0;
/// and a place of this many metres is one in millimetres.
const MILLIMETRES: f64 = 10.0;
/// A unit is named if it explains the reading to within this share.
const UNIT_TOLERANCE: f64 = 0.1;
/// Less than this share of gravity is what is left where somebody subtracts it.
const WITHOUT: f64 = 0.25;
/// The length of gravity columns differs from gravity by at most this many standard deviations of both,
const LENGTH_SD: f64 = 4.42;
/// or by this share, as that of a table or a level with few digits does,
const FEW_DIGITS: f64 = 1e-3;
/// and scatters from pose to pose by at most this share.
const SCATTERS: f64 = 0.01;
/// One g of an accelerometer in g, m/s².
const STANDARD_GRAVITY: f64 = 9.80665;
/// The rate above which there is no still pose, rad/s.
const TURNING_RADPS: f64 = 0.1;
/// Poses held for less than this are hardly still poses, s.
const SHORTEST_POSE_S: f64 = 0.05;

/// Why a recording is not what it is said to be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Implausible {
    /// Wrong unit or scale.
    #[error(
        "at rest |a| is {measured:.3}, while gravity_mps2 is {gravity}: {what} must be in m/s²{}",
        unit.map_or_else(
            || if *measured < WITHOUT * gravity {
                "; gravity seems to have been taken out of it: record the specific force as the sensor reads \
                 it, 9.8 m/s² at rest, not a linear acceleration".to_owned()
            } else {
                "; check its unit and scale, and gravity_mps2 in [recording]".to_owned()
            },
            |(name, scale)| format!(
                ", and this looks like {name}: give scale = {scale} in [recording] columns of the rig file, \
                 or accel_scale in [[imu]]"
            )
        )
    )]
    NotGravity {
        /// |a| where it is quietest, in the unit it has.
        measured: f64,
        /// Gravity, m/s².
        gravity: f64,
        /// The columns.
        what: &'static str,
        /// The unit it seems to be in, and the factor from it to m/s².
        unit: Option<(&'static str, f64)>,
    },
    /// Gravity columns of another length than gravity has, or of several.
    #[error(
        "the gravity columns are {length:.4} m/s² long on average and scatter by {scatter:.4} m/s² from pose to \
         pose, while gravity_mps2 is {gravity}: {}",
        if *scatter > SCATTERS * *gravity {
            "gravity has one length; an axis of them has another scale or sign, or they are the readings of an \
             accelerometer, which are to be given as imu_ax_mps2 … with the class of the IMU"
        } else {
            "correct their scale in [recording] columns of the rig file, or gravity_mps2 in [recording]"
        }
    )]
    GravityLength {
        /// Mean length of the columns, m/s².
        length: f64,
        /// Standard deviation of the length, m/s².
        scatter: f64,
        /// Gravity as it is stated, m/s².
        gravity: f64,
    },
    /// The load cell gives one value for ever.
    #[error(
        "the wrench is the same in all {0} rows, to the last digit: the load cell is frozen or not \
         connected; check its cable, its supply and the program that recorded it"
    )]
    FrozenWrench(usize),
    /// The IMU gives one value for ever.
    #[error(
        "the IMU's readings are the same in all {0} rows, to the last digit: it is frozen or not connected; \
         check its cable, its supply and the program that recorded it"
    )]
    FrozenImu(usize),
    /// Channels that give one value for ever while the others of their sensor have noise.
    #[error(
        "{} never {}, to the last digit, while the other channels of the same sensor have noise: dead, or \
         not connected; check its cable and the program that recorded it",
        _0.join(", "),
        if _0.len() == 1 { "changes" } else { "change" }
    )]
    Dead(Vec<String>),
    /// Channels of one sensor that are the same in every row.
    #[error(
        "{} are the same in every row, to the last digit, though they have noise: one was copied into the \
         other's column; look at the names in [recording] columns of the rig file, and at the program that \
         recorded them",
        _0.iter().map(|pair| pair.join(" and ")).collect::<Vec<_>>().join(", ")
    )]
    Copied(Vec<[String; 2]>),
    /// Not still poses.
    #[error(
        "static = true says that every row is a still pose, but in {turning} of {rows} rows the gyro is more \
         than {TURNING_RADPS} rad/s off its median, up to {fastest:.2} rad/s: take static = true out of the \
         rig file, or keep only the rows at rest"
    )]
    Turning {
        /// Rows in which it turns.
        turning: usize,
        /// All rows.
        rows: usize,
        /// The fastest, rad/s.
        fastest: f64,
    },
}

/// Checks that no channel of a sensor is dead, nor a copy of another one.
///
/// # Errors
/// [`Implausible::Dead`], [`Implausible::Copied`].
pub fn check_channels(recording: &Recording) -> Result<(), Implausible> {
    let dead = recording.dead_channels();
    if !dead.is_empty() {
        return Err(Implausible::Dead(dead));
    }
    match recording.copied_channels() {
        pairs if pairs.is_empty() => Ok(()),
        pairs => Err(Implausible::Copied(pairs)),
    }
}

/// Checks the readings with the mounting that they will be identified with; `gravity_columns` if they hold
/// gravity in place of what an accelerometer read.
///
/// # Errors
/// [`Implausible`], in the order in which one fault would show as the next.
pub fn check(input: &Input, gravity_mps2: f64, gravity_columns: bool) -> Result<(), Implausible> {
    let readings = &input.readings;
    if !input.is_static && readings.len() >= usize::from(FROZEN_AFTER) {
        let alike = |of: &dyn Fn(&Reading<f64>) -> [f64; 6]| {
            readings.windows(2).all(|pair| matches!(pair, [a, b] if of(a) == of(b)))
        };
        if alike(&|r| r.wrench.array()) {
            return Err(Implausible::FrozenWrench(readings.len()));
        }
        if alike(&|r| {
            let ([a, b, c], [d, e, f]) = (r.specific_force.array(), r.angular_rate.array());
            [a, b, c, d, e, f]
        }) {
            return Err(Implausible::FrozenImu(readings.len()));
        }
    }
    let mounting = &input.mounting;
    let (accel_bias, gyro_bias) = (mounting.accel_bias.array(), mounting.gyro_bias.array());
    let calibrated = |r: &Reading<f64>| {
        let (a, w) = (r.specific_force.array(), r.angular_rate.array());
        let force: [f64; 3] = std::array::from_fn(|k| mounting.accel_scale[k] * a[k] - accel_bias[k]);
        (force, std::array::from_fn(|k| w[k] - gyro_bias[k]))
    };
    let lever_m = length(mounting.position.array());
    let at_rest = at_rest(readings, calibrated, input.is_static, input.rate_hz);
    compare(at_rest, gravity_mps2, gravity_columns, lever_m)?;
    if !gravity_columns {
        return Ok(());
    }
    let known = input.nuisances.iter().find(|nuisance| nuisance.name == GRAVITY);
    let known_sd = known.map_or(0.0, |nuisance| nuisance.sigma * gravity_mps2);
    let lengths = readings.iter().map(|reading| length(calibrated(reading).0)).filter(|v| v.is_finite());
    check_length(&lengths.collect::<Vec<_>>(), gravity_mps2, known_sd)
}

/// Checks the lengths of gravity columns against gravity, known to `known_sd`, m/s², and against each other.
fn check_length(lengths: &[f64], gravity: f64, known_sd: f64) -> Result<(), Implausible> {
    let count = lengths.len() as f64;
    let length = lengths.iter().sum::<f64>() / count.max(1.0);
    let square = lengths.iter().map(|own| (own - length).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let most = (LENGTH_SD * (square / count.max(1.0) + known_sd * known_sd).sqrt()).max(FEW_DIGITS * gravity);
    let scatter = square.sqrt();
    if lengths.is_empty() || ((length - gravity).abs() <= most && scatter <= SCATTERS * gravity) {
        return Ok(());
    }
    Err(Implausible::GravityLength { length, scatter, gravity })
}

/// Returns what to know of an IMU's place, m, that can hardly be in metres.
pub fn far_away(position_m: [f64; 3]) -> Option<String> {
    let far = length(position_m);
    (far >= MILLIMETRES).then(|| {
        format!(
            "position_m of the IMU is {far:.0} m from the load cell: it is in metres; was it given in \
                 millimetres?"
        )
    })
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Checks |a| where it is quietest against gravity: calibrated specific forces, m/s², each with its rate,
/// rad/s, of a sensor that sits `lever_m` away from the origin.
///
/// # Errors
/// [`Implausible::NotGravity`].
pub fn check_gravity(
    readings: impl Iterator<Item = ([f64; 3], [f64; 3])>,
    is_static: bool,
    rate_hz: f64,
    gravity_mps2: f64,
    gravity_columns: bool,
    lever_m: f64,
) -> Result<(), Implausible> {
    let readings: Vec<_> = readings.collect();
    compare(
        at_rest(&readings, |reading| *reading, is_static, rate_hz),
        gravity_mps2,
        gravity_columns,
        lever_m,
    )
}

/// Compares the specific force of [`at_rest`] with gravity.
fn compare(
    at_rest: Option<(f64, f64)>,
    gravity_mps2: f64,
    gravity_columns: bool,
    lever_m: f64,
) -> Result<(), Implausible> {
    let Some((measured, turning)) = at_rest else { return Ok(()) };
    let outwards = turning * lever_m.clamp(LEVER_M, FARTHEST_M);
    if (gravity_mps2 / FACTOR - outwards..=gravity_mps2 * FACTOR + outwards).contains(&measured) {
        return Ok(());
    }
    let scales = [("g", STANDARD_GRAVITY), ("mg", 1e-3 * STANDARD_GRAVITY)];
    let unit = scales.into_iter().find(|(_, s)| (measured * s / gravity_mps2 - 1.0).abs() < UNIT_TOLERANCE);
    let what = if gravity_columns { "the gravity columns" } else { "the accelerometer" };
    Err(Implausible::NotGravity { measured, gravity: gravity_mps2, what, unit })
}

/// Returns the median |a| of the quietest stretches, and the median of `mean ω² + |mean ω̇|` in them, 1/s²,
/// which bounds the contribution of a metre of lever to a mean. `of` gives a reading's force and rate. `None`
/// without finite readings.
fn at_rest<R>(
    readings: &[R],
    of: impl Fn(&R) -> ([f64; 3], [f64; 3]),
    is_static: bool,
    rate_hz: f64,
) -> Option<(f64, f64)> {
    let rows = if is_static { 1 } else { (STRETCH_S * rate_hz).round().clamp(1.0, 1e6) as usize };
    // Spread, |mean specific force|, what turning brings to a metre of lever, of each stretch.
    let mut stretches: Vec<(f64, f64, f64)> = readings
        .chunks(rows)
        .filter(|part| part.len() == rows || part.len() == readings.len())
        .map(|part| {
            let part: Vec<_> = part.iter().map(&of).collect();
            let n = part.len() as f64;
            let middle: [f64; 3] = std::array::from_fn(|k| part.iter().map(|r| r.0[k]).sum::<f64>() / n);
            let square = part.iter().flat_map(|r| r.1).map(|w| w * w).sum::<f64>() / n;
            let ends = part.first().zip(part.last());
            let gained = ends.map_or([0.0; 3], |(a, b)| std::array::from_fn(|k| b.1[k] - a.1[k]));
            let turning = if is_static { square } else { square + length(gained) * rate_hz / n };
            let spread = part.iter().flat_map(|r| r.0.into_iter().zip(middle)).map(|(a, m)| (a - m).powi(2));
            (spread.sum::<f64>() / n, length(middle), turning)
        })
        .filter(|(spread, force, turning)| (spread + force + turning).is_finite())
        .collect();
    stretches.sort_by(|a, b| a.0.total_cmp(&b.0));
    let quiet = if is_static { stretches.len() } else { stretches.len().div_ceil(QUIETEST) };
    stretches.truncate(quiet);
    let force = median(stretches.iter().map(|s| s.1).collect())?;
    Some((force, median(stretches.iter().map(|s| s.2).collect())?))
}

/// Checks that rows said to be still poses are: a gyro, if there is one, must not turn in a tenth of them or
/// more.
///
/// # Errors
/// [`Implausible::Turning`].
pub fn check_still(gyro: &[[f64; 3]]) -> Result<(), Implausible> {
    let middle: [f64; 3] =
        std::array::from_fn(|k| median(gyro.iter().map(|w| w[k]).collect()).unwrap_or(0.0));
    let rates = gyro.iter().map(|w| w.iter().zip(middle).map(|(w, m)| (w - m).powi(2)).sum::<f64>().sqrt());
    let (mut turning, mut fastest) = (0, 0.0_f64);
    for rate in rates {
        turning += usize::from(rate > TURNING_RADPS);
        fastest = fastest.max(rate);
    }
    if 10 * turning > gyro.len() {
        return Err(Implausible::Turning { turning, rows: gyro.len(), fastest });
    }
    Ok(())
}

/// Returns what to know if rows said to be still poses have times, s, that follow each other too closely for
/// that.
pub fn hurried_poses(time_s: &[f64]) -> Option<String> {
    let steps = time_s.windows(2).filter_map(|w| Some(w.last()? - w.first()?)).collect();
    let step = median(steps).filter(|step| *step > 0.0 && *step < SHORTEST_POSE_S)?;
    Some(format!(
        "static = true says that every row is a still pose, but by t_s one comes every {:.3} ms: if the body \
         moved, take static = true out of the rig file; of a pose held for many rows give their mean",
        1e3 * step
    ))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
#[path = "input_checks_tests.rs"]
mod tests;
