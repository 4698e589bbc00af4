//! Bodies that are not rigid, recognised by the form of their residuals.
//!
//! - *Resonance* (an elastic mount, liquid, a load that swings): a part of the body on a spring of the
//!   frequency ω₀ and the damping ζ moves against the rest by z, `z̈ + 2ζω₀ ż + ω₀² z = −u`, u being what
//!   moves the body. The wrench has `z̈` times the part's mass too much: the rows of the body through the
//!   filter `−s²/(s² + 2ζω₀ s + ω₀²)`, whatever the source. Frequencies and dampings are tried one after the
//!   other. The part makes no larger a wrench than the whole.
//! - *Spring* (a cable, a hose): channels follow the angles, the second integrals of rows that contain
//!   angular accelerations.
//! - *Bursts* (a loose bolt): the noise is much larger at some times than at others.
//!
//! If efforts of drives are measured, friction that is left out resembles all of these, and of many
//! parameters something always does: nothing is named there.
//!
//! A candidate counts with white, flicker and walking noise as the residuals beside it show them; the one
//! that explains most is named, less 7 for each of its columns.

use nalgebra::DMatrix;

use super::bins::Bins;
use super::clear_band;
use super::filters::{Section, second_integral};
use super::metric::{Metric, drift, product};
use super::noise::{self, PowerLaw};
use super::noise_filled::Quiet;
use super::score::{Added, Candidate, Common, Further, PER_COLUMN};
use super::tail;
use super::{NoiseRows, Rows};

/// A candidate counts if noise explains as much once in this many recordings. What a load cell does by itself
/// is no more than nearly noise, and a cable or a resonance that matters is far beyond.
pub const FALSE_ALARM: f64 = 1e-12;
/// Row blocks that are examined, the middle ones.
const MOST_BLOCKS: usize = 12_000;
/// Frequencies that are tried: from the lowest on, this many to an octave, up to this share of the rate of
/// the rows.
const LOWEST_HZ: f64 = 0.4;
const PER_OCTAVE: f64 = 2.5;
const HIGHEST: f64 = 0.2;
const DAMPINGS: [f64; 2] = [0.02, 0.15];
/// Dampings of Butterworth's low-pass of four poles.
const DAMPINGS_OF_FOUR: [f64; 2] = [0.3827, 0.9239];
/// Columns that belong to what is identified, at most.
const MOST_COLUMNS: usize = 16;
/// An angle counts if this share of it is in no other.
const NEW_ANGLE: f64 = 0.5;
/// Frequencies that explain this share of what the best does are as good.
const AS_GOOD: f64 = 0.8;
/// Energy of a burst over the mean of the quieter half, and bursts that are no single knocks.
const LOUD: f64 = 4.0;
const LEAST_BURSTS: usize = 8;
/// Bins that may be loud without being bursts of something: beyond, all is loud.
const MOST_LOUD: f64 = 0.6;

/// The part that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// A part swings at a frequency, Hz.
    Resonance {
        /// Lowest and highest frequency that explain as much, Hz.
        frequency_hz: [f64; 2],
    },
    /// Something pulls as the body turns.
    Spring,
    /// Something rattles, this many times.
    Bursts {
        /// Number of bursts.
        count: usize,
    },
}

/// The explanation of the residuals of a body that is not rigid.
#[derive(Clone, Debug, PartialEq)]
pub struct NotRigid {
    /// The part that moves.
    pub motion: Motion,
    /// Probability that an honest recording shows as much.
    pub probability: f64,
    /// Decrease of χ², less what columns explain by chance.
    pub explained: f64,
}

/// Whitened rows over time, by channels and columns; empty of a column that has nothing.
type Series = Vec<Vec<Vec<f64>>>;

/// Whitened rows of a stretch, stored.
struct Stretch<'a> {
    rows: &'a Rows<'a>,
    /// Bins of all columns.
    bins: Bins,
    columns: Series,
    /// Residuals by channels.
    residuals: Vec<Vec<f64>>,
    first: usize,
    rate_hz: f64,
    /// Noise of the signals in the rows.
    noise: Vec<NoiseSeries>,
    /// Their quietest time.
    quiet: Quiet,
}

/// Noise of the signals in whitened rows, once.
struct NoiseSeries {
    columns: Series,
    /// The same in bins, by channels.
    binned: Vec<DMatrix<f64>>,
    /// First row block of each bin.
    first: Vec<usize>,
    /// The weight of its squares.
    weight: f64,
}

