//! The rows of base link and joints, from positions, rates and accelerations.
//!
//! `w = Y φ`: six base rows, the wrench exerted on the tree at the base link's origin, in its axes; and for
//! every freedom of every joint the force or torque of its drive. A base held still has the same rows.

use nalgebra::Vector3;

use super::joint::{Link, TreeError, hat};
use super::motion::{LinkState, screws};
use crate::Scalar;

/// A link's share of the six base rows: `[Fx, Fy, Fz, Mx, My, Mz]`, ten columns each.
pub type Block<T> = [[T; 10]; 6];

/// Returns a block of zeros.
pub fn zero_block<T: Scalar>() -> Block<T> {
    [[T::ZERO; 10]; 6]
}

/// Sets ten parameters' forces and moments about the link's origin, as a block about the base's origin.
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

/// Returns the block of one link in motion, base axes, about the base's origin.
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

/// Returns `weights · block`, over the ten columns; tensors have no part in forces.
#[inline(always)]
pub(super) fn project<T: Scalar>(weights: &[T; 6], block: &Block<T>) -> [T; 10] {
    let mut row = [T::ZERO; 10];
    for (weight, line) in weights.iter().zip(block).take(3) {
        for (sum, entry) in row.iter_mut().zip(line).take(4) {
            *sum += *weight * *entry;
        }
    }
    for (weight, line) in weights.iter().zip(block).skip(3) {
        for (sum, entry) in row.iter_mut().zip(line) {
            *sum += *weight * *entry;
        }
    }
    row
}

/// Puts link `i`'s block into the six base rows.
#[inline(always)]
pub(super) fn put_base<T: Scalar>(block: &Block<T>, i: usize, stride: usize, rows: &mut [T]) {
    for (line, row) in block.iter().zip(rows.chunks_exact_mut(stride)) {
        if let Some(place) = row.get_mut(10 * i..10 * i + 10) {
            place.copy_from_slice(line);
        }
    }
}

/// A block by rows without the zeros of tensors in forces.
struct Lines<T> {
    /// Mass and first moment.
    force: [[T; 4]; 3],
    /// All ten parameters.
    moment: [[T; 10]; 3],
}

/// Returns numbers of some columns, all by the same operations.
#[inline(always)]
fn lanes<T, const N: usize>(of: impl FnMut(usize) -> T) -> [T; N] {
    core::array::from_fn(of)
}

/// Returns `[c]× + [w]× [w]×` by rows. Products with the zeros of `[w]×` keep the signs of zeros.
#[inline(always)]
fn turning<T: Scalar>(w: &Vector3<T>, c: &Vector3<T>) -> [[T; 3]; 3] {
    let o = T::ZERO;
    let (xx, yy, zz) = (w.x * w.x, w.y * w.y, w.z * w.z);
    let (xy, yz, zx) = (w.x * w.y, w.y * w.z, w.z * w.x);
    let (x, y, z) = (w.x * o, w.y * o, w.z * o);
    [
        [o - (zz + yy), -c.z + (xy - z), c.y + (zx + y)],
        [c.z + (xy + z), o - (zz + xx), -c.x + (yz - x)],
        [-c.y + (zx - y), c.x + (yz + x), o - (yy + xx)],
    ]
}

