//! The prior knowledge, as rows with a σ.
//!
//! `m = 20.013 ± 0.005` is one whitened row `m/σ = 20.013/σ` like any other. A centre of mass is
//! `mcx − cx m = 0 ± σ m`: linear in φ, its σ taken at the estimated mass. A tensor about the centre of mass
//! is `I − (|mc|² 1 − mc mcᵀ)/m`, linearised about the estimate and iterated. A plane of symmetry normal to y
//! through the origin of a link's frame makes `mcy`, `Iyz` and `Ixy` vanish; where the plane is out by σ at
//! the body's middle and, tilting, by σ at its radius of gyration ℓ, their σ are `σ m`, `σ m ℓ` and `σ m ℓ`.

mod error;
mod rows;
mod subject;

pub use self::error::KnownError;
use self::error::plain;
use self::rows::{absorb, two_sided};
use self::subject::Subject;
use super::{Estimate, Factor, Fit, Gaussian, Noise, Parameter, Prior, PriorStatement};

/// σ of a plane of symmetry's position where none is given, m.
pub const SYMMETRY_SIGMA_M: f64 = 1e-3;

/// A known value this improbable, two-sided, contradicts what is known already: 5 σ of the joint
/// uncertainty of a normal deviate, so one true statement in two million is refused.
const REFUSED_PROBABILITY: f64 = 5.733e-7;

/// One statement as it was made.
#[derive(Clone, Debug, PartialEq)]
struct Stated {
    /// `mass_kg`, `arm.com_x_m`, `arm.MSx`; of a plane its link, empty where none was named.
    name: String,
    /// The normal of a plane of symmetry: 0, 1, 2.
    plane: Option<usize>,
    value: f64,
    sigma: f64,
}

/// A statement about parameters of a model.
#[derive(Clone, Debug, PartialEq)]
struct Known {
    name: String,
    subject: Subject,
    value: f64,
    sigma: f64,
}

/// Values known beforehand: value and standard deviation each, SI.
///
/// ```
/// use rigident_fit::prior::{KnownError, KnownValues};
///
/// let known = KnownValues::parse(&["mass_kg=20.013±0.005".into()], &["y±0.001".into()])?;
/// assert!(!known.is_empty());
/// let refused = KnownValues::parse(&["mass_kg=20".into()], &[]);
/// assert!(matches!(refused, Err(KnownError::Form(_))));
/// # Ok::<(), KnownError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownValues {
    stated: Vec<Stated>,
}

impl KnownValues {
    /// Reads statements: `NAME=VALUE±SIGMA` each, and planes of symmetry `AXIS±SIGMA` or `LINK:AXIS±SIGMA`
    /// each. `+-` and `+/-` do for `±`.
    ///
    /// A name is that of a parameter, or `mass_kg`, `mcx_kgm`, `ixx_kgm2`, `com_x_m`, `ixx_com_kgm2` and so
    /// on of a body; of a link in a tree with its name before: `arm.com_x_m`.
    ///
    /// # Errors
    /// [`KnownError`] names the first that is of no such form.
    pub fn parse(known: &[String], symmetry: &[String]) -> Result<Self, KnownError> {
        let values = known.iter().map(|text| Stated::value(text));
        let planes = symmetry.iter().map(|text| Stated::plane(text));
        Ok(Self { stated: values.chain(planes).collect::<Result<_, _>>()? })
    }

    /// Returns true if nothing is stated.
    pub fn is_empty(&self) -> bool {
        self.stated.is_empty()
    }

    /// Checks that a model has what the statements are about, once each: to be asked before an experiment.
    ///
    /// # Errors
    /// [`KnownError`] names the first that cannot be used.
    pub fn check(&self, parameters: &[Parameter]) -> Result<(), KnownError> {
        self.resolve(parameters).map(|_| ())
    }

    /// Puts the statements into the estimate of a fit, whose factor stays that of the data alone. Each is
    /// judged against the data and those before it; their order does not matter. Intervals keep the coverage
    /// factor of the data's noise.
    ///
    /// # Errors
    /// [`KnownError`] if a statement cannot be used or contradicts the rest; the fit is then as it was.
    pub fn apply(&self, fit: &mut Fit) -> Result<(), KnownError> {
        if self.is_empty() {
            return Ok(());
        }
        let known = self.resolve(&fit.parameters)?;
        let data = fit.data_alone().clone();
        let mut factor = fit.scaled_factor();
        absorb(&mut factor, &known, Some(data.noise), fit.rounding)?;
        let estimate = Estimate::new(&factor, fit.rounding, 1.0, data.noise).beside(&[fit.rows()]);
        let statements = known.iter().map(|known| known.statement(&estimate)).collect();
        fit.prior = Some(Prior { statements, data_alone: Box::new(data) });
        fit.estimate = estimate;
        Ok(())
    }

    /// Puts the statements into rows whose first columns are those of the parameters, whitened by their true
    /// σ; errors of a rig may follow. They are judged beside the noise of the rows, where it is given: rows
    /// about values far from the estimate say nothing of a contradiction.
    ///
    /// # Errors
    /// As [`KnownValues::apply`]; the rows are then as they were.
    pub fn absorbed_by(
        &self,
        rows: &mut Factor,
        parameters: &[Parameter],
        noise: Option<Noise>,
        rounding: f64,
    ) -> Result<(), KnownError> {
        absorb(rows, &self.resolve(parameters)?, noise, rounding)
    }

