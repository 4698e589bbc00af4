//! Limits that are met at every instant of a motion, not only where it was checked.
//!
//! Between two seams a motion has a bounded third derivative (`x'''`, and `d²ω/dt²`). From the exact state in
//! the middle of an interval that bounds every lower derivative of the plate over it (Taylor), hence speeds,
//! accelerations and jerks of its joints, hence lengths, rates, accelerations, angles and forces of the legs
//! and the singular values of H (Weyl). An interval whose bound lies more than a per cent above the largest
//! value seen anywhere is cut in two.

mod look;

use look::Look;

use super::geometry::Geometry;
use super::limits::{Bulk, Limit, Part, Violation};
use super::load::{Bodies, Load};
use super::margins::too_near;
use super::trajectory::Trajectory;

/// The largest value of one limited quantity over a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// The limit; `None` for the plate's angular rate, which is the gyro's concern.
    pub limit: Option<Limit>,
    /// 1 to 6, of the largest value seen; absent for `cond(H)`, the clearance and the angular rate.
    pub leg: Option<usize>,
    /// The two parts whose clearance is the least.
    pub between: Option<[Part; 2]>,
    /// Time of the largest value seen, s.
    pub time_s: f64,
    /// Largest value seen. Of a length its distance from the middle of the stroke, m; of the clearance what
    /// the distance lacks of a leg's diameter beyond the least, m; else a magnitude in the [`Limit`]'s unit,
    /// rad/s of the angular rate.
    pub seen: f64,
    /// The bound that it stays below at every instant.
    pub bound: f64,
    /// The allowed value: half the stroke, or the limit; infinite if there is none.
    pub allowed: f64,
}

impl Peak {
    /// Returns the guaranteed margin as a share of what is allowed, as [`super::Margin::relative`].
    pub fn margin(&self) -> f64 {
        if self.allowed.is_infinite() { 1.0 } else { 1.0 - self.bound / self.allowed }
    }
}

/// The guarantee for a whole motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Guarantee {
    /// The peaks in the order of [`Limit`], the angular rate last. Joint angles, jerks and the further limits
    /// of forces are there if they are limited. The bound of a jerk is that of a whole segment, some twelve
    /// times the largest there is.
    pub peaks: Vec<Peak>,
}

impl Guarantee {
    /// Returns the limit that is nearest.
    pub fn tightest(&self) -> Option<&Peak> {
        self.peaks.iter().min_by(|a, b| a.margin().total_cmp(&b.margin()))
    }

    /// Returns whether every limit is met.
    pub fn is_kept(&self) -> bool {
        self.peaks.iter().all(|p| p.bound <= p.allowed)
    }

    /// Returns the first limit that is not known to be met, with its value and time, if it is the platform's.
    pub fn violation(&self, geometry: &Geometry) -> Option<(Violation, f64)> {
        self.peaks.iter().filter(|p| p.bound > p.allowed).find_map(|p| {
            Some((geometry.overstepped(p.limit?, p.leg, p.between, p.bound, p.allowed), p.time_s))
        })
    }
}

/// Quantities in the order of [`Limit`], and the angular rate.
const QUANTITIES: usize = 16;
const JERK: usize = 3;
const FORCE: usize = 4;
const PUSH: usize = 5;
const PULL: usize = 6;
const BUCKLING: usize = 7;
const BASE: usize = 8;
const PLATE: usize = 9;
const CONDITIONING: usize = 10;
const CLEARANCE: usize = 11;
const TRAVEL: usize = 12;
const PLATE_SPEED: usize = 13;
const PLATE_RATE: usize = 14;
const TURNING: usize = 15;
const LIMITS: [Option<Limit>; QUANTITIES] = [
    Some(Limit::LegLength),
    Some(Limit::LegRate),
    Some(Limit::LegAcceleration),
    Some(Limit::LegJerk),
    Some(Limit::LegForce),
    Some(Limit::LegPush),
    Some(Limit::LegPull),
    Some(Limit::LegBuckling),
    Some(Limit::BaseJointAngle),
    Some(Limit::PlateJointAngle),
    Some(Limit::Conditioning),
    Some(Limit::Clearance),
    Some(Limit::Travel),
    Some(Limit::PlateSpeed),
    Some(Limit::PlateRate),
    None,
];
/// Bounds need not be nearer to the largest value seen than this share of it.
const TOLERANCE: f64 = 0.01;
/// Intervals to begin with, s, and how often one is cut in two at most.
const FIRST_STEP_S: f64 = 0.016;
const CUTS: u32 = 16;

