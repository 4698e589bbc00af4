//! Orientations in which the plate can be held, and its position there.

use hexapod::{Geometry, Load, MotionProgram, Pose, Segment};
use nalgebra::Vector3;

use super::measure::roll_pitch;
use crate::workspace;

/// The reason why there is no region.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RegionError {
    /// Not even the level pose can be held.
    #[error("the platform cannot hold its plate level: {0}; check [platform] in the rig file")]
    LevelUnreachable(String),
    /// The limits leave nothing.
    #[error("{0}")]
    Limits(String),
}

/// Tilts on the way from level, rad: two degrees.
const STRIDE_RAD: f64 = 2.0 * std::f64::consts::PI / 180.0;

/// The share of what is allowed by which a straight line between two poses on a limit may overstep it; a way
/// around begins with it.
const TRIFLE: f64 = 0.005;

/// A platform and where its plate can be brought to from the level pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    geometry: Geometry,
    /// The limits that poses keep.
    inner: Geometry,
    load: Option<Load>,
    level: Pose,
}

impl Reach {
    /// Makes the reach, with the legs' middle `stroke_m` only, if given.
    ///
    /// # Errors
    /// Limits that contradict each other, a stroke the legs do not have, or a level pose out of reach.
    pub fn new(mut geometry: Geometry, stroke_m: Option<f64>) -> Result<Self, RegionError> {
        let [shortest, longest] = geometry.leg_length_m;
        if !(shortest.is_finite() && longest.is_finite() && 0.0 < shortest && shortest < longest) {
            return Err(RegionError::Limits(format!(
                "legs from {shortest} m to {longest} m: leg_length_m is the shortest length, then the longest"
            )));
        }
        if let Some(stroke) = stroke_m {
            geometry = geometry
                .with_stroke(stroke)
                .map_err(|error| RegionError::Limits(format!("`stroke_m` {stroke}: {error}")))?;
        }
        let level = workspace::level(&geometry)
            .map_err(|(_, violation)| RegionError::LevelUnreachable(violation.to_string()))?;
        Ok(Self { inner: geometry.clone(), geometry, load: None, level })
    }

    /// Returns the reach with poses that stay away from every limit by a share of what it allows, as
    /// [`Margin::relative`] has it; moves between them may use that share.
    ///
    /// # Errors
    /// A share that makes no sense or leaves no level pose.
    ///
    /// [`Margin::relative`]: hexapod::Margin::relative
    pub fn with_margin(mut self, share: f64) -> Result<Self, RegionError> {
        if !(0.0..1.0).contains(&share) {
            return Err(RegionError::Limits(format!("`margin` {share}: a share from 0 to less than 1")));
        }
        self.inner = self.geometry.within(1.0 - share);
        self.level = workspace::level(&self.inner).map_err(|(_, violation)| {
            RegionError::Limits(format!("`margin` {share} leaves no level pose: {violation}"))
        })?;
        Ok(self)
    }

    /// Returns the reach with legs that carry something: poses in which it is too heavy for them are out of
    /// reach.
    ///
    /// # Errors
    /// It is too heavy in the level pose.
    pub fn carrying(mut self, load: Option<Load>) -> Result<Self, RegionError> {
        self.load = load;
        if self.is_too_heavy(&self.level) {
            return Err(RegionError::LevelUnreachable("the body is too heavy for the legs".to_owned()));
        }
        Ok(self)
    }

    fn is_too_heavy(&self, pose: &Pose) -> bool {
        self.load.as_ref().is_some_and(|load| {
            self.inner.limits.of_force().is_some() && self.inner.check_pose_loaded(pose, load).is_err()
        })
    }

    /// Returns the geometry of the machine.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Returns what they carry, if that is known.
    pub fn load(&self) -> Option<&Load> {
        self.load.as_ref()
    }

    /// Returns the pose above which the plate starts: level, its legs as central as can be.
    pub fn level(&self) -> Pose {
        self.level
    }

