//! What the ground does to a person: wrenches of force plates in the laboratory's frame.

use nalgebra::{Matrix3, Vector3};

use super::c3d::{C3d, Plate, PlateKind};

/// The wrench of a force plate on whoever stands on it, over time.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundWrench {
    /// The plate's name.
    pub name: String,
    /// Corners of its surface, laboratory axes, m; `None` if they are not known, as of a belt.
    pub corners_m: Option<[[f64; 3]; 4]>,
    /// Samples per second.
    pub rate_hz: f64,
    /// Time of the first sample, s.
    pub first_s: f64,
    /// Force and moment on the person about the laboratory's origin, laboratory axes, N and N m.
    pub wrench: Vec<[f64; 6]>,
}

impl Plate {
    /// Returns the plate's axes in the laboratory's, by columns, and the middle of its surface, m; `None` if its corners are no
    /// rectangle's.
    ///
    /// x from the second corner to the first, y from the fourth to the first, z of both.
    pub fn place(&self) -> Option<(Matrix3<f64>, Vector3<f64>)> {
        let [a, b, c, d] = self.corners_m.map(Vector3::from);
        let x = (a + d - b - c).try_normalize(1e-6)?;
        let y = a + b - c - d;
        let y = (y - x * x.dot(&y)).try_normalize(1e-6)?;
        Some((Matrix3::from_columns(&[x, y, x.cross(&y)]), (a + b + c + d) / 4.0))
    }

    /// Returns force and moment in the plate's axes and the point that the moment is about, in the plate's frame, from the values of
    /// its channels.
    ///
    /// The point lies below the surface, whatever sign a laboratory has written the plate's origin with.
    fn own_wrench(&self, values: &[f64; 8]) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let [ox, oy, oz] = self.origin_m;
        // z of the plate points down; what is below the surface has a positive one.
        let below = Vector3::new(-ox, -oy, oz.abs());
        let length = self.moment_m;
        let first =
            |v: &[f64; 6]| (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]) * length, below);
        match &self.kind {
            PlateKind::Wrench => {
                let [a, b, c, d, e, f, ..] = *values;
                first(&[a, b, c, d, e, f])
            }
            PlateKind::Calibrated(matrix) => {
                first(&std::array::from_fn(|row| matrix[row].iter().zip(values).map(|(m, v)| m * v).sum()))
            }
            PlateKind::Pressure => {
                let [fx, fy, fz, px, py, mz, ..] = *values;
                let at = Vector3::new(px, py, 0.0) * length;
                (Vector3::new(fx, fy, fz), Vector3::new(0.0, 0.0, mz * length), at)
            }
            PlateKind::Pillars => {
                let [x12, x34, y14, y23, z1, z2, z3, z4] = *values;
                // The pillars' distances from the middle; the moment is about their tops.
                let (a, b) = (ox.abs(), oy.abs());
                let force = Vector3::new(x12 + x34, y14 + y23, z1 + z2 + z3 + z4);
                let moment = Vector3::new(
                    b * (z1 + z2 - z3 - z4),
                    a * (-z1 + z2 + z3 - z4),
                    b * (-x12 + x34) + a * (y14 - y23),
                );
                (force, moment, Vector3::new(0.0, 0.0, oz.abs()))
            }
        }
    }
}

impl C3d {
    /// Returns the wrenches of the plates as their channels have them, not zeroed.
    pub fn ground_wrenches(&self) -> Vec<GroundWrench> {
        let each = self.plates.iter().enumerate().filter_map(|(k, plate)| {
            let (axes, middle) = plate.place()?;
            let samples = self.analog.chunks_exact(self.channels.len().max(1));
            let wrench = samples.map(|sample| {
                let mut values = [0.0; 8];
                for (to, channel) in values.iter_mut().zip(&plate.channels) {
                    *to = sample.get(*channel).copied().map_or(f64::NAN, f64::from);
                }
                let (force, moment, at) = plate.own_wrench(&values);
                let force = axes * force;
                let moment = axes * moment + (middle + axes * at).cross(&force);
                [force.x, force.y, force.z, moment.x, moment.y, moment.z]
            });
            Some(GroundWrench {
                name: format!("plate {}", k + 1),
                corners_m: Some(plate.corners_m),
                rate_hz: self.rate_hz * self.samples_per_frame as f64,
                first_s: 0.0,
                wrench: wrench.collect(),
            })
        });
        each.collect()
    }
}
