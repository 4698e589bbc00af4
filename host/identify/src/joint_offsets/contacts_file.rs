//! The file of contacts: which links touch planes with corners, which are held, and how IMUs are turned on
//! their links.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::{Contacts, Held, Imu, JointTree, Plane, Sole};

/// A corner is no farther from its link's origin, m: beyond, it is in mm.
const FARTHEST_M: f64 = 2.0;
/// Corners of one sole are apart by more, m.
const LEAST_EXTENT_M: f64 = 1e-3;
/// Fewest corners of a sole: with three a plane is determined.
const FEWEST: usize = 3;
/// A unit vector's or quaternion's length differs from one by no more: four digits were written.
const UNIT_WITHIN: f64 = 0.01;
/// Name of the plane that is always there.
const FLOOR: &str = "floor";
/// 1 σ of a plane's normal about each axis along it, degrees, where none is stated.
const PLANE_NOISE_DEG: f64 = 0.5;

/// A file of contacts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactsFile {
    /// The soles.
    #[serde(default)]
    pub sole: Vec<SoleTable>,
    /// Planes beside the floor.
    #[serde(default)]
    pub plane: Vec<PlaneTable>,
    /// Links that are held.
    #[serde(default)]
    pub fixed: Vec<FixedTable>,
    /// IMUs whose axes are not their links'.
    #[serde(default)]
    pub imu: Vec<ImuTable>,
}

/// `[[sole]]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoleTable {
    /// Its name in the column `contact`; the link's by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its link in the model.
    pub link: String,
    /// Its corners in the link's frame, m.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corners_m: Vec<[f64; 3]>,
    /// Links of the model whose origins are corners, fixed to the sole's link.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corner_links: Vec<String>,
    /// Sites of an MJCF that are corners, on the sole's link or one fixed to it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corner_sites: Vec<String>,
    /// The plane that it touches; the floor by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<String>,
}

/// `[[plane]]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneTable {
    /// Its name in `plane` of a sole.
    pub name: String,
    /// Its normal in the axes of the attitudes, z up.
    pub normal: [f64; 3],
    /// 1 σ of the normal about each axis along the plane, degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_noise_deg: Option<f64>,
}

/// `[[fixed]]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedTable {
    /// Its name in the column `contact`; the link's by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its link in the model.
    pub link: String,
    /// The point that stays where it is, in the link's frame, m.
    #[serde(default)]
    pub point_m: [f64; 3],
    /// Whether the link may turn about that point.
    #[serde(default)]
    pub turns: bool,
}

/// `[[imu]]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuTable {
    /// Its link in the model.
    pub link: String,
    /// Takes vectors in the IMU's axes to the link's.
    pub rotation_wxyz: [f64; 4],
}

/// Finds the place of a site: its link and its position there, m.
pub type Sites<'a> = &'a dyn Fn(&str) -> Result<(String, [f64; 3]), String>;

/// Reads the text of a file of contacts for a model; `what` names it in complaints.
///
/// # Errors
/// Says what is wrong, where, and what to do.
pub fn parse(text: &str, what: &str, tree: &JointTree, sites: Sites) -> Result<Contacts, String> {
    let file: ContactsFile = toml::from_str(text).map_err(|e| format!("{what}: {e}"))?;
    if file.sole.is_empty() && file.fixed.is_empty() {
        return Err(format!(
            "{what}: there is no [[sole]] with link and corners_m: which corners touch the floor?"
        ));
    }
    let mut contacts = Contacts::from(Vec::new());
    for table in &file.plane {
        let plane = plane(table).map_err(|why| format!("{what}: [[plane]] {}: {why}", table.name))?;
        if contacts.planes.iter().any(|other| other.name == plane.name) {
            return Err(format!("{what}: two planes are named {}; {FLOOR} is always there", plane.name));
        }
        contacts.planes.push(plane);
    }
    for table in &file.sole {
        let sole = sole(table, tree, &contacts.planes, sites)
            .map_err(|why| format!("{what}: [[sole]] of {}: {why}", table.link))?;
        if contacts.names().any(|other| other == sole.name) {
            return Err(format!("{what}: two soles are named {}", sole.name));
        }
        contacts.soles.push(sole);
    }
    for table in &file.fixed {
        let held = held(table, tree).map_err(|why| format!("{what}: [[fixed]] of {}: {why}", table.link))?;
        if contacts.names().any(|other| other == held.name) {
            return Err(format!("{what}: two contacts are named {}", held.name));
        }
        contacts.held.push(held);
    }
    for table in &file.imu {
        let link = tree.link(&table.link).map_err(|why| format!("{what}: [[imu]]: {why}"))?;
        let [w, x, y, z] = table.rotation_wxyz;
        let given = Quaternion::new(w, x, y, z);
        if !is_unit(given.norm()) {
            return Err(format!(
                "{what}: [[imu]] of {}: rotation_wxyz is no unit quaternion w, x, y, z",
                table.link
            ));
        }
        if contacts.imus.iter().any(|other| other.link == link) {
            return Err(format!("{what}: [[imu]] of {}: it is there twice", table.link));
        }
        contacts.imus.push(Imu { link, rotation: UnitQuaternion::from_quaternion(given) });
    }
    if contacts.links().all(|link| tree.joints_to(std::iter::once(link)).is_ok_and(|way| way.is_empty())) {
        return Err(format!("{what}: no joint is between the base and any sole: nothing can be found"));
    }
    Ok(contacts)
}

