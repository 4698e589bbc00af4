//! The signals that the filter passes and those that it aliases into the rows, asked of the pipeline itself.

use rigident::fit::{ESTIMATOR_TAPS, FILTER_WIDTH_S, Filter, row_every};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{Estimator, EstimatorConfig, Outcome};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::report::short;

const RATES_HZ: [f64; 6] = [100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0];
/// Rounding of sums of a hundred terms; below it nothing is reported.
const ROUNDING: f64 = 1e-13;

/// Returns `|Σ h exp(−2πi f t)|`.
fn magnitude(h: &[f64], f_hz: f64, rate_hz: f64) -> f64 {
    let phase = |n: usize| std::f64::consts::TAU * (n as f64 * f_hz / rate_hz).fract();
    let sum = |part: &dyn Fn(f64) -> f64| h.iter().enumerate().map(|(n, h)| h * part(phase(n))).sum::<f64>();
    sum(&f64::cos).hypot(sum(&f64::sin))
}

/// Neighbours that have one coefficient: this many readings are averaged.
fn averaged(h: &[f64]) -> usize {
    h.chunk_by(|a, b| a == b).map(<[f64]>::len).min().unwrap_or(0)
}

fn shown(value: f64) -> String {
    if value.abs() < ROUNDING { format!("< {}", short(ROUNDING)) } else { short(value) }
}

/// Returns the filter's impulse response, by asking the pipeline itself: what a unit force at one reading
/// leaves in the rows.
///
/// `config` with a filter; empty if the estimator cannot be made of it.
pub fn impulse_response(config: &EstimatorConfig<f64>) -> Vec<f64> {
    let config = EstimatorConfig { limits: Limits::none(), known_offset: [0.0; 6], ..*config };
    let Ok(fresh) = Estimator::<f64, 10, ESTIMATOR_TAPS>::new(&config) else { return Vec::new() };
    let mut pipeline = Box::new(fresh);
    let every = usize::from(config.row_every);
    let first_block = |pipeline: &mut Estimator<f64, 10, ESTIMATOR_TAPS>, unit_at: usize, wanted: usize| {
        pipeline.reset();
        let mut rows = Vec::with_capacity(wanted);
        for k in 0.. {
            let force = if k == unit_at { 1.0 } else { 0.0 };
            let reading = Reading {
                time_ns: (k as f64 * 1e9 / config.rate_hz) as u64,
                wrench: Wrench::from_array([force, 0.0, 0.0, 0.0, 0.0, 0.0]),
                specific_force: SpecificForce::zero(),
                angular_rate: AngularRate::zero(),
            };
            if pipeline.absorb(&reading) == Outcome::Absorbed {
                rows.push(pipeline.last_block().map_or(0.0, |b| b.wrench[0]));
            }
            if rows.len() == wanted || k > 4 * ESTIMATOR_TAPS {
                return (rows, k + 1);
            }
        }
        (rows, 0)
    };
    // A window is as long as the first row takes; the row of the window that began `i` windows later holds
    // the unit at `i every` taps less.
    let (_, taps) = first_block(&mut pipeline, 0, 1);
    let windows = taps.div_ceil(every);
    let mut response = vec![0.0; windows * every];
    for phase in 0..every {
        let unit_at = (windows - 1) * every + phase;
        let (rows, _) = first_block(&mut pipeline, unit_at, windows);
        for (window, value) in rows.into_iter().enumerate() {
            if let Some(entry) = response.get_mut(unit_at - window * every) {
                *entry = value;
            }
        }
    }
    response.truncate(taps);
    response
}

/// Returns the autocovariance of the rows for white noise of unit variance before the filter, at lags of 0,
/// 1, … rows.
pub fn white_autocovariance(response: &[f64], every: u16) -> Vec<f64> {
    Filter { every, response: response.to_vec(), ..Filter::default() }.white_autocovariance()
}

/// Returns the table.
pub fn table() -> String {
    let mut text = "| rate, Hz | a row every | averaged | readings under the filter | σ² after/before \
                    | \\|H\\| at 2 Hz | at the row rate | twice | three times | `row_every Σ γ(m row_every)` \
                    − 1 |\n\
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
                shown(magnitude(&h, k * row_rate, rate_hz))
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
            shown(every * sum - 1.0),
        );
    }
    text
}
