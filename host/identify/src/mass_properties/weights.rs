//! Standard deviations of a source's channels: as stated, else what least squares leave.

use rigident_fit::{FitError, Prediction, Progress, RowSource as _, plain_factor};
use rigident_rows::tree::TreeSource;
use rigident_rows::tree::unmodelled::Unmodelled;

/// Rounds of weights by residuals.
const ROUNDS: usize = 2;
/// The residuals of a channel are at least this share of what it measures: rounding.
const ROUNDED: f64 = 1e-6;

/// Returns σ of every channel: as stated, else the root mean square of what least squares leave behind the
/// filter, channel by channel; `beside` the model what else acts.
///
/// # Errors
/// [`FitError`] if the recording has no rows.
pub fn channel_sigma(
    source: &TreeSource,
    beside: &[Unmodelled],
    progress: &dyn Progress,
) -> Result<Vec<f64>, FitError> {
    if let Some(stated) = &source.input().channel_sigma {
        return Ok(stated.clone());
    }
    let mut sigma = match &source.input().contact {
        Some(contact) => contact.sigma.clone(),
        None => source.nominal_sigma(),
    };
    let with = source.with_unmodelled(beside);
    for _ in 0..ROUNDS {
        let found = plain_factor(&with, &sigma, progress)?.solve(source.rounding()).estimate;
        let left = Prediction::of(&with, &found, &[])?;
        let own = left.residual_rms.iter().zip(&left.measured_sd).zip(&sigma);
        let own = own.map(|((rms, measured), before)| match rms.max(ROUNDED * measured) {
            sigma if sigma > 0.0 => sigma,
            _ => *before,
        });
        sigma = own.collect();
    }
    Ok(sigma)
}