fn is_unit(length: f64) -> bool {
    (length - 1.0).abs() <= UNIT_WITHIN
}

fn plane(table: &PlaneTable) -> Result<Plane, String> {
    let normal = Vector3::from(table.normal);
    if !is_unit(normal.norm()) {
        return Err("its normal is no unit vector; a wall that x runs into has [-1, 0, 0]".to_owned());
    }
    let noise = table.normal_noise_deg.unwrap_or(PLANE_NOISE_DEG);
    if !(0.0..=20.0).contains(&noise) {
        return Err(format!("normal_noise_deg {noise}: must be 0 to 20"));
    }
    Ok(Plane {
        name: named(&table.name)?,
        normal: normal.normalize(),
        tilt_rad: noise.to_radians(),
        at_origin: false,
    })
}

fn held(table: &FixedTable, tree: &JointTree) -> Result<Held, String> {
    let link = tree.link(&table.link)?;
    near(&table.point_m)?;
    let name = named(table.name.as_ref().unwrap_or(&table.link))?;
    Ok(Held { name, link, point_m: table.point_m, turns: table.turns })
}

fn named(name: &str) -> Result<String, String> {
    if name.trim().is_empty() || name.contains('+') {
        return Err(format!(
            "its name {name:?} is empty or has a +, which separates contacts in the column contact"
        ));
    }
    Ok(name.to_owned())
}

fn near(point: &[f64; 3]) -> Result<(), String> {
    if point.iter().any(|v| !v.is_finite() || v.abs() > FARTHEST_M) {
        return Err(format!("corner {point:?} is metres away from its link: is it in mm?"));
    }
    Ok(())
}

fn sole(table: &SoleTable, tree: &JointTree, planes: &[Plane], sites: Sites) -> Result<Sole, String> {
    let link = tree.link(&table.link)?;
    let mut corners_m = table.corners_m.clone();
    let places = tree.places(&[]);
    let mut add = |key: &str, name: &str, corner: usize, own: [f64; 3]| {
        if tree.joints_to(std::iter::once(corner))? != tree.joints_to(std::iter::once(link))? {
            return Err(format!("{key}: a joint moves {name} against it; a corner is fixed to its sole"));
        }
        if let (Some(sole), Some(at)) = (places.get(link), places.get(corner)) {
            corners_m.push(sole.rotation.tr_mul(&(at.point(&own) - sole.position)).into());
        }
        Ok(())
    };
    for name in &table.corner_links {
        add("corner_links", name, tree.link(name)?, [0.0; 3])?;
    }
    for name in &table.corner_sites {
        let (on, own) = sites(name).map_err(|why| format!("corner_sites: {why}"))?;
        add("corner_sites", name, tree.link(&on)?, own)?;
    }
    if corners_m.len() < FEWEST {
        return Err(format!(
            "it has {} corners, and a flat sole needs at least {FEWEST}: give corners_m, corner_links or \
             corner_sites",
            corners_m.len()
        ));
    }
    corners_m.iter().try_for_each(near)?;
    let apart = |a: &[f64; 3], b: &[f64; 3]| (Vector3::from(*a) - Vector3::from(*b)).norm();
    for (k, corner) in corners_m.iter().enumerate() {
        if corners_m.iter().take(k).any(|other| apart(corner, other) < LEAST_EXTENT_M) {
            return Err(format!("corner {corner:?} is stated twice"));
        }
    }
    let wanted = table.plane.as_deref().unwrap_or(FLOOR);
    let plane = planes.iter().position(|plane| plane.name == wanted).ok_or_else(|| {
        let names: Vec<&str> = planes.iter().map(|plane| plane.name.as_str()).collect();
        format!("plane {wanted} is not there; there are {}", names.join(", "))
    })?;
    Ok(Sole { name: named(table.name.as_ref().unwrap_or(&table.link))?, link, corners_m, plane })
}
