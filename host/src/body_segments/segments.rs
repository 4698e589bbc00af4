//! Segments with intervals, beside the table.
//!
//! Values are the physically consistent ones nearest to the table. How uncertain they are is what rows and table leave together:
//! with the map B from segments to base parameters and the table's covariance Σ, `P = (Σ⁻¹ + BᵀRᵀR B)⁻¹`, and what joint centres leave open,
//! `G D Dᵀ Gᵀ` with `G = P BᵀRᵀR`.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::study::{Study, StudyError};
use crate::answer::person::SegmentResult;
use crate::answer::standard_parameters::Full;
use crate::fit::{COVERAGE_95, Fit, Measured};
use crate::model::inertial::Parameters;
use crate::problem::person::Person;
use crate::problem::person::anthropometry;

/// Returns the segments of a person, and the centre of mass of all of her when she stands upright, from midway between the hips, m.
///
/// # Errors
/// [`StudyError::NoFrames`] if what is known of them is singular.
pub fn segments(
    study: &Study,
    person: &Person,
    fit: &Fit,
    found: &Full,
) -> Result<(Vec<SegmentResult>, [Measured; 3]), StudyError> {
    let refuse = || StudyError::NoFrames("what is known of the segments is singular".to_owned());
    let model = &person.subject.model;
    let known = anthropometry::standard(model, &study.options.spread).ok_or_else(refuse)?;
    let map = study.base().map() * anthropometry::bodies(model);
    let r = fit.scaled_factor().r().columns(0, map.nrows()).into_owned();
    let rows = &r * &map;
    let information = known.clone().cholesky().ok_or_else(refuse)?.inverse() + rows.transpose() * &rows;
    let covariance = information.cholesky().ok_or_else(refuse)?.inverse();
    // What joint centres move in the rows' own estimate moves so much of the segments.
    let moved = &covariance * rows.transpose() * &r * &study.draws;
    let covariance = covariance + &moved * moved.transpose();
    let each = found.links.iter().filter_map(|link| {
        let at = model.links.iter().position(|l| l.name == link.name)?;
        let own = covariance.view((10 * at, 10 * at), (10, 10)).into_owned();
        let before = known[(10 * at, 10 * at)];
        Some(segment(&link.name, &link.parameters, &link.nominal, &own, before))
    });
    Ok((each.collect(), centre(person, found, &covariance)))
}

/// The centre of mass of all links at zero position: `c = Σ (m p + ms) / Σ m`, `δc = Σ (p δm + δms − c δm) / M`.
fn centre(person: &Person, found: &Full, covariance: &DMatrix<f64>) -> [Measured; 3] {
    let model = &person.subject.model;
    let places = person.subject.skeleton.places(&person.subject.skeleton.zero());
    let mut mass = 0.0;
    let mut first = Vector3::zeros();
    let mut weights = DMatrix::zeros(3, covariance.nrows());
    for (i, link) in model.links.iter().enumerate() {
        let Some(own) = found.links.iter().find(|l| l.name == link.name) else { continue };
        let (turn, origin) = places[i];
        let [m, x, y, z, ..] = own.parameters;
        mass += m;
        first += origin * m + turn * Vector3::new(x, y, z);
        for axis in 0..3 {
            weights[(axis, 10 * i)] = origin[axis];
            (0..3).for_each(|k| weights[(axis, 10 * i + 1 + k)] = turn[(axis, k)]);
        }
    }
    let centre = first / mass;
    for i in 0..model.links.len() {
        (0..3).for_each(|axis| weights[(axis, 10 * i)] -= centre[axis]);
    }
    let square = &weights * covariance * weights.transpose() / (mass * mass);
    std::array::from_fn(|k| Measured { value: centre[k], u95: COVERAGE_95 * square[(k, k)].max(0.0).sqrt() })
}

fn segment(
    name: &str,
    phi: &Parameters,
    table: &Parameters,
    covariance: &DMatrix<f64>,
    before: f64,
) -> SegmentResult {
    let u95 = |variance: f64| COVERAGE_95 * variance.max(0.0).sqrt();
    let (centre, radii) = shape(phi);
    let (table_centre, table_radii) = shape(table);
    // c = ms / m: δc = (δms − c δm) / m
    let of_axis = |k: usize| {
        let (a, b, c) = (covariance[(1 + k, 1 + k)], covariance[(0, 0)], covariance[(0, 1 + k)]);
        u95(a + centre[k] * centre[k] * b - 2.0 * centre[k] * c) / phi[0]
    };
    SegmentResult {
        name: name.to_owned(),
        mass_kg: Measured { value: phi[0], u95: u95(covariance[(0, 0)]) },
        table_mass_kg: table[0],
        com_m: std::array::from_fn(|k| Measured { value: centre[k], u95: of_axis(k) }),
        table_com_m: table_centre.into(),
        radii_m: radii,
        table_radii_m: table_radii,
        informed: (1.0 - covariance[(0, 0)] / before).clamp(0.0, 1.0),
    }
}

/// Centre of mass, m, and radii of gyration about the axes through it, m.
fn shape(phi: &Parameters) -> (Vector3<f64>, [f64; 3]) {
    let mass = phi[0];
    let c = Vector3::new(phi[1], phi[2], phi[3]) / mass;
    let about = Matrix3::from_diagonal(&Vector3::new(phi[4], phi[5], phi[6]))
        - (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * mass;
    (c, std::array::from_fn(|k| (about[(k, k)].max(0.0) / mass).sqrt()))
}