/// Returns mass (kg), first (kg m) and second (kg m²) moment of all points' distances from the plate's
/// origin.
fn moments(load: &Load) -> [f64; 3] {
    let (known, set) = match &load.bodies {
        Bodies::Known(known) => (known, [0.0; 3]),
        Bodies::Within { known, body } => (known, body.moments()),
    };
    known.iter().fold(set, |[m, first, second], body| {
        let [xx, yy, zz, ..] = body.inertia_origin_kgm2();
        let square = 0.5 * (xx + yy + zz);
        // Cauchy and Schwarz.
        [m + body.mass_kg, first + (body.mass_kg * square).sqrt(), second + square]
    })
}

/// A machine, its load and its limits.
pub(super) struct Bounds<'a> {
    geometry: &'a Geometry,
    load: Option<&'a Load>,
    moments: Option<[f64; 3]>,
    allowed: [f64; QUANTITIES],
}

impl Bounds<'_> {
    /// Returns true if every limit is known to be met in the interval of `2 half` about `time_s`, between two
    /// seams.
    pub(super) fn shown(&self, trajectory: &Trajectory, time_s: f64, half: f64) -> bool {
        let look = self.look(trajectory, time_s, half);
        look.bound.iter().zip(self.allowed).all(|(bound, allowed)| *bound <= allowed)
    }

    /// Returns the first limit that is not known to be met in the interval of `2 half` about `time_s`,
    /// between two seams; a bound may lie above its limit by the share `touch`.
    pub(super) fn beyond(
        &self,
        trajectory: &Trajectory,
        time_s: f64,
        half: f64,
        touch: f64,
    ) -> Option<Violation> {
        let look = self.look(trajectory, time_s, half);
        (0..QUANTITIES).find_map(|q| {
            let (value, max) = (look.bound[q], self.allowed[q]);
            if value <= max * (1.0 + touch) {
                return None;
            }
            let leg = look.seen[q].1;
            LIMITS[q].map(|limit| self.geometry.overstepped(limit, leg, look.between, value, max))
        })
    }

    /// Examines the interval of `2 half` about `time_s`, between two seams.
    fn look(&self, trajectory: &Trajectory, time_s: f64, half: f64) -> Look {
        self.geometry.look(trajectory, time_s, half, self.load, self.moments)
    }
}

/// The search for bounds over a whole motion.
struct Search<'a> {
    bounds: Bounds<'a>,
    trajectory: &'a Trajectory,
    /// Quantities that are of account.
    present: [bool; QUANTITIES],
    /// Largest values seen, each with its leg and its time, s.
    seen: [(f64, Option<usize>, f64); QUANTITIES],
    /// Bounds over the intervals that are done with.
    bound: [f64; QUANTITIES],
}

