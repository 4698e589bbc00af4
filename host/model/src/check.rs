//! Suspicious inertias of a robot description: impossible ones, and ones that are in another frame, unit
//! or place than they should be.

mod conventions;
pub mod shapes;
mod sides;
pub(crate) mod surface;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Matrix3;
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;

use super::finding::Finding;
use super::inertial::impossibility;
use super::tree::Model;
use super::xml::Language;
use shapes::Shape;

/// Of osmium, kg/m³: nothing is denser.
pub const DENSEST: f64 = 22_590.0;
/// Less than of anything that a link is made of, its hollows counted, kg/m³.
const LIGHTEST: f64 = 2.0;

/// The checked parts, and the findings.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// The model's name.
    pub name: String,
    /// The number of links.
    pub links: usize,
    /// Sum of the masses, kg.
    pub mass_kg: f64,
    /// The suspicious findings.
    pub findings: Vec<Finding>,
    /// The statements of its file that are not used here; they say nothing against the links.
    pub not_used: Vec<Finding>,
}

/// Checks a model; `text` is that of its URDF, MJCF or SDF, if it has one, and `path` the place that its
/// meshes are searched for from.
#[must_use]
pub fn check(model: &Model, text: Option<&str>, path: &Path) -> Checked {
    let (not_used, mut findings): (Vec<Finding>, Vec<Finding>) = model
        .findings
        .iter()
        .cloned()
        .partition(|finding| finding.text.starts_with(crate::finding::NOT_USED));
    let urdf = text.filter(|text| Language::of_text(text) == Some(Language::Urdf));
    findings.extend(of_inertias(model, &urdf.map_or_else(BTreeMap::new, |text| shapes::shapes(text, path))));
    Checked {
        links: model.links.iter().filter(|link| link.is_body()).count(),
        mass_kg: model.links.iter().filter_map(|l| Some(l.nominal?[0])).sum(),
        name: model.name.clone(),
        findings,
        not_used,
    }
}

/// Returns what is strange about the inertias of a model whose links have these shapes.
#[must_use]
pub fn of_inertias(model: &Model, shapes: &BTreeMap<String, Shape>) -> Vec<Finding> {
    let mut findings = sizes(model);
    findings.extend(sides::sides(model));
    findings.extend(outside(model, shapes));
    for finding in conventions::conventions(model, shapes) {
        // One cause is enough.
        if findings.iter().all(|other| other.place != finding.place) {
            findings.push(finding);
        }
    }
    findings
}

fn body(phi: &[f64; 10]) -> InertialParameters<Body, f64> {
    InertialParameters::from_vector(*phi)
}

/// Returns the radii of gyration about the principal axes, m, smallest first.
fn radii(phi: &[f64; 10]) -> [f64; 3] {
    let own = body(phi);
    let moments = own.inertia_com().symmetric_eigenvalues();
    let mut radii = [0, 1, 2].map(|k| (moments[k].max(0.0) / own.mass).sqrt());
    radii.sort_by(f64::total_cmp);
    radii
}

/// Returns the density, kg/m³, that some part of a body must at least have, from its ten parameters in SI: of
/// all bodies of a mass and a volume the solid ellipsoid has the least `det Σ`, Σ the second moments over the
/// mass about the centre of mass, `V = 4/3 π √(5³ det Σ)`.
#[must_use]
pub fn least_density(phi: &[f64; 10]) -> f64 {
    let own = body(phi);
    let tensor = own.inertia_com();
    let second = (Matrix3::identity() * (0.5 * tensor.trace()) - tensor) / own.mass;
    let volume = 4.0 / 3.0 * std::f64::consts::PI * (125.0 * second.determinant().max(0.0)).sqrt();
    own.mass / volume
}

/// Masses without inertia, placeholders, tensors in other units, centres of mass that are nowhere near.
fn sizes(model: &Model) -> Vec<Finding> {
    let mut reach: f64 = 0.0;
    let mut from_base = vec![0.0; model.links.len()];
    for (i, link) in model.links.iter().enumerate().skip(1) {
        from_base[i] = from_base[link.link.parent] + link.link.position.norm();
        reach = reach.max(from_base[i]);
    }
    let mut found = Vec::new();
    for link in model.links.iter().filter(|link| link.is_body()) {
        let Some(phi) = &link.nominal else { continue };
        let own = body(phi);
        let mut say = |text: String| found.push(Finding { place: format!("link {}", link.name), text });
        // What no body has is reported elsewhere.
        if impossibility(phi).is_some() {
            continue;
        }
        let com = own.centre_of_mass().vector();
        if (own.inertia_com() - Matrix3::identity()).norm() < 1e-9 && (own.mass - 1.0).abs() < 1e-9 {
            say("has a kilogram of unit moments of inertia: a placeholder?".to_owned());
            continue;
        }
        let density = least_density(phi);
        let [_, _, largest] = radii(phi);
        if density > DENSEST {
            say(format!(
                "a body of {:.4} kg with these moments of inertia would have to be denser than osmium \
                 ({density:.2e} kg/m³; its largest radius of gyration is {:.3} mm): is the mass in kg, and \
                 the tensor in kg m²?",
                own.mass,
                largest * 1e3
            ));
        } else if density < LIGHTEST {
            say(format!(
                "a body of {:.4} kg with these moments of inertia would be a cloud of {density:.1e} kg/m³ \
                 (its largest radius of gyration is {largest:.3} m; all joints together are {reach:.3} m \
                 apart): is the tensor in kg m², and the mass in kg?",
                own.mass
            ));
        }
        // A last link may be longer than all that is before it; then it is wide as well.
        if com.norm() > 5.0 * largest && com.norm() > 0.3 * reach {
            say(format!(
                "its centre of mass is {:.3} m from its origin, {:.0} of its radii of gyration: is it in \
                 metres, and in the link's own frame?",
                com.norm(),
                com.norm() / largest
            ));
        }
    }
    found
}

/// Centres of mass outside of a link's simple shapes, and moments that nothing inside of them has.
fn outside(model: &Model, shapes: &BTreeMap<String, Shape>) -> Vec<Finding> {
    let mut found = Vec::new();
    for link in &model.links {
        let simple = shapes.get(&link.name).and_then(|shape| shape.simple);
        let (Some(phi), Some((low, high))) = (link.nominal, simple) else { continue };
        let name = &link.name;
        if phi[0] <= 0.0 {
            continue;
        }
        let com = body(&phi).centre_of_mass().vector();
        let size = (high - low).norm();
        let beyond = (low - com).sup(&(com - high)).max();
        let mut say = |text: String| found.push(Finding { place: format!("link {name}"), text });
        if beyond > 0.01 * size {
            say(format!(
                "its centre of mass is {beyond:.3} m outside of the box around its shapes ({size:.3} m \
                 across): is it in the link's frame, and in metres?"
            ));
            continue;
        }
        // No mass is further from the centre of mass than the furthest corner.
        let furthest = (com - low).abs().sup(&(high - com).abs()).norm();
        let [_, _, largest] = radii(&phi);
        if largest > furthest * 1.01 {
            say(format!(
                "its largest radius of gyration is {largest:.3} m, and no point of its shapes is further \
                 than {furthest:.3} m from its centre of mass: is the tensor about the link's origin and not \
                 about the centre of mass, or in another unit?"
            ));
        }
    }
    found
}
