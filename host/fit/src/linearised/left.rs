//! Several blocks at once: their rows, and their residuals for values of all columns. Residuals need no rows:
//! most columns of errors are zero in most channels.
//!
//! The products are added in the order of the columns, as those of a whole row are, so that the bits are the
//! same; only zeros are left out.

use std::ops::Range;

use super::{Columns, Linearised, Sensitivities, legendre};
use crate::left_of_rows::dot;
use crate::{Effect, RowBlocks};

/// Blocks whose sums go side by side: one alone waits for each of its additions.
const SIDE_BY_SIDE: usize = 4;

/// An entry of the column of an error, in the row of one channel.
#[derive(Clone, Copy)]
enum Entry {
    /// The prediction of φ̂ for a channel.
    Predicted(usize),
    /// A polynomial of the time.
    Drift(usize),
    /// A sensitivity, by its place among those of a block.
    Signal(usize),
}

impl Columns {
    /// Returns the entries of a channel's row that are not zero, in the order of the columns, each with the
    /// value of its column.
    fn entries(&self, channel: usize, values: &[f64]) -> Vec<(Entry, f64)> {
        let values = values.iter().skip(self.parameters).copied();
        let of = |effect: Effect| match effect {
            Effect::Gain { channel: own } if own == channel => Some(Entry::Predicted(channel)),
            Effect::CrossTalk { from, to } if to == channel => Some(Entry::Predicted(from)),
            Effect::Drift { channel: own, degree } if own == channel => {
                Some(Entry::Drift(usize::from(degree > 1)))
            }
            Effect::Signal(signal) => Some(Entry::Signal(channel * self.signals + signal)),
            Effect::Gain { .. } | Effect::CrossTalk { .. } | Effect::Drift { .. } | Effect::None => None,
        };
        self.nuisances.iter().zip(values).filter_map(|(k, value)| Some((of(k.effect)?, value))).collect()
    }

    /// Returns the prediction of φ̂ for a channel by its row, but for the offset.
    fn predicted(&self, channel: usize, row: &[f64], phi: &[f64]) -> f64 {
        let offset = self.offsets.get(channel).copied().flatten();
        let constant = offset.map_or(0.0, |j| row[j] * phi.get(j).copied().unwrap_or(0.0));
        dot(row, phi) - constant
    }
}

/// A block as far as its residuals need it.
struct Own {
    rows: Vec<f64>,
    measured: Vec<f64>,
    predicted: Vec<f64>,
    drift: [f64; 2],
}

impl Own {
    fn value(&self, entry: Entry, sensitivities: &[f64]) -> f64 {
        match entry {
            Entry::Predicted(channel) => self.predicted.get(channel),
            Entry::Drift(degree) => self.drift.get(degree),
            Entry::Signal(place) => sensitivities.get(place),
        }
        .copied()
        .unwrap_or(0.0)
    }
}

impl Sensitivities {
    /// Writes the columns of blocks, one after the other, C rows of `count` each.
    fn write_blocks(
        &self,
        blocks: &dyn RowBlocks,
        range: Range<usize>,
        phi: &[f64],
        count: usize,
        out: &mut [f64],
    ) {
        match self {
            Self::Direct => blocks.sensitivities_of_blocks(range, phi, count, out),
            Self::Stored(all) => {
                let length = out.len() / range.len().max(1);
                if let Some(own) = all.get(range.start * length..range.end * length) {
                    out.copy_from_slice(own);
                }
            }
        }
    }
}

/// Writes the residuals of a linearised source; see [`RowBlocks::left`].
pub(super) fn left(rows: &Linearised<'_>, range: Range<usize>, values: &[f64], out: &mut [f64]) {
    let Columns { offsets, parameters, signals, .. } = rows.columns;
    let (n, channels) = (*parameters, offsets.len());
    let entries: Vec<_> = (0..channels).map(|c| rows.columns.entries(c, values)).collect();
    let new = || Own {
        rows: vec![0.0; channels * n],
        measured: vec![0.0; channels],
        predicted: vec![0.0; channels],
        drift: [0.0; 2],
    };
    let mut some: [Own; SIDE_BY_SIDE] = std::array::from_fn(|_| new());
    let length = channels * signals;
    let mut sensitivities = vec![0.0; SIDE_BY_SIDE * length];
    for (first, out) in
        range.clone().step_by(SIDE_BY_SIDE).zip(out.chunks_mut((SIDE_BY_SIDE * channels).max(1)))
    {
        let blocks = first..range.end.min(first + SIDE_BY_SIDE);
        let own = &mut sensitivities[..blocks.len() * length];
        rows.sensitivities.write_blocks(rows.blocks, blocks.clone(), &rows.phi, *signals, own);
        for (block, own) in blocks.clone().zip(&mut some) {
            rows.blocks.write(block, &mut own.rows, &mut own.measured);
            let lines = own.rows.chunks_exact(n.max(1)).enumerate();
            let predicted = lines.map(|(c, row)| rows.columns.predicted(c, row, &rows.phi));
            own.predicted.iter_mut().zip(predicted).for_each(|(to, from)| *to = from);
            own.drift = legendre(rows.time(block));
        }
        for (c, entries) in entries.iter().enumerate() {
            // As a sum begins.
            let mut sums = [-0.0; SIDE_BY_SIDE];
            for (j, value) in values.iter().enumerate().take(n) {
                let own = sums.iter_mut().zip(&some);
                own.for_each(|(sum, own)| *sum += own.rows[c * n + j] * value);
            }
            for (entry, value) in entries {
                for (b, (sum, own)) in sums.iter_mut().zip(&some).enumerate() {
                    let sensitivities = &sensitivities[b * length..(b + 1) * length];
                    *sum += own.value(*entry, sensitivities) * value;
                }
            }
            for (block, (to, (own, sum))) in
                blocks.clone().zip(out.chunks_exact_mut(channels).zip(some.iter().zip(sums)))
            {
                // Drift is not seen where nothing is measured.
                let sum = if rows.blocks.measures(block, c) { sum } else { 0.0 };
                to[c] = own.measured[c] - sum;
            }
        }
    }
}

/// Writes the rows of blocks of a linearised source; see [`RowBlocks::write_blocks`].
pub(super) fn write(
    own: &Linearised<'_>,
    range: Range<usize>,
    channels: usize,
    rows: &mut [f64],
    measured: &mut [f64],
) {
    let Columns { offsets, parameters, signals, .. } = own.columns;
    let length = offsets.len() * signals;
    let mut sensitivities = vec![0.0; range.len() * length];
    own.sensitivities.write_blocks(own.blocks, range.clone(), &own.phi, *signals, &mut sensitivities);
    let lines = rows.chunks_exact_mut((offsets.len() * own.columns.all()).max(1));
    let lines = lines.zip(measured.chunks_exact_mut(channels.max(1)));
    for (k, (block, (rows, measured))) in range.zip(lines).enumerate() {
        own.blocks.write(block, &mut rows[..offsets.len() * parameters], measured);
        own.spread(block, rows, &sensitivities[k * length..(k + 1) * length]);
    }
}
