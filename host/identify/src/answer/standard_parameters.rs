//! Standard parameters of every link: the nearest to a nominal model, every link a body that can be.
//!
//! The rows say `½ ‖R (B φ − φ̂_B)‖²` of the standard parameters φ of all links. What they leave open is
//! taken from the nominal model: of all φ the one is chosen that makes
//! ```text
//! ½ ‖R (B φ − φ̂_B)‖² + 1/s² Σ_i D(J_i, J_i⁰),      D(J, J⁰) = tr(J⁰⁻¹ J) − log det(J⁰⁻¹ J) − 4
//! ```
//! least. D is the divergence of the log-determinant between pseudo-inertias: twice the relative entropy of
//! two Gaussian distributions of mass of these second moments. It does not depend on units or on a link's
//! frame, to second order it is half the square of the affine-invariant distance `‖log(J⁰^−½ J J⁰^−½)‖`, it
//! is convex in φ, and it grows beyond all bounds where J ceases to be positive definite: every link is a
//! body that can be, without a constraint (T. Lee, P. Wensing, F. Park, "Geometric robot dynamic
//! identification: a convex programming approach", IEEE T-RO 36 (2), 2020; P. Wensing, S. Kim, J.-J. Slotine,
//! "Linear matrix inequalities for physically consistent inertial parameter identification", RA-L 3 (1),
//! 2018). s is the relative 1 σ that the nominal model is trusted with.
//!
//! Solved by damped Newton steps, each a linear least-squares problem: nothing is squared.

use nalgebra::{DMatrix, DVector, Matrix4, SMatrix};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;

use super::context::Links;
use super::result::CompleteParameter;
use rigident_fit::{Factor, Fit, Noise};
use rigident_model::base::BaseParameters;
use rigident_model::inertial::{Parameters, impossibility, map_to_parent};
use rigident_model::symmetry::{self, Pair};
use rigident_model::{Model, ModelError};

/// Newton steps; some ten are usual.
const MOST_STEPS: usize = 200;
/// The least decrement of a step, in units of what is minimised.
const DONE: f64 = 1e-14;
/// The same on the way.
const ROUGH: f64 = 1e-3;

/// Singular values below this share of the largest are not determined, as in the rows of a tree.
const ROUNDING: f64 = 1e-10;

/// Rows that are to be kept weigh this many times as much as those of the data, beside the nominal model.
const HEAVY: f64 = 1e4;
/// Bodies keep base parameters if they are off by no more, in standard deviations of the data.
const EXACT: f64 = 1e-2;

/// The base parameters of a tree as its rows give them, whatever offsets and drives are.
#[derive(Clone, Debug)]
pub struct BaseEstimate<'a> {
    /// The combinations, in the order of the estimate.
    pub base: &'a BaseParameters,
    /// Triangle of the base parameters, rows in true standard deviations.
    pub r: DMatrix<f64>,
    /// Right-hand side.
    pub z: DVector<f64>,
    /// Least-squares estimate; meaningless where not determined.
    pub values: DVector<f64>,
    /// Standard deviations.
    sd: Vec<f64>,
    /// True where the rows determine the parameter.
    determined: Vec<bool>,
    /// Number of directions that the rows determine.
    pub rank: usize,
    /// The way the noise is known.
    pub noise: Noise,
}

impl<'a> BaseEstimate<'a> {
    /// Returns the base parameters of a fit, whose first columns they are, from the data alone.
    pub fn of(fit: &Fit, base: &'a BaseParameters) -> Self {
        let scale = fit.noise.variance_scale;
        match &fit.solved {
            Some(solved) => Self::of_factor(solved, base, 1.0, fit.estimate.noise),
            None => Self::of_factor(&fit.factor, base, scale, fit.estimate.noise),
        }
    }

    /// Returns the same of rows whose standard deviations are all as much larger; see
    /// [`Fit::evenly_widened`].
    pub fn evenly_widened(&self, fit: &Fit) -> Self {
        match &fit.solved {
            Some(solved) if fit.widened.is_empty() => Self::of_factor(solved, self.base, 1.0, self.noise),
            _ => Self::of_factor(&fit.evenly_widened(), self.base, fit.noise.variance_scale, self.noise),
        }
    }

