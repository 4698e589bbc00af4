//! The expected readings of the sensors on the way, beside their ranges.

use std::fmt;

use hexapod::{BodyParameters, BodySet, MotionError, Mounting, Payload, Trajectory};
use nalgebra::Vector3;

use super::machine::{self, MachineError};
use super::motion::information::Instrument;
use rigident_device::platform::stops;
use rigident_io::rig::{RigFile, WRENCH_CHANNELS};

/// Steps in which a motion is examined, s, and how many they are at most.
const LOOK_S: f64 = 0.005;
const MOST_LOOKS: f64 = 100_000.0;

/// A program that a sensor does not follow.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RangeError {
    /// Beyond a range.
    #[error(
        "the program takes {what} to {value:.3} {unit} at t = {time_s:.2} s, and its range is {range:.3} \
         {unit}: use a smaller or slower motion"
    )]
    Beyond {
        /// The channel.
        what: String,
        /// The largest value.
        value: f64,
        /// The channel's range.
        range: f64,
        /// The unit of both.
        unit: &'static str,
        /// The time, s.
        time_s: f64,
    },
    /// A segment that makes no sense.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The error in the rig file's statements about the machine.
    #[error(transparent)]
    Machine(#[from] MachineError),
}

/// The largest reading of one channel.
#[derive(Clone, Debug, PartialEq)]
struct Peak {
    what: String,
    unit: &'static str,
    range: f64,
    /// The value with the middle of what may be on the load cell, and its time, s.
    value: f64,
    time_s: f64,
    /// The value with any body that may be on the load cell.
    at_worst: f64,
}

/// The largest readings of a whole motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RangePeaks(Vec<Peak>);

impl RangePeaks {
    fn nearest<'a>(&'a self, unit: &'a [&'a str]) -> Option<&'a Peak> {
        let share = |p: &Peak| p.at_worst / p.range;
        self.0.iter().filter(|p| unit.contains(&p.unit)).max_by(|a, b| share(a).total_cmp(&share(b)))
    }
}

impl fmt::Display for RangePeaks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for units in [&["N", "N m"][..], &["rad/s"], &["m/s²"]] {
            let Some(peak) = self.nearest(units) else { continue };
            write!(f, "  {:<9} up to {:.2} ", peak.what, peak.at_worst)?;
            if peak.range.is_infinite() {
                writeln!(f, "{}; the rig file gives no range to compare it with", peak.unit)?;
            } else if peak.at_worst > peak.range {
                writeln!(
                    f,
                    "of {:.2} {} with the worst body that may be on it: the motion is ended before the range \
                     is reached",
                    peak.range, peak.unit
                )?;
            } else {
                writeln!(f, "of {:.2} {}", peak.range, peak.unit)?;
            }
        }
        Ok(())
    }
}

