//! Rows of the modes of free vibration: what vibrates has the mass matrix that its frequencies and shapes ask
//! for.
//!
//! With the displacement φ = (x, θ) of O and the ten parameters π of all that moves, about O in the axes at
//! rest,
//! ```text
//! (K + K_g(π)) φ = ω² M(π) φ      M = [m 1, −[ms]×; [ms]×, I]
//! ```
//! where K_g is what the forces that carry the weight do ([`super::preload`]), of upright springs at the
//! height h `g (h m − ms_z)` on roll and pitch. It is linear in π and homogeneous in φ, which needs no scale.
//! Frequencies and
//! shapes are in the coefficients, with noise: least squares would make bodies small. So they are corrected
//! with the parameters (Gauss–Helmert): with `f = K φ − A(ω, φ) π` and its derivative B by (ω, φ), at the
//! corrected (ω̂, φ̂)
//! ```text
//! A(ω̂, φ̂) π = K φ̂ + B ((ω, φ) − (ω̂, φ̂)),   covariance B Σ Bᵀ
//! ```
//! until nothing changes. Rows are whitened by that covariance, of all modes together. Several postures of
//! one tree are rows of the same base parameters and share the errors of the springs.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, OMatrix, SMatrix, U6, Vector3, Vector6};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::screening::Rejection;
use rigident_shared::spatial::Body;

use super::rests::Rest;
use super::springs::COORDINATES;
use super::support::{Change, Support};
use crate::modal_analysis::Shapes;
use rigident_fit::{Channel, Factor, Nuisance, OtherColumns, Parameter, RowSource, SampleRows, Timing};

/// Parameters of all that moves in one posture.
const TEN: usize = 10;
/// Rounds of correction at most; each gains about two digits.
const MOST_ROUNDS: usize = 50;
/// Corrections have ended when parameters change by less than this share of their standard deviation, and of
/// their size.
const STILL: f64 = 1e-6;
/// Directions of columns of unit length with less than this share are not determined.
const LOST: f64 = 1e-11;
/// Standard deviation of an equation of free vibration by the size of its spring force that is taken for
/// exact: shapes from cameras are ten thousand times worse.
const EXACT: f64 = 1e-9;
/// Least variance of an equation by the largest one, where their covariance has no inverse.
const LEAST: f64 = 1e-12;

/// The swinging body in one posture: its modes, and its ten parameters as those that are estimated make them.
#[derive(Clone, Debug)]
pub struct Swing {
    /// Modes over the free coordinates, in their order: m, rad.
    pub shapes: Shapes,
    /// The ten parameters in S, by those that are estimated: 10 × P.
    pub map: DMatrix<f64>,
    /// The rests of the platform with other loads.
    pub rests: Vec<Rest>,
}

impl Swing {
    /// Returns the swing of one body, of which all ten parameters are estimated.
    pub fn of_body(shapes: &Shapes, rests: Vec<Rest>) -> Self {
        Self { shapes: shapes.clone(), map: DMatrix::identity(TEN, TEN), rests }
    }
}

/// The rows of modes, whitened.
pub struct ModalSource {
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
    nuisances: Vec<Nuisance>,
    /// A row for each equation, coefficients of the parameters.
    coefficients: DMatrix<f64>,
    /// Coefficients of the springs' errors.
    by_errors: DMatrix<f64>,
    values: DVector<f64>,
    fingerprint: u64,
}

impl ModalSource {
    /// Returns the rows of swings over `parameters`; `fingerprint` is the model's.
    ///
    /// `None` if no mode is given, or their covariance is not one.
    pub fn new(
        swings: &[Swing],
        support: &Support,
        parameters: Vec<Parameter>,
        fingerprint: u64,
    ) -> Option<Self> {
        let nuisances: Vec<Nuisance> = support.modal_nuisances();
        let problem = Problem::new(swings, support, parameters.len(), &nuisances, None);
        let (rows, values) = problem.solve()?;
        let (p, e) = (parameters.len(), nuisances.len());
        let channels = support.free.iter().map(|k| Channel {
            name: format!("equation of {}", COORDINATES[*k]),
            unit: String::new(),
            sigma: Some(1.0),
            offset: None,
            group: 0,
        });
        Some(Self {
            parameters,
            channels: channels.collect(),
            nuisances,
            coefficients: rows.columns(0, p).into_owned(),
            by_errors: rows.columns(p, e).into_owned(),
            values,
            fingerprint,
        })
    }

