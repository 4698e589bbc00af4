//! The axes X Y Z U V W.

use hexapod::{Geometry, Pose};

/// Names of the axes, in order.
pub(super) const AXES: [char; 6] = ['X', 'Y', 'Z', 'U', 'V', 'W'];

/// Translations, mm, and rotations, degrees, from the reference pose: X, Y, Z, U, V, W.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GcsPosition(pub [f64; 6]);

impl GcsPosition {
    /// Of a pose, against the reference pose (which is level). With `R = Rx(U) Ry(V) Rz(W)`:
    /// `sin V = R₁₃`, `tan U = −R₂₃ / R₃₃`, `tan W = −R₁₂ / R₁₁`.
    pub fn of(pose: &Pose, reference: &Pose) -> Self {
        let r = pose.rotation();
        let mut out = [0.0; 6];
        for (i, mm) in out.iter_mut().take(3).enumerate() {
            *mm = 1e3 * (pose.position_m[i] - reference.position_m[i]);
        }
        out[3] = (-r[1][2]).atan2(r[2][2]).to_degrees();
        out[4] = r[0][2].clamp(-1.0, 1.0).asin().to_degrees();
        out[5] = (-r[0][1]).atan2(r[0][0]).to_degrees();
        Self(out)
    }

    /// The pose. From `R = Rz(yaw) Ry(pitch) Rx(roll)`: `sin pitch = −R₃₁`, `tan roll = R₃₂ / R₃₃`,
    /// `tan yaw = R₂₁ / R₁₁`.
    pub fn pose(&self, reference: &Pose) -> Pose {
        let [x, y, z, u, v, w] = self.0;
        let [(su, cu), (sv, cv), (sw, cw)] = [u, v, w].map(|d| d.to_radians().sin_cos());
        let (r11, r21, r31) = (cv * cw, cu * sw + su * sv * cw, su * sw - cu * sv * cw);
        let (r32, r33) = (su * cw + cu * sv * sw, cu * cv);
        let [x0, y0, z0] = reference.position_m;
        Pose {
            position_m: [x0 + 1e-3 * x, y0 + 1e-3 * y, z0 + 1e-3 * z],
            rpy_rad: [r32.atan2(r33), (-r31).clamp(-1.0, 1.0).asin(), r21.atan2(r11)],
        }
    }
}

/// Travel of each axis by itself from the reference pose, lowest and highest, mm and degrees: as far as the legs reach.
pub fn limits(geometry: &Geometry) -> [[f64; 2]; 6] {
    let home = geometry.home();
    let reaches = |axis: usize, value: f64| {
        let mut at = GcsPosition::default();
        at.0[axis] = value;
        let [lo, hi] = geometry.leg_length_m;
        geometry.leg_lengths(&at.pose(&home)).iter().all(|l| (lo..=hi).contains(l))
    };
    std::array::from_fn(|axis| {
        let most = if axis < 3 { 1000.0 } else { 60.0 };
        [-1.0, 1.0].map(|sign| {
            // The first value that is out of reach, in steps, then by halving.
            let steps = 600;
            let first = (1..=steps)
                .map(|k| most * f64::from(k) / f64::from(steps))
                .find(|v| !reaches(axis, sign * v));
            let Some(mut out) = first else { return sign * most };
            let mut inside = out - most / f64::from(steps);
            for _ in 0..30 {
                let middle = 0.5 * (inside + out);
                if reaches(axis, sign * middle) { inside = middle } else { out = middle }
            }
            sign * inside
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Vector3};

    #[test]
    fn uvw_are_rotations_one_after_the_other_about_axes_that_go_along() {
        let home = Geometry::thesis().home();
        let (u, v, w) = (11.0_f64, -17.0_f64, 23.0_f64);
        let pose = GcsPosition([10.0, -20.0, 30.0, u, v, w]).pose(&home);
        // The platform's own steps: about x, then about the new y, then about the newest z.
        let about = |axis: Vector3<f64>, d: f64| {
            Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(axis), d.to_radians())
        };
        let first = about(Vector3::x(), u);
        let second = about(first * Vector3::y(), v) * first;
        let third = about(second * Vector3::z(), w) * second;
        let rotation = pose.rotation();
        for i in 0..3 {
            for j in 0..3 {
                assert!((rotation[i][j] - third[(i, j)]).abs() < 1e-14);
            }
        }
        assert!((pose.position_m[2] - home.position_m[2] - 0.03).abs() < 1e-15);
        for (a, b) in GcsPosition::of(&pose, &home).0.iter().zip([10.0, -20.0, 30.0, u, v, w]) {
            assert!((a - b).abs() < 1e-11);
        }
    }

    #[test]
    fn the_travel_ends_where_a_leg_ends() {
        let geometry = Geometry::thesis();
        let all = limits(&geometry);
        // Straight up a leg is as long as it can be: the height follows from Pythagoras.
        let [lo, hi] = geometry.leg_length_m;
        // The plate's joints are 0.123 m below its origin; leg² = height² + (a constant distance in the plane)².
        let height = geometry.home().position_m[2] - 0.123;
        let plane = (0.5 * (lo + hi)).powi(2) - height * height;
        for (limit, l) in all[2].iter().zip([lo, hi]) {
            let expected = 1e3 * ((l * l - plane).sqrt() - height);
            assert!((limit - expected).abs() < 1e-3, "{limit} {expected}");
        }
        assert!(all.iter().all(|[low, high]| *low < 0.0 && *high > 0.0));
    }
}
