//! A link of a tree of which frames tell.

use nalgebra::Matrix3;

use crate::Scalar;
use crate::spatial::{Imu, Rotation};
use crate::tree::base::TurningJoint;

/// Links at most.
pub const LINKS: usize = 16;

/// One link of the tree. The first is the base link, of which nothing is examined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameLink<T> {
    /// Index of the parent, smaller than the link's own.
    pub parent: u8,
    /// The joint above it.
    pub joint: TurningJoint,
    /// The joint in the parent's frame, m.
    pub position: [T; 3],
}

/// Returns the rotation matrix of a quaternion w, x, y, z; `None` of one that is a hundredth off a unit
/// quaternion.
#[inline(never)]
pub(super) fn attitude<T: Scalar>(quaternion: [T; 4]) -> Option<Matrix3<T>> {
    let n2 = quaternion.iter().map(|v| *v * *v).sum::<T>();
    let near = (n2 - T::ONE).abs() < T::from_f32(0.02);
    Rotation::<Imu, Imu, T>::from_quaternion(quaternion).filter(|_| near).map(|r| r.matrix())
}
