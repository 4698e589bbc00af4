//! The columns of a link's base rows that stay when what the rows cannot tell apart is regrouped to its
//! parent.
//!
//! Regrouping moves parameters, not columns: `Y φ = Y_B φ_B` with `Y_B` a subset of Y's columns, one for
//! every base parameter. Which ones is a matter of the joint alone: it keeps the rules of G. Venture, K.
//! Ayusawa, Y. Nakamura (SYSID 2009) for a base that moves freely.

/// The joint above a link, for a tree whose joints do not slide. The first link has none and keeps all ten
/// columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TurningJoint {
    /// Does not turn: all goes to the parent.
    Fixed,
    /// Turns about one of the link's axes: 0 x, 1 y, 2 z.
    Revolute(u8),
    /// Turns in any way, or about two axes.
    Spherical,
}

/// Returns a mask in which bit k is set if column k of φ stays. Of a revolute joint about z (x, y, z in a
/// circle) the mass, MSz and Jyy go to the parent, and the column of Jxx represents Jxx − Jyy. `None` if
/// there is no such axis.
pub const fn kept_columns(joint: TurningJoint) -> Option<u16> {
    const ALL: u16 = 0x3FF;
    match joint {
        TurningJoint::Fixed => Some(0),
        TurningJoint::Spherical => Some(ALL & !1),
        TurningJoint::Revolute(axis) if axis < 3 => {
            Some(ALL & !(1 | 1 << (1 + axis) | 1 << (4 + (axis + 2) % 3)))
        }
        TurningJoint::Revolute(_) => None,
    }
}

/// Bit k: column k of the first link stays.
pub const FIRST_LINK: u16 = 0x3FF;
