//! Mistakes of convention: tensors about the link's origin, products of inertia of the wrong sign, centres of
//! mass on the wrong side.
//!
//! A link's inertia is compared with its shapes, taken for a shell of one thickness, and with the link of the
//! other side. What matter is made of where is not known: its spread is some ten per cent off, so that only
//! mistakes are found that change it by more. Each mistake is undone, and is reported where the body is much
//! nearer to its shapes without it.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;

use super::shapes::Shape;
use crate::finding::Finding;
use crate::inertial::{Parameters, impossibility};
use crate::tree::{Model, ModelLink};

/// The least second moment of shapes over their largest: what is thinner has screws, cables and motors on it.
const FLATTEST: f64 = 0.01;
/// The least second moment over the largest that is left of a tensor when it is moved from the origin to the
/// centre of mass.
const LEFT: f64 = 0.003;
/// The multiple of the tensor about the centre of mass that the way there must have added, with shapes and
/// without.
const TIMES: (f64, f64) = (0.999, 2.0);
/// Logarithm of a ratio of second moments: how much nearer to the shapes those as given may be at most.
const NEARER: f64 = 0.5;
/// Norm of the correlation coefficients below which shapes do not tell the products' signs.
const CORRELATED: f64 = 0.03;
/// Cosine between the correlation coefficients of two bodies that have opposite products.
const OPPOSITE: f64 = 0.5;
/// The change of the tensor, relative to itself, from which the products' signs matter.
const MATTERS: f64 = 0.1;
/// The multiple by which the square of a distance from the shapes' centre must exceed that of the other side,
/// and by how much it must exceed it.
const FARTHER: (f64, f64) = (3.0, 0.5);
/// Fewest links, and their least share, by which a whole file's products are judged.
const CONVENTION: (usize, f64) = (3, 0.75);

/// A body's centre of mass and the second moments of its mass about it over the mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    /// m
    pub(super) centre: Vector3<f64>,
    /// m²
    pub(super) second: Matrix3<f64>,
}

impl Spread {
    /// Returns it of a body; `None` of what none has.
    pub(super) fn of(phi: &Parameters) -> Option<Self> {
        if impossibility(phi).is_some() {
            return None;
        }
        let body = InertialParameters::<Body, f64>::from_vector(*phi);
        let tensor = body.inertia_com();
        let second = (Matrix3::identity() * (0.5 * tensor.trace()) - tensor) / body.mass;
        Some(Self { centre: body.centre_of_mass().vector(), second })
    }

    /// Returns the same if the tensor was about the origin.
    pub(super) fn if_about_origin(&self) -> Self {
        Self { second: self.second - self.centre * self.centre.transpose(), ..*self }
    }

    /// Returns the same with the signs of the products in `rows` changed: (y, z), (z, x) and (x, y).
    pub(super) fn with_products(&self, changed: [bool; 3]) -> Self {
        let sign = |i: usize, j: usize| if i != j && changed[3 - i - j] { -1.0 } else { 1.0 };
        Self { second: Matrix3::from_fn(|i, j| sign(i, j) * self.second[(i, j)]), ..*self }
    }

    /// Returns the same with a coordinate of the centre of mass on the other side.
    pub(super) fn across(&self, axis: usize) -> Self {
        let mut centre = self.centre;
        centre[axis] = -centre[axis];
        Self { centre, ..*self }
    }

    /// Radius of gyration about the centre of mass, all axes taken together, m.
    pub(super) fn radius(&self) -> f64 {
        self.second.trace().sqrt()
    }
}

/// Frobenius norm of the tensor of these second moments.
fn size(second: &Matrix3<f64>) -> f64 {
    (Matrix3::identity() * second.trace() - second).norm()
}

/// Returns the shapes' spread, no flatter than a body.
fn rounded(shape: &Shape) -> Option<Spread> {
    if shape.second.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let own = SymmetricEigen::new(shape.second);
    let largest = own.eigenvalues.max();
    let raised = own.eigenvalues.map(|v| v.max(FLATTEST * largest));
    let second = own.eigenvectors * Matrix3::from_diagonal(&raised) * own.eigenvectors.transpose();
    (largest > 0.0).then_some(Spread { centre: shape.centre, second })
}

/// Returns the correlation coefficients of (y, z), (z, x) and (x, y).
fn correlations(second: &Matrix3<f64>) -> Vector3<f64> {
    let of = |i: usize, j: usize| second[(i, j)] / (second[(i, i)] * second[(j, j)]).sqrt();
    Vector3::new(of(1, 2), of(2, 0), of(0, 1))
}

