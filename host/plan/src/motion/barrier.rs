//! The barrier that keeps a motion inside the limits while it is planned: `−Σ log slack` over legs and
//! instants.
//!
//! Lengths, rates and accelerations of the legs and the plate's angular rate have a gradient here. Joint
//! angles, forces, clearances and `cond(H)` have not: the guarantee at the end makes the motion smaller if
//! they ask for it.

use hexapod::{Geometry, PlateState, Travel};
use nalgebra::Vector3;

use super::information::Variation;

/// A share that is this small counts as such: where one changes its sign the sum of their magnitudes has no
/// gradient.
const LEAST_SHARE: f64 = 1e-3;

/// Limits as the barrier sees them.
#[derive(Clone, Debug)]
pub struct Barrier {
    geometry: Geometry,
    rate_radps: f64,
}

impl Barrier {
    /// Makes the barrier of a platform, with the highest angular rate of the plate, rad/s. Everything stays a
    /// three-hundredth away from its limit, for what happens between the instants.
    pub fn new(geometry: &Geometry, rate_radps: f64) -> Self {
        const SHARE: f64 = 1.0 - 1.0 / 300.0;
        let mut geometry = geometry.clone();
        let [lo, hi] = geometry.leg_length_m;
        let (middle, half) = (0.5 * (lo + hi), 0.5 * SHARE * (hi - lo));
        geometry.leg_length_m = [middle - half, middle + half];
        geometry.leg_rate_mps *= SHARE;
        geometry.limits.leg_acceleration_mps2 = geometry.limits.leg_acceleration_mps2.map(|a| SHARE * a);
        let of_plate = geometry.travel.as_ref().and_then(|travel| travel.rate_radps);
        let rate_radps = of_plate.map_or(rate_radps, |most| most.min(rate_radps));
        geometry.travel = geometry.travel.map(|travel| travel.reaching(SHARE).slower(SHARE));
        Self { geometry, rate_radps: SHARE * rate_radps }
    }

    /// Returns `−Σ log slack` at one instant and, in `worth`, `share` times its change; `None` outside.
    pub fn at(&self, state: &PlateState, share: f64, worth: &mut Variation) -> Option<f64> {
        let g = &self.geometry;
        if let Some(travel) = &g.travel {
            return self.of_travel(travel, state, share, worth);
        }
        let legs = g.legs_at(&state.position, &state.rotation);
        let [lo, hi] = g.leg_length_m;
        let half = 0.5 * (hi - lo);
        let back = state.rotation.transpose();
        let mut sum = 0.0;
        let mut within = |value: f64, limit: f64| within(value, limit, share, &mut sum);
        let (w, dw) = (state.angular_rate, state.angular_acceleration);
        let rate = w.norm();
        let pull = within(rate, self.rate_radps)?;
        if rate > 1e-9 {
            worth.angular_rate(state, &(w * (pull / rate)));
        }
        for (i, arm) in g.plate_joints_m.iter().enumerate() {
            let arm = Vector3::from(*arm);
            let (n, length) = (legs.directions[i], legs.lengths[i]);
            let u = state.velocity + state.rotation * w.cross(&arm);
            let along = n.dot(&u);
            // The leg's direction and its derivative: in A, and with the joint's arm in P.
            let n1 = (u - along * n) / length;
            let m = arm.cross(&(back * n));
            let m1 = arm.cross(&(back * n1 - w.cross(&(back * n))));
            let pull = within(length - 0.5 * (lo + hi), half)?;
            worth.place += pull * n;
            worth.turn[0] += pull * m;
            if g.leg_rate_mps.is_finite() {
                // l' = [n, m]·(v, ω): its variation is the derivative of that of l.
                let pull = within(along, g.leg_rate_mps)?;
                worth.place += pull * n1;
                worth.velocity += pull * n;
                worth.turn[0] += pull * m1;
                worth.turn[1] += pull * m;
            }
            if let Some(limit) = g.limits.leg_acceleration_mps2 {
                let du = state.acceleration + state.rotation * (dw.cross(&arm) + w.cross(&w.cross(&arm)));
                let second = n.dot(&du) + (u.dot(&u) - along * along) / length;
                let n2 = (du - second * n - 2.0 * along * n1) / length;
                let (bn, bn1) = (back * n, back * n1);
                let turned = back * n2 - 2.0 * w.cross(&bn1) - dw.cross(&bn) + w.cross(&w.cross(&bn));
                let m2 = arm.cross(&turned);
                let pull = within(second, limit)?;
                worth.place += pull * n2;
                worth.velocity += 2.0 * pull * n1;
                worth.acceleration += pull * n;
                worth.turn[0] += pull * m2;
                worth.turn[1] += 2.0 * pull * m1;
                worth.turn[2] += pull * m;
            }
        }
        Some(sum)
    }

    /// Returns `−Σ log slack` as [`Self::at`] does, for a machine without joints.
    fn of_travel(
        &self,
        travel: &Travel,
        state: &PlateState,
        share: f64,
        worth: &mut Variation,
    ) -> Option<f64> {
        let (rate, speed) = (state.angular_rate.norm(), state.velocity.norm());
        let mut sum = 0.0;
        let mut within = |value: f64, limit: f64| within(value, limit, share, &mut sum);
        let pull = within(rate, self.rate_radps)?;
        if rate > 1e-9 {
            worth.angular_rate(state, &(state.angular_rate * (pull / rate)));
        }
        if let Some(limit) = travel.speed_mps {
            let pull = within(speed, limit)?;
            if speed > 1e-9 {
                worth.velocity += state.velocity * (pull / speed);
            }
        }
        let (at, ranges) = (state.pose().coordinates(), travel.ranges());
        // Each axis' share, rounded at zero, and its derivative.
        let shares: [(f64, f64); 6] = std::array::from_fn(|k| {
            let ratio = at[k] / ranges[k];
            let rounded = ratio.hypot(LEAST_SHARE);
            (rounded, ratio / (rounded * ranges[k]))
        });
        let mut slopes = [0.0; 6];
        if travel.together {
            for (slope, (used, change)) in slopes.iter_mut().zip(shares) {
                *slope = within(used, 1.0)? * change;
            }
        } else {
            let pull = within(shares.iter().map(|(used, _)| used).sum(), 1.0)?;
            slopes = shares.map(|(_, change)| pull * change);
        }
        let [x, y, z, of_roll, of_pitch, of_yaw] = slopes;
        worth.place += Vector3::new(x, y, z);
        // E⁻ᵀ brings what a change of the angles is worth to the rotation in P.
        let ((sr, cr), (sp, cp)) = (state.rpy.x.sin_cos(), state.rpy.y.sin_cos());
        let about = (of_roll * sp + of_yaw) / cp;
        worth.turn[0] += Vector3::new(of_roll, of_pitch * cr + about * sr, about * cr - of_pitch * sr);
        Some(sum)
    }
}

/// Adds `−log(1 − (v/limit)²)`; returns `share` times its derivative, `None` outside.
fn within(value: f64, limit: f64, share: f64, sum: &mut f64) -> Option<f64> {
    let ratio = value / limit;
    let slack = 1.0 - ratio * ratio;
    if slack.is_nan() || slack <= 0.0 {
        return None;
    }
    *sum -= slack.ln();
    Some(share * 2.0 * ratio / (limit * slack))
}