    /// Returns these base parameters as if the rows of a factor, rotors in its columns, said them [`HEAVY`]
    /// times as exactly.
    fn exactly(factor: &Factor, base: &'a BaseParameters, values: &[f64]) -> Self {
        let count = base.parameters.len();
        let (r, values) = (factor.leading(count).r() * HEAVY, DVector::from_column_slice(values));
        Self {
            base,
            z: &r * &values,
            r,
            values,
            sd: vec![0.0; count],
            determined: vec![false; count],
            rank: count,
            noise: Noise::Given,
        }
    }

    /// Returns the base parameters of a factor whose covariance is to be multiplied by `variance_scale`.
    pub fn of_factor(factor: &Factor, base: &'a BaseParameters, variance_scale: f64, noise: Noise) -> Self {
        let count = base.parameters.len();
        let marginal = with_rotors(factor, base).leading(count);
        let solution = marginal.solve(ROUNDING);
        let scale = 1.0 / variance_scale.sqrt();
        Self {
            base,
            r: marginal.r() * scale,
            z: DVector::from_column_slice(marginal.z()) * scale,
            sd: (0..count).map(|j| (solution.covariance[(j, j)] * variance_scale).sqrt()).collect(),
            rank: count - solution.null_directions.len().min(count),
            values: DVector::from_vec(solution.estimate),
            determined: solution.determined,
            noise,
        }
    }
}

/// Returns the links nearest to the nominal model whose base parameters are these, the rotors that no motion
/// tells from links included: bodies that do what links and rotors do together, for programs without rotors.
/// `None` if there are no such rotors, or no such bodies.
pub fn nearest_with_rotors(fit: &Fit, links: &Links, base: &[CompleteParameter]) -> Option<Full> {
    let (request, count) = (links.standard?, links.base.parameters.len());
    if links.base.rotors().is_empty() {
        return None;
    }
    let factor = fit.solved.as_ref().unwrap_or(&fit.factor);
    let values: Vec<f64> = base.iter().take(count).map(|parameter| parameter.value).collect();
    if values.len() < count {
        return None;
    }
    let own = BaseEstimate::exactly(factor, links.base, &values);
    let full = nearest(request.nominal, &own, request.trust, request.symmetric).ok()?;
    (full.converged && full.distance_sd <= EXACT * HEAVY).then_some(full)
}

/// Returns a factor with the rotors that are parts of base parameters as columns of their own, after all
/// others: the first are then those of the links alone.
pub(super) fn with_rotors(factor: &Factor, base: &BaseParameters) -> Factor {
    let (n, weights) = (factor.parameters(), base.rotor_map());
    if weights.ncols() == 0 {
        return factor.clone();
    }
    let mut map = DMatrix::identity(n, n + weights.ncols());
    map.view_mut((0, n), (weights.nrows(), weights.ncols())).copy_from(&weights);
    factor.substitute(&map)
}

/// Standard parameters of all links.
#[derive(Clone, Debug, PartialEq)]
pub struct Full {
    /// Links that have mass, as the model's file has them.
    pub links: Vec<FullLink>,
    /// The distance of the base parameters of these from those identified, standard deviations.
    pub distance_sd: f64,
    /// Largest of that distance for a single identified parameter, in its own standard deviations.
    pub largest_sd: f64,
    /// True if the steps ended.
    pub converged: bool,
    /// Their base parameters, without rotors.
    pub base: Vec<f64>,
}

/// A link's full parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct FullLink {
    /// Its name.
    pub name: String,
    /// About its own origin, its axes.
    pub parameters: Parameters,
    /// The nominal model's, likewise.
    pub nominal: Parameters,
    /// `√(2 D)`: relative distance from the nominal model.
    pub distance: f64,
}

/// Pseudo-inertia of φ.
fn pseudo(phi: &[f64]) -> Matrix4<f64> {
    let phi: Parameters = std::array::from_fn(|k| phi.get(k).copied().unwrap_or(0.0));
    InertialParameters::<Body, f64>::from_vector(phi).pseudo_inertia()
}

/// `D(J, J⁰)`, relative entropy; `None` if one of them is no body's.
pub fn divergence(phi: &Parameters, nominal: &Parameters) -> Option<f64> {
    let (own, other) = (pseudo(phi).cholesky()?, pseudo(nominal).cholesky()?);
    // L⁰⁻¹ L: the product of its diagonal is the root of det(J⁰⁻¹ J).
    let product = other.l().solve_lower_triangular(&own.l())?;
    let log: f64 = product.diagonal().iter().map(|v| v.ln()).sum();
    Some((product.norm_squared() - 4.0 - 2.0 * log).max(0.0))
}

