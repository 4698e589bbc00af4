//! What is known beforehand, as rows with a σ.
//!
//! Lives here: the words in which a person states a known quantity ([`Known::parse`]), and their rows
//! ([`absorb`]). May not live here: what becomes identified by them; that is in [`crate::answer`].
//!
//! `m = 20.013 ± 0.005` is one whitened row `m/σ = 20.013/σ` like any other. A centre of mass is
//! `mcx − cx m = 0 ± σ m`: linear in φ, its σ taken at the estimated mass. A tensor about the centre of mass is
//! `I − (|mc|² 1 − mc mcᵀ)/m`, linearised about the estimate and iterated. A plane of symmetry normal to S.y
//! through S's origin makes `mcy`, `Iyz` and `Ixy` vanish; where the plane is out by σ at the body's middle
//! and, tilting, by σ at its radius of gyration ℓ, their σ are `σ m`, `σ m ℓ` and `σ m ℓ`.

use std::fmt;

use rigident_shared::factor::InformationFactor;
use rigident_shared::inertia::PARAMETER_NAMES;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::Factor;
use crate::answer::{Estimate, Noise};
use crate::report::text::{significant, with_u95};

/// σ of a plane of symmetry's position where none is given, m.
pub const SYMMETRY_SIGMA_M: f64 = 1e-3;

/// A known quantity this improbable, two-sided, contradicts what is known already: 5 σ of the joint
/// uncertainty of a normal deviate, so one true statement in two million is refused.
const REFUSED_PROBABILITY: f64 = 5.733e-7;

/// The linearisation is renewed so often; the change is quadratic, and of second order in σ/m to begin with.
const ROUNDS: usize = 4;

/// A row `a φ = y ± σ` rounds the others by about `ε |a φ| / σ` of their standard deviations, as all share one
/// triangle: σ is at least so many times `ε |a| (|φ| + sd)`, which leaves 1e-4 of a standard deviation.
const LEAST_SIGMA_OVER_ROUNDING: f64 = 1e4;

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

/// Why known quantities are refused. Nothing was absorbed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnownError {
    /// Not of the form `NAME=VALUE±SIGMA`.
    #[error(
        "--known {0}: write NAME=VALUE±SIGMA with a standard uncertainty (1 σ), for example --known mass_kg=20.013±0.005; `+-` and `+/-` do as well"
    )]
    Form(String),
    /// Not of the form `AXIS` or `AXIS±SIGMA`.
    #[error(
        "--symmetry {0}: write the normal of the plane, x, y or z of S, and how far out it may be, 1 σ in m: y±0.002"
    )]
    SymmetryForm(String),
    /// No such quantity.
    #[error("--known {name}: no such quantity; there are {}", all_names())]
    Name {
        /// What was given.
        name: String,
    },
    /// A weighted row needs a positive σ.
    #[error(
        "{name}: a standard uncertainty of {sigma} is impossible; state how well it is known, however well, as a positive number"
    )]
    Sigma {
        /// The quantity.
        name: String,
        /// What was given.
        sigma: f64,
    },
    /// Rounding would spoil what else is known.
    #[error(
        "{name}: a standard uncertainty of {sigma:e} is below what double precision can hold beside the data; the smallest usable is {least:.1e}, and nothing is known that well: state that or a larger one"
    )]
    TooTight {
        /// The quantity.
        name: String,
        /// What was given.
        sigma: f64,
        /// The smallest usable, rounded up.
        least: f64,
    },
    /// The value is not finite, or a mass or a moment is not positive.
    #[error("{name}: no body has {}", plain(*.value))]
    Value {
        /// The quantity.
        name: String,
        /// What was given.
        value: f64,
    },
    /// Stated twice, and the two agree.
    #[error(
        "{name} is stated twice; if these are two measurements of it, combine them into one value and its σ"
    )]
    Repeated {
        /// The quantity.
        name: String,
    },
    /// Stated twice, and the two disagree.
    #[error(
        "{name} is stated twice, as {} and as {}: {} σ apart; keep the one that is true", plain(*.first), plain(*.second), significant(*.deviation, 4)
    )]
    Disagree {
        /// The quantity.
        name: String,
        /// One value.
        first: f64,
        /// The other.
        second: f64,
        /// Their distance over their joint σ.
        deviation: f64,
    },
    /// The rig file fixes the offset.
    #[error(
        "{name} cannot be used: the wrench offset is not estimated here (offset_n_nm in the rig file fixes it); remove one of the two"
    )]
    NoOffset {
        /// The quantity.
        name: String,
    },
    /// A centre of mass needs a mass, a central tensor a centre of mass.
    #[error(
        "{name} cannot be used: {needs} is known neither from the data nor from --known; state it as well"
    )]
    Needs {
        /// The quantity.
        name: String,
        /// What is missing.
        needs: &'static str,
    },
    /// The data, or the other known quantities, say otherwise.
    #[error(
        "{name} = {} ± {} contradicts the data and what else is known: they give {} (1 σ), {} σ away; check its unit and frame, the sensors' scales, or state a larger σ",
        plain(*.value), plain(*.sigma), with_u95(*.found, *.found_sigma, ""), significant(*.deviation, 4)
    )]
    Contradiction {
        /// The quantity.
        name: String,
        /// What was stated.
        value: f64,
        /// Its σ.
        sigma: f64,
        /// What the rest says.
        found: f64,
        /// Its σ.
        found_sigma: f64,
        /// Distance over the joint σ.
        deviation: f64,
    },
}

