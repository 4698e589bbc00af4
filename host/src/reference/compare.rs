//! What was measured against a reference: the E_n number of each quantity, and whether it is the body at all.

use nalgebra::{DMatrix, DVector, SVector};
use rigident_shared::inertia::{InertialParameters, tensor_elements};
use rigident_shared::spatial::Sensor;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::body::Mounted;
use crate::answer::Answer;
use crate::fit::{COVERAGE_95, Fit};

/// A body less likely than this to be the one of the reference is another one.
pub(super) const OTHER_BODY: f64 = 1e-5;
/// Quantities that are compared.
const COUNT: usize = 10;
const NAMES: [&str; COUNT] =
    ["m", "com_x", "com_y", "com_z", "Ixx_com", "Iyy_com", "Izz_com", "Iyz_com", "Izx_com", "Ixy_com"];

/// One quantity against the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quantity {
    /// Its name: `m`, `com_x`, `Ixx_com`.
    pub name: String,
    /// Unit in ASCII.
    pub unit: String,
    /// Measured; absent where it is not identified.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Its 95 % expanded uncertainty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub u95: Option<f64>,
    /// The reference's value.
    pub reference: f64,
    /// Its 95 % expanded uncertainty.
    pub reference_u95: f64,
    /// `(value − reference)/√(u95² + reference_u95²)`, ISO/IEC 17043.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub e_n: Option<f64>,
    /// True if the quantity is identified and |E_n| is at most 1.
    pub passed: bool,
}

/// What was measured against the reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// Each quantity.
    pub quantities: Vec<Quantity>,
    /// Disagreement of the ten parameters as far as they are determined.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: f64,
    /// Probability of as much for the body of the reference.
    pub probability: f64,
}

/// The body is not that of the reference.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the body is not the reference: χ² of its ten parameters is {chi2:.0} for {degrees_of_freedom:.0} degrees of freedom; look for \
     the wrong file, another mounting, a fixture that is not taken off, or an error of the rig that the rig file does not allow for"
)]
pub struct Mismatch {
    /// Disagreement.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: f64,
}

impl Comparison {
    /// Compares an answer and its fit with the reference as it was mounted.
    pub fn new(fit: &Fit, answer: &Answer, reference: &Mounted) -> Self {
        let expected = quantities(&reference.parameters);
        let slopes = slopes(&reference.parameters);
        let known = &slopes * reference.covariance() * slopes.transpose();
        let measured = measured(answer);
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
        Self { quantities: quantities.collect(), chi2, degrees_of_freedom, probability }
    }

    /// Returns the mismatch if the body is hardly that of the reference.
    pub fn mismatch(&self) -> Option<Mismatch> {
        let Self { chi2, degrees_of_freedom, .. } = *self;
        (self.probability < OTHER_BODY).then_some(Mismatch { chi2, degrees_of_freedom })
    }

    /// Returns true if every quantity passed, and the body is that of the reference.
    pub fn passed(&self) -> bool {
        self.mismatch().is_none() && self.quantities.iter().all(|quantity| quantity.passed)
    }
}

/// Returns χ² and degrees of freedom of the parameters that a fit determines against the reference, both uncertainties counted.
pub(super) fn disagreement(fit: &Fit, reference: &Mounted) -> (f64, f64) {
    let estimate = &fit.estimate;
    let known = reference.covariance();
    let at: Vec<usize> = (0..10).filter(|j| estimate.is_determined(*j)).collect();
    let off = DVector::from_fn(at.len(), |k, _| {
        estimate.values.get(at[k]).copied().unwrap_or(0.0) - reference.parameters[at[k]]
    });
    let both = DMatrix::from_fn(at.len(), at.len(), |i, j| {
        estimate.covariance[(at[i], at[j])] + known[(at[i], at[j])]
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

/// Returns value and U95 of each quantity that an answer holds.
fn measured(answer: &Answer) -> [Option<[f64; 2]>; COUNT] {
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
