//! What is known beforehand, as rows with a σ.
//!
//! Lives here: the words in which a person states a known quantity ([`Known::parse`]), their rows ([`absorb`]), and why
//! they are refused ([`KnownError`]). May not live here: what becomes identified by them; that is in [`crate::answer`].
//!
//! `m = 20.013 ± 0.005` is one whitened row `m/σ = 20.013/σ` like any other. A centre of mass is
//! `mcx − cx m = 0 ± σ m`: linear in φ, its σ taken at the estimated mass. A tensor about the centre of mass is
//! `I − (|mc|² 1 − mc mcᵀ)/m`, linearised about the estimate and iterated. A plane of symmetry normal to S.y
//! through S's origin makes `mcy`, `Iyz` and `Ixy` vanish; where the plane is out by σ at the body's middle
//! and, tilting, by σ at its radius of gyration ℓ, their σ are `σ m`, `σ m ℓ` and `σ m ℓ`.

mod error;
mod rows;

use std::fmt;

use rigident_shared::inertia::PARAMETER_NAMES;

pub use self::error::KnownError;
use self::error::plain;
pub use self::rows::{absorb, absorb_into};
use self::rows::{trace, two_sided};
use crate::answer::{Estimate, Noise};

/// σ of a plane of symmetry's position where none is given, m.
pub const SYMMETRY_SIGMA_M: f64 = 1e-3;

/// A known quantity this improbable, two-sided, contradicts what is known already: 5 σ of the joint
/// uncertainty of a normal deviate, so one true statement in two million is refused.
const REFUSED_PROBABILITY: f64 = 5.733e-7;

const PARAMETERS: [&str; 16] = [
    "mass_kg",
    "mcx_kgm",
    "mcy_kgm",
    "mcz_kgm",
    "ixx_kgm2",
    "iyy_kgm2",
    "izz_kgm2",
    "iyz_kgm2",
    "izx_kgm2",
    "ixy_kgm2",
    "offset_fx_n",
    "offset_fy_n",
    "offset_fz_n",
    "offset_mx_nm",
    "offset_my_nm",
    "offset_mz_nm",
];
const CENTRE: [&str; 3] = ["com_x_m", "com_y_m", "com_z_m"];
const CENTRAL: [&str; 6] =
    ["ixx_com_kgm2", "iyy_com_kgm2", "izz_com_kgm2", "iyz_com_kgm2", "izx_com_kgm2", "ixy_com_kgm2"];
/// Axes of each tensor element in the order of the parameters.
const ELEMENT: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [1, 2], [2, 0], [0, 1]];

/// What a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Subject {
    /// A parameter in S, by its place.
    Parameter(usize),
    /// A coordinate of the centre of mass in S.
    Centre(usize),
    /// An element of the tensor about the centre of mass, axes of S.
    Central(usize),
    /// A plane of symmetry through S's origin, by its normal.
    Symmetry(usize),
}

/// A known quantity: value and standard uncertainty (1 σ), SI, in S.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    subject: Subject,
    value: f64,
    sigma: f64,
}

impl fmt::Display for Known {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.subject {
            Subject::Symmetry(_) => {
                write!(f, "{} through the origin of S ± {} m (1 σ)", self.name(), plain(self.sigma))
            }
            _ => write!(f, "{} = {} ± {} (1 σ)", self.name(), plain(self.value), plain(self.sigma)),
        }
    }
}

impl Known {
    /// All that was stated: `NAME=VALUE±SIGMA` each, and planes of symmetry `AXIS±SIGMA` each.
    ///
    /// # Errors
    /// [`KnownError`] names the first that cannot be used, or is stated twice.
    pub fn parse_all(known: &[String], symmetry: &[String]) -> Result<Vec<Self>, KnownError> {
        let mut all: Vec<Self> = Vec::new();
        for stated in known.iter().map(|k| Self::parse(k)).chain(symmetry.iter().map(|s| Self::plane(s))) {
            let stated = stated?;
            if let Some(other) = all.iter().find(|k| k.subject == stated.subject) {
                let deviation = (other.value - stated.value).abs() / other.sigma.hypot(stated.sigma);
                let (name, first, second) = (stated.name(), other.value, stated.value);
                return Err(if two_sided(deviation, Noise::Given) < REFUSED_PROBABILITY {
                    KnownError::Disagree { name, first, second, deviation }
                } else {
                    KnownError::Repeated { name }
                });
            }
            all.push(stated);
        }
        Ok(all)
    }

