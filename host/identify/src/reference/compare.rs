//! The measured values against a reference: the E_n number of each quantity, and whether it is the body at
//! all.

use nalgebra::{DMatrix, DVector, SVector};
use rigident_shared::inertia::{InertialParameters, tensor_elements};
use rigident_shared::spatial::Sensor;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::body::Mounted;
use super::cause;
use super::quantity::Quantity;
use crate::answer::result::UnusableFit;
use crate::answer::{Answer, derived};
use rigident_fit::figures::with_u95;
use rigident_fit::{COVERAGE_95, Fit};

/// A body less likely than this to be the one of the reference is another one.
pub(super) const OTHER_BODY: f64 = 1e-5;
/// Share of the recordings of the reference itself in which some quantity may be beyond its bound.
const FALSE_ALARM: f64 = 0.01;
/// Quantities that are compared.
const COUNT: usize = 10;
const NAMES: [&str; COUNT] =
    ["m", "com_x", "com_y", "com_z", "Ixx_com", "Iyy_com", "Izz_com", "Iyz_com", "Izx_com", "Ixy_com"];

/// What was measured against the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// Each quantity.
    pub quantities: Vec<Quantity>,
    /// Bound on the largest |E_n|: with body and rig as stated it is beyond with a probability of 1 % at
    /// most.
    pub e_n_limit: f64,
    /// Disagreement of the ten parameters as far as they are determined.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: f64,
    /// Probability of as much for the body of the reference.
    pub probability: f64,
}

/// The body is not that of the reference.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mismatch {
    /// A quantity is further off than the largest of all may be.
    #[error(
        "the body is not the reference: {measured}, and {reference} in the reference: E_n {e_n:.2}, and the \
         largest of {count} quantities is at most {limit:.2}{also}; likely cause: {cause}"
    )]
    Quantity {
        /// The one that the others follow from, with its value: `m is 3.32 ± 0.03 kg`.
        measured: String,
        /// The reference's value.
        reference: String,
        /// Its E_n.
        e_n: f64,
        /// The bound.
        limit: f64,
        /// Quantities compared.
        count: usize,
        /// The others that are beyond the bound.
        also: String,
        /// What makes such a difference.
        cause: String,
    },
    /// The ten parameters between them.
    #[error(
        "the body is not the reference: χ² of its ten parameters is {chi2:.0} for {degrees_of_freedom:.0} \
         degrees of freedom; look for the wrong file, another mounting, a fixture that is not taken off, or \
         an error of the rig that the rig file does not allow for"
    )]
    All {
        /// Disagreement.
        chi2: f64,
        /// Its degrees of freedom.
        degrees_of_freedom: f64,
    },
}

/// Returns the bound on |E_n| of each of `count` quantities: with body and rig as stated, one of them is
/// beyond in one of a hundred recordings at most (Bonferroni, whatever their correlations). It is 1.68 for
/// ten. ISO/IEC 17043's bound of 1 is that of a single quantity, which one of twenty exceeds.
fn limit(count: usize) -> f64 {
    let tail = 0.5 * FALSE_ALARM / count.max(1) as f64;
    Normal::standard().inverse_cdf(1.0 - tail) / COVERAGE_95
}

impl Comparison {
    /// Compares an answer and its fit with the reference as it was mounted.
    pub fn new(fit: &Fit, answer: &Answer, reference: &Mounted) -> Self {
        let expected = quantities(&reference.parameters);
        let slopes = slopes(&reference.parameters);
        let known = &slopes * reference.covariance() * slopes.transpose();
        let measured = measured(fit, answer);
        let e_n_limit = limit(measured.iter().flatten().count());
        let quantities = NAMES.iter().zip(measured).enumerate().map(|(k, (name, measured))| {
            let reference_u95 = COVERAGE_95 * known[(k, k)].max(0.0).sqrt();
            let e_n = measured.map(|[value, u95]| (value - expected[k]) / u95.hypot(reference_u95));
            Quantity {
                name: (*name).to_owned(),
                unit: match k {
                    0 => "kg",
                    1..4 => "m",
                    _ => "kg m2",
                }
                .to_owned(),
                value: measured.map(|m| m[0]),
                u95: measured.map(|m| m[1]),
                reference: expected[k],
                reference_u95,
                e_n,
                passed: e_n.is_some_and(|e_n| e_n.abs() <= 1.0),
            }
        });
        let (chi2, degrees_of_freedom) = disagreement(fit, reference);
        let probability = match degrees_of_freedom {
            0.0 => 1.0,
            dof => ChiSquared::new(dof).map_or(0.0, |d| d.sf(chi2)),
        };
        Self { quantities: quantities.collect(), e_n_limit, chi2, degrees_of_freedom, probability }
    }

    /// Returns the mismatch if the body is hardly that of the reference: by one quantity, or by all of them
    /// together. χ² alone is no test of one of ten, in which it drowns.
    pub fn mismatch(&self) -> Option<Mismatch> {
        let Self { chi2, degrees_of_freedom, .. } = *self;
        let of_all = (self.probability < OTHER_BODY).then_some(Mismatch::All { chi2, degrees_of_freedom });
        self.beyond().or(of_all)
    }

