//! The true motion of a simulated machine, by finite differences of its own poses: nothing here is the
//! planner's or the guards'.

use std::collections::VecDeque;

use hexapod::Pose;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// Samples are this far apart, s.
pub const STEP_S: f64 = 1e-3;

/// The machine as the referee knows it: joints (m), and point masses on the plate (kg, m, in P), in gravity
/// (A, m/s²).
#[derive(Clone, Debug)]
pub struct Machine {
    pub base: [[f64; 3]; 6],
    pub plate: [[f64; 3]; 6],
    pub points: Vec<(f64, [f64; 3])>,
    pub gravity: [f64; 3],
}

/// The largest values of a phase.
#[derive(Clone, Copy, Debug)]
pub struct Peaks {
    pub shortest_m: f64,
    pub longest_m: f64,
    pub rate_mps: f64,
    pub acceleration_mps2: f64,
    pub jerk_mps3: f64,
    pub push_n: f64,
    pub pull_n: f64,
    pub buckling_nm2: f64,
}

impl Default for Peaks {
    fn default() -> Self {
        Self {
            shortest_m: f64::INFINITY,
            longest_m: 0.0,
            rate_mps: 0.0,
            acceleration_mps2: 0.0,
            jerk_mps3: 0.0,
            push_n: 0.0,
            pull_n: 0.0,
            buckling_nm2: 0.0,
        }
    }
}

/// One instant.
struct Sample {
    origin: Vector3<f64>,
    joints: [Vector3<f64>; 6],
    lengths: [f64; 6],
    points: Vec<Vector3<f64>>,
}

/// Watches one machine.
pub struct Referee {
    machine: Machine,
    last: VecDeque<Sample>,
    /// The peaks before and after something went wrong.
    pub peaks: [Peaks; 2],
    /// The one of these that is counted.
    pub phase: usize,
    /// The last time at which a leg moved faster than `still_mps`, s.
    pub moved_s: f64,
    pub still_mps: f64,
}

/// Returns `Rz(yaw) Ry(pitch) Rx(roll)`, factor by factor.
fn turned(rpy: [f64; 3]) -> Matrix3<f64> {
    let [(sr, cr), (sp, cp), (sy, cy)] = rpy.map(f64::sin_cos);
    let x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cr, -sr, 0.0, sr, cr);
    let y = Matrix3::new(cp, 0.0, sp, 0.0, 1.0, 0.0, -sp, 0.0, cp);
    let z = Matrix3::new(cy, -sy, 0.0, sy, cy, 0.0, 0.0, 0.0, 1.0);
    z * y * x
}

impl Referee {
    pub fn new(machine: Machine, still_mps: f64) -> Self {
        Self {
            machine,
            last: VecDeque::new(),
            peaks: [Peaks::default(); 2],
            phase: 0,
            moved_s: 0.0,
            still_mps,
        }
    }

    /// Takes the pose of an instant, [`STEP_S`] after the one before.
    pub fn sees(&mut self, time_s: f64, pose: &Pose) {
        let (origin, turn) = (Vector3::from(pose.position_m), turned(pose.rpy_rad));
        let at = |p: &[f64; 3]| origin + turn * Vector3::from(*p);
        let joints: [Vector3<f64>; 6] = std::array::from_fn(|i| at(&self.machine.plate[i]));
        let lengths = std::array::from_fn(|i| (joints[i] - Vector3::from(self.machine.base[i])).norm());
        let points = self.machine.points.iter().map(|(_, p)| at(p)).collect();
        self.last.push_back(Sample { origin, joints, lengths, points });
        if self.last.len() > 4 {
            self.last.pop_front();
        }
        if self.last.len() == 4 {
            self.judge(time_s);
        }
    }

    fn judge(&mut self, time_s: f64) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| &self.last[k]);
        let peaks = &mut self.peaks[self.phase];
        for i in 0..6 {
            let [la, lb, lc, ld] = [a, b, c, d].map(|s| s.lengths[i]);
            let rate = (ld - lc) / STEP_S;
            peaks.shortest_m = peaks.shortest_m.min(ld);
            peaks.longest_m = peaks.longest_m.max(ld);
            peaks.rate_mps = peaks.rate_mps.max(rate.abs());
            peaks.acceleration_mps2 =
                peaks.acceleration_mps2.max((ld - 2.0 * lc + lb).abs() / STEP_S.powi(2));
            peaks.jerk_mps3 = peaks.jerk_mps3.max((ld - 3.0 * lc + 3.0 * lb - la).abs() / STEP_S.powi(3));
            if rate.abs() > self.still_mps {
                self.moved_s = time_s;
            }
        }
        // Newton for every point about the sample in the middle.
        let mut wrench = Vector6::zeros();
        for (k, (mass, _)) in self.machine.points.iter().enumerate() {
            let acceleration = (d.points[k] - 2.0 * c.points[k] + b.points[k]) / STEP_S.powi(2);
            let force = *mass * (acceleration - Vector3::from(self.machine.gravity));
            let moment = (c.points[k] - c.origin).cross(&force);
            wrench += Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        }
        let mut h = Matrix6::zeros();
        for i in 0..6 {
            let along = (c.joints[i] - Vector3::from(self.machine.base[i])) / c.lengths[i];
            let about = (c.joints[i] - c.origin).cross(&along);
            h.set_column(i, &Vector6::new(along.x, along.y, along.z, about.x, about.y, about.z));
        }
        let Some(forces) = h.lu().solve(&wrench) else { return };
        for (force, length) in forces.iter().zip(c.lengths) {
            peaks.push_n = peaks.push_n.max(*force);
            peaks.pull_n = peaks.pull_n.max(-force);
            peaks.buckling_nm2 = peaks.buckling_nm2.max(force * length * length);
        }
    }
}