    /// Returns a pose with "up" there in the plate's axes, at a yaw of zero, if the plate can be tilted to it
    /// from the level pose straight on: legs inside their limits and the guard met all the way, no singular
    /// pose crossed.
    pub fn pose(&self, up: &Vector3<f64>) -> Option<Pose> {
        let held = self.strides(up)?.pop()?;
        let central =
            workspace::settled(&self.inner, held, true).ok().filter(|pose| !self.is_too_heavy(pose));
        Some(central.filter(|central| self.is_free(&held, central)).unwrap_or(held))
    }

    /// Returns poses on the way there from the level pose, two degrees or less apart, each as near as can be
    /// to the one before it.
    pub(super) fn strides(&self, up: &Vector3<f64>) -> Option<Vec<Pose>> {
        let tilt = up.z.clamp(-1.0, 1.0).acos();
        let strides = (tilt / STRIDE_RAD).ceil().max(1.0);
        let mut pose = self.level;
        (1..=strides as usize)
            .map(|k| {
                pose = self.towards(&pose, &tilted(up, tilt * k as f64 / strides))?;
                Some(pose)
            })
            .collect()
    }

    /// Returns whether the plate can go straight from one pose to another, but for a trifle: descent may leap
    /// over what is barred.
    fn is_free(&self, from: &Pose, to: &Pose) -> bool {
        let program =
            MotionProgram { start: *from, segments: vec![Segment::Move { to: *to, duration_s: 1e3 }] };
        program.trajectory().is_ok_and(|t| self.geometry.within(1.0 + TRIFLE).check(&t).is_ok())
    }

    /// Returns a pose half-way between two poses, aside to where the limits are met, with something to spare
    /// if that can be.
    pub(super) fn between(&self, from: &Pose, to: &Pose) -> Option<Pose> {
        let middle = mean(from, to, 0.5);
        [0.9, 0.95, 0.98, 0.99, 1.0].into_iter().find_map(|share| self.settled(&middle, Some(share)))
    }

    /// Returns the same orientation where a share of each limit is met, or as far inside all of them as can
    /// be.
    pub(super) fn settled(&self, pose: &Pose, share: Option<f64>) -> Option<Pose> {
        let settled = match share {
            Some(share) => workspace::settled(&self.geometry.within(share), *pose, false),
            None => workspace::settled(&self.geometry, *pose, true),
        };
        settled.ok().filter(|pose| !self.is_too_heavy(pose))
    }

    /// Returns a pose for the next direction on the way, as near as can be to one that is held.
    pub fn towards(&self, from: &Pose, up: &Vector3<f64>) -> Option<Pose> {
        let [roll, pitch] = roll_pitch(up);
        let turned = Pose { rpy_rad: [roll, pitch, 0.0], ..*from };
        let held = workspace::settled(&self.inner, turned, false).ok()?;
        (!self.is_too_heavy(&held) && self.is_free(from, &held)).then_some(held)
    }
}

/// Returns the pose at this share of the straight line between two.
pub(super) fn mean(from: &Pose, to: &Pose, share: f64) -> Pose {
    let mean = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|k| (1.0 - share) * a[k] + share * b[k]);
    Pose { position_m: mean(from.position_m, to.position_m), rpy_rad: mean(from.rpy_rad, to.rpy_rad) }
}

/// Returns the direction at this tilt towards where `up` is.
pub(super) fn tilted(up: &Vector3<f64>, tilt: f64) -> Vector3<f64> {
    let aside = Vector3::new(up.x, up.y, 0.0).try_normalize(1e-12).unwrap_or_else(Vector3::x);
    aside * tilt.sin() + Vector3::z() * tilt.cos()
}

#[cfg(test)]
mod tests {
    use hexapod::Limits;
    use nalgebra::Matrix6;

    use super::*;
    use crate::poses::measure::up_in_plate;

    fn thesis(stroke_m: Option<f64>) -> Reach {
        Reach::new(Geometry::thesis(), stroke_m).unwrap()
    }

    /// Returns the largest of the measures.
    fn tightness(reach: &Reach, pose: &Pose) -> f64 {
        let [low, high] = reach.geometry.leg_length_m;
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let cond = reach.geometry.condition_number(pose) / reach.geometry.limits.cond_max;
        reach.geometry.leg_lengths(pose).iter().fold(cond, |w, l| w.max((l - middle).abs() / half))
    }

