//! Limits that are met at every instant of a motion, not only where it was checked.
//!
//! Between two seams a motion has a bounded third derivative (`x'''`, and `d²ω/dt²`). From the exact state in
//! the middle of an interval that bounds every lower derivative of the plate over it (Taylor), hence speeds,
//! accelerations and jerks of its joints, hence lengths, rates, accelerations, angles and forces of the legs
//! and the singular values of H (Weyl). An interval whose bound lies more than a per cent above the largest
//! value seen anywhere is cut in two.

use nalgebra::Vector3;

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
    /// The guaranteed margin as a share of what is allowed, as [`super::Margin::relative`].
    pub fn margin(&self) -> f64 {
        if self.allowed.is_infinite() { 1.0 } else { 1.0 - self.bound / self.allowed }
    }
}

/// The guarantee for a whole motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Guarantee {
    /// In the order of [`Limit`], the angular rate last. Joint angles, jerks and the further limits of forces
    /// are there if they are limited. The bound of a jerk is that of a whole segment, some twelve times the
    /// largest there is.
    pub peaks: Vec<Peak>,
}

impl Guarantee {
    /// The limit that is nearest.
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

/// Values in the middle of an interval and bounds over it.
struct Look {
    seen: [(f64, Option<usize>); QUANTITIES],
    bound: [f64; QUANTITIES],
    between: Option<[Part; 2]>,
}

/// Mass (kg), first (kg m) and second (kg m²) moment of all points' distances from the plate's origin.
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
    /// True if every limit is known to be met in the interval of `2 half` about `time_s`, between two seams.
    pub(super) fn shown(&self, trajectory: &Trajectory, time_s: f64, half: f64) -> bool {
        let look = self.geometry.look(trajectory, time_s, half, self.load, self.moments);
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
        let look = self.geometry.look(trajectory, time_s, half, self.load, self.moments);
        (0..QUANTITIES).find_map(|q| {
            let (value, max) = (look.bound[q], self.allowed[q]);
            if value <= max * (1.0 + touch) {
                return None;
            }
            let leg = look.seen[q].1;
            LIMITS[q].map(|limit| self.geometry.overstepped(limit, leg, look.between, value, max))
        })
    }
}

impl Geometry {
    /// A bound that lies above what is allowed.
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
    /// Bounds of every limited quantity over the whole of `trajectory`, at most about 1 % above the largest
    /// value seen; leg forces with `load`, the angular rate against `rate_limit_radps`.
    pub fn guarantee(
        &self,
        trajectory: &Trajectory,
        load: Option<&Load>,
        rate_limit_radps: f64,
    ) -> Guarantee {
        let moments = load.map(moments);
        let legs = self.has_joints();
        let present = [
            legs,
            legs,
            legs,
            legs && self.limits.leg_jerk_mps3.is_some(),
            legs && load.is_some(),
            legs && load.is_some() && self.limits.leg_push_n.is_some(),
            legs && load.is_some() && self.limits.leg_pull_n.is_some(),
            legs && load.is_some() && self.limits.leg_buckling_nm2.is_some(),
            legs && self.limits.base_joints.is_some(),
            legs && self.limits.plate_joints.is_some(),
            legs,
            legs && self.limits.bulk.is_some(),
            !legs,
            !legs,
            !legs,
            true,
        ];
        let allowed = self.allowed(rate_limit_radps);
        let mut queue = Vec::new();
        for pair in trajectory.seams_s().windows(2) {
            let (from, length) = (pair[0], pair[1] - pair[0]);
            let count = (length / FIRST_STEP_S).ceil().max(1.0);
            let half = 0.5 * length / count;
            queue.extend((0..count as u64).map(|k| (from + (2 * k + 1) as f64 * half, half, 0)));
        }
        if queue.is_empty() {
            queue.push((0.0, 0.0, 0));
        }
        let mut seen = [(0.0, None, 0.0); QUANTITIES];
        let mut note = |look: &Look, time_s: f64| {
            for (best, (value, leg)) in seen.iter_mut().zip(look.seen) {
                if value > best.0 {
                    *best = (value, leg, time_s);
                }
            }
            seen
        };
        // A first round of all intervals, so that most are seen to be small the first time.
        let looks: Vec<Look> = queue
            .iter()
            .map(|&(time_s, half, _)| {
                let look = self.look(trajectory, time_s, half, load, moments);
                note(&look, time_s);
                look
            })
            .collect();
        let mut stack: Vec<_> = queue.into_iter().zip(looks).collect();
        let mut bound = [0.0_f64; QUANTITIES];
        while let Some(((time_s, half, cuts), look)) = stack.pop() {
            let best = note(&look, time_s);
            let near = (0..QUANTITIES).all(|q| {
                let most = best[q].0;
                // Where nothing comes near anything, there is no value to be near to.
                let slack = if q == CLEARANCE { TOLERANCE * allowed[q] } else { 0.0 };
                // The bound of a jerk comes no nearer in a shorter interval; pushes and pulls have the
                // force's.
                !present[q]
                    || (JERK..=BUCKLING).contains(&q) && q != FORCE
                    || look.bound[q] <= slack.max(most * (1.0 + TOLERANCE))
                    || most.is_infinite()
            });
            if near || cuts == CUTS || half == 0.0 {
                for (sum, b) in bound.iter_mut().zip(look.bound) {
                    *sum = sum.max(b);
                }
                continue;
            }
            for middle in [time_s - 0.5 * half, time_s + 0.5 * half] {
                let look = self.look(trajectory, middle, 0.5 * half, load, moments);
                stack.push(((middle, 0.5 * half, cuts + 1), look));
            }
        }
        let mut between = None;
        if present[CLEARANCE] {
            let state = trajectory.state(seen[CLEARANCE].2);
            between = self.nearest(&self.legs_at(&state.position, &state.rotation)).map(|n| n.between);
        }
        let peaks = (0..QUANTITIES).filter(|q| present[*q]).map(|q| {
            let (value, leg, time_s) = seen[q];
            Peak {
                limit: LIMITS[q],
                leg,
                between: between.filter(|_| q == CLEARANCE),
                time_s,
                seen: value,
                bound: bound[q].max(value),
                allowed: allowed[q],
            }
        });
        Guarantee { peaks: peaks.collect() }
    }

