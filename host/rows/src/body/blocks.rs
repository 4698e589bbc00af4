//! The row blocks of one body, and the rows that are made of them.

use std::ops::Range;

use nalgebra::Matrix3;
use rigident_shared::factor::BodyCascade;
use rigident_shared::regressor::{self, RegressorBlock, SIGNALS, SMOOTHED};
use rigident_shared::spatial::{Position, Sensor};

use super::side_by_side::{self, LANES};
use super::{BODY, WRENCH, sensitivities};
use rigident_fit::{Factor, Filter, RowBlocks, SampleCounts, Whitening, condition::absorb};

/// Filtered signals of all row blocks.
#[derive(Clone, Debug)]
pub(super) struct BodyBlocks {
    pub(super) filter: Filter,
    pub(super) counts: SampleCounts,
    pub(super) parts: Vec<Range<usize>>,
    pub(super) is_static: bool,
    /// Time of the sample that completed it, s, and the conditioned signals in the axes of S.
    pub(super) blocks: Vec<(f64, [f64; SIGNALS])>,
    /// Filtered rates of turn in the axes of S, rad/s; empty where no error of a signal is searched for.
    pub(super) rates: Vec<[f64; 3]>,
    /// Axes of the IMU in S.
    pub(super) axes: Matrix3<f64>,
    pub(super) lever_arm: Position<Sensor, f64>,
}

impl BodyBlocks {
    /// Returns the derivatives of a block's signals from its neighbours; zero where there are none.
    fn slope(&self, block: usize) -> [f64; SIGNALS] {
        let period_s = self.filter.row_period_s();
        let at = |k: Option<usize>| k.and_then(|k| self.blocks.get(k));
        let Some(own) = self.blocks.get(block).filter(|_| period_s > 0.0) else { return [0.0; SIGNALS] };
        let near = |other: Option<&'_ (f64, [f64; SIGNALS])>| {
            other.copied().filter(|(time_s, _)| (time_s - own.0).abs() < 1.5 * period_s).unwrap_or(*own)
        };
        let (before, after) = (near(at(block.checked_sub(1))), near(at(Some(block + 1))));
        let span_s = after.0 - before.0;
        let difference = |i: usize| if span_s > 0.0 { (after.1[i] - before.1[i]) / span_s } else { 0.0 };
        std::array::from_fn(difference)
    }

    /// Returns a block with its neighbours' say.
    fn block(&self, block: usize) -> Option<sensitivities::Block<'_>> {
        let (_, signals) = self.blocks.get(block)?;
        let rate = self.rates.get(block).copied().unwrap_or_default().into();
        let (axes, lever_arm) = (self.axes, self.lever_arm);
        Some(sensitivities::Block { signals, one: 1.0, rate, slope: self.slope(block), axes, lever_arm })
    }

    fn absorb_as<const N: usize>(
        &self,
        range: Range<usize>,
        whitening: &[f64],
        weights: Option<&[f64]>,
    ) -> Factor {
        let whitening: [f64; WRENCH] = std::array::from_fn(|c| whitening.get(c).copied().unwrap_or(0.0));
        let mut cascade = Box::new(BodyCascade::<f64, N>::new());
        let blocks = self.blocks.get(range.clone()).unwrap_or_default();
        for (block, (_, signals)) in range.zip(blocks) {
            let own = weights.and_then(|w| w.get(block * WRENCH..(block + 1) * WRENCH));
            let mut weights = whitening;
            for (weight, own) in weights.iter_mut().zip(own.unwrap_or_default()) {
                *weight *= own;
            }
            cascade.absorb(signals, &self.lever_arm, &weights);
        }
        Factor::from(&cascade.factor())
    }
}

/// Numbers of [`Features`]: signals, one, rates, and slopes without those of the wrench.
const FEATURES: usize = SIGNALS + 1 + 3 + SIGNALS - WRENCH;
/// Signals before those of the wrench.
const BEFORE: usize = SMOOTHED - WRENCH;

/// The features that the rows of a block are linear in.
struct Features {
    signals: [f64; SIGNALS],
    /// The coefficient of the offsets.
    one: f64,
    rate: [f64; 3],
    slope: [f64; SIGNALS],
}

impl Features {
    fn array(&self) -> [f64; FEATURES] {
        let (before, after) = (self.slope.iter().take(BEFORE), self.slope.iter().skip(SMOOTHED));
        let mut all =
            self.signals.iter().chain([&self.one]).chain(&self.rate).chain(before).chain(after).copied();
        std::array::from_fn(|_| all.next().unwrap_or(0.0))
    }