impl<T: Scalar> Lines<T> {
    /// Returns [`block`] to the last bit, by operations on whole rows, of which a processor does several
    /// numbers at once.
    #[inline(always)]
    fn new(state: &LinkState<T>) -> Self {
        let (arm, a) = (&state.position, &state.specific_force);
        let (rate, change) = (&state.rate, &state.angular_acceleration);
        let (o, turn) = (T::ZERO, &state.rotation.data.0);
        // The columns of mass, then of the first moment.
        let axes: [[T; 4]; 3] = lanes(|i| [o, turn[0][i], turn[1][i], turn[2][i]]);
        let omega = turning(rate, change);
        let (mut force, mut moment) = ([[o; 4]; 3], [[o; 10]; 3]);
        for i in 0..3 {
            let m = &omega[i];
            force[i] = lanes(|k| m[0] * axes[0][k] + m[1] * axes[1][k] + m[2] * axes[2][k]);
            force[i][0] = a[i];
        }
        let tensors = tensors(&axes, rate, change);
        for i in 0..3 {
            let (j, l) = ((i + 1) % 3, (i + 2) % 3);
            let own: [T; 4] = lanes(|k| axes[j][k] * a[l] - axes[l][k] * a[j]);
            let of_arm: [T; 4] = lanes(|k| arm[j] * force[l][k] - arm[l] * force[j][k]);
            let near: [T; 4] = lanes(|k| own[k] + of_arm[k]);
            let t = [turn[0][i], turn[1][i], turn[2][i]];
            let far: [T; 6] = lanes(|k| t[0] * tensors[0][k] + t[1] * tensors[1][k] + t[2] * tensors[2][k]);
            moment[i][..4].copy_from_slice(&near);
            moment[i][0] = o + of_arm[0];
            moment[i][4..].copy_from_slice(&far);
        }
        Self { force, moment }
    }

    /// Writes `weights · block`.
    #[inline(always)]
    fn project(&self, w: &[T; 6], row: &mut [T; 10]) {
        let (o, Self { force: f, moment: m }) = (T::ZERO, self);
        let near: [T; 4] = lanes(|k| {
            let forces = o + w[0] * f[0][k] + w[1] * f[1][k] + w[2] * f[2][k];
            forces + w[3] * m[0][k] + w[4] * m[1][k] + w[5] * m[2][k]
        });
        let far: [T; 6] = lanes(|k| o + w[3] * m[0][4 + k] + w[4] * m[1][4 + k] + w[5] * m[2][4 + k]);
        row[..4].copy_from_slice(&near);
        row[4..].copy_from_slice(&far);
    }

    /// Writes link `i`'s share of the six base rows.
    #[inline(always)]
    fn put_base(&self, i: usize, stride: usize, rows: &mut [T]) {
        let (forces, moments) = rows.split_at_mut(3 * stride);
        for (line, row) in self.force.iter().zip(forces.chunks_exact_mut(stride)) {
            row[10 * i..10 * i + 4].copy_from_slice(line);
            row[10 * i + 4..10 * i + 10].fill(T::ZERO);
        }
        for (line, row) in self.moment.iter().zip(moments.chunks_exact_mut(stride)) {
            row[10 * i..10 * i + 10].copy_from_slice(line);
        }
    }
}

/// Returns the tensor's columns in link axes, by rows.
#[inline(always)]
fn tensors<T: Scalar>(axes: &[[T; 4]; 3], rate: &Vector3<T>, change: &Vector3<T>) -> [[T; 6]; 3] {
    let in_link =
        |v: &Vector3<T>| -> [T; 4] { lanes(|k| axes[0][k] * v.x + axes[1][k] * v.y + axes[2][k] * v.z) };
    let ([_, wx, wy, wz], [_, cx, cy, cz]) = (in_link(rate), in_link(change));
    let (xx, yy, zz) = (wx * wx, wy * wy, wz * wz);
    let (yz, zx, xy) = (wy * wz, wz * wx, wx * wy);
    let o = T::ZERO;
    [
        [cx, o - yz, yz, yy - zz, cz + xy, cy - zx],
        [zx, cy, o - zx, cz - xy, zz - xx, cx + yz],
        [o - xy, xy, cz, cy + zx, cx - yz, xx - yy],
    ]
}

/// Writes the six base rows, row by row, `10 · links` columns each.
///
/// # Errors
/// [`TreeError::Lengths`] if `rows` is not `60 · links` long.
#[inline(always)]
pub fn base_rows<T: Scalar>(states: &[LinkState<T>], rows: &mut [T]) -> Result<(), TreeError> {
    let stride = 10 * states.len();
    if rows.len() != 6 * stride {
        return Err(TreeError::Lengths);
    }
    for (i, state) in states.iter().enumerate() {
        Lines::new(state).put_base(i, stride, rows);
    }
    Ok(())
}

