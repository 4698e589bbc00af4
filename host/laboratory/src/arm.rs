//! Recordings of arms as they are run: at rest, in motion, at rest again, with friction in every joint and
//! noise on every signal.

use rigident_shared::tree::BaseMotion;

use super::noise::Noise;
use super::trees::swing;
use rigident_io::recording::Recording;
use rigident_io::rig::{RigFile, TreeClass, TreeTable};
use rigident_model::Model;
use rigident_model::dynamics::inverse_dynamics;

/// Time from rest to full speed, s.
const RAMP_S: f64 = 0.5;
/// Largest part of a swing, rad or m.
const SIZE: f64 = 0.5;

/// An experiment with an arm of revolute and prismatic joints on a base that is held still.
#[derive(Clone, Debug)]
pub struct ArmRun {
    /// Samples per second.
    pub rate_hz: f64,
    /// Length of the motion, s.
    pub motion_s: f64,
    /// Rest before the motion and after it, s.
    pub rest_s: f64,
    /// Further rest of each joint while the others move, s; zero of joints beyond.
    pub held_s: Vec<f64>,
    /// The number of the motion; others have other phases.
    pub motion: usize,
    /// Positions that the motion is about, rad or m; zero of joints beyond.
    pub home: Vec<f64>,
    /// Viscous, Coulomb and constant friction of the first joint, SI; of each next one nine tenths.
    pub friction: [f64; 3],
    /// Rate at which Coulomb friction has turned over by `1/√2`, rad/s or m/s; zero: it jumps.
    pub slip: f64,
    /// Share of viscous and Coulomb friction that is gone when gears are warm, to 1/e in a third of the time.
    pub warming: f64,
    /// Growth of Coulomb friction by what links and rotor take.
    pub load: f64,
    /// Rotor inertia of every joint, kg m² or kg.
    pub rotor: f64,
    /// 1 σ of positions, rad or m.
    pub position_noise: f64,
    /// 1 σ of rates.
    pub rate_noise: f64,
    /// 1 σ of efforts, N m or N, of the first joint; of each next one nine tenths.
    pub effort_noise: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for ArmRun {
    fn default() -> Self {
        Self {
            rate_hz: 200.0,
            motion_s: 20.0,
            rest_s: 5.0,
            held_s: Vec::new(),
            motion: 0,
            home: Vec::new(),
            friction: [2.0, 4.0, 0.2],
            slip: 0.0,
            warming: 0.0,
            load: 0.0,
            rotor: 0.0,
            position_noise: 0.0,
            rate_noise: 0.0,
            effort_noise: 0.3,
            seed: 1,
        }
    }
}

impl ArmRun {
    /// Returns how much of the motion of joint `k` there is at a time, s: itself, its rate and acceleration.
    fn progress(&self, k: usize, t: f64) -> [f64; 3] {
        let held_s = self.held_s.get(k).copied().unwrap_or(0.0);
        if held_s + RAMP_S > self.motion_s {
            return [0.0; 3];
        }
        let ramp = |t: f64| {
            let s = (t / RAMP_S).clamp(0.0, 1.0);
            let over = (t - RAMP_S).max(0.0);
            [
                RAMP_S * (s.powi(3) - 0.5 * s.powi(4)) + over,
                s * s * (3.0 - 2.0 * s),
                6.0 * s * (1.0 - s) / RAMP_S,
            ]
        };
        let (from, to) = (ramp(t - self.rest_s - held_s), ramp(t - self.rest_s - self.motion_s + RAMP_S));
        std::array::from_fn(|k| from[k] - to[k])
    }

    /// Returns the share of joint `k`.
    fn share(k: usize) -> f64 {
        0.9_f64.powi(i32::try_from(k).unwrap_or(i32::MAX))
    }

    /// Returns the parameters of friction of joint `k`.
    pub fn friction_of(&self, k: usize) -> [f64; 3] {
        self.friction.map(|value| Self::share(k) * value)
    }

    /// Returns what the arm's sensors read. At rest friction is a part of what it can be, another in every
    /// joint and from time to time.
    pub fn recording(&self, model: &Model) -> Recording {
        let model = model.welded();
        let joints = model.links.len() - 1;
        let rows = ((2.0 * self.rest_s + self.motion_s) * self.rate_hz) as usize;
        let moves = |row: usize| {
            let t = row as f64 / self.rate_hz;
            let moved = |k: usize| {
                let [u, du, ddu] = self.progress(k, t);
                let [value, rate, change] = swing(u, 3 * k + 1 + 31 * self.motion, SIZE);
                let home = self.home.get(k).copied().unwrap_or(0.0);
                [home + value, rate * du, change * du * du + rate * ddu]
            };
            (0..joints).map(moved).collect()
        };
        self.read(&model, rows, &moves)
    }

