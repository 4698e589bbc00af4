//! All offsets and rates at a coarse step: the correlation of the wrench with what a stream sees, over a
//! common frame of both that makes every channel independent of the others, by Fourier transforms.

use std::sync::Arc;

use nalgebra::DMatrix;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::Clock;
use super::signals::{CHANNELS, Signals};

/// Samples for the search, 1/s.
const RATE_HZ: f64 = 25.0;
/// The largest error of a clock's rate, and by how much a step of it may move the ends of what is compared,
/// s.
const MOST_RATE: f64 = 0.0125;
const DRIFT_S: f64 = 0.08;
/// The longest part of the stream that is compared, s; the liveliest is.
const LONGEST_S: f64 = 240.0;
/// They have at least this long in common, s.
pub(super) const SHORTEST_S: f64 = 8.0;
/// Those that have this share of the shorter one in common are compared by how well they agree; of all, how
/// unlikely that is by chance counts.
const SHARE: f64 = 0.5;
/// Candidates that are refined by either, and how far they are from each other at least, s.
const CANDIDATES: usize = 6;
const APART_S: f64 = 0.25;
/// Directions with less than this share of the mean variance are noise.
const LEAST: f64 = 1e-2;

/// Channels on a uniform grid, independent and of variance one; zero where there is none.
struct White {
    from_s: f64,
    channels: Vec<Vec<f64>>,
    len: usize,
}

/// The search for one stream.
pub(super) struct Search<'a> {
    signals: &'a Signals,
    wrench: White,
    /// The part of the stream that is compared, s of its clock.
    part_s: (f64, f64),
}

impl<'a> Search<'a> {
    pub(super) fn new(signals: &'a Signals) -> Self {
        let (from, to) = signals.wrench_ends_s();
        let wrench = white(from, to, |at| signals.wrench(at).map(|w| w.to_vec()), CHANNELS);
        Self { signals, wrench, part_s: liveliest(signals) }
    }

    /// Returns the best correlation within `near_s` of the stamps as they are, and that of all offsets, at
    /// the clock's own rate.
    pub(super) fn at_rate(&self, near_s: f64) -> (f64, f64) {
        let curve = self.curve(1.0);
        let mut found = (0.0_f64, 0.0_f64);
        for at in curve.iter().filter(|at| at.is_long) {
            found.1 = found.1.max(at.score);
            if at.offset_s.abs() <= near_s {
                found.0 = found.0.max(at.score);
            }
        }
        found
    }

    /// Returns the best clocks of all offsets and rates, apart from each other.
    pub(super) fn candidates(&self) -> Vec<Clock> {
        let length = self.part_s.1 - self.part_s.0;
        let steps = (MOST_RATE * 0.5 * length / DRIFT_S).ceil().max(1.0) as i64;
        let middle = 0.5 * (self.part_s.0 + self.part_s.1);
        let mut all: Vec<(Agreement, f64, Clock)> = Vec::new();
        for step in -steps..=steps {
            let rate = 1.0 + MOST_RATE * step as f64 / steps as f64;
            let curve = self.curve(rate);
            for (k, at) in curve.iter().enumerate() {
                let before = k.checked_sub(1).and_then(|k| curve.get(k));
                let is_peak = before.is_none_or(|b| b.score <= at.score)
                    && curve.get(k + 1).is_none_or(|n| n.score < at.score);
                if is_peak && at.score > 0.0 {
                    all.push((*at, at.offset_s + rate * middle, Clock { offset_s: at.offset_s, rate }));
                }
            }
        }
        let mut kept: Vec<(f64, Clock)> = Vec::new();
        all.sort_by(|a, b| b.0.score.total_cmp(&a.0.score));
        apart(all.iter().filter(|(at, ..)| at.is_long), &mut kept);
        all.sort_by(|a, b| b.0.evidence.total_cmp(&a.0.evidence));
        apart(all.iter(), &mut kept);
        kept.into_iter().map(|(_, clock)| clock).collect()
    }

    /// Returns the correlation at each offset, s, for a rate of the stream's clock.
    fn curve(&self, rate: f64) -> Vec<Agreement> {
        let (from, to) = (rate * self.part_s.0, rate * self.part_s.1);
        let own =
            white(from, to, |at| self.signals.motion(at / rate).map(|[a, w, _]| [a, w].concat()), CHANNELS);
        if own.channels.is_empty() || self.wrench.channels.is_empty() {
            return Vec::new();
        }
        let size = (self.wrench.len + own.len).next_power_of_two();
        let mut planner = FftPlanner::new();
        let (forward, back) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
        let wrench = spectra(&self.wrench, &forward, size);
        let own_spectra = spectra(&own, &forward, size);
        let mut sums = vec![0.0; size];
        for a in &wrench {
            for b in &own_spectra {
                let mut product: Vec<Complex<f64>> = a.iter().zip(b).map(|(a, b)| a * b.conj()).collect();
                back.process(&mut product);
                sums.iter_mut().zip(&product).for_each(|(sum, c)| *sum += (c.re / size as f64).powi(2));
            }
        }
        let (n, m) = (self.wrench.len as i64, own.len as i64);
        let (long, least) = ((SHARE * n.min(m) as f64) as i64, (SHORTEST_S * RATE_HZ) as i64);
        let channels = self.wrench.channels.len() as f64;
        let agreement = |lag: i64| {
            let common = n.min(m + lag) - lag.max(0);
            let sum = sums[lag.rem_euclid(size as i64) as usize] / channels;
            (common >= least).then(|| Agreement {
                offset_s: self.wrench.from_s + lag as f64 / RATE_HZ - own.from_s,
                score: sum / (common as f64).powi(2),
                // By chance the sum grows as what they have in common.
                evidence: sum / common as f64,
                is_long: common >= long,
            })
        };
        (-m + 1..n).filter_map(agreement).collect()
    }
}

