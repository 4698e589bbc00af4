//! The file of a reference body: a weighed body with a drawing, or with measured properties, and where it
//! sits.
//!
//! Its ten parameters about the origin of S are a function of independent quantities, each with a standard
//! deviation: mass, dimensions, place, attitude, and how evenly the mass fills the drawing. Their covariance
//! is propagated to first order (JCGM 100:2008, 5.1); a tolerance `±a` is a standard deviation of `a/√3`
//! (4.3.7).

use nalgebra::{DMatrix, Matrix3, Vector3};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::spatial::{Position, Sensor};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use rigident_io::rig::classes::rectangular;

/// Relative standard deviation of what is not even in a body's density, unless the file says otherwise: of
/// the centre of mass by the radius of gyration, of the tensor by its size.
const DENSITY_STD: f64 = 1e-4;
/// Limits of a place that the file does not state, m and degrees: a part made to ISO 2768-1, class m, has
/// lengths of 30 to 120 mm within ±0.3 mm, and angles of sides of 50 to 120 mm within ±20′.
const PLACE_LIMIT_M: f64 = 3e-4;
const ATTITUDE_LIMIT_DEG: f64 = 1.0 / 3.0;
/// Less than this is not taken: no body is known so well.
pub(super) const LEAST_DENSITY_STD: f64 = 1e-7;

/// A body of known properties.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceBody {
    /// Its name.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// 1 σ of the mass, kg.
    pub mass_std_kg: f64,
    /// 1 σ, relative, of how far centre of mass and tensor are from those of an even density.
    #[serde(default = "density_std")]
    pub density_std: f64,
    /// A cylinder about z that stands on the origin of the body's frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cylinder: Option<Cylinder>,
    /// A cuboid along the axes that stands on the origin of the body's frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<Cuboid>,
    /// Properties that were measured elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<MeasuredBody>,
    /// The body's frame in S.
    #[serde(default)]
    pub place: Place,
    /// The body turned: other ways in which it was mounted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub mounting: Vec<Mounting>,
}

fn density_std() -> f64 {
    DENSITY_STD
}

/// `[cylinder]`
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cylinder {
    /// Diameter, m.
    pub diameter_m: f64,
    /// Its limits, ±, m.
    pub diameter_tolerance_m: f64,
    /// Length, m.
    pub length_m: f64,
    /// Its limits, ±, m.
    pub length_tolerance_m: f64,
    /// Diameter of a bore along the axis, m.
    #[serde(default)]
    pub bore_diameter_m: f64,
    /// Its limits, ±, m.
    #[serde(default)]
    pub bore_diameter_tolerance_m: f64,
}

/// `[cuboid]`
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Edges along x, y, z, m.
    pub size_m: [f64; 3],
    /// Their limits, ±, m.
    pub size_tolerance_m: [f64; 3],
}

/// `[measured]`, in the body's frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredBody {
    /// Centre of mass, m.
    pub com_m: [f64; 3],
    /// Its 1 σ, m.
    pub com_std_m: [f64; 3],
    /// Tensor about the centre of mass, `[Ixx, Iyy, Izz, Iyz, Izx, Ixy]`, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Its 1 σ, kg m².
    pub inertia_com_std_kgm2: [f64; 6],
}

/// `[place]`: the body's frame in S.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Place {
    /// Its origin, m.
    pub position_m: [f64; 3],
    /// The origin's limits along each axis, ±, m; 0.3 mm unless stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_tolerance_m: Option<[f64; 3]>,
    /// Its attitude: turned by roll, pitch and yaw about the fixed axes x, y, z of S, one after the other,
    /// degrees.
    pub rotation_rpy_deg: [f64; 3],
    /// The attitude's limits about each axis, ±, degrees; a third of one unless stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_tolerance_deg: Option<[f64; 3]>,
}

impl Place {
    /// Returns the limits of the origin, m.
    pub fn position_limits_m(&self) -> [f64; 3] {
        self.position_tolerance_m.unwrap_or([PLACE_LIMIT_M; 3])
    }

