//! The common parameters of all poses: the offsets, and what is estimated along with them. The columns of
//! each, and what is known of it beforehand.

use std::ops::Range;

use nalgebra::{Rotation3, Unit, Vector3};

use super::turns::turn_of;
use super::{HEADING_FREE, Setup};

/// 1 σ of a place of which nothing is known, m, and of an attitude, rad: so far above any other that it says
/// nothing.
const UNKNOWN: f64 = 10.0;

/// The common parameters of all poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Shared {
    /// Offsets of the joints that are asked for, rad or m: true less measured position.
    pub offsets: Vec<f64>,
    /// Errors of the IMUs' mountings: link axes ← those that the attitude is of.
    pub mountings: Vec<Rotation3<f64>>,
    /// The planes.
    pub planes: Vec<PlaneAt>,
    /// The places of held links.
    pub held: Vec<HeldAt>,
}

/// The place of a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneAt {
    /// The turn of it against the stated one, rad, about [`Setup::tilt_axes`].
    pub tilt_rad: [f64; 2],
    /// Its distance from the origin along its normal, m.
    pub distance_m: f64,
}

/// The place of a held link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldAt {
    /// Its point in the world, m.
    pub position: Vector3<f64>,
    /// World axes ← link axes.
    pub rotation: Rotation3<f64>,
}

impl Default for HeldAt {
    fn default() -> Self {
        Self { position: Vector3::zeros(), rotation: Rotation3::identity() }
    }
}

/// The prior knowledge of a shared column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// The column.
    pub column: usize,
    /// The distance of the present value above what is expected.
    pub off: f64,
    /// 1 σ.
    pub sigma: f64,
}

impl Shared {
    /// Returns the beginning of the search: no offset, no error.
    pub fn zero(setup: &Setup) -> Self {
        Self {
            offsets: vec![0.0; setup.asked.len()],
            mountings: vec![Rotation3::identity(); setup.measured_links.len()],
            planes: vec![PlaneAt { tilt_rad: [0.0; 2], distance_m: 0.0 }; setup.contacts.planes.len()],
            held: vec![HeldAt::default(); setup.contacts.held.len()],
        }
    }

    /// Returns the same after a step of the shared columns.
    #[must_use]
    pub fn moved(&self, setup: &Setup, step: &[f64]) -> Self {
        let entry = |k: usize| step.get(k).copied().unwrap_or(0.0);
        let triple = |k: usize| Vector3::new(entry(k), entry(k + 1), entry(k + 2));
        let turned = |by: Vector3<f64>, from: &Rotation3<f64>| {
            let mut rotation = Rotation3::new(by) * from;
            rotation.renormalize();
            rotation
        };
        let mut out = self.clone();
        out.offsets.iter_mut().enumerate().for_each(|(k, offset)| *offset += entry(k));
        for (n, mounting) in out.mountings.iter_mut().enumerate() {
            if let Some(at) = setup.mounting_column(n) {
                *mounting = turned(triple(at), mounting);
            }
        }
        for (n, plane) in out.planes.iter_mut().enumerate() {
            let columns = setup.plane_columns(n);
            if let Some(at) = columns.tilt {
                plane.tilt_rad = [plane.tilt_rad[0] + entry(at), plane.tilt_rad[1] + entry(at + 1)];
            }
            plane.distance_m += columns.distance.map_or(0.0, entry);
        }
        for (n, held) in out.held.iter_mut().enumerate() {
            let columns = setup.held_columns(n);
            held.position += triple(columns.start);
            if columns.len() > 3 {
                held.rotation = turned(triple(columns.start + 3), &held.rotation);
            }
        }
        out
    }
}

/// The columns of a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PlaneColumns {
    /// The first of two.
    pub tilt: Option<usize>,
    pub distance: Option<usize>,
}

impl Setup {
    /// Returns the number of columns that all poses share: offsets, then mountings of IMUs, planes and held
    /// links.
    pub fn shared_columns(&self) -> usize {
        self.held_columns(self.contacts.held.len()).start
    }

    /// Returns the first of three columns of an IMU's mounting, if it is not exact.
    pub(super) fn mounting_column(&self, n: usize) -> Option<usize> {
        (self.noise.mounting_rad > 0.0).then_some(self.asked.len() + 3 * n)
    }

