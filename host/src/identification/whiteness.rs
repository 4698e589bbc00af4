//! Whether the residuals are as coloured as the filter alone makes them, or more.
//!
//! Lives here: the autocorrelation that white noise has after the filter, what the residuals have, and by how much
//! intervals that rest on white noise are too small. May not live here: the estimate.
//!
//! `cov = σ² (AᵀA)⁻¹` is right for noise that is white before the filter, because the sum over all lags of the filtered
//! noise's autocovariance, which is what a slowly varying row averages, is then `σ² (Σh)² = σ²` again. For any noise
//! that sum is `row_every Σ_m γ(m)` with γ the residuals' autocovariance, so that `√(row_every Σ γ) / σ` is the
//! factor by which intervals are too small. Colour much faster than the filter raises the residuals as it raises the
//! intervals' σ and needs no test; slower colour shows at lags where the filter's own correlation has ended.

use rigident_shared::calibration::Reading;
use rigident_shared::estimator::{Estimator, EstimatorConfig, Outcome};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::TAPS;

/// A deviation this many standard deviations long is not chance: 6 channels, two tests, one false alarm in 1e4.
const SIGNIFICANT: f64 = 4.5;
/// Rows over the longest lag of the tests. With so few, 0.8 s at 200 Hz, white noise is still taken for coloured in less than one
/// channel of 1e4, and noise that is remembered for 0.05 s is named in most.
const LEAST: usize = 5;
/// Longest lag that is looked at, rows.
const LONGEST: usize = 2000;

/// What an answer leaves of a row block, channel by channel.
pub trait Leftover {
    /// Time of the reading that completed the block, s.
    fn time_s(&self) -> f64;
    /// The filtered measurement less the prediction, as the answer counts it.
    fn of(&self, channel: usize) -> f64;
}

/// Noise that is more than the filter explains.
#[derive(Clone, Debug, PartialEq)]
pub struct Colour {
    /// The channel that shows it; 0 to 5 are those of the wrench, where there is one.
    pub channel: usize,
    /// Mean autocorrelation of its residuals between half a filter's width and one and a half.
    pub autocorrelation: f64,
    /// Standard deviation of that mean for white noise, whose own is nearly zero there.
    pub chance: f64,
    /// Factor by which intervals on white noise are too small for a parameter that rests on this channel's slowest part: the
    /// largest for any parameter.
    pub factor: f64,
    /// Of its residuals at lags of 0, 1, … rows, their unit squared, as far as it is told from chance.
    pub autocovariance: Vec<f64>,
}

/// The filter's impulse response, by asking the pipeline itself: what a unit force at one reading leaves in the rows.
///
/// `config` with a filter; empty if the estimator cannot be made of it.
pub fn impulse_response(config: &EstimatorConfig<f64>) -> Vec<f64> {
    let config = EstimatorConfig { limits: Limits::none(), known_offset: [0.0; 6], ..*config };
    let Ok(fresh) = Estimator::<f64, 10, TAPS>::new(&config) else { return Vec::new() };
    let mut pipeline = Box::new(fresh);
    let every = usize::from(config.row_every);
    let first_block = |pipeline: &mut Estimator<f64, 10, TAPS>, unit_at: usize, wanted: usize| {
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
            if rows.len() == wanted || k > 4 * TAPS {
                return (rows, k + 1);
            }
        }
        (rows, 0)
    };
    // A window is as long as the first row takes; the row of the window that began `i` windows later holds the
    // unit at `i every` taps less.
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

/// Autocovariance of the rows for white noise of unit variance before the filter, at lags of 0, 1, … rows, until the
/// windows no longer overlap.
pub fn white_autocovariance(response: &[f64], row_every: u16) -> Vec<f64> {
    (0..response.len())
        .step_by(usize::from(row_every).max(1))
        .map(|lag| response.iter().zip(response.iter().skip(lag)).map(|(a, b)| a * b).sum())
        .collect()
}

