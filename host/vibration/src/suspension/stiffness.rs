//! The stiffness of springs from the modes of a body that is known.
//!
//! The equations are those of [`super::modal`], with the body known and every element of the stiffness
//! unknown: rows of the same problem, with errors of the springs as large as the springs, and what is known
//! of the body below them.

use nalgebra::{DMatrix, DVector, Matrix6, SVector};

use super::geometry::Geometry;
use super::modal::{Problem, Swing};
use super::springs::Springs;
use super::support::Support;
use rigident_fit::Nuisance;
use rigident_io::rig::SuspensionTable;

/// 1 σ of an element beforehand, relative to the diagonal: nothing is known of it.
const UNKNOWN: f64 = 1e3;
/// A value stated as exact is known to this share.
const EXACT: f64 = 1e-6;
/// An element whose standard deviation is more than this share of what it was beforehand is not determined.
const DETERMINED: f64 = 0.01;

/// Springs that differ by more standard deviations from what is stated are others, or the body is.
const OTHER: f64 = 4.0;

/// A stiffness that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundStiffness {
    /// About O, axes of P at rest: N/m, N, N m; zero where a coordinate is locked.
    pub stiffness: Matrix6<f64>,
    /// 1 σ of its elements.
    pub std: Matrix6<f64>,
    /// χ² of what is left by its degrees of freedom: more than chance gives contradicts body, springs or
    /// modes.
    pub variance_ratio: f64,
    /// The degrees of freedom of χ².
    pub degrees_of_freedom: f64,
}

impl FoundStiffness {
    /// Returns the diagonal elements in which springs that a rig file states are others, by their numbers:
    /// with the value stated, that found, and by how many of their standard deviations these differ. A
    /// stiffness of one body in place of another is off by the ratio of their masses.
    pub fn other_than(&self, springs: &Springs) -> Vec<(usize, [f64; 3])> {
        let stated = springs.stiffness();
        let errors = springs.error_stiffnesses();
        let sigma: Vec<f64> = springs.stiffness_nuisances().iter().map(|own| own.sigma).collect();
        let of = |k: usize| {
            let variance: f64 =
                errors.iter().zip(&sigma).map(|(own, sigma)| (own[(k, k)] * sigma).powi(2)).sum();
            let sd = variance.sqrt().hypot(self.std[(k, k)]);
            let off = (self.stiffness[(k, k)] - stated[(k, k)]).abs();
            (sd > 0.0 && off > OTHER * sd).then_some((k, [stated[(k, k)], self.stiffness[(k, k)], off / sd]))
        };
        (0..6).filter_map(of).collect()
    }
}

/// Returns the stiffness about O of the springs that a known body vibrated on: its ten parameters in S, the
/// platform's among them, and their covariance. `table` is the rig file's, of whose stiffness only the size
/// counts; 1 σ are larger where more is left than chance gives.
///
/// `None` if the modes do not tell every element.
pub fn stiffness(
    table: &SuspensionTable,
    support: &Support,
    swing: &Swing,
    (parameters, covariance): (&DVector<f64>, &DMatrix<f64>),
) -> Option<FoundStiffness> {
    let start = support.springs.stiffness();
    let rows: [[f64; 6]; 6] = std::array::from_fn(|i| std::array::from_fn(|j| start[(i, j)]));
    let wide = SuspensionTable {
        stiffness: Some(rows),
        stiffness_std: Some(UNKNOWN),
        stiffness_common_std: Some(0.0),
        stiffness_element_std: None,
        spring: Vec::new(),
        ..table.clone()
    };
    // The matrix is that of springs at the places and the height that are stated.
    let own = Support { springs: Springs::new(&wide), geometry: Geometry::default(), ..support.clone() };
    let nuisances: Vec<Nuisance> = own.modal_nuisances();
    let unknown = own.springs.error_stiffnesses();
    // What is stated as exact is known to a millionth.
    let mut covariance = covariance.clone();
    let largest = parameters.amax();
    for k in 0..10 {
        covariance[(k, k)] += (EXACT * parameters[k].abs().max(EXACT * largest)).powi(2);
    }
    let whitening = covariance.cholesky()?.inverse().cholesky()?.l().transpose();
    let problem = Problem::new(
        std::slice::from_ref(swing),
        &own,
        10,
        &nuisances,
        Some((parameters.clone(), whitening)),
    );
    let (rows, values) = problem.solve()?;
    let factor = problem.factor(&rows, &values);
    let solution = factor.solve(factor.rounding());
    let degrees_of_freedom = values.len() as f64 - unknown.len() as f64;
    if degrees_of_freedom < 1.0 {
        return None;
    }
    let variance_ratio = factor.residual_sum_of_squares() / degrees_of_freedom;
    let surprising = variance_ratio > 1.0 + 4.0 * (2.0 / degrees_of_freedom).sqrt();
    let wider = if surprising { variance_ratio.sqrt() } else { 1.0 };
    let (mut stiffness, mut std) = (Matrix6::zeros(), Matrix6::zeros());
    for (k, (nuisance, by)) in nuisances.iter().zip(unknown).enumerate() {
        let at = 10 + k;
        let sd = solution.covariance[(at, at)].max(0.0).sqrt();
        if !solution.determined[at] || sd.is_nan() || sd > DETERMINED * nuisance.sigma {
            return None;
        }
        stiffness += by * solution.estimate[at];
        std += by * (sd * wider);
    }
    // Modes show the springs' stiffness with that of their load, of which the latter is taken off as stated.
    let ten = support.mount.map() * SVector::<f64, 10>::from_fn(|k, _| parameters[k]);
    let load = support.geometry.load_std(&std::array::from_fn(|k| ten[k]));
    std = std.zip_map(&load, f64::hypot);
    // What is locked has no stiffness of its own.
    let is_free = |i: usize, j: usize| support.free.contains(&i) && support.free.contains(&j);
    let whole = Matrix6::from_fn(|i, j| if is_free(i, j) { start[(i, j)] + stiffness[(i, j)] } else { 0.0 });
    Some(FoundStiffness { stiffness: whole, std, variance_ratio, degrees_of_freedom })
}
