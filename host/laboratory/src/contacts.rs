//! Robots of any model that stand, touch and are held, and what their encoders and IMUs read.
//!
//! The places of links are computed here by chains of isometries and differences, not by the kinematics of
//! the search.
#![allow(clippy::missing_panics_doc, reason = "of a robot that is made here")]

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rigident_shared::tree::Joint;

use super::noise::Noise;
use rigident_identify::joint_offsets::{Pose, Setup};
use rigident_model::Model;

/// The conditions of a pose hold to this, m and rad.
const EXACT: f64 = 1e-12;
/// Difference that slopes are taken over.
const STEP: f64 = 1e-6;
/// Steps at most until a pose holds.
const STEPS: usize = 60;

/// 1 σ of what is read of a pose.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReadingNoise {
    /// Of every encoder, rad; of joints that slide, m.
    pub encoder: f64,
    /// Of attitudes about level axes, rad.
    pub attitude_rad: f64,
    /// Of headings, rad.
    pub yaw_rad: f64,
}

/// A robot by its model's joints.
#[derive(Clone, Debug)]
pub struct Robot {
    links: Vec<(usize, Isometry3<f64>, Joint<f64>)>,
}

/// The place of a robot.
#[derive(Clone, Debug)]
pub struct Stance {
    /// World ← base.
    pub base: Isometry3<f64>,
    /// Positions of the joints of all links, rad or m.
    pub positions: Vec<f64>,
}

impl Robot {
    /// Takes the joints of a model; those of several freedoms are stiff.
    pub fn of(model: &Model) -> Self {
        let of = |own: &rigident_model::ModelLink| {
            let link = &own.link;
            let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&link.rotation));
            (link.parent, Isometry3::from_parts(Translation3::from(link.position), turn), link.joint)
        };
        Self { links: model.links.iter().map(of).collect() }
    }

    /// Returns where all links are in the world.
    pub fn places(&self, stance: &Stance) -> Vec<Isometry3<f64>> {
        let mut places: Vec<Isometry3<f64>> = Vec::with_capacity(self.links.len());
        for (k, (parent, at, joint)) in self.links.iter().enumerate() {
            let q = stance.positions.get(k).copied().unwrap_or(0.0);
            let moved = match joint {
                Joint::Revolute(axis) => Isometry3::rotation(axis * q),
                Joint::Prismatic(axis) => {
                    Isometry3::from_parts((axis * q).into(), UnitQuaternion::identity())
                }
                _ => Isometry3::identity(),
            };
            places.push(if k == 0 { stance.base } else { places[*parent] * at * moved });
        }
        places
    }

    /// Moves a robot by the shortest way, joints of `moving` and base, to where all of `wanted` is zero;
    /// `None` if it is nowhere near.
    pub fn settled(
        &self,
        mut stance: Stance,
        moving: &[usize],
        wanted: &dyn Fn(&[Isometry3<f64>]) -> Vec<f64>,
    ) -> Option<Stance> {
        let count = moving.len() + 6;
        for _ in 0..STEPS {
            let off = DVector::from_vec(wanted(&self.places(&stance)));
            if off.amax() < EXACT {
                return Some(stance);
            }
            let mut slope = DMatrix::zeros(off.len(), count);
            for k in 0..count {
                let by = |size: f64| {
                    let mut step = vec![0.0; count];
                    step[k] = size;
                    DVector::from_vec(wanted(&self.places(&stance.moved(moving, &step))))
                };
                slope.set_column(k, &((by(STEP) - by(-STEP)) / (2.0 * STEP)));
            }
            let step = slope.pseudo_inverse(1e-9).ok()? * off;
            let step: Vec<f64> = step.iter().map(|v| -v).collect();
            if step.iter().any(|v| !v.is_finite() || v.abs() > 1.0) {
                return None;
            }
            stance = stance.moved(moving, &step);
        }
        None
    }

    /// Returns a stance as it is read with offsets of the joints that count: true less measured position.
    pub fn read(
        &self,
        setup: &Setup,
        stance: &Stance,
        offsets: &[f64],
        noise: ReadingNoise,
        name: &str,
        seed: u64,
    ) -> Pose {
        let mut random = Noise(Some(seed));
        let places = self.places(stance);
        let read = |(link, offset): (&usize, &f64)| stance.positions[*link] - offset;
        let mut positions: Vec<f64> = setup.joints.iter().zip(offsets).map(read).collect();
        positions.iter_mut().for_each(|q| *q += random.normal(noise.encoder));
        let attitude = |link: &usize| {
            let off = [noise.attitude_rad, noise.attitude_rad, noise.yaw_rad].map(|s| random.normal(s));
            UnitQuaternion::from_scaled_axis(Vector3::from(off)) * places[*link].rotation
        };
        let attitudes = setup.measured_links.iter().map(attitude).collect();
        Pose { name: name.to_owned(), positions, attitudes, stands: vec![true; setup.contacts.count()] }
    }
}

impl Stance {
    fn moved(&self, moving: &[usize], step: &[f64]) -> Self {
        let mut out = self.clone();
        for (link, by) in moving.iter().zip(step) {
            out.positions[*link] += by;
        }
        let turn = &step[moving.len()..];
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(turn[0], turn[1], turn[2]));
        out.base.rotation = rotation * self.base.rotation;
        out.base.translation.vector += Vector3::new(turn[3], turn[4], turn[5]);
        out
    }
}

/// Returns how far three corners of a link are from a plane, m.
pub fn from_plane(
    place: &Isometry3<f64>,
    corners: &[[f64; 3]],
    normal: &Vector3<f64>,
    distance: f64,
) -> Vec<f64> {
    let of = |own: &[f64; 3]| normal.dot(&(place * Point3::from(*own)).coords) - distance;
    corners.iter().take(3).map(of).collect()
}

/// Returns numbers between −1 and 1, the same for a seed.
pub fn uniform(count: usize, seed: u64) -> Vec<f64> {
    let mut noise = Noise(Some(seed));
    (0..count).map(|_| 2.0 * noise.uniform() - 1.0).collect()
}
