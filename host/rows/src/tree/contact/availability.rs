//! Rows that are free of what is not measured: `W = D L⁻¹ N` with N H = 0, and its derivative.
//!
//! H are the columns of what is not measured, p the rows by which it is eliminated, r the others:
//! `N = [1, −K]` with `K = H_r H_p⁺`. The noise of torques and feet makes the rows N correlated:
//! `T = N S Nᵀ = L Lᵀ`, and `L⁻¹ N` has white noise. D gives each row the size of its own noise again. A row
//! is differentiated by the filter, `W ∂h = ∂(W h) − (∂W) h`, so ∂W is needed too; all of it follows from the
//! derivatives of G, that of a Cholesky factor as `∂L = L Φ(L⁻¹ ∂T L⁻ᵀ)`, Φ the lower triangle with half the
//! diagonal.

use nalgebra::{DMatrix, DVector};
use rigident_shared::tree::TreeError;

use super::super::Frame;
use super::forces::{self, Columns};
use super::{Contact, ContactState, Foot};
use rigident_model::rows::Moving;

/// Directions of H_p that are less than this share of its largest count for nothing.
const RANK: f64 = 1e-9;

/// The rows of an instant that are free of what is not measured.
pub(in super::super) struct Availability {
    weights: DMatrix<f64>,
    slopes: DMatrix<f64>,
    /// The addition of the feet to what is measured, before it is weighted.
    ground: Vec<f64>,
    /// Columns of the feet that stand, by foot.
    pub(in super::super) feet: Vec<(usize, Columns)>,
}

impl Contact {
    /// Returns the feet that count in a frame, each with its number and wrench: those that stand, and those
    /// of which all is measured, whatever they read.
    pub(in super::super) fn standing(&self, frame: &Frame) -> Vec<(usize, &Foot, [f64; 6])> {
        let ground = &frame.ground;
        let feet = self.feet.iter().zip(&ground.wrenches).zip(&ground.touching).enumerate();
        let counts = feet.filter(|(_, ((foot, _), touching))| **touching || foot.is_measured());
        counts.map(|(i, ((foot, w), _))| (i, foot, *w)).collect()
    }

    /// Returns the rows of a frame that are free of what is not measured; the tree has the frame's motion.
    ///
    /// # Errors
    /// [`TreeError`] if frame, tree and states of contact do not fit.
    pub(in super::super) fn availability(
        &self,
        moving: &mut Moving,
        frame: &Frame,
    ) -> Result<Availability, TreeError> {
        let state = self.states.get(frame.ground.state).ok_or(TreeError::Lengths)?;
        let standing = self.standing(frame);
        let feet: Vec<&Foot> = standing.iter().map(|(_, foot, _)| *foot).collect();
        let columns = forces::columns(moving, &feet)?;
        let (values, slopes) = unknown(state, &feet, &columns, self.sigma.len());
        let rest = state.rest(self.sigma.len());
        let (free, free_slope) = eliminate(&values, &slopes, &state.pivots, &rest);
        let (weights, slopes) =
            self.whiten(&rest, &free, &free_slope, &feet, &columns).ok_or(TreeError::Lengths)?;
        let mut ground = vec![0.0; self.sigma.len()];
        for ((_, foot, wrench), columns) in standing.iter().zip(&columns) {
            for (k, value) in wrench.iter().enumerate().filter(|(k, _)| foot.known[*k]) {
                ground.iter_mut().zip(columns.values.column(k).iter()).for_each(|(to, g)| *to += g * value);
            }
        }
        let numbers = standing.iter().map(|(i, ..)| *i);
        Ok(Availability { weights, slopes, ground, feet: numbers.zip(columns).collect() })
    }

