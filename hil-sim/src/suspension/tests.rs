//! Tests of the suspension against mechanics.

mod laws;
mod parts;

use nalgebra::Vector3;

use super::{Instant, Joint, JointedLink, Motion, Spring, Start, Suspension};
use hexapod::{BodyParameters, Mounting};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.80665);

/// Returns a body without symmetry.
fn body(k: f64) -> BodyParameters {
    BodyParameters {
        mass_kg: 2.0 + k,
        com_m: [0.03, -0.05 * k, -0.1],
        inertia_com_kgm2: [0.031, 0.042, 0.025, 0.003, -0.004, 0.006],
    }
}

/// Returns a base with a ball joint, a hinge behind it and another hinge on the base; damped everywhere.
fn chain() -> Suspension {
    let corners = [[0.3, 0.25, -0.02], [-0.35, 0.3, 0.0], [-0.3, -0.3, 0.03], [0.32, -0.28, 0.0]];
    let springs = corners.map(|at_m| Spring {
        axis: [0.2 * at_m[0], -0.1, 1.0],
        axial_nspm: 8.0,
        lateral_nspm: 3.0,
        factor: 1.0 + 0.1 * at_m[0],
        cubic_npm3: 2e4,
        ..Spring::upright(at_m, 2500.0, 500.0)
    });
    let link = |parent, joint, k: f64| JointedLink {
        parent,
        joint_m: [0.05, 0.04 * k, 0.1],
        joint,
        locked: false,
        damping_nmspr: 0.02,
        body: body(k),
    };
    Suspension {
        links: vec![
            link(0, Joint::Spherical, 1.0),
            link(1, Joint::Revolute { axis: [0.3, 1.0, -0.2] }, 0.4),
            link(0, Joint::Revolute { axis: [1.0, 0.0, 0.5] }, 0.7),
        ],
        ..Suspension::of_body(
            BodyParameters {
                mass_kg: 9.0,
                com_m: [0.01, 0.0, -0.02],
                inertia_com_kgm2: [0.4, 0.35, 0.7, 0.01, 0.0, 0.02],
            },
            springs.to_vec(),
            Mounting { position_m: [0.02, -0.03, 0.3], rotation_wxyz: [0.9, 0.1, -0.2, 0.3] },
            body(6.0),
        )
    }
}

/// Returns a posture of the chain.
fn rests() -> [[f64; 4]; 3] {
    [[0.9, 0.1, 0.3, -0.2], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
}

/// Returns a start of the chain with everything moving.
fn moving() -> Start {
    Start {
        position_m: [0.01, -0.02, 0.015],
        rotation_wxyz: [1.0, 0.02, -0.03, 0.05],
        velocity_mps: [0.1, -0.05, 0.08],
        rate_radps: [0.2, 0.3, -0.4],
        joint_rate_radps: vec![[1.0, -2.0, 1.5], [0.3, 1.0, -0.2], [-1.0, 0.0, -0.5]],
        ..Start::resting(&[[0.7, 0.2, 0.5, -0.1], [1.0, 0.15, 0.5, -0.1], [1.0, -0.4, 0.0, -0.2]])
    }
}

/// Returns the slope of the total energy by least squares, J/s, and the energy exchanged, the most of kinetic
/// energy, J.
fn drift(motion: &Motion) -> (f64, f64) {
    let n = motion.instants.len() as f64;
    let mean = |f: &dyn Fn(&Instant) -> f64| motion.instants.iter().map(f).sum::<f64>() / n;
    let (t, e) = (mean(&|i| i.time_s), mean(&|i| i.energy.total_j()));
    let top = mean(&|i| (i.time_s - t) * (i.energy.total_j() - e));
    let bottom = mean(&|i| (i.time_s - t).powi(2));
    (top / bottom, motion.instants.iter().map(|i| i.energy.kinetic_j).fold(0.0, f64::max))
}
