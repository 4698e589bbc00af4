//! A person, or another tree that turns about its joints, in motion.

use hexapod::BodyParameters;
use hexapod::STANDARD_GRAVITY_MPS2;
use nalgebra::Matrix3;
use rigident_shared::inertia::{InertialParameters, tensor_elements};
use rigident_shared::spatial::Body;
use rigident_shared::tree::Joint;
use rigident_sim::links::{Swing, Tree, TreeLink};

use super::noise::Noise;
use rigident_model::{Model, ModelLink};

/// Segments are heavier or lighter than the table's by at most this much, relative.
const SPREAD: f64 = 0.15;

/// Mass, centre of mass and tensor about it, of φ about the link's origin.
fn body(phi: [f64; 10]) -> BodyParameters {
    let body = InertialParameters::<Body, f64>::from_vector(phi);
    BodyParameters {
        mass_kg: body.mass,
        com_m: body.centre_of_mass().array(),
        inertia_com_kgm2: tensor_elements(&body.inertia_com()),
    }
}

/// Returns how the joint of link `i` swings; what it cannot do it does not.
fn swing(i: usize, link: &ModelLink) -> Swing {
    let possible = match link.link.joint {
        Joint::Revolute(axis) => axis.map(f64::abs).into(),
        _ => [1.0; 3],
    };
    Swing {
        amplitude_rad: std::array::from_fn(|k| possible[k] * (0.5 + 0.1 * ((i + k) % 3) as f64)),
        frequency_hz: std::array::from_fn(|k| 0.35 + 0.083 * ((5 * i + 3 * k) % 11) as f64),
        phase_rad: std::array::from_fn(|k| 0.9 * i as f64 + 1.7 * k as f64),
    }
}

/// Sets a tree in motion: every joint swings about its axes, and the base sways. `parameters` are ten of
/// every link.
///
/// Joints are spherical, or revolute about an axis of their link, and their axes at zero are the parent's.
pub fn tree(model: &Model, parameters: &[f64]) -> Tree {
    let bodies = parameters.as_chunks::<10>().0.iter().map(|phi| body(*phi));
    let links = model.links.iter().zip(bodies).enumerate().map(|(i, (link, body))| {
        debug_assert_eq!(link.link.rotation, Matrix3::identity());
        TreeLink { parent: link.link.parent, joint_m: link.link.position.into(), body, swing: swing(i, link) }
    });
    Tree {
        links: links.collect(),
        sway_m: [0.1, 0.08, 0.05],
        sway_hz: [0.5, 0.7, 0.9],
        gravity_mps2: STANDARD_GRAVITY_MPS2,
    }
}

/// Parameters of somebody whose segments are not the model's, but up to this much heavier or lighter: ten of
/// every link.
pub fn somebody(model: &Model, seed: u64) -> Vec<f64> {
    let mut noise = Noise(Some(seed));
    let nominal = model.nominal();
    let scaled = nominal.as_chunks::<10>().0.iter().flat_map(|phi| {
        let factor = 1.0 + SPREAD * (2.0 * noise.uniform() - 1.0);
        phi.map(|v| v * factor)
    });
    scaled.collect()
}
