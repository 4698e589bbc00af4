//! Choices one motion after the other: by the determinant of the information, by its least eigenvalue, or by
//! chance.
//!
//! Columns are scaled to unit length over all candidates, so that units do not matter. The information begins
//! with δ on its diagonal: where nothing is known yet, a motion is worth what it adds to the directions that
//! it tells.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::hash::{DefaultHasher, Hash, Hasher};

use nalgebra::{DMatrix, DVector};

use super::{Candidate, SelectionError, check};

/// δ: what each direction is known by before anything is chosen, relative to all candidates together.
pub const BEFOREHAND: f64 = 1e-8;
/// Least eigenvectors that motions are first compared in.
const LEAST: usize = 8;
/// Motions whose least eigenvalue is found exactly.
const EXACT: usize = 10;

/// The triangles of all candidates, columns of unit length over all of them.
struct Scaled {
    triangles: Vec<DMatrix<f64>>,
    columns: usize,
}

impl Scaled {
    fn new(candidates: &[Candidate], count: usize) -> Result<Self, SelectionError> {
        let columns = check(candidates)?;
        if count == 0 {
            return Err(SelectionError::Zero);
        }
        let triangles: Vec<DMatrix<f64>> = candidates.iter().map(|c| c.factor.r()).collect();
        let mut squares = DVector::<f64>::zeros(columns);
        for triangle in &triangles {
            for (sum, column) in squares.iter_mut().zip(triangle.column_iter()) {
                *sum += column.norm_squared();
            }
        }
        let scale = squares.map(|square| if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 });
        let scaled = triangles.into_iter().map(|mut triangle| {
            for (mut column, scale) in triangle.column_iter_mut().zip(&scale) {
                column *= *scale;
            }
            triangle
        });
        Ok(Self { triangles: scaled.collect(), columns })
    }

    fn beginning(&self) -> DMatrix<f64> {
        DMatrix::identity(self.columns, self.columns) * BEFOREHAND
    }
}

/// The information that a motion would add, by the last check of it.
struct Offer {
    gain: f64,
    motion: usize,
    /// The number of motions that were chosen when it was examined.
    seen: usize,
}

impl PartialEq for Offer {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Offer {}
impl PartialOrd for Offer {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Offer {
    fn cmp(&self, other: &Self) -> Ordering {
        self.gain.total_cmp(&other.gain).then(other.motion.cmp(&self.motion))
    }
}

/// Returns the motions that add most to the logarithm of the determinant of the information, one after the
/// other, in the order of their choice: at least `1 − 1/e` of what any choice of the same size adds (G.
/// Nemhauser, L. Wolsey, M. Fisher 1978).
///
/// What a motion adds never grows while others are chosen, so that only the best offers are examined again:
/// some n p³ operations for n motions of p columns, and few more for each choice.
///
/// # Errors
/// [`SelectionError`] if there is nothing to choose from.
pub fn d_optimal(candidates: &[Candidate], count: usize) -> Result<Vec<usize>, SelectionError> {
    let scaled = Scaled::new(candidates, count)?;
    let mut information = scaled.beginning();
    let mut before = log_determinant(information.clone());
    let mut offers: BinaryHeap<Offer> = scaled
        .triangles
        .iter()
        .enumerate()
        .map(|(motion, triangle)| Offer { gain: gain(&information, before, triangle), motion, seen: 0 })
        .collect();
    let mut chosen = Vec::new();
    while chosen.len() < count.min(candidates.len()) {
        let Some(best) = offers.pop() else { break };
        let triangle = &scaled.triangles[best.motion];
        if best.seen == chosen.len() {
            information = added(&information, triangle);
            before = log_determinant(information.clone());
            chosen.push(best.motion);
        } else {
            let gain = gain(&information, before, triangle);
            offers.push(Offer { gain, seen: chosen.len(), ..best });
        }
    }
    Ok(chosen)
}

/// `log det(M + RᵀR) − log det M`, the latter known.
fn gain(information: &DMatrix<f64>, before: f64, triangle: &DMatrix<f64>) -> f64 {
    log_determinant(added(information, triangle)) - before
}

fn log_determinant(m: DMatrix<f64>) -> f64 {
    m.cholesky()
        .map_or(f64::NEG_INFINITY, |c| 2.0 * c.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>())
}

/// `M + RᵀR`; the product of matrices is the fast one.
fn added(information: &DMatrix<f64>, triangle: &DMatrix<f64>) -> DMatrix<f64> {
    let mut sum = information.clone();
    sum.gemm(1.0, &triangle.transpose(), triangle, 1.0);
    sum
}

/// Returns the motions that raise the least eigenvalue of the information most, one after the other, in the
/// order of their choice. Motions are first compared in the directions of the least eigenvalues, the best of
/// them by the least eigenvalue itself.
///
/// # Errors
/// [`SelectionError`] if there is nothing to choose from.
pub fn e_optimal(candidates: &[Candidate], count: usize) -> Result<Vec<usize>, SelectionError> {
    let scaled = Scaled::new(candidates, count)?;
    let mut information = scaled.beginning();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count.min(candidates.len()) {
        let eigen = information.clone().symmetric_eigen();
        let mut order: Vec<usize> = (0..scaled.columns).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        order.truncate(LEAST);
        let directions = eigen.eigenvectors.select_columns(&order);
        let own = DMatrix::from_diagonal(&DVector::from_iterator(
            order.len(),
            order.iter().map(|k| eigen.eigenvalues[*k]),
        ));
        let mut offers: Vec<(f64, usize)> = (0..candidates.len())
            .filter(|k| !chosen.contains(k))
            .map(|k| {
                let gained = &scaled.triangles[k] * &directions;
                ((&own + gained.tr_mul(&gained)).symmetric_eigenvalues().min(), k)
            })
            .collect();
        offers.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let exact = offers.iter().take(EXACT).map(|(_, k)| {
            let triangle = &scaled.triangles[*k];
            (added(&information, triangle).symmetric_eigenvalues().min(), *k)
        });
        let Some((_, best)) = exact.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))) else { break };
        information = added(&information, &scaled.triangles[best]);
        chosen.push(best);
    }
    Ok(chosen)
}

/// Returns the given number of motions by chance; the same for the same seed and names, whatever their order.
///
/// # Errors
/// [`SelectionError`] if there is nothing to choose from.
pub fn random(candidates: &[Candidate], count: usize, seed: u64) -> Result<Vec<usize>, SelectionError> {
    check(candidates)?;
    if count == 0 {
        return Err(SelectionError::Zero);
    }
    let drawn = |name: &str| {
        let mut hash = DefaultHasher::new();
        (seed, name).hash(&mut hash);
        hash.finish()
    };
    let mut all: Vec<usize> = (0..candidates.len()).collect();
    all.sort_by_key(|k| (drawn(&candidates[*k].name), candidates[*k].name.clone()));
    all.truncate(count);
    Ok(all)
}
