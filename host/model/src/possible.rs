//! Inertias that no body has, taken as those of the nearest that has them where a whole body is needed.

use nalgebra::{Matrix3, SymmetricEigen};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::Joint;

use super::inertial::{Parameters, impossibility};
use super::tree::Model;

/// Density of the balls that replace inertias of zero, kg/m³: water's.
const DENSITY: f64 = 1000.0;
/// The least second moment of a repaired body over its largest: a plate whose thickness is a tenth of its
/// width.
const FLATTEST: f64 = 0.01;
/// Second moments that are negative by less, relative to the largest, are flat ones that were rounded.
const ROUNDED: f64 = 0.01;

/// Returns the parameters of a body that is as these say, but no flatter than a body can be, and what was
/// done; `None` if they are too far from any body's, or without mass.
fn corrected(phi: &Parameters, rounded_only: bool) -> Option<(Parameters, String)> {
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

/// The repair of a link whose inertia no body has.
#[derive(Clone, Debug, PartialEq)]
pub struct Repair {
    /// The link.
    pub link: String,
    /// Why no body has its inertia.
    pub why: String,
    /// The replacement, in words; `None` where nothing near it is a body's, and it stays as it is.
    pub taken: Option<String>,
    /// Norm of the change of the tensor about the centre of mass over that of the tensor.
    pub change: f64,
}

impl Model {
    /// Returns the model with the nearest inertia that a body can have in the place of every one that no body
    /// has: the mass and its centre stay, and the second moments about it are the nearest, by the sum of
    /// squares, that are those of a body no flatter than a plate a tenth as thick as wide. What has no mass,
    /// or a negative one, stays.
    #[must_use]
    pub fn repaired(&self) -> (Self, Vec<Repair>) {
        let (mut out, mut repairs) = (self.clone(), Vec::new());
        for link in out.links.iter_mut().filter(|link| link.is_body()) {
            let Some((phi, why)) = link.nominal.and_then(|phi| Some((phi, impossibility(&phi)?))) else {
                continue;
            };
            let found = corrected(&phi, false);
            let tensor = |phi: &Parameters| InertialParameters::<Body, f64>::from_vector(*phi).inertia_com();
            let change = found.as_ref().map_or(0.0, |(new, _)| {
                let before = tensor(&phi);
                (tensor(new) - before).norm() / before.norm().max(f64::MIN_POSITIVE)
            });
            if let Some((new, _)) = &found {
                link.nominal = Some(*new);
            }
            let taken = found.map(|(_, text)| text);
            repairs.push(Repair { link: link.name.clone(), why, taken, change });
        }
        (out, repairs)
    }

    /// Returns the inertias of all links as bodies have them, and what was found of those that none has: a
    /// link's index and why.
    ///
    /// Links that are fixed together are judged as one. If that is a body, each link of it is repaired, or
    /// left out where it has moments and no mass; otherwise only rounded inertias are repaired. An inertia
    /// that cannot be repaired stays as it is, and [`impossibility`] says why.
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
            let text = match corrected(&phi, !is_body) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_inertia_keeps_mass_centre_and_possible_moments() {
        let urdf = |moments: &str, mass: f64| {
            format!(
                "<robot name='r'><link name='base'/><link name='arm'><inertial><origin xyz='0.1 0 0.2' \
                 rpy='0 0 0.3'/><mass value='{mass}'/><inertia {moments} ixy='0' ixz='0' \
                 iyz='0'/></inertial></link><joint name='j' type='revolute'><parent link='base'/><child \
                 link='arm'/><axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='1' \
                 velocity='1'/></joint></robot>"
            )
        };
        let read = |text: &str| crate::write::parse(text, "a.urdf").unwrap();
        let repaired = |moments: &str, mass: f64| {
            let parsed = read(&urdf(moments, mass));
            parsed.model.repaired()
        };
        // The sum of two is less than the third: by the triangle inequality 0.45 − 0.2 is missing.
        let (model, repairs) = repaired("ixx='0.1' iyy='0.1' izz='0.45'", 2.0);
        let arm = model.link("arm").unwrap();
        let phi = model.links[arm].nominal.unwrap();
        assert_eq!((repairs.len(), repairs[0].link.as_str()), (1, "arm"));
        assert_eq!(impossibility(&phi), None);
        assert!((phi[0] - 2.0).abs() < 1e-12 && (phi[1] - 0.2).abs() < 1e-12 && (phi[3] - 0.4).abs() < 1e-12);
        // Second moments (trace/2 − I) are 0.225, 0.225 and −0.125; the last becomes 0.00225, and I_xx that
        // much more.
        let tensor = InertialParameters::<Body, f64>::from_vector(phi).inertia_com();
        let mut moments: Vec<f64> = tensor.symmetric_eigenvalues().iter().copied().collect();
        moments.sort_by(f64::total_cmp);
        for (found, wanted) in moments.iter().zip([0.22725, 0.22725, 0.45]) {
            assert!((found - wanted).abs() < 1e-9, "{moments:?}");
        }
        // What a body has stays to the last bit; what has no mass cannot be repaired.
        let good = read(&urdf("ixx='0.1' iyy='0.2' izz='0.25'", 2.0));
        let (same, none) = good.model.repaired();
        assert!(none.is_empty());
        assert_eq!(same.links[arm].nominal, good.model.links[arm].nominal);
        let (_, left) = repaired("ixx='0.1' iyy='0.1' izz='0.1'", -1.0);
        assert!(left.len() == 1 && left[0].taken.is_none() && left[0].why.contains("negative"));
    }
}
