//! Rows that noise of the signals makes: half the difference of those with noise of either sign.

use std::ops::Range;

use super::{Group, MOST_REPETITIONS};
use crate::linearised::DRIFTS;
use crate::{FitError, RowBlocks, RowSource, SignalNoise, Silent, parallel};

/// Samples by which it is seen whether noise is felt at all,
const TRIAL: usize = 500;
/// as it is by a column that it changes by more than this share: the square is lost in any noise of the
/// measured side.
const LEAST_CHANGE: f64 = 1e-7;

/// A source with noise in its signals, and its row blocks.
pub(super) type Noisy<'a> = (Box<dyn RowSource + 'a>, Box<dyn RowBlocks>);

/// Rows that noise of unit σ makes.
pub(super) struct Difference<'a> {
    pub(super) time_s: Vec<f64>,
    /// By blocks: C rows of the columns reached.
    pub(super) rows: Vec<f64>,
    /// Noise of either sign, where there are nuisance parameters and the blocks have no features.
    pub(super) both: Option<[Noisy<'a>; 2]>,
    /// By blocks: what noise of unit σ makes of the features and of the drift, which is nothing.
    pub(super) features: Vec<f64>,
}

impl<'a> Difference<'a> {
    /// Returns half the difference of rows of n parameters and the measured side, with noise of either sign
    /// of the size `sigma`, as of unit noise.
    fn of([(_, more), (_, less)]: &[Noisy<'a>; 2], n: usize, channels: usize, sigma: f64) -> Self {
        let count = more.len().min(less.len());
        let mut rows = Vec::with_capacity(count * channels * (n + 1));
        let (mut own, mut other) = (vec![0.0; channels * n], vec![0.0; channels * n]);
        let (mut value, mut other_value) = (vec![0.0; channels], vec![0.0; channels]);
        for block in 0..count {
            more.write(block, &mut own, &mut value);
            less.write(block, &mut other, &mut other_value);
            for c in 0..channels {
                let pairs = own[c * n..(c + 1) * n].iter().zip(&other[c * n..(c + 1) * n]);
                rows.extend(pairs.chain([(&value[c], &other_value[c])]).map(|(a, b)| 0.5 * (a - b) / sigma));
            }
        }
        let time_s = (0..count).map(|block| more.time_s(block)).collect();
        Self { time_s, rows, both: None, features: Vec::new() }
    }

    /// Keeps what the columns of nuisance parameters have of noise in, too. The recording's own blocks have
    /// `count` features.
    fn with_nuisances(mut self, both: [Noisy<'a>; 2], sigma: f64, count: usize) -> Self {
        let [(_, more), (_, less)] = &both;
        if count == 0 {
            self.both = Some(both);
            return self;
        }
        let (mut own, mut other) = (vec![0.0; count], vec![0.0; count]);
        for block in 0..self.len() {
            more.write_features(block, &mut own);
            less.write_features(block, &mut other);
            self.features.extend(own.iter().zip(&other).map(|(a, b)| 0.5 * (a - b) / sigma));
            self.features.extend([0.0; DRIFTS]);
        }
        self
    }

    /// Keeps some of `width` columns.
    pub(super) fn keep(&mut self, columns: &[usize], width: usize) {
        let rows = self.rows.chunks_exact(width);
        self.rows = rows.flat_map(|row| columns.iter().map(|j| row[*j])).collect();
    }

    pub(super) fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Returns true if noise of this size changes a parameter's column of these lengths, root mean square of
    /// all rows, by more than rounding.
    fn is_felt(&self, lengths: &[f64], size: f64) -> bool {
        let width = lengths.len() + 1;
        let rows = (self.rows.len() / width).max(1) as f64;
        lengths.iter().enumerate().any(|(j, length)| {
            let square: f64 = self.rows.iter().skip(j).step_by(width).map(|a| a * a).sum();
            size * (square / rows).sqrt() > LEAST_CHANGE * length
        })
    }
}

/// The making of noise in the rows of a source, by groups of signals.
pub(super) struct Differences<'a> {
    source: &'a dyn RowSource,
    noise: Vec<SignalNoise>,
    /// How many features the recording's own blocks have, if columns of nuisance parameters have noise too.
    features: Option<usize>,
}

impl<'a> Differences<'a> {
    pub(super) fn of(source: &'a dyn RowSource, features: Option<usize>) -> Self {
        Self { source, noise: source.signal_noise(), features }
    }

