//! The rows of base link and joints, from positions, rates and accelerations.
//!
//! `w = Y φ`: six base rows, the wrench exerted on the tree at the base link's origin, in its axes; and for every
//! freedom of every joint the force or torque of its drive. A base held still has the same rows.

use nalgebra::Vector3;

use super::joint::{Link, TreeError, hat};
use super::motion::{LinkState, screws};
use crate::Scalar;

/// A link's share of the six base rows: `[Fx, Fy, Fz, Mx, My, Mz]`, ten columns each.
pub type Block<T> = [[T; 10]; 6];

/// A block of zeros.
pub fn zero_block<T: Scalar>() -> Block<T> {
    [[T::ZERO; 10]; 6]
}

/// Ten parameters' forces and moments about the link's origin, as a block about the base's origin.
#[inline(always)]
pub(super) fn set<T: Scalar>(
    block: &mut Block<T>,
    k: usize,
    arm: &Vector3<T>,
    force: &Vector3<T>,
    moment: &Vector3<T>,
) {
    let about_base = moment + arm.cross(force);
    for axis in 0..3 {
        block[axis][k] = force[axis];
        block[3 + axis][k] = about_base[axis];
    }
}

/// The block of one link in motion, base axes, about the base's origin.
///
/// With a, ω, ω̇ of the link: `F = a m + ([ω̇]× + [ω]×[ω]×) mc`, `M = −[a]× mc + (L(ω̇) + [ω]× L(ω)) I`.
#[inline(always)]
pub fn block<T: Scalar>(state: &LinkState<T>) -> Block<T> {
    let mut block = zero_block();
    let (turn, arm, a) = (&state.rotation, &state.position, &state.specific_force);
    let (rate, change) = (&state.rate, &state.angular_acceleration);
    set(&mut block, 0, arm, a, &Vector3::zeros());
    let spin = hat(rate);
    let omega = hat(change) + spin * spin;
    for (k, axis) in turn.data.0.iter().enumerate() {
        let axis = Vector3::from(*axis);
        set(&mut block, 1 + k, arm, &(omega * axis), &axis.cross(a));
    }
    // The inertia's columns in link axes, where the parameters are, and then turned.
    let w = turn.tr_mul(rate);
    let c = turn.tr_mul(change);
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (yz, zx, xy) = (w.y * w.z, w.z * w.x, w.x * w.y);
    let o = T::ZERO;
    let columns = [
        [c.x, zx, o - xy],
        [o - yz, c.y, xy],
        [yz, o - zx, c.z],
        [yy - zz, c.z - xy, c.y + zx],
        [c.z + xy, zz - xx, c.x - yz],
        [c.y - zx, c.x + yz, xx - yy],
    ];
    for (k, column) in columns.into_iter().enumerate() {
        let moment = turn * Vector3::from(column);
        for axis in 0..3 {
            block[3 + axis][4 + k] = moment[axis];
        }
    }
    block
}

/// `weights · block`, over the ten columns.
#[inline(always)]
pub(super) fn project<T: Scalar>(weights: &[T; 6], block: &Block<T>) -> [T; 10] {
    let mut row = [T::ZERO; 10];
    for (weight, line) in weights.iter().zip(block) {
        for (sum, entry) in row.iter_mut().zip(line) {
            *sum += *weight * *entry;
        }
    }
    row
}

/// Link `i`'s block into the six base rows.
#[inline(always)]
pub(super) fn put_base<T: Scalar>(block: &Block<T>, i: usize, stride: usize, rows: &mut [T]) {
    for (line, row) in block.iter().zip(rows.chunks_exact_mut(stride)) {
        if let Some(place) = row.get_mut(10 * i..10 * i + 10) {
            place.copy_from_slice(line);
        }
    }
}

/// The six base rows, row by row, `10 · links` columns each.
///
/// # Errors
/// [`TreeError::Lengths`] if `rows` is not `60 · links` long.
pub fn base_rows<T: Scalar>(states: &[LinkState<T>], rows: &mut [T]) -> Result<(), TreeError> {
    let stride = 10 * states.len();
    if rows.len() != 6 * stride {
        return Err(TreeError::Lengths);
    }
    for (i, state) in states.iter().enumerate() {
        put_base(&block(state), i, stride, rows);
    }
    Ok(())
}

