//! A tree of joints that turn or slide one by one, and where its links are.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rigident_shared::tree::{Joint, Link};

use rigident_model::Model;

/// The joints of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTree {
    name: String,
    links: Vec<Link<f64>>,
    names: Vec<[String; 2]>,
    follows: Vec<bool>,
}

/// Tells why a joint cannot be between the base and a contact.
pub type TreeProblem = String;

/// The place of a link in the base's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Base axes ← link axes.
    pub rotation: Matrix3<f64>,
    /// Origin, m.
    pub position: Vector3<f64>,
}

impl Place {
    /// Returns where a point of the link is in the base's frame, m.
    pub(super) fn point(&self, own: &[f64; 3]) -> Vector3<f64> {
        self.position + self.rotation * Vector3::from(*own)
    }
}

/// The way a joint moves what hangs on it, in the base's frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Moves {
    /// Turns about an axis through a point.
    Turns { axis: Vector3<f64>, through: Vector3<f64> },
    /// Slides along an axis.
    Slides { axis: Vector3<f64> },
}

impl Moves {
    /// Returns the velocity of a point for a unit rate.
    pub(super) fn of_point(&self, at: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Turns { axis, through } => axis.cross(&(at - through)),
            Self::Slides { axis } => *axis,
        }
    }

    /// Returns the angular rate for a unit rate.
    pub(super) fn angular(&self) -> Vector3<f64> {
        match self {
            Self::Turns { axis, .. } => *axis,
            Self::Slides { .. } => Vector3::zeros(),
        }
    }
}

impl JointTree {
    /// Takes the joints of a model, links on fixed joints included.
    pub fn new(model: &Model) -> Self {
        Self {
            name: model.name.clone(),
            links: model.tree(),
            names: model.links.iter().map(|l| [l.name.clone(), l.joint_name.clone()]).collect(),
            follows: model.links.iter().map(|l| l.mimic.is_some()).collect(),
        }
    }

    /// Returns the index of the link of this name.
    ///
    /// # Errors
    /// Names links that there are.
    pub fn link(&self, name: &str) -> Result<usize, String> {
        self.names.iter().position(|[link, _]| link == name).ok_or_else(|| {
            let names: Vec<&str> = self.names.iter().map(|[link, _]| link.as_str()).collect();
            format!("{} has no link {name}; its links are {}", self.name, names.join(", "))
        })
    }

    /// Returns the names of all links.
    pub fn link_names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(|[link, _]| link.as_str())
    }

    /// Returns the name of a link.
    pub fn link_name(&self, link: usize) -> &str {
        self.names.get(link).map_or("", |[link, _]| link)
    }

    /// Returns the name of the joint on which a link hangs.
    pub fn joint_name(&self, link: usize) -> &str {
        self.names.get(link).map_or("", |[_, joint]| joint)
    }

    /// Tells whether the joint of a link slides.
    pub fn slides(&self, link: usize) -> bool {
        self.links.get(link).is_some_and(|l| matches!(l.joint, Joint::Prismatic(_)))
    }

    /// Returns the link on which a link hangs.
    pub(super) fn parent(&self, link: usize) -> usize {
        self.links.get(link).map_or(0, |own| own.parent)
    }

    /// Returns the links from the one below the base down to this one.
    pub(super) fn way(&self, link: usize) -> Vec<usize> {
        let mut way = Vec::new();
        let mut at = link;
        while at != 0 {
            way.push(at);
            at = self.links.get(at).map_or(0, |l| l.parent);
        }
        way.reverse();
        way
    }

    /// Returns the links whose joints move any of these links against the base, in the model's order.
    ///
    /// # Errors
    /// Names a joint of several freedoms, or one that follows another.
    pub fn joints_to(&self, links: impl Iterator<Item = usize>) -> Result<Vec<usize>, TreeProblem> {
        let mut all: Vec<usize> = links.flat_map(|link| self.way(link)).collect();
        all.sort_unstable();
        all.dedup();
        let mut moving = Vec::new();
        for link in all {
            let Some(own) = self.links.get(link) else { continue };
            let refuse = |why: &str| Err(format!("{}: joint {} {why}", self.name, self.joint_name(link)));
            match own.joint {
                Joint::Fixed => continue,
                Joint::Revolute(_) | Joint::Prismatic(_) => {}
                _ => {
                    return refuse(
                        "has several freedoms; between the base and a contact or a measured link joints turn \
                         or slide about one axis each",
                    );
                }
            }
            if self.follows.get(link) == Some(&true) {
                return refuse(
                    "follows another joint; take its <mimic> out of the model, and give a column of its own",
                );
            }
            moving.push(link);
        }
        Ok(moving)
    }

    /// Returns where all links are, with these positions of all links' joints, rad or m; other joints are at
    /// zero.
    pub(super) fn places(&self, positions: &[f64]) -> Vec<Place> {
        let mut places: Vec<Place> = Vec::with_capacity(self.links.len());
        for (i, link) in self.links.iter().enumerate() {
            let Some(parent) = places.get(link.parent).copied().filter(|_| i > 0) else {
                places.push(Place { rotation: Matrix3::identity(), position: Vector3::zeros() });
                continue;
            };
            let q = positions.get(i).copied().unwrap_or(0.0);
            let mut rotation = parent.rotation * link.rotation;
            let mut position = parent.position + parent.rotation * link.position;
            match link.joint {
                Joint::Revolute(axis) if q != 0.0 => {
                    rotation *= Rotation3::from_axis_angle(&Unit::new_unchecked(axis), q).into_inner();
                }
                Joint::Prismatic(axis) => position += rotation * axis * q,
                _ => {}
            }
            places.push(Place { rotation, position });
        }
        places
    }

    /// Returns how the joint of a link moves what hangs on it.
    pub(super) fn moves(&self, link: usize, places: &[Place]) -> Option<Moves> {
        let place = places.get(link)?;
        match self.links.get(link)?.joint {
            Joint::Revolute(axis) => {
                Some(Moves::Turns { axis: place.rotation * axis, through: place.position })
            }
            Joint::Prismatic(axis) => Some(Moves::Slides { axis: place.rotation * axis }),
            _ => None,
        }
    }
}
