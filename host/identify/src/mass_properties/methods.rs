//! Ways to solve `A ψ = d` where rows tell little: truncated singular values, bounded gradient, active set,
//! ridge.

use nalgebra::{DMatrix, DVector};

use super::unknowns::{Equations, Unknowns};

/// Singular values below this share of the largest are rounding.
const ROUNDING: f64 = 1e-12;
/// A gradient's component is zero below this share of the first gradient.
const SETTLED: f64 = 1e-10;

/// A way to solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Singular values below the largest over `condition` are left out: the part of ψ that is determined
    /// better (equation 21).
    Truncated {
        /// The largest condition number.
        condition: f64,
    },
    /// Conjugate gradients from ψ = 0 with masses held above their bounds, stopped after this many steps.
    Gradient {
        /// Steps.
        steps: usize,
    },
    /// The least squares under the same bounds, by an active set: where the gradient method ends.
    Bounded,
    /// Least squares beside `ψ = 0 ± scale/weight`: the nominal model counts as this many rows.
    Ridge {
        /// Weight of the nominal model.
        weight: f64,
    },
}

impl Method {
    /// Returns ψ.
    pub fn solve(self, equations: &Equations, unknowns: &Unknowns) -> DVector<f64> {
        let (rows, values) = (&equations.rows, &equations.values);
        match self {
            Self::Truncated { condition } => truncated(rows, values, condition).0,
            Self::Gradient { steps } => gradient(rows, values, &unknowns.lower, steps),
            Self::Bounded => bounded(rows, values, &unknowns.lower),
            Self::Ridge { weight } => ridge(rows, values, &unknowns.scale, weight),
        }
    }
}

/// Returns the shortest ψ of the singular values above the largest over `condition`, and how many these are.
pub fn truncated(rows: &DMatrix<f64>, values: &DVector<f64>, condition: f64) -> (DVector<f64>, usize) {
    let svd = rows.clone().svd(true, true);
    let (Some(u), Some(vt)) = (&svd.u, &svd.v_t) else { return (DVector::zeros(rows.ncols()), 0) };
    let least = svd.singular_values.max() / condition;
    let mut psi = DVector::zeros(rows.ncols());
    let mut kept = 0;
    for (k, size) in svd.singular_values.iter().enumerate().filter(|(_, size)| **size > least) {
        psi += vt.row(k).transpose() * (u.column(k).dot(values) / size);
        kept += 1;
    }
    (psi, kept)
}

/// Returns ψ after some steps of conjugate gradients on `‖A ψ − d‖²` from zero, none below its bound. A step
/// ends at the first bound, and directions start anew where the set of bounds that hold changes.
pub fn gradient(rows: &DMatrix<f64>, values: &DVector<f64>, lower: &[f64], steps: usize) -> DVector<f64> {
    let mut psi = DVector::zeros(rows.ncols());
    let mut left = values.clone();
    let mut held = vec![false; lower.len()];
    let mut direction: Option<(DVector<f64>, f64)> = None;
    let mut first = 0.0_f64;
    for _ in 0..steps {
        let mut slope = rows.tr_mul(&left);
        first = first.max(slope.amax());
        for (k, lower) in lower.iter().enumerate() {
            let holds = psi[k] <= *lower && slope[k] < 0.0;
            if holds != held[k] {
                (held[k], direction) = (holds, None);
            }
            if holds {
                slope[k] = 0.0;
            }
        }
        let square = slope.norm_squared();
        if slope.amax() <= SETTLED * first {
            break;
        }
        let along = match direction.take() {
            Some((before, size)) => &slope + before * (square / size),
            None => slope,
        };
        let moved = rows * &along;
        let wanted = left.dot(&moved) / moved.norm_squared().max(f64::MIN_POSITIVE);
        let bounds = lower.iter().enumerate().filter(|(k, _)| along[*k] < 0.0 && !held[*k]);
        let ends = bounds.map(|(k, lower): (usize, &f64)| (k, *lower, (lower - psi[k]) / along[k]));
        let ends: Vec<(usize, f64, f64)> = ends.collect();
        let end = ends.into_iter().min_by(|a, b| a.2.total_cmp(&b.2)).filter(|(.., length)| *length < wanted);
        let length = end.map_or(wanted, |(.., length)| length.max(0.0));
        psi += &along * length;
        left -= moved * length;
        match end {
            Some((k, lower, _)) => psi[k] = lower,
            None => direction = Some((along, square)),
        }
    }
    psi
}

