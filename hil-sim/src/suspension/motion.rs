//! A motion at a uniform rate from a start.

use nalgebra::{DVector, Vector3};

use hexapod::FrameMotion;

use super::dynamics::{PLACES, Suspended, rotation};
use super::{Gauss, SuspensionError};

/// Stages of the integrator, of order twice as many.
const STAGES: usize = 4;
/// Longest step, s.
const LONGEST_STEP_S: f64 = 1.0 / 120.0;
/// Longest step, periods of the quickest natural vibration.
const LONGEST_STEP_PERIODS: f64 = 0.06;

/// The beginning of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// P's origin in A, m.
    pub position_m: [f64; 3],
    /// `R_AP`, w, x, y, z.
    pub rotation_wxyz: [f64; 4],
    /// Velocity of P's origin, A's axes, m/s.
    pub velocity_mps: [f64; 3],
    /// Angular rate of P, A's axes, rad/s.
    pub rate_radps: [f64; 3],
    /// Joints: parent's axes ← link's axes, w, x, y, z; in the order of the links.
    pub joint_wxyz: Vec<[f64; 4]>,
    /// Rates of the joints, link's axes, rad/s.
    pub joint_rate_radps: Vec<[f64; 3]>,
    /// Shift of the support, A's axes, m.
    pub support_m: [f64; 3],
}

impl Start {
    /// Returns a start at rest in the reference pose with the joints so.
    pub fn resting(joint_wxyz: &[[f64; 4]]) -> Self {
        Self {
            position_m: [0.0; 3],
            rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
            velocity_mps: [0.0; 3],
            rate_radps: [0.0; 3],
            joint_wxyz: joint_wxyz.to_vec(),
            joint_rate_radps: vec![[0.0; 3]; joint_wxyz.len()],
            support_m: [0.0; 3],
        }
    }
}

/// The time to simulate, and the part of it to store.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Duration, s; the last instant is not later.
    pub duration_s: f64,
    /// Rate of the instants, Hz.
    pub rate_hz: f64,
    /// Longest step of the integrator, s; `None` chooses by the quickest natural vibration.
    pub step_s: Option<f64>,
}

impl Run {
    /// Makes a run with steps by the quickest natural vibration.
    pub fn new(duration_s: f64, rate_hz: f64) -> Self {
        Self { duration_s, rate_hz, step_s: None }
    }
}

/// Energy, J; the sum of all three is constant without damping.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Energy of motion.
    pub kinetic_j: f64,
    /// Energy of height above A's origin.
    pub gravity_j: f64,
    /// Energy in the springs, the work of their preload included, zero in the reference pose; with the
    /// support's.
    pub springs_j: f64,
}

impl Energy {
    /// Returns the sum of all energies, J.
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.gravity_j + self.springs_j
    }
}

/// Everything at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Instant {
    /// Time since the start, s.
    pub time_s: f64,
    /// Motion of P.
    pub platform: FrameMotion,
    /// Motion of link 0, the base link, and of the links on it.
    pub links: Vec<FrameMotion>,
    /// Joints: parent's axes ← link's axes, w, x, y, z.
    pub joint_wxyz: Vec<[f64; 4]>,
    /// Wrench of the springs on P about its origin, A's axes, without loss; N, N m.
    pub springs: [f64; 6],
    /// The addition of the springs' loss to it.
    pub damping: [f64; 6],
    /// The addition of the locks of P's coordinates, zero along free ones.
    pub reaction: [f64; 6],
    /// Shift of the support, A's axes, m.
    pub support_m: [f64; 3],
    /// Energy.
    pub energy: Energy,
}

/// A motion at a uniform rate, from time zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Rate, Hz.
    pub rate_hz: f64,
    /// The instants.
    pub instants: Vec<Instant>,
}

fn six([a, b]: [Vector3<f64>; 2]) -> [f64; 6] {
    [a.x, a.y, a.z, b.x, b.y, b.z]
}

