//! A clock of the IMU that is off by more than any delay: found where its specific force is most like the
//! force on the body.

use super::attitude::Motion;
use super::sensors::{LONGEST_S, moved_imu};
use super::{Case, Fault};
use nalgebra::Vector3;

/// No clock is looked for further off, s, nor further than a share of the recording.
const FARTHEST_S: f64 = 3.0;
const SHARE: f64 = 0.3;
/// Rows on either side of the likeliest that are tried.
const AROUND: isize = 6;
/// Force and specific force are alike from this correlation on, and this much more than as they are stamped.
const ALIKE: f64 = 0.8;
const MORE: f64 = 0.05;

/// Returns clocks of the IMU that are off, near the one with which force and specific force are most alike.
pub(super) fn faults(case: &Case) -> Vec<Fault> {
    let Some((late, rate_hz)) = late_rows(case) else { return Vec::new() };
    let near = (late - AROUND..=late + AROUND).map(|rows| rows as f64 / rate_hz);
    let one = |s: f64| {
        let way = if s > 0.0 { "late" } else { "early" };
        let what = format!("the IMU's clock is {way} by {:.2} s against that of the load cell", s.abs());
        let remedy = "set both clocks by one source, or give clock_offset_s in [[stream]] of the rig file";
        Fault::new("delay of the IMU", what, remedy, move |case| moved_imu(case, s, true, true))
    };
    near.filter(|s| s.abs() > LONGEST_S).map(one).collect()
}

/// Returns by how many rows the IMU is late by the correlation of forces, and the rate, Hz.
fn late_rows(case: &Case) -> Option<(isize, f64)> {
    if case.model.is_some() || case.recording.is_static {
        return None;
    }
    let rate_hz = case.recording.rate_hz?;
    let specific = varying(Motion::of(case)?.force);
    let wrench = case.recording.wrench.as_ref()?;
    let force = varying(wrench.iter().map(|w| Vector3::new(w[0], w[1], w[2])).collect());
    let rows = force.len().min(specific.len());
    let most = (FARTHEST_S * rate_hz).min(SHARE * rows as f64) as isize;
    let correlation = |late: isize| {
        let (from, to) = (0.max(-late) as usize, rows - 0.max(late) as usize);
        let (mut both, mut one, mut other) = (0.0, 0.0, 0.0);
        for k in from..to {
            let (f, a) = (force[k], specific[k.saturating_add_signed(late)]);
            both += f.dot(&a);
            one += f.norm_squared();
            other += a.norm_squared();
        }
        both / (one * other).sqrt()
    };
    let all = (-most..=most).map(|late| (late, correlation(late)));
    let (late, found) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
    (found > ALIKE && found > correlation(0) + MORE).then_some((late, rate_hz))
}

/// Returns vectors less their mean.
fn varying(mut all: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
    let mean = all.iter().sum::<Vector3<f64>>() / all.len().max(1) as f64;
    all.iter_mut().for_each(|v| *v -= mean);
    all
}