/// Returns what load cell, gyro and accelerometer read at most while the plate follows a motion with any of a
/// set of bodies (S) on the load cell.
///
/// # Errors
/// A range that is not enough, with channel and time: of the load cell for the middle of the bodies, as it
/// ends a motion itself before it is overloaded.
pub fn peaks(
    trajectory: &Trajectory,
    rig: &RigFile,
    body: Option<&BodySet>,
) -> Result<RangePeaks, RangeError> {
    let (at, rotation) = machine::load_cell(rig)?;
    let range = rig.load_cell.range_n_nm.unwrap_or([f64::INFINITY; 6]);
    let instrument = Instrument::new(&at, &rotation, rig.recording.gravity_mps2, &[1.0; 6], 1.0);
    let peak = |what: String, unit, range| Peak { what, unit, range, value: 0.0, time_s: 0.0, at_worst: 0.0 };
    let channels = WRENCH_CHANNELS.into_iter().zip(range);
    let cell = channels.map(|((name, unit), range)| peak(name.to_owned(), unit, range));
    let mut peaks: Vec<Peak> = cell.collect();
    let imu = rig.imu.first();
    let most = |range: Option<f64>| range.unwrap_or(f64::INFINITY);
    peaks.extend(
        ["x", "y", "z"]
            .map(|axis| peak(format!("gyro {axis}"), "rad/s", most(imu.and_then(|imu| imu.range_radps)))),
    );
    peaks.extend(
        ["x", "y", "z"]
            .map(|axis| peak(format!("accel. {axis}"), "m/s²", most(imu.and_then(|imu| imu.range_mps2)))),
    );
    let sensors = ideal(rig, &at);
    let step_s = (trajectory.duration_s() / MOST_LOOKS).max(LOOK_S);
    for k in 0..=(trajectory.duration_s() / step_s).ceil() as usize {
        let time_s = (k as f64 * step_s).min(trajectory.duration_s());
        let state = trajectory.state(time_s);
        let wrench = body.map_or([[0.0; 2]; 6], |body| instrument.wrench_of(&state, body));
        let (felt, rate) = sensors.as_ref().map_or(([0.0; 3], [0.0; 3]), |sensors| sensors.imu(&state));
        let alone = |v: f64| [v.abs(); 2];
        let all = wrench.into_iter().chain(rate.map(alone)).chain(felt.map(alone));
        for (peak, [value, at_worst]) in peaks.iter_mut().zip(all) {
            peak.at_worst = peak.at_worst.max(at_worst);
            if value > peak.value {
                (peak.value, peak.time_s) = (value, time_s);
            }
        }
    }
    match peaks.iter().find(|p| p.value > p.range) {
        None => Ok(RangePeaks(peaks)),
        Some(Peak { what, unit, range, value, time_s, .. }) => Err(RangeError::Beyond {
            what: what.clone(),
            value: *value,
            range: *range,
            unit,
            time_s: *time_s,
        }),
    }
}

/// The load cell in a stop, its channel that comes nearest to its range.
#[derive(Clone, Debug, PartialEq)]
pub struct CellStopped {
    /// The channel.
    pub channel: &'static str,
    /// N or N m.
    pub unit: &'static str,
    /// The channel's range.
    pub range: f64,
    /// The value with the middle of what may be on the load cell.
    pub value: f64,
    /// The value with any body that may be on the load cell.
    pub at_worst: f64,
    /// The time of the program at which the stop begins, s.
    pub time_s: f64,
}

/// Returns what the load cell reads at most if the plate is brought to rest on its path in `stop_s` from the
/// worst instant, with any of a set of bodies (S) on it; `None` without a range.
///
/// # Errors
/// A rotation of the load cell that is none.
pub fn stopped(
    trajectory: &Trajectory,
    rig: &RigFile,
    body: &BodySet,
    stop_s: f64,
) -> Result<Option<CellStopped>, RangeError> {
    let Some(range) = rig.load_cell.range_n_nm else { return Ok(None) };
    let (at, rotation) = machine::load_cell(rig)?;
    let instrument = Instrument::new(&at, &rotation, rig.recording.gravity_mps2, &[1.0; 6], 1.0);
    let mut nearest: Option<CellStopped> = None;
    for (time_s, state) in stops::states(trajectory, stop_s) {
        let wrench = instrument.wrench_of(&state, body);
        for (((channel, unit), range), [value, at_worst]) in
            WRENCH_CHANNELS.into_iter().zip(range).zip(wrench)
        {
            if nearest.as_ref().is_none_or(|most| value / range > most.value / most.range) {
                nearest = Some(CellStopped { channel, unit, range, value, at_worst, time_s });
            }
        }
    }
    Ok(nearest)
}