impl NoiseSeries {
    /// Returns a series of whitened rows in bins of `several` blocks, with the weight of its squares.
    fn new(columns: Series, weight: f64, several: usize) -> Self {
        let mut own = Self { columns, binned: Vec::new(), first: Vec::new(), weight };
        own.bin(several);
        own
    }

    /// Sums its columns in bins of `several` blocks.
    fn bin(&mut self, several: usize) {
        self.first = (0..length(&self.columns) / several).map(|b| b * several).collect();
        self.binned = self.columns.iter().map(|own| binned(own, &self.first, several)).collect();
    }
}

/// Returns how many rows there are over time.
fn length(columns: &Series) -> usize {
    columns.iter().flatten().map(Vec::len).max().unwrap_or(0)
}

/// Blocks whose columns are taken apart at once.
const AT_ONCE: usize = 16;

/// Returns the columns over time of blocks of C rows of n columns, one after the other.
fn over_time(blocks: &[f64], channels: usize, n: usize) -> Series {
    let long = (channels * n).max(1);
    let mut is_any = vec![false; long];
    for block in blocks.chunks_exact(long) {
        is_any.iter_mut().zip(block).for_each(|(is_any, a)| *is_any |= *a != 0.0);
    }
    let empty = |at: usize| Vec::with_capacity(if is_any[at] { blocks.len() / long } else { 0 });
    let of_channel = |c: usize| (0..n).map(|j| empty(c * n + j)).collect();
    let mut columns: Series = (0..channels).map(of_channel).collect();
    for some in blocks.chunks(AT_ONCE * long) {
        let all = columns.iter_mut().flatten().enumerate().filter(|(at, _)| is_any[*at]);
        all.for_each(|(at, column)| column.extend(some.chunks_exact(long).map(|block| block[at])));
    }
    columns
}

/// Returns columns over time in bins of `several` blocks from each `first` on, as [`Bins`] has them.
fn binned(columns: &[Vec<f64>], first: &[usize], several: usize) -> DMatrix<f64> {
    DMatrix::from_fn(first.len(), columns.len(), |b, j| {
        let own = columns[j].get(first[b]..first[b] + several).unwrap_or_default();
        own.iter().sum::<f64>() / (several as f64).sqrt()
    })
}

impl Motion {
    /// Returns true if what moves makes the estimate wrong; bursts of noise make it no more than uncertain.
    pub fn spoils(&self) -> bool {
        !matches!(self, Self::Bursts { .. })
    }
}

/// Whitened rows of a stretch, as they come.
pub(super) struct Stored {
    pub(super) bins: Bins,
    /// Blocks of C rows, one after the other; the same of each series of noise.
    blocks: Vec<f64>,
    noise: Vec<Vec<f64>>,
    residuals: Vec<Vec<f64>>,
    first: usize,
}

impl Stored {
    /// Returns the rows of the middle.
    fn new(rows: &Rows) -> Self {
        let count = rows.blocks.len();
        let first = count.saturating_sub(MOST_BLOCKS) / 2;
        let last = count.min(first + MOST_BLOCKS);
        let (channels, n) = (rows.whitening.channels(), rows.values.len());
        let mut blocks = Vec::with_capacity((last - first) * channels * n);
        let mut residuals: Vec<Vec<f64>> = vec![Vec::new(); channels];
        let mut noise: Vec<Vec<f64>> = vec![Vec::new(); rows.noise.map_or(0, NoiseRows::series)];
        let of_noise = |k: usize, own: &[f64]| {
            let series = noise.get_mut(k).filter(|series| series.len() < MOST_BLOCKS * own.len());
            series.into_iter().for_each(|series| series.extend_from_slice(own));
        };
        let of_rows = |_, own: &mut [f64], left: &[f64]| {
            blocks.extend_from_slice(own);
            residuals.iter_mut().zip(left).for_each(|(all, e)| all.push(*e));
        };
        let bins = Bins::with(rows, first..last, n, of_rows, of_noise);
        Self { bins, blocks, noise, residuals, first }
    }

    /// Returns all rows, with the bins that any search has, if [`find`] will ask for them; `None` if it will
    /// not, or for some of them.
    pub(super) fn whole(rows: &Rows) -> Option<Self> {
        let is_whole = rows.is_suspect && rows.blocks.filter().row_period_s() > 0.0 && is_examined(rows);
        (is_whole && rows.blocks.len() <= MOST_BLOCKS).then(|| Self::new(rows))
    }
}

