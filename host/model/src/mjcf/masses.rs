//! The effect of MuJoCo's compiler on stated masses: least ones, moments that are balanced, a total.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use crate::inertial::Parameters;
use crate::tree::RawLink;
use crate::xml::{self, describe, exactly};

/// Settings of `<compiler>` that change stated inertias.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Masses {
    /// Least mass of a body, kg.
    least_kg: f64,
    /// Least principal moment, kg m².
    least_moment: f64,
    /// Moments that no body has become their mean.
    balances: bool,
    /// Sum of all masses, kg, that they are scaled to.
    total_kg: Option<f64>,
}

impl Masses {
    /// Reads the settings; of several `<compiler>` the last counts.
    pub(super) fn of(compilers: &[Node]) -> Result<Self, String> {
        let number = |name: &str| -> Result<f64, String> {
            let Some(node) = compilers.iter().rev().find(|c| c.attribute(name).is_some()) else {
                return Ok(0.0);
            };
            let what = format!("{name} of {}", describe(node));
            Ok(exactly::<1>(xml::numbers(node, name)?.unwrap_or_default(), &what)?[0])
        };
        let balances = compilers.iter().rev().find_map(|c| c.attribute("balanceinertia"));
        Ok(Self {
            least_kg: number("boundmass")?,
            least_moment: number("boundinertia")?,
            balances: balances == Some("true"),
            total_kg: Some(number("settotalmass")?).filter(|total| *total > 0.0),
        })
    }

    /// Returns mass and tensor about the centre of mass as the compiler leaves them.
    pub(super) fn bounded(&self, mass: f64, tensor: Matrix3<f64>) -> (f64, Matrix3<f64>) {
        let eigen = tensor.symmetric_eigen();
        let stated = eigen.eigenvalues;
        let mut moments = stated.map(|moment| moment.max(self.least_moment));
        let sum = moments.sum();
        if self.balances && moments.iter().any(|moment| sum - moment < *moment) {
            moments = Vector3::repeat(sum / 3.0);
        }
        let tensor = if moments == stated || !(self.balances || self.least_moment > 0.0) {
            tensor
        } else {
            eigen.eigenvectors * Matrix3::from_diagonal(&moments) * eigen.eigenvectors.transpose()
        };
        (mass.max(self.least_kg), tensor)
    }

    /// Scales all masses to their total, those of bodies beside the robot included. Returns why it cannot.
    pub(super) fn scale(&self, links: &mut [&mut RawLink], unknown: &[String]) -> Option<String> {
        let total = self.total_kg?;
        let of = |link: &RawLink| link.link.nominal.map_or(0.0, |phi: Parameters| phi[0]);
        let sum: f64 = links.iter().map(|link| of(link)).sum();
        if !unknown.is_empty() || sum <= 0.0 {
            return Some(format!(
                "settotalmass = {total} kg is not followed, as the masses of {} are not stated: masses are \
                 those of <inertial>",
                shortened(unknown)
            ));
        }
        for phi in links.iter_mut().filter_map(|link| link.link.nominal.as_mut()) {
            phi.iter_mut().for_each(|value| *value *= total / sum);
        }
        None
    }
}

/// Returns names in a sentence: the first six, and how many more there are.
pub(super) fn shortened(names: &[String]) -> String {
    const SHOWN: usize = 6;
    let more = names.len().saturating_sub(SHOWN);
    let rest = if more == 0 { String::new() } else { format!(" and {more} more") };
    format!("{}{rest}", names[..names.len().min(SHOWN)].join(", "))
}