impl Suspended {
    /// Simulates the motion from a start.
    pub fn simulate(&self, start: &Start, run: &Run) -> Result<Motion, SuspensionError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let step = run.step_s.unwrap_or(LONGEST_STEP_S);
        if !(positive(run.duration_s) && positive(run.rate_hz) && positive(step)) {
            return Err(SuspensionError::Figure { what: "duration, rate or step".to_string() });
        }
        let longest = match run.step_s {
            Some(step) => step,
            None => self.step_for(&start.joint_wxyz),
        };
        let mut state = self.state(start)?;
        let period = 1.0 / run.rate_hz;
        let steps = (period / longest - 1e-9).ceil().max(1.0);
        let step_s = period / steps;
        let gauss = Gauss::new(STAGES);
        let slope = |x: &DVector<f64>| self.derivative(x);
        let mut slopes = gauss.begin(&state, slope);
        let count = (run.duration_s * run.rate_hz + 1e-9).floor() as usize;
        let mut instants = Vec::with_capacity(count + 1);
        instants.push(self.instant(0.0, &state)?);
        for n in 1..=count {
            let time_s = n as f64 / run.rate_hz;
            for _ in 0..steps as usize {
                state = gauss
                    .step(&state, step_s, &mut slopes, slope)
                    .ok_or(SuspensionError::Step { time_s, step_s })?;
            }
            instants.push(self.instant(time_s, &state)?);
        }
        Ok(Motion { rate_hz: run.rate_hz, instants })
    }

    /// Returns a step short enough for the quickest vibration, s.
    fn step_for(&self, joint_wxyz: &[[f64; 4]]) -> f64 {
        // What has no rest has no modes either; it moves all the same.
        let modes = self.modes(joint_wxyz).unwrap_or_default();
        let quickest = modes.last().map_or(0.0, |m| m.frequency_hz);
        LONGEST_STEP_S.min(LONGEST_STEP_PERIODS / quickest.max(1e-9))
    }

    /// Returns everything at a start: accelerations and forces without a motion.
    pub fn at(&self, start: &Start) -> Result<Instant, SuspensionError> {
        self.instant(0.0, &self.state(start)?)
    }

    /// Returns everything at a state.
    pub(super) fn instant(&self, time_s: f64, state: &DVector<f64>) -> Result<Instant, SuspensionError> {
        let equations = self.equations(state);
        let accelerations = self.accelerations(&equations).ok_or(SuspensionError::Massless)?;
        let left = &equations.mass * &accelerations - &equations.force;
        let mut motions = equations.frames.iter().map(|f| f.with(&accelerations));
        let platform = motions.next().ok_or(SuspensionError::Massless)?;
        let joint = |k: usize| rotation(&state.as_slice()[PLACES + 4 * k..PLACES + 4 * k + 4]);
        let [support, _] = self.support(state);
        Ok(Instant {
            time_s,
            platform,
            links: motions.collect(),
            joint_wxyz: (0..self.joints.len()).map(|k| crate::links::quaternion(&joint(k))).collect(),
            springs: six(equations.springs.elastic),
            damping: six(equations.springs.damping),
            reaction: std::array::from_fn(|k| if self.made_of.locked[k] { left[3 + k] } else { 0.0 }),
            support_m: support.into(),
            energy: Energy {
                kinetic_j: self.kinetic(state, &equations.mass),
                gravity_j: self.height(&equations.frames),
                springs_j: equations.springs.energy + self.under_support(&support, &Vector3::zeros()).1,
            },
        })
    }

    /// Returns `½ uᵀ M u`, J.
    fn kinetic(&self, state: &DVector<f64>, mass: &nalgebra::DMatrix<f64>) -> f64 {
        let (places, rates) = self.size();
        let u = state.rows(places, rates);
        0.5 * u.dot(&(mass * u))
    }

    /// Returns `− Σ m g · c`, J.
    fn height(&self, frames: &[super::dynamics::Frame]) -> f64 {
        let com = |f: &FrameMotion, com: [f64; 3]| f.position + f.rotation * Vector3::from(com);
        self.bodies()
            .zip(frames)
            .map(|(b, f)| -b.mass_kg * self.gravity().dot(&com(&f.motion, b.com_m)))
            .sum()
    }
}
