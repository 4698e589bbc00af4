//! Whether there are bodies at all that have the base parameters found.
//!
//! The base parameters of bodies, each with positive mass and a tensor that obeys the triangle inequality, form a convex
//! cone. The truth lies in it, and `‖R (φ_B − φ̂_B)‖²` of the truth is χ² of as many degrees of freedom as there are base
//! parameters; so an estimate whose distance from the cone is larger than χ² explains is no tree's. The nearest point
//! of the cone is found as [`super::nearest`] finds full parameters, from bodies that are made up and trusted less and less,
//! until D, which keeps every link a body, weighs next to nothing.
//!
//! A wrench or torques with the wrong sign, gravity included, are recognised: then the negative of the estimate is in the
//! cone.

use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use nalgebra::{DMatrix, DVector, Matrix3};

use super::nearest::{Data, Problem};
use super::{Input, TreeIdentification};
use crate::answer::Noise;
use crate::model::inertial::Parameters;

/// A distance less likely than this is no chance.
const SURPRISING: f64 = 1e-4;
/// To this share, or of what χ² is expected to be, the square of the distance is found.
const ACCURACY: f64 = 0.05;
/// Of a made-up body: kg, and m where its link has no length.
const MASS: f64 = 1.0;
const LENGTH: f64 = 0.1;
/// Reversed signs bring an estimate so much nearer to bodies.
const REVERSED: f64 = 0.1;

/// How far base parameters are from those of bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Possible {
    /// Distance of the estimate from the nearest, standard deviations.
    pub distance_sd: f64,
    /// The probability of a larger one.
    pub probability: f64,
    /// There are no such bodies, but there are of the negative of all parameters.
    pub reversed: bool,
}

impl Possible {
    /// Whether bodies have these parameters, as far as the uncertainty tells.
    pub fn is_consistent(&self) -> bool {
        self.probability >= SURPRISING
    }

    /// What to know if they have not.
    pub fn warning(&self) -> Option<String> {
        if self.is_consistent() {
            return None;
        }
        Some(if self.reversed {
            "the base parameters are those of bodies of negative mass, so nothing is identified: is the sign of the wrench or of the \
             torques right? wrench_sign in [recording] of the rig file says whether the load cell reports \"on_body\" or \
             \"on_sensor\", scale = -1 of a [[joint]]'s effort turns a torque round; reversed axes of the IMU and reversed \
             gravity look the same"
                .to_owned()
        } else {
            format!(
                "no bodies have these base parameters: the nearest that can be are {:.1} standard deviations away. Look for a \
                 wrong sign, unit, frame or scale, attitudes that are the inverse, links that are not rigid, friction that \
                 is left out",
                self.distance_sd
            )
        })
    }
}

/// Judges what was found; `None` if the search did not end.
pub fn possible(input: &Input, found: &TreeIdentification) -> Option<Possible> {
    let count = found.base.parameters.len();
    let marginal = found.factor.leading(count);
    let solution = marginal.solve();
    let data = Data::new(&marginal, found.variance_scale);
    let best = (&data.r * DVector::from_column_slice(&solution.estimate) - &data.z).norm_squared();
    let bodies: Vec<Parameters> =
        (0..found.base.standard.len() / 10).map(|k| made_up(input, found, k)).collect();
    let rows = &data.r * found.base.map();
    let freedoms = (count - solution.lost.len().min(count)) as f64;
    let distance = |sign: f64| {
        let mut problem = Problem {
            rows: rows.clone(),
            rhs: &data.z * sign,
            substitution: DMatrix::identity(rows.ncols(), rows.ncols()),
            nominal: &bodies,
            weight: 1.0,
        };
        Some((problem.least_misfit(ACCURACY, freedoms)? - best).max(0.0))
    };
    let square = distance(1.0)?;
    let probability = match found.noise {
        Noise::Given => ChiSquared::new(freedoms).ok()?.sf(square),
        Noise::Estimated { degrees_of_freedom } => {
            FisherSnedecor::new(freedoms, degrees_of_freedom.max(1.0)).ok()?.sf(square / freedoms)
        }
    };
    let mut judged = Possible { distance_sd: square.sqrt(), probability, reversed: false };
    if !judged.is_consistent() {
        judged.reversed = distance(-1.0).is_some_and(|other| other.sqrt() < REVERSED * judged.distance_sd);
    }
    Some(judged)
}

/// A ball about the middle of a link, of a kilogram.
fn made_up(input: &Input, found: &TreeIdentification, k: usize) -> Parameters {
    let links = &input.model.links;
    let i = links.len() - found.base.standard.len() / 10 + k;
    let below = links.iter().skip(1).filter(|l| l.link.parent == i).map(|l| l.link.position);
    let longest = below.max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
    let radius = longest.norm().max(LENGTH);
    let tensor = Matrix3::from_diagonal_element(MASS * radius * radius);
    let centre = Position::from_array((longest * 0.5).into());
    InertialParameters::<Body, f64>::from_centre_of_mass(MASS, centre, tensor).to_vector()
}