    /// Returns a bound of the legs' jerks over the whole of `trajectory` as a share of their limit; zero
    /// without a limit.
    pub fn jerk_share(&self, trajectory: &Trajectory) -> f64 {
        let Some(limit) = self.limits.leg_jerk_mps3.filter(|_| self.has_joints()) else { return 0.0 };
        let mut most = 0.0_f64;
        for pair in trajectory.seams_s().windows(2) {
            let (from, length) = (pair[0], pair[1] - pair[0]);
            let count = (length / FIRST_STEP_S).ceil().max(1.0);
            let half = 0.5 * length / count;
            for k in 0..count as u64 {
                let look = self.look(trajectory, from + (2 * k + 1) as f64 * half, half, None, None);
                most = most.max(look.bound[JERK]);
            }
        }
        most / limit
    }

    /// To ask of intervals of any length, as [`Geometry::check`] does.
    pub(super) fn bounds_of<'a>(&'a self, load: Option<&'a Load>) -> Bounds<'a> {
        self.bounds_with(load, f64::INFINITY)
    }

    /// The same with a limit of the plate's angular rate.
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

    /// Magnitudes of the legs' mean jerks, m/s³, over at most a millisecond about `time_s`, inside `2 half`.
    fn mean_jerks(&self, trajectory: &Trajectory, time_s: f64, half: f64) -> [f64; 6] {
        let h = half.min(5e-4);
        if h <= 0.0 {
            return [0.0; 6];
        }
        let [before, after] = [-h, h].map(|h| self.leg_accelerations(&trajectory.state(time_s + h)));
        std::array::from_fn(|i| (after[i] - before[i]).abs() / (2.0 * h))
    }

