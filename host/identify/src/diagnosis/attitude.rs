//! Faults that follow the attitude of the body, as drivers publish readings: in the axes of the world,
//! without gravity, rates of Euler's angles in place of the body's.
//!
//! The attitude is that of the gyro, integrated; where it begins, and the gyro's bias, are settings that are
//! found with the body ([`super::tuned`]). The heading of the world's axes is among them where it counts.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::spatial::{AngularRate, SpecificForce};

use super::tuned::Tuned;
use super::{Case, Fault};
use rigident_io::rig::ImuTable;
use rigident_rows::body::prepare::mounting;

type Vector = Vector3<f64>;
type Turn = UnitQuaternion<f64>;

/// Settings are rotations about x, y and z at the start, rad, the gyro's bias, rad/s, and of gravity's wrench
/// a mass, kg, and first moments, kg m.
const HEADED: [f64; 6] = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3];
const TILTED: [f64; 5] = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3];
const WEIGHED: [f64; 9] = [1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 0.1, 0.01, 0.01, 0.01];

/// Returns the faults of one body's moving recording that follow its attitude.
pub(super) fn faults(case: &Case) -> Vec<Fault> {
    if case.model.is_some() || case.recording.is_static || Motion::of(case).is_none() {
        return Vec::new();
    }
    vec![
        Tuned {
            kind: "frame of the wrench",
            what: "the wrench is in the axes of the world, not in those of the load cell",
            remedy: "record it in the sensor's own axes: drivers call that the sensor or tool frame",
            start: |case| {
                let (motion, wrench) = (Motion::of(case)?, case.recording.wrench.as_ref()?);
                Start::heading(&motion, &motion.force, wrench.iter().map(|w| Vector::new(w[0], w[1], w[2])))
            },
            units: &HEADED,
            undo: |case, start, settings| undo_world_wrench(case, start, settings).is_some(),
            is_possible: |_| true,
        }
        .fault(),
        Tuned {
            kind: "frame of the accelerometer",
            what: "the accelerometer is in the axes of the world, not in its own",
            remedy: "record the raw readings in the IMU's own axes, not those that its filter has turned",
            start: |case| {
                let (motion, wrench) = (Motion::of(case)?, case.recording.wrench.as_ref()?);
                let force: Vec<Vector> = wrench.iter().map(|w| Vector::new(w[0], w[1], w[2])).collect();
                Start::heading(&motion, &force, motion.own_force.iter().copied())
            },
            units: &HEADED,
            undo: |case, start, settings| undo_world_accelerometer(case, start, settings).is_some(),
            is_possible: |_| true,
        }
        .fault(),
        Tuned {
            kind: "gravity of the accelerometer",
            what: "gravity has been taken out of the accelerometer's readings",
            remedy: "record what the sensor reads, 9.8 m/s² at rest, not a linear acceleration",
            start: |case| {
                let (motion, wrench) = (Motion::of(case)?, case.recording.wrench.as_ref()?);
                let force: Vec<Vector> = wrench.iter().map(|w| Vector::new(w[0], w[1], w[2])).collect();
                Start::upright(&motion, &force)
            },
            units: &TILTED,
            undo: |case, start, settings| undo_linear_acceleration(case, start, settings).is_some(),
            is_possible: |_| true,
        }
        .fault(),
        Tuned {
            kind: "rates of Euler's angles",
            what: "the gyro columns are rates of roll, pitch and yaw, not the body's angular rate",
            remedy: "record the gyro's own readings, or form the angular rate of them (docs/diagnosis.md)",
            start: |case| Motion::of(case)?.angles(),
            units: &TILTED,
            undo: |case, start, settings| undo_euler_rates(case, *start, settings).is_some(),
            is_possible: |_| true,
        }
        .fault(),
        Tuned {
            kind: "gravity of the wrench",
            what: "the body's weight has been taken out of the wrench",
            remedy: "switch compensation of gravity or payload off in the load cell's driver, and record \
                     anew",
            start: |case| {
                let motion = Motion::of(case)?;
                Start::upright(&motion, &motion.force)
            },
            units: &WEIGHED,
            undo: |case, start, settings| undo_weightless(case, start, settings).is_some(),
            is_possible: |settings| settings.get(5).is_some_and(|mass_kg| *mass_kg > 0.0),
        }
        .fault(),
    ]
}

