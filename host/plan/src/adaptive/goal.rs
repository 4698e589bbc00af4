//! The goal, and the distance to it.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rigident_shared::inertia::PARAMETER_NAMES;

use super::compact::Compact;
use super::information::{Information, InverseRoot, deviations};

/// 95 % of a normal distribution, standard deviations.
const COVERAGE: f64 = 1.96;

/// The request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Asked {
    /// Largest 95 % uncertainties, SI; infinite where anything will do.
    Absolute([f64; 16]),
    /// Every element of the tensors about S and about the centre of mass at most this share of the largest
    /// principal moment about the centre of mass.
    Tensor(f64),
}

/// The goal, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Largest 95 % uncertainties; infinite where anything will do.
    pub u95: [f64; 16],
    /// The largest 95 % uncertainty of the tensor about the centre of mass, the same for every element, and
    /// the elements' derivatives by the ten parameters.
    pub about_com: Option<(f64, [[f64; 10]; 6])>,
}

impl Asked {
    /// Returns the goal in SI, for the present estimate of the ten parameters. Without one a relative goal is
    /// that of the most compact body. Mass and first moment are asked for as well then, so that they would do
    /// for the tensor about its centre of mass.
    pub fn goal(&self, estimate: Option<&[f64]>, compact: &Compact) -> Goal {
        match self {
            Self::Absolute(u95) => Goal { u95: *u95, about_com: None },
            Self::Tensor(share) => {
                let principal = estimate.and_then(largest_principal);
                let least = share * principal.unwrap_or(compact.moment_kgm2);
                let mut u95 = [f64::INFINITY; 16];
                u95[4..10].fill(least);
                if principal.is_none() {
                    u95[0] = least / (compact.away_m * compact.away_m);
                    u95[1..4].fill(least / (2.0 * compact.away_m));
                }
                let slopes = estimate.filter(|_| principal.is_some()).and_then(about_com_slopes);
                Goal { u95, about_com: slopes.map(|slopes| (least, slopes)) }
            }
        }
    }
}

impl Asked {
    /// Returns true if it can be said what share of what is asked for can be reached where this much of it is
    /// known now: of a relative goal the largest moment, by which it is measured, must be known itself: 10 %
    /// are then nearly three standard deviations.
    pub(super) fn can_foresee(&self, ratio: f64) -> bool {
        match self {
            Self::Absolute(_) => ratio.is_finite(),
            Self::Tensor(share) => ratio * share <= 0.07,
        }
    }

    /// Returns true if it is known what is asked for: a share of a moment is not before a body is identified,
    /// nor where noise has left its tensor without a positive moment.
    pub fn is_known(&self, estimate: Option<&[f64]>) -> bool {
        match self {
            Self::Absolute(_) => true,
            Self::Tensor(_) => estimate.and_then(largest_principal).is_some(),
        }
    }
}

impl Goal {
    /// Uncertainties of every element of the tensors about S and about the centre of mass over 1 kg m².
    pub(super) fn of_moments(phi: &[f64]) -> Option<Self> {
        let mut u95 = [f64::INFINITY; 16];
        u95[4..10].fill(1.0);
        Some(Self { u95, about_com: Some((1.0, about_com_slopes(phi)?)) })
    }

    /// Returns the 95 % uncertainty over what is asked for, of each parameter; infinite where one is not
    /// determined.
    pub fn ratios(&self, information: &Information, variance_scale: f64) -> [f64; 16] {
        let k = COVERAGE * variance_scale.sqrt();
        match deviations(information) {
            Some(sd) => std::array::from_fn(|j| k * sd[j] / self.u95[j]),
            None => self.u95.map(|u| if u.is_finite() { f64::INFINITY } else { 0.0 }),
        }
    }

    /// Returns the largest of [`Self::ratios`] and of those about the centre of mass; at most 1 when all is
    /// reached.
    pub fn worst(&self, information: &Information, variance_scale: f64) -> f64 {
        let k = COVERAGE * variance_scale.sqrt();
        let Some(inverse) = InverseRoot::of(information) else {
            return if self.u95.iter().any(|u| u.is_finite()) { f64::INFINITY } else { 0.0 };
        };
        let about_s =
            inverse.deviations().iter().zip(&self.u95).map(|(sd, u95)| k * sd / u95).fold(0.0, f64::max);
        let about_com = self.about_com.as_ref().map_or(0.0, |(least, slopes)| {
            slopes.iter().map(|slope| k * inverse.deviation_of(slope) / least).fold(0.0, f64::max)
        });
        about_s.max(about_com)
    }

    /// Returns the name of the parameter that is furthest off.
    pub fn furthest(&self, information: &Information) -> &'static str {
        let ratios = self.ratios(information, 1.0);
        let worst = (0..16).max_by(|i, j| ratios[*i].total_cmp(&ratios[*j])).unwrap_or(0);
        PARAMETER_NAMES[worst]
    }
}

/// Derivatives of `I_S − (|mc|² 1 − mc mcᵀ)/m` by `[m, mc, I about S]`, elements in the order of the
/// parameters.
fn about_com_slopes(phi: &[f64]) -> Option<[[f64; 10]; 6]> {
    let [m, x, y, z, ..] = *phi.first_chunk::<10>()?;
    let c = [x / m, y / m, z / m];
    let mut slopes = [[0.0; 10]; 6];
    for (element, (i, j)) in [(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)].into_iter().enumerate() {
        let slope = &mut slopes[element];
        slope[4 + element] = 1.0;
        if i == j {
            for k in (0..3).filter(|k| *k != i) {
                slope[0] += c[k] * c[k];
                slope[1 + k] = -2.0 * c[k];
            }
        } else {
            slope[0] = -c[i] * c[j];
            slope[1 + i] = c[j];
            slope[1 + j] = c[i];
        }
    }
    Some(slopes)
}

/// Returns the largest principal moment about the centre of mass, kg m², of `[m, mc, I about S]`; `None`
/// unless it is positive.
pub fn largest_principal(phi: &[f64]) -> Option<f64> {
    let [m, x, y, z, xx, yy, zz, yz, zx, xy] = *phi.first_chunk::<10>()?;
    let mc = Vector3::new(x, y, z);
    let about_s = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let steiner = (Matrix3::identity() * mc.norm_squared() - mc * mc.transpose()) / m;
    let inertia = about_s - steiner;
    if !inertia.iter().all(|v| v.is_finite()) || m <= 0.0 {
        return None;
    }
    let largest = SymmetricEigen::new(inertia).eigenvalues.max();
    (largest > 0.0).then_some(largest)
}
