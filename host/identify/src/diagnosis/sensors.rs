//! Faults of a load cell and of IMUs: units, signs, axes, delays, mounting.

use nalgebra::{Matrix3, Vector3};

use super::{Case, Fault, gyro_scale};
use crate::problem::Problem;
use rigident_fit::{FitOptions, Silent};
use rigident_io::rig::{ImuTable, RigFile};

/// Three readings of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Triple {
    Force,
    Moment,
    Accel,
    Gyro,
    Gravity,
}

impl Triple {
    const ALL: [Self; 5] = [Self::Force, Self::Moment, Self::Accel, Self::Gyro, Self::Gravity];

    fn name(self) -> &'static str {
        match self {
            Self::Force => "the force",
            Self::Moment => "the moment",
            Self::Accel => "the accelerometer",
            Self::Gyro => "the gyro",
            Self::Gravity => "the gravity vector",
        }
    }

    /// Units that it is often recorded in, with their factors to SI.
    fn units(self) -> &'static [(&'static str, f64)] {
        const POUND: f64 = 4.448_221_615;
        match self {
            Self::Force => &[("kgf", 9.80665), ("gf", 9.80665e-3), ("lbf", POUND), ("kN", 1e3), ("mN", 1e-3)],
            Self::Moment => &[
                ("N mm", 1e-3),
                ("N cm", 1e-2),
                ("kgf m", 9.80665),
                ("kgf cm", 9.80665e-2),
                ("lbf ft", POUND * 0.3048),
                ("lbf in", POUND * 0.0254),
                ("kN m", 1e3),
            ],
            Self::Accel | Self::Gravity => {
                &[("g", 9.80665), ("mg", 9.80665e-3), ("cm/s²", 1e-2), ("ft/s²", 0.3048)]
            }
            Self::Gyro => &[
                ("deg/s", std::f64::consts::PI / 180.0),
                ("rpm", std::f64::consts::PI / 30.0),
                ("rev/s", std::f64::consts::TAU),
                ("mrad/s", 1e-3),
            ],
        }
    }

    /// Changes every reading; false if there are none.
    pub(super) fn each(self, case: &mut Case, change: &dyn Fn([f64; 3]) -> [f64; 3]) -> bool {
        let recording = &mut case.recording;
        let half = |wrench: &mut Option<Vec<[f64; 6]>>, at: usize| {
            let rows = wrench.as_mut();
            rows.map(|rows| {
                for row in rows {
                    let new = change([row[at], row[at + 1], row[at + 2]]);
                    row[at..at + 3].copy_from_slice(&new);
                }
            })
        };
        let all = |rows: Option<&mut Vec<[f64; 3]>>| {
            rows.map(|rows| rows.iter_mut().for_each(|row| *row = change(*row)))
        };
        let imu = recording.imus.first_mut();
        match self {
            Self::Force => half(&mut recording.wrench, 0),
            Self::Moment => half(&mut recording.wrench, 3),
            Self::Accel => all(imu.and_then(|imu| imu.accel.as_mut())),
            Self::Gyro => all(imu.and_then(|imu| imu.gyro.as_mut())),
            Self::Gravity => all(recording.gravity.as_mut()),
        }
        .is_some()
    }

    /// Returns true if the readings are as large as gravity, as those of an accelerometer in m/s² are.
    fn is_gravity(self, case: &Case) -> bool {
        let recording = &case.recording;
        let rows = match self {
            Self::Accel => recording.imus.first().and_then(|imu| imu.accel.as_ref()),
            Self::Gravity => recording.gravity.as_ref(),
            _ => None,
        };
        let mut sizes: Vec<f64> = rows
            .into_iter()
            .flatten()
            .map(|row| Vector3::from(*row).norm())
            .filter(|v| v.is_finite())
            .collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).is_some_and(|size| (0.5..2.0).contains(&(size / GRAVITY_MPS2)))
    }

    fn is_in(self, case: &Case) -> bool {
        let imu = case.recording.imus.first();
        match self {
            Self::Force | Self::Moment => case.recording.wrench.is_some(),
            Self::Accel => imu.is_some_and(|imu| imu.accel.is_some()),
            Self::Gyro => imu.is_some_and(|imu| imu.gyro.is_some()),
            // Columns of the file, not made of attitudes.
            Self::Gravity => case.recording.gravity.is_some() && case.recording.gravity_attitudes.is_empty(),
        }
    }
}

