//! The file of locked postures.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use rigident_io::rig::LinkTable;

/// No centre of mass on a platform is farther from its origin, m.
const FARTHEST_M: f64 = 5.0;
/// Masses of one body in two postures differ by less than this share.
const SAME_MASS: f64 = 0.1;
/// A file of postures: the tree, and what it weighs in each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PosturesFile {
    /// The tree, as in a rig file.
    pub link: Vec<LinkTable>,
    /// 1 σ of the mass of each posture, kg; of all three or of none: then the postures' scatter tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_std_kg: Option<f64>,
    /// 1 σ of each coordinate of the centre of mass, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_std_m: Option<f64>,
    /// 1 σ of each element of the tensor, kg m².
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_std_kgm2: Option<f64>,
    /// Masses of single links where they are known, kg: they narrow what the postures leave open.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub link_mass_kg: BTreeMap<String, f64>,
    /// The postures.
    pub posture: Vec<PostureTable>,
    /// Values to print beside those found, by the names that these have.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reference: BTreeMap<String, f64>,
}

impl PosturesFile {
    /// Refuses postures that are not in kg and m, or not of one body.
    pub(super) fn check(&self) -> Result<(), String> {
        let mut masses: Vec<f64> = self.posture.iter().map(|posture| posture.mass_kg).collect();
        masses.sort_by(f64::total_cmp);
        let median = masses.get(masses.len() / 2).copied().unwrap_or(0.0);
        for (n, posture) in self.posture.iter().enumerate() {
            let name =
                if posture.name.is_empty() { format!("posture {}", n + 1) } else { posture.name.clone() };
            if posture.com_m.iter().any(|c| c.abs() > FARTHEST_M) {
                return Err(format!(
                    "{name}: com_m = {:?} is metres away from the platform: is it in mm?",
                    posture.com_m
                ));
            }
            if posture.mass_kg > 0.0 && (posture.mass_kg / median - 1.0).abs() > SAME_MASS {
                return Err(format!(
                    "{name}: mass_kg = {} where other postures have {median}: one body has one mass; is it \
                     in g?",
                    posture.mass_kg
                ));
            }
        }
        for (link, mass) in &self.link_mass_kg {
            if !self.link.iter().any(|own| own.name == *link) {
                return Err(format!("link_mass_kg.{link}: there is no such [[link]]"));
            }
            if !(*mass > 0.0 && *mass < median) {
                return Err(format!(
                    "link_mass_kg.{link} = {mass}: a link weighs more than nothing and less than all, \
                     {median} kg"
                ));
            }
        }
        Ok(())
    }
}

/// `[[posture]]`: the whole thing with its joints locked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PostureTable {
    /// Its name.
    #[serde(default)]
    pub name: String,
    /// Mass of everything, kg.
    pub mass_kg: f64,
    /// Centre of mass in the base link's frame, m.
    pub com_m: [f64; 3],
    /// Tensor about the centre of mass, axes of the base link, Ixx, Iyy, Izz, Iyz, Izx, Ixy, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// The positions of the joints, by the names of their links.
    #[serde(default)]
    pub joint: BTreeMap<String, JointStand>,
}

/// The position of a locked joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum JointStand {
    /// Angle of a revolute joint, rad, or length of a prismatic one, m.
    Coordinate(f64),
    /// Attitude of the link in its joint: quaternion w, x, y, z.
    Quaternion([f64; 4]),
    /// The same as a matrix, row by row: takes vectors in the link's axes to the parent's.
    Matrix([[f64; 3]; 3]),
}
