//! Motions made for what is asked for: of all six coordinates' Fourier series inside the limits, the one that
//! needs the least time.
//!
//! A motion that brings ΔM must be repeated until the worst uncertainty is what was asked for, so the best
//! one makes the worst ratio least. Its smooth substitute is the p-norm of the squared ratios
//! `r_j = s_jᵀ M⁻¹ s_j / u_j²`, whose derivative by M is of rank one for each:
//! `d(s M⁻¹ s) = −s M⁻¹ dM M⁻¹ s`.

use std::sync::atomic::AtomicBool;

use hexapod::{Pose, Segment};
use nalgebra::SVector;

use super::goal::Goal;
use super::information::{Information, RigModel};
use crate::motion::barrier::Barrier;
use crate::motion::family::Family;
use crate::motion::information::log_determinant;
use crate::motion::plan::{HIGHEST_HZ, frequencies_hz, step_s};
use crate::motion::search::{Descent, Merit, Problem};

/// Power of the norm. Twelve equal ratios count as 36 % above each in variance, 17 % in deviation, whatever
/// the motion.
const POWER: i32 = 8;
/// The barrier's weights are made for `log det` of some ten parameters, this is the logarithm of one.
const SCALE: f64 = 10.0;
/// Random beginnings of the search.
const STARTS: usize = 2;

/// The purpose of a motion.
#[derive(Clone, Copy, Debug)]
pub struct Design<'a> {
    /// The machine, and what is known of the sensors' ranges.
    pub rig: &'a RigModel,
    /// The pose where it begins and ends.
    pub centre: &'a Pose,
    /// The motion's length, s.
    pub duration_s: f64,
    /// s.
    pub ramp_s: f64,
    /// Coordinates that do not move.
    pub still: [bool; 6],
    /// The request.
    pub goal: &'a Goal,
    /// The knowledge, by the number of times that the motion is believed to be needed.
    pub beforehand: &'a Information,
}

struct Worst<'a>(&'a Goal);

impl Merit for Worst<'_> {
    fn of(&self, information: &Information) -> Option<(f64, Information)> {
        let (_, inverse) = log_determinant(information)?;
        let mut sum = 0.0;
        let mut slope = Information::zeros();
        let mut add = |along: SVector<f64, 16>, u95: f64| {
            let v = inverse * along;
            let ratio = along.dot(&v) / (u95 * u95);
            sum += ratio.powi(POWER);
            slope.syger(ratio.powi(POWER - 1) / (u95 * u95), &v, &v, 1.0);
        };
        for (j, u95) in self.0.u95.iter().enumerate().filter(|(_, u95)| u95.is_finite()) {
            add(SVector::from_fn(|i, _| f64::from(u8::from(i == j))), *u95);
        }
        if let Some((u95, slopes)) = &self.0.about_com {
            for along in slopes {
                add(SVector::from_fn(|i, _| along.get(i).copied().unwrap_or(0.0)), *u95);
            }
        }
        slope.fill_upper_triangle_with_lower_triangle();
        let merit = -SCALE / f64::from(POWER) * sum.ln();
        merit.is_finite().then(|| (merit, slope * (SCALE / sum)))
    }
}

/// Returns the best motion found; `None` where nothing that moves keeps the limits or determines what is
/// asked for.
pub fn design(task: &Design, stop: &AtomicBool) -> Option<Segment> {
    let rig = task.rig;
    let step_s = step_s(HIGHEST_HZ);
    let instrument = rig.instrument(rig.rate_hz * step_s);
    let frequencies_hz = frequencies_hz(HIGHEST_HZ);
    let problem = Problem {
        family: Family::new(task.centre, task.duration_s, task.ramp_s, &frequencies_hz, step_s)
            .without(task.still),
        barrier: Barrier::new(&rig.geometry, rig.highest_rate_radps()),
        instrument,
        beforehand: *task.beforehand,
        merit: Worst(task.goal),
    };
    let found = problem.search(STARTS, 1, stop, |_, _| ());
    found.first().map(|best| problem.family.segment(&best.coefficients, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adaptive::Asked;
    use crate::adaptive::compact::Compact;

    /// By differences along a symmetric direction.
    #[test]
    fn the_derivative_of_the_worst_ratio_is_that_of_differences() {
        let body = hexapod::BodyParameters::thesis_vertical();
        let goal = Asked::Tensor(0.01).goal(Some(&body.parameters()), &Compact::of(20.0));
        let worst = Worst(&goal);
        let mut seed = 3_u64;
        let mut chance = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let root = Information::from_fn(|_, _| chance());
        let information = root * root.transpose() + Information::identity();
        let other = Information::from_fn(|_, _| chance());
        let direction = other + other.transpose();
        let (_, slope) = worst.of(&information).unwrap();
        let h = 1e-5;
        let at = |by: f64| worst.of(&(information + direction * by)).unwrap().0;
        let (got, want) = ((slope * direction).trace(), (at(h) - at(-h)) / (2.0 * h));
        assert!((got - want).abs() < 1e-6 * slope.norm() * direction.norm(), "{got} {want}");
    }
}