    /// Finds the parameters that the statements are about.
    fn resolve(&self, parameters: &[Parameter]) -> Result<Vec<Known>, KnownError> {
        let mut all: Vec<Known> = Vec::new();
        for stated in &self.stated {
            let known = stated.resolve(parameters)?;
            if let Some(other) = all.iter().find(|k| k.subject == known.subject) {
                let deviation = (other.value - known.value).abs() / other.sigma.hypot(known.sigma);
                let (name, first, second) = (known.name, other.value, known.value);
                return Err(if two_sided(deviation, Noise::Given) < REFUSED_PROBABILITY {
                    KnownError::Disagree { name, first, second, deviation }
                } else {
                    KnownError::Repeated { name }
                });
            }
            all.push(known);
        }
        Ok(all)
    }
}

/// Puts a normal distribution of parameters into the estimate of a fit, whose factor stays that of the data
/// alone: what it says of names that the fit does not have counts for nothing.
pub fn apply_distribution(fit: &mut Fit, known: &Gaussian) {
    let place = |name: &str| fit.parameters.iter().position(|p| p.name == name);
    let known = known.only(|name| place(name).is_some());
    let at: Vec<usize> = known.names().iter().filter_map(|name| place(name)).collect();
    let rows = known.rows(fit.parameters.len(), &at);
    let data = fit.data_alone().clone();
    let mut factor = fit.scaled_factor();
    factor.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
    fit.estimate = Estimate::new(&factor, fit.rounding, 1.0, data.noise);
    fit.prior = Some(Prior { statements: Vec::new(), data_alone: Box::new(data) });
}

impl Stated {
    /// Reads one `NAME=VALUE±SIGMA`.
    fn value(text: &str) -> Result<Self, KnownError> {
        let form = || KnownError::Form(text.to_owned());
        let (name, numbers) = text.split_once('=').ok_or_else(form)?;
        let name = Some(name.trim()).filter(|name| !name.is_empty()).ok_or_else(form)?;
        let (value, sigma) = uncertain(numbers).ok_or_else(form)?;
        let value: f64 = value.parse().map_err(|_| form())?;
        let stated =
            Self { name: name.to_owned(), plane: None, value, sigma: sigma.parse().map_err(|_| form())? };
        if !value.is_finite() {
            return Err(KnownError::Value { name: stated.name, value });
        }
        stated.checked()
    }

    /// Reads one `AXIS` or `AXIS±SIGMA`, with or without `LINK:` before it.
    fn plane(text: &str) -> Result<Self, KnownError> {
        let form = || KnownError::SymmetryForm(text.to_owned());
        let (link, plane) = text.rsplit_once(':').unwrap_or(("", text));
        let (axis, sigma) = match uncertain(plane) {
            Some((axis, sigma)) => (axis, sigma.parse().map_err(|_| form())?),
            None => (plane.trim(), SYMMETRY_SIGMA_M),
        };
        let axis = ["x", "y", "z"].iter().position(|a| *a == axis).ok_or_else(form)?;
        Self { name: link.trim().to_owned(), plane: Some(axis), value: 0.0, sigma }.checked()
    }

    fn checked(self) -> Result<Self, KnownError> {
        if self.sigma > 0.0 && self.sigma.is_finite() {
            Ok(self)
        } else {
            Err(KnownError::Sigma { name: self.label(), sigma: self.sigma })
        }
    }

    /// The name that messages use.
    fn label(&self) -> String {
        let Some(axis) = self.plane.and_then(|k| ["x", "y", "z"].get(k)) else { return self.name.clone() };
        if self.name.is_empty() {
            format!("symmetry {axis}")
        } else {
            format!("symmetry {}:{axis}", self.name)
        }
    }

    fn resolve(&self, parameters: &[Parameter]) -> Result<Known, KnownError> {
        let name = self.label();
        let subject = match self.plane {
            Some(axis) => Subject::plane(&name, &self.name, axis, parameters)?,
            None => Subject::named(&self.name, parameters)?,
        };
        if subject.is_positive(parameters) && self.value <= 0.0 {
            return Err(KnownError::Value { name, value: self.value });
        }
        Ok(Known { name, subject, value: self.value, sigma: self.sigma })
    }
}

impl Known {
    /// The statement as a fit keeps it.
    fn statement(&self, estimate: &Estimate) -> PriorStatement {
        let text = match &self.subject {
            Subject::Symmetry { .. } => {
                format!("{} through the frame's origin ± {} m (1 σ)", self.name, plain(self.sigma))
            }
            _ => format!("{} = {} ± {} (1 σ)", self.name, plain(self.value), plain(self.sigma)),
        };
        PriorStatement {
            name: self.name.clone(),
            parameter: self.subject.first(),
            value: self.value,
            sigma: self.sigma,
            is_symmetry: matches!(self.subject, Subject::Symmetry { .. }),
            free: self.subject.left_free(estimate),
            text,
        }
    }
}

/// The two sides of `±`, trimmed.
fn uncertain(text: &str) -> Option<(&str, &str)> {
    ["±", "+/-", "+-"].iter().find_map(|sign| text.split_once(sign)).map(|(a, b)| (a.trim(), b.trim()))
}

#[cfg(test)]
mod tests;
