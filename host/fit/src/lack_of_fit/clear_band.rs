//! Frequencies at which motion is clear of noise, without a rest that would show the noise.
//!
//! Of an honest recording rows predict `p = s + n`, s of the motion and n by noise of the signals, and leave
//! the residual `r = e − n`: their cross spectrum is `−S_n`, whatever filter that noise went through. What
//! swings far above the motion would move by that noise as by a motion, and its wrench resembles the
//! residual, which has the noise too. So where that is seen above the motion, only what is slower is
//! evidence.

use std::f64::consts::TAU;

/// Rows of a stretch, and of two that follow one another the half that they share.
const LONG: usize = 256;
const STEP: usize = LONG / 2;
/// Stretches at least: the cross spectrum of fewer is chance.
const FEWEST: usize = 4;
/// Motion has this share of what rows predict, as a power: the rest may be noise.
const MOTION: f64 = 0.99;
/// Noise of the rows is this share at least of what they predict above the motion,
const PREDICTED: f64 = 0.5;
/// and this share of the residuals there.
const LEFT: f64 = 0.03;

/// Powers of what rows predict, of residuals, and their product.
#[derive(Clone, Copy, Default)]
struct Powers {
    predicted: f64,
    left: f64,
    both: f64,
}

/// Returns the highest frequency at which motion is clear of noise, Hz, if residuals above it have noise of
/// the rows; `None` if they have none, or rows are too few to tell. Series are those of the channels, of the
/// given rate, Hz.
pub(super) fn highest_hz(predicted: &[Vec<f64>], left: &[Vec<f64>], rate_hz: f64) -> Option<f64> {
    let spectrum = spectrum(predicted, left)?;
    let whole: f64 = spectrum.iter().map(|own| own.predicted).sum();
    let (mut above, mut found) = (Powers::default(), None);
    for (k, own) in spectrum.iter().enumerate().rev() {
        above.predicted += own.predicted;
        above.left += own.left;
        above.both += own.both;
        if above.predicted > (1.0 - MOTION) * whole {
            break;
        }
        if -above.both > PREDICTED * above.predicted && -above.both > LEFT * above.left {
            found = Some(k);
        }
    }
    found.map(|k| (k.max(1) as f64) * rate_hz / LONG as f64)
}

/// Returns powers by frequency, from 1 on in steps of the rate over [`LONG`], of stretches through Hann's
/// window; `None` of too few rows.
fn spectrum(predicted: &[Vec<f64>], left: &[Vec<f64>]) -> Option<Vec<Powers>> {
    let count = left.first().map_or(0, Vec::len);
    if count < LONG + (FEWEST - 1) * STEP {
        return None;
    }
    let hann: Vec<f64> =
        (0..LONG).map(|k| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / LONG as f64).cos()).collect();
    let turns: Vec<(f64, f64)> = (0..LONG).map(|k| (TAU * k as f64 / LONG as f64).sin_cos()).collect();
    let mut powers = vec![Powers::default(); LONG / 2 - 1];
    let windowed = |series: &[f64], from: usize| -> Vec<f64> {
        let own = &series[from..from + LONG];
        let mean = own.iter().sum::<f64>() / LONG as f64;
        own.iter().zip(&hann).map(|(v, w)| (v - mean) * w).collect()
    };
    let at = |series: &[f64], k: usize| {
        series.iter().enumerate().fold((0.0, 0.0), |(re, im), (t, v)| {
            let (sin, cos) = turns[(t * k) % LONG];
            (re + v * cos, im - v * sin)
        })
    };
    for (predicted, left) in predicted.iter().zip(left) {
        for from in (0..=count - LONG).step_by(STEP) {
            let (p, r) = (windowed(predicted, from), windowed(left, from));
            for (k, sum) in powers.iter_mut().enumerate() {
                let ((a, b), (c, d)) = (at(&p, k + 1), at(&r, k + 1));
                sum.predicted += a * a + b * b;
                sum.left += c * c + d * d;
                sum.both += a * c + b * d;
            }
        }
    }
    Some(powers)
}
