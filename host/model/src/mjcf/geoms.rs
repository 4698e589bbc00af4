//! Inertias of bodies that state none: MuJoCo's compiler makes them of the body's geoms.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};

use super::Reader;
use super::robot::Inside;
use crate::inertial::{Parameters, in_parent};
use crate::tree::NO_BODY;
use crate::xml::{self, describe, exactly};

/// Density that a geom has where it states none, kg/m³.
const DENSITY: f64 = 1000.0;
/// MuJoCo leaves lighter geoms out, kg.
const LIGHTEST_KG: f64 = 1e-14;

/// A solid about its centre.
struct Solid {
    /// m³.
    volume: f64,
    /// Moments over its mass, m².
    moments: Vector3<f64>,
}

impl Solid {
    /// Returns that of a type of geom; `None` of a mesh or another whose solid is not made here.
    fn of(kind: &str, [a, b, c]: [f64; 3]) -> Option<Self> {
        const PI: f64 = std::f64::consts::PI;
        let squares = |share: f64| Vector3::new(b * b + c * c, a * a + c * c, a * a + b * b) / share;
        let height = 2.0 * b;
        let cylinder = {
            let across = (3.0 * a * a + height * height) / 12.0;
            Vector3::new(across, across, a * a / 2.0)
        };
        Some(match kind {
            "sphere" => Self { volume: 4.0 / 3.0 * PI * a.powi(3), moments: Vector3::repeat(0.4 * a * a) },
            "ellipsoid" => Self { volume: 4.0 / 3.0 * PI * a * b * c, moments: squares(5.0) },
            "box" => Self { volume: 8.0 * a * b * c, moments: squares(3.0) },
            "cylinder" => Self { volume: PI * a * a * height, moments: cylinder },
            "capsule" => {
                // Two half balls at the ends of a cylinder.
                let balls = 4.0 * a / (4.0 * a + 3.0 * height);
                let away = balls * height * (3.0 * a + 2.0 * height) / 8.0;
                let moments = cylinder * (1.0 - balls)
                    + Vector3::repeat(0.4 * balls * a * a)
                    + Vector3::new(away, away, 0.0);
                Self { volume: PI * (a * a * height + 4.0 / 3.0 * a.powi(3)), moments }
            }
            // A plane has no mass.
            "plane" => Self { volume: 0.0, moments: Vector3::zeros() },
            _ => return None,
        })
    }
}

impl<'a> Reader<'a> {
    /// Returns the parameters of a body about its origin as its geoms make them, and the type of a geom that is none of those that
    /// are followed.
    ///
    /// # Errors
    /// Which attribute of a geom holds no such numbers.
    pub(super) fn of_geoms(&self, inside: &[Inside<'a>]) -> Result<(Parameters, Option<String>), String> {
        let mut sum = NO_BODY;
        for geom in inside.iter().filter(|own| own.node.has_tag_name("geom")) {
            let own = |name: &str| self.word("geom", &geom.node, name, &geom.classes);
            let what = describe(&geom.node);
            let numbers =
                |name: &str| own(name).map(|text| xml::parse(text, &format!("{name} of {what}"))).transpose();
            let one =
                |name: &str| numbers(name).map(|found| found.and_then(|values| values.first().copied()));
            let group = one("group")?.unwrap_or(0.0);
            let (mass, density) = (one("mass")?, one("density")?.unwrap_or(DENSITY));
            let weighs = mass.map_or(density > 0.0, |mass| mass > 0.0);
            if !weighs || !(self.groups[0]..=self.groups[1]).contains(&group) {
                continue;
            }
            let kind = if own("mesh").is_some() { "mesh" } else { own("type").unwrap_or("sphere") };
            if own("shellinertia") == Some("true") {
                return Ok((sum, Some("shell".to_owned())));
            }
            let mut size = [0.0; 3];
            for (to, value) in size.iter_mut().zip(numbers("size")?.unwrap_or_default()) {
                *to = value;
            }
            let (rotation, position) = match numbers("fromto")? {
                Some(ends) => {
                    let ends = exactly::<6>(ends, &format!("fromto of {what}"))?;
                    let [from, to] = [0, 3].map(|k| Vector3::new(ends[k], ends[k + 1], ends[k + 2]));
                    let half = (to - from).norm() / 2.0;
                    size = if matches!(kind, "box" | "ellipsoid") {
                        [size[0], size[0], half]
                    } else {
                        [size[0], half, 0.0]
                    };
                    let turn = Rotation3::rotation_between(&Vector3::z(), &(from - to));
                    let upside_down = || Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
                    (turn.unwrap_or_else(upside_down).into_inner(), (from + to) / 2.0)
                }
                None => {
                    let place = Self::vector(&geom.node, "pos")?.unwrap_or_else(Vector3::zeros);
                    (self.angles.rotation(&geom.node)?, place)
                }
            };
            let Some(solid) = Solid::of(kind, size) else { return Ok((sum, Some(kind.to_owned()))) };
            let mass = mass.unwrap_or(density * solid.volume);
            if mass < LIGHTEST_KG || kind == "plane" {
                continue;
            }
            let tensor = Matrix3::from_diagonal(&(solid.moments * mass));
            let body = InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::zero(), tensor);
            let rotation = geom.rotation * rotation;
            let position = geom.position + geom.rotation * position;
            for (to, value) in sum.iter_mut().zip(in_parent(&body.to_vector(), &rotation, &position)) {
                *to += value;
            }
        }
        Ok((sum, None))
    }
}
