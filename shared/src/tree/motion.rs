//! The motion of every link from the motion of the joints, in the base link's axes.

use nalgebra::{Matrix3, Vector3};

use super::joint::{Joint, JointMotion, Link, TreeError, check};
use crate::Scalar;

/// Holds what an ideal IMU at the base link's origin reads, in its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseMotion<T: Scalar> {
    /// Specific force `a = p̈ − g`, m/s²: gravity is in it.
    pub specific_force: Vector3<T>,
    /// Angular rate, rad/s.
    pub rate: Vector3<T>,
    /// Derivative of the angular rate, rad/s². Not examined by [`super::momentum`].
    pub angular_acceleration: Vector3<T>,
}

impl<T: Scalar> BaseMotion<T> {
    /// Returns a base held still, where gravity is `gravity` in its axes, m/s².
    pub fn still(gravity: [T; 3]) -> Self {
        let zero = Vector3::zeros();
        Self { specific_force: -Vector3::from(gravity), rate: zero, angular_acceleration: zero }
    }
}

/// A link's motion; all vectors in the base link's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkState<T: Scalar> {
    /// Base axes ← link axes.
    pub rotation: Matrix3<T>,
    /// Origin from the base's origin, m.
    pub position: Vector3<T>,
    /// Inertial derivative of `position`, m/s: the origin's velocity less that of the base's origin.
    pub velocity: Vector3<T>,
    /// Angular rate, rad/s.
    pub rate: Vector3<T>,
    /// Angular acceleration, rad/s².
    pub angular_acceleration: Vector3<T>,
    /// Specific force at the link's origin, m/s².
    pub specific_force: Vector3<T>,
}

impl<T: Scalar> LinkState<T> {
    /// Returns a state in which nothing moves and nothing weighs, with which arrays are filled.
    pub fn zero() -> Self {
        let zero = Vector3::zeros();
        Self {
            rotation: Matrix3::identity(),
            position: zero,
            velocity: zero,
            rate: zero,
            angular_acceleration: zero,
            specific_force: zero,
        }
    }
}

/// Computes the state of every link.
///
/// # Errors
/// [`TreeError`] if the links are in no order, or the three are not equally long.
pub fn states<T: Scalar>(
    links: &[Link<T>],
    joints: &[JointMotion<T>],
    base: &BaseMotion<T>,
    states: &mut [LinkState<T>],
) -> Result<(), TreeError> {
    check(links)?;
    if joints.len() != links.len() || states.len() != links.len() {
        return Err(TreeError::Lengths);
    }
    let moving = links.iter().zip(joints).enumerate().skip(1);
    if let Some(first) = states.first_mut() {
        *first = LinkState {
            rate: base.rate,
            angular_acceleration: base.angular_acceleration,
            specific_force: base.specific_force,
            ..LinkState::zero()
        };
    }
    for (i, (link, joint)) in moving {
        let (before, rest) = states.split_at_mut(i);
        let (Some(parent), Some(state)) = (before.get(link.parent), rest.first_mut()) else {
            return Err(TreeError::Order(i));
        };
        step(parent, joint, state);
    }
    Ok(())
}

/// Brings a link's state to the motion of its joint beyond a parent whose state it is.
#[inline(always)]
pub fn step<T: Scalar>(parent: &LinkState<T>, joint: &JointMotion<T>, state: &mut LinkState<T>) {
    step_by::<T, true>(parent, joint, state);
}

/// Does what [`step`] does for a joint that only turns: its velocity and acceleration, both zero, are not
/// examined.
#[inline(always)]
pub fn step_turning<T: Scalar>(parent: &LinkState<T>, joint: &JointMotion<T>, state: &mut LinkState<T>) {
    step_by::<T, false>(parent, joint, state);
}

#[inline(always)]
fn step_by<T: Scalar, const SLIDES: bool>(
    parent: &LinkState<T>,
    joint: &JointMotion<T>,
    state: &mut LinkState<T>,
) {
    let (omega, change) = (&parent.rate, &parent.angular_acceleration);
    let rotation = parent.rotation * joint.rotation;
    let arm = parent.rotation * joint.position;
    let turning = rotation * joint.rate;
    let swing = omega.cross(&arm);
    state.rotation = rotation;
    state.position = parent.position + arm;
    state.rate = omega + turning;
    // d/dt (R ω_rel) = R ω̇_rel + ω_parent × R ω_rel
    state.angular_acceleration = change + rotation * joint.angular_acceleration + omega.cross(&turning);
    if SLIDES {
        let slide = parent.rotation * joint.velocity;
        let two = T::ONE + T::ONE;
        state.velocity = parent.velocity + swing + slide;
        state.specific_force = parent.specific_force
            + parent.rotation * joint.acceleration
            + change.cross(&arm)
            + omega.cross(&(swing + slide * two));
    } else {
        state.velocity = parent.velocity + swing;
        state.specific_force = parent.specific_force + change.cross(&arm) + omega.cross(&swing);
    }
}

/// One freedom of a joint in base axes about the base's origin: with it `τ = screw · [F; M]`, `[F; M]` the
/// wrench on the links beyond the joint about the base's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Screw<T: Scalar> {
    /// Weights of Fx, Fy, Fz, Mx, My, Mz.
    pub weights: [T; 6],
    /// Derivatives of the weights as components in base axes.
    pub changes: [T; 6],
}

/// Gives the screws of a link's joint, in the order of its rates. Calls `each` with the number of the
/// freedom.
#[inline(always)]
pub fn screws<T: Scalar>(
    link: &Link<T>,
    parent: &LinkState<T>,
    state: &LinkState<T>,
    base_rate: &Vector3<T>,
    mut each: impl FnMut(usize, Screw<T>),
) {
    let position = &state.position;
    let shift = state.velocity - base_rate.cross(position);
    let turning = |axis: Vector3<T>, carrier: &Vector3<T>| {
        let change = (carrier - base_rate).cross(&axis);
        // a·(M − r×F) = a·M + (r×a)·F
        pair(position.cross(&axis), axis, shift.cross(&axis) + position.cross(&change), change)
    };
    let sliding = |axis: Vector3<T>, carrier: &Vector3<T>| {
        pair(axis, Vector3::zeros(), (carrier - base_rate).cross(&axis), Vector3::zeros())
    };
    match &link.joint {
        Joint::Fixed => {}
        Joint::Revolute(axis) => each(0, turning(state.rotation * axis, &state.rate)),
        Joint::Prismatic(axis) => each(0, sliding(state.rotation * axis, &state.rate)),
        Joint::Universal(first, second) => {
            each(0, turning(parent.rotation * (link.rotation * first), &parent.rate));
            each(1, turning(state.rotation * second, &state.rate));
        }
        Joint::Spherical => {
            for k in 0..3 {
                each(k, turning(state.rotation.column(k).into(), &state.rate));
            }
        }
        Joint::Free => {
            for k in 0..3 {
                each(k, sliding(state.rotation.column(k).into(), &state.rate));
            }
            for k in 0..3 {
                each(3 + k, turning(state.rotation.column(k).into(), &state.rate));
            }
        }
    }
}

#[inline(always)]
fn pair<T: Scalar>(f: Vector3<T>, m: Vector3<T>, df: Vector3<T>, dm: Vector3<T>) -> Screw<T> {
    Screw { weights: [f.x, f.y, f.z, m.x, m.y, m.z], changes: [df.x, df.y, df.z, dm.x, dm.y, dm.z] }
}
