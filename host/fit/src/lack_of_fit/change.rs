//! A change at one time: something loosened, added or lost while the recording was made.
//!
//! The supremum over time of the score test of a step in the parameters (D. W. K. Andrews, Tests for
//! parameter instability and structural change with unknown change point, Econometrica 61, 1993), on means of
//! whitened rows over bins of time (`bins`). A first test takes the bins' noise as white; what it suspects is
//! tested again with white, flicker and walking noise as the residuals beside the step show them (`noise`), a
//! line and a curve in time of every channel eliminated. A step of the body counts only beside a step of the
//! channels' offsets and of friction: what a load cell does by itself is no change of the body, and friction
//! is no evidence at all. Nothing here knows of bodies: columns say themselves whose they are.

use nalgebra::{DMatrix, DVector};

use super::bins::Bins;
use super::metric::{Metric, drift};
use super::noise::{self, PowerLaw};
use super::noise_filled::NoiseFilled;
use super::score::{Common, PER_COLUMN, Score, Step};
use super::{Role, Rows, tail};
use crate::Whitener;
use crate::left_of_rows::dot;

/// A change by chance in one honest recording of this many, at most.
pub const FALSE_ALARM: f64 = 1e-7;
/// A first test with white noise lets this many honest recordings pass to the second.
const SUSPICION: f64 = 1e-2;
/// Share of the bins at either end in which no change is searched for, and least number of them.
const ENDS: f64 = 0.05;
const LEAST_END: usize = 5;
/// Fewer bins than this say nothing.
const LEAST_BINS: usize = 40;
/// Rounds of the noise beside the step, and of the directions that noise could fill.
const ROUNDS: usize = 4;
const MOST_FILLED: usize = 16;
/// Steps at all times are worth this many independent ones.
const INDEPENDENT: f64 = 4.0;
/// A change of bodies on drives explains this share of the residuals at least: less is no more than a model
/// of friction lacks.
const LEAST_SHARE: f64 = 0.05;
/// Bins about the change in which its time is searched for row by row.
const NEAR: usize = 3;
/// The 95 % interval of the time is `11/L` to either side, L being the mean square of the step in a row, in
/// units of its noise (J. Bai, Estimation of a change point in multiple regression models, Review of
/// Economics and Statistics 79, 1997).
const BAI_95: f64 = 11.0;

/// The change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Changed {
    /// The parameters that are identified.
    Body,
    /// Offsets of channels.
    Offset,
    /// Either: the motion does not tell.
    Either,
}

/// A step of one column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnStep {
    /// Number of the column.
    pub column: usize,
    /// After less before.
    pub value: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// A change at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Time, s, as the samples count it.
    pub time_s: f64,
    /// Its 95 % uncertainty, s.
    pub time_u95_s: f64,
    /// The change.
    pub changed: Changed,
    /// Probability, at most, that an honest recording shows as much somewhere.
    pub probability: f64,
    /// Decrease of χ², less what columns explain by chance.
    pub explained: f64,
    /// Steps of the columns that changed, as far as they are determined.
    pub steps: Vec<ColumnStep>,
}

/// Returns the change that rows show; `None` where there is none beyond chance, or rows are too few to tell.
pub(super) fn find(rows: &Rows, bins: &Bins) -> Option<Change> {
    let offset = rows.columns(|role| role == Role::Offset);
    let friction = rows.columns(|role| role == Role::Friction);
    let body = rows.columns(Role::is_body);
    if bins.len() < LEAST_BINS || body.is_empty() {
        return None;
    }
    let columns: Vec<usize> = friction.iter().chain(&offset).chain(&body).copied().collect();
    let bin_s = bins.several as f64 * rows.blocks.filter().row_period_s();
    let [friction, offsets] = [friction.len(), offset.len()];
    Search { bins, columns: &columns, friction, offsets, bin_s }.find(rows)
}

pub(super) struct Search<'a> {
    pub(super) bins: &'a Bins,
    /// Columns that may step: friction, offsets, bodies.
    pub(super) columns: &'a [usize],
    pub(super) friction: usize,
    pub(super) offsets: usize,
    /// Length of a bin, s.
    pub(super) bin_s: f64,
}

/// Returns the decrease of χ² and its degrees of freedom by a first set of columns, then by both.
type Explain<'a> = &'a dyn Fn([&[usize]; 2]) -> [(f64, usize); 2];