    fn of(numbers: &[f64; FEATURES]) -> Self {
        let mut all = numbers.iter().copied();
        let mut next = || all.next().unwrap_or(0.0);
        Self {
            signals: std::array::from_fn(|_| next()),
            one: next(),
            rate: std::array::from_fn(|_| next()),
            slope: std::array::from_fn(|k| if (BEFORE..SMOOTHED).contains(&k) { 0.0 } else { next() }),
        }
    }
}

impl RowBlocks for BodyBlocks {
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
        if self.is_static { 0.0 } else { self.blocks.get(block).map_or(0.0, |b| b.0) }
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        let Some((_, signals)) = self.blocks.get(block) else { return };
        let n = rows.len() / WRENCH;
        write_rows(&regressor::block(signals, &self.lever_arm), n, rows, measured);
    }

    fn sensitivities(&self, block: usize, parameters: &[f64], out: &mut [f64]) -> bool {
        let mut features = [0.0; FEATURES];
        self.write_features(block, &mut features);
        self.sensitivities_of(&features, parameters, out);
        true
    }

    fn sensitivities_of_blocks(
        &self,
        blocks: Range<usize>,
        parameters: &[f64],
        count: usize,
        out: &mut [f64],
    ) {
        let Some(phi) = parameters.first_chunk() else { return };
        let mut own = Vec::with_capacity(LANES);
        let length = LANES * WRENCH * count;
        for (first, out) in blocks.clone().step_by(LANES).zip(out.chunks_mut(length.max(1))) {
            own.clear();
            let some = first..blocks.end.min(first + LANES);
            own.extend(some.filter_map(|block| self.block(block)));
            side_by_side::write(&own, phi, count, out);
        }
    }

    fn features(&self) -> usize {
        FEATURES
    }

    fn write_features(&self, block: usize, out: &mut [f64]) {
        let (Some((_, signals)), Some(out)) = (self.blocks.get(block), out.first_chunk_mut()) else { return };
        let rate = self.rates.get(block).copied().unwrap_or_default();
        *out = Features { signals: *signals, one: 1.0, rate, slope: self.slope(block) }.array();
    }

    fn write_of(&self, features: &[f64], rows: &mut [f64], measured: &mut [f64]) {
        let Some(Features { signals, one, .. }) = features.first_chunk().map(Features::of) else { return };
        let n = rows.len() / WRENCH;
        write_rows(&regressor::block(&signals, &self.lever_arm), n, rows, measured);
        for (c, row) in rows.chunks_exact_mut(n.max(1)).enumerate() {
            row.iter_mut().skip(BODY + c).take(1).for_each(|own| *own = one);
        }
    }

    fn sensitivities_of(&self, features: &[f64], parameters: &[f64], out: &mut [f64]) {
        let Some(Features { signals, one, rate, slope }) = features.first_chunk().map(Features::of) else {
            return;
        };
        let Self { axes, lever_arm, .. } = *self;
        let own = sensitivities::Block { signals: &signals, one, rate: rate.into(), slope, axes, lever_arm };
        own.write(parameters, out);
    }

    fn absorb(
        &self,
        blocks: Range<usize>,
        parameters: usize,
        whitening: &Whitening,
        weights: Option<&[f64]>,
    ) -> Factor {
        match whitening.weights() {
            Some(own) if parameters == BODY => self.absorb_as::<BODY>(blocks, &own, weights),
            Some(own) => self.absorb_as::<{ BODY + WRENCH }>(blocks, &own, weights),
            None => absorb(self, blocks, parameters, whitening, weights),
        }
    }
}

/// Writes the six rows of `n` parameters, the offset's unit matrix among them, and the wrench.
pub(super) fn write_rows(block: &RegressorBlock<f64>, n: usize, rows: &mut [f64], measured: &mut [f64]) {
    write_columns(block, n, rows);
    for (c, row) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        if let Some(offset) = row.get_mut(BODY..) {
            offset.fill(0.0);
            if let Some(own) = offset.get_mut(c) {
                *own = 1.0;
            }
        }
    }
    measured.copy_from_slice(&block.wrench);
}

/// Writes the body's columns of six rows of `n` parameters.
pub(super) fn write_columns(block: &RegressorBlock<f64>, n: usize, rows: &mut [f64]) {
    for (c, row) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        for (a, column) in row.iter_mut().zip(&block.columns) {
            *a = column[c];
        }
    }
}
