//! Offset and rate of a clock by least squares over the whole recording: the wrench less all that is linear
//! in what the stream sees, by Gauss and Newton, first over a part and then over all of it.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::signals::{CHANNELS, COLUMNS, Noise, Signals};
use super::{Clock, Found};
use crate::problem::clocks::least_squares::sandwich;

/// Instants that are used at most, and how far they are apart at least, s.
const MOST: usize = 6000;
const STEP_S: f64 = 0.04;
/// The first part, s; each next one is this many times as long.
const FIRST_S: f64 = 60.0;
const GROWTH: f64 = 4.0;
/// Lags over which a signal's correlation with itself counts: 10 s.
const LAGS: usize = 250;
const MOST_ITERATIONS: usize = 12;
/// The longest step at the ends of a part, and the one that ends the iteration, s.
const LONGEST_S: f64 = 0.12;
const CONVERGED_S: f64 = 2e-6;
/// Half the step of the numerical derivative, s.
const HALF_S: f64 = 2e-3;

/// A clock with what it leaves of the wrench.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refined {
    pub(super) found: Found,
    /// Geometric mean over the channels of the share of the variance that is left.
    pub(super) left: f64,
    /// The same for as many independent readings as they are worth; infinite of fewer than there are
    /// unknowns.
    pub(super) corrected: f64,
    /// Geometric mean over the channels of what is left to what noise makes.
    pub(super) over_noise: f64,
}

/// Refines a clock; `None` if there is too little in common, or it does not converge.
pub(super) fn refine(signals: &Signals, noise: &Noise, clock: Clock) -> Option<Refined> {
    let (mut clock, mut width) = (clock, FIRST_S);
    loop {
        let (begin, end) = common(signals, clock);
        let length = end - begin;
        let part = width.min(length);
        let middle = 0.5 * (begin + end);
        let refined = over(signals, noise, clock, (middle - 0.5 * part, middle + 0.5 * part))?;
        if part >= length {
            return Some(refined);
        }
        clock = Clock { offset_s: refined.found.offset_s, rate: refined.found.rate };
        width *= GROWTH;
    }
}

/// Returns what both have in common, s of the wrench's clock.
fn common(signals: &Signals, clock: Clock) -> (f64, f64) {
    let ((a, b), (c, d)) = (signals.wrench_ends_s(), signals.own_ends_s());
    (a.max(clock.offset_s + clock.rate * c), b.min(clock.offset_s + clock.rate * d))
}

/// Rows of a part at a clock.
struct Rows {
    /// Times from the middle, s of the wrench's clock.
    times: Vec<f64>,
    /// The wrench, channel by channel.
    wrench: Vec<DVector<f64>>,
    columns: DMatrix<f64>,
    /// Their derivative by the time of the stream's clock.
    slopes: DMatrix<f64>,
}

fn rows(signals: &Signals, clock: Clock, (from, to): (f64, f64)) -> Option<Rows> {
    let step = STEP_S.max((to - from) / MOST as f64);
    let middle = 0.5 * (from + to);
    let count = ((to - from) / step).floor().max(0.0) as usize;
    let mut all = Vec::new();
    for k in 0..count {
        let at = from + k as f64 * step;
        let own = (at - clock.offset_s) / clock.rate;
        let Some(wrench) = signals.wrench(at) else { continue };
        let (Some(columns), Some(before), Some(after)) =
            (signals.columns(own), signals.columns(own - HALF_S), signals.columns(own + HALF_S))
        else {
            continue;
        };
        all.push((at - middle, wrench, columns, before, after));
    }
    if all.len() < 4 * COLUMNS {
        return None;
    }
    let matrix = |of: &dyn Fn(usize, usize) -> f64| DMatrix::from_fn(all.len(), COLUMNS, of);
    Some(Rows {
        times: all.iter().map(|row| row.0).collect(),
        wrench: (0..CHANNELS)
            .map(|c| DVector::from_iterator(all.len(), all.iter().map(|row| row.1[c])))
            .collect(),
        columns: matrix(&|k, c| all[k].2[c]),
        slopes: matrix(&|k, c| (all[k].4[c] - all[k].3[c]) / (2.0 * HALF_S)),
    })
}

/// The result of one step.
struct Step {
    /// Time of the stream's clock at the middle, s, and how fast it runs.
    change: Vector2<f64>,
    covariance: Matrix2<f64>,
    /// Geometric means over the channels, as [`Refined`] has them.
    left: f64,
    over_noise: f64,
    unknowns: usize,
}