/// Finds mistakes of convention by shapes.
pub(super) fn conventions(model: &Model, shapes: &BTreeMap<String, Shape>) -> Vec<Finding> {
    let bodies: Vec<(&ModelLink, Spread, Option<Spread>)> = model
        .links
        .iter()
        .filter(|link| link.is_body())
        .filter_map(|link| {
            let shape = shapes.get(&link.name).and_then(rounded);
            Some((link, Spread::of(&link.nominal?)?, shape))
        })
        .collect();
    let mut found = Vec::new();
    for (link, own, shape) in &bodies {
        let text = about_origin(own, shape.as_ref()).or_else(|| {
            shape.and_then(|shape| wrong_side(own, &shape).or_else(|| wrong_products(own, &shape)))
        });
        found.extend(text.map(|text| Finding { place: format!("link {}", link.name), text }));
    }
    let signs: Vec<f64> =
        bodies.iter().filter_map(|(_, own, shape)| agreement(own, shape.as_ref()?)).collect();
    let against = signs.iter().filter(|cosine| **cosine < -OPPOSITE).count();
    let telling = signs.iter().filter(|cosine| cosine.abs() > OPPOSITE).count();
    let (fewest, share) = CONVENTION;
    if against >= fewest && against as f64 >= share * telling as f64 {
        found.push(Finding {
            place: "model".to_owned(),
            text: format!(
                "in {against} of {telling} links whose shapes tell, the products of inertia have the sign \
                 opposite to that of the shapes: were they written as ∫ x y dm, as some CAD programs do, and \
                 not as −∫ x y dm?"
            ),
        });
    }
    found
}

/// Judges a tensor that leaves a body if it is moved from the origin to the centre of mass, of half of it at
/// most, or a third where there are no shapes. One about the centre of mass does so only if the origin is
/// well inside of the body, and then moves little.
fn about_origin(own: &Spread, shape: Option<&Spread>) -> Option<String> {
    let undone = own.if_about_origin();
    let left = undone.second.symmetric_eigenvalues();
    let moved = own.centre * own.centre.transpose();
    let least = if shape.is_some() { TIMES.0 } else { TIMES.1 };
    if left.min() <= LEFT * left.max() || size(&moved) < least * size(&undone.second) {
        return None;
    }
    // The spread along the way from the origin.
    let along = |second: &Matrix3<f64>| (own.centre.transpose() * second * own.centre)[0];
    if let Some(shape) = shape {
        let far = |second: &Matrix3<f64>| (along(second) / along(&shape.second)).ln().abs();
        if far(&own.second) - far(&undone.second) < -NEARER {
            return None;
        }
    }
    Some(format!(
        "its tensor looks as if it was about the link's origin and not about the centre of mass: moved by \
         {:.3} m to there a body is left, of {:.0} % of the moments",
        own.centre.norm(),
        100.0 * undone.second.trace() / own.second.trace()
    ))
}

/// Judges a centre of mass that is much nearer to that of the shapes on the other side of the origin.
fn wrong_side(own: &Spread, shape: &Spread) -> Option<String> {
    let inverse = shape.second.try_inverse()?;
    let far = |spread: &Spread| {
        let off = spread.centre - shape.centre;
        (off.transpose() * inverse * off)[0]
    };
    let here = far(own);
    let best = (0..3)
        .filter(|axis| 2.0 * own.centre[*axis].abs() > own.radius())
        .map(|axis| (axis, far(&own.across(axis))))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (axis, there) = best;
    (here - there > FARTHER.1 && here > FARTHER.0 * there).then(|| {
        format!(
            "its centre of mass is {:.3} m off the middle of its shapes, and {:.3} m if {} had the other \
             sign",
            (own.centre - shape.centre).norm(),
            (own.across(axis).centre - shape.centre).norm(),
            ["x", "y", "z"][axis]
        )
    })
}

/// Returns the cosine between the correlation coefficients of a body and of its shapes where both are large
/// enough to tell.
fn agreement(own: &Spread, shape: &Spread) -> Option<f64> {
    let changed = own.with_products([true; 3]);
    if size(&own.second) * MATTERS > (own.second - changed.second).norm() {
        return None;
    }
    let (own, shape) = (correlations(&own.second), correlations(&shape.second));
    (shape.norm() > CORRELATED).then(|| own.dot(&shape) / (own.norm() * shape.norm()))
}

/// Judges products that are opposite to those of the shapes.
fn wrong_products(own: &Spread, shape: &Spread) -> Option<String> {
    let cosine = agreement(own, shape)?;
    (cosine < -OPPOSITE).then(|| {
        let own = correlations(&own.second);
        let shape = correlations(&shape.second);
        format!(
            "its products of inertia have the sign opposite to that of its shapes: y z, z x and x y are \
             correlated by {:.2}, {:.2} and {:.2}, in its shapes by {:.2}, {:.2} and {:.2}",
            own.x, own.y, own.z, shape.x, shape.y, shape.z
        )
    })
}
