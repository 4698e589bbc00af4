//! The covariance of the numbers of an answer.

use nalgebra::DMatrix;
use rigident_fit::Fit;
use rigident_identify::answer::Answer;

/// The covariance of the parameters of an answer that have numbers: those of a contradicted answer have none.
///
/// The standard uncertainty of a sum `w · p` of parameters is `√(wᵀ C w)` (JCGM 100:2008, 5.2.2); its U95 is
/// 1.96 to 2 of them, or at most [`Answer::coverage_factor`] where noise was estimated from few residuals.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    /// The names of n parameters, in the answer's order.
    pub names: Vec<String>,
    /// Their covariance, n × n, in products of their SI units.
    pub matrix: DMatrix<f64>,
}

impl Covariance {
    /// Takes that of a fit for the parameters to which its answer gives numbers.
    pub(super) fn of(answer: &Answer, fit: &Fit) -> Self {
        let numbered = answer.parameters.iter().enumerate().filter(|(_, p)| p.state.measured().is_some());
        let (of, names): (Vec<usize>, Vec<String>) = numbered.map(|(j, p)| (j, p.name.clone())).unzip();
        let element = |i: usize, k: usize| fit.estimate.covariance(of[i], of[k]).unwrap_or(f64::NAN);
        Self { matrix: DMatrix::from_fn(of.len(), of.len(), element), names }
    }
}