const GRAVITY_MPS2: f64 = 9.80665;
/// An IMU that is this many standard deviations, and further than a ruler errs, from the origin sits
/// elsewhere; m.
const ELSEWHERE_SD: f64 = 4.42;
const RULER_M: f64 = 5e-3;
/// 1 σ of its place where nothing is known of it, m.
const ANYWHERE_M: f64 = 0.2;

/// Returns that the IMU sits where the fit finds it, if that is far from the origin and nobody has said where
/// it sits.
fn of_place(case: &Case) -> Option<Fault> {
    let said = case.recording.rig.imu.iter().any(|imu| imu.link == 0 && imu.position_m != [0.0; 3]);
    if said || case.model.is_some() || case.recording.is_static {
        return None;
    }
    // As if nobody had said where it sits.
    let mut open = case.clone();
    own_table(&mut open.recording.rig).position_std_m = Some(ANYWHERE_M);
    let problem = Problem::from_recording(&open.recording, None, &open.options).ok()?;
    let fit = problem.fit(&FitOptions { convergence_points: 0, ..FitOptions::default() }, &Silent).ok()?;
    let own: Vec<_> = fit.nuisances.iter().filter(|found| found.nuisance.group == "lever arm").collect();
    let [x, y, z] = own.as_slice() else { return None };
    let place = [x, y, z].map(|found| found.value);
    let far = [x, y, z].iter().any(|found| found.value.abs() > (ELSEWHERE_SD * found.sd).max(RULER_M));
    let [px, py, pz] = place.map(|v| format!("{v:.3}"));
    let what =
        format!("the IMU does not sit at the load cell's origin, but at about {px}, {py}, {pz} m from it");
    let remedy =
        format!("measure it, and give position_m = [{px}, {py}, {pz}] or better in [[imu]] of the rig file");
    far.then(|| {
        Fault::new("place of the IMU", what, remedy, move |case| {
            own_table(&mut case.recording.rig).position_m = place;
            true
        })
    })
}

/// A matrix of one ±1 in each row and column.
pub(super) type Axes = [(usize, f64); 3];

/// Returns all that are rotations, but the identity.
pub(super) fn rotations() -> impl Iterator<Item = Axes> {
    signed_permutations().into_iter().filter(|axes| matrix(*axes).determinant() > 0.0)
}

/// Returns all of them but the identity, the simplest first.
fn signed_permutations() -> Vec<Axes> {
    let orders = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];
    let signs = (0..8_u8).map(|bits| std::array::from_fn(|k| if bits >> k & 1 == 1 { -1.0 } else { 1.0 }));
    let all = orders.into_iter().flat_map(|order| {
        signs.clone().map(move |sign: [f64; 3]| std::array::from_fn(|k| (order[k], sign[k])))
    });
    all.skip(1).collect()
}

pub(super) fn turned(axes: Axes, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| axes[k].1 * v[axes[k].0])
}

fn matrix(axes: Axes) -> Matrix3<f64> {
    Matrix3::from_columns(&[0, 1, 2].map(|k| {
        let mut unit = [0.0; 3];
        unit[k] = 1.0;
        Vector3::from(turned(axes, unit))
    }))
}

/// Returns in words what makes the truth of readings whose axes are these.
pub(super) fn axes_in_words(axes: Axes) -> String {
    const NAMES: [&str; 3] = ["x", "y", "z"];
    let reversed: Vec<&str> = (0..3).filter(|k| axes[*k].1 < 0.0).map(|k| NAMES[k]).collect();
    let moved: Vec<usize> = (0..3).filter(|k| axes[*k].0 != *k).collect();
    let proper = matrix(axes).determinant() > 0.0;
    match (moved.as_slice(), reversed.len()) {
        ([], 3) => "is reversed".to_owned(),
        ([], 1) => format!("has {} reversed", reversed[0]),
        ([], _) => {
            let about = (0..3).find(|k| axes[*k].1 > 0.0).map_or("", |k| NAMES[k]);
            format!("is turned by 180° about {about}")
        }
        ([a, b], 0) => format!("has {} and {} swapped", NAMES[*a], NAMES[*b]),
        ([_, _], 1) if proper => {
            let about = (0..3).find(|k| axes[*k].0 == *k).map_or("", |k| NAMES[k]);
            format!("is turned by 90° about {about}")
        }
        _ => {
            let each = axes.map(|(k, sign)| format!("{}{}", if sign < 0.0 { "−" } else { "" }, NAMES[k]));
            format!("has its axes as x, y, z = {} of what is recorded", each.join(", "))
        }
    }
}

