//! The effect of the uncertainty of the clocks of several files on an estimate.

use super::{Aligned, Grid, Pose, StreamError, StreamSet};
use rigident_fit::{COVERAGE_95, FitOptions, Silent, fit};

/// Returns the columns by which errors of the clocks, independent and of unit variance, move the estimate.
///
/// An error ε of the skews moves it by `S ε`, and the covariance of ε is `L Lᵀ`: the columns are those of
/// `S L`. S is found by central differences: the streams aligned anew with each clock shifted by its σ, and
/// fitted.
///
/// # Errors
/// [`StreamError`] if shifted streams have nothing in common.
pub fn moves(set: &StreamSet, aligned: &Aligned, pose: &Pose<'_>) -> Result<Vec<Vec<f64>>, StreamError> {
    let skews = &aligned.skews;
    let Some(factor) = skews.covariance.clone().cholesky() else { return Ok(Vec::new()) };
    let grid = Grid::of(set)?;
    let mut slopes: Vec<Vec<f64>> = Vec::new();
    for k in &skews.identified {
        let sigma_ns = skews.u95_s.get(*k).map_or(0.0, |u| 1e9 * u / COVERAGE_95);
        let step_ns = sigma_ns.clamp(1e3, 5e6).round() as i64;
        let instants = grid.instants(set, &skews.late_ns, step_ns)?;
        let values = |step: i64| -> Result<Vec<f64>, StreamError> {
            let mut late_ns = skews.late_ns.clone();
            if let Some(late) = late_ns.get_mut(*k) {
                *late += step;
            }
            let streams = grid.all(set, &instants, &late_ns);
            let source = pose(&grid.recording(set, &instants, &streams))?;
            // Nothing to compare where nothing could be identified.
            Ok(fit(&*source, &FitOptions::default(), &Silent)
                .map_or_else(|_| Vec::new(), |f| f.estimate.unjudged().values.to_vec()))
        };
        let (before, after) = (values(-step_ns)?, values(step_ns)?);
        let pairs = before.into_iter().zip(after);
        slopes.push(pairs.map(|(b, a)| (a - b) / (2e-9 * step_ns as f64)).collect());
    }
    let parameters = slopes.iter().map(Vec::len).max().unwrap_or(0);
    let l = factor.l();
    let entry = |i: usize, j: usize| {
        let of = |k: usize| slopes.get(k).and_then(|s| s.get(i)).copied().unwrap_or(0.0);
        (0..l.nrows()).map(|k| of(k) * l[(k, j)]).sum()
    };
    Ok((0..l.ncols()).map(|j| (0..parameters).map(|i| entry(i, j)).collect()).collect())
}
