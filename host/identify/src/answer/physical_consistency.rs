//! Physical consistency: how far an estimate is from the parameters that bodies can have.
//!
//! The parameters of bodies, each with positive mass and a tensor that obeys the triangle inequality, form a
//! convex cone, and so do their base parameters. The truth lies in it, and `‖R (φ − φ̂)‖²` of the truth is χ²
//! of as many degrees of freedom as there are parameters; no point is nearer than the nearest one, so a
//! larger distance than χ² explains is no body's. This is the one judgement for one body and for trees. The
//! threshold, [`SURPRISING`], is one for both: one answer in ten thousand is called a mistake that is none,
//! however the truth lies on the edge of the cone.
//!
//! Of one body the nearest point is [`super::nearest_body`]'s. Of base parameters it is found as
//! [`super::standard_parameters`] are, from bodies that are made up and trusted less and less, until D, which
//! keeps every link a body, weighs next to nothing.
//!
//! A wrench or torques with the wrong sign, gravity included, are recognised: then the negative of the
//! estimate is in the cone.

use nalgebra::{DMatrix, DVector, Matrix3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::standard_parameters::{BaseEstimate, Problem};
use rigident_fit::Noise;
use rigident_model::Model;
use rigident_model::inertial::Parameters;

/// A distance less likely than this is no chance.
pub const SURPRISING: f64 = 1e-4;
/// The square of the distance is found to this share of itself, or of what χ² is expected to be.
const ACCURACY: f64 = 0.05;
/// Mass of a made-up body, kg, and its radius where its link has no length, m.
const MASS: f64 = 1.0;
const LENGTH: f64 = 0.1;
/// Reversed signs bring an estimate this much nearer to bodies.
const REVERSED: f64 = 0.1;

/// The distance of an estimate from the parameters that bodies can have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhysicalConsistency {
    /// Distance of the estimate from the nearest, standard deviations.
    pub distance_sd: f64,
    /// The probability that noise makes it larger, at least.
    pub probability: f64,
    /// True if there are no such bodies, but there are of the negative of all parameters.
    pub reversed: bool,
}

/// Returns the probability that a distance is larger, whose square is χ² of the given number of degrees of
/// freedom, or F where the noise is estimated; `None` without degrees of freedom.
pub fn probability(square: f64, freedoms: f64, noise: Noise) -> Option<f64> {
    match noise {
        Noise::Given => Some(ChiSquared::new(freedoms).ok()?.sf(square)),
        Noise::Estimated { degrees_of_freedom } => {
            Some(FisherSnedecor::new(freedoms, degrees_of_freedom.max(1.0)).ok()?.sf(square / freedoms))
        }
    }
}

impl PhysicalConsistency {
    /// Returns true if bodies have these parameters, as far as the uncertainty tells.
    pub fn is_consistent(&self) -> bool {
        self.probability >= SURPRISING
    }

    /// Returns what a user should check if base parameters are no bodies'; `None` if they are.
    pub fn warning(&self) -> Option<String> {
        if self.is_consistent() {
            return None;
        }
        Some(if self.reversed {
            "the base parameters are those of bodies of negative mass, so nothing is identified: is the sign \
             of the wrench or of the torques right? wrench_sign in [recording] of the rig file says whether \
             the load cell reports \"on_body\" or \"on_sensor\", scale = -1 of a [[joint]]'s effort turns a \
             torque round; reversed axes of the IMU and reversed gravity look the same"
                .to_owned()
        } else {
            format!(
                "no bodies have these base parameters: the nearest that can be are {:.1} standard deviations \
                 away. Look for a wrong sign, unit, frame or scale, attitudes that are the inverse, links \
                 that are not rigid, friction that is left out",
                self.distance_sd
            )
        })
    }
}

/// Judges the base parameters of a tree; `None` if the search did not end. `model` is that of the base
/// parameters.
pub fn of_base_parameters(model: &Model, found: &BaseEstimate) -> Option<PhysicalConsistency> {
    let best = (&found.r * &found.values - &found.z).norm_squared();
    let links = found.base.standard.len() / 10;
    let rows = &found.r * found.base.map();
    let bodies = of_size((0..links).map(|k| made_up(model, links, k)).collect(), &rows, found.z.norm());
    let freedoms = found.rank as f64;
    let distance = |sign: f64| {
        let mut problem = Problem {
            rows: rows.clone(),
            rhs: &found.z * sign,
            substitution: DMatrix::identity(rows.ncols(), rows.ncols()),
            nominal: &bodies,
            weight: 1.0,
        };
        Some((problem.least_misfit(ACCURACY, freedoms)? - best).max(0.0))
    };
    let square = distance(1.0)?;
    let probability = probability(square, freedoms, found.noise)?;
    let mut judged = PhysicalConsistency { distance_sd: square.sqrt(), probability, reversed: false };
    if !judged.is_consistent() {
        judged.reversed = distance(-1.0).is_some_and(|other| other.sqrt() < REVERSED * judged.distance_sd);
    }
    Some(judged)
}

/// Returns the bodies with all masses multiplied by what makes their rows as large as the right-hand side:
/// the problem is then the same in every unit of mass.
fn of_size(bodies: Vec<Parameters>, rows: &DMatrix<f64>, size: f64) -> Vec<Parameters> {
    let all = DVector::from_iterator(rows.ncols(), bodies.iter().flatten().copied());
    let factor = size / (rows * all).norm();
    let factor = if factor.is_normal() { factor } else { 1.0 };
    bodies.into_iter().map(|phi| phi.map(|v| v * factor)).collect()
}

/// Returns a ball of a kilogram about the middle of the `k`th of the last `seen` links.
fn made_up(model: &Model, seen: usize, k: usize) -> Parameters {
    let links = &model.links;
    let i = links.len().saturating_sub(seen) + k;
    let below = links.iter().skip(1).filter(|l| l.link.parent == i).map(|l| l.link.position);
    let longest = below.max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
    let radius = longest.norm().max(LENGTH);
    let tensor = Matrix3::from_diagonal_element(MASS * radius * radius);
    let centre = Position::from_array((longest * 0.5).into());
    InertialParameters::<Body, f64>::from_centre_of_mass(MASS, centre, tensor).to_vector()
}

#[cfg(test)]
#[path = "physical_consistency_tests.rs"]
mod tests;
