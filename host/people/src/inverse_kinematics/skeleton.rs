//! A tree of links in a pose.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::tree::{Joint, Link};

use rigident_model::Model;

/// Columns of the base: its position in laboratory axes, then its turn in its own axes.
pub const BASE: usize = 6;

/// The links of a model, whose base is free, with the numbers of their freedoms.
#[derive(Clone, Debug)]
pub struct Skeleton {
    links: Vec<Link<f64>>,
    first: Vec<usize>,
    freedoms: usize,
    /// For every link the links from it to the base, itself first, the base last.
    ways: Vec<Vec<usize>>,
}

/// The type of turn of the joint of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// About its axis, rad.
    Hinge(f64),
    /// In any way: parent axes at zero ← link axes.
    Ball(UnitQuaternion<f64>),
    /// Not at all.
    None,
}

/// A pose of a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Origin of the base, laboratory axes, m.
    pub position_m: Vector3<f64>,
    /// Laboratory ← base axes.
    pub attitude: UnitQuaternion<f64>,
    /// The joint of every link; the base's is not examined.
    pub turns: Vec<Turn>,
}

/// The place of a link: laboratory ← link axes, and its origin, m.
pub type Place = (Matrix3<f64>, Vector3<f64>);

impl Skeleton {
    /// Returns the skeleton of a model with joints that turn; `None` if one slides or has two axes.
    pub fn new(model: &Model) -> Option<Self> {
        let links: Vec<Link<f64>> = model.links.iter().map(|l| l.link).collect();
        let mut first = vec![0];
        let mut freedoms = BASE;
        for link in links.iter().skip(1) {
            if !matches!(link.joint, Joint::Revolute(_) | Joint::Spherical | Joint::Fixed) {
                return None;
            }
            first.push(freedoms);
            freedoms += link.joint.freedoms();
        }
        let mut ways: Vec<Vec<usize>> = Vec::new();
        for (i, link) in links.iter().enumerate() {
            let above = if i == 0 { None } else { ways.get(link.parent) };
            let way: Vec<usize> = std::iter::once(i).chain(above.into_iter().flatten().copied()).collect();
            ways.push(way);
        }
        Some(Self { links, first, freedoms, ways })
    }

    /// Returns the links.
    pub fn links(&self) -> &[Link<f64>] {
        &self.links
    }

    /// Returns the number of freedoms, the base's six among them.
    pub fn freedoms(&self) -> usize {
        self.freedoms
    }

    /// Returns the first column of a link's joint.
    pub(super) fn first(&self, link: usize) -> usize {
        self.first.get(link).copied().unwrap_or(0)
    }

    /// Returns the links from one to the base, itself first.
    pub(super) fn way(&self, link: usize) -> &[usize] {
        self.ways.get(link).map_or(&[], Vec::as_slice)
    }

    /// Moves the joint of a link in its parent, m.
    pub(super) fn shift(&mut self, link: usize, by: &Vector3<f64>) {
        if let Some(link) = self.links.get_mut(link) {
            link.position += by;
        }
    }

    /// Returns the pose at zero, the base's origin in the laboratory's.
    pub fn zero(&self) -> Pose {
        let turn = |link: &Link<f64>| match link.joint {
            Joint::Revolute(_) => Turn::Hinge(0.0),
            Joint::Spherical => Turn::Ball(UnitQuaternion::identity()),
            _ => Turn::None,
        };
        Pose {
            position_m: Vector3::zeros(),
            attitude: UnitQuaternion::identity(),
            turns: self.links.iter().map(turn).collect(),
        }
    }

    /// Returns where every link is.
    pub fn places(&self, pose: &Pose) -> Vec<Place> {
        let mut places: Vec<Place> = Vec::with_capacity(self.links.len());
        for (i, (link, turn)) in self.links.iter().zip(&pose.turns).enumerate() {
            if i == 0 {
                places.push((pose.attitude.to_rotation_matrix().into_inner(), pose.position_m));
                continue;
            }
            let (parent, origin) = places[link.parent];
            let turned = match (turn, &link.joint) {
                (Turn::Hinge(angle), Joint::Revolute(axis)) => {
                    Rotation3::from_scaled_axis(axis * *angle).into_inner()
                }
                (Turn::Ball(turn), _) => turn.to_rotation_matrix().into_inner(),
                _ => Matrix3::identity(),
            };
            places.push((parent * link.rotation * turned, origin + parent * link.position));
        }
        places
    }

    /// Returns the pose that a small step leads to: one number for every freedom, turns in axes of the link
    /// beyond the joint.
    pub fn step(&self, pose: &Pose, step: &[f64]) -> Pose {
        let three = |at: usize| Vector3::from_fn(|k, _| step.get(at + k).copied().unwrap_or(0.0));
        let turned =
            |from: &UnitQuaternion<f64>, at: usize| from * UnitQuaternion::from_scaled_axis(three(at));
        let turns = pose.turns.iter().enumerate().map(|(i, turn)| match turn {
            Turn::Hinge(angle) => Turn::Hinge(angle + step.get(self.first(i)).copied().unwrap_or(0.0)),
            Turn::Ball(q) if i > 0 => Turn::Ball(turned(q, self.first(i))),
            other => *other,
        });
        Pose {
            position_m: pose.position_m + three(0),
            attitude: turned(&pose.attitude, 3),
            turns: turns.collect(),
        }
    }
}
