//! The estimate as rows come in, on the way to the one that a fit ends at.

use super::gains::ChannelFactors;
use super::{BlockResidual, Channel, Convergence, Estimate, Factor, Noise, RowBlocks, Whitening, parallel};

/// Operations that all points together may take, in cubes of the number of parameters.
const MOST_CUBES: f64 = 2e7;

/// Returns the blocks between two points, so that there are about as many as wished and their cost stays bounded; zero: no
/// points.
pub(super) fn every(blocks: &dyn RowBlocks, points: usize, parameters: usize) -> usize {
    if points == 0 {
        return 0;
    }
    // As many as there are without gaps.
    let blocks = blocks.counts().samples as usize / usize::from(blocks.filter().every).max(1);
    let most = (MOST_CUBES / (parameters as f64).powi(3)).max(1.0) as usize;
    (blocks / points.min(most).max(1)).max(1)
}

/// The way to a result: rows weighted, and intervals scaled, as they are there.
pub(super) struct Way<'a> {
    pub(super) blocks: &'a dyn RowBlocks,
    pub(super) parameters: usize,
    pub(super) rounding: f64,
    pub(super) whitening: &'a Whitening,
    /// What multiplies each channel where gains are uncertain.
    pub(super) channel_weights: Vec<f64>,
    pub(super) weights: Option<&'a [f64]>,
    /// Where gains are uncertain.
    pub(super) channels: Option<&'a [Channel]>,
    /// What the covariance is multiplied by.
    pub(super) scale: f64,
    pub(super) noise: Noise,
}

/// All rows up to a point: one factor, or one a channel where gains are uncertain.
enum Rows<'a> {
    All(Factor),
    ByChannel(ChannelFactors<'a>),
}

impl<'a> Way<'a> {
    fn rows(&self, range: std::ops::Range<usize>) -> Rows<'a> {
        match self.channels {
            None => Rows::All(self.blocks.absorb(range, self.parameters, self.whitening, self.weights)),
            Some(channels) => {
                Rows::ByChannel(ChannelFactors::of_range(self.blocks, range, self.parameters, channels))
            }
        }
    }

    fn estimate(&self, rows: &Rows) -> Estimate {
        match rows {
            Rows::All(factor) => Estimate::new(factor, self.rounding, self.scale, self.noise),
            Rows::ByChannel(factors) => {
                let (factor, _) = factors.fit(&self.channel_weights, self.rounding);
                Estimate::new(&factor, self.rounding, self.scale, self.noise)
            }
        }
    }

    /// Returns about so many estimates on the way.
    pub(super) fn points(&self, points: usize) -> Vec<Convergence> {
        let count = self.blocks.len();
        let every = every(self.blocks, points, self.parameters);
        if every == 0 {
            return Vec::new();
        }
        let steps: Vec<std::ops::Range<usize>> =
            (0..count / every).map(|k| k * every..(k + 1) * every).collect();
        let rows = parallel::map(parallel::threads(), steps.len(), |k| {
            self.rows(steps.get(k).cloned().unwrap_or_default())
        });
        let mut so_far: Option<Rows> = None;
        let mut way = Vec::new();
        for (step, rows) in steps.iter().zip(rows) {
            let all = match (so_far.take(), rows) {
                (Some(Rows::All(mut all)), Rows::All(rows)) => {
                    all.merge(&rows);
                    Rows::All(all)
                }
                (Some(Rows::ByChannel(mut all)), Rows::ByChannel(rows)) => {
                    all.merge(&rows);
                    Rows::ByChannel(all)
                }
                (_, rows) => rows,
            };
            let estimate = self.estimate(&all);
            way.push(Convergence {
                time_s: self.blocks.time_s(step.end.saturating_sub(1)),
                parameters: (0..self.parameters).map(|j| estimate.measured(j)).collect(),
            });
            so_far = Some(all);
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