/// A place of the IMU that somebody measured is at least this far, m.
const LEAST_LEVER_M: f64 = 1e-3;
/// Delays that are tried, in rows.
const DELAYS: [usize; 16] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60];
/// None is longer, s.
pub(super) const LONGEST_S: f64 = 0.25;

/// Returns delays in rows, either way, with the times that they are.
pub(super) fn delays(case: &Case) -> Vec<(isize, f64)> {
    let Some(rate) = case.recording.rate_hz.filter(|_| !case.recording.is_static) else { return Vec::new() };
    let ways = |rows: usize| {
        let s = rows as f64 / rate;
        [(rows as isize, s), (-(rows as isize), -s)].into_iter().filter(|(_, s)| s.abs() <= LONGEST_S)
    };
    DELAYS.into_iter().flat_map(ways).collect()
}

/// Moves the readings of accelerometer and gyro, as asked for, to this time earlier, s; false if there are
/// none, or too few.
pub(super) fn moved_imu(case: &mut Case, s: f64, accel: bool, gyro: bool) -> bool {
    let rows = (s * case.recording.rate_hz.unwrap_or(1.0)).round() as isize;
    let Some(imu) = case.recording.imus.first_mut() else { return false };
    if let Some(values) = imu.accel.as_mut().filter(|_| accel) {
        earlier(values, rows);
    }
    if let Some(values) = imu.gyro.as_mut().filter(|_| gyro) {
        earlier(values, rows);
    }
    cut(case, rows)
}

/// Moves readings to this many rows earlier; the ends of the recording are to be cut off.
pub(super) fn earlier<T>(rows: &mut [T], by: isize) {
    let by = if by < 0 { rows.len().saturating_sub(by.unsigned_abs()) } else { by.unsigned_abs() };
    if by < rows.len() {
        rows.rotate_left(by);
    }
}

/// Cuts off the rows that [`earlier`] brought from the other end.
pub(super) fn cut(case: &mut Case, by: isize) -> bool {
    let (rows, by_rows) = (case.recording.rows(), by.unsigned_abs());
    if 2 * by_rows >= rows {
        return false;
    }
    let kept = if by > 0 { 0..rows - by_rows } else { by_rows..rows };
    case.recording = case.recording.section(kept);
    true
}

/// Returns in words what is late, or early.
pub(super) fn late(what: &str, s: f64) -> String {
    format!("{what} is {} by {:.0} ms", if s > 0.0 { "late" } else { "early" }, 1e3 * s.abs())
}

/// Returns the faults that load cell and base IMU may have.
pub(super) fn faults(case: &Case) -> Vec<Fault> {
    let mut all = Vec::new();
    let there: Vec<Triple> = Triple::ALL.into_iter().filter(|triple| triple.is_in(case)).collect();
    all.extend(of_place(case));
    for triple in there.iter().filter(|triple| !triple.is_gravity(case)) {
        all.extend(of_units(*triple));
    }
    all.extend(of_wrench_sign(case));
    all.extend(of_halves(case));
    all.extend(gyro_scale::fault(case));
    for triple in &there {
        all.extend(of_axes(*triple));
    }
    if there.contains(&Triple::Accel) {
        all.extend(of_mounting(case));
        all.extend(of_delays(case, &there));
    }
    all
}

fn of_units(triple: Triple) -> impl Iterator<Item = Fault> {
    triple.units().iter().map(move |(unit, factor)| {
        let what = format!("{} is in {unit}", triple.name());
        let remedy = format!("give scale = {factor:.6} in [recording] columns of the rig file");
        Fault::new(format!("unit of {}", triple.name()), what, remedy, move |case| {
            triple.each(case, &|v| v.map(|v| factor * v))
        })
    })
}

fn of_wrench_sign(case: &Case) -> Option<Fault> {
    let what = "the wrench has the sign of the other body: that on the sensor, not that on the body";
    let remedy = "correct wrench_sign in [recording] of the rig file";
    let undo = |case: &mut Case| {
        let reversed = |v: [f64; 3]| v.map(|v| -v);
        Triple::Force.each(case, &reversed) && Triple::Moment.each(case, &reversed)
    };
    case.recording.wrench.as_ref().map(|_| Fault::new("wrench sign", what, remedy, undo))
}