/// Autocovariance of one channel at a lag, pairs counted only within stretches without gaps.
fn autocovariance(stretches: &[&[impl Leftover]], channel: usize, lag: usize) -> f64 {
    let count = stretches.iter().map(|s| s.len()).sum::<usize>().max(1) as f64;
    let pairs = stretches.iter().flat_map(|s| s.iter().zip(s.iter().skip(lag)));
    pairs.map(|(a, b)| a.of(channel) * b.of(channel)).sum::<f64>() / count
}

/// Variance, times the number of rows, of the mean autocorrelation over `lags` lags beyond the filter, for white noise
/// of autocorrelation ρ: the mean over pairs of lags of `Σ_m ρ(m) ρ(m + k − l)` (Bartlett 1946).
fn chance(white: &[f64], lags: usize) -> f64 {
    let rho = |lag: isize| white.get(lag.unsigned_abs()).map_or(0.0, |w| w / white[0]);
    let reach = white.len() as isize;
    let overlap = |d: isize| (-reach..=reach).map(|m| rho(m) * rho(m + d)).sum::<f64>();
    let lags = lags as isize;
    (0..lags).flat_map(|k| (0..lags).map(move |l| overlap(k - l))).sum::<f64>() / (lags * lags) as f64
}

/// The channels whose residuals show more than the filter explains, the worst first.
///
/// `white` is [`white_autocovariance`]; `variance` the one that the intervals assume, per channel and reading before the
/// filter. Empty too where there are too few rows to tell.
pub fn colour<L: Leftover>(
    residuals: &[L],
    white: &[f64],
    row_period_s: f64,
    row_every: u16,
    variance: &[f64],
) -> Vec<Colour> {
    let reach = white.len();
    let (from, to) = (reach.div_ceil(2).max(1), (3 * reach).div_ceil(2));
    if reach < 2 || residuals.len() < LEAST * to {
        return Vec::new();
    }
    let stretches: Vec<&[L]> =
        residuals.chunk_by(|a, b| b.time_s() - a.time_s() < 1.5 * row_period_s).collect();
    let count = residuals.len() as f64;
    let chance = (chance(white, to - from + 1) / count).sqrt();
    // Sum over lags with triangular weights: its relative variance is 4 M / 3 n (Newey and West 1987), that of a χ² of
    // ν degrees of freedom 2/ν; the cube root of χ²/ν is nearly normal (Wilson and Hilferty 1931).
    let ninths = 2.0 / 9.0 * (0.5 * 4.0 * (2 * reach) as f64 / (3.0 * count));
    let largest_by_chance = (1.0 - ninths + SIGNIFICANT * ninths.sqrt()).powi(3);
    let weighted = |gamma: &[f64]| {
        let tail = gamma.iter().enumerate().skip(1).take(2 * reach);
        gamma[0] + 2.0 * tail.map(|(m, g)| g * (1.0 - m as f64 / (2 * reach) as f64)).sum::<f64>()
    };
    let every = f64::from(row_every);
    let longest = (residuals.len() / 4).min(LONGEST);
    let found = variance.iter().enumerate().filter_map(|(channel, scale)| {
        let gamma: Vec<f64> = (0..=2 * reach).map(|lag| autocovariance(&stretches, channel, lag)).collect();
        if *scale <= 0.0 || gamma[0] <= 0.0 {
            return None;
        }
        let beyond = &gamma[from..=to];
        let autocorrelation = beyond.iter().sum::<f64>() / (beyond.len() as f64 * gamma[0]);
        let expected = white[from.min(reach)..].iter().sum::<f64>() / (beyond.len() as f64 * white[0]);
        let ratio = weighted(&gamma) / (scale * weighted(white));
        if autocorrelation - expected < SIGNIFICANT * chance && ratio < largest_by_chance {
            return None;
        }
        // The sum ends where two neighbours no longer are positive together (Geyer 1992).
        let (mut tail, mut told) = (0.0, vec![gamma[0]]);
        for lag in (1..longest).step_by(2) {
            let pair = [lag, lag + 1].map(|lag| autocovariance(&stretches, channel, lag));
            let sum = pair[0] + pair[1];
            if lag >= reach && sum <= 0.0 {
                break;
            }
            tail += sum;
            told.extend(pair);
        }
        let factor = (every * (gamma[0] + 2.0 * tail) / scale).max(0.0).sqrt();
        Some(Colour { channel, autocorrelation, chance, factor, autocovariance: told })
    });
    let mut found: Vec<Colour> = found.filter(|c| c.factor > 1.1).collect();
    found.sort_by(|a, b| b.factor.total_cmp(&a.factor));
    found
}

