//! Row blocks: the samples of a source after the filter.
//!
//! One FIR over both parts of the rows and the measurements leaves the equation exact:
//! `k ∗ measured = (k ∗ smoothed + k̇ ∗ differentiated) φ`. The kernel is the firmware's
//! (`rigident_shared::conditioning`). A rejected sample or a gap in time starts the filter anew.

use std::collections::{BTreeMap, HashSet, VecDeque};
use std::ops::Range;

use rigident_shared::conditioning::{Kernel, KernelError};
use rigident_shared::screening::Rejection;

use super::left_of_rows::left_of_rows;
use super::{Factor, FitError, Progress, RowSource, SampleRows, Timing, Whitener, Whitening};

/// Width of the FIR where samples are frequent enough, s; see [`filter_width_s`].
pub const FILTER_WIDTH_S: f64 = 0.1;
/// Least width of the FIR in samples: with nine, `ḣ ∗ ω` is `h ∗ ω̇` to 1e-4 up to a tenth of the rate and to
/// 6e-4 up to a quarter of it, where the kernel has let three quarters of the amplitude go; with four and a
/// half it is to 1.6 % and 14 %.
const LEAST_WIDTH_SAMPLES: f64 = 9.0;
/// Row blocks come at about this rate, 1/s: twice the filter's noise bandwidth and more.
const ROW_RATE_HZ: f64 = 100.0;
/// Room for the longest kernel: a second at 1 kHz.
const TAPS: usize = 1024;
/// Room for the filter of one body's estimator on the host: 0.1 s at 40 kHz.
pub const ESTIMATOR_TAPS: usize = 256;
/// A step longer than this many periods is a gap.
const GAP: f64 = 1.5;
/// Samples between two reports of progress.
const REPORTED_SAMPLES: usize = 256;
/// Samples under the filter that are summed at a time.
const AT_ONCE: usize = 4;
/// Row blocks that are whitened before they are absorbed.
const CHUNK: usize = 32;

/// Returns the width of the FIR at this rate, s: [`FILTER_WIDTH_S`], below 90 samples a second as many
/// seconds as nine samples take.
pub fn filter_width_s(rate_hz: f64) -> f64 {
    FILTER_WIDTH_S.max(LEAST_WIDTH_SAMPLES / rate_hz)
}

/// Returns the samples that a row block represents at this rate: an even number where they are many, so that
/// a filter may average neighbours ([`rigident_shared::conditioning`]); at least some 75 row blocks come a
/// second, above twice the filter's bandwidth.
pub fn row_every(rate_hz: f64) -> u16 {
    if rate_hz < 150.0 { 1 } else { 2 * (rate_hz / (2.0 * ROW_RATE_HZ)).floor().clamp(1.0, 500.0) as u16 }
}

/// The filter that rows went through, as far as their noise is concerned.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    /// Samples per second; zero without a filter.
    pub rate_hz: f64,
    /// Width of the FIR, s; zero without a filter.
    pub width_s: f64,
    /// Samples that a row block represents.
    pub every: u16,
    /// `Σh²`: variance of white noise after the filter, relative to before.
    pub noise_gain: f64,
    /// `Σḣ²`, 1/s².
    pub derivative_noise_gain: f64,
    /// Impulse response on the samples, oldest first; empty without a filter.
    pub response: Vec<f64>,
    /// The same of the derivative, 1/s.
    pub derivative: Vec<f64>,
}

impl Default for Filter {
    /// Returns the identity: each sample is a row block.
    fn default() -> Self {
        Self {
            rate_hz: 0.0,
            width_s: 0.0,
            every: 1,
            noise_gain: 1.0,
            derivative_noise_gain: 0.0,
            response: Vec::new(),
            derivative: Vec::new(),
        }
    }
}

impl Filter {
    /// Returns the variance of whitened, filtered white noise per row.
    pub fn row_noise_gain(&self) -> f64 {
        f64::from(self.every) * self.noise_gain
    }

    /// Returns the autocovariance of the rows for white noise of unit variance that is differentiated, 1/s²,
    /// at the lags of
    /// [`Filter::white_autocovariance`]; zeros without a filter.
    pub fn derivative_autocovariance(&self) -> Vec<f64> {
        autocovariance(&self.derivative, self.every)
    }

    /// Returns the time between row blocks, s; zero without a filter.
    pub fn row_period_s(&self) -> f64 {
        if self.rate_hz > 0.0 { f64::from(self.every) / self.rate_hz } else { 0.0 }
    }

