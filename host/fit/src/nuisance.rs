//! Nuisance parameters: errors of sensors and mounting that do not average out, each with what is known of it
//! beforehand.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Kind, Owner, Parameter};

/// The knowledge that the standard deviation of a nuisance parameter rests on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Basis {
    /// Stated for this rig, by the key of the rig file.
    Stated(String),
    /// The default of a class of data sheets.
    Class(String),
    /// Found in a calibration of this rig.
    Calibration(String),
}

/// The runs that share an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Scope {
    /// It is the same in all runs of a rig: mounting, scales.
    Rig,
    /// It is another one in each recording: drift, bias.
    Recording,
}

/// The way in which an error enters the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Effect {
    /// A channel reads `1 + g` times its value, its offset apart.
    Gain {
        /// The channel.
        channel: usize,
    },
    /// A channel reads a share of another one's value besides its own.
    CrossTalk {
        /// The channel that leaks.
        from: usize,
        /// The channel that reads it.
        to: usize,
    },
    /// A channel's offset moves by a Legendre polynomial of the time, which goes from −1 to 1 over the
    /// recording.
    Drift {
        /// The channel.
        channel: usize,
        /// 1: a line; 2: a curve.
        degree: u8,
    },
    /// No row has it; [`super::RowSource::error_observations`] do.
    None,
    /// An error of the signals that the source makes its rows of: its number among
    /// [`super::RowBlocks::sensitivities`].
    Signal(usize),
}

/// One error that is estimated beside the parameters, and eliminated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Nuisance {
    /// Its name, unique in its source: `lever_arm_x`.
    pub name: String,
    /// The errors that it is one of: `lever arm`.
    pub group: String,
    /// Its SI unit in ASCII.
    pub unit: String,
    /// Standard deviation beforehand, about zero unless [`super::RowSource::beforehand`] says more.
    pub sigma: f64,
    /// The knowledge that this rests on.
    pub basis: Basis,
    /// The runs that share it.
    pub scope: Scope,
    /// Its effect on the rows.
    pub effect: Effect,
}

/// The class of what a law of friction leaves open.
pub const FRICTION: &str = "friction";

impl Nuisance {
    /// Returns true for what the law of a drive's friction leaves open, which is the model's and no error of
    /// the rig.
    pub fn is_of_friction(&self) -> bool {
        matches!(&self.basis, Basis::Class(class) if class == FRICTION)
    }

    /// Returns it as an unknown of rows.
    pub fn parameter(&self) -> Parameter {
        Parameter::new(self.name.clone(), Owner::Other(self.group.clone()), Kind::Other, &self.unit)
    }
}

/// Something that tells of errors but not of the body: `Σ c_k θ_k = value ± sd`, errors that a source does
/// not have left out.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorRow {
    /// Errors by name, and their factors.
    pub terms: Vec<(String, f64)>,
    /// The value seen.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// A nuisance parameter as a fit found it.
#[derive(Clone, Debug, PartialEq)]
pub struct NuisanceFit {
    /// The parameter.
    pub nuisance: Nuisance,
    /// Its value beforehand: zero, or what a calibration found.
    pub expected: f64,
    /// Estimate, prior included.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Variance of the estimate if the error is drawn from the prior: `σ² − 2 N⁻¹ + C` with the inverse of
    /// the normal matrix and the covariance.
    pub drawn: f64,
    /// The contribution of one prior standard deviation to each parameter: `(N⁻¹)_jk / σ_k`, signed; of
    /// correlated errors the part by row k of the prior's whitening ([`super::Gaussian::whitening`]), so that
    /// the squares add up to the variance.
    pub contributions: Vec<f64>,
}

/// Rows tell of an error where its estimate has at least this share of the variance beforehand.
const LEAST_SHARE: f64 = 0.1;

impl NuisanceFit {
    /// Returns how far the estimate is from its value beforehand, in the standard deviations that it has if
    /// the error is drawn from the prior. Zero where the rows say nothing of it.
    pub fn pull(&self) -> f64 {
        if self.learned_share() > LEAST_SHARE {
            (self.value - self.expected) / self.drawn.sqrt()
        } else {
            0.0
        }
    }

    /// Returns true if it is not as stated.
    pub fn is_contradicted(&self) -> bool {
        self.pull().abs() > CONTRADICTED
    }

    /// Returns the share of the prior's variance that the estimate has: what the rows tell.
    pub fn learned_share(&self) -> f64 {
        (self.drawn / self.nuisance.sigma.powi(2)).clamp(0.0, 1.0)
    }
}

/// An error further from its value beforehand than this many of the standard deviations that it was drawn
/// with is not as stated: one of a hundred thousand is.
pub const CONTRADICTED: f64 = 4.42;
/// All errors together agree less well than in this share of recordings.
const DISAGREEMENT: f64 = 1e-5;

/// Returns true if errors found contradict what was known of them: one by itself, or all together. Friction
/// that follows another law is no error of the rig.
pub fn contradict(nuisances: &[NuisanceFit], agreement: Option<Agreement>) -> bool {
    nuisances.iter().any(|k| !k.nuisance.is_of_friction() && k.is_contradicted())
        || agreement.is_some_and(|agreement| agreement.probability() < DISAGREEMENT)
}

/// The agreement of the errors found with what was known of them beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// `(θ̂ − μ)ᵀ (Σ − C)⁺ (θ̂ − μ)` of the prior's mean μ and covariance Σ and the posterior's C: χ² if the
    /// errors are drawn from the prior.
    pub chi2: f64,
    /// Directions that the rows tell of.
    pub degrees_of_freedom: f64,
}

impl Agreement {
    /// Returns the agreement of estimates that are `off` by the given number of standard deviations
    /// beforehand, with `learned`: the covariance that `off` has if the truth is drawn as known
    /// beforehand. `None` if they tell of nothing.
    pub(super) fn new(off: &DVector<f64>, learned: DMatrix<f64>) -> Option<Self> {
        if off.is_empty() {
            return None;
        }
        let eigen = nalgebra::SymmetricEigen::new(learned);
        let (mut chi2, mut degrees_of_freedom) = (0.0, 0.0);
        for (share, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *share > LEAST_SHARE {
                chi2 += direction.dot(off).powi(2) / share;
                degrees_of_freedom += 1.0;
            }
        }
        (degrees_of_freedom > 0.0).then_some(Self { chi2, degrees_of_freedom })
    }

    /// Returns the probability that errors drawn from the prior agree no better.
    pub fn probability(&self) -> f64 {
        ChiSquared::new(self.degrees_of_freedom).map_or(1.0, |d| d.sf(self.chi2))
    }
}
