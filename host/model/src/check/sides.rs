//! Links of the left and the right side: each the mirror image of the other, or the same part.

use nalgebra::SVector;

use super::conventions::Spread;
use crate::finding::Finding;
use crate::inertial::Parameters;
use crate::symmetry;
use crate::tree::Model;

/// Numbers that agree to this, relative, were copied or mirrored.
const ALIKE: f64 = 1e-3;
/// A deviation below this is no mistake of these kinds.
const OFF: f64 = 0.02;

/// Finds links of one side that would be the image of the other but for one mistake.
pub(super) fn sides(model: &Model) -> Vec<Finding> {
    let mut found = Vec::new();
    for pair in symmetry::images(model) {
        let (Some(left), Some(right)) = (model.links[pair.left].nominal, model.links[pair.right].nominal)
        else {
            continue;
        };
        let image: Parameters = (pair.map * SVector::<f64, 10>::from(left)).into();
        let same_mass = (left[0] - right[0]).abs() <= ALIKE * left[0].abs();
        let (Some(image), Some(copy), Some(own)) =
            (Spread::of(&image), Spread::of(&left), Spread::of(&right))
        else {
            continue;
        };
        // The same part on both sides, turned about, has the same numbers by right; and of two that are in
        // one place at zero, as closed fingers, the place does not say that one is the other's image.
        let may_be_copy = pair.turned || pair.together;
        if !same_mass || off(&image, &own) <= OFF || (may_be_copy && off(&copy, &own) <= OFF) {
            continue;
        }
        let names = (&model.links[pair.left].name, &model.links[pair.right].name);
        let mut say = |text: String| {
            found.push(Finding { place: format!("link {}", names.1), text });
        };
        if !may_be_copy && off(&copy, &own) <= ALIKE {
            say(format!(
                "has the very numbers of {}, whose mirror image it is by its place: centre of mass and \
                 products of inertia should have changed signs (it is off by {:.0} % of its own)",
                names.0,
                100.0 * off(&image, &own)
            ));
            continue;
        }
        let wanted = if may_be_copy { vec![image, copy] } else { vec![image] };
        if let Some(mistake) = wanted.iter().find_map(|wanted| mistake(wanted, &own)) {
            say(format!(
                "would be the image of {} but for one thing: {mistake}, in one of the two; they differ by \
                 {:.0} %",
                names.0,
                100.0 * off(&image, &own)
            ));
        }
    }
    found
}

/// Returns the largest difference of two bodies in places and second moments, relative to their radius of
/// gyration and its square.
fn off(a: &Spread, b: &Spread) -> f64 {
    let radius = a.radius().max(b.radius()).max(f64::MIN_POSITIVE);
    let places = (a.centre - b.centre).norm() / radius;
    places.max((a.second - b.second).norm() / (radius * radius))
}

/// Names the one mistake between two bodies.
fn mistake(wanted: &Spread, own: &Spread) -> Option<String> {
    let alike = |a: &Spread, b: &Spread| off(a, b) <= ALIKE;
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if alike(&wanted.across(axis), own) {
            return Some(format!("the sign of {name} of the centre of mass"));
        }
    }
    let products = [
        ([true; 3], "the signs of the products of inertia"),
        ([true, false, false], "the sign of the product of inertia yz"),
        ([false, true, false], "the sign of the product of inertia zx"),
        ([false, false, true], "the sign of the product of inertia xy"),
    ];
    for (changed, name) in products {
        if alike(&wanted.with_products(changed), own) {
            return Some(name.to_owned());
        }
    }
    (alike(&own.if_about_origin(), wanted) || alike(&wanted.if_about_origin(), own))
        .then(|| "the tensor is about the link's origin and not about the centre of mass".to_owned())
}