    /// Returns the autocovariance of the rows for white noise of unit variance before the filter, at lags of
    /// 0, 1, … rows, until the windows no longer overlap.
    pub fn white_autocovariance(&self) -> Vec<f64> {
        autocovariance(&self.response, self.every)
    }
}

/// Returns the products of a response with itself, `every` samples later and so on.
fn autocovariance(response: &[f64], every: u16) -> Vec<f64> {
    (0..response.len())
        .step_by(usize::from(every).max(1))
        .map(|lag| response.iter().zip(response.iter().skip(lag)).map(|(a, b)| a * b).sum())
        .collect()
}

/// Samples counted on the way to row blocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleCounts {
    /// Samples given.
    pub samples: u64,
    /// Samples rejected.
    pub rejected: u64,
    /// Samples rejected by the signal that was the reason.
    pub by_signal: BTreeMap<u8, u64>,
    /// Gaps in time.
    pub gaps: u64,
}

impl SampleCounts {
    /// Counts a rejected sample.
    pub fn reject(&mut self, rejection: Rejection) {
        let (Rejection::NotFinite(signal) | Rejection::Saturated(signal) | Rejection::Frozen(signal)) =
            rejection;
        self.rejected += 1;
        *self.by_signal.entry(signal).or_default() += 1;
    }
}

/// Filtered row blocks, in the order of time: C channels of N coefficients each.
pub trait RowBlocks: Send + Sync {
    /// Returns the filter.
    fn filter(&self) -> &Filter;

    /// Returns what became of the samples.
    fn counts(&self) -> &SampleCounts;

    /// Returns the parts, one after the other, that are treated on their own, each on a core of its own.
    fn parts(&self) -> &[Range<usize>];

    /// Returns the time of the sample that completed a block, s.
    fn time_s(&self, block: usize) -> f64;

    /// Writes a block: C × N coefficients, row by row, and C measurements, not whitened.
    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]);

    /// Writes blocks as [`RowBlocks::write`] does, one after the other; `channels` measurements each.
    fn write_blocks(&self, blocks: Range<usize>, channels: usize, rows: &mut [f64], measured: &mut [f64]) {
        let length = rows.len() / blocks.len().max(1);
        let own = rows.chunks_exact_mut(length.max(1)).zip(measured.chunks_exact_mut(channels.max(1)));
        blocks.zip(own).for_each(|(block, (rows, measured))| self.write(block, rows, measured));
    }

    /// Returns false if a block tells nothing of a channel: coefficients and measurement are zero, and count
    /// for nothing.
    fn measures(&self, _block: usize, _channel: usize) -> bool {
        true
    }

    /// Writes what errors of the signals change in what `parameters` predict of a block: C rows, one column
    /// for each number of a [`super::Effect::Signal`]. Returns false if these blocks do not know.
    fn sensitivities(&self, _block: usize, _parameters: &[f64], _out: &mut [f64]) -> bool {
        false
    }

    /// Writes [`RowBlocks::sensitivities`] of blocks, one after the other, C rows of `count` columns each.
    fn sensitivities_of_blocks(
        &self,
        blocks: Range<usize>,
        parameters: &[f64],
        count: usize,
        out: &mut [f64],
    ) {
        let length = out.len() / blocks.len().max(1);
        let own = out.chunks_exact_mut(length.max(1));
        own.zip(blocks).filter(|_| count > 0).for_each(|(own, block)| {
            self.sensitivities(block, parameters, own);
        });
    }

    /// Writes the residuals of blocks for values of all columns, one after the other, C numbers each.
    fn left(&self, blocks: Range<usize>, values: &[f64], out: &mut [f64]) {
        let (n, channels) = (values.len(), out.len() / blocks.len().max(1));
        let (mut rows, mut measured) = (vec![0.0; channels * n], vec![0.0; channels]);
        for (block, out) in blocks.zip(out.chunks_exact_mut(channels.max(1))) {
            self.write(block, &mut rows, &mut measured);
            left_of_rows(&rows, &measured, values, out);
        }
    }

    /// Returns the number of features that the rows of a block follow from linearly; zero if it is not known.
    fn features(&self) -> usize {
        0
    }

    /// Writes the features of a block.
    fn write_features(&self, _block: usize, _out: &mut [f64]) {}

    /// Writes what [`RowBlocks::write`] would of a block with such features.
    fn write_of(&self, _features: &[f64], _rows: &mut [f64], _measured: &mut [f64]) {}

    /// Writes what [`RowBlocks::sensitivities`] would of a block with such features.
    fn sensitivities_of(&self, _features: &[f64], _parameters: &[f64], _out: &mut [f64]) {}

    /// Returns the factor of some blocks.
    ///
    /// Rows are multiplied by `weights`, one a channel and block of the whole recording, where there are any,
    /// then by `whitening`. The number of parameters is `parameters`.
    fn absorb(
        &self,
        blocks: Range<usize>,
        parameters: usize,
        whitening: &Whitening,
        weights: Option<&[f64]>,
    ) -> Factor {
        absorb(self, blocks, parameters, whitening, weights)
    }

    /// Returns the number of blocks.
    fn len(&self) -> usize {
        self.parts().last().map_or(0, |part| part.end)
    }

    /// Returns true if there is no block.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Returns the error of blocks of which there are none.