impl<'a> Stretch<'a> {
    fn new(rows: &'a Rows<'a>, stored: Stored) -> Self {
        let Stored { bins, blocks, noise, residuals, first } = stored;
        let (channels, n) = (rows.whitening.channels(), rows.values.len());
        let rate_hz = 1.0 / rows.blocks.filter().row_period_s();
        let columns = over_time(&blocks, channels, n);
        let noise = noise.into_iter().enumerate().map(|(k, series)| {
            let weight = rows.noise.map_or(0.0, |noise| noise.weight(k));
            NoiseSeries::new(over_time(&series, channels, n + 1), weight, bins.several)
        });
        let noise = noise.filter(|series| !series.first.is_empty()).collect();
        let quiet = Quiet::new(&bins, bins.several as f64 / rate_hz);
        Self { rows, bins, columns, residuals, first, rate_hz, noise, quiet }
    }

    /// Returns the same of what is slower than motion that is clear of noise, where noise above it is in rows
    /// and residuals alike.
    fn clear(self) -> Self {
        let of_channel = |own: &Vec<Vec<f64>>| {
            let mut sum = vec![0.0; self.residuals.first().map_or(0, Vec::len)];
            for (column, value) in own.iter().zip(self.rows.values) {
                sum.iter_mut().zip(column).for_each(|(s, a)| *s += a * value);
            }
            sum
        };
        let predicted: Vec<Vec<f64>> = self.columns.iter().map(of_channel).collect();
        match clear_band::highest_hz(&predicted, &self.residuals, self.rate_hz) {
            Some(hz) if 2.0 * hz * (self.bins.several as f64) < self.rate_hz => self.below(hz),
            _ => self,
        }
    }