/// Returns the IMU without errors, the load cell at a place in P, m; `None` without an IMU in the rig file.
pub fn ideal(rig: &RigFile, at: &Vector3<f64>) -> Option<hexapod::IdealSensors> {
    let imu = rig.imu.first()?;
    let cell = rig.platform.as_ref().and_then(|p| p.load_cell.as_ref());
    let payload = Payload {
        // The body has no part in what an IMU reads.
        body: BodyParameters { mass_kg: 1.0, com_m: [0.0; 3], inertia_com_kgm2: [0.0; 6] },
        load_cell: Mounting {
            position_m: (*at).into(),
            rotation_wxyz: cell.map_or([1.0, 0.0, 0.0, 0.0], |cell| cell.rotation_wxyz),
        },
        imu: Mounting { position_m: imu.position_m, rotation_wxyz: imu.rotation_wxyz },
        gravity_mps2: rig.recording.gravity_mps2,
    };
    payload.sensors().ok()
}

#[cfg(test)]
mod tests {
    use hexapod::{Geometry, MotionProgram, Segment};

    use super::*;

    #[test]
    fn motions_beyond_a_sensor_are_named_with_their_time() {
        let text = "[[imu]]\nrange_radps = 1\nrange_mps2 = 30\n[load_cell]\nrange_n_nm = [500, 500, 500, 40, \
                    40, 40]\n";
        let rig = RigFile::parse(text).unwrap();
        let home = Geometry::thesis().home();
        let mut over = home;
        over.rpy_rad[1] = 0.5;
        let turn = |duration_s: f64| {
            let segments = vec![Segment::Move { to: over, duration_s }];
            MotionProgram { start: home, segments }.trajectory().unwrap()
        };
        // A quintic of 0.5 rad in one second has 15/8 · 0.5 rad/s about y.
        let body = BodySet::known(&BodyParameters::thesis_horizontal());
        let said = peaks(&turn(1.0), &rig, Some(&body)).unwrap();
        let gyro = said.0.iter().find(|p| p.what == "gyro y").unwrap();
        assert!((gyro.value - 0.9375).abs() < 1e-4 && (gyro.time_s - 0.5).abs() < 0.006, "{gyro:?}");
        assert!(said.to_string().contains("gyro y    up to 0.94 of 1.00 rad/s"), "{said}");
        let error = peaks(&turn(0.8), &rig, Some(&body)).unwrap_err();
        assert!(matches!(&error, RangeError::Beyond { what, .. } if what == "gyro y"), "{error}");
        let heavy = BodySet::known(&BodyParameters { mass_kg: 60.0, ..BodyParameters::thesis_horizontal() });
        let error = peaks(&turn(4.0), &rig, Some(&heavy)).unwrap_err();
        assert!(matches!(&error, RangeError::Beyond { unit: "N", .. }), "{error}");
        // Of a body that may be so heavy it is said.
        let perhaps = BodySet::bounded(60.0, [0.0; 3], 0.3);
        let said = peaks(&turn(4.0), &rig, Some(&perhaps)).unwrap().to_string();
        assert!(said.contains("with the worst body that may be on it"), "{said}");
        // Straight down with a known body: Fz of a stop is m (g + v/T 15/8) at most, of the program m (g +
        // 10/√3 way/T²).
        let mut down = home;
        down.position_m[2] -= 0.08;
        let segments = vec![Segment::Move { to: down, duration_s: 1.0 }];
        let fall = MotionProgram { start: home, segments }.trajectory().unwrap();
        let known = BodySet::known(&BodyParameters {
            mass_kg: 20.0,
            com_m: [0.0; 3],
            ..BodyParameters::thesis_horizontal()
        });
        let stop = stopped(&fall, &rig, &known, 0.1).unwrap().unwrap();
        let (weight, speed) = (20.0 * 9.80665, 1.875 * 0.08);
        let most = weight + 20.0 * (speed * 1.875 / 0.1);
        assert_eq!((stop.channel, stop.unit), ("Fz", "N"));
        assert!(stop.value > 0.9 * most && stop.value < 1.15 * most, "{stop:?} {most}");
        // Without a body nothing is said of the load cell.
        peaks(&turn(4.0), &rig, None).unwrap();
    }
}