pub(super) fn no_rows(blocks: &dyn RowBlocks) -> FitError {
    let counts = blocks.counts();
    FitError::NoRows { samples: counts.samples, rejected: counts.rejected, width_s: blocks.filter().width_s }
}

/// Absorbs blocks by their rows; see [`RowBlocks::absorb`].
pub fn absorb<B: RowBlocks + ?Sized>(
    blocks: &B,
    range: Range<usize>,
    parameters: usize,
    whitening: &Whitening,
    weights: Option<&[f64]>,
) -> Factor {
    let channels = whitening.channels();
    let mut factor = Factor::new(parameters);
    // Where channels are mixed every row has something of the others.
    let mixed = whitening.weights().is_none();
    let mut whitener = Whitener::new(whitening, parameters);
    let mut rows = vec![0.0; CHUNK * channels * parameters];
    let mut values = vec![0.0; CHUNK * channels];
    // The low-pass comes from the blocks before.
    let mut start = range.start.saturating_sub(whitening.lead());
    while start < range.end {
        let end = range.end.min(start + CHUNK);
        let own_rows = rows.chunks_exact_mut((channels * parameters).max(1));
        let own_values = values.chunks_exact_mut(channels.max(1));
        for (block, (rows, values)) in (start..end).zip(own_rows.zip(own_values)) {
            blocks.write(block, rows, values);
            let of_block = weights.and_then(|w| w.get(block * channels..(block + 1) * channels));
            whitener.apply(blocks.time_s(block), rows, values, of_block);
        }
        let skipped = range.start.saturating_sub(start).min(end - start) * channels;
        let count = (end - start) * channels;
        let lines = rows.chunks_exact(parameters.max(1)).zip(values.iter().copied());
        let present =
            (start..end).flat_map(|block| (0..channels).map(move |c| mixed || blocks.measures(block, c)));
        let lines = lines.zip(present).take(count).skip(skipped);
        factor.absorb(lines.filter(|(_, present)| *present).map(|(line, _)| line));
        start = end;
    }
    factor
}

/// Row blocks whose rows are stored.
#[derive(Clone, Debug)]
pub struct StoredBlocks {
    filter: Filter,
    counts: SampleCounts,
    parts: Vec<Range<usize>>,
    time_s: Vec<f64>,
    rows: Vec<f64>,
    measured: Vec<f64>,
    /// Blocks and channels that tell nothing.
    missing: HashSet<(usize, usize)>,
}

impl RowBlocks for StoredBlocks {
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
        copy(&self.rows, block, rows);
        copy(&self.measured, block, measured);
    }

    fn measures(&self, block: usize, channel: usize) -> bool {
        self.missing.is_empty() || !self.missing.contains(&(block, channel))
    }
}

/// Copies chunk `k` of some numbers.
fn copy(all: &[f64], k: usize, to: &mut [f64]) {
    let length = to.len();
    if let Some(from) = all.get(k * length..(k + 1) * length) {
        to.copy_from_slice(from);
    }
}

impl StoredBlocks {
    /// None yet.
    pub(super) fn of(filter: Filter) -> Self {
        Self {
            filter,
            counts: SampleCounts::default(),
            parts: Vec::new(),
            time_s: Vec::new(),
            rows: Vec::new(),
            measured: Vec::new(),
            missing: HashSet::new(),
        }
    }

    /// Forgets all blocks, and keeps their room.
    pub(super) fn clear(&mut self) {
        self.time_s.clear();
        self.rows.clear();
        self.measured.clear();
        self.missing.clear();
    }

