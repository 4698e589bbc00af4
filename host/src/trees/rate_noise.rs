//! What noise of the rates does to the answer: it stands in the rows, and does not average out there.
//!
//! Rows `Y + Δ` in place of Y move the estimate by `−(RᵀR)⁻¹ (Y + Δ)ᵀ W Δ φ`. The expectation is of second order in the
//! noise: `ΔᵀWΔ`, which draws the estimate to zero, and the mean that Δ has where rates occur in products. Both are found by
//! noise of the same size that is added to the rates once more, with either sign: what is of first order cancels in the mean of
//! the two. (J. Cook, L. Stefanski, J. American Statistical Association 89 (428), 1994, extrapolate in the same way.)
//! The answer is not moved back, as σ is known by its order only: intervals count the whole of it.

use std::borrow::Cow;

use rigident_shared::tree::BaseMotion;

use super::noise::Noise;
use super::rows::Filtered;
use super::{Frame, Input, RowMaker, TreeIdentificationError, filter};
use crate::fit::Solution;
use crate::model::base::BaseParameters;

/// Longer recordings are looked at in their middle.
const LONGEST: usize = 20_000;

/// Expected error of every parameter from noise of the rates; zero where nothing determines it. `sigma` are those of the
/// channels, that the factor was whitened by; `filtered` are the rows of all frames as they are.
///
/// # Errors
/// [`TreeIdentificationError`] if the middle of a recording has no rows.
pub(super) fn bias(
    input: &Input,
    base: &BaseParameters,
    filtered: &Filtered,
    solution: &Solution,
    sigma: &[f64],
) -> Result<Vec<f64>, TreeIdentificationError> {
    let n = solution.estimate.len();
    if input.rate_sigma == 0.0 || input.is_static {
        return Ok(vec![0.0; n]);
    }
    let from = input.frames.len().saturating_sub(LONGEST) / 2;
    let frames = input.frames.get(from..).unwrap_or_default();
    let frames = frames.get(..LONGEST).unwrap_or(frames);
    let share = input.frames.len() as f64 / frames.len().max(1) as f64;
    let mut noise = Noise(Some(1));
    let signs: Vec<Vec<f64>> = frames
        .iter()
        .map(|frame| {
            (0..frame.rates.len() + 3).map(|_| if noise.uniform() < 0.5 { -1.0 } else { 1.0 }).collect()
        })
        .collect();
    let rows = |sign: f64| -> Result<Filtered, TreeIdentificationError> {
        let noisy =
            frames.iter().zip(&signs).map(|(frame, signs)| noisier(frame, signs, sign * input.rate_sigma));
        let input = input.with_frames(noisy.collect());
        filter(&input, RowMaker::new(&input, base).map_err(TreeIdentificationError::Tree)?, &|_| {})
    };
    let quiet =
        if frames.len() == input.frames.len() { Cow::Borrowed(filtered) } else { Cow::Owned(rows(0.0)?) };
    let every = quiet.every;
    let mut pull = vec![0.0; n];
    for noisy in [rows(1.0)?, rows(-1.0)?] {
        for (noisy, quiet) in noisy.blocks.iter().zip(&quiet.blocks) {
            let rows = noisy.rows.chunks_exact(n).zip(quiet.rows.chunks_exact(n));
            for ((row, own), sigma) in rows.zip(sigma) {
                let differ = row.iter().zip(own).zip(&solution.estimate);
                let error: f64 = differ.map(|((a, b), phi)| (a - b) * phi).sum();
                let weight = 0.5 * share * f64::from(every) / (sigma * sigma);
                for (pull, a) in pull.iter_mut().zip(row) {
                    *pull += weight * a * error;
                }
            }
        }
    }
    let pull = nalgebra::DVector::from_vec(pull);
    let moved = &solution.covariance * pull;
    Ok(moved.iter().zip(&solution.determined).map(|(v, d)| if *d { -v } else { 0.0 }).collect())
}

/// The same frame with more noise on its rates.
fn noisier(frame: &Frame, signs: &[f64], sigma: f64) -> Frame {
    let (joints, base) = signs.split_at(frame.rates.len());
    let mut noisy = frame.clone();
    for (rate, sign) in noisy.rates.iter_mut().zip(joints) {
        *rate += sigma * sign;
    }
    // A base that stands still is not measured.
    if frame.base.rate != nalgebra::Vector3::zeros() {
        let rate = frame.base.rate + nalgebra::Vector3::from_column_slice(base) * sigma;
        noisy.base = BaseMotion { rate, ..frame.base };
    }
    noisy
}

#[cfg(test)]
mod tests {
    use super::super::prepare::{Wishes, prepare};
    use super::super::simulated::{coverage, seven_axes, seven_axis_recording, truth};
    use super::super::{TreeIdentification, identify};
    use super::*;

    /// Joint rates from coarse encoders: 0.03 rad/s a reading.
    fn noisy(seed: u64) -> TreeIdentification {
        let model = seven_axes();
        let mut recording = seven_axis_recording(&model, 200.0, 20.0, true, Some(seed), 0.0);
        let mut noise = Noise(Some(seed.wrapping_mul(977)));
        for (_, cells) in recording.extra.iter_mut().filter(|(name, _)| name.ends_with("_radps")) {
            for cell in cells {
                *cell = (cell.parse::<f64>().unwrap() + noise.normal(0.03)).to_string();
            }
        }
        identify(&prepare(&recording, &model, &Wishes::default()).unwrap().input).unwrap()
    }

    #[test]
    fn what_noise_of_the_rates_does_is_foreseen_and_counted() {
        let model = seven_axes();
        let runs = 8;
        let (mut errors, mut foreseen) = (vec![0.0; 43], vec![0.0; 43]);
        let inside = coverage(runs, |seed| {
            let found = noisy(seed + 1);
            let truth = truth(&model, &found);
            for j in 0..43 {
                // Without what is foreseen.
                let sd = (found.estimate.covariance[(j, j)] - found.rate_bias[j].powi(2)).sqrt();
                errors[j] += (found.estimate.values[j] - truth[j]) / sd / runs as f64;
                foreseen[j] += found.rate_bias[j] / sd / runs as f64;
            }
            (truth, found)
        });
        let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let left: Vec<f64> = errors.iter().zip(&foreseen).map(|(e, f)| e - f).collect();
        // Eight runs leave of a mean of 43 numbers √(43/8) = 2.3 at most, where σ is no larger than said.
        assert!(
            norm(&errors) > 2.5 && norm(&left) < 0.5 * norm(&errors),
            "{} {}",
            norm(&errors),
            norm(&left)
        );
        assert!(inside > 0.93, "{inside}");
    }
}
