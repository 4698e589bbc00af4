//! Links and how they hang together.

use nalgebra::{Matrix3, Vector3};

use crate::Scalar;
use crate::spatial::cross_matrix;

/// Tells how a link moves against its parent. Axes are unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Joint<T: Scalar> {
    /// The link does not move against its parent.
    Fixed,
    /// Turns about an axis, given in the link's frame.
    Revolute(Vector3<T>),
    /// Slides along an axis, given in the link's frame.
    Prismatic(Vector3<T>),
    /// Turns about the first axis, then about the second, both given in the link's frame at zero angles;
    /// between them is nothing that has mass.
    Universal(Vector3<T>, Vector3<T>),
    /// Turns about its origin.
    Spherical,
    /// Moves in any way.
    Free,
}

impl<T: Scalar> Joint<T> {
    /// Degrees of freedom: entries of its rates.
    pub fn freedoms(&self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Revolute(_) | Self::Prismatic(_) => 1,
            Self::Universal(..) => 2,
            Self::Spherical => 3,
            Self::Free => 6,
        }
    }

    /// Entries of its position: an angle (rad) or a length (m), a quaternion w, x, y, z, or a position (m)
    /// and a quaternion.
    pub fn coordinates(&self) -> usize {
        match self {
            Self::Spherical => 4,
            Self::Free => 7,
            other => other.freedoms(),
        }
    }
}

/// A link: its parent and the joint it hangs on. The first link of a tree is the base, whose joint is not
/// examined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T: Scalar> {
    /// Index of the parent, smaller than the link's own.
    pub parent: usize,
    /// The joint.
    pub joint: Joint<T>,
    /// Parent axes ← link axes at zero position.
    pub rotation: Matrix3<T>,
    /// Joint in the parent's frame at zero position, m.
    pub position: Vector3<T>,
}

/// Tells why links make no tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeError {
    /// There is not even a base.
    Empty,
    /// The parent of this link does not precede it.
    Order(usize),
    /// The arrays given are not as long as the tree.
    Lengths,
}

/// Returns whether every link's parent precedes it.
///
/// # Errors
/// [`TreeError`] naming the first link for which it does not.
pub fn check<T: Scalar>(links: &[Link<T>]) -> Result<(), TreeError> {
    if links.is_empty() {
        return Err(TreeError::Empty);
    }
    match links.iter().enumerate().skip(1).find(|(i, link)| link.parent >= *i) {
        Some((i, _)) => Err(TreeError::Order(i)),
        None => Ok(()),
    }
}

/// Holds where a link is and how it moves, against its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion<T: Scalar> {
    /// Parent axes ← link axes.
    pub rotation: Matrix3<T>,
    /// Origin of the link in the parent's frame, m.
    pub position: Vector3<T>,
    /// Angular rate against the parent, link axes, rad/s.
    pub rate: Vector3<T>,
    /// Velocity of the origin against the parent, parent axes, m/s.
    pub velocity: Vector3<T>,
    /// Derivative of the components of `rate`, rad/s².
    pub angular_acceleration: Vector3<T>,
    /// Derivative of the components of `velocity`, m/s².
    pub acceleration: Vector3<T>,
}

/// Returns `R(axis, angle) = 1 c + [axis]× s + axis axisᵀ (1 − c)` from sine and cosine.
#[inline(always)]
pub fn turn<T: Scalar>(axis: &Vector3<T>, sine: T, cosine: T) -> Matrix3<T> {
    let rest = T::ONE - cosine;
    let (x, y, z) = (axis.x, axis.y, axis.z);
    let (rx, ry, rz) = (rest * x, rest * y, rest * z);
    let (sx, sy, sz) = (sine * x, sine * y, sine * z);
    let (xy, yz, zx) = (rx * y, ry * z, rz * x);
    Matrix3::new(
        rx * x + cosine,
        xy - sz,
        zx + sy,
        xy + sz,
        ry * y + cosine,
        yz - sx,
        zx - sy,
        yz + sx,
        rz * z + cosine,
    )
}