    /// Adds a block.
    pub(super) fn push(&mut self, time_s: f64, due: &SampleRows) {
        let channels = due.measured.len();
        let (block, from, length) =
            (self.time_s.len(), self.rows.len(), due.smoothed.len() / channels.max(1));
        self.time_s.push(time_s);
        self.rows.extend_from_slice(&due.smoothed);
        self.measured.extend_from_slice(&due.measured);
        let missing = due.missing.iter().enumerate().filter(|(_, missing)| **missing);
        for (c, _) in missing {
            self.missing.insert((block, c));
            let own = self.rows.iter_mut().skip(from + c * length).take(length);
            own.chain(self.measured.iter_mut().skip(block * channels + c).take(1)).for_each(|v| *v = 0.0);
        }
    }
}

/// Filters the samples of a source into row blocks that are stored.
///
/// # Errors
/// [`FitError::Filter`] if there is no such filter at the source's rate.
pub fn condition<S: RowSource + ?Sized>(
    source: &S,
    progress: &dyn Progress,
) -> Result<Box<dyn RowBlocks>, FitError> {
    let mut walk = Walk::new(source)?;
    let mut blocks = StoredBlocks::of(walk.filter().clone());
    while let Some((time_s, due)) = walk.next(progress) {
        blocks.push(time_s, due);
    }
    blocks.counts = walk.counts;
    blocks.parts.push(0..blocks.time_s.len());
    Ok(Box::new(blocks))
}

/// Goes through the samples of a source, from block to block.
pub(super) struct Walk<'a, S: ?Sized> {
    source: &'a S,
    taps: Taps,
    next: usize,
    before: Option<u64>,
    spare: SampleRows,
    size: (usize, usize),
    pub(super) counts: SampleCounts,
}

impl<'a, S: RowSource + ?Sized> Walk<'a, S> {
    /// Before the first sample.
    pub(super) fn new(source: &'a S) -> Result<Self, FitError> {
        Ok(Self {
            taps: Taps::new(source.timing())?,
            next: 0,
            before: None,
            spare: SampleRows::default(),
            size: (source.channels().len(), source.parameters().len()),
            counts: SampleCounts { samples: source.samples() as u64, ..SampleCounts::default() },
            source,
        })
    }

    pub(super) fn filter(&self) -> &Filter {
        &self.taps.filter
    }

    /// Goes to a sample, with nothing under the filter.
    pub(super) fn go_to(&mut self, sample: usize) {
        self.taps.reset();
        (self.next, self.before) = (sample, None);
    }

    /// The first sample under the filter of the last block.
    pub(super) fn first(&self) -> usize {
        self.next.saturating_sub(self.taps.weights.len())
    }

    /// The next block that tells of a channel, and the time of its last sample.
    pub(super) fn next(&mut self, progress: &dyn Progress) -> Option<(f64, &SampleRows)> {
        let filter = &self.taps.filter;
        let period_ns = if filter.rate_hz > 0.0 { 1e9 / filter.rate_hz } else { f64::INFINITY };
        let is_static = self.source.timing() == Timing::Static;
        loop {
            let sample = self.next;
            if sample >= self.source.samples() {
                return None;
            }
            self.next += 1;
            if sample.is_multiple_of(REPORTED_SAMPLES) {
                progress.stage("rows", sample as f64 / self.source.samples() as f64);
            }
            let time_ns = if is_static { 0 } else { self.source.time_ns(sample) };
            self.spare.clear(self.size.0, self.size.1);
            if let Err(rejection) = self.source.rows(sample, &mut self.spare) {
                self.counts.reject(rejection);
                self.taps.reset();
                self.before = None;
                continue;
            }
            if self.before.is_some_and(|t| time_ns.saturating_sub(t) as f64 > GAP * period_ns) {
                self.counts.gaps += 1;
                self.taps.reset();
            }
            self.before = Some(time_ns);
            let time_s = if is_static { 0.0 } else { time_ns as f64 * 1e-9 };
            if self.taps.push(&mut self.spare) && !self.taps.out.tells_nothing() {
                return Some((time_s, &self.taps.out));
            }
        }
    }
}

/// The kernel with the samples under it.
struct Taps {
    filter: Filter,
    /// Weights of the smoothed and of the differentiated part, oldest sample first.
    weights: Vec<(f64, f64)>,
    samples: VecDeque<SampleRows>,
    until: usize,
    out: SampleRows,
}

