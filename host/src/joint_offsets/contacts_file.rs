//! The file of contacts: which links have soles, and where their corners are.

use serde::{Deserialize, Serialize};

use super::{JointTree, Sole};

/// A corner is no farther from its link's origin, m: beyond, it is in mm.
const FARTHEST_M: f64 = 2.0;
/// Corners of one sole are apart by more, m.
const LEAST_EXTENT_M: f64 = 1e-3;
/// Fewest corners of a sole: with three a plane is told.
const FEWEST: usize = 3;

/// A file of contacts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactsFile {
    /// The soles.
    #[serde(default)]
    pub sole: Vec<SoleTable>,
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
}

/// Reads the text of a file of contacts for a model; `what` names it in complaints.
///
/// # Errors
/// Says what is wrong, where, and what to do.
pub fn parse(text: &str, what: &str, tree: &JointTree) -> Result<Vec<Sole>, String> {
    let file: ContactsFile = toml::from_str(text).map_err(|e| format!("{what}: {e}"))?;
    if file.sole.is_empty() {
        return Err(format!(
            "{what}: there is no [[sole]] with link and corners_m: which corners touch the floor?"
        ));
    }
    let mut soles: Vec<Sole> = Vec::new();
    for table in &file.sole {
        let sole = sole(table, tree).map_err(|why| format!("{what}: [[sole]] of {}: {why}", table.link))?;
        if soles.iter().any(|other| other.name == sole.name) {
            return Err(format!("{what}: two soles are named {}", sole.name));
        }
        soles.push(sole);
    }
    if soles.iter().all(|sole| tree.joints_to(std::iter::once(sole.link)).is_ok_and(|way| way.is_empty())) {
        return Err(format!("{what}: no joint stands between the base and any sole: nothing can be found"));
    }
    Ok(soles)
}

fn sole(table: &SoleTable, tree: &JointTree) -> Result<Sole, String> {
    let link = tree.link(&table.link)?;
    let mut corners_m = table.corners_m.clone();
    let places = tree.places(&[]);
    for name in &table.corner_links {
        let corner = tree.link(name)?;
        if tree.joints_to(std::iter::once(corner))? != tree.joints_to(std::iter::once(link))? {
            return Err(format!(
                "corner_links: a joint moves {name} against it; a corner is fixed to its sole"
            ));
        }
        let (Some(own), Some(at)) = (places.get(link), places.get(corner)) else { continue };
        corners_m.push(own.rotation.tr_mul(&(at.position - own.position)).into());
    }
    if corners_m.len() < FEWEST {
        return Err(format!(
            "it has {} corners, and a flat sole needs at least {FEWEST}: give corners_m or corner_links",
            corners_m.len()
        ));
    }
    if let Some(far) = corners_m.iter().find(|c| c.iter().any(|v| !v.is_finite() || v.abs() > FARTHEST_M)) {
        return Err(format!("corner {far:?} is metres away from its link: is it in mm?"));
    }
    let apart =
        |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    for (k, corner) in corners_m.iter().enumerate() {
        if corners_m.iter().take(k).any(|other| apart(corner, other) < LEAST_EXTENT_M) {
            return Err(format!("corner {corner:?} stands twice"));
        }
    }
    let name = table.name.clone().unwrap_or_else(|| table.link.clone());
    if name.trim().is_empty() || name.contains('+') {
        return Err(format!(
            "its name {name:?} is empty or has a +, which separates soles in the column contact"
        ));
    }
    Ok(Sole { name, link, corners_m })
}
