//! A platform that hangs on springs, and a tree of links that swings on it.
//!
//! Lives here: what such a rig is made of ([`Suspension`]), the exact equations of its motion
//! ([`Suspended`]), their integration ([`Suspended::simulate`]), stiffness and modes by differences of forces
//! ([`Suspended::modes`]), what cameras see of it ([`MotionCapture`]) and the experiment of the vibration
//! paper ([`paper`]). May not live here: regressors or anything else from the estimator's side. Before this:
//! [`crate::links`], whose links are driven; here they are free.
//!
//! Frames: the earth's A, z up; P, the platform's, in the reference pose at A's origin with A's axes.
//! Springs' forces, reactions and rates are in A's axes. Link 0, the base link, is fixed in P; link k ≥ 1 has
//! its origin in the joint to its parent.
//!
//! The integrator is our own, Gauss' collocation of order eight with steps of at most 1/120 s: in the paper's
//! experiment energy drifts by 3e-15 of the largest kinetic energy per second, against 4e-14 for the best
//! crate tried, at two and a half times its cost, 0.15 s for ten seconds of motion. `suspension/integrate.rs`
//! has the comparison.

mod dynamics;
mod integrate;
mod markers;
mod modes;
mod motion;
pub mod paper;
mod resting;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Vector3};

use hexapod::{BodyParameters, Mounting, STANDARD_GRAVITY_MPS2};

pub use dynamics::Suspended;
pub use integrate::Gauss;
pub use markers::{Carrier, Film, Hidden, Marker, MotionCapture};
pub use modes::Mode;
pub use motion::{Energy, Instant, Motion, Run, Start};

/// A spring between the ground and a point of the platform.
///
/// Its force on the platform is `f0 − K d − k₃ |d|² d − C ḋ`, A's axes, with d how far the anchor is from
/// where it is in the reference pose, `K = factor (axial n nᵀ + lateral (1 − n nᵀ))` along an axis n fixed in
/// A, and C alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// Anchor in P, m.
    pub at_m: [f64; 3],
    /// The spring's axis in A, of any length.
    pub axis: [f64; 3],
    /// Stiffness along the axis, N/m.
    pub axial_npm: f64,
    /// Stiffness across the axis, N/m.
    pub lateral_npm: f64,
    /// Damping along the axis, N s/m.
    pub axial_nspm: f64,
    /// Damping across the axis, N s/m.
    pub lateral_nspm: f64,
    /// Hardening k₃, N/m³.
    pub cubic_npm3: f64,
    /// The factor of the spring's tolerance for both stiffnesses.
    pub factor: f64,
}

impl Spring {
    /// Returns an upright spring without loss, hardening or tolerance.
    pub fn upright(at_m: [f64; 3], axial_npm: f64, lateral_npm: f64) -> Self {
        Self {
            at_m,
            axis: [0.0, 0.0, 1.0],
            axial_npm,
            lateral_npm,
            axial_nspm: 0.0,
            lateral_nspm: 0.0,
            cubic_npm3: 0.0,
            factor: 1.0,
        }
    }

    /// Returns the spring with damping in proportion to its stiffness, `C = time_s K`, before its tolerance.
    pub fn with_loss(self, time_s: f64) -> Self {
        Self { axial_nspm: time_s * self.axial_npm, lateral_nspm: time_s * self.lateral_npm, ..self }
    }
}

/// The way a link turns against its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Joint {
    /// About every axis.
    Spherical,
    /// About one axis, of any length, the same in the parent's and the link's frame at angle zero.
    Revolute {
        /// The axis in the link's axes.
        axis: [f64; 3],
    },
}

/// A link that hangs on another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointedLink {
    /// The parent, 0 the base link; smaller than the link's own number.
    pub parent: usize,
    /// The joint in the parent's frame, m.
    pub joint_m: [f64; 3],
    /// The way it turns.
    pub joint: Joint,
    /// True if it keeps the rotation that it starts with.
    pub locked: bool,
    /// Torque against the rate of the joint, N m s/rad.
    pub damping_nmspr: f64,
    /// The body in the link's frame, whose origin is the joint.
    pub body: BodyParameters,
}

/// Ground under all springs that is not quite free: a mass that only shifts, on springs of its own to the
/// earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Stiffness along A's axes, N/m.
    pub stiffness_npm: [f64; 3],
    /// Damping along A's axes, N s/m.
    pub damping_nspm: [f64; 3],
}

/// A platform on springs with a tree of links on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspension {
    /// The empty platform, in P.
    pub platform: BodyParameters,
    /// The springs.
    pub springs: Vec<Spring>,
    /// Coordinates of P that are locked: shifts along A's x, y, z and turns about them. Of the turns either
    /// none, all or two.
    pub locked: [bool; 6],
    /// The base link's frame in P.
    pub mount: Mounting,
    /// The base link, in its own frame.
    pub base: BodyParameters,
    /// Links 1 and up.
    pub links: Vec<JointedLink>,
    /// The base of the springs, if not on the earth.
    pub support: Option<Support>,
    /// Gravity, downward positive, m/s².
    pub gravity_mps2: f64,
}