impl Search<'_> {
    /// Bounds the whole motion.
    fn run(&mut self) {
        let mut first = first_intervals(self.trajectory);
        if first.is_empty() {
            first.push((0.0, 0.0));
        }
        let mut stack = Vec::with_capacity(first.len());
        // A first round of all intervals, so that most are seen to be small the first time.
        for (time_s, half) in first {
            let look = self.bounds.look(self.trajectory, time_s, half);
            self.note(&look, time_s);
            stack.push(((time_s, half, 0), look));
        }
        while let Some(((time_s, half, cuts), look)) = stack.pop() {
            self.note(&look, time_s);
            if self.is_near(&look) || cuts == CUTS || half == 0.0 {
                for (sum, b) in self.bound.iter_mut().zip(look.bound) {
                    *sum = sum.max(b);
                }
                continue;
            }
            for middle in [time_s - 0.5 * half, time_s + 0.5 * half] {
                let look = self.bounds.look(self.trajectory, middle, 0.5 * half);
                stack.push(((middle, 0.5 * half, cuts + 1), look));
            }
        }
    }

    /// Keeps the largest values.
    fn note(&mut self, look: &Look, time_s: f64) {
        for (best, (value, leg)) in self.seen.iter_mut().zip(look.seen) {
            if value > best.0 {
                *best = (value, leg, time_s);
            }
        }
    }

    /// Returns true if no bound of an interval lies far above the largest value seen.
    fn is_near(&self, look: &Look) -> bool {
        (0..QUANTITIES).all(|q| {
            let most = self.seen[q].0;
            // Where nothing comes near anything, there is no value to be near to.
            let slack = if q == CLEARANCE { TOLERANCE * self.bounds.allowed[q] } else { 0.0 };
            // The bound of a jerk comes no nearer in a shorter interval; pushes and pulls have the force's.
            !self.present[q]
                || (JERK..=BUCKLING).contains(&q) && q != FORCE
                || look.bound[q] <= slack.max(most * (1.0 + TOLERANCE))
                || most.is_infinite()
        })
    }

    /// Returns the peaks of all quantities that are of account.
    fn peaks(&self) -> Vec<Peak> {
        let geometry = self.bounds.geometry;
        let mut between = None;
        if self.present[CLEARANCE] {
            let state = self.trajectory.state(self.seen[CLEARANCE].2);
            between =
                geometry.nearest(&geometry.legs_at(&state.position, &state.rotation)).map(|n| n.between);
        }
        let peaks = (0..QUANTITIES).filter(|q| self.present[*q]).map(|q| {
            let (value, leg, time_s) = self.seen[q];
            Peak {
                limit: LIMITS[q],
                leg,
                between: between.filter(|_| q == CLEARANCE),
                time_s,
                seen: value,
                bound: self.bound[q].max(value),
                allowed: self.bounds.allowed[q],
            }
        });
        peaks.collect()
    }
}

/// Intervals to begin with, between any two seams: the middle of each and half its length, s.
fn first_intervals(trajectory: &Trajectory) -> Vec<(f64, f64)> {
    let mut intervals = Vec::new();
    for pair in trajectory.seams_s().windows(2) {
        let (from, length) = (pair[0], pair[1] - pair[0]);
        let count = (length / FIRST_STEP_S).ceil().max(1.0);
        let half = 0.5 * length / count;
        intervals.extend((0..count as u64).map(|k| (from + (2 * k + 1) as f64 * half, half)));
    }
    intervals
}

impl Geometry {
    /// Returns the violation of a bound that lies above what is allowed.
    fn overstepped(
        &self,
        limit: Limit,
        leg: Option<usize>,
        between: Option<[Part; 2]>,
        bound: f64,
        max: f64,
    ) -> Violation {
        if let (Limit::Clearance, Some(bulk), Some(between)) = (limit, &self.limits.bulk, between) {
            return too_near(bulk.clearance_m + max - bound, between, bulk.clearance_m);
        }
        let [lo, hi] = self.leg_length_m;
        let (value, allowed) = match limit {
            _ if limit.is_of_travel() => (bound, [0.0, max]),
            Limit::LegLength => (0.5 * (lo + hi) + bound, [lo, hi]),
            _ => (bound, [-max, max]),
        };
        Violation { limit, leg, between: None, value, allowed }
    }
}

impl Geometry {
    /// Returns bounds of every limited quantity over the whole of `trajectory`, at most about 1 % above the
    /// largest value seen; leg forces with `load`, the angular rate against `rate_limit_radps`.
    pub fn guarantee(
        &self,
        trajectory: &Trajectory,
        load: Option<&Load>,
        rate_limit_radps: f64,
    ) -> Guarantee {
        let mut search = Search {
            bounds: self.bounds_with(load, rate_limit_radps),
            trajectory,
            present: self.present(load.is_some()),
            seen: [(0.0, None, 0.0); QUANTITIES],
            bound: [0.0; QUANTITIES],
        };
        search.run();
        let mut peaks = search.peaks();
        // The angular rate stays the last.
        let last = peaks.len() - 1;
        peaks.splice(last..last, self.arm_peaks(trajectory, load));
        Guarantee { peaks }
    }

