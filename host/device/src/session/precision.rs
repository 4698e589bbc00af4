//! The least σ that the device can weigh rows by, in single precision.
//!
//! A row is `Σ aⱼ φⱼ = y` of up to 25 terms, each of which the device rounds by up to half a step, `ε/2` of
//! its size with `ε = 2⁻²³`. Were σ less than what that comes to, rounding would be taken for information;
//! and whitened rows grow as 1/σ while the reflections multiply four of their numbers, which single precision
//! holds up to about 1e9 each.

use rigident_shared::screening::CHANNEL_NAMES;

use rigident_fit::{FitError, Progress, RowSource};

/// The largest number of a row counts this many times for the least σ: `√25 ε/2`, rounded up.
const STEPS: f64 = 4.0 * f32::EPSILON as f64;

/// Returns the least σ of a channel whose rows hold numbers up to `largest`.
pub fn least_sigma(largest: f64) -> f64 {
    STEPS * largest
}

/// Returns the largest number, of coefficients and measurement, in the filtered rows of every channel.
///
/// # Errors
/// [`FitError`] if the filter does not fit the rate.
pub fn largest_numbers(source: &dyn RowSource, progress: &dyn Progress) -> Result<Vec<f64>, FitError> {
    let (channels, parameters) = (source.channels().len(), source.parameters().len());
    let blocks = source.blocks(progress)?;
    let (mut rows, mut measured) = (vec![0.0; channels * parameters], vec![0.0; channels]);
    let mut largest = vec![0.0_f64; channels];
    for block in 0..blocks.len() {
        blocks.write(block, &mut rows, &mut measured);
        for ((largest, row), y) in largest.iter_mut().zip(rows.chunks(parameters.max(1))).zip(&measured) {
            *largest = row.iter().chain([y]).fold(*largest, |most, v| most.max(v.abs()));
        }
    }
    Ok(largest)
}

/// Raises each σ to the least that the device can weigh its channel by; returns the indices of those that
/// were less.
pub fn raise(sigma: &mut [f64], largest: &[f64]) -> Vec<usize> {
    let mut raised = Vec::new();
    for (c, (sigma, largest)) in sigma.iter_mut().zip(largest).enumerate() {
        let least = least_sigma(*largest);
        if *sigma < least {
            *sigma = least;
            raised.push(c);
        }
    }
    raised
}

/// Says which σ were raised, if any.
pub fn raised_warning(sigma: &[f64; 6], raised: &[usize]) -> Option<String> {
    let names: Vec<&str> = raised.iter().filter_map(|c| CHANNEL_NAMES.get(*c).copied()).collect();
    let most = raised.iter().filter_map(|c| sigma.get(*c)).fold(0.0_f64, |most, s| most.max(*s));
    (!raised.is_empty()).then(|| {
        format!(
            "the device counts in single precision, which bears no smaller noise than {most:.1e} N or N m of \
             {}: it was given that, and its own estimate holds six digits; the answer is counted in double \
             precision here",
            names.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sigma_below_the_rounding_of_single_precision_is_raised_and_named() {
        let mut sigma = [1e-9, 0.3, 2e-6];
        assert_eq!(raise(&mut sigma, &[50.0, 50.0, 2.0]), [0]);
        assert_eq!(sigma, [50.0 * 4.0 * f64::from(f32::EPSILON), 0.3, 2e-6]);
    }

    #[test]
    fn whitened_rows_of_the_least_sigma_stay_within_single_precision() {
        // Every tenth reading makes a row, a hundred a second: R of an hour, and the product that a merge
        // makes of it.
        let r = 10_f64.sqrt() / STEPS * (3600.0 * 100.0_f64).sqrt();
        let tenth = r / 10.0;
        assert!(2.0 * r * r * tenth * tenth < f64::from(f32::MAX));
    }
}