fn of_halves(case: &Case) -> Option<Fault> {
    let what = "the columns of force and moment are exchanged";
    let remedy = "correct their names in [recording] columns of the rig file";
    let undo = |case: &mut Case| {
        let rows = case.recording.wrench.iter_mut().flatten();
        rows.for_each(|row| row.rotate_left(3));
        true
    };
    case.recording.wrench.as_ref().map(|_| Fault::new("halves of the wrench", what, remedy, undo))
}

fn of_axes(triple: Triple) -> impl Iterator<Item = Fault> {
    signed_permutations().into_iter().map(move |axes| {
        let what = format!("{} {}", triple.name(), axes_in_words(axes));
        let remedy = "correct its axes and signs: name the columns in [recording] columns of the rig file, \
                    with scale = -1 where one is reversed";
        Fault::new(format!("axes of {}", triple.name()), what, remedy, move |case| {
            triple.each(case, &|v| turned(axes, v))
        })
    })
}

/// Changes the rig file's table of the base's IMU; false if there is none.
fn table(rig: &mut RigFile, change: impl FnOnce(&mut rigident_io::rig::ImuTable)) -> bool {
    let Some(table) = rig.imu.iter_mut().find(|imu| imu.link == 0) else { return false };
    change(table);
    true
}

/// Returns the rig file's table of the base's IMU, which it gets if it has none.
fn own_table(rig: &mut RigFile) -> &mut ImuTable {
    let at = rig.imu.iter().position(|imu| imu.link == 0).unwrap_or_else(|| {
        rig.imu.push(ImuTable::default());
        rig.imu.len() - 1
    });
    &mut rig.imu[at]
}

fn of_mounting(case: &Case) -> Vec<Fault> {
    let mut all = Vec::new();
    for axes in rotations().filter(|_| case.recording.imus.first().is_some_and(|imu| imu.gyro.is_some())) {
        let what = format!("the IMU {}", axes_in_words(axes));
        let remedy = "correct rotation_wxyz in [[imu]] of the rig file";
        all.push(Fault::new("attitude of the IMU", what, remedy, move |case| {
            Triple::Accel.each(case, &|v| turned(axes, v)) && Triple::Gyro.each(case, &|v| turned(axes, v))
        }));
    }
    let Some(own) = case.recording.rig.imu.iter().find(|imu| imu.link == 0) else { return all };
    let [w, x, y, z] = own.rotation_wxyz;
    let quaternions = [
        ("rotation_wxyz is the inverse one", [w, -x, -y, -z]),
        ("rotation_wxyz is in the order x, y, z, w", [z, w, x, y]),
    ];
    for (what, rotation) in quaternions
        .into_iter()
        .filter(|(_, q)| *q != own.rotation_wxyz && *q != own.rotation_wxyz.map(|v| -v))
    {
        let remedy =
            "correct rotation_wxyz in [[imu]] of the rig file: w, x, y, z of the attitude of the IMU in S";
        all.push(Fault::new("rotation_wxyz", what, remedy, move |case| {
            table(&mut case.recording.rig, |imu| imu.rotation_wxyz = rotation)
        }));
    }
    if own.position_m == [0.0; 3] {
        return all;
    }
    let size = own.position_m.iter().map(|v| v * v).sum::<f64>().sqrt();
    let levers = [("millimetres", 1e-3), ("centimetres", 1e-2), ("inches", 0.0254)];
    for (unit, factor) in levers.into_iter().filter(|(_, factor)| factor * size > LEAST_LEVER_M) {
        let what = format!("position_m of the IMU is in {unit}");
        all.push(Fault::new(
            "place of the IMU",
            what,
            "give position_m in [[imu]] of the rig file in metres",
            move |case| {
                table(&mut case.recording.rig, |imu| imu.position_m = imu.position_m.map(|v| factor * v))
            },
        ));
    }
    let remedy = "correct position_m in [[imu]] of the rig file: from the load cell's origin to the IMU, in \
                  the axes of S";
    all.push(Fault::new("place of the IMU", "position_m of the IMU is reversed", remedy, move |case| {
        table(&mut case.recording.rig, |imu| imu.position_m = imu.position_m.map(|v| -v))
    }));
    all
}

