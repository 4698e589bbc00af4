//! The tasks for the platform. Its kinematics are those of [`super::Trajectory`].

use serde::{Deserialize, Serialize};

use super::path::MOST_VIA;
use super::pose::Pose;
use super::sphere::Sphere;

/// The longest program, s: a day.
pub const LONGEST_S: f64 = 86_400.0;

/// Longest line in which a program travels as JSON, bytes.
pub const PROGRAM_LINE_BYTES: usize = 1 << 20;

/// One of the six coordinates of the plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along x of A, m.
    X,
    /// Along y of A, m.
    Y,
    /// Along z of A, m.
    Z,
    /// Roll, rad.
    Roll,
    /// Pitch, rad.
    Pitch,
    /// Yaw, rad.
    Yaw,
}

/// `amplitude · sin(2π frequency t + phase)` on one coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SineTerm {
    /// The coordinate that moves.
    pub axis: Axis,
    /// m or rad.
    pub amplitude: f64,
    /// Hz.
    pub frequency_hz: f64,
    /// rad.
    pub phase_rad: f64,
}

/// A piece of a motion. Every piece begins and ends at rest. In JSON `{"hold": {"duration_s": 1.0}}`: an
/// inner tag would go through serde's buffer, which cannot read numbers when `serde_json` keeps them in
/// arbitrary precision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Segment {
    /// Stand still.
    Hold {
        /// s.
        duration_s: f64,
    },
    /// To another pose, each coordinate on the quintic `10 s³ − 15 s⁴ + 6 s⁵`.
    Move {
        /// Where to.
        to: Pose,
        /// s.
        duration_s: f64,
    },
    /// To another pose through one to three others without a stop there: each coordinate on the polynomial
    /// through them at equal steps of u, and u on the quintic of [`Segment::Move`].
    Path {
        /// On the way, in order.
        via: Vec<Pose>,
        /// Where to.
        to: Pose,
        /// s.
        duration_s: f64,
    },
    /// A sum of sines about the current pose, swelling and fading over `ramp_s` with the same quintic.
    Multisine {
        /// s, both ramps included.
        duration_s: f64,
        /// s, at most half of the duration.
        ramp_s: f64,
        /// The sines.
        terms: Vec<SineTerm>,
    },
    /// Turns about every axis while one point stays still; returns to the pose it began at.
    Sphere(Sphere),
}