/// Writes the rows of all joints, row by row in the order of links and freedoms, `10 · links` columns each.
/// Entries of links that are not beyond a joint are left as they are: they are zero always, so an array that
/// was zeroed once serves. Of the workspace's screws only the weights are brought to this instant.
///
/// # Errors
/// [`TreeError::Lengths`] if workspace or rows do not fit the tree.
#[inline(always)]
pub fn joint_rows<T: Scalar>(
    links: &[Link<T>],
    states: &[LinkState<T>],
    workspace: &mut Workspace<'_, T>,
    rows: &mut [T],
) -> Result<(), TreeError> {
    let stride = 10 * links.len();
    workspace.fill_weights(links, states)?;
    if rows.len() != workspace.screws.len() * stride {
        return Err(TreeError::Lengths);
    }
    for (i, state) in states.iter().enumerate().skip(1) {
        workspace.put_lines(&Lines::new(state), links, i, rows);
    }
    Ok(())
}

/// Writes base rows and joint rows together: six, then those of all joints, row by row. Each link's block is
/// made once.
///
/// # Errors
/// [`TreeError::Lengths`] if workspace or rows do not fit the tree.
#[inline(always)]
pub fn all_rows<T: Scalar>(
    links: &[Link<T>],
    states: &[LinkState<T>],
    workspace: &mut Workspace<'_, T>,
    rows: &mut [T],
) -> Result<(), TreeError> {
    let stride = 10 * links.len();
    workspace.fill_weights(links, states)?;
    if rows.len() != (6 + workspace.screws.len()) * stride {
        return Err(TreeError::Lengths);
    }
    let (base, joints) = rows.split_at_mut(6 * stride);
    for (i, state) in states.iter().enumerate() {
        let lines = Lines::new(state);
        lines.put_base(i, stride, base);
        workspace.put_lines(&lines, links, i, joints);
    }
    Ok(())
}

/// Room for the screws of all freedoms, and where each link's first one is.
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
        self.fill_by(links, states, |to, screw| *to = screw)
    }

    /// Writes the weights alone.
    #[inline(always)]
    fn fill_weights(&mut self, links: &[Link<T>], states: &[LinkState<T>]) -> Result<(), TreeError> {
        self.fill_by(links, states, |to, screw| to.weights = screw.weights)
    }

    #[inline(always)]
    fn fill_by(
        &mut self,
        links: &[Link<T>],
        states: &[LinkState<T>],
        put: impl Fn(&mut super::Screw<T>, super::Screw<T>),
    ) -> Result<(), TreeError> {
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
            screws(link, parent, state, &base_rate, |k, screw| put(&mut self.screws[next + k], screw));
            next += link.joint.freedoms();
        }
        self.first[links.len()] = next;
        Ok(())
    }

    /// Puts link `i`'s lines, seen by every joint between it and the base, into the rows of all joints.
    #[inline(always)]
    fn put_lines(&self, lines: &Lines<T>, links: &[Link<T>], i: usize, rows: &mut [T]) {
        let mut at = i;
        while at != 0 {
            for row in self.first[at]..self.first[at + 1] {
                let place = 10 * (row * links.len() + i);
                if let Some(row_of_link) = rows.get_mut(place..).and_then(|rest| rest.first_chunk_mut()) {
                    lines.project(&self.screws[row].weights, row_of_link);
                }
            }
            at = links[at].parent;
        }
    }

    /// Puts link `i`'s block, seen by every joint between it and the base, into the rows of all joints.
    #[inline(always)]
    pub(super) fn put_joints(&self, block: &Block<T>, links: &[Link<T>], i: usize, rows: &mut [T]) {
        self.each_above(links, i, |row, screw| {
            let place = 10 * (row * links.len() + i);
            rows[place..place + 10].copy_from_slice(&project(&screw.weights, block));
        });
    }

    /// Calls `each` with every freedom between link `i` and the base.
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