/// The reason why a suspension cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SuspensionError {
    /// A figure is not finite, or has a sign that it cannot have.
    #[error("{what} makes no sense")]
    Figure {
        /// The one concerned.
        what: String,
    },
    /// No real body has such a tensor.
    #[error("no body has the inertial parameters of {what}")]
    Body {
        /// The one concerned.
        what: String,
    },
    /// A link comes before its parent.
    #[error("link {link} hangs on link {parent}; a parent's number is smaller")]
    Parent {
        /// The link.
        link: usize,
        /// The link's parent.
        parent: usize,
    },
    /// A single turn is locked, which holds no attitude.
    #[error("of the turns of the platform none, two or all can be locked, not one alone")]
    SingleTurnLocked,
    /// There are not as many joints' values as joints.
    #[error("{given} joints are described, {links} links have one")]
    Joints {
        /// Described.
        given: usize,
        /// Links with a joint.
        links: usize,
    },
    /// A revolute joint is turned or turns about another axis than its own.
    #[error("link {link} has a revolute joint that is to turn about another axis than its own")]
    OffAxis {
        /// The link.
        link: usize,
    },
    /// A velocity is along a coordinate that is locked.
    #[error("{what} is locked, and is to begin with a velocity")]
    LockedMoves {
        /// The coordinate.
        what: String,
    },
    /// Forces straight up at the anchors cannot carry the weight where it is.
    #[error("upright forces at the springs' anchors cannot balance the weight: {moment_nm:.3} N m are left")]
    NoPreload {
        /// Moment left, or force in N.
        moment_nm: f64,
    },
    /// The mass matrix has no inverse.
    #[error("a free coordinate moves no mass")]
    Massless,
    /// The reference pose is not a rest, or not a stable one.
    #[error("the platform falls over: its stiffness with the weight on it is not positive")]
    Unstable,
    /// The steps are too long for the stiffest spring.
    #[error("at t = {time_s:.4} s a step of {step_s:e} s is too long")]
    Step {
        /// Time, s.
        time_s: f64,
        /// Step, s.
        step_s: f64,
    },
    /// The cameras' rate does not divide the motion's.
    #[error(
        "cameras at {camera_hz} Hz cannot film a motion that is known at {motion_hz} Hz; it must be a whole \
         multiple"
    )]
    CameraRate {
        /// Rate of the cameras, Hz.
        camera_hz: f64,
        /// Rate of the motion, Hz.
        motion_hz: f64,
    },
}

impl Suspension {
    /// Returns a platform on springs that carries one body and nothing that swings, all coordinates free.
    pub fn of_body(
        platform: BodyParameters,
        springs: Vec<Spring>,
        mount: Mounting,
        base: BodyParameters,
    ) -> Self {
        Self {
            platform,
            springs,
            locked: [false; 6],
            mount,
            base,
            links: Vec::new(),
            support: None,
            gravity_mps2: STANDARD_GRAVITY_MPS2,
        }
    }

    /// Names the first thing that makes no sense.
    fn check(&self) -> Result<(), SuspensionError> {
        let figure = |what: String| Err(SuspensionError::Figure { what });
        for (i, s) in self.springs.iter().enumerate() {
            let axis = Vector3::from(s.axis).norm();
            let signed = [s.axial_npm, s.lateral_npm, s.axial_nspm, s.lateral_nspm, s.cubic_npm3, s.factor];
            let signs = signed.iter().all(|v| v.is_finite() && *v >= 0.0);
            if !(signs && axis.is_finite() && axis > 0.0 && s.at_m.iter().all(|v| v.is_finite())) {
                return figure(format!("spring {i}"));
            }
        }
        if self.mount.rotation().is_none() || self.mount.position_m.iter().any(|v| !v.is_finite()) {
            return figure("the mount".to_string());
        }
        if !self.gravity_mps2.is_finite() {
            return figure("gravity".to_string());
        }
        if self.locked[3..].iter().filter(|l| **l).count() == 1 {
            return Err(SuspensionError::SingleTurnLocked);
        }
        let support = self.support.is_none_or(|s| {
            let all = s.stiffness_npm.iter().chain(&s.damping_nspm);
            s.mass_kg > 0.0 && s.mass_kg.is_finite() && all.into_iter().all(|v| v.is_finite() && *v >= 0.0)
        });
        if !support {
            return figure("the support".to_string());
        }
        let named = [(&self.platform, "the platform".to_string()), (&self.base, "link 0".to_string())];
        let links = self.links.iter().enumerate().map(|(k, l)| (&l.body, format!("link {}", k + 1)));
        for (body, what) in named.into_iter().chain(links) {
            if !body.is_possible() {
                return Err(SuspensionError::Body { what });
            }
        }
        self.links.iter().enumerate().try_for_each(|(k, link)| check_link(k + 1, link))
    }
}

/// Names what makes no sense about a link.
fn check_link(number: usize, link: &JointedLink) -> Result<(), SuspensionError> {
    if link.parent >= number {
        return Err(SuspensionError::Parent { link: number, parent: link.parent });
    }
    let axis = match link.joint {
        Joint::Spherical => 1.0,
        Joint::Revolute { axis } => Vector3::from(axis).norm(),
    };
    let damping = link.damping_nmspr.is_finite() && link.damping_nmspr >= 0.0;
    if !(damping && axis.is_finite() && axis > 0.0 && link.joint_m.iter().all(|v| v.is_finite())) {
        return Err(SuspensionError::Figure { what: format!("the joint of link {number}") });
    }
    Ok(())
}

/// Returns the matrix of `v ×`.
fn cross(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}
