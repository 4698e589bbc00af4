//! Strides: how long a motion takes to come back to itself.

use super::track::Tracked;

/// Strides of people take this long, s.
const LENGTHS_S: [f64; 2] = [0.6, 2.5];
/// Joints come back to themselves if their correlation with themselves a stride later is as large, …
const LEAST_CORRELATION: f64 = 0.5;
/// … and the shortest time is taken that reaches this share of the largest one.
const SHARE: f64 = 0.9;
/// This much of a trial is examined, s.
const LOOKED_S: f64 = 60.0;
/// Numbers of the base, which goes on.
const BASE: usize = 7;

/// Returns the period of the joints' motion, s: the lag of the largest autocorrelation of all joints'
/// coordinates together; `None` if they do not come back to themselves.
pub fn period_s(tracked: &Tracked) -> Option<f64> {
    let rate_hz = tracked.report.rate_hz;
    let most = (LOOKED_S * rate_hz) as usize;
    let series: Vec<Vec<f64>> = (BASE..tracked.coordinates.width())
        .map(|k| {
            let own = tracked.coordinates.series(k);
            let seen = || own.iter().take(most).filter(|v| v.is_finite()).map(|v| f64::from(*v));
            let mean = seen().sum::<f64>() / seen().count().max(1) as f64;
            own.iter().take(most).map(|v| f64::from(*v) - mean).collect()
        })
        .collect();
    let correlation = |lag: usize| {
        let (mut product, mut before, mut after) = (0.0, 0.0, 0.0);
        for own in &series {
            for (a, b) in own.iter().zip(own.iter().skip(lag)).filter(|(a, b)| (*a + *b).is_finite()) {
                product += a * b;
                before += a * a;
                after += b * b;
            }
        }
        product / (before * after).sqrt().max(f64::MIN_POSITIVE)
    };
    let [shortest, longest] = LENGTHS_S.map(|s| (s * rate_hz).round() as usize);
    // Half a stride at least is seen twice.
    let frames = series.first().map_or(0, Vec::len);
    let lags = shortest.max(1)..=longest.min(frames * 2 / 3);
    let all: Vec<(usize, f64)> = lags.map(|lag| (lag, correlation(lag))).collect();
    let peaks: Vec<(usize, f64)> =
        all.windows(3).filter(|w| w[1].1 >= w[0].1 && w[1].1 > w[2].1).map(|w| w[1]).collect();
    let largest = peaks.iter().map(|(_, r)| *r).fold(0.0, f64::max);
    let found = peaks.into_iter().find(|(_, r)| *r >= SHARE * largest && *r >= LEAST_CORRELATION)?;
    Some(found.0 as f64 / rate_hz)
}
