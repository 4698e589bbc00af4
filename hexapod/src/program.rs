//! What the platform is asked to do. Its kinematics are those of [`super::Trajectory`].

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

/// A piece of a motion. Every piece begins and ends at rest. In JSON `{"hold": {"duration_s": 1.0}}`: an inner tag
/// would go through serde's buffer, which cannot read numbers when `serde_json` keeps them in arbitrary precision.
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
    /// To another pose through one to three others without a stop there: each coordinate on the polynomial through them at
    /// equal steps of u, and u on the quintic of [`Segment::Move`].
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
    /// How long it takes, s.
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

    /// Where it ends, if it ends elsewhere than where it began.
    pub fn target(&self) -> Option<&Pose> {
        match self {
            Self::Move { to, .. } | Self::Path { to, .. } => Some(to),
            Self::Hold { .. } | Self::Multisine { .. } | Self::Sphere(_) => None,
        }
    }

    /// Ramp at both ends, s.
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
    /// The sum of the segments' durations, s.
    pub fn duration_s(&self) -> f64 {
        self.segments.iter().map(Segment::duration_s).sum()
    }
}
