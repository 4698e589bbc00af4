//! The estimate as rows come in, on the way to the one that a fit ends at.

use super::compensation::{NoiseGram, compensate};
use super::linearised::Columns;
use super::weighing::Weighing;
use super::{BlockResidual, Convergence, Estimate, Factor, Noise, RowBlocks, parallel};

/// Operations that all points together may take, in cubes of the number of parameters.
const MOST_CUBES: f64 = 2e7;

/// Returns the blocks between two points, so that there are about as many as wished and their cost stays
/// bounded; zero: no points.
pub(super) fn every(blocks: &dyn RowBlocks, points: usize, parameters: usize) -> usize {
    if points == 0 {
        return 0;
    }
    // As many as there are without gaps.
    let blocks = blocks.counts().samples as usize / usize::from(blocks.filter().every).max(1);
    let most = (MOST_CUBES / (parameters as f64).powi(3)).max(1.0) as usize;
    (blocks / points.min(most).max(1)).max(1)
}

/// The way to a result: rows weighed, and intervals scaled, as they are there.
pub(super) struct Way<'a> {
    pub(super) blocks: &'a dyn RowBlocks,
    pub(super) rounding: f64,
    pub(super) weighing: &'a Weighing,
    /// The addition of the noise of the signals to the normal equations of all rows.
    pub(super) noise_gram: Option<NoiseGram<'a>>,
    pub(super) weights: Option<&'a [f64]>,
    /// Nuisance parameters whose columns the blocks have; `None`: they have none.
    pub(super) columns: Option<&'a Columns>,
    pub(super) parameters: usize,
    /// The factor of the variance of the noise.
    pub(super) scale: f64,
    pub(super) noise: Noise,
}

impl Way<'_> {
    fn columns(&self) -> usize {
        self.columns.map_or(self.parameters, Columns::all)
    }

    fn rows(&self, range: std::ops::Range<usize>) -> Factor {
        self.blocks.absorb(range, self.columns(), &self.weighing.whitening, self.weights)
    }

    fn estimate(&self, rows: &Factor, share: f64) -> Estimate {
        // Beside what is known beforehand the noise is scaled first, else in the end.
        let (rows, left) = match self.columns {
            Some(_) => (rows.discount(self.scale), 1.0),
            None => (rows.clone(), self.scale),
        };
        let noise = self.noise_gram.map(|whole| NoiseGram {
            times: share * left / self.scale,
            spread: whole.spread / share.sqrt(),
            ..whole
        });
        let rows = match noise {
            Some(noise) => compensate(&rows, &noise, self.rounding).map_or(rows, |own| own.factor),
            None => rows,
        };
        let known = self.columns.map_or(rows.clone(), |columns| columns.with_prior(&rows));
        let own = if self.columns.is_some() { known.leading(self.parameters) } else { known };
        Estimate::new(&own, self.rounding, left, self.noise)
    }

    /// Returns about the given number of estimates on the way.
    pub(super) fn points(&self, points: usize) -> Vec<Convergence> {
        let count = self.blocks.len();
        let every = every(self.blocks, points, self.columns());
        if every == 0 {
            return Vec::new();
        }
        let steps: Vec<std::ops::Range<usize>> =
            (0..count / every).map(|k| k * every..(k + 1) * every).collect();
        let rows = parallel::map(parallel::threads(), steps.len(), |k| {
            self.rows(steps.get(k).cloned().unwrap_or_default())
        });
        let mut all = Factor::new(self.columns());
        let mut way = Vec::new();
        for (step, rows) in steps.iter().zip(rows) {
            if all.rows() == 0 {
                all = rows
            } else {
                all.merge(&rows)
            }
            let estimate = self.estimate(&all, step.end as f64 / count as f64);
            way.push(Convergence {
                time_s: self.blocks.time_s(step.end.saturating_sub(1)),
                parameters: (0..self.parameters).map(|j| estimate.measured(j)).collect(),
            });
        }
        way
    }
}

/// Makes the result itself the last point.
pub(super) fn end_at(way: &mut Vec<Convergence>, residuals: &[BlockResidual], estimate: &Estimate) {
    let (Some(last), Some(point)) = (residuals.last(), way.last()) else { return };
    let time_s = last.time_s.max(point.time_s);
    if point.time_s >= last.time_s {
        way.pop();
    }
    let parameters = (0..estimate.len()).map(|j| estimate.measured(j)).collect();
    way.push(Convergence { time_s, parameters });
}