    /// Returns the limits of the attitude, degrees.
    pub fn rotation_limits_deg(&self) -> [f64; 3] {
        self.rotation_tolerance_deg.unwrap_or([ATTITUDE_LIMIT_DEG; 3])
    }

    /// Says which of its limits are defaults; `None` if the file states them.
    pub fn assumed(&self) -> Option<String> {
        let position = format!("place.position_tolerance_m ±{:.1} mm", 1e3 * PLACE_LIMIT_M);
        let attitude = format!("place.rotation_tolerance_deg ±{ATTITUDE_LIMIT_DEG:.2}°");
        let mut named = Vec::new();
        named.extend(self.position_tolerance_m.is_none().then_some(position));
        named.extend(self.rotation_tolerance_deg.is_none().then_some(attitude));
        (!named.is_empty()).then(|| {
            format!(
                "the reference does not state how well it is placed; defaults are taken: {} (ISO 2768-1, \
                 class m)",
                named.join(", ")
            )
        })
    }
}

/// `[[mounting]]`: the place turned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mounting {
    /// Its name, for `--mounting`.
    pub name: String,
    /// Turned after the place's own attitude by roll, pitch and yaw about the fixed axes of S, degrees, about
    /// the place's origin.
    pub rotation_rpy_deg: [f64; 3],
    /// Another origin than the place's, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
}

/// Why a reference body cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReferenceError {
    /// It cannot be read.
    #[error("reference body {path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// What the system says.
        reason: String,
    },
    /// Not TOML, an unknown key, a value of the wrong kind.
    #[error("reference body {path}: {reason}")]
    Syntax {
        /// The file.
        path: String,
        /// What is wrong.
        reason: String,
    },
    /// A value that makes no sense.
    #[error("reference body {path}: {key} = {value}: {advice}")]
    Value {
        /// The file.
        path: String,
        /// The key.
        key: String,
        /// The value there.
        value: String,
        /// What should.
        advice: String,
    },
    /// There is not one shape.
    #[error("reference body {path}: it needs one of [cylinder], [cuboid] and [measured], and has {count}")]
    Shape {
        /// The file.
        path: String,
        /// How many there are.
        count: usize,
    },
    /// There is no such mounting.
    #[error("reference body {name} has no mounting {mounting}{}", choices(known))]
    Mounting {
        /// Its name.
        name: String,
        /// What was asked for.
        mounting: String,
        /// The mountings that it has.
        known: Vec<String>,
    },
}

fn choices(known: &[String]) -> String {
    if known.is_empty() {
        "; there is no [[mounting]]".to_owned()
    } else {
        format!("; there are {}", known.join(", "))
    }
}

/// An independent quantity that the ten parameters follow from.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// Its name; those of a mounting begin with the mounting's.
    pub name: String,
    /// Its standard deviation, SI.
    pub sd: f64,
}

/// The ten parameters of a mounted body about the origin of S: values, and what one standard deviation of
/// each cause moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Mounted {
    /// The parameters, SI.
    pub parameters: [f64; 10],
    /// The causes.
    pub causes: Vec<Cause>,
    /// 10 × causes.
    pub moved: DMatrix<f64>,
}

impl Mounted {
    /// Returns the covariance of the ten parameters.
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.moved * self.moved.transpose()
    }

    /// Returns the body with a fixture under it, of ten parameters in S with their covariance.
    #[must_use]
    pub fn with_fixture(mut self, parameters: &[f64; 10], covariance: &DMatrix<f64>) -> Self {
        self.parameters.iter_mut().zip(parameters).for_each(|(own, more)| *own += more);
        let eigen = nalgebra::SymmetricEigen::new(covariance.clone());
        let count = self.causes.len();
        self.moved = self.moved.insert_columns(count, eigen.eigenvalues.len(), 0.0);
        for (k, (value, direction)) in
            eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).enumerate()
        {
            self.causes.push(Cause { name: format!("fixture {k}"), sd: value.max(0.0).sqrt() });
            self.moved.set_column(count + k, &(direction * value.max(0.0).sqrt()));
        }
        self
    }
}