impl Taps {
    fn new(timing: Timing) -> Result<Self, FitError> {
        let (filter, weights) = match timing {
            Timing::Static => (Filter::default(), vec![(1.0, 0.0)]),
            Timing::Uniform { rate_hz } => {
                let width_s = filter_width_s(rate_hz);
                let refuse = |error| FitError::Filter { rate_hz, width_s, error };
                let kernel = Kernel::<f64, TAPS>::new(rate_hz, width_s, 1).map_err(refuse)?;
                let weights: Vec<(f64, f64)> =
                    kernel.smooth().iter().copied().zip(kernel.derivative().iter().copied()).collect();
                if weights.len() < 3 {
                    return Err(refuse(KernelError::Invalid));
                }
                let filter = Filter {
                    rate_hz,
                    width_s,
                    every: row_every(rate_hz),
                    noise_gain: kernel.noise_gain(),
                    derivative_noise_gain: kernel.derivative_noise_gain(),
                    response: kernel.smooth().to_vec(),
                    derivative: kernel.derivative().to_vec(),
                };
                (filter, weights)
            }
        };
        let until = weights.len();
        Ok(Self {
            filter,
            weights,
            samples: VecDeque::with_capacity(until),
            until,
            out: SampleRows::default(),
        })
    }

    fn reset(&mut self) {
        self.samples.clear();
        self.until = self.weights.len();
    }

    /// Takes a sample, giving another one's room back; returns whether rows are due.
    fn push(&mut self, sample: &mut SampleRows) -> bool {
        // Without a filter every sample is a block.
        if self.weights.len() == 1 {
            std::mem::swap(&mut self.out, sample);
            return true;
        }
        let full = self.samples.len() == self.weights.len();
        let mut room =
            if full { self.samples.pop_front().unwrap_or_default() } else { SampleRows::default() };
        std::mem::swap(&mut room, sample);
        self.samples.push_back(room);
        self.until -= 1;
        if self.until > 0 {
            return false;
        }
        self.until = usize::from(self.filter.every).max(1);
        let Some(first) = self.samples.front() else { return false };
        let (rows, channels) = (first.smoothed.len(), first.measured.len());
        self.out.smoothed.clear();
        self.out.smoothed.resize(rows, 0.0);
        self.out.measured.clear();
        self.out.measured.resize(channels, 0.0);
        self.out.missing.clear();
        self.out.missing.resize(channels, false);
        let mut taps = self.weights.iter().zip(&self.samples);
        loop {
            // Several at a time, each sum in the order of the taps: fewer sums are stored.
            let some: [_; AT_ONCE] = std::array::from_fn(|_| taps.next());
            if let [Some(a), Some(b), Some(c), Some(d)] = some {
                add_four(&mut self.out.smoothed, [a, b, c, d]);
            } else {
                for ((h, d), sample) in some.into_iter().flatten() {
                    let parts = sample.smoothed.iter().zip(&sample.differentiated);
                    for (sum, (smoothed, differentiated)) in self.out.smoothed.iter_mut().zip(parts) {
                        *sum += h * smoothed + d * differentiated;
                    }
                }
            }
            for ((h, _), sample) in some.into_iter().flatten() {
                for (sum, value) in self.out.measured.iter_mut().zip(&sample.measured) {
                    *sum += h * value;
                }
                self.out.missing.iter_mut().zip(&sample.missing).for_each(|(any, own)| *any |= own);
            }
            if some.iter().any(Option::is_none) {
                break;
            }
        }
        true
    }
}

/// A sample with the weights of its smoothed and of its differentiated part.
type Tap<'a> = (&'a (f64, f64), &'a SampleRows);

/// Adds the weighted coefficients of samples to sums, one sample after the other.
fn add_four(sums: &mut [f64], taps: [Tap<'_>; AT_ONCE]) {
    let count = sums.len();
    let [Some(s0), Some(s1), Some(s2), Some(s3)] = taps.map(|(_, rows)| rows.smoothed.get(..count)) else {
        return;
    };
    let [Some(d0), Some(d1), Some(d2), Some(d3)] = taps.map(|(_, rows)| rows.differentiated.get(..count))
    else {
        return;
    };
    let [(h0, k0), (h1, k1), (h2, k2), (h3, k3)] = taps.map(|(weights, _)| *weights);
    for (i, sum) in sums.iter_mut().enumerate() {
        let mut own = *sum + (h0 * s0[i] + k0 * d0[i]);
        own += h1 * s1[i] + k1 * d1[i];
        own += h2 * s2[i] + k2 * d2[i];
        *sum = own + (h3 * s3[i] + k3 * d3[i]);
    }
}