/// Symmetric matrices as vectors of ten whose length is the Frobenius norm.
fn vector_of(m: &Matrix4<f64>) -> [f64; 10] {
    let root = std::f64::consts::SQRT_2;
    let mut out = [0.0; 10];
    let mut k = 0;
    for i in 0..4 {
        for j in i..4 {
            out[k] = if i == j { m[(i, i)] } else { root * 0.5 * (m[(i, j)] + m[(j, i)]) };
            k += 1;
        }
    }
    out
}

/// The links of a model that have mass, and how the parameters of its bodies are made of theirs.
pub(super) struct Variables {
    names: Vec<String>,
    pub(super) nominal: Vec<Parameters>,
    /// φ of all bodies = W φ of the links.
    pub(super) bodies: DMatrix<f64>,
    /// Index of the links in the model.
    indices: Vec<usize>,
}

/// Of the bodies from `first` on every one needs nominal parameters.
pub(super) fn variables(model: &Model, first: usize) -> Result<Variables, ModelError> {
    let refuse = |problem: String| ModelError::Structure { what: model.name.clone(), problem };
    let welded = model.welded();
    let mut maps = Vec::new();
    let mut places: Vec<(usize, nalgebra::Matrix3<f64>, nalgebra::Vector3<f64>)> = Vec::new();
    let (possible, _) = model.possible();
    for (i, link) in model.links.iter().enumerate() {
        let own = (nalgebra::Matrix3::identity(), nalgebra::Vector3::zeros());
        let place = if i == 0 {
            (0, own.0, own.1)
        } else if link.link.joint == rigident_shared::tree::Joint::Fixed {
            let (body, r, p) = places[link.link.parent];
            (body, r * link.link.rotation, p + r * link.link.position)
        } else {
            (welded.link(&link.name).unwrap_or(0), own.0, own.1)
        };
        places.push(place);
        let Some(nominal) = possible[i] else { continue };
        if let Some(why) = impossibility(&nominal) {
            return Err(refuse(format!(
                "link {} cannot be the nominal model: {why}; correct the file (`model_check()`)",
                link.name
            )));
        }
        maps.push((i, place, nominal));
    }
    for (body, link) in welded.links.iter().enumerate().filter(|(i, link)| link.is_body() && *i >= first) {
        if maps.iter().all(|(_, (b, ..), _)| *b != body) {
            return Err(refuse(format!(
                "link {} has no nominal mass: full parameters nearest to a nominal model need one of every \
                 body that moves",
                link.name
            )));
        }
    }
    let mut bodies = DMatrix::zeros(10 * welded.links.len(), 10 * maps.len());
    for (k, (_, (body, r, p), _)) in maps.iter().enumerate() {
        bodies.view_mut((10 * body, 10 * k), (10, 10)).copy_from(&map_to_parent(r, p));
    }
    Ok(Variables {
        names: maps.iter().map(|(i, ..)| model.links[*i].name.clone()).collect(),
        nominal: maps.iter().map(|(_, _, n)| *n).collect(),
        indices: maps.iter().map(|(i, ..)| *i).collect(),
        bodies,
    })
}

/// The full parameters of a model's links nearest to it, of which the rows leave what they leave. `model` is
/// the file's, links on fixed joints on their own; `trust` is s. With `symmetric` the right links mirror the
/// left ones.
///
/// # Errors
/// [`ModelError`] if a body has no nominal parameters or impossible ones, or there are no pairs.
pub fn nearest(model: &Model, found: &BaseEstimate, trust: f64, symmetric: bool) -> Result<Full, ModelError> {
    // The rows may not see a base that is held still.
    let seen = found.base.standard.len() / 10;
    let variables = variables(model, model.welded().links.len().saturating_sub(seen))?;
    let pairs = if symmetric { symmetric_pairs(model, &variables)? } else { Vec::new() };
    let substitution = symmetry::substitution(variables.nominal.len(), &pairs);
    let skip = variables.bodies.nrows() - found.base.standard.len();
    let map = found.base.map() * variables.bodies.rows(skip, variables.bodies.nrows() - skip);
    let mut problem = Problem {
        rows: &found.r * &map * &substitution,
        rhs: found.z.clone(),
        substitution,
        nominal: &variables.nominal,
        weight: 1.0 / trust,
    };
    let solved = problem.solve();
    Ok(full(&variables, found, &map, solved))
}