    /// Writes the rows of a mode.
    fn fill(&self, from: &DMatrix<f64>, mode: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let (c, n) = (self.channels.len(), from.ncols());
        if (mode + 1) * c > from.nrows() {
            return Err(Rejection::NotFinite(0));
        }
        for i in 0..c {
            for j in 0..n {
                rows.smoothed[i * n + j] = from[(mode * c + i, j)];
            }
            rows.measured[i] = self.values[mode * c + i];
        }
        Ok(())
    }
}

/// The prior knowledge of the parameters: their mean, and W of their covariance `(Wᵀ W)⁻¹`.
pub(super) type Known = (DVector<f64>, DMatrix<f64>);

/// Six equations: rows over parameters, and values.
type Equations = (OMatrix<f64, U6, Dyn>, Vector6<f64>);

/// Equations at corrected modes and parameters: rows over parameters and errors, values, and derivatives by
/// what was measured.
struct Linearised {
    rows: DMatrix<f64>,
    values: DVector<f64>,
    by: DMatrix<f64>,
}

/// All equations, and what is corrected with the parameters.
pub(super) struct Problem<'a> {
    swings: &'a [Swing],
    support: &'a Support,
    parameters: usize,
    nuisances: &'a [Nuisance],
    known: Option<Known>,
    /// The stiffness of the springs with what is stated of their preload, and the part that a unit of each
    /// parameter's weight adds.
    stiffness: Matrix6<f64>,
    by_weight: [Matrix6<f64>; TEN],
    /// Number of modes of all swings.
    modes: usize,
    /// Measured (ω, φ) of each mode, free coordinates alone, swing by swing, then the displacements of the
    /// rests; and their covariance.
    measured: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
        swings: &'a [Swing],
        support: &'a Support,
        parameters: usize,
        nuisances: &'a [Nuisance],
        known: Option<Known>,
    ) -> Self {
        let c = support.free.len();
        let modes: usize = swings.iter().map(|swing| swing.shapes.modes.len()).sum();
        let rests: usize = swings.iter().map(|swing| swing.rests.len()).sum();
        let size = modes * (1 + c) + rests * c;
        let (mut measured, mut covariance) = (DVector::zeros(size), DMatrix::zeros(size, size));
        let mut from = 0;
        for swing in swings {
            let shapes = &swing.shapes;
            // Damping ratios are in no equation.
            let kept: Vec<usize> = (0..shapes.modes.len())
                .flat_map(|r| {
                    let at = shapes.place(r);
                    std::iter::once(at).chain(at + 2..at + 2 + c)
                })
                .collect();
            for (r, mode) in shapes.modes.iter().enumerate() {
                measured[from + r * (1 + c)] = mode.angular;
                measured.rows_mut(from + r * (1 + c) + 1, c).copy_from(&mode.shape);
            }
            let own = shapes.covariance.select_rows(&kept).select_columns(&kept);
            covariance.view_mut((from, from), (kept.len(), kept.len())).copy_from(&own);
            from += kept.len();
        }
        for rest in swings.iter().flat_map(|swing| &swing.rests) {
            for k in &support.free {
                measured[from] = rest.change[*k];
                covariance[(from, from)] = rest.sd[*k].powi(2);
                from += 1;
            }
        }
        let (by_weight, stated) = support.preload.stiffnesses();
        Self {
            swings,
            support,
            parameters,
            nuisances,
            known,
            stiffness: support.springs.stiffness() + stated,
            by_weight,
            modes,
            measured,
            covariance,
        }
    }

    /// Corrects modes, parameters and errors until they stay; returns the whitened rows there, over
    /// parameters and errors, and their values.
    pub(super) fn solve(&self) -> Option<(DMatrix<f64>, DVector<f64>)> {
        if self.measured.is_empty() {
            return None;
        }
        let (p, e) = (self.parameters, self.nuisances.len());
        let mut corrected = self.measured.clone();
        let mut found = DVector::zeros(p + e);
        let mut rounds = 0;
        loop {
            let (rows, values, by) = self.linearised(&corrected, &found);
            let q = self.whitening(&rows, &by, &corrected)?;
            let lower = q.l();
            let white = lower.solve_lower_triangular(&rows)?;
            let white_values = lower.solve_lower_triangular(&values)?;
            // The smallest where several fit.
            let next = DVector::from_vec(self.factor(&white, &white_values).solve(LOST).estimate);
            let residual = &values - &rows * &next;
            let correction = &self.covariance * by.transpose() * q.solve(&residual);
            corrected = &self.measured - correction;
            let change = (&white * (&next - &found)).norm();
            let scale = white_values.norm().max(1.0);
            found = next;
            rounds += 1;
            if change < STILL.max(1e-12 * scale) || rounds == MOST_ROUNDS {
                return Some((white, white_values));
            }
        }
    }

    /// Returns the factor of the rows, and of what is known beforehand of parameters and errors.
    pub(super) fn factor(&self, white: &DMatrix<f64>, values: &DVector<f64>) -> Factor {
        self.bounded(white, values, self.nuisances)
    }

    /// Returns the factor as [`Self::factor`] does, with other bounds of the errors.
    pub(super) fn bounded(
        &self,
        white: &DMatrix<f64>,
        values: &DVector<f64>,
        nuisances: &[Nuisance],
    ) -> Factor {
        let (p, e) = (self.parameters, self.nuisances.len());
        let mut factor = Factor::new(p + e);
        factor.absorb_matrix(white, values.as_slice());
        let mut known = DMatrix::zeros(e, p + e);
        for (k, nuisance) in nuisances.iter().enumerate() {
            known[(k, p + k)] = 1.0 / nuisance.sigma;
        }
        factor.absorb_matrix(&known, &vec![0.0; e]);
        if let Some((mean, whitening)) = &self.known {
            let wide = whitening.clone().insert_columns(p, e, 0.0);
            factor.absorb_matrix(&wide, (whitening * mean).as_slice());
        }
        factor
    }

    /// Returns rows over parameters and errors, values, and the derivative by what was measured, at corrected
    /// modes and parameters.
    fn linearised(
        &self,
        corrected: &DVector<f64>,
        found: &DVector<f64>,
    ) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
        let c = self.support.free.len();
        let rests: usize = self.swings.iter().map(|swing| swing.rests.len()).sum();
        let (p, e, count) = (self.parameters, self.nuisances.len(), (self.modes + rests) * c);
        let mut all = Linearised {
            rows: DMatrix::zeros(count, p + e),
            values: DVector::zeros(count),
            by: DMatrix::zeros(count, corrected.len()),
        };
        let to_o = self.support.mount.map();
        let (mut mode, mut rest) = (0, 0);
        for swing in self.swings {
            let map = DMatrix::from_fn(TEN, TEN, |i, j| to_o[(i, j)]) * &swing.map;
            let ten = &map * found.rows(0, p);
            let ten: [f64; TEN] = std::array::from_fn(|k| ten[k]);
            let by_error = self.support.modal_changes(&ten);
            let carried: Matrix6<f64> = self.by_weight.iter().zip(&ten).map(|(k, value)| k * *value).sum();
            let (mut stiffness, mut mass) = (self.stiffness + carried, mass_matrix(&ten));
            for (change, value) in by_error.iter().zip(found.rows(p, e).iter()) {
                stiffness += change.stiffness * *value;
                mass += change.mass * *value;
            }
            for _ in 0..swing.shapes.modes.len() {
                let at = mode * (1 + c);
                let angular = corrected[at];
                let shape = self.whole(corrected.rows(at + 1, c).as_slice());
                let slope = stiffness - mass * (angular * angular);
                let forces =
                    |error: &Change| error.stiffness * shape - error.mass * shape * (angular * angular);
                let by_errors: Vec<Vector6<f64>> = by_error.iter().take(e).map(forces).collect();
                let equations = (self.coefficients(angular, &shape) * &map, self.stiffness * shape);
                self.write(&mut all, mode * c, (&equations, &by_errors), (at + 1, &slope));
                let by_angular = mass * shape * (-2.0 * angular);
                for (i, k) in self.support.free.iter().enumerate() {
                    all.by[(mode * c + i, at)] = by_angular[*k];
                }
                mode += 1;
            }
            for own in &swing.rests {
                let at = self.modes * (1 + c) + rest * c;
                let change = self.whole(corrected.rows(at, c).as_slice());
                let (rows, values) = own.equations(
                    &change,
                    (self.support.gravity_mps2, &self.support.preload),
                    (&self.stiffness, &self.by_weight),
                );
                let by_errors: Vec<Vector6<f64>> =
                    by_error.iter().take(e).map(|error| error.stiffness * change).collect();
                let first = (self.modes + rest) * c;
                self.write(&mut all, first, (&(rows * &map, values), &by_errors), (at, &stiffness));
                rest += 1;
            }
        }
        all.values += &all.by * (&self.measured - corrected);
        (all.rows, all.values, all.by)
    }

    /// Returns how far the measured rest of a swing is from where parameters and errors let it be, and the
    /// covariance: 6, m and rad; zero where a coordinate is locked. `None` if nothing determines it.
    pub(super) fn off_rest(
        &self,
        rest: &Rest,
        found: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        let swing = Swing { rests: vec![rest.clone()], ..self.swings.first()?.clone() };
        let swings =
            [Swing { shapes: Shapes { modes: Vec::new(), covariance: DMatrix::zeros(0, 0) }, ..swing }];
        let alone = Problem::new(&swings, self.support, self.parameters, self.nuisances, None);
        let (rows, values, by) = alone.linearised(&alone.measured, found);
        let inverse = by.clone().try_inverse()?;
        let off = &inverse * (values - &rows * found);
        let whitening = alone.whitening(&rows, &by, &alone.measured)?;
        let variance = whitening.l() * whitening.l().transpose() + &rows * covariance * rows.transpose();
        let variance = &inverse * variance * inverse.transpose();
        let free = &self.support.free;
        let mut all = Matrix6::zeros();
        for (i, k) in free.iter().enumerate() {
            for (j, l) in free.iter().enumerate() {
                all[(*k, *l)] = variance[(i, j)];
            }
        }
        Some((self.whole(off.as_slice()), all))
    }

    /// Writes the equations of a mode or a rest from a row on, with the forces of unit errors, and their
    /// slopes by the displacement that is measured from a place on.
    fn write(
        &self,
        all: &mut Linearised,
        first: usize,
        ((coefficients, values), by_errors): (&Equations, &[Vector6<f64>]),
        (place, slope): (usize, &Matrix6<f64>),
    ) {
        let p = self.parameters;
        for (i, k) in self.support.free.iter().enumerate() {
            let row = first + i;
            all.rows.view_mut((row, 0), (1, p)).copy_from(&coefficients.row(*k));
            for (j, forces) in by_errors.iter().enumerate() {
                all.rows[(row, p + j)] = -forces[*k];
            }
            for (j, l) in self.support.free.iter().enumerate() {
                all.by[(row, place + j)] = slope[(*k, *l)];
            }
            all.values[row] = values[*k];
        }
    }

    /// Returns the covariance of the equations, factored.
    fn whitening(
        &self,
        rows: &DMatrix<f64>,
        by: &DMatrix<f64>,
        corrected: &DVector<f64>,
    ) -> Option<Cholesky<f64, Dyn>> {
        let c = self.support.free.len();
        let mut q = by * &self.covariance * by.transpose();
        for row in 0..rows.nrows() {
            let block = row / c;
            let is_rest = block >= self.modes;
            let at = if is_rest { self.modes + block * c } else { block * (1 + c) + 1 };
            let displacement = self.whole(corrected.rows(at, c).as_slice());
            let force = self.stiffness * displacement;
            let kind = if self.support.free[row % c] < 3 {
                force.fixed_rows::<3>(0).norm()
            } else {
                force.fixed_rows::<3>(3).norm()
            };
            let share = if is_rest { self.support.static_std(&displacement) } else { EXACT };
            q[(row, row)] += (share * kind.max(1e-6 * force.norm())).powi(2);
        }
        for (n, rest) in self.swings.iter().flat_map(|swing| &swing.rests).enumerate() {
            let load = rest.of_load(self.support.gravity_mps2);
            let first = (self.modes + n) * c;
            for (i, k) in self.support.free.iter().enumerate() {
                for (j, l) in self.support.free.iter().enumerate() {
                    q[(first + i, first + j)] += load[(*k, *l)];
                }
            }
        }
        // Without any weight yet, springs hold a pendulum's mode by nothing.
        Cholesky::new(q.clone()).or_else(|| {
            let floor = LEAST * q.diagonal().amax();
            Cholesky::new(q.clone() + DMatrix::from_diagonal_element(q.nrows(), q.nrows(), floor))
        })
    }

    /// Returns all six coordinates of a displacement.
    fn whole(&self, free: &[f64]) -> Vector6<f64> {
        let mut all = Vector6::zeros();
        self.support.free.iter().zip(free).for_each(|(k, value)| all[*k] = *value);
        all
    }

    /// Returns `ω² M(π) φ − K_g(π) φ` by the ten parameters.
    fn coefficients(&self, angular: f64, shape: &Vector6<f64>) -> SMatrix<f64, 6, TEN> {
        let mut all = mass_rows(shape) * (angular * angular);
        for (k, by_weight) in self.by_weight.iter().enumerate() {
            let less = all.column(k) - by_weight * shape;
            all.set_column(k, &less);
        }
        all
    }
}