/// All its digits, with an exponent where there would be too many of them.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-6..1e7).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

fn all_names() -> String {
    [&PARAMETERS[..], &CENTRE, &CENTRAL].concat().join(", ")
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

    /// Its rows `(a, y, σ)` at φ; fewer where a plane of symmetry has no scale yet.
    fn rows<const N: usize>(&self, at: &Point<N>) -> Result<Vec<Row<N>>, KnownError> {
        let Self { subject, value, sigma } = *self;
        let needs = |needs| KnownError::Needs { name: self.name(), needs };
        let unit = |j: usize, y: f64, sigma: f64| {
            let mut a = [0.0; N];
            if let Some(entry) = a.get_mut(j) {
                *entry = 1.0;
            }
            Row { a, y, sigma }
        };
        let mass =
            || if at.determined[0] && at.phi[0] > 0.0 { Ok(at.phi[0]) } else { Err(needs("the mass")) };
        match subject {
            Subject::Parameter(j) if j >= N => Err(KnownError::NoOffset { name: self.name() }),
            Subject::Parameter(j) => Ok(vec![unit(j, value, sigma)]),
            Subject::Centre(k) => {
                let mut row = unit(1 + k, 0.0, sigma * mass()?);
                row.a[0] = -value;
                Ok(vec![row])
            }
            Subject::Central(k) => {
                let m = mass()?;
                if !(1..4).all(|j| at.determined[j]) {
                    return Err(needs("the centre of mass"));
                }
                let mc = [at.phi[1], at.phi[2], at.phi[3]];
                let [i, j] = ELEMENT[k];
                let diagonal = f64::from(u8::from(i == j));
                let square = diagonal * mc.iter().map(|v| v * v).sum::<f64>() - mc[i] * mc[j];
                let mut row = unit(4 + k, 0.0, sigma);
                row.a[0] = square / (m * m);
                for (n, v) in mc.iter().enumerate() {
                    let mut slope = 2.0 * diagonal * v;
                    slope -= if n == i { mc[j] } else { 0.0 };
                    slope -= if n == j { mc[i] } else { 0.0 };
                    row.a[1 + n] = -slope / m;
                }
                // f is homogeneous of degree one in φ, so J φ = f(φ) and the row needs no constant.
                row.y = value;
                Ok(vec![row])
            }
            Subject::Symmetry(k) => {
                let m = mass()?;
                let mut rows = vec![unit(1 + k, 0.0, sigma * m)];
                // Without a tensor there is no size, and a product of inertia no scale of its uncertainty.
                let moment =
                    |j: usize| at.determined[j].then(|| [at.phi[j], at.covariance[j][j].max(0.0).sqrt()]);
                if let Some(trace) = trace([4, 5, 6].map(moment)) {
                    let gyration = (trace / (2.0 * m)).sqrt();
                    for (e, [i, j]) in ELEMENT.iter().enumerate().skip(3) {
                        if *i == k || *j == k {
                            rows.push(unit(4 + e, 0.0, sigma * m * gyration));
                        }
                    }
                }
                Ok(rows)
            }
        }
    }
}

/// Sum of the three moments, each with its σ; `None` if it may be anything down to nothing.
fn trace(moments: [Option<[f64; 2]>; 3]) -> Option<f64> {
    let (mut sum, mut sigma) = (0.0, 0.0);
    for moment in moments {
        let [value, sd] = moment?;
        sum += value;
        sigma += sd;
    }
    (sum > 2.0 * sigma).then_some(sum)
}

/// The two sides of `±`, trimmed.
fn uncertain(text: &str) -> Option<(&str, &str)> {
    ["±", "+/-", "+-"].iter().find_map(|sign| text.split_once(sign)).map(|(a, b)| (a.trim(), b.trim()))
}

/// `a φ = y ± σ`.
struct Row<const N: usize> {
    a: [f64; N],
    y: f64,
    sigma: f64,
}

/// What a factor says of φ.
struct Point<const N: usize> {
    phi: [f64; N],
    determined: [bool; N],
    covariance: [[f64; N]; N],
}