    /// Returns the rows, the residuals and the noise below a frequency, in bins that are as long as that
    /// allows.
    fn below(mut self, hz: f64) -> Self {
        let section = DAMPINGS_OF_FOUR.map(|damping| Section::low_pass(hz, damping, self.rate_hz));
        let smooth = |columns: &mut Vec<Vec<f64>>| {
            for section in &section {
                *columns = section.apply(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
            }
        };
        self.columns.iter_mut().for_each(smooth);
        smooth(&mut self.residuals);
        self.noise.iter_mut().flat_map(|noise| &mut noise.columns).for_each(smooth);
        let several = (0.5 * self.rate_hz / hz).ceil() as usize;
        let before = &self.bins;
        let mut covered = vec![false; self.residuals.first().map_or(0, Vec::len)];
        for first in &before.first {
            covered[first - self.first..first - self.first + before.several].fill(true);
        }
        let bins = covered.chunks_exact(several).enumerate();
        let first: Vec<usize> =
            bins.filter(|(_, own)| own.iter().all(|c| *c)).map(|(k, _)| k * several).collect();
        let column =
            |own: &Vec<f64>| binned(std::slice::from_ref(own), &first, several).column(0).into_owned();
        let (wide, mut noise) = (before.columns, before.noise.clone());
        noise.iter_mut().for_each(|own| own.gram.fill(0.0));
        for series in &mut self.noise {
            series.bin(several);
            let weight = series.weight / series.first.len().max(1) as f64;
            for (own, binned) in noise.iter_mut().zip(&series.binned) {
                own.gram += (product(binned, binned) * weight).rows(0, wide);
            }
        }
        let bins = Bins {
            rows: self.columns.iter().map(|own| binned(own, &first, several)).collect(),
            residuals: self.residuals.iter().map(column).collect(),
            first: first.iter().map(|k| k + self.first).collect(),
            several,
            noise,
            ..self.bins
        };
        let quiet = Quiet::new(&bins, several as f64 / self.rate_hz);
        Self { bins, quiet, ..self }
    }

    /// Returns what `of` makes of the rows over time of each channel, in bins, and the mean product of that
    /// with all columns as noise of the signals makes it.
    fn candidate(&self, of: impl Fn(&Series, usize) -> Vec<Vec<f64>>) -> Candidate {
        let Bins { channels, columns: p, several, .. } = self.bins;
        let first: Vec<usize> = self.bins.first.iter().map(|b| b - self.first).collect();
        let of_channel = |c: usize| {
            let columns = binned(&of(&self.columns, c), &first, several);
            let mut expected = DMatrix::zeros(columns.ncols(), p + 1);
            for series in &self.noise {
                let own = binned(&of(&series.columns, c), &series.first, several);
                let weight = series.weight / series.first.len() as f64;
                expected += product(&own, &series.binned[c]) * weight;
            }
            Further { columns, expected }
        };
        (0..channels).map(of_channel).collect()
    }

    /// Returns the rows of the body as a resonance has them.
    fn resonance(&self, frequency_hz: f64, damping: f64) -> Candidate {
        let section = Section::resonance(frequency_hz, damping, self.rate_hz);
        let body = self.rows.columns(super::Role::is_body);
        self.candidate(|series, c| {
            section.apply(&body.iter().map(|j| series[c][*j].as_slice()).collect::<Vec<_>>())
        })
    }

    /// Returns the angles, each in every channel; where they are many each in its own.
    fn spring(&self) -> Candidate {
        let turning = self.rows.columns(|role| role == super::Role::Turning);
        let channels = self.columns.len();
        let square = |v: &Vec<f64>| v.iter().map(|a| a * a).sum::<f64>();
        let strongest = |j: &usize| {
            (0..channels)
                .max_by(|c, d| square(&self.columns[*c][*j]).total_cmp(&square(&self.columns[*d][*j])))
                .map(|c| (c, *j))
        };
        let angles: Vec<(usize, usize)> = turning.iter().filter_map(strongest).collect();
        let angle = |series: &Series, (c, j): (usize, usize)| {
            second_integral(series[c][j].iter().copied(), self.rate_hz)
        };
        let all = self.candidate(|series, _| angles.iter().map(|at| angle(series, *at)).collect());
        let of_first = all.first().map_or(DMatrix::zeros(0, 0), |own| own.columns.clone());
        let unit = noise::basis(&of_first, NEW_ANGLE);
        let wide = unit.ncols();
        if wide * channels <= 2 * MOST_COLUMNS {
            // The basis is the angles times this.
            let map = of_first.svd(true, true).solve(&unit, f64::EPSILON);
            let map = map.unwrap_or_else(|_| DMatrix::zeros(angles.len(), wide));
            let of = |(c, own): (usize, &Further)| {
                let mut further = Further {
                    columns: DMatrix::zeros(unit.nrows(), wide * channels),
                    expected: DMatrix::zeros(wide * channels, self.bins.columns + 1),
                };
                further.columns.columns_mut(c * wide, wide).copy_from(&unit);
                further.expected.rows_mut(c * wide, wide).copy_from(&map.tr_mul(&own.expected));
                further
            };
            return all.iter().enumerate().map(of).collect();
        }
        let own = |(c, mut further): (usize, Further)| {
            for (k, _) in angles.iter().enumerate().filter(|(_, at)| at.0 != c) {
                further.columns.column_mut(k).fill(0.0);
                further.expected.row_mut(k).fill(0.0);
            }
            further
        };
        all.into_iter().enumerate().map(own).collect()
    }

    /// Returns what a candidate explains beside the common fit, with noise as it is beside both, and its
    /// probability.
    fn judge(&self, candidate: &Candidate, tried: f64) -> (f64, f64) {
        let bins = &self.bins;
        let (count, n) = (bins.len(), bins.columns);
        let drift = drift(count);
        let noise: Vec<PowerLaw> = (0..bins.channels)
            .map(|c| {
                let k = candidate[c].columns.ncols();
                let all = DMatrix::from_fn(count, 3 + n + k, |b, j| match j {
                    0 => 1.0,
                    1 | 2 => drift[(b, j - 1)],
                    _ if j < 3 + n => bins.rows[c][(b, j - 3)],
                    _ => candidate[c].columns[(b, j - 3 - n)],
                });
                PowerLaw::of(&bins.residuals[c], &noise::basis(&all, noise::ROUNDING))
            })
            .collect();
        let metrics: Vec<Metric> = noise.iter().map(|noise| Metric::new(noise, count)).collect();
        let quiet = Some((&self.quiet, noise.as_slice()));
        let Added { square, rank, .. } = Common::new(bins, &metrics, &[]).added(candidate, quiet);
        let others = (count as f64 - ((n + rank) as f64 / bins.channels as f64) - 3.0).max(1.0);
        (square - PER_COLUMN * rank as f64, (tail(square, rank, others) * tried).min(1.0))
    }

    /// Returns true if parameters of a part make no larger a wrench than those of the whole.
    fn is_part(&self, factors: &[f64]) -> bool {
        let body = self.rows.columns(super::Role::is_body);
        let whole: Vec<f64> = body.iter().map(|j| self.rows.values[*j]).collect();
        let size = |parameters: &[f64]| -> f64 {
            let of = |rows: &DMatrix<f64>| {
                let terms = body.iter().zip(parameters);
                let wrench =
                    (0..rows.nrows()).map(|b| terms.clone().map(|(j, v)| rows[(b, *j)] * v).sum::<f64>());
                wrench.map(|w| w * w).sum::<f64>()
            };
            self.bins.rows.iter().map(of).sum()
        };
        size(factors) <= size(&whole)
    }

    /// Returns the resonance that explains most.
    fn best_resonance(&self) -> Option<NotRigid> {
        let highest = HIGHEST * self.rate_hz;
        let count = ((highest / LOWEST_HZ).log2() * PER_OCTAVE).floor().max(0.0) as usize;
        let frequencies = (0..=count).map(|k| LOWEST_HZ * 2f64.powf(k as f64 / PER_OCTAVE));
        let noise: Vec<PowerLaw> = self.bins.residuals.iter().map(noise::successive).collect();
        let metrics: Vec<Metric> = noise.iter().map(|noise| Metric::new(noise, self.bins.len())).collect();
        let common = Common::new(&self.bins, &metrics, &[]);
        let mut tried: Vec<(f64, f64, f64)> = Vec::new();
        for frequency_hz in frequencies {
            for damping in DAMPINGS {
                let found = common.added(&self.resonance(frequency_hz, damping), None);
                let square = if self.is_part(found.factors.as_slice()) { found.square } else { 0.0 };
                tried.push((square, frequency_hz, damping));
            }
        }
        let most = tried.iter().map(|t| t.0).fold(0.0, f64::max);
        let good = || tried.iter().filter(|t| t.0 >= AS_GOOD * most);
        // The stiffest of those that are as good: far above the motion all are alike.
        let (_, highest, damping) = good().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let lowest = good().map(|t| t.1).fold(*highest, f64::min);
        let candidate = self.resonance(*highest, *damping);
        let (explained, probability) = self.judge(&candidate, tried.len() as f64);
        Some(NotRigid {
            motion: Motion::Resonance { frequency_hz: [lowest, *highest] },
            probability,
            explained,
        })
    }

    /// Returns the bursts, if there are many.
    fn bursts(&self) -> Option<NotRigid> {
        let several = self.bins.several;
        let energies: Vec<f64> = self
            .bins
            .first
            .iter()
            .map(|first| {
                let from = first - self.first;
                // Second differences: of what is slow nothing is left.
                let of = |all: &Vec<f64>| {
                    let own = &all[from..from + several];
                    own.windows(3).map(|e| (e[0] - 2.0 * e[1] + e[2]).powi(2)).sum::<f64>()
                };
                self.residuals.iter().map(of).sum()
            })
            .collect();
        let mut sorted = energies.clone();
        sorted.sort_by(f64::total_cmp);
        let quiet = sorted.get(sorted.len() / 4)?;
        let loud: Vec<bool> = energies.iter().map(|e| *e > LOUD * quiet).collect();
        let count = loud.windows(2).filter(|w| !w[0] && w[1]).count();
        let share = loud.iter().filter(|l| **l).count() as f64 / loud.len().max(1) as f64;
        if several < 4 || count < LEAST_BURSTS || share > MOST_LOUD {
            return None;
        }
        let filter = self.rows.blocks.filter();
        let free = (several * self.residuals.len()) as f64 * filter.row_noise_gain().min(1.0);
        // This number of all bins as loud by chance.
        let one = tail(LOUD * free, free as usize, free * energies.len() as f64) * energies.len() as f64;
        let probability = one.powi(LEAST_BURSTS as i32);
        // What the loud bins have beyond the quiet ones.
        let beyond = energies.iter().zip(&loud).filter(|(_, l)| **l).map(|(e, _)| e / quiet - 1.0);
        let explained = free * beyond.sum::<f64>();
        Some(NotRigid { motion: Motion::Bursts { count }, probability: probability.min(1.0), explained })
    }
}

/// Returns true if something may be named.
fn is_examined(rows: &Rows) -> bool {
    !rows.has_drives && (1..=MOST_COLUMNS).contains(&rows.columns(super::Role::is_body).len())
}

/// Returns what explains the residuals best; `None` if nothing does beyond chance.
pub(super) fn find(rows: &Rows, stored: Option<Stored>) -> Option<NotRigid> {
    if !is_examined(rows) {
        return None;
    }
    let stretch = Stretch::new(rows, stored.unwrap_or_else(|| Stored::new(rows)));
    let bursts = stretch.bursts();
    let stretch = stretch.clear();
    if stretch.bins.len() < 2 * stretch.bins.columns {
        return None;
    }
    let (explained, probability) = stretch.judge(&stretch.spring(), 1.0);
    let spring = NotRigid { motion: Motion::Spring, probability, explained };
    let candidates = stretch.best_resonance().into_iter().chain([spring]).chain(bursts);
    candidates
        .filter(|found| found.probability < FALSE_ALARM)
        .max_by(|a, b| a.explained.total_cmp(&b.explained))
}