/// Returns the shortest of ψ that make `‖A ψ − d‖` least with the bounded unknowns above their bounds: those
/// without a bound are projected out, and the others found by the active set of Lawson and Hanson (*Solving
/// Least Squares Problems*, 1974, chapter 23).
pub fn bounded(rows: &DMatrix<f64>, values: &DVector<f64>, lower: &[f64]) -> DVector<f64> {
    let (held, free): (Vec<usize>, Vec<usize>) = (0..rows.ncols()).partition(|k| lower[*k].is_finite());
    let start = DVector::from_iterator(held.len(), held.iter().map(|k| lower[*k]));
    let of_held = rows.select_columns(&held);
    let shifted = values - &of_held * &start;
    let of_free = rows.select_columns(&free);
    let onto = |matrix: &DMatrix<f64>| -> DMatrix<f64> {
        if free.is_empty() {
            return matrix.clone();
        }
        let svd = of_free.clone().svd(true, false);
        let Some(u) = svd.u else { return matrix.clone() };
        let least = ROUNDING * svd.singular_values.max();
        let kept: Vec<usize> =
            (0..svd.singular_values.len()).filter(|k| svd.singular_values[*k] > least).collect();
        let u = u.select_columns(&kept);
        matrix - &u * u.tr_mul(matrix)
    };
    let projected = onto(&DMatrix::from_column_slice(shifted.len(), 1, shifted.as_slice()));
    let above = nonnegative(&onto(&of_held), &projected.column(0).into_owned());
    let rest = truncated(&of_free, &(&shifted - &of_held * &above), 1.0 / ROUNDING).0;
    let mut psi = DVector::zeros(rows.ncols());
    held.iter().enumerate().for_each(|(k, column)| psi[*column] = start[k] + above[k]);
    free.iter().enumerate().for_each(|(k, column)| psi[*column] = rest[k]);
    psi
}

/// Returns x ≥ 0 that makes `‖A x − b‖` least.
fn nonnegative(rows: &DMatrix<f64>, values: &DVector<f64>) -> DVector<f64> {
    let count = rows.ncols();
    let mut x = DVector::zeros(count);
    let mut passive: Vec<usize> = Vec::new();
    let first = rows.tr_mul(values).amax();
    // Each step takes one in; the bound on the steps is that of the chapter.
    for _ in 0..3 * count {
        let slope = rows.tr_mul(&(values - rows * &x));
        let candidates = (0..count).filter(|k| !passive.contains(k));
        let Some(next) = candidates.max_by(|a, b| slope[*a].total_cmp(&slope[*b])) else { break };
        if slope[next] <= SETTLED * first {
            break;
        }
        passive.push(next);
        for _ in 0..count {
            let found = truncated(&rows.select_columns(&passive), values, 1.0 / ROUNDING).0;
            if found.iter().all(|v| *v > 0.0) {
                x.fill(0.0);
                passive.iter().zip(found.iter()).for_each(|(k, v)| x[*k] = *v);
                break;
            }
            // As far towards what was found as nothing goes below zero.
            let shares = passive.iter().zip(found.iter()).filter(|(_, v)| **v <= 0.0);
            let share = shares.map(|(k, v)| x[*k] / (x[*k] - v).max(f64::MIN_POSITIVE)).fold(1.0, f64::min);
            passive.iter().zip(found.iter()).for_each(|(k, v)| x[*k] += share * (v - x[*k]));
            let largest = x.amax();
            passive.retain(|k| x[*k] > ROUNDING * largest);
            (0..count).filter(|k| !passive.contains(k)).for_each(|k| x[k] = 0.0);
        }
    }
    x
}

/// Returns ψ of least `‖A ψ − d‖² + weight² Σ (ψ/scale)²`.
pub fn ridge(rows: &DMatrix<f64>, values: &DVector<f64>, scale: &[f64], weight: f64) -> DVector<f64> {
    let (m, n) = rows.shape();
    let mut stacked = DMatrix::zeros(m + n, n);
    for (k, size) in scale.iter().enumerate() {
        stacked.view_mut((0, k), (m, 1)).copy_from(&(rows.column(k) * *size));
        stacked[(m + k, k)] = weight;
    }
    let mut target = DVector::zeros(m + n);
    target.rows_mut(0, m).copy_from(values);
    let qr = stacked.qr();
    let solved = qr.r().solve_upper_triangular(&qr.q().tr_mul(&target));
    let solved = solved.unwrap_or_else(|| DVector::zeros(n));
    DVector::from_iterator(n, solved.iter().zip(scale).map(|(v, size)| v * size))
}
