//! What the uncertainty of the skews does to the answer.
//!
//! An error ε of the skews moves the parameters by `S ε`, so the rows say `R (φ − S ε) = z`, and of ε is known that its
//! covariance is `L Lᵀ`. With `ε = L η` each η is one more parameter of unit variance that is eliminated: the answer stays,
//! its covariance grows by `S L Lᵀ Sᵀ`, and a factor that is merged with others takes it along.

use nalgebra::DMatrix;
use rigident_shared::factor::InformationFactor;

use super::{Aligned, Grid, StreamError, StreamSet};
use crate::answer::{Estimate, Noise};
use crate::identification::pooled::PooledFactor;
use crate::identification::prepare::prepare;
use crate::identification::{self, Factor, Identification};

/// Adds what the skews leave uncertain to the factor and the estimate of an identification of `aligned`.
///
/// # Errors
/// As [`super::align`].
pub fn widen(
    set: &StreamSet,
    aligned: &Aligned,
    identification: &mut Identification,
) -> Result<(), StreamError> {
    let skews = &aligned.skews;
    let Some(factor) = skews.covariance.clone().cholesky() else { return Ok(()) };
    let grid = Grid::of(set)?;
    let step_ns = skews.identified.iter().map(|k| {
        let sigma_ns = skews.u95_s.get(*k).map_or(0.0, |u| 1e9 * u / 1.96);
        sigma_ns.clamp(1e3, 5e6).round() as i64
    });
    let slopes: Vec<Vec<f64>> = skews
        .identified
        .iter()
        .zip(step_ns)
        .map(|(k, step_ns)| {
            let instants = grid.instants(set, &skews.late_ns, step_ns)?;
            let values = |step: i64| -> Result<Option<Vec<f64>>, StreamError> {
                let mut late_ns = skews.late_ns.clone();
                if let Some(late) = late_ns.get_mut(*k) {
                    *late += step;
                }
                let streams = grid.all(set, &instants, &late_ns);
                let input = prepare(&grid.recording(set, &instants, &streams))?.input;
                // Nothing to compare where nothing could be identified.
                Ok(identification::identify(&input).ok().map(|found| found.estimate.values.clone()))
            };
            let (before, after) = (values(-step_ns)?, values(step_ns)?);
            let pairs = before.unwrap_or_default().into_iter().zip(after.unwrap_or_default());
            Ok(pairs.map(|(b, a)| (a - b) / (2e-9 * step_ns as f64)).collect())
        })
        .collect::<Result<_, StreamError>>()?;
    let run = PooledFactor::of(identification, &aligned.prepared.input, &aligned.recording.name);
    let judgement = run.judgement(run.factor.determined());
    let (scale, noise) = (judgement.variance_scale, judgement.noise);
    let determined = identification.estimate.determined.clone();
    let moves = |l: &DMatrix<f64>| -> Vec<Vec<f64>> {
        (0..l.ncols())
            .map(|j| {
                (0..determined.len())
                    .map(|i| {
                        let slope = |k: usize| slopes.get(k).and_then(|s| s.get(i)).copied().unwrap_or(0.0);
                        let free = determined.get(i) != Some(&true);
                        if free { 0.0 } else { (0..l.nrows()).map(|k| slope(k) * l[(k, j)]).sum() }
                    })
                    .collect()
            })
            .collect()
    };
    let moves = moves(&factor.l());
    match &identification.factor {
        Factor::Ten(f) => {
            let (f, estimate) = uncertain::<10, 11>(f, &moves, scale, noise);
            (identification.factor, identification.estimate) = (Factor::Ten(Box::new(f)), estimate);
        }
        Factor::Sixteen(f) => {
            let (f, estimate) = uncertain::<16, 17>(f, &moves, scale, noise);
            (identification.factor, identification.estimate) = (Factor::Sixteen(Box::new(f)), estimate);
        }
    }
    Ok(())
}

/// `M = N + 1`. The prior of η is no noise, so the rows are scaled and it is not.
fn uncertain<const N: usize, const M: usize>(
    factor: &InformationFactor<f64, N>,
    moves: &[Vec<f64>],
    scale: f64,
    noise: Noise,
) -> (InformationFactor<f64, N>, Estimate) {
    let mut rows = factor.cast(|v| v / scale.sqrt());
    for column in moves {
        let mut joint = rows.substitute::<M>(&std::array::from_fn(|i| {
            std::array::from_fn(|j| match j {
                0 => -column.get(i).copied().unwrap_or(0.0),
                _ => f64::from(u8::from(j == i + 1)),
            })
        }));
        let count = rows.rows();
        let mut prior = [[0.0; 1]; M];
        prior[0] = [1.0];
        joint.absorb(&prior, &[0.0]);
        // A row of what is known beforehand is none of the data's.
        let eliminated = joint.trailing::<N>();
        rows = InformationFactor::from_entries(eliminated.entries().collect::<Vec<_>>(), count)
            .unwrap_or(eliminated);
    }
    let estimate = Estimate::new(&rows, 1.0, noise);
    (rows.cast(|v| v * scale.sqrt()), estimate)
}