    /// Against trying positions on a grid of two centimetres, 0.4 m wide.
    #[test]
    fn no_position_of_a_grid_is_much_more_central() {
        let reach = thesis(None);
        for degrees in [[0.0, 0.0], [25.0, -10.0], [-31.0, 30.0], [5.0, 50.0], [-50.0, 0.0]] {
            let up = up_in_plate(degrees.map(f64::to_radians));
            let pose = reach.pose(&up).unwrap();
            let got = tightness(&reach, &pose);
            let home = reach.geometry.home().position_m;
            let mut brute = f64::INFINITY;
            for k in 0..21_usize.pow(3) {
                let at = [k % 21, k / 21 % 21, k / 441].map(|i| 0.02 * i as f64 - 0.2);
                let position_m = std::array::from_fn(|i| home[i] + at[i]);
                brute = brute.min(tightness(&reach, &Pose { position_m, ..pose }));
            }
            // A mean of 96th powers approximates the maximum: within 7^(1/96) of it.
            assert!(got < 1.03 * brute, "{degrees:?}: {got} {brute}");
        }
    }

    /// Along the straight way out, in steps of a tenth of a degree: the determinant never changes its sign,
    /// and every pose is held.
    #[test]
    fn nothing_singular_is_crossed_on_the_way_to_a_pose() {
        let reach = thesis(None);
        let determinant = |pose: &Pose| Matrix6::from(reach.geometry.jacobian(pose)).determinant();
        let sign = determinant(&reach.geometry.home()).signum();
        for azimuth in 0..12 {
            let mut pose = reach.level();
            let (s, c) = (f64::from(azimuth) * 30.0).to_radians().sin_cos();
            for k in 1..700 {
                let up = tilted(&Vector3::new(c, s, 0.0), (f64::from(k) * 0.1).to_radians());
                let Some(next) = reach.towards(&pose, &up) else { break };
                assert!(determinant(&next) * sign > 0.0);
                // Nor on the straight line from the last position to this one.
                for part in 1..8 {
                    let share = f64::from(part) / 8.0;
                    let between =
                        |i: usize| pose.position_m[i] + share * (next.position_m[i] - pose.position_m[i]);
                    let pose = Pose { position_m: std::array::from_fn(between), ..next };
                    assert!(determinant(&pose) * sign > 0.0, "{azimuth} {k} {part}");
                }
                pose = next;
            }
        }
    }

    #[test]
    fn the_middle_twenty_centimetres_tilt_as_far_as_another_solver_finds() {
        // A minimax solution by sequential quadratic programming found 31.4° to 41.3° in azimuths 5° apart;
        // the thesis' Table 11 lies at 32.0° to 32.7°. What is taken for the maximum here may cost a tenth or
        // two, never gain.
        let region = crate::poses::Region::of_platform(&thesis(Some(0.20)));
        let (least, largest) = region.tilt_range_rad();
        let [least, largest] = [least, largest].map(f64::to_degrees);
        assert!((31.2..31.5).contains(&least), "{least}");
        assert!((41.0..41.4).contains(&largest), "{largest}");
    }

    #[test]
    fn limits_that_contradict_each_other_are_named() {
        let crossed = Geometry { leg_length_m: [0.9, 0.6], ..Geometry::thesis() };
        let short = Geometry { leg_length_m: [0.05, 0.06], ..Geometry::thesis() };
        for (geometry, stroke, part) in [
            (crossed, None, "the shortest length"),
            (Geometry::thesis(), Some(0.4), "0.3048 m"),
            (Geometry::thesis(), Some(-0.1), "greater than zero"),
            (short, None, "leg "),
        ] {
            let error = Reach::new(geometry, stroke).unwrap_err().to_string();
            assert!(error.contains(part), "{part}: {error}");
        }
        let limits = Limits { cond_max: 5.0, ..Limits::default() };
        let error = Reach::new(Geometry { limits, ..Geometry::thesis() }, None).unwrap_err().to_string();
        assert!(error.contains("cond(H)"), "{error}");
    }
}