#[cfg(test)]
mod tests {
    use super::super::prepare::{Wishes, prepare};
    use super::super::simulated::{seven_axes, seven_axis_recording, two_link_recording, two_links};
    use super::super::{TreeIdentification, identify};
    use super::*;
    use crate::model::Model;
    use crate::recording::Recording;

    fn judged(model: &Model, recording: &Recording) -> (TreeIdentification, Possible) {
        let input = prepare(recording, model, &Wishes::default()).unwrap().input;
        let found = identify(&input).unwrap();
        let judged = possible(&input, &found).unwrap();
        (found, judged)
    }

    #[test]
    fn what_bodies_have_is_possible_with_noise_and_without() {
        let two = two_links();
        for noise in [None, Some(3), Some(8)] {
            let (_, judged) = judged(&two, &two_link_recording(&two, 200.0, 20.0, noise));
            assert!(judged.is_consistent() && judged.warning().is_none(), "{noise:?} {judged:?}");
        }
        let seven = seven_axes();
        let recording = seven_axis_recording(&seven, 200.0, 20.0, true, Some(4), 0.0);
        let (_, judged) = self::judged(&seven, &recording);
        assert!(judged.is_consistent(), "{judged:?}");
    }

    #[test]
    fn reversed_signs_are_recognised_and_other_mistakes_are_told() {
        let two = two_links();
        let mut reversed = two_link_recording(&two, 200.0, 20.0, Some(3));
        reversed.wrench.iter_mut().flatten().flatten().for_each(|v| *v = -*v);
        let (_, judged) = judged(&two, &reversed);
        assert!(judged.reversed && !judged.is_consistent(), "{judged:?}");
        assert!(judged.warning().unwrap().contains("wrench_sign"));
        // More than all was taken off the arm: the whole is heavy enough, the arm is no body.
        let mut hollow = two_links();
        hollow.links[1].nominal = hollow.links[1].nominal.map(|phi| phi.map(|v| -v));
        let (_, judged) = self::judged(&two, &two_link_recording(&hollow, 200.0, 20.0, Some(3)));
        assert!(!judged.reversed && !judged.is_consistent(), "{judged:?}");
        assert!(judged.warning().unwrap().contains("standard deviations away"));
        let seven = seven_axes();
        let mut recording = seven_axis_recording(&seven, 200.0, 20.0, true, Some(4), 0.0);
        let torques = recording.extra.iter_mut().filter(|(name, _)| name.ends_with("_nm"));
        torques
            .flat_map(|(_, cells)| cells)
            .for_each(|cell| *cell = (-cell.parse::<f64>().unwrap()).to_string());
        let (_, judged) = self::judged(&seven, &recording);
        assert!(judged.reversed, "{judged:?}");
    }

    /// A single body's ten are all there is to know: the distance is that of the nearest body.
    #[test]
    fn it_is_as_far_as_the_nearest_of_many_bodies_tried() {
        let two = two_links();
        let mut hollow = two_links();
        hollow.links[1].nominal = hollow.links[1].nominal.map(|phi| phi.map(|v| -v));
        let wrong = two_link_recording(&hollow, 200.0, 20.0, Some(3));
        let input = prepare(&wrong, &two, &Wishes::default()).unwrap().input;
        let found = identify(&input).unwrap();
        let judged = possible(&input, &found).unwrap();
        let marginal = found.factor.leading(19);
        let data = Data::new(&marginal, found.variance_scale);
        let estimate = DVector::from_vec(marginal.solve().estimate);
        let best = (&data.r * &estimate - &data.z).norm_squared();
        let map = found.base.map();
        // Random bodies around the truth: none is nearer.
        let mut seed = 9_u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let truth = two.nominal();
        let mut tried = 0;
        for _ in 0..2000 {
            let share = 0.4 * (uniform() + 0.5);
            let phi: Vec<f64> = truth.iter().map(|v| v + share * uniform() * (v.abs() + 0.01)).collect();
            let is_body = phi.chunks_exact(10).all(|link| {
                crate::model::inertial::impossibility(&std::array::from_fn(|k| link[k])).is_none()
            });
            if !is_body {
                continue;
            }
            tried += 1;
            let square = (&data.r * (map.clone() * DVector::from_vec(phi)) - &data.z).norm_squared() - best;
            assert!(square >= judged.distance_sd.powi(2) * (1.0 - ACCURACY));
        }
        assert!(tried > 100, "{tried}");
    }
}
