//! One interval of a motion: values in its middle, and bounds over it.

use nalgebra::Vector3;

use super::{
    BASE, BUCKLING, CLEARANCE, CONDITIONING, FORCE, JERK, PLATE, PLATE_RATE, PLATE_SPEED, PULL, PUSH,
    QUANTITIES, TRAVEL, TURNING,
};
use crate::geometry::Geometry;
use crate::kinematics::PlateState;
use crate::legs::Legs;
use crate::limits::Part;
use crate::load::Load;
use crate::margins::{LimitMargins, TravelMargins};
use crate::trajectory::Trajectory;
use crate::travel::Travel;

/// Values in the middle of an interval and bounds over it.
pub(super) struct Look {
    pub(super) seen: [(f64, Option<usize>); QUANTITIES],
    pub(super) bound: [f64; QUANTITIES],
    pub(super) between: Option<[Part; 2]>,
}

impl Look {
    /// Notes a value of a quantity, and by how much more it is at most within the interval.
    fn put(&mut self, q: usize, leg: Option<usize>, value: f64, more: f64) {
        if value >= self.seen[q].0 {
            self.seen[q] = (value, leg);
        }
        // What is not a number bounds nothing.
        let sum = if (value + more).is_nan() { f64::INFINITY } else { value + more };
        self.bound[q] = self.bound[q].max(sum);
    }
}

/// The motion in the middle of an interval, and bounds of it over the interval.
struct Interval<'a> {
    geometry: &'a Geometry,
    state: PlateState,
    margins: LimitMargins,
    legs: Legs,
    /// The angular rate in A, rad/s.
    omega: Vector3<f64>,
    /// Half the length of the interval, s.
    half_s: f64,
    /// The length that moments are divided by, as in `cond(H)`, m.
    scale_m: f64,
    /// Bounds of |x'''|, |x''|, |ω̇| and |ω|.
    jerk: f64,
    acceleration: f64,
    angular_acceleration: f64,
    rate: f64,
    /// Bound of the change of |ω|.
    faster: f64,
    /// A point at distance r has at most this much more jerk, times r.
    whirl: f64,
}

/// Bounds of the legs' motion over an interval.
struct LegBounds {
    /// Speeds of the plate's joints, m/s.
    speeds: [f64; 6],
    /// Least lengths, m.
    least_lengths: [f64; 6],
    /// ‖H'‖ by columns, moments over a length as in `cond(H)`.
    h_rate: f64,
}

impl<'a> Interval<'a> {
    fn of(
        geometry: &'a Geometry,
        trajectory: &Trajectory,
        time_s: f64,
        half_s: f64,
        load: Option<&Load>,
    ) -> Self {
        let state = trajectory.state(time_s);
        let [jerk, turning] = trajectory.third_derivatives(time_s);
        let acceleration = state.acceleration.norm() + jerk * half_s;
        let angular_acceleration = state.angular_acceleration.norm() + turning * half_s;
        let faster = (state.angular_acceleration.norm() + 0.5 * turning * half_s) * half_s;
        let rate = state.angular_rate.norm() + faster;
        let whirl = turning + 3.0 * rate * angular_acceleration + rate * rate * rate;
        Self {
            geometry,
            margins: geometry.margins(&state, load),
            legs: geometry.legs_at(&state.position, &state.rotation),
            omega: state.rotation * state.angular_rate,
            state,
            half_s,
            scale_m: geometry.moment_length_m(),
            jerk,
            acceleration,
            angular_acceleration,
            rate,
            faster,
            whirl,
        }
    }

    /// Bounds what a plate does whose joints are not published.
    fn of_travel(&self, travel: &Travel, used: TravelMargins, look: &mut Look) {
        let (state, d) = (&self.state, self.half_s);
        let speed: [f64; 3] = state.velocity.map(|v| v.abs() + 0.5 * self.acceleration * d).into();
        look.put(TRAVEL, None, used.share, travel.most(state, d, speed, self.rate) - used.share);
        let more = (state.acceleration.norm() + 0.5 * self.jerk * d) * d;
        look.put(PLATE_SPEED, None, used.speed_mps, more);
        look.put(PLATE_RATE, None, used.rate_radps, self.faster);
    }

    /// Bounds lengths, rates, accelerations, jerks and angles of the legs; `jerks` are their mean ones.
    fn of_legs(&self, jerks: Option<[f64; 6]>, look: &mut Look) -> LegBounds {
        let [lo, hi] = self.geometry.leg_length_m;
        let middle = 0.5 * (lo + hi);
        let (d, w, dw) = (self.half_s, self.rate, self.angular_acceleration);
        let (margins, legs) = (&self.margins, &self.legs);
        let (mut speeds, mut least_lengths, mut h_rate) = ([0.0; 6], [0.0; 6], 0.0_f64);
        for i in 0..6 {
            let leg = Some(i + 1);
            let arm = legs.arms[i].norm();
            let (rate, acceleration) = (margins.leg_rate_mps[i], margins.leg_acceleration_mps2[i]);
            let joint_a = self.acceleration + (dw + w * w) * arm;
            let joint_jerk = self.jerk + self.whirl * arm;
            let u = (self.state.velocity + self.omega.cross(&legs.arms[i])).norm() + joint_a * d;
            let length = (legs.lengths[i] - u * d).max(f64::MIN_POSITIVE);
            (speeds[i], least_lengths[i]) = (u, length);
            // l'' = n·p'' + |u⊥|²/l and l''' = n·p''' + 3 u⊥·p''/l − 3 l' |u⊥|²/l², |l'| |u⊥|² ≤ 2|u|³/√27.
            let second = joint_a + u * u / length;
            let third =
                joint_jerk + 3.0 * u * joint_a / length + 6.0 / 27.0_f64.sqrt() * u.powi(3) / length.powi(2);
            look.put(0, leg, (legs.lengths[i] - middle).abs(), (rate.abs() + 0.5 * second * d) * d);
            look.put(1, leg, rate.abs(), (acceleration.abs() + 0.5 * third * d) * d);
            look.put(2, leg, acceleration.abs(), third * d);
            if let Some(jerks) = jerks {
                look.put(JERK, leg, jerks[i], (third - jerks[i]).max(0.0));
            }
            let lean = u / length;
            self.of_angles(i, lean, look);
            h_rate += lean * lean + (arm * (w + lean) / self.scale_m).powi(2);
        }
        LegBounds { speeds, least_lengths, h_rate: h_rate.sqrt() }
    }

