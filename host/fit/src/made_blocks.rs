//! Row blocks of long recordings: made of the samples again, a run of blocks at a time.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::condition::{StoredBlocks, Walk};
use super::{Filter, FitError, Progress, RowBlocks, RowSource, SampleCounts, Silent};

/// Coefficients that are held at a time: 64 MB.
const KEPT: usize = 8_000_000;

/// Row blocks of which one run is stored; a recording of one run is stored whole.
pub struct MadeBlocks<'a, S: RowSource + ?Sized> {
    source: &'a S,
    filter: Filter,
    counts: SampleCounts,
    parts: Vec<Range<usize>>,
    time_s: Vec<f64>,
    /// Blocks of a run.
    run: usize,
    /// The first sample under the filter of each run's first block.
    starts: Vec<usize>,
    /// Blocks and channels that tell nothing.
    missing: HashSet<(usize, usize)>,
    kept: Mutex<(usize, StoredBlocks)>,
}

impl<'a, S: RowSource + ?Sized> MadeBlocks<'a, S> {
    /// Filters the samples of a source.
    ///
    /// # Errors
    /// [`FitError::Filter`] if there is no such filter at the source's rate.
    pub fn new(source: &'a S, progress: &dyn Progress) -> Result<Self, FitError> {
        Self::in_runs(source, KEPT, progress)
    }

    fn in_runs(source: &'a S, kept: usize, progress: &dyn Progress) -> Result<Self, FitError> {
        let mut walk = Walk::new(source)?;
        let coefficients = source.channels().len() * source.parameters().len();
        let mut blocks = Self {
            source,
            filter: walk.filter().clone(),
            counts: SampleCounts::default(),
            parts: Vec::new(),
            time_s: Vec::new(),
            run: (kept / coefficients.max(1)).max(1),
            starts: Vec::new(),
            missing: HashSet::new(),
            kept: Mutex::new((0, StoredBlocks::of(walk.filter().clone()))),
        };
        let (_, first) = blocks.kept.get_mut().unwrap_or_else(PoisonError::into_inner);
        while let Some((time_s, due)) = walk.next(progress) {
            let block = blocks.time_s.len();
            blocks.time_s.push(time_s);
            let missing = due.missing.iter().enumerate().filter(|(_, missing)| **missing);
            blocks.missing.extend(missing.map(|(channel, _)| (block, channel)));
            if block < blocks.run {
                first.push(time_s, due);
            }
            if block.is_multiple_of(blocks.run) {
                blocks.starts.push(walk.first());
            }
        }
        blocks.counts = walk.counts;
        blocks.parts.push(0..blocks.time_s.len());
        Ok(blocks)
    }

    /// Makes the blocks of a run.
    fn make(&self, run: usize, kept: &mut StoredBlocks) {
        kept.clear();
        // The source went through these samples before: the filter is the same.
        let (Ok(mut walk), Some(start)) = (Walk::new(self.source), self.starts.get(run)) else { return };
        walk.go_to(*start);
        for _ in 0..self.run {
            let Some((time_s, due)) = walk.next(&Silent) else { return };
            kept.push(time_s, due);
        }
    }
}

impl<S: RowSource + ?Sized> RowBlocks for MadeBlocks<'_, S> {
    fn filter(&self) -> &Filter {
        &self.filter
    }

    fn counts(&self) -> &SampleCounts {
        &self.counts
    }

    fn parts(&self) -> &[Range<usize>] {
        &self.parts
    }

    fn time_s(&self, block: usize) -> f64 {
        self.time_s.get(block).copied().unwrap_or(0.0)
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let (run, within) = (block / self.run, block % self.run);
        if kept.0 != run {
            let (number, stored) = &mut *kept;
            self.make(run, stored);
            *number = run;
        }
        kept.1.write(within, rows, measured);
    }

    fn measures(&self, block: usize, channel: usize) -> bool {
        self.missing.is_empty() || !self.missing.contains(&(block, channel))
    }
}

#[cfg(test)]
mod tests {
    use rigident_shared::screening::Rejection;

    use super::*;
    use crate::{Channel, Kind, Owner, Parameter, SampleRows, Timing};

    /// Made-up samples with gaps, rejections and channels that tell nothing.
    struct Samples {
        parameters: Vec<Parameter>,
        channels: Vec<Channel>,
    }

    impl RowSource for Samples {
        fn parameters(&self) -> &[Parameter] {
            &self.parameters
        }

        fn channels(&self) -> &[Channel] {
            &self.channels
        }

        fn timing(&self) -> Timing {
            Timing::Uniform { rate_hz: 200.0 }
        }

        fn samples(&self) -> usize {
            700
        }

        fn time_ns(&self, sample: usize) -> u64 {
            (sample as u64 + if sample > 333 { 7 } else { 0 }) * 5_000_000
        }

        fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
            if sample % 171 == 170 {
                return Err(Rejection::NotFinite(1));
            }
            let wave = |k: usize| ((sample * (k + 3)) as f64 * 0.01).sin();
            for (k, (s, d)) in rows.smoothed.iter_mut().zip(&mut rows.differentiated).enumerate() {
                (*s, *d) = (wave(k), wave(k + 7));
            }
            rows.measured.iter_mut().enumerate().for_each(|(c, m)| *m = wave(c + 20));
            rows.missing[0] = (500..540).contains(&sample);
            rows.missing[1] = (520..600).contains(&sample);
            Ok(())
        }
    }

    #[test]
    fn blocks_made_in_runs_are_those_that_are_stored() {
        let parameter =
            |k: usize| Parameter::new(format!("p{k}"), Owner::Link(String::new()), Kind::Mass, "kg");
        let channel =
            |name: &str| Channel { name: name.into(), unit: "N".into(), sigma: None, offset: None, group: 0 };
        let source = Samples {
            parameters: (0..3).map(parameter).collect(),
            channels: vec![channel("a"), channel("b")],
        };
        let stored = source.condition(&Silent).unwrap();
        assert!(stored.len() > 250 && stored.counts().rejected == 4 && stored.counts().gaps == 1);
        // Runs of one block, of eleven, of all.
        for kept in [1, 66, KEPT] {
            let made = MadeBlocks::in_runs(&source, kept, &Silent).unwrap();
            assert_eq!((made.counts(), made.parts()), (stored.counts(), stored.parts()));
            let (mut rows, mut other) = ([[0.0; 6]; 2], [[0.0; 2]; 2]);
            // Forward, then backward.
            for block in (0..stored.len()).chain((0..stored.len()).rev()) {
                made.write(block, &mut rows[0], &mut other[0]);
                stored.write(block, &mut rows[1], &mut other[1]);
                assert_eq!((rows[0], other[0]), (rows[1], other[1]), "{kept}, {block}");
                assert_eq!(made.time_s(block), stored.time_s(block));
                assert!((0..2).all(|c| made.measures(block, c) == stored.measures(block, c)));
            }
        }
    }
}
