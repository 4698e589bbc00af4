//! Smoothed coordinates of a tree whose base is tracked, with their slopes, as positions and rates.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Coordinates of a frame and their rates: first the base's position and quaternion (w, x, y, z) in
/// laboratory axes, then the joints', as [`rigident_model::rows::Moving::set`] takes them.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// Positions, m and rad, and quaternions.
    pub positions: Vec<f64>,
    /// Rates: the base's velocity and angular rate in its own axes, m/s and rad/s, then the joints', rad/s.
    pub rates: Vec<f64>,
}

/// The meaning of a stretch of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The base's position.
    Place,
    /// A quaternion: the base's attitude, a joint that turns about any axis.
    Ball,
    /// An angle or a length.
    Hinge,
}

impl Part {
    /// Returns how many numbers it has.
    pub fn numbers(self) -> usize {
        match self {
            Self::Place => 3,
            Self::Ball => 4,
            Self::Hinge => 1,
        }
    }
}

/// Returns positions and rates of numbers and their slopes (per second), of a base's place and attitude, then
/// the joints'.
pub fn moved(parts: &[Part], values: &[f64], slopes: &[f64]) -> Moved {
    let mut moved = Moved { positions: Vec::with_capacity(values.len()), rates: Vec::new() };
    let mut at = 0;
    let mut velocity = Vector3::zeros();
    for (k, part) in parts.iter().enumerate() {
        let own = (&values[at..at + part.numbers()], &slopes[at..at + part.numbers()]);
        at += part.numbers();
        match part {
            Part::Place => {
                moved.positions.extend(own.0);
                velocity = Vector3::from_column_slice(own.1);
            }
            Part::Hinge => {
                moved.positions.extend(own.0);
                moved.rates.extend(own.1);
            }
            Part::Ball => {
                let q = Quaternion::new(own.0[0], own.0[1], own.0[2], own.0[3]);
                let slope = Quaternion::new(own.1[0], own.1[1], own.1[2], own.1[3]);
                // ω = 2 vec(q* q̇)/|q|², in the link's axes, whatever the length of q
                let rate = (q.conjugate() * slope).vector() * (2.0 / q.norm_squared());
                let unit = UnitQuaternion::from_quaternion(q);
                if k == 1 {
                    moved.rates.extend(unit.inverse_transform_vector(&velocity).iter());
                }
                moved.positions.extend([unit.w, unit.i, unit.j, unit.k]);
                moved.rates.extend(rate.iter());
            }
        }
    }
    moved
}