/// The agreement of a stream with the wrench at an offset.
#[derive(Clone, Copy, Debug)]
struct Agreement {
    offset_s: f64,
    /// Mean square of the correlations.
    score: f64,
    /// The mean square times the readings that they have in common.
    evidence: f64,
    /// They have much of the shorter one in common.
    is_long: bool,
}

/// Appends the first few clocks that are apart from each other and from those there are.
fn apart<'a>(all: impl Iterator<Item = &'a (Agreement, f64, Clock)>, kept: &mut Vec<(f64, Clock)>) {
    let most = kept.len() + CANDIDATES;
    for (_, at, clock) in all {
        if kept.len() == most {
            break;
        }
        if kept.iter().all(|(other, _)| (other - at).abs() > APART_S) {
            kept.push((*at, *clock));
        }
    }
}

fn spectra(white: &White, forward: &Arc<dyn Fft<f64>>, size: usize) -> Vec<Vec<Complex<f64>>> {
    let of = |channel: &Vec<f64>| {
        let mut all: Vec<Complex<f64>> = channel.iter().map(|v| Complex::new(*v, 0.0)).collect();
        all.resize(size, Complex::new(0.0, 0.0));
        forward.process(&mut all);
        all
    };
    white.channels.iter().map(of).collect()
}

/// Returns channels on a grid, turned so that they are independent, each of variance one; those that are
/// noise are left out.
fn white(from_s: f64, to_s: f64, at: impl Fn(f64) -> Option<Vec<f64>>, channels: usize) -> White {
    let len = (((to_s - from_s) * RATE_HZ).floor().max(0.0) as usize).saturating_add(1).min(1 << 22);
    let rows: Vec<Option<Vec<f64>>> = (0..len).map(|k| at(from_s + k as f64 / RATE_HZ)).collect();
    let there: Vec<&Vec<f64>> = rows.iter().flatten().collect();
    let count = there.len().max(1) as f64;
    let mean: Vec<f64> = (0..channels).map(|c| there.iter().map(|row| row[c]).sum::<f64>() / count).collect();
    let sigma: Vec<f64> = (0..channels)
        .map(|c| (there.iter().map(|row| (row[c] - mean[c]).powi(2)).sum::<f64>() / count).sqrt())
        .collect();
    let scaled = |row: &[f64], c: usize| if sigma[c] > 0.0 { (row[c] - mean[c]) / sigma[c] } else { 0.0 };
    let mut gram = DMatrix::<f64>::zeros(channels, channels);
    for row in &there {
        for i in 0..channels {
            for j in 0..channels {
                gram[(i, j)] += scaled(row, i) * scaled(row, j) / count;
            }
        }
    }
    let eigen = gram.symmetric_eigen();
    let mut turned = Vec::new();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > LEAST {
            let of = |row: &Option<Vec<f64>>| {
                let sum =
                    row.as_ref().map(|row| (0..channels).map(|c| vector[c] * scaled(row, c)).sum::<f64>());
                sum.unwrap_or(0.0) / value.sqrt()
            };
            turned.push(rows.iter().map(of).collect());
        }
    }
    White { from_s, channels: turned, len }
}

/// Returns the part of a long stream in which it moves most, s of its clock.
fn liveliest(signals: &Signals) -> (f64, f64) {
    let (from, to) = signals.own_ends_s();
    if to - from <= LONGEST_S {
        return (from, to);
    }
    let starts = (0..).map(|k| from + 0.25 * LONGEST_S * f64::from(k)).take_while(|at| at + LONGEST_S <= to);
    let motion = |start: f64| {
        let rows: Vec<[f64; 6]> = (0..480)
            .filter_map(|k| signals.motion(start + LONGEST_S * f64::from(k) / 480.0))
            .map(|[a, w, _]| [a[0], a[1], a[2], w[0], w[1], w[2]])
            .collect();
        let count = rows.len().max(1) as f64;
        let mean = |c: usize| rows.iter().map(|row| row[c]).sum::<f64>() / count;
        (0..6).map(|c| rows.iter().map(|row| (row[c] - mean(c)).powi(2)).sum::<f64>()).sum::<f64>()
    };
    let best = starts.max_by(|a, b| motion(*a).total_cmp(&motion(*b))).unwrap_or(from);
    (best, best + LONGEST_S)
}