    /// Returns W and its derivative of rows `free`; those that are eliminated are zero.
    fn whiten(
        &self,
        rest: &[usize],
        free: &DMatrix<f64>,
        slope: &DMatrix<f64>,
        feet: &[&Foot],
        columns: &[Columns],
    ) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let count = self.sigma.len();
        let mut noise =
            DMatrix::from_diagonal(&DVector::from_iterator(count, self.sigma.iter().map(|s| s * s)));
        let mut change = DMatrix::zeros(count, count);
        for (foot, columns) in feet.iter().zip(columns) {
            for k in (0..6).filter(|k| foot.known[*k]) {
                let (g, dg) = (columns.values.column(k), columns.slopes.column(k));
                let variance = foot.sigma[k].powi(2);
                noise.ger(variance, &g, &g, 1.0);
                change.ger(variance, &dg, &g, 1.0);
                change.ger(variance, &g, &dg, 1.0);
            }
        }
        let carried = free * &noise;
        let across = slope * carried.transpose();
        let t = &carried * free.transpose();
        let dt = &across + across.transpose() + free * change * free.transpose();
        let l = t.cholesky()?.unpack();
        let white = l.solve_lower_triangular(free)?;
        let half = l.solve_lower_triangular(&l.solve_lower_triangular(&dt)?.transpose())?;
        // ∂(L⁻¹ N) = L⁻¹ ∂N − Φ L⁻¹ N
        let phi = DMatrix::from_fn(half.nrows(), half.ncols(), |i, j| match i.cmp(&j) {
            std::cmp::Ordering::Greater => half[(i, j)],
            std::cmp::Ordering::Equal => 0.5 * half[(i, j)],
            std::cmp::Ordering::Less => 0.0,
        });
        let white_slope = l.solve_lower_triangular(slope)? - phi * &white;
        let mut out = (DMatrix::zeros(count, count), DMatrix::zeros(count, count));
        for (k, row) in rest.iter().enumerate() {
            out.0.set_row(*row, &(white.row(k) * self.sigma[*row]));
            out.1.set_row(*row, &(white_slope.row(k) * self.sigma[*row]));
        }
        Some(out)
    }
}

impl ContactState {
    /// Returns the rows that are left, of the given number.
    fn rest(&self, rows: usize) -> Vec<usize> {
        (0..rows).filter(|row| !self.pivots.contains(row)).collect()
    }
}

/// Returns the columns of what is not measured in a state, and their derivatives.
pub(super) fn unknown(
    state: &ContactState,
    feet: &[&Foot],
    columns: &[Columns],
    rows: usize,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let of_feet = feet
        .iter()
        .zip(columns)
        .flat_map(|(foot, own)| (0..6).filter(|k| !foot.known[*k]).map(move |k| (own, k)));
    let of_feet: Vec<(&Columns, usize)> = of_feet.collect();
    let efforts = state.unknown_efforts.len();
    let mut values = DMatrix::zeros(rows, efforts + of_feet.len());
    let mut slopes = values.clone();
    for (column, freedom) in state.unknown_efforts.iter().enumerate() {
        values[(6 + freedom, column)] = 1.0;
    }
    for (column, (own, k)) in of_feet.into_iter().enumerate() {
        values.set_column(efforts + column, &own.values.column(k));
        slopes.set_column(efforts + column, &own.slopes.column(k));
    }
    (values, slopes)
}

/// Returns `N = [1, −H_r H_p⁺]` over all rows, and its derivative.
fn eliminate(
    values: &DMatrix<f64>,
    slopes: &DMatrix<f64>,
    pivots: &[usize],
    rest: &[usize],
) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut free = DMatrix::zeros(rest.len(), values.nrows());
    let mut change = free.clone();
    for (k, row) in rest.iter().enumerate() {
        free[(k, *row)] = 1.0;
    }
    if pivots.is_empty() || rest.is_empty() {
        return (free, change);
    }
    let own = values.select_rows(pivots);
    let Ok(inverse) = own.clone().pseudo_inverse(RANK * own.amax()) else { return (free, change) };
    let k = values.select_rows(rest) * &inverse;
    // H_r = K H_p
    let dk = (slopes.select_rows(rest) - &k * slopes.select_rows(pivots)) * &inverse;
    for (column, pivot) in pivots.iter().enumerate() {
        free.set_column(*pivot, &-k.column(column));
        change.set_column(*pivot, &-dk.column(column));
    }
    (free, change)
}

impl Availability {
    /// Combines rows of coefficients, `columns` each: `W S − (∂W) D` is smoothed, `W D` differentiated.
    pub(in super::super) fn combine(&self, smoothed: &mut [f64], differentiated: &mut [f64], columns: usize) {
        let rows = self.weights.nrows();
        if smoothed.len() != rows * columns || differentiated.len() != rows * columns {
            return;
        }
        // Row by row is column by column of the transposed.
        let s = nalgebra::DMatrixView::from_slice(smoothed, columns, rows);
        let d = nalgebra::DMatrixView::from_slice(differentiated, columns, rows);
        let (wt, dwt) = (self.weights.transpose(), self.slopes.transpose());
        let to_smooth = s * &wt - d * dwt;
        let to_differentiate = d * wt;
        smoothed.copy_from_slice(to_smooth.as_slice());
        differentiated.copy_from_slice(to_differentiate.as_slice());
    }

    /// Adds the feet's wrenches to what is measured, and combines that.
    pub(in super::super) fn combine_measured(&self, measured: &mut [f64]) {
        let all =
            DVector::from_iterator(measured.len(), measured.iter().zip(&self.ground).map(|(m, g)| m + g));
        measured.copy_from_slice((&self.weights * all).as_slice());
    }
}
