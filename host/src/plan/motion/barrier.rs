//! What keeps a motion inside the limits while it is planned: `−Σ log slack` over legs and instants.
//!
//! Lengths, rates and accelerations of the legs and the plate's angular rate have a gradient here. Joint angles, forces,
//! clearances and `cond(H)` have not: the guarantee at the end makes the motion smaller if they ask for it.

use hexapod::{Geometry, PlateState};
use nalgebra::Vector3;

use super::information::Variation;

/// Limits as the barrier sees them.
#[derive(Clone, Debug)]
pub struct Barrier {
    geometry: Geometry,
    rate_radps: f64,
}

impl Barrier {
    /// Of a platform, with the highest angular rate of the plate, rad/s. Everything is kept a three-hundredth away from its
    /// limit, for what happens between the instants.
    pub fn new(geometry: &Geometry, rate_radps: f64) -> Self {
        const SHARE: f64 = 1.0 - 1.0 / 300.0;
        let mut geometry = geometry.clone();
        let [lo, hi] = geometry.leg_length_m;
        let (middle, half) = (0.5 * (lo + hi), 0.5 * SHARE * (hi - lo));
        geometry.leg_length_m = [middle - half, middle + half];
        geometry.leg_rate_mps *= SHARE;
        geometry.limits.leg_acceleration_mps2 = geometry.limits.leg_acceleration_mps2.map(|a| SHARE * a);
        Self { geometry, rate_radps: SHARE * rate_radps }
    }

    /// `−Σ log slack` at one instant and, in `worth`, `share` times its change; `None` outside.
    pub fn at(&self, state: &PlateState, share: f64, worth: &mut Variation) -> Option<f64> {
        let g = &self.geometry;
        let legs = g.legs_at(&state.position, &state.rotation);
        let [lo, hi] = g.leg_length_m;
        let half = 0.5 * (hi - lo);
        let back = state.rotation.transpose();
        let mut sum = 0.0;
        // −log(1 − (v/limit)²) and its derivative.
        let mut within = |value: f64, limit: f64| -> Option<f64> {
            let ratio = value / limit;
            let slack = 1.0 - ratio * ratio;
            if slack.is_nan() || slack <= 0.0 {
                return None;
            }
            sum -= slack.ln();
            Some(share * 2.0 * ratio / (limit * slack))
        };
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
}