    /// Returns the quantity beyond the bound that the others follow from, with the others that are.
    fn beyond(&self) -> Option<Mismatch> {
        let mut beyond: Vec<(&Quantity, f64)> = self
            .quantities
            .iter()
            .filter_map(|quantity| quantity.e_n.map(|e_n| (quantity, e_n)))
            .filter(|(_, e_n)| e_n.abs() > self.e_n_limit)
            .collect();
        // A wrong mass moves the tensor of a drawing with it, a wrong place nothing else: mass, centre,
        // tensor.
        let part = |name: &str| (name != "m", name.ends_with("_com"));
        beyond.sort_by(|a, b| part(&a.0.name).cmp(&part(&b.0.name)).then(b.1.abs().total_cmp(&a.1.abs())));
        let ((most, e_n), others) = beyond.split_first()?;
        let measured = with_u95(most.value?, most.u95?, &most.unit);
        let names: Vec<String> =
            others.iter().map(|(quantity, e_n)| format!("{} {e_n:.2}", quantity.name)).collect();
        Some(Mismatch::Quantity {
            measured: format!("{} is {measured}", most.name),
            reference: with_u95(most.reference, most.reference_u95, &most.unit),
            e_n: *e_n,
            limit: self.e_n_limit,
            count: self.quantities.iter().filter(|quantity| quantity.e_n.is_some()).count(),
            also: if names.is_empty() {
                String::new()
            } else {
                format!(" (E_n of {} too)", names.join(", "))
            },
            cause: cause::of(&self.quantities, self.e_n_limit),
        })
    }

    /// Returns true if every quantity is identified, and the body is that of the reference.
    pub fn passed(&self) -> bool {
        self.mismatch().is_none() && self.quantities.iter().all(|quantity| quantity.e_n.is_some())
    }
}

/// Returns χ² and degrees of freedom of the parameters that a fit determines against the reference, both
/// uncertainties counted.
fn disagreement(fit: &Fit, reference: &Mounted) -> (f64, f64) {
    let estimate = &fit.estimate;
    let known = reference.covariance();
    let at: Vec<usize> = (0..10).filter(|j| estimate.is_determined(*j)).collect();
    let off = DVector::from_fn(at.len(), |k, _| {
        estimate.unjudged().values.get(at[k]).copied().unwrap_or(0.0) - reference.parameters[at[k]]
    });
    let both = DMatrix::from_fn(at.len(), at.len(), |i, j| {
        estimate.unjudged().covariance[(at[i], at[j])] + known[(at[i], at[j])]
    });
    let sd = both.diagonal().map(f64::sqrt);
    let scaled = DMatrix::from_fn(at.len(), at.len(), |i, j| both[(i, j)] / (sd[i] * sd[j]));
    let Some(cholesky) = scaled.cholesky() else { return (f64::INFINITY, at.len() as f64) };
    let off = off.component_div(&sd);
    (off.dot(&cholesky.solve(&off)), at.len() as f64)
}

/// Returns mass, centre of mass and the tensor about it.
fn quantities(phi: &[f64; 10]) -> [f64; COUNT] {
    let body = InertialParameters::<Sensor, f64>::from_vector(*phi);
    let ([x, y, z], [xx, yy, zz, yz, zx, xy]) =
        (body.centre_of_mass().array(), tensor_elements(&body.inertia_com()));
    [phi[0], x, y, z, xx, yy, zz, yz, zx, xy]
}

/// Returns value and U95 of each quantity that a fit determines, though it must not be used.
fn fitted(fit: &Fit, unusable: &UnusableFit) -> [Option<[f64; 2]>; COUNT] {
    let has = |j: usize| {
        let name = fit.parameters.get(j).map(|p| p.name.as_str());
        unusable.parameters.iter().any(|p| Some(p.name.as_str()) == name)
    };
    let mass = unusable.parameters.first().filter(|_| has(0)).map(|m| [m.value, m.u95]);
    let of_com = |com: derived::Derived<3>| (com.value, com.u95());
    let com = (0..4).all(has).then(|| of_com(derived::centre_of_mass(&fit.estimate)));
    let of_tensor = |tensor: derived::Derived<6>| (tensor.value, tensor.u95());
    let tensor = (0..10).all(has).then(|| of_tensor(derived::inertia_com(&fit.estimate)));
    std::array::from_fn(|k| match k {
        0 => mass,
        1..4 => com.map(|(value, u95)| [value[k - 1], u95[k - 1]]),
        _ => tensor.map(|(value, u95)| [value[k - 4], u95[k - 4]]),
    })
}

/// Returns the derivatives of the quantities by the parameters, by central differences.
fn slopes(phi: &[f64; 10]) -> DMatrix<f64> {
    let mut slopes = DMatrix::zeros(COUNT, 10);
    let size = [phi[0], phi[0] * 0.1, phi[0] * 0.01];
    for j in 0..10 {
        let step = 1e-4 * size[usize::from(j > 0) + usize::from(j > 3)];
        let at = |by: f64| {
            let mut moved = *phi;
            moved[j] += by;
            SVector::from(quantities(&moved))
        };
        slopes.set_column(j, &((at(step) - at(-step)) / (2.0 * step)));
    }
    slopes
}

/// Returns value and U95 of each quantity that an answer holds. Of a recording that cannot be true they are
/// those of its fit: the comparison says what is wrong with it.
fn measured(fit: &Fit, answer: &Answer) -> [Option<[f64; 2]>; COUNT] {
    if let Some(unusable) = &answer.fit {
        return fitted(fit, unusable);
    }
    let mass = answer.parameters.first().and_then(|p| p.state.measured());
    std::array::from_fn(|k| match k {
        0 => mass.map(|m| [m.value, m.u95]),
        1..4 => answer.com_m.zip(answer.com_u95_m).map(|(value, u95)| [value[k - 1], u95[k - 1]]),
        _ => {
            let both = answer.inertia_com_kgm2.zip(answer.inertia_com_u95_kgm2);
            both.map(|(value, u95)| [value[k - 4], u95[k - 4]])
        }
    })
}