/// The rows of all joints, row by row in the order of links and freedoms, `10 · links` columns each. Entries of links
/// that are not beyond a joint are left as they are: they are zero always, so an array that was zeroed once serves.
///
/// # Errors
/// [`TreeError::Lengths`] if workspace or rows do not fit the tree.
pub fn joint_rows<T: Scalar>(
    links: &[Link<T>],
    states: &[LinkState<T>],
    workspace: &mut Workspace<'_, T>,
    rows: &mut [T],
) -> Result<(), TreeError> {
    let stride = 10 * links.len();
    workspace.fill(links, states)?;
    if rows.len() != workspace.screws.len() * stride {
        return Err(TreeError::Lengths);
    }
    for (i, state) in states.iter().enumerate().skip(1) {
        workspace.put_joints(&block(state), links, i, rows);
    }
    Ok(())
}

/// Base rows and joint rows together: six, then those of all joints, row by row. Each link's block is made once.
///
/// # Errors
/// [`TreeError::Lengths`] if workspace or rows do not fit the tree.
pub fn all_rows<T: Scalar>(
    links: &[Link<T>],
    states: &[LinkState<T>],
    workspace: &mut Workspace<'_, T>,
    rows: &mut [T],
) -> Result<(), TreeError> {
    let stride = 10 * links.len();
    workspace.fill(links, states)?;
    if rows.len() != (6 + workspace.screws.len()) * stride {
        return Err(TreeError::Lengths);
    }
    let (base, joints) = rows.split_at_mut(6 * stride);
    for (i, state) in states.iter().enumerate() {
        let block = block(state);
        put_base(&block, i, stride, base);
        workspace.put_joints(&block, links, i, joints);
    }
    Ok(())
}

/// Room for the screws of all freedoms, and where each link's first one stands.
#[derive(Debug)]
pub struct Workspace<'a, T: Scalar> {
    /// One for every freedom.
    pub screws: &'a mut [super::Screw<T>],
    /// One for every link, and one more: the number of freedoms.
    pub first: &'a mut [usize],
}

impl<T: Scalar> Workspace<'_, T> {
    /// Writes the screws of this instant.
    ///
    /// # Errors
    /// [`TreeError`] if the room does not fit the tree.
    pub fn fill(&mut self, links: &[Link<T>], states: &[LinkState<T>]) -> Result<(), TreeError> {
        let freedoms: usize = links.iter().skip(1).map(|l| l.joint.freedoms()).sum();
        if self.screws.len() != freedoms || self.first.len() != links.len() + 1 || states.len() != links.len()
        {
            return Err(TreeError::Lengths);
        }
        let base_rate = states.first().map_or_else(Vector3::zeros, |s| s.rate);
        let mut next = 0;
        for (i, (link, state)) in links.iter().zip(states).enumerate() {
            self.first[i] = next;
            if i == 0 {
                continue;
            }
            let Some(parent) = states.get(link.parent) else { return Err(TreeError::Order(i)) };
            screws(link, parent, state, &base_rate, |k, screw| self.screws[next + k] = screw);
            next += link.joint.freedoms();
        }
        self.first[links.len()] = next;
        Ok(())
    }

    /// Link `i`'s block, seen by every joint between it and the base, into the rows of all joints.
    #[inline(always)]
    pub(super) fn put_joints(&self, block: &Block<T>, links: &[Link<T>], i: usize, rows: &mut [T]) {
        self.each_above(links, i, |row, screw| {
            let place = 10 * (row * links.len() + i);
            rows[place..place + 10].copy_from_slice(&project(&screw.weights, block));
        });
    }

    /// Every freedom between link `i` and the base.
    #[inline(always)]
    pub(super) fn each_above(
        &self,
        links: &[Link<T>],
        i: usize,
        mut each: impl FnMut(usize, &super::Screw<T>),
    ) {
        let mut at = i;
        while at != 0 {
            for row in self.first[at]..self.first[at + 1] {
                each(row, &self.screws[row]);
            }
            at = links[at].parent;
        }
    }
}
