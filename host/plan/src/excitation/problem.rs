//! The unknown: the series of the largest `log det M` inside the limits.

use super::collisions::Collisions;
use super::family::{Family, Motion};
use super::information::{Tree, volume};
use super::limits::JointLimits;
use crate::descent::Descent;

/// The search for a series.
pub struct Problem<'a> {
    /// The tree, with what is measured.
    pub tree: &'a Tree,
    /// The motions.
    pub family: Family,
    /// Limits of every joint.
    pub limits: &'a [JointLimits],
    /// The parts that must stay apart.
    pub collisions: &'a Collisions,
    /// Readings per second.
    pub rate_hz: f64,
}

impl Descent for Problem<'_> {
    fn len(&self) -> usize {
        self.family.len()
    }

    /// Returns a hundredth of a parameter's information: nothing that a user would see.
    fn least_gain(&self) -> f64 {
        1e-2
    }

    fn cost(&self, z: &[f64], weight: f64) -> Option<(f64, Vec<f64>, f64)> {
        let joints = self.limits.len();
        let readings = self.rate_hz * self.family.step_s();
        let mut moving = self.tree.moving();
        let mut information = self.tree.nothing();
        let mut sum = 0.0;
        let mut instants = Vec::with_capacity(self.family.instants());
        // What is cheap comes first: most motions that are outside are so by positions and rates.
        for k in 0..self.family.instants() {
            let (motion, mut wall) = (self.family.motion(z, k), Motion::zeros(joints));
            for (j, limits) in self.limits.iter().enumerate() {
                limits.barrier(&motion, j, &mut sum, &mut wall)?;
            }
            instants.push((motion, wall));
        }
        let mut seen = Vec::with_capacity(instants.len());
        for (motion, wall) in &mut instants {
            let instant = self.tree.instant(&mut moving, motion)?;
            let efforts = instant.efforts.iter().zip(self.limits);
            let pulls = efforts
                .map(|(effort, limits)| limits.effort_barrier(*effort, &mut sum))
                .collect::<Option<Vec<_>>>()?;
            self.collisions.barrier(&moving, &mut sum, &mut wall.positions)?;
            self.tree.add(&instant, motion, readings, &mut information);
            seen.push((instant, pulls));
        }
        let (merit, inverse) = volume(&information)?;
        let mut gradient = vec![0.0; self.len()];
        for (k, ((motion, wall), (instant, pulls))) in instants.iter().zip(&seen).enumerate() {
            let pulls: Vec<f64> = pulls.iter().map(|pull| weight * pull).collect();
            let mut worth = self.tree.worth((instant, motion), (&inverse, readings), &pulls, &mut moving)?;
            let add =
                |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, v)| *to += weight * v);
            add(&mut worth.positions, &wall.positions);
            add(&mut worth.rates, &wall.rates);
            add(&mut worth.accelerations, &wall.accelerations);
            self.family.pull_back(&worth, k, &mut gradient);
        }
        Some((weight * sum - merit, gradient, merit))
    }
}
