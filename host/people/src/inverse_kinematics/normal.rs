//! Normal equations of a frame: what markers tell of a pose, and of joint centres and marker places.

use nalgebra::{DMatrix, DVector, Vector3};
use rigident_shared::tree::Joint;

use super::markers::{Attached, Seen};
use super::skeleton::{Pose, Skeleton, Turn};

/// Residuals of this many σ count as they are; beyond, a marker counts ever less (Huber).
const HUBER: f64 = 3.0;
/// 1 σ of a joint's turn from zero, rad: so wide that it decides only what markers leave open.
pub(super) const POSTURE_SIGMA: f64 = 1.0;

/// Normal equations `H δ = g` of a frame's own freedoms, and what couples them with what all frames share.
pub(super) struct Normal {
    /// The lower triangle of `H` for the frame's own freedoms.
    pub own: DMatrix<f64>,
    pub own_right: DVector<f64>,
    /// Freedoms × shared; empty if nothing is shared.
    pub coupling: DMatrix<f64>,
    pub shared: DMatrix<f64>,
    pub shared_right: DVector<f64>,
    /// Sum of the squared, weighted residuals.
    pub cost: f64,
}

/// Returns what all frames share: three numbers for every joint's place in its parent, then three for every
/// marker's place on its link.
pub(super) fn shared_columns(skeleton: &Skeleton, markers: usize) -> usize {
    3 * (skeleton.links().len() - 1) + 3 * markers
}

impl Normal {
    pub(super) fn new(freedoms: usize, shared: usize) -> Self {
        Self {
            own: DMatrix::zeros(freedoms, freedoms),
            own_right: DVector::zeros(freedoms),
            coupling: DMatrix::zeros(freedoms, shared),
            shared: DMatrix::zeros(shared, shared),
            shared_right: DVector::zeros(shared),
            cost: 0.0,
        }
    }

    fn clear(&mut self) {
        self.own.fill(0.0);
        self.own_right.fill(0.0);
        self.coupling.fill(0.0);
        self.shared.fill(0.0);
        self.shared_right.fill(0.0);
        self.cost = 0.0;
    }
}

/// Fills the equations of a frame about a pose.
///
/// A marker on link i at x is at `y = p_i + R_i x`. A turn of joint j above it moves it by
/// `(R_j e) × (y − p_j)`, the place of that joint in its parent by `R_parent`, its own place by `R_i`.
pub(super) fn fill(
    skeleton: &Skeleton,
    pose: &Pose,
    markers: &[Attached],
    seen: &Seen,
    with_shared: bool,
    normal: &mut Normal,
) {
    normal.clear();
    let places = skeleton.places(pose);
    let links = skeleton.links();
    let joints = 3 * (links.len() - 1);
    let mut own: Vec<(usize, Vector3<f64>)> = Vec::with_capacity(16);
    let mut shared: Vec<(usize, Vector3<f64>)> = Vec::with_capacity(24);
    for (m, (marker, seen)) in markers.iter().zip(seen).enumerate() {
        let Some(seen) = seen else { continue };
        let (turn, origin) = &places[marker.link];
        let at = origin + turn * marker.position_m;
        let residual = (seen - at) / marker.sigma_m;
        let size = residual.norm();
        let weight = if size > HUBER { HUBER / size } else { 1.0 };
        normal.cost += if size > HUBER { HUBER * (2.0 * size - HUBER) } else { size * size };
        own.clear();
        shared.clear();
        for &j in skeleton.way(marker.link) {
            let (axes, centre) = &places[j];
            let arm = at - centre;
            if j == 0 {
                own.extend((0..3).map(|k| (k, Vector3::ith(k, 1.0))));
                own.extend((0..3).map(|k| (3 + k, axes.column(k).cross(&arm))));
                continue;
            }
            let first = skeleton.first(j);
            match &links[j].joint {
                Joint::Revolute(axis) => own.push((first, (axes * axis).cross(&arm))),
                Joint::Spherical => own.extend((0..3).map(|k| (first + k, axes.column(k).cross(&arm)))),
                _ => {}
            }
            if with_shared {
                let parent = &places[links[j].parent].0;
                shared.extend((0..3).map(|k| (3 * (j - 1) + k, parent.column(k).into_owned())));
            }
        }
        if with_shared {
            shared.extend((0..3).map(|k| (joints + 3 * m + k, turn.column(k).into_owned())));
        }
        let scale = weight / marker.sigma_m;
        let square = scale / marker.sigma_m;
        for (k, (a, column)) in own.iter().enumerate() {
            normal.own_right[*a] += scale * column.dot(&residual);
            // What a Cholesky factor reads.
            for (b, other) in &own[..=k] {
                normal.own[(*a.max(b), *a.min(b))] += square * column.dot(other);
            }
            for (b, other) in &shared {
                normal.coupling[(*a, *b)] += square * column.dot(other);
            }
        }
        for (a, column) in &shared {
            normal.shared_right[*a] += scale * column.dot(&residual);
            for (b, other) in &shared {
                normal.shared[(*a, *b)] += square * column.dot(other);
            }
        }
    }
    posture(skeleton, pose, normal);
}

/// Adds the weak preference for joints at zero.
fn posture(skeleton: &Skeleton, pose: &Pose, normal: &mut Normal) {
    let weight = POSTURE_SIGMA.powi(-2);
    let mut add = |column: usize, value: f64| {
        normal.own[(column, column)] += weight;
        normal.own_right[column] -= weight * value;
        normal.cost += weight * value * value;
    };
    for (i, turn) in pose.turns.iter().enumerate().skip(1) {
        let first = skeleton.first(i);
        match turn {
            Turn::Hinge(angle) => add(first, *angle),
            Turn::Ball(q) => {
                for (k, value) in q.scaled_axis().iter().enumerate() {
                    add(first + k, *value);
                }
            }
            Turn::None => {}
        }
    }
}