/// The full parameters of links, with what they are by the rows, whose base parameters are `map` φ; φ and
/// whether the steps ended.
pub(super) fn full(
    variables: &Variables,
    found: &BaseEstimate,
    map: &DMatrix<f64>,
    (phi, converged): (DVector<f64>, bool),
) -> Full {
    let chosen = map * &phi;
    let mut largest: f64 = 0.0;
    for (j, sd) in found.sd.iter().enumerate() {
        if found.determined[j] && *sd > 0.0 {
            largest = largest.max(((chosen[j] - found.values[j]) / sd).abs());
        }
    }
    // The rows' misfit that is not the estimate's own.
    let best = &found.r * &found.values - &found.z;
    let misfit = (&found.r * &chosen - &found.z).norm_squared() - best.norm_squared();
    let links = variables.names.iter().enumerate().map(|(k, name)| {
        let parameters: Parameters = std::array::from_fn(|i| phi[10 * k + i]);
        let nominal = variables.nominal[k];
        FullLink {
            name: name.clone(),
            parameters,
            nominal,
            distance: divergence(&parameters, &nominal).map_or(f64::INFINITY, |d| (2.0 * d).sqrt()),
        }
    });
    Full {
        links: links.collect(),
        distance_sd: misfit.max(0.0).sqrt(),
        largest_sd: largest,
        converged,
        base: chosen.as_slice().to_vec(),
    }
}

/// Pairs among the links that have mass.
pub(super) fn symmetric_pairs(model: &Model, variables: &Variables) -> Result<Vec<Pair>, ModelError> {
    let at = |i: usize| variables.indices.iter().position(|k| *k == i);
    let all = symmetry::pairs(model)?;
    Ok(all.into_iter().filter_map(|p| Some(Pair { left: at(p.left)?, right: at(p.right)?, ..p })).collect())
}

/// The cost that is minimised.
pub(super) struct Problem<'a> {
    /// Rows of ψ.
    pub(super) rows: DMatrix<f64>,
    pub(super) rhs: DVector<f64>,
    /// φ = T ψ.
    pub(super) substitution: DMatrix<f64>,
    pub(super) nominal: &'a [Parameters],
    /// 1/s.
    pub(super) weight: f64,
}

