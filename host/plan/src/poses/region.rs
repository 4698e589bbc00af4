//! The angle by which the plate can be tilted in every direction.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::Vector3;

use super::reach::Reach;

/// Azimuths at which the largest tilt is known: one in two degrees.
const AZIMUTHS: usize = 180;
/// Steps in which the tilt is tried, rad: a degree.
const STEP_RAD: f64 = std::f64::consts::PI / 180.0;
/// The accuracy of the largest tilt, rad.
const RESOLUTION_RAD: f64 = 1e-4;

/// Directions of "up" in the plate's axes that the plate can be brought to: for each azimuth all tilts up to
/// a largest one, so that the way there from the level pose is reachable too.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The largest tilt at azimuth `k · 360°/len`, rad.
    largest_tilt_rad: Vec<f64>,
}

impl Region {
    /// Makes the region of all directions within `tilt_rad` of the plate's normal.
    pub fn cone(tilt_rad: f64) -> Self {
        Self { largest_tilt_rad: vec![tilt_rad.clamp(0.0, FRAC_PI_2); 1] }
    }

    /// Makes the region of the tilts to which a platform can bring its plate from the level pose, see
    /// [`Reach::pose`].
    pub fn of_platform(reach: &Reach) -> Self {
        let level = reach.level();
        Self::of_rows(|azimuth| {
            // The pose of the largest tilt that is held.
            let mut within = level;
            largest_tilt(|tilt| {
                let next = reach.towards(&within, &direction(azimuth, tilt));
                within = next.unwrap_or(within);
                next.is_some()
            })
        })
    }

    /// Makes the region of the tilts for which `reachable` holds, up to the first for which it does not; it
    /// is asked with "up" in the plate's axes. At most 90°.
    pub fn reachable_by(reachable: impl Fn(&Vector3<f64>) -> bool + Sync) -> Self {
        Self::of_rows(|azimuth| largest_tilt(|tilt| reachable(&direction(azimuth, tilt))))
    }

    /// Makes the region from the largest tilt at an azimuth.
    fn of_rows(row: impl Fn(f64) -> f64 + Sync) -> Self {
        let mut largest_tilt_rad = vec![0.0; AZIMUTHS];
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let share = AZIMUTHS.div_ceil(cores);
        std::thread::scope(|scope| {
            for (part, tilts) in largest_tilt_rad.chunks_mut(share).enumerate() {
                let row = &row;
                scope.spawn(move || {
                    for (k, tilt) in tilts.iter_mut().enumerate() {
                        *tilt = row(TAU * (part * share + k) as f64 / AZIMUTHS as f64);
                    }
                });
            }
        });
        Self { largest_tilt_rad }
    }

    /// Returns the largest tilt at an azimuth, interpolated, rad.
    pub fn largest_tilt_rad(&self, azimuth: f64) -> f64 {
        let count = self.largest_tilt_rad.len();
        let place = azimuth.rem_euclid(TAU) / TAU * count as f64;
        let at = |k: usize| self.largest_tilt_rad.get(k % count).copied().unwrap_or(0.0);
        let below = place.floor();
        let (low, high) = (at(below as usize), at(below as usize + 1));
        low + (place - below) * (high - low)
    }

    /// Returns least and largest of the largest tilts, rad.
    pub fn tilt_range_rad(&self) -> (f64, f64) {
        self.largest_tilt_rad.iter().fold((f64::INFINITY, 0.0), |(low, high), t| (low.min(*t), high.max(*t)))
    }

    /// Returns a direction in the region from two numbers, the azimuth as a share of the circle and the solid
    /// angle within the border as a share from 0 (level) to 1 (border): uniform numbers give uniform
    /// directions.
    pub fn direction(&self, [turn, share]: [f64; 2]) -> Vector3<f64> {
        let azimuth = TAU * turn;
        let cosine = 1.0 - share.clamp(0.0, 1.0) * (1.0 - self.largest_tilt_rad(azimuth).cos());
        direction(azimuth, cosine.clamp(-1.0, 1.0).acos())
    }
}

fn direction(azimuth: f64, tilt: f64) -> Vector3<f64> {
    let ((sa, ca), (st, ct)) = (azimuth.sin_cos(), tilt.sin_cos());
    Vector3::new(st * ca, st * sa, ct)
}

/// Searches in steps to the first tilt that is out of reach, then by halves.
fn largest_tilt(mut reachable: impl FnMut(f64) -> bool) -> f64 {
    let mut within = 0.0;
    loop {
        let next = within + STEP_RAD;
        if next > FRAC_PI_2 {
            return within;
        }
        if !reachable(next) {
            break;
        }
        within = next;
    }
    let mut beyond = within + STEP_RAD;
    while beyond - within > RESOLUTION_RAD {
        let middle = 0.5 * (within + beyond);
        if reachable(middle) { within = middle } else { beyond = middle }
    }
    within
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_border_is_found_in_every_direction() {
        // A tilted cone: up to 0.5 rad around a direction that is off by 0.2 rad.
        let axis = direction(1.0, 0.2);
        let region = Region::reachable_by(|up| up.dot(&axis) >= 0.5_f64.cos());
        for (azimuth, want) in [(1.0, 0.7), (1.0 + TAU / 2.0, 0.3)] {
            let got = region.largest_tilt_rad(azimuth);
            // The bisection ends below 1e-4.
            assert!((got - want).abs() < 2e-4, "{got} {want}");
        }
        assert!((region.direction([0.3, 1.0]).dot(&axis) - 0.5_f64.cos()).abs() < 2e-4);
        assert_eq!(region.direction([0.3, 0.0]), Vector3::z());
    }

    #[test]
    fn shares_are_uniform_on_the_sphere() {
        // A quarter of the solid angle of a cone of 60° lies within acos(1 − 0.25 · 0.5).
        let up = Region::cone(60_f64.to_radians()).direction([0.7, 0.25]);
        assert!((up.z - 0.875).abs() < 1e-12);
    }
}