/// The largest step beside one of friction, at one bin.
struct Largest {
    bin: usize,
    square: f64,
    rank: usize,
}

impl Search<'_> {
    fn others(&self) -> f64 {
        let per_channel = (self.bins.columns + self.columns.len()).div_ceil(self.bins.channels.max(1)) + 2;
        (self.bins.len() as f64 - per_channel as f64).max(1.0)
    }

    /// Returns the probability of a step of this much at one of the times that were examined, by the sum of
    /// all.
    fn probability(&self, square: f64, rank: usize) -> f64 {
        (tail(square, rank, self.others()) * self.range().len() as f64).min(1.0)
    }

    fn range(&self) -> std::ops::Range<usize> {
        let end = LEAST_END.max((ENDS * self.bins.len() as f64).ceil() as usize);
        end..self.bins.len().saturating_sub(end)
    }

    fn friction(&self) -> Vec<usize> {
        (0..self.friction).collect()
    }

    fn offset(&self) -> Vec<usize> {
        (self.friction..self.friction + self.offsets).collect()
    }

    fn body(&self) -> Vec<usize> {
        (self.friction + self.offsets..self.columns.len()).collect()
    }

    /// Returns what a second set of columns explains beside friction and a first set.
    fn beside(&self, first: &[usize], second: &[usize], explain: Explain) -> (f64, usize) {
        let first: Vec<usize> = self.friction().into_iter().chain(first.iter().copied()).collect();
        let [(square, rank), (both, all)] = explain([&first, second]);
        (both - square, all.saturating_sub(rank))
    }

    /// Returns what steps explain beside those of friction.
    fn explained(&self, common: &Common, score: &Score) -> (f64, usize) {
        let others: Vec<usize> = (self.friction..self.columns.len()).collect();
        self.beside(&[], &others, &|sets| common.explained(score, sets))
    }

    fn largest(&self, common: &Common, filled: &[DVector<f64>]) -> Option<Largest> {
        let mut largest: Option<(f64, Largest)> = None;
        common.each(self.range(), |score| {
            let score = score.beside(filled);
            let (square, rank) = self.explained(common, &score);
            let chance = tail(square, rank, self.others());
            // Beyond the smallest number that there is, the square decides.
            let better = |(least, best): &(f64, Largest)| {
                chance < *least || (chance == *least && square > best.square)
            };
            if largest.as_ref().is_none_or(better) {
                largest = Some((chance, Largest { bin: score.bin, square, rank }));
            }
        });
        largest.map(|(_, found)| found)
    }

    /// Returns the largest step beside noise of the channels as it is beside that step, and beside directions
    /// that noise of the signals could fill; `None` where there is none beyond chance.
    fn find(&self, rows: &Rows) -> Option<Change> {
        let noise: Vec<PowerLaw> = self.bins.residuals.iter().map(noise::successive).collect();
        let first = self.largest(&Common::new(self.bins, &self.metrics(&noise), self.columns), &[])?;
        if self.probability(first.square, first.rank) > SUSPICION {
            return None;
        }
        let could = NoiseFilled::new(self.bins, self.columns, self.friction + self.offsets, self.bin_s);
        let (mut filled, mut found): (Vec<DVector<f64>>, _) = (Vec::new(), first);
        for _ in 0..MOST_FILLED {
            let (noise, largest) = self.second_look(found, &filled)?;
            if self.probability(largest.square, largest.rank) > FALSE_ALARM {
                return None;
            }
            let metrics = self.metrics(&noise);
            let more = could.at(largest.bin, &metrics, &noise);
            let common = Common::new(self.bins, &metrics, self.columns);
            let score = common.at(largest.bin)?;
            let evidence = score.clone().beside(&filled);
            let beside = evidence.clone().beside(&more);
            let (_, rank) = self.explained(&common, &beside);
            if rank == largest.rank {
                if rows.has_drives && self.is_everywhere(&metrics, &largest) {
                    return None;
                }
                let change = self.conclude(rows, &common, [&score, &evidence], &filled, &noise);
                // What is no larger than noise in any row is at no time.
                return Some(change).filter(|change| change.time_u95_s < self.bin_s * self.bins.len() as f64);
            }
            filled.extend(more);
            found = largest;
        }
        None
    }

    /// Returns true if a step at another time, beside the largest, explains so much that the largest may be
    /// of its kind: what a model lacks of friction is everywhere, more in one move than in another, and a
    /// change is at one time.
    fn is_everywhere(&self, metrics: &[Metric], largest: &Largest) -> bool {
        let squares = metrics.iter().zip(&self.bins.residuals).map(|(metric, left)| {
            let weighted = metric.apply(&DMatrix::from_column_slice(left.len(), 1, left.as_slice()));
            left.dot(&weighted.column(0))
        });
        if largest.square < LEAST_SHARE * squares.sum::<f64>() {
            return true;
        }
        let bins = self.bins.with_step(self.columns, largest.bin);
        let beside = Common::new(&bins, metrics, self.columns);
        let mut usual = 1.0_f64;
        beside.each(self.range(), |score| {
            // Near to it a step explains what the bins leave of the largest itself.
            if score.bin.abs_diff(largest.bin) <= NEAR {
                return;
            }
            let (square, rank) = self.explained(&beside, &score);
            usual = usual.max(square / rank.max(1) as f64);
        });
        let known = (INDEPENDENT * largest.rank as f64).min(self.others());
        let chance = tail(largest.square / usual, largest.rank, known) * self.range().len() as f64;
        chance > FALSE_ALARM
    }

    /// Returns the noise of every channel as it is beside the largest step, and the largest step beside that
    /// noise.
    fn second_look(&self, first: Largest, filled: &[DVector<f64>]) -> Option<(Vec<PowerLaw>, Largest)> {
        let (mut noise, mut found) = (Vec::new(), first);
        for _ in 0..ROUNDS {
            let before = found.bin;
            noise = (0..self.bins.channels).map(|c| self.noise_beside(c, before)).collect();
            found = self.largest(&Common::new(self.bins, &self.metrics(&noise), self.columns), filled)?;
            if found.bin == before {
                break;
            }
        }
        Some((noise, found))
    }

    /// Returns the probability of the largest step, however small it is.
    #[cfg(test)]
    pub(super) fn chance(&self) -> Option<f64> {
        let noise: Vec<PowerLaw> = self.bins.residuals.iter().map(noise::successive).collect();
        let first = self.largest(&Common::new(self.bins, &self.metrics(&noise), self.columns), &[])?;
        let (_, found) = self.second_look(first, &[])?;
        Some(self.probability(found.square, found.rank))
    }

    fn metrics(&self, noise: &[PowerLaw]) -> Vec<Metric> {
        noise.iter().map(|noise| Metric::new(noise, self.bins.len())).collect()
    }

    /// Returns the noise of a channel beside everything that its rows explain, a step from a bin on too.
    fn noise_beside(&self, channel: usize, bin: usize) -> PowerLaw {
        let rows = &self.bins.rows[channel];
        let (count, n) = rows.shape();
        let drift = drift(count);
        let after = |b: usize| f64::from(u8::from(b >= bin));
        let all = DMatrix::from_fn(count, 1 + 2 + n + self.columns.len(), |b, j| match j {
            0 => 1.0,
            1 | 2 => drift[(b, j - 1)],
            _ if j < 3 + n => rows[(b, j - 3)],
            _ => rows[(b, self.columns[j - 3 - n])] * after(b),
        });
        PowerLaw::of(&self.bins.residuals[channel], &noise::basis(&all, noise::ROUNDING))
    }

    /// Tells what changed, by how much, and when: by a score, and by that beside `filled` directions.
    fn conclude(
        &self,
        rows: &Rows,
        common: &Common,
        [score, evidence]: [&Score; 2],
        filled: &[DVector<f64>],
        noise: &[PowerLaw],
    ) -> Change {
        let (offset, body) = (self.offset(), self.body());
        let beside = |first: &[usize], second: &[usize]| {
            let (square, rank) = self.beside(first, second, &|sets| common.explained(evidence, sets));
            self.probability(square, rank)
        };
        let (square, rank) = self.explained(common, evidence);
        let of_body = beside(&offset, &body);
        let of_offset = beside(&body, &offset);
        let changed = if of_body < FALSE_ALARM {
            Changed::Body
        } else if of_offset < FALSE_ALARM {
            Changed::Offset
        } else {
            Changed::Either
        };
        let also = match changed {
            Changed::Body if of_offset < FALSE_ALARM => [&offset[..], &body],
            Changed::Body | Changed::Either => [&body[..], &[]],
            Changed::Offset => [&offset[..], &[]],
        };
        let set: Vec<usize> = self.friction().into_iter().chain(also.concat()).collect();
        let step = common.step(score, &set, filled);
        let (time_s, time_u95_s) = self.time(rows, &step, score.bin, noise);
        let steps = step.columns.iter().enumerate().filter(|(k, _)| step.determined[*k]);
        let steps = steps.map(|(k, column)| ColumnStep {
            column: *column,
            value: step.value[k],
            deviation: step.covariance[(k, k)].max(0.0).sqrt(),
        });
        let steps = steps.collect();
        let probability = if changed == Changed::Body { of_body } else { self.probability(square, rank) };
        let explained = square - PER_COLUMN * rank as f64;
        Change { time_s, time_u95_s, changed, probability, explained, steps }
    }

    /// Returns what the drift of a channel is in a row near a bin, beside a step from there on: the common
    /// fit leaves it, as it says nothing of a step.
    fn level(&self, channel: usize, step: &Step, bin: usize) -> f64 {
        let rows = &self.bins.rows[channel];
        let mut left = &self.bins.residuals[channel] - rows * &step.fitted;
        for (column, value) in step.columns.iter().zip(step.value.iter()) {
            let own = rows.column(*column);
            left.iter_mut().zip(own.iter()).skip(bin).for_each(|(left, row)| *left -= row * value);
        }
        let drift = drift(left.len()).insert_column(0, 1.0);
        let of_bin = drift.row(bin.min(left.len().saturating_sub(1))).into_owned();
        let fitted = drift.svd(true, true).solve(&left, f64::EPSILON);
        fitted.map_or(0.0, |fitted| (of_bin * fitted)[0]) / (self.bins.several as f64).sqrt()
    }

    /// Returns the time of a step near a bin, row by row, and its 95 % uncertainty.
    fn time(&self, rows: &Rows, step: &Step, bin: usize, noise: &[PowerLaw]) -> (f64, f64) {
        let (n, channels) = (self.bins.columns, self.bins.channels);
        let filter = rows.blocks.filter();
        let first = self.bins.first[bin.saturating_sub(NEAR)];
        let last = self.bins.first[(bin + NEAR).min(self.bins.len() - 1)];
        let mut whitener = Whitener::new(rows.whitening, n);
        let (mut own, mut values) = (vec![0.0; channels * n], vec![0.0; channels]);
        let levels: Vec<f64> = (0..channels).map(|c| self.level(c, step, bin)).collect();
        // Squares of the step and of the residuals beside it, row by row: after less before.
        let (mut gain, mut size) = (Vec::new(), 0.0);
        for block in first.saturating_sub(rows.whitening.lead())..last {
            rows.blocks.write(block, &mut own, &mut values);
            for (row, value) in own.chunks_exact(n.max(1)).zip(&mut values) {
                *value -= dot(row, rows.values);
            }
            whitener.apply(rows.blocks.time_s(block), &mut own, &mut values, None);
            if block < first {
                continue;
            }
            let lines = own.chunks_exact(n.max(1)).zip(&values).zip(noise).zip(&levels);
            let sums = lines.map(|(((row, value), noise), level)| {
                let left = value - dot(row, step.fitted.as_slice()) - level;
                let moved: f64 = step.columns.iter().zip(step.value.iter()).map(|(j, v)| row[*j] * v).sum();
                let variance = noise.white;
                (((left - moved).powi(2) - left * left) / variance, moved * moved / variance)
            });
            let (difference, square) = sums.fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
            gain.push(difference);
            size += square;
        }
        // The step begins where all rows after it are better explained with it.
        let mut best = (0.0, gain.len());
        let mut sum = 0.0;
        for (k, difference) in gain.iter().enumerate().rev() {
            sum += difference;
            if sum < best.0 {
                best = (sum, k);
            }
        }
        let period_s = filter.row_period_s();
        let time_s = rows.blocks.time_s(first + best.1) - 0.5 * (filter.width_s + period_s);
        let per_row = size / gain.len().max(1) as f64;
        (time_s, period_s * (1.0 + BAI_95 / per_row.max(f64::MIN_POSITIVE)))
    }
}