    /// Returns what the arm's sensors read while it follows a trajectory, at the trajectory's rate: columns
    /// of positions and rates of all joints, as they are in a file. Accelerations are differences of the
    /// rates, of fourth order. `None` if a column is missing.
    pub fn following(&self, model: &Model, trajectory: &Recording) -> Option<Recording> {
        let model = model.welded();
        let column = |name: String| -> Option<Vec<f64>> {
            let (_, cells) = trajectory.extra.iter().find(|(own, _)| *own == name)?;
            cells.iter().map(|cell| cell.trim().parse().ok()).collect()
        };
        let names = model.links.iter().skip(1).map(|l| &l.joint_name);
        let columns = names
            .map(|name| Some([column(format!("{name}_rad"))?, column(format!("{name}_radps"))?]))
            .collect::<Option<Vec<_>>>()?;
        let rows = trajectory.time_ns.len();
        let rate_hz = trajectory.rate_hz.unwrap_or(self.rate_hz);
        let moves = |row: usize| {
            let of = |[positions, rates]: &[Vec<f64>; 2]| {
                // It rests before and after.
                let at = |by: usize, back: usize| {
                    (row + by).checked_sub(back).and_then(|row| rates.get(row)).copied().unwrap_or(0.0)
                };
                let change = (8.0 * (at(1, 0) - at(0, 1)) - at(2, 0) + at(0, 2)) / 12.0 * rate_hz;
                [positions[row], rates[row], change]
            };
            columns.iter().map(of).collect()
        };
        Some(Self { rate_hz, ..self.clone() }.read(&model, rows, &moves))
    }

    /// Returns what the sensors read in the given number of rows, in each of which the joints have positions,
    /// rates and accelerations.
    fn read(&self, model: &Model, rows: usize, moves: &dyn Fn(usize) -> Vec<[f64; 3]>) -> Recording {
        let names: Vec<&str> = model.links.iter().skip(1).map(|l| l.joint_name.as_str()).collect();
        let mut noise = Noise(Some(self.seed.wrapping_mul(0x2545_f491_4f6c_dd1d)));
        let base = BaseMotion::still([0.0, 0.0, -9.80665]);
        let mut columns: Vec<[Vec<String>; 3]> = vec![Default::default(); names.len()];
        let mut time_ns = Vec::new();
        for row in 0..rows {
            let t = row as f64 / self.rate_hz;
            let moves = moves(row);
            let part = |n: usize| moves.iter().map(|m| m[n]).collect::<Vec<f64>>();
            let cold = 1.0 - self.warming * (1.0 - (-3.0 * row as f64 / rows as f64).exp());
            let truth = inverse_dynamics(model, &base, &part(0), &part(1), &part(2)).unwrap_or_default();
            for (k, (columns, [q, v, a])) in columns.iter_mut().zip(moves).enumerate() {
                let [viscous, coulomb, offset] = self.friction_of(k);
                let sign = if v == 0.0 {
                    0.9 * (1.0 + 2.0 * k as f64 + 0.3 * t).sin()
                } else {
                    v / v.hypot(self.slip)
                };
                let carried = truth.get(6 + k).copied().unwrap_or(0.0) + self.rotor * a;
                let effort = carried
                    + cold * viscous * v
                    + (cold * coulomb + self.load * carried.abs()) * sign
                    + offset
                    + noise.normal(Self::share(k) * self.effort_noise);
                let values =
                    [q + noise.normal(self.position_noise), v + noise.normal(self.rate_noise), effort];
                columns.iter_mut().zip(values).for_each(|(column, value)| column.push(format!("{value:e}")));
            }
            time_ns.push((row as f64 * 1e9 / self.rate_hz).round() as u64);
        }
        let named = names.iter().zip(columns).flat_map(|(name, columns)| {
            columns
                .into_iter()
                .zip(["rad", "radps", "nm"])
                .map(move |(cells, unit)| (format!("{name}_{unit}"), cells))
        });
        Recording {
            name: model.name.clone(),
            rate_hz: Some(self.rate_hz),
            time_ns,
            extra: named.collect(),
            rig: RigFile {
                tree: TreeTable { class: Some(TreeClass::Exact), ..TreeTable::default() },
                ..RigFile::default()
            },
            ..Recording::default()
        }
    }
}

/// Returns a recording of joints' columns as CSV with times.
pub fn csv(recording: &Recording) -> String {
    let names: Vec<&str> = recording.extra.iter().map(|(name, _)| name.as_str()).collect();
    let mut out = format!("t_s,{}\n", names.join(","));
    for (row, time_ns) in recording.time_ns.iter().enumerate() {
        out.push_str(&format!("{:.9}", *time_ns as f64 * 1e-9));
        for (_, cells) in &recording.extra {
            out.push(',');
            out.push_str(cells.get(row).map_or("", String::as_str));
        }
        out.push('\n');
    }
    out
}