/// The body about its centre of mass in its frame.
struct Central {
    com: Vector3<f64>,
    /// Radii of gyration squared, as a tensor.
    per_mass: Matrix3<f64>,
}

impl ReferenceBody {
    /// Returns the mounting of a name; an empty name is the place as it is.
    ///
    /// # Errors
    /// [`ReferenceError::Mounting`] if there is none.
    pub fn mounting(&self, name: &str) -> Result<Option<&Mounting>, ReferenceError> {
        if name.is_empty() {
            return Ok(None);
        }
        let found = self.mounting.iter().find(|mounting| mounting.name == name);
        found.map(Some).ok_or_else(|| ReferenceError::Mounting {
            name: self.name.clone(),
            mounting: name.to_owned(),
            known: self.mounting.iter().map(|mounting| mounting.name.clone()).collect(),
        })
    }

    /// Returns the ten parameters as it is mounted.
    pub fn mounted(&self, mounting: Option<&Mounting>) -> Mounted {
        let causes = self.causes(mounting);
        let at = |moved: Option<(usize, f64)>| {
            let by: Vec<f64> = causes
                .iter()
                .enumerate()
                .map(|(k, _)| moved.filter(|m| m.0 == k).map_or(0.0, |m| m.1))
                .collect();
            self.parameters(mounting, &by)
        };
        let mut moved = DMatrix::zeros(10, causes.len());
        for (k, cause) in causes.iter().enumerate() {
            let (more, less) = (at(Some((k, cause.sd))), at(Some((k, -cause.sd))));
            for (j, (more, less)) in more.iter().zip(less).enumerate() {
                moved[(j, k)] = 0.5 * (more - less);
            }
        }
        Mounted { parameters: at(None), causes, moved }
    }

    /// Returns the limits of the shape's dimensions.
    fn dimensions(&self) -> Vec<(&'static str, f64)> {
        if let Some(c) = &self.cylinder {
            return vec![
                ("diameter", c.diameter_tolerance_m),
                ("length", c.length_tolerance_m),
                ("bore", c.bore_diameter_tolerance_m),
            ];
        }
        let Some(c) = &self.cuboid else { return Vec::new() };
        ["size x", "size y", "size z"].into_iter().zip(c.size_tolerance_m).collect()
    }

    /// Returns the causes in the order of [`ReferenceBody::parameters`], exact ones included.
    fn causes(&self, mounting: Option<&Mounting>) -> Vec<Cause> {
        let of = |name: String, sd: f64| Cause { name, sd };
        let mut all = vec![of("mass".to_owned(), self.mass_std_kg)];
        let limits = self.dimensions();
        all.extend(limits.into_iter().map(|(name, limit)| of(name.to_owned(), rectangular(limit))));
        let gyration = self.central(&[]).per_mass.trace().max(0.0) / 2.0;
        let (com, tensor) = match &self.measured {
            Some(measured) => (measured.com_std_m, measured.inertia_com_std_kgm2),
            None => ([0.0; 3], [0.0; 6]),
        };
        for (axis, stated) in ["x", "y", "z"].iter().zip(com) {
            all.push(of(format!("centre of mass {axis}"), stated.hypot(self.density_std * gyration.sqrt())));
        }
        for (element, stated) in ["xx", "yy", "zz", "yz", "zx", "xy"].iter().zip(tensor) {
            let even = self.density_std * self.mass_kg * gyration;
            all.push(of(format!("tensor {element}"), stated.hypot(even)));
        }
        let of_mounting = |what: &str, axis: &str| {
            let own = mounting.map_or(String::new(), |mounting| format!("{} ", mounting.name));
            format!("{own}{what} {axis}")
        };
        for (axis, limit) in ["x", "y", "z"].iter().zip(self.place.position_limits_m()) {
            all.push(of(of_mounting("place", axis), rectangular(limit)));
        }
        for (axis, limit) in ["x", "y", "z"].iter().zip(self.place.rotation_limits_deg()) {
            all.push(of(of_mounting("attitude", axis), rectangular(limit.to_radians())));
        }
        all
    }

