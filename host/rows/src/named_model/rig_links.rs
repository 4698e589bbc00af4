//! Models from the `[[link]]` tables of a rig file.

use std::path::Path;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};

use rigident_io::rig::{self, LinkTable, RigFile};
use rigident_model::finding::{Finding, ModelError};
use rigident_model::inertial::Parameters;
use rigident_model::tree::{Model, ModelLink, NO_BODY, RawLink};

/// Reads a rig file's tree.
///
/// # Errors
/// [`ModelError`] if the file cannot be read, has no `[[link]]`, or these make no tree.
pub fn read(path: &Path) -> Result<Model, ModelError> {
    let rig = RigFile::load(path).map_err(|error| ModelError::RigFile(error.to_string()))?;
    from_tables(&rig.link, &path.display().to_string())
}

/// Returns the tree of some tables; `what` names it in complaints.
///
/// # Errors
/// [`ModelError::Structure`] if they make no tree.
pub fn from_tables(tables: &[LinkTable], what: &str) -> Result<Model, ModelError> {
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    if tables.is_empty() {
        return Err(refuse("there is no [[link]] table in it; a tree needs one for each link".to_owned()));
    }
    let mut raw = Vec::new();
    for (n, table) in tables.iter().enumerate() {
        let kind = match (n, table.joint) {
            (0, _) => Joint::Free,
            (_, None) => {
                return Err(refuse(format!(
                    "[[link]] {}: needs its joint = \"fixed\", \"revolute\", \"continuous\", \"prismatic\", \
                     \"universal\", \"spherical\" or \"free\"",
                    table.name
                )));
            }
            (_, Some(joint)) => self::kind(joint, table).map_err(refuse)?,
        };
        let [w, x, y, z] = table.rotation_wxyz;
        let rotation: Matrix3<f64> =
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix().into_inner();
        let position = Vector3::from(table.position_m.unwrap_or_default());
        raw.push(RawLink {
            link: ModelLink::new(
                table.name.clone(),
                if n == 0 { String::new() } else { table.name.clone() },
                Link { parent: 0, joint: kind, rotation, position },
                nominal(table),
            ),
            parent: table.parent.clone(),
        });
    }
    let mut model = Model::assemble(what, raw, Vec::new())?;
    // A rig file need not say anything of masses: that is not strange.
    model.findings.retain(|finding| !finding.text.starts_with("has no mass"));
    let unplaced = tables.iter().filter(|table| table.position_m.is_none());
    let unplaced = unplaced.filter_map(|table| Some((table, table.parent.as_ref()?)));
    model.findings.extend(unplaced.map(|(table, parent)| Finding {
        place: format!("link {}", table.name),
        text: format!(
            "has no position_m in its [[link]] table: its joint is assumed at the origin of {parent}, [0, 0, \
             0] m; write it if that is so"
        ),
    }));
    Ok(model)
}

/// Returns the nominal parameters of a table about the link's origin.
fn nominal(table: &LinkTable) -> Option<Parameters> {
    let (mass, com) = (table.nominal_mass_kg?, table.nominal_com_m?);
    let tensor = tensor_from_elements(table.nominal_inertia_com_kgm2?);
    let body = InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::from_array(com), tensor);
    // Zeros say nothing of it.
    Some(body.to_vector()).filter(|phi| *phi != NO_BODY)
}

fn kind(joint: rig::Joint, table: &LinkTable) -> Result<Joint<f64>, String> {
    let axis = || {
        table
            .axis
            .map(Vector3::from)
            .ok_or_else(|| format!("[[link]] {}: needs its axis = [x, y, z]", table.name))
    };
    Ok(match joint {
        rig::Joint::Fixed => Joint::Fixed,
        rig::Joint::Revolute | rig::Joint::Continuous => Joint::Revolute(axis()?),
        rig::Joint::Prismatic => Joint::Prismatic(axis()?),
        rig::Joint::Universal => Joint::Universal(
            table.axis.map_or_else(Vector3::x, Vector3::from),
            table.second_axis.map_or_else(Vector3::y, Vector3::from),
        ),
        rig::Joint::Spherical => Joint::Spherical,
        rig::Joint::Free => Joint::Free,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rig_files_give_the_same_trees() {
        let text = r#"
[[link]]
name = "base"
[[link]]
name = "arm"
parent = "base"
joint = "universal"
position_m = [0.03, 0.0, 0.065]
[[link]]
name = "slide"
parent = "arm"
joint = "prismatic"
axis = [0, 0, 2]
"#;
        let rig = RigFile::parse(text).unwrap();
        let model = from_tables(&rig.link, "two.rig.toml").unwrap();
        assert_eq!(model.links[1].link.joint, Joint::Universal(Vector3::x(), Vector3::y()));
        assert_eq!(model.links[2].link.joint, Joint::Prismatic(Vector3::z()));
        assert_eq!(model.freedoms(), 3);
        let said = from_tables(&[], "two.rig.toml").unwrap_err().to_string();
        assert!(said.contains("no [[link]] table"), "{said}");
        let bare = text.replace("joint = \"universal\"\n", "");
        let rig = RigFile::parse(&bare).unwrap();
        let said = from_tables(&rig.link, "two.rig.toml").unwrap_err().to_string();
        assert!(said.contains("arm: needs its joint"), "{said}");
    }
}