    /// Returns the peaks of an arm's joints, if it is one: control points bound a path at every instant.
    fn arm_peaks(&self, trajectory: &Trajectory, load: Option<&Load>) -> Vec<Peak> {
        let Some(arm) = &self.arm else { return Vec::new() };
        let peak = |limit, leg, time_s, value: f64, allowed| Peak {
            limit: Some(limit),
            leg,
            between: None,
            time_s,
            seen: value,
            bound: value,
            allowed,
        };
        let mut peaks: Vec<Peak> = match arm.peaks(trajectory) {
            Ok(all) => {
                all.map(|p| peak(p.limit, Some(p.joint), p.time_s, p.value, p.allowed)).into_iter().collect()
            }
            Err((violation, time_s)) => vec![peak(violation.limit, None, time_s, f64::INFINITY, 1.0)],
        };
        if let (Some(most), Some(load)) = (arm.payload_kg, load) {
            peaks.push(peak(Limit::ArmPayload, None, 0.0, load.most_kg(), most));
        }
        peaks
    }

    /// Returns the quantities that are of account, with a load or without one.
    fn present(&self, is_loaded: bool) -> [bool; QUANTITIES] {
        let (legs, limits) = (self.has_joints(), &self.limits);
        [
            legs,
            legs,
            legs,
            legs && limits.leg_jerk_mps3.is_some(),
            legs && is_loaded,
            legs && is_loaded && limits.leg_push_n.is_some(),
            legs && is_loaded && limits.leg_pull_n.is_some(),
            legs && is_loaded && limits.leg_buckling_nm2.is_some(),
            legs && limits.base_joints.is_some(),
            legs && limits.plate_joints.is_some(),
            legs,
            legs && limits.bulk.is_some(),
            !legs,
            !legs,
            !legs,
            true,
        ]
    }

    /// Returns a bound of the legs' jerks over the whole of `trajectory` as a share of their limit; zero
    /// without a limit.
    pub fn jerk_share(&self, trajectory: &Trajectory) -> f64 {
        let Some(limit) = self.limits.leg_jerk_mps3.filter(|_| self.has_joints()) else { return 0.0 };
        let mut most = 0.0_f64;
        for (time_s, half) in first_intervals(trajectory) {
            most = most.max(self.look(trajectory, time_s, half, None, None).bound[JERK]);
        }
        most / limit
    }

    /// Returns the bounds of intervals of any length, as [`Geometry::check`] uses them.
    pub(super) fn bounds_of<'a>(&'a self, load: Option<&'a Load>) -> Bounds<'a> {
        self.bounds_with(load, f64::INFINITY)
    }

    /// Returns the bounds as [`Self::bounds_of`] does, with a limit of the plate's angular rate.
    pub(super) fn bounds_with<'a>(&'a self, load: Option<&'a Load>, rate_limit_radps: f64) -> Bounds<'a> {
        Bounds { geometry: self, load, moments: load.map(moments), allowed: self.allowed(rate_limit_radps) }
    }

    fn allowed(&self, rate_limit_radps: f64) -> [f64; QUANTITIES] {
        let [lo, hi] = self.leg_length_m;
        let limits = &self.limits;
        let most = |limit: Option<f64>| limit.unwrap_or(f64::INFINITY);
        if let Some(travel) = &self.travel {
            let mut allowed = [f64::INFINITY; QUANTITIES];
            (allowed[TRAVEL], allowed[TURNING]) = (1.0, rate_limit_radps);
            (allowed[PLATE_SPEED], allowed[PLATE_RATE]) = (most(travel.speed_mps), most(travel.rate_radps));
            return allowed;
        }
        [
            0.5 * (hi - lo),
            self.leg_rate_mps,
            most(limits.leg_acceleration_mps2),
            most(limits.leg_jerk_mps3),
            most(limits.leg_force_n),
            most(limits.leg_push_n),
            most(limits.leg_pull_n),
            most(limits.leg_buckling_nm2),
            most(limits.base_joints.as_ref().map(|c| c.half_angle_rad)),
            most(limits.plate_joints.as_ref().map(|c| c.half_angle_rad)),
            limits.cond_max,
            limits.bulk.as_ref().map_or(f64::INFINITY, Bulk::range_m),
            f64::INFINITY,
            f64::INFINITY,
            f64::INFINITY,
            rate_limit_radps,
        ]
    }
}

#[cfg(test)]
#[path = "guarantee_tests.rs"]
mod tests;
