//! Noise of the signals as the rows of a test of lack of fit have it.

use std::sync::PoisonError;

use super::{Kept, RowNoise, join};
use crate::Whitener;
use crate::condition::RowBlocks;
use crate::lack_of_fit::NoiseRows;
use crate::linearised::{Columns, Linearised};
use crate::weighing::Weighing;

/// Noise of the signals in the rows as they are weighed, with the columns of nuisance parameters if they are
/// linearised.
pub(crate) struct WhitenedNoise<'a> {
    pub(crate) noise: &'a RowNoise<'a>,
    pub(crate) weighing: &'a Weighing,
    pub(crate) columns: &'a Columns,
    pub(crate) linearised: Option<&'a Linearised<'a>>,
}

impl WhitenedNoise<'_> {
    /// Returns the group of a series, and which repetition of it this is.
    fn place(&self, series: usize) -> Option<(usize, usize)> {
        let groups = self.noise.groups.iter().enumerate();
        groups.flat_map(|(g, group)| (0..group.repetitions.len()).map(move |r| (g, r))).nth(series)
    }

    /// Writes the rows of a block, C × all columns, and what is measured.
    fn write(
        &self,
        (g, r): (usize, usize),
        block: usize,
        kept: Option<&Kept>,
        rows: &mut [f64],
        values: &mut [f64],
    ) {
        rows.fill(0.0);
        values.fill(0.0);
        self.noise.write_own((g, r), block, &mut [], values);
        match (self.linearised, kept) {
            (None, _) => self.noise.write_own((g, r), block, rows, &mut []),
            (Some(linearised), Some(kept)) => {
                self.noise.write_joint((g, r), block, kept, (self.columns, linearised.phi()), rows);
            }
            (Some(linearised), None) => {
                let count = linearised.features();
                let own = self.noise.groups.get(g).and_then(|group| group.repetitions.get(r));
                let features = own.and_then(|own| own.features.get(block * count..(block + 1) * count));
                if let Some(features) = features {
                    linearised.write_of(features, rows, &mut vec![0.0; self.noise.channels]);
                }
            }
        }
    }
}

impl NoiseRows for WhitenedNoise<'_> {
    fn series(&self) -> usize {
        self.noise.groups.iter().map(|group| group.repetitions.len()).sum()
    }

    fn weight(&self, series: usize) -> f64 {
        let Some((g, _)) = self.place(series) else { return 0.0 };
        let Some(group) = self.noise.groups.get(g) else { return 0.0 };
        let sigma = self.weighing.signals.get(g).copied().unwrap_or(group.noise.size());
        sigma * sigma / group.repetitions.len().max(1) as f64
    }

    fn doubt(&self) -> f64 {
        self.weighing.doubt
    }

    fn each(&self, series: usize, visit: &mut dyn FnMut(f64, &[f64])) {
        let Some(place) = self.place(series) else { return };
        let all = self.linearised.map_or(self.noise.parameters, |_| self.columns.all());
        let kept = self.noise.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = kept.as_ref().filter(|_| self.linearised.is_some_and(|l| l.features() == 0));
        let (mut rows, mut values) = (vec![0.0; self.noise.channels * all], vec![0.0; self.noise.channels]);
        let mut whitener = Whitener::new(&self.weighing.whitening, all);
        let mut joined = Vec::new();
        let times = self.noise.groups.get(place.0).and_then(|group| group.repetitions.get(place.1));
        for (block, time_s) in times.iter().flat_map(|own| &own.time_s).enumerate() {
            self.write(place, block, kept, &mut rows, &mut values);
            whitener.apply(*time_s, &mut rows, &mut values, None);
            joined.clear();
            joined.extend(join(&rows, &values));
            visit(*time_s, &joined);
        }
    }
}