    /// Bounds the angles at the joints of leg `i`, which leans at most this fast, rad/s.
    fn of_angles(&self, i: usize, lean: f64, look: &mut Look) {
        let margins = &self.margins;
        for (q, angles, turn) in
            [(BASE, margins.base_joint_rad, 0.0), (PLATE, margins.plate_joint_rad, self.rate)]
        {
            if let Some(angles) = angles {
                look.put(q, Some(i + 1), angles[i], (lean + turn) * self.half_s);
            }
        }
    }

    /// Bounds `cond(H)`, and returns a bound of the least singular value of H from below.
    fn of_conditioning(&self, h_rate: f64, look: &mut Look) -> f64 {
        let singular = self.legs.force_transmission_over(self.scale_m).singular_values();
        let (most, least) = (singular.max(), singular.min());
        let floor = least - h_rate * self.half_s;
        let cond = self.margins.condition_number;
        let worst = if floor > 0.0 { (most + h_rate * self.half_s) / floor } else { f64::INFINITY };
        look.put(CONDITIONING, None, cond, if cond.is_finite() { (worst - cond).max(0.0) } else { 0.0 });
        floor
    }

    /// Bounds how near parts come to each other.
    fn of_clearance(&self, bounds: &LegBounds, look: &mut Look) {
        let (Some(bulk), Some(nearest)) = (&self.geometry.limits.bulk, self.margins.nearest) else { return };
        // Clipped: what is far away is none of its business.
        let lacking = bulk.range_m() - (nearest.distance_m - bulk.clearance_m);
        let more = bulk.rate(&bounds.speeds, &bounds.least_lengths) * self.half_s;
        look.put(CLEARANCE, None, lacking.max(0.0), (lacking + more).max(0.0) - lacking.max(0.0));
    }

    /// Bounds the legs' forces under a load with these moments; `floor` lies below all singular values of H.
    fn of_forces(&self, (load, moments): (&Load, [f64; 3]), bounds: &LegBounds, floor: f64, look: &mut Look) {
        let Some(forces) = self.margins.leg_force_n else { return };
        let (rate, legs, d) = (self.force_rate(load, moments, bounds.h_rate, floor), &self.legs, self.half_s);
        for (i, [low, high]) in forces.into_iter().enumerate() {
            let leg = Some(i + 1);
            let (push, pull) = (high.max(0.0), (-low).max(0.0));
            look.put(FORCE, leg, high.max(-low), rate * d);
            look.put(PUSH, leg, push, rate * d);
            look.put(PULL, leg, pull, rate * d);
            let (length, longer) = (legs.lengths[i], legs.lengths[i] + bounds.speeds[i] * d);
            let now = push * length * length;
            look.put(BUCKLING, leg, now, (push + rate * d) * longer * longer - now);
        }
    }

    /// Returns a bound of the rate at which forces of the legs change, N/s.
    fn force_rate(&self, load: &Load, [m, first, second]: [f64; 3], h_rate: f64, floor: f64) -> f64 {
        let (w, dw, whirl, jerk) = (self.rate, self.angular_acceleration, self.whirl, self.jerk);
        // Of points at distance r: specific force at most `felt + spin r`, its derivative at most
        // `jerk + whirl r`.
        let felt = self.acceleration + Vector3::from(load.gravity_mps2).norm();
        let spin = dw + w * w;
        let wrench = (m * felt + spin * first).hypot((first * felt + spin * second) / self.scale_m);
        let change = (m * jerk + whirl * first)
            .hypot((first * (w * felt + jerk) + second * (w * spin + whirl)) / self.scale_m);
        // H f' = w' − H' f.
        if floor > 0.0 { (change + h_rate * wrench / floor) / floor } else { f64::INFINITY }
    }
}

impl Geometry {
    /// Bounds one interval of `2 half` about `time_s`, between two seams; `moments` are the load's.
    pub(super) fn look(
        &self,
        trajectory: &Trajectory,
        time_s: f64,
        half: f64,
        load: Option<&Load>,
        moments: Option<[f64; 3]>,
    ) -> Look {
        let interval = Interval::of(self, trajectory, time_s, half, load);
        let mut look = Look {
            seen: [(0.0, None); QUANTITIES],
            bound: [0.0; QUANTITIES],
            between: interval.margins.nearest.map(|nearest| nearest.between),
        };
        look.put(TURNING, None, interval.omega.norm(), interval.faster);
        if let (Some(travel), Some(used)) = (&self.travel, interval.margins.travel) {
            interval.of_travel(travel, used, &mut look);
            return look;
        }
        let jerks = self.limits.leg_jerk_mps3.map(|_| self.mean_jerks(trajectory, time_s, half));
        let bounds = interval.of_legs(jerks, &mut look);
        let floor = interval.of_conditioning(bounds.h_rate, &mut look);
        interval.of_clearance(&bounds, &mut look);
        if let Some(load) = load.zip(moments) {
            interval.of_forces(load, &bounds, floor, &mut look);
        }
        look
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
}