impl<T: Scalar> JointMotion<T> {
    /// Returns a joint at rest at zero position.
    pub fn rest(link: &Link<T>) -> Self {
        let zero = Vector3::zeros();
        Self {
            rotation: link.rotation,
            position: link.position,
            rate: zero,
            velocity: zero,
            angular_acceleration: zero,
            acceleration: zero,
        }
    }

    /// Makes the state of a revolute joint: sine and cosine of the angle, rad/s, rad/s².
    #[inline(always)]
    pub fn revolute(link: &Link<T>, axis: &Vector3<T>, sine_cosine: (T, T), rate: T, change: T) -> Self {
        Self {
            rotation: link.rotation * turn(axis, sine_cosine.0, sine_cosine.1),
            rate: axis * rate,
            angular_acceleration: axis * change,
            ..Self::rest(link)
        }
    }

    /// Makes the state of a prismatic joint: m, m/s, m/s².
    #[inline(always)]
    pub fn prismatic(link: &Link<T>, axis: &Vector3<T>, length: T, rate: T, change: T) -> Self {
        let along = link.rotation * axis;
        Self {
            position: link.position + along * length,
            velocity: along * rate,
            acceleration: along * change,
            ..Self::rest(link)
        }
    }

    /// Makes the state of a universal joint: sines and cosines of both angles, rad/s, rad/s².
    #[inline(always)]
    pub fn universal(
        link: &Link<T>,
        axes: [&Vector3<T>; 2],
        sines_cosines: [(T, T); 2],
        rates: [T; 2],
        changes: [T; 2],
    ) -> Self {
        let [first, second] = axes;
        let [(s1, c1), (s2, c2)] = sines_cosines;
        let inner = turn(second, s2, c2);
        // ω = R₂ᵀ a₁ q̇₁ + a₂ q̇₂, and d/dt (R₂ᵀ a₁) = (R₂ᵀ a₁) × a₂ q̇₂
        let carried = inner.tr_mul(first);
        let own = second * rates[1];
        let carried_rate = carried * rates[0];
        Self {
            rotation: link.rotation * turn(first, s1, c1) * inner,
            rate: carried_rate + own,
            angular_acceleration: carried * changes[0] + second * changes[1] + carried_rate.cross(&own),
            ..Self::rest(link)
        }
    }

    /// Makes the state of a spherical joint: link axes at zero ← link axes; rate and its derivative in link
    /// axes.
    #[inline(always)]
    pub fn spherical(link: &Link<T>, attitude: &Matrix3<T>, rate: [T; 3], change: [T; 3]) -> Self {
        Self {
            rotation: link.rotation * attitude,
            rate: rate.into(),
            angular_acceleration: change.into(),
            ..Self::rest(link)
        }
    }

    /// Makes the state of a free joint: position of the origin from its place at zero and attitude, both in
    /// the axes at zero; velocity and rate, then their derivatives, as components in link axes.
    #[inline(always)]
    pub fn free(
        link: &Link<T>,
        place: [T; 3],
        attitude: &Matrix3<T>,
        rates: [[T; 3]; 2],
        changes: [[T; 3]; 2],
    ) -> Self {
        let turned = Self::spherical(link, attitude, rates[1], changes[1]);
        let (v, change) = (Vector3::from(rates[0]), Vector3::from(changes[0]));
        Self {
            position: link.position + link.rotation * Vector3::from(place),
            velocity: turned.rotation * v,
            // d/dt (R v) = R (v̇ + ω × v)
            acceleration: turned.rotation * (change + turned.rate.cross(&v)),
            ..turned
        }
    }
}

/// Returns `[v]×` of a vector.
#[inline(always)]
pub(super) fn hat<T: Scalar>(v: &Vector3<T>) -> Matrix3<T> {
    cross_matrix([v.x, v.y, v.z])
}
