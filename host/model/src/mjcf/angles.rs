//! Orientations as MJCF writes them.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use roxmltree::Node;

use crate::xml::{describe, exactly, of_quaternion, parse};

/// The ways to write an orientation.
const WAYS: [&str; 5] = ["axisangle", "xyaxes", "zaxis", "euler", "quat"];

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
        self.rotation_of(node, &|name| node.attribute(name))
    }

    /// Returns the same of an element whose attributes may be those of a class, which `word` returns; its own
    /// counts first.
    ///
    /// # Errors
    /// Which attribute holds no such numbers.
    pub(super) fn rotation_of<'w>(
        &self,
        node: &Node,
        word: &dyn Fn(&str) -> Option<&'w str>,
    ) -> Result<Matrix3<f64>, String> {
        let own = WAYS.into_iter().find(|name| node.has_attribute(*name));
        let way = own.or_else(|| WAYS.into_iter().find(|name| word(name).is_some()));
        let Some((way, text)) = way.and_then(|way| Some((way, word(way)?))) else {
            return Ok(Matrix3::identity());
        };
        let what = format!("{way} of {}", describe(node));
        let v = parse(text, &what)?;
        Ok(match way {
            "euler" => self.euler(exactly::<3>(v, &what)?),
            "axisangle" => {
                let [x, y, z, a] = exactly::<4>(v, &what)?;
                let axis = Unit::new_normalize(Vector3::new(x, y, z));
                Rotation3::from_axis_angle(&axis, self.angle(a)).into_inner()
            }
            "xyaxes" => {
                let v = exactly::<6>(v, &what)?;
                let x = Vector3::new(v[0], v[1], v[2]).normalize();
                let y = Vector3::new(v[3], v[4], v[5]);
                let y = (y - x * x.dot(&y)).normalize();
                Matrix3::from_columns(&[x, y, x.cross(&y)])
            }
            "zaxis" => {
                let turn =
                    Rotation3::rotation_between(&Vector3::z(), &Vector3::from(exactly::<3>(v, &what)?));
                let upside_down = || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
                turn.unwrap_or_else(upside_down).into_inner()
            }
            _ => {
                let q = exactly::<4>(v, &what)?;
                if q.iter().all(|v| *v == 0.0) {
                    return Err(format!("{what} is zero"));
                }
                of_quaternion(q)
            }
        })
    }
}