/// Returns the mass matrix of ten parameters about O.
pub(super) fn mass_matrix(ten: &[f64; TEN]) -> Matrix6<f64> {
    let body = InertialParameters::<Body, f64>::from_vector(*ten);
    let arm = body.first_moment.cross_matrix();
    let mut all = Matrix6::zeros();
    all.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(body.mass);
    all.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm);
    all.fixed_view_mut::<3, 3>(3, 0).copy_from(&arm);
    all.fixed_view_mut::<3, 3>(3, 3).copy_from(&body.inertia);
    all
}

/// Returns `M(π) φ` by the ten parameters.
fn mass_rows(shape: &Vector6<f64>) -> SMatrix<f64, 6, TEN> {
    let (x, turn): (Vector3<f64>, Vector3<f64>) =
        (shape.fixed_rows::<3>(0).into_owned(), shape.fixed_rows::<3>(3).into_owned());
    let mut all = SMatrix::<f64, 6, TEN>::zeros();
    for k in 0..TEN {
        let unit = std::array::from_fn(|j| f64::from(u8::from(j == k)));
        let moved = mass_matrix(&unit) * Vector6::new(x.x, x.y, x.z, turn.x, turn.y, turn.z);
        all.set_column(k, &moved);
    }
    all
}

impl RowSource for ModalSource {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        Timing::Static
    }

    fn samples(&self) -> usize {
        self.values.len() / self.channels.len().max(1)
    }

    fn time_ns(&self, sample: usize) -> u64 {
        sample as u64
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        self.fill(&self.coefficients, sample, rows)
    }

    fn model_fingerprint(&self) -> u64 {
        self.fingerprint
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        self.nuisances.clone()
    }

    fn error_columns(&self, _parameters: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        let parameters = self.nuisances.iter().map(Nuisance::parameter).collect();
        Some(Box::new(OtherColumns::new(self, parameters, |sample, rows| {
            self.fill(&self.by_errors, sample, rows)
        })))
    }
}

#[cfg(test)]
#[path = "modal_tests.rs"]
mod tests;