impl<const N: usize> Point<N> {
    fn of(factor: &InformationFactor<f64, N>) -> Self {
        let solution = factor.solve();
        Self { phi: solution.estimate, determined: solution.determined, covariance: factor.covariance() }
    }

    /// What is rounded where the row is absorbed: `Σ |a_j| (|φ_j| + sd_j)` over what is determined, or y if that is
    /// larger.
    fn size(&self, row: &Row<N>) -> f64 {
        let mut size = 0.0;
        for (j, a) in row.a.iter().enumerate().filter(|(j, _)| self.determined[*j]) {
            size += a.abs() * (self.phi[j].abs() + self.covariance[j][j].max(0.0).sqrt());
        }
        size.max(row.y.abs())
    }

    /// `aᵀφ` and its standard deviation; `None` if it depends on what is not determined.
    fn along(&self, a: &[f64; N]) -> Option<(f64, f64)> {
        if a.iter().zip(&self.determined).any(|(a, determined)| *a != 0.0 && !determined) {
            return None;
        }
        let (mut value, mut variance) = (0.0, 0.0);
        for i in 0..N {
            value += a[i] * self.phi[i];
            for j in 0..N {
                variance += a[i] * a[j] * self.covariance[i][j];
            }
        }
        Some((value, variance.max(0.0).sqrt()))
    }
}

/// Probability of so many σ or more on either side.
fn two_sided(deviation: f64, noise: Noise) -> f64 {
    let normal = || Normal::standard().sf(deviation);
    2.0 * match noise {
        Noise::Given => normal(),
        Noise::Estimated { degrees_of_freedom } => StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0))
            .map_or_else(|_| normal(), |t| t.sf(deviation)),
    }
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

/// Absorbs known quantities into a factor whose rows are whitened by their true σ.
///
/// The order of statements does not matter to the answer: those on parameters come first, then centres of
/// mass and planes, then central tensors; each is judged against the data and those before it.
///
/// # Errors
/// [`KnownError`]; the factor is then as it was.
pub fn absorb<const N: usize>(
    factor: &mut InformationFactor<f64, N>,
    known: &[Known],
    noise: Noise,
) -> Result<(), KnownError> {
    let mut ordered: Vec<&Known> = known.iter().collect();
    ordered.sort_by_key(|k| match k.subject {
        Subject::Parameter(_) => 0,
        Subject::Centre(_) => 1,
        Subject::Symmetry(_) => 2,
        Subject::Central(_) => 3,
    });
    let mut joint = *factor;
    let mut at: Option<Point<N>> = None;
    for _ in 0..ROUNDS {
        joint = *factor;
        for statement in &ordered {
            let so_far = Point::of(&joint);
            for row in statement.rows(at.as_ref().unwrap_or(&so_far))? {
                let least = LEAST_SIGMA_OVER_ROUNDING * f64::EPSILON * so_far.size(&row);
                if row.sigma < least {
                    // One digit more than is told, rounded up.
                    let least = 1.05 * least * statement.sigma / row.sigma;
                    return Err(KnownError::TooTight {
                        name: statement.name(),
                        sigma: statement.sigma,
                        least,
                    });
                }
                if let Some((found, found_sigma)) = so_far.along(&row.a) {
                    let deviation = (row.y - found).abs() / row.sigma.hypot(found_sigma);
                    if two_sided(deviation, noise) < REFUSED_PROBABILITY {
                        return Err(contradiction(statement, &row, found, found_sigma, deviation));
                    }
                }
                let columns = row.a.map(|a| [a / row.sigma]);
                joint.absorb::<1>(&columns, &[row.y / row.sigma]);
            }
        }
        at = Some(Point::of(&joint));
    }
    *factor = joint;
    Ok(())
}

/// In the statement's own unit: `mcx − cx m` is told as a centre of mass.
fn contradiction<const N: usize>(
    known: &Known,
    row: &Row<N>,
    found: f64,
    found_sigma: f64,
    deviation: f64,
) -> KnownError {
    let scale = known.sigma / row.sigma;
    KnownError::Contradiction {
        name: known.name(),
        value: known.value,
        sigma: known.sigma,
        found: known.value + (found - row.y) * scale,
        found_sigma: found_sigma * scale,
        deviation,
    }
}

/// [`absorb`] for either model.
///
/// # Errors
/// [`KnownError`]; the factor is then as it was.
pub fn absorb_into(factor: &mut Factor, known: &[Known], noise: Noise) -> Result<(), KnownError> {
    match factor {
        Factor::Ten(f) => absorb(f, known, noise),
        Factor::Sixteen(f) => absorb(f, known, noise),
    }
}

#[cfg(test)]
#[path = "known_tests.rs"]
mod tests;
