//! Rates that a controller has filtered: they are later than the positions beside them.
//!
//! A low-pass in the rates alone makes momentum and friction late against the pose, and bodies of the
//! difference. A filter of any order is a lag τ first of all: with the kernel h of the rows
//! `h ∗ r − ḣ ∗ q = −τ ḣ ∗ r`, and nothing is differentiated twice. Slopes of positions have no such lag.

use std::collections::BTreeMap;

use super::{JointColumns, Preparation};
use crate::smoothing::{Smoother, cut_off_hz};
use rigident_fit::figures::with_u95;
use rigident_fit::filter_width_s;

/// A lag of this many standard deviations is none by chance, in one of a hundred thousand, two-sided.
const CERTAIN_SD: f64 = 4.42;
/// Shorter lags are those of sampling and of the kernel, and move nothing, s.
const LEAST_S: f64 = 1e-4;
/// Independent windows that a lag is seen by at least.
const LEAST_WINDOWS: usize = 20;

/// A lag with its variance, s and s².
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lag {
    value: f64,
    variance: f64,
}

impl Preparation<'_> {
    /// Leaves out the rates of all joints where together they lag behind the positions, or are ahead of them.
    pub(super) fn leave_filtered_rates(&mut self, joints: &mut BTreeMap<usize, JointColumns>, rate_hz: f64) {
        if self.recording.is_static {
            return;
        }
        let Some(kernel) = Smoother::new(cut_off_hz(filter_width_s(rate_hz)), rate_hz) else { return };
        let starts = starts(&self.recording.time_ns, rate_hz, 2 * kernel.half() + 1);
        let of = |joint: &JointColumns| lag(&kernel, &starts, &joint.positions, joint.rates.as_ref()?);
        let lags: Vec<Lag> = joints.values().filter_map(of).collect();
        let Some(lag) = together(&lags) else { return };
        let sd = lag.variance.sqrt();
        if lag.value.abs() < LEAST_S.max(CERTAIN_SD * sd) {
            return;
        }
        joints.values_mut().for_each(|joint| joint.rates = None);
        let way = if lag.value > 0.0 { "later" } else { "earlier" };
        self.warnings.push(format!(
            "the columns of the joints' rates are {way} than the slopes of their positions by {}, as a \
             low-pass in one of them makes them (in rates alone of first order one of {:.0} Hz): they are \
             not used, rates are taken from the positions; record rates before the controller's filter",
            with_u95(1e3 * lag.value.abs(), 1.96e3 * sd, "ms"),
            1.0 / (std::f64::consts::TAU * lag.value.abs())
        ));
    }
}

/// Returns the first rows of windows without a gap, half a window apart.
fn starts(time_ns: &[u64], rate_hz: f64, length: usize) -> Vec<usize> {
    let longest = (length as f64 - 0.5) * 1e9 / rate_hz;
    let is_whole = |start: &usize| match (time_ns.get(*start), time_ns.get(start + length - 1)) {
        (Some(from), Some(to)) => (to.saturating_sub(*from) as f64) < longest,
        _ => false,
    };
    (0..time_ns.len()).step_by((length / 2).max(1)).filter(is_whole).collect()
}

/// Returns the lag of the rates behind the slopes of the positions by least squares; `None` where too little
/// moves to tell.
fn lag(kernel: &Smoother, starts: &[usize], positions: &[f64], rates: &[f64]) -> Option<Lag> {
    let length = 2 * kernel.half() + 1;
    let (mut product, mut square, mut pairs) = (0.0, 0.0, Vec::new());
    for start in starts {
        let own = |values: &'_ [f64]| -> Option<(f64, f64)> {
            let window = values.get(*start..start + length)?;
            // About the middle one, so that a large constant costs no digits.
            let middle = window[kernel.half()];
            let (value, slope) = kernel.at(window.iter().map(|v| v - middle));
            Some((value + middle, slope))
        };
        let ((_, speed), (rate, change)) = own(positions).zip(own(rates))?;
        let late = speed - rate;
        product += late * change;
        square += change * change;
        pairs.push((late, change));
    }
    if pairs.len() < LEAST_WINDOWS || square <= 0.0 {
        return None;
    }
    let value = product / square;
    let left: f64 = pairs.iter().map(|(late, change)| (late - value * change).powi(2)).sum();
    let variance = left / (pairs.len() - 1) as f64 / square;
    variance.is_finite().then_some(Lag { value, variance })
}

/// Returns what lags of several joints have in common, each by its own certainty.
fn together(lags: &[Lag]) -> Option<Lag> {
    // Computed rates have no noise.
    let weight = |lag: &Lag| 1.0 / lag.variance.max(f64::EPSILON * LEAST_S * LEAST_S);
    let sum: f64 = lags.iter().map(weight).sum();
    let value = lags.iter().map(|lag| weight(lag) * lag.value).sum::<f64>() / sum;
    (!lags.is_empty()).then_some(Lag { value, variance: 1.0 / sum })
}
