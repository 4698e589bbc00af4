//! Directions of an information matrix that rows see, and those of them that noise could fill.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A direction with less than this of its column's information is not seen.
pub(super) const LEAST: f64 = 1e-9;
/// Noise that could be more than this share of what is known of a direction fills it.
const FILLED: f64 = 0.1;

/// Returns directions of unit information, a column each, that span all that is seen; `None` if that is
/// nothing, or no number.
pub(super) fn seen(known: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = known.nrows();
    let scale = known.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(n, n, |i, j| known[(i, j)] * scale[i] * scale[j]);
    if n == 0 || !scaled.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(scaled);
    let most = eigen.eigenvalues.max();
    let seen: Vec<usize> = (0..n).filter(|k| eigen.eigenvalues[*k] > LEAST * most).collect();
    Some(DMatrix::from_fn(n, seen.len(), |j, k| {
        eigen.eigenvectors[(j, seen[k])] * scale[j] / eigen.eigenvalues[seen[k]].sqrt()
    }))
}

/// Returns the directions among those of unit information in which noise could be more than its share.
pub(super) fn filled(unit: &DMatrix<f64>, could: &DMatrix<f64>) -> Vec<DVector<f64>> {
    if !could.iter().all(|v| v.is_finite()) {
        return Vec::new();
    }
    let shares = SymmetricEigen::new(unit.tr_mul(&(could * unit)));
    let with = shares.eigenvalues.iter().zip(shares.eigenvectors.column_iter());
    with.filter(|(share, _)| **share > FILLED).map(|(_, v)| unit * v).collect()
}
