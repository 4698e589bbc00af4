//! Skews by the rows of a source: what a tree of links has in place of a body's two equations.
//!
//! The rows `y = A φ` hold once every stream is on one time base. With the stamps of stream k late by `τ_k`
//! more than was taken off they leave `e = y − A φ`, and to first order `e = −(∂e/∂τ) δτ + A δφ`:
//! Gauss-Newton on skews and parameters together, the slopes by central differences.

use nalgebra::{DMatrix, DVector};

use super::least_squares::Fit;
use super::skew::STEP_NS;
use super::{Grid, Pose, StreamError, StreamSet};
use rigident_fit::Silent;
use rigident_io::recording::Recording;

/// Filtered rows, an instant each, and the filter's noise gain.
struct Rows {
    blocks: Vec<(DMatrix<f64>, DVector<f64>)>,
    noise_gain: f64,
}

impl Rows {
    fn of(recording: &Recording, pose: &Pose<'_>) -> Result<Self, StreamError> {
        let source = pose(recording)?;
        let (channels, parameters) = (source.channels().len(), source.parameters().len());
        let made = source.condition(&Silent).map_err(|error| StreamError::Rows(error.to_string()))?;
        let count = made.parts().iter().map(|part| part.end).max().unwrap_or(0);
        let (mut rows, mut measured) = (vec![0.0; channels * parameters], vec![0.0; channels]);
        let blocks = (0..count).map(|block| {
            made.write(block, &mut rows, &mut measured);
            (DMatrix::from_row_slice(channels, parameters, &rows), DVector::from_column_slice(&measured))
        });
        Ok(Self { blocks: blocks.collect(), noise_gain: made.filter().noise_gain.min(1.0) })
    }
}

/// Returns one step of the skews of the streams `free`, and the noise gain of the filter. `phi` are the
/// parameters that the slopes are taken at, `None` at the first step.
///
/// # Errors
/// [`StreamError`] if the streams have too little in common, or make no rows.
pub(super) fn step(
    set: &StreamSet,
    grid: &Grid,
    free: &[usize],
    late_ns: &[i64],
    pose: &Pose<'_>,
    phi: &mut Option<DVector<f64>>,
) -> Result<(Fit, f64), StreamError> {
    let instants = grid.instants(set, late_ns, STEP_NS)?;
    let streams = grid.all(set, &instants, late_ns);
    let rows = Rows::of(&grid.recording(set, &instants, &streams), pose)?;
    let about = phi.take().unwrap_or_else(|| Fit::new(&rows.blocks, 0).solution);
    let mut slopes: Vec<Vec<DVector<f64>>> = Vec::new();
    for k in free {
        let residuals = |step: i64| -> Result<Vec<DVector<f64>>, StreamError> {
            let (Some(stream), Some(late)) = (set.streams.get(*k), late_ns.get(*k)) else {
                return Ok(Vec::new());
            };
            let moved = grid.resample(set, stream, &instants, late + step);
            let all = streams.iter().enumerate().map(|(i, s)| if i == *k { &moved } else { s });
            let rows = Rows::of(&grid.recording(set, &instants, all), pose)?;
            Ok(rows.blocks.iter().map(|(a, y)| y - a * &about).collect())
        };
        let pairs = residuals(-STEP_NS)?.into_iter().zip(residuals(STEP_NS)?);
        slopes.push(pairs.map(|(before, after)| (before - after) / (2e-9 * STEP_NS as f64)).collect());
    }
    let design: Vec<(DMatrix<f64>, DVector<f64>)> = rows
        .blocks
        .into_iter()
        .enumerate()
        .map(|(t, (a, y))| {
            let mut wide = a.insert_columns(0, slopes.len(), 0.0);
            for (i, slope) in slopes.iter().enumerate() {
                if let Some(slope) = slope.get(t) {
                    wide.set_column(i, slope);
                }
            }
            (wide, y)
        })
        .collect();
    let fit = Fit::new(&design, free.len());
    *phi = Some(fit.solution.rows(free.len(), about.len()).into_owned());
    Ok((fit, rows.noise_gain))
}
