//! What the legs carry and the forces it takes: Newton and Euler through `H`.

use nalgebra::{Matrix3, SymmetricEigen, Vector3, Vector6};

use super::body::{BodyParameters, FrameMotion, STANDARD_GRAVITY_MPS2};
use super::error::MotionError;
use super::geometry::Geometry;
use super::kinematics::PlateState;
use super::legs::Legs;
use super::limits::{Limit, Violation};
use super::trajectory::Trajectory;

/// What moves with the plate. Everything in P.
#[derive(Clone, Debug, PartialEq)]
pub enum Bodies {
    /// Rigid bodies that are known: plate, load cell, body under test.
    Known(Vec<BodyParameters>),
    /// Any body of at most `mass_kg` within `radius_m` of `centre_m`, beside the known ones. For planning before the
    /// body has been identified.
    Bounded {
        /// Bodies that are known, the plate for instance.
        known: Vec<BodyParameters>,
        /// Largest mass, kg.
        mass_kg: f64,
        /// Centre of the ball that holds the body, m.
        centre_m: [f64; 3],
        /// Radius of the ball, m.
        radius_m: f64,
    },
}

/// Bodies on the plate in a gravity field. The masses of the legs are not modelled.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// What is carried.
    pub bodies: Bodies,
    /// Gravity in A, m/s².
    pub gravity_mps2: [f64; 3],
}

impl Load {
    /// One known body, given in P, under standard gravity.
    pub fn body(body: BodyParameters) -> Self {
        Self::new(Bodies::Known(vec![body]))
    }

    /// Any body of at most `mass_kg` within `radius_m` of `centre_m` (P), under standard gravity.
    pub fn bounded(mass_kg: f64, centre_m: [f64; 3], radius_m: f64) -> Self {
        Self::new(Bodies::Bounded { known: Vec::new(), mass_kg, centre_m, radius_m })
    }

    /// `bodies` under standard gravity.
    pub fn new(bodies: Bodies) -> Self {
        Self { bodies, gravity_mps2: [0.0, 0.0, -STANDARD_GRAVITY_MPS2] }
    }

    fn known(&self) -> &[BodyParameters] {
        match &self.bodies {
            Bodies::Known(known) | Bodies::Bounded { known, .. } => known,
        }
    }

    /// Force and moment about the plate's origin, in A, that the legs must exert for the known bodies to follow
    /// `state`; N, N m.
    pub fn wrench(&self, state: &PlateState) -> [f64; 6] {
        let (motion, gravity) = (FrameMotion::of_plate(state), Vector3::from(self.gravity_mps2));
        let mut sum = Vector6::zeros();
        for body in self.known() {
            sum += Vector6::from(body.wrench(&motion, &gravity));
        }
        let force = state.rotation * sum.fixed_rows::<3>(0);
        let moment = state.rotation * sum.fixed_rows::<3>(3);
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }

    /// Least and greatest force of every leg; infinite where the platform is singular.
    pub(super) fn leg_forces_of(&self, legs: &Legs, state: &PlateState) -> [[f64; 2]; 6] {
        const UNBOUNDED: [[f64; 2]; 6] = [[f64::NEG_INFINITY, f64::INFINITY]; 6];
        let Some(inverse) = legs.force_transmission().try_inverse() else { return UNBOUNDED };
        let forces: [f64; 6] = (inverse * Vector6::from(self.wrench(state))).into();
        let mut range = forces.map(|f| [f, f]);
        let Bodies::Bounded { mass_kg, centre_m, radius_m, .. } = &self.bodies else { return range };
        // A unit point mass at c + d on the plate (P) takes the force a + Ω(c + d), a the specific force at the plate's
        // origin and Ω = [ω̇]× + [ω]×[ω]×, and its moment. With (u, v) a row of H⁻¹ turned into P the leg's force is
        // q(d) = u·s + v·(c×s) + (Ωᵀ u + s×v + Ωᵀ(v×c))·d + dᵀ Ωᵀ[v]× d, s = a + Ω c; it is linear in the mass
        // distribution, so its extremes over all bodies in the ball are mass times those of q, or zero.
        let (w, dw) = (state.angular_rate, state.angular_acceleration);
        let spin = dw.cross_matrix() + w.cross_matrix() * w.cross_matrix();
        let back = state.rotation.transpose();
        let a = back * (state.acceleration - Vector3::from(self.gravity_mps2));
        let c = Vector3::from(*centre_m);
        let s = a + spin * c;
        for (row, [low, high]) in range.iter_mut().enumerate() {
            let entry =
                |k: usize| Vector3::new(inverse[(row, k)], inverse[(row, k + 1)], inverse[(row, k + 2)]);
            let (u, v) = (back * entry(0), back * entry(3));
            let middle = u.dot(&s) + v.dot(&c.cross(&s));
            let slope = spin.transpose() * (u + v.cross(&c)) + s.cross(&v);
            let square: Matrix3<f64> = spin.transpose() * v.cross_matrix();
            let eigen = SymmetricEigen::new((square + square.transpose()) * 0.5).eigenvalues;
            let [least, greatest] = [eigen.min().min(0.0), eigen.max().max(0.0)];
            let reach = slope.norm() * radius_m;
            *high += mass_kg * (middle + reach + greatest * radius_m * radius_m).max(0.0);
            *low += mass_kg * (middle - reach + least * radius_m * radius_m).min(0.0);
        }
        range
    }
}

impl Geometry {
    /// Least and greatest force of each leg, N, positive when a leg pushes, for the plate to follow `state` with `load`.
    /// Equal for known bodies. For a bounded body the range holds the forces of every body that it allows, and is
    /// somewhat wider than needed.
    ///
    /// # Errors
    /// A singular pose.
    pub fn leg_force_ranges(
        &self,
        state: &PlateState,
        time_s: f64,
        load: &Load,
    ) -> Result<[[f64; 2]; 6], MotionError> {
        let legs = self.legs_at(&state.position, &state.rotation);
        let forces = load.leg_forces_of(&legs, state);
        if forces.iter().flatten().all(|f| f.is_finite()) {
            return Ok(forces);
        }
        let violation = Violation {
            limit: Limit::Conditioning,
            leg: None,
            value: legs.condition_number(),
            allowed: [1.0, self.limits.cond_max],
        };
        Err(MotionError::Limit { violation, time_s })
    }

    /// Largest magnitude of each leg's force along a trajectory, N, looked at every `step_s`.
    ///
    /// # Errors
    /// A singular pose on the way.
    pub fn peak_leg_forces(
        &self,
        trajectory: &Trajectory,
        step_s: f64,
        load: &Load,
    ) -> Result<[f64; 6], MotionError> {
        let mut peaks = [0.0_f64; 6];
        let steps = (trajectory.duration_s() / step_s).ceil() as usize;
        for k in 0..=steps {
            let time_s = (k as f64 * step_s).min(trajectory.duration_s());
            let ranges = self.leg_force_ranges(&trajectory.state(time_s), time_s, load)?;
            for (peak, [low, high]) in peaks.iter_mut().zip(ranges) {
                *peak = peak.max(-low).max(high);
            }
        }
        Ok(peaks)
    }
}
