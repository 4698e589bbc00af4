//! The load of the legs and the forces that it takes: Newton and Euler through `H`.

use nalgebra::{Vector3, Vector6};

use super::body::{BodyParameters, FrameMotion, STANDARD_GRAVITY_MPS2};
use super::body_set::{BodySet, linear_form};
use super::error::MotionError;
use super::geometry::Geometry;
use super::kinematics::PlateState;
use super::legs::Legs;
use super::limits::{Limit, Violation};
use super::trajectory::Trajectory;

/// The bodies that move with the plate. Everything in P.
#[derive(Clone, Debug, PartialEq)]
pub enum Bodies {
    /// Rigid bodies that are known: plate, load cell, body under test.
    Known(Vec<BodyParameters>),
    /// One of a set of bodies beside the known ones: before the body has been identified, or as well as it is
    /// by now.
    Within {
        /// Bodies that are known, the plate for instance.
        known: Vec<BodyParameters>,
        /// The possible values of the other.
        body: BodySet,
    },
}

/// Bodies on the plate in a gravity field. The masses of the legs are not modelled.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    /// The bodies carried.
    pub bodies: Bodies,
    /// Gravity in A, m/s².
    pub gravity_mps2: [f64; 3],
}

impl Load {
    /// Makes the load of one known body, given in P, under standard gravity.
    pub fn body(body: BodyParameters) -> Self {
        Self::new(Bodies::Known(vec![body]))
    }

    /// Makes the load of `bodies` under standard gravity.
    pub fn new(bodies: Bodies) -> Self {
        Self { bodies, gravity_mps2: [0.0, 0.0, -STANDARD_GRAVITY_MPS2] }
    }

    fn known(&self) -> &[BodyParameters] {
        match &self.bodies {
            Bodies::Known(known) | Bodies::Within { known, .. } => known,
        }
    }

    /// Returns the greatest mass of all bodies together, kg.
    pub fn most_kg(&self) -> f64 {
        let known: f64 = self.known().iter().map(|body| body.mass_kg).sum();
        match &self.bodies {
            Bodies::Known(_) => known,
            Bodies::Within { body, .. } => {
                let mut mass = [0.0; 10];
                mass[0] = 1.0;
                known + body.range(&mass)[1]
            }
        }
    }

    /// Returns force and moment about the plate's origin, in A, that the legs must exert for the known bodies
    /// to follow `state`; N, N m.
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

    /// Returns the least and greatest force of every leg; infinite where the platform is singular.
    pub(super) fn leg_forces_of(&self, legs: &Legs, state: &PlateState) -> [[f64; 2]; 6] {
        const UNBOUNDED: [[f64; 2]; 6] = [[f64::NEG_INFINITY, f64::INFINITY]; 6];
        let Some(inverse) = legs.force_transmission().try_inverse() else { return UNBOUNDED };
        let forces: [f64; 6] = (inverse * Vector6::from(self.wrench(state))).into();
        let mut range = forces.map(|f| [f, f]);
        let Bodies::Within { body, .. } = &self.bodies else { return range };
        let (back, gravity) = (state.rotation.transpose(), Vector3::from(self.gravity_mps2));
        for (row, [low, high]) in range.iter_mut().enumerate() {
            // A row of H⁻¹, turned into P, is the wrench that this leg's force is made of.
            let entry = |k: usize| {
                back * Vector3::new(inverse[(row, k)], inverse[(row, k + 1)], inverse[(row, k + 2)])
            };
            let [least, most] = body.range(&linear_form(state, &gravity, &entry(0), &entry(3)));
            *low += least;
            *high += most;
        }
        range
    }
}

impl Geometry {
    /// Returns the least and greatest force of each leg, N, positive when a leg pushes, for the plate to
    /// follow `state` with `load`. Equal for known bodies. For a set the range holds the forces of every body
    /// in it, and is somewhat wider than needed.
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
            between: None,
            value: legs.condition_over(self.moment_length_m()),
            allowed: [1.0, self.limits.cond_max],
        };
        Err(MotionError::Limit { violation, time_s })
    }

    /// Returns the largest magnitude of each leg's force along a trajectory, N, examined every `step_s`.
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