    /// Returns the columns of a plane.
    pub(super) fn plane_columns(&self, n: usize) -> PlaneColumns {
        let mut at =
            self.asked.len() + if self.noise.mounting_rad > 0.0 { 3 * self.measured_links.len() } else { 0 };
        let mut columns = PlaneColumns::default();
        for plane in self.contacts.planes.iter().take(n + 1) {
            columns = PlaneColumns::default();
            if plane.tilt_rad > 0.0 {
                columns.tilt = Some(at);
                at += 2;
            }
            if !plane.at_origin {
                columns.distance = Some(at);
                at += 1;
            }
        }
        columns
    }

    /// Returns the columns of a held link: three of its place, three more if its attitude is the same in all
    /// poses.
    pub(super) fn held_columns(&self, n: usize) -> Range<usize> {
        let mounting = if self.noise.mounting_rad > 0.0 { 3 * self.measured_links.len() } else { 0 };
        let of_plane =
            |plane: &super::Plane| 2 * usize::from(plane.tilt_rad > 0.0) + usize::from(!plane.at_origin);
        let planes: usize = self.contacts.planes.iter().map(of_plane).sum();
        let of_held = |held: &super::Held| if held.turns { 3 } else { 6 };
        let before: usize = self.contacts.held.iter().take(n).map(of_held).sum();
        let start = self.asked.len() + mounting + planes + before;
        start..start + self.contacts.held.get(n).map_or(0, of_held)
    }

    /// Returns the two axes, in the world, about which a plane may be turned against what is stated.
    pub fn tilt_axes(&self, n: usize) -> [Vector3<f64>; 2] {
        let normal = self.contacts.planes.get(n).map_or_else(Vector3::z, |plane| plane.normal);
        if (normal - Vector3::z()).norm() < 1e-9 {
            return [Vector3::x(), Vector3::y()];
        }
        // The axis that is farthest from the normal.
        let least = Vector3::ith(normal.iamin(), 1.0);
        let first = normal.cross(&least).normalize();
        [first, normal.cross(&first)]
    }

    /// Returns the normal of a plane as it is turned, in world axes.
    pub(super) fn normal(&self, n: usize, at: &PlaneAt) -> Vector3<f64> {
        let stated = self.contacts.planes.get(n).map_or_else(Vector3::z, |plane| plane.normal);
        let [a, b] = self.tilt_axes(n);
        let tilt = at.tilt_rad[0] * a + at.tilt_rad[1] * b;
        Unit::new_normalize(Rotation3::new(tilt) * stated).into_inner()
    }

    /// Returns what is known beforehand of shared columns.
    pub(super) fn priors(&self, shared: &Shared) -> Vec<Prior> {
        let mut priors = Vec::new();
        let mut add = |column: usize, off: f64, sigma: f64| priors.push(Prior { column, off, sigma });
        for (n, mounting) in shared.mountings.iter().enumerate() {
            if let Some(at) = self.mounting_column(n) {
                let turn = turn_of(mounting);
                (0..3).for_each(|k| add(at + k, turn[k], self.noise.mounting_rad));
            }
        }
        for (n, (plane, at)) in self.contacts.planes.iter().zip(&shared.planes).enumerate() {
            let columns = self.plane_columns(n);
            if let Some(first) = columns.tilt {
                (0..2).for_each(|k| add(first + k, at.tilt_rad[k], plane.tilt_rad));
            }
            if let Some(column) = columns.distance {
                add(column, at.distance_m, UNKNOWN);
            }
        }
        for (n, held) in shared.held.iter().enumerate() {
            let columns = self.held_columns(n);
            for (k, column) in columns.enumerate() {
                add(column, held.position.get(k).copied().unwrap_or(0.0), UNKNOWN);
            }
        }
        priors
    }

    /// Tells whether the place of the base along the floor plays a part.
    pub(super) fn has_horizontal(&self) -> bool {
        let leans =
            |plane: &super::Plane| !plane.at_origin && (plane.normal.z < 1.0 - 1e-12 || plane.tilt_rad > 0.0);
        !self.contacts.held.is_empty() || self.contacts.planes.iter().any(leans)
    }

    /// Returns the number of columns of a pose's base: three of its attitude, its height, and its place along
    /// the floor where that counts.
    pub fn base_columns(&self) -> usize {
        if self.has_horizontal() { 6 } else { 4 }
    }

    /// Tells whether headings that IMUs measure say nothing.
    pub(super) fn heading_is_free(&self) -> bool {
        self.noise.yaw_rad >= HEADING_FREE
    }
}