    /// One interval of `2 half` about `time_s`, between two seams.
    fn look(
        &self,
        trajectory: &Trajectory,
        time_s: f64,
        half: f64,
        load: Option<&Load>,
        moments: Option<[f64; 3]>,
    ) -> Look {
        let state = trajectory.state(time_s);
        let [jerk, turning] = trajectory.third_derivatives(time_s);
        let margins = self.margins(&state, load);
        let legs = self.legs_at(&state.position, &state.rotation);
        let d = half;
        // Over the interval: |x''|, |ω̇|, |ω|.
        let a = state.acceleration.norm() + jerk * d;
        let dw = state.angular_acceleration.norm() + turning * d;
        let w = state.angular_rate.norm() + (state.angular_acceleration.norm() + 0.5 * turning * d) * d;
        let whirl = turning + 3.0 * w * dw + w * w * w;
        let [lo, hi] = self.leg_length_m;
        let middle = 0.5 * (lo + hi);
        let omega = state.rotation * state.angular_rate;
        let mut look = Look {
            seen: [(0.0, None); QUANTITIES],
            bound: [0.0; QUANTITIES],
            between: margins.nearest.map(|nearest| nearest.between),
        };
        let mut put = |q: usize, leg: Option<usize>, value: f64, more: f64| {
            if value >= look.seen[q].0 {
                look.seen[q] = (value, leg);
            }
            // What is not a number bounds nothing.
            let sum = if (value + more).is_nan() { f64::INFINITY } else { value + more };
            look.bound[q] = look.bound[q].max(sum);
        };
        let faster = (state.angular_acceleration.norm() + 0.5 * turning * d) * d;
        put(TURNING, None, omega.norm(), faster);
        if let (Some(travel), Some(used)) = (&self.travel, margins.travel) {
            let speed: [f64; 3] = state.velocity.map(|v| v.abs() + 0.5 * a * d).into();
            put(TRAVEL, None, used.share, travel.most(&state, d, speed, w) - used.share);
            put(PLATE_SPEED, None, used.speed_mps, (state.acceleration.norm() + 0.5 * jerk * d) * d);
            put(PLATE_RATE, None, used.rate_radps, faster);
            return look;
        }
        // ‖H'‖ by columns, moments over a length as in `cond(H)`.
        let (mut h_rate, scale) = (0.0, self.moment_length_m());
        let jerks = self.limits.leg_jerk_mps3.map(|_| self.mean_jerks(trajectory, time_s, d));
        let (mut speeds, mut least_lengths) = ([0.0; 6], [0.0; 6]);
        for i in 0..6 {
            let leg = Some(i + 1);
            let arm = legs.arms[i].norm();
            let (rate, acceleration) = (margins.leg_rate_mps[i], margins.leg_acceleration_mps2[i]);
            let joint_a = a + (dw + w * w) * arm;
            let joint_jerk = jerk + whirl * arm;
            let u = (state.velocity + omega.cross(&legs.arms[i])).norm() + joint_a * d;
            let length = (legs.lengths[i] - u * d).max(f64::MIN_POSITIVE);
            (speeds[i], least_lengths[i]) = (u, length);
            // l'' = n·p'' + |u⊥|²/l and l''' = n·p''' + 3 u⊥·p''/l − 3 l' |u⊥|²/l², |l'| |u⊥|² ≤ 2|u|³/√27.
            let second = joint_a + u * u / length;
            let third =
                joint_jerk + 3.0 * u * joint_a / length + 6.0 / 27.0_f64.sqrt() * u.powi(3) / length.powi(2);
            put(0, leg, (legs.lengths[i] - middle).abs(), (rate.abs() + 0.5 * second * d) * d);
            put(1, leg, rate.abs(), (acceleration.abs() + 0.5 * third * d) * d);
            put(2, leg, acceleration.abs(), third * d);
            if let Some(jerks) = jerks {
                put(JERK, leg, jerks[i], (third - jerks[i]).max(0.0));
            }
            let lean = u / length;
            for (q, angles, turn) in
                [(BASE, margins.base_joint_rad, 0.0), (PLATE, margins.plate_joint_rad, w)]
            {
                if let Some(angles) = angles {
                    put(q, leg, angles[i], (lean + turn) * d);
                }
            }
            h_rate += lean * lean + (arm * (w + lean) / scale).powi(2);
        }
        let h_rate = h_rate.sqrt();
        let singular = legs.force_transmission_over(scale).singular_values();
        let (most, least) = (singular.max(), singular.min());
        let floor = least - h_rate * d;
        let cond = margins.condition_number;
        let worst = if floor > 0.0 { (most + h_rate * d) / floor } else { f64::INFINITY };
        put(CONDITIONING, None, cond, if cond.is_finite() { (worst - cond).max(0.0) } else { 0.0 });
        if let (Some(bulk), Some(nearest)) = (&self.limits.bulk, margins.nearest) {
            // Clipped: what is far away is none of its business.
            let lacking = bulk.range_m() - (nearest.distance_m - bulk.clearance_m);
            let more = bulk.rate(&speeds, &least_lengths) * d;
            put(CLEARANCE, None, lacking.max(0.0), (lacking + more).max(0.0) - lacking.max(0.0));
        }
        if let (Some(forces), Some([m, first, second]), Some(load)) = (margins.leg_force_n, moments, load) {
            // Of points at distance r: specific force at most `felt + spin r`, its derivative at most
            // `jerk + whirl r`.
            let felt = a + Vector3::from(load.gravity_mps2).norm();
            let spin = dw + w * w;
            let wrench = (m * felt + spin * first).hypot((first * felt + spin * second) / scale);
            let change = (m * jerk + whirl * first)
                .hypot((first * (w * felt + jerk) + second * (w * spin + whirl)) / scale);
            // H f' = w' − H' f.
            let rate = if floor > 0.0 { (change + h_rate * wrench / floor) / floor } else { f64::INFINITY };
            for (i, [low, high]) in forces.into_iter().enumerate() {
                let leg = Some(i + 1);
                let (push, pull) = (high.max(0.0), (-low).max(0.0));
                put(FORCE, leg, high.max(-low), rate * d);
                put(PUSH, leg, push, rate * d);
                put(PULL, leg, pull, rate * d);
                let (length, longer) = (legs.lengths[i], legs.lengths[i] + speeds[i] * d);
                let now = push * length * length;
                put(BUCKLING, leg, now, (push + rate * d) * longer * longer - now);
            }
        }
        look
    }
}

#[cfg(test)]
#[path = "guarantee_tests.rs"]
mod tests;
