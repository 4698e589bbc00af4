//! The drawing of a pose: links as lines in the world, contacts with their corners, and how far these are
//! off.

use nalgebra::Vector3;

use super::pose::{Base, RowOf};
use super::shared::Shared;
use super::{Pose, Setup};

/// A pose as lines, in the world's axes turned so that the base's x points along x.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// Ends of each link: from its parent's origin to its own, m.
    pub bones: Vec<[Vector3<f64>; 2]>,
    /// Corners of the contacts that are made, m, with the place of each contact.
    pub contacts: Vec<(usize, Vec<Vector3<f64>>)>,
}

impl Setup {
    /// Returns a pose as lines.
    pub fn figure(&self, pose: &Pose, base: &Base, shared: &Shared) -> Figure {
        let places = self.places(pose, shared);
        let ahead = base.rotation * Vector3::x();
        let back = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -ahead.y.atan2(ahead.x));
        let foot = Vector3::new(base.position.x, base.position.y, 0.0);
        let world = |own: Vector3<f64>| back * (base.rotation * own + base.position - foot);
        let mut shown: Vec<usize> = self
            .contacts
            .links()
            .chain(self.measured_links.iter().copied())
            .flat_map(|link| self.tree.way(link))
            .collect();
        shown.sort_unstable();
        shown.dedup();
        let mut figure = Figure::default();
        for link in shown {
            let Some((own, parent)) = places.get(link).zip(places.get(self.tree.parent(link))) else {
                continue;
            };
            figure.bones.push([world(parent.position), world(own.position)]);
        }
        let soles = self.contacts.soles.iter().map(|sole| (sole.link, sole.corners_m.clone()));
        let held = self.contacts.held.iter().map(|held| (held.link, vec![held.point_m]));
        for (n, (link, corners)) in soles.chain(held).enumerate() {
            if let (Some(true), Some(place)) = (pose.stands.get(n), places.get(link)) {
                figure.contacts.push((n, corners.iter().map(|own| world(place.point(own))).collect()));
            }
        }
        figure
    }

    /// Returns the largest deviation of each contact that is made from its plane or place, m, in the order of
    /// the contacts.
    pub fn deviations(&self, pose: &Pose, base: &Base, shared: &Shared) -> Vec<Option<f64>> {
        let mut out = vec![None; self.contacts.count()];
        let rows = self.rows(pose, base, shared);
        for (of, off) in rows.of.iter().zip(rows.residual.iter()) {
            if let RowOf::Contact(n) = of
                && let Some(own) = out.get_mut(*n)
            {
                let most: f64 = own.unwrap_or(0.0);
                *own = Some(most.max(off.abs()));
            }
        }
        out
    }
}
