//! Rows that follow linearly from few features of a block: its filtered signals, their slopes, the time.
//!
//! With `u` the features of a block, row c is `C_c u` and the whitened row `Σ_c T_rc C_c u_r`, the low-pass
//! of channel r in `u_r`. With the triangle `U_r` of all `u_r` the rows `T_rc C_c g`, g being the rows of
//! `U_r`, have the factor that all blocks have: `Σ_k u_k u_kᵀ = U_rᵀ U_r`. What the columns are linearised
//! about changes C alone, and many columns cost little.

use std::ops::Range;

use nalgebra::DMatrix;

use super::reduction::Reduction;
use super::whitening::PoleGroup;
use super::{Factor, RowBlocks, Whitener, Whitening};

/// Blocks whose features are reduced at once.
const CHUNK: usize = 64;
/// Blocks whose features are held: they fit the second cache.
const WINDOW: usize = 8 * CHUNK;

/// Returns the factor of some blocks by the triangles of their features; see [`RowBlocks::absorb`]. The
/// blocks have features.
pub(super) fn absorb(
    blocks: &dyn RowBlocks,
    range: Range<usize>,
    parameters: usize,
    whitening: &Whitening,
) -> Factor {
    let channels = whitening.channels();
    let mut factor = Factor::new(parameters);
    let groups = whitening.by_pole();
    for (group, triangle) in groups.iter().zip(triangles(blocks, &range, &groups)) {
        let (mut rows, mut measured) = (vec![0.0; channels * parameters], vec![0.0; channels]);
        let mut mixed = Vec::new();
        for features in triangle.row_iter().filter(|row| row.iter().any(|v| *v != 0.0)) {
            let features: Vec<f64> = features.iter().copied().collect();
            blocks.write_of(&features, &mut rows, &mut measured);
            mixed.extend(group.rows.iter().map(|weights| mix(weights, &rows, &measured, parameters)));
        }
        factor.absorb(mixed.iter().map(|(row, value)| (row.as_slice(), *value)));
    }
    let left = factor.residual_sum_of_squares();
    factor.with_residual(left, (range.len() * channels) as u64)
}

/// Returns the triangles of the features behind the low-pass of each group; features are made once for all of
/// them.
fn triangles(blocks: &dyn RowBlocks, range: &Range<usize>, groups: &[PoleGroup]) -> Vec<DMatrix<f64>> {
    let count = blocks.features();
    let mut passes: Vec<Pass> = groups.iter().map(|group| Pass::new(group, range, count)).collect();
    let mut features = vec![0.0; WINDOW * count];
    while let Some(first) = passes.iter().map(|pass| pass.next).filter(|next| *next < range.end).min() {
        let window = first..range.end.min(first + WINDOW);
        let own = window.clone().zip(features.chunks_exact_mut(count.max(1)));
        own.for_each(|(block, row)| blocks.write_features(block, row));
        let times: Vec<f64> = window.clone().map(|block| blocks.time_s(block)).collect();
        passes.iter_mut().for_each(|pass| pass.take(range, &window, &times, &features));
    }
    passes.into_iter().map(|pass| pass.triangle(count)).collect()
}

/// Features on their way through a low-pass into a triangle.
struct Pass<'a> {
    whitener: Whitener<'a>,
    reduction: Reduction,
    /// The first block that it has not seen.
    next: usize,
    row: Vec<f64>,
}

impl<'a> Pass<'a> {
    fn new(group: &'a PoleGroup, range: &Range<usize>, count: usize) -> Self {
        Self {
            whitener: Whitener::new(&group.low_pass, count),
            reduction: Reduction::new(&vec![0.0; count * count], count, count),
            next: range.start.saturating_sub(group.low_pass.lead()),
            row: vec![0.0; count],
        }
    }

    /// Takes the chunks that lie in a window of blocks, with their times and features.
    fn take(&mut self, range: &Range<usize>, window: &Range<usize>, times: &[f64], features: &[f64]) {
        let count = self.row.len();
        loop {
            let end = range.end.min(self.next + CHUNK);
            if self.next >= end || end > window.end {
                return;
            }
            for block in self.next..end {
                let at = block - window.start;
                let (Some(own), Some(time_s)) = (features.get(at * count..(at + 1) * count), times.get(at))
                else {
                    return;
                };
                self.row.copy_from_slice(own);
                self.whitener.apply(*time_s, &mut self.row, &mut [0.0], None);
                // The low-pass comes from the blocks before.
                if block >= range.start {
                    self.reduction.push(&self.row, 0.0);
                }
            }
            self.reduction.settle();
            self.next = end;
        }
    }

    fn triangle(self, count: usize) -> DMatrix<f64> {
        let mut triangle = vec![0.0; count * count];
        self.reduction.write(&mut triangle);
        DMatrix::from_vec(count, count, triangle)
    }
}

/// Returns the sum of rows, each times its weight.
fn mix(weights: &[f64], rows: &[f64], measured: &[f64], parameters: usize) -> (Vec<f64>, f64) {
    let mut out = vec![0.0; parameters];
    for (weight, row) in weights.iter().zip(rows.chunks_exact(parameters.max(1))) {
        out.iter_mut().zip(row).for_each(|(o, v)| *o += weight * v);
    }
    (out, weights.iter().zip(measured).map(|(w, v)| w * v).sum())
}

/// Returns the sum of the squares of whitened rows whose features are `u`, one after the other with their
/// times, in the columns that `blocks` make of features.
pub(super) fn gram(
    blocks: &dyn RowBlocks,
    parameters: usize,
    whitening: &Whitening,
    parts: &[(&[f64], &[f64])],
) -> DMatrix<f64> {
    let (count, channels) = (blocks.features(), whitening.channels());
    let mut rows = vec![0.0; channels * parameters];
    let mut measured = vec![0.0; channels];
    // By channels: what a unit of each feature makes of its row.
    let mut maps = vec![DMatrix::<f64>::zeros(count, parameters); channels];
    for k in 0..count {
        let unit: Vec<f64> = (0..count).map(|i| f64::from(u8::from(i == k))).collect();
        blocks.write_of(&unit, &mut rows, &mut measured);
        for (map, row) in maps.iter_mut().zip(rows.chunks_exact(parameters.max(1))) {
            map.row_mut(k).iter_mut().zip(row).for_each(|(to, v)| *to = *v);
        }
    }
    let mut sum = DMatrix::<f64>::zeros(parameters, parameters);
    for group in whitening.by_pole() {
        let mut squares = DMatrix::<f64>::zeros(count, count);
        for (times, features) in parts {
            let mut whitener = Whitener::new(&group.low_pass, count);
            let mut passed = features.to_vec();
            for (time_s, row) in times.iter().zip(passed.chunks_exact_mut(count.max(1))) {
                whitener.apply(*time_s, row, &mut [0.0], None);
            }
            let passed = DMatrix::from_vec(count, times.len().min(passed.len() / count.max(1)), passed);
            squares += &passed * passed.transpose();
        }
        for weights in &group.rows {
            let zero = DMatrix::<f64>::zeros(count, parameters);
            let map = weights.iter().zip(&maps).fold(zero, |sum, (weight, map)| sum + map * *weight);
            sum += map.tr_mul(&(&squares * &map));
        }
    }
    sum
}

#[cfg(test)]
#[path = "features_tests.rs"]
mod tests;
