//! Orientations as MJCF writes them.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use roxmltree::Node;

use crate::xml::{describe, exactly, numbers, of_quaternion};

/// The way a file writes angles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Angles {
    /// In degrees, not radians.
    pub(super) degrees: bool,
    /// The axes of Euler angles, one after the other: small letters turn with the body, capitals do not.
    order: String,
}

impl Angles {
    /// Takes the compiler's settings.
    pub(super) fn of(angle: Option<&str>, sequence: Option<&str>) -> Self {
        Self { degrees: angle != Some("radian"), order: sequence.unwrap_or("xyz").to_owned() }
    }

    fn angle(&self, value: f64) -> f64 {
        if self.degrees { value.to_radians() } else { value }
    }

    /// Returns the rotation of three Euler angles.
    pub(super) fn euler(&self, angles: [f64; 3]) -> Matrix3<f64> {
        let mut out = Matrix3::identity();
        for (letter, value) in self.order.chars().zip(angles) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => Vector3::x_axis(),
                'y' => Vector3::y_axis(),
                _ => Vector3::z_axis(),
            };
            let turn = Rotation3::from_axis_angle(&axis, self.angle(value)).into_inner();
            // Small letters turn with the body, capitals about fixed axes.
            out = if letter.is_ascii_lowercase() { out * turn } else { turn * out };
        }
        out
    }

    /// Returns the orientation that an element states, in any of the ways there are.
    ///
    /// # Errors
    /// Which attribute holds no such numbers.
    pub(super) fn rotation(&self, node: &Node) -> Result<Matrix3<f64>, String> {
        let what = describe(node);
        if let Some(q) = numbers(node, "quat")? {
            let q = exactly::<4>(q, &format!("quat of {what}"))?;
            if q.iter().all(|v| *v == 0.0) {
                return Err(format!("quat of {what} is zero"));
            }
            return Ok(of_quaternion(q));
        }
        if let Some(v) = numbers(node, "euler")? {
            return Ok(self.euler(exactly::<3>(v, &format!("euler of {what}"))?));
        }
        if let Some(v) = numbers(node, "axisangle")? {
            let [x, y, z, a] = exactly::<4>(v, &format!("axisangle of {what}"))?;
            let axis = Vector3::new(x, y, z);
            return Ok(Rotation3::from_axis_angle(&Unit::new_normalize(axis), self.angle(a)).into_inner());
        }
        if let Some(v) = numbers(node, "xyaxes")? {
            let v = exactly::<6>(v, &format!("xyaxes of {what}"))?;
            let x = Vector3::new(v[0], v[1], v[2]).normalize();
            let y = Vector3::new(v[3], v[4], v[5]);
            let y = (y - x * x.dot(&y)).normalize();
            return Ok(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        }
        if let Some(v) = numbers(node, "zaxis")? {
            let z = Vector3::from(exactly::<3>(v, &format!("zaxis of {what}"))?);
            let turn = Rotation3::rotation_between(&Vector3::z(), &z);
            return Ok(turn.map_or_else(
                || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI).into_inner(),
                Rotation3::into_inner,
            ));
        }
        Ok(Matrix3::identity())
    }
}