fn of_delays(case: &Case, there: &[Triple]) -> Vec<Fault> {
    let mut all = Vec::new();
    let has_gyro = there.contains(&Triple::Gyro);
    let groups: [(&str, bool, bool); 3] =
        [("the IMU", true, has_gyro), ("the gyro", false, has_gyro), ("the accelerometer", true, false)];
    // Without a gyro the IMU is its accelerometer.
    for (name, accel, gyro) in
        groups.into_iter().filter(|(name, _, gyro)| has_gyro || (*name == "the IMU" && !gyro))
    {
        for (_, s) in delays(case) {
            let remedy = match (accel, gyro) {
                (true, true) => {
                    "give it as group_delay_s in [[imu]] of the rig file, or stamp readings where they are \
                     taken"
                }
                _ => "stamp readings where they are taken; sensors of one IMU have one clock",
            };
            let kind = format!("delay of {name}");
            all.push(Fault::new(kind, late(name, s), remedy, move |case| moved_imu(case, s, accel, gyro)));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_io::recording::{ImuColumns, Recording};
    use rigident_rows::tree::ProblemOptions;

    #[test]
    fn axes_are_all_there_once_and_named_by_their_change() {
        let all = signed_permutations();
        assert_eq!(all.len(), 47);
        for (k, axes) in all.iter().enumerate() {
            assert!(!all[..k].contains(axes));
            let turn = matrix(*axes);
            assert!((turn * turn.transpose() - Matrix3::identity()).norm() < 1e-15);
        }
        let words = |axes: Axes| axes_in_words(axes);
        assert_eq!(words([(0, -1.0), (1, -1.0), (2, -1.0)]), "is reversed");
        assert_eq!(words([(0, 1.0), (1, -1.0), (2, 1.0)]), "has y reversed");
        assert_eq!(words([(0, -1.0), (1, -1.0), (2, 1.0)]), "is turned by 180° about z");
        assert_eq!(words([(1, 1.0), (0, 1.0), (2, 1.0)]), "has x and y swapped");
        assert_eq!(words([(1, 1.0), (0, -1.0), (2, 1.0)]), "is turned by 90° about z");
        assert!(words([(1, 1.0), (2, -1.0), (0, 1.0)]).contains("y, −z, x"));
    }

    fn case() -> Case {
        let row = |k: u32| f64::from(k);
        let recording = Recording {
            time_ns: (0..100).map(|k| k * 10_000_000).collect(),
            rate_hz: Some(100.0),
            wrench: Some((0..100).map(|k| [row(k); 6]).collect()),
            imus: vec![ImuColumns {
                accel: Some((0..100).map(|k| [row(k); 3]).collect()),
                gyro: Some((0..100).map(|k| [row(k); 3]).collect()),
            }],
            ..Recording::default()
        };
        Case { recording, model: None, options: ProblemOptions::default() }
    }

    #[test]
    fn a_delay_moves_late_readings_and_cuts_those_without_partner() {
        for (s, first) in [(0.03, 3.0), (-0.03, 0.0)] {
            let what = late("the gyro", s);
            let fault = faults(&case()).into_iter().find(|fault| fault.what == what).unwrap();
            let undone = fault.undone(&case()).unwrap().recording;
            assert_eq!(undone.rows(), 97);
            let (wrench, gyro) = (undone.wrench.unwrap(), undone.imus[0].gyro.clone().unwrap());
            // Read three rows later, it is beside what it belongs to.
            assert!(wrench.iter().zip(&gyro).all(|(w, g)| g[0] - w[0] == 100.0 * s), "{s}");
            assert_eq!(gyro[0][0], first);
        }
        assert!(delays(&case()).iter().all(|(_, s)| s.abs() <= LONGEST_S));
    }

    #[test]
    fn units_of_a_sensor_that_is_not_there_are_no_fault() {
        let mut without = case();
        without.recording.imus[0].gyro = None;
        assert!(faults(&without).iter().all(|fault| !fault.what.contains("gyro")));
        assert!(faults(&case()).iter().any(|fault| fault.what == "the gyro is in deg/s"));
        let mut none = case();
        none.recording.wrench = None;
        none.recording.imus.clear();
        assert!(faults(&none).is_empty());
    }
}
