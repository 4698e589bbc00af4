//! Rows without accelerations: two parts, of which one is smoothed and the other differentiated by the
//! filter.
//!
//! Let h be the momentum of the links relative to a frame that moves with S without turning:
//! `P' = Σ m u + ω × mc`, and `H'` about S. In that frame the base's acceleration and gravity act together as
//! the specific force a, so that
//! ```text
//! w = ∂h + ω₀ × h + [m a; mc × a],          τ_j = s_j · w = ∂(s_j · h) + s_j · (ω₀ × h + [m a; mc × a]) − (∂s_j) · h
//! ```
//! with ∂ the derivative of components in S and s_j the joint's screw. h is linear in φ and knows rates
//! alone. A filter with kernel k on both sides: `k ∗ w = k ∗ smoothed + k̇ ∗ differentiated`: nothing is
//! differentiated numerically.

use nalgebra::Vector3;

use super::joint::{Link, TreeError};
use super::motion::{BaseMotion, LinkState};
use super::rows::{Block, Workspace, project, put_base, set, zero_block};
use crate::Scalar;

/// A link's momentum about the base's origin and the rest of its base rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts<T: Scalar> {
    /// The part to be smoothed: `ω₀ × h + [m a; mc × a]`.
    pub smoothed: Block<T>,
    /// The part to be differentiated: h.
    pub differentiated: Block<T>,
}

/// Returns the momentum of one link about the base's origin, in base axes: h. Its velocity is that of
/// [`LinkState::velocity`].
#[inline(never)]
pub fn momentum<T: Scalar>(state: &LinkState<T>) -> Block<T> {
    let mut momentum = zero_block();
    let (turn, arm, u, rate) = (&state.rotation, &state.position, &state.velocity, &state.rate);
    let zero = Vector3::zeros();
    // H' = m r×u + r×(ω×mc) + mc×u + I ω
    set(&mut momentum, 0, arm, u, &zero);
    for (k, axis) in turn.data.0.iter().enumerate() {
        let axis = Vector3::from(*axis);
        set(&mut momentum, 1 + k, arm, &rate.cross(&axis), &axis.cross(u));
    }
    let w = turn.tr_mul(rate);
    let o = T::ZERO;
    let columns = [[w.x, o, o], [o, w.y, o], [o, o, w.z], [o, w.z, w.y], [w.z, o, w.x], [w.y, w.x, o]];
    for (k, column) in columns.into_iter().enumerate() {
        let moment = turn * Vector3::from(column);
        for axis in 0..3 {
            momentum[3 + axis][4 + k] = moment[axis];
        }
    }
    momentum
}

/// Returns the parts of one link.
pub fn parts<T: Scalar>(state: &LinkState<T>, base: &BaseMotion<T>) -> Parts<T> {
    let differentiated = momentum(state);
    Parts { smoothed: smoothed(state, base, &differentiated), differentiated }
}

/// Returns the rest of a link's base rows beside its momentum h: `ω₀ × h + [m a; mc × a]`.
#[inline(always)]
pub fn smoothed<T: Scalar>(state: &LinkState<T>, base: &BaseMotion<T>, momentum: &Block<T>) -> Block<T> {
    let (turn, arm) = (&state.rotation, &state.position);
    let mut smoothed = zero_block();
    let a = &base.specific_force;
    for k in 0..10 {
        let p = Vector3::new(momentum[0][k], momentum[1][k], momentum[2][k]);
        let h = Vector3::new(momentum[3][k], momentum[4][k], momentum[5][k]);
        let (mut force, mut moment) = (base.rate.cross(&p), base.rate.cross(&h));
        if k == 0 {
            force += a;
            moment += arm.cross(a);
        } else if let Some(axis) = turn.data.0.get(k - 1) {
            moment += Vector3::from(*axis).cross(a);
        }
        for axis in 0..3 {
            smoothed[axis][k] = force[axis];
            smoothed[3 + axis][k] = moment[axis];
        }
    }
    smoothed
}

/// Writes the six base rows in two parts, each row by row with `10 · links` columns.
///
/// # Errors
/// [`TreeError::Lengths`] if the arrays are not `60 · links` long.
pub fn base_rows<T: Scalar>(
    states: &[LinkState<T>],
    base: &BaseMotion<T>,
    smoothed: &mut [T],
    differentiated: &mut [T],
) -> Result<(), TreeError> {
    let stride = 10 * states.len();
    if smoothed.len() != 6 * stride || differentiated.len() != 6 * stride {
        return Err(TreeError::Lengths);
    }
    for (i, state) in states.iter().enumerate() {
        let parts = parts(state, base);
        put_base(&parts.smoothed, i, stride, smoothed);
        put_base(&parts.differentiated, i, stride, differentiated);
    }
    Ok(())
}

/// Writes the rows of all joints in two parts; as in [`super::rows::joint_rows`], entries that are always
/// zero are left alone.
///
/// # Errors
/// [`TreeError::Lengths`] if the arrays do not fit the tree.
pub fn joint_rows<T: Scalar>(
    links: &[Link<T>],
    states: &[LinkState<T>],
    base: &BaseMotion<T>,
    workspace: &mut Workspace<'_, T>,
    smoothed: &mut [T],
    differentiated: &mut [T],
) -> Result<(), TreeError> {
    let stride = 10 * links.len();
    workspace.fill(links, states)?;
    let rows = workspace.screws.len();
    if smoothed.len() != rows * stride || differentiated.len() != rows * stride {
        return Err(TreeError::Lengths);
    }
    for (i, state) in states.iter().enumerate().skip(1) {
        let parts = parts(state, base);
        workspace.each_above(links, i, |row, screw| {
            let place = row * stride + 10 * i;
            let mut rest = project(&screw.weights, &parts.smoothed);
            let turned = project(&screw.changes, &parts.differentiated);
            for (value, less) in rest.iter_mut().zip(turned) {
                *value -= less;
            }
            smoothed[place..place + 10].copy_from_slice(&rest);
        });
        workspace.put_joints(&parts.differentiated, links, i, differentiated);
    }
    Ok(())
}