/// How the body moves, by its IMU.
pub(super) struct Motion {
    time_s: Vec<f64>,
    /// Accelerometer in the axes of S, m/s², and in its own.
    pub(super) force: Vec<Vector>,
    own_force: Vec<Vector>,
    /// Gyro in the axes of S, rad/s, and in its own.
    rate: Vec<Vector>,
    own_rate: Vec<Vector>,
}

impl Motion {
    pub(super) fn of(case: &Case) -> Option<Self> {
        let recording = &case.recording;
        let imu = recording.imus.first()?;
        let mounting = mounting(&table(case));
        let own = |v: &[f64; 3]| Vector::from(v.map(|v| if v.is_finite() { v } else { 0.0 }));
        let [sx, sy, sz] = mounting.accel_scale;
        let scaled = |v: &[f64; 3]| {
            let v = own(v).component_mul(&Vector::new(sx, sy, sz));
            v - Vector::from(mounting.accel_bias.array())
        };
        let unbiased = |v: &[f64; 3]| own(v) - Vector::from(mounting.gyro_bias.array());
        let own_force: Vec<Vector> = imu.accel.as_ref()?.iter().map(scaled).collect();
        let own_rate: Vec<Vector> = imu.gyro.as_ref()?.iter().map(unbiased).collect();
        let turned = |v: &Vector| {
            let force: SpecificForce<_, f64> = mounting.rotation * SpecificForce::from_array([v.x, v.y, v.z]);
            Vector::from(force.array())
        };
        let spun = |v: &Vector| {
            let rate: AngularRate<_, f64> = mounting.rotation * AngularRate::from_array([v.x, v.y, v.z]);
            Vector::from(rate.array())
        };
        Some(Self {
            time_s: recording.time_ns.iter().map(|ns| *ns as f64 * 1e-9).collect(),
            force: own_force.iter().map(turned).collect(),
            rate: own_rate.iter().map(spun).collect(),
            own_force,
            own_rate,
        })
        .filter(|motion| motion.time_s.len() > 2)
    }

    /// Returns the attitude against that at a time, s, of each row, its gyro's bias taken off.
    fn turns(&self, from_s: f64, bias: &Vector) -> Vec<Turn> {
        let mut now = Turn::identity();
        let mut all = vec![now];
        for (times, rates) in self.time_s.windows(2).zip(self.rate.windows(2)) {
            let ([a, b], [before, after]) = (times, rates) else { continue };
            now *= Turn::from_scaled_axis(((before + after) * 0.5 - bias) * (b - a));
            all.push(now);
        }
        let nearest = |k: &usize| (self.time_s[*k] - from_s).abs();
        let at = (0..all.len().min(self.rate.len())).min_by(|a, b| nearest(a).total_cmp(&nearest(b)));
        let begin = at.map_or(now, |k| {
            all[k] * Turn::from_scaled_axis((self.rate[k] - bias) * (from_s - self.time_s[k]))
        });
        all.iter().map(|turn| begin.inverse() * turn).collect()
    }

    /// Returns roll and pitch at the first row, by the mean over all rows of what the accelerometer says less
    /// what the angles' rates say has come since, and the time of that row, s.
    fn angles(&self) -> Option<[f64; 3]> {
        let (mut roll, mut pitch) = (Vector::zeros(), Vector::zeros());
        for (angles, force) in self.integrated([0.0; 3]).iter().zip(&self.own_force) {
            let up = Vector::new(force.x, force.y, force.z);
            let said = [up.y.atan2(up.z) - angles.x, (-up.x).atan2(up.y.hypot(up.z)) - angles.y];
            roll += Vector::new(said[0].cos(), said[0].sin(), 0.0);
            pitch += Vector::new(said[1].cos(), said[1].sin(), 0.0);
        }
        Some([roll.y.atan2(roll.x), pitch.y.atan2(pitch.x), *self.time_s.first()?])
    }

