//! The search for the motion of the greatest merit (the largest `log det M`) inside the limits, by
//! [`Descent`] with the gradient that goes backwards through rows and barrier.

use super::barrier::Barrier;
use super::family::Family;
use super::information::{Information, Instrument, Variation, log_determinant};
pub use crate::descent::{Descent, Found};

/// The quantity that is maximised.
pub trait Merit: Sync {
    /// Returns a figure of merit of the information and its derivative Q by it, `d merit = tr(Q dM)`; `None`
    /// where something is left undetermined.
    fn of(&self, information: &Information) -> Option<(f64, Information)>;
}

/// `log det M`: D-optimality.
#[derive(Clone, Copy, Debug)]
pub struct Volume;

impl Merit for Volume {
    fn of(&self, information: &Information) -> Option<(f64, Information)> {
        log_determinant(information)
    }
}

/// The unknown.
#[derive(Clone, Debug)]
pub struct Problem<M = Volume> {
    /// The motions.
    pub family: Family,
    /// The limits.
    pub barrier: Barrier,
    /// The load cell.
    pub instrument: Instrument,
    /// The information of the rest of the experiment.
    pub beforehand: Information,
    /// The quantity that is maximised.
    pub merit: M,
}

impl<M: Merit> Descent for Problem<M> {
    fn len(&self) -> usize {
        self.family.len()
    }

    /// Returns `weight Σ barrier − merit`, its gradient, and the merit; `None` outside the limits.
    fn cost(&self, z: &[f64], weight: f64) -> Option<(f64, Vec<f64>, f64)> {
        let mut information = self.beforehand;
        let mut walls = Vec::with_capacity(self.family.instants());
        let mut sum = 0.0;
        for k in 0..self.family.instants() {
            let c = self.family.coordinates(z, k);
            let state = c.plate_state();
            let mut variation = Variation::default();
            sum += self.barrier.at(&state, weight, &mut variation)?;
            sum += self.instrument.barrier(&state, weight, &mut variation)?;
            self.instrument.add(&state, self.family.times(k), &mut information);
            walls.push((c, state, variation));
        }
        let (merit, slope) = self.merit.of(&information)?;
        let mut gradient = vec![0.0; self.family.len()];
        for (k, (c, state, wall)) in walls.iter().enumerate() {
            let worth = self.instrument.worth(state, &slope, self.family.times(k));
            let total = Variation {
                place: wall.place - worth.place,
                velocity: wall.velocity - worth.velocity,
                acceleration: wall.acceleration - worth.acceleration,
                turn: std::array::from_fn(|i| wall.turn[i] - worth.turn[i]),
            };
            self.family.pull_back(&total.coordinates(c), k, &mut gradient);
        }
        Some((weight * sum - merit, gradient, merit))
    }
}