/// Returns how many independent readings a signal is worth, by its autocorrelation up to a lag.
fn independent(signal: &DVector<f64>, lags: usize) -> f64 {
    let mean = signal.mean();
    let e: Vec<f64> = signal.iter().map(|v| v - mean).collect();
    let along = |lag: usize| e.iter().zip(e.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
    let whole = along(0);
    let sum: f64 = (1..lags.min(e.len() / 2)).map(|lag| (along(lag) / whole).powi(2)).sum();
    e.len() as f64 / (1.0 + 2.0 * sum)
}

fn step(rows: &Rows, noise: &Noise) -> Option<Step> {
    // Columns of one size, so that a factor tells which are there.
    let norms: Vec<f64> = rows.columns.column_iter().map(|column| column.norm()).collect();
    let kept: Vec<usize> = (0..COLUMNS).filter(|c| norms[*c] > 0.0).collect();
    let scaled = DMatrix::from_fn(rows.columns.nrows(), kept.len(), |k, c| {
        rows.columns[(k, kept[c])] / norms[kept[c]]
    });
    let qr = scaled.qr();
    let q = qr.q();
    let solved = |y: &DVector<f64>| qr.r().solve_upper_triangular(&(q.transpose() * y));
    let apart = |v: &DVector<f64>| v - &q * (q.transpose() * v);
    let count = rows.times.len();
    let mut derivatives = Vec::new();
    let (mut left, mut over_noise, mut used) = (0.0, 0.0, 0.0);
    for (c, y) in rows.wrench.iter().enumerate() {
        let mean = y.mean();
        let total = y.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let Some(beta) = solved(y).filter(|_| total > 0.0) else { continue };
        let e = apart(y);
        let squares = e.norm_squared();
        left += (squares / total).max(1e-12).ln();
        let of_columns: f64 =
            kept.iter().enumerate().map(|(n, c)| (beta[n] / norms[*c]).powi(2) * noise.columns[*c]).sum();
        let made = (noise.wrench[c] + of_columns).max(1e-12 * total / count as f64);
        over_noise += (squares / (count - kept.len()).max(1) as f64 / made).max(1e-12).ln();
        used += 1.0;
        let slope = DVector::from_fn(count, |k, _| {
            kept.iter().enumerate().map(|(n, c)| rows.slopes[(k, *c)] / norms[*c] * beta[n]).sum()
        });
        let later = DVector::from_fn(count, |k, _| slope[k] * rows.times[k]);
        let variance = squares / (count - kept.len()).max(1) as f64;
        derivatives.push((apart(&slope), apart(&later), e, variance.max(1e-12 * total / count as f64)));
    }
    if used == 0.0 {
        return None;
    }
    let (mut gram, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (a, b, e, variance) in &derivatives {
        gram += Matrix2::new(a.dot(a), a.dot(b), a.dot(b), b.dot(b)) / *variance;
        right += Vector2::new(a.dot(e), b.dot(e)) / *variance;
    }
    let inverse = gram.try_inverse()?;
    let influence: Vec<DVector<f64>> = (0..count)
        .map(|k| {
            let score: Vector2<f64> =
                derivatives.iter().map(|(a, b, e, v)| Vector2::new(a[k], b[k]) * (e[k] / v)).sum();
            DVector::from_column_slice((inverse * score).as_slice())
        })
        .collect();
    let found = sandwich(&influence, &[inverse[(0, 0)], inverse[(1, 1)]], 2, 1.0);
    let covariance = Matrix2::from_fn(|i, j| found[(i, j)]);
    let mean = |sum: f64| (sum / used).exp();
    let (left, over_noise) = (mean(left), mean(over_noise));
    Some(Step { change: inverse * right, covariance, left, over_noise, unknowns: kept.len() })
}

/// Returns the share that a step leaves for as many independent readings as the wrench's are worth.
fn corrected(rows: &Rows, step: &Step) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for y in rows.wrench.iter().filter(|y| y.variance() > 0.0) {
        let worth = independent(y, LAGS);
        let spare = (worth - step.unknowns as f64) / (worth - 1.0);
        if spare <= 0.0 {
            return f64::INFINITY;
        }
        sum += spare.ln();
        count += 1.0;
    }
    step.left / f64::exp(sum / f64::max(count, 1.0))
}

fn over(signals: &Signals, noise: &Noise, clock: Clock, part: (f64, f64)) -> Option<Refined> {
    let (mut clock, mut part) = (clock, part);
    let half = |part: (f64, f64)| 0.5 * (part.1 - part.0);
    for _ in 0..MOST_ITERATIONS {
        let (begin, end) = common(signals, clock);
        part = (part.0.max(begin), part.1.min(end));
        let middle = 0.5 * (part.0 + part.1);
        let rows = rows(signals, clock, part)?;
        let step = step(&rows, noise)?;
        // How far the step moves times at the ends.
        let reach = step.change[0].abs() + half(part) * step.change[1].abs();
        let share = (LONGEST_S / reach.max(f64::MIN_POSITIVE)).min(1.0);
        let own = (middle - clock.offset_s) / clock.rate + share * step.change[0];
        let speed = 1.0 / clock.rate + share * step.change[1];
        if !(0.9..=1.1).contains(&speed) {
            return None;
        }
        clock = Clock { rate: 1.0 / speed, offset_s: middle - own / speed };
        if reach < CONVERGED_S.max(0.02 * step.covariance[(0, 0)].max(0.0).sqrt()) {
            let u95 = |k: usize| 1.96 * step.covariance[(k, k)].max(0.0).sqrt();
            return Some(Refined {
                found: Found {
                    offset_s: clock.offset_s,
                    rate: clock.rate,
                    time_u95_s: u95(0) * clock.rate,
                    rate_u95: u95(1) * clock.rate * clock.rate,
                    explained: 1.0 - step.left,
                },
                left: step.left,
                corrected: corrected(&rows, &step),
                over_noise: step.over_noise,
            });
        }
    }
    None
}