    /// Returns the integral of the gyro columns less a bias, from the first row on.
    fn integrated(&self, bias: [f64; 3]) -> Vec<Vector> {
        let mut now = Vector::zeros();
        let mut all = vec![now];
        for (times, rates) in self.time_s.windows(2).zip(self.own_rate.windows(2)) {
            let ([a, b], [before, after]) = (times, rates) else { continue };
            now += ((before + after) * 0.5 - Vector::from(bias)) * (b - a);
            all.push(now);
        }
        all
    }
}

/// Returns the rig file's table of the base's IMU, or the default one.
fn table(case: &Case) -> ImuTable {
    case.recording.rig.imu.iter().find(|imu| imu.link == 0).cloned().unwrap_or_default()
}

/// From where the settings count: the attitude at a time, s.
struct Start {
    turn: Turn,
    time_s: f64,
}

impl Start {
    /// Returns the attitude at the first row that turns vectors in the body's axes into those in the world's,
    /// in the sense of least squares (Wahba's problem).
    fn heading(motion: &Motion, body: &[Vector], world: impl Iterator<Item = Vector>) -> Option<Self> {
        let time_s = *motion.time_s.first()?;
        let turns = motion.turns(time_s, &Vector::zeros());
        let pairs = turns.iter().zip(body).zip(world);
        let sum = pairs.map(|((turn, body), world)| world * (turn * body).transpose()).sum::<Matrix3<f64>>();
        if !sum.iter().all(|v| v.is_finite()) || sum.norm() == 0.0 {
            return None;
        }
        let svd = sum.svd(true, true);
        let (u, v_t) = (svd.u?, svd.v_t?);
        let sign = Matrix3::from_diagonal(&Vector::new(1.0, 1.0, (u * v_t).determinant()));
        let turn = Turn::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * sign * v_t));
        Some(Self { turn, time_s })
    }

    /// Returns an attitude at the first row in which the mean of vectors in the body's axes is upright.
    fn upright(motion: &Motion, body: &[Vector]) -> Option<Self> {
        let time_s = *motion.time_s.first()?;
        let turns = motion.turns(time_s, &Vector::zeros());
        let mean = turns.iter().zip(body).map(|(turn, body)| turn * body).sum::<Vector>();
        let turn = Turn::rotation_between(&mean, &Vector::z()).unwrap_or(Turn::identity());
        (mean.norm() > 0.0).then_some(Self { turn, time_s })
    }

    /// Returns the attitude of S in the world at each row.
    fn attitudes(&self, motion: &Motion, turn: Vector, bias: Vector) -> Vec<Turn> {
        let start = Turn::from_scaled_axis(turn) * self.turn;
        motion.turns(self.time_s, &bias).into_iter().map(|since| start * since).collect()
    }

    /// Returns the specific force of a body at rest, m/s², in the axes of S, by a tilt of the start.
    fn gravity(&self, case: &Case, motion: &Motion, settings: [f64; 5]) -> Vec<Vector> {
        let [x, y, bx, by, bz] = settings;
        let up = Vector::z() * case.recording.rig.recording.gravity_mps2;
        let attitudes = self.attitudes(motion, Vector::new(x, y, 0.0), Vector::new(bx, by, bz));
        attitudes.iter().map(|attitude| attitude.inverse() * up).collect()
    }
}