    fn size(&self, group: usize) -> f64 {
        self.noise.get(group).map_or(0.0, SignalNoise::size)
    }

    /// Returns some samples of the source with noise of this σ in one group; `None` if it knows of none.
    fn noisy(
        &self,
        group: usize,
        sigma: f64,
        samples: Range<usize>,
        seed: usize,
    ) -> Result<Option<Noisy<'a>>, FitError> {
        let sigma: Vec<f64> = (0..self.noise.len()).map(|j| if j == group { sigma } else { 0.0 }).collect();
        let noisy = self.source.with_signal_noise(samples, &sigma, seed as u64);
        let Some(noisy) = noisy else { return Ok(None) };
        let blocks = noisy.condition(&Silent)?;
        Ok(Some((noisy, blocks)))
    }

    /// Returns the rows that noise of a group makes in some samples; `None` if there are none.
    fn difference(
        &self,
        group: usize,
        samples: &Range<usize>,
        seed: usize,
    ) -> Result<Option<Difference<'a>>, FitError> {
        let size = self.size(group);
        let with = |sign: f64| self.noisy(group, sign * size, samples.clone(), seed);
        let (Some(more), Some(less)) = (with(1.0)?, with(-1.0)?) else { return Ok(None) };
        let both = [more, less];
        let (n, channels) = (self.source.parameters().len(), self.source.channels().len());
        let difference = Difference::of(&both, n, channels, size);
        if difference.len() == 0 {
            return Ok(None);
        }
        Ok(Some(match self.features {
            Some(count) => difference.with_nuisances(both, size, count),
            None => difference,
        }))
    }

    /// Returns the groups whose noise changes columns of these lengths at the beginning of some samples.
    pub(super) fn felt(&self, samples: &Range<usize>, lengths: &[f64]) -> Result<Vec<usize>, FitError> {
        let trial = samples.start..samples.end.min(samples.start + TRIAL);
        let tried: Vec<Result<bool, FitError>> = parallel::map(parallel::threads(), self.noise.len(), |k| {
            let size = self.size(k);
            if size <= 0.0 {
                return Ok(false);
            }
            Ok(self.difference(k, &trial, 0)?.is_none_or(|d| d.is_felt(lengths, size)))
        });
        let mut felt = Vec::new();
        for (k, is_felt) in tried.into_iter().enumerate() {
            if is_felt? {
                felt.push(k);
            }
        }
        Ok(felt)
    }

    /// Returns the rows that noise of some groups makes, each so often; `None` if there are none of a group.
    pub(super) fn groups(
        &self,
        felt: &[usize],
        samples: &Range<usize>,
        repetitions: usize,
    ) -> Result<Option<Vec<Group<'a>>>, FitError> {
        let made = parallel::map(parallel::threads(), felt.len() * repetitions, |job| {
            let (k, own) = (felt.get(job / repetitions).copied().unwrap_or(0), job % repetitions);
            self.difference(k, samples, k * MOST_REPETITIONS + own)
        });
        let mut made = made.into_iter();
        let mut groups = Vec::new();
        for k in felt {
            let own: Result<Vec<Option<Difference<'a>>>, FitError> =
                made.by_ref().take(repetitions).collect();
            let own: Option<Vec<Difference<'a>>> = own?.into_iter().collect();
            let (Some(own), Some(noise)) = (own, self.noise.get(*k)) else { return Ok(None) };
            groups.push(Group::new(noise.clone(), own, self.source.parameters().len()));
        }
        Ok(Some(groups))
    }
}