/// Names of the wrench's channels.
pub const WRENCH: [&str; 6] = ["fx", "fy", "fz", "mx", "my", "mz"];

/// In words, with the channels' names; `None` where there is no colour. `widened`: the largest factor on an interval, where
/// they count it.
pub fn warning(
    colours: &[Colour],
    names: &[impl AsRef<str>],
    widened: Option<f64>,
    width_s: f64,
) -> Option<String> {
    let name = |c: &Colour| names.get(c.channel).map_or("?", AsRef::as_ref);
    let worst = colours.first()?;
    let factors: Vec<String> = colours.iter().map(|c| format!("{:.1} ({})", c.factor, name(c))).collect();
    let consequence = match widened {
        Some(largest) => format!(
            "Intervals count this and are wider for it by up to {largest:.1}; one that rested on the slowest part alone would be \
             wider by factors of"
        ),
        None => "Intervals do not count this and may be too narrow, as far as they rest on these channels, by factors up to"
            .to_owned(),
    };
    Some(format!(
        "residuals of {} stay correlated for longer than the filter explains (of {}: autocorrelation {:.2} about {width_s} s \
         apart, where white noise has 0.00 ± {:.2}). {consequence} {}; look for vibration, drift, a wrong delay or a body that is not rigid",
        colours.iter().map(name).collect::<Vec<_>>().join(", "),
        name(worst),
        worst.autocorrelation,
        2.0 * worst.chance,
        factors.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use rigident_shared::calibration::ImuMounting;

    use super::super::BlockResidual;
    use super::*;

    fn config(rate_hz: f64) -> EstimatorConfig<f64> {
        EstimatorConfig {
            rate_hz,
            filter_width_s: super::super::FILTER_WIDTH_S,
            row_every: super::super::row_every(rate_hz),
            channel_sigma: [1.0; 6],
            known_offset: [0.0; 6],
            mounting: ImuMounting::default(),
            limits: Limits::none(),
        }
    }

    /// Rows as the estimator makes them of noise that obeys `n ← ρ n + √(1 − ρ²) g`, of unit variance.
    fn residuals(config: &EstimatorConfig<f64>, rho: f64, readings: usize, seed: u64) -> Vec<BlockResidual> {
        let mut normal = rand_distr::Distribution::<f64>::sample_iter(
            rand_distr::StandardNormal,
            <rand_chacha::ChaCha8Rng as rand_chacha::rand_core::SeedableRng>::seed_from_u64(seed),
        );
        let mut pipeline = Box::new(Estimator::<f64, 10, TAPS>::new(config).unwrap());
        let mut noise = [0.0; 6];
        let mut rows = Vec::new();
        for k in 0..readings {
            for n in &mut noise {
                let fresh = normal.next().unwrap();
                *n = if k == 0 { fresh } else { rho * *n + (1.0 - rho * rho).sqrt() * fresh };
            }
            let time_s = k as f64 / config.rate_hz;
            let reading = Reading {
                time_ns: (time_s * 1e9) as u64,
                wrench: Wrench::from_array(noise),
                specific_force: SpecificForce::zero(),
                angular_rate: AngularRate::zero(),
            };
            if pipeline.absorb(&reading) == Outcome::Absorbed {
                rows.push(BlockResidual {
                    time_s,
                    residual: pipeline.last_block().unwrap().wrench,
                    factors: [1.0; 6],
                });
            }
        }
        rows
    }

    fn found(rate_hz: f64, rho: f64, seconds: f64, seed: u64) -> Vec<Colour> {
        let config = config(rate_hz);
        let white = white_autocovariance(&impulse_response(&config), config.row_every);
        let rows = residuals(&config, rho, (seconds * rate_hz) as usize, seed);
        let period = f64::from(config.row_every) / rate_hz;
        colour(&rows, &white, period, config.row_every, &[1.0; 6])
    }

    #[test]
    fn the_pipeline_answers_an_impulse_with_a_symmetric_kernel_of_the_noise_gain_it_states() {
        for rate_hz in [100.0, 200.0, 250.0, 1000.0] {
            let config = config(rate_hz);
            let stated = Estimator::<f64, 10, TAPS>::new(&config).unwrap().noise_gain();
            let response = impulse_response(&config);
            let energy: f64 = response.iter().map(|h| h * h).sum();
            assert!((energy * f64::from(config.row_every) / stated - 1.0).abs() < 1e-12, "{rate_hz}");
            assert!((response.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{rate_hz}");
            for (early, late) in response.iter().zip(response.iter().rev()) {
                assert!((early - late).abs() < 1e-14, "{rate_hz}");
            }
        }
    }

    /// The sum over all lags is one: what makes the shipped covariance right.
    #[test]
    fn all_lags_of_the_filtered_noise_together_are_the_noise_before_it() {
        for rate_hz in [100.0, 200.0, 250.0, 500.0, 1000.0] {
            let config = config(rate_hz);
            let white = white_autocovariance(&impulse_response(&config), config.row_every);
            let sum = white[0] + 2.0 * white[1..].iter().sum::<f64>();
            assert!((sum * f64::from(config.row_every) - 1.0).abs() < 1e-3, "{rate_hz}: {sum}");
        }
    }

    #[test]
    fn white_noise_gives_no_warning() {
        for seed in 0..100 {
            assert_eq!(found(200.0, 0.0, 20.0, seed), [], "seed {seed}");
        }
        // As few rows as are looked at.
        for seed in 0..1000 {
            assert_eq!(found(200.0, 0.0, 0.9, seed), [], "seed {seed}");
        }
        assert_eq!(found(1000.0, 0.0, 20.0, 1), []);
    }

    #[test]
    fn coloured_noise_is_named_in_a_second_too() {
        let rho = f64::exp(-1.0 / (200.0 * 0.05));
        let named: usize = (0..50).map(|seed| found(200.0, rho, 0.9, seed).len()).sum();
        assert!(named > 6 * 50 / 2, "{named} of 300 channels");
        assert_eq!(found(200.0, rho, 0.7, 1), [], "too few rows");
    }

    /// Autoregressive noise of correlation time τ: the spectrum at zero frequency is (1 + ρ)/(1 − ρ) times the white one's.
    #[test]
    fn coloured_noise_is_named_with_its_factor() {
        for (tau_s, seconds) in [(0.05, 60.0), (0.2, 240.0)] {
            let rho = f64::exp(-1.0 / (200.0 * tau_s));
            let expected = ((1.0 + rho) / (1.0 - rho)).sqrt();
            for seed in 0..5 {
                let colours = found(200.0, rho, seconds, seed);
                let colour = colours.first().expect("a warning");
                // The largest of six estimates, each good to about √(τ/T) of its variance times a few.
                let ratio = colour.factor / expected;
                assert!((0.8..1.5).contains(&ratio), "{tau_s} s, seed {seed}: {ratio}");
                // All six channels have that noise, and each is named with its own factor.
                let words = warning(&colours, &WRENCH, None, 0.1).unwrap();
                assert_eq!(colours.len(), 6, "{tau_s} s, seed {seed}: {words}");
                for c in &colours {
                    let ratio = c.factor / expected;
                    assert!(
                        (0.5..1.5).contains(&ratio),
                        "{tau_s} s, seed {seed}, {}: {ratio}",
                        WRENCH[c.channel]
                    );
                    assert!(words.contains(&format!("{:.1} ({})", c.factor, WRENCH[c.channel])), "{words}");
                }
            }
        }
    }
}
