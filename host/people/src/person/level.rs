//! Checks whether plates are level: over some seconds a person's mean horizontal force is `m Δv / T`,
//! whatever the masses of the segments.

use nalgebra::Vector3;

use super::people::Person;
use super::plausible::forces;
use super::strides::period_s;
use super::tilt::Tilt;
use super::track::Tracked;
use rigident_io::motion_capture::zeroing::UNKNOWN_ZERO_N;

/// A stretch of time without a gap tells if it is at least this long, s.
const LEAST_S: f64 = 0.7;
/// 1 σ of the velocity of the table's centre of mass, m/s: where it comes back to itself after whole strides,
/// elsewhere, and of somebody whose trunk no marker follows (assumed).
const VELOCITY_MPS: [f64; 3] = [0.02, 0.05, 0.1];

/// Returns how far the plates of a trial lean; `None` if no stretch is long enough.
pub(super) fn tilt(person: &Person, trial: usize) -> Option<Tilt> {
    let tracked = person.trials.get(trial)?;
    let pairs = forces(person, trial);
    let rate = tracked.report.rate_hz;
    let stride = period_s(tracked).map(|period_s| (period_s * rate).round() as usize);
    let (mut left, mut push, mut time, mut variance) = (Vector3::zeros(), 0.0, 0.0, 0.0);
    let mut at = 0;
    while at < pairs.len() {
        let follows = |k: &usize| *k == at || pairs[*k].0 == pairs[*k - 1].0 + 1;
        let whole = (at..pairs.len()).take_while(follows).count();
        // As many whole strides as there are.
        let strides = stride.filter(|stride| whole >= *stride);
        let count = strides.map_or(whole, |stride| whole / stride * stride);
        let seconds = count as f64 / rate;
        if seconds >= LEAST_S {
            for (_, [needed, measured]) in &pairs[at..at + count] {
                left += (measured - needed) / rate;
                push += measured.z / rate;
            }
            time += seconds;
            // The velocity is off at either end.
            let unseen = person.subject.unseen_trunk.is_some();
            let velocity = VELOCITY_MPS[if unseen { 2 } else { usize::from(strides.is_none()) }];
            variance += 2.0 * (person.subject.person.mass_kg * velocity).powi(2);
        }
        at += whole;
    }
    let push = push / time;
    let zeros = UNKNOWN_ZERO_N * (tracked.unzeroed.len() as f64).sqrt();
    let sigma = (variance.sqrt() / time).hypot(zeros) / push;
    let horizontal = (left / time).xy();
    (time > 0.0 && push > 0.0).then(|| Tilt { lean: horizontal / push, sigma, force_n: horizontal.norm() })
}

impl Tracked {
    /// Returns what to say of plates that lean; `None` if they do not.
    pub fn tilt_words(&self) -> Option<String> {
        let tilt = self.report.tilt.filter(Tilt::is_significant)?;
        let [x, y] = [tilt.lean.x, tilt.lean.y].map(|v| v.atan().to_degrees());
        Some(format!(
            "{}: the plates' axes are not the cameras' vertical: they lean by {:.1} ± {:.1}° ({x:.1}° along \
             x, {y:.1}° along y, z up): their mean horizontal force is {:.0} N more than the person's change \
             of speed. Masses of head and trunk and all first moments are wrong by it: level the plates, or \
             turn their forces into the cameras' axes (those of a slope, too)",
            self.name,
            tilt.lean.norm().atan().to_degrees(),
            rigident_fit::COVERAGE_95 * tilt.sigma.to_degrees(),
            tilt.force_n,
        ))
    }
}
