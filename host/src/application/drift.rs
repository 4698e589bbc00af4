//! The first pose repeated at the end: how much the load cell drifted in between.

use rigident_shared::calibration::Reading;

use rigident_fit::{COVERAGE_95, Fit, Measured};
use rigident_identify::answer::{Drift, DriftChange};

/// The edges of a pose still shake, s.
const MARGIN_S: f64 = 0.2;

/// Returns the mean wrench of the second span less that of the first, spans in s from the first reading;
/// `None` where a span has no readings.
pub(super) fn of_body(readings: &[Reading<f64>], spans: [(f64, f64); 2], found: &Fit) -> Option<Drift> {
    let origin_ns = readings.first()?.time_ns;
    let mean = |(from, to): (f64, f64)| -> Option<([f64; 6], f64)> {
        let inside = readings.iter().filter(|r| {
            let t = r.time_ns.saturating_sub(origin_ns) as f64 * 1e-9;
            t > from + MARGIN_S && t < to - MARGIN_S
        });
        let wrenches: Vec<[f64; 6]> = inside.map(|r| r.wrench.array()).collect();
        let n = wrenches.len() as f64;
        (!wrenches.is_empty())
            .then(|| (std::array::from_fn(|c| wrenches.iter().map(|w| w[c]).sum::<f64>() / n), n))
    };
    let ((before, n), (after, m)) = (mean(spans[0])?, mean(spans[1])?);
    let change = |(c, channel): (usize, &rigident_fit::ChannelFit)| DriftChange {
        channel: channel.channel.name.clone(),
        unit: channel.channel.unit.clone(),
        change: Some(Measured {
            value: after[c] - before[c],
            u95: COVERAGE_95 * channel.sigma * (1.0 / n + 1.0 / m).sqrt(),
        }),
    };
    Some(Drift {
        elapsed_s: spans[1].0 - spans[0].0,
        changes: found.channels.iter().take(6).enumerate().map(change).collect(),
    })
}
