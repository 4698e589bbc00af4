//! What the filter passes and what it aliases into the rows, asked of the pipeline itself.

use rigident::identification::whiteness::{impulse_response, white_autocovariance};
use rigident::identification::{FILTER_WIDTH_S, row_every};
use rigident_shared::calibration::ImuMounting;
use rigident_shared::estimator::EstimatorConfig;
use rigident_shared::screening::Limits;

use super::report::short;

const RATES_HZ: [f64; 6] = [100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0];
/// Rounding of sums of a hundred terms; below it nothing is told.
const ROUNDING: f64 = 1e-13;

/// `|Σ h exp(−2πi f t)|`
fn magnitude(h: &[f64], f_hz: f64, rate_hz: f64) -> f64 {
    let phase = |n: usize| std::f64::consts::TAU * (n as f64 * f_hz / rate_hz).fract();
    let sum = |part: &dyn Fn(f64) -> f64| h.iter().enumerate().map(|(n, h)| h * part(phase(n))).sum::<f64>();
    sum(&f64::cos).hypot(sum(&f64::sin))
}

/// Neighbours that have one coefficient: so many readings are averaged.
fn averaged(h: &[f64]) -> usize {
    h.chunk_by(|a, b| a == b).map(<[f64]>::len).min().unwrap_or(0)
}

fn told(value: f64) -> String {
    if value.abs() < ROUNDING { format!("< {}", short(ROUNDING)) } else { short(value) }
}

/// The table.
pub fn table() -> String {
    let mut text = "| rate, Hz | a row every | averaged | readings under the filter | σ² after/before | \\|H\\| at 2 Hz | at the row rate | twice | three times | `row_every Σ γ(m row_every)` − 1 |\n\
                    |---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for rate_hz in RATES_HZ {
        let config = EstimatorConfig {
            rate_hz,
            filter_width_s: FILTER_WIDTH_S,
            row_every: row_every(rate_hz),
            channel_sigma: [1.0; 6],
            known_offset: [0.0; 6],
            mounting: ImuMounting::default(),
            limits: Limits::none(),
        };
        let h = impulse_response(&config);
        let every = f64::from(config.row_every);
        let white = white_autocovariance(&h, config.row_every);
        let sum = white.iter().skip(1).fold(white[0], |sum, gamma| sum + 2.0 * gamma);
        let row_rate = rate_hz / every;
        // Above half the rate everything repeats.
        let alias = |k: f64| {
            if k * row_rate > 0.5 * rate_hz {
                String::new()
            } else {
                told(magnitude(&h, k * row_rate, rate_hz))
            }
        };
        text += &format!(
            "| {rate_hz} | {every} | {} | {} | {:.2} | {:.3} | {} | {} | {} | {} |\n",
            averaged(&h),
            h.len(),
            every * white[0],
            magnitude(&h, 2.0, rate_hz),
            alias(1.0),
            alias(2.0),
            alias(3.0),
            told(every * sum - 1.0),
        );
    }
    text
}