fn undo_world_wrench(case: &mut Case, start: &Start, settings: &[f64]) -> Option<()> {
    let [x, y, z, bx, by, bz] = *settings.first_chunk()?;
    let motion = Motion::of(case)?;
    let attitudes = start.attitudes(&motion, Vector::new(x, y, z), Vector::new(bx, by, bz));
    for (row, attitude) in case.recording.wrench.as_mut()?.iter_mut().zip(attitudes) {
        let [fx, fy, fz, mx, my, mz] = *row;
        let force = attitude.inverse() * Vector::new(fx, fy, fz);
        let moment = attitude.inverse() * Vector::new(mx, my, mz);
        *row = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
    }
    Some(())
}

/// Puts a specific force in the axes of S into the accelerometer's columns.
fn set_force(case: &mut Case, of: impl Iterator<Item = Vector>) -> Option<()> {
    let mounting = mounting(&table(case));
    let [w, x, y, z] = table(case).rotation_wxyz;
    let turn = Turn::new_normalize(nalgebra::Quaternion::new(w, x, y, z));
    let (bias, scale) = (Vector::from(mounting.accel_bias.array()), Vector::from(mounting.accel_scale));
    let rows = case.recording.imus.first_mut()?.accel.as_mut()?;
    for (row, force) in rows.iter_mut().zip(of) {
        *row = (turn.inverse() * force + bias).component_div(&scale).into();
    }
    Some(())
}

fn undo_world_accelerometer(case: &mut Case, start: &Start, settings: &[f64]) -> Option<()> {
    let [x, y, z, bx, by, bz] = *settings.first_chunk()?;
    let motion = Motion::of(case)?;
    let attitudes = start.attitudes(&motion, Vector::new(x, y, z), Vector::new(bx, by, bz));
    let forces = motion.own_force.iter().zip(attitudes).map(|(world, attitude)| attitude.inverse() * world);
    set_force(case, forces)
}

fn undo_linear_acceleration(case: &mut Case, start: &Start, settings: &[f64]) -> Option<()> {
    let motion = Motion::of(case)?;
    let gravity = start.gravity(case, &motion, *settings.first_chunk()?);
    set_force(case, motion.force.iter().zip(gravity).map(|(own, gravity)| own + gravity))
}

fn undo_weightless(case: &mut Case, start: &Start, settings: &[f64]) -> Option<()> {
    let [.., mass, mx, my, mz] = *settings else { return None };
    let motion = Motion::of(case)?;
    let gravity = start.gravity(case, &motion, *settings.first_chunk()?);
    for (row, gravity) in case.recording.wrench.as_mut()?.iter_mut().zip(gravity) {
        let (force, moment) = (gravity * mass, Vector::new(mx, my, mz).cross(&gravity));
        row.iter_mut().zip(force.iter().chain(&moment)).for_each(|(to, own)| *to += own);
    }
    Some(())
}

/// Makes angular rates of the rates of roll, pitch and yaw about x, y and z, turned in the order z, y, x;
/// `start` are roll and pitch at a time, s.
fn undo_euler_rates(case: &mut Case, start: [f64; 3], settings: &[f64]) -> Option<()> {
    let [roll, pitch, bx, by, bz] = *settings.first_chunk()?;
    let motion = Motion::of(case)?;
    let angles = motion.integrated([bx, by, bz]);
    let gyro_bias = Vector::from(mounting(&table(case)).gyro_bias.array());
    let rows = case.recording.imus.first_mut()?.gyro.as_mut()?;
    // The time of the start is that of the first row but for half a row of a thinned recording.
    let late_s = motion.time_s.first()? - start[2];
    let first = motion.own_rate.first()? * late_s;
    for ((row, rate), angle) in rows.iter_mut().zip(&motion.own_rate).zip(angles) {
        let [d, e] = [start[0] + roll + angle.x + first.x, start[1] + pitch + angle.y + first.y];
        let ((sd, cd), (se, ce)) = (d.sin_cos(), e.sin_cos());
        let [p, q, r] = (rate - Vector::new(bx, by, bz)).into();
        *row = (Vector::new(p - r * se, q * cd + r * ce * sd, -q * sd + r * ce * cd) + gyro_bias).into();
    }
    Some(())
}
