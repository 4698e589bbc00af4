//! Inertias that no body has, taken as those of the nearest that has them where a whole body is needed.

use nalgebra::{Matrix3, SymmetricEigen};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::Joint;

use super::inertial::{Parameters, impossibility};
use super::tree::Model;

/// Density of the balls that stand in for inertias of zero, kg/m³: water's.
const DENSITY: f64 = 1000.0;
/// The least second moment of a mended body over its largest: a plate whose thickness is a tenth of its width.
const FLATTEST: f64 = 0.01;
/// Second moments that are negative by less, relative to the largest, are flat ones that were rounded.
const ROUNDED: f64 = 0.01;

/// Returns the parameters of a body that is as these say, but no flatter than a body can be, and what was done; `None` if they
/// are too far from any body's, or without mass.
fn mended(phi: &Parameters, rounded_only: bool) -> Option<(Parameters, String)> {
    let body = InertialParameters::<Body, f64>::from_vector(*phi);
    if phi.iter().any(|v| !v.is_finite()) || body.mass <= 0.0 {
        return None;
    }
    let tensor = body.inertia_com();
    // Integrals of x xᵀ over the mass: those of a body are positive.
    let second = SymmetricEigen::new(Matrix3::identity() * (0.5 * tensor.trace()) - tensor);
    let largest = second.eigenvalues.max();
    let radius_squared = (body.mass / (4.0 / 3.0 * std::f64::consts::PI * DENSITY)).cbrt().powi(2);
    let ball = body.mass * radius_squared / 5.0;
    let (least, text) = if largest < FLATTEST * ball {
        (ball, format!("that of a ball of {:.3} m, as water would be", 2.0 * radius_squared.sqrt()))
    } else {
        (FLATTEST * largest, "no flatter than a plate a tenth as thick as wide".to_owned())
    };
    if rounded_only && second.eigenvalues.min() < -ROUNDED * largest.max(ball) {
        return None;
    }
    let raised = second.eigenvalues.map(|value| value.max(least));
    let second = second.eigenvectors * Matrix3::from_diagonal(&raised) * second.eigenvectors.transpose();
    let tensor = Matrix3::identity() * second.trace() - second;
    let [x, y, z] = body.centre_of_mass().array();
    let new = InertialParameters::<Body, f64>::from_centre_of_mass(body.mass, Position::new(x, y, z), tensor);
    let new = new.to_vector();
    impossibility(&new).is_none().then_some((new, text))
}

impl Model {
    /// Returns the inertias of all links as bodies have them, and what was found of those that none has: a link's index and why.
    ///
    /// What is fixed together is judged as one. If that is a body, each link of it is mended, or left out where it has moments and
    /// no mass; otherwise only what was rounded is. What cannot be mended stays as it is, and [`impossibility`] says why.
    #[must_use]
    pub fn possible(&self) -> (Vec<Option<Parameters>>, Vec<(usize, String)>) {
        let welded = self.welded();
        let (mut out, mut found) = (Vec::new(), Vec::new());
        let mut holder: Vec<usize> = Vec::new();
        for (i, link) in self.links.iter().enumerate() {
            let holds = if i > 0 && link.link.joint == Joint::Fixed { holder[link.link.parent] } else { i };
            holder.push(holds);
            out.push(link.nominal.filter(|_| link.is_body()));
            let Some((phi, why)) = out[i].and_then(|phi| Some((phi, impossibility(&phi)?))) else { continue };
            let whole = welded.link(&self.links[holds].name).and_then(|k| welded.links[k].nominal);
            let is_body = whole.is_some_and(|whole| impossibility(&whole).is_none());
            let text = match mended(&phi, !is_body) {
                Some((new, taken)) => {
                    out[i] = Some(new);
                    format!("{why}; where every link has to be a body its inertia is taken as {taken}")
                }
                None if is_body && phi[0] == 0.0 => {
                    out[i] = None;
                    format!("{why}; where every link has to be a body it is left out")
                }
                None => why,
            };
            found.push((i, text));
        }
        (out, found)
    }
}