    /// One `NAME=VALUE±SIGMA`.
    ///
    /// # Errors
    /// [`KnownError`] if it is not that, or cannot be.
    pub fn parse(text: &str) -> Result<Self, KnownError> {
        let form = || KnownError::Form(text.to_owned());
        let (name, numbers) = text.split_once('=').ok_or_else(form)?;
        let place = |names: &[&str]| names.iter().position(|n| *n == name.trim());
        let subject = place(&PARAMETERS)
            .map(Subject::Parameter)
            .or_else(|| place(&CENTRE).map(Subject::Centre))
            .or_else(|| place(&CENTRAL).map(Subject::Central))
            .ok_or_else(|| KnownError::Name { name: name.trim().to_owned() })?;
        let (value, sigma) = uncertain(numbers).ok_or_else(form)?;
        let known = Self {
            subject,
            value: value.parse().map_err(|_| form())?,
            sigma: sigma.parse().map_err(|_| form())?,
        };
        let positive = matches!(subject, Subject::Parameter(0 | 4..=6) | Subject::Central(0..=2));
        if !known.value.is_finite() || (positive && known.value <= 0.0) {
            return Err(KnownError::Value { name: known.name(), value: known.value });
        }
        known.checked()
    }

    /// One `AXIS` or `AXIS±SIGMA`.
    fn plane(text: &str) -> Result<Self, KnownError> {
        let form = || KnownError::SymmetryForm(text.to_owned());
        let (axis, sigma) = match uncertain(text) {
            Some((axis, sigma)) => (axis, sigma.parse().map_err(|_| form())?),
            None => (text.trim(), SYMMETRY_SIGMA_M),
        };
        let axis = ["x", "y", "z"].iter().position(|a| *a == axis).ok_or_else(form)?;
        Self { subject: Subject::Symmetry(axis), value: 0.0, sigma }.checked()
    }

    fn checked(self) -> Result<Self, KnownError> {
        if self.sigma > 0.0 && self.sigma.is_finite() {
            Ok(self)
        } else {
            Err(KnownError::Sigma { name: self.name(), sigma: self.sigma })
        }
    }

    /// What it is about.
    pub fn name(&self) -> String {
        match self.subject {
            Subject::Parameter(j) => PARAMETERS[j].to_owned(),
            Subject::Centre(k) => CENTRE[k].to_owned(),
            Subject::Central(k) => CENTRAL[k].to_owned(),
            Subject::Symmetry(k) => format!("symmetry {}", ["x", "y", "z"][k]),
        }
    }

    /// Whether it is a plane of symmetry.
    pub(crate) fn is_symmetry(&self) -> bool {
        matches!(self.subject, Subject::Symmetry(_))
    }

    /// The parameter that it is first about.
    pub(crate) fn parameter(&self) -> usize {
        match self.subject {
            Subject::Parameter(j) => j,
            Subject::Centre(k) | Subject::Symmetry(k) => 1 + k,
            Subject::Central(k) => 4 + k,
        }
    }

    /// The stated value; zero, in m, for a plane of symmetry.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Its standard uncertainty, 1 σ; m for a plane of symmetry.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// What it did not say, with the estimate made with it: a plane of symmetry where the body has no size.
    pub fn warning(&self, estimate: &Estimate) -> Option<String> {
        let Subject::Symmetry(k) = self.subject else { return None };
        let moment = |j: usize| estimate.measured(j).map(|m| [m.value, m.u95 / estimate.coverage_factor]);
        if trace([4, 5, 6].map(moment)).is_some() {
            return None;
        }
        let crossing = ELEMENT.iter().zip(&PARAMETER_NAMES[4..]).skip(3).filter(|(e, _)| e.contains(&k));
        let names: Vec<&str> = crossing.map(|(_, name)| *name).collect();
        Some(format!(
            "{}: {} stay free: how far from zero they may be grows with the body's size, which is not known without \
             Ixx, Iyy and Izz; turn the body about all three axes, or state ixx_kgm2, iyy_kgm2 and izz_kgm2 with --known",
            self.name(),
            names.join(" and "),
        ))
    }
}

/// The two sides of `±`, trimmed.
fn uncertain(text: &str) -> Option<(&str, &str)> {
    ["±", "+/-", "+-"].iter().find_map(|sign| text.split_once(sign)).map(|(a, b)| (a.trim(), b.trim()))
}

/// Whether the model has what the known quantities are about: to be asked before an experiment.
///
/// # Errors
/// [`KnownError::NoOffset`].
pub fn check_model(known: &[Known], offset_estimated: bool) -> Result<(), KnownError> {
    let offset = |k: &&Known| matches!(k.subject, Subject::Parameter(10..));
    match known.iter().find(offset) {
        Some(known) if !offset_estimated => Err(KnownError::NoOffset { name: known.name() }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