impl Segment {
    /// Returns how long it takes, s.
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Hold { duration_s }
            | Self::Move { duration_s, .. }
            | Self::Path { duration_s, .. }
            | Self::Multisine { duration_s, .. }
            | Self::Sphere(Sphere { duration_s, .. }) => *duration_s,
        }
    }

    pub(super) fn check(&self) -> Result<(), &'static str> {
        let duration = self.duration_s();
        if !(duration.is_finite() && duration > 0.0) {
            return Err("its duration must be a positive number of seconds");
        }
        match self {
            Self::Hold { .. } => Ok(()),
            Self::Move { to, .. } if to.coordinates().iter().all(|c| c.is_finite()) => Ok(()),
            Self::Move { .. } => Err("its target has a coordinate that is not a finite number"),
            Self::Path { via, .. } if !(1..=MOST_VIA).contains(&via.len()) => {
                Err("it must have one to three poses on its way")
            }
            Self::Path { via, to, .. }
                if !via.iter().chain([to]).all(|p| p.coordinates().iter().all(|c| c.is_finite())) =>
            {
                Err("a pose of its path has a coordinate that is not a finite number")
            }
            Self::Path { .. } => Ok(()),
            Self::Multisine { ramp_s, .. } if !(*ramp_s > 0.0 && 2.0 * ramp_s <= duration) => {
                Err("its ramp must be longer than zero and at most half of its duration")
            }
            Self::Multisine { terms, .. }
                if !terms.iter().all(|t| {
                    t.amplitude.is_finite() && t.frequency_hz.is_finite() && t.phase_rad.is_finite()
                }) =>
            {
                Err("a term has an amplitude, frequency or phase that is not a finite number")
            }
            Self::Multisine { .. } => Ok(()),
            Self::Sphere(sphere) => sphere.check(),
        }
    }

    fn slowed(&self, share: f64) -> Self {
        let mut slow = self.clone();
        match &mut slow {
            Self::Hold { duration_s } | Self::Move { duration_s, .. } | Self::Path { duration_s, .. } => {
                *duration_s /= share;
            }
            Self::Multisine { duration_s, ramp_s, terms } => {
                (*duration_s, *ramp_s) = (*duration_s / share, *ramp_s / share);
                terms.iter_mut().for_each(|term| term.frequency_hz *= share);
            }
            Self::Sphere(sphere) => {
                (sphere.duration_s, sphere.ramp_s) = (sphere.duration_s / share, sphere.ramp_s / share);
                sphere.frequency_hz *= share;
            }
        }
        slow
    }

    /// Returns where it ends, if it ends elsewhere than where it began.
    pub fn target(&self) -> Option<&Pose> {
        match self {
            Self::Move { to, .. } | Self::Path { to, .. } => Some(to),
            Self::Hold { .. } | Self::Multisine { .. } | Self::Sphere(_) => None,
        }
    }

    /// Returns the ramp at both ends, s.
    pub(super) fn ramp_s(&self) -> Option<f64> {
        match self {
            Self::Hold { .. } | Self::Move { .. } | Self::Path { .. } => None,
            Self::Multisine { ramp_s, .. } | Self::Sphere(Sphere { ramp_s, .. }) => Some(*ramp_s),
        }
    }
}

/// Where to start and what to do. Travels as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MotionProgram {
    /// The pose at which the plate stands before the first segment.
    pub start: Pose,
    /// What happens, in order.
    pub segments: Vec<Segment>,
}

impl MotionProgram {
    /// Returns the sum of the segments' durations, s.
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(Segment::duration_s).sum()
    }

    /// Returns the same path driven at a share of its speed: accelerations fall by the share squared.
    #[must_use]
    pub fn slowed(&self, share: f64) -> Self {
        Self { start: self.start, segments: self.segments.iter().map(|s| s.slowed(share)).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Geometry;

    #[test]
    fn a_slowed_program_takes_the_same_path() {
        let home = Geometry::thesis().home();
        let mut to = home;
        to.position_m[0] += 0.03;
        let mut via = home;
        via.rpy_rad[2] += 0.1;
        let term = SineTerm { axis: Axis::Roll, amplitude: 0.1, frequency_hz: 0.8, phase_rad: 0.7 };
        let sphere = Sphere {
            duration_s: 3.0,
            ramp_s: 0.5,
            amplitude_rad: 0.2,
            frequency_hz: 0.9,
            turns: 2.0,
            still_point_m: [0.0, 0.0, 0.1],
        };
        let segments = vec![
            Segment::Hold { duration_s: 0.5 },
            Segment::Move { to, duration_s: 2.0 },
            Segment::Multisine { duration_s: 4.0, ramp_s: 1.0, terms: vec![term] },
            Segment::Path { via: vec![via], to: home, duration_s: 2.0 },
            Segment::Sphere(sphere),
        ];
        let program = MotionProgram { start: home, segments };
        let slow = program.slowed(0.1);
        assert!((slow.duration_s() - 115.0).abs() < 1e-9);
        let (fast, slow) = (program.trajectory().unwrap(), slow.trajectory().unwrap());
        for k in 0..460 {
            let t = 0.025 * f64::from(k) + 1e-3;
            let (a, b) = (fast.coordinates(t), slow.coordinates(10.0 * t));
            for i in 0..6 {
                assert!((a.value[i] - b.value[i]).abs() < 1e-12, "{i} at {t}");
                assert!((0.1 * a.rate[i] - b.rate[i]).abs() < 1e-12, "{i} at {t}");
            }
        }
    }
}
