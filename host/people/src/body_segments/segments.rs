//! Segments with intervals, beside the table.
//!
//! Values and intervals are what rows, with joint centres and plates that may be off, and the table say
//! together ([`rigident_identify::answer::standard_beside`]).

use nalgebra::{DMatrix, Matrix3, UnitQuaternion, Vector3, Vector4};

use super::error::StudyError;
use super::study::{Segments, Study};
use crate::inverse_kinematics::skeleton::{Pose, Turn};
use crate::person::Person;
use crate::person::anthropometry::with_whole_mass;
use rigident_fit::{COVERAGE_95, Measured};
use rigident_identify::answer::person::SegmentResult;
use rigident_identify::answer::standard_parameters::Full;
use rigident_model::human::PELVIS_TILT;
use rigident_model::inertial::Parameters;

/// A segment is identified if motions take so large a part of the variance of its mass among people of one
/// table: a quarter makes that interval 13 % narrower.
const LEAST_INFORMED: f64 = 0.25;

/// Returns the segments of a person, `found` by [`Study::segments`], and the centre of mass of all of her
/// when she stands upright, from midway between the hips, m.
///
/// # Errors
/// [`StudyError::Model`] if the table has none.
pub fn segments(
    study: &Study,
    person: &Person,
    found: &Segments,
) -> Result<(Vec<SegmentResult>, [Measured; 3]), StudyError> {
    let model = &person.subject.model;
    let Segments { full: found, covariance, informed } = found;
    // That the whole is heavier or lighter than the table's tells of no segment.
    let known = with_whole_mass(&study.known_of_segments(person, &study.options.spread)?, 0.0);
    let each = found.links.iter().filter_map(|link| {
        let at = model.links.iter().position(|l| l.name == link.name)?;
        let own = covariance.view((10 * at, 10 * at), (10, 10)).into_owned();
        let before = known[(10 * at, 10 * at)];
        let informed = informed.get(at).copied().unwrap_or(0.0);
        Some(segment(&link.name, [&link.parameters, &link.nominal], &own, (before, informed)))
    });
    Ok((each.collect(), centre(person, found, covariance)))
}

/// Returns the pose of somebody who stands upright: at zero, with the pelvis' spines leaning forward, and
/// trunk and thighs upright.
fn upright(person: &Person) -> Pose {
    let mut pose = person.subject.skeleton.zero();
    let lean = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PELVIS_TILT);
    pose.attitude = lean;
    for name in ["torso", "lumbar", "l_thigh", "r_thigh"] {
        let turn = person.subject.model.link(name).and_then(|link| pose.turns.get_mut(link));
        if let Some(Turn::Ball(turn)) = turn {
            *turn = lean.inverse();
        }
    }
    pose
}

/// Returns the centre of mass of all links upright. Their masses are `Σ m`, their first moments
/// `Σ (m p + ms)`.
fn centre(person: &Person, found: &Full, covariance: &DMatrix<f64>) -> [Measured; 3] {
    let model = &person.subject.model;
    let places = person.subject.skeleton.places(&upright(person));
    let mut mass = 0.0;
    let mut first = Vector3::zeros();
    let mut weights = DMatrix::zeros(4, covariance.nrows());
    for (i, link) in model.links.iter().enumerate() {
        let Some(own) = found.links.iter().find(|l| l.name == link.name) else { continue };
        let (turn, origin) = places[i];
        let [m, x, y, z, ..] = own.parameters;
        mass += m;
        first += origin * m + turn * Vector3::new(x, y, z);
        weights[(0, 10 * i)] = 1.0;
        weights.fixed_view_mut::<3, 1>(1, 10 * i).copy_from(&origin);
        weights.fixed_view_mut::<3, 3>(1, 10 * i + 1).copy_from(&turn);
    }
    centre_of_mass(
        &Vector4::new(mass, first.x, first.y, first.z),
        &(&weights * covariance * weights.transpose()),
    )
}

fn segment(
    name: &str,
    [phi, table]: [&Parameters; 2],
    covariance: &DMatrix<f64>,
    (before, informed): (f64, f64),
) -> SegmentResult {
    let u95 = |variance: f64| COVERAGE_95 * variance.max(0.0).sqrt();
    let (_, radii) = shape(phi);
    let (table_centre, table_radii) = shape(table);
    let mass_kg = Measured { value: phi[0], u95: u95(covariance[(0, 0)]) };
    SegmentResult {
        name: name.to_owned(),
        mass_kg,
        table_mass_kg: table[0],
        com_m: centre_of_mass(&Vector4::new(phi[0], phi[1], phi[2], phi[3]), covariance),
        table_com_m: table_centre.into(),
        radii_m: radii,
        table_radii_m: table_radii,
        informed,
        identified: informed >= LEAST_INFORMED && mass_kg.u95 < mass_kg.value,
        table_mass_u95_kg: u95(before),
    }
}

/// Returns a centre of mass, m, from mass and first moments and their covariance, which comes first in
/// `covariance`: `c = ms / m`, `δc = (δms − c δm) / m`.
pub(super) fn centre_of_mass(body: &Vector4<f64>, covariance: &DMatrix<f64>) -> [Measured; 3] {
    std::array::from_fn(|k| {
        let (mass, c) = (body[0], body[1 + k] / body[0]);
        let (a, b, ab) = (covariance[(1 + k, 1 + k)], covariance[(0, 0)], covariance[(0, 1 + k)]);
        let variance = (a + c * c * b - 2.0 * c * ab).max(0.0);
        Measured { value: c, u95: COVERAGE_95 * variance.sqrt() / mass.abs() }
    })
}

/// Returns the centre of mass, m, and the radii of gyration about the axes through it, m.
fn shape(phi: &Parameters) -> (Vector3<f64>, [f64; 3]) {
    let mass = phi[0];
    let c = Vector3::new(phi[1], phi[2], phi[3]) / mass;
    let about = Matrix3::from_diagonal(&Vector3::new(phi[4], phi[5], phi[6]))
        - (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * mass;
    (c, std::array::from_fn(|k| (about[(k, k)].max(0.0) / mass).sqrt()))
}