    /// Returns the body about its centre of mass, its dimensions changed by this much.
    fn central(&self, by: &[f64]) -> Central {
        let by = |k: usize| by.get(k).copied().unwrap_or(0.0);
        let diagonal = |[a, b, c]: [f64; 3]| Matrix3::from_diagonal(&Vector3::new(a, b, c));
        if let Some(c) = &self.cylinder {
            let (d, length, bore) = (c.diameter_m + by(0), c.length_m + by(1), c.bore_diameter_m + by(2));
            // `m (R² + r²)/2` about the axis, `m (3 (R² + r²) + l²)/12` across it.
            let squares = 0.25 * (d * d + bore * bore);
            let across = (3.0 * squares + length * length) / 12.0;
            return Central {
                com: Vector3::new(0.0, 0.0, 0.5 * length),
                per_mass: diagonal([across, across, 0.5 * squares]),
            };
        }
        if let Some(c) = &self.cuboid {
            let [x, y, z] = [c.size_m[0] + by(0), c.size_m[1] + by(1), c.size_m[2] + by(2)];
            let [xx, yy, zz] = [x * x, y * y, z * z];
            return Central {
                com: Vector3::new(0.0, 0.0, 0.5 * z),
                per_mass: diagonal([(yy + zz) / 12.0, (zz + xx) / 12.0, (xx + yy) / 12.0]),
            };
        }
        let measured = self.measured.as_ref();
        let tensor = measured.map_or([0.0; 6], |measured| measured.inertia_com_kgm2);
        Central {
            com: measured.map_or(Vector3::zeros(), |measured| Vector3::from(measured.com_m)),
            per_mass: tensor_from_elements(tensor) / self.mass_kg,
        }
    }

    /// Returns the ten parameters in S with every cause off by this much.
    fn parameters(&self, mounting: Option<&Mounting>, by: &[f64]) -> [f64; 10] {
        let dimensions = self.dimensions().len();
        let (own, rest) = by.split_at(by.len().min(1 + dimensions));
        let rest = |k: usize| rest.get(k).copied().unwrap_or(0.0);
        let central = self.central(own.get(1..).unwrap_or_default());
        let mass = self.mass_kg + own.first().copied().unwrap_or(0.0);
        let com = central.com + Vector3::new(rest(0), rest(1), rest(2));
        // A drawing scales with the mass, what was measured does not.
        let scale = if self.measured.is_some() { self.mass_kg } else { mass };
        let uneven = tensor_from_elements(std::array::from_fn(|k| rest(3 + k)));
        let inertia = central.per_mass * scale + uneven;
        let place = mounting.and_then(|mounting| mounting.position_m).unwrap_or(self.place.position_m);
        let place = Vector3::from(place) + Vector3::new(rest(9), rest(10), rest(11));
        let off = nalgebra::Rotation3::new(Vector3::new(rest(12), rest(13), rest(14)));
        let turned =
            mounting.map_or(nalgebra::Rotation3::identity(), |mounting| turn(mounting.rotation_rpy_deg));
        let attitude = off * turned * turn(self.place.rotation_rpy_deg);
        let com = place + attitude * com;
        let inertia = attitude.matrix() * inertia * attitude.matrix().transpose();
        let com = Position::<Sensor, f64>::from_array([com.x, com.y, com.z]);
        InertialParameters::from_centre_of_mass(mass, com, inertia).to_vector()
    }
}

/// Roll, pitch and yaw about fixed axes.
fn turn(degrees: [f64; 3]) -> nalgebra::Rotation3<f64> {
    let [roll, pitch, yaw] = degrees.map(f64::to_radians);
    nalgebra::Rotation3::from_euler_angles(roll, pitch, yaw)
}

#[cfg(test)]
#[path = "body_tests.rs"]
mod tests;