impl Problem<'_> {
    fn cost(&self, psi: &DVector<f64>) -> Option<f64> {
        let phi = &self.substitution * psi;
        let mut sum = 0.5 * (&self.rows * psi - &self.rhs).norm_squared();
        for (own, nominal) in phi.as_slice().chunks_exact(10).zip(self.nominal) {
            let own: Parameters = std::array::from_fn(|k| own[k]);
            sum += self.weight * self.weight * divergence(&own, nominal)?;
        }
        sum.is_finite().then_some(sum)
    }

    /// φ, and whether the steps ended.
    pub(super) fn solve(&mut self) -> (DVector<f64>, bool) {
        let trusted = self.weight;
        let mut psi = self.start();
        let mut weight = trusted.max(self.misfit(&psi).min(f64::MAX.sqrt()));
        loop {
            let last = weight <= trusted;
            self.weight = weight.max(trusted);
            let converged = self.descend(&mut psi, if last { DONE } else { ROUGH });
            if last {
                return (&self.substitution * &psi, converged);
            }
            weight *= 0.1;
        }
    }

    /// The square of what the rows leave of the right-hand side, of bodies of which no others that are not
    /// much heavier leave less by more than a `share` of it or of `unit`; `None` if the steps do not end. The
    /// weight is not examined.
    pub(super) fn least_misfit(&mut self, share: f64, unit: f64) -> Option<f64> {
        let mut psi = self.start();
        self.weight = self.misfit(&psi).clamp(1.0, f64::MAX.sqrt());
        // Where a barrier of ν = 4 a link, twice, weighs w², the least is nearer than w² ν (Y. Nesterov, A.
        // Nemirovskii, 1994).
        let barrier = 8.0 * self.nominal.len() as f64;
        loop {
            if !self.descend(&mut psi, ROUGH) {
                return None;
            }
            let square = self.misfit(&psi).powi(2);
            if self.weight * self.weight * barrier <= share * square.max(unit) {
                return Some(square);
            }
            self.weight *= 0.3;
        }
    }

    /// The nominal model, made symmetric by taking the left side's. From here to less and less trust in it no
    /// step runs into the edge of what is a body.
    fn start(&self) -> DVector<f64> {
        let nominal = DVector::from_iterator(10 * self.nominal.len(), self.nominal.iter().flatten().copied());
        let own = |column: nalgebra::DVectorView<f64>| column.iter().position(|v| *v == 1.0).unwrap_or(0);
        DVector::from_iterator(
            self.substitution.ncols(),
            self.substitution.column_iter().map(|c| nominal[own(c)]),
        )
    }

    fn misfit(&self, psi: &DVector<f64>) -> f64 {
        (&self.rows * psi - &self.rhs).norm()
    }

    /// Newton's steps until they promise less than `done` of the weight's square; whether they reached it.
    fn descend(&self, psi: &mut DVector<f64>, done: f64) -> bool {
        let Some(mut cost) = self.cost(psi) else { return false };
        // The residual of the rows is known to their rounding only.
        let rounding = (f64::EPSILON * self.substitution.ncols() as f64 * self.rhs.norm()).powi(2);
        for _ in 0..MOST_STEPS {
            let Some((step, decrement)) = self.step(psi) else { return false };
            if decrement <= done * self.weight * self.weight + rounding {
                return true;
            }
            let mut length = 1.0;
            loop {
                let next = &*psi + &step * length;
                // A quarter of what the slope promises.
                if let Some(lower) = self.cost(&next).filter(|c| *c <= cost - 0.25 * length * decrement) {
                    (*psi, cost) = (next, lower);
                    break;
                }
                length *= 0.5;
                if length < 1e-12 {
                    // Rounding: there is nothing lower.
                    return true;
                }
            }
        }
        false
    }

    /// Newton's step and half the square of its decrement.
    fn step(&self, psi: &DVector<f64>) -> Option<(DVector<f64>, f64)> {
        let phi = &self.substitution * psi;
        let links = self.nominal.len();
        let (m, n) = (self.rows.nrows(), self.substitution.ncols());
        let mut stacked = DMatrix::zeros(m + 10 * links, n);
        let mut target = DVector::zeros(m + 10 * links);
        stacked.rows_mut(0, m).copy_from(&self.rows);
        target.rows_mut(0, m).copy_from(&(&self.rhs - &self.rows * psi));
        for (k, nominal) in self.nominal.iter().enumerate() {
            // J = L Lᵀ; a step E in its own metric is dJ = L E Lᵀ, and to second order
            // D = D₀ + tr((Lᵀ J⁰⁻¹ L − 1) E) + ½ ‖E‖².
            let lower = pseudo(&phi.as_slice()[10 * k..10 * k + 10]).cholesky()?.l();
            let inner = pseudo(nominal).cholesky()?.l().solve_lower_triangular(&lower)?;
            let slope = vector_of(&(inner.transpose() * inner - Matrix4::identity()));
            let mut own = SMatrix::<f64, 10, 10>::zeros();
            for j in 0..10 {
                let mut unit = [0.0; 10];
                unit[j] = 1.0;
                let left = lower.solve_lower_triangular(&pseudo(&unit))?;
                let e = lower.solve_lower_triangular(&left.transpose())?;
                own.set_column(j, &nalgebra::SVector::from(vector_of(&e)));
            }
            let dynamic = DMatrix::from_column_slice(10, 10, own.as_slice());
            let rows = dynamic * self.substitution.rows(10 * k, 10) * self.weight;
            stacked.rows_mut(m + 10 * k, 10).copy_from(&rows);
            for (i, s) in slope.iter().enumerate() {
                target[m + 10 * k + i] = -self.weight * s;
            }
        }
        // Columns of one size; the rows of the data, heavy ones, are first.
        let scale: Vec<f64> = stacked.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        for (mut column, scale) in stacked.column_iter_mut().zip(&scale) {
            column /= *scale;
        }
        let qr = stacked.col_piv_qr();
        let projected = qr.q().tr_mul(&target);
        let mut solved = qr.r().solve_upper_triangular(&projected)?;
        qr.p().inv_permute_rows(&mut solved);
        for (s, scale) in solved.iter_mut().zip(&scale) {
            *s /= *scale;
        }
        Some((solved, 0.5 * projected.norm_squared()))
    }
}

#[cfg(test)]
#[path = "standard_parameters_tests.rs"]
mod tests;
