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

/// A solid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Solid {
    /// m³.
    pub(super) volume: f64,
    /// Centre of mass of the solid in the frame of the geom, m.
    pub(super) centre: Vector3<f64>,
    /// Tensor of the solid about the centre of mass over its mass, m².
    pub(super) moments: Matrix3<f64>,
}

impl Solid {
    /// Returns that of a type of geom; `None` of one whose solid is not made here.
    fn of(kind: &str, [a, b, c]: [f64; 3]) -> Option<Self> {
        const PI: f64 = std::f64::consts::PI;
        let squares = |share: f64| Vector3::new(b * b + c * c, a * a + c * c, a * a + b * b) / share;
        let height = 2.0 * b;
        let cylinder = {
            let across = (3.0 * a * a + height * height) / 12.0;
            Vector3::new(across, across, a * a / 2.0)
        };
        let (volume, moments) = match kind {
            "sphere" => (4.0 / 3.0 * PI * a.powi(3), Vector3::repeat(0.4 * a * a)),
            "ellipsoid" => (4.0 / 3.0 * PI * a * b * c, squares(5.0)),
            "box" => (8.0 * a * b * c, squares(3.0)),
            "cylinder" => (PI * a * a * height, cylinder),
            "capsule" => {
                // Two half balls at the ends of a cylinder.
                let balls = 4.0 * a / (4.0 * a + 3.0 * height);
                let away = balls * height * (3.0 * a + 2.0 * height) / 8.0;
                let moments = cylinder * (1.0 - balls)
                    + Vector3::repeat(0.4 * balls * a * a)
                    + Vector3::new(away, away, 0.0);
                (PI * (a * a * height + 4.0 / 3.0 * a.powi(3)), moments)
            }
            // A plane has no mass.
            "plane" => (0.0, Vector3::zeros()),
            _ => return None,
        };
        Some(Self { volume, centre: Vector3::zeros(), moments: Matrix3::from_diagonal(&moments) })
    }
}

impl<'a> Reader<'a> {
    /// Returns the parameters of a body about its origin as its geoms make them, and the type of a geom that
    /// is none of those that are followed.
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
            let kind = own("type").unwrap_or("sphere");
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
                    let place =
                        numbers("pos")?.map(|v| exactly::<3>(v, &format!("pos of {what}"))).transpose()?;
                    let rotation = self.angles.rotation_of(&geom.node, &own)?;
                    (rotation, place.map_or_else(Vector3::zeros, Vector3::from))
                }
            };
            let solid = match self.solid(kind, own("mesh"), size) {
                Ok(solid) => solid,
                Err(other) => return Ok((sum, Some(other))),
            };
            let mass = mass.unwrap_or(density * solid.volume);
            if mass < LIGHTEST_KG || kind == "plane" {
                continue;
            }
            let tensor = solid.moments * mass;
            let body = InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::zero(), tensor);
            let rotation = geom.rotation * rotation;
            let position = geom.position + geom.rotation * position + rotation * solid.centre;
            for (to, value) in sum.iter_mut().zip(in_parent(&body.to_vector(), &rotation, &position)) {
                *to += value;
            }
        }
        Ok((sum, None))
    }

    /// Returns the solid of a type of geom, or which kind of geom it is whose solid is not known.
    fn solid(&self, kind: &str, mesh: Option<&str>, size: [f64; 3]) -> Result<Solid, String> {
        match (kind, mesh) {
            ("mesh", Some(name)) => self.meshes.solid(name).map_err(|why| format!("mesh ({name}: {why})")),
            ("mesh", None) => Err("mesh (it is not named)".to_owned()),
            (_, Some(name)) => Err(format!("{kind} that is fitted to a mesh ({name})")),
            (_, None) => Solid::of(kind, size).ok_or_else(|| kind.to_owned()),
        }
    }
}
