//! Motions that are driven several times, and what a model lacks of them each time again.
//!
//! Friction, cables and elasticity that a model of drives lacks follow the motion. Where a motion repeats,
//! they are the same each time: n repetitions say no more of them than one does, though residuals of two
//! repetitions are as far apart as noise of no memory has. The period is that of the measured efforts; the
//! residuals decide how much of them repeats.

/// Instants that are examined, at most.
const MOST: usize = 3000;
/// A motion begins anew where the measured efforts are as alike as this, as a correlation,
const ALIKE: f64 = 0.9;
/// after they have been less alike than this.
const OTHER: f64 = 0.5;
/// Lags whose correlations are as large as the largest but for this are as good: the shortest of them is the
/// period.
const AS_GOOD: f64 = 0.02;
/// Residuals that repeat less than this, as a correlation, are noise.
const NOISE: f64 = 0.1;

/// Returns the step at which row blocks are examined, of the given number.
pub(super) fn stride(blocks: usize) -> usize {
    blocks.div_ceil(MOST).max(1)
}

/// Returns by how much intervals are too narrow because residuals repeat with the motion: 1 where nothing
/// repeats. Of each channel the measurements and the residuals at evenly spaced instants.
pub(super) fn factor(measured: &[Vec<f64>], residuals: &[Vec<f64>]) -> f64 {
    let Some(period) = period(measured) else { return 1.0 };
    let of = |left: &Vec<f64>| {
        let alike = correlation(left, period);
        let (count, repeats) = (left.len(), left.len().saturating_sub(1) / period);
        let weight: f64 = (1..=repeats).map(|j| 1.0 - (j * period) as f64 / count as f64).sum();
        if alike > NOISE { (1.0 + 2.0 * alike * weight).sqrt() } else { 1.0 }
    };
    residuals.iter().map(of).fold(1.0, f64::max)
}

/// Returns after how many instants a motion begins anew.
fn period(measured: &[Vec<f64>]) -> Option<usize> {
    let count = measured.first()?.len();
    let alike =
        |lag: usize| measured.iter().map(|own| correlation(own, lag)).sum::<f64>() / measured.len() as f64;
    let all: Vec<f64> = (0..=count / 2).map(alike).collect();
    let first = all.iter().position(|alike| *alike < OTHER)?;
    let largest = all[first..].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let found = all[first..].iter().position(|alike| *alike > largest - AS_GOOD)?;
    (largest > ALIKE).then_some(first + found)
}

/// Returns the correlation of a series with itself this many instants later.
fn correlation(values: &[f64], lag: usize) -> f64 {
    let (early, late) = (&values[..values.len() - lag], &values[lag..]);
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
    let (a, b) = (mean(early), mean(late));
    let (mut product, mut squares) = (0.0, [0.0; 2]);
    for (x, y) in early.iter().zip(late) {
        product += (x - a) * (y - b);
        squares[0] += (x - a) * (x - a);
        squares[1] += (y - b) * (y - b);
    }
    let size = (squares[0] * squares[1]).sqrt();
    if size > 0.0 { product / size } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudo-random numbers from 0 to 1 (Knuth's MMIX generator).
    fn drawn(count: usize) -> Vec<f64> {
        let mut state = 7_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..count).map(|_| next()).collect()
    }

    fn motion(k: usize, period: f64) -> f64 {
        let phase = std::f64::consts::TAU * k as f64 / period;
        phase.sin() + 0.7 * (2.0 * phase + 1.0).cos() + 0.4 * (5.0 * phase).sin()
    }

    #[test]
    fn residuals_that_repeat_count_once() {
        // A friction that the model lacks: it depends on the motion alone.
        let measured = vec![(0..1200).map(|k| motion(k, 300.0)).collect::<Vec<f64>>()];
        let lacked = vec![(0..1200).map(|k| motion(k, 300.0).powi(3).tanh()).collect::<Vec<f64>>()];
        let by = factor(&measured, &lacked);
        // Four repetitions are one.
        assert!((by - 2.0).abs() < 0.01, "{by}");
    }

    #[test]
    fn noise_and_motions_that_do_not_repeat_count_as_they_are() {
        let measured = vec![(0..1200).map(|k| motion(k, 300.0)).collect::<Vec<f64>>()];
        assert_eq!(factor(&measured, &[drawn(1200)]), 1.0);
        let once = vec![(0..1200).map(|k| motion(k, 1000.0)).collect::<Vec<f64>>()];
        assert_eq!(factor(&once, &once), 1.0);
        assert_eq!(factor(&[], &[]), 1.0);
        assert_eq!(factor(&[vec![1.0; 50]], &[vec![0.0; 50]]), 1.0);
    }
}
